//! Merging of photons with multiple importance sampling.

use super::mis::{self, Merges, MisState};
use super::shares::PhotonShares;
use super::{MergeLevels, PathKind, PathRecorder, Technique};
use crate::bsdf::{LobeSet, Transport};
use crate::light::Group;
use crate::math::{Rgb, Vec3, is_lit};
use crate::path_class::{CameraSuffix, ClassSet, LightPrefix, PathClass};
use crate::photon::{Located, PhotonMap, same_surface};
use crate::spectrum::Band;
use crate::transport::walk::interior::Presence;
use crate::transport::walk::lobe_layers::{FirstScatter, LobeHistory};
use crate::transport::walk::pixel_sample::INNER_AREAS;
use crate::transport::walk::scattering_vertex::ScatterPoint;
use crate::transport::walk::vertex::Vertex;
use std::f32::consts::FRAC_1_PI;

/// A photon for merging in the next iteration: a light vertex, reduced to the data that this needs.
#[derive(Clone, Copy, Debug)]
pub struct MergePhoton {
    /// World position.
    pub p: Vec3,
    /// Unit direction towards the previous vertex of the light path.
    pub wi: Vec3,
    /// Unit geometric normal of the surface.
    pub ng: Vec3,
    /// Flux (W), already divided by the number of merged light paths of the iteration.
    pub flux: Rgb,
    /// Partial sums of MIS weights: dVCM times its number of samples, and the coefficients of dVC. On light paths all
    /// merges count with one coefficient.
    d_vcm: f32,
    plain: f32,
    merged: f32,
    /// Number of segments of the light path up to the photon.
    pub depth: u16,
    /// Class of the light path up to the photon: the kinds of its bounces.
    pub prefix: LightPrefix,
    /// Band of the light path's wavelength; 0 for a path without one, which has not met dispersive glass.
    band: Band,
    /// Light group of the light that the path starts from.
    group: Group,
    /// Code of the solids around that alpha lets not exist for the light path ([`Presence::absent`]).
    absent: u8,
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

/// A partial sum of MIS weights as a photon stores it. Merging has no weight against larger sums, so they are clamped;
/// infinity times zero would give NaN.
#[inline]
fn single(sum: f64) -> f32 {
    sum.min(f64::from(f32::MAX)) as f32
}

impl MergePhoton {
    /// The photon that a light path leaves at `vertex`. `joins` is the number of samples of the technique that joins the
    /// last two vertices of the light path, `presence` what alpha has decided for it to end there.
    #[inline]
    pub fn new(
        vertex: &Vertex<'_, '_>,
        flux: Rgb,
        prefix: LightPrefix,
        group: Group,
        mis: &MisState,
        joins: f64,
        presence: Presence,
    ) -> MergePhoton {
        MergePhoton {
            p: vertex.surface.p,
            wi: vertex.wo,
            ng: vertex.surface.ng,
            flux: flux / presence.chance,
            d_vcm: single(mis.d_vcm * joins),
            plain: single(mis.plain),
            merged: single(mis.merged.y + mis.last.y),
            depth: vertex.depth.min(u32::from(u16::MAX)) as u16,
            prefix,
            band: Band::of_wavelength(vertex.wavelength.as_ref()),
            group,
            absent: presence.absent,
        }
    }

    /// Partial sums of MIS weights of the light path at the photon, whose dVCM contains its number of samples.
    #[inline]
    pub fn mis(&self) -> MisState {
        let [d_vcm, plain, merged] = [self.d_vcm, self.plain, self.merged].map(f64::from);
        MisState { d_vcm, plain, merged: Merges::new(0.0, merged), last: Merges::ZERO }
    }
}

/// Data for merging photons at one vertex of a camera path.
pub(in crate::transport) struct Merge<'a> {
    pub photons: &'a PhotonMap<MergePhoton>,
    pub levels: &'a MergeLevels,
    /// Partial sums of MIS weights of the camera path at the vertex.
    pub mis: &'a MisState,
    /// Number of samples of the technique that joins the last two vertices of the camera path.
    pub joins: f64,
    /// Code of the solids around the vertex that alpha lets not exist ([`Presence::absent`]).
    pub absent: u8,
    /// Coefficients with which a merge at this vertex counts in MIS weights ([`mis::one_merge`]).
    pub own: Merges,
    /// Class of the camera path up to the vertex: the kinds of its bounces.
    pub suffix: CameraSuffix,
    /// The first vertex of the camera path, if light is recorded by its lobes.
    pub lobes: Option<&'a LobeHistory>,
    /// Path classes (by kinds of bounces) that the picture shows.
    pub classes: ClassSet,
    /// Largest number of segments of a photon's light path.
    pub longest: u32,
}

impl Merge<'_> {
    /// Merges the photons around `vertex` at all bandwidth levels with one query. Calls `add(class, level, radiance)`
    /// for each contribution, and adds the difference that shows the bias of one bandwidth to `difference`
    /// ([`crate::transport::PixelSample::merge_difference`]). Returns whether all contributions are finite.
    #[inline]
    pub fn run<R: PathRecorder>(
        &self,
        vertex: &Vertex<'_, '_>,
        record: &mut R,
        mut add: impl FnMut(PathClass, usize, Rgb),
        difference: &mut Rgb,
    ) -> bool {
        let bandwidths = self.levels.bandwidth2();
        let mut finite = true;
        let Some(&largest) = bandwidths.last() else { return finite };
        let (ng, shading) = (vertex.surface.ng, vertex.shading);
        let mut photon_shares = PhotonShares::new(vertex, self.suffix, self.classes);
        self.photons.within(vertex.surface.p, largest, |photon, distance2| {
            if !same_surface(photon, ng) || u32::from(photon.depth) > self.longest || photon.absent != self.absent {
                return;
            }
            let wavelength = vertex.wavelength.as_ref();
            let factor = wavelength.map_or(Some(Rgb::ONE), |wavelength| wavelength.connection_factor(photon.band));
            let Some(weight) = factor else { return };
            let (f, pdf) = shading.evaluate_cos(photon.wi, Transport::Radiance, LobeSet::ALL);
            // Photons represent irradiance on the geometric surface at their own position, see `Shading::gather`. The
            // cosine in `f` belongs to the vertex.
            let cosine = photon.wi.dot(photon.ng).abs();
            let value = vertex.throughput * f * photon.flux * weight / cosine;
            if cosine <= 0.0 || !is_lit(value) {
                finite &= cosine <= 0.0 || value.is_finite();
                return;
            }
            finite &= value.is_finite();
            let shares = photon_shares.shares(photon.prefix, photon.wi, f);
            let reverse = shading.reverse_pdf(photon.wi, Transport::Importance, LobeSet::ALL);
            let ratios = mis::merge(&photon.mis(), self.mis, [1.0, self.joins], pdf, reverse, self.own);
            let technique = Technique::Merge { light: u32::from(photon.depth), camera: vertex.depth };
            record.contribution(technique, value, photon.p, ratios);
            let here = || vertex.first_scatter(photon.wi, Transport::Radiance, LobeSet::ALL, f);
            let first = self.lobes.map_or(FirstScatter::Emit, |lobes| lobes.arriving(here));
            for (level, (&bandwidth2, &eta)) in bandwidths.iter().zip(self.levels.eta()).enumerate() {
                if distance2 < bandwidth2 {
                    let weight = ratios.merge_weight(eta);
                    let area = bandwidth2 * self.levels.probability();
                    let inner = f32::from(distance2 * INNER_AREAS < bandwidth2);
                    for (class, share) in shares.iter() {
                        let light = value * share * (FRAC_1_PI / area);
                        let of = PathKind { class, group: photon.group, first };
                        record.arrival(technique, of, level, light, weight);
                        let radiance = value * share * (weight * FRAC_1_PI / area);
                        add(class, level, radiance);
                        *difference += radiance * (1.0 / INNER_AREAS - inner);
                    }
                }
            }
        });
        finite
    }
}
