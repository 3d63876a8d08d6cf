//! Candidates that `auto` chooses from.

use super::method::Method;
use crate::transport::Indirect;
use serde::{Deserialize, Serialize};

/// A method with the settings that `auto` compares.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Candidate {
    /// Algorithm that finds the light.
    pub method: Method,
    /// Light that gathered photons carry.
    pub indirect: Indirect,
    /// Whether starts of light paths are guided.
    pub guided: bool,
}

impl Candidate {
    /// The choice unless another candidate is clearly better, and for renders that are too short for pilots. It combines
    /// all techniques, so that it samples no light badly.
    pub const DEFAULT: Candidate = Candidate::unguided(Method::Vcm);
    /// The choice where glass or mirrors focus light. Guided light paths find small glass objects that unguided ones
    /// hardly hit. Guiding costs about 5 % where unguided paths would find the glass as well.
    pub const GUIDED: Candidate = Candidate { guided: true, ..Candidate::DEFAULT };
    /// The choice where [`Candidate::DEFAULT`] does not find all focused light.
    pub const GUIDED_GATHERING: Candidate = Candidate { guided: true, ..Candidate::GATHERING };
    /// Photon gathering with bandwidth levels and photons of every class. Effects are measured and options checked with
    /// its settings before a candidate is chosen.
    pub const GATHERING: Candidate = Candidate::unguided(Method::Sppm);

    /// A method with unguided light paths, whose photons carry all indirect light.
    pub const fn unguided(method: Method) -> Candidate {
        Candidate { method, indirect: Indirect::Photons, guided: false }
    }

    /// Name for messages.
    pub fn name(self) -> String {
        let indirect = match self.indirect {
            Indirect::Photons => "",
            Indirect::Paths => " for caustics, path tracing for the rest",
        };
        format!("{}{indirect}{}", self.method.name(), if self.guided { ", guided" } else { "" })
    }
}
