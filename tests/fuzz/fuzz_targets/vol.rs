#![no_main]

caustique_fuzz::target!("vol");
