//! Multiple importance sampling of vertex connection and merging, accumulated along the walk.
//!
//! One function per equation of Georgiev, "Implementing Vertex Connection and Merging" (2012), numbers in brackets; it knows no scene. With
//! the balance heuristic all its partial sums are affine in `eta = pi r^2 n_VM / n_VC`, the one number that holds the merging radius. We
//! keep the two coefficients apart and put `eta` in when a weight is evaluated, so the radius may differ by pixel, level and pass, and photons
//! of one pass may be merged in the next. Since `dVM = dVC / eta` holds at the start and is kept by (34) and (35), one pair of coefficients serves
//! both. `eta = 0` is plain bidirectional path tracing; [`Eta::MERGE_ONLY`] leaves merging as the only strategy besides running into
//! lights.
//!
//! Roulette is left out of all densities: weights need only sum to one.

/// `pi r^2 n_VM / n_VC` \[Georgiev (20)\]: how much likelier a merge is than a connection per unit of density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eta(pub f32);

/// Partial sums at a vertex: `dVC = plain + eta * merged`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MisState {
    /// dVCM \[(31)\].
    pub d_vcm: f32,
    /// The part of dVC \[(32)\] without eta.
    pub plain: f32,
    /// The coefficient of eta in dVC.
    pub merged: f32,
}

impl MisState {
    /// dVC for an eta.
    #[inline]
    pub fn d_vc(&self, eta: Eta) -> f32 {
        self.plain + eta.0 * self.merged
    }

    /// A light path's first vertex \[(31), (32)\]: density of next-event estimation (per area for finite lights, per solid angle for those at
    /// infinity) and of emission, the choice of the light in both; `cos` at the light (1 at infinity); a delta light cannot be run into.
    #[inline]
    pub fn light(direct_pdf: f32, emission_pdf: f32, cos: f32, delta: bool) -> MisState {
        MisState { d_vcm: direct_pdf / emission_pdf, plain: if delta { 0.0 } else { cos / emission_pdf }, merged: 0.0 }
    }

    /// A camera path's first vertex \[(31)\]: `light_paths` per pixel-image over the camera's density per solid angle.
    #[inline]
    pub fn camera(light_paths: f32, camera_pdf_w: f32) -> MisState {
        MisState { d_vcm: light_paths / camera_pdf_w, plain: 0.0, merged: 0.0 }
    }

    /// Arrival at a surface \[(31) to (33), the conversion of measures\]: distance squared (1 on the first segment of light from infinity) and the
    /// cosine there.
    #[must_use]
    #[inline]
    pub fn arrive(self, distance2: f32, cos: f32) -> MisState {
        let inverse = 1.0 / cos;
        MisState { d_vcm: self.d_vcm * distance2 * inverse, plain: self.plain * inverse, merged: self.merged * inverse }
    }

    /// Departure by a non-delta lobe \[(34), (35)\]: cosine and densities per solid angle of the direction and of its reverse.
    /// `merges`: photons may be merged at this vertex.
    #[must_use]
    #[inline]
    pub fn scatter(self, cos: f32, pdf: f32, reverse_pdf: f32, merges: bool) -> MisState {
        let ratio = cos / pdf;
        MisState {
            d_vcm: 1.0 / pdf,
            plain: ratio * (self.plain * reverse_pdf + self.d_vcm),
            merged: ratio * (self.merged * reverse_pdf + if merges { 1.0 } else { 0.0 }),
        }
    }

    /// Departure by a delta lobe, whose forward and reverse densities cancel \[(53) to (55)\].
    #[must_use]
    #[inline]
    pub fn scatter_delta(self, cos: f32) -> MisState {
        MisState { d_vcm: 0.0, plain: self.plain * cos, merged: self.merged * cos }
    }
}

/// Weight of an eye path that runs into a light \[(43)\]: density of next-event estimation (per area) and of emission.
#[inline]
pub fn weight_hit(eye: &MisState, eta: Eta, direct_pdf_a: f32, emission_pdf: f32) -> f32 {
    1.0 / (1.0 + direct_pdf_a * eye.d_vcm + emission_pdf * eye.d_vc(eta))
}

/// Weight of next-event estimation \[(44), (45)\].
///
/// `bsdf_pdf`, `reverse_pdf`: densities at the eye vertex of the direction to the light and back; `light_pdf`: of next-event
/// estimation per solid angle (the choice of the light included); `emission_ratio`: emission density times the cosine at the eye vertex over
/// (light_pdf times the cosine at the light). A delta light cannot be run into.
#[inline]
pub fn weight_next_event(
    eye: &MisState,
    eta: Eta,
    bsdf_pdf: f32,
    reverse_pdf: f32,
    light_pdf: f32,
    emission_ratio: f32,
    delta: bool,
    merges: bool,
) -> f32 {
    let light = if delta { 0.0 } else { bsdf_pdf / light_pdf };
    let merge = if merges { eta.0 } else { 0.0 };
    let camera = emission_ratio * (merge + eye.d_vcm + eye.d_vc(eta) * reverse_pdf);
    1.0 / (light + 1.0 + camera)
}

/// Weight of connecting a light vertex to the camera \[(46), (47)\]: density per area at the vertex of the camera's rays, `light_paths` per
/// image, and the light vertex' reverse density of the direction back along its path.
#[inline]
pub fn weight_camera(light: &MisState, eta: Eta, camera_pdf_a: f32, light_paths: f32, reverse_pdf: f32, merges: bool) -> f32 {
    let merge = if merges { eta.0 } else { 0.0 };
    1.0 / (1.0 + camera_pdf_a / light_paths * (merge + light.d_vcm + light.d_vc(eta) * reverse_pdf))
}

/// Weight of connecting two vertices \[(40), (41)\]; densities per area at the other vertex, and reverse densities per solid angle.
#[allow(clippy::too_many_arguments)]
#[inline]
pub fn weight_connect(
    light: &MisState,
    eye: &MisState,
    eta: Eta,
    eye_pdf_a: f32,
    light_reverse_pdf: f32,
    light_merges: bool,
    light_pdf_a: f32,
    eye_reverse_pdf: f32,
    eye_merges: bool,
) -> f32 {
    let at = |merges: bool| if merges { eta.0 } else { 0.0 };
    let light_side = eye_pdf_a * (at(light_merges) + light.d_vcm + light.d_vc(eta) * light_reverse_pdf);
    let eye_side = light_pdf_a * (at(eye_merges) + eye.d_vcm + eye.d_vc(eta) * eye_reverse_pdf);
    1.0 / (light_side + 1.0 + eye_side)
}

/// Weight of merging a light vertex into an eye vertex \[(37) to (39)\]: densities at the eye vertex of the photon's direction
/// and of the reverse.
#[inline]
pub fn weight_merge(light: &MisState, eye: &MisState, eta: Eta, bsdf_pdf: f32, reverse_pdf: f32) -> f32 {
    let side = |state: &MisState, pdf: f32| state.d_vcm / eta.0 + state.d_vc(eta) / eta.0 * pdf;
    1.0 / (side(light, bsdf_pdf) + 1.0 + side(eye, reverse_pdf))
}
