//! A clear coat on a surface under a normal map: the map is that of the base alone (KHR_materials_clearcoat), so the
//! coat reflects in a frame of its own. What it leaves to the base is reckoned there, too ([`super::cover`]).

use super::cover::Cover;
use super::facing::Facing;
use super::layered::LEAST_COSINE;
use super::{BsdfSample, LobeSet, Transport};
use crate::math::{Frame, Rgb, Vec2, Vec3};

/// A coat seen along one direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coat<'a> {
    cover: &'a Cover,
    facing: Facing,
    /// The direction, from the side it is on.
    o: Vec3,
    /// That side: -1 below.
    side: f32,
}

impl<'a> Coat<'a> {
    /// On a surface of interpolated normal `n` and geometric normal `ng`, seen along `wo`.
    pub(super) fn new(cover: &'a Cover, n: Vec3, ng: Vec3, wo: Vec3) -> Coat<'a> {
        let (facing, o) = Facing::new(Frame::from_normal(n), ng, wo);
        Coat { cover, facing, o: Vec3::new(o.x, o.y, o.z.abs()), side: o.z.signum() }
    }

    /// As [`super::Shading::evaluate_cos`].
    #[inline]
    pub(super) fn evaluate_cos(&self, wi: Vec3, transport: Transport) -> (f32, f32) {
        let Some((i, cos_ig)) = self.facing.local(wi, transport) else { return (0.0, 0.0) };
        let Some(i) = self.lit(i) else { return (0.0, 0.0) };
        let (f, pdf) = self.cover.coat(self.o, i);
        let cosine = match transport {
            Transport::Radiance => i.z,
            Transport::Importance => self.o.z * cos_ig / self.facing.cos_og,
        };
        (f * cosine, pdf)
    }

    /// `i` as seen from the viewer's side, where it is on that and the coat has a width.
    #[inline]
    fn lit(&self, i: Vec3) -> Option<Vec3> {
        let i = Vec3::new(i.x, i.y, i.z * self.side);
        (self.cover.coat_class != LobeSet::DELTA && i.z.min(self.o.z) >= LEAST_COSINE).then_some(i)
    }

    /// Density with which a path that comes along `wi` would be sent along the direction the coat is seen along.
    #[inline]
    pub(super) fn reverse_pdf(&self, wi: Vec3, transport: Transport) -> f32 {
        let i = self.facing.local(wi, transport.reversed()).and_then(|(i, _)| self.lit(i));
        i.map_or(0.0, |i| self.cover.coat(i, self.o).1)
    }

    /// A direction that the coat reflects to; the weight is that of a coat without width.
    #[inline]
    pub(super) fn sample(&self, transport: Transport, u: Vec2) -> Option<BsdfSample> {
        let importance = transport == Transport::Importance;
        if self.o.z < LEAST_COSINE || self.facing.cos_og == 0.0 || (importance && self.facing.opposite) {
            return None;
        }
        let i = self.cover.sample_coat(self.o, u);
        if i.z < LEAST_COSINE {
            return None;
        }
        let mut wi = self.facing.frame.to_world(Vec3::new(i.x, i.y, i.z * self.side));
        let mut cos_ig = wi.dot(self.facing.ng) * self.side;
        if cos_ig < 0.0 && importance {
            (wi, cos_ig) = (-wi, -cos_ig);
        }
        let adjoint = if importance { self.o.z * cos_ig / (self.facing.cos_og * i.z) } else { 1.0 };
        let weight = Rgb::splat(self.cover.coat_reflectance(self.o.z) * adjoint);
        let lobe = self.cover.coat_class;
        (cos_ig > 0.0).then_some(BsdfSample { wi, weight, pdf_w: 1.0, lobe, transmitted: false })
    }
}
