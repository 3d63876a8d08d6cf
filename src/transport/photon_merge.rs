//! Photons that are merged with multiple importance sampling.

use super::bidirectional::{MergeLevels, Record, Technique};
use super::mis::{self, Merges, MisState};
use super::shares::Merged;
use super::vertex::Vertex;
use crate::bsdf::{LobeSet, Transport};
use crate::light::Group;
use crate::math::{Rgb, Vec3, is_lit};
use crate::photon::{Located, PhotonMap, same_surface};
use crate::plan::{CameraSuffix, ClassSet, LightPrefix, PathClass};
use crate::spectrum::Band;
use std::f32::consts::FRAC_1_PI;

/// A light-path vertex, as small as merging in the next pass allows.
#[derive(Clone, Copy, Debug)]
pub struct MergePhoton {
    /// World position.
    pub p: Vec3,
    /// Unit direction towards where the light came from.
    pub wi: Vec3,
    /// Unit geometric normal of the surface.
    pub ng: Vec3,
    /// Flux (W), already divided by the number of light paths of the pass.
    pub flux: Rgb,
    /// Partial sums of the weights: dVCM, and dVC's coefficients; the merges of a light path are of one kind.
    d_vcm: f32,
    plain: f32,
    merged: f32,
    /// Segments of the light path up to here.
    pub depth: u16,
    /// What has happened on the way here.
    pub prefix: LightPrefix,
    /// Of the light path's wavelength.
    band: Band,
    /// Of its light.
    group: Group,
}

impl Located for MergePhoton {
    #[inline]
    fn position(&self) -> Vec3 {
        self.p
    }

    #[inline]
    fn normal(&self) -> Vec3 {
        self.ng
    }

    #[inline]
    fn is_finite(&self) -> bool {
        self.p.is_finite() && self.flux.is_finite()
    }
}

/// A partial sum as a photon keeps it. What is too large for it leaves merging no weight, and may be anything large but
/// infinite, of which nothing would be no number.
#[inline]
fn single(sum: f64) -> f32 {
    sum.min(f64::from(f32::MAX)) as f32
}

impl MergePhoton {
    /// The photon that a light path leaves at `vertex`.
    #[inline]
    pub fn new(
        vertex: &Vertex<'_, '_>,
        flux: Rgb,
        (prefix, group): (LightPrefix, Group),
        mis: &MisState,
    ) -> MergePhoton {
        MergePhoton {
            p: vertex.surface.p,
            wi: vertex.wo,
            ng: vertex.surface.ng,
            flux,
            d_vcm: single(mis.d_vcm),
            plain: single(mis.plain),
            merged: single(mis.merged.y + mis.last.y),
            depth: vertex.depth.min(u32::from(u16::MAX)) as u16,
            prefix,
            band: Band::of(vertex.wavelength.as_ref()),
            group,
        }
    }

    /// Partial sums of the weights.
    #[inline]
    pub fn mis(&self) -> MisState {
        let [d_vcm, plain, merged] = [self.d_vcm, self.plain, self.merged].map(f64::from);
        MisState { d_vcm, plain, merged: Merges::new(0.0, merged), last: Merges::ZERO }
    }
}

/// Merges the photons around `vertex`, of all levels with one query: calls `add(class, level, radiance)`. Returns whether
/// all that was found is finite.
#[inline]
#[allow(clippy::too_many_arguments, reason = "what a merge needs, by reference")]
pub(super) fn merge_photons<R: Record>(
    (photons, levels): (&PhotonMap<MergePhoton>, &MergeLevels),
    vertex: &Vertex<'_, '_>,
    (mis, own): (&MisState, Merges),
    (suffix, classes): (CameraSuffix, ClassSet),
    longest: u32,
    record: &mut R,
    mut add: impl FnMut(PathClass, usize, Rgb),
) -> bool {
    let radii = levels.radius2();
    let mut finite = true;
    let Some(&largest) = radii.last() else { return finite };
    let (ng, shading) = (vertex.surface.ng, vertex.shading);
    let mut merged = Merged::new(vertex, suffix, classes);
    photons.within(vertex.surface.p, largest, |photon, distance2| {
        if !same_surface(photon, ng) || u32::from(photon.depth) > longest {
            return;
        }
        let meets =
            vertex.wavelength.as_ref().map_or(Some(Rgb::ONE), |wavelength| wavelength.connection_factor(photon.band));
        let Some(weight) = meets else { return };
        let (f, pdf) = shading.evaluate_cos(photon.wi, Transport::Radiance, LobeSet::ALL);
        // Photons measure irradiance on the geometric surface where they are, see `Shading::gather`: the cosine in f
        // belongs to a direction, not to them.
        let cosine = photon.wi.dot(photon.ng).abs();
        let value = vertex.throughput * f * photon.flux * weight / cosine;
        if cosine <= 0.0 || !is_lit(value) {
            finite &= cosine <= 0.0 || value.is_finite();
            return;
        }
        finite &= value.is_finite();
        let shares = merged.shares(photon.prefix, photon.wi, f);
        let reverse = shading.reverse_pdf(photon.wi, Transport::Importance, LobeSet::ALL);
        let ratios = mis::merge(&photon.mis(), mis, pdf, reverse, own);
        let technique = Technique::Merge { light: u32::from(photon.depth), camera: vertex.depth };
        record.contribution(technique, value, photon.p, ratios);
        for (level, (&radius2, &eta)) in radii.iter().zip(levels.eta()).enumerate() {
            if distance2 < radius2 {
                let weight = ratios.merge_weight(eta);
                for (class, share) in shares.iter() {
                    record.arrival(
                        technique,
                        (class, photon.group),
                        level,
                        value * share * (FRAC_1_PI / radius2),
                        weight,
                    );
                    add(class, level, value * share * (weight * FRAC_1_PI / radius2));
                }
            }
        }
    });
    finite
}
