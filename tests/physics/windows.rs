//! Rooms that the sky lights through a window, where renders learn from which directions light arrives. Methods are
//! compared with closed forms (t tests over seeds, family-wise error rate 0.1 %), and a density that ignores what was
//! learnt must be rejected.

use crate::support;

use caustique::camera::Camera;
use caustique::light::{Environment, ImageEnvironment, LearntSky, LightSamples, Receiver, SkySectors};
use caustique::math::{DVec3, Rgb, Vec2, Vec3, luminance};
use caustique::random::{Domain, Purpose, Stream};
use caustique::render::{
    Control, InitialBandwidth, Levels, Method, RenderInput, Rendered, Session, Settings, Shard, learn_light,
    run_session,
};
use caustique::scene::description::{EnvironmentDescription, EnvironmentSource};
use caustique::scene::{Description, Scene, View};
use std::f32::consts::FRAC_1_PI;
use std::f64::consts::PI;
use std::sync::Arc;
use support::render;
use support::scenes::{add, build, look_at, matte, quad, square, window_room};
use support::stats::{Check, mean_and_error};

/// Side of the pictures.
pub const SIZE: u32 = 16;

fn sky() -> Option<EnvironmentDescription> {
    Some(EnvironmentDescription { source: EnvironmentSource::Color(Rgb::ONE), rotation_deg: 0.0, strength: 1.0 })
}

pub fn settings(iterations: u64, seed: u64) -> Settings {
    Settings {
        seed,
        photons: 4096,
        initial_bandwidth: InitialBandwidth::Fixed(0.1),
        levels: Levels::new(1),
        iterations: Some(iterations),
        ..Settings::default()
    }
}

pub fn camera(scene: &Scene) -> Camera {
    scene.camera(&square(SIZE)).expect("a camera")
}

/// Renders without learning.
pub fn render_plain(scene: &Scene, settings: &Settings) -> Rendered {
    let camera = camera(scene);
    let input = RenderInput::new(scene, &camera, settings);
    let mut session = Session::new(&input);
    let stop = run_session(&mut session, |_, _| Control::Continue);
    session.finish(stop)
}

pub fn values(rendered: &Rendered) -> Vec<f64> {
    rendered.pixels.iter().map(|pixel| pixel.mean(0).x).collect()
}

pub fn mean(rendered: &Rendered) -> f64 {
    let values = values(rendered);
    values.iter().sum::<f64>() / values.len() as f64
}

/// Light that the floor of [`window_room`] with black walls reflects, averaged over the picture.
fn expected(albedo: f64) -> f64 {
    let center = |i: i32, n: i32| (f64::from(i) + 0.5) / f64::from(n);
    let mut sum = 0.0;
    for (i, j) in (0..16).flat_map(|i| (0..16).map(move |j| (i, j))) {
        // The picture shows the square from -0.5 to 0.5.
        let p = DVec3::new(center(i, 16) - 0.5, 0.0, center(j, 16) - 0.5);
        for (k, l) in (0..40).flat_map(|k| (0..40).map(move |l| (k, l))) {
            let q = DVec3::new(1.0, 0.5 + 0.4 * center(k, 40), 0.6 * center(l, 40) - 0.3);
            let d = q - p;
            sum += d.y * d.x / (PI * d.length_squared().powi(2)) * 0.4 * 0.6 / 1600.0;
        }
    }
    albedo * sum / 256.0
}

/// The floor of a black room receives the form factor of the window, by all methods.
#[test]
fn the_floor_of_a_black_room() {
    let scene = build(window_room(matte(0.0, 0.0), sky()));
    let check = Check { expected: expected(0.8), bias: 5e-3, detects: 0.05 };
    assert!(
        learn_light(View::new(&scene, &camera(&scene)), &settings(1, 0)).sky.is_some(),
        "a window is worth learning"
    );
    for method in [Method::Path, Method::Bdpt, Method::Vcm, Method::Sppm] {
        let means: Vec<f64> = (0..12).map(|seed| mean(&render(&scene, method, SIZE, &settings(96, seed)))).collect();
        check.run(4, &format!("{method:?}"), &means);
    }
}

/// Checks that rendering a scene with what is learnt gives the mean of the picture without, which a comparison finds
/// whose noise is at most the fraction `noise` of it.
pub fn keeps_the_mean(scene: &Scene, iterations: u64, noise: f64) {
    for method in [Method::Path, Method::Bdpt, Method::Vcm] {
        let of = |seed| Settings { method, ..settings(iterations, seed) };
        let means = |render: &dyn Fn(u64) -> Rendered| (0..16).map(|seed| mean(&render(seed))).collect::<Vec<f64>>();
        let learnt = mean_and_error(&means(&|seed| render(scene, method, SIZE, &of(seed))));
        let plain = mean_and_error(&means(&|seed| render_plain(scene, &of(100 + seed))));
        let error = learnt.1.hypot(plain.1);
        println!("{method:?}: {learnt:?} {plain:?}");
        // Two-sided 5 sigma of 30 degrees of freedom, three times: one false alarm in 10,000 seeds.
        assert!((learnt.0 - plain.0).abs() < 5.0 * error, "{method:?}: {learnt:?} {plain:?}");
        assert!(5.0 * error < noise * plain.0, "{method:?}: the comparison is too noisy");
    }
}

/// Checks that `path` has at most 0.3 of the variance in a scene of direct light, if it learns where light arrives.
pub fn lowers_the_noise(scene: &Scene) {
    let variance = |render: &dyn Fn(u64) -> Rendered| {
        let pictures: Vec<Vec<f64>> = (0..16).map(|seed| values(&render(seed))).collect();
        let of_pixel = |i| mean_and_error(&pictures.iter().map(|picture| picture[i]).collect::<Vec<f64>>()).1.powi(2);
        (0..pictures[0].len()).map(of_pixel).sum::<f64>()
    };
    let of = |seed| Settings { method: Method::Path, ..settings(4, seed) };
    let ratio = variance(&|seed| render(scene, Method::Path, SIZE, &of(seed)))
        / variance(&|seed| render_plain(scene, &of(seed)));
    println!("variance of direct light: {ratio}");
    assert!(ratio < 0.3, "{ratio}");
}

/// In a white room, rendering with what was learnt gives the picture without, and `path` has at most 0.3 of the variance
/// of direct light.
#[test]
fn what_is_learnt_changes_the_noise_alone() {
    keeps_the_mean(&build(window_room(matte(0.6, 0.0), sky())), 16, 0.1);
    lowers_the_noise(&build(window_room(matte(0.0, 0.0), sky())));
}

/// Any number of threads, shards and crop windows learn the same.
#[test]
fn threads_shards_and_windows_make_the_same_picture() {
    let scene = build(window_room(matte(0.6, 0.0), sky()));
    let base = settings(4, 3);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        values(&pool.install(|| render(&scene, Method::Path, SIZE, &base)))
    };
    let whole = with(1);
    assert!(whole == with(3), "threads change the picture");
    assert!(whole != values(&render_plain(&scene, &Settings { method: Method::Path, ..base.clone() })), "not learnt");
    let shard =
        |index| render(&scene, Method::Path, SIZE, &Settings { shard: Shard { index, count: 2 }, ..base.clone() });
    let mut joined = shard(1);
    for (pixel, other) in joined.pixels.iter_mut().zip(shard(0).pixels) {
        pixel.join(other);
    }
    assert!(whole == values(&joined), "shards make another picture");
    let window = caustique::render::render(
        &scene,
        &camera(&scene).crop([4, 2, 8, 6]),
        &Settings { method: Method::Path, ..base.clone() },
        |_, _| Control::Continue,
    );
    let of_whole = (2..8).flat_map(|y| (4..12).map(move |x| y * SIZE as usize + x)).map(|i| whole[i]);
    assert!(values(&window).into_iter().eq(of_whole), "a crop window shows another picture");
}

/// On a plane under an open sky there is nothing to learn, and the picture keeps its bytes.
#[test]
fn open_scenes_keep_their_bytes() {
    let mut description = Description { environment: sky(), ..Description::default() };
    add(&mut description, "floor", quad(Vec3::new(-9.0, 0.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0), matte(0.5, 0.0));
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 0.0), DVec3::ZERO, 60.0));
    let scene = build(description);
    let settings = Settings { method: Method::Path, ..settings(2, 0) };
    assert!(values(&render(&scene, Method::Path, SIZE, &settings)) == values(&render_plain(&scene, &settings)));
}

// ---------------------------------------------------------------- densities

fn draw(seed: u64, i: u64) -> Vec2 {
    Stream::new(seed, 0, Domain::Test, i).vertex(0).two(Purpose::LightPoint)
}

/// A uniform sky, and images: a gradient with a small sun, and one with fewer strips than sectors.
fn environments() -> [Environment; 3] {
    let image = |w: usize, h: usize, sun: f32| {
        let mut texels: Vec<[f32; 3]> = (0..w * h).map(|i| [1.0 + (i / w) as f32 * 0.1, 1.0, 2.0]).collect();
        texels[h / 2 * w + w / 2] = [sun; 3];
        Environment::Image(Arc::new(ImageEnvironment::new(w, h, &texels, 0.3).expect("it is not black")))
    };
    [Environment::Uniform(Rgb::ONE), image(160, 80, 300.0), image(64, 20, 2.0)]
}

/// A receiver on the square from 0 to 1 in x and y, every second one without a normal.
fn receiver(seed: u64, i: u64) -> Receiver {
    let n = if i % 4 < 2 { Vec3::Z } else { Vec3::ZERO };
    Receiver { n, ..Receiver::anywhere(draw(seed, i).extend(0.0)) }
}

/// Whether light arrives at `p` along `d` through a window in the plane x = 2.
fn through_window(p: Vec3, d: Vec3) -> bool {
    let at = p + d * ((2.0 - p.x) / d.x);
    d.x > 0.0 && (at.y - 0.5).abs() < 0.6 && (at.z - 1.2).abs() < 0.5
}

/// Share of the light from a direction that a receiver scatters, which is also the density of a bounce.
fn scattered(at: &Receiver, wi: Vec3) -> f32 {
    if at.n == Vec3::ZERO { 0.25 * FRAC_1_PI } else { wi.dot(at.n).max(0.0) * FRAC_1_PI }
}

/// A direction sampled without a table: the direction, its radiance and density.
fn sample_plain(environment: &Environment, at: &Receiver, u: Vec2) -> (Vec3, f32, f32) {
    let sample = environment.sample_at(at.n, u).expect("the sky is not black");
    (sample.wi, luminance(sample.radiance), environment.pdf_w_at(at.n, sample.wi, sample.pdf_w))
}

/// The table for receivers that light reaches from the `visible` directions.
fn learn(environment: &Environment, visible: impl Fn(Vec3, Vec3) -> bool) -> Option<LearntSky> {
    let (mut samples, sky) = (LightSamples::default(), SkySectors::new(environment));
    for i in 0..4000 {
        let at = receiver(1, i);
        samples.begin(&at, 1.0, (i % 2) as usize, 8);
        for k in 0..8 {
            let (wi, radiance, density) = sample_plain(environment, &at, draw(2, 8 * i + k));
            if visible(at.p, wi) {
                let bounce = scattered(&at, wi) / density;
                samples.add(sky.lit(&at, wi, radiance * bounce, bounce));
            }
        }
    }
    LearntSky::learn(sky, &samples)
}

/// Mean of `value` over `n` draws, and the variance of the mean.
fn mean_and_variance(n: u64, value: impl Fn(u64) -> f64) -> (f64, f64) {
    let (sum, squares) = (0..n).map(value).fold((0.0, 0.0), |(sum, squares), x| (sum + x, squares + x * x));
    let mean = sum / n as f64;
    (mean, (squares / n as f64 - mean * mean) / n as f64)
}

/// Samples have the density that the table states for their direction, and densities integrate to 1: the mean of
/// 1 / density is the solid angle.
#[test]
fn samples_follow_the_learnt_density() {
    for environment in environments() {
        let sky = learn(&environment, through_window).expect("a window is worth a table");
        let n = 40_000;
        let sampled = |i| (receiver(3, i), sky.sample(&receiver(3, i), draw(4, i)).expect("the sky is not black"));
        let count = |is: &dyn Fn(u64) -> bool| (0..n).filter(|&i| is(i)).count();
        let differs = |a: f32, b: f32| (a - b).abs() > 1e-3 * b;
        let wrong = count(&|i| {
            let (at, (sample, density)) = sampled(i);
            let (_, found, image) = sky.arriving(&at, sample.wi);
            differs(found, density) || differs(image, sample.pdf_w)
        });
        // Rounding rarely moves a direction into the next sector.
        assert!(wrong < 40, "{wrong} of {n} directions have another density than they were sampled with");
        let learnt = count(&|i| {
            let (at, (sample, density)) = sampled(i);
            differs(environment.pdf_w_at(at.n, sample.wi, sample.pdf_w), density)
        });
        assert!(learnt > 20_000, "{learnt} of {n} densities were learnt");
        let (mean, variance) = mean_and_variance(n, |i| 1.0 / f64::from(sampled(i).1.1));
        // Two-sided 4.5 sigma, three times: one false alarm in 50,000 seeds.
        assert!((mean - 4.0 * PI).abs() < 4.5 * variance.sqrt(), "{mean} +- {}", variance.sqrt());
    }
}

/// Behind a window, the table finds the same light with less noise. With the density of the environment alone, it
/// would not.
#[test]
fn light_behind_a_window_has_less_noise() {
    for environment in environments() {
        let sky = learn(&environment, through_window).expect("a window is worth a table");
        let n = 40_000;
        let light = |at: &Receiver, (wi, radiance, density): (Vec3, f32, f32)| {
            let visible = if through_window(at.p, wi) { radiance } else { 0.0 };
            f64::from(visible * scattered(at, wi) / density)
        };
        let at = |i| receiver(5, i);
        let plain = mean_and_variance(n, |i| light(&at(i), sample_plain(&environment, &at(i), draw(6, i))));
        let by_table = |i, plants: bool| {
            let (sample, density) = sky.sample(&at(i), draw(7, i)).expect("the sky is not black");
            let own = environment.pdf_w_at(at(i).n, sample.wi, sample.pdf_w);
            light(&at(i), (sample.wi, luminance(sample.radiance), if plants { own } else { density }))
        };
        let [learnt, planted] = [false, true].map(|plants| mean_and_variance(n, |i| by_table(i, plants)));
        // Two-sided 4.5 sigma, six times: one false alarm in 25,000 seeds.
        let agrees = |other: (f64, f64)| (plain.0 - other.0).abs() < 4.5 * (plain.1 + other.1).sqrt();
        println!("variance {:.3} of that without a table", learnt.1 / plain.1);
        assert!(agrees(learnt) && !agrees(planted), "{plain:?} {learnt:?} {planted:?}");
        assert!(learnt.1 < 0.5 * plain.1, "{plain:?} {learnt:?}");
    }
}

/// Where all of a uniform sky is visible, its cosine is the best sampling already.
#[test]
fn nothing_is_learnt_in_the_open() {
    let [uniform, ..] = environments();
    assert!(learn(&uniform, |_, _| true).is_none());
}

/// A table that was learnt under a sky of another brightness does not change the light of a scene.
#[test]
fn a_scene_keeps_the_light_of_its_own_sky() {
    let brighter = sky().map(|sky| EnvironmentDescription { strength: 2.0, ..sky });
    let [scene, other] = [sky(), brighter].map(|sky| build(window_room(matte(0.0, 0.0), sky)));
    let learnt = learn_light(View::new(&scene, &camera(&scene)), &settings(1, 0));
    let other = other.with_learnt(&learnt).expect("a window is worth learning");
    let (mut found, from) = (Vec::new(), Receiver::anywhere(Vec3::ZERO));
    other.lights.for_each_infinite(&from, Vec3::Y, false, |radiance, _, _, _| found.push(radiance));
    assert_eq!(found, [Rgb::splat(2.0)]);
}
