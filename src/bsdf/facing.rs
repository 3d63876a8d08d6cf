//! Shading normal and geometric normal of a surface, and the sides of both that directions are on.

use super::Transport;
use crate::math::{Frame, Vec3};

/// A shading frame and a geometric normal with respect to a viewing direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facing {
    pub frame: Frame,
    pub ng: Vec3,
    /// Absolute cosine of the viewing direction with the geometric normal.
    pub cos_og: f32,
    /// Whether the viewing direction is on different sides of the two normals. Its opposite then replaces it.
    pub flipped: bool,
}

impl Facing {
    /// Builds the sides for a viewing direction `wo`. Also returns `wo`, or its opposite if that replaces it, in the
    /// shading frame.
    #[inline(always)]
    pub(super) fn new(frame: Frame, ng: Vec3, wo: Vec3) -> (Facing, Vec3) {
        let local = frame.to_local(wo);
        let cos = wo.dot(ng);
        let flipped = local.z * cos < 0.0;
        let cos_og = if local.z == 0.0 { 0.0 } else { cos.abs() };
        (Facing { frame, ng, cos_og, flipped }, if flipped { -local } else { local })
    }

    /// The other direction `w` in the shading frame, and its absolute cosine with the geometric normal. `None` if the
    /// direction of light (`w` for radiance, the viewing direction for importance) is on different sides of the two
    /// normals.
    #[inline]
    pub(super) fn local(&self, w: Vec3, transport: Transport) -> Option<(Vec3, f32)> {
        let local = self.frame.to_local(w);
        let cos = w.dot(self.ng);
        let agrees = local.z * cos > 0.0;
        let lit = match transport {
            Transport::Radiance => agrees,
            Transport::Importance => !self.flipped && local.z * cos != 0.0,
        };
        (lit && self.cos_og > 0.0).then_some((if agrees { local } else { -local }, cos.abs()))
    }
}
