//! The surface that a pixel shows, for layers that take one point of each pixel.

use super::camera_paths::CameraPaths;
use super::vertex::{Next, Scattered, Vertex, Visitor};
use super::walk;
use crate::bsdf::{LobeSet, Transport};
use crate::geometry::Surface;
use crate::math::Vec2;
use crate::random::{Domain, Streams};
use bumpalo::Bump;
use smallvec::SmallVec;

/// Largest number of paths per pixel that are followed through mirrors and clear glass. At normal incidence, fewer than
/// one pixel in a million of a pane shows the reflection.
const PATHS: usize = 32;
/// Largest number of segments of such a path.
const MAX_SEGMENTS: u32 = 64;

/// Follows a camera path through mirrors and clear glass to the first other surface, and passes media.
#[derive(Default)]
struct Finder {
    found: Option<Surface>,
    /// Whether the path has met a mirror or clear glass.
    scattered: bool,
}

impl<'a> Visitor<'a> for Finder {
    const SPLITS: bool = true;

    fn spared(&self) -> f32 {
        1e-6
    }

    fn surface(&mut self, vertex: &Vertex<'_, 'a>, _: Option<Scattered>) -> Next {
        if vertex.shading.bsdf.lobes() == LobeSet::DELTA {
            self.scattered = true;
            return Next::Continue(LobeSet::DELTA);
        }
        self.found = Some(*vertex.surface);
        Next::Stop
    }
}

/// The surface behind the centre of a pixel that is neither a perfect mirror nor clear glass; `None` if there is none.
/// Clear glass shows a reflection and a refraction: the result is on the object at which most of several paths end. It
/// depends on no seed. `arena` is reset.
pub fn visible_surface(camera_paths: &CameraPaths<'_>, arena: &mut Bump, pixel: (u32, u32)) -> Option<Surface> {
    let key = camera_paths.camera.pixel_key(pixel);
    let mut find = |path: u64| {
        arena.reset();
        let stream = Streams::new(0, path + 1, Domain::CameraIndependent).path(key);
        let start = camera_paths.start_at(pixel, Vec2::splat(0.5), stream);
        let mut finder = Finder::default();
        walk(camera_paths.scene, arena, &start, stream, Transport::Radiance, MAX_SEGMENTS, &mut finder);
        finder
    };
    let first = find(0);
    if !first.scattered {
        return first.found;
    }
    // The first surface of each object, and the number of paths that end at the object; `None` stands for no object.
    let mut objects: SmallVec<[(Option<Surface>, usize); 4]> = SmallVec::new();
    let mut most = 0;
    let mut end = first.found;
    for path in 1..=PATHS {
        let instance = |surface: &Option<Surface>| surface.map(|surface| surface.instance);
        let known = objects.iter().position(|(other, _)| instance(other) == instance(&end));
        let object = known.unwrap_or_else(|| {
            objects.push((end, 0));
            objects.len() - 1
        });
        objects[object].1 += 1;
        if objects[object].1 > objects[most].1 {
            most = object;
        }
        if path == PATHS || objects[most].1 > PATHS / 2 {
            break;
        }
        end = find(path as u64).found;
    }
    objects[most].0
}
