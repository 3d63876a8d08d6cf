//! Renders by other renderers. They return no intermediate pictures, so that each point of their curves is a render of its
//! own, with a growing time budget.

use super::point::Point;
use super::reference::Reference;
use crate::camera::Camera;
use crate::error::Result;
use crate::film::Picture;
use crate::finish::{Denoiser, Estimate, Quality};
use crate::image::errors;
use crate::peers::{Drivers, Peer, Rendering, Reply, Task};
use crate::render::{Method, RenderInput, Session, Settings, TimeSpent};
use crate::scene::Scene;

/// The smallest time budget of a peer's renders, as a share of the time of the runs; the other budgets are its doubles.
const MIN_BUDGET: f64 = 1.0 / 16.0;
/// Iterations of path tracing for albedo and normal, the denoiser's guides.
const GUIDE_ITERATIONS: u64 = 32;

/// Facts about a peer, another renderer, and its renders.
#[derive(Clone, Debug, Default)]
pub struct PeerSummary {
    /// Version of the renderer.
    pub version: String,
    /// Wall-clock seconds of startup, one value for each render.
    pub startups: Vec<f64>,
    /// Features of the scene that the renderer approximates, in words.
    pub approximations: Vec<String>,
    /// Number of renders that ended before every pixel had a sample.
    pub unfinished: usize,
    /// Why the peer is left out from the start or since an error; `None` if it renders.
    pub left_out: Option<String>,
}

/// Denoiser for the pictures of other renderers, with its guides.
pub struct PeerDenoiser {
    /// The denoiser: Open Image Denoise.
    pub denoiser: Denoiser,
    /// Albedo of the scene, the denoiser's first guide.
    pub albedo: Option<Picture>,
    /// Normals of the scene, the denoiser's second guide.
    pub normal: Option<Picture>,
}

impl PeerDenoiser {
    /// Renders the guides, albedo and normal, by our own path tracing. They are the same for all peers, and their time
    /// does not count.
    ///
    /// # Errors
    /// None beyond lack of memory.
    pub fn new(denoiser: Denoiser, scene: &Scene, camera: &Camera, seed: u64) -> Result<PeerDenoiser> {
        let settings = Settings { method: Method::Path, seed, ..Settings::default() };
        let stage = RenderInput::new(scene, camera, &settings);
        let mut session = Session::new(&stage);
        (0..GUIDE_ITERATIONS).for_each(|_| {
            session.step();
        });
        let set = session.layers(|name| ["albedo", "normal"].contains(&name))?;
        let [albedo, normal] = ["albedo", "normal"].map(|name| set.picture(name));
        Ok(PeerDenoiser { denoiser, albedo, normal })
    }

    /// Denoises a picture of another renderer; returns it with the time taken.
    fn run(&mut self, picture: &Picture) -> Result<(Picture, TimeSpent)> {
        let mut estimate = Estimate {
            mean: picture.clone(),
            deviation: Picture::filled(picture.size(), [0.0; 3]),
            albedo: self.albedo.clone(),
            normal: self.normal.clone(),
            clean_guides: false,
            alpha: None,
            samples: None,
        };
        let mut spent = TimeSpent::default();
        let denoised = spent.measure(|| {
            self.denoiser.clean_guides(&mut estimate, None)?;
            self.denoiser.run(&estimate, Quality::High, None)
        })?;
        Ok((denoised, spent))
    }
}

/// The programs that run other renderers, or the reason why none runs.
pub enum Driver {
    /// Driver programs that can render.
    Ready(Drivers),
    /// The reason, in words, why no peer can render the comparison.
    Refused(String),
}

/// The peers, other renderers, of a comparison, and how they render.
pub struct PeerRenders {
    /// The peers, each a renderer in one of its modes.
    pub peers: Vec<Peer>,
    /// The programs that run the peers.
    pub driver: Driver,
    /// Denoiser of the peers' pictures; `None` unless denoised pictures are compared as well.
    pub denoiser: Option<PeerDenoiser>,
    /// Time budget of the peers' longest renders in seconds.
    pub time: f64,
    /// Returns true to stop; called while a peer renders.
    pub stop: Box<dyn Fn() -> bool>,
}

/// One render to be made by a peer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeerTurn {
    /// Index of the peer.
    pub peer: usize,
    /// Time budget for rendering in seconds.
    pub budget: f64,
}

/// Result of one render by a peer.
pub enum PeerResult {
    /// Measurements of the picture and of the denoised picture, each with its picture; the caller sets their `line` and
    /// `picture`.
    Points(Vec<(Point, Picture)>),
    /// The render gave no picture that can be measured.
    Nothing,
    /// The user has stopped the render.
    Stopped,
}

impl PeerRenders {
    /// The renders of the peers with one seed, in order of their time budgets.
    pub fn turns(&self) -> Vec<PeerTurn> {
        let doublings = (1.0 / MIN_BUDGET).log2().round() as i32;
        let budgets = (0..=doublings).map(|i| self.time * MIN_BUDGET * f64::from(i).exp2());
        budgets.flat_map(|budget| (0..self.peers.len()).map(move |peer| PeerTurn { peer, budget })).collect()
    }

    /// Renders one picture with a peer and measures its error. A failure leaves the peer out from then on, with the
    /// reason in `summary`.
    pub fn render(
        &mut self,
        turn: PeerTurn,
        seed: u64,
        reference: &Reference,
        summary: &mut PeerSummary,
    ) -> PeerResult {
        let task = Task { budget: turn.budget, seed };
        let reply = match &self.driver {
            Driver::Refused(why) => {
                summary.left_out = Some(why.clone());
                return PeerResult::Nothing;
            }
            Driver::Ready(drivers) => drivers.render(&self.peers[turn.peer], task, &*self.stop),
        };
        match reply {
            Ok(Reply::Rendered(rendering)) => self.measure(*rendering, seed, reference, summary),
            Ok(Reply::Unsupported(why)) => {
                summary.left_out = Some(format!("cannot render the scene: {}", why.join("; ")));
                PeerResult::Nothing
            }
            Ok(Reply::Stopped) => PeerResult::Stopped,
            Err(error) => {
                summary.left_out = Some(error.to_string());
                PeerResult::Nothing
            }
        }
    }

    fn measure(
        &mut self,
        rendering: Rendering,
        seed: u64,
        reference: &Reference,
        summary: &mut PeerSummary,
    ) -> PeerResult {
        let Rendering { picture, seconds, core_seconds, startup_seconds, passes, version, approximations } = rendering;
        summary.version = version;
        summary.approximations = approximations;
        summary.startups.push(startup_seconds);
        if passes < 1.0 {
            summary.unfinished += 1;
            return PeerResult::Nothing;
        }
        let point = |picture: &Picture, denoised: Option<TimeSpent>| {
            let more = denoised.unwrap_or_default();
            Some(Point {
                line: 0,
                seed,
                iterations: passes as u64,
                light_paths: 0,
                seconds: seconds + more.seconds,
                cpu_seconds: core_seconds + more.cpu_seconds,
                finish_seconds: denoised.map(|spent| spent.seconds),
                errors: errors(picture, &reference.picture)?,
                estimate: None,
                picture: None,
            })
        };
        let mut made = Vec::new();
        made.extend(point(&picture, None).map(|point| (point, picture.clone())));
        if let Some(denoiser) = &mut self.denoiser {
            match denoiser.run(&picture) {
                Ok((denoised, spent)) => made.extend(point(&denoised, Some(spent)).map(|point| (point, denoised))),
                Err(error) => summary.left_out = Some(error.to_string()),
            }
        }
        PeerResult::Points(made)
    }
}
