#![no_main]

caustique_fuzz::target!("usd_options");
