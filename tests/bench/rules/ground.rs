//! Common code of all figures: a scene, its pictures, references, and errors.

use caustique::camera::Camera;
use caustique::estimator::InitialBandwidth;
use caustique::film::{Layer, LayerSet};
use caustique::image::exr;
use caustique::image::tonemap::{Look, ToneMap};
use caustique::math::DVec3;
use caustique::render::{Levels, Method, RenderInput, Session, Settings};
use caustique::scene::gltf::{ReadOptions, read};
use caustique::scene::{CameraRequest, Scene};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Light paths per iteration, and neighbours, of a reference by photons. Where only photons find light, its bias is a
/// third of that of the paper's setting after 1,000 iterations.
const REFERENCE: (u32, usize) = (1 << 18, 8);
/// Scenes that bidirectional path tracing, which has no bias, renders quickly.
const CONNECTED: [&str; 2] = ["blocks", "interior"];
/// Scenes where bidirectional path tracing has fireflies. Vertex connection and merging, whose bias is far below that
/// of any rule, renders them.
const MERGED: [&str; 1] = ["cornell"];

/// The methods that the paper compares.
pub const METHODS: [Method; 3] = [Method::Sppm, Method::Appm, Method::Cppm];

/// A scene from scenes/ and the width of its picture.
pub struct Ground {
    pub name: String,
    pub scene: Scene,
    pub camera: Camera,
}

impl Ground {
    pub fn new(name: &str, width: u32) -> Ground {
        let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("scenes/{name}.glb"));
        let description = read(&path, &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let scene = Scene::build(description, 0).unwrap_or_else(|e| panic!("{e}"));
        let view = CameraRequest { width: Some(width), ..CameraRequest::default() };
        let camera = scene.camera(&view).unwrap_or_else(|e| panic!("{e}"));
        Ground { name: name.into(), scene, camera }
    }

    pub fn size(&self) -> (usize, usize) {
        let (width, height) = self.camera.size();
        (width as usize, height as usize)
    }

    pub fn stage(&self, settings: &Settings) -> RenderInput<'_> {
        RenderInput::new(&self.scene, &self.camera, settings)
    }

    /// Renders some iterations.
    pub fn render(&self, settings: &Settings, iterations: u64) -> Shot {
        let stage = self.stage(settings);
        let mut session = Session::new(&stage);
        for _ in 0..iterations {
            session.step();
        }
        Shot::of(&session)
    }

    /// Renders two independent halves of a reference in `seconds` core-seconds: by bidirectional path tracing or VCM if
    /// they converge in this scene, else by SPPM with more light paths and smaller bandwidths. Kept in out/rules.
    pub fn reference(&self, seconds: f64) -> Reference {
        let method = match self.name.as_str() {
            name if CONNECTED.contains(&name) => Method::Bdpt,
            name if MERGED.contains(&name) => Method::Vcm,
            _ => Method::Sppm,
        };
        let (width, height) = self.size();
        let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("out/rules");
        std::fs::create_dir_all(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
        let path = folder.join(format!("{}-{width}x{height}-{}-{seconds}s.exr", self.name, method.name()));
        let names = ["AllA", "PhotonsA", "AllB", "PhotonsB"];
        if path.exists() {
            let (set, attributes) = exr::read(&path).unwrap_or_else(|e| panic!("{e}"));
            let layer = |name: &str| {
                let layer = set.get(name).unwrap_or_else(|| panic!("{}: no layer {name}", path.display()));
                layer.triples().iter().map(|v| DVec3::from(v.map(f64::from))).collect()
            };
            let [a, ap, b, bp] = names.map(layer);
            let iterations = attributes.object().and_then(|o| o["iterations"].as_u64()).unwrap_or(0);
            let halves = [Shot { all: a, photons: ap }, Shot { all: b, photons: bp }];
            return Reference { halves, iterations };
        }
        let (photons, neighbours) = REFERENCE;
        let initial = match method {
            Method::Vcm => InitialBandwidth::Footprint,
            _ => InitialBandwidth::Nearest(neighbours),
        };
        // The default alpha of a method that merges.
        let alpha = method.default_alpha();
        let settings = |seed| Settings { initial_bandwidth: initial, alpha, ..settings(method, photons, seed) };
        let stages = [1_000_001, 1_000_002].map(|seed| self.stage(&settings(seed)));
        let [mut a, mut b] = [0, 1].map(|half| Session::new(&stages[half]));
        while a.spent().cpu_seconds + b.spent().cpu_seconds < seconds {
            a.step();
            b.step();
        }
        let halves = [Shot::of(&a), Shot::of(&b)];
        let mut set = LayerSet::new(width, height);
        let pictures = halves.iter().flat_map(|half| [&half.all, &half.photons]);
        for (name, picture) in names.iter().zip(pictures) {
            let layer = Layer::interleaved(*name, "RGB", picture.iter().map(|v| v.as_vec3().to_array()));
            set.push(layer).unwrap_or_else(|e| panic!("{e}"));
        }
        let header = json!({"iterations": a.iterations(), "method": method.name()});
        exr::Attributes::of(&header)
            .and_then(|header| exr::write(&path, &set, &header, exr::Options::default()))
            .unwrap_or_else(|e| panic!("{e}"));
        Reference { halves, iterations: a.iterations() }
    }
}

/// The paper's setting: one level, and bandwidths from ten neighbours.
pub fn settings(method: Method, photons: u32, seed: u64) -> Settings {
    Settings {
        method,
        photons,
        seed,
        levels: Levels::new(1),
        initial_bandwidth: InitialBandwidth::Nearest(10),
        iterations: None,
        ..Settings::default()
    }
}

/// A picture, and its part without direct light and visible lights.
pub struct Shot {
    pub all: Vec<DVec3>,
    pub photons: Vec<DVec3>,
}

impl Shot {
    pub fn of(session: &Session<'_>) -> Shot {
        let pixels = session.pixels();
        let photons = pixels.iter().map(|pixel| {
            let count = f64::from(pixel.iterations.max(1));
            (pixel.parts().indirect + pixel.parts().caustic) / count
        });
        Shot { all: pixels.iter().map(|pixel| pixel.mean(0)).collect(), photons: photons.collect() }
    }
}

/// Two independent pictures of little bias. The mean product of the differences of a picture from both is the expected
/// squared error of the picture alone.
pub struct Reference {
    pub halves: [Shot; 2],
    /// Iterations of each half.
    pub iterations: u64,
}

/// Mean squared errors over pixels and channels.
#[derive(Clone, Copy, Debug, Default)]
pub struct Errors {
    /// Error of all light.
    pub all: f64,
    /// Error of the light of photons.
    pub photons: f64,
    /// Error of display values from 0 to 255, which clamp fireflies.
    pub display: f64,
}

impl Errors {
    pub fn object(&self) -> Value {
        json!({"all": self.all, "photons": self.photons, "display": self.display})
    }
}

impl Reference {
    /// Best estimate of a pixel's light of photons.
    pub fn photons(&self, pixel: usize) -> DVec3 {
        let [a, b] = &self.halves;
        0.5 * (a.photons[pixel] + b.photons[pixel])
    }

    /// Mean squared noise of a half, for all light and for the light of photons.
    pub fn noise(&self) -> [f64; 2] {
        let [a, b] = &self.halves;
        let half = |a: &[DVec3], b: &[DVec3]| {
            a.iter().zip(b).map(|(a, b)| a.distance_squared(*b)).sum::<f64>() / (6 * a.len()) as f64
        };
        [half(&a.all, &b.all), half(&a.photons, &b.photons)]
    }

    /// Squared bias of two pictures that differ only in their seed, for all light and for the light of photons.
    pub fn squared_bias(&self, x: &Shot, y: &Shot) -> [f64; 2] {
        let [a, b] = &self.halves;
        let all = product([&x.all, &y.all], [&a.all, &b.all]);
        [all, product([&x.photons, &y.photons], [&a.photons, &b.photons])]
    }

    /// Errors of a picture, without the error of the reference.
    pub fn errors(&self, shot: &Shot) -> Errors {
        let [a, b] = &self.halves;
        let values = (3 * shot.all.len()) as f64;
        let shown = |v: DVec3| 255.0 * Look::from(ToneMap::Srgb).display(v.as_vec3()).as_dvec3();
        let display = |x: DVec3, y: DVec3| (shown(x) - shown(y)).length_squared();
        let each = shot.all.iter().zip(&a.all).zip(&b.all);
        let sum: f64 = each.map(|((x, a), b)| display(*x, 0.5 * (*a + *b)) - 0.25 * display(*a, *b)).sum();
        Errors {
            all: product([&shot.all; 2], [&a.all, &b.all]),
            photons: product([&shot.photons; 2], [&a.photons, &b.photons]),
            display: sum / values,
        }
    }
}

/// Mean over pixels and channels of the product of the differences of two pictures from two references.
fn product([x, y]: [&[DVec3]; 2], [a, b]: [&[DVec3]; 2]) -> f64 {
    let sum: f64 = x.iter().zip(y).zip(a.iter().zip(b)).map(|((x, y), (a, b))| (*x - *a).dot(*y - *b)).sum();
    sum / (3 * x.len()) as f64
}

/// Iterations at which errors are measured: increasing by a fifth, and the last.
pub fn moments(last: u64) -> Vec<u64> {
    let mut all = vec![1];
    let mut at = 1.0_f64;
    while *all.last().unwrap_or(&last) < last {
        at *= 1.2;
        let next = (at.round() as u64).min(last);
        if all.last() != Some(&next) {
            all.push(next);
        }
    }
    all
}

/// Mean and its standard error.
pub fn mean(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n * (n - 1.0).max(1.0))).sqrt())
}
