#![no_main]

caustique_fuzz::target!("draco");
