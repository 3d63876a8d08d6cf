#![no_main]

caustique_fuzz::target!("ktx2");
