//! Other renderers in a race: renders of their own at growing budgets, for they give no pictures in between.
//!
//! A render takes place when ours have got as far, so that all meet the same machine.

use super::point::Point;
use super::reference::Reference;
use crate::camera::Camera;
use crate::error::Result;
use crate::film::Picture;
use crate::finish::{Denoiser, Estimate, Quality};
use crate::image::errors;
use crate::peers::{Answer, Drivers, Peer, Rendering, Task};
use crate::render::{Method, RenderInput, Session, Settings, TimeSpent};
use crate::scene::Scene;

/// Budgets double from this share of the whole time.
const FIRST: f64 = 1.0 / 16.0;
/// Iterations of path tracing that the denoiser's guides are the mean of.
const GUIDES: u64 = 32;

/// What is known of a peer in the end.
#[derive(Clone, Debug, Default)]
pub struct PeerSummary {
    /// Version of the renderer.
    pub version: String,
    /// Seconds of starting up, of each render.
    pub startups: Vec<f64>,
    /// What of the scene means something else there.
    pub approximations: Vec<String>,
    /// Renders that ended before every pixel had a sample.
    pub unfinished: usize,
    /// Why it does not take part, or stopped to.
    pub out: Option<String>,
}

/// The denoiser of peers' pictures, and its guides.
pub struct PeerDenoiser {
    /// Open Image Denoise.
    pub denoiser: Denoiser,
    /// Albedo.
    pub albedo: Option<Picture>,
    /// Normal.
    pub normal: Option<Picture>,
}

impl PeerDenoiser {
    /// With guides by our own path tracing, the same for all and not counted.
    ///
    /// # Errors
    /// Memory's alone.
    pub fn new(denoiser: Denoiser, scene: &Scene, camera: &Camera, seed: u64) -> Result<PeerDenoiser> {
        let settings = Settings { method: Method::Path, seed, ..Settings::default() };
        let stage = RenderInput::new(scene, camera, &settings);
        let mut session = Session::new(&stage);
        (0..GUIDES).for_each(|_| {
            session.step();
        });
        let set = session.layers(|name| ["albedo", "normal"].contains(&name))?;
        let [albedo, normal] = ["albedo", "normal"].map(|name| set.picture(name));
        Ok(PeerDenoiser { denoiser, albedo, normal })
    }

    /// The denoised picture, and what that took.
    fn run(&mut self, picture: &Picture) -> Result<(Picture, TimeSpent)> {
        let estimate = Estimate {
            mean: picture.clone(),
            deviation: Picture::filled(picture.size(), [0.0; 3]),
            albedo: self.albedo.clone(),
            normal: self.normal.clone(),
            alpha: None,
        };
        let mut spent = TimeSpent::default();
        let denoised = spent.measure(|| self.denoiser.run(&estimate, Quality::High))?;
        Ok((denoised, spent))
    }
}

/// Who drives the peers.
pub enum Driver {
    /// Their drivers.
    By(Drivers),
    /// Nobody, for a reason that holds for all.
    Refused(String),
}

/// The peers of a race.
pub struct PeerRenders {
    /// Who they are.
    pub peers: Vec<Peer>,
    /// Who drives them.
    pub driver: Driver,
    /// What denoises their pictures.
    pub denoising: Option<PeerDenoiser>,
    /// Seconds of the longest renders.
    pub time: f64,
    /// Whether to stop, asked while one of them renders.
    pub stop: Box<dyn Fn() -> bool>,
}

/// A render to come: a peer by number, and its seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeerTurn {
    /// Which peer.
    pub peer: usize,
    /// Seconds of rendering.
    pub budget: f64,
}

/// What came of a turn.
pub enum PeerResult {
    /// Points without their lines and pictures' numbers: of the picture, and of the denoised one.
    Points(Vec<(Point, Picture)>),
    /// Nothing that can be measured.
    Nothing,
    /// It was stopped.
    Stopped,
}

impl PeerRenders {
    /// All turns of a seed, by budget.
    pub fn turns(&self) -> Vec<PeerTurn> {
        let doublings = (1.0 / FIRST).log2().round() as i32;
        let budgets = (0..=doublings).map(|i| self.time * FIRST * f64::from(i).exp2());
        budgets.flat_map(|budget| (0..self.peers.len()).map(move |peer| PeerTurn { peer, budget })).collect()
    }

    /// Makes a render and measures it. What goes wrong ends the peer's part, and `account` says why.
    pub fn take(&mut self, turn: PeerTurn, seed: u64, reference: &Reference, account: &mut PeerSummary) -> PeerResult {
        let task = Task { budget: turn.budget, seed };
        let answer = match &self.driver {
            Driver::Refused(why) => {
                account.out = Some(why.clone());
                return PeerResult::Nothing;
            }
            Driver::By(drivers) => drivers.render(&self.peers[turn.peer], task, &*self.stop),
        };
        match answer {
            Ok(Answer::Rendered(rendering)) => self.measure(*rendering, seed, reference, account),
            Ok(Answer::Cannot(why)) => {
                account.out = Some(format!("cannot say the scene: {}", why.join("; ")));
                PeerResult::Nothing
            }
            Ok(Answer::Stopped) => PeerResult::Stopped,
            Err(error) => {
                account.out = Some(error.to_string());
                PeerResult::Nothing
            }
        }
    }

    fn measure(
        &mut self,
        rendering: Rendering,
        seed: u64,
        reference: &Reference,
        account: &mut PeerSummary,
    ) -> PeerResult {
        let Rendering { picture, seconds, core_seconds, startup_seconds, passes, version, approximations } = rendering;
        account.version = version;
        account.approximations = approximations;
        account.startups.push(startup_seconds);
        if passes < 1.0 {
            account.unfinished += 1;
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
        if let Some(denoising) = &mut self.denoising {
            match denoising.run(&picture) {
                Ok((denoised, spent)) => made.extend(point(&denoised, Some(spent)).map(|point| (point, denoised))),
                Err(error) => account.out = Some(error.to_string()),
            }
        }
        PeerResult::Points(made)
    }
}
