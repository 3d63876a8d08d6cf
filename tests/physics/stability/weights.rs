//! MIS weights of paths with densities over the whole range of f32, and weights of guided emission.

use crate::support::scenes::{add, build, cuboid, glass, look_at, matte, quad, sphere, square};
use caustique::camera::Camera;
use caustique::light::{EmissionDensity, Guide};
use caustique::math::{DVec3, Vec3};
use caustique::random::{Domain, Purpose, Stream};
use caustique::scene::Description;
use caustique::transport::bidirectional::mis::{self, End, Eta, Merges, MisState, one_merge};
use caustique::transport::{InitialMedia, LightPaths, TechniqueSet};

const PATHS: u64 = 100_000;
const LIGHT_PATHS: f32 = 1e6;
/// Allowed deviation of a sum of weights from one.
const TOLERANCE: f64 = 1e-5;

/// A path described by its densities.
struct Chain {
    light: EmissionDensity,
    /// Per vertex from the light: cosine (equal on both sides), and densities of scattering towards the camera and
    /// towards the light.
    vertices: Vec<[f32; 3]>,
    /// Squared lengths of segments, one more than vertices.
    distance2: Vec<f32>,
    camera: f32,
    /// Number of light paths that a camera path connects to, 0 to 4.
    connections: f64,
}

impl Chain {
    /// A path of one to four vertices. Densities per area are from 10^-30 to 10^30.
    fn new(index: u64) -> Chain {
        let stream = Stream::new(41, 0, Domain::Test, index);
        let mut drawn = 0;
        let mut draw = |low: f32, high: f32| {
            drawn += 1;
            10f32.powf(low + (high - low) * stream.vertex(drawn).one(Purpose::Pixel))
        };
        let count = 1 + index % 4;
        let vertices = (0..count).map(|_| [draw(-5.0, 0.0), draw(-15.0, 20.0), draw(-15.0, 20.0)]).collect();
        let distance2 = (0..=count).map(|_| draw(-10.0, 10.0)).collect();
        let (start, onward, cos) = (draw(-20.0, 20.0), draw(-15.0, 20.0), draw(-5.0, 0.0));
        let light = EmissionDensity { direct: start, start, onward, cos, infinite: false, delta: false };
        Chain { light, vertices, distance2, camera: draw(-10.0, 15.0), connections: (index % 5) as f64 }
    }

    /// Weights of all techniques. The planted bug ignores the cosines at which light paths arrive.
    fn weights(&self, which: &TechniqueSet, eta: Eta, bug: bool) -> Vec<f32> {
        let (k, light) = (self.vertices.len(), &self.light);
        let [cos, to_eye, to_light] = [0, 1, 2].map(|part| move |j: usize| self.vertices[j][part]);
        let by_light = |j: usize| which.light_vertex_merge(j as u32 + 1);
        let by_camera = |j: usize| which.camera_vertex_merge((k - j) as u32, j + 1 == k);
        // Densities per area of reaching a vertex from either side.
        let from_light = |j: usize| if j == 0 { light.onward } else { to_eye(j - 1) } * (cos(j) / self.distance2[j]);
        let from_camera =
            |j: usize| if j + 1 == k { self.camera } else { to_light(j + 1) } * (cos(j) / self.distance2[j + 1]);
        let joins = |length: usize| if length == 1 { 1.0 } else { self.connections };
        let (mut lights, mut eyes) = (Vec::new(), vec![MisState::default(); k]);
        let mut mis = MisState::light(light);
        for j in 0..k {
            mis = mis.arrive(self.distance2[j], if bug { 1.0 } else { cos(j) });
            lights.push(mis);
            mis = mis.scatter(cos(j), to_eye(j), to_light(j), joins(j + 1), by_light(j));
        }
        let mut mis = MisState::camera(LIGHT_PATHS, self.camera);
        for j in (0..k).rev() {
            mis = mis.arrive(self.distance2[j + 1], cos(j));
            eyes[j] = mis;
            mis = mis.scatter(cos(j), to_light(j), to_eye(j), joins(k - j), by_camera(j));
        }
        let solid = self.distance2[0] / light.cos;
        let arrival = light.onward * (cos(0) / self.distance2[0]);
        let pdfs = mis::NextEventPdfs {
            pdf_w: to_light(0),
            reverse_pdf_w: to_eye(0),
            light_pdf_w: light.direct * solid,
            arrival_pdf_a: arrival,
            delta: false,
        };
        let mut all = vec![
            mis::hit(&mis.arrive(self.distance2[0], light.cos), light).weight(eta),
            mis::next_event(&eyes[0], joins(k), &pdfs).weight(eta),
            mis::camera(&lights[k - 1], joins(k), from_camera(k - 1), LIGHT_PATHS, to_light(k - 1)).weight(eta),
        ];
        for s in (1..k).filter(|_| self.connections > 0.0) {
            let end = |mis, length, reverse_pdf_w, arrival_pdf_a, merges| End {
                mis,
                reverse_pdf_w,
                arrival_pdf_a,
                joins: joins(length),
                merges,
            };
            let light = end(&lights[s - 1], s, to_light(s - 1), from_camera(s - 1), by_light(s - 1));
            let camera = end(&eyes[s], k - s, to_eye(s), from_light(s), by_camera(s));
            all.push(mis::connect(&light, &camera, self.connections).weight(eta));
        }
        for m in 0..k {
            if by_light(m) != Merges::ZERO && by_camera(m) != Merges::ZERO {
                let own = one_merge(m + 1 == k);
                all.push(
                    mis::merge(&lights[m], &eyes[m], [joins(m + 1), joins(k - m)], to_light(m), to_eye(m), own)
                        .merge_weight(eta),
                );
            }
        }
        all
    }
}

/// Each weight is from 0 to 1 and all sum to one, for any densities, bandwidth and number of connections.
#[test]
fn weights_of_any_densities_sum_to_one() {
    let techniques = TechniqueSet::VCM;
    let (mut worst, mut planted) = (0.0f64, 0.0f64);
    for index in 0..PATHS {
        let chain = Chain::new(index);
        let eta = match index % 3 {
            0 => Eta::NONE,
            1 => Eta::new(1e-10, LIGHT_PATHS).sharing(3.0, 7.0),
            _ => Eta::new(10.0, LIGHT_PATHS),
        };
        let techniques = if index % 3 == 0 { TechniqueSet::BDPT } else { techniques };
        let weights = chain.weights(&techniques, eta, false);
        assert!(weights.iter().all(|weight| (0.0..=1.0 + 1e-6).contains(weight)), "path {index}: {weights:?}");
        let sum = |weights: &[f32]| weights.iter().map(|weight| f64::from(*weight)).sum::<f64>();
        let error = (sum(&weights) - 1.0).abs();
        assert!(error < TOLERANCE, "path {index}: {weights:?} sum to 1 + {error:e}");
        worst = worst.max(error);
        planted = planted.max((sum(&chain.weights(&techniques, eta, true)) - 1.0).abs());
    }
    println!("{PATHS} paths: sums off by {worst:.1e}, with a cosine forgotten by {planted:.1e}");
    assert!(planted > 100.0 * TOLERANCE, "{planted:e}");
}

/// The flux of guided and aimed light paths is multiplied by the density of unguided emission over that of the mixture.
/// Over a million starts, this factor has the mean 1 within four standard errors (6.3e-5 false alarms) and a
/// ten-thousandth, and the unguided part has its share. Starts with a doubled probability are detected.
#[test]
fn guided_starts_conserve_the_flux() {
    let mut description = Description::default();
    add(&mut description, "room", cuboid(Vec3::ZERO, Vec3::new(4.0, 2.0, 4.0), true), matte(0.5, 0.0));
    for (x, side) in [(1.0, 0.4), (3.0, 1e-3)] {
        let lamp = quad(Vec3::new(x, 1.9, 2.0), Vec3::X * side, Vec3::Z * side);
        add(&mut description, "lamp", lamp, matte(0.0, 1.0 / (side * side)));
    }
    add(&mut description, "near", sphere(Vec3::new(1.0, 0.4, 2.0), 0.3, 64), glass(1.5));
    add(&mut description, "dust", sphere(Vec3::new(3.0, 1.0, 1.0), 1e-3, 16), glass(1.5));
    description.cameras.push(look_at(DVec3::new(2.0, 1.0, 3.8), DVec3::new(2.0, 0.8, 0.0), 50.0));
    let scene = build(description);
    let camera: Camera = scene.camera(&square(8)).expect("a camera");
    let initial_media = InitialMedia::of(&scene, &camera);
    for all in [true, false] {
        let guide = Guide::new(&scene.lights, all).expect("there is something to guide to");
        const STARTS: u32 = 1_000_000;
        let pass = LightPaths::new(5, 1, Domain::Light, STARTS, 8).guided(Some(&guide));
        let (mut sum, mut squares) = (0.0, 0.0);
        for emitted in (0..STARTS).filter_map(|index| pass.emit(&scene, &initial_media, index)) {
            assert!(emitted.ratio > 0.0 && emitted.weight > 0.0 && (0.0..=1.0 + 1e-5).contains(&emitted.unaimed));
            sum += f64::from(emitted.ratio);
            squares += f64::from(emitted.ratio).powi(2);
        }
        let n = f64::from(STARTS);
        let mean = sum / n;
        let error = ((squares / n - mean * mean) / n).sqrt();
        println!("all light {all}: {} cells, mean {mean:.6} +- {error:.6}", guide.cells());
        let passes = |expected: f64| (mean - expected).abs() < 4.0 * error + 1e-4;
        assert!(passes(1.0) && !passes(0.5) && !passes(1.01), "{mean} +- {error}");
    }
}
