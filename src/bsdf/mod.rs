//! The scattering model: one closed set of lobes that agrees with the glTF specification and conserves energy.

mod coat;
mod cover;
mod energy;
mod facing;
mod fresnel;
mod gathering;
mod interface;
mod layered;
mod microfacet;
mod parameters;
mod profile;
mod relief;
mod scatter;
mod shading;
mod sheen;
mod stretched;

pub use cover::coat_reflectance;
pub use energy::EnergyTables;
pub use gathering::Gathering;
pub use interface::Interface;
pub use layered::Layered;
pub use microfacet::refraction_width;
pub use parameters::Parameters;
pub use shading::Shading;

use crate::math::{Rgb, Vec2, Vec3, warp};
use bitflags::bitflags;
use layered::Seen;
use profile::Profile;
use std::f32::consts::FRAC_1_PI;

bitflags! {
    /// A set of lobe classes. The class decides which technique carries light that arrives at a surface: see
    /// [`LobeSet::BROAD`].
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
    pub struct LobeSet: u8 {
        /// Perfect mirrors and clear interfaces: a path can only continue.
        const DELTA = 1;
        /// Glossy lobes too narrow to gather photons well (GGX alpha below [`SHARP_ALPHA`], for solid glass as far as
        /// it bends light): a camera path continues.
        const SHARP = 2;
        /// Diffuse, sheen and wide glossy lobes: photons are gathered here.
        const BROAD = 4;
        /// Lobes that a light sample can be evaluated against.
        const SMOOTH = 6;
        /// Every class.
        const ALL = 7;
    }
}

/// GGX alpha (perceptual roughness squared) below which a glossy lobe is [`LobeSet::SHARP`].
pub const SHARP_ALPHA: f32 = 0.2;

/// GGX alpha below which a lobe is a perfect mirror or a clear interface (perceptual roughness 0.03).
pub const DELTA_ALPHA: f32 = 1e-3;

/// Which quantity a walk carries; refraction compresses radiance by 1/eta^2 and leaves importance's adjoint alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// Walking from the eye: BSDFs weight radiance.
    Radiance,
    /// Walking from a light: the adjoint BSDF weights flux.
    Importance,
}

impl Transport {
    /// That of a path the other way.
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
    /// Unit direction, local frame.
    pub wi: Vec3,
    /// f |cos wi| / pdf over the set of lobes asked for (for a delta lobe, its weight over the probability of choosing
    /// it).
    pub weight: Rgb,
    /// Density per solid angle of `wi` over the non-delta lobes of the set; for a delta sample the probability of
    /// choosing that lobe.
    pub pdf_w: f32,
    /// Class of the lobe drawn (exactly one).
    pub lobe: LobeSet,
    /// The direction crosses to the other side of the surface.
    pub transmitted: bool,
}

/// How a surface scatters at one point, in its shading frame: z is the shading normal, directions point away from the
/// surface, z > 0 is its front.
#[derive(Clone, Copy, Debug)]
pub enum Bsdf<'a> {
    /// Lambert's reflection of some colour on both sides.
    Matte(Rgb),
    /// Everything else.
    Layered(Layered<'a>),
}

/// Lambert's BSDF and density over `set`, from the cosines of both directions with the normal on the side that the
/// surface is seen from.
#[inline(always)]
fn lambert(color: Rgb, seen: f32, lit: f32, set: LobeSet) -> (Rgb, f32) {
    if seen > 0.0 && lit > 0.0 && set.intersects(LobeSet::BROAD) && color.max_element() > 0.0 {
        (color * FRAC_1_PI, lit * FRAC_1_PI)
    } else {
        (Rgb::ZERO, 0.0)
    }
}

impl<'a> Bsdf<'a> {
    /// The BSDF of `parameters`, whose interface is `interface`.
    pub fn new(parameters: &Parameters, interface: &'a Interface<'a>) -> Bsdf<'a> {
        Bsdf::of(parameters.base_color, parameters.metallic, parameters.transmission, interface)
    }

    /// The BSDF of a surface of colour `base`, `metallic` and transmitting in these shares, at `interface`.
    #[inline(always)]
    pub fn of(base: Rgb, metallic: f32, transmission: f32, interface: &'a Interface<'a>) -> Bsdf<'a> {
        if metallic == 0.0 && transmission == 0.0 && interface.bare {
            Bsdf::Matte(base)
        } else {
            Bsdf::Layered(Layered::new(base, metallic, transmission, interface))
        }
    }

    /// Light from one side may leave on the other, not by a delta lobe.
    #[inline]
    pub fn transmits(&self) -> bool {
        matches!(self, Bsdf::Layered(layered) if layered.glass > 0.0)
    }

    /// Classes of lobes that are there.
    #[inline]
    pub fn lobes(&self) -> LobeSet {
        match self {
            Bsdf::Matte(color) if color.max_element() > 0.0 => LobeSet::BROAD,
            Bsdf::Matte(_) => LobeSet::empty(),
            Bsdf::Layered(layered) => layered.lobes,
        }
    }

    /// The surface seen along `wo`.
    #[inline(always)]
    fn seen(&self, wo: Vec3) -> Seen {
        match self {
            Bsdf::Matte(_) => Seen::plain(wo),
            Bsdf::Layered(layered) => layered.seen(wo),
        }
    }

    /// The BSDF (1/sr, without cosine) over the lobes of `set` that are not delta, and the density per solid angle with
    /// which [`Bsdf::sample`] draws `wi` for `wo` and `set`.
    ///
    /// [`Transport::Radiance`]: light from `wi` is seen along `wo`; [`Transport::Importance`]: flux that came from `wo`
    /// leaves along `wi`. They differ for refraction only: with n the index on the side of a direction,
    /// `f_radiance(o, i) = f_importance(i, o) = f_importance(o, i) n_o^2 / n_i^2`.
    #[inline]
    pub fn evaluate(&self, wo: Vec3, wi: Vec3, transport: Transport, set: LobeSet) -> (Rgb, f32) {
        match self {
            Bsdf::Matte(color) => lambert(*color, wo.z.abs(), if wo.z < 0.0 { -wi.z } else { wi.z }, set),
            Bsdf::Layered(layered) => layered.evaluate(&layered.seen(wo), wi, transport, set),
        }
    }

    #[inline]
    fn evaluate_seen(&self, seen: &Seen, wi: Vec3, transport: Transport, set: LobeSet) -> (Rgb, f32) {
        match self {
            Bsdf::Matte(color) => lambert(*color, seen.o.z, if seen.side == 1 { -wi.z } else { wi.z }, set),
            Bsdf::Layered(layered) => layered.evaluate(seen, wi, transport, set),
        }
    }

    /// [`Bsdf::evaluate_seen`] with a share of the diffuse reflection, the density being that of the whole.
    #[inline]
    fn evaluate_dimmed(&self, share: f32, seen: &Seen, wi: Vec3, transport: Transport, set: LobeSet) -> (Rgb, f32) {
        match self {
            Bsdf::Matte(_) => {
                let (f, pdf) = self.evaluate_seen(seen, wi, transport, set);
                (f * share, pdf)
            }
            Bsdf::Layered(layered) => {
                let mut layered = *layered;
                layered.diffuse *= share;
                layered.evaluate(seen, wi, transport, set)
            }
        }
    }

    /// The first part of [`Bsdf::evaluate`].
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3, transport: Transport, set: LobeSet) -> Rgb {
        self.eval_seen(&self.seen(wo), wi, transport, set)
    }

    #[inline]
    fn eval_seen(&self, seen: &Seen, wi: Vec3, transport: Transport, set: LobeSet) -> Rgb {
        match self {
            Bsdf::Matte(_) => self.evaluate_seen(seen, wi, transport, set).0,
            Bsdf::Layered(layered) => layered.eval(seen, wi, transport, set),
        }
    }

    /// Where only diffuse reflection is in `set`: the BSDF over its dependence on `wi`, and that dependence (`None`:
    /// there is none).
    #[inline]
    fn diffuse_only(&self, seen: &Seen, set: LobeSet) -> Option<(Rgb, Option<&'a Profile>)> {
        match self {
            Bsdf::Matte(color) if set.intersects(LobeSet::BROAD) => Some((*color * FRAC_1_PI, None)),
            Bsdf::Matte(_) => None,
            Bsdf::Layered(layered) => {
                layered.diffuse_only(seen, set).map(|factor| (factor, Some(&layered.interface.through)))
            }
        }
    }

    /// The layered model, where facets that only reflect are in `set`, and nothing lies on them.
    #[inline]
    fn reflecting_facets_only(&self, seen: &Seen, set: LobeSet) -> Option<&Layered<'a>> {
        match self {
            Bsdf::Layered(layered) if layered.has_plain_facets(seen, set) => Some(layered),
            _ => None,
        }
    }

    /// The second part of [`Bsdf::evaluate`]. The density of the reverse direction is `pdf(wi, wo, ..)`.
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3, transport: Transport, set: LobeSet) -> f32 {
        self.evaluate(wo, wi, transport, set).1
    }

    /// Draws a direction from the lobes of `set`; `u_lobe` chooses the lobe, `u` the direction. `None` where the lobes
    /// scatter nothing, or the direction drawn is not one they scatter to.
    #[inline]
    pub fn sample(&self, wo: Vec3, transport: Transport, set: LobeSet, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        self.sample_seen(&self.seen(wo), transport, set, u_lobe, u)
    }

    #[inline]
    fn sample_seen(&self, seen: &Seen, transport: Transport, set: LobeSet, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        match self {
            Bsdf::Matte(color) => {
                let mut wi = warp::hemisphere_cosine(u);
                if !self.lobes().intersects(set) || wi.z <= 0.0 || seen.o.z == 0.0 {
                    return None;
                }
                let pdf_w = wi.z * FRAC_1_PI;
                if seen.side == 1 {
                    wi.z = -wi.z;
                }
                Some(BsdfSample { wi, weight: *color, pdf_w, lobe: LobeSet::BROAD, transmitted: false })
            }
            Bsdf::Layered(layered) => layered.sample(seen, transport, set, u_lobe, u),
        }
    }

    /// Albedo of the lobes of `set`: the share of flux from `wo` that they scatter. Exact for delta and diffuse lobes,
    /// an estimate for others, off by up to 0.15 where facets of glass are wider one way. It steers roulette, whose
    /// chances are divided out, and the denoiser: no picture's mean depends on it.
    #[inline]
    pub fn albedo(&self, wo: Vec3, set: LobeSet) -> Rgb {
        self.albedo_seen(&self.seen(wo), set)
    }

    #[inline]
    fn albedo_seen(&self, seen: &Seen, set: LobeSet) -> Rgb {
        match self {
            Bsdf::Matte(color) if set.intersects(LobeSet::BROAD) => *color,
            Bsdf::Matte(_) => Rgb::ZERO,
            Bsdf::Layered(layered) => layered.albedo(seen, set),
        }
    }
}
