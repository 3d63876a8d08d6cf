//! Corrections for surfaces with a normal map, which stands for facets with walls between them.
//!
//! *Diffuse* light is shadowed like light on microfacets whose roughness is the slope of the map \[Conty Estevez,
//! Lecocq and Stein 2019, "A Microfacet-Based Shadowing Function to Solve the Bump Terminator Problem"\]. As in Cycles,
//! it fades out smoothly where it grazes the surface.
//!
//! *Specular* light that a facet would reflect into the surface is mirrored out of it at the geometric plane, as if the
//! walls were mirrors. So white metal stays white, as with displaced geometry, and the picture stays continuous where
//! the mirror direction of a facet crosses the horizon. Light from `l` thus reaches a facet from two directions, `l`
//! and its mirror image, if the facet faces both. (Cycles tilts the facet until its mirror direction grazes the
//! surface. That loses up to 45 % of the light, and the tilt depends on the viewing direction, which photons do not
//! know.)

use crate::math::Vec3;

/// Light from one direction that reaches a facet of a normal map: how it is shadowed and mirrored.
#[derive(Clone, Copy, Debug)]
pub(super) struct Relief {
    /// Share (0 to 1) of the light that is not shadowed, for diffuse reflection.
    pub diffuse: f32,
    /// Direction of the light, mirrored at the geometric plane (world space).
    pub mirrored: Vec3,
}

impl Relief {
    /// The effect of the map on light from `l` at a facet of normal `n`, on a surface of geometric normal `ng` and
    /// interpolated normal `interpolated`. All vectors are unit vectors.
    #[inline]
    pub(super) fn new(l: Vec3, n: Vec3, interpolated: Vec3, ng: Vec3) -> Relief {
        Relief {
            diffuse: bump_shadowing(l.dot(interpolated) * l.dot(n).signum(), n.dot(interpolated)),
            mirrored: mirrored(l, ng),
        }
    }
}

/// The direction `w` mirrored at the plane of unit normal `ng`.
#[inline]
pub(super) fn mirrored(w: Vec3, ng: Vec3) -> Vec3 {
    w - ng * (2.0 * w.dot(ng))
}

/// Share (0 to 1) of light at a facet that is not shadowed: Smith shadowing by GGX facets (see [`super::microfacet`])
/// of alpha = tan(tilt) / sqrt(8), at most 1, where tilt is the angle between facet and surface \[Conty Estevez 2019\].
/// `light` is the cosine of light and surface, positive on the side from which light reaches the facet; `facet` is the
/// cosine of facet and surface.
#[inline]
fn bump_shadowing(light: f32, facet: f32) -> f32 {
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
    fn shadowing_follows_its_closed_form() {
        // Light along the normal; no tilt; light that grazes the surface; light below it.
        assert_eq!((bump_shadowing(1.0, 0.6), bump_shadowing(0.3, 1.0)), (1.0, 1.0));
        assert_eq!((bump_shadowing(0.0, 0.6), bump_shadowing(-0.1, 0.6), bump_shadowing(0.5, -0.1)), (0.0, 0.0, 0.0));
        // A tilt of 60 degrees has alpha^2 = 3 / 8; for light at 45 degrees tan^2 is 1.
        let expected = 2.0 / (1.0 + (1.0f32 + 0.375).sqrt());
        assert!((bump_shadowing(0.5f32.sqrt(), 0.5) - expected).abs() < 1e-6);
        // Alpha is at most 1.
        assert!((bump_shadowing(0.5, 0.1) - 2.0 / (1.0 + 2.0)).abs() < 1e-6);
    }

    #[test]
    fn both_sides_have_the_same_shadowing() {
        let (n, interpolated) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0, 0.1, 1.0).normalize());
        let l = Vec3::new(0.3, 0.4, 0.5).normalize();
        assert_eq!(Relief::new(l, n, interpolated, Vec3::Z).diffuse, Relief::new(-l, n, interpolated, Vec3::Z).diffuse);
    }
}
