//! Rays and what they hit: the scene's geometry committed to Embree.
