//! Light groups. Each group has its own colour and nothing in the scene mixes colours, so that light in the wrong group
//! is detected exactly.

use crate::support;

use caustique::film::output::names;
use caustique::light::Group;
use caustique::math::{DVec3, Rgb, Vec3};
use caustique::render::output::layer_shape;
use caustique::render::{Control, Levels, Method, Rendered, Settings, Shard, render};
use caustique::scene::Scene;
use caustique::scene::description::{
    Description, EnvironmentDescription, EnvironmentSource, Linked, Links, PunctualKind, PunctualLight,
};
use std::sync::Arc;
use support::scenes::{add, build, glass, look_at, matte, mirror, point_light, quad, sphere, square};

/// A floor with a ball of glass and a mirror, seen at an angle. An emissive panel is red, a sphere light and a spot are
/// green, the sky and a sun are blue.
fn coloured() -> Description {
    let mut scene = Description::default();
    add(&mut scene, "floor", quad(Vec3::new(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0), matte(0.8, 0.0));
    add(&mut scene, "ball", sphere(Vec3::new(0.0, 0.6, 0.0), 0.5, 32), glass(1.5));
    add(&mut scene, "mirror", quad(Vec3::new(-2.0, 0.0, -1.5), Vec3::X * 4.0, Vec3::Y * 2.0), mirror());
    let mut red = matte(0.0, 0.0);
    red.emission = Rgb::new(9.0, 0.0, 0.0);
    add(&mut scene, "panel", quad(Vec3::new(0.5, 2.5, -0.5), Vec3::X, Vec3::Z), red);
    scene.instances[3].light_group = Some("panel".into());
    let green = |p: DVec3, radius: f32, kind: PunctualKind| PunctualLight {
        intensity: Rgb::new(0.0, 4.0, 0.0),
        radius,
        kind,
        light_group: Some("lamps".into()),
        ..point_light(p, 0.0)
    };
    let edge = caustique::light::SpotEdge::default();
    scene.lights.push(green(DVec3::new(-1.0, 2.0, 0.5), 0.1, PunctualKind::Point));
    scene.lights.push(green(DVec3::new(0.0, 3.0, 0.2), 0.0, PunctualKind::Spot { inner: 0.3, outer: 0.5, edge }));
    scene.lights.push(PunctualLight {
        intensity: Rgb::new(0.0, 0.0, 1.0),
        kind: PunctualKind::Sun { angle: 0.05 },
        light_group: Some("sky".into()),
        ..point_light(DVec3::ZERO, 0.0)
    });
    let source = EnvironmentSource::Color(Rgb::new(0.0, 0.0, 0.5));
    scene.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
    scene.environment_light_group = Some("sky".into());
    scene.cameras.push(look_at(DVec3::new(0.3, 1.6, 3.5), DVec3::new(0.0, 0.5, 0.0), 45.0));
    scene
}

fn picture(scene: &Scene, method: Method, shard: Shard) -> Rendered {
    let camera = scene.camera(&square(20)).expect("a camera");
    let levels = Levels::new(if method == Method::Vcm { 5 } else { 1 });
    let settings = Settings { method, levels, shard, iterations: Some(8), ..Settings::default() };
    render(scene, &camera, &settings, |_, _| Control::Continue)
}

const WHOLE: Shard = Shard { index: 0, count: 1 };

#[test]
fn each_group_has_its_colour_and_nothing_else_in_all_pixels_by_all_methods() {
    let scene = build(coloured());
    assert_eq!(scene.lights.groups().names, ["panel", "lamps", "sky"]);
    for method in Method::ALL.iter().copied().filter(|method| method.has_techniques()) {
        let rendered = picture(&scene, method, WHOLE);
        let own = rendered.settings.levels.picture_level();
        let mut seen = [[0.0; 2]; 3];
        for (index, pixel) in rendered.pixels.iter().enumerate() {
            let (all, caustic) = (pixel.mean(own), pixel.parts().caustic / f64::from(pixel.iterations));
            for (group, seen) in seen.iter_mut().enumerate() {
                // The colour of a group is the channel of its index.
                for ((light, whole), seen) in pixel.group(group).into_iter().zip([all, caustic]).zip(seen) {
                    let what = format!("{method:?}, pixel {index}, group {group}: {light} of {whole}");
                    assert!((light[group] - whole[group]).abs() <= 2e-6 * whole[group], "{what}");
                    assert!((0..3).all(|channel| channel == group || light[channel] == 0.0), "{what}");
                    *seen += light[group];
                }
            }
        }
        // Every group has light, but few paths find the caustics of a small lamp.
        let found = seen.map(|[all, caustic]| all > 0.0 && (caustic > 0.0 || method == Method::Path));
        assert_eq!(found, [true; 3], "{method:?}: {seen:?}");
    }
}

/// Lights without a group are in no layer, and the other methods have no layers of groups.
#[test]
fn light_without_a_group_is_left_out_and_layers_have_the_names_of_groups() {
    let mut description = coloured();
    description.lights.iter_mut().for_each(|light| light.light_group = None);
    let scene = build(description);
    let rendered = picture(&scene, Method::Bdpt, WHOLE);
    for pixel in &rendered.pixels {
        let [panel, sky] = [0, 1].map(|group| pixel.group(group)[0]);
        assert!(panel.y == 0.0 && sky.y == 0.0 && sky.z <= pixel.mean(0).z * (1.0 + 1e-6), "{panel} {sky}");
    }
    let of = |method| names(&layer_shape(&Settings { method, ..Settings::default() }, &scene));
    for name in ["LightGroup_panel", "Caustic_panel", "LightGroup_sky", "Caustic_sky"] {
        assert!(
            of(Method::Vcm).iter().any(|layer| layer == name) && !of(Method::Sppm).iter().any(|layer| layer == name)
        );
    }
    let plain = Description { environment_light_group: None, ..coloured() };
    let plain = Description {
        instances: plain
            .instances
            .into_iter()
            .map(|placed| caustique::scene::description::PlacedMesh { light_group: None, ..placed })
            .collect(),
        lights: plain.lights.into_iter().map(|light| PunctualLight { light_group: None, ..light }).collect(),
        ..plain
    };
    let without = picture(&build(plain), Method::Bdpt, WHOLE);
    let with = picture(&build(coloured()), Method::Bdpt, WHOLE);
    assert!(with.pixels.iter().zip(&without.pixels).all(|(a, b)| a.mean(0) == b.mean(0)), "groups change the picture");
}

#[test]
fn shards_join_their_groups_too() {
    let scene = build(coloured());
    let whole = picture(&scene, Method::Vcm, WHOLE);
    let [mut joined, other] = [0, 1].map(|index| picture(&scene, Method::Vcm, Shard { index, count: 2 }));
    for ((pixel, other), whole) in joined.pixels.iter_mut().zip(other.pixels).zip(&whole.pixels) {
        pixel.join(other);
        assert!((0..3).all(|group| pixel.group(group) == whole.group(group)));
    }
}

/// A panel that is dark at the frame keeps its group and its linking if it may shine at another moment.
#[test]
fn dark_panels_keep_their_group_and_linking_with_motion_blur() {
    for animated in [false, true] {
        let mut description = Description { shutter: Some([-0.5, 0.5]), animated, ..coloured() };
        let floor = Links { collections: vec!["floor".into()], ..Links::default() };
        let receivers = Linked { include: vec!["floor".into()], ..Linked::default() };
        let panel = Links { receivers, ..Links::default() };
        for (instance, links) in [(0, floor), (3, panel)] {
            description.instances[instance].links = Some(Arc::new(links));
        }
        let material = description.instances[3].material as usize;
        description.materials[material].emission = Rgb::ZERO;
        let scene = build(description);
        let kept = [scene.lights.object_group(3) != Group::NONE, !scene.lights.links().is_empty()];
        assert_eq!(kept, [animated; 2]);
    }
}
