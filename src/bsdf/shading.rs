//! Scattering in world space: shading normals, decided once.
//!
//! A direction whose sides of the shading plane and of the geometric plane differ is scattered neither from nor to: whether light is
//! reflected or transmitted is then never in doubt, nothing leaks, and every algorithm sees the same function. Light carried the other
//! way takes the adjoint of Veach \[1997, 5.3\].

use super::layered::LEAST_COSINE;
use super::profile::{Position, Profile};
use super::{Bsdf, BsdfSample, LobeSet, Transport};
use crate::math::{Frame, Rgb, Vec2, Vec3};

/// A BSDF standing in the world.
#[derive(Clone, Copy, Debug)]
pub struct Shading<'a> {
    /// Shading frame.
    pub frame: Frame,
    /// Unit geometric normal.
    pub ng: Vec3,
    /// Scattering in the frame.
    pub bsdf: Bsdf<'a>,
}

impl Shading<'_> {
    /// `w` in the frame, and its cosine with the geometric normal; `None` where the two normals disagree about its side.
    #[inline]
    fn local(&self, w: Vec3) -> Option<(Vec3, f32)> {
        let local = self.frame.to_local(w);
        let cos = w.dot(self.ng);
        (local.z * cos > 0.0).then_some((local, cos.abs()))
    }

    /// The BSDF times the cosine that belongs to it: `f |wi.ns|` for radiance, and for importance
    /// `f |wi.ns| (|wo.ns| |wi.ng|) / (|wo.ng| |wi.ns|)` \[Veach 1997 (5.17)\].
    #[inline]
    pub fn eval_cos(&self, wo: Vec3, wi: Vec3, transport: Transport, set: LobeSet) -> Rgb {
        self.evaluate_cos(wo, wi, transport, set).0
    }

    /// Density per solid angle with which [`Shading::sample`] draws `wi`.
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3, transport: Transport, set: LobeSet) -> f32 {
        self.evaluate_cos(wo, wi, transport, set).1
    }

    /// [`Shading::eval_cos`] and [`Shading::pdf`] at the price of one.
    #[inline]
    pub fn evaluate_cos(&self, wo: Vec3, wi: Vec3, transport: Transport, set: LobeSet) -> (Rgb, f32) {
        let (Some((o, cos_og)), Some((i, cos_ig))) = (self.local(wo), self.local(wi)) else {
            return (Rgb::ZERO, 0.0);
        };
        let (f, pdf) = self.bsdf.evaluate(o, i, transport, set);
        let cosine = match transport {
            Transport::Radiance => i.z.abs(),
            Transport::Importance => o.z.abs() * cos_ig / cos_og,
        };
        (f * cosine, pdf)
    }

    /// What a photon from `wi` (unit, towards where it came from) adds to the radiance along `wo`, per flux over kernel area: photons
    /// measure irradiance on the geometric surface, so `f |wi.ns| / |wi.ng|`.
    #[inline]
    pub fn gather(&self, wo: Vec3, wi: Vec3, set: LobeSet) -> Rgb {
        let (Some((o, _)), Some((i, cos_ig))) = (self.local(wo), self.local(wi)) else {
            return Rgb::ZERO;
        };
        self.bsdf.eval(o, i, Transport::Radiance, set) * (i.z.abs() / cos_ig)
    }

    /// [`Shading::gather`] for one `wo` and many photons.
    #[inline]
    pub fn gathering(&self, wo: Vec3, set: LobeSet) -> Gathering<'_> {
        let kind = match self.local(wo) {
            None => Kind::Nothing,
            Some((o, _)) => match self.bsdf.diffuse_from(o, set) {
                Some((factor, through)) => Kind::Diffuse { factor, through, side: o.z.signum() },
                None => Kind::Any,
            },
        };
        Gathering { shading: self, wo, set, kind }
    }

    /// Albedo of the lobes of `set`, see [`Bsdf::albedo`].
    #[inline]
    pub fn albedo(&self, wo: Vec3, set: LobeSet) -> Rgb {
        self.bsdf.albedo(self.frame.to_local(wo), set)
    }

    /// Draws a direction, see [`Bsdf::sample`]; `wi` and the weight are those of the world.
    #[inline]
    pub fn sample(&self, wo: Vec3, transport: Transport, set: LobeSet, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let (o, cos_og) = self.local(wo)?;
        let mut sample = self.bsdf.sample(o, transport, set, u_lobe, u)?;
        let wi = self.frame.to_world(sample.wi);
        let cos_ig = wi.dot(self.ng);
        if sample.wi.z * cos_ig <= 0.0 {
            return None;
        }
        if transport == Transport::Importance {
            sample.weight *= o.z.abs() * cos_ig.abs() / (cos_og * sample.wi.z.abs());
        }
        sample.wi = wi;
        Some(sample)
    }
}

/// What photons add to the radiance along one direction.
pub struct Gathering<'a> {
    shading: &'a Shading<'a>,
    wo: Vec3,
    set: LobeSet,
    kind: Kind<'a>,
}

/// Diffuse reflection, which most photons meet, needs little per photon.
enum Kind<'a> {
    Nothing,
    Diffuse {
        factor: Rgb,
        through: Option<&'a Profile<'a>>,
        /// 1 in front, -1 behind: photons on the side of `wo` count.
        side: f32,
    },
    Any,
}

impl Gathering<'_> {
    /// [`Shading::gather`] of a photon from `wi`.
    #[inline]
    pub fn photon(&self, wi: Vec3) -> Rgb {
        match &self.kind {
            Kind::Nothing => Rgb::ZERO,
            Kind::Any => self.shading.gather(self.wo, wi, self.set),
            Kind::Diffuse { factor, through, side } => {
                let (cos_s, cos_g) = (wi.dot(self.shading.frame.n) * side, wi.dot(self.shading.ng) * side);
                if cos_s < LEAST_COSINE || cos_g <= 0.0 {
                    return Rgb::ZERO;
                }
                let through = through.map_or(1.0, |through| through.at(Position::new(cos_s)));
                *factor * (through * cos_s / cos_g)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::{Coverings, EnergyTables, Parameters};
    use crate::random::{Domain, Purpose, Stream};

    /// The short way for diffuse reflection gives what the long way gives, on both sides and with a bent shading normal.
    #[test]
    fn gathering_is_gather() {
        let tables = EnergyTables::new([1.5], Coverings::default());
        let plastic =
            Parameters { base_color: Rgb::new(0.6, 0.3, 0.1), eta: 1.5, specular: 1.0, ..Parameters::default() };
        let matte = Parameters { specular: 0.0, ..plastic };
        let rough = Parameters { alpha_x: 0.5, alpha_y: 0.5, ..plastic };
        let sharp = Parameters { alpha_x: 0.05, alpha_y: 0.05, ..plastic };
        for parameters in [plastic, matte, rough, sharp] {
            let frame = Frame::from_normal(Vec3::new(0.3, 0.1, 1.0).normalize());
            let shading = Shading { frame, ng: Vec3::Z, bsdf: Bsdf::new(&parameters, &tables) };
            for i in 0..2000 {
                let draws = Stream::new(1, 0, Domain::Test, i).vertex(0);
                let wo = crate::math::warp::sphere_uniform(draws.two(Purpose::Pixel));
                let wi = crate::math::warp::sphere_uniform(draws.two(Purpose::Lens));
                let expected = shading.gather(wo, wi, LobeSet::BROAD);
                let found = shading.gathering(wo, LobeSet::BROAD).photon(wi);
                assert!((found - expected).length() <= 1e-4 * expected.length() + 1e-7, "{found} {expected}");
            }
        }
    }
}
