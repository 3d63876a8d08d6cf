#![no_main]

caustique_fuzz::target!("model");
