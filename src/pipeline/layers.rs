//! The layers that a render has, and those that are wanted.

use crate::error::Result;
use crate::estimator::Pixel;
use crate::film::cryptomatte::{Cryptomatte, PixelRanks, RANKS};
use crate::film::{Layer, LayerSet, Naming, Selection, describe, output as film};
use crate::finish::finished_part;
use crate::image::exr::Attributes;
use crate::render::output::shape;
use crate::render::{Rendered, Settings};
use crate::scene::Scene;
use crate::scene::Survey;
use rayon::prelude::*;

/// Kinds of cryptomattes.
const CRYPTOMATTES: [&str; 2] = ["CryptoObject", "CryptoMaterial"];

/// Names of the layers of one kind of cryptomatte.
fn cryptomatte_layers(kind: &str) -> impl Iterator<Item = String> {
    (0..RANKS / 2).map(move |index| format!("{kind}{index:02}"))
}

/// Names of the layers that a render with these settings can have, finished or not.
fn names(settings: &Settings, survey: &Survey, finished: bool) -> Vec<String> {
    let mut names = film::names(&shape(settings, survey));
    if finished {
        names.extend(names.iter().filter_map(|name| finished_part(name)).collect::<Vec<_>>());
    }
    names.extend(CRYPTOMATTES.into_iter().flat_map(cryptomatte_layers));
    names
}

/// Channels that a render with these settings can have.
pub fn channels(settings: &Settings, survey: &Survey) -> usize {
    names(settings, survey, true).iter().filter_map(|name| describe(name)).map(|layer| layer.components.len()).sum()
}

/// The layers asked for (`all`, `beauty`, or names separated by commas), checked against what this render will have.
///
/// # Errors
/// There is no such layer.
pub fn selection(asked: &str, settings: &Settings, survey: &Survey, finished: bool) -> Result<Selection> {
    let selection = Selection::parse(asked)?;
    let layers = names(settings, survey, finished).into_iter().map(|name| Layer { name, planes: vec![] }).collect();
    selection.apply(LayerSet { width: 0, height: 0, layers })?;
    Ok(selection)
}

/// Adds the cryptomattes of objects and materials that are asked for; returns their attributes.
pub(super) fn cryptomattes(
    scene: &Scene,
    rendered: &Rendered,
    selection: &Selection,
    naming: Naming,
    set: &mut LayerSet,
) -> Result<Attributes> {
    let mut attributes = Attributes::default();
    let instances = &scene.shapes.instances;
    let materials = scene.materials.list.iter().map(|material| material.name.clone());
    let objects = Cryptomatte::new(CRYPTOMATTES[0], scene.objects.iter().cloned());
    let materials = Cryptomatte::new(CRYPTOMATTES[1], materials);
    let kinds: [(Cryptomatte, &(dyn Fn(u32) -> u32 + Sync)); 2] = [
        (objects, &|instance| instances[instance as usize].object),
        (materials, &|instance| instances[instance as usize].material),
    ];
    for ((mattes, of_instance), kind) in kinds.into_iter().zip(CRYPTOMATTES) {
        if !cryptomatte_layers(kind).any(|name| selection.wants(&name)) {
            continue;
        }
        let ranks = |pixel: &Pixel| {
            let mut ranks = PixelRanks::default();
            for (instance, fraction) in pixel.coverage.fractions() {
                ranks.add(mattes.ids()[of_instance(instance) as usize], fraction);
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
