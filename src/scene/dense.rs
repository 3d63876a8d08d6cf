//! Media that scatter within the way by which rays start off a surface ([`triangle_error`]): what happens in there would
//! not be seen, and all that comes from so near to the surface would be missing.
//!
//! A medium so dense looks as one without end, and what that sends back depends on albedo and phase function alone, not
//! on the density \[Chandrasekhar 1950, section 13: everything is told in optical depths\]. So it is taken to be as dense
//! as positions resolve, channel by channel, with the albedo that it has.

use crate::geometry::{Shapes, triangle_error};
use crate::material::{Materials, MediumParameters};
use crate::math::Rgb;

/// Most of a free path that may be skipped: a half-space of albedo 1/2 looks darker by twice as much.
const SKIPPED: f32 = 0.005;

/// Thins what is denser than positions resolve; a warning for each object that has such a medium, and for the space.
pub(super) fn thin(
    shapes: &Shapes,
    materials: &mut Materials,
    space: &mut Option<MediumParameters>,
    warnings: &mut Vec<String>,
) {
    let skipped = |instance: usize| {
        let instance = &shapes.instances[instance];
        let mesh = &shapes.meshes[instance.mesh as usize];
        let primitives = 0..mesh.triangles.len() as u32;
        primitives.map(|primitive| triangle_error(instance.corners(mesh, primitive))).fold(0.0, f32::max)
    };
    let mut farthest = vec![0f32; materials.list.len()];
    for (i, instance) in shapes.instances.iter().enumerate() {
        let medium = materials.list[instance.material as usize].medium;
        let Some(medium) = medium.filter(MediumParameters::scatters) else { continue };
        let skipped = skipped(i);
        if thinned(medium, skipped).is_some() {
            warnings.push(said(&format!("object \"{}\": its", instance.name), medium, skipped));
            let farthest = &mut farthest[instance.material as usize];
            *farthest = farthest.max(skipped);
        }
    }
    for (material, skipped) in materials.list.iter_mut().zip(farthest) {
        material.medium = material.medium.map(|medium| thinned(medium, skipped).unwrap_or(medium));
    }
    if let Some(medium) = space.as_mut().filter(|medium| medium.scatters()) {
        let skipped = (0..shapes.instances.len()).map(skipped).fold(0.0, f32::max);
        if let Some(thin) = thinned(*medium, skipped) {
            warnings.push(said("the scene's", *medium, skipped));
            *medium = thin;
        }
    }
}

fn said(whose: &str, medium: MediumParameters, skipped: f32) -> String {
    format!(
        "{whose} medium scatters light within {:.1e} m, and positions where it is are exact to {skipped:.1e} m: it is \
         taken to scatter within {:.1e} m, which looks the same where it is much thicker than that (make the scene \
         smaller otherwise)",
        1.0 / medium.sigma_t().max_element(),
        skipped / SKIPPED
    )
}

/// A medium as dense as positions off by `skipped` allow, if it is denser.
fn thinned(medium: MediumParameters, skipped: f32) -> Option<MediumParameters> {
    let (most, sigma_t) = (SKIPPED / skipped, medium.sigma_t());
    if !medium.scatters() || sigma_t.max_element() <= most {
        return None;
    }
    let sigma_t = sigma_t.min(Rgb::splat(f32::MAX));
    let factor = Rgb::select(sigma_t.cmpgt(Rgb::splat(most)), Rgb::splat(most) / sigma_t, Rgb::ONE);
    Some(MediumParameters { sigma_a: medium.sigma_a * factor, sigma_s: medium.sigma_s * factor, g: medium.g })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Channels are as dense as they may be, or as they were, and no albedo changes; what does not scatter is left alone.
    #[test]
    fn channels_keep_their_albedo() {
        let medium = MediumParameters { sigma_a: Rgb::new(1e20, 1.0, 0.0), sigma_s: Rgb::new(3e20, 1.0, 1e4), g: 0.5 };
        let thin = thinned(medium, SKIPPED * 1e-3).expect("it is denser");
        assert!((thin.sigma_t() - Rgb::new(1e3, 2.0, 1e3)).abs().max_element() < 1e-3);
        assert!((thin.sigma_s / thin.sigma_t() - Rgb::new(0.75, 0.5, 1.0)).abs().max_element() < 1e-6);
        assert_eq!(thin.g, 0.5);
        assert!(thinned(medium, 0.0).is_none());
        assert!(thinned(MediumParameters { sigma_s: Rgb::ZERO, ..medium }, 1.0).is_none());
        let endless = MediumParameters { sigma_s: Rgb::splat(f32::MAX), sigma_a: Rgb::splat(f32::MAX), g: 0.0 };
        assert!(thinned(endless, 1e-6).is_some_and(|thin| thin.scatters() && thin.sigma_t().is_finite()));
    }
}
