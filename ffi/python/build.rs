//! Leaves the symbols of Python to the process that loads the module, which the linker of macOS must be told.

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
