//! Pictures as data: named layers of float planes, their names in files, and cryptomatte ranks.

mod ascii;
pub mod cryptomatte;
mod layers;
mod naming;
pub mod output;
mod plain;

pub use ascii::ascii_json;
pub use layers::{Layer, LayerSet, Plane, Role, Sample};
pub use naming::{CAUSTIC, COMBINED, Description, LIGHT_GROUP, Naming, Selection, check, describe};
pub use plain::take_plain_names;
