//! A way to render, of those that auto chooses from.

use super::method::Method;
use crate::transport::Indirect;
use serde::{Deserialize, Serialize};

/// A way to render.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Candidate {
    /// How light is found.
    pub method: Method,
    /// What photons bring, where they are gathered.
    pub indirect: Indirect,
    /// Light paths are guided.
    pub guided: bool,
}

impl Candidate {
    /// What is taken unless another is clearly better, and where a render is too short to try anything: no light is
    /// left to a technique that finds it badly.
    pub const DEFAULT: Candidate = Candidate::unguided(Method::Vcm);
    /// What is taken where glass or mirrors focus light: the same with guided light paths, which cost a twentieth where
    /// others would have found the glass, and without which it is hardly found where it is small.
    pub const GUIDED: Candidate = Candidate { guided: true, ..Candidate::DEFAULT };
    /// What is taken where the usual does not find all light that is focused.
    pub const GUIDED_GATHERING: Candidate = Candidate { guided: true, ..Candidate::GATHERING };
    /// By which effects are weighed and options checked: it has bandwidth levels, and photons of every class.
    pub const GATHERING: Candidate = Candidate::unguided(Method::Sppm);

    /// A method with light paths as they come.
    pub const fn unguided(method: Method) -> Candidate {
        Candidate { method, indirect: Indirect::Photons, guided: false }
    }

    /// A way in words.
    pub fn name(self) -> String {
        let what = match self.indirect {
            Indirect::Photons => "",
            Indirect::Paths => " for caustics, path tracing for the rest",
        };
        format!("{}{what}{}", self.method.name(), if self.guided { ", guided" } else { "" })
    }
}
