//! Motion blur: the picture is the mean over the time for which the shutter is open. Error rate of each test: 1e-4.

use crate::support;

use caustique::camera::Camera;
use caustique::error::Result;
use caustique::math::{DVec3, Vec3};
use caustique::render::{Control, Levels, Method, Motion, RenderInput, Rendered, Session, Settings, run_session};
use caustique::scene::{Description, Scene};
use support::channels::{self, SIZE, agree, disagreeing};
use support::scenes::{add, build, glass, look_at, matte, quad, sphere, square};

/// A scene whose parts depend on the time, 0 to 1.
struct Moving<F>(F);

impl<F: Fn(f64) -> Description + Sync> Moving<F> {
    fn scene(&self, time: f64) -> (Scene, Camera) {
        let scene = build((self.0)(time));
        let camera = scene.camera(&square(SIZE)).expect("a camera");
        (scene, camera)
    }

    /// Renders with motion blur.
    fn blurred(&self, settings: &Settings) -> Rendered {
        let (scene, camera) = self.scene(0.5);
        rendered(&RenderInput::new(&scene, &camera, settings).with_motion(Some(self)))
    }

    /// Renders the scene at one time.
    fn still(&self, time: f64, settings: &Settings) -> Rendered {
        let (scene, camera) = self.scene(time);
        rendered(&RenderInput::new(&scene, &camera, settings))
    }
}

impl<F: Fn(f64) -> Description + Sync> Motion for Moving<F> {
    fn at(&self, time: f64) -> Result<(Scene, Camera)> {
        Ok(self.scene(time))
    }
}

pub(crate) fn rendered(input: &RenderInput<'_>) -> Rendered {
    let mut session = Session::new(input);
    let stop = run_session(&mut session, |_, _| Control::Continue);
    session.finish(stop)
}

pub(crate) fn settings(method: Method, iterations: u64, seed: u64) -> Settings {
    Settings {
        method,
        iterations: Some(iterations),
        seed,
        photons: 4000,
        levels: Levels::new(1),
        ..Settings::default()
    }
}

/// A luminous square of side 1 that moves to the right from x = -1 to x = 0, in front of a camera that sees x from -1 to 1.
/// The mean of a pixel column is the radiance times the share of time and width for which it is covered.
#[test]
fn a_moving_square_covers_pixels_for_its_share_of_time() {
    let moving = Moving(|time: f64| {
        let mut description = Description::default();
        let left = time as f32 - 1.0;
        add(&mut description, "square", quad(Vec3::new(left, -0.5, 0.0), Vec3::X, Vec3::Y), matte(0.0, 1.0));
        description.cameras.push(look_at(DVec3::Z, DVec3::ZERO, 90.0));
        description
    });
    // The camera at distance 1 with 90 degrees sees two units.
    let pixel = 2.0 / f64::from(SIZE);
    let covered = |x: f64| (x + 1.0).clamp(0.0, 1.0) - x.clamp(0.0, 1.0);
    let expected = |column: u32| {
        let at = |k: u32| -1.0 + pixel * (f64::from(column) + (f64::from(k) + 0.5) / 64.0);
        (0..64).map(|k| covered(at(k))).sum::<f64>() / 64.0
    };
    let middle = SIZE * SIZE / 2;
    for method in [Method::Path, Method::Vcm, Method::Sppm] {
        let blurred = moving.blurred(&settings(method, 512, 1));
        let still = moving.still(0.5, &settings(method, 64, 1));
        let mut unlike = 0.0f64;
        for column in 0..SIZE {
            let index = (middle + column) as usize;
            let (found, still) = (blurred.pixels[index].mean(0).x, still.pixels[index].mean(0).x);
            // 512 moments and points in the pixel: a standard error of at most 1 / 45, much less in sequence.
            assert!((found - expected(column)).abs() < 0.02, "{method:?}, {column}: {found}, {}", expected(column));
            unlike = unlike.max((still - expected(column)).abs());
        }
        assert!(unlike > 0.2, "{method:?}: a still picture passes the test");
    }
}

/// A glass ball that moves above the floor in the light of a small lamp.
fn rolling_ball(time: f64) -> Description {
    let mut description = Description::default();
    add(&mut description, "floor", quad(Vec3::new(-2.0, 0.0, 2.0), 4.0 * Vec3::X, -4.0 * Vec3::Z), matte(0.7, 0.0));
    let center = Vec3::new(1.2 * time as f32 - 0.6, 0.5, 0.0);
    add(&mut description, "ball", sphere(center, 0.4, 24), glass(1.5));
    let lamp = quad(Vec3::new(-0.2, 2.5, -0.2), 0.4 * Vec3::X, 0.4 * Vec3::Z);
    add(&mut description, "lamp", lamp, matte(0.0, 40.0));
    // The caustic passes through this view, which is dark when the ball is in the middle.
    description.cameras.push(look_at(DVec3::new(0.7, 2.0, 2.5), DVec3::new(0.6, 0.0, 0.2), 10.0));
    description
}

/// The blurred caustic of a moving ball is the mean of 64 still pictures, by every method that finds caustics. Photons of
/// another moment would give the still picture of the middle, which is refused.
#[test]
#[ignore = "long"]
fn the_caustic_of_a_moving_ball_is_the_mean_of_still_pictures() {
    const STILLS: u64 = 64;
    let moving = Moving(rolling_ball);
    let mean_of_stills = |seed: u64| {
        let mut sums = vec![0.0; 3 * channels::TILES];
        for k in 0..STILLS {
            let time = (k as f64 + 0.5) / STILLS as f64;
            let still = channels::tiles(&moving.still(time, &settings(Method::Sppm, 4, 1000 * seed + k)));
            sums.iter_mut().zip(still).for_each(|(sum, value)| *sum += value / STILLS as f64);
        }
        sums
    };
    let reference: Vec<Vec<f64>> = (0..6).map(mean_of_stills).collect();
    for (method, iterations) in [(Method::Sppm, 256), (Method::Vcm, 128), (Method::Bdpt, 256)] {
        let blurred = channels::seeds(method, 6, |seed| moving.blurred(&settings(method, iterations, seed)));
        agree(&format!("{method:?}"), &blurred, &reference, 0.03, 0.3);
        let still = channels::seeds(method, 6, |seed| moving.still(0.5, &settings(method, iterations, seed)));
        assert!(!disagreeing(&still, &reference, 0.03).is_empty(), "{method:?}: a still picture passes the test");
    }
    // A planted fault: photons of a moment that is an eighth of the shutter's time late. The camera and what it sees rest,
    // so this is a ball that is late.
    let late = Moving(|time: f64| rolling_ball(time - 0.125));
    let late = channels::seeds(Method::Sppm, 6, |seed| late.blurred(&settings(Method::Sppm, 256, seed)));
    assert!(!disagreeing(&late, &reference, 0.03).is_empty(), "photons of another moment pass the test");
}

/// A moving render stops and continues without a change of its bits: the moment of an iteration follows from its number.
#[test]
fn a_blurred_render_continues_from_its_state_with_equal_bits() {
    let moving = Moving(rolling_ball);
    let (scene, camera) = moving.scene(0.5);
    for method in [Method::Path, Method::Vcm, Method::Sppm, Method::Cppm, Method::Pm, Method::Mlt] {
        let settings = settings(method, 6, 3);
        let input = RenderInput::new(&scene, &camera, &settings).with_motion(Some(&moving));
        let whole = rendered(&input);
        let mut session = Session::new(&input);
        for _ in 0..3 {
            session.step();
        }
        let state = session.state().expect("a state");
        let bytes = postcard::to_allocvec(&state).expect("bytes");
        let state = postcard::from_bytes(&bytes).expect("the state");
        let mut session = Session::resume(&input, state).expect("the same render");
        let stop = run_session(&mut session, |_, _| Control::Continue);
        let continued = session.finish(stop);
        for (a, b) in whole.pixels.iter().zip(&continued.pixels) {
            assert_eq!(a.mean(0), b.mean(0), "{method:?}");
        }
    }
}
