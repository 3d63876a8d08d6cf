//! The scene: read from a file into a plain [`Description`], then validated and committed into a [`Scene`].

pub mod description;

pub use description::Description;
