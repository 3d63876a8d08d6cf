//! What tests and fuzz targets share.

#[path = "../../../support/promises.rs"]
pub mod promises;
#[path = "../../../support/readers.rs"]
pub mod readers;
