#![no_main]

caustique_fuzz::target!("ies");
