//! The classes and owners of random paths, traced from the camera and from lights.

use super::room;
use caustique::bsdf::{LobeSet, Transport};
use caustique::path_class::{CameraSuffix, Event, LightPrefix, PathClass};
use caustique::plan::{Owner, Search};
use caustique::random::{Domain, Stream};
use caustique::scene::{Scene, gltf};
use caustique::transport::{
    CameraPaths, Indirect, InitialMedia, LightPaths, MediumVertex, Next, Scattered, Vertex, Visitor, walk,
};
use std::collections::{BTreeMap, HashSet};
use std::path::Path;

/// A path from the camera, with the letters of the table of classes, and whether its light is a point.
type Whole = (String, bool);

fn letter(event: Event) -> char {
    match event {
        Event::Clear => 'C',
        Event::Mirror => 'M',
        Event::Sharp => 'S',
        Event::Broad => 'B',
        Event::Medium => 'V',
    }
}

fn event(letter: char) -> Event {
    Event::ALL.into_iter().find(|event| self::letter(*event) == letter).expect("it is one of them")
}

/// Records the events of a walk, and every path that the walk could be a part of.
struct Scribe<'a> {
    scene: &'a Scene,
    sofar: String,
    last: Option<LobeSet>,
    /// For a walk from a light: whether the light is a point.
    from_light: Option<bool>,
    found: &'a mut HashSet<Whole>,
}

impl Scribe<'_> {
    fn arrive(&mut self, scattered: Option<Scattered>) {
        if let Some(scattered) = scattered {
            self.sofar.push(letter(self.last.map_or(Event::Medium, |lobes| Event::at_surface(scattered.lobe, lobes))));
        }
    }

    /// Records the paths that end at the last vertex of this walk with these events: by next-event estimation to either
    /// kind of light, or by connection to the camera.
    fn ends(&mut self, events: &[Event]) {
        for event in events {
            let path = format!("{}{}", self.sofar, letter(*event));
            match self.from_light {
                None => self.found.extend([false, true].map(|sizeless| (path.clone(), sizeless))),
                Some(sizeless) => {
                    self.found.insert((path.chars().rev().collect(), sizeless));
                }
            }
        }
    }
}

impl<'a> Visitor<'a> for Scribe<'_> {
    fn surface(&mut self, vertex: &Vertex<'_, 'a>, scattered: Option<Scattered>) -> Next {
        self.arrive(scattered);
        let lobes = vertex.shading.bsdf.lobes();
        if self.from_light.is_none() && self.scene.materials.list[vertex.surface.material as usize].emits() {
            self.found.insert((self.sofar.clone(), false));
        }
        let events = [(LobeSet::SHARP, Event::Sharp), (LobeSet::BROAD, Event::Broad)];
        let events: Vec<Event> =
            events.into_iter().filter(|(lobe, _)| lobes.intersects(*lobe)).map(|(_, e)| e).collect();
        self.ends(&events);
        self.last = Some(lobes);
        Next::Continue(LobeSet::ALL)
    }

    fn medium(&mut self, _: &MediumVertex, scattered: Option<Scattered>) -> Next {
        self.arrive(scattered);
        self.ends(&[Event::Medium]);
        self.last = None;
        Next::Continue(LobeSet::ALL)
    }
}

/// Finds the paths of random walks from the camera and from lights.
fn random_paths(scene: &Scene, walks: u32, found: &mut HashSet<Whole>) {
    let camera = scene.camera(&crate::support::scenes::square(64)).expect("a camera");
    let initial_media = InitialMedia::new(scene, camera.position());
    let classes = caustique::path_class::ClassSet::ALL;
    let (interior, indirect) = (initial_media.camera, Indirect::Photons);
    let camera_paths = CameraPaths {
        scene,
        camera: &camera,
        interior,
        max_depth: 7,
        splits: 0,
        indirect,
        classes,
        lobes: false,
        stop: None,
    };
    let pass = LightPaths::new(5, 0, Domain::Test, walks, 7);
    for index in 0..walks {
        let arena = bumpalo::Bump::new();
        let stream = Stream::new(3, 0, Domain::Test, u64::from(index));
        let start = camera_paths.start((index % 64, index / 64 % 64), stream);
        let mut scribe = Scribe { scene, sofar: String::new(), last: None, from_light: None, found };
        walk(scene, &arena, &start, stream, Transport::Radiance, 7, &mut scribe);
        if let Some(emitted) = pass.emit(scene, &initial_media, index) {
            let mut scribe = Scribe { scene, sofar: String::new(), last: None, from_light: Some(emitted.delta), found };
            walk(scene, &arena, &emitted.start, emitted.stream, Transport::Importance, 7, &mut scribe);
        }
    }
}

fn narrow(path: &str) -> bool {
    path.chars().all(|c| "CMS".contains(c))
}

fn delta(path: &str) -> bool {
    path.chars().all(|c| "CM".contains(c))
}

/// The owners that count a path, one entry per count, from the rules of the estimators: the lobes at which camera paths
/// continue, are lit and gather, and the vertices at which photons are stored. Independent of the classes.
fn counted(search: Search, (path, sizeless): &Whole) -> Vec<Owner> {
    let sizeless = *sizeless;
    let mut owners = Vec::new();
    if delta(path) {
        // A point light is invisible in a mirror.
        return if sizeless { owners } else { vec![Owner::Hits] };
    }
    let lit = path.ends_with(['S', 'B', 'V']);
    let run_into = !sizeless;
    let gathers = |at: usize, what: char| {
        let (before, after) = (&path[..at], &path[at + 1..]);
        let reached = match search {
            Search::PathsAndPhotons => true,
            _ => narrow(before),
        };
        let left = match (search, what) {
            (_, 'S') => narrow(before) && sizeless && delta(after),
            (Search::PathsAndPhotons, _) => narrow(after),
            _ => true,
        };
        reached && left && !after.is_empty() && "SBV".contains(what)
    };
    let by_camera = match search {
        Search::CameraPaths => lit || run_into,
        Search::PathsAndPhotons => match path.rfind('B') {
            Some(last) => last + 1 == path.len(),
            None => lit || run_into,
        },
        _ => narrow(&path[..path.len() - 1]) && (lit || (run_into && narrow(path))),
    };
    if by_camera {
        owners.push(Owner::Lit);
    }
    if search != Search::CameraPaths {
        owners.extend(path.char_indices().filter(|(at, what)| gathers(*at, *what)).map(|_| Owner::Photons));
    }
    owners
}

/// Paths that are not counted exactly once by the owner of their class.
fn faults(paths: &HashSet<Whole>, search: Search, counted: impl Fn(&Whole) -> Vec<Owner>) -> Vec<String> {
    let class = |whole: &Whole| PathClass::of(whole.0.chars().map(event), whole.1);
    // Without photons, no technique finds a point light by a mirror, and camera paths that continue do not support
    // scattering media, so these paths are excluded.
    let invisible = |(path, sizeless): &Whole| {
        *sizeless && (delta(path) || (search == Search::CameraPaths && path.ends_with(['C', 'M'])))
    };
    let beyond = |(path, _): &Whole| search == Search::PathsAndPhotons && path.contains('V');
    let wrong = |whole: &&Whole| counted(whole) != Vec::from_iter(search.owner(class(whole)));
    let all = paths.iter().filter(|whole| !invisible(whole) && !beyond(whole)).filter(wrong);
    all.map(|whole| format!("{whole:?} {:?}: {:?}", class(whole), counted(whole))).collect()
}

const SEARCHES: [Search; 3] = [Search::CameraPaths, Search::Photons, Search::PathsAndPhotons];

/// Random paths of the shipped scenes and of the room.
fn all_paths() -> HashSet<Whole> {
    let mut found = HashSet::new();
    random_paths(&room(true), 20_000, &mut found);
    for name in ["gems", "lamp", "interior", "fog", "prism"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenes/{name}.glb"));
        let description = gltf::read(&path, &gltf::ReadOptions::default()).expect("the scene can be read");
        random_paths(&Scene::build(description, 1).expect("a scene"), 2_000, &mut found);
    }
    found
}

#[test]
fn random_paths_have_one_class_and_one_owner() {
    let paths = all_paths();
    let mut numbers = BTreeMap::new();
    for (path, sizeless) in &paths {
        let class = PathClass::of(path.chars().map(event), *sizeless);
        *numbers.entry(class).or_insert(0u32) += 1;
        // Classified from both ends, for every vertex where the two subpaths meet.
        for (at, _) in path.char_indices().filter(|(_, c)| "SBV".contains(*c)) {
            let suffix = path[..=at].chars().map(event).fold(CameraSuffix::START, CameraSuffix::then);
            let beam = path[at + 1..].chars().rev().map(event).fold(LightPrefix::start(*sizeless), LightPrefix::then);
            assert_eq!(suffix.class_with(beam), class, "{path} {sizeless} at {at}");
        }
    }
    println!("{} different paths: {numbers:?}", paths.len());
    assert_eq!(numbers.len(), PathClass::ALL.len(), "a class was never met: {numbers:?}");
    for search in SEARCHES {
        let found = faults(&paths, search, |whole| counted(search, whole));
        assert!(found.is_empty(), "{search:?}: {} faults\n{}", found.len(), found[..found.len().min(20)].join("\n"));
    }
}

/// Finds classes with two owners, without an owner, or with the wrong one.
#[test]
fn planted_faults_are_found() {
    let paths = all_paths();
    let search = Search::Photons;
    let has = |search, wrong: &dyn Fn(&Whole, &mut Vec<Owner>)| {
        let counted = |whole: &Whole| {
            let mut owners = counted(search, whole);
            wrong(whole, &mut owners);
            owners
        };
        !faults(&paths, search, counted).is_empty()
    };
    assert!(!has(search, &|_, _| {}));
    // The bug: sharp lobes gather light that the camera path also finds when it continues.
    assert!(has(search, &|(path, sizeless), owners| {
        if path == "SC" && !sizeless {
            owners.push(Owner::Photons);
        }
    }));
    // The bug: photons of direct light.
    assert!(has(search, &|(path, _), owners| {
        if path == "B" {
            owners.push(Owner::Photons);
        }
    }));
    // The bug: camera paths end at polished surfaces.
    assert!(has(search, &|(path, _), owners| {
        if path.starts_with('M') {
            owners.clear();
        }
    }));
    // The bug: camera paths that continue count the caustics that they hit.
    assert!(has(Search::PathsAndPhotons, &|(path, sizeless), owners| {
        if path == "BC" && !sizeless {
            owners.push(Owner::Lit);
        }
    }));
}

/// Every method has at most one owner per class, and every class that photons or connections can carry has an owner.
#[test]
fn every_class_has_an_owner_in_every_plan() {
    let searches = [
        Search::CameraPaths,
        Search::LightPaths,
        Search::Connections,
        Search::Map,
        Search::Photons,
        Search::PathsAndPhotons,
        Search::Merging,
        Search::ConnectionsAndMerging,
    ];
    let owners = [Owner::Hits, Owner::Lit, Owner::Photons, Owner::LightPaths, Owner::Connections];
    for search in searches {
        for class in PathClass::ALL {
            let of: Vec<Owner> = owners.into_iter().filter(|owner| search.owned_by(*owner).has(class)).collect();
            assert_eq!(of, Vec::from_iter(search.owner(class)));
            let media = matches!(class, PathClass::Single | PathClass::Volume);
            let on_surfaces = matches!(search, Search::Map | Search::Merging);
            assert!(!of.is_empty() || (media && on_surfaces), "{search:?} {class:?}");
        }
    }
}
