//! Media whose mean free path is shorter than the offset of ray origins from a surface ([`triangle_error`]). Scattering
//! within the offset is skipped, so such media would look too dark.
//!
//! A medium this dense looks like a half-space of it. The reflectance of a half-space depends on albedo and phase
//! function alone, not on the density \[Chandrasekhar 1950, section 13: all lengths are optical depths\]. So the
//! density is reduced, channel by channel, to the highest that positions resolve; the albedo stays.

use crate::geometry::{Shapes, triangle_error};
use crate::material::{Material, Materials, MediumParameters};
use crate::math::Rgb;

/// Maximum share of a medium's mean free path that the offset of ray origins from surfaces may skip. A half-space of
/// albedo 1/2 gets darker by about twice this share.
const MAX_SKIPPED_SHARE: f32 = 0.005;

/// Reduces the density of media whose mean free path is too short for rounded positions, with a warning for each object
/// that contains one, and for the medium outside all solids.
pub(super) fn limit_densities(
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
        let material = &materials.list[instance.material as usize];
        let Some(medium) = material.medium.filter(MediumParameters::scatters) else { continue };
        let medium = medium.scaled(highest_density(material));
        let skipped = skipped(i);
        if limit_density(medium, skipped).is_some() {
            warnings.push(warning(&format!("object \"{}\": its", instance.name), medium, skipped));
            let farthest = &mut farthest[instance.material as usize];
            *farthest = farthest.max(skipped);
        }
    }
    for (material, skipped) in materials.list.iter_mut().zip(farthest) {
        let highest = highest_density(material);
        let limit =
            |medium: MediumParameters| Some(limit_density(medium.scaled(highest), skipped)?.scaled(1.0 / highest));
        material.medium = material.medium.map(|medium| limit(medium).unwrap_or(medium));
    }
    if let Some(medium) = space.as_mut().filter(|medium| medium.scatters()) {
        let skipped = (0..shapes.instances.len()).map(skipped).fold(0.0, f32::max);
        if let Some(limited) = limit_density(*medium, skipped) {
            warnings.push(warning("the scene's", *medium, skipped));
            *medium = limited;
        }
    }
}

/// The largest factor of a medium's coefficients: 1 for a homogeneous medium.
fn highest_density(material: &Material) -> f32 {
    material.grids.as_ref().map_or(1.0, |grids| grids.density.highest())
}

fn warning(owner: &str, medium: MediumParameters, skipped: f32) -> String {
    format!(
        "{owner} medium scatters light within {:.1e} m, and positions where it is are exact to {skipped:.1e} m: it is \
         taken to scatter within {:.1e} m, which looks the same where it is much thicker than that (make the scene \
         smaller otherwise)",
        1.0 / medium.sigma_t().max_element(),
        skipped / MAX_SKIPPED_SHARE
    )
}

/// The medium reduced to the highest extinction at which rays may skip `skipped` metres; `None` if the medium is not
/// denser.
fn limit_density(medium: MediumParameters, skipped: f32) -> Option<MediumParameters> {
    let (most, sigma_t) = (MAX_SKIPPED_SHARE / skipped, medium.sigma_t());
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

    /// Each channel gets the smaller of its own and the highest extinction, and keeps its albedo. A medium that does
    /// not scatter does not change.
    #[test]
    fn limited_densities_keep_the_albedo_of_each_channel() {
        let medium = MediumParameters { sigma_a: Rgb::new(1e20, 1.0, 0.0), sigma_s: Rgb::new(3e20, 1.0, 1e4), g: 0.5 };
        let thin = limit_density(medium, MAX_SKIPPED_SHARE * 1e-3).expect("it is denser");
        assert!((thin.sigma_t() - Rgb::new(1e3, 2.0, 1e3)).abs().max_element() < 1e-3);
        assert!((thin.sigma_s / thin.sigma_t() - Rgb::new(0.75, 0.5, 1.0)).abs().max_element() < 1e-6);
        assert_eq!(thin.g, 0.5);
        assert!(limit_density(medium, 0.0).is_none());
        assert!(limit_density(MediumParameters { sigma_s: Rgb::ZERO, ..medium }, 1.0).is_none());
        let overflowing = MediumParameters { sigma_s: Rgb::splat(f32::MAX), sigma_a: Rgb::splat(f32::MAX), g: 0.0 };
        assert!(limit_density(overflowing, 1e-6).is_some_and(|thin| thin.scatters() && thin.sigma_t().is_finite()));
    }
}
