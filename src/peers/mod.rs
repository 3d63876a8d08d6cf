//! Renders our scenes with other renderers: Mitsuba, LuxCore and Cycles, each run by a Python script.
//!
//! The scripts (`scripts/compare/peers`) are compiled into the program, like the USD converter, so that they have its
//! version and are always found. `driver.py` there documents their command line and reply.

mod drivers;
mod process;
mod python;

pub use drivers::{Drivers, Rendering, Reply, Task};
pub use process::Stop;

/// Another renderer, to which caustique is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Renderer {
    /// Mitsuba 3: path tracing
    Mitsuba,
    /// LuxCoreRender: path tracing, the same with its caustic cache, and bidirectional
    Luxcore,
    /// Blender's Cycles: path tracing
    Cycles,
}

/// Another renderer in one of its modes, to which caustique is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Peer {
    /// The renderer.
    pub renderer: Renderer,
    /// Name of the renderer's mode, as its driver script expects it.
    pub mode: &'static str,
    /// Name of renderer and mode in reports.
    pub name: &'static str,
}

impl Renderer {
    /// The modes of this renderer that are compared.
    pub fn peers(self) -> Vec<Peer> {
        let names: &[(&str, &str)] = match self {
            Renderer::Mitsuba => &[("path", "Mitsuba")],
            Renderer::Luxcore => {
                &[("path", "LuxCore path"), ("path_cache", "LuxCore cache"), ("bidir", "LuxCore bidir")]
            }
            Renderer::Cycles => &[("path", "Cycles")],
        };
        names.iter().map(|&(mode, name)| Peer { renderer: self, mode, name }).collect()
    }

    /// File name of the renderer's driver, the Python script that runs it.
    fn driver(self) -> &'static str {
        match self {
            Renderer::Mitsuba => "mitsuba_driver.py",
            Renderer::Luxcore => "luxcore_driver.py",
            Renderer::Cycles => "cycles_driver.py",
        }
    }
}
