//! The two normals of a shaded surface, and the side of each that a direction is on.

use super::Transport;
use crate::math::{Frame, Vec3};

/// A shading frame on a surface, and how a viewer stands to both.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facing {
    pub frame: Frame,
    pub ng: Vec3,
    /// Cosine of the viewer's direction with the geometric normal.
    pub cos_og: f32,
    /// The two normals disagree about its side: its opposite stands for it.
    pub opposite: bool,
}

impl Facing {
    /// And the direction that stands for the viewer's, in the frame.
    #[inline(always)]
    pub(super) fn new(frame: Frame, ng: Vec3, wo: Vec3) -> (Facing, Vec3) {
        let local = frame.to_local(wo);
        let cos = wo.dot(ng);
        let opposite = local.z * cos < 0.0;
        let cos_og = if local.z == 0.0 { 0.0 } else { cos.abs() };
        (Facing { frame, ng, cos_og, opposite }, if opposite { -local } else { local })
    }

    /// `w`, which paths of `transport` come from, in the frame, and its cosine with the geometric normal; `None` where
    /// the two normals disagree about the side of light, be it `w` or the viewer's direction.
    #[inline]
    pub(super) fn local(&self, w: Vec3, transport: Transport) -> Option<(Vec3, f32)> {
        let local = self.frame.to_local(w);
        let cos = w.dot(self.ng);
        let agrees = local.z * cos > 0.0;
        let lit = match transport {
            Transport::Radiance => agrees,
            Transport::Importance => !self.opposite && local.z * cos != 0.0,
        };
        (lit && self.cos_og > 0.0).then_some((if agrees { local } else { -local }, cos.abs()))
    }
}
