#![no_main]

caustique_fuzz::target!("exr");
