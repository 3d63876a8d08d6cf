//! Why samples are rejected.

/// What has brought a sample something that is not finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The camera path itself: its weight.
    Path,
    /// A light that the camera path has run into.
    Emission,
    /// Next-event estimation, on surfaces or in media.
    DirectLight,
    /// A light path's vertex connected to the camera path.
    Connection,
    /// Photons, gathered or merged.
    Photons,
    /// A light path's vertex connected to the camera.
    Splat,
    /// Nothing alone: a weight, or the sum of what was finite.
    Sum,
}

impl Cause {
    /// All of them, in their order.
    pub const ALL: [Cause; 7] =
        [Cause::Path, Cause::Emission, Cause::DirectLight, Cause::Connection, Cause::Photons, Cause::Splat, Cause::Sum];

    /// Its name in headers.
    pub fn name(self) -> &'static str {
        match self {
            Cause::Path => "path",
            Cause::Emission => "emission",
            Cause::DirectLight => "direct_light",
            Cause::Connection => "connection",
            Cause::Photons => "photons",
            Cause::Splat => "splat",
            Cause::Sum => "sum",
        }
    }
}
