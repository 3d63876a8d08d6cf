//! Samples that are not finite are rejected, counted by cause, reported, and joined over shards and checkpoints.

use crate::support::scenes::{add, build, look_at, matte, point_light, quad, square};
use caustique::math::{DVec3, Vec3};
use caustique::render::{
    Control, Method, Rejections, RenderInput, Rendered, Session, Settings, Shard, ShardResult, render,
};
use caustique::scene::{Description, Scene};

const SIZE: u32 = 32;
const ITERATIONS: u64 = 16;

/// A floor, a wall, and a point light in their corner, so strong that light on near surfaces overflows f32, and so do
/// connections across the corner; elsewhere nothing does.
fn corner(intensity: f32) -> Scene {
    let mut description = Description::default();
    add(&mut description, "floor", quad(Vec3::new(-4.0, 0.0, -4.0), Vec3::Z * 8.0, Vec3::X * 8.0), matte(0.5, 0.0));
    add(&mut description, "wall", quad(Vec3::new(-4.0, 0.0, -0.15), Vec3::X * 8.0, Vec3::Y * 3.0), matte(0.5, 0.0));
    description.lights.push(point_light(DVec3::Y * 0.02, intensity));
    description.cameras.push(look_at(DVec3::new(0.4, 0.5, 1.0), DVec3::new(0.4, 0.05, -0.1), 26.0));
    build(description)
}

fn settings(method: Method) -> Settings {
    Settings { method, photons: 3000, iterations: Some(ITERATIONS), max_depth: 6, ..Settings::default() }
}

fn rendered(scene: &Scene, settings: &Settings) -> Rendered {
    let camera = scene.camera(&square(SIZE)).expect("a camera");
    render(scene, &camera, settings, |_, _| Control::Continue)
}

fn by(rejections: &Rejections, cause: &str) -> u64 {
    rejections.header()[cause].as_u64().expect("a count")
}

/// The rejections that a render reports; checks that they are consistent.
fn checked(rendered: &Rendered) -> Rejections {
    let own = rendered.settings.levels.picture_level();
    for pixel in &rendered.pixels {
        assert!(pixel.mean(own).is_finite() && pixel.iterations + pixel.rejected.total() == ITERATIONS as u32);
    }
    let rejections = rendered.rejections();
    let account = rendered.header(None);
    assert_eq!(account["rejected"], rejections.rejected());
    assert_eq!(account["rejected_by"], serde_json::Value::from(rejections.header()));
    let samples = ["path", "emission", "direct_light", "connection", "photons", "splat", "sum"];
    assert_eq!(samples.map(|cause| by(&rejections, cause)).iter().sum::<u64>(), rejections.rejected());
    rejections
}

/// With a weaker lamp nothing is rejected. With the strong one some samples are, and the rest of the picture is
/// unaffected. Methods that connect and merge have their own causes.
#[test]
fn overflows_are_counted_by_cause() {
    let (dim, bright) = (corner(1e29), corner(2.5e37));
    for (method, causes) in [
        (Method::Path, &["direct_light"][..]),
        (Method::Sppm, &["direct_light"]),
        (Method::Cppm, &["direct_light"]),
        (Method::Bdpt, &["direct_light", "connection"]),
        (Method::Vcm, &["direct_light", "connection"]),
    ] {
        let quiet = checked(&rendered(&dim, &settings(method)));
        assert!(quiet.sentence().is_none() && !quiet.are_too_many(), "{method:?}: {quiet:?}");
        let loud = rendered(&bright, &settings(method));
        let rejections = checked(&loud);
        println!("{method:?}: {}", rejections.sentence().unwrap_or_default());
        let lit = loud.pixels.iter().filter(|pixel| pixel.mean(loud.settings.levels.picture_level()).x > 0.0).count();
        assert!(lit > loud.pixels.len() / 4 && rejections.are_too_many(), "{method:?}: {lit} pixels, {rejections:?}");
        for cause in causes {
            assert!(by(&rejections, cause) > 0, "{method:?}: {cause} in {rejections:?}");
        }
    }
}

/// A lamp whose flux overflows f32 emits no light path, and this is reported.
#[test]
fn light_paths_that_cannot_start_are_counted() {
    let mut description = Description::default();
    add(&mut description, "floor", quad(Vec3::new(-4.0, 0.0, -4.0), Vec3::Z * 8.0, Vec3::X * 8.0), matte(0.5, 0.0));
    description.lights.push(point_light(DVec3::Y * 9.0, 2e38));
    description.cameras.push(look_at(DVec3::new(0.0, 3.0, 4.0), DVec3::ZERO, 40.0));
    let scene = build(description);
    for method in [Method::Light, Method::Bpm, Method::Vcm] {
        let rendered = rendered(&scene, &settings(method));
        let rejections = checked(&rendered);
        let lost = by(&rejections, "light_paths");
        assert!(rejections.are_too_many() && lost >= rendered.stats.light_paths, "{method:?}: {rejections:?}");
    }
}

/// Shards join to the counts of the whole render, and so does a render that was saved and continued.
#[test]
fn counts_join_over_shards_and_checkpoints() {
    let scene = corner(2.5e37);
    let camera = scene.camera(&square(SIZE)).expect("a camera");
    for method in [Method::Path, Method::Sppm, Method::Vcm] {
        let whole = rendered(&scene, &settings(method));
        let shards: Vec<Rendered> = (0..3)
            .map(|index| rendered(&scene, &Settings { shard: Shard { index, count: 3 }, ..settings(method) }))
            .collect();
        let parts: Vec<ShardResult> = shards.iter().map(Rendered::shard_result).collect();
        let mut pixels = shards[2].pixels.clone();
        for shard in [&shards[0], &shards[1]] {
            pixels.iter_mut().zip(&shard.pixels).for_each(|(all, pixel)| all.join(pixel.clone()));
        }
        let joined = ShardResult::merge(&parts).expect("there are shards").with_pixels(pixels);
        assert_eq!(joined.rejections(), whole.rejections(), "{method:?}");
        assert!(whole.rejected() > 0 && shards[0].rejections() != whole.rejections());

        let stage = RenderInput::new(&scene, &camera, &settings(method));
        let mut session = Session::new(&stage);
        for _ in 0..ITERATIONS / 2 {
            session.step();
        }
        let saved = postcard::to_allocvec(&session.state().expect("memory")).expect("memory");
        let state = postcard::from_bytes(&saved).expect("a state");
        let mut session = Session::resume(&stage, state).expect("the same render");
        while !session.is_finished() {
            session.step();
        }
        let resumed = session.finish(whole.stop);
        assert_eq!(resumed.rejections(), whole.rejections(), "{method:?}");
    }
}
