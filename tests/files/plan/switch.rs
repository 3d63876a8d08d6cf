//! A scene with an effect switched off is rendered like a scene that never had it, to the bit, whether it is removed
//! from the description or from the scene.

use super::floor;
use crate::support::scenes::{add, build, glass, matte, point_light, quad, square};
use caustique::camera::Camera;
use caustique::material::{Alpha, Material, MediumParameters};
use caustique::math::{DVec3, Rgb, Vec2, Vec3};
use caustique::path_class::{Effect, EffectSet};
use caustique::plan::switch;
use caustique::render::output::layer_shape;
use caustique::render::{Control, Settings, render};
use caustique::scene::description::{EnvironmentDescription, EnvironmentSource};
use caustique::scene::{Description, Scene};
use caustique::texture::{Texels, Texture, TextureRef, Wrap};

/// The sums of a render, pixel by pixel.
fn picture(description: Description) -> String {
    let scene = build(description);
    let camera = scene.camera(&square(12)).expect("there is a camera");
    picture_of(&scene, &camera)
}

fn picture_of(scene: &Scene, camera: &Camera) -> String {
    let settings = Settings { iterations: Some(2), photons: 500, ..Settings::default() };
    let rendered = render(scene, camera, &settings, |_, _| Control::Continue);
    let layers = rendered.layers(&layer_shape(&rendered.settings, scene), |_| true).expect("there are layers");
    layers
        .layers
        .iter()
        .filter(|layer| layer.name.is_empty() || layer.name == "Noisy")
        .map(|layer| format!("{layer:?}"))
        .collect()
}

/// A pane over the floor under a lamp; `pane` is its material.
fn scene(pane: Material) -> Description {
    let mut description = floor();
    description.lights = vec![point_light(DVec3::new(0.5, 4.0, 0.0), 10.0)];
    let mut mesh = quad(Vec3::new(-1.0, 1.0, -1.0), Vec3::new(0.0, 0.0, 2.0), Vec3::new(2.0, 0.0, 0.0));
    mesh.uvs[0] = vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    add(&mut description, "Pane", mesh, pane);
    description
}

/// Checks that `with` has the effect, caused by `because`, that it differs from `without`, and that with the effect
/// switched off it equals `without`.
fn check(effect: Effect, mut with: Description, without: Description, because: &str) {
    let plain = picture(without);
    assert!(picture(with.clone()) != plain, "{effect:?} makes no difference");
    let scene = build(with.clone());
    let camera = scene.camera(&square(12)).expect("there is a camera");
    let left = match effect {
        Effect::DepthOfField => picture_of(&scene, &camera.without_lens()),
        _ => picture_of(&switch::without_effect(&scene, effect).expect("it is built"), &camera),
    };
    assert!(left == plain, "{effect:?} left out of the scene");
    let removed = switch::remove_effects(&mut with, EffectSet::from_iter([effect]));
    assert!(picture(with) == plain, "{effect:?}");
    assert_eq!(removed.because(effect), [because]);
}

fn texture(texels: &[[f32; 4]]) -> Texture {
    Texture {
        name: "tiles".into(),
        width: texels.len() as u32,
        height: 1,
        texels: Texels::Floats(texels.to_vec()),
        wrap: [Wrap::Repeat; 2],
        linear: false,
    }
}

const FIRST: TextureRef = TextureRef { texture: 0, set: 0, transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] };

#[test]
fn environment_and_lens() {
    let without = scene(matte(0.5, 0.0));
    let mut with = without.clone();
    let source = EnvironmentSource::Color(Rgb::ONE);
    with.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
    check(Effect::Environment, with, without.clone(), "the environment");
    let mut with = without.clone();
    with.cameras[0].aperture_radius = 0.5;
    check(Effect::DepthOfField, with, without, "the aperture of camera \"camera\"");
}

#[test]
fn media() {
    let medium = MediumParameters { sigma_a: Rgb::splat(0.1), sigma_s: Rgb::splat(0.1), g: 0.0 };
    let without = scene(glass(1.5));
    let mut with = without.clone();
    with.medium = Some(medium);
    check(Effect::Volume, with, without.clone(), "the scene's medium");
    let mut with = without.clone();
    with.materials[1].medium = Some(medium);
    check(Effect::Volume, with, without, "the medium of material \"Pane\" on \"Pane\"");
}

#[test]
fn cut_outs() {
    let without = scene(matte(0.5, 0.0));
    let mut with = without.clone();
    with.materials[1].alpha = Alpha::Blend;
    with.materials[1].base_color[3] = 0.5;
    check(Effect::Alpha, with, without, "material \"Pane\" on \"Pane\"");
}

#[test]
fn dispersion() {
    let without = scene(glass(1.5));
    let with = scene(Material { dispersion: 0.5, ..glass(1.5) });
    check(Effect::Dispersion, with, without, "material \"Pane\" on \"Pane\"");
}

/// A texture is replaced by its mean. Cut-outs are another effect and keep their texture.
#[test]
fn textures() {
    let tiles = texture(&[[1.0, 0.0, 0.5, 1.0], [0.0, 0.5, 0.5, 0.0]]);
    let mean = [0.5, 0.25, 0.5];
    let white = matte(0.8, 0.0);
    let mut with = scene(Material { base_color_texture: Some(FIRST), ..white.clone() });
    with.textures = vec![tiles.clone()];
    let flat = |alpha| Material { base_color: [0.8 * mean[0], 0.8 * mean[1], 0.8 * mean[2], alpha], ..white.clone() };
    check(Effect::Textures, with.clone(), scene(flat(1.0)), "material \"Pane\" on \"Pane\"");
    with.materials[1].alpha = Alpha::Mask(0.5);
    let mut without = scene(Material { base_color_texture: Some(FIRST), alpha: Alpha::Mask(0.5), ..flat(1.0) });
    without.textures = vec![texture(&[[1.0; 4], [1.0, 1.0, 1.0, 0.0]])];
    check(Effect::Textures, with, without, "material \"Pane\" on \"Pane\"");
    let mut with = scene(Material { emission_texture: Some(FIRST), emission: Rgb::splat(2.0), ..white.clone() });
    with.textures = vec![tiles];
    let without = scene(Material { emission: Rgb::new(1.0, 0.5, 1.0), ..white });
    check(Effect::Textures, with, without, "material \"Pane\" on \"Pane\"");
}

/// Classes of light paths are left out by the render, not removed from the scene.
#[test]
fn classes_of_paths_leave_the_scene_alone() {
    let mut description = scene(glass(1.5));
    let before = format!("{description:?}");
    let removed = switch::remove_effects(&mut description, EffectSet::from_iter([Effect::Caustic, Effect::Direct]));
    assert_eq!(format!("{description:?}"), before);
    assert!(removed.because(Effect::Caustic).is_empty());
}
