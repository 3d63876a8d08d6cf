//! Materials at surface points as the glTF specification defines them, and world-space BSDFs with shading normals.

use crate::support;

use bumpalo::Bump;
use caustique::bsdf::{Bsdf, EnergyTables, Interface, LobeSet, Parameters, Shading, Transport};
use caustique::geometry::Surface;
use caustique::material::{Input, Material};
use caustique::math::{DAffine3, DMat3, DVec3, Frame, Rgb, Vec2, Vec3, Vec4};
use caustique::path_class::Effect;
use caustique::plan::switch;
use caustique::random::mix;
use caustique::scene::Description;
use caustique::texture::{Texels, Texture, TextureRef, Wrap};
use rayon::prelude::*;
use support::scenes::{add_at, build, matte, quad};
use support::stats::{mean_and_error, t_critical};

const IDENTITY: [[f32; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

fn surface() -> Surface {
    Surface {
        p: Vec3::ZERO,
        ng: Vec3::Z,
        ns: Vec3::Z,
        tangent: Vec4::new(1.0, 0.0, 0.0, 1.0),
        uv: [Vec2::splat(0.5); 2],
        color: Vec4::ONE,
        instance: 0,
        primitive: 0,
        material: 0,
        error: 0.0,
        touching: false,
    }
}

/// One texel of four values.
fn texel(value: [f32; 4]) -> Texture {
    Texture {
        name: String::new(),
        width: 1,
        height: 1,
        texels: Texels::Floats(vec![value]),
        wrap: [Wrap::Repeat; 2],
        linear: true,
    }
}

fn reference(texture: u32) -> Option<TextureRef> {
    Some(TextureRef { texture, set: 0, transform: IDENTITY })
}

/// An input that the first texture multiplies.
fn textured<T, const CHANNEL: usize>(factor: T) -> Input<T, CHANNEL> {
    Input { factor, texture: reference(0) }
}

#[test]
fn factors_textures_and_vertex_colours_multiply() {
    let textures = [texel([0.5, 0.25, 0.75, 0.4]), texel([f32::NAN, 4.0, -1.0, 0.0])];
    let material = Material {
        base_color: [1.0, 0.8, 0.5, 0.5],
        base_color_texture: reference(0),
        metallic: textured(0.8),
        roughness: textured(0.9),
        transmission: textured(0.5),
        specular: textured(0.5),
        specular_color: textured(Rgb::ONE),
        clearcoat: textured(0.5),
        clearcoat_roughness: textured(0.8),
        sheen_color: textured(Rgb::splat(0.5)),
        sheen_roughness: textured(0.5),
        emission: Rgb::splat(2.0),
        emission_texture: reference(0),
        ..Material::default()
    };
    let surface = Surface { color: Vec4::new(0.5, 1.0, 1.0, 0.5), ..surface() };
    let p = material.parameters(&surface, &textures, 1.5);
    let near = |a: f32, b: f32| assert!((a - b).abs() < 1e-6, "{a} is not {b}");
    assert!((p.base_color - Rgb::new(0.25, 0.2, 0.375)).length() < 1e-6);
    near(p.metallic, 0.8 * 0.75);
    near(p.alpha_x, (0.9f32 * 0.25).powi(2));
    near(p.transmission, 0.25);
    near(p.specular, 0.2);
    assert_eq!(p.specular_color, Rgb::new(0.5, 0.25, 0.75));
    near(p.clearcoat, 0.25);
    near(p.clearcoat_alpha, (0.8f32 * 0.25).powi(2));
    assert_eq!(p.sheen_color, Rgb::new(0.25, 0.125, 0.375));
    near(p.sheen_alpha, (0.5f32 * 0.4).powi(2));
    near(material.alpha(&surface, &textures), 0.5 * 0.5 * 0.4);
    assert_eq!(material.emitted(&surface, &textures), Rgb::new(1.0, 0.5, 1.5));
    // Invalid texels are clamped.
    let bad = Material {
        base_color_texture: reference(1),
        metallic: Input { texture: reference(1), ..material.metallic },
        roughness: Input { texture: reference(1), ..material.roughness },
        ..material.clone()
    };
    let p = bad.parameters(&surface, &textures, 1.5);
    assert_eq!((p.base_color, p.metallic), (Rgb::new(0.0, 1.0, 0.0), 0.0));
    assert!(p.alpha_x <= 1.0);
    // A missing texture is white.
    let missing = Material { base_color_texture: reference(9), ..Material::default() };
    assert_eq!(missing.parameters(&self::surface(), &textures, 1.5).base_color, Rgb::ONE);
}

/// Diffuse roughness and the index and colour of the coat follow their textures, as do the emission below the coat and
/// the means that replace textures.
#[test]
fn rough_diffuse_reflection_and_coats_follow_their_textures() {
    let material = Material {
        diffuse_roughness: textured(0.8),
        clearcoat: 0.5.into(),
        clearcoat_ior: textured(2.0),
        clearcoat_color: textured(Rgb::new(1.0, 0.8, 0.5)),
        emission: Rgb::splat(2.0),
        ..Material::default()
    };
    let textures = [texel([0.5, 0.25, 1.0, 0.4])];
    let p = material.parameters(&surface(), &textures, 1.5);
    assert_eq!((p.diffuse_roughness, p.clearcoat_eta), (0.4, 1.5));
    assert_eq!(p.clearcoat_color, Rgb::new(0.5, 0.2, 0.5));
    // What passes half a coat once, along the mean path in it.
    let path = 2.25 * (1.0 - (1.0f32 - 1.0 / 2.25).sqrt());
    let passed = p.clearcoat_color.map(|c| 0.5 + 0.5 * c.powf(path));
    assert!((material.emitted(&surface(), &textures) - passed * 2.0).length() < 1e-6);
    assert!(material.has_textured_emission() && !material.has_plain_interface());
    let mut description = Description::default();
    let corners = quad(Vec3::ZERO, Vec3::X, Vec3::Y);
    add_at(&mut description, "quad", corners, material, DAffine3::IDENTITY);
    description.textures = textures.to_vec();
    let flat = switch::without_effect(&build(description), Effect::Textures).unwrap();
    let (flat, none) = (&flat.materials.list[0], &[]);
    assert_eq!(flat.textures().count(), 0);
    assert_eq!(flat.parameters(&surface(), none, 1.5), p);
    assert!((flat.emitted(&surface(), none) - passed * 2.0).length() < 1e-6);
    // A texture of the strength alone: there is no coat where it is black.
    let mut masked = Material {
        clearcoat: Input { factor: 1.0, texture: reference(0) },
        clearcoat_color: Rgb::splat(0.5).into(),
        emission: Rgb::ONE,
        ..Material::default()
    };
    masked.tint_emission();
    for (mask, expected) in [(0.0, 1.0), (1.0, 0.5f32.powf(0.5728))] {
        let emitted = masked.emitted(&surface(), &[texel([mask, 0.0, 0.0, 1.0])]);
        assert!((emitted - Rgb::splat(expected)).length() < 1e-3, "{mask}: {emitted}");
    }
    // Without textures the reader has tinted the emission.
    let mut plain = Material { clearcoat: 1.0.into(), clearcoat_color: Rgb::splat(0.5).into(), ..Material::default() };
    plain.emission = Rgb::ONE;
    plain.tint_emission();
    assert!((plain.emitted(&surface(), none) - Rgb::splat(0.5f32.powf(0.5728))).length() < 1e-3);
}

/// White below a coat stays white for every index that a texture gives, between those of the tables.
#[test]
fn textured_coats_lose_no_energy() {
    let coated = Material {
        clearcoat: 1.0.into(),
        clearcoat_roughness: 0.3.into(),
        clearcoat_ior: textured(2.4),
        ..matte(1.0, 0.0)
    };
    let tables = EnergyTables::for_materials(std::slice::from_ref(&coated));
    let worst = |tables: &EnergyTables| {
        let errors = (0..64u64).map(|k| {
            let share = (mix(k) >> 40) as f32 / 16_777_216.0;
            let p = coated.parameters(&surface(), &[texel([share, 0.0, 0.0, 0.0])], 1.5);
            let interface = Interface::new(&p, tables);
            let bsdf = Bsdf::from_shares(p.base_color, p.metallic, p.transmission, &interface);
            let cos = 0.05 + 0.95 * (mix(k + 64) >> 40) as f32 / 16_777_216.0;
            let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
            let mut sum = 0.0;
            const SIDE: u32 = 128;
            for i in 0..SIDE * SIDE {
                let [lobe, x, y] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_3]
                    .map(|a| (f64::from(i) * a + 0.5).fract() as f32);
                let drawn = bsdf.sample(wo, Transport::Radiance, LobeSet::ALL, lobe, Vec2::new(x, y));
                sum += drawn.map_or(0.0, |s| f64::from(s.weight.x));
            }
            (sum / f64::from(SIDE * SIDE) - 1.0).abs()
        });
        errors.fold(0.0, f64::max)
    };
    let found = worst(&tables);
    assert!(found < 0.006, "{found}");
    // The tables of the largest index alone are rejected.
    let untextured = Material { clearcoat_ior: 2.4.into(), ..coated.clone() };
    assert!(worst(&EnergyTables::for_materials(&[untextured])) > 0.02);
}

/// A map of the clear coat's normals does not turn the base. Without a coat it has no effect.
#[test]
fn the_coat_has_its_own_normal_map() {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let textures = [texel([0.5 + 0.5 * half, 0.5, 0.5 + 0.5 * half, 1.0])];
    let map = reference(0).map(|r| (r, 1.0));
    let material = Material { clearcoat: 1.0.into(), clearcoat_normal_texture: map, ..Material::default() };
    assert!((material.coat_normal(&surface(), &textures) - Vec3::new(half, 0.0, half)).length() < 1e-5);
    assert_eq!(material.shading_frame(&surface(), &textures).n, Vec3::Z);
    assert_eq!(Material { clearcoat: 0.0.into(), ..material }.coat_normal(&surface(), &textures), Vec3::Z);
}

/// Diffuse transmission is A of its texture, on thin sheets only.
#[test]
fn diffuse_transmission_follows_its_textures() {
    let textures = [texel([0.5, 0.25, 0.75, 0.4])];
    let sheet = Material {
        diffuse_transmission: textured(0.5),
        diffuse_transmission_color: textured(Rgb::ONE),
        ..Material::default()
    };
    let p = sheet.parameters(&surface(), &textures, 1.5);
    assert_eq!((p.diffuse_transmission, p.diffuse_transmission_color), (0.2, Rgb::new(0.5, 0.25, 0.75)));
    assert!(sheet.transmits() && !sheet.is_solid() && !sheet.has_plain_interface());
    let solid = Material { thin: false, transmission: 0.5.into(), ..sheet };
    assert_eq!(solid.parameters(&surface(), &textures, 1.5).diffuse_transmission, 0.2);
    assert!(solid.is_solid() && Material { transmission: 0.0.into(), ..solid }.is_solid());
}

/// The thickness of a thin film is interpolated by G, without a texture it is the maximum, and its index is relative to
/// the medium around the surface.
#[test]
fn thin_films_follow_their_textures() {
    let textures = [texel([0.5, 0.25, 0.75, 0.4])];
    let plain = Material { iridescence: 0.8.into(), iridescence_ior: 1.6, ..Material::default() };
    let textured =
        Material { iridescence: textured(0.8), iridescence_thickness: textured([100.0, 500.0]), ..plain.clone() };
    let p = textured.parameters(&surface(), &textures, 1.5);
    assert_eq!((p.film, p.film_eta, p.film_path), (0.4, 1.6, 2.0 * 1.6 * 200.0));
    assert!(!textured.has_plain_interface() && textured.textures().count() == 2);
    let p = plain.parameters(&surface(), &textures, 1.5 / 1.25);
    assert!((p.film_eta - 1.6 / 1.25).abs() < 1e-6 && p.film_path == 2.0 * 1.6 * 400.0);
    assert_eq!(Material::default().parameters(&surface(), &textures, 1.5).film, 0.0);
}

#[test]
fn unlit_gives_its_base_colour_and_scatters_nothing() {
    let material = Material { unlit: true, base_color: [0.2, 0.4, 0.6, 1.0], ..Material::default() };
    assert_eq!(material.emitted(&surface(), &[]), Rgb::new(0.2, 0.4, 0.6));
    let tables = EnergyTables::for_materials(std::slice::from_ref(&material));
    assert_eq!(support::bsdf(&material.parameters(&surface(), &[], 1.5), &tables).lobes(), LobeSet::empty());
}

#[test]
fn anisotropy_widens_along_its_direction() {
    let material =
        Material { anisotropy: 0.5, anisotropy_rotation: std::f32::consts::FRAC_PI_2, ..Material::default() };
    let material = Material { roughness: 0.4.into(), ..material };
    let p = material.parameters(&surface(), &[], 1.5);
    assert!((p.alpha_x - (0.16 + 0.84 * 0.25)).abs() < 1e-6 && (p.alpha_y - 0.16).abs() < 1e-6);
    let frame = material.shading_frame(&surface(), &[]);
    assert!((frame.t - Vec3::Y).length() < 1e-6 && (frame.n - Vec3::Z).length() < 1e-6);
}

#[test]
fn normal_maps_turn_the_frame_and_stay_on_the_side() {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let textures = [texel([0.5 + 0.5 * half, 0.5, 0.5 + 0.5 * half, 1.0]), texel([1.0, 0.5, 0.5, 1.0])];
    let with = |i: u32| Material { normal_texture: reference(i).map(|r| (r, 1.0)), ..Material::default() };
    let n = with(0).shading_frame(&surface(), &textures).n;
    assert!((n - Vec3::new(half, 0.0, half)).length() < 1e-5, "{n}");
    let n = with(1).shading_frame(&surface(), &textures).n;
    assert!(n.z > 0.0 && n.is_normalized(), "{n}");
    // Without tangents the normal map is ignored.
    let bare = Surface { tangent: Vec4::ZERO, ..surface() };
    assert_eq!(with(0).shading_frame(&bare, &textures).n, Vec3::Z);
}

/// A mirrored node shows the mirror image: the frame of a normal map with anisotropy, under random rotations with and
/// without a reflection, for a mesh with one instance and with two.
#[test]
fn frames_of_mirrored_nodes_are_mirror_images() {
    let material = Material {
        normal_texture: reference(0).map(|r| (r, 1.0)),
        anisotropy: 0.5,
        anisotropy_rotation: 0.7,
        ..Material::default()
    };
    let textures = || vec![texel([0.6, 0.8, 0.9, 1.0])];
    let mut mesh = quad(Vec3::ZERO, Vec3::X, Vec3::Y);
    mesh.normals = vec![Vec3::new(0.1, -0.2, 1.0).normalize(); 4];
    for (seed, handedness) in (0..32).flat_map(|seed| [(seed, 1.0), (seed, -1.0)]) {
        mesh.tangents = vec![Vec4::new(0.8, 0.6, 0.0, handedness); 4];
        let angle = |k: u64| (mix(7 * seed + k) % 1000) as f64 * 0.00628;
        let turn = DMat3::from_euler(glam::EulerRot::XYZ, angle(0), angle(1), angle(2));
        let mirrored = seed % 2 == 1;
        let flip = DMat3::from_diagonal(DVec3::new(if mirrored { -1.0 } else { 1.0 }, 1.0, 1.0));
        let to_world = DAffine3::from_mat3(turn * flip * DMat3::from_euler(glam::EulerRot::XYZ, angle(3), 0.4, 1.1));
        for shared in [false, true] {
            let mut description = Description { textures: textures(), ..Description::default() };
            add_at(&mut description, "mapped", mesh.clone(), material.clone(), to_world);
            if shared {
                description.instances.push(description.instances[0].clone());
            }
            let scene = build(description);
            let own = Surface { uv: [Vec2::ZERO; 2], ns: mesh.normals[0], tangent: mesh.tangents[0], ..surface() };
            let expected = material.shading_frame(&own, &textures());
            let seen = scene.shapes.surface(0, 0, [0.3, 0.3]).expect("a surface");
            let frame = scene.materials.list[0].shading_frame(&seen, &scene.materials.textures);
            for (found, expected) in [(frame.n, expected.n), (frame.t, expected.t)] {
                let expected = to_world.transform_vector3(expected.as_dvec3()).as_vec3();
                assert!((found - expected).length() < 1e-4, "{seed}, {shared}: {found} is not {expected}");
            }
        }
    }
}

/// Thirty glasses of one roughness compute no row before two of them touch. Then the two rows adjacent to that
/// roughness are computed for both sides, and for index 1.5, which gives the loss of facets. Their values do not depend
/// on when or by which thread they are computed.
#[test]
fn rows_are_computed_at_first_use() {
    let glass = |i: usize| {
        let ior = 1.3 + 0.037 * i as f32;
        Material {
            ior,
            metallic: 0.0.into(),
            roughness: 0.5.into(),
            transmission: 1.0.into(),
            thin: false,
            ..Material::default()
        }
    };
    let materials: Vec<Material> = (0..30).map(glass).collect();
    assert!(materials.iter().all(Material::is_solid));
    let tables = EnergyTables::for_materials(&materials);
    assert_eq!(tables.row_count(), 0);
    let eta = materials[3].ior / materials[21].ior;
    let p = materials[3].parameters(&surface(), &[], eta);
    let early = format!("{:?}", Interface::new(&p, &EnergyTables::new([eta])));
    let made = |_| format!("{:?}", Interface::new(&p, &tables));
    let all: Vec<String> = (0..16).into_par_iter().map(made).collect();
    assert!(all.iter().all(|late| *late == early));
    assert_eq!(tables.row_count(), 2 * 2 + 2);
}

/// Creates the shading for a viewing direction.
type Shade<'a> = &'a dyn Fn(Vec3) -> Shading<'a>;

/// Calls `check` with a tilted shading normal and a function that creates the shading for a viewing direction.
fn tilted(p: &Parameters, tables: &EnergyTables, check: impl Fn(Vec3, Shade<'_>)) {
    let n = Vec3::new(0.5, 0.1, 0.8).normalize();
    let bsdf = support::bsdf(p, tables);
    check(n, &|wo| Shading::new(Frame::from_normal(n), Vec3::Z, bsdf, wo));
}

/// [`tilted`], and again with a steep normal map on a surface whose interpolated normal is tilted, too, with and without
/// another map for the clear coat.
fn tilted_and_mapped(p: &Parameters, tables: &EnergyTables, check: impl Fn(Vec3, Shade<'_>)) {
    tilted(p, tables, &check);
    let (n, smooth) = (Vec3::new(0.8, 0.1, 0.5).normalize(), Vec3::new(-0.1, 0.05, 1.0).normalize());
    let (bsdf, arena) = (support::bsdf(p, tables), Bump::new());
    for coat in [smooth, Vec3::new(0.1, -0.4, 0.9).normalize()] {
        check(n, &|wo| Shading::new(Frame::from_normal(n), Vec3::Z, bsdf, wo).with_normal_map(smooth, coat, &arena));
    }
}

fn direction(k: u64) -> Vec3 {
    let u = |salt: u64| (mix(k * 3 + salt) >> 40) as f32 / 16_777_216.0;
    let z = 2.0 * u(1) - 1.0;
    let phi = std::f32::consts::TAU * u(2);
    let r = (1.0 - z * z).sqrt();
    Vec3::new(r * phi.cos(), r * phi.sin(), z)
}

/// A diffuse surface with a steep normal map is as bright from the side as from the front, also where its normal faces
/// away from the viewer. Light from behind the normal is not scattered; all other light is, in both transport modes:
/// white stays white, within five standard errors of 400,000 samples.
#[test]
fn steep_normals_are_not_black_from_the_side() {
    let tables = EnergyTables::new([1.5]);
    let matte = Parameters { base_color: Rgb::ONE, ..Parameters::default() };
    let (viewer, front) = (Vec3::new(-0.95, 0.0, 0.31).normalize(), Vec3::new(0.3, 0.0, 0.95).normalize());
    tilted(&matte, &tables, |n, shading| {
        assert!(viewer.dot(n) < -0.1 && viewer.z > 0.2);
        let value =
            |wo: Vec3| shading(wo).eval_cos(Vec3::new(0.4, 0.2, 0.9).normalize(), Transport::Radiance, LobeSet::ALL).x;
        assert!(value(front) > 0.2 && (value(viewer) / value(front) - 1.0).abs() < 1e-5);
        let behind = shading(front).eval_cos(viewer, Transport::Radiance, LobeSet::ALL);
        assert_eq!(behind, Rgb::ZERO);
        let u = |k: u64, salt: u64| (mix(mix(k) ^ salt) >> 40) as f32 / 16_777_216.0;
        let drawn =
            |k: u64| shading(front).sample(Transport::Importance, LobeSet::ALL, u(k, 7), Vec2::new(u(k, 8), u(k, 9)));
        // Veach's adjoint is per geometric cosine. Divided by it, each sample has the albedo as its weight.
        let carried = |s: caustique::bsdf::BsdfSample| {
            let (cos_s, cos_g) = (s.wi.dot(n).abs(), s.wi.z.abs());
            f64::from(s.weight.x * cos_s / cos_g * front.z / front.dot(n))
        };
        let weights: Vec<f64> = (0..40_000).map(|k| drawn(k).map_or(0.0, carried)).collect();
        let (mean, error) = mean_and_error(&weights);
        println!("{mean} +- {error}");
        assert!((mean - 1.0).abs() < 5.0 * error + 1e-3, "{mean} +- {error}");
        let sideways = (0..40_000).filter_map(drawn).filter(|s| s.wi.dot(n) < 0.0).count();
        assert!(sideways > 1000, "{sideways} draws go where only the opposite of the shading plane is");
    });
}

/// Metal with a steep normal map, or at the coarse corners of a smooth-shaded mesh, has no black spots: light that would
/// be reflected into the surface is mirrored out of it. White metal is white within five standard errors of 40,000
/// samples; without the correction a fifth of it would be black. A mirror is symmetric between lamp and camera.
#[test]
fn steep_metal_is_not_black() {
    let (tables, arena) = (EnergyTables::new([1.5]), Bump::new());
    let metal = Parameters { base_color: Rgb::ONE, metallic: 1.0, alpha_x: 0.3, alpha_y: 0.3, ..Parameters::default() };
    let mirror = Parameters { alpha_x: 0.0, alpha_y: 0.0, ..metal };
    let n = Vec3::new(0.8, 0.0, 0.6);
    let shading = |p: &Parameters, wo| Shading::new(Frame::from_normal(n), Vec3::Z, support::bsdf(p, &tables), wo);
    let u = |k: u64, salt: u64| (mix(mix(k) ^ salt) >> 40) as f32 / 16_777_216.0;
    let seen = |shading: Shading<'_>, counts: &dyn Fn(Vec3) -> bool| {
        let draw = |k| shading.sample(Transport::Radiance, LobeSet::ALL, u(k, 7), Vec2::new(u(k, 8), u(k, 9)));
        let counted = |k| draw(k).filter(|s| counts(s.wi)).map_or(0.0, |s| f64::from(s.weight.x));
        mean_and_error(&(0..40_000).map(counted).collect::<Vec<f64>>())
    };
    for wo in [Vec3::Z, Vec3::new(0.0, 0.8, 0.6), Vec3::new(-0.28, 0.0, 0.96), Vec3::new(-0.96, 0.0, 0.28)] {
        let corner = shading(&metal, wo);
        for shading in [corner, corner.with_normal_map(Vec3::Z, Vec3::Z, &arena)] {
            let (mean, error) = seen(shading, &|_| true);
            println!("{wo}: {mean} +- {error}");
            assert!((mean - 1.0).abs() < 5.0 * error + 5e-3, "{wo}: {mean} +- {error}");
        }
    }
    let facet = Shading::new(Frame::from_normal(n), n, support::bsdf(&metal, &tables), Vec3::Z);
    assert!(seen(facet, &|wi| wi.z > 0.0).0 < 0.8, "no power");
    // The mirror direction of the facet is below the surface. Mirrored at the surface it is the direction of the lamp.
    let wo = Vec3::Z;
    let below = n * (2.0 * n.dot(wo)) - wo;
    let lamp = Vec3::new(below.x, below.y, -below.z);
    assert!(below.z < -0.2);
    let to_lamp = shading(&mirror, wo).with_normal_map(Vec3::Z, Vec3::Z, &arena).sample(
        Transport::Radiance,
        LobeSet::ALL,
        0.5,
        Vec2::splat(0.5),
    );
    let to_lamp = to_lamp.expect("a mirror's direction");
    assert!((to_lamp.wi - lamp).length() < 1e-5 && (to_lamp.weight.x - 1.0).abs() < 1e-5, "{to_lamp:?}");
    let lit = shading(&mirror, lamp).with_normal_map(Vec3::Z, Vec3::Z, &arena);
    let draw = |u| lit.sample(Transport::Importance, LobeSet::ALL, u, Vec2::splat(0.5));
    let to_eye = [0.25, 0.75].map(draw).into_iter().flatten().find(|s| (s.wi - wo).length() < 1e-5).expect("the eye");
    // One of two directions is sampled with the probability 1/2, and its weight is per geometric cosine.
    assert!((0.5 * to_eye.weight.x - wo.z / lamp.z).abs() < 1e-4 && to_eye.pdf_w == 0.5, "{to_eye:?}");
}

/// Diffuse light on a steep normal map is shadowed \[Conty Estevez 2019\]: for light whose cosine with the surface is
/// 0.1, a facet tilted by 60 degrees receives 2 / (1 + sqrt(1 + 3/8 tan^2)). White under a uniform white sky is as
/// bright as in Cycles 4.5, which renders 0.943, 0.744, 0.565, 0.421 for tilts of 20, 45, 60 and 70 degrees.
#[test]
fn relief_shadows_its_own_diffuse_light() {
    let (tables, arena) = (EnergyTables::new([1.5]), Bump::new());
    let plain = Parameters { base_color: Rgb::ONE, specular: 0.0, ..Parameters::default() };
    let leaning = |degrees: f32| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let frame = Frame::from_normal(Vec3::new(sin, 0.0, cos));
        Shading::new(frame, Vec3::Z, support::bsdf(&plain, &tables), Vec3::Z)
    };
    let bare = leaning(60.0);
    let x = (0.5 - 0.05) / bare.frame.n.x;
    let lamp = Vec3::new(x, (1.0 - x * x - 0.01f32).sqrt(), 0.1);
    let lit = |s: Shading<'_>| s.eval_cos(lamp, Transport::Radiance, LobeSet::ALL).x;
    assert!((lit(bare) - 0.5 / std::f32::consts::PI).abs() < 1e-5);
    let expected = 2.0 / (1.0 + (1.0 + 0.375 * 99.0f32).sqrt());
    assert!((lit(bare.with_normal_map(Vec3::Z, Vec3::Z, &arena)) / lit(bare) - expected).abs() < 1e-4);
    let u = |k: u64, salt: u64| (mix(mix(k) ^ salt) >> 40) as f32 / 16_777_216.0;
    for (lean, cycles) in [(20.0, 0.943), (45.0, 0.744), (60.0, 0.565), (70.0, 0.421)] {
        let shading = leaning(lean).with_normal_map(Vec3::Z, Vec3::Z, &arena);
        let draw = |k| shading.sample(Transport::Radiance, LobeSet::ALL, u(k, 7), Vec2::new(u(k, 8), u(k, 9)));
        let drawn: Vec<f64> = (0..40_000).map(|k| draw(k).map_or(0.0, |s| f64::from(s.weight.x))).collect();
        let (mean, error) = mean_and_error(&drawn);
        let critical = t_critical(1e-3, 4, drawn.len() as f64 - 1.0);
        assert!((mean - cycles).abs() < critical * error + 1e-3, "{lean}: {mean} +- {error}, {cycles}");
        assert!((mean - 1.05 * cycles).abs() > critical * error + 1e-3, "no power");
    }
}

/// A normal map does not affect a clear coat: on black the coat reflects as without the map, from all directions and in
/// both transport modes, and on white it adds no energy.
#[test]
fn a_clear_coat_keeps_its_own_normal() {
    let (tables, arena) = (EnergyTables::new([1.5]), Bump::new());
    let u = |k: u64, salt: u64| (mix(mix(k) ^ salt) >> 40) as f32 / 16_777_216.0;
    let upper = |k: u64| Vec3::new(direction(k).x, direction(k).y, direction(k).z.abs());
    for clearcoat_alpha in [0.0, 0.16] {
        let white = Parameters { clearcoat: 1.0, clearcoat_alpha, ..Parameters::default() };
        let black = Parameters { base_color: Rgb::ZERO, ..white };
        let shading = |p: &Parameters, n: Vec3, wo| {
            let bare = Shading::new(Frame::from_normal(n), Vec3::Z, support::bsdf(p, &tables), wo);
            bare.with_normal_map(Vec3::Z, Vec3::Z, &arena)
        };
        for k in 0..200 {
            let (wo, wi, n) = (upper(3 * k), upper(3 * k + 1), upper(3 * k + 2));
            let [plain, mapped] = [Vec3::Z, n].map(|n| shading(&black, n, wo));
            for transport in [Transport::Radiance, Transport::Importance] {
                let [a, b] = [&plain, &mapped].map(|shading| shading.evaluate_cos(wi, transport, LobeSet::ALL));
                assert!((a.0 - b.0).length() <= 1e-4 * a.0.length() && (a.1 - b.1).abs() <= 1e-4 * a.1, "{a:?} {b:?}");
                let draw = |shading: &Shading<'_>| shading.sample(transport, LobeSet::ALL, 0.5, Vec2::new(0.3, 0.6));
                let (a, b) = (draw(&plain), draw(&mapped));
                assert_eq!(a.is_some(), b.is_some());
                if let (Some(a), Some(b)) = (a, b) {
                    assert!((a.wi - b.wi).length() < 1e-4 && (a.weight - b.weight).length() < 1e-3, "{a:?} {b:?}");
                }
            }
        }
        // A map of the coat alone tilts the coat, which mirrors nothing.
        for k in 0..200 {
            let (wo, wi, n) = (upper(3 * k), upper(3 * k + 1), upper(3 * k + 2));
            if [wo, wi].iter().any(|w| Vec3::new(w.x, w.y, -w.z).dot(n) > 0.0) {
                continue;
            }
            let on = |n| Shading::new(Frame::from_normal(n), Vec3::Z, support::bsdf(&black, &tables), wo);
            let (tilted, mapped) = (on(n), on(Vec3::Z).with_normal_map(Vec3::Z, n, &arena));
            for transport in [Transport::Radiance, Transport::Importance] {
                let [a, b] = [&tilted, &mapped].map(|shading| shading.evaluate_cos(wi, transport, LobeSet::ALL));
                assert!((a.0 - b.0).length() <= 1e-4 * a.0.length() && (a.1 - b.1).abs() <= 1e-4 * a.1, "{a:?} {b:?}");
            }
        }
        for k in 0..20 {
            let shading = shading(&white, upper(2 * k), upper(2 * k + 1));
            let weight = |k| {
                let drawn = shading.sample(Transport::Radiance, LobeSet::ALL, u(k, 7), Vec2::new(u(k, 8), u(k, 9)));
                drawn.map_or(0.0, |s| f64::from(s.weight.x))
            };
            let (mean, error) = mean_and_error(&(0..4000).map(weight).collect::<Vec<f64>>());
            assert!(mean < 1.01 + 4.0 * error, "{mean} +- {error}");
        }
    }
}

/// With shading normals, both transport modes evaluate the same function: exchanging directions exchanges radiance and
/// importance per geometric cosine \[Veach 1997, 5.3\]. No light leaks through an opaque surface, and photons are
/// weighted consistently.
#[test]
fn shading_normals_treat_radiance_and_importance_alike() {
    let tables = EnergyTables::new([1.5]);
    let plastic = Parameters { specular: 1.0, alpha_x: 0.3, alpha_y: 0.3, ..Parameters::default() };
    let glass = Parameters { transmission: 1.0, ..plastic };
    let coated = Parameters { clearcoat: 0.8, clearcoat_alpha: 0.3, ..plastic };
    let sheet = Parameters { diffuse_transmission: 0.4, ..coated };
    for p in [Parameters::default(), plastic, glass, coated, sheet] {
        tilted_and_mapped(&p, &tables, |_, shading| {
            for k in 0..4000 {
                let (wo, wi) = (direction(2 * k), direction(2 * k + 1));
                let radiance = shading(wo).eval_cos(wi, Transport::Radiance, LobeSet::ALL);
                let importance = shading(wi).eval_cos(wo, Transport::Importance, LobeSet::ALL);
                // Radiance: f*(wi -> wo) |cos_g wi|; importance: f*(wi -> wo) |cos_g wo|.
                let (a, b) = (radiance * wo.z.abs(), importance * wi.z.abs());
                assert!((a - b).abs().max_element() <= 2e-3 * a.max(b).max_element(), "{wo} {wi}: {a} {b}");
                let gathered = shading(wo).gather(wi, wi.z.abs(), LobeSet::ALL) * wi.z.abs();
                assert!((gathered - radiance).abs().max_element() <= 1e-4 * radiance.max_element());
                for transport in [Transport::Radiance, Transport::Importance] {
                    let there = shading(wo).reverse_pdf(wi, transport, LobeSet::ALL);
                    let back = shading(wi).pdf(wo, transport, LobeSet::ALL);
                    assert!((there - back).abs() <= 2e-3 * there.max(back), "{wo} {wi} {transport:?}: {there} {back}");
                }
                if p.transmission == 0.0 && p.diffuse_transmission == 0.0 && wo.z * wi.z < 0.0 {
                    assert_eq!(radiance, Rgb::ZERO, "light leaks");
                }
            }
        });
    }
    // The check is sensitive: f |cos_s| in both modes does not satisfy it.
    tilted(&Parameters::default(), &tables, |n, _| {
        let (wo, wi) = (Vec3::new(0.3, 0.2, 0.93).normalize(), Vec3::new(-0.6, 0.3, 0.74).normalize());
        let f = |i: Vec3| i.dot(n).abs();
        assert!((f(wi) * wo.z - f(wo) * wi.z).abs() > 0.05);
    });
}

/// The mean weight of samples is the integral of [`Shading::eval_cos`], in both transport modes: a t test at 0.1 %.
#[test]
fn mean_sample_weights_are_the_integral() {
    let tables = EnergyTables::new([1.5]);
    let plastic = Parameters { specular: 1.0, alpha_x: 0.4, alpha_y: 0.4, ..Parameters::default() };
    let coated = Parameters { clearcoat: 0.8, clearcoat_alpha: 0.4, ..Parameters::default() };
    for (p, transport) in [
        (Parameters::default(), Transport::Importance),
        (plastic, Transport::Radiance),
        (plastic, Transport::Importance),
        (coated, Transport::Radiance),
        (coated, Transport::Importance),
    ] {
        tilted_and_mapped(&p, &tables, |_, shading| {
            for wo in [Vec3::new(-0.2, 0.4, 0.6).normalize(), Vec3::new(-0.95, 0.0, 0.31).normalize()] {
                if transport == Transport::Importance && wo.x < -0.9 {
                    continue;
                }
                let shading = shading(wo);
                let u = |k: u64, salt: u64| (mix(mix(k) ^ salt) >> 40) as f32 / 16_777_216.0;
                let drawn: Vec<f64> = (0..40_000)
                    .map(|k| {
                        let s = shading.sample(transport, LobeSet::ALL, u(k, 7), Vec2::new(u(k, 8), u(k, 9)));
                        s.map_or(0.0, |s| {
                            let f = shading.eval_cos(s.wi, transport, LobeSet::ALL);
                            let pdf = shading.pdf(s.wi, transport, LobeSet::ALL);
                            assert!((s.weight * pdf - f).abs().max_element() < 1e-3 * f.max_element().max(pdf * 1e-3));
                            f64::from(s.weight.x)
                        })
                    })
                    .collect();
                // A grid of uniform directions of the sphere.
                let n = 600;
                let mut integral = 0.0;
                for i in 0..n {
                    for j in 0..n {
                        let z = 2.0 * (i as f32 + 0.5) / n as f32 - 1.0;
                        let phi = std::f32::consts::TAU * (j as f32 + 0.5) / n as f32;
                        let r = (1.0 - z * z).sqrt();
                        let wi = Vec3::new(r * phi.cos(), r * phi.sin(), z);
                        integral += f64::from(shading.eval_cos(wi, transport, LobeSet::ALL).x);
                    }
                }
                integral *= 4.0 * std::f64::consts::PI / f64::from(n * n);
                let (mean, error) = mean_and_error(&drawn);
                let critical = t_critical(1e-3, 8, drawn.len() as f64 - 1.0);
                assert!((mean - integral).abs() < critical * error + 1e-3 * integral, "{mean} +- {error}, {integral}");
                assert!((mean - 1.05 * integral).abs() > critical * error + 1e-3 * integral, "no power");
            }
        });
    }
}
