//! The layers of a render: which ones it has, whether a selection fits it, and the cryptomattes.

use crate::error::Result;
use crate::estimator::PixelAccumulator;
use crate::film::cryptomatte::{Cryptomatte, PixelRanks, RANKS};
use crate::film::output::{self, Shape};
use crate::film::{
    self, CRYPTOMATTES, Layer, LayerSet, MOTION, Naming, Plane, Sample, Selection, describe, finished_part, is_effect,
    part_names,
};
use crate::finish::{reads, reads_for_error};
use crate::image::exr::Attributes;
use crate::render::Rendered;
use crate::scene::Scene;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Names of the layers of a cryptomatte of this kind: objects or materials.
fn cryptomatte_layers(kind: &str) -> impl Iterator<Item = String> {
    (0..RANKS / 2).map(move |index| format!("{kind}{index:02}"))
}

/// Names of the layers that the EXR of a render of this shape can have. `finished`: including finished parts.
fn names(shape: &Shape, finished: bool) -> Vec<String> {
    let mut names = output::names(shape);
    if finished {
        names.extend(names.iter().filter_map(|name| finished_part(name)).collect::<Vec<_>>());
    }
    names.extend(CRYPTOMATTES.into_iter().flat_map(cryptomatte_layers));
    names
}

/// Numbers of the layers of a picture, from which its memory follows.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LayerCounts {
    /// Number of channels of the layers that are written or that the finish reads.
    pub channels: usize,
    /// Number of channels of the layers from which the error of the finished picture is estimated.
    pub channels_of_error: usize,
    /// Number of additive parts that are finished.
    pub parts: usize,
    /// Whether there are motion vectors.
    pub motion: bool,
}

impl LayerCounts {
    /// The layers of a render of this shape that a selection and the finish, if there is one, take.
    pub fn new(shape: &Shape, selection: &Selection, finishes: bool) -> LayerCounts {
        let all = names(shape, false);
        let wanted = |name: &String| selection.wants(name) || name.is_empty() || (finishes && reads(name));
        let channels = |takes: &dyn Fn(&String) -> bool| {
            let layers = all.iter().filter(|name| takes(name)).filter_map(|name| describe(name));
            layers.map(|layer| layer.components.len()).sum()
        };
        let parts = if finishes { finished_parts(&all, selection) } else { 0 };
        let channels_of_error = channels(&|name| reads_for_error(name));
        LayerCounts { channels: channels(&wanted), channels_of_error, parts, motion: selection.wants(MOTION) }
    }
}

/// Number of additive parts among these layers that the finish denoises: all if it delivers any, else those that it
/// makes the picture of.
pub(super) fn finished_parts(layers: &[String], selection: &Selection) -> usize {
    let finished: Vec<String> = layers.iter().filter_map(|name| finished_part(name)).collect();
    let of_picture = layers.iter().filter(|name| is_effect(name)).count();
    if finished.iter().any(|name| selection.wants(name)) { finished.len() } else { of_picture }
}

/// Checks that a render of this shape has all layers of a selection. `motion`: whether it has motion vectors.
///
/// # Errors
/// The render has no such layer.
pub(super) fn check(selection: &Selection, shape: &Shape, finished: bool, motion: bool) -> Result<()> {
    let all = names(shape, finished).into_iter().chain(black(selection, shape, finished));
    let all = all.chain(motion.then(|| MOTION.into()));
    let layers = all.map(|name| Layer { name, planes: vec![] }).collect();
    selection.apply(LayerSet { layers, ..LayerSet::default() }).map(drop)
}

/// Names of the selected layers of additive parts that a render of this shape has no light for. They are delivered
/// black.
pub(super) fn black(selection: &Selection, shape: &Shape, finished: bool) -> Vec<String> {
    let Selection::List(selected) = selection.chosen() else { return Vec::new() };
    let present = names(shape, finished);
    let mut black: Vec<String> = part_names().map(String::from).collect();
    if finished {
        black.extend(part_names().filter_map(finished_part));
    }
    black.retain(|name| selected.contains(name) && !present.contains(name));
    black
}

/// Adds the selected layers without light to a picture, as black layers.
pub(super) fn add_black(selection: &Selection, shape: &Shape, finished: bool, set: &mut LayerSet) -> Result<()> {
    let pixels = vec![[0.0; 3]; set.width * set.height];
    black(selection, shape, finished)
        .into_iter()
        .try_for_each(|name| set.push(Layer::interleaved(name, "RGB", pixels.iter().copied())))
}

/// Checks that other programs can read the channel names of the selected layers.
///
/// # Errors
/// The first channel whose name other programs do not read.
pub(super) fn check_names(selection: &Selection, shape: &Shape, finished: bool, naming: Naming) -> Result<()> {
    let plane = |c: char| Plane { component: c.into(), sample: Sample::Float, values: vec![] };
    let layer = |name: String| {
        let components = describe(&name).map_or("", |layer| layer.components);
        Layer { planes: components.chars().map(plane).collect(), name }
    };
    let selected = names(shape, finished).into_iter().filter(|name| selection.wants(name));
    film::check_names(&LayerSet { layers: selected.map(layer).collect(), ..LayerSet::default() }, naming)
}

/// Names of a scene's objects and materials, for cryptomattes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct SceneNames {
    pub objects: Vec<String>,
    pub materials: Vec<String>,
    /// Indices of the object and the material of each instance in the scene.
    pub instances: Vec<[u32; 2]>,
    /// Names of the materials that are smooth glass or mirrors, see [`crate::material::Material::is_smooth`].
    pub smooth: Vec<String>,
}

impl SceneNames {
    /// Collects the names of a scene's objects and materials.
    pub fn of(scene: &Scene) -> SceneNames {
        let smooth = scene.materials.list.iter().filter(|material| material.is_smooth());
        SceneNames {
            smooth: smooth.map(|material| material.name.clone()).collect(),
            objects: scene.objects.clone(),
            materials: scene.materials.list.iter().map(|material| material.name.clone()).collect(),
            instances: scene.shapes.instances.iter().map(|instance| [instance.object, instance.material]).collect(),
        }
    }
}

/// Adds the selected cryptomattes of objects and materials to a picture. Returns their EXR attributes.
pub(super) fn add_cryptomattes(
    scene: &SceneNames,
    rendered: &Rendered,
    selection: &Selection,
    naming: Naming,
    set: &mut LayerSet,
) -> Result<Attributes> {
    let mut attributes = Attributes::default();
    let lists = [&scene.objects, &scene.materials];
    for (which, (kind, names)) in CRYPTOMATTES.into_iter().zip(lists).enumerate() {
        if !cryptomatte_layers(kind).any(|name| selection.wants(&name)) {
            continue;
        }
        let mattes = Cryptomatte::new(kind, names.iter().cloned());
        let ranks = |pixel: &PixelAccumulator| {
            let mut ranks = PixelRanks::default();
            for (instance, fraction) in pixel.coverage.fractions() {
                let of = scene.instances.get(instance as usize).map(|of| of[which] as usize);
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
