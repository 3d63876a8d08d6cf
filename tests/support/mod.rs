//! Code that integration tests share.
#![allow(dead_code)]

use caustique::bsdf::{Bsdf, EnergyTables, Interface, Parameters};

/// The BSDF of `p`. Its interface is leaked, so it lives as long as the program.
pub fn bsdf(p: &Parameters, tables: &EnergyTables) -> Bsdf<'static> {
    Bsdf::new(p, Box::leak(Box::new(Interface::new(p, tables))))
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
