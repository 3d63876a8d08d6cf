//! Numbers at their limits: what is not finite is rejected, counted and told; sums and bandwidths keep their digits
//! over a million iterations; weights of densities of any size sum to one.
//!
//! Bounds on errors are stated beside each check, and each check is shown to reject what it guards against.

mod crowds;
mod exact;
mod finish;
mod rejected;
mod rules;
mod sums;
mod weights;
