//! An independent check of MIS weights: every weight is computed again from the explicit densities of whole paths.
//!
//! A recorder sees each contribution of random paths in a few scenes, one of them foggy. The check traces the same
//! paths with the same draws, records every vertex, multiplies the densities per area of every technique that could
//! sample the path, and must reproduce the weight of the recursion. Then the recursion is run over the same vertices
//! for all techniques of a path. The weights must sum to one, and must not if a bug is planted.

mod counts;
mod sums;

use crate::support;

use crate::walled_lamps::{learnt, rooms};
use bumpalo::Bump;
use caustique::bsdf::{BsdfSample, LobeSet, Shading, Transport};
use caustique::camera::Camera;
use caustique::light::{EmissionDensity, Emitter, Light, Receiver, TriangleLight};
use caustique::material::{Material, MediumParameters};
use caustique::math::{DVec3, Rgb, Vec3};
use caustique::medium::{FlightDensity, HenyeyGreenstein};
use caustique::path_class::ClassSet;
use caustique::photon::PhotonMap;
use caustique::random::{Domain, Purpose, Stream};
use caustique::render::{Settings, learn_light};
use caustique::scene::description::{EnvironmentDescription, EnvironmentSource};
use caustique::scene::{Description, Scene, View};
use caustique::transport::bidirectional::mis::{self, Eta, Merges, MisState, Ratios, one_merge};
use caustique::transport::{
    Bidirectional, CameraPathStart, CameraPaths, CameraWalkContext, Deposits, Indirect, InitialMedia, LightPaths,
    LightVertices, MediumVertex, MergeLevels, Next, PathRecorder, PathStart, PixelSample, SPARED_BY_ROULETTE,
    Scattered, Technique, TechniqueSet, Vertex, Visitor, lit_side, walk,
};
use support::scenes::{
    add, build, cuboid, glass, look_at, matte, mirror, point_light, quad, sphere, square, window_room,
};

const SIZE: u32 = 16;
const TOLERANCE: f64 = 1e-4;
/// The assumed numbers of pixels that share photons, and of photons that share a camera path.
const SHARING: [f32; 2] = [3.0, 7.0];

/// How a vertex scatters.
// As in the library, vertices are not boxed.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy)]
enum Scatters<'s> {
    Surface(Shading<'s>),
    Medium(HenyeyGreenstein),
}

impl Scatters<'_> {
    fn in_medium(&self) -> bool {
        matches!(self, Scatters::Medium(_))
    }
}

/// A vertex as recorded by a walk.
#[derive(Clone, Copy)]
struct Met<'s> {
    p: Vec3,
    ng: Vec3,
    scatters: Scatters<'s>,
    /// Medium of the last segment.
    medium: Option<MediumParameters>,
    /// Direction back along the walk.
    wo: Vec3,
    distance: f32,
    /// The sampled direction, if the walk continued.
    onward: Option<(Vec3, bool, f32)>,
    emitted: Option<EmissionDensity>,
}

impl Met<'_> {
    fn receiver(&self) -> Receiver {
        let n = match &self.scatters {
            Scatters::Surface(shading) => lit_side(shading, self.ng, self.wo),
            Scatters::Medium(_) => Vec3::ZERO,
        };
        Receiver { n, in_medium: self.scatters.in_medium(), ..Receiver::anywhere(self.p) }
    }
}

/// Records a walk.
struct Notes<'a> {
    scene: &'a Scene,
    /// Fraction of the initial throughput down to which roulette does not end the path.
    spared: f32,
    met: Vec<Met<'a>>,
    escaped: Option<Vec3>,
}

impl<'a> Visitor<'a> for Notes<'a> {
    fn spared(&self) -> f32 {
        self.spared
    }

    fn surface(&mut self, v: &Vertex<'_, 'a>, _: Option<Scattered>) -> Next {
        let from = self.met.last().map_or(Receiver::anywhere(v.from), Met::receiver);
        let emitted = self.scene.lights.emitted(&self.scene.materials, &from, v.surface, v.wo).map(|e| e.1);
        self.met.push(Met {
            p: v.surface.p,
            ng: v.surface.ng,
            scatters: Scatters::Surface(*v.shading),
            medium: v.interior.medium(self.scene),
            wo: v.wo,
            distance: v.distance,
            onward: None,
            emitted,
        });
        Next::Continue(LobeSet::ALL)
    }

    fn medium(&mut self, v: &MediumVertex, _: Option<Scattered>) -> Next {
        self.met.push(Met {
            p: v.arrival.p,
            ng: Vec3::ZERO,
            scatters: Scatters::Medium(v.phase()),
            medium: Some(v.arrival.medium),
            wo: v.wo,
            distance: v.arrival.distance,
            onward: None,
            emitted: None,
        });
        Next::Continue(LobeSet::ALL)
    }

    fn scatter_medium(&mut self, _: &MediumVertex, sample: &BsdfSample) {
        if let Some(last) = self.met.last_mut() {
            last.onward = Some((sample.wi, false, sample.pdf_w));
        }
    }

    fn scatter(&mut self, _: &Vertex<'_, 'a>, sample: &BsdfSample) {
        if let Some(last) = self.met.last_mut() {
            last.onward = Some((sample.wi, sample.lobe == LobeSet::DELTA, sample.pdf_w));
        }
    }

    fn escape(&mut self, direction: Vec3, _: Rgb, _: Option<Scattered>, _: FlightDensity) {
        self.escaped = Some(direction);
    }
}

fn notes<'a>(
    scene: &'a Scene,
    arena: &'a Bump,
    start: PathStart,
    stream: Stream,
    (transport, spared): (Transport, f32),
) -> Notes<'a> {
    let mut notes = Notes { scene, spared, met: Vec::new(), escaped: None };
    walk(scene, arena, &start, stream, transport, 12, &mut notes);
    notes
}

/// A vertex of a whole path.
#[derive(Clone, Copy)]
struct Node<'s> {
    scatters: Scatters<'s>,
    to_light: Vec3,
    to_eye: Vec3,
    /// Cosines of arrivals from the light's side and from the camera's side (on two surfaces if a photon was merged).
    cos: [f64; 2],
    delta: bool,
    /// Density of the direction that a walk has sampled here, and whether it is towards the light. A grazing direction
    /// has too few digits in f32 to evaluate the density again.
    drawn: Option<(bool, f32)>,
}

/// A whole path, from the light to the camera.
struct Whole<'s> {
    light: EmissionDensity,
    nodes: Vec<Node<'s>>,
    /// Squared lengths: `distance2[j]` is that of the segment before node `j`; the last is that to the camera.
    distance2: Vec<f64>,
    /// Media of the segments.
    media: Vec<Option<MediumParameters>>,
    /// Density per solid angle of the rays of one pixel.
    camera_pdf_w: f64,
    /// Number of light paths that a camera path connects to.
    connections: f64,
}

#[derive(Clone, Copy, PartialEq, Debug)]
enum Candidate {
    Hit,
    NextEvent,
    /// A connection after this number of nodes from the light.
    Connect(usize),
    Camera,
    /// A merge at this node.
    Merge(usize),
}

impl<'s> Whole<'s> {
    /// Appends the vertices of a walk in the order from the light to the camera, each with the segment by which the
    /// walk arrived.
    fn append<'m>(&mut self, met: impl Iterator<Item = &'m Met<'s>>, eye_side: bool)
    where
        's: 'm,
    {
        for met in met {
            self.nodes.push(passed(met, eye_side));
            self.segment(f64::from(met.distance) * f64::from(met.distance), met.medium);
        }
    }

    fn segment(&mut self, distance2: f64, medium: Option<MediumParameters>) {
        self.distance2.push(distance2);
        self.media.push(medium);
    }

    /// Mean over channels of the density of flying along segment `j` and stopping at a vertex of its medium, or of
    /// passing.
    fn flies(&self, j: usize, stops: bool) -> f64 {
        let Some(medium) = self.media[j].filter(|m| m.sigma_s != Rgb::ZERO) else { return 1.0 };
        let distance = self.distance2[j].sqrt();
        let channel = |c: usize| {
            let sigma = f64::from(medium.sigma_a[c]) + f64::from(medium.sigma_s[c]);
            (-sigma * distance).exp() * if stops { sigma } else { 1.0 }
        };
        (0..3).map(channel).sum::<f64>() / 3.0
    }

    /// Whether a vertex is in a medium. Light and camera are not.
    fn in_medium(&self, node: usize) -> bool {
        self.nodes.get(node).is_some_and(|node| node.scatters.in_medium())
    }

    /// Flight densities of segment `j`, from the light to the camera.
    fn flight(&self, j: usize) -> FlightDensity {
        let starts = j > 0 && self.in_medium(j - 1);
        FlightDensity { forward: self.flies(j, self.in_medium(j)) as f32, reverse: self.flies(j, starts) as f32 }
    }

    fn techniques(&self) -> Vec<Candidate> {
        let k = self.nodes.len();
        let mut all = vec![Candidate::Hit, Candidate::NextEvent];
        all.extend((1..k).map(Candidate::Connect));
        all.push(Candidate::Camera);
        all.extend((0..k).map(Candidate::Merge));
        all
    }

    /// Density of scattering at node `j`, away from the light or towards it.
    fn scatters(&self, j: usize, to_light: bool) -> f64 {
        let node = &self.nodes[j];
        if node.delta {
            return 1.0;
        }
        if let Some((_, pdf)) = node.drawn.filter(|&(towards, _)| towards == to_light) {
            return f64::from(pdf);
        }
        let (from, to, transport) = if to_light {
            (node.to_eye, node.to_light, Transport::Radiance)
        } else {
            (node.to_light, node.to_eye, Transport::Importance)
        };
        let Shading { frame, ng, bsdf, .. } = match node.scatters {
            Scatters::Medium(phase) => return f64::from(phase.pdf_w(from, to)),
            Scatters::Surface(shading) => shading,
        };
        f64::from(Shading::new(frame, ng, bsdf, from).pdf(to, transport, LobeSet::ALL))
    }

    /// Density per area of node `j`, sampled from the light.
    fn light_pdf_a(&self, j: usize) -> f64 {
        let cos = self.nodes[j].cos[0] * self.flies(j, self.in_medium(j));
        match j {
            0 if self.light.infinite => f64::from(self.light.onward) * cos,
            0 => f64::from(self.light.onward) * cos / self.distance2[0],
            _ => self.scatters(j - 1, false) * cos / self.distance2[j],
        }
    }

    /// Density per area of node `j` walked to from the eye.
    fn eye_pdf_a(&self, j: usize) -> f64 {
        let pdf = if j + 1 == self.nodes.len() { self.camera_pdf_w } else { self.scatters(j + 1, true) };
        pdf * self.nodes[j].cos[1] / self.distance2[j + 1] * self.flies(j + 1, self.in_medium(j))
    }

    /// Whether no vertex between this one and the camera could have scattered the camera path elsewhere.
    fn is_clear(&self, m: usize) -> bool {
        self.nodes[m + 1..].iter().all(|node| node.delta)
    }

    /// Number of samples times density of the path by a technique. For merges, times the share of independent photons.
    fn density(&self, strategy: Candidate, which: &TechniqueSet, light_paths: f64, eta: f64) -> f64 {
        let k = self.nodes.len();
        let smooth = |j: usize| !self.nodes[j].delta;
        let light = |n: usize| (0..n).map(|j| self.light_pdf_a(j)).product::<f64>() * f64::from(self.light.start);
        let eye = |n: usize| (n..k).map(|j| self.eye_pdf_a(j)).product::<f64>();
        match strategy {
            Candidate::Hit if self.light.delta => 0.0,
            Candidate::Hit => {
                let measure = if self.light.infinite { 1.0 } else { f64::from(self.light.cos) / self.distance2[0] };
                self.scatters(0, true) * measure * self.flies(0, false) * eye(0)
            }
            Candidate::NextEvent if smooth(0) => f64::from(self.light.direct) * eye(0),
            Candidate::Connect(s) if smooth(s - 1) && smooth(s) => self.connections * light(s) * eye(s),
            Candidate::Camera if smooth(k - 1) => light_paths * light(k),
            Candidate::Merge(m) => {
                let (from_light, from_camera) = (m as u32 + 1, (k - m) as u32);
                if !smooth(m)
                    || self.in_medium(m)
                    || !which.light_vertex_merges(from_light)
                    || !which.camera_vertex_merges(from_camera)
                {
                    return 0.0;
                }
                let [pixels, photons] = SHARING.map(f64::from);
                let worth = 1.0 / (1.0 + if self.is_clear(m) { pixels } else { photons });
                worth * eta * light(m + 1) * eye(m)
            }
            _ => 0.0,
        }
    }

    fn weight(&self, strategy: Candidate, which: &TechniqueSet, light_paths: f64, eta: f64) -> f64 {
        let sum: f64 = self.techniques().into_iter().map(|s| self.density(s, which, light_paths, eta)).sum();
        self.density(strategy, which, light_paths, eta) / sum
    }

    /// Weights of all techniques by the recursion.
    fn recursive(
        &self,
        which: &TechniqueSet,
        light_paths: f64,
        (eta, oracle): (Eta, f64),
        bug: Option<Bug>,
    ) -> Vec<f64> {
        let k = self.nodes.len();
        let one = |merges: bool, clear: bool| {
            if merges { one_merge(clear) } else { Merges::ZERO }
        };
        let by_light = |j: usize, merges: bool| one(merges && !self.in_medium(j), bug == Some(Bug::NothingShared));
        let by_camera =
            |j: usize| one(which.camera_vertex_merges((k - j) as u32) && !self.in_medium(j), self.is_clear(j));
        // The number of samples of the technique that joins the last two vertices of a subpath of `length` vertices.
        let joins = |length: usize| if length == 1 || bug == Some(Bug::OneConnection) { 1.0 } else { self.connections };
        let cosine = |c: f64| if bug == Some(Bug::Cosine) { 1.0 } else { c as f32 };
        let flight = |j: usize, eye_side: bool| {
            let FlightDensity { forward, reverse } =
                if bug == Some(Bug::FlightDensity) { FlightDensity::ONE } else { self.flight(j) };
            if eye_side {
                FlightDensity { forward: reverse, reverse: forward }
            } else {
                FlightDensity { forward, reverse }
            }
        };
        let go = |mis: MisState, j: usize, to_light: bool, merges: Merges| {
            let cos = self.nodes[j].cos[usize::from(!to_light)] as f32;
            let cos = if to_light { self.nodes[j].cos[0] as f32 } else { cos };
            if self.nodes[j].delta {
                return mis.scatter_delta(cos);
            }
            let (mut forward, mut reverse) = (self.scatters(j, to_light) as f32, self.scatters(j, !to_light) as f32);
            if bug == Some(Bug::Reverse) {
                (forward, reverse) = (reverse, forward);
            }
            mis.scatter(cos, forward, reverse, joins(if to_light { k - j } else { j + 1 }), merges)
        };
        let (mut lights, mut eyes) = (Vec::new(), vec![MisState::default(); k]);
        let chosen = if bug == Some(Bug::Chosen) { 1.0 } else { self.light.direct / self.light.start };
        let mut mis = MisState::light(&self.light).received(chosen);
        for j in 0..k {
            let distance2 = if j == 0 && self.light.infinite { 1.0 } else { self.distance2[j] as f32 };
            mis = mis.arrive(distance2, cosine(self.nodes[j].cos[0])).fly(flight(j, false));
            lights.push(mis);
            let from = if bug == Some(Bug::DirectMerged) { 1 } else { j as u32 + 1 };
            let merges = which.light_vertex_merges(from) || (bug == Some(Bug::DirectMerged) && which.merge);
            mis = go(mis, j, false, by_light(j, merges));
        }
        let mut mis = MisState::camera(light_paths as f32, self.camera_pdf_w as f32);
        let mut before_light = mis;
        for j in (0..k).rev() {
            mis = mis.arrive(self.distance2[j + 1] as f32, cosine(self.nodes[j].cos[1])).fly(flight(j + 1, true));
            eyes[j] = mis;
            mis = go(mis, j, true, by_camera(j));
            before_light = mis;
        }
        let possible = |s: Candidate| self.density(s, which, light_paths, oracle) > 0.0;
        let weight = |s: Candidate| -> f64 {
            if !possible(s) {
                return 0.0;
            }
            let reverse = |j: usize, to_light: bool| self.scatters(j, to_light) as f32;
            f64::from(match s {
                Candidate::Hit => {
                    let at = if self.light.infinite {
                        before_light
                    } else {
                        before_light.arrive(self.distance2[0] as f32, self.light.cos)
                    };
                    mis::hit(&at.fly(flight(0, true)), &self.light).weight(eta)
                }
                Candidate::NextEvent => {
                    let d2 = self.distance2[0] as f32;
                    let solid = if self.light.infinite || self.light.delta { 1.0 } else { d2 / self.light.cos };
                    let reach = if self.light.infinite { 1.0 } else { 1.0 / d2 };
                    let FlightDensity { forward, reverse: back } = self.flight(0);
                    let chosen = self.light.start / self.light.direct;
                    let arrival = self.light.onward * reach * self.nodes[0].cos[0] as f32 * forward * chosen;
                    let pdfs = mis::NextEventPdfs {
                        pdf_w: reverse(0, true) * back,
                        reverse_pdf_w: reverse(0, false),
                        light_pdf_w: self.light.direct * solid,
                        arrival_pdf_a: arrival,
                        delta: self.light.delta,
                    };
                    mis::next_event(&eyes[0], joins(k), &pdfs).weight(eta)
                }
                Candidate::Connect(s) => {
                    let light = mis::End {
                        mis: &lights[s - 1],
                        reverse_pdf_w: reverse(s - 1, true),
                        arrival_pdf_a: self.eye_pdf_a(s - 1) as f32,
                        joins: joins(s),
                        merges: by_light(s - 1, which.light_vertex_merges(s as u32)),
                    };
                    let eye = mis::End {
                        mis: &eyes[s],
                        reverse_pdf_w: reverse(s, false),
                        arrival_pdf_a: self.light_pdf_a(s) as f32,
                        joins: joins(k - s),
                        merges: by_camera(s),
                    };
                    mis::connect(&light, &eye, self.connections).weight(eta)
                }
                Candidate::Camera => {
                    let (pdf_a, back) = (self.eye_pdf_a(k - 1) as f32, reverse(k - 1, true));
                    mis::camera(&lights[k - 1], joins(k), pdf_a, light_paths as f32, back).weight(eta)
                }
                Candidate::Merge(m) => {
                    let (joins, own) = ([joins(m + 1), joins(k - m)], by_camera(m));
                    mis::merge(&lights[m], &eyes[m], joins, reverse(m, true), reverse(m, false), own).merge_weight(eta)
                }
            })
        };
        self.techniques().into_iter().map(weight).collect()
    }
}

#[derive(Clone, Copy, PartialEq, Debug)]
enum Bug {
    /// The cosine of an arrival is missing.
    Cosine,
    /// Forward and reverse densities are exchanged.
    Reverse,
    /// Merges are counted where there are none.
    DirectMerged,
    /// Free-flight densities are missing.
    FlightDensity,
    /// Lights are chosen for next-event estimation with the probabilities of emission.
    Chosen,
    /// Merges at the vertices of light paths count as independent; those of camera paths do not.
    NothingShared,
    /// Subpaths count one connection, whatever their number is.
    OneConnection,
}

const BUGS: [Bug; 7] = [
    Bug::Cosine,
    Bug::Reverse,
    Bug::DirectMerged,
    Bug::FlightDensity,
    Bug::Chosen,
    Bug::NothingShared,
    Bug::OneConnection,
];

/// The contributions that the library has reported.
#[derive(Default)]
struct Said(Vec<(Technique, Vec3, Ratios)>);

impl PathRecorder for Said {
    fn contribution(&mut self, technique: Technique, _: Rgb, from: Vec3, ratios: Ratios) {
        self.0.push((technique, from, ratios));
    }
}

/// The node at a vertex through which a walk has passed.
fn passed<'s>(met: &Met<'s>, eye_side: bool) -> Node<'s> {
    let (onward, delta, pdf) = met.onward.unwrap_or((Vec3::ZERO, false, 0.0));
    let (to_light, to_eye) = if eye_side { (onward, met.wo) } else { (met.wo, onward) };
    Node { delta, drawn: Some((eye_side, pdf)), ..node(met, met, to_light, to_eye) }
}

/// A node that was reached as `light` from the light's side and as `eye` from the camera's side, and scatters.
fn node<'s>(light: &Met<'s>, eye: &Met<'s>, to_light: Vec3, to_eye: Vec3) -> Node<'s> {
    let cos = |w: Vec3, met: &Met| if met.scatters.in_medium() { 1.0 } else { f64::from(w.dot(met.ng).abs()) };
    Node {
        scatters: eye.scatters,
        to_light,
        to_eye,
        cos: [cos(to_light, light), cos(to_eye, eye)],
        delta: false,
        drawn: None,
    }
}

struct Tally {
    weights: usize,
    techniques: std::collections::BTreeMap<&'static str, usize>,
    sums: usize,
    bugs: [f64; BUGS.len()],
    /// Number of weights of paths with vertices in media.
    in_media: usize,
}

/// Numbers of samples of the techniques.
#[derive(Clone, Copy, Debug)]
struct Samples {
    /// Light paths per pixel.
    light_paths: f32,
    connections: f32,
    /// Probability that a camera path merges.
    merging: f32,
}

const ONE_OF_EACH: Samples = Samples { light_paths: 1.0, connections: 1.0, merging: 1.0 };

/// A scene and the data that weights need.
struct Lab<'a> {
    scene: &'a Scene,
    camera: &'a Camera,
    initial_media: &'a InitialMedia,
    shared: Bidirectional<'a>,
    levels: MergeLevels,
    eta: Eta,
    /// Merges that the explicit densities count.
    oracle: f64,
}

impl<'a> Lab<'a> {
    fn new(
        scene: &'a Scene,
        camera: &'a Camera,
        initial_media: &'a InitialMedia,
        radius: f32,
        samples: Samples,
    ) -> Lab<'a> {
        let camera_paths = CameraPaths {
            lobes: false,
            scene,
            camera,
            interior: initial_media.camera,
            splits: 0,
            max_depth: 12,
            indirect: Indirect::Photons,
            classes: ClassSet::ALL,
            stop: None,
        };
        let light_paths = (SIZE * SIZE) as f32 * samples.light_paths;
        let techniques = TechniqueSet::VCM;
        let shared = Bidirectional {
            camera_paths,
            initial_media,
            techniques,
            light_paths,
            connections: samples.connections,
            spared: if samples.connections > 0.0 { 1.0 } else { SPARED_BY_ROULETTE },
            merged_paths: 2.0 * light_paths,
            only: None,
        };
        let merged = 2.0 * light_paths * samples.merging;
        let eta = Eta::new(radius * radius, merged).sharing(SHARING[0], SHARING[1]);
        let oracle = std::f64::consts::PI * f64::from(radius * radius) * f64::from(merged);
        // Wider than eta implies, so that many photons are merged. Weights do not depend on distances.
        let levels = MergeLevels::new(std::iter::once((36.0 * radius * radius, eta)));
        Lab { scene, camera, initial_media, shared, levels, eta, oracle }
    }

    /// Sum of the weights of all techniques of a path by the recursion.
    fn sum(&self, whole: &Whole<'_>, bug: Option<Bug>) -> f64 {
        let Bidirectional { techniques, light_paths, .. } = self.shared;
        whole.recursive(&techniques, f64::from(light_paths), (self.eta, self.oracle), bug).iter().sum()
    }

    /// All whole paths that a random pair of subpaths is combined to.
    fn paths(&self, path: u32, mut each: impl FnMut(Technique, Candidate, &Whole<'_>, Ratios)) {
        let Lab { scene, camera, initial_media, shared, ref levels, .. } = *self;
        let (camera_paths, pixels) = (shared.camera_paths, (SIZE * SIZE) as f32);
        let (pass, index) = (u64::from(path / (SIZE * SIZE)), path % (SIZE * SIZE));
        let lights = LightPaths::new(1, pass, Domain::Light, SIZE * SIZE, 12);
        let stream = Stream::new(1, pass, Domain::CameraIndependent, u64::from(index));
        let pixel = (index % SIZE, index / SIZE);
        let arena = Bump::new();
        let mut vertices = LightVertices::new_in(&arena);
        let (mut left, mut by_light, mut by_camera) = (Deposits::default(), Said::default(), Said::default());
        let emitted = lights.emit(scene, initial_media, index);
        if let Some(emitted) = &emitted {
            shared.light_path(&lights, emitted, false, &mut vertices, &mut left, &mut by_light);
        }
        let map = PhotonMap::build(left.photons.clone());
        let meets = CameraWalkContext { vertices: &vertices, photons: Some(&map), levels };
        let mut measure = PixelSample::default();
        shared.camera_path(
            &arena,
            &CameraPathStart { ray: shared.camera_paths.start(pixel, stream), stream },
            &meets,
            &mut by_camera,
            &mut measure,
        );

        let start = camera_paths.start(pixel, stream);
        let eye_notes = notes(scene, &arena, start, stream, (Transport::Radiance, shared.spared));
        let light_notes =
            emitted.as_ref().map(|e| notes(scene, &arena, e.start, e.stream, (Transport::Importance, 1.0)));
        let from_light = light_notes.as_ref().map_or(&[][..], |n| &n.met[..]);
        let from_camera = &eye_notes.met[..];
        let camera_pdf_w = f64::from(camera.pdf_w(start.direction) * pixels);
        let square = |d: f32| f64::from(d) * f64::from(d);
        for (technique, from, ratios) in by_light.0.into_iter().chain(by_camera.0) {
            let density = emitted.as_ref().zip(from_light.first()).map(|(e, met)| EmissionDensity {
                direct: e.density.start * scene.lights.next_event_ratio(&met.receiver(), e.light, met.wo),
                ..e.density
            });
            let infinity =
                EmissionDensity { direct: 0.0, start: 0.0, onward: 0.0, cos: 1.0, infinite: true, delta: false };
            let mut whole = Whole {
                light: density.unwrap_or(infinity),
                nodes: vec![],
                distance2: vec![],
                media: vec![],
                camera_pdf_w,
                connections: f64::from(shared.connections),
            };
            let strategy = match technique {
                Technique::Hit { camera: 1 } => continue,
                Technique::Hit { camera: 0 } => {
                    if from_camera.is_empty() {
                        continue;
                    }
                    let direction = eye_notes.escaped.expect("an escape");
                    let met = from_camera[from_camera.len() - 1];
                    whole.light = EmissionDensity { onward: scene.lights.entry_pdf_a(met.p, direction), ..infinity };
                    scene.lights.for_each_infinite(&met.receiver(), direction, false, |_, direct, start, _| {
                        (whole.light.direct, whole.light.start) = (direct, start);
                    });
                    whole.segment(1.0, None);
                    whole.append(from_camera[..from_camera.len()].iter().rev(), true);
                    Candidate::Hit
                }
                Technique::Hit { camera: t } => {
                    let t = t as usize;
                    whole.light = from_camera[t - 1].emitted.expect("a lamp");
                    whole.segment(square(from_camera[t - 1].distance), from_camera[t - 1].medium);
                    whole.append(from_camera[..t - 1].iter().rev(), true);
                    Candidate::Hit
                }
                Technique::NextEvent { camera: t } => {
                    let met = &from_camera[t as usize - 1];
                    let draws = stream.vertex(t);
                    let (choice, point) = (draws.one_fine(Purpose::LightChoice), draws.two(Purpose::LightPoint));
                    let sample = {
                        let receiver = met.receiver();
                        scene.lights.sample_direct(&scene.shapes, &scene.materials, &receiver, choice, point)
                    };
                    let sample = sample.expect("a light sample");
                    let mut distance2 = 1.0;
                    let emitters = scene.lights.emitters();
                    let environment = (0..).zip(emitters).find(|(_, e)| e.is_infinite()).map(|(light, _)| light);
                    whole.light = match sample.target {
                        None => EmissionDensity {
                            direct: sample.pdf_w,
                            start: sample.pdf_w
                                / environment.map_or(1.0, |light| {
                                    scene.lights.next_event_ratio(&met.receiver(), light, sample.wi)
                                }),
                            onward: scene.lights.entry_pdf_a(met.p, sample.wi),
                            ..infinity
                        },
                        Some(target) if sample.delta => {
                            distance2 = f64::from(target.distance_squared(met.p));
                            let onward = 0.25 * std::f32::consts::FRAC_1_PI;
                            EmissionDensity { direct: 1.0, start: 1.0, onward, cos: 1.0, infinite: false, delta: true }
                        }
                        Some(target) => {
                            // The lamp is flat and has uniform radiance, but each of its triangles has its own
                            // probability.
                            let Emitter::Triangle(TriangleLight { instance, primitive, corners: [a, b, c], .. }) =
                                &emitters[sample.light as usize]
                            else {
                                panic!("another light than a lamp");
                            };
                            let (n, to) = (b.cross(*c), target - *a);
                            let at = [to.cross(*c), b.cross(to)].map(|v| v.dot(n) / n.length_squared());
                            let lamp = scene.shapes.surface(*instance, *primitive, at);
                            let lamp = lamp.expect("a lamp");
                            // Shadow rays end a little off the lamp, along its normal.
                            let p = target - lamp.ng * (target - lamp.p).dot(lamp.ng);
                            distance2 = f64::from(p.distance_squared(met.p));
                            let emitted = scene.lights.emitted(&scene.materials, &met.receiver(), &lamp, -sample.wi);
                            emitted.expect("light from the lamp").1
                        }
                    };
                    assert_eq!(from, sample.target.unwrap_or(sample.wi));
                    whole.segment(distance2, scene.medium);
                    whole.append(from_camera[..t as usize].iter().rev(), true);
                    whole.nodes[0] = node(met, met, sample.wi, met.wo);
                    Candidate::NextEvent
                }
                Technique::Connect { light: s, camera: t } => {
                    let (s, t) = (s as usize, t as usize);
                    let (a, b) = (&from_light[s - 1], &from_camera[t - 1]);
                    let d = (b.p - a.p).normalize();
                    whole.append(from_light[..s].iter(), false);
                    whole.nodes[s - 1] = node(a, a, a.wo, d);
                    whole.segment(f64::from(b.p.distance_squared(a.p)), scene.medium);
                    whole.append(from_camera[..t].iter().rev(), true);
                    whole.nodes[s] = node(b, b, -d, b.wo);
                    Candidate::Connect(s)
                }
                Technique::Camera { light: s } => {
                    let s = s as usize;
                    let met = &from_light[s - 1];
                    let d = (from - met.p).normalize();
                    whole.append(from_light[..s].iter(), false);
                    whole.nodes[s - 1] = node(met, met, met.wo, d);
                    whole.segment(f64::from(from.distance_squared(met.p)), scene.medium);
                    whole.camera_pdf_w = f64::from(camera.pdf_w(-d) * pixels);
                    Candidate::Camera
                }
                Technique::Merge { light: s, camera: t } => {
                    let (s, t) = (s as usize, t as usize);
                    let (a, b) = (&from_light[s - 1], &from_camera[t - 1]);
                    assert_eq!(a.p, from);
                    whole.append(from_light[..s].iter(), false);
                    whole.nodes.pop();
                    let merged = node(a, b, a.wo, b.wo);
                    whole.append(from_camera[..t].iter().rev(), true);
                    whole.nodes[s - 1] = merged;
                    Candidate::Merge(s - 1)
                }
            };
            each(technique, strategy, &whole, ratios);
        }
    }
}

/// The name of a technique.
fn name(strategy: Candidate) -> &'static str {
    match strategy {
        Candidate::Hit => "hit",
        Candidate::NextEvent => "next event",
        Candidate::Connect(_) => "connect",
        Candidate::Camera => "camera",
        Candidate::Merge(_) => "merge",
    }
}

/// Compares all contributions of `paths` random pairs of subpaths, with one sample of each technique.
fn check(what: &str, scene: &Scene, radius: f32, paths: u32) {
    check_samples(what, scene, radius, paths, ONE_OF_EACH, &BUGS);
}

/// Compares all contributions of `paths` random pairs of subpaths. The weights must not sum to one with any of `bugs`.
fn check_samples(what: &str, scene: &Scene, radius: f32, paths: u32, samples: Samples, bugs: &[Bug]) {
    let camera: Camera = scene.camera(&square(SIZE)).expect("a camera");
    let initial_media = InitialMedia::new(scene, camera.position());
    let lab = Lab::new(scene, &camera, &initial_media, radius, samples);
    let Bidirectional { techniques, light_paths, .. } = lab.shared;
    let mut tally = Tally { weights: 0, techniques: Default::default(), sums: 0, bugs: [0.0; BUGS.len()], in_media: 0 };
    for path in 0..paths {
        lab.paths(path, |technique, strategy, whole, ratios| {
            let expected = whole.weight(strategy, &techniques, f64::from(light_paths), lab.oracle);
            let found = match strategy {
                Candidate::Merge(_) => ratios.merge_weight(lab.eta),
                _ => ratios.weight(lab.eta),
            };
            let found = f64::from(found);
            assert!(
                (found - expected).abs() <= TOLERANCE,
                "{what}, path {path}, {technique:?}: {found} by recursion, {expected} by densities"
            );
            tally.weights += 1;
            tally.in_media += usize::from(whole.nodes.iter().any(|node| node.scatters.in_medium()));
            *tally.techniques.entry(name(strategy)).or_default() += 1;
            if strategy != Candidate::Hit || whole.techniques().len() > 2 {
                let error = (lab.sum(whole, None) - 1.0).abs();
                assert!(error <= TOLERANCE, "{what}, path {path}, {technique:?}: the weights sum to 1 + {error}");
                tally.sums += 1;
                for (bug, worst) in BUGS.into_iter().zip(&mut tally.bugs) {
                    *worst = worst.max((lab.sum(whole, Some(bug)) - 1.0).abs());
                }
            }
        });
    }
    println!(
        "{what}: {} weights, {} with media, {} sums, {:?}; planted bugs {:?}",
        tally.weights, tally.in_media, tally.sums, tally.techniques, tally.bugs
    );
    assert!(
        tally.techniques.len() >= 4 - usize::from(samples.connections == 0.0) && tally.weights > 1000,
        "{what}: too little happened"
    );
    let media = scene.survey.scattering;
    assert_eq!(tally.in_media > tally.weights / 4, media, "{what}: {} paths through media", tally.in_media);
    for (bug, worst) in BUGS.into_iter().zip(tally.bugs).filter(|(bug, _)| bugs.contains(bug)) {
        // Some bugs need a scene with the feature that they ignore.
        let possible = match bug {
            Bug::FlightDensity => media,
            Bug::OneConnection => samples.connections != 1.0,
            // The triangles of a lamp have equal probabilities for emission and for next-event estimation.
            Bug::Chosen => {
                let emitters = scene.lights.emitters();
                emitters.len() > 1 && emitters.iter().any(Light::is_infinite)
            }
            _ => true,
        };
        if !possible {
            continue;
        }
        assert!(worst > 100.0 * TOLERANCE, "{what}: {bug:?} is not detected ({worst})");
    }
}

fn room() -> Description {
    let mut description = Description::default();
    let plastic = Material {
        base_color: [0.7, 0.6, 0.5, 1.0],
        metallic: 0.0.into(),
        roughness: 0.4.into(),
        ..Material::default()
    };
    add(&mut description, "room", cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 3.0), true), plastic);
    description.cameras.push(look_at(DVec3::new(0.0, 1.0, 2.8), DVec3::new(0.0, 0.9, 0.0), 50.0));
    description
}

/// Glossy walls, a mirror, a lamp with an area.
#[test]
fn lamp_in_a_glossy_room() {
    let mut description = room();
    let lamp = quad(Vec3::new(-0.4, 1.9, -0.4), Vec3::X * 0.8, Vec3::Z * 0.8);
    add(&mut description, "lamp", lamp, Material { double_sided: true, ..matte(0.2, 8.0) });
    add(&mut description, "mirror", sphere(Vec3::new(-0.45, 0.4, 0.0), 0.4, 64), mirror());
    check("glossy room", &build(description), 0.1, 2000);
}

/// Smooth and rough glass under a point light.
#[test]
fn point_light_and_glass() {
    let mut description = room();
    add(&mut description, "smooth", sphere(Vec3::new(-0.45, 0.45, 0.0), 0.4, 64), glass(1.5));
    add(
        &mut description,
        "rough",
        sphere(Vec3::new(0.45, 0.45, 0.3), 0.4, 64),
        Material { roughness: 0.5.into(), ..glass(1.4) },
    );
    description.lights.push(point_light(DVec3::new(0.1, 1.7, 0.2), 3.0));
    check("point light", &build(description), 0.1, 2000);
}

/// An environment image over rough metal: light from infinity.
#[test]
fn under_an_environment() {
    check("environment", &build(outdoors()), 0.1, 4000);
}

/// With a lamp, so that every point has its own probabilities of choosing a light.
#[test]
fn lamp_under_an_environment() {
    let mut description = outdoors();
    let lamp = quad(Vec3::new(-0.8, 1.2, -0.6), Vec3::X * 0.6, Vec3::Z * 0.4);
    add(&mut description, "lamp", lamp, Material { double_sided: true, ..matte(0.2, 20.0) });
    check("lamp and environment", &build(description), 0.1, 4000);
}

/// In a room whose sky was learnt.
#[test]
fn behind_a_window() {
    let mut description = window_room(matte(0.6, 0.0), outdoors().environment);
    let lamp = quad(Vec3::new(-0.8, 0.8, -0.6), Vec3::X * 0.3, Vec3::Z * 0.2);
    add(&mut description, "lamp", lamp, Material { double_sided: true, ..matte(0.2, 2.0) });
    let scene = build(description);
    let camera = scene.camera(&square(SIZE)).expect("a camera");
    let learnt = learn_light(View::new(&scene, &camera), &Settings::default());
    check("window", &scene.with_learnt(&learnt).expect("a window is worth learning"), 0.1, 4000);
}

/// In a room whose lamps were learnt, because brighter ones are behind walls.
#[test]
fn between_lamps_behind_walls() {
    check("lamps behind walls", &learnt(&build(rooms(0.6))), 0.1, 4000);
}

fn outdoors() -> Description {
    let mut description = Description::default();
    let floor = quad(Vec3::new(-1.5, 0.0, -1.5), Vec3::Z * 3.0, Vec3::X * 3.0);
    add(&mut description, "floor", floor, matte(0.5, 0.0));
    let metal = Material { metallic: 1.0.into(), roughness: 0.4.into(), ..Material::default() };
    add(&mut description, "ball", sphere(Vec3::new(0.3, 0.5, 0.0), 0.5, 64), metal);
    let wall = quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::X * 2.0, Vec3::Y * 2.0);
    add(&mut description, "wall", wall, matte(0.6, 0.0));
    let texels = (0..32 * 16).map(|i| [0.2 + (i % 7) as f32, 0.5, 0.3 + (i % 5) as f32]).collect();
    let source = EnvironmentSource::Image { width: 32, height: 16, texels };
    description.environment = Some(EnvironmentDescription { source, rotation_deg: 30.0, strength: 1.0 });
    description.cameras.push(look_at(DVec3::new(1.2, 1.4, 2.2), DVec3::new(0.0, 0.4, 0.0), 40.0));
    description
}

/// Coloured fog in a room with a mirror and a ball of clear glass: vertices in the medium, segments through it, and no
/// medium in the ball.
#[test]
fn lamp_in_fog() {
    let mut description = room();
    let lamp = quad(Vec3::new(-0.4, 1.9, -0.4), Vec3::X * 0.8, Vec3::Z * 0.8);
    add(&mut description, "lamp", lamp, Material { double_sided: true, ..matte(0.2, 8.0) });
    add(&mut description, "mirror", sphere(Vec3::new(-0.45, 0.4, 0.0), 0.4, 64), mirror());
    add(&mut description, "glass", sphere(Vec3::new(0.45, 0.45, 0.3), 0.4, 64), glass(1.4));
    let (sigma_a, sigma_s) = (Rgb::new(0.02, 0.1, 0.3), Rgb::new(0.9, 0.5, 0.3));
    description.medium = Some(MediumParameters { sigma_a, sigma_s, g: 0.5 });
    check("fog", &build(description), 0.1, 2000);
}

/// Coloured fog with a point light.
#[test]
fn point_light_in_fog() {
    let mut description = room();
    add(&mut description, "mirror", sphere(Vec3::new(-0.45, 0.4, 0.0), 0.4, 64), mirror());
    description.lights.push(point_light(DVec3::new(0.1, 1.7, 0.2), 3.0));
    description.medium = Some(MediumParameters { sigma_a: Rgb::ZERO, sigma_s: Rgb::splat(0.8), g: -0.3 });
    check("point light in fog", &build(description), 0.1, 2000);
}
