//! Direct light of many lamps and a sky: the irradiance has a closed form.

use crate::support;

use caustique::geometry::Surface;
use caustique::light::{DirectSample, Light, Receiver};
use caustique::math::{DVec3, Rgb, Vec3};
use caustique::random::{Domain, Purpose, Stream};
use caustique::scene::Scene;
use caustique::scene::description::{Description, EnvironmentDescription, EnvironmentSource};
use std::f64::consts::PI;
use support::scenes::{add, build, matte, point_light, quad};
use support::stats::{mean_and_error, t_critical};

const SKY: f32 = 0.02;
/// Error rate of the eight points, for each way to choose lights.
const RATE: f64 = 1e-4;

/// Lamps of 20 by 20 cm in a grid 2 m above a floor, facing it, point lights in the gaps, and a dim sky.
fn hall() -> (Description, Vec<[DVec3; 4]>, Vec<(DVec3, f64)>) {
    let mut description = Description::default();
    let floor = quad(Vec3::new(-20.0, 0.0, -20.0), Vec3::Z * 40.0, Vec3::X * 40.0);
    add(&mut description, "floor", floor, matte(0.5, 0.0));
    let (mut panels, mut points) = (Vec::new(), Vec::new());
    for i in 0..6u8 {
        for j in 0..6u8 {
            let (x, z) = (f64::from(i) * 3.0 - 7.5, f64::from(j) * 3.0 - 7.5);
            let corner = DVec3::new(x, 2.0, z);
            let panel = quad(corner.as_vec3(), Vec3::X * 0.2, Vec3::Z * 0.2);
            add(&mut description, "panel", panel, matte(0.0, 1.0 + f32::from(i)));
            let [right, up] = [DVec3::X * 0.2, DVec3::Z * 0.2];
            panels.push([corner, corner + right, corner + right + up, corner + up]);
            let p = DVec3::new(x + 1.3, 1.0 + 0.2 * f64::from(j), z + 1.7);
            let intensity = 0.05 * f32::from(1 + j);
            description.lights.push(point_light(p, intensity));
            points.push((p, f64::from(intensity)));
        }
    }
    let source = EnvironmentSource::Color(Rgb::splat(SKY));
    description.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
    (description, panels, points)
}

/// Irradiance at `p`, facing up, from a polygon of radiance 1 with counter-clockwise corners as seen from `p` \[Lambert
/// 1760\].
pub fn polygon(p: DVec3, corners: &[DVec3]) -> f64 {
    let n = corners.len();
    let edge = |k: usize| {
        let (a, b) = ((corners[k] - p).normalize(), (corners[(k + 1) % n] - p).normalize());
        a.dot(b).clamp(-1.0, 1.0).acos() * a.cross(b).normalize().y
    };
    0.5 * (0..n).map(edge).sum::<f64>().abs()
}

/// `n` estimates of the irradiance at `p` on the floor. Each is divided by `share`, the probability used over the true
/// one.
pub fn estimates(scene: &Scene, receiver: &Receiver, n: u64, share: impl Fn(&DirectSample) -> f64) -> Vec<f64> {
    let one = |i: u64| {
        let draws = Stream::new(11, 0, Domain::Test, i).vertex(1);
        let (choice, point) = (draws.one_fine(Purpose::LightChoice), draws.two(Purpose::LightPoint));
        let light = scene.lights.sample_direct(&scene.shapes, &scene.materials, receiver, choice, point);
        light.map_or(0.0, |light| {
            let cos = f64::from(light.wi.y.max(0.0));
            f64::from(light.radiance.x) * cos / f64::from(light.pdf_w) * share(&light)
        })
    };
    (0..n).map(one).collect()
}

#[test]
fn irradiance_is_correct_and_near_lamps_are_sampled_most() {
    let (description, panels, points) = hall();
    let scene = build(description);
    let critical = t_critical(RATE, 8, 50_000.0);
    let mut least: f64 = f64::INFINITY;
    for k in 0..8u8 {
        let p = DVec3::new(1.9 * f64::from(k) - 7.0, 0.0, 6.5 - 1.7 * f64::from(k));
        let lamps: f64 =
            (0..6).flat_map(|i| [f64::from(i) + 1.0; 6]).zip(&panels).map(|(l, c)| l * polygon(p, c)).sum();
        let bulbs: f64 = points.iter().map(|(at, i)| i * (*at - p).y / (*at - p).length().powi(3)).sum();
        // The lamps block nothing here, so no shadow rays are needed.
        let expected = lamps + bulbs + PI * f64::from(SKY);
        let receiver = Receiver { n: Vec3::Y, ..Receiver::anywhere(p.as_vec3()) };
        let values = estimates(&scene, &receiver, 50_000, |_| 1.0);
        let (mean, error) = mean_and_error(&values);
        assert!((mean - expected).abs() < critical * error, "at {p}: {mean} +- {error}, expected {expected}");
        // Lights chosen only by power, as for points in media.
        let by_power = Receiver { in_medium: true, ..receiver };
        let powers = estimates(&scene, &by_power, 50_000, |_| 1.0);
        let (mean, power_error) = mean_and_error(&powers);
        assert!(
            (mean - expected).abs() < critical * power_error,
            "at {p}: {mean} +- {power_error}, expected {expected}"
        );
        least = least.min((power_error / error).powi(2));
        // The planted bug: the sky divided by its density in emission.
        let sky = (0..).zip(scene.lights.emitters()).find(|(_, e)| e.is_infinite()).map_or(0, |(i, _)| i);
        let chosen = |wi| f64::from(scene.lights.next_event_ratio(&receiver, sky, wi));
        let wrong = |light: &DirectSample| if light.target.is_none() { chosen(light.wi) } else { 1.0 };
        let values = estimates(&scene, &receiver, 50_000, wrong);
        let (mean, error) = mean_and_error(&values);
        assert!((mean - expected).abs() > critical * error, "at {p}: a wrong probability is not detected");
    }
    println!("variance by power over that by what arrives: {least:.1} at least");
    assert!(least > 3.0, "the nearest lamps are not asked more often: {least}");
}

/// Points under, beside and at the edge of a large panel. Their irradiance is right, the densities of all techniques belong
/// to one sampler, and sampling the solid angle divides the variance by three at least, up close.
#[test]
fn directions_to_near_panels_are_sampled() {
    let mut description = Description::default();
    let (corner, side) = (DVec3::new(-1.0, 1.0, -1.0), 2.0);
    let panel = quad(corner.as_vec3(), Vec3::X * 2.0, Vec3::Z * 2.0);
    add(&mut description, "panel", panel, matte(0.0, 1.0));
    let scene = build(description);
    let corners = [corner, corner + DVec3::X * side, corner + DVec3::new(side, 0.0, side), corner + DVec3::Z * side];
    let n = 20_000;
    let critical = t_critical(RATE, 16, n as f64);
    let mut gains = Vec::new();
    for k in 0..8u8 {
        let height = [0.02, 0.1, 0.4, 1.0][usize::from(k % 4)];
        let p = DVec3::new(1.3 * f64::from(k) / 8.0, 1.0 - height, -0.4 * f64::from(k) / 4.0);
        let receiver = Receiver { n: Vec3::Y, ..Receiver::anywhere(p.as_vec3()) };
        let by_area = Receiver { in_medium: true, ..receiver };
        let variances = [(receiver, by_area), (by_area, receiver)].map(|(receiver, other)| {
            let (mean, error) = mean_and_error(&estimates(&scene, &receiver, n, |_| 1.0));
            let expected = polygon(p, &corners);
            assert!((mean - expected).abs() < critical * error, "at {p}: {mean} +- {error}, expected {expected}");
            // The planted bug: the density of the other sampler.
            let planted = |light: &DirectSample| {
                let ratio = |of: &Receiver| f64::from(scene.lights.next_event_ratio(of, light.light, light.wi));
                ratio(&receiver) / ratio(&other)
            };
            let (wrong, wrong_error) = mean_and_error(&estimates(&scene, &receiver, n, planted));
            let noticed = (wrong - expected).abs() > critical * wrong_error;
            assert!(noticed || receiver.in_medium, "at {p}: another density is not detected");
            error * error
        });
        if height < 0.5 {
            gains.push(variances[1] / variances[0]);
        }
        for i in 0..200 {
            let draws = Stream::new(12, 0, Domain::Test, i).vertex(1);
            let (choice, u) = (draws.one_fine(Purpose::LightChoice), draws.two(Purpose::LightPoint));
            let Some(light) = scene.lights.sample_direct(&scene.shapes, &scene.materials, &receiver, choice, u) else {
                panic!("no light at {p}");
            };
            let (distance, cos) = (height as f32 / light.wi.y, light.wi.y);
            let at = receiver.p + light.wi * distance;
            let surface =
                scene.shapes.surface(0, light.light, [0.3, 0.3]).map(|s| Surface { p: at, ..s }).expect("a panel");
            let hit = scene.lights.hit_radiance(&scene.materials, &receiver, &surface, -light.wi).expect("light").1;
            assert!((hit / light.pdf_w - 1.0).abs() < 2e-3, "at {p}: {hit} and {}", light.pdf_w);
            // Light paths leave the panel by the cosine.
            let arrival = scene.lights.arrival_pdf_a(&light, receiver.p)
                * scene.lights.next_event_ratio(&receiver, light.light, light.wi);
            let expected = cos / std::f32::consts::PI / (distance * distance);
            assert!((arrival / expected - 1.0).abs() < 2e-3, "at {p}: {arrival}, expected {expected}");
        }
    }
    println!("variance by area over that by solid angle: {gains:.1?}");
    assert!(gains.iter().all(|&gain| gain > 3.0), "{gains:?}");
}
