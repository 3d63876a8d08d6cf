//! Lights with photometric profiles, and spots that throw pictures: closed forms for all methods, and light paths
//! against direct light.
//!
//! Checks are t tests over independent seeds at a family-wise error rate of 0.1 % per test (Sidak over its checks).
//! A profile or a picture that is rotated must be rejected.

use crate::support;

use caustique::light::{Light, Pattern, Picture, Profile, Receiver, SpotEdge};
use caustique::math::{DAffine3, DMat3, DVec3, Rgb, Vec2, Vec3};
use caustique::random::{Domain, Purpose, Stream};
use caustique::render::{Control, InitialBandwidth, Method, Settings, render};
use caustique::scene::description::{CameraDescription, Projection, PunctualKind, PunctualLight};
use caustique::scene::ies::{self, Turn};
use caustique::scene::{Description, Scene};
use caustique::transport::{InitialMedia, LightPaths};
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;
use support::scenes::{add, build, matte, point_light, quad};
use support::stats::{mean_and_error, sidak, t_critical};

const ERROR_RATE: f64 = 1e-3;
const SEEDS: u64 = 10;
const METHODS: [Method; 6] = [Method::Path, Method::Bdpt, Method::Vcm, Method::Pm, Method::Sppm, Method::Light];
/// Vertical and horizontal angles of the profiles (degrees).
const VERTICAL: [f32; 7] = [0.0, 10.0, 20.0, 35.0, 50.0, 70.0, 90.0];
const HORIZONTAL: [f32; 6] = [0.0, 40.0, 100.0, 180.0, 270.0, 360.0];

/// A random profile over all horizontal angles: its file, and the intensity (cd) at pairs of angles.
struct Measured {
    text: String,
    candela: Vec<Vec<f64>>,
}

fn measured(seed: u64) -> Measured {
    let draw = |i: usize, j: usize| {
        f64::from(Stream::new(17, (9 * i + j) as u64, Domain::Test, seed).vertex(0).one(Purpose::Lobe))
    };
    // At the axis all horizontal angles meet.
    let value = |i: usize, j: usize| if i == 0 { 100.0 } else { 10.0 + 190.0 * draw(i, j % 5).powi(2) };
    let candela: Vec<Vec<f64>> = (0..6).map(|j| (0..7).map(|i| value(i, j).round()).collect()).collect();
    let numbers = |row: &[f64]| row.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
    let rows: Vec<String> = candela.iter().map(|row| numbers(row)).collect();
    let angles = |angles: &[f32]| numbers(&angles.iter().map(|&a| f64::from(a)).collect::<Vec<_>>());
    let text = format!(
        "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 7 6 1 2 0 0 0\n1 1 50\n{}\n{}\n{}\n",
        angles(&VERTICAL),
        angles(&HORIZONTAL),
        rows.join("\n")
    );
    Measured { text, candela }
}

impl Measured {
    /// The interpolated intensity (cd) at angles in degrees.
    fn at(&self, vertical: f64, horizontal: f64) -> f64 {
        if vertical > 90.0 {
            return 0.0;
        }
        let cell = |angles: &[f32], x: f64| {
            let k = angles.iter().rposition(|&a| f64::from(a) <= x).unwrap_or(0).min(angles.len() - 2);
            let (a, b) = (f64::from(angles[k]), f64::from(angles[k + 1]));
            (k, (x - a) / (b - a))
        };
        let ((i, x), (j, y)) = (cell(&VERTICAL, vertical), cell(&HORIZONTAL, horizontal.rem_euclid(360.0)));
        let row = |j: usize| self.candela[j][i] * (1.0 - x) + self.candela[j][i + 1] * x;
        row(j) * (1.0 - y) + row(j + 1) * y
    }

    fn pattern(&self) -> (Arc<Pattern>, f32) {
        let read = ies::parse(self.text.as_bytes(), &mut Vec::new()).expect("a profile");
        (Arc::new(Pattern::Profile(read.profile(Turn::default()).expect("a profile"))), read.peak())
    }
}

/// A light at the origin with the profile, 1 m above a floor. It shines down; its X axis is the world's, rotated by
/// `turn` (degrees) about the vertical.
fn scene(measured: &Measured, kind: PunctualKind, radius: f32, turn: f64) -> Scene {
    let (pattern, peak) = measured.pattern();
    scene_of(pattern, peak, kind, radius, turn)
}

/// [`scene`] with any pattern, of this intensity (W/sr).
fn scene_of(pattern: Arc<Pattern>, peak: f32, kind: PunctualKind, radius: f32, turn: f64) -> Scene {
    let mut description = Description::default();
    let floor = quad(Vec3::new(-9.0, -1.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0);
    add(&mut description, "floor", floor, matte(0.5, 0.0));
    let down = glam::DQuat::from_rotation_y(turn.to_radians()) * glam::DQuat::from_rotation_x(-FRAC_PI_2);
    description.lights.push(PunctualLight {
        to_world: DAffine3::from_quat(down),
        intensity: Rgb::splat(peak),
        kind,
        pattern: Some(pattern),
        radius,
        ..point_light(DVec3::ZERO, 1.0)
    });
    description.cameras.push(CameraDescription {
        name: "camera".into(),
        // Looks down, with X to the right and -Z up.
        to_world: DAffine3 { matrix3: DMat3::from_rotation_x(-FRAC_PI_2), translation: DVec3::Y },
        projection: Projection::Orthographic { xmag: 1.0, ymag: 1.0 },
        aperture_radius: 0.0,
        focus_distance: 1.0,
        shift: [0.0; 2],
    });
    build(description)
}

/// Irradiance on the floor at (x, z): I cos / r^2.
fn irradiance(measured: &Measured, x: f64, z: f64, cone: f64) -> f64 {
    let r2 = 1.0 + x * x + z * z;
    let vertical = (1.0 / r2.sqrt()).acos();
    if vertical > cone {
        return 0.0;
    }
    // The light's X axis is the world's and its Y axis is -Z.
    measured.at(vertical.to_degrees(), (-z).atan2(x).to_degrees()) / (r2 * r2.sqrt())
}

/// Means of the quarters of the picture, for each seed.
fn quarters(scene: &Scene, method: Method) -> [Vec<f64>; 4] {
    let camera = scene.camera(&support::scenes::square(8)).expect("a camera");
    let settings = Settings {
        method,
        photons: 4000,
        iterations: Some(24),
        initial_bandwidth: InitialBandwidth::Fixed(0.03),
        ..Settings::default()
    };
    let mut means: [Vec<f64>; 4] = Default::default();
    for seed in 1..=SEEDS {
        let rendered = render(scene, &camera, &Settings { seed, ..settings.clone() }, |_, _| Control::Continue);
        let mut sums = [0.0; 4];
        for (i, pixel) in rendered.pixels.iter().enumerate() {
            sums[2 * usize::from(i / 8 >= 4) + usize::from(i % 8 >= 4)] += pixel.mean(0).x / 16.0;
        }
        means.iter_mut().zip(sums).for_each(|(means, sum)| means.push(sum));
    }
    means
}

/// Expected means of the quarters of the picture, in the same order.
fn expected(measured: &Measured, cone: f64) -> [f64; 4] {
    expected_of(|x, z| irradiance(measured, x, z, cone))
}

/// [`expected`] for an irradiance at (x, z).
fn expected_of(irradiance: impl Fn(f64, f64) -> f64) -> [f64; 4] {
    let n = 200;
    let mut sums = [0.0; 4];
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let at = |k: usize| 2.0 * (k as f64 + 0.5) / n as f64 - 1.0;
        // Rows go from -Z to +Z.
        sums[2 * usize::from(i >= n / 2) + usize::from(j >= n / 2)] += irradiance(at(j), at(i));
    }
    sums.map(|sum| 0.5 / PI * sum * 4.0 / (n * n) as f64)
}

/// The radiance of a floor below random profiles, and below a spot with a profile, is the closed form in each quarter of
/// the picture, by every method. A profile that is rotated by 90 degrees is rejected.
#[test]
fn floors_below_profiles_have_the_closed_form() {
    let cone = 0.7f32;
    let spot = PunctualKind::Spot { inner: cone, outer: cone, edge: SpotEdge::Squared };
    let cases = [(1, PunctualKind::Point, PI), (2, PunctualKind::Point, PI), (3, spot, f64::from(cone))];
    let critical = t_critical(sidak(ERROR_RATE, cases.len() * METHODS.len() * 4), 1, SEEDS as f64 - 1.0);
    for (seed, kind, cone) in cases {
        let measured = measured(seed);
        let scene = scene(&measured, kind, 0.0, 0.0);
        let turned = [1, 3, 0, 2].map(|k| expected(&measured, cone)[k]);
        for method in METHODS {
            let means = quarters(&scene, method);
            // Kernels and the edge of the cone blur the picture.
            let passes = |expected: [f64; 4]| {
                means.iter().zip(expected).all(|(values, expected)| {
                    let (mean, error) = mean_and_error(values);
                    (mean - expected).abs() <= critical * error + 6e-3 * expected
                })
            };
            let found = means.each_ref().map(|values| mean_and_error(values));
            println!("{seed} {method:?}: {found:?}, {:?}", expected(&measured, cone));
            assert!(passes(expected(&measured, cone)), "{seed} {method:?}: {found:?}, {:?}", expected(&measured, cone));
            assert!(!passes(turned), "{seed} {method:?}: a rotated profile is not detected: {found:?}, {turned:?}");
        }
    }
}

/// Irradiance on squares of the floor by light paths and by direct light, each with its standard error.
fn both(paths_of: &Scene, direct_of: &Scene, seed: u64) -> Vec<[(f64, f64); 2]> {
    const BATCHES: u32 = 16;
    const PATHS: u32 = 40_000;
    let squares: Vec<(f32, f32)> = (0..9).map(|k| ((k % 3) as f32 - 1.0, (k / 3) as f32 - 1.0)).collect();
    let half = 0.3f32;
    let initial_media = InitialMedia::new(paths_of, Vec3::ZERO);
    let mut by_paths = vec![Vec::new(); squares.len()];
    let mut by_light = vec![Vec::new(); squares.len()];
    for batch in 0..BATCHES {
        let pass = LightPaths::new(seed, u64::from(batch), Domain::Test, PATHS, u32::MAX);
        let mut sums = vec![0.0; squares.len()];
        for start in (0..PATHS).filter_map(|index| pass.emit(paths_of, &initial_media, index)) {
            let start = start.start;
            let on_floor = start.origin + start.direction * ((-1.0 - start.origin.y) / start.direction.y);
            if start.direction.y < 0.0 {
                for (sum, (x, z)) in sums.iter_mut().zip(&squares) {
                    if (on_floor.x - x).abs() < half && (on_floor.z - z).abs() < half {
                        *sum += f64::from(start.throughput.x) / f64::from(4.0 * half * half);
                    }
                }
            }
        }
        by_paths.iter_mut().zip(sums).for_each(|(values, sum)| values.push(sum));
        for (k, (x, z)) in squares.iter().enumerate() {
            let n = 1000;
            let sum: f64 = (0..n)
                .map(|i| {
                    let draws = Stream::new(seed, u64::from(batch), Domain::Test, i + 1_000_000 * k as u64).vertex(1);
                    let (at, point) = (draws.two(Purpose::Pixel), draws.two(Purpose::LightPoint));
                    let p = Vec3::new(x + half * (2.0 * at.x - 1.0), -1.0, z + half * (2.0 * at.y - 1.0));
                    let (lights, to) = (&direct_of.lights, Receiver::anywhere(p));
                    let light = lights.sample_direct(&direct_of.shapes, &direct_of.materials, &to, 0.5, point);
                    light.map_or(0.0, |light| f64::from(light.radiance.x * light.wi.y / light.pdf_w))
                })
                .sum();
            by_light[k].push(sum / n as f64);
        }
    }
    by_paths.iter().zip(&by_light).map(|(a, b)| [mean_and_error(a), mean_and_error(b)]).collect()
}

/// Light paths and direct light agree on the irradiance of nine squares, for random profiles on points and spots, with
/// and without a radius. Paths of a profile that is rotated by 40 degrees are rejected.
#[test]
fn light_paths_agree_with_direct_light() {
    let spot = PunctualKind::Spot { inner: 0.3, outer: 0.9, edge: SpotEdge::Smooth };
    let cases = [(PunctualKind::Point, 0.0), (PunctualKind::Point, 0.4), (spot, 0.0), (spot, 0.2)];
    let critical = t_critical(sidak(ERROR_RATE, 4 * cases.len() * 9), 1, 15.0);
    for seed in 0..4 {
        let measured = measured(20 + seed);
        for (kind, radius) in cases {
            let [own, turned] = [0.0, 40.0].map(|turn| scene(&measured, kind, radius, turn));
            let passes = |found: &[[(f64, f64); 2]]| {
                found.iter().all(|[a, b]| (a.0 - b.0).abs() <= critical * a.1.hypot(b.1) + 1e-12)
            };
            let found = both(&own, &own, seed);
            assert!(passes(&found), "{seed} {kind:?} {radius}: {found:?}");
            assert!(!passes(&both(&turned, &own, seed)), "{seed} {kind:?} {radius}: a rotated profile is not detected");
        }
    }
}

/// The power by which lights are selected is the flux of light paths, and the flux is the integral of the intensity.
#[test]
fn the_power_of_a_profile_is_its_flux() {
    for seed in 30..34 {
        let measured = measured(seed);
        let scene = scene(&measured, PunctualKind::Point, 0.0, 0.0);
        let (n, mut integral) = (600, 0.0);
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let [vertical, horizontal] = [(i, 90.0), (j, 360.0)].map(|(k, end)| (k as f64 + 0.5) / n as f64 * end);
            let solid_angle = vertical.to_radians().sin() * (FRAC_PI_2 / n as f64) * (2.0 * PI / n as f64);
            integral += measured.at(vertical, horizontal) * solid_angle;
        }
        let power = scene.lights.emitters()[0].power(scene.lights.sky());
        assert!((power / integral - 1.0).abs() < 1e-3, "{seed}: {power}, {integral}");
        let initial_media = InitialMedia::new(&scene, Vec3::ZERO);
        let pass = LightPaths::new(seed, 0, Domain::Test, 65_536, u32::MAX);
        let starts = (0..65_536).filter_map(|index| pass.emit(&scene, &initial_media, index));
        let sent: f64 = starts.map(|start| f64::from(start.start.throughput.x)).sum();
        assert!((sent / integral - 1.0).abs() < 2e-3, "{seed}: {sent}, {integral}");
    }
}

/// A profile with one bright direction of 2 degrees is sampled there: paths carry about equal flux.
#[test]
fn paths_of_a_narrow_beam_carry_equal_flux() {
    let polar: Vec<f32> = [0.0f32, 20.0, 21.0, 22.0, 90.0].map(f32::to_radians).to_vec();
    let azimuth = vec![0.0, 0.49, 0.5, 0.51, 1.0];
    let mut values = vec![0.01; 25];
    values[2 * 5 + 2] = 1000.0;
    let profile = Profile::new(polar, azimuth, values).expect("a profile");
    let shape = caustique::light::Distribution::new(Arc::new(Pattern::Profile(profile)), None).expect("light");
    let (mut sum, mut squares, n) = (0.0f64, 0.0f64, 40_000);
    for i in 0..n {
        let u: Vec2 = Stream::new(5, 0, Domain::Test, i).vertex(0).two(Purpose::Direction);
        let (d, pdf) = shape.sample(u).expect("a direction");
        let weight = f64::from(shape.relative(d).x / pdf);
        sum += weight;
        squares += weight * weight;
    }
    let spread = squares * n as f64 / (sum * sum);
    assert!(spread < 2.0, "{spread}");
}

/// A random picture of 5 x 4 texels with black ones, which spans two metres of the floor across, as red, green and blue
/// alike.
fn slide(seed: u64) -> Vec<f64> {
    let draw = |i: u64| f64::from(Stream::new(19, i, Domain::Test, seed).vertex(0).one(Purpose::Lobe));
    (0..20).map(|i| if draw(i) < 0.3 { 0.0 } else { draw(i) }).collect()
}

fn thrown(slide: &[f64]) -> Arc<Pattern> {
    let texels = slide.iter().map(|&x| [x as f32; 3]).collect();
    Arc::new(Pattern::Picture(Picture::new(5, 4, texels, 2.0 * 1f32.atan()).expect("a picture")))
}

/// Irradiance on the floor below a slide: the interpolated texel times cos^3 / h^2, within the cone.
fn below_slide(slide: &[f64], x: f64, z: f64, cone: f64) -> f64 {
    let r2 = 1.0 + x * x + z * z;
    let beside = x.abs() > 1.0 || z.abs() > 0.8;
    if beside || (1.0 / r2.sqrt()).acos() > cone {
        return 0.0;
    }
    // Seen from behind the light, X is to the right and -Z is up.
    let cell = |u: f64, n: usize| {
        let u = (u * n as f64 - 0.5).clamp(0.0, n as f64 - 1.0);
        let i = (u as usize).min(n - 2);
        (i, u - i as f64)
    };
    let ((i, s), (j, t)) = (cell(0.5 + 0.5 * x, 5), cell(0.5 + 0.5 * z / 0.8, 4));
    let row = |j: usize| slide[5 * j + i] * (1.0 - s) + slide[5 * j + i + 1] * s;
    (row(j) * (1.0 - t) + row(j + 1) * t) / (r2 * r2.sqrt())
}

/// The radiance of a floor below a spot with a random picture is the closed form in each quarter, by every method. A
/// picture that is rotated by 180 degrees is rejected.
#[test]
fn floors_below_pictures_have_the_closed_form() {
    let cone = 0.75f32;
    let kind = PunctualKind::Spot { inner: cone, outer: cone, edge: SpotEdge::Squared };
    let seeds = [1u64, 2];
    let critical = t_critical(sidak(ERROR_RATE, seeds.len() * METHODS.len() * 4), 1, SEEDS as f64 - 1.0);
    for seed in seeds {
        let slide = slide(seed);
        let scene = scene_of(thrown(&slide), 1.0, kind, 0.0, 0.0);
        let right = expected_of(|x, z| below_slide(&slide, x, z, f64::from(cone)));
        let turned = [right[3], right[2], right[1], right[0]];
        for method in METHODS {
            let found = quarters(&scene, method).each_ref().map(|values| mean_and_error(values));
            // Kernels and the edges of the picture blur.
            let passes = |expected: [f64; 4]| {
                let near = |((mean, error), expected): (&(f64, f64), f64)| {
                    (mean - expected).abs() <= critical * error + 0.015 * expected
                };
                found.iter().zip(expected).all(near)
            };
            println!("{seed} {method:?}: {found:?}, {right:?}");
            assert!(passes(right), "{seed} {method:?}: {found:?}, {right:?}");
            assert!(!passes(turned), "{seed} {method:?}: a rotated picture is not detected: {found:?}, {turned:?}");
        }
    }
}

/// Light paths and direct light agree below spots that throw random pictures, with and without a radius, and the power
/// of the light is its flux. Paths of a picture that is rotated by 40 degrees are rejected.
#[test]
fn light_paths_of_pictures_agree_with_direct_light() {
    let kind = PunctualKind::Spot { inner: 0.3, outer: 0.9, edge: SpotEdge::Smooth };
    let critical = t_critical(sidak(ERROR_RATE, 6 * 9), 1, 15.0);
    for (seed, radius) in (0..3).flat_map(|seed| [(seed, 0.0), (seed, 0.2)]) {
        let pattern = thrown(&slide(10 + seed));
        let [own, turned] = [0.0, 40.0].map(|turn| scene_of(Arc::clone(&pattern), 1.0, kind, radius, turn));
        let passes = |found: &[[(f64, f64); 2]]| {
            found.iter().all(|[a, b]| (a.0 - b.0).abs() <= critical * a.1.hypot(b.1) + 1e-12)
        };
        let found = both(&own, &own, seed);
        assert!(passes(&found), "{seed} {radius}: {found:?}");
        assert!(!passes(&both(&turned, &own, seed)), "{seed} {radius}: a rotated picture is not detected");
        let initial_media = InitialMedia::new(&own, Vec3::ZERO);
        let pass = LightPaths::new(seed, 0, Domain::Test, 65_536, u32::MAX);
        let starts = (0..65_536).filter_map(|index| pass.emit(&own, &initial_media, index));
        let sent: f64 = starts.map(|start| f64::from(start.start.throughput.x)).sum();
        let power = own.lights.emitters()[0].power(own.lights.sky());
        assert!((sent / power - 1.0).abs() < 5e-3, "{seed} {radius}: {sent}, {power}");
    }
}
