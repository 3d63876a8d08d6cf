//! Support code of tests and fuzz targets.

#[path = "../../../support/promises.rs"]
pub mod promises;
#[path = "../../../support/readers.rs"]
pub mod readers;
