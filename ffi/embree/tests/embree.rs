//! Tests the binding with the Embree that `CAUSTIQUE_EMBREE` names, or that the system has.

mod support;

use std::sync::Arc;

use caustique_embree::{
    Candidate, Error, Folders, GeometryId, Hit, Library, MAX_GEOMETRY_ID, Ray, Scene, SceneBuilder,
};
use support::*;

const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 3.0, 0.0]];
const ID: GeometryId = GeometryId(4);

fn one_triangle() -> Scene {
    let mut builder = builder();
    builder.triangles(ID, &TRIANGLE, &[[0, 1, 2]]).unwrap();
    builder.commit().unwrap()
}

/// A ray straight down onto (x, y) from z = 5.
fn down(x: f32, y: f32) -> Ray {
    ray([x, y, 5.0], [0.0, 0.0, -1.0])
}

/// The nearest hit of each ray, all traced as one packet; `None` for a missing ray or without a hit.
fn together(scene: &Scene, rays: &[Option<Ray>; 8]) -> [Option<Hit>; 8] {
    let mut hits = [None; 8];
    scene.intersect8(|k| rays[k], |k, hit| hits[k] = Some(hit));
    hits
}

#[test]
fn the_library_reports_its_version_and_stays_within_the_structure() {
    let library = library();
    let version = library.version();
    assert!(version.major == 3 || version.major == 4, "{version}");
    assert!(library.path().to_string_lossy().contains("embree"), "{library:?}");
    // Embree has `instPrimID` since 4.3.
    let expected = if (version.major, version.minor) >= (4, 3) { 84 } else { 80 };
    assert_eq!(library.hit_extent(), expected, "{version}");
}

#[test]
fn empty_scene_has_no_hits_and_no_bounds() {
    let scene = builder().commit().unwrap();
    assert_eq!(scene.intersect(&down(0.5, 0.5)), None);
    assert!(!scene.occluded(&down(0.5, 0.5)));
    assert_eq!(scene.bounds(), None);
}

#[test]
fn mesh_without_triangles_is_allowed() {
    let mut builder = builder();
    builder.triangles(GeometryId(0), &[], &[]).unwrap();
    builder.triangles(GeometryId(1), &TRIANGLE, &[]).unwrap();
    builder.filter(GeometryId(1), Arc::new(|_| false)).unwrap();
    assert_eq!(builder.triangles(GeometryId(1), &TRIANGLE, &[]), Err(Error::DuplicateId(GeometryId(1))));
    let scene = builder.commit().unwrap();
    assert_eq!(scene.intersect(&down(0.5, 0.5)), None);
    assert_eq!(scene.bounds(), None);
}

#[test]
fn one_triangle_is_hit_with_its_coordinates_and_normal() {
    let scene = one_triangle();
    let hit = scene.intersect(&down(0.5, 1.5)).unwrap();
    assert_close([hit.t, hit.u, hit.v], [5.0, 0.25, 0.5]);
    assert_eq!((hit.primitive, hit.geometry, hit.instance), (0, ID, None));
    // cross(p1 - p0, p2 - p0), whose length is twice the area of the triangle, for hits from both sides.
    assert_eq!(hit.ng, [0.0, 0.0, 6.0]);
    let from_below = scene.intersect(&ray([0.5, 1.5, -5.0], [0.0, 0.0, 1.0])).unwrap();
    assert_eq!(from_below.ng, [0.0, 0.0, 6.0]);
    assert!(scene.occluded(&down(0.5, 1.5)));
    assert_eq!(scene.intersect(&down(1.5, 1.5)), None);
    assert!(!scene.occluded(&down(1.5, 1.5)));
    let bounds = scene.bounds().unwrap();
    assert_eq!((bounds.min, bounds.max), ([0.0; 3], [2.0, 3.0, 0.0]));
}

#[test]
fn hits_are_within_the_segment() {
    let scene = one_triangle();
    let segment = |tmin, tmax| Ray { tmin, tmax, ..down(0.5, 0.5) };
    for (tmin, tmax, expected) in [
        (0.0, 6.0, true),
        (0.0, f32::INFINITY, true),
        (-1.0, 6.0, true),
        (f32::NEG_INFINITY, 6.0, true),
        (0.0, 4.9, false),
        (5.1, 9.0, false),
        (6.0, 4.0, false),
        (0.0, -1.0, false),
        (0.0, f32::NEG_INFINITY, false),
        (0.0, f32::NAN, false),
    ] {
        let segment = segment(tmin, tmax);
        assert_eq!(scene.intersect(&segment).is_some(), expected, "{segment:?}");
        assert_eq!(scene.occluded(&segment), expected, "{segment:?}");
    }
    // A negative tmin does not reach behind the origin.
    let behind = Ray { tmin: -9.0, ..ray([0.5, 0.5, -1.0], [0.0, 0.0, -1.0]) };
    assert_eq!(scene.intersect(&behind), None);
    assert!(!scene.occluded(&behind));
}

#[test]
fn rays_with_extreme_numbers_do_not_crash() {
    let scene = million();
    let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -0.0, f32::MIN_POSITIVE / 4.0, f32::MAX, 0.3];
    for x in odd {
        for y in odd {
            for z in odd {
                for ray in
                    [ray([0.3, 0.2, 1.0], [x, y, z]), ray([x, y, z], [0.1, 0.2, -1.0]), ray([x, y, z], [z, x, y])]
                {
                    scene.intersect(&ray);
                    scene.occluded(&ray);
                }
            }
        }
    }
}

#[test]
fn a_million_triangles_agree_with_brute_force() {
    let (positions, indices) = grid(SIDE);
    assert!(indices.len() > 1_000_000);
    let scene = million();
    let mut random = Random(7);
    let mut hits = 0;
    for _ in 0..60 {
        let ray = ray(random.point(), random.direction());
        let expected = brute_force(&positions, &indices, &ray);
        let found = scene.intersect(&ray);
        assert_eq!(scene.occluded(&ray), found.is_some(), "{ray:?}");
        match (found, expected) {
            (None, None) => {}
            (Some(hit), Some((t, near))) => {
                hits += 1;
                assert!((f64::from(hit.t) - t).abs() < 1e-5 * (1.0 + t), "{hit:?}, {t}");
                // On an edge, both adjacent triangles are correct.
                assert!(near.contains(&hit.primitive), "{hit:?}, {near:?}");
                let corners = indices[hit.primitive as usize].map(|index| positions[index as usize]);
                let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
                let [a, b, c] = corners;
                for (k, (origin, direction)) in ray.origin.iter().zip(ray.direction).enumerate() {
                    let on_triangle = weights[0] * a[k] + weights[1] * b[k] + weights[2] * c[k];
                    assert!((on_triangle - (origin + hit.t * direction)).abs() < 1e-5, "{hit:?}");
                }
            }
            (found, expected) => panic!("{ray:?}: {found:?}, but by brute force {expected:?}"),
        }
    }
    assert!((10..50).contains(&hits), "{hits} of 60 rays hit: a poor test");
}

/// Packets find the same triangles as single rays, except for rays within rounding errors of an edge.
#[test]
fn packets_agree_with_single_rays() {
    let scene = million();
    let mut random = Random(9);
    let (mut hits, mut others) = (0, 0);
    for packet in 0..20_000 {
        let origin = random.point();
        let towards = random.direction();
        let rays: [Option<Ray>; 8] = std::array::from_fn(|k| {
            let spread = 0.05 * random.unit();
            let direction = [towards[0] + spread, towards[1] - spread, towards[2]];
            // Some rays are absent, and some must not be passed to Embree.
            match (packet + k) % 11 {
                0 => None,
                1 => Some(ray([f32::NAN, 0.0, 0.0], direction)),
                _ => Some(ray(origin, direction)),
            }
        });
        for (ray, together) in rays.iter().zip(together(scene, &rays)) {
            let alone = ray.as_ref().and_then(|ray| scene.intersect(ray));
            match (alone, together) {
                (None, None) => {}
                (Some(a), Some(b)) if (a.geometry, a.primitive) == (b.geometry, b.primitive) => {
                    hits += 1;
                    assert!((a.t - b.t).abs() <= 1e-4 * a.t + 1e-6, "{a:?} {b:?}");
                    assert!((a.u - b.u).abs() < 0.01 && (a.v - b.v).abs() < 0.01, "{a:?} {b:?}");
                }
                (Some(a), Some(b)) => {
                    others += 1;
                    assert!((a.t - b.t).abs() <= 1e-3 * a.t + 1e-4, "{a:?} {b:?}");
                }
                _ => others += 1,
            }
        }
    }
    assert!(hits > 20_000 && others * 1000 < hits, "{hits} alike, {others} not");
}

#[test]
fn packets_call_filters_and_hit_instances() {
    let scene = sheets(|candidate| candidate.token == 0);
    let rays: [Option<Ray>; 8] =
        std::array::from_fn(|k| Some(Ray { token: k as u32 % 2, ..down(0.1 + 0.02 * k as f32, 0.2) }));
    let hits = together(&scene, &rays);
    for (ray, hit) in rays.iter().zip(hits) {
        assert_eq!(hit, ray.as_ref().and_then(|ray| scene.intersect(ray)));
    }
    let mut root = builder();
    let shift = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 2.0, 0.0, 0.0];
    root.instance(GeometryId(4), &one_triangle(), &shift).unwrap();
    let root = root.commit().unwrap();
    let rays: [Option<Ray>; 8] = std::array::from_fn(|k| Some(down(2.1 + 0.02 * k as f32, 0.2)));
    for hit in together(&root, &rays) {
        assert_eq!(hit.and_then(|hit| hit.instance), Some(GeometryId(4)));
    }
}

#[test]
fn intersect_and_occluded_agree() {
    let scene = million();
    let mut random = Random(11);
    let mut hits = 0;
    for _ in 0..200_000 {
        let ray = ray(random.point(), random.direction());
        let hit = scene.intersect(&ray);
        assert_eq!(hit.is_some(), scene.occluded(&ray), "{ray:?}");
        if let Some(hit) = hit {
            hits += 1;
            assert!(!scene.occluded(&Ray { tmax: hit.t * 0.999, ..ray }), "{ray:?}");
            assert!(scene.occluded(&Ray { tmin: hit.t * 0.999, tmax: hit.t * 1.001, ..ray }), "{ray:?}");
        }
    }
    assert!((20_000..180_000).contains(&hits), "{hits}");
}

/// No ray from inside of a closed surface escapes through an edge. Of rays aimed exactly at corners, where six
/// triangles meet, at most 2 % escape (see `SceneBuilder`).
#[test]
fn rays_do_not_escape_through_edges() {
    let (positions, indices) = sphere(64);
    let mut builder = builder();
    builder.triangles(ID, &positions, &indices).unwrap();
    let scene = builder.commit().unwrap();
    let mut random = Random(3);
    let (mut corners, mut slipped) = (0, 0);
    for triangle in &indices {
        let [a, b, c] = triangle.map(|index| positions[index as usize]);
        let origin = random.direction().map(|x| x * 0.1);
        let hits = |target: [f32; 3]| {
            let ray = ray(origin, std::array::from_fn(|k| target[k] - origin[k]));
            assert_eq!(scene.intersect(&ray).is_some(), scene.occluded(&ray), "{ray:?}");
            scene.occluded(&ray)
        };
        for edge in [[a, b], [b, c], [c, a]] {
            for weight in [0.5, 0.25, 0.01, 0.99] {
                assert!(hits(between(edge[0], edge[1], weight)), "{origin:?} -> {edge:?} at {weight}");
            }
        }
        for corner in [a, b, c] {
            corners += 1;
            slipped += usize::from(!hits(corner));
        }
    }
    assert!(slipped * 100 < corners * 2, "{slipped} of {corners} rays aimed at corners slipped through");
}

#[test]
fn degenerate_triangles_are_never_hit() {
    let positions = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.25, 0.25, -1.0]];
    let mut builder = builder();
    builder.triangles(ID, &positions, &[[0, 0, 0], [0, 1, 2], [1, 1, 3], [4, 4, 4], [0, 1, 3]]).unwrap();
    let scene = builder.commit().unwrap();
    assert_eq!(scene.intersect(&down(0.25, 0.25)).unwrap().primitive, 4);
    let mut builder = support::builder();
    builder.triangles(ID, &positions, &[[0, 0, 0], [0, 1, 2], [1, 1, 3], [4, 4, 4]]).unwrap();
    let scene = builder.commit().unwrap();
    for target in positions {
        assert_eq!(scene.intersect(&down(target[0], target[1])), None, "{target:?}");
        assert!(!scene.occluded(&down(target[0], target[1])), "{target:?}");
    }
}

#[test]
fn bad_vertices_are_named() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e19] {
        for axis in 0..3 {
            let mut positions = TRIANGLE;
            positions[1][axis] = bad;
            let mut builder = builder();
            let error = builder.triangles(ID, &positions, &[[0, 1, 2]]).unwrap_err();
            assert!(matches!(error, Error::BadVertex { geometry: ID, vertex: 1, .. }), "{error:?}");
            assert!(error.to_string().starts_with("geometry 4: vertex 1 at ("), "{error}");
            // The builder is unchanged.
            builder.triangles(ID, &TRIANGLE, &[[0, 1, 2]]).unwrap();
            assert!(builder.commit().unwrap().occluded(&down(0.5, 0.5)));
        }
    }
}

#[test]
fn bad_indices_are_named() {
    let mut builder = builder();
    let error = builder.triangles(ID, &TRIANGLE, &[[0, 1, 2], [0, 3, 1]]).unwrap_err();
    assert_eq!(error, Error::BadIndex { geometry: ID, triangle: 1, index: 3, vertices: 3 });
    assert_eq!(error.to_string(), "geometry 4: triangle 1: index 3 is past the 3 vertices");
    assert!(matches!(builder.triangles(ID, &[], &[[0, 0, 0]]), Err(Error::BadIndex { vertices: 0, .. })));
    assert!(matches!(builder.triangles(ID, &TRIANGLE, &[[u32::MAX; 3]]), Err(Error::BadIndex { .. })));
}

#[test]
fn bad_ids_are_refused() {
    let mut builder = builder();
    builder.triangles(ID, &TRIANGLE, &[[0, 1, 2]]).unwrap();
    assert_eq!(builder.triangles(ID, &TRIANGLE, &[[0, 1, 2]]), Err(Error::DuplicateId(ID)));
    for id in [GeometryId(MAX_GEOMETRY_ID.0 + 1), GeometryId(u32::MAX)] {
        assert_eq!(builder.triangles(id, &TRIANGLE, &[[0, 1, 2]]), Err(Error::IdTooLarge(id)));
    }
    builder.triangles(MAX_GEOMETRY_ID, &TRIANGLE.map(|[x, y, z]| [x + 9.0, y, z]), &[[0, 1, 2]]).unwrap();
    let scene = builder.commit().unwrap();
    assert_eq!(scene.intersect(&down(9.5, 0.5)).unwrap().geometry, MAX_GEOMETRY_ID);
}

/// Column-major matrix that rotates x to y and y to -x, doubles z, and translates by (10, 20, 30).
const MAP: [f32; 12] = [0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 2.0, 10.0, 20.0, 30.0];

#[test]
fn instances_are_hit_at_their_transformed_position() {
    let child = one_triangle();
    let mut builder = builder();
    builder.triangles(GeometryId(0), &[[-9.0, -9.0, 0.0], [-8.0, -9.0, 0.0], [-9.0, -8.0, 0.0]], &[[0, 1, 2]]).unwrap();
    builder.instance(GeometryId(6), &child, &MAP).unwrap();
    drop(child);
    let scene = builder.commit().unwrap();
    // (0.5, 1.5, 0) is transformed to (-1.5 + 10, 0.5 + 20, 30).
    let hit = scene.intersect(&ray([8.5, 20.5, 50.0], [0.0, 0.0, -2.0])).unwrap();
    assert_close([hit.t, hit.u, hit.v], [10.0, 0.25, 0.5]);
    assert_eq!((hit.primitive, hit.geometry, hit.instance), (0, ID, Some(GeometryId(6))));
    // The normal is in the space of the mesh.
    assert_eq!(hit.ng, [0.0, 0.0, 6.0]);
    let own = scene.intersect(&ray([-8.9, -8.9, 5.0], [0.0, 0.0, -1.0])).unwrap();
    assert_eq!((own.geometry, own.instance), (GeometryId(0), None));
    let bounds = scene.bounds().unwrap();
    assert_eq!((bounds.min, bounds.max), ([-9.0, -9.0, 0.0], [10.0, 22.0, 30.0]));
}

/// The transform tilts the triangle, so the normals in both spaces differ.
#[test]
fn instance_normals_are_in_the_space_of_the_mesh() {
    let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.5], [0.0, 1.0, 0.25]];
    let mut child = builder();
    child.triangles(ID, &positions, &[[0, 1, 2]]).unwrap();
    let mut parent = builder();
    parent.instance(GeometryId(0), &child.commit().unwrap(), &MAP).unwrap();
    let scene = parent.commit().unwrap();
    let hit = scene.intersect(&ray([9.75, 20.25, 90.0], [0.0, 0.0, -1.0])).unwrap();
    assert_eq!(hit.ng, [-0.5, -0.25, 1.0]);
}

#[test]
fn bad_instances_are_refused() {
    let child = one_triangle();
    let mut builder = builder();
    let mut flat = MAP;
    flat[8] = 0.0;
    let mut not_a_number = MAP;
    not_a_number[11] = f32::NAN;
    let mut infinite = MAP;
    infinite[0] = f32::INFINITY;
    for map in [flat, not_a_number, infinite] {
        let error = builder.instance(ID, &child, &map).unwrap_err();
        assert!(matches!(error, Error::BadTransform { geometry: ID, .. }), "{error:?}");
    }
    let other = SceneBuilder::new(&device(1)).unwrap().commit().unwrap();
    assert_eq!(builder.instance(ID, &other, &MAP), Err(Error::OtherDevice(ID)));
    builder.instance(ID, &child, &MAP).unwrap();
    assert_eq!(builder.instance(ID, &child, &MAP), Err(Error::DuplicateId(ID)));
    assert_eq!(builder.filter(ID, Arc::new(|_| true)), Err(Error::NoSuchMesh(ID)));
    let nested = SceneBuilder::new(child.device()).unwrap().instance(ID, &builder.commit().unwrap(), &MAP);
    assert_eq!(nested, Err(Error::NestedInstance(ID)));
}

/// Debian's Embree 3 is built with assertions and aborts if the inverse transform makes a ray too large.
#[test]
fn extreme_instances_are_refused_or_do_not_crash() {
    let child = one_triangle();
    let mut random = Random(23);
    let (mut taken, mut refused) = (0, 0);
    for _ in 0..2000 {
        let scale = |random: &mut Random| 10f32.powf(60.0 * random.unit() - 30.0);
        let (size, distance) = (scale(&mut random), scale(&mut random));
        let mut map = [0.0; 12];
        for column in 0..4 {
            let length = if column == 3 { distance } else { size };
            map[3 * column..][..3].copy_from_slice(&random.direction().map(|x| length * x));
        }
        if random.unit() < 0.3 {
            // Nearly flat.
            let k = (random.unit() * 3.0) as usize;
            map[6 + k] = map[k];
        }
        let mut builder = builder();
        match builder.instance(ID, &child, &map) {
            Ok(()) => taken += 1,
            Err(Error::BadTransform { .. }) => {
                refused += 1;
                continue;
            }
            Err(error) => panic!("{error}"),
        }
        let scene = builder.commit().unwrap();
        for _ in 0..50 {
            let [origin, direction] = [0; 2].map(|_| {
                let length = scale(&mut random);
                random.direction().map(|x| length * x)
            });
            scene.intersect(&ray(origin, direction));
            scene.occluded(&ray(origin, direction));
        }
        // A ray at the triangle, from an origin that is near in the space of the mesh.
        let world = |p: [f32; 3]| -> [f32; 3] {
            std::array::from_fn(|k| map[k] * p[0] + map[3 + k] * p[1] + map[6 + k] * p[2] + map[9 + k])
        };
        let (from, to) = (world([0.5, 0.5, 3.0]), world([0.5, 0.5, 0.0]));
        scene.intersect(&ray(from, std::array::from_fn(|k| to[k] - from[k])));
    }
    assert!(taken > 200 && refused > 200, "{taken} taken, {refused} refused");
}

/// A scene of three parallel sheets, the middle one with a filter.
fn sheets(filter: impl Fn(&Candidate) -> bool + Send + Sync + 'static) -> Scene {
    let mut builder = builder();
    for sheet in 0..3u32 {
        let positions = TRIANGLE.map(|[x, y, _]| [x, y, sheet as f32]);
        builder.triangles(GeometryId(sheet), &positions, &[[0, 1, 2]]).unwrap();
    }
    builder.filter(GeometryId(1), Arc::new(filter)).unwrap();
    builder.commit().unwrap()
}

#[test]
fn rays_continue_after_a_rejected_hit() {
    let scene = sheets(|candidate| {
        assert_eq!((candidate.geometry, candidate.instance, candidate.primitive), (GeometryId(1), None, 0));
        candidate.u < 0.25 && candidate.token == 77
    });
    let up = |x, token| Ray { token, tmin: 0.0, tmax: 0.9, ..ray([x, 0.3, 0.5], [0.0, 0.0, 1.0]) };
    assert_eq!(scene.intersect(&up(0.4, 77)).unwrap().geometry, GeometryId(1));
    assert!(scene.occluded(&up(0.4, 77)));
    for rejected in [up(0.6, 77), up(0.4, 78)] {
        assert_eq!(scene.intersect(&rejected), None);
        assert!(!scene.occluded(&rejected));
        let longer = Ray { tmax: 9.0, ..rejected };
        assert_eq!(scene.intersect(&longer).unwrap().geometry, GeometryId(2));
        assert!(scene.occluded(&longer));
    }
}

#[test]
fn candidates_in_an_instance_have_its_id() {
    let mut child = builder();
    child.triangles(GeometryId(2), &TRIANGLE, &[[0, 1, 2]]).unwrap();
    child
        .filter(
            GeometryId(2),
            Arc::new(|candidate| {
                assert_eq!((candidate.geometry, candidate.primitive), (GeometryId(2), 0));
                assert_close([candidate.u, candidate.v, 0.0], [0.25, 0.25, 0.0]);
                candidate.instance == Some(GeometryId(8)) && candidate.token == 5
            }),
        )
        .unwrap();
    let child = child.commit().unwrap();
    let mut parent = builder();
    for (id, x) in [(8, 0.0), (9, 10.0)] {
        let map = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, x, 0.0, 0.0];
        parent.instance(GeometryId(id), &child, &map).unwrap();
    }
    let scene = parent.commit().unwrap();
    drop(child);
    for (x, token, expected) in [(0.5, 5, true), (0.5, 6, false), (10.5, 5, false)] {
        let ray = Ray { token, ..down(x, 0.75) };
        assert_eq!(scene.intersect(&ray).is_some(), expected, "{ray:?}");
        assert_eq!(scene.occluded(&ray), expected, "{ray:?}");
    }
}

#[test]
fn a_panic_in_a_filter_reaches_the_caller_once() {
    let scene = sheets(|candidate| if candidate.token == 13 { panic!("unlucky") } else { true });
    let unlucky = Ray { token: 13, tmax: 1.0, ..ray([0.3, 0.3, 1.5], [0.0, 0.0, -1.0]) };
    let caught = |call: &dyn Fn()| {
        let panic = std::panic::catch_unwind(std::panic::AssertUnwindSafe(call)).unwrap_err();
        assert_eq!(panic.downcast_ref::<&str>(), Some(&"unlucky"));
    };
    caught(&|| _ = scene.intersect(&unlucky));
    caught(&|| _ = scene.occluded(&unlucky));
    let lucky = Ray { token: 0, ..unlucky };
    assert_eq!(scene.intersect(&lucky).unwrap().geometry, GeometryId(1));
}

#[test]
fn a_filter_needs_a_mesh_and_replaces_an_earlier_one() {
    let mut builder = builder();
    assert_eq!(builder.filter(ID, Arc::new(|_| true)), Err(Error::NoSuchMesh(ID)));
    builder.triangles(ID, &TRIANGLE, &[[0, 1, 2]]).unwrap();
    builder.filter(ID, Arc::new(|_| true)).unwrap();
    builder.filter(ID, Arc::new(|_| false)).unwrap();
    assert_eq!(builder.commit().unwrap().intersect(&down(0.5, 0.5)), None);
}

#[test]
fn scene_outlives_builder_device_and_library_handles() {
    let library = Library::load(&Folders::default()).unwrap();
    let device = caustique_embree::Device::new(&library, 1).unwrap();
    let mut child = SceneBuilder::new(&device).unwrap();
    child.triangles(ID, &TRIANGLE, &[[0, 1, 2]]).unwrap();
    let seen = Arc::new(());
    let held = seen.clone();
    child.filter(ID, Arc::new(move |_| Arc::strong_count(&held) > 0)).unwrap();
    let child = child.commit().unwrap();
    let mut parent = SceneBuilder::new(&device).unwrap();
    parent.instance(GeometryId(0), &child, &MAP).unwrap();
    let scene = parent.commit().unwrap();
    drop((child, device, library));
    let clone = scene.clone();
    drop(scene);
    let through = ray([8.5, 20.5, 50.0], [0.0, 0.0, -1.0]);
    assert_eq!(clone.intersect(&through).unwrap().instance, Some(GeometryId(0)));
    assert_eq!(Arc::strong_count(&seen), 2);
    drop(clone);
    assert_eq!(Arc::strong_count(&seen), 1, "the filter was not dropped with the scene");
}

#[test]
fn a_dropped_builder_frees_its_filters() {
    let seen = Arc::new(());
    let held = seen.clone();
    let mut builder = builder();
    builder.triangles(ID, &TRIANGLE, &[[0, 1, 2]]).unwrap();
    builder.filter(ID, Arc::new(move |_| Arc::strong_count(&held) > 0)).unwrap();
    drop(builder);
    assert_eq!(Arc::strong_count(&seen), 1);
}

#[test]
fn threads_see_the_same_hits() {
    let scene = million();
    let trace = |seed| {
        let mut random = Random(seed);
        (0..20_000).map(|_| scene.intersect(&ray(random.point(), random.direction()))).collect::<Vec<_>>()
    };
    let expected: Vec<_> = (0..4).map(trace).collect();
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..8).map(|k| (k % 4, scope.spawn(move || trace(k % 4)))).collect();
        for (seed, thread) in threads {
            assert_eq!(thread.join().unwrap(), expected[seed as usize]);
        }
    });
}

#[test]
fn threads_may_build_scenes_at_once() {
    let device = device(0);
    std::thread::scope(|scope| {
        for k in 0..4u32 {
            let device = &device;
            scope.spawn(move || {
                for _ in 0..20 {
                    let mut builder = SceneBuilder::new(device).unwrap();
                    let (positions, indices) = sphere(8 + k as usize);
                    builder.triangles(GeometryId(k), &positions, &indices).unwrap();
                    let hit = builder.commit().unwrap().intersect(&ray([0.0; 3], [0.1, 0.2, 0.3])).unwrap();
                    assert_eq!(hit.geometry, GeometryId(k));
                }
            });
        }
    });
}

/// For coinciding triangles, and at common corners and edges, several hits are correct. The choice must not depend on
/// the number of threads that built the scene, and must not change from build to build.
#[test]
fn ties_do_not_depend_on_threads() {
    // A flat grid whose size is a power of two, hit at an angle, so that a ray at a corner hits six triangles at
    // exactly the same distance. Some triangles exist 41 times, which is more than fits into a leaf of Embree's BVH.
    let (mut positions, mut indices) = grid(512);
    positions.iter_mut().for_each(|position| position[2] = 0.0);
    let targets = positions.clone();
    for quad in 0..512 {
        let triangle = indices[quad * 1021];
        indices.extend([triangle; 40]);
    }
    let answers = |threads, indices: &[[u32; 3]]| {
        let mut builder = SceneBuilder::new(&device(threads)).unwrap();
        builder.triangles(ID, &positions, indices).unwrap();
        let scene = builder.commit().unwrap();
        let onto = |&[x, y, _]: &[f32; 3]| {
            let ray = ray([x + 1.0, y + 2.0, 4.0], [-0.25, -0.5, -1.0]);
            scene.intersect(&ray).map(|hit| hit.primitive)
        };
        targets.iter().map(onto).collect::<Vec<_>>()
    };
    let differing = |a: &[Option<u32>], b: &[Option<u32>]| a.iter().zip(b).filter(|(a, b)| a != b).count();
    let expected = answers(1, &indices);
    for threads in [1, 2, 2, 3, 8, 8, 0] {
        let found = answers(threads, &indices);
        assert_eq!(differing(&found, &expected), 0, "with {threads} threads");
    }
    // The test is sensitive: with the triangles in reverse order, other triangles are hit.
    let reversed: Vec<_> = indices.iter().rev().copied().collect();
    let last = indices.len() as u32 - 1;
    let found: Vec<_> = answers(1, &reversed).iter().map(|hit| hit.map(|primitive| last - primitive)).collect();
    let ties = differing(&found, &expected);
    assert!(ties > targets.len() / 10, "{ties} of {} rays: no test of ties", targets.len());
}
