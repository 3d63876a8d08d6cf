//! Tests of the physics: estimators against closed forms, each other and planted bugs. Every file declares its error
//! rate.

#[path = "../support/mod.rs"]
mod support;

mod agreement;
mod analytic;
mod bidirectional;
mod bsdf;
mod cameras;
mod catchers;
mod classes;
mod contact;
mod dispersion;
mod filters;
mod furnaces;
mod glints;
mod guide;
mod hidden;
mod lamps;
mod large_triangles;
mod light_groups;
mod links;
mod lobe_layers;
mod long_paths;
mod many_lights;
mod material;
mod media;
mod merging;
mod mis;
mod moments;
mod motion;
mod motion_files;
mod narrow_spots;
mod nesting;
mod open_space;
mod photon_mapping;
mod profiles;
mod progressive;
mod seen;
mod shadow_rays;
mod smoke;
mod splitting;
mod stability;
mod stopping;
mod unseen;
mod windows;
