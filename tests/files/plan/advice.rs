//! Likely mistakes in a scene give a warning that names the object and a remedy; other scenes give none.

use super::{floor, plan, plan_by, plan_to};
use crate::support::scenes::{add, cuboid, glass, matte, point_light, quad, sphere};
use caustique::geometry::Mesh;
use caustique::light::SpotEdge;
use caustique::material::{Alpha, Material};
use caustique::math::{DVec3, Rgb, Vec2, Vec3};
use caustique::plan::Search;
use caustique::scene::Description;
use caustique::scene::description::{
    EnvironmentDescription, EnvironmentSource, GuessedUnits, PunctualKind, PunctualLight,
};
use caustique::texture::{Texels, Texture, TextureRef, Wrap};

/// The floor under a lamp.
fn lit() -> Description {
    let mut description = floor();
    description.lights = vec![point_light(DVec3::new(0.0, 3.0, 0.0), 10.0)];
    description
}

fn with(mut description: Description, name: &str, mesh: Mesh, material: Material) -> Description {
    add(&mut description, name, mesh, material);
    description
}

fn ball(material: Material) -> Description {
    with(lit(), "Ball", sphere(Vec3::new(0.0, 1.0, 0.0), 0.5, 32), material)
}

/// The only warning about a scene.
fn warning(description: Description) -> String {
    let warnings = plan(description).warnings;
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    warnings.concat()
}

fn silent(description: Description) {
    assert_eq!(plan(description).warnings, [""; 0]);
}

#[test]
fn a_good_scene_has_no_warnings() {
    silent(ball(glass(1.5)));
    silent(lit());
}

/// Lamps light the scene, but the program that wrote the file may have omitted the environment.
#[test]
fn an_environment_that_was_not_exported() {
    let unsaid = |description: Description| Description { environment_unknown: true, ..description };
    assert_eq!(
        warning(unsaid(ball(glass(1.5)))),
        "no environment: Blender's own exporter leaves the world out, so what it shines is missing; export with scripts/blender/export.py, \
         or give it with --env (--env 0,0,0 if it is dark)"
    );
    let source = EnvironmentSource::Color(Rgb::ONE);
    let environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
    silent(unsaid(Description { environment, ..lit() }));
}

#[test]
fn thin_walls_that_were_meant_to_bend_light() {
    let thin = Material { thin: true, ..glass(1.5) };
    assert_eq!(
        warning(ball(thin.clone())),
        "material \"Ball\" on \"Ball\": a thin wall does not bend light and casts no caustic; close the mesh (a bowl has an inside and an \
         outside), or give the material a thickness"
    );
    // A pane is meant to be thin.
    silent(with(lit(), "Pane", quad(Vec3::new(-1.0, 1.0, 0.0), Vec3::X, Vec3::new(0.0, 1.0, 1.0)), thin));
}

/// A screen whose back faces the camera is reported; one whose front does is not.
#[test]
fn back_faces_that_the_camera_looks_through() {
    let screen = |a, b, culled| {
        let mesh = quad(Vec3::new(-0.5, 0.2, 1.0), a, b);
        with(lit(), "Screen", mesh, Material { culled, ..matte(0.5, 0.0) })
    };
    assert_eq!(
        warning(screen(Vec3::Y, Vec3::X, true)),
        "object \"Screen\": the camera looks through back faces, which glTF culls where a material is not double-sided; \
         set doubleSided to see them"
    );
    silent(screen(Vec3::Y, Vec3::X, false));
    silent(screen(Vec3::X, Vec3::Y, true));
}

/// A coarse smooth ball under a lamp is reported; a fine one, a flat one, and one under the sky are not.
#[test]
fn terminators_that_follow_the_facets() {
    let shape = |segments| sphere(Vec3::new(0.0, 1.0, 0.0), 0.5, segments);
    assert_eq!(
        warning(with(lit(), "Ball", shape(12), matte(0.5, 0.0))),
        "object \"Ball\": its faces are large for smooth shading, so the edge of the shadow on its far side follows them in \
         steps; subdivide the mesh (there is no shadow terminator offset, as Cycles has)"
    );
    silent(with(lit(), "Ball", shape(64), matte(0.5, 0.0)));
    silent(with(lit(), "Ball", Mesh { normals: Vec::new(), ..shape(12) }, matte(0.5, 0.0)));
    let source = EnvironmentSource::Color(Rgb::ONE);
    let environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
    silent(Description { environment, ..with(floor(), "Ball", shape(12), matte(0.5, 0.0)) });
}

#[test]
fn glass_too_rough_for_a_caustic() {
    let frosted = Material { roughness: 0.6.into(), ..glass(1.5) };
    assert_eq!(
        warning(ball(frosted)),
        "material \"Ball\" on \"Ball\": its roughness of 0.6 spreads light too wide for a caustic to show; 0.45 and more is frosted"
    );
    silent(ball(Material { roughness: 0.3.into(), ..glass(1.5) }));
}

/// A lamp of flux 4 pi I beside a panel of flux pi L A, in one system of units and in two.
#[test]
fn lamps_and_surfaces_in_different_units() {
    let scene = |intensity: f32, photometric| {
        let panel = quad(Vec3::new(-2.0, 3.0, -2.0), Vec3::X, Vec3::Z);
        let mut description = with(lit(), "Panel", panel, matte(0.0, 4.0));
        description.lights[0].intensity = Rgb::splat(intensity);
        description.guessed_units = Some(GuessedUnits { photometric, from: "generator \"Any\"".into() });
        description
    };
    assert_eq!(
        warning(scene(683.0, false)),
        "the light of its lamps is 683 times that of its surfaces that glow: the numbers of lamps were taken for watts, going by generator \
         \"Any\"; if that is wrong, use --light-units photometric"
    );
    assert_eq!(
        warning(scene(1.0 / 683.0, true)),
        "the light of its surfaces that glow is 683 times that of its lamps: the numbers of lamps were taken for lumens, going by generator \
         \"Any\"; if that is wrong, use --light-units radiometric"
    );
    for (intensity, photometric) in [(1.0, false), (1.0, true), (30.0, false), (683.0, true), (1e6, false)] {
        silent(scene(intensity, photometric));
    }
    // Units are not guessed if the file or the user states them.
    let mut stated = scene(683.0, false);
    stated.guessed_units = None;
    silent(stated);
}

#[test]
fn suns_and_environments_in_different_units() {
    let scene = |irradiance: f32| {
        let mut description = floor();
        description.lights =
            vec![PunctualLight { kind: PunctualKind::Sun { angle: 0.0 }, ..point_light(DVec3::ZERO, irradiance) }];
        let source = EnvironmentSource::Color(Rgb::ONE);
        description.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
        description.guessed_units = Some(GuessedUnits { photometric: false, from: "the file's generator".into() });
        description
    };
    assert!(warning(scene(683.0 * 4.0)).starts_with("the light of its suns is 870 times that of the environment: "));
    silent(scene(4.0));
}

/// A point lamp in a glass globe is found by photons but not by camera paths; with a radius, camera paths find it.
#[test]
fn point_lamps_behind_glass() {
    let globe = || with(lit(), "Globe", sphere(Vec3::new(0.0, 3.0, 0.0), 0.5, 16), glass(1.5));
    silent(globe());
    let warnings = plan_by(globe(), Search::CameraPaths).warnings;
    assert_eq!(
        warnings.last().map(String::as_str),
        Some(
            "light \"point\": 100 % of its light goes through the glass of \"Globe\", and --method any cannot find a lamp without size there; \
             choose --method sppm or vcm, or give it a radius"
        )
    );
    let mut sized = globe();
    sized.lights[0].radius = 0.1;
    assert_eq!(plan_by(sized, Search::CameraPaths).warnings, [""; 0]);
    // Glass beside the lamp instead of around it.
    let beside = plan_by(ball(glass(1.5)), Search::CameraPaths).warnings;
    assert!(beside.iter().all(|warning| !warning.contains("% of its light")), "{beside:?}");
}

#[test]
fn scenes_without_light() {
    let warnings = |description: Description| crate::support::scenes::build(description).warnings;
    let black = "the picture will be black (add --light-preset studio, --env, a lamp or an emissive material; Blender's own exporter leaves out area lights and the world)";
    assert_eq!(warnings(floor()), [format!("the scene has no light: {black}")]);
    let mut dark = lit();
    dark.lights[0].intensity = Rgb::ZERO;
    assert_eq!(warnings(dark.clone()), [format!("the intensities of all lights are zero: {black}")]);
    silent(with(dark, "Ball", sphere(Vec3::new(0.0, 1.0, 0.0), 0.5, 16), glass(1.5)));
    assert_eq!(warnings(lit()), [""; 0]);
}

#[test]
fn lamps_in_a_casing() {
    let around = |half: f32, material| {
        let center = Vec3::new(0.0, 3.0, 0.0);
        with(lit(), "Casing", cuboid(center - half, center + half, false), material)
    };
    assert_eq!(
        warning(around(0.3, matte(0.5, 0.0))),
        "light \"point\": all its light stays within \"Casing\", and the camera is outside; make an opening, or give the casing a material \
         that transmits light"
    );
    silent(around(0.3, glass(1.5)));
    // A room around the camera is not a casing.
    silent(around(20.0, matte(0.5, 0.0)));
    // An opening.
    let mut open = around(0.3, matte(0.5, 0.0));
    std::sync::Arc::make_mut(&mut open.meshes[1]).triangles.truncate(10);
    silent(open);
    // Emissive surfaces, too.
    let mut panel = around(0.3, matte(0.5, 0.0));
    panel.lights.clear();
    let panel = with(panel, "Filament", sphere(Vec3::new(0.0, 3.0, 0.0), 0.05, 8), matte(0.0, 100.0));
    assert!(warning(panel).starts_with("object \"Filament\": all its light stays within \"Casing\", "));
    // A spot that lights only the floor, which reflects the light elsewhere.
    let mut spot = lit();
    spot.lights[0].kind = PunctualKind::Spot { inner: 0.1, outer: 0.2, edge: SpotEdge::Squared };
    spot.lights[0].to_world.matrix3 = glam::DMat3::from_rotation_x(-std::f64::consts::FRAC_PI_2);
    silent(spot);
}

#[test]
fn glass_that_no_light_reaches() {
    // A lid as wide as the floor, between the lamp and the ball.
    let lid = |y: f32| {
        let plane = quad(Vec3::new(-4.0, y, -4.0), Vec3::new(0.0, 0.0, 8.0), Vec3::new(8.0, 0.0, 0.0));
        with(ball(glass(1.5)), "Lid", plane, matte(0.5, 0.0))
    };
    assert_eq!(
        warning(lid(2.0)),
        "object \"Ball\": no light shines on its glass, so it casts no caustic; it is in the shadow of \"Lid\""
    );
    silent(lid(3.5));
    // Glass between them transmits light.
    let mut clear = lid(2.0);
    clear.materials[2] = Material { thin: true, ..glass(1.5) };
    silent(clear);
    // A spot that shines past it.
    let mut past = ball(glass(1.5));
    past.lights[0].kind = PunctualKind::Spot { inner: 0.1, outer: 0.2, edge: SpotEdge::Squared };
    past.lights[0].to_world.translation = DVec3::new(3.0, 3.0, 0.0);
    past.lights[0].to_world.matrix3 = glam::DMat3::from_rotation_x(-std::f64::consts::FRAC_PI_2);
    assert_eq!(
        warning(past),
        "object \"Ball\": no light shines on its glass, so it casts no caustic; aim a light at it"
    );
}

/// A beam of half a degree on a slab with two large triangles per face misses the test points, but the slab counts as
/// lit, also through a pane. With a beam beside the slab it does not.
#[test]
fn narrow_beams_light_large_glass() {
    let scene = |x: f64, pane: bool| {
        let slab = cuboid(Vec3::new(-3.0, 1.0, -3.0), Vec3::new(3.0, 1.2, 3.0), false);
        let mut description = with(lit(), "Slab", slab, glass(1.5));
        if pane {
            add(
                &mut description,
                "Pane",
                cuboid(Vec3::new(-5.0, 2.0, -5.0), Vec3::new(5.0, 2.1, 5.0), false),
                glass(1.5),
            );
        }
        let light = &mut description.lights[0];
        light.kind = PunctualKind::Spot { inner: 0.0, outer: 0.01, edge: SpotEdge::Squared };
        light.to_world = glam::DAffine3::from_translation(DVec3::new(x, 3.0, 0.7))
            * glam::DAffine3::from_rotation_x(-std::f64::consts::FRAC_PI_2);
        description
    };
    silent(scene(0.3, false));
    silent(scene(0.3, true));
    let expected = "object \"Slab\": no light shines on its glass, so it casts no caustic; aim a light at it";
    assert_eq!(warning(scene(4.0, false)), expected);
}

/// Old models imitate glass by alpha. Open, rough or flat surfaces, and alpha near 1, may be intended.
#[test]
fn alpha_in_place_of_glass() {
    let faded = |alpha: f32, roughness: f32| Material {
        base_color: [1.0, 1.0, 1.0, alpha],
        alpha: Alpha::Blend,
        roughness: roughness.into(),
        ..matte(0.8, 0.0)
    };
    assert_eq!(
        warning(ball(faded(0.1, 0.1))),
        "material \"Ball\" on \"Ball\": its alpha of 0.1 lets light through straight, so it bends no light and casts no caustic; if it is \
         glass, give it transmission 1 and alpha 1"
    );
    for material in
        [faded(0.1, 1.0), faded(0.9, 0.1), faded(0.0, 0.1), Material { alpha: Alpha::Opaque, ..faded(0.1, 0.1) }]
    {
        silent(ball(material));
    }
    let pane = quad(Vec3::new(-1.0, 0.5, 0.0), Vec3::X, Vec3::Y);
    silent(with(lit(), "Pane", pane, faded(0.1, 0.1)));
    // Texture alpha: nearly uniform, and a cut-out.
    let textured = |alphas: [f32; 4]| {
        let first = TextureRef { texture: 0, set: 0, transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] };
        let mut body = sphere(Vec3::new(0.0, 1.0, 0.0), 0.5, 32);
        body.uvs[0] = body.positions.iter().map(|p| Vec2::new(p.x + 0.5, p.z + 0.5)).collect();
        let texels = Texels::Floats(alphas.map(|alpha| [1.0, 1.0, 1.0, alpha]).to_vec());
        let (wrap, name) = ([Wrap::Repeat; 2], "alphas".into());
        let textures = vec![Texture { name, width: 2, height: 2, texels, wrap, linear: false }];
        let material = Material { base_color_texture: Some(first), ..faded(1.0, 0.1) };
        with(Description { textures, ..lit() }, "Ball", body, material)
    };
    assert!(warning(textured([0.3; 4])).contains("its alpha of 0.3 lets light through straight"));
    assert!(warning(textured([0.2, 0.21, 0.2, 0.22])).contains("\"Ball\": its alpha of 0.2"));
    silent(textured([0.0, 1.0, 0.3, 0.0]));
    silent(textured([0.3, 1.0, 0.3, 0.3]));
}

#[test]
fn a_dome_shuts_the_environment_out() {
    let under = |dome: Material, radius: f32| {
        let source = EnvironmentSource::Color(Rgb::ONE);
        let environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
        let dome_mesh = sphere(Vec3::ZERO, radius, 16);
        with(Description { environment, ..floor() }, "Dome", dome_mesh, dome)
    };
    let expected = "the environment lights nothing that the camera sees: \"Dome\" shuts it out; make an opening, let it glow if it is the sky, \
                or take it away";
    let plan = plan(under(matte(0.5, 0.0), 50.0));
    assert_eq!(plan.warnings, [expected]);
    assert_eq!(plan.reason_if_black, expected);
    silent(under(glass(1.0), 50.0));
    // A ball beside the camera.
    silent(under(matte(0.5, 0.0), 1.0));
    // The camera is outside, and looks through the dome.
    let hidden = |mut description: Description| {
        description.instances.last_mut().expect("the dome").hidden_from_camera = true;
        description
    };
    assert_eq!(self::plan(hidden(under(matte(0.5, 0.0), 7.0))).warnings, [expected]);
    let mut sunny = hidden(with(floor(), "Dome", sphere(Vec3::ZERO, 7.0, 32), matte(0.5, 0.0)));
    let sun = PunctualKind::Sun { angle: 0.01 };
    sunny.lights = vec![PunctualLight { kind: sun, ..point_light(DVec3::ZERO, 1.0) }];
    assert_eq!(warning(sunny), expected.replace("the environment lights", "the sun lights"));
}

#[test]
fn a_limit_of_depth_is_reported() {
    let to = |most| plan_to(ball(glass(1.5)), Search::Photons, Some(most));
    assert_eq!(
        to(2).warnings,
        ["--max-depth 2: left out are indirect, caustic, sds, whose paths have 3 segments or more"]
    );
    assert_eq!(to(3).warnings, ["--max-depth 3: left out are sds, whose paths have 4 segments or more"]);
    assert_eq!(to(8).warnings, ["--max-depth 8: light of longer paths is left out"]);
    assert!(to(2).reason_if_black.starts_with("all its light may be in what is left out: indirect, caustic"));
}

/// Each possible reason for a black picture.
#[test]
fn reasons_of_black_pictures() {
    let reason = |description: Description| plan(description).reason_if_black;
    assert!(reason(floor()).starts_with("the scene has no light; "));
    let mut away = lit();
    away.cameras = vec![crate::support::scenes::look_at(DVec3::new(0.0, 5.0, 6.0), DVec3::new(0.0, 9.0, 6.1), 50.0)];
    assert!(warning(away.clone()).starts_with("the camera sees no surface, so the picture will be black; "));
    assert!(reason(away.clone()).starts_with("the camera sees no surface; "));
    // A sky is visible in an empty scene.
    let source = EnvironmentSource::Color(Rgb::ONE);
    away.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
    silent(away);
    assert!(reason(lit()).ends_with("too hard to find for any"));
}

/// If lamps are the only lights, the guess of their unit cannot be checked.
#[test]
fn guessed_lumens_are_reported_if_lamps_are_the_only_lights() {
    let mut description = lit();
    description.guessed_units = Some(GuessedUnits { photometric: true, from: "generator \"Any\"".into() });
    assert_eq!(
        warning(description.clone()),
        "lamps give all its light, and their numbers were taken for lumens, going by generator \"Any\"; if the picture is far too dark, \
         use --light-units radiometric"
    );
    description.guessed_units = Some(GuessedUnits { photometric: false, from: "generator \"Any\"".into() });
    silent(description);
}
