//! Vertices of light paths that camera vertices are connected to.

use super::mis::MisState;
use crate::bsdf::{LobeSet, Shading, Transport};
use crate::geometry::Surface;
use crate::light::Group;
use crate::math::{Rgb, Vec3};
use crate::medium::HenyeyGreenstein;
use crate::plan::LightPrefix;
use crate::scene::contact::ContactPoint;

/// How a light path's vertex scatters.
// Boxing the large variant would allocate once per vertex.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug)]
pub enum Scatterer<'s> {
    /// A surface.
    Surface(Surface, Shading<'s>),
    /// A point of a medium.
    Medium(Vec3, HenyeyGreenstein),
}

/// A light path's vertex that camera vertices can be connected to.
#[derive(Clone, Copy, Debug)]
pub struct LightVertex<'s> {
    /// Where and how it scatters.
    pub scatterer: Scatterer<'s>,
    /// Unit direction towards where the light came from.
    pub wo: Vec3,
    /// Flux (W) of the path as if it were the only one.
    pub throughput: Rgb,
    /// Number of segments up to here.
    pub depth: u32,
    /// Partial sums of the weights.
    pub mis: MisState,
    /// What has happened on the way here.
    pub prefix: LightPrefix,
    /// The path has taken a wavelength, the one its camera path takes if it does.
    pub dispersed: bool,
    /// Of its light.
    pub group: Group,
}

impl LightVertex<'_> {
    /// World position.
    #[inline]
    pub fn p(&self) -> Vec3 {
        match &self.scatterer {
            Scatterer::Surface(surface, _) => surface.p,
            Scatterer::Medium(p, _) => *p,
        }
    }

    /// Whether it is in a medium.
    #[inline]
    pub fn in_medium(&self) -> bool {
        matches!(self.scatterer, Scatterer::Medium(..))
    }

    /// Where a shadow ray of length `distance` ends that comes against `w`.
    #[inline]
    pub fn shadow_end(&self, w: Vec3, distance: f32) -> Vec3 {
        match &self.scatterer {
            Scatterer::Surface(surface, _) => surface.shadow_end(w, distance),
            Scatterer::Medium(p, _) => *p,
        }
    }

    /// The surface it is on, if others lie on that.
    #[inline]
    pub fn touching(&self) -> Option<ContactPoint> {
        match &self.scatterer {
            Scatterer::Surface(surface, _) => ContactPoint::touching(surface),
            Scatterer::Medium(..) => None,
        }
    }

    /// Geometric cosine of a direction; 1 in a medium.
    #[inline]
    pub fn cos(&self, w: Vec3) -> f32 {
        match &self.scatterer {
            Scatterer::Surface(surface, _) => w.dot(surface.ng).abs(),
            Scatterer::Medium(..) => 1.0,
        }
    }

    /// Its lobes that are not delta.
    #[inline]
    pub fn smooth(&self) -> LobeSet {
        match &self.scatterer {
            Scatterer::Surface(_, shading) => shading.bsdf.lobes() & LobeSet::SMOOTH,
            Scatterer::Medium(..) => LobeSet::BROAD,
        }
    }

    /// Scattering of its light into `wi` times the cosine, and the density of drawing `wi`.
    #[inline]
    pub fn evaluate_cos(&self, wi: Vec3) -> (Rgb, f32) {
        self.evaluate_set_cos(wi, LobeSet::ALL)
    }

    /// The same of some lobes; a medium has but one.
    #[inline]
    pub fn evaluate_set_cos(&self, wi: Vec3, set: LobeSet) -> (Rgb, f32) {
        match &self.scatterer {
            Scatterer::Surface(_, shading) => shading.evaluate_cos(wi, Transport::Importance, set),
            Scatterer::Medium(_, phase) => {
                let f = phase.pdf_w(self.wo, wi);
                (Rgb::splat(f), f)
            }
        }
    }

    /// Density with which a camera path that comes along `wi` would go back along the light path.
    #[inline]
    pub fn reverse_pdf(&self, wi: Vec3) -> f32 {
        match &self.scatterer {
            Scatterer::Surface(_, shading) => shading.reverse_pdf(wi, Transport::Radiance, LobeSet::ALL),
            Scatterer::Medium(_, phase) => phase.pdf_w(self.wo, wi),
        }
    }
}
