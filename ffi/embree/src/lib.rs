//! Safe bindings to Intel Embree 3 and 4.
