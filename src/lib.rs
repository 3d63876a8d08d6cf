//! caustique
