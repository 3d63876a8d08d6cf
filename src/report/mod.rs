//! Comparison of methods and settings by accuracy against time, and its report.
//!
//! [`equal_time`] renders every [`entry`] against a [`reference`](mod@reference), one iteration of each at a time, with
//! renders by other renderers ([`peer_renders`]) in between, and measures pictures at a geometric series of iterations. The
//! measurements give [`curve`]s, exponents to compare with [`theory`], the [`time to targets`](target) (Table 1 of \[CPPM
//! 2020\]), the [`overhead`] (Table 2 of \[post-reconstruction 2021\]) and [`crop`]s, which [`data`], [`plot`] and [`page`]
//! write.

pub mod crop;
pub mod curve;
pub mod data;
pub mod entry;
mod entry_run;
pub mod equal_time;
pub mod errors;
pub mod inside;
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
mod subject;
pub mod summary;
mod tables;
pub mod target;
pub mod theory;
pub mod verdict;
