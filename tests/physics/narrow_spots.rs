//! Spots down to a thousandth of a degree: what they send and what arrives, in closed form.

use crate::support;

use caustique::light::Receiver;
use caustique::math::{DAffine3, DVec3, Rgb, Vec2, Vec3};
use caustique::random::{Domain, Purpose, Stream};
use caustique::scene::description::{PunctualKind, PunctualLight};
use caustique::scene::{Description, Scene};
use caustique::transport::{LightPass, Surroundings};
use support::scenes::{add, build, look_at, matte, quad};

/// A spot of intensity 1 that shines straight down on a floor 1 m below.
fn scene(inner: f32, outer: f32) -> Scene {
    let mut description = Description::default();
    add(&mut description, "floor", quad(Vec3::new(-9.0, -1.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0), matte(0.5, 0.0));
    let down = glam::DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2);
    description.lights.push(PunctualLight {
        name: "spot".into(),
        to_world: DAffine3::from_quat(down),
        intensity: Rgb::ONE,
        kind: PunctualKind::Spot { inner, outer },
        radius: 0.0,
    });
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 4.0), DVec3::ZERO, 40.0));
    build(description)
}

/// Solid angle of the cone, that of the edge weighted by the mean of a squared ramp: the flux for intensity 1.
fn flux(inner: f64, outer: f64) -> f64 {
    let cap = |angle: f64| 2.0 * (0.5 * angle).sin().powi(2);
    std::f64::consts::TAU * (cap(inner) + (cap(outer) - cap(inner)) / 3.0)
}

/// The flux that light paths leave with, and the irradiance of next-event estimation integrated over the floor,
/// whatever the angle. With cosines, and borders at least 1e-6 apart in them, a spot that is all edge had the solid
/// angle of 0.08 degrees: at 0.05 degrees 2.7 times its flux, at 0.001 degrees 6,600 times.
#[test]
fn narrow_spots_send_what_they_should() {
    for degrees in [0.001f32, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 30.0] {
        for share in [0.0, 0.5, 1.0] {
            let outer = degrees.to_radians();
            let inner = share * outer;
            let scene = scene(inner, outer);
            let expected = flux(f64::from(inner), f64::from(outer));
            let surroundings = Surroundings::new(&scene, Vec3::ZERO);
            let paths = 4096;
            let pass = LightPass::new(0, 1, Domain::Light, paths, 1);
            let starts: Vec<_> = (0..paths).filter_map(|index| pass.emit(&scene, &surroundings, index)).collect();
            let sent: f64 = starts.iter().map(|start| f64::from(start.start.throughput.x)).sum();
            assert!((sent / expected - 1.0).abs() < 1e-3, "{degrees} {share}: sends {sent} of {expected}");
            // Rounding moves a direction by 1e-7 or so.
            let widest =
                starts.iter().map(|start| start.start.direction.cross(Vec3::NEG_Y).length()).fold(0.0, f32::max);
            assert!(widest < outer.sin() * 1.001 + 2e-7 && widest > 0.5 * outer.sin(), "{degrees} {share}: {widest}");
            // Points of the floor, uniform over a disc a little wider than the cone.
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
            assert!((1.04 * sent / expected - 1.0).abs() > 4e-3, "one part in 25 goes unnoticed");
        }
    }
}
