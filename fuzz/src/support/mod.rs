//! What tests and fuzz targets share.

#[path = "../../../tests/support/promises.rs"]
pub mod promises;
#[path = "../../../tests/support/readers.rs"]
pub mod readers;
