//! The BSDF model: a fixed set of lobes that follows the glTF specification and conserves energy.

mod anisotropic;
mod coat;
mod cover;
mod dielectric;
mod energy;
mod facing;
mod film;
mod fresnel;
mod gathering;
mod interface;
mod layered;
mod lobe_shares;
mod microfacet;
mod parameters;
mod profile;
mod relief;
mod rough_diffuse;
mod scatter;
mod shading;
mod sheen;

pub use cover::{coat_reflectance, mean_path};
pub use energy::EnergyTables;
pub use gathering::Gathering;
pub use interface::Interface;
pub use layered::Layered;
pub use microfacet::refraction_width;
pub use parameters::Parameters;
pub use shading::Shading;
pub use sheen::SheenModel;

use crate::math::{Rgb, Vec2, Vec3, warp};
use bitflags::bitflags;
use layered::ViewTerms;
use profile::Profile;
use std::f32::consts::FRAC_1_PI;

bitflags! {
    /// A set of lobe classes: delta, sharp, broad. The class of a lobe decides which technique carries the light that
    /// it scatters.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
    pub struct LobeSet: u8 {
        /// Perfect mirrors and clear interfaces. A path can only continue there.
        const DELTA = 1;
        /// Glossy lobes that are too narrow to gather photons (GGX alpha below [`SHARP_ALPHA`], for solid glass scaled
        /// by [`refraction_width`]). A camera path continues there.
        const SHARP = 2;
        /// Diffuse lobes, sheen and wide glossy lobes. Photons are gathered there.
        const BROAD = 4;
        /// All classes except delta lobes: lobes that can be evaluated for a given direction.
        const SMOOTH = 6;
        /// All lobe classes.
        const ALL = 7;
    }
}

/// GGX alpha (perceptual roughness squared) below which a glossy lobe is [`LobeSet::SHARP`].
pub const SHARP_ALPHA: f32 = 0.2;

/// GGX alpha below which a lobe is a perfect mirror or a clear interface (perceptual roughness 0.03).
pub const DELTA_ALPHA: f32 = 1e-3;

/// The quantity that a path transports (PBRT's `TransportMode`). Refraction scales radiance by the squared ratio of the
/// indices, but not the flux of a light path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// The path starts at the camera, and BSDFs scale radiance.
    Radiance,
    /// The path starts at a light, and adjoint BSDFs scale flux.
    Importance,
}

impl Transport {
    /// The mode of a path in the opposite direction: radiance becomes importance, and the reverse.
    #[inline]
    fn reversed(self) -> Transport {
        match self {
            Transport::Radiance => Transport::Importance,
            Transport::Importance => Transport::Radiance,
        }
    }
}

/// A direction drawn from a BSDF.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Unit direction in the shading frame.
    pub wi: Vec3,
    /// The BSDF times |cos wi| over the density, for the requested set of lobes. For a delta lobe, its weight over the
    /// probability of choosing it.
    pub weight: Rgb,
    /// Density per solid angle of `wi` over the non-delta lobes of the set. For a delta lobe, the probability of
    /// choosing it.
    pub pdf_w: f32,
    /// Class of the lobe that was sampled (exactly one).
    pub lobe: LobeSet,
    /// Whether `wi` is on the other side of the surface than `wo`.
    pub transmitted: bool,
}

/// The BSDF of a surface point in its shading frame. The z axis is the shading normal on the front; directions point
/// away from the surface.
#[derive(Clone, Copy, Debug)]
pub enum Bsdf<'a> {
    /// Lambertian reflection of this colour on both sides.
    Matte(Rgb),
    /// The layered model: metal, matte surface and glass below coat and sheen.
    Layered(Layered<'a>),
}

/// Value and density over `set` of Lambertian reflection of colour `color`, from the cosines of both directions, `view`
/// and `lit`, with the normal on the side of the viewer.
#[inline(always)]
fn lambert(color: Rgb, view: f32, lit: f32, set: LobeSet) -> (Rgb, f32) {
    if view > 0.0 && lit > 0.0 && set.intersects(LobeSet::BROAD) && color.max_element() > 0.0 {
        (color * FRAC_1_PI, lit * FRAC_1_PI)
    } else {
        (Rgb::ZERO, 0.0)
    }
}

impl<'a> Bsdf<'a> {
    /// The BSDF that `parameters` describe, with the interface made from them.
    pub fn new(parameters: &Parameters, interface: &'a Interface<'a>) -> Bsdf<'a> {
        Bsdf::from_shares(parameters.base_color, parameters.metallic, parameters.transmission, interface)
    }

    /// The BSDF of a surface with this base colour, metalness (0 to 1), transmission (0 to 1) and interface.
    #[inline(always)]
    pub fn from_shares(base: Rgb, metallic: f32, transmission: f32, interface: &'a Interface<'a>) -> Bsdf<'a> {
        if metallic == 0.0 && transmission == 0.0 && interface.invisible {
            Bsdf::Matte(base)
        } else {
            Bsdf::Layered(Layered::new(base, metallic, transmission, interface))
        }
    }

    /// Whether a lobe other than a delta lobe transmits light.
    #[inline]
    pub fn transmits(&self) -> bool {
        matches!(self, Bsdf::Layered(layered) if layered.glass > 0.0 || layered.transmits_diffusely())
    }

    /// Classes (delta, sharp, broad) of the lobes that scatter light.
    #[inline]
    pub fn lobes(&self) -> LobeSet {
        match self {
            Bsdf::Matte(color) if color.max_element() > 0.0 => LobeSet::BROAD,
            Bsdf::Matte(_) => LobeSet::empty(),
            Bsdf::Layered(layered) => layered.lobes,
        }
    }

    /// Whether the BSDF may have several lobes, among which [`Bsdf::sample`] chooses by its random number.
    #[inline]
    pub fn has_several_lobes(&self) -> bool {
        matches!(self, Bsdf::Layered(_))
    }

    /// The terms of the BSDF that depend only on the viewing direction `wo`.
    #[inline(always)]
    fn view_terms(&self, wo: Vec3) -> ViewTerms {
        match self {
            Bsdf::Matte(_) => ViewTerms::plain(wo),
            Bsdf::Layered(layered) => layered.view_terms(wo),
        }
    }

    /// Value (1/sr, without cosine) of the non-delta lobes of `set`, and the density per solid angle with which
    /// [`Bsdf::sample`] draws `wi` for `wo` and `set`.
    ///
    /// With [`Transport::Radiance`], light from `wi` leaves along `wo` to the camera. With [`Transport::Importance`],
    /// light from `wo` leaves along `wi`. The two differ only for refraction: with n the index on the side of a
    /// direction, `f_radiance(o, i) = f_importance(i, o) = f_importance(o, i) n_o^2 / n_i^2`.
    #[inline]
    pub fn evaluate(&self, wo: Vec3, wi: Vec3, transport: Transport, set: LobeSet) -> (Rgb, f32) {
        match self {
            Bsdf::Matte(color) => lambert(*color, wo.z.abs(), if wo.z < 0.0 { -wi.z } else { wi.z }, set),
            Bsdf::Layered(layered) => layered.evaluate(&layered.view_terms(wo), wi, transport, set),
        }
    }

    #[inline]
    fn evaluate_view(&self, view: &ViewTerms, wi: Vec3, transport: Transport, set: LobeSet) -> (Rgb, f32) {
        match self {
            Bsdf::Matte(color) => lambert(*color, view.o.z, if view.side == 1 { -wi.z } else { wi.z }, set),
            Bsdf::Layered(layered) => layered.evaluate(view, wi, transport, set),
        }
    }

    /// [`Bsdf::evaluate_view`] with diffuse light multiplied by `share` (0 to 1). The density does not change.
    #[inline]
    fn evaluate_dimmed(
        &self,
        share: f32,
        view: &ViewTerms,
        wi: Vec3,
        transport: Transport,
        set: LobeSet,
    ) -> (Rgb, f32) {
        match self {
            Bsdf::Matte(_) => {
                let (f, pdf) = self.evaluate_view(view, wi, transport, set);
                (f * share, pdf)
            }
            Bsdf::Layered(layered) => {
                let mut layered = *layered;
                layered.diffuse *= share;
                layered.diffuse_multiple *= share;
                layered.diffuse_transmitted *= share;
                layered.evaluate(view, wi, transport, set)
            }
        }
    }

    /// The value of [`Bsdf::evaluate`] (1/sr, without cosine), without its density.
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3, transport: Transport, set: LobeSet) -> Rgb {
        self.eval_view(&self.view_terms(wo), wi, transport, set)
    }

    #[inline]
    fn eval_view(&self, view: &ViewTerms, wi: Vec3, transport: Transport, set: LobeSet) -> Rgb {
        match self {
            Bsdf::Matte(_) => self.evaluate_view(view, wi, transport, set).0,
            Bsdf::Layered(layered) => layered.eval(view, wi, transport, set),
        }
    }

    /// If the BSDF has only diffuse reflection in `set`: its constant factor, and, if it depends on the cosine of `wi`,
    /// the profile of this dependence. Otherwise `None`.
    #[inline]
    fn diffuse_only(&self, view: &ViewTerms, set: LobeSet) -> Option<(Rgb, Option<&'a Profile>)> {
        match self {
            Bsdf::Matte(color) if set.intersects(LobeSet::BROAD) => Some((*color * FRAC_1_PI, None)),
            Bsdf::Matte(_) => None,
            Bsdf::Layered(layered) => {
                layered.diffuse_only(view, set).map(|factor| (factor, Some(&layered.interface.through)))
            }
        }
    }

    /// The layered model, if it has reflecting facets in `set` that neither transmit nor have a cover; otherwise
    /// `None`.
    #[inline]
    fn reflecting_facets_only(&self, view: &ViewTerms, set: LobeSet) -> Option<&Layered<'a>> {
        match self {
            Bsdf::Layered(layered) if layered.has_plain_facets(view, set) => Some(layered),
            _ => None,
        }
    }

    /// The density per solid angle of [`Bsdf::evaluate`]. The density of the reverse direction is `pdf(wi, wo, ..)`.
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3, transport: Transport, set: LobeSet) -> f32 {
        self.evaluate(wo, wi, transport, set).1
    }

    /// Samples a direction from the lobes of `set`; `u_lobe` chooses the lobe, `u` the direction. `None` if the lobes
    /// scatter nothing, or if the sampled direction is invalid (below the horizon, for example).
    #[inline]
    pub fn sample(&self, wo: Vec3, transport: Transport, set: LobeSet, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        self.sample_view(&self.view_terms(wo), transport, set, u_lobe, u)
    }

    #[inline]
    fn sample_view(
        &self,
        view: &ViewTerms,
        transport: Transport,
        set: LobeSet,
        u_lobe: f32,
        u: Vec2,
    ) -> Option<BsdfSample> {
        match self {
            Bsdf::Matte(color) => {
                let mut wi = warp::hemisphere_cosine(u);
                if !self.lobes().intersects(set) || wi.z <= 0.0 || view.o.z == 0.0 {
                    return None;
                }
                let pdf_w = wi.z * FRAC_1_PI;
                if view.side == 1 {
                    wi.z = -wi.z;
                }
                Some(BsdfSample { wi, weight: *color, pdf_w, lobe: LobeSet::BROAD, transmitted: false })
            }
            Bsdf::Layered(layered) => layered.sample(view, transport, set, u_lobe, u),
        }
    }

    /// Albedo of the lobes of `set` for `wo`. Exact for delta and diffuse lobes without a coloured coat, an estimate
    /// for others, with errors of up to 0.15 for anisotropic glass. Only Russian roulette and the denoiser use it, so
    /// it does not bias the picture.
    #[inline]
    pub fn albedo(&self, wo: Vec3, set: LobeSet) -> Rgb {
        self.albedo_view(&self.view_terms(wo), set)
    }

    #[inline]
    fn albedo_view(&self, view: &ViewTerms, set: LobeSet) -> Rgb {
        match self {
            Bsdf::Matte(color) if set.intersects(LobeSet::BROAD) => *color,
            Bsdf::Matte(_) => Rgb::ZERO,
            Bsdf::Layered(layered) => layered.albedo(view, set),
        }
    }
}
