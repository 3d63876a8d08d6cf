//! Why samples are rejected.

/// Source of a value in a sample that is not finite; the sample is rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The throughput of the camera path.
    Path,
    /// A light that the camera path has hit.
    Emission,
    /// Light from next-event estimation, on surfaces or in media.
    DirectLight,
    /// Light from a light vertex connected to the camera path.
    Connection,
    /// Light from photons, gathered or merged.
    Photons,
    /// Light from a light vertex connected to the camera.
    Splat,
    /// A MIS weight, or the sum of finite values.
    Sum,
}

impl Cause {
    /// All causes, in the order of their values.
    pub const ALL: [Cause; 7] =
        [Cause::Path, Cause::Emission, Cause::DirectLight, Cause::Connection, Cause::Photons, Cause::Splat, Cause::Sum];

    /// Name of the cause in headers of pictures.
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
