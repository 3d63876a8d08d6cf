//! Numerical limits: values that are not finite are rejected, counted and reported; sums and bandwidths keep their
//! digits over a million iterations; MIS weights sum to one for densities of any size.
//!
//! The bounds on errors are stated beside each check, and each check must reject the bug that it guards against.

mod crowds;
mod exact;
mod finish;
mod rejected;
mod rules;
mod sums;
mod weights;
