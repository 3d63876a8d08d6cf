//! Code that integration tests share.
#![allow(dead_code)]

use caustique::bsdf::{Bsdf, EnergyTables, Interface, Parameters};
use caustique::render::{Control, Method, Rendered, Settings};
use caustique::scene::Scene;

/// The BSDF of `p`. Its interface is leaked, so it lives as long as the program.
pub fn bsdf(p: &Parameters, tables: &EnergyTables) -> Bsdf<'static> {
    Bsdf::new(p, Box::leak(Box::new(Interface::new(p, tables))))
}

/// Renders a picture of this side by a method. No path may be rejected.
pub fn render(scene: &Scene, method: Method, size: u32, settings: &Settings) -> Rendered {
    let camera = scene.camera(&scenes::square(size)).expect("a camera");
    let settings = Settings { method, ..settings.clone() };
    let rendered = caustique::render::render(scene, &camera, &settings, |_, _| Control::Continue);
    assert_eq!(rendered.rejected(), 0, "{method:?}");
    rendered
}

pub mod channels;
pub mod field;
pub mod glb;
pub mod onnx;
pub mod promises;
pub mod readers;
pub mod scenes;
pub mod stats;
pub mod tiles;
