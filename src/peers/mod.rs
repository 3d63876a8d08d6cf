//! Other renderers on our scenes: Mitsuba, LuxCore and Cycles, each driven by a script in Python. The scripts
//! (`scripts/compare`) are part of the program as the converter of USD is, so that they are those of its version and are
//! found wherever it lies. What both say to each other is in `scripts/compare/peers/driver.py`.

mod drivers;
mod process;
mod python;

pub use drivers::{Answer, Drivers, Rendering, Task};
pub use process::Stop;

/// A renderer.
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

/// A renderer in one of its ways.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Peer {
    /// Which renderer.
    pub renderer: Renderer,
    /// What its driver calls the way.
    pub mode: &'static str,
    /// What reports call it.
    pub name: &'static str,
}

impl Renderer {
    /// Its ways that are compared.
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

    /// Its driver's file.
    fn driver(self) -> &'static str {
        match self {
            Renderer::Mitsuba => "mitsuba_driver.py",
            Renderer::Luxcore => "luxcore_driver.py",
            Renderer::Cycles => "cycles_driver.py",
        }
    }
}
