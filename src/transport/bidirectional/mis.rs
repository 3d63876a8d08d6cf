//! Multiple importance sampling weights of vertex connection and merging, accumulated along the walk.
//!
//! One function per equation of Georgiev, "Implementing Vertex Connection and Merging" (2012), with its number in
//! brackets; independent of the scene. With the balance heuristic all partial sums are affine in `eta = pi r^2 n_VM /
//! n_VC`, the only factor that contains the merging bandwidth. The two coefficients are kept separately, and `eta` is
//! inserted when a weight is evaluated. So the bandwidth may differ by pixel, level and iteration, and photons of one
//! iteration may be merged in the next. Since `dVM = dVC / eta` holds at the start and (34) to (36) preserve it, one
//! pair of coefficients serves both. [`Eta::NONE`] is bidirectional path tracing; [`Eta::MERGE_ONLY`] leaves merging as
//! the only technique.
//!
//! All photons merged at a vertex share the camera path, but the balance heuristic assumes independent samples. Given
//! the camera path they are independent: if `X` is the contribution of one of `n` light paths, `E[(sum X)^2]` is
//! `n E[X^2] + n (n - 1) E[E[X | camera path]^2]`. `X` is nonzero only if the light path ends in the disc, with
//! probability `N / n`. So the second term is about `N` times the first, and such merges are worth `1 / (1 + N)` of
//! independent ones:
//! correlation-aware MIS \[Grittmann et al. 2021\]. If all earlier vertices of the camera path are delta, all camera
//! paths of the pixel reach the same disc, and a merge counts in full. So there are two coefficients of merges,
//! [`Merges`]. Light paths need one only: for all their vertices except the last merged one, the camera path has a
//! vertex that is not delta.
//!
//! A camera path does not know whether the next vertex is on the light. Where direct light is not merged, the merge at
//! the last vertex before the light must not count. [`MisState::last`] keeps its term separate for one more vertex.
//!
//! A vertex in a medium has a cosine of 1 and densities per volume, and nothing is merged there. Flight through media
//! multiplies the densities at both ends ([`MisState::fly`]).
//!
//! Sums are in f64: densities are f32, but with tiny lights and sharp lobes products of a few of them exceed its range.
//!
//! Techniques may differ in their number of samples: `n` light paths, `c` light paths whose vertices each camera vertex
//! connects to, merges with some probability. With the balance heuristic every density is multiplied by its number of
//! samples. `n` enters the camera's dVCM and eta; the callers give `c` with the densities of connections, as `joins`:
//! how often the two last vertices of a subpath are joined by a technique. `d_vcm` does not contain it, because at the
//! last vertex of a subpath next-event estimation, which has one sample, may take the place of the connection.
//!
//! Densities do not contain roulette: weights only have to sum to one. Delta lobes count as if their forward and
//! reverse densities were equal \[(53) to (55)\]; this neglects factors of n^2, which are equal for all techniques.

use crate::light::EmissionDensity;
use crate::math::DVec2;
use crate::medium::FlightDensity;

/// Smaller cosines are treated as this one. f32 hardly resolves such directions.
const MIN_COSINE: f32 = 1e-30;

/// Factor of merging in MIS weights, `pi r^2 n_VM / n_VC` \[Georgiev (20)\]: number of merges per connection and unit
/// of density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eta {
    value: f64,
    /// Worth of a merge relative to an independent sample, see [`Merges`].
    worth: Merges,
}

/// A pair of coefficients of merging in MIS weights: for merges where all earlier vertices of the camera path are delta
/// (`x`), and for merges that share a random camera path (`y`).
pub type Merges = DVec2;

/// The coefficient pair of a single merge. `clear`: all earlier vertices of the camera path are delta.
#[inline]
pub fn one_merge(clear: bool) -> Merges {
    if clear { DVec2::X } else { DVec2::Y }
}

impl Eta {
    /// Eta of methods without merging.
    pub const NONE: Eta = Eta { value: 0.0, worth: DVec2::ONE };
    /// Eta of methods that have no technique but merging.
    pub const MERGE_ONLY: Eta = Eta { value: f64::INFINITY, worth: DVec2::ONE };

    /// Eta for merging within a squared bandwidth, where `light_paths` is the number of merged light paths of an iteration
    /// per connected one. Merges count as independent samples.
    #[inline]
    pub fn new(bandwidth2: f32, light_paths: f32) -> Eta {
        Eta { value: std::f64::consts::PI * f64::from(bandwidth2) * f64::from(light_paths), worth: DVec2::ONE }
    }

    /// Lowers the worth of merges, which are not independent. What a pixel shows by delta bounces alone merges with photons
    /// that the `pixels` within the disc share: their noise is one blot, which no mean over neighbours removes. Behind a
    /// random bounce, all `photons` that are expected in the disc share one camera path.
    #[must_use]
    #[inline]
    pub fn sharing(self, pixels: f32, photons: f32) -> Eta {
        Eta { worth: DVec2::ONE / (1.0 + DVec2::new(f64::from(pixels), f64::from(photons))), ..self }
    }
}

/// Densities of all techniques that sample a path, over the density of the technique at hand: affine in eta.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ratios {
    /// Coefficient without eta: the sum over techniques other than merging.
    pub plain: f64,
    /// Coefficients of eta: the sum over all merges.
    pub merged: Merges,
    /// Part of `merged` that belongs to the merge at hand, if the technique is merging.
    pub own: Merges,
}

impl Ratios {
    /// Ratios of a path that only one technique samples.
    pub const ALONE: Ratios = Ratios { plain: 1.0, merged: DVec2::ZERO, own: DVec2::ZERO };

    /// MIS weight of any technique except merging \[(37), balance heuristic\].
    #[inline]
    pub fn weight(self, eta: Eta) -> f32 {
        let merged = self.merged.dot(eta.worth);
        // Without the test, a path that cannot be merged would have the weight 0 * infinity under MERGE_ONLY.
        let sum = if merged > 0.0 { self.plain + eta.value * merged } else { self.plain };
        (1.0 / sum) as f32
    }

    /// MIS weight of merging; requires an eta above 0.
    #[inline]
    pub fn merge_weight(self, eta: Eta) -> f32 {
        (self.own.dot(eta.worth) / (self.merged.dot(eta.worth) + self.plain / eta.value)) as f32
    }
}

/// Partial sums of MIS weights at a vertex of a subpath: dVCM, and `dVC = plain + eta * (merged + last)`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MisState {
    /// The partial sum dVCM \[(31)\].
    pub d_vcm: f64,
    /// Part of the partial sum dVC \[(32)\] without eta.
    pub plain: f64,
    /// Coefficients of eta in dVC, without the merge at the previous vertex.
    pub merged: Merges,
    /// Coefficients of eta in dVC that belong to the merge at the previous vertex.
    pub last: Merges,
}

impl MisState {
    /// State at the start of a light path \[(31), (32), (48) to (52)\]. Next-event estimation and emission choose the
    /// light with equal probability until [`MisState::received`] is called. Camera paths cannot hit a delta light.
    #[inline]
    pub fn light(start: &EmissionDensity) -> MisState {
        let onward = f64::from(start.onward);
        let plain = if start.delta { 0.0 } else { f64::from(start.cos) / (f64::from(start.start) * onward) };
        MisState { d_vcm: 1.0 / onward, plain, ..MisState::default() }
    }

    /// State at the start of a camera path \[(31)\]. `light_paths` is the number of light paths connected to the camera
    /// per camera path of a pixel, `camera_pdf_w` the density of the camera path per solid angle; 0 if nothing can be
    /// connected to the camera.
    #[inline]
    pub fn camera(light_paths: f32, camera_pdf_w: f32) -> MisState {
        let d_vcm = if camera_pdf_w > 0.0 { f64::from(light_paths) / f64::from(camera_pdf_w) } else { 0.0 };
        MisState { d_vcm, ..MisState::default() }
    }

    /// State after arrival at a vertex \[(31) to (33), conversion of measures\]. `distance2` is the squared length of
    /// the segment (1 on the first segment of light from infinity), `cos` the cosine at the vertex, 1 in a medium.
    #[must_use]
    #[inline]
    pub fn arrive(self, distance2: f32, cos: f32) -> MisState {
        // A grazing ray must not give NaN.
        let inverse = 1.0 / f64::from(cos.max(MIN_COSINE));
        MisState {
            d_vcm: self.d_vcm * f64::from(distance2) * inverse,
            plain: self.plain * inverse,
            merged: self.merged * inverse,
            last: self.last * inverse,
        }
    }

    /// State corrected at the first vertex. `chosen` is the probability that next-event estimation there chooses the
    /// light, over the probability that emission does.
    #[must_use]
    #[inline]
    pub fn received(self, chosen: f32) -> MisState {
        MisState { d_vcm: self.d_vcm * f64::from(chosen), ..self }
    }

    /// State after flight through media up to the vertex, whose densities per length, or probabilities, in both
    /// directions are `flight`. They belong to the densities per area (per volume) of the vertices at both ends
    /// \[Georgiev (2), with the flight's factor as in Lafortune and Willems 1996\].
    #[must_use]
    #[inline]
    pub fn fly(self, flight: FlightDensity) -> MisState {
        let (forward, reverse) = (f64::from(flight.forward), f64::from(flight.reverse));
        let ratio = reverse / forward;
        MisState {
            d_vcm: self.d_vcm / forward,
            plain: self.plain * ratio,
            merged: self.merged * ratio,
            last: self.last * ratio,
        }
    }

    /// State after scattering by a lobe that is not delta \[(34), (35)\], from the cosine, and the densities per solid
    /// angle of the direction and of its reverse. `joins` is the number of samples of the technique that joins this
    /// vertex and the previous one. `merges` is the [`one_merge`] of this vertex, or zero.
    #[must_use]
    #[inline]
    pub fn scatter(self, cos: f32, pdf_w: f32, reverse_pdf_w: f32, joins: f64, merges: Merges) -> MisState {
        let [cos, pdf_w, reverse_pdf_w] = [cos, pdf_w, reverse_pdf_w].map(f64::from);
        let ratio = cos / pdf_w;
        MisState {
            d_vcm: 1.0 / pdf_w,
            plain: ratio * (self.plain * reverse_pdf_w + self.d_vcm * joins),
            merged: (self.merged + self.last) * (ratio * reverse_pdf_w),
            last: merges * ratio,
        }
    }

    /// State after scattering by a delta lobe, whose forward and reverse densities cancel \[(53) to (55)\].
    #[must_use]
    #[inline]
    pub fn scatter_delta(self, cos: f32) -> MisState {
        let cos = f64::from(cos);
        MisState { d_vcm: 0.0, plain: self.plain * cos, merged: (self.merged + self.last) * cos, last: DVec2::ZERO }
    }

    /// Densities of all techniques that end this subpath earlier, over the density of ending here. `reverse_pdf_w` is
    /// the density of scattering back along the subpath, `joins` the number of samples of the technique that joins the
    /// last two vertices.
    #[inline]
    fn earlier(&self, reverse_pdf_w: f32, joins: f64) -> Side {
        let reverse_pdf_w = f64::from(reverse_pdf_w);
        Side {
            plain: self.d_vcm * joins + self.plain * reverse_pdf_w,
            merged: (self.merged + self.last) * reverse_pdf_w,
        }
    }
}

/// The part of [`Ratios`] that comes from one subpath.
#[derive(Clone, Copy)]
struct Side {
    plain: f64,
    merged: Merges,
}

/// Ratios if a camera path hits a light \[(43)\]. For light from infinity, `camera` is the state before the arrival
/// \[5.1\]. Direct light is never merged.
#[inline]
pub fn hit(camera: &MisState, light: &EmissionDensity) -> Ratios {
    let emission = f64::from(light.start) * f64::from(light.onward);
    let plain = 1.0 + f64::from(light.direct) * camera.d_vcm + emission * camera.plain;
    Ratios { plain, merged: camera.merged * emission, own: DVec2::ZERO }
}

/// Probability densities that the MIS weight of next-event estimation needs.
#[derive(Clone, Copy, Debug)]
pub struct NextEventPdfs {
    /// Density of scattering towards the light, per solid angle.
    pub pdf_w: f32,
    /// Density of scattering from the light back along the camera path, per solid angle.
    pub reverse_pdf_w: f32,
    /// Density of the light sample per solid angle, including the choice of the light.
    pub light_pdf_w: f32,
    /// Density per area at the vertex of emission from the light sample, including the probability that emission chooses
    /// the light over the probability that next-event estimation does.
    pub arrival_pdf_a: f32,
    /// Whether the light is a delta light, which camera paths cannot hit.
    pub delta: bool,
}

/// Ratios of next-event estimation \[(44), (45)\]. Direct light is never merged. `joins` is the number of samples of the
/// technique that joins the last two vertices of the camera path.
#[inline]
pub fn next_event(camera: &MisState, joins: f64, pdfs: &NextEventPdfs) -> Ratios {
    let hit = if pdfs.delta { 0.0 } else { f64::from(pdfs.pdf_w) / f64::from(pdfs.light_pdf_w) };
    let arrival_pdf_a = f64::from(pdfs.arrival_pdf_a);
    let camera = camera.earlier(pdfs.reverse_pdf_w, joins);
    Ratios { plain: hit + 1.0 + arrival_pdf_a * camera.plain, merged: camera.merged * arrival_pdf_a, own: DVec2::ZERO }
}

/// Ratios if a light vertex is connected to the camera \[(46), (47)\]. `camera_pdf_a` is the density of a camera path's
/// arrival per area at the vertex, `light_paths` the number of connected light paths, `reverse_pdf_w` the density of
/// scattering back along the light path, `joins` the number of samples of the technique that joins its last two
/// vertices. Vertices that the camera sees directly are not merged.
#[inline]
pub fn camera(light: &MisState, joins: f64, camera_pdf_a: f32, light_paths: f32, reverse_pdf_w: f32) -> Ratios {
    let light = light.earlier(reverse_pdf_w, joins);
    let scale = f64::from(camera_pdf_a) / f64::from(light_paths);
    Ratios { plain: 1.0 + scale * light.plain, merged: light.merged * scale, own: DVec2::ZERO }
}

/// One of the two vertices that a connection joins.
#[derive(Clone, Copy, Debug)]
pub struct End<'a> {
    /// Partial sums of MIS weights of the subpath that ends at the vertex.
    pub mis: &'a MisState,
    /// Density per solid angle of scattering back along the subpath of the vertex.
    pub reverse_pdf_w: f32,
    /// Density per area at which the other end's subpath would arrive here.
    pub arrival_pdf_a: f32,
    /// Number of samples of the technique that joins the last two vertices of the subpath.
    pub joins: f64,
    /// Coefficients of a merge at the vertex ([`one_merge`]), or zero if nothing is merged there.
    pub merges: Merges,
}

/// Ratios if a light vertex and a camera vertex are connected \[(40), (41)\], where the camera vertex connects to
/// `connections` light paths.
#[inline]
pub fn connect(light: &End<'_>, camera: &End<'_>, connections: f64) -> Ratios {
    let [l, e] = [light, camera].map(|end| end.mis.earlier(end.reverse_pdf_w, end.joins));
    let [by_camera, by_light] = [light, camera].map(|end| f64::from(end.arrival_pdf_a) / connections);
    Ratios {
        plain: by_camera * l.plain + 1.0 + by_light * e.plain,
        merged: (l.merged + light.merges) * by_camera + (e.merged + camera.merges) * by_light,
        own: DVec2::ZERO,
    }
}

/// Ratios if a photon is merged with a camera vertex \[(38), (39)\], for [`Ratios::merge_weight`]. `pdf_w` and
/// `reverse_pdf_w` are the densities of scattering along the light path and back along the camera path; `joins` are the
/// numbers of samples of the techniques that join the last two vertices of light path and camera path; `own` is the
/// vertex's [`one_merge`].
#[inline]
pub fn merge(
    light: &MisState,
    camera: &MisState,
    joins: [f64; 2],
    pdf_w: f32,
    reverse_pdf_w: f32,
    own: Merges,
) -> Ratios {
    let (l, e) = (light.earlier(pdf_w, joins[0]), camera.earlier(reverse_pdf_w, joins[1]));
    Ratios { plain: l.plain + e.plain, merged: own + l.merged + e.merged, own }
}
