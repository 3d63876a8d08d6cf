//! Accuracy against time: several methods and settings in one run, and the report on it.
//!
//! [`race`] renders the [`entry`] list against a [`reference`](mod@reference), one iteration of each at a time, with
//! [`peers`] (other renderers) in between, and measures pictures at a geometric series of moments. From the points come
//! [`curve`]s, exponents beside [`theory`], the [`time to targets`](target) (Table 1 of \[CPPM 2020\]), the [`overhead`]
//! (Table 2 of \[post-reconstruction 2021\]) and [`crop`]s; [`data`], [`plot`] and [`page`] write them down.

pub mod crop;
pub mod curve;
pub mod data;
pub mod entry;
mod entry_run;
pub mod equal_time;
pub mod errors;
pub mod number;
mod outcome;
pub mod overhead;
pub mod page;
pub mod peer_renders;
mod picture_store;
pub mod plot;
pub mod point;
pub mod reference;
mod strips;
pub mod summary;
mod tables;
pub mod target;
pub mod theory;
