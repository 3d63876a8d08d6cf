//! The techniques that a method combines, and the effects that they find.

use crate::path_class::{ClassSet, Effect, PathClass};
use crate::scene::{Scene, Survey};

/// Combination of techniques by which a method finds light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Search {
    /// Camera paths, connected to lights.
    CameraPaths,
    /// Light paths, connected to the camera.
    LightPaths,
    /// Camera and light paths, connected to each other.
    Connections,
    /// Camera paths that gather photons of a single map, on surfaces alone.
    Map,
    /// Camera paths that gather photons, on surfaces and in media.
    Photons,
    /// Camera paths, connected to lights, that gather only the photons of caustics.
    PathsAndPhotons,
    /// Camera and light paths, merged where their vertices are near each other on surfaces.
    Merging,
    /// Camera and light paths, connected to each other, and merged at nearby points.
    ConnectionsAndMerging,
}

/// The techniques that carry the light of a path class: one technique, or several whose MIS weights sum to one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Owner {
    /// Camera paths that hit lights by chance.
    Hits,
    /// Next-event estimation, and camera paths that hit lights. If a path reaches the light by way of a sharp lobe and
    /// then mirrors or clear glass, also photons of caustics.
    Lit,
    /// Photons, gathered by or merged with camera paths.
    Photons,
    /// Light paths, connected to the camera.
    LightPaths,
    /// All connections between camera and light paths, and merging if the method merges.
    Connections,
}

impl Search {
    /// The techniques that carry the light of a path class; `None` if the method does not find this light.
    pub fn owner(self, class: PathClass) -> Option<Owner> {
        use PathClass as C;
        Some(match (self, class) {
            // No other technique can find these classes.
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

    /// The path classes whose light the techniques `owner` carry.
    pub fn owned_by(self, owner: Owner) -> ClassSet {
        PathClass::ALL.into_iter().filter(|class| self.owner(*class) == Some(owner)).collect()
    }

    /// Whether the techniques find all light of an effect. No path hits a delta light, and no connection passes through
    /// glass, so only photons find a delta light behind glass.
    pub fn finds(self, effect: Effect, scene: &Survey) -> bool {
        let Survey { delta_lights, scattering, cloudy_glass, .. } = *scene;
        match (self, effect) {
            (Search::CameraPaths, Effect::Caustic | Effect::Sds) => !delta_lights,
            (Search::LightPaths, Effect::Sds) => false,
            (Search::Connections, Effect::Sds) => !delta_lights,
            // Light that enters clear glass and scatters there once is missed: photons are merged on surfaces only.
            (Search::ConnectionsAndMerging, Effect::Sds) => !(delta_lights && cloudy_glass),
            (Search::Map | Search::Merging, Effect::Volume) => !scattering,
            // Photons end where they first scatter broadly, and camera paths do not scatter in media.
            (Search::PathsAndPhotons, Effect::Volume | Effect::Indirect) => !scattering,
            _ => true,
        }
    }

    /// Why the method does not take all of its techniques for an effect, in words for the user; `None` if it does.
    pub(super) fn limit(self, effect: Effect, scene: &Scene) -> Option<&'static str> {
        let merges = self == Search::ConnectionsAndMerging;
        (merges && effect == Effect::Volume && scene.survey.scattering)
            .then_some("nothing merges in media: connections find this light")
    }

    /// The techniques that carry the light of an effect, in words for the user.
    pub(super) fn carrier(self, effect: Effect, scene: &Scene) -> &'static str {
        let media_scatter = scene.survey.scattering;
        // Reflections of lights in sharp lobes are shared with the photons of caustics, if there are any.
        let shared = scene.survey.glints && !scene.lights.targets().spheres().is_empty();
        let gathers = matches!(self, Search::Map | Search::Photons);
        let walks = matches!(self, Search::CameraPaths | Search::PathsAndPhotons);
        match (effect, self) {
            (Effect::Environment | Effect::Alpha | Effect::Textures | Effect::Dispersion, _) => "all paths",
            (Effect::Volume, _) if !media_scatter => "all paths",
            (_, Search::LightPaths) => "light paths",
            (Effect::Glossy, Search::Photons | Search::PathsAndPhotons) if shared => "camera paths and photons",
            (Effect::Emission | Effect::Glossy | Effect::DepthOfField, _) => "camera paths",
            (Effect::Direct, Search::CameraPaths | Search::PathsAndPhotons | Search::Map | Search::Photons) => {
                "connections to lights"
            }
            (Effect::Volume, Search::ConnectionsAndMerging) => "connections",
            (Effect::Caustic | Effect::Sds, Search::ConnectionsAndMerging | Search::PathsAndPhotons) => "photons",
            _ if walks => "camera paths",
            (_, Search::Merging) => "photons",
            _ if gathers => "photons",
            (_, Search::Connections) => "connections",
            _ => "connections and photons",
        }
    }
}
