//! How a method looks for light, as far as that decides which effects it finds.

use super::class::{ClassSet, PathClass};
use super::effect::Effect;
use crate::scene::{Scene, Survey};

/// Kinds of methods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Search {
    /// Paths from the eye, connected to lights.
    CameraPaths,
    /// Paths from the lights, connected to the eye.
    LightPaths,
    /// Both, connected to each other.
    Connections,
    /// Eye paths that gather the photons of one map, on surfaces.
    Map,
    /// Eye paths that gather photons, on surfaces and in media.
    Photons,
    /// Eye paths connected to lights, that gather photons of caustics.
    PathsAndPhotons,
    /// Both, merged where they meet, on surfaces.
    Merging,
    /// Both, connected and merged.
    ConnectionsAndMerging,
}

/// Who brings the light of a class: one technique, or several whose weights sum to one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Owner {
    /// Eye paths that run into lights.
    Hits,
    /// Connections to lights, and eye paths that run into them; where these come from a sharp lobe by mirrors and clear
    /// glass, photons of caustics as well.
    Lit,
    /// Photons, gathered or merged.
    Photons,
    /// Light paths, connected to the camera.
    LightPaths,
    /// Eye and light paths connected in all ways, and merged where the method merges.
    Connections,
}

impl Search {
    /// The one who brings the light of a class; `None`: nobody does.
    pub fn owner(self, class: PathClass) -> Option<Owner> {
        use PathClass as C;
        Some(match (self, class) {
            // No other technique can find these.
            (_, C::Emission | C::Coat) => Owner::Hits,
            (Search::CameraPaths, _) => Owner::Lit,
            (Search::LightPaths, _) => Owner::LightPaths,
            (Search::Connections | Search::ConnectionsAndMerging, _) => Owner::Connections,
            (Search::Merging, C::Single | C::Volume) | (Search::Map, C::Volume) => return None,
            (Search::Merging, _) => Owner::Photons,
            (_, C::Direct | C::Highlight | C::Reflection | C::ReflectedDirect | C::Single) => Owner::Lit,
            (Search::Map | Search::Photons, _) => Owner::Photons,
            (Search::PathsAndPhotons, C::Indirect | C::ReflectedIndirect) => Owner::Lit,
            (Search::PathsAndPhotons, _) => Owner::Photons,
        })
    }

    /// The classes that someone brings.
    pub fn owned_by(self, owner: Owner) -> ClassSet {
        PathClass::ALL.into_iter().filter(|class| self.owner(*class) == Some(owner)).collect()
    }

    /// Whether it finds all light of an effect. A light without size is hit by no path: without photons it shows no
    /// light behind glass, where it could be neither connected to nor run into.
    pub fn finds(self, effect: Effect, scene: &Survey) -> bool {
        let Survey { delta_lights, scattering, cloudy_glass, .. } = *scene;
        match (self, effect) {
            (Search::CameraPaths, Effect::Caustic | Effect::Sds) => !delta_lights,
            (Search::LightPaths, Effect::Sds) => false,
            (Search::Connections, Effect::Sds) => !delta_lights,
            // Light that comes into clear glass and scatters there once: photons are merged on surfaces alone.
            (Search::ConnectionsAndMerging, Effect::Sds) => !(delta_lights && cloudy_glass),
            (Search::Map | Search::Merging, Effect::Volume) => !scattering,
            // Photons end where they first scatter broadly, eye paths do not scatter in media.
            (Search::PathsAndPhotons, Effect::Volume | Effect::Indirect) => !scattering,
            _ => true,
        }
    }

    /// What brings an effect into the picture.
    pub(super) fn carrier(self, effect: Effect, scene: &Scene) -> &'static str {
        let media_scatter = scene.survey.scattering;
        // Photons of caustics, if there are any, share what sharp lobes show of lamps.
        let shared = scene.survey.glints && !scene.lights.targets().spheres().is_empty();
        let gathers = matches!(self, Search::Map | Search::Photons);
        let walks = matches!(self, Search::CameraPaths | Search::PathsAndPhotons);
        match (effect, self) {
            (Effect::Environment | Effect::Alpha | Effect::Textures | Effect::Dispersion, _) => "all paths",
            (Effect::Volume, _) if !media_scatter => "all paths",
            (_, Search::LightPaths) => "light paths",
            (Effect::Glossy, Search::Photons | Search::PathsAndPhotons) if shared => "eye paths and photons",
            (Effect::Emission | Effect::Glossy | Effect::DepthOfField, _) => "eye paths",
            (Effect::Direct, Search::CameraPaths | Search::PathsAndPhotons | Search::Map | Search::Photons) => {
                "connections to lights"
            }
            (Effect::Caustic | Effect::Sds, Search::ConnectionsAndMerging | Search::PathsAndPhotons) => "photons",
            _ if walks => "eye paths",
            (_, Search::Merging) => "photons",
            _ if gathers => "photons",
            (_, Search::Connections) => "connections",
            _ => "connections and photons",
        }
    }
}
