#![no_main]

caustique_fuzz::target!("exr_environment");
