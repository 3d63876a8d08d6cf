//! Mean numbers of vertices of paths. The cost model of methods uses them instead of a clock.

use super::LightPaths;
use crate::bsdf::{LobeSet, Transport};
use crate::light::Guide;
use crate::math::Vec3;
use crate::photon::{Located, PhotonMap, same_surface};
use crate::random::{Domain, Stream};
use crate::scene::Scene;
use crate::transport::walk::camera_paths::CameraPaths;
use crate::transport::walk::initial_media::InitialMedia;
use crate::transport::walk::vertex::{MediumVertex, Next, Scattered, Vertex, Visitor};
use crate::transport::walk::{PathStart, walk};
use bumpalo::Bump;
use rayon::prelude::*;

/// Number of paths of each kind (camera and light) that are traced to count vertices.
const PATHS: u32 = 4096;
/// Number of paths that a thread traces as one unit of work.
const CHUNK: usize = 16;
/// Number of batches of paths. Each has paths of the whole picture.
const BATCHES: u32 = 64;
/// Number of vertices after which no further batch is traced. Closed white rooms have thousands of vertices per path.
const MAX_VERTICES: u64 = 1 << 18;
/// Number of camera vertices whose merges are counted if there are more than [`MAX_VERTICES`].
const MERGING_VERTICES: u64 = 1 << 10;

/// Mean numbers of vertices of a path in a scene, from which the costs of methods are estimated. "Full" paths continue
/// by all lobes and collide in media; "short" paths end at broad lobes and cross media straight.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VertexCounts {
    /// Mean number of surface vertices of a full camera path.
    pub camera: f64,
    /// Mean number of surface vertices of a camera path that ends at broad lobes.
    pub camera_to_broad: f64,
    /// Mean number of surface vertices of a full light path.
    pub light: f64,
    /// Mean number of surface vertices of a light path that ends at broad lobes.
    pub light_to_broad: f64,
    /// Mean number of surface vertices of a full camera path that have lobes other than delta: they sample lights,
    /// gather photons and are connected.
    pub camera_connectable: f64,
    /// Mean number of surface vertices of a full light path that have lobes other than delta.
    pub light_connectable: f64,
    /// Mean number of vertices of a full camera path in scattering media.
    pub camera_media: f64,
    /// Mean number of vertices of a full light path in scattering media.
    pub light_media: f64,
    /// Mean number of points in scattering media that a camera path samples which ends at broad lobes and crosses media
    /// straight.
    pub media_samples: f64,
    /// Fraction of surface vertices whose material has textures, 0 to 1.
    pub textured: f64,
    /// Mean number of light vertices that a full camera path merges with, if there is one light path per pixel.
    pub merged: f64,
}

/// Position in space, and geometric normal, of a vertex that photons can merge with: it has lobes that are not delta.
#[derive(Clone, Copy)]
struct Open {
    p: Vec3,
    ng: Vec3,
}

impl Located for Open {
    fn position(&self) -> Vec3 {
        self.p
    }

    fn normal(&self) -> Vec3 {
        self.ng
    }

    fn is_finite(&self) -> bool {
        self.p.is_finite()
    }
}

/// Visitor that counts vertices, and lists those that are not perfect mirrors or clear glass. `THROUGH`: crosses media
/// straight.
struct Count<'a, const THROUGH: bool> {
    scene: &'a Scene,
    all: u32,
    to_broad: u32,
    media: u32,
    media_to_broad: u32,
    textured: u32,
    open: Vec<Open>,
    narrow: bool,
    /// Number of smooth interfaces at which the path may be split.
    splits: u32,
    /// Length of the path up to the first vertex that is not a perfect mirror or clear glass.
    length: f32,
}

impl<const THROUGH: bool> Count<'_, THROUGH> {
    fn new(scene: &Scene, splits: u32) -> Count<'_, THROUGH> {
        Count {
            scene,
            all: 0,
            to_broad: 0,
            media: 0,
            media_to_broad: 0,
            textured: 0,
            open: Vec::new(),
            narrow: true,
            splits,
            length: 0.0,
        }
    }

    /// Numbers of all surface vertices, of those up to the first broad lobe, of listed ones, of vertices in media, of
    /// those up to the first broad lobe, and of textured ones.
    fn counts(&self) -> [f64; 6] {
        [self.all, self.to_broad, self.open.len() as u32, self.media, self.media_to_broad, self.textured].map(f64::from)
    }

    /// Number of vertices on surfaces and in media.
    fn vertices(&self) -> u64 {
        u64::from(self.all) + u64::from(self.media)
    }

    fn is_textured(&self, material: u32) -> bool {
        self.scene.materials.list[material as usize].textures().next().is_some()
    }

    fn passed(&mut self) {
        self.media += 1;
        self.media_to_broad += u32::from(self.narrow);
    }
}

impl<'a, const THROUGH: bool> Visitor<'a> for Count<'_, THROUGH> {
    const BRANCHES: bool = true;
    const SPLITS: bool = THROUGH;

    fn splits(&self) -> u32 {
        self.splits
    }

    fn branch(&mut self, follow: impl FnOnce(&mut Self)) {
        let narrow = self.narrow;
        follow(self);
        self.narrow = narrow;
    }

    fn medium(&mut self, _: &MediumVertex, _: Option<Scattered>) -> Next {
        self.passed();
        self.narrow &= THROUGH;
        Next::Continue(LobeSet::ALL)
    }

    fn medium_next_event(&mut self, _: &MediumVertex, _: Option<Scattered>) {
        self.passed();
    }

    fn surface(&mut self, vertex: &Vertex<'_, 'a>, scattered: Option<Scattered>) -> Next {
        self.narrow &= scattered.is_none_or(|s| !s.lobe.intersects(LobeSet::BROAD));
        self.all += 1;
        self.to_broad += u32::from(self.narrow);
        self.textured += u32::from(self.is_textured(vertex.surface.material));
        if self.open.is_empty() {
            self.length += vertex.distance;
        }
        if vertex.shading.bsdf.lobes() != LobeSet::DELTA {
            self.open.push(Open { p: vertex.surface.p, ng: vertex.surface.ng });
        }
        Next::Continue(LobeSet::ALL)
    }
}

impl VertexCounts {
    /// Counts the vertices of paths of a view. `guide` guides the light paths. `reach(length)` is the merging bandwidth of
    /// a camera path of that length at its first merging vertex.
    pub fn new(
        camera_paths: &CameraPaths<'_>,
        initial_media: &InitialMedia,
        seed: u64,
        guide: Option<&Guide>,
        reach: impl Fn(f32) -> f32 + Sync,
    ) -> VertexCounts {
        let (width, height) = camera_paths.camera.size();
        let pixels = u64::from(width) * u64::from(height);
        let lights = LightPaths::new(seed, 0, Domain::GuideLight, PATHS, camera_paths.max_depth).guided(guide);
        let from_light = |index: u32| {
            let emitted = lights.emit(camera_paths.scene, initial_media, index);
            let start = emitted.map(|emitted| (emitted.start, emitted.stream));
            count_path::<false>(camera_paths, start, Transport::Importance)
        };
        let start = |index: u32| {
            let pixel = u64::from(index) * pixels / u64::from(PATHS);
            let at = ((pixel % u64::from(width)) as u32, (pixel / u64::from(width)) as u32);
            let stream = Stream::new(seed, u64::MAX, Domain::GuideCamera, u64::from(index));
            Some((camera_paths.start(at, stream), stream))
        };
        let from_camera = |index: u32| count_path::<false>(camera_paths, start(index), Transport::Radiance);
        let through = |index: u32| count_path::<true>(camera_paths, start(index), Transport::Radiance).counts();
        let light = in_batches(from_light, Count::vertices);
        let vertices = |counts: &[f64; 6]| (counts[0] + counts[3]) as u64;
        let through = if camera_paths.scene.survey.scattering { in_batches(through, vertices) } else { Vec::new() };
        let camera = in_batches(from_camera, Count::vertices);
        let map = PhotonMap::build(light.iter().flat_map(|count| &count.open).copied().collect());
        // Fewer paths than pixels: the same number of vertices is expected in a proportionally larger area.
        let larger = pixels as f32 / light.len() as f32;
        let open = camera.iter().map(|count| count.open.len() as u64).sum::<u64>();
        let step = if open > MAX_VERTICES { (open / MERGING_VERTICES) as usize } else { 1 };
        let merged = |count: &Count<'_, false>| {
            let (mut merged, bandwidth2) = (0u64, reach(count.length).powi(2) * larger);
            for open in count.open.iter().step_by(step) {
                map.within(open.p, bandwidth2, |other, _| merged += u64::from(same_surface(other, open.ng)));
            }
            merged
        };
        let merged: Vec<u64> = camera.par_iter().with_min_len(CHUNK).map(merged).collect();
        let merged = step as f64 * merged.iter().sum::<u64>() as f64 / camera.len() as f64;
        let [full, light] = [&camera, &light].map(|counts| mean(counts.iter().map(Count::counts)));
        let short = if through.is_empty() { full } else { mean(through.into_iter()) };
        VertexCounts::from_means(full, short, light, merged)
    }

    /// Combines the means of [`Count::counts`] over full camera paths, short camera paths and full light paths.
    fn from_means(full: [f64; 6], short: [f64; 6], light: [f64; 6], merged: f64) -> VertexCounts {
        let [camera, _, camera_connectable, camera_media, _, camera_textured] = full;
        let [light, light_to_broad, light_connectable, light_media, _, light_textured] = light;
        let [_, camera_to_broad, _, _, media_samples, _] = short;
        VertexCounts {
            camera,
            camera_to_broad,
            light,
            light_to_broad,
            camera_connectable,
            light_connectable,
            camera_media,
            light_media,
            media_samples,
            textured: (camera_textured + light_textured) / (camera + light).max(1.0),
            merged,
        }
    }
}

/// Traces [`PATHS`] paths by `path`, or as many batches of them as have [`MAX_VERTICES`] `vertices`.
fn in_batches<T: Send>(path: impl Fn(u32) -> T + Sync, vertices: impl Fn(&T) -> u64) -> Vec<T> {
    let (mut all, mut counted) = (Vec::with_capacity(PATHS as usize), 0);
    for batch in 0..BATCHES {
        let indices = (0..PATHS / BATCHES).into_par_iter().with_min_len(CHUNK);
        let traced: Vec<T> = indices.map(|index| path(BATCHES * index + batch)).collect();
        counted += traced.iter().map(&vertices).sum::<u64>();
        all.extend(traced);
        if counted >= MAX_VERTICES {
            break;
        }
    }
    all
}

/// Mean counts of paths. Counts are integers, so sums do not depend on their order.
fn mean(counts: impl ExactSizeIterator<Item = [f64; 6]>) -> [f64; 6] {
    let paths = counts.len() as f64;
    let sum = counts.fold([0.0; 6], |sum, counts| std::array::from_fn(|k| sum[k] + counts[k]));
    sum.map(|sum| sum / paths)
}

/// Counts the vertices of one path; none without a start.
fn count_path<'a, const THROUGH: bool>(
    camera_paths: &CameraPaths<'a>,
    start: Option<(PathStart, Stream)>,
    transport: Transport,
) -> Count<'a, THROUGH> {
    let (scene, max_depth) = (camera_paths.scene, camera_paths.max_depth);
    let splits = if transport == Transport::Radiance { camera_paths.splits } else { 0 };
    let mut count = Count::<THROUGH>::new(scene, splits);
    if let Some((start, stream)) = start {
        walk(scene, &Bump::new(), &start, stream, transport, max_depth, &mut count);
    }
    count
}
