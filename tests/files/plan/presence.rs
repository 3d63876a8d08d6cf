//! The effects of a scene, and the objects that cause them.

use super::{floor, plan, plan_by};
use crate::support::scenes::{add, glass, matte, mirror, point_light, quad, sphere};
use caustique::material::{Material, MediumParameters};
use caustique::math::{DVec3, Rgb, Vec3};
use caustique::path_class::Effect;
use caustique::plan::{Plan, Search};
use caustique::scene::description::{EnvironmentDescription, EnvironmentSource};

fn present(plan: &Plan) -> String {
    let names = plan.effects.iter().filter(|effect| effect.present).map(|effect| effect.effect.name());
    names.collect::<Vec<_>>().join(" ")
}

#[test]
fn effects_are_there_for_reasons() {
    assert_eq!(present(&plan(floor())), "");
    let mut scene = floor();
    scene.lights = vec![point_light(DVec3::new(0.0, 3.0, 0.0), 10.0)];
    assert_eq!(present(&plan(scene.clone())), "direct indirect");
    // A diffuse light is visible; a mirror and glass focus its light, and show caustics.
    add(&mut scene, "Panel", quad(Vec3::new(0.0, 4.0, 0.0), Vec3::X, Vec3::Z), matte(0.0, 1.0));
    add(&mut scene, "Ball", sphere(Vec3::new(0.0, 1.0, 0.0), 0.5, 16), Material { dispersion: 0.3, ..glass(1.5) });
    add(&mut scene, "Disc", sphere(Vec3::new(2.0, 1.0, 0.0), 0.5, 16), mirror());
    let everything = plan(scene.clone());
    assert_eq!(present(&everything), "emission direct indirect caustic sds dispersion");
    // A perfect mirror and clear glass have no glossy reflection. A rough mirror has, and a coated one.
    let disc = scene.materials.len() - 1;
    for glossy in [Material { roughness: 0.1.into(), ..mirror() }, Material { clearcoat: 1.0.into(), ..mirror() }] {
        let mut scene = scene.clone();
        scene.materials[disc] = glossy;
        assert_eq!(present(&plan(scene)), "emission direct indirect glossy caustic sds dispersion");
    }
    let because = |effect: Effect| everything.effect(effect).because.join("; ");
    assert_eq!(because(Effect::Emission), "object \"Panel\"");
    assert_eq!(because(Effect::Direct), "object \"Panel\"; light \"point\"");
    assert_eq!(
        because(Effect::Indirect),
        "\"Floor\", \"Panel\", \"Ball\" and 1 more under object \"Panel\", light \"point\""
    );
    assert_eq!(
        because(Effect::Caustic),
        "material \"Ball\" on \"Ball\" under object \"Panel\", light \"point\"; \
         material \"Disc\" on \"Disc\" under object \"Panel\", light \"point\""
    );
    assert_eq!(
        because(Effect::Sds),
        "caustics seen through material \"Ball\" on \"Ball\"; caustics seen in material \"Disc\" on \"Disc\""
    );
    assert_eq!(
        (everything.effect(Effect::Caustic).by, everything.effect(Effect::Sds).by),
        (Some("photons"), Some("photons"))
    );
    assert!(everything.effect(Effect::Dispersion).simulated);
    // Photons find all light. Connections miss the light of a point lamp through glass, in an unknown amount.
    assert_eq!(everything.left_out_at_most, Some(0.0));
    assert_eq!(plan_by(scene.clone(), Search::Connections).left_out_at_most, None);
    // Without lights there are no effects.
    scene.lights.clear();
    scene.materials[1].emission = Rgb::ZERO;
    assert_eq!(present(&plan(scene)), "dispersion");
}

/// Photons carry glossy light only if it may come from lamps that sharp lobes show through clear glass or perfect
/// mirrors.
#[test]
fn photons_carry_gloss_only_of_lamps_behind_glass_or_mirrors() {
    let by = |lamp: bool, ball: Material, shining: Material| {
        let mut scene = floor();
        scene.lights = vec![point_light(DVec3::new(0.0, 3.0, 0.0), 10.0)];
        if lamp {
            add(&mut scene, "Panel", quad(Vec3::new(0.0, 4.0, 0.0), Vec3::X, Vec3::Z), matte(0.0, 1.0));
        }
        add(&mut scene, "Ball", sphere(Vec3::new(0.0, 1.0, 0.0), 0.5, 16), ball);
        add(&mut scene, "Disc", sphere(Vec3::new(2.0, 1.0, 0.0), 0.5, 16), shining);
        plan(scene).effect(Effect::Glossy).by
    };
    let brushed = Material { roughness: 0.3.into(), ..mirror() };
    let varnished = Material { clearcoat: 1.0.into(), clearcoat_roughness: 0.1.into(), ..matte(0.5, 0.0) };
    let frosted = Material { roughness: 0.2.into(), ..glass(1.5) };
    let both = Some("camera paths and photons");
    assert_eq!([&brushed, &varnished].map(|shining| by(true, glass(1.5), shining.clone())), [both; 2]);
    let camera_paths = Some("camera paths");
    assert_eq!(by(false, glass(1.5), brushed.clone()), camera_paths);
    assert_eq!(by(true, frosted, brushed.clone()), camera_paths);
    assert_eq!(by(true, matte(0.5, 0.0), brushed), camera_paths);
    assert_eq!(by(true, glass(1.5), Material { clearcoat: 1.0.into(), ..mirror() }), camera_paths);
}

#[test]
fn properties_of_the_scene() {
    let mut scene = floor();
    scene.environment =
        Some(EnvironmentDescription { source: EnvironmentSource::Color(Rgb::ONE), rotation_deg: 0.0, strength: 1.0 });
    let fog = MediumParameters { sigma_s: Rgb::splat(0.1), ..MediumParameters::default() };
    scene.medium = Some(fog);
    add(&mut scene, "Ball", sphere(Vec3::new(0.0, 1.0, 0.0), 0.5, 16), Material { medium: Some(fog), ..glass(1.5) });
    scene.cameras[0].aperture_radius = 0.1;
    let whole = plan(scene.clone());
    assert_eq!(present(&whole), "emission direct indirect caustic sds volume depth_of_field environment");
    let because = |effect: Effect| whole.effect(effect).because.join("; ");
    assert_eq!(because(Effect::Volume), "the scene's medium; the medium of material \"Ball\" on \"Ball\"");
    assert_eq!(because(Effect::DepthOfField), "the camera's aperture");
    // An environment of strength zero does not count.
    scene.environment.as_mut().expect("it is there").strength = 0.0;
    assert_eq!(present(&plan(scene)), "volume depth_of_field");
}

/// Lamps with a radius count as lights and have names, although they are built as spheres.
#[test]
fn lights_have_their_names() {
    let mut scene = floor();
    let mut bulb = point_light(DVec3::new(0.0, 3.0, 0.0), 10.0);
    (bulb.name, bulb.radius) = ("Bulb".into(), 0.1);
    let mut dark = point_light(DVec3::new(0.0, 3.0, 1.0), 0.0);
    dark.name = "Dark".into();
    scene.lights = vec![dark, bulb, point_light(DVec3::new(1.0, 3.0, 0.0), 1.0)];
    assert_eq!(plan(scene).effect(Effect::Direct).because, ["light \"Bulb\"", "light \"point\""]);
}
