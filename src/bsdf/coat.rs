//! A clear coat on a surface with a normal map. The map applies only to the base (KHR_materials_clearcoat), so the coat
//! reflects in its own frame, and its transmittance to the base is computed there, too ([`super::cover`]).

use super::cover::Cover;
use super::facing::Facing;
use super::layered::MIN_COSINE;
use super::{BsdfSample, LobeSet, Transport};
use crate::math::{Frame, Rgb, Vec2, Vec3};

/// A clear coat over a normal map, seen along one direction. It reflects in a frame of its own, without the map.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coat<'a> {
    cover: &'a Cover,
    facing: Facing,
    /// The viewing direction in the coat's frame, with z >= 0.
    o: Vec3,
    /// 1 if the viewer is above the surface, -1 below.
    side: f32,
}

impl<'a> Coat<'a> {
    /// The coat of a surface of interpolated normal `n` and geometric normal `ng`, seen along `wo`.
    pub(super) fn new(cover: &'a Cover, n: Vec3, ng: Vec3, wo: Vec3) -> Coat<'a> {
        let (facing, o) = Facing::new(Frame::from_normal(n), ng, wo);
        Coat { cover, facing, o: Vec3::new(o.x, o.y, o.z.abs()), side: o.z.signum() }
    }

    /// Value of the coat's lobe times the cosine, and the density of sampling `wi`, like
    /// [`super::Shading::evaluate_cos`].
    #[inline]
    pub(super) fn evaluate_cos(&self, wi: Vec3, transport: Transport) -> (f32, f32) {
        let Some((i, cos_ig)) = self.facing.local(wi, transport) else { return (0.0, 0.0) };
        let Some(i) = self.on_viewer_side(i) else { return (0.0, 0.0) };
        let (f, pdf) = self.cover.coat(self.o, i);
        let cosine = match transport {
            Transport::Radiance => i.z,
            Transport::Importance => self.o.z * cos_ig / self.facing.cos_og,
        };
        (f * cosine, pdf)
    }

    /// The direction `i` with z > 0, if it is on the viewer's side of the coat and the coat is not a delta lobe;
    /// otherwise `None`.
    #[inline]
    fn on_viewer_side(&self, i: Vec3) -> Option<Vec3> {
        let i = Vec3::new(i.x, i.y, i.z * self.side);
        (self.cover.coat_class != LobeSet::DELTA && i.z.min(self.o.z) >= MIN_COSINE).then_some(i)
    }

    /// Density per solid angle with which a path that arrives from `wi` samples the viewing direction from the coat.
    #[inline]
    pub(super) fn reverse_pdf(&self, wi: Vec3, transport: Transport) -> f32 {
        let i = self.facing.local(wi, transport.reversed()).and_then(|(i, _)| self.on_viewer_side(i));
        i.map_or(0.0, |i| self.cover.coat(i, self.o).1)
    }

    /// Samples a direction that the coat reflects to; `None` if it is below the surface. The weight is valid only for a
    /// delta coat.
    #[inline]
    pub(super) fn sample(&self, transport: Transport, u: Vec2) -> Option<BsdfSample> {
        let importance = transport == Transport::Importance;
        if self.o.z < MIN_COSINE || self.facing.cos_og == 0.0 || (importance && self.facing.flipped) {
            return None;
        }
        let i = self.cover.sample_coat(self.o, u);
        if i.z < MIN_COSINE {
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
