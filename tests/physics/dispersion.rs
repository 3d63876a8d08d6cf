//! Compares dispersion with Snell's law wavelength by wavelength, and methods with each other.
//!
//! Statistical tests have a family-wise error rate of 0.1 % each (Sidak over their checks), plus the stated bias of
//! kernels. Every check must reject a planted error: glass without dispersion, colours combined as if they were
//! independent, or a picture that is brighter by a stated share.

use crate::support;

use bumpalo::Bump;
use caustique::bsdf::{BsdfSample, Transport};
use caustique::geometry::Mesh;
use caustique::material::{Material, MediumParameters};
use caustique::math::{DAffine3, DVec3, Rgb, Vec3};
use caustique::random::{Domain, Purpose, Stream};
use caustique::render::{InitialBandwidth, Levels, Method, Rendered, Settings};
use caustique::scene::description::{EnvironmentDescription, EnvironmentSource, PunctualKind, PunctualLight};
use caustique::scene::{Description, Scene};
use caustique::spectrum::{BANDS, Band, IterationWavelengths, Wavelength, WavelengthSample, observer};
use caustique::transport::{
    InitialMedia, Interior, LightPaths, Next, PathStart, Photons, Scattered, Vertex, Visitor, light_path, walk,
};
use glam::DQuat;
use support::channels::{self, SIZE, agree, disagreeing};
use support::render;
use support::scenes::{add, build, cuboid, glass, look_at, matte, quad, sphere};
use support::stats::{ERROR_RATE, chi_squared_p, mean_and_error, sidak, t_critical};

/// Glass of this index of refraction at 587.6 nm and this Abbe number.
fn dispersive(ior: f32, abbe: f32) -> Material {
    Material { dispersion: 20.0 / abbe, ..glass(ior) }
}

/// The index of refraction of KHR_materials_dispersion in double precision.
fn cauchy(ior: f64, abbe: f64, nm: f64) -> f64 {
    let b = (ior - 1.0) / (abbe * (486.1f64.powi(-2) - 656.3f64.powi(-2)));
    (ior + b * (nm.powi(-2) - 587.6f64.powi(-2))).max(1.0)
}

// ---------------------------------------------------------------- indices and colours

/// The Abbe number of the indices is the given one, and no index is below 1.
#[test]
fn indices_follow_the_abbe_number() {
    for (ior, abbe) in [(1.5f32, 59.0f32), (2.417, 55.3), (1.6, 5.0), (1.33, 55.0)] {
        let material = dispersive(ior, abbe);
        assert!(material.disperses());
        let [blue, yellow, red] = [486.1, 587.6, 656.3].map(|nm| material.ior_at(nm));
        assert!((yellow - ior).abs() < 1e-4, "{yellow}");
        assert!(((ior - 1.0) / (blue - red) / abbe - 1.0).abs() < 2e-3, "{ior} {abbe}: {blue} {red}");
        for nm in (390..=720).step_by(10) {
            let exact = cauchy(f64::from(ior), f64::from(abbe), f64::from(nm));
            assert!((f64::from(material.ior_at(nm as f32)) - exact).abs() < 2e-4, "{nm} nm");
        }
    }
    assert_eq!(dispersive(1.1, 0.1).ior_at(720.0), 1.0);
    for other in [glass(1.5), Material { thin: true, ..dispersive(1.5, 30.0) }, dispersive(1.0, 30.0)] {
        assert!(!other.disperses());
    }
}

/// Mean of `f` over the spectrum by the midpoint rule.
fn over_spectrum(f: impl Fn(f32) -> Rgb) -> [f64; 3] {
    let n = 1 << 16;
    let mut sum = [0.0; 3];
    for i in 0..n {
        let value = f((i as f32 + 0.5) / n as f32);
        for (c, sum) in sum.iter_mut().enumerate() {
            *sum += f64::from(value[c]) / f64::from(n);
        }
    }
    sum
}

/// The mean weight over all wavelengths is white, weights are between 0 and 3, and colours have the order of a prism.
#[test]
fn weights_are_white_on_average() {
    for mean in over_spectrum(|u| observer::sample(u).1) {
        assert!((mean - 1.0).abs() < 1e-6, "{mean}");
    }
    let mut last = 0.0;
    for i in 0..=10_000 {
        let (nm, weight) = observer::sample(i as f32 / 10_000.0);
        assert!(nm >= last && (390.0..=720.0).contains(&nm), "{nm}");
        assert!(weight.min_element() >= 0.0 && weight.max_element() < 3.05, "{nm}: {weight}");
        assert!((weight.element_sum() - 3.0).abs() < 0.02, "{nm}: {weight}");
        last = nm;
        // Blue, green and red are at the wavelengths where a prism shows them.
        let strongest = weight.max_position();
        match nm {
            430.0..480.0 => assert_eq!(strongest, 2, "{nm}: {weight}"),
            505.0..555.0 => assert_eq!(strongest, 1, "{nm}: {weight}"),
            600.0..680.0 => assert_eq!(strongest, 0, "{nm}: {weight}"),
            _ => {}
        }
    }
}

/// The mean weight of one iteration is nearly white, and the mean over iterations converges fast.
#[test]
fn the_wavelengths_of_an_iteration_are_nearly_white() {
    let of_pass = |pass| {
        let wavelengths = IterationWavelengths::new(9, pass);
        let band = |band: u8| {
            wavelengths.nearest(WavelengthSample::new((f32::from(band) + 0.5) / f32::from(BANDS))).wavelength().weight
        };
        (0..BANDS).map(band).sum::<Rgb>() / f32::from(BANDS)
    };
    let mut mean = Rgb::ZERO;
    for pass in 1..=32 {
        let white = of_pass(pass);
        assert!((white - Rgb::ONE).abs().max_element() < 0.25, "pass {pass}: {white}");
        mean += white / 32.0;
    }
    assert!((mean - Rgb::ONE).abs().max_element() < 0.01, "{mean}");
}

/// Paths of one channel draw bands in proportion to the weights in that channel, so all have the same weight.
#[test]
fn paths_of_one_channel_carry_the_same() {
    for channel in 0..3 {
        let offset = 0.37;
        let wavelength = |band: u8| WavelengthSample::new((f32::from(band) + offset) / f32::from(BANDS));
        let weights: Vec<f64> =
            (0..BANDS).map(|band| f64::from(wavelength(band).wavelength().weight[channel])).collect();
        let total: f64 = weights.iter().sum();
        let n = 100_000;
        let mut counts = vec![0.0; usize::from(BANDS)];
        for i in 0..n {
            let draws = Stream::new(5, 0, Domain::Test, i).vertex(channel as u32);
            // The result does not depend on the initial band.
            let taken = wavelength((i % 8) as u8).sample_in_channel(channel, draws.one(Purpose::Wavelength));
            let band = (0..BANDS).find(|&band| wavelength(band).wavelength().band == taken.band).expect("a band");
            counts[usize::from(band)] += 1.0;
            assert!((f64::from(taken.weight[channel]) - total / f64::from(BANDS)).abs() < 1e-5);
        }
        let expected = |weights: &[f64]| weights.iter().map(|w| w / total * n as f64).collect::<Vec<_>>();
        assert!(chi_squared_p(&counts, &expected(&weights)) > sidak(ERROR_RATE, 3), "channel {channel}: {counts:?}");
        let wrong: Vec<f64> = weights.iter().map(|w| 0.9 * w + 0.1 * total / f64::from(BANDS)).collect();
        assert!(chi_squared_p(&counts, &expected(&wrong)) < 1e-6, "channel {channel}: bands half blind go unnoticed");
    }
    // The mean over all offsets is the weight of white light.
    let mean = over_spectrum(|u| {
        Rgb::from_array([0, 1, 2].map(|c| WavelengthSample::new(u).sample_in_channel(c, 0.5).weight.x))
    });
    assert!(mean.iter().all(|m| (m - 1.0).abs() < 1e-4), "{mean:?}");
}

/// Mean contribution of two connected subpaths with independent wavelengths. `carried` is a further factor of both
/// subpaths, 0 or 1, that depends on the wavelength as behind a prism.
fn put_together(carried: impl Fn(f32) -> bool, weight: impl Fn(&Wavelength, &Wavelength) -> Rgb) -> [f64; 3] {
    let mut sum = [0.0; 3];
    let passes = 512;
    for pass in 1..=passes {
        let wavelengths = IterationWavelengths::new(1, pass);
        let taken = |band: u8| {
            wavelengths.nearest(WavelengthSample::new((f32::from(band) + 0.5) / f32::from(BANDS))).wavelength()
        };
        let all: Vec<Wavelength> = (0..BANDS).map(taken).filter(|wavelength| carried(wavelength.nm)).collect();
        for (eye, light) in all.iter().flat_map(|eye| all.iter().map(move |light| (eye, light))) {
            let value = eye.weight * light.weight * weight(eye, light);
            for (c, sum) in sum.iter_mut().enumerate() {
                *sum += f64::from(value[c]) / f64::from(BANDS).powi(2) / passes as f64;
            }
        }
    }
    sum
}

#[test]
fn connected_paths_have_one_wavelength() {
    let carried = |nm: f32| nm > 530.0 && nm < 610.0;
    let expected = over_spectrum(|u| {
        let (nm, weight) = observer::sample(u);
        if carried(nm) { weight } else { Rgb::ZERO }
    });
    let off = |found: [f64; 3]| (0..2).map(|c| (found[c] / expected[c] - 1.0).abs()).fold(0.0, f64::max);
    let meeting = |eye: &Wavelength, light: &Wavelength| eye.connection_factor(light.band).unwrap_or(Rgb::ZERO);
    let found = put_together(carried, meeting);
    assert!(off(found) < 0.02, "{found:?} {expected:?}");
    // The planted bugs: colours multiplied as if wavelengths were independent; and equal bands connected with the
    // colour counted twice.
    assert!(off(put_together(carried, |_, _| Rgb::ONE)) > 0.2, "a product of colours is not detected");
    let twice = |eye: &Wavelength, light: &Wavelength| {
        if eye.band == light.band { Rgb::splat(f32::from(BANDS)) } else { Rgb::ZERO }
    };
    assert!(off(put_together(carried, twice)) > 0.2, "a colour counted twice is not detected");
    // White subpaths are connected to all others.
    let eye = WavelengthSample::new(0.3).wavelength();
    assert_eq!(eye.connection_factor(Band::WHITE), Some(Rgb::ONE));
    assert_eq!(Band::of_wavelength(None), Band::WHITE);
}

// ---------------------------------------------------------------- a prism, by Snell's law

const ABBE: f32 = 12.0;
const IOR: f32 = 1.6;

/// An equilateral prism along the z axis. Its faces look left (up), right (up) and down.
fn prism_mesh(half: f32) -> Mesh {
    let (s, c) = (0.5, 0.75f32.sqrt());
    let corner = |x: f32, y: f32, z: f32| Vec3::new(x, y - c / 3.0, z);
    let positions = [-half, half].into_iter().flat_map(|z| [corner(-s, 0.0, z), corner(s, 0.0, z), corner(0.0, c, z)]);
    let triangles = vec![[0, 2, 1], [3, 4, 5], [0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [2, 0, 3], [2, 3, 5]];
    Mesh { positions: positions.collect(), triangles, closed: true, ..Mesh::default() }
}

/// Angle above the x axis of light that leaves the right face, if it arrives at the left face at an angle `arriving`
/// above the x axis. `None` if it does not leave there.
fn through_prism(index: f64, arriving: f64) -> Option<f64> {
    let half = 30f64.to_radians();
    // The angle with the inward normal of the left face, which points down.
    let first = ((arriving + half).sin() / index).asin();
    let second = 2.0 * half - first;
    let sin = index * second.sin();
    (sin < 1.0).then(|| half - sin.asin())
}

/// Fresnel transmittance of unpolarised light through both faces.
fn prism_transmittance(index: f64, arriving: f64) -> f64 {
    let half = 30f64.to_radians();
    let face = |outside: f64, inside: f64| {
        let (o, i) = (outside.cos(), inside.cos());
        let (s, p) = ((o - index * i) / (o + index * i), (index * o - i) / (index * o + i));
        1.0 - 0.5 * (s * s + p * p)
    };
    let first = ((arriving + half).sin() / index).asin();
    let second = 2.0 * half - first;
    face(arriving + half, first) * face((index * second.sin()).asin(), second)
}

fn prism_scene(material: Material) -> Scene {
    let mut description = Description::default();
    add(&mut description, "prism", prism_mesh(2.0), material);
    build(description)
}

/// A visitor that follows only transmission.
#[derive(Default)]
struct Straight {
    surfaces: u32,
    transmitted: u32,
    escaped: Option<Vec3>,
}

impl<'a> Visitor<'a> for Straight {
    fn surface(&mut self, vertex: &Vertex<'_, 'a>, _: Option<Scattered>) -> Next {
        self.surfaces += 1;
        Next::Continue(vertex.shading.bsdf.lobes())
    }

    fn scatter(&mut self, _: &Vertex<'_, 'a>, sample: &BsdfSample) {
        self.transmitted += u32::from(sample.transmitted);
    }

    fn escape(&mut self, direction: Vec3, _: Rgb, _: Option<Scattered>, _: caustique::medium::FlightDensity) {
        self.escaped = Some(direction);
    }
}

/// Angle at which a ray of this wavelength leaves the prism.
fn deviated(scene: &Scene, wavelength: WavelengthSample, arriving: f64) -> f64 {
    let direction = DVec3::new(arriving.cos(), arriving.sin(), 0.0).as_vec3();
    // Starts into the middle of the left face.
    let start = PathStart {
        origin: Vec3::new(-0.25, 0.75f32.sqrt() / 6.0, 0.0) - 3.0 * direction,
        direction,
        throughput: Rgb::ONE,
        interior: Interior::default(),
        leaving: None,
        first: caustique::transport::PrecomputedHit::Unknown,
        far: false,
        channel: None,
        wavelength_sample: wavelength,
        linked: None,
    };
    for path in 0..100 {
        let mut straight = Straight::default();
        let stream = Stream::new(0, 0, Domain::Test, path);
        walk(scene, &Bump::new(), &start, stream, Transport::Importance, 8, &mut straight);
        if let (2, 2, Some(d)) = (straight.surfaces, straight.transmitted, straight.escaped) {
            return f64::from(d.y).atan2(f64::from(d.x));
        }
    }
    panic!("no path gets through the prism");
}

/// Every wavelength has its angle of minimum deviation D, with n = sin((A + D) / 2) / sin(A / 2), and at the angle of
/// another wavelength it leaves as Snell's law predicts.
#[test]
fn a_prism_bends_each_wavelength_by_its_index() {
    let scene = prism_scene(dispersive(IOR, ABBE));
    let plain = prism_scene(glass(IOR));
    let mut wrong: f64 = 0.0;
    for k in 0..40 {
        let wavelength = WavelengthSample::new((f32::from(k as u8) + 0.5) / 40.0);
        let nm = f64::from(wavelength.wavelength().nm);
        let index = cauchy(f64::from(IOR), f64::from(ABBE), nm);
        // At minimum deviation the path inside is parallel to the base.
        let arriving = (index * 0.5).asin() - 30f64.to_radians();
        let deviation = arriving - deviated(&scene, wavelength, arriving);
        let found = (0.5 * (60f64.to_radians() + deviation)).sin() / 0.5;
        assert!((found - index).abs() < 3e-5, "{nm} nm: {found} for {index}");
        let fixed = 24f64.to_radians();
        let expected = through_prism(index, fixed).expect("no total reflection");
        let angle = deviated(&scene, wavelength, fixed);
        assert!((angle - expected).abs() < 1e-4, "{nm} nm: {angle} for {expected}");
        wrong = wrong.max((deviated(&plain, wavelength, fixed) - expected).abs());
    }
    assert!(wrong > 0.02, "glass that does not disperse is not detected: {wrong}");
}

/// The sun shines through the prism on to a screen. Photons land where their wavelength is refracted to, with its
/// colour, and the mean direction of each channel is that of the integral.
#[test]
fn photons_behind_a_prism_land_where_their_colour_belongs() {
    let arriving = 24f64.to_radians();
    let seeds = 16;
    let trace = |material: Material| -> [Vec<f64>; 3] {
        let (ior, abbe) = (f64::from(material.ior), 20.0 / f64::from(material.dispersion).max(1e-9));
        let mut description = Description::default();
        add(&mut description, "prism", prism_mesh(0.5), material);
        let screen = quad(Vec3::new(3.0, -4.0, -3.0), Vec3::Z * 6.0, Vec3::Y * 6.0);
        add(&mut description, "screen", screen, matte(0.0, 0.0));
        description.lights.push(PunctualLight {
            name: "sun".into(),
            to_world: DAffine3::from_quat(DQuat::from_rotation_arc(
                DVec3::NEG_Z,
                DVec3::new(arriving.cos(), arriving.sin(), 0.0),
            )),
            intensity: Rgb::ONE,
            kind: PunctualKind::Sun { angle: 0.0 },
            pattern: None,
            pass_through: false,
            bulb: false,
            radius: 0.0,
            hidden_from_camera: false,
            light_group: None,
            links: None,
        });
        let scene = build(description);
        assert_eq!(scene.survey.dispersion, abbe < 1e6);
        let initial_media = InitialMedia::new(&scene, Vec3::new(0.0, 5.0, 0.0));
        let mut means: [Vec<f64>; 3] = Default::default();
        for seed in 0..seeds {
            let pass = LightPaths::new(seed, 0, Domain::Light, 40_000, 3);
            let mut photons = Photons::default();
            for index in 0..pass.count() {
                light_path(&scene, &Bump::new(), &initial_media, &pass, index, &mut photons);
            }
            let (mut flux, mut moment) = ([0.0f64; 3], [0.0f64; 3]);
            for photon in photons.surface.iter().flatten().filter(|photon| photon.depth == 3) {
                let d = -photon.wi;
                let angle = f64::from(d.y).atan2(f64::from(d.x));
                // Light that enters by the base goes up.
                if d.x < 0.1 || angle > 0.0 {
                    continue;
                }
                // The wavelength that leaves at this angle, by bisection. Blue is deflected most.
                let (mut low, mut high) = (390.0f64, 720.0f64);
                for _ in 0..50 {
                    let middle = 0.5 * (low + high);
                    let bent = through_prism(cauchy(ior, abbe, middle), arriving).unwrap_or(f64::NEG_INFINITY);
                    if bent < angle { low = middle } else { high = middle }
                }
                if abbe < 1e6 {
                    let weight = color_of(0.5 * (low + high));
                    let color = photon.flux * (3.0 / photon.flux.element_sum());
                    assert!((color - weight).abs().max_element() < 0.03, "{low} nm: {color} for {weight}");
                }
                // The photon is where a ray of that angle hits the screen.
                assert!((photon.p.x - 3.0).abs() < 1e-4);
                assert!((f64::from(photon.p.y) - 3.0 * angle.tan()).abs() < 0.8, "{}", photon.p);
                for (c, (flux, moment)) in flux.iter_mut().zip(&mut moment).enumerate() {
                    *flux += f64::from(photon.flux[c]);
                    *moment += f64::from(photon.flux[c]) * angle;
                }
            }
            for (means, (moment, flux)) in means.iter_mut().zip(moment.iter().zip(&flux)) {
                means.push(moment / flux);
            }
        }
        means
    };
    // The midpoint rule over the spectrum.
    let n = 4000;
    let (mut flux, mut moment) = ([0.0f64; 3], [0.0f64; 3]);
    for i in 0..n {
        let (nm, weight) = observer::sample((i as f32 + 0.5) / n as f32);
        let index = cauchy(f64::from(IOR), f64::from(ABBE), f64::from(nm));
        let Some(angle) = through_prism(index, arriving) else { continue };
        for (c, (flux, moment)) in flux.iter_mut().zip(&mut moment).enumerate() {
            let passed = f64::from(weight[c]) * prism_transmittance(index, arriving);
            *flux += passed;
            *moment += passed * angle;
        }
    }
    let expected: [f64; 3] = std::array::from_fn(|c| moment[c] / flux[c]);
    let critical = t_critical(ERROR_RATE, 3, seeds as f64 - 1.0);
    let faults = |means: &[Vec<f64>; 3]| {
        let fault = |c: usize| {
            let (mean, error) = mean_and_error(&means[c]);
            println!("channel {c}: {mean:.5} +- {error:.5}, expected {:.5}", expected[c]);
            // Interreflection between the faces changes less with the angle than this.
            (mean - expected[c]).abs() > critical * error + 5e-4
        };
        (0..3).filter(|&c| fault(c)).count()
    };
    assert_eq!(faults(&trace(dispersive(IOR, ABBE))), 0);
    assert_eq!(faults(&trace(glass(IOR))), 3, "glass that does not disperse is not detected");
}

/// The weight of a wavelength (nm), by bisection.
fn color_of(nm: f64) -> Rgb {
    let (mut low, mut high) = (0.0f32, 1.0f32);
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if f64::from(observer::sample(middle).0) < nm { low = middle } else { high = middle }
    }
    observer::sample(low).1
}

// ---------------------------------------------------------------- pictures

fn settings(iterations: u64, seed: u64) -> Settings {
    Settings { seed, levels: Levels::new(1), iterations: Some(iterations), ..Settings::default() }
}

fn photons(photons: u32, radius: f32, iterations: u64, seed: u64) -> Settings {
    Settings { photons, initial_bandwidth: InitialBandwidth::Fixed(radius), ..settings(iterations, seed) }
}

const SEEDS: u64 = 20;

/// Renders one picture per seed.
fn seeds(scene: &Scene, method: Method, of: impl Fn(u64) -> Settings) -> Vec<Vec<f64>> {
    channels::seeds(method, SEEDS, |seed| render(scene, method, SIZE, &of(seed)))
}

fn sun(direction: DVec3, angle_deg: f32, irradiance: f32) -> PunctualLight {
    PunctualLight {
        name: "sun".into(),
        to_world: DAffine3::from_quat(DQuat::from_rotation_arc(DVec3::NEG_Z, direction.normalize())),
        intensity: Rgb::splat(irradiance),
        kind: PunctualKind::Sun { angle: angle_deg.to_radians() },
        pattern: None,
        pass_through: false,
        bulb: false,
        radius: 0.0,
        hidden_from_camera: false,
        light_group: None,
        links: None,
    }
}

/// A wedge from `low` to `high` whose height grows by `slope` along x.
fn wedge(low: Vec3, high: Vec3, slope: f32) -> Mesh {
    let mut mesh = cuboid(low, high, false);
    for p in mesh.positions.iter_mut().filter(|p| p.y > 0.5 * (low.y + high.y)) {
        p.y += slope * (p.x - low.x);
    }
    mesh
}

/// The sun shines through a hole in a roof, which a wedge of glass covers, and makes a rainbow on the floor. The camera
/// is below the roof; with `behind_glass`, behind a second wedge.
fn rainbow(material: impl Fn(f32) -> Material, behind_glass: bool) -> Scene {
    let mut description = Description::default();
    let floor = quad(Vec3::new(-3.0, 0.0, -3.0), Vec3::Z * 6.0, Vec3::X * 6.0);
    add(&mut description, "floor", floor, matte(0.6, 0.0));
    for (x, z, width, depth) in
        [(-3.0, -3.0, 2.8, 6.0), (0.2, -3.0, 2.8, 6.0), (-0.2, -3.0, 0.4, 2.6), (-0.2, 0.4, 0.4, 2.6)]
    {
        add(&mut description, "roof", quad(Vec3::new(x, 2.0, z), Vec3::Z * depth, Vec3::X * width), matte(0.2, 0.0));
    }
    let cover = wedge(Vec3::new(-0.25, 2.001, -0.45), Vec3::new(0.25, 2.05, 0.45), 0.45);
    add(&mut description, "wedge", cover, material(1.7));
    description.lights.push(sun(DVec3::new(0.0, -1.0, 0.0), 20.0, 10.0));
    if behind_glass {
        let pane = wedge(Vec3::new(-0.2, 0.8, -0.8), Vec3::new(1.8, 0.85, 0.8), 0.25);
        add(&mut description, "pane", pane, material(1.5));
    }
    description.cameras.push(look_at(DVec3::new(0.8, 1.9, 0.0), DVec3::new(0.8, 0.0, 0.01), 32.0));
    build(description)
}

/// Glass with strong dispersion.
fn strong(ior: f32) -> Material {
    dispersive(ior, 3.0)
}

fn merging(iterations: u64, seed: u64) -> Settings {
    Settings { initial_bandwidth: InitialBandwidth::Fixed(0.06), ..settings(iterations, seed) }
}

fn plus(settings: Settings) -> Settings {
    let mut settings = settings;
    settings.chi_squared.plus = true;
    settings
}

/// The rainbow on the floor is found by all methods. Light tracing, which needs no equal wavelengths, has the least
/// noise.
#[test]
fn a_rainbow_agrees() {
    let scene = rainbow(strong, false);
    let light = seeds(&scene, Method::Light, |seed| settings(60, seed));
    let plain = seeds(&rainbow(glass, false), Method::Light, |seed| settings(15, seed));
    assert!(!disagreeing(&plain, &light, 0.2).is_empty(), "glass that does not disperse is not detected");
    let path = seeds(&scene, Method::Path, |seed| settings(180, seed));
    agree("rainbow, path", &path, &light, 2e-3, 0.35);
    let bdpt = seeds(&scene, Method::Bdpt, |seed| settings(30, seed));
    agree("rainbow, bdpt", &bdpt, &light, 2e-3, 0.15);
    let vcm = seeds(&scene, Method::Vcm, |seed| merging(24, seed));
    agree("rainbow, vcm", &vcm, &light, 0.01, 0.15);
    for method in [Method::Sppm, Method::Ppm] {
        let other = seeds(&scene, method, |seed| photons(10_000, 0.06, 4, seed));
        agree(&format!("rainbow, {method:?}"), &other, &light, 0.02, 0.2);
    }
    let other = seeds(&scene, Method::Cppm, |seed| plus(photons(30_000, 0.06, 5, seed)));
    agree("rainbow, cppm plus", &other, &light, 0.02, 0.4);
}

/// The rainbow seen through dispersive glass: light subpaths and camera subpaths both have a wavelength.
#[test]
#[ignore = "long"]
fn a_rainbow_behind_dispersive_glass_agrees() {
    let scene = rainbow(strong, true);
    let path = seeds(&scene, Method::Path, |seed| settings(300, seed));
    let plain = seeds(&rainbow(glass, true), Method::Sppm, |seed| photons(10_000, 0.06, 4, seed));
    assert!(!disagreeing(&plain, &path, 0.2).is_empty(), "glass that does not disperse is not detected");
    let bdpt = seeds(&scene, Method::Bdpt, |seed| settings(45, seed));
    agree("rainbow behind glass, bdpt", &bdpt, &path, 2e-3, 0.5);
    for method in [Method::Vcm, Method::Bpm] {
        let other = seeds(&scene, method, |seed| merging(96, seed));
        agree(&format!("rainbow behind glass, {method:?}"), &other, &path, 0.02, 0.4);
    }
    for method in [Method::Sppm, Method::Cppm, Method::Pm] {
        let other = seeds(&scene, method, |seed| photons(20_000, 0.06, 6, seed));
        agree(&format!("rainbow behind glass, {method:?}"), &other, &path, 0.02, 0.4);
    }
    let other = seeds(&scene, Method::Cppm, |seed| plus(photons(20_000, 0.06, 18, seed)));
    agree("rainbow behind glass, cppm plus", &other, &path, 0.02, 0.4);
}

/// A prism in fog, seen through a dispersive pane: photons in media.
#[test]
fn a_rainbow_in_fog_agrees() {
    let mut description = Description::default();
    let room = cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 2.0), true);
    add(&mut description, "room", room, matte(0.3, 0.0));
    let lamp = quad(Vec3::new(-0.3, 1.98, -0.3), Vec3::X * 0.6, Vec3::Z * 0.6);
    add(&mut description, "lamp", lamp, matte(0.0, 10.0));
    add(&mut description, "ball", sphere(Vec3::new(0.0, 1.1, 0.0), 0.35, 64), dispersive(1.6, 5.0));
    let mut pane = cuboid(Vec3::new(-0.6, 0.3, 1.0), Vec3::new(0.6, 1.7, 1.1), false);
    for p in &mut pane.positions {
        p.z += if p.z > 1.05 { 0.3 * (p.x + 0.6) } else { 0.0 };
    }
    add(&mut description, "pane", pane, dispersive(1.5, 5.0));
    description.medium = Some(MediumParameters { sigma_a: Rgb::splat(0.05), sigma_s: Rgb::splat(0.7), g: 0.3 });
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 1.9), DVec3::new(0.0, 0.8, 0.0), 50.0));
    let scene = build(description);
    let path = seeds(&scene, Method::Path, |seed| settings(24, seed));
    let bdpt = seeds(&scene, Method::Bdpt, |seed| settings(9, seed));
    agree("rainbow in fog, bdpt", &bdpt, &path, 2e-3, 0.3);
    let sppm = seeds(&scene, Method::Sppm, |seed| photons(10_000, 0.08, 5, seed));
    agree("rainbow in fog, sppm", &sppm, &bdpt, 0.03, 0.3);
}

/// Rough dispersive glass, at which lights are sampled and photons are gathered.
#[test]
fn rough_dispersive_glass_agrees() {
    let mut description = Description::default();
    let room = cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 3.0), true);
    add(&mut description, "room", room, matte(0.5, 0.0));
    let lamp = quad(Vec3::new(-0.4, 1.98, -0.4), Vec3::X * 0.8, Vec3::Z * 0.8);
    add(&mut description, "lamp", lamp, matte(0.0, 8.0));
    for (x, roughness) in [(-0.45, 0.25), (0.45, 0.6)] {
        let ball = sphere(Vec3::new(x, 0.45, 0.2), 0.4, 64);
        add(&mut description, "ball", ball, Material { roughness: roughness.into(), ..dispersive(1.5, 6.0) });
    }
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 2.8), DVec3::new(0.0, 0.9, 0.0), 50.0));
    let scene = build(description);
    let path = seeds(&scene, Method::Path, |seed| settings(12, seed));
    let bdpt = seeds(&scene, Method::Bdpt, |seed| settings(4, seed));
    agree("rough glass, bdpt", &bdpt, &path, 2e-3, 0.15);
    let vcm = seeds(&scene, Method::Vcm, |seed| merging(7, seed));
    agree("rough glass, vcm", &vcm, &path, 0.02, 0.15);
    let sppm = seeds(&scene, Method::Sppm, |seed| photons(20_000, 0.05, 5, seed));
    agree("rough glass, sppm", &sppm, &path, 0.03, 0.2);
}

// ---------------------------------------------------------------- white stays white

/// Clear dispersive glass, smooth or rough, is invisible under a white sky.
#[test]
fn furnace() {
    for roughness in [0.0, 0.5] {
        let mut description = Description::default();
        let ball = sphere(Vec3::ZERO, 1.0, 64);
        add(&mut description, "ball", ball, Material { roughness: roughness.into(), ..dispersive(1.7, 5.0) });
        let source = EnvironmentSource::Color(Rgb::ONE);
        description.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
        description.cameras.push(look_at(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, 36.0));
        let scene = build(description);
        // Rough glass gathers photons: a photon map of the sky would be only noise.
        let methods = [Method::Path, Method::Bdpt, Method::Sppm];
        for &method in &methods[..if roughness > 0.0 { 2 } else { 3 }] {
            let mut means: [Vec<f64>; 3] = Default::default();
            for seed in 0..10 {
                let rendered = render(&scene, method, 8, &photons(100, 0.05, 100, seed));
                for (c, means) in means.iter_mut().enumerate() {
                    means.push(rendered.pixels.iter().map(|p| p.mean(0)[c]).sum::<f64>() / 64.0);
                }
            }
            let critical = t_critical(ERROR_RATE, 3, 9.0);
            for (c, means) in means.iter().enumerate() {
                let (mean, error) = mean_and_error(means);
                println!("furnace, roughness {roughness}, {method:?}, channel {c}: {mean:.5} +- {error:.5}");
                // The energy compensation of rough interfaces uses tables of one index for all wavelengths.
                let bias = if roughness > 0.0 { 0.01 } else { 1e-3 };
                let passes = |expected: f64| (mean - expected).abs() < critical * error + bias;
                assert!(passes(1.0), "roughness {roughness}, {method:?}, channel {c}: {mean} +- {error}");
                assert!(
                    !passes(1.1) && !passes(0.9),
                    "{method:?}, channel {c}: the error is not detected ({mean} +- {error})"
                );
            }
        }
    }
}

fn bytes(rendered: &Rendered) -> Vec<[u64; 3]> {
    rendered.pixels.iter().map(|pixel| pixel.mean(0).to_array().map(f64::to_bits)).collect()
}

/// Dispersion of zero, of a material that does not refract, and of an unused material does not change any bit. The bits
/// do not depend on the number of threads.
#[test]
fn without_dispersion_no_bit_changes() {
    let scene = |first: Material, unused: bool| {
        let mut description = Description::default();
        let room = cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 2.0), true);
        add(&mut description, "room", room, matte(0.5, 0.0));
        let lamp = quad(Vec3::new(-0.3, 1.98, -0.3), Vec3::X * 0.6, Vec3::Z * 0.6);
        add(&mut description, "lamp", lamp, matte(0.0, 10.0));
        add(&mut description, "ball", sphere(Vec3::new(0.0, 0.8, 0.3), 0.4, 32), first);
        if unused {
            description.materials.push(dispersive(1.5, 10.0));
        }
        description.cameras.push(look_at(DVec3::new(0.0, 1.0, 1.9), DVec3::new(0.0, 0.9, 0.0), 50.0));
        build(description)
    };
    let thin = Material { thin: true, ..glass(1.5) };
    let cases = [
        (glass(1.5), Material { dispersion: 0.0, ..glass(1.5) }, true),
        (thin.clone(), Material { dispersion: 0.7, ..thin }, false),
        (glass(1.0), dispersive(1.0, 20.0), false),
    ];
    for method in [Method::Path, Method::Sppm, Method::Vcm] {
        for (plain, dispersion, unused) in &cases {
            let [plain, other] = [(plain, false), (dispersion, *unused)].map(|(m, unused)| scene(m.clone(), unused));
            assert!(!plain.survey.dispersion && !other.survey.dispersion);
            let [a, b] = [&plain, &other].map(|s| bytes(&render(s, method, 16, &photons(2000, 0.1, 3, 1))));
            assert_eq!(a, b, "{method:?}");
        }
        let scene = scene(dispersive(1.5, 10.0), false);
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| bytes(&render(&scene, method, 16, &photons(2000, 0.1, 3, 1))))
        };
        assert_eq!(with(1), with(3), "{method:?}");
    }
}

/// Glass of very weak dispersion uses wavelengths, and gives nearly the picture without dispersion.
#[test]
fn little_dispersion_is_nearly_none() {
    let none = rainbow(glass, true);
    let little = rainbow(|ior| Material { dispersion: 1e-5, ..glass(ior) }, true);
    assert!(little.survey.dispersion);
    let sppm = |scene: &Scene, first: u64| seeds(scene, Method::Sppm, |seed| photons(20_000, 0.06, 5, seed + first));
    let plain = sppm(&none, 0);
    agree("little dispersion, sppm", &sppm(&little, 100), &plain, 2e-3, 0.2);
    let bdpt = seeds(&little, Method::Bdpt, |seed| settings(30, seed));
    agree("little dispersion, bdpt", &bdpt, &plain, 0.02, 0.8);
}
