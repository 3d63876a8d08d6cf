//! Light on a surface under a normal map, which stands for facets with walls between them.
//!
//! Two things happen to it that a flat surface does not know. *Diffuse* light is shadowed by the relief, as light on
//! microfacets is whose roughness is the slope of the map \[Conty Estevez, Lecocq and Stein 2019, "A Microfacet-Based
//! Shadowing Function to Solve the Bump Terminator Problem"\]: it ends softly where it grazes the surface, as in Cycles.
//! *Shine* that a facet sends into the surface is mirrored out of it at the geometric plane, as if a wall there were a
//! mirror: white metal is white, as it is on relief of real mesh, and what is seen stays continuous where the facet's
//! mirror direction passes the horizon. So light that comes along `l` meets a facet twice, along `l` and along its
//! mirror image, if the facet faces both. (Cycles turns the facet until its mirror direction grazes the surface; what
//! lies below is lost, up to 45 % of the light. Such a facet depends on the viewer, and photons do not know theirs.)

use crate::math::Vec3;

/// How light that comes along one direction meets a facet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Relief {
    /// The share of it that diffuse reflection sees.
    pub diffuse: f32,
    /// Its image in the geometric plane (world), along which it comes as well.
    pub mirrored: Vec3,
}

impl Relief {
    /// Of light along `l`, on a surface of geometric normal `ng` and interpolated normal `smooth`, at a facet of normal
    /// `n`; all unit vectors.
    #[inline]
    pub(super) fn new(l: Vec3, n: Vec3, smooth: Vec3, ng: Vec3) -> Relief {
        Relief { diffuse: unshadowed(l.dot(smooth) * l.dot(n).signum(), n.dot(smooth)), mirrored: mirrored(l, ng) }
    }
}

/// `w` mirrored at the plane of unit normal `ng`.
#[inline]
pub(super) fn mirrored(w: Vec3, ng: Vec3) -> Vec3 {
    w - ng * (2.0 * w.dot(ng))
}

/// The share of light that the relief leaves: shadowing by GGX facets (see [`super::microfacet`]) whose alpha is tan(lean)
/// / sqrt(8), at most 1, for the angle by which the facet leans \[Conty Estevez 2019\]. From the cosines of light and
/// surface, on the side where light meets the facet, and of facet and surface.
#[inline]
fn unshadowed(light: f32, facet: f32) -> f32 {
    if light <= 0.0 || facet <= 0.0 {
        return 0.0;
    }
    let (light2, facet2) = (light * light, facet * facet);
    let alpha2 = ((1.0 - facet2).max(0.0) / (8.0 * facet2)).min(1.0);
    2.0 * light / (light + (light2 + alpha2 * (1.0 - light2).max(0.0)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shadows_end_softly() {
        // Light from straight above, no lean, light that grazes the surface, light below it.
        assert_eq!((unshadowed(1.0, 0.6), unshadowed(0.3, 1.0)), (1.0, 1.0));
        assert_eq!((unshadowed(0.0, 0.6), unshadowed(-0.1, 0.6), unshadowed(0.5, -0.1)), (0.0, 0.0, 0.0));
        // A lean of 60 degrees: alpha^2 = 3 / 8, tan^2 of light at 45 degrees is 1.
        let expected = 2.0 / (1.0 + (1.0f32 + 0.375).sqrt());
        assert!((unshadowed(0.5f32.sqrt(), 0.5) - expected).abs() < 1e-6);
        // No steeper than alpha = 1.
        assert!((unshadowed(0.5, 0.1) - 2.0 / (1.0 + 2.0)).abs() < 1e-6);
    }

    #[test]
    fn both_sides_are_alike() {
        let (n, smooth) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0, 0.1, 1.0).normalize());
        let l = Vec3::new(0.3, 0.4, 0.5).normalize();
        assert_eq!(Relief::new(l, n, smooth, Vec3::Z).diffuse, Relief::new(-l, n, smooth, Vec3::Z).diffuse);
    }
}
