//! Candidates that `auto` chooses from.

use super::counts::Counts;
use super::method::Method;
use crate::transport::Indirect;
use serde::{Deserialize, Serialize};

/// A candidate: a method with settings, one of those that `auto` compares to choose how to render a scene.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// Algorithm that finds the light, such as path tracing.
    pub method: Method,
    /// Light that gathered photons carry: all indirect light, or caustics alone.
    pub indirect: Indirect,
    /// Whether light paths start preferably toward objects that focus light.
    pub guided: bool,
    /// Numbers of samples of the techniques of `bdpt` and `vcm`. Checkpoints of before have the default ones.
    #[serde(default)]
    pub counts: Counts,
}

impl Candidate {
    /// The candidate of renders that are too short for a pilot. It combines all techniques, so that it samples no light
    /// badly.
    pub const DEFAULT: Candidate = Candidate::unguided(Method::Vcm);
    /// The candidate of renders that are too short for a pilot where glass or mirrors focus light. Guided light paths find small glass objects
    /// that unguided ones hardly hit. Guiding costs about 5 % where unguided paths would find the glass as well.
    pub const GUIDED: Candidate = Candidate { guided: true, ..Candidate::DEFAULT };
    /// The candidate that `auto` takes where [`Candidate::DEFAULT`] does not find all focused light.
    pub const GUIDED_GATHERING: Candidate = Candidate { guided: true, ..Candidate::GATHERING };
    /// Photon gathering with bandwidth levels and photons of every class of light. Its settings serve to measure the
    /// effects of a scene and to check the user's options before `auto` chooses a candidate.
    pub const GATHERING: Candidate = Candidate::unguided(Method::Sppm);

    /// Path tracing, which alone renders shadow catchers and shadow linking.
    pub const CAMERA_PATHS: Candidate = Candidate::unguided(Method::Path);

    /// The candidate with this method, unguided light paths, and photons that carry all indirect light.
    pub const fn unguided(method: Method) -> Candidate {
        Candidate { method, indirect: Indirect::Photons, guided: false, counts: Counts::DEFAULT }
    }

    /// The candidate of `vcm` with these numbers of samples.
    pub const fn with_counts(counts: Counts, guided: bool) -> Candidate {
        Candidate { counts, guided, ..Candidate::DEFAULT }
    }

    /// The method that renders the candidate: another one if some techniques have no samples.
    pub fn rendered_by(self) -> Method {
        self.method.with_counts(&self.counts)
    }

    /// Name of the candidate for messages, such as `sppm, guided`.
    pub fn name(self) -> String {
        let method = self.rendered_by();
        let indirect = match self.indirect {
            Indirect::Photons => "",
            Indirect::Paths => " for caustics, path tracing for the rest",
        };
        let counts = Counts { merging: if method.has_bandwidths() { self.counts.merging } else { 1.0 }, ..self.counts };
        let counts = if method.takes_counts() { counts.describe() } else { String::new() };
        let with = if counts.is_empty() { "" } else { " with " };
        format!("{}{with}{counts}{indirect}{}", method.name(), if self.guided { ", guided" } else { "" })
    }
}
