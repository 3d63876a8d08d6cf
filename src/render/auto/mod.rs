//! Choosing how to render: a short pilot tries every candidate on a small picture of the same view, and takes the one that is expected to come
//! closest within what the render may cost.
//!
//! The cost of an iteration is counted, never timed: mean numbers of vertices ([`crate::transport::Lengths`]) times constants (`super::cost`). So the
//! same arguments give the same choice on any machine and any number of threads. What a candidate is expected to reach comes from its own variances:
//! noise falls as 1/n where paths are whole, and as n^-alpha where photons are gathered; the squared bias there as the area n^-(1 - alpha) to an
//! exponent that levels tell (`bias`) \[Knaus and Zwicker 2011\]. Light that connections hardly ever find is told by merging (`missing`).
//!
//! Where photons are gathered the pilot also balances: noise that bandwidths can smooth against the bias they bring, and light paths against eye paths
//! ([`Balance`]).

mod balance;
mod bias;
mod contest;
mod missing;
mod pilot;
mod room;
mod tail;
mod trial;
mod weights;

pub use balance::Balance;
pub use trial::Trial;
pub use weights::Weight;

use super::control::{Clock, cpu_seconds};
use super::cost::Cost;
use super::method::Method;
use super::session::{Session, Spent, Stage};
use super::settings::Settings;
use crate::camera::Camera;
use crate::scene::Scene;
use crate::transport::Indirect;
use pilot::Pilot;
use weights::Weighed;

/// Squared errors whose ratio is nearer to one cannot be told apart by a pilot.
const APART: f64 = 0.75;
/// Why merging was taken before connections.
const PREFERRED: &str = "connections are expected to leave little less, and miss light that merging finds";

/// A way to render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Way {
    /// How light is found.
    pub method: Method,
    /// What photons bring, where they are gathered.
    pub indirect: Indirect,
    /// Light paths are guided.
    pub guided: bool,
}

impl Way {
    /// What is done where a render is too short to try anything: stochastic progressive photon mapping, which finds all light.
    pub const UNTRIED: Way = Way { method: Method::Sppm, indirect: Indirect::Photons, guided: false };

    /// A way in words.
    pub fn name(self) -> String {
        let what = match self.indirect {
            Indirect::Photons => "",
            Indirect::Paths => " for caustics, path tracing for the rest",
        };
        format!("{}{what}{}", self.method.name(), if self.guided { ", guided" } else { "" })
    }
}

/// Settings that the user leaves to the choice.
#[derive(Clone, Copy, Debug)]
pub struct Free {
    /// Light paths of an iteration.
    pub photons: bool,
    /// Neighbours that set bandwidths.
    pub neighbours: bool,
}

/// What was chosen.
pub struct Choice {
    /// Settings of the render.
    pub settings: Settings,
    /// The way.
    pub way: Way,
    /// All that were tried; none where the render is too short.
    pub trials: Vec<Trial>,
    /// Index of the one chosen.
    pub chosen: Option<usize>,
    /// What effects of light mean to the picture; none where the render is too short.
    pub weights: Vec<Weight>,
    /// Why nothing was tried, or why another way was taken than that of the least expected error.
    pub because: Option<&'static str>,
    /// Time that it took.
    pub spent: Spent,
}

impl Choice {
    /// The trial of what was chosen.
    pub fn trial(&self) -> Option<&Trial> {
        self.chosen.map(|chosen| &self.trials[chosen])
    }
}

/// The trial that is to be taken: the one of the least expected error. Connections have to be better than merging by more than a pilot can tell: it has every way
/// to find light that they have and one more, and light that they find too rarely for a pilot to see only ever makes them worse.
fn best(expected: &[(Method, f64)]) -> Option<usize> {
    let least = (0..expected.len()).min_by(|&a, &b| expected[a].1.total_cmp(&expected[b].1))?;
    let merging = expected.iter().position(|(method, _)| *method == Method::Vcm);
    let connects = matches!(expected[least].0, Method::Path | Method::Bdpt);
    let alike = |&merging: &usize| connects && expected[least].1 > APART * expected[merging].1;
    merging.filter(alike).or(Some(least))
}

/// Tries the candidates and takes the best. `make` gives the settings of a way, `None` where other wishes rule it out. Once `stop` holds, what is tried ends as soon
/// as it can, and the choice is worth nothing.
pub fn choose(
    (scene, camera): (&Scene, &Camera),
    free: Free,
    make: impl Fn(Way) -> Option<Settings>,
    stop: impl Fn() -> bool,
) -> Option<Choice> {
    let (clock, cpu_start) = (Clock::start(), cpu_seconds());
    let untried = make(Way::UNTRIED)?;
    let pilot = Pilot::new(scene, camera, &untried);
    let (weighed, weighing) = pilot.weigh();
    let (trials, because) = pilot.try_all(weighing, free, &make, &stop);
    let expected: Vec<(Method, f64)> = trials.iter().map(|trial| (trial.way.method, trial.expected)).collect();
    let best = best(&expected);
    let preferred = best.is_some_and(|best| expected.iter().any(|other| other.1 < expected[best].1));
    let because = preferred.then_some(PREFERRED).or(because);
    let way = best.map_or(Way::UNTRIED, |best| trials[best].way);
    let mut settings = make(way)?;
    if let Some(best) = best {
        trials[best].balance.apply(&mut settings);
    }
    let cost = best.map_or(pilot.cost, |best| trials[best].cost);
    let saving = |weighed: Weighed| weighed.saving([&cost, &pilot.cost], way, &settings, pilot.pixels);
    let weights = weighed.into_iter().map(saving).collect();
    let spent = Spent { seconds: clock.seconds(), cpu_seconds: cpu_seconds() - cpu_start };
    settings.decided = spent;
    Some(Choice { settings, way, trials, chosen: best, weights, because, spent })
}

/// Core-seconds that an iteration is taken to cost, by counted work.
pub fn counted_cost(scene: &Scene, camera: &Camera, way: Way, settings: &Settings) -> f64 {
    let (width, height) = camera.size();
    let stage = Stage::new(scene, camera, settings);
    let session = Session::new(&stage);
    Cost::count(scene, camera, settings, session.guide()).of(way, settings, f64::from(width) * f64::from(height))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Connections that are expected to leave a tenth less than merging give way to it, those that leave half as much do not, nor does what gathers photons.
    #[test]
    fn connections_have_to_be_clearly_better_than_merging() {
        let of = |first: Method, expected: f64| best(&[(first, expected), (Method::Vcm, 1.0), (Method::Sppm, 3.0)]);
        assert_eq!(of(Method::Bdpt, 0.9), Some(1));
        assert_eq!(of(Method::Path, 0.9), Some(1));
        assert_eq!(of(Method::Bdpt, 0.5), Some(0));
        assert_eq!(of(Method::Cppm, 0.9), Some(0));
        assert_eq!(of(Method::Bdpt, 1.1), Some(1));
        assert_eq!(best(&[(Method::Bdpt, 0.9), (Method::Path, 0.95)]), Some(0));
        assert_eq!(best(&[]), None);
    }
}
