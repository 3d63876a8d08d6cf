//! The network of the finish: agreement with the training code, tiles, threads, and output that is no picture.
//! `scripts/lab/train/finish_fixture.py` writes the network and the numbers.

use super::*;
use crate::combine::{Model, Runtime};
use crate::film::{Layer, Plane, Sample};
use crate::finish::bound::{LIMIT, limit};
use crate::finish::{DenoiserChoice, Finish};
use crate::random::{Domain, Purpose, Stream};

const NETWORK: &[u8] = include_bytes!("../testdata/finish.onnx");
/// Number that the network adds to its picture.
const OFFSET: f32 = 1e-30;
/// Layers of the fixture with their components, in order.
const LAYERS: [(&str, &str); 14] = [
    ("", "RGB"),
    ("Noisy", "RGB"),
    ("Variance1", "RGB"),
    ("Quarter1", "RGB"),
    ("Quarter2", "RGB"),
    ("Quarter3", "RGB"),
    ("Quarter4", "RGB"),
    ("albedo", "RGB"),
    ("Emission", "RGB"),
    ("Direct", "RGB"),
    ("Caustic", "RGB"),
    ("Whole", "RGB"),
    ("normal", "XYZ"),
    ("depth", "Z"),
];

/// The picture of the fixture, its input planes and the network's picture.
fn fixture() -> (LayerSet, Vec<f32>, Picture) {
    let bytes = include_bytes!("../testdata/finish.f32").chunks_exact(4);
    let mut numbers = bytes.map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let mut take = |count: usize| numbers.by_ref().take(count).collect::<Vec<f32>>();
    let [height, width, iterations] = take(3)[..] else { panic!("there is no header") };
    let mut set = LayerSet { iterations: Some(iterations as u64), ..LayerSet::new(width as usize, height as usize) };
    let (size, pixels) = (set.size(), set.pixels());
    let mut plane = |c: char| Plane { component: c.into(), sample: Sample::Float, values: take(pixels) };
    for (name, components) in LAYERS {
        set.push(Layer { name: name.into(), planes: components.chars().map(&mut plane).collect() }).unwrap();
    }
    set.layers[0].planes.push(plane('A'));
    let planes = take(FINISH_PLANES * pixels);
    let output = Picture::new(size, take(3 * pixels).chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect());
    assert!(take(1).is_empty());
    (set, planes, output)
}

/// A random picture with the layers of the fixture.
fn random(width: usize, height: usize) -> LayerSet {
    let mut set = LayerSet { iterations: Some(9), ..LayerSet::new(width, height) };
    let size = set.size();
    for (k, (name, components)) in LAYERS.into_iter().enumerate() {
        let draw = |i: usize| Stream::new(k as u64, 0, Domain::Test, i as u64).vertex(0).one(Purpose::Pixel);
        let scale = if name == "Variance1" { 0.01 } else { 1.0 };
        let plane = |(c, component): (usize, char)| {
            let values = (0..size.pixels()).map(|i| scale * (0.1 + draw(3 * i + c))).collect();
            Plane { component: component.into(), sample: Sample::Float, values }
        };
        let planes = components.chars().enumerate().map(plane).collect();
        set.push(Layer { name: name.into(), planes }).unwrap();
    }
    set
}

/// The network with other bytes, which stand in its file once.
fn edited(from: &[u8], to: &[u8]) -> Vec<u8> {
    let at: Vec<usize> = (0..NETWORK.len()).filter(|at| NETWORK[*at..].starts_with(from)).collect();
    assert_eq!((at.len(), to.len()), (1, from.len()));
    [&NETWORK[..at[0]], to, &NETWORK[at[0] + to.len()..]].concat()
}

/// The network, which adds a number to its picture.
fn offset(by: f32) -> Network {
    load(&edited(&OFFSET.to_le_bytes(), &by.to_le_bytes()))
}

fn load(bytes: &[u8]) -> Network {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.onnx");
    std::fs::write(&path, bytes).unwrap();
    let model = Model::from_file(&path).unwrap();
    Network::load(&model, &Runtime::find().unwrap(), rayon::current_num_threads()).unwrap()
}

/// The network's picture in tiles of about `pixels` pixels. The denoised picture is the layer `Whole` of the set, its
/// mean with the parts the beauty.
fn output(network: Network, set: &LayerSet, has_parts: bool, pixels: usize) -> Picture {
    let estimate = Estimate::of(set).unwrap();
    let planes = Planes::of(set, &estimate).unwrap();
    let (whole, mean) = (set.picture("Whole").unwrap(), has_parts.then(|| set.beauty().unwrap()));
    FinishNetwork::new(network).run_tiled(&planes, &estimate, &whole, mean.as_ref(), pixels).unwrap()
}

/// Largest difference of two pictures in any channel.
fn distance(a: &Picture, b: &Picture) -> f32 {
    let both = a.iter().flatten().zip(b.iter().flatten());
    // `max` would drop a NaN.
    both.map(|(a, b)| (a - b).abs()).fold(0.0, |most: f32, d| if most.is_nan() || d <= most { most } else { d })
}

/// The training data are half floats, with a relative rounding of 2^-11.
#[test]
fn planes_equal_those_of_the_training_code() {
    let (set, wanted, _) = fixture();
    let estimate = Estimate::of(&set).unwrap();
    let (planes, spread) = (Planes::of(&set, &estimate).unwrap(), bound::spread(&estimate));
    let (mean, whole) = (set.beauty().unwrap(), set.picture("Whole").unwrap());
    let different = |has_parts: bool| -> Vec<usize> {
        let input = Input {
            planes: &planes,
            estimate: &estimate,
            denoised: [&mean, &whole],
            noise: Noise::new(&estimate, &spread),
            scales: Normalisation::new(Some(&estimate.mean), &planes.depth),
            has_parts,
        };
        let found = input.fill(Rect { x0: 0, y0: 0, x1: set.width, y1: set.height });
        assert_eq!(found.len(), wanted.len());
        let close = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-3 * b.abs() + 1e-6);
        let pairs = found.chunks(set.pixels()).zip(wanted.chunks(set.pixels())).enumerate();
        pairs.filter(|(_, (a, b))| !close(a, b)).map(|(plane, _)| plane).collect()
    };
    assert_eq!(different(true), [0usize; 0]);
    // The fixture has the parts Emission, Direct and Caustic.
    assert_eq!(different(false), [17, 18, 20]);
}

#[test]
fn the_picture_equals_that_of_the_training_code() {
    let (set, _, wanted) = fixture();
    let [found, without] = [true, false].map(|has_parts| output(load(NETWORK), &set, has_parts, usize::MAX));
    let found = distance(&found, &wanted);
    assert!(found < 5e-3, "{found}");
    assert!(distance(&without, &wanted) > 0.05, "the test detects planes that are missing");
}

#[test]
fn tiles_leave_no_seams() {
    let set = random(61, 47);
    let seams = |bytes: &[u8]| {
        let whole = output(load(bytes), &set, true, usize::MAX);
        [20 * 20, 31 * 31].map(|pixels| distance(&output(load(bytes), &set, true, pixels), &whole))
    };
    assert!(seams(NETWORK).iter().all(|seam| *seam < 1e-5), "{:?}", seams(NETWORK));
    let without_halo = seams(&edited(b"caustique.halo\x12\x014", b"caustique.halo\x12\x010"));
    assert!(without_halo.iter().all(|seam| *seam > 1e-3), "the test detects seams: {without_halo:?}");
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let set = random(150, 90);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let picture = pool.install(|| output(load(NETWORK), &set, true, 64 * 64));
        picture.iter().map(|rgb| rgb.map(f32::to_bits)).collect::<Vec<_>>()
    };
    let one = run(1);
    for threads in [2, 3] {
        assert!(run(threads) == one, "{threads} threads");
    }
}

/// The finished picture of a set, by our own denoiser.
fn finished(set: &LayerSet, network: Option<Network>) -> Picture {
    let mut set = set.clone();
    let (mut finish, _) = Finish::open(DenoiserChoice::Own, network).unwrap();
    let account = finish.apply(&mut set, |_| false).unwrap();
    assert!(account.error.is_some() && account.combined.is_none());
    set.beauty().unwrap()
}

/// With one iteration there is no bound.
#[test]
fn output_that_is_no_picture_leaves_the_denoised_one() {
    for iterations in [9, 1] {
        let set = LayerSet { iterations: Some(iterations), ..random(40, 30) };
        let without = finished(&set, None);
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, 1e6, -10.0] {
            assert!(finished(&set, Some(offset(value))) == without, "{value} after {iterations} iterations");
        }
        assert!(finished(&set, Some(load(NETWORK))) != without);
    }
}

/// A network that adds light to every pixel moves none farther than its bound, or than the light that any pixel may
/// have missed, and certain pixels not at all.
#[test]
fn the_bound_holds() {
    let mut set = random(40, 30);
    let exact = |i: usize| i % 40 < 10;
    let variance = set.layers.iter_mut().find(|layer| layer.name == "Variance1").unwrap();
    variance.planes.iter_mut().for_each(|plane| {
        plane.values.iter_mut().enumerate().filter(|(i, _)| exact(*i)).for_each(|(_, value)| *value = 0.0);
    });
    let estimate = Estimate::of(&set).unwrap();
    let (spread, deviation) = (bound::spread(&estimate), &estimate.deviation);
    let square = |c: usize| deviation.iter().map(|error| error[c].powi(2)).sum::<f32>() / deviation.len() as f32;
    let missed = [0, 1, 2].map(|c| LIMIT * square(c).sqrt());
    let picture = finished(&set, Some(offset(0.3)));
    let noise = Noise::new(&estimate, &spread);
    assert!((0..40 * 30).any(|i| noise.is_certain(i)));
    let mut moved = 0.0f32;
    for (i, (out, mean)) in picture.iter().zip(estimate.mean.iter()).enumerate() {
        for c in 0..3 {
            let most = (limit(Some(9)) * spread[i][c]).max(missed[c]);
            let most = if noise.is_certain(i) { 0.0 } else { most * 1.0001 };
            let step = (out[c] - mean[c]).abs();
            assert!(step <= most, "pixel {i}: {step}, at most {most}");
            moved = moved.max(step);
        }
    }
    assert!(moved > 0.1 && distance(&picture, &finished(&set, None)) > 0.01, "{moved}");
}

#[test]
fn pictures_that_the_network_does_not_read_are_errors_that_say_so() {
    let message = |change: &dyn Fn(&mut LayerSet)| {
        let mut set = random(4, 3);
        change(&mut set);
        let (mut finish, _) = Finish::open(DenoiserChoice::Own, Some(load(NETWORK))).unwrap();
        let error = finish.apply(&mut set, |_| false).unwrap_err();
        assert_eq!(error.kind, ErrorKind::Image);
        format!("{error}; {}", error.hint.clone().unwrap_or_default())
    };
    let levels = |set: &mut LayerSet| {
        let second = Layer { name: "Variance2".into(), ..set.get("Variance1").unwrap().clone() };
        set.push(second).unwrap();
    };
    let levels = message(&levels);
    assert!(levels.starts_with("the image has 2 levels, the network takes 1; render with --levels 1"), "{levels}");
    let without = |name: &'static str| message(&move |set| set.layers.retain(|layer| layer.name != name));
    assert_eq!(without("depth"), "layer depth: the layer holds 0 pixels, the image 12; render with --layers all");
    assert_eq!(without("normal"), "layer normal: the layer holds 0 pixels, the image 12; render with --layers all");
    let cause = "the file does not say how many iterations it has, which the network of --model reads";
    assert_eq!(message(&|set| set.iterations = None), format!("{cause}; leave --model out"));
}
