//! Multiple importance sampling of vertex connection and merging, accumulated along the walk.
//!
//! One function per equation of Georgiev, "Implementing Vertex Connection and Merging" (2012), numbers in brackets; it
//! knows no scene. With the balance heuristic all partial sums are affine in `eta = pi r^2 n_VM / n_VC`, the one number
//! that holds the merging radius. We keep the two coefficients apart and put `eta` in when a weight is evaluated, so
//! the radius may differ by pixel, level and pass, and photons of one pass may be merged in the next. Since
//! `dVM = dVC / eta` holds at the start and is kept by (34) to (36), one pair of coefficients serves both.
//! [`Eta::NONE`] is bidirectional path tracing; [`Eta::MERGE_ONLY`] leaves merging as the only strategy.
//!
//! All photons merged at one vertex share the camera path up to there, and the balance heuristic counts them as if they
//! did not. Given the camera path they are independent: with `X` what one of `n` light paths brings,
//! `E[(sum X)^2] = n E[X^2] + n (n - 1) E[E[X | camera path]^2]`. `X` is nothing but where the light path lands in the
//! disc, with probability `N / n`, so the second term is about `N` times the first, and those merges are worth
//! `1 / (1 + N)` of what they are counted for: correlation-aware MIS \[Grittmann et al. 2021\]. Where all earlier
//! vertices of the camera path are delta, other camera paths of the pixel come to the same disc, nothing varies with them,
//! and a merge counts in full. So merges have two coefficients, [`Merges`]. Light paths know but one: behind each of
//! their vertices but the last merged the camera path has a vertex that is not delta.
//!
//! A camera path does not know yet whether what comes next is the light. Where direct light is not merged, the merge at
//! its last vertex must not count when it is: [`MisState::last`] keeps that term apart for one more vertex.
//!
//! A vertex in a medium is one whose cosine is 1, whose densities are per volume, and where nothing is merged; flight
//! through media multiplies the densities of both its ends ([`MisState::fly`]).
//!
//! Sums are in f64: densities are f32, and the products of those of a few vertices are not, where lamps are as small as
//! dust and lobes as sharp as glass.
//!
//! Roulette is left out of all densities: weights need only sum to one. Delta lobes count as if their forward and
//! reverse densities were equal \[(53) to (55)\], which neglects n^2 ratios, the same for all strategies.

use crate::light::EmissionDensity;
use crate::math::DVec2;
use crate::medium::FlightDensity;

/// Directions nearer to a surface (cosine) than this count as if they were this far from it: so near that f32 hardly
/// tells them from along it.
const MIN_COSINE: f32 = 1e-30;

/// `pi r^2 n_VM / n_VC` \[Georgiev (20)\]: how many merges there are for a connection, per unit of density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eta {
    value: f64,
    /// What a merge of either kind is worth, see [`Merges`].
    worth: Merges,
}

/// A number each for merges where all earlier vertices of the camera path are delta (`x`), and for those that share a path
/// which might have gone elsewhere (`y`).
pub type Merges = DVec2;

/// The merge of a vertex: `clear` says that all earlier vertices of the camera path are delta.
#[inline]
pub fn one_merge(clear: bool) -> Merges {
    if clear { DVec2::X } else { DVec2::Y }
}

impl Eta {
    /// Nothing is merged.
    pub const NONE: Eta = Eta { value: 0.0, worth: DVec2::ONE };
    /// Nothing but merging.
    pub const MERGE_ONLY: Eta = Eta { value: f64::INFINITY, worth: DVec2::ONE };

    /// `light_paths` of a pass merged within a squared radius, one connected; merges count as if they were independent.
    #[inline]
    pub fn new(radius2: f32, light_paths: f32) -> Eta {
        Eta { value: std::f64::consts::PI * f64::from(radius2) * f64::from(light_paths), worth: DVec2::ONE }
    }

    /// The same where so many photons of a pass are expected in a disc, all of one camera path.
    #[must_use]
    #[inline]
    pub fn sharing(self, photons: f32) -> Eta {
        Eta { worth: DVec2::new(1.0, 1.0 / (1.0 + f64::from(photons))), ..self }
    }
}

/// Densities of all strategies of a path over that of plain connection at the one in question: affine in eta.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ratios {
    /// The part without eta.
    pub plain: f64,
    /// The coefficients of eta.
    pub merged: Merges,
    /// Of a merge: its own part of the coefficients.
    pub own: Merges,
}

impl Ratios {
    /// No other strategy can do it.
    pub const ALONE: Ratios = Ratios { plain: 1.0, merged: DVec2::ZERO, own: DVec2::ZERO };

    /// Weight of any strategy but merging \[(37), the balance heuristic\].
    #[inline]
    pub fn weight(self, eta: Eta) -> f32 {
        let merged = self.merged.dot(eta.worth);
        // Without the test a path that cannot be merged would weigh 0 * infinity under MERGE_ONLY.
        let sum = if merged > 0.0 { self.plain + eta.value * merged } else { self.plain };
        (1.0 / sum) as f32
    }

    /// Weight of merging; eta above 0.
    #[inline]
    pub fn merge_weight(self, eta: Eta) -> f32 {
        (self.own.dot(eta.worth) / (self.merged.dot(eta.worth) + self.plain / eta.value)) as f32
    }
}

/// Partial sums at a vertex: `dVC = plain + eta * (merged + last)`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MisState {
    /// dVCM \[(31)\].
    pub d_vcm: f64,
    /// The part of dVC \[(32)\] without eta.
    pub plain: f64,
    /// The coefficients of eta in dVC, but for the merge at the vertex before.
    pub merged: Merges,
    /// The merge at the vertex before.
    pub last: Merges,
}

impl MisState {
    /// A light path's start \[(31), (32), (48) to (52)\]; next-event estimation is as probable as emission until
    /// [`MisState::received`] says otherwise. A delta light cannot be run into.
    #[inline]
    pub fn light(start: &EmissionDensity) -> MisState {
        let onward = f64::from(start.onward);
        let plain = if start.delta { 0.0 } else { f64::from(start.cos) / (f64::from(start.start) * onward) };
        MisState { d_vcm: 1.0 / onward, plain, ..MisState::default() }
    }

    /// A camera path's start \[(31)\]: light paths that are connected to the camera for every camera path of a pixel, over
    /// the density per solid angle of that camera path; 0 when the camera cannot be connected to.
    #[inline]
    pub fn camera(light_paths: f32, camera_pdf_w: f32) -> MisState {
        let d_vcm = if camera_pdf_w > 0.0 { f64::from(light_paths) / f64::from(camera_pdf_w) } else { 0.0 };
        MisState { d_vcm, ..MisState::default() }
    }

    /// Arrival at a vertex \[(31) to (33), the conversion of measures\]: distance squared (1 on the first segment of
    /// light from infinity) and the cosine there, 1 in a medium.
    #[must_use]
    #[inline]
    pub fn arrive(self, distance2: f32, cos: f32) -> MisState {
        // A ray along the surface must not make sums that are not numbers.
        let inverse = 1.0 / f64::from(cos.max(MIN_COSINE));
        MisState {
            d_vcm: self.d_vcm * f64::from(distance2) * inverse,
            plain: self.plain * inverse,
            merged: self.merged * inverse,
            last: self.last * inverse,
        }
    }

    /// At the first vertex: `chosen` is the probability that next-event estimation from there chooses the light over
    /// that of emission.
    #[must_use]
    #[inline]
    pub fn received(self, chosen: f32) -> MisState {
        MisState { d_vcm: self.d_vcm * f64::from(chosen), ..self }
    }

    /// Flight through media to where the path has arrived: densities per length, or probabilities, that all it takes
    /// besides direction has in both ways. They belong to the densities per area (per volume) of the vertices at both
    /// ends \[Georgiev (2), with the flight's factor as in Lafortune and Willems 1996\].
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

    /// Departure by a lobe that is not delta \[(34), (35)\]: cosine, and densities per solid angle of the direction and
    /// of its reverse. `merges`: the [`one_merge`] of this vertex, or none.
    #[must_use]
    #[inline]
    pub fn scatter(self, cos: f32, pdf_w: f32, reverse_pdf_w: f32, merges: Merges) -> MisState {
        let [cos, pdf_w, reverse_pdf_w] = [cos, pdf_w, reverse_pdf_w].map(f64::from);
        let ratio = cos / pdf_w;
        MisState {
            d_vcm: 1.0 / pdf_w,
            plain: ratio * (self.plain * reverse_pdf_w + self.d_vcm),
            merged: (self.merged + self.last) * (ratio * reverse_pdf_w),
            last: merges * ratio,
        }
    }

    /// Departure by a delta lobe, whose forward and reverse densities cancel \[(53) to (55)\].
    #[must_use]
    #[inline]
    pub fn scatter_delta(self, cos: f32) -> MisState {
        let cos = f64::from(cos);
        MisState { d_vcm: 0.0, plain: self.plain * cos, merged: (self.merged + self.last) * cos, last: DVec2::ZERO }
    }

    /// Densities of all strategies that end this side earlier, over that of ending here; `reverse_pdf_w` is the density
    /// of scattering back along the path.
    #[inline]
    fn earlier(&self, reverse_pdf_w: f32) -> Side {
        let reverse_pdf_w = f64::from(reverse_pdf_w);
        Side { plain: self.d_vcm + self.plain * reverse_pdf_w, merged: (self.merged + self.last) * reverse_pdf_w }
    }
}

/// One side's part of [`Ratios`].
#[derive(Clone, Copy)]
struct Side {
    plain: f64,
    merged: Merges,
}

/// A camera path that runs into a light \[(43)\]. For light from infinity: before the arrival \[5.1\]. Direct light is
/// never merged.
#[inline]
pub fn hit(camera: &MisState, light: &EmissionDensity) -> Ratios {
    let emission = f64::from(light.start) * f64::from(light.onward);
    let plain = 1.0 + f64::from(light.direct) * camera.d_vcm + emission * camera.plain;
    Ratios { plain, merged: camera.merged * emission, own: DVec2::ZERO }
}

/// Next-event estimation \[(44), (45)\].
///
/// `pdf_w`, `reverse_pdf_w`: densities at the camera vertex of the direction to the light and back; `light_pdf_w`: that of
/// next-event estimation (the choice of the light included); `arrival_pdf_a`: of emission from the light's point per
/// area of the camera vertex, the choice of the light over that of next-event estimation included. A delta light cannot be
/// run into. Direct light is never merged.
#[inline]
pub fn next_event(
    camera: &MisState,
    (pdf_w, reverse_pdf_w): (f32, f32),
    (light_pdf_w, arrival_pdf_a): (f32, f32),
    delta: bool,
) -> Ratios {
    let hit = if delta { 0.0 } else { f64::from(pdf_w) / f64::from(light_pdf_w) };
    let arrival_pdf_a = f64::from(arrival_pdf_a);
    let camera = camera.earlier(reverse_pdf_w);
    Ratios { plain: hit + 1.0 + arrival_pdf_a * camera.plain, merged: camera.merged * arrival_pdf_a, own: DVec2::ZERO }
}

/// A light vertex connected to the camera \[(46), (47)\]: density of a camera path's arrival per area there, over the
/// number of light paths connected; density of scattering back along the light path. What the camera sees directly is
/// not merged.
#[inline]
pub fn camera(light: &MisState, camera_pdf_a: f32, light_paths: f32, reverse_pdf_w: f32) -> Ratios {
    let light = light.earlier(reverse_pdf_w);
    let scale = f64::from(camera_pdf_a) / f64::from(light_paths);
    Ratios { plain: 1.0 + scale * light.plain, merged: light.merged * scale, own: DVec2::ZERO }
}

/// One side of a connection.
#[derive(Clone, Copy, Debug)]
pub struct End<'a> {
    /// Sums of its path.
    pub mis: &'a MisState,
    /// Density per solid angle of scattering back along its path.
    pub reverse_pdf_w: f32,
    /// Density per area at which the other end's path would arrive here.
    pub arrival_pdf_a: f32,
    /// The [`one_merge`] of the vertex, or none.
    pub merges: Merges,
}

/// Two vertices connected \[(40), (41)\].
#[inline]
pub fn connect(light: &End<'_>, camera: &End<'_>) -> Ratios {
    let (l, e) = (light.mis.earlier(light.reverse_pdf_w), camera.mis.earlier(camera.reverse_pdf_w));
    let (by_camera, by_light) = (f64::from(light.arrival_pdf_a), f64::from(camera.arrival_pdf_a));
    Ratios {
        plain: by_camera * l.plain + 1.0 + by_light * e.plain,
        merged: (l.merged + light.merges) * by_camera + (e.merged + camera.merges) * by_light,
        own: DVec2::ZERO,
    }
}

/// A light vertex merged into a camera vertex \[(38), (39)\]: densities there of scattering towards the photon's past and
/// towards the eye, and the vertex's [`one_merge`]. For [`Ratios::merge_weight`].
#[inline]
pub fn merge(light: &MisState, camera: &MisState, pdf_w: f32, reverse_pdf_w: f32, own: Merges) -> Ratios {
    let (l, e) = (light.earlier(pdf_w), camera.earlier(reverse_pdf_w));
    Ratios { plain: l.plain + e.plain, merged: own + l.merged + e.merged, own }
}
