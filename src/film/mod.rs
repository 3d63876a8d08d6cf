//! Pictures as data: named layers of float planes, their names in files, and cryptomatte ranks.

pub mod cryptomatte;
pub mod kind;
mod layers;
mod naming;
pub mod output;
mod picture;
mod selection;

pub use cryptomatte::ascii_json;
pub use kind::{
    CAUSTIC, COMBINED, CRYPTOMATTES, LIGHT_GROUP, LOBE_COLORS, LayerDescription, MOTION, current_name, describe,
    finished_part, former_name, is_effect, kind_of, lobe_names, part_names,
};
pub use layers::{Layer, LayerSet, Plane, Role, Sample};
pub use naming::{Naming, VIEW_LAYER, check_names, plain_name, take_plain_names};
pub use picture::{Picture, Size, channel_mean};
pub use selection::Selection;
