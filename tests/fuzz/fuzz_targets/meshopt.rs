#![no_main]

caustique_fuzz::target!("meshopt");
