//! The layers that a render has, and those that are wanted.

use crate::error::Result;
use crate::estimator::PixelAccumulator;
use crate::film::cryptomatte::{Cryptomatte, PixelRanks, RANKS};
use crate::film::output::{self, Shape};
use crate::film::{
    self, CAUSTIC, COMBINED, CRYPTOMATTES, LIGHT_GROUP, Layer, LayerSet, Naming, Plane, Sample, Selection, describe,
    finished_part, part_names,
};
use crate::image::exr::Attributes;
use crate::render::Rendered;
use crate::scene::Scene;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Names of the layers of one kind of cryptomatte.
fn cryptomatte_layers(kind: &str) -> impl Iterator<Item = String> {
    (0..RANKS / 2).map(move |index| format!("{kind}{index:02}"))
}

/// Names of the layers that a render of this shape can have, finished or not.
fn names(shape: &Shape, finished: bool) -> Vec<String> {
    let mut names = output::names(shape);
    if finished {
        names.extend(names.iter().filter_map(|name| finished_part(name)).collect::<Vec<_>>());
    }
    names.extend(CRYPTOMATTES.into_iter().flat_map(cryptomatte_layers));
    names
}

/// Channels that a render of this shape can have.
pub fn channels(shape: &Shape) -> usize {
    names(shape, true).iter().filter_map(|name| describe(name)).map(|layer| layer.components.len()).sum()
}

/// The layers asked for (`all`, `beauty`, or names separated by commas), checked against what this render will have.
///
/// # Errors
/// There is no such layer.
pub fn selection(asked: &str, shape: &Shape, finished: bool) -> Result<Selection> {
    let selection = Selection::parse(asked)?;
    let all = names(shape, finished).into_iter().chain(dark(&selection, shape, finished));
    let layers = all.map(|name| Layer { name, planes: vec![] }).collect();
    selection.apply(LayerSet { width: 0, height: 0, layers })?;
    Ok(selection)
}

/// Parts of the light that are asked for by name and that this render has none of: their layers are black.
pub fn dark(selection: &Selection, shape: &Shape, finished: bool) -> Vec<String> {
    let Selection::List(asked) = selection else { return Vec::new() };
    let there = names(shape, finished);
    let mut dark: Vec<String> = part_names().map(String::from).collect();
    if finished {
        dark.extend(part_names().filter_map(finished_part));
    }
    dark.retain(|name| asked.contains(name) && !there.contains(name));
    dark
}

/// Adds them to a picture.
pub(super) fn add_dark(selection: &Selection, shape: &Shape, finished: bool, set: &mut LayerSet) -> Result<()> {
    let black = vec![[0.0; 3]; set.width * set.height];
    dark(selection, shape, finished)
        .into_iter()
        .try_for_each(|name| set.push(Layer::interleaved(name, "RGB", black.iter().copied())))
}

/// Checks that a file can hold the names of the layers that are wanted of a render of this shape.
///
/// # Errors
/// The first channel whose name other programs do not read.
pub fn check_names(selection: &Selection, shape: &Shape, finished: bool, naming: Naming) -> Result<()> {
    let plane = |c: char| Plane { component: c.into(), sample: Sample::Float, values: vec![] };
    let layer = |name: String| {
        let components = describe(&name).map_or("", |layer| layer.components);
        Layer { planes: components.chars().map(plane).collect(), name }
    };
    let wanted = names(shape, finished).into_iter().filter(|name| selection.wants(name));
    film::check_names(&LayerSet { width: 0, height: 0, layers: wanted.map(layer).collect() }, naming)
}

/// Groups of lights that are asked for by the names of their layers.
pub fn groups_named(asked: &str) -> Vec<String> {
    let group = |name: &str| {
        let name = name.trim();
        let name = name.strip_prefix(COMBINED).unwrap_or(name);
        [LIGHT_GROUP, CAUSTIC].iter().find_map(|prefix| name.strip_prefix(prefix)).map(String::from)
    };
    asked.split(',').filter_map(group).collect()
}

/// Names of objects and materials, and whose each instance is.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Named {
    pub objects: Vec<String>,
    pub materials: Vec<String>,
    /// Object and material of each instance.
    pub instances: Vec<[u32; 2]>,
}

impl Named {
    /// Those of a scene.
    pub fn of(scene: &Scene) -> Named {
        Named {
            objects: scene.objects.clone(),
            materials: scene.materials.list.iter().map(|material| material.name.clone()).collect(),
            instances: scene.shapes.instances.iter().map(|instance| [instance.object, instance.material]).collect(),
        }
    }
}

/// Adds the cryptomattes of objects and materials that are asked for; returns their attributes.
pub(super) fn cryptomattes(
    named: &Named,
    rendered: &Rendered,
    selection: &Selection,
    naming: Naming,
    set: &mut LayerSet,
) -> Result<Attributes> {
    let mut attributes = Attributes::default();
    let lists = [&named.objects, &named.materials];
    for (which, (kind, names)) in CRYPTOMATTES.into_iter().zip(lists).enumerate() {
        if !cryptomatte_layers(kind).any(|name| selection.wants(&name)) {
            continue;
        }
        let mattes = Cryptomatte::new(kind, names.iter().cloned());
        let ranks = |pixel: &PixelAccumulator| {
            let mut ranks = PixelRanks::default();
            for (instance, fraction) in pixel.coverage.fractions() {
                let of = named.instances.get(instance as usize).map(|of| of[which] as usize);
                if let Some(id) = of.and_then(|of| mattes.ids().get(of)) {
                    ranks.add(*id, fraction);
                }
            }
            ranks
        };
        let ranks: Vec<PixelRanks> = rendered.pixels.par_iter().map(ranks).collect();
        for layer in mattes.layers(&ranks, 1.0) {
            set.push(layer)?;
        }
        attributes.texts.extend(mattes.attributes(naming));
    }
    Ok(attributes)
}
