//! Speed of rays, photon maps and EXR files relative to their lower bounds, as ratios in one run.
//!
//! `cargo bench --bench spine -- [SCENE.glb]`. The last line is JSON for `scripts/lab`.

#![allow(clippy::disallowed_methods, reason = "benchmarks are what clocks are for")]

use caustique::film::{Layer, LayerSet};
use caustique::image::exr;
use caustique::math::{Rgb, Vec2, Vec3, warp};
use caustique::photon::{Photon, PhotonFlags, PhotonMap, PhotonTag, ThinningKey};
use caustique::random::{Domain, Purpose, Stream};
use caustique::scene::gltf::{ReadOptions, read};
use caustique::scene::{CameraRequest, Scene};

use caustique::trace::Ray;
use caustique_embree as embree;
use std::time::Instant;

/// Seconds of `a` and of `b`, the fastest of five interleaved runs.
fn race(mut a: impl FnMut(), mut b: impl FnMut()) -> (f64, f64) {
    let mut best = (f64::INFINITY, f64::INFINITY);
    for _ in 0..5 {
        let t = Instant::now();
        a();
        best.0 = best.0.min(t.elapsed().as_secs_f64());
        let t = Instant::now();
        b();
        best.1 = best.1.min(t.elapsed().as_secs_f64());
    }
    best
}

/// Rays of camera paths: from the camera, and in random directions from their hits.
fn rays(scene: &Scene) -> Vec<Ray> {
    let view = CameraRequest { width: Some(640), ..CameraRequest::default() };
    let camera = scene.camera(&view).unwrap_or_else(|e| panic!("{e}"));
    let (width, height) = camera.size();
    let mut rays = Vec::new();
    for i in 0..u64::from(width * height) {
        let draws = Stream::new(1, 0, Domain::Test, i).vertex(0);
        let pixel = Vec2::new((i % u64::from(width)) as f32, (i / u64::from(width)) as f32);
        let start = camera.ray(pixel + draws.two(Purpose::Pixel), Vec2::ZERO);
        let ray = Ray { origin: start.origin, direction: start.direction, tmax: f32::INFINITY, token: 0 };
        rays.push(ray);
        if let Some(hit) = scene.tracer.intersect(&ray)
            && let Some(surface) = scene.shapes.surface(hit.instance, hit.primitive, hit.barycentric)
        {
            let direction = warp::sphere_uniform(draws.two(Purpose::Direction));
            rays.push(Ray { origin: surface.ray_origin(direction), direction, tmax: f32::INFINITY, token: 0 });
        }
    }
    rays
}

/// The triangles of the scene in Embree, without other code around it.
fn raw(scene: &Scene) -> Result<embree::Scene, embree::Error> {
    let device = embree::Device::new(&caustique::trace::library()?, 1)?;
    let mut root = embree::SceneBuilder::new(&device)?;
    let mut children: Vec<Option<embree::Scene>> = vec![None; scene.shapes.meshes.len()];
    for (i, instance) in scene.shapes.instances.iter().enumerate() {
        let mesh = &scene.shapes.meshes[instance.mesh as usize];
        let positions: Vec<[f32; 3]> = mesh.positions.iter().map(Vec3::to_array).collect();
        let Some(placement) = &instance.to_world else {
            root.triangles(embree::GeometryId(i as u32), &positions, &mesh.triangles)?;
            continue;
        };
        let child = match children[instance.mesh as usize].clone() {
            Some(child) => child,
            None => {
                let mut builder = embree::SceneBuilder::new(&device)?;
                builder.triangles(embree::GeometryId(0), &positions, &mesh.triangles)?;
                children[instance.mesh as usize].insert(builder.commit()?).clone()
            }
        };
        let m = placement.points;
        let columns = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis, m.translation];
        root.instance(embree::GeometryId(i as u32), &child, &std::array::from_fn(|k| columns[k / 3][k % 3]))?;
    }
    root.commit()
}

fn main() {
    let path = std::env::args().skip(1).find(|a| !a.starts_with("--")).unwrap_or_else(|| "scenes/interior.glb".into());
    let description = read(path.as_ref(), &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    let scene = Scene::build(description, 1).unwrap_or_else(|e| panic!("{e}"));
    let raw = raw(&scene).unwrap_or_else(|e| panic!("{e}"));
    let rays = rays(&scene);
    let plain: Vec<embree::Ray> = rays
        .iter()
        .map(|r| embree::Ray {
            origin: r.origin.to_array(),
            direction: r.direction.to_array(),
            tmin: 0.0,
            tmax: f32::INFINITY,
            token: 0,
        })
        .collect();
    let (mut found, mut bare_found) = (0u64, 0u64);
    let (ours, bare) = race(
        || {
            for ray in &rays {
                let hit = scene.tracer.intersect(ray);
                found +=
                    u64::from(hit.and_then(|h| scene.shapes.surface(h.instance, h.primitive, h.barycentric)).is_some());
            }
        },
        || {
            for ray in &plain {
                bare_found += u64::from(raw.intersect(ray).is_some());
            }
        },
    );
    let mrays = |seconds: f64| rays.len() as f64 / seconds * 1e-6;
    println!("{path}: {} rays of eye paths, one thread", rays.len());
    println!(
        "rays with their surfaces {:.2} M/s, bare Embree {:.2} M/s: {:.0} %",
        mrays(ours),
        mrays(bare),
        100.0 * bare / ours
    );

    let photons: Vec<Photon> = (0..200_000)
        .map(|i| {
            let u = Stream::new(2, 0, Domain::Test, i).vertex(0);
            let (a, b) = (u.two(Purpose::Pixel), u.one(Purpose::Lobe));
            let flags = PhotonFlags::default();
            Photon {
                p: Vec3::new(a.x, b * 0.01, a.y),
                wi: Vec3::Y,
                ng: Vec3::Y,
                flux: Rgb::ONE,
                flags,
                depth: 2,
                tag: PhotonTag::default(),
                thinning_key: ThinningKey::default(),
            }
        })
        .collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap_or_else(|e| panic!("{e}"));
    let (build, copy) = pool.install(|| {
        race(
            || drop(std::hint::black_box(PhotonMap::build(photons.clone()))),
            || drop(std::hint::black_box(photons.clone())),
        )
    });
    println!(
        "photon map of {} photons: {:.1} ms, {:.1} times a copy of the photons",
        photons.len(),
        build * 1e3,
        build / copy
    );

    let mut set = LayerSet::new(1280, 720);
    for k in 0..10 {
        let noise = |i: u64| {
            let u = Stream::new(k, 0, Domain::Test, i).vertex(0);
            let v = u.two(Purpose::Pixel);
            [v.x, v.y, u.one(Purpose::Lobe)]
        };
        let layer = Layer::interleaved(format!("L{k}"), "RGB", (0..1280 * 720).map(noise));
        set.push(layer).unwrap_or_else(|e| panic!("{e}"));
    }
    let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"));
    let file = folder.path().join("layers.exr");
    let write = |compression| {
        let options = exr::Options { compression, ..exr::Options::default() };
        exr::write(&file, &set, &exr::Attributes::default(), options).unwrap_or_else(|e| panic!("{e}"));
    };
    let (zip, none) = race(|| write(exr::Compression::Zip), || write(exr::Compression::None));
    println!("EXR of 30 float channels at 1280 x 720, noise: ZIP {zip:.2} s, {:.1} times no compression", zip / none);
    println!(
        "{{\"rays_percent_of_embree\": {:.1}, \"rays_m_per_s\": {:.2}, \"embree_m_per_s\": {:.2}, \"map_ms\": {:.2}, \"exr_zip_s\": {zip:.3}}}",
        100.0 * bare / ours,
        mrays(ours),
        mrays(bare),
        build * 1e3
    );
    assert!(found.abs_diff(bare_found) < bare_found / 1000, "the two disagree about hits: {found} {bare_found}");
}
