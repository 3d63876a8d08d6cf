//! The interface through which a render reports its progress and learns that the user wants to stop.

use crate::choose::Choice;
use crate::error::{Error, Result};
use crate::film::LayerSet;
use crate::image::exr;
use crate::plan::Plan;
use crate::render::{Progress, Rendered, Settings};
use crate::scene::Scene;
use crate::stop::Stop;

/// A part of a render that may take long and does not report its progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Reading the scene's files and building the scene.
    Reading,
    /// Comparing candidates (methods with settings) for `auto`.
    Choosing,
    /// Making the layers and finishing the picture.
    Finishing,
}

/// An event of a render. The variants stand in the order in which they occur.
pub enum Event<'a> {
    /// A long part of the render begins.
    PhaseBegins(Phase),
    /// The current long part of the render has ended.
    PhaseEnds,
    /// The method is settled. Holds the choice of `auto` if it has compared candidates.
    Chosen(Option<&'a Choice>),
    /// The denoiser and the network of the finish have been opened.
    FinishOpened {
        /// Why the preferred denoiser is missing, if the built-in one takes its place; `None` otherwise.
        missing: Option<&'a Error>,
    },
    /// The first iteration is about to begin.
    Begins {
        /// The effects that the render simulates, and its warnings.
        plan: &'a Plan,
        /// The final settings of the render.
        settings: &'a Settings,
    },
    /// The render continues from a checkpoint with this number of iterations.
    Resumed(u64),
    /// An iteration has ended.
    Progress(&'a Progress),
    /// The picture so far, see [`Observer::wants_preview`].
    Preview {
        /// The beauty layer alone (radiance), or why it could not be made.
        picture: Result<LayerSet>,
        /// Position of the rendered window within the whole picture.
        frame: &'a exr::Frame,
    },
    /// A checkpoint could not be saved; the render continues.
    SaveFailed(&'a Error),
    /// A warning about the iterations, which have ended: motion blur shows few moments, or the time limit has cut paths.
    Warning(&'a str),
    /// The scene could not be built at another moment of the shutter interval, which ends the render; the iterations so
    /// far make the picture.
    MomentFailed(&'a Error),
    /// The last iteration has ended. The pixel sums are still available.
    Rendered(&'a Rendered),
    /// The finish is about to begin. A file with these layers can be finished later if the process is killed meanwhile.
    Estimated {
        /// The unfinished layers, with all that a finish reads.
        set: &'a LayerSet,
        /// Attributes of the EXR file, its JSON header included.
        attributes: &'a exr::Attributes,
    },
}

/// Receives the events of a render: the command line or a host program.
pub trait Observer {
    /// Receives the scene when it has been read and built.
    ///
    /// # Errors
    /// The observer rejects the scene, which ends the render before any work that could be lost.
    fn accept(&mut self, scene: &Scene) -> Result<()> {
        let _ = scene;
        Ok(())
    }

    /// Receives an event of the render.
    fn event(&mut self, event: Event<'_>);

    /// The flag by which the user stops the render, also within an iteration.
    fn stop(&self) -> Stop;

    /// Whether nobody wants the picture any more when the iterations have ended, so that it is not delivered.
    fn abandons(&self) -> bool {
        false
    }

    /// Whether to send an [`Event::Preview`] after the current iteration.
    fn wants_preview(&mut self) -> bool {
        false
    }
}

/// Runs `work` and tells the observer when the phase begins and ends.
pub(super) fn during<T>(phase: Phase, observer: &mut dyn Observer, work: impl FnOnce(&mut dyn Observer) -> T) -> T {
    observer.event(Event::PhaseBegins(phase));
    let done = work(observer);
    observer.event(Event::PhaseEnds);
    done
}
