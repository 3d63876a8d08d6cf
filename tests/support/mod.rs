//! What integration tests share.
#![allow(dead_code)]

pub mod glb;
pub mod scenes;
pub mod stats;
