//! Scattering in world space: shading normals, decided once.
//!
//! A direction whose sides of the shading plane and of the geometric plane differ is scattered neither from nor to: whether light is
//! reflected or transmitted is then never in doubt, nothing leaks, and every algorithm sees the same function. Light carried the other
//! way takes the adjoint of Veach \[1997, 5.3\].

use super::layered::{LEAST_COSINE, Seen};
use super::profile::{Position, Profile};
use super::{Bsdf, BsdfSample, LobeSet, Transport};
use crate::math::{Frame, Rgb, Vec2, Vec3};

/// A BSDF standing in the world, seen along one direction.
#[derive(Clone, Copy, Debug)]
pub struct Shading<'a> {
    /// Shading frame.
    pub frame: Frame,
    /// Unit geometric normal.
    pub ng: Vec3,
    /// Scattering in the frame.
    pub bsdf: Bsdf<'a>,
    seen: Seen,
    /// Cosine of the direction with the geometric normal; 0 where the two normals disagree about its side.
    cos_og: f32,
}

impl<'a> Shading<'a> {
    /// `bsdf` in `frame` on a surface with geometric normal `ng`, seen along the unit direction `wo`.
    #[inline]
    pub fn new(frame: Frame, ng: Vec3, bsdf: Bsdf<'a>, wo: Vec3) -> Shading<'a> {
        let local = frame.to_local(wo);
        let cos = wo.dot(ng);
        let cos_og = if local.z * cos > 0.0 { cos.abs() } else { 0.0 };
        Shading { frame, ng, bsdf, seen: bsdf.seen(local), cos_og }
    }

    /// `w` in the frame, and its cosine with the geometric normal; `None` where the two normals disagree about its side.
    #[inline]
    fn local(&self, w: Vec3) -> Option<(Vec3, f32)> {
        let local = self.frame.to_local(w);
        let cos = w.dot(self.ng);
        (local.z * cos > 0.0).then_some((local, cos.abs()))
    }

    /// The BSDF times the cosine that belongs to it: `f |wi.ns|` for radiance, and for importance
    /// `f |wi.ns| (|wo.ns| |wi.ng|) / (|wo.ng| |wi.ns|)` \[Veach 1997 (5.17)\]; and the density per solid angle with which
    /// [`Shading::sample`] draws `wi`.
    #[inline]
    pub fn evaluate_cos(&self, wi: Vec3, transport: Transport, set: LobeSet) -> (Rgb, f32) {
        let (true, Some((i, cos_ig))) = (self.cos_og > 0.0, self.local(wi)) else {
            return (Rgb::ZERO, 0.0);
        };
        let (f, pdf) = self.bsdf.evaluate_seen(&self.seen, i, transport, set);
        let cosine = match transport {
            Transport::Radiance => i.z.abs(),
            Transport::Importance => self.seen.o.z * cos_ig / self.cos_og,
        };
        (f * cosine, pdf)
    }

    /// The first part of [`Shading::evaluate_cos`].
    #[inline]
    pub fn eval_cos(&self, wi: Vec3, transport: Transport, set: LobeSet) -> Rgb {
        self.evaluate_cos(wi, transport, set).0
    }

    /// The second part of [`Shading::evaluate_cos`].
    #[inline]
    pub fn pdf(&self, wi: Vec3, transport: Transport, set: LobeSet) -> f32 {
        self.evaluate_cos(wi, transport, set).1
    }

    /// Density per solid angle with which a path that comes along `wi` would be sent along the direction the surface is seen along.
    #[inline]
    pub fn reverse_pdf(&self, wi: Vec3, transport: Transport, set: LobeSet) -> f32 {
        let (true, Some((i, _))) = (self.cos_og > 0.0, self.local(wi)) else { return 0.0 };
        self.bsdf.pdf(i, self.seen.wo(), transport, set)
    }

    /// What a photon from `wi` (unit, towards where it came from) adds to the radiance seen, per flux over kernel area: photons
    /// measure irradiance on the geometric surface, so `f |wi.ns| / |wi.ng|`.
    #[inline]
    pub fn gather(&self, wi: Vec3, set: LobeSet) -> Rgb {
        let (true, Some((i, cos_ig))) = (self.cos_og > 0.0, self.local(wi)) else {
            return Rgb::ZERO;
        };
        self.bsdf.eval_seen(&self.seen, i, Transport::Radiance, set) * (i.z.abs() / cos_ig)
    }

    /// [`Shading::gather`] for many photons.
    #[inline]
    pub fn gathering(&self, set: LobeSet) -> Gathering<'_> {
        let kind = if self.cos_og == 0.0 {
            Kind::Nothing
        } else {
            match self.bsdf.diffuse_only(&self.seen, set) {
                Some((factor, through)) => {
                    Kind::Diffuse { factor, through, side: if self.seen.side == 1 { -1.0 } else { 1.0 } }
                }
                None => Kind::Any,
            }
        };
        Gathering { shading: self, set, kind }
    }

    /// Albedo of the lobes of `set`, see [`Bsdf::albedo`].
    #[inline]
    pub fn albedo(&self, set: LobeSet) -> Rgb {
        self.bsdf.albedo_seen(&self.seen, set)
    }

    /// Draws a direction, see [`Bsdf::sample`]; `wi` and the weight are those of the world.
    #[inline]
    pub fn sample(&self, transport: Transport, set: LobeSet, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if self.cos_og == 0.0 {
            return None;
        }
        let mut sample = self.bsdf.sample_seen(&self.seen, transport, set, u_lobe, u)?;
        let wi = self.frame.to_world(sample.wi);
        let cos_ig = wi.dot(self.ng);
        if sample.wi.z * cos_ig <= 0.0 {
            return None;
        }
        if transport == Transport::Importance {
            sample.weight *= self.seen.o.z * cos_ig.abs() / (self.cos_og * sample.wi.z.abs());
        }
        sample.wi = wi;
        Some(sample)
    }
}

/// What photons add to the radiance along one direction.
pub struct Gathering<'a> {
    shading: &'a Shading<'a>,
    set: LobeSet,
    kind: Kind<'a>,
}

/// Diffuse reflection, which most photons meet, needs little per photon.
enum Kind<'a> {
    Nothing,
    Diffuse {
        factor: Rgb,
        through: Option<&'a Profile>,
        /// 1 in front, -1 behind: photons on the side of the viewer count.
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
            Kind::Any => self.shading.gather(wi, self.set),
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
    use crate::bsdf::{Coverings, EnergyTables, Interface, Parameters};
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
            let interface = Interface::new(&parameters, &tables);
            let bsdf = Bsdf::new(&parameters, &interface);
            for i in 0..2000 {
                let draws = Stream::new(1, 0, Domain::Test, i).vertex(0);
                let wo = crate::math::warp::sphere_uniform(draws.two(Purpose::Pixel));
                let wi = crate::math::warp::sphere_uniform(draws.two(Purpose::Lens));
                let shading = Shading::new(frame, Vec3::Z, bsdf, wo);
                let expected = shading.gather(wi, LobeSet::BROAD);
                let found = shading.gathering(LobeSet::BROAD).photon(wi);
                assert!((found - expected).length() <= 1e-4 * expected.length() + 1e-7, "{found} {expected}");
            }
        }
    }
}
