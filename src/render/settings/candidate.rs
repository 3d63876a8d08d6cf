//! Candidates that `auto` chooses from.

use super::method::Method;
use crate::transport::Indirect;
use serde::{Deserialize, Serialize};

/// A candidate: a method with settings, one of those that `auto` compares to choose how to render a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Candidate {
    /// Algorithm that finds the light, such as path tracing.
    pub method: Method,
    /// Light that gathered photons carry: all indirect light, or caustics alone.
    pub indirect: Indirect,
    /// Whether light paths start preferably toward objects that focus light.
    pub guided: bool,
}

impl Candidate {
    /// The candidate that `auto` takes unless another one is clearly better, and for renders that are too short for
    /// pilots. It combines all techniques, so that it samples no light badly.
    pub const DEFAULT: Candidate = Candidate::unguided(Method::Vcm);
    /// The candidate that `auto` takes where glass or mirrors focus light. Guided light paths find small glass objects
    /// that unguided ones hardly hit. Guiding costs about 5 % where unguided paths would find the glass as well.
    pub const GUIDED: Candidate = Candidate { guided: true, ..Candidate::DEFAULT };
    /// The candidate that `auto` takes where [`Candidate::DEFAULT`] does not find all focused light.
    pub const GUIDED_GATHERING: Candidate = Candidate { guided: true, ..Candidate::GATHERING };
    /// Photon gathering with bandwidth levels and photons of every class of light. Its settings serve to measure the
    /// effects of a scene and to check the user's options before `auto` chooses a candidate.
    pub const GATHERING: Candidate = Candidate::unguided(Method::Sppm);

    /// The candidate with this method, unguided light paths, and photons that carry all indirect light.
    pub const fn unguided(method: Method) -> Candidate {
        Candidate { method, indirect: Indirect::Photons, guided: false }
    }

    /// Name of the candidate for messages, such as `sppm, guided`.
    pub fn name(self) -> String {
        let indirect = match self.indirect {
            Indirect::Photons => "",
            Indirect::Paths => " for caustics, path tracing for the rest",
        };
        format!("{}{indirect}{}", self.method.name(), if self.guided { ", guided" } else { "" })
    }
}
