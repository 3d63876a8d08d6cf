//! Vertices of light paths to which camera vertices are connected.

use super::mis::MisState;
use crate::bsdf::{LobeSet, Shading, Transport};
use crate::geometry::Surface;
use crate::light::Group;
use crate::math::{Rgb, Vec3};
use crate::medium::HenyeyGreenstein;
use crate::path_class::LightPrefix;
use crate::scene::contact::ContactPoint;
use crate::transport::walk::interior::Presence;

/// Scattering at a light vertex.
#[derive(Clone, Copy, Debug)]
pub enum Scatterer<'s> {
    /// A surface point with its BSDF. References keep light vertices small, which are moved as their number grows.
    Surface(&'s Surface, &'s Shading<'s>),
    /// A point in a medium with its phase function.
    Medium(Vec3, HenyeyGreenstein),
}

/// A vertex of a light path to which camera vertices are connected.
#[derive(Clone, Copy, Debug)]
pub struct LightVertex<'s> {
    /// Position and scattering.
    pub scatterer: Scatterer<'s>,
    /// Unit direction towards the previous vertex.
    pub wo: Vec3,
    /// Flux (W) as if the path were the only one.
    pub throughput: Rgb,
    /// Number of path segments up to the vertex.
    pub depth: u32,
    /// Partial sums of MIS weights of the light path at the vertex.
    pub mis: MisState,
    /// Class of the light path up to the vertex: the kinds of its bounces.
    pub prefix: LightPrefix,
    /// Whether the path has a wavelength because it has met dispersive glass; its camera path uses the same one.
    pub dispersed: bool,
    /// Light group of the light that the path starts from.
    pub group: Group,
    /// What alpha has decided about the solids on the side of `wo`, and on the other side of the surface.
    pub presence: [Presence; 2],
    /// Probability of the decisions that a camera vertex joined with the vertex before this one would repeat.
    pub chance_before: f32,
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

    /// Whether the vertex is in a medium.
    #[inline]
    pub fn in_medium(&self) -> bool {
        matches!(self.scatterer, Scatterer::Medium(..))
    }

    /// End of a shadow ray of length `distance` that arrives against `w`.
    #[inline]
    pub fn shadow_end(&self, w: Vec3, distance: f32) -> Vec3 {
        match &self.scatterer {
            Scatterer::Surface(surface, _) => surface.shadow_end(w, distance),
            Scatterer::Medium(p, _) => *p,
        }
    }

    /// The point of the vertex on its surface, if other surfaces touch it there.
    #[inline]
    pub fn touching(&self) -> Option<ContactPoint> {
        match &self.scatterer {
            Scatterer::Surface(surface, _) => ContactPoint::touching(surface),
            Scatterer::Medium(..) => None,
        }
    }

    /// Absolute cosine between `w` and the geometric normal; 1 in a medium.
    #[inline]
    pub fn cos(&self, w: Vec3) -> f32 {
        match &self.scatterer {
            Scatterer::Surface(surface, _) => w.dot(surface.ng).abs(),
            Scatterer::Medium(..) => 1.0,
        }
    }

    /// The lobes of the vertex that are not delta.
    #[inline]
    pub fn smooth(&self) -> LobeSet {
        match &self.scatterer {
            Scatterer::Surface(_, shading) => shading.bsdf.lobes() & LobeSet::SMOOTH,
            Scatterer::Medium(..) => LobeSet::BROAD,
        }
    }

    /// Value of all lobes for light scattered into `wi`, times the cosine, and the density of sampling `wi`.
    #[inline]
    pub fn evaluate_cos(&self, wi: Vec3) -> (Rgb, f32) {
        self.evaluate_set_cos(wi, LobeSet::ALL)
    }

    /// Value of the lobes in `set` for light scattered into `wi`, times the cosine, and the density of sampling `wi`.
    /// In a medium `set` is ignored.
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

    /// What alpha has decided about the solids on the side of `w`.
    #[inline]
    pub fn presence(&self, w: Vec3) -> Presence {
        let crosses = match &self.scatterer {
            Scatterer::Surface(surface, _) => w.dot(surface.ng) * self.wo.dot(surface.ng) < 0.0,
            Scatterer::Medium(..) => false,
        };
        self.presence[usize::from(crosses)]
    }

    /// Probability of the decisions of alpha that a camera path merged at this vertex would repeat.
    #[inline]
    pub fn merge_chance(&self) -> f64 {
        let [here, behind] = self.presence;
        f64::from(here.chance.min(behind.chance))
    }

    /// Density with which a camera path that arrives along `wi` would continue along the light path.
    #[inline]
    pub fn reverse_pdf(&self, wi: Vec3) -> f32 {
        match &self.scatterer {
            Scatterer::Surface(_, shading) => shading.reverse_pdf(wi, Transport::Radiance, LobeSet::ALL),
            Scatterer::Medium(_, phase) => phase.pdf_w(self.wo, wi),
        }
    }
}
