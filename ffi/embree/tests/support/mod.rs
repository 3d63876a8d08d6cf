//! Meshes, rays and a brute-force ray tracer for the tests of the binding.

use std::sync::OnceLock;

use caustique_embree::{Device, Folders, GeometryId, Library, Ray, Scene, SceneBuilder};

/// The library under test, loaded once.
pub fn library() -> &'static Library {
    static LIBRARY: OnceLock<Library> = OnceLock::new();
    LIBRARY.get_or_init(|| {
        Library::load(&Folders::default()).unwrap_or_else(|error| panic!("{error}\nhint: {:?}", error.hint()))
    })
}

pub fn device(threads: usize) -> Device {
    Device::new(library(), threads).unwrap()
}

/// A builder on a device that all tests share, so that scenes can instance each other.
pub fn builder() -> SceneBuilder {
    static DEVICE: OnceLock<Device> = OnceLock::new();
    SceneBuilder::new(DEVICE.get_or_init(|| device(0))).unwrap()
}

pub fn ray(origin: [f32; 3], direction: [f32; 3]) -> Ray {
    Ray { origin, direction, tmin: 0.0, tmax: f32::INFINITY, token: 0 }
}

/// The random number generator SplitMix64.
pub struct Random(pub u64);

impl Random {
    /// The next random number, uniform in [0, 1).
    pub fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 40) as f32 / (1 << 24) as f32
    }

    /// A random point, uniform in a box around the height field.
    pub fn point(&mut self) -> [f32; 3] {
        [self.unit(), self.unit(), self.unit() - 0.5]
    }

    /// A random direction that is not of unit length.
    pub fn direction(&mut self) -> [f32; 3] {
        [self.unit() - 0.5, self.unit() - 0.5, self.unit() - 0.5]
    }
}

/// Number of quads along a side of the mesh of a million triangles: 708 x 708 x 2 = 1,002,528.
pub const SIDE: usize = 708;

/// A height field over the unit square of `side` times `side` quads, each cut into two triangles.
pub fn grid(side: usize) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let height = |x: f32, y: f32| 0.1 * (17.0 * x).sin() * (23.0 * y).cos();
    let at = |k| k as f32 / side as f32;
    let positions = (0..=side).flat_map(|j| (0..=side).map(move |i| [at(i), at(j), height(at(i), at(j))])).collect();
    let row = side as u32 + 1;
    let quad = |i: u32, j: u32| {
        let corner = j * row + i;
        [[corner, corner + 1, corner + row], [corner + 1, corner + row + 1, corner + row]]
    };
    let indices = (0..side as u32).flat_map(|j| (0..side as u32).flat_map(move |i| quad(i, j))).collect();
    (positions, indices)
}

/// The scene of the [`grid`] of [`SIDE`], built once.
pub fn million() -> &'static Scene {
    static SCENE: OnceLock<Scene> = OnceLock::new();
    SCENE.get_or_init(|| {
        let (positions, indices) = grid(SIDE);
        let mut builder = builder();
        builder.triangles(GeometryId(0), &positions, &indices).unwrap();
        builder.commit().unwrap()
    })
}

/// A unit sphere of `rings` bands of `2 * rings` quads. Half of the triangles at the poles are degenerate.
pub fn sphere(rings: usize) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let around = 2 * rings;
    let mut positions = Vec::new();
    for j in 0..=rings {
        let theta = std::f32::consts::PI * j as f32 / rings as f32;
        for i in 0..around {
            let phi = std::f32::consts::TAU * i as f32 / around as f32;
            let sin = if j == rings { 0.0 } else { theta.sin() };
            positions.push([sin * phi.cos(), sin * phi.sin(), theta.cos()]);
        }
    }
    let mut indices = Vec::new();
    for j in 0..rings {
        for i in 0..around {
            let at = |j: usize, i: usize| (j * around + i % around) as u32;
            indices.push([at(j, i), at(j, i + 1), at(j + 1, i)]);
            indices.push([at(j, i + 1), at(j + 1, i + 1), at(j + 1, i)]);
        }
    }
    (positions, indices)
}

/// Linear interpolation from `a` (weight 0) to `b` (weight 1).
pub fn between(a: [f32; 3], b: [f32; 3], weight: f32) -> [f32; 3] {
    std::array::from_fn(|k| a[k] + weight * (b[k] - a[k]))
}

/// The nearest hit over all triangles in double precision, by Moeller and Trumbore's test: its distance, and all
/// triangles that are hit there within rounding errors. Independent of Embree.
pub fn brute_force(positions: &[[f32; 3]], indices: &[[u32; 3]], ray: &Ray) -> Option<(f64, Vec<u32>)> {
    let wide = |p: [f32; 3]| p.map(f64::from);
    let sub = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let (origin, direction) = (wide(ray.origin), wide(ray.direction));
    let mut hits = Vec::new();
    for (k, triangle) in indices.iter().enumerate() {
        let [p0, p1, p2] = triangle.map(|index| wide(positions[index as usize]));
        let (e1, e2, s) = (sub(p1, p0), sub(p2, p0), sub(origin, p0));
        let p = cross(direction, e2);
        let determinant = dot(e1, p);
        let q = cross(s, e1);
        let (u, v, t) = (dot(s, p) / determinant, dot(direction, q) / determinant, dot(e2, q) / determinant);
        let slack = -1e-4;
        if u >= slack && v >= slack && 1.0 - u - v >= slack && t >= 0.0 {
            hits.push((t, k as u32));
        }
    }
    let nearest = hits.iter().map(|&(t, _)| t).reduce(f64::min)?;
    let near = |t: f64| t - nearest < 1e-5 * (1.0 + nearest);
    Some((nearest, hits.iter().filter(|&&(t, _)| near(t)).map(|&(_, k)| k).collect()))
}

/// Asserts equality within a few units in the last place, because Embree divides by an approximate reciprocal.
#[track_caller]
pub fn assert_close(found: [f32; 3], expected: [f32; 3]) {
    let close = |k: usize| (found[k] - expected[k]).abs() <= 4.0 * f32::EPSILON * expected[k].abs();
    assert!((0..3).all(close), "{found:?}, not {expected:?}");
}
