//! Corrections where the shading normal leans away from the geometric one.
//!
//! *Specular* light that would leave on the wrong side of the geometric plane is mirrored at it, as if facets had
//! mirrors for walls. So white metal stays white and clear glass clear, also at the coarse corners of smooth-shaded
//! meshes, as with displaced geometry, and the picture stays continuous where the mirror direction crosses the horizon.
//! Light from `l` thus reaches a surface from two directions, `l` and its mirror image, if the shading normal faces both.
//! (Cycles tilts the normal until its mirror direction grazes the surface. That loses up to 45 % of the light, and the
//! tilt depends on the viewing direction, which photons do not know.)
//!
//! *Diffuse* light on a normal map, which stands for facets with walls between them, is shadowed like light on microfacets
//! whose roughness is the slope of the map \[Conty Estevez, Lecocq and Stein 2019, "A Microfacet-Based Shadowing Function
//! to Solve the Bump Terminator Problem"\]. As in Cycles, it fades out smoothly where it grazes the surface.

use crate::math::Vec3;

/// Share (0 to 1) of diffuse light from `l` that a normal map does not shadow, at a facet of normal `n`, where
/// `interpolated` is the normal without the map. All vectors are unit vectors.
#[inline]
pub(super) fn unshadowed(l: Vec3, n: Vec3, interpolated: Vec3) -> f32 {
    bump_shadowing(l.dot(interpolated) * l.dot(n).signum(), n.dot(interpolated))
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
        assert_eq!(unshadowed(l, n, interpolated), unshadowed(-l, n, interpolated));
    }
}
