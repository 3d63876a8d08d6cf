//! Closed forms of the flux and irradiance of spots down to a thousandth of a degree.

use crate::support;

use caustique::light::{Receiver, SpotEdge};
use caustique::math::{DAffine3, DVec3, Rgb, Vec2, Vec3};
use caustique::random::{Domain, Purpose, Stream};
use caustique::scene::description::{PunctualKind, PunctualLight};
use caustique::scene::{Description, Scene};
use caustique::transport::{InitialMedia, LightPaths};
use glam::Vec3Swizzles;
use support::scenes::{add, build, look_at, matte, quad};
use support::stats::chi_squared_p;

/// A spot of intensity 1 that shines straight down on a floor 1 m below.
fn scene(inner: f32, outer: f32, edge: SpotEdge, radius: f32) -> Scene {
    let mut description = Description::default();
    add(&mut description, "floor", quad(Vec3::new(-9.0, -1.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0), matte(0.5, 0.0));
    let down = glam::DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2);
    description.lights.push(PunctualLight {
        name: "spot".into(),
        to_world: DAffine3::from_quat(down),
        intensity: Rgb::ONE,
        kind: PunctualKind::Spot { inner, outer, edge },
        pattern: None,
        pass_through: false,
        bulb: false,
        radius,
        hidden_from_camera: false,
        light_group: None,
        links: None,
    });
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 4.0), DVec3::ZERO, 40.0));
    build(description)
}

/// Flux for intensity 1: the solid angle of the cone, with the edge weighted by the mean of its ramp.
fn flux(inner: f64, outer: f64, mean: f64) -> f64 {
    let cap = |angle: f64| 2.0 * (0.5 * angle).sin().powi(2);
    std::f64::consts::TAU * (cap(inner) + (cap(outer) - cap(inner)) * mean)
}

/// The flux of light paths, and the irradiance of next-event estimation integrated over the floor, are correct for
/// every angle. With cosines that had to differ by at least 1e-6, a spot that is all edge had the solid angle of 0.08
/// degrees: 2.7 times the flux at 0.05 degrees, 6,600 times at 0.001 degrees.
#[test]
fn narrow_spots_emit_their_flux() {
    for degrees in [0.001f32, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 30.0] {
        let edges = [(SpotEdge::Squared, 1.0 / 3.0), (SpotEdge::Smooth, 0.5)];
        for (share, (edge, mean)) in [0.0, 0.5, 1.0].into_iter().flat_map(|share| edges.map(|edge| (share, edge))) {
            let outer = degrees.to_radians();
            let inner = share * outer;
            let scene = scene(inner, outer, edge, 0.0);
            let expected = flux(f64::from(inner), f64::from(outer), mean);
            let initial_media = InitialMedia::new(&scene, Vec3::ZERO);
            let paths = 4096;
            let pass = LightPaths::new(0, 1, Domain::Light, paths, 1);
            let starts: Vec<_> = (0..paths).filter_map(|index| pass.emit(&scene, &initial_media, index)).collect();
            let sent: f64 = starts.iter().map(|start| f64::from(start.start.throughput.x)).sum();
            assert!((sent / expected - 1.0).abs() < 1e-3, "{degrees} {share}: sends {sent} of {expected}");
            // Rounding errors move a direction by about 1e-7.
            let widest =
                starts.iter().map(|start| start.start.direction.cross(Vec3::NEG_Y).length()).fold(0.0, f32::max);
            assert!(widest < outer.sin() * 1.001 + 2e-7 && widest > 0.5 * outer.sin(), "{degrees} {share}: {widest}");
            // Uniform points of a disc on the floor that is a little wider than the cone.
            let radius = 1.02 * f64::from(outer).tan();
            let (n, area) = (40_000u64, std::f64::consts::PI * radius * radius);
            let mut arrives = 0.0;
            for i in 0..n {
                let (u, v) = ((i as f64 + 0.5) / n as f64, Stream::new(3, 0, Domain::Test, i).vertex(0));
                let (r, phi) = (radius * u.sqrt(), f64::from(v.one(Purpose::Pixel)) * std::f64::consts::TAU);
                let p = DVec3::new(r * phi.cos(), -1.0, r * phi.sin()).as_vec3();
                let light = scene.lights.sample_direct(
                    &scene.shapes,
                    &scene.materials,
                    &Receiver::anywhere(p),
                    0.5,
                    Vec2::splat(0.5),
                );
                let irradiance = light.map_or(0.0, |light| light.radiance.x * light.wi.y / light.pdf_w);
                arrives += f64::from(irradiance) * area / n as f64;
            }
            assert!((arrives / expected - 1.0).abs() < 4e-3, "{degrees} {share}: {arrives} of {expected} arrives");
            assert!((1.04 * sent / expected - 1.0).abs() > 4e-3, "one part in 25 is not detected");
        }
    }
}

/// Directions of light paths in the edge have the density of the intensity: in tenths of the ramp, by a chi-squared
/// test at an error rate of 0.1 %.
#[test]
fn edges_are_sampled_in_proportion_to_intensity() {
    for (edge, integral) in [
        (SpotEdge::Squared, (|t: f64| t.powi(3)) as fn(f64) -> f64),
        (SpotEdge::Smooth, |t: f64| 2.0 * t.powi(3) - t.powi(4)),
    ] {
        let scene = scene(0.0, 0.5, edge, 0.0);
        let initial_media = InitialMedia::new(&scene, Vec3::ZERO);
        let paths = 50_000;
        let pass = LightPaths::new(0, 1, Domain::Light, paths, 1);
        let mut counts = [0.0; 10];
        for index in 0..paths {
            let start = pass.emit(&scene, &initial_media, index).expect("a path");
            let ramp = (f64::from(-start.start.direction.y) - 0.5f64.cos()) / (1.0 - 0.5f64.cos());
            counts[((10.0 * ramp) as usize).min(9)] += 1.0;
        }
        let share = |k: i32| integral(0.1 * f64::from(k));
        let expected: Vec<f64> = (0..10).map(|k| (share(k + 1) - share(k)) * f64::from(paths)).collect();
        let p = chi_squared_p(&counts, &expected);
        println!("{edge:?}: p {p:.4}, {counts:?}");
        assert!(p > 1e-3, "{edge:?}: {counts:?}, {expected:?}");
        let wrong: Vec<f64> = (0..10).map(|k| 0.1 * f64::from(paths) * f64::from(2 * k + 1) / 10.0).collect();
        assert!(chi_squared_p(&counts, &wrong) < 1e-6, "a linear edge is not detected");
    }
}

/// Below the centre of a disc of radius r, at height h, a spot of intensity I has the irradiance I (2 / r^2) (1 - h /
/// sqrt(h^2 + r^2)), by next-event estimation and by light paths.
#[test]
fn spots_shine_from_a_disc() {
    let radius = 0.8;
    let scene = scene(1.2, 1.2, SpotEdge::Smooth, radius);
    let expected = 2.0 / f64::from(radius).powi(2) * (1.0 - 1.0 / (1.0 + f64::from(radius).powi(2)).sqrt());
    assert!((expected - 1.0).abs() > 0.1, "a point is something else");
    let below = Receiver::anywhere(Vec3::new(0.0, -1.0, 0.0));
    let n = 40_000u64;
    let mut arrives = 0.0;
    for i in 0..n {
        let u = Stream::new(3, 0, Domain::Test, i).vertex(0).two(Purpose::LightPoint);
        let light = scene.lights.sample_direct(&scene.shapes, &scene.materials, &below, 0.5, u).expect("light");
        arrives += f64::from(light.radiance.x * light.wi.y / light.pdf_w) / n as f64;
    }
    assert!((arrives / expected - 1.0).abs() < 5e-3, "{arrives} of {expected}");
    let initial_media = InitialMedia::new(&scene, Vec3::ZERO);
    let (paths, within) = (400_000, 0.2f32);
    let pass = LightPaths::new(0, 1, Domain::Light, paths, 1);
    let mut flux = 0.0;
    for start in (0..paths).filter_map(|index| pass.emit(&scene, &initial_media, index)) {
        let start = start.start;
        let on_floor = start.origin + start.direction * ((-1.0 - start.origin.y) / start.direction.y);
        if on_floor.xz().length() < within {
            flux += f64::from(start.throughput.x);
        }
    }
    let irradiance = flux / (std::f64::consts::PI * f64::from(within).powi(2));
    // 2 % less at the rim of the circle in which light paths are counted, and a noise of 0.6 %.
    assert!((irradiance / expected - 1.0).abs() < 0.03, "{irradiance} of {expected}");
}
