//! The surface that a pixel shows, for layers that take one point of each pixel.

use super::camera_paths::CameraPaths;
use super::vertex::{Next, Scattered, Vertex, Visitor};
use super::walk;
use crate::bsdf::{LobeSet, Transport};
use crate::geometry::Surface;
use crate::math::{Vec2, Vec3};
use crate::random::{Domain, Streams};
use bumpalo::Bump;
use smallvec::SmallVec;

/// Largest number of paths per pixel that are followed through mirrors and clear glass. At normal incidence, fewer than
/// one pixel in a million of a pane shows the reflection.
const PATHS: usize = 32;
/// Largest number of segments of such a path.
const MAX_SEGMENTS: u32 = 64;

/// The surface that a pixel shows, and how.
#[derive(Clone, Copy)]
pub struct Visible {
    /// A surface that is neither a perfect mirror nor clear glass.
    pub surface: Surface,
    /// How mirrors or clear glass show it; `None` if it is seen directly.
    pub through: Option<Through>,
}

/// A path of a pixel through mirrors and clear glass.
#[derive(Clone, Copy)]
pub struct Through {
    /// Number of the path ([`last_ray`]).
    pub path: u64,
    /// Where it meets the first of them.
    pub first: Vec3,
}

/// A point of a ray, and its unit direction.
#[derive(Clone, Copy)]
pub struct PointOnRay {
    /// The point.
    pub p: Vec3,
    /// The direction.
    pub direction: Vec3,
}

/// Follows a camera path through mirrors and clear glass to the first other surface, and passes media.
#[derive(Default)]
struct Finder {
    /// The surface, and the direction in which the path arrives there.
    found: Option<(Surface, Vec3)>,
    /// Where the path has met the first mirror or clear glass.
    first: Option<Vec3>,
}

impl<'a> Visitor<'a> for Finder {
    const SPLITS: bool = true;

    fn spared(&self) -> f32 {
        1e-6
    }

    fn surface(&mut self, vertex: &Vertex<'_, 'a>, _: Option<Scattered>) -> Next {
        if vertex.shading.bsdf.lobes() == LobeSet::DELTA {
            self.first.get_or_insert(vertex.surface.p);
            return Next::Continue(LobeSet::DELTA);
        }
        self.found = Some((*vertex.surface, -vertex.wo));
        Next::Stop
    }
}

/// Follows the path with the number `path` of the pixel with the key `key` from the point `film` of the whole picture.
fn follow(camera_paths: &CameraPaths<'_>, arena: &mut Bump, key: u64, path: u64, film: Vec2) -> Finder {
    arena.reset();
    let stream = Streams::new(0, path + 1, Domain::CameraIndependent).path(key);
    let start = camera_paths.start_from(film, stream);
    let mut finder = Finder::default();
    walk(camera_paths.scene, arena, &start, stream, Transport::Radiance, MAX_SEGMENTS, &mut finder);
    finder
}

/// The last ray of the path with the number `path` of a pixel with the key `key` ([`Through::path`]) if the path starts at
/// the point `film` of the whole picture, maybe of another camera; `None` if it leaves the scene, or meets no mirror and no
/// clear glass. The path decides between reflection and refraction as the pixel's own. `arena` is reset.
pub fn last_ray(
    camera_paths: &CameraPaths<'_>,
    arena: &mut Bump,
    key: u64,
    path: u64,
    film: Vec2,
) -> Option<PointOnRay> {
    let Finder { found, first } = follow(camera_paths, arena, key, path, film);
    let (surface, direction) = found.filter(|_| first.is_some())?;
    Some(PointOnRay { p: surface.p, direction })
}

/// The surface behind the centre of a pixel that is neither a perfect mirror nor clear glass; `None` if there is none.
/// Clear glass shows a reflection and a refraction: the result is on the object at which most of several paths end. It
/// depends on no seed. `arena` is reset.
pub fn visible_surface(camera_paths: &CameraPaths<'_>, arena: &mut Bump, pixel: (u32, u32)) -> Option<Visible> {
    let key = camera_paths.camera.pixel_key(pixel);
    let centre = camera_paths.camera.film_point(pixel, Vec2::splat(0.5));
    let mut find = |path: u64| follow(camera_paths, arena, key, path, centre);
    let visible = |Finder { found, first }: Finder, path: u64| {
        found.map(|(surface, _)| Visible { surface, through: first.map(|first| Through { path, first }) })
    };
    let first = find(0);
    if first.first.is_none() {
        return visible(first, 0);
    }
    // What is seen of each object, and the number of paths that end at the object; `None` stands for no object.
    let mut objects: SmallVec<[(Option<Visible>, usize); 4]> = SmallVec::new();
    let mut most = 0;
    let mut end = visible(first, 0);
    for path in 1..=PATHS as u64 {
        let instance = |visible: &Option<Visible>| visible.map(|visible| visible.surface.instance);
        let known = objects.iter().position(|(other, _)| instance(other) == instance(&end));
        let object = known.unwrap_or_else(|| {
            objects.push((end, 0));
            objects.len() - 1
        });
        objects[object].1 += 1;
        if objects[object].1 > objects[most].1 {
            most = object;
        }
        if path == PATHS as u64 || objects[most].1 > PATHS / 2 {
            break;
        }
        end = visible(find(path), path);
    }
    objects[most].0
}
