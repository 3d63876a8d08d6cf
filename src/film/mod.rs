//! Pictures as data: named layers of float planes, their names in files, and cryptomatte ranks.

mod ascii;
pub mod cryptomatte;
mod layers;
mod naming;
pub mod output;

pub use ascii::ascii_json;
pub use layers::{Layer, LayerSet, Plane, Role, Sample};
pub use naming::{Description, Naming, Selection, check, describe};
