//! Resolves light linking and shadow linking, which a scene file gives by collections of nodes, to bits of objects.

use super::description::{Description, Linked, Links, PlacedMesh};
use crate::light::{LightLinks, LinkedObjects, Linking, MAX_LINKINGS};
use std::collections::HashSet;

/// Light linking and shadow linking of all objects and lights.
pub(super) struct Resolved {
    /// For each instance, the bits of the linkings that it is part of.
    pub objects: Vec<u64>,
    /// The linkings of each light.
    pub lights: LightLinks,
}

/// The different linkings. The index of a linking plus 1 is its bit ([`Linking`]).
#[derive(Default)]
struct Linkings<'d>(Vec<&'d Linked>);

impl<'d> Linkings<'d> {
    /// The bit of a linking; 0 if the light is linked to all objects, `None` if there are too many different ones.
    fn bit(&mut self, linked: &'d Linked) -> Option<u8> {
        if linked.is_all() {
            return Some(0);
        }
        let known = self.0.iter().position(|known| *known == linked);
        let index = known.or_else(|| {
            (self.0.len() < MAX_LINKINGS).then(|| {
                self.0.push(linked);
                self.0.len() - 1
            })
        })?;
        u8::try_from(index + 1).ok()
    }

    /// The bits of the linkings that an object in these collections has.
    fn bits(&self, collections: &[String]) -> u64 {
        let bits = self.0.iter().enumerate().filter(|(_, linked)| !linked.has(collections));
        bits.fold(u64::MAX, |all, (index, _)| all & !(1 << (index + 1)))
    }
}

/// Resolves the links of a description. Objects from `first_light_sphere` on are spheres made for point lights.
pub(super) fn resolve<'d>(
    description: &'d Description,
    first_light_sphere: u32,
    warnings: &mut Vec<String>,
) -> Resolved {
    let Description { instances, lights, .. } = description;
    let glows = |placed: &PlacedMesh| description.may_glow(placed, first_light_sphere);
    let surfaces = instances.iter().map(|placed| (&placed.name, placed.links.as_deref().filter(|_| glows(placed))));
    let others = lights.iter().filter(|light| !light.is_sphere()).map(|light| (&light.name, light.links.as_deref()));
    let sources = surfaces.chain(others);
    let unlinked = |links: &Links| links.receivers.is_all() && links.blockers.is_all();
    if sources.clone().all(|(_, links)| links.is_none_or(unlinked)) {
        return Resolved { objects: Vec::new(), lights: LightLinks::default() };
    }
    let known: HashSet<&str> = instances
        .iter()
        .flat_map(|placed| placed.links.iter().flat_map(|l| &l.collections))
        .map(|name| &**name)
        .collect();
    let mut linkings = Linkings::default();
    let mut warn = |warning: String| {
        if !warnings.contains(&warning) {
            warnings.push(warning);
        }
    };
    let mut resolve = |name: &String, linked: &'d Linked| {
        for missing in linked.include.iter().chain(&linked.exclude) {
            if !known.contains(&**missing) {
                warn(format!(
                    "light \"{name}\": its linking names the collection \"{missing}\", in which no object is (add \
                     the name to \"collections\" of its objects)"
                ));
            }
        }
        Linking(linkings.bit(linked).unwrap_or_else(|| {
            warn(format!(
                "light \"{name}\": its linking is left out, because there are {MAX_LINKINGS} others (link more \
                 lights to the same collections)"
            ));
            0
        }))
    };
    let of_lights: Vec<LinkedObjects> = sources
        .map(|(name, links)| {
            links.map_or_else(LinkedObjects::default, |Links { receivers, blockers, .. }| LinkedObjects {
                receivers: resolve(name, receivers),
                blockers: resolve(name, blockers),
            })
        })
        .collect();
    let objects =
        instances.iter().map(|placed| linkings.bits(placed.links.as_ref().map_or(&[], |links| &links.collections)));
    let (objects, medium_linkings) = (objects.collect(), linkings.bits(&[]));
    let (surfaces, others) = of_lights.split_at(instances.len());
    let lights = LightLinks { instances: surfaces.to_vec(), others: others.to_vec(), medium_linkings };
    Resolved { objects, lights }
}
