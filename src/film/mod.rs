//! Pictures as data: named layers of float planes, their names in files, and cryptomatte ranks.

mod ascii;
pub mod cryptomatte;
pub mod kind;
mod layers;
mod naming;
pub mod output;
mod picture;
mod plain;

pub use ascii::ascii_json;
pub use kind::{CAUSTIC, COMBINED, CRYPTOMATTES, LIGHT_GROUP, finished_part, kind_of, part_names};
pub use layers::{Layer, LayerSet, Plane, Role, Sample};
pub use naming::{Description, Naming, Selection, check, describe};
pub use picture::{Picture, Size, channel_mean};
pub use plain::take_plain_names;
