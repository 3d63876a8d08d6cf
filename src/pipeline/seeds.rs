//! The mean of renders that differ only in their seed, weighted by iterations, with its variance and its error. The
//! renders keep their bandwidths, so the mean has the bias of one render.

use super::checkpoint::first_difference;
use super::deliver::FINISHED_PICTURE;
use crate::error::{Error, ErrorKind, Result};
use crate::estimator::QUARTERS;
use crate::film::cryptomatte::{Cryptomatte, Id, PixelRanks, RANKS};
use crate::film::kind::Merge;
use crate::film::{CRYPTOMATTES, Layer, LayerSet, kind_of};
use crate::image::exr::{self, Attributes};
use crate::math::Vec3;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};

/// Options that may differ between renders whose mean is made.
const FREE_OPTIONS: [&str; 9] =
    ["seed", "iterations", "time", "target-error", "layers", "exr-naming", "compression", "scene", "path"];

/// A render whose picture has been added to the mean.
struct Source {
    path: PathBuf,
    header: Value,
    /// Seeds of the renders that it is the mean of: one, unless it was merged itself.
    seeds: Vec<u64>,
    iterations: u64,
}

/// Renders of one picture with different seeds, added up to make their mean.
#[derive(Default)]
pub struct Seeds {
    sources: Vec<Source>,
    sum: Option<(LayerSet, Attributes)>,
    /// For each cryptomatte, the prefix of its layer names and the ranks of its pixels.
    mattes: Vec<(String, Vec<PixelRanks>)>,
}

/// The rule by which the values of the layer `name` are merged.
fn merge_rule(name: &str) -> Merge {
    kind_of(name).map_or(Merge::Mean, |(kind, _)| kind.merge)
}

/// Number of the iterations of a render that the layer `name` is the mean of: all, or those of a quarter, which iterations
/// take in turn.
fn iterations_of(name: &str, iterations: u64) -> f64 {
    let number = || name.strip_prefix("Quarter")?.parse::<u64>().ok();
    let quarters = QUARTERS as u64;
    let all = |number: u64| (iterations + quarters - number.clamp(1, quarters)) / quarters;
    number().map_or(iterations, all) as f64
}

impl Merge {
    /// Adds the layer value of a render with this number of iterations to the sum over the renders before.
    fn add(self, sum: f32, value: f32, iterations: f64) -> f32 {
        let (total, value) = (f64::from(sum), f64::from(value));
        let added = match self {
            Merge::Mean => total + iterations * value,
            Merge::Variance => total + iterations * iterations * value,
            Merge::Error => total + iterations * value * value,
            Merge::Sum => total + value,
            Merge::First | Merge::Matte => total,
        };
        added as f32
    }

    /// The merged layer value from the sum over renders; `iterations`: their total number.
    fn finish(self, sum: f32, iterations: f64) -> f32 {
        let total = f64::from(sum);
        let value = match self {
            Merge::Mean | Merge::Error => total / iterations,
            Merge::Variance => total / (iterations * iterations),
            Merge::Sum | Merge::First | Merge::Matte => total,
        };
        value as f32
    }
}

impl Seeds {
    /// Adds a render to the mean, which keeps the layers that all renders have.
    ///
    /// # Errors
    /// The file is no render, differs from the first in its size or in an option, or has the seed of another render.
    pub fn add(&mut self, path: &Path, mut set: LayerSet, attributes: Attributes) -> Result<()> {
        let source = self.source(path, &set, &attributes)?;
        let iterations = source.iterations;
        self.add_mattes(&set, iterations as f64);
        for layer in &mut set.layers {
            let (rule, iterations) = (merge_rule(&layer.name), iterations_of(&layer.name, iterations));
            let first = self.sum.as_ref().map(|(sum, _)| sum.get(&layer.name));
            for plane in &mut layer.planes {
                let before = match first {
                    None => None,
                    Some(layer) => match layer.and_then(|layer| layer.plane(&plane.component)) {
                        Some(plane) => Some(plane),
                        None => continue,
                    },
                };
                for (index, value) in plane.values.iter_mut().enumerate() {
                    *value = match (before, rule) {
                        (Some(before), _) => rule.add(before.values[index], *value, iterations),
                        (None, Merge::First | Merge::Matte) => *value,
                        (None, _) => rule.add(0.0, *value, iterations),
                    };
                }
            }
        }
        let attributes = match self.sum.take() {
            Some((sum, attributes)) => {
                set.layers.retain(|layer| sum.get(&layer.name).is_some());
                attributes
            }
            None => attributes,
        };
        self.sum = Some((set, attributes));
        self.sources.push(source);
        Ok(())
    }

    fn source(&self, path: &Path, set: &LayerSet, attributes: &Attributes) -> Result<Source> {
        let error = |cause: String| Error::new(ErrorKind::Usage, path.display(), cause);
        let header = attributes.object().filter(|header| header["iterations"].as_u64().is_some_and(|n| n > 0));
        let Some(header) = header else {
            return Err(error("is no render of caustique".into()).hint("merge renders of other seeds, or shards"));
        };
        if let Some(first) = self.sources.first() {
            let name = first.path.display();
            let hash = |header: &Value| header["scene_hash"].as_str().map(str::to_owned);
            if hash(&header).zip(hash(&first.header)).is_some_and(|(own, other)| own != other) {
                let cause = format!("was rendered from other scene files than {name}");
                return Err(error(cause).hint("merge renders of one scene"));
            }
            if let Some((key, there, here)) =
                first_difference(&first.header["arguments"], &header["arguments"], &FREE_OPTIONS)
            {
                let cause = format!("was rendered with another --{key} than {name}: {here} here, {there} there");
                return Err(error(cause).hint("merge renders that differ in their --seed alone"));
            }
        }
        if let Some((sum, _)) = &self.sum
            && (sum.width, sum.height) != (set.width, set.height)
        {
            let cause = format!("is {} x {}, the others {} x {}", set.width, set.height, sum.width, sum.height);
            return Err(error(cause).hint("merge renders of one picture"));
        }
        let seeds = match header["merged"]["seeds"].as_array() {
            Some(seeds) => seeds.iter().map(Value::as_u64).collect(),
            None => header["seed"].as_u64().map(|seed| vec![seed]),
        };
        let Some(seeds) = seeds.filter(|seeds: &Vec<u64>| !seeds.is_empty()) else {
            return Err(
                error("does not say from which seeds it was merged".into()).hint("merge the renders themselves")
            );
        };
        let shared = |other: &Source| seeds.iter().copied().find(|seed| other.seeds.contains(seed));
        if let Some((other, seed)) = self.sources.iter().find_map(|other| Some((other, shared(other)?))) {
            let cause = format!("has the seed {seed} as {} has: the same noise twice", other.path.display());
            return Err(error(cause).hint("render each with another --seed"));
        }
        let iterations = header["iterations"].as_u64().unwrap_or(0);
        Ok(Source { path: path.into(), header, seeds, iterations })
    }

    fn add_mattes(&mut self, set: &LayerSet, iterations: f64) {
        for kind in CRYPTOMATTES {
            let layers: Vec<&Layer> =
                (0..RANKS / 2).filter_map(|index| set.get(&format!("{kind}{index:02}"))).collect();
            if layers.len() < RANKS / 2 {
                continue;
            }
            if !self.mattes.iter().any(|(known, _)| known == kind) {
                self.mattes.push((kind.into(), vec![PixelRanks::default(); set.pixels()]));
            }
            let Some((_, ranks)) = self.mattes.iter_mut().find(|(known, _)| known == kind) else { continue };
            for layer in layers {
                for pair in [["r", "g"], ["b", "a"]] {
                    let [Some(ids), Some(shares)] = pair.map(|component| layer.plane(component)) else { continue };
                    for ((ranks, id), share) in ranks.iter_mut().zip(&ids.values).zip(&shares.values) {
                        if *share > 0.0 {
                            ranks.add(Id(id.to_bits()), share * iterations as f32);
                        }
                    }
                }
            }
        }
    }

    /// The mean of the renders with its header, which describes no finish: the mean has to be finished again.
    ///
    /// # Errors
    /// No render was added, or the header cannot be written.
    pub fn mean(self) -> Result<(LayerSet, Attributes)> {
        let Seeds { sources, sum, mattes } = self;
        let Some((mut set, mut attributes)) = sum else {
            return Err(Error::usage("there is no render"));
        };
        let total: u64 = sources.iter().map(|source| source.iterations).sum();
        set.iterations = Some(total);
        let total_of = |name: &str| sources.iter().map(|source| iterations_of(name, source.iterations)).sum::<f64>();
        set.layers.retain(|layer| total_of(&layer.name) > 0.0);
        for layer in &mut set.layers {
            let (rule, total) = (merge_rule(&layer.name), total_of(&layer.name));
            let values = layer.planes.iter_mut().flat_map(|plane| plane.values.iter_mut());
            values.for_each(|value| *value = rule.finish(*value, total));
            if layer.name == "normal" {
                normalise(layer);
            }
        }
        let own = sources.first().and_then(|source| source.header["levels"].as_u64()).unwrap_or(1).max(2) - 1;
        if !have_finished_errors(&sources) {
            let renders = sources.iter().map(|source| source.seeds.len()).sum();
            set_error_of_mean(&mut set, &format!("Variance{own}"), renders);
        } else if let Some(error) = set.layers.iter_mut().find(|layer| layer.name == "Error") {
            error.planes.iter_mut().flat_map(|plane| &mut plane.values).for_each(|square| *square = square.sqrt());
        }
        for (kind, ranks) in mattes {
            let named = Cryptomatte::new(kind, []);
            for layer in named.layers(&ranks, total as f32) {
                if let Some(own) = set.layers.iter_mut().find(|own| own.name == layer.name) {
                    *own = layer;
                }
            }
        }
        attributes.insert(exr::ATTRIBUTE, &header(&sources, total))?;
        Ok((set, attributes))
    }
}

/// Whether any of the renders states the error of its finished picture.
fn have_finished_errors(sources: &[Source]) -> bool {
    sources.iter().any(|source| source.header["error_of"] == FINISHED_PICTURE)
}

/// Turns the layer `Error` from the mean square of the errors into the error of the mean. The variance falls with the
/// number of renders. The remainder of the mean square is bias, which the renders share.
fn set_error_of_mean(set: &mut LayerSet, variance: &str, renders: usize) {
    let variance = set.get(variance).cloned();
    let Some(error) = set.layers.iter_mut().find(|layer| layer.name == "Error") else { return };
    for plane in &mut error.planes {
        let variance = variance.as_ref().and_then(|layer| layer.plane(&plane.component));
        for (index, value) in plane.values.iter_mut().enumerate() {
            let variance = variance.map_or(*value / renders as f32, |plane| plane.values[index]);
            *value = (variance + (*value - renders as f32 * variance).max(0.0)).sqrt();
        }
    }
}

/// Scales the vectors of a layer to unit length, except zero vectors.
fn normalise(layer: &mut Layer) {
    let [x, y, z] = layer.planes.as_mut_slice() else { return };
    for ((x, y), z) in x.values.iter_mut().zip(&mut y.values).zip(&mut z.values) {
        let unit = Vec3::new(*x, *y, *z).normalize_or_zero();
        [*x, *y, *z] = unit.to_array();
    }
}

/// The header's key `rejected_by`: sums of the rejected samples of all renders, by cause.
fn rejected_by(sources: &[Source]) -> Value {
    let mut all: Map<String, Value> = Map::new();
    for (name, count) in sources.iter().filter_map(|source| source.header["rejected_by"].as_object()).flatten() {
        let sum = all.get(name).and_then(Value::as_u64).unwrap_or(0) + count.as_u64().unwrap_or(0);
        all.insert(name.clone(), sum.into());
    }
    all.into()
}

/// The header's key `unseen`: sums of photon counts, and the smallest error by light that hardly any photon has carried,
/// because it is enough that one render has found the light. `None` if the methods count no photons.
fn unseen(sources: &[Source]) -> Option<Value> {
    let all = || sources.iter().filter_map(|source| source.header.get("unseen"));
    let error = all().filter_map(|unseen| unseen["error"].as_f64()).reduce(f64::min)?;
    let of_kind = |kind: &str| {
        let sum = |key: &str| all().filter_map(|unseen| unseen[kind][key].as_u64()).sum::<u64>();
        json!({"stored": sum("stored"), "gathered": sum("gathered")})
    };
    Some(json!({"indirect": of_kind("indirect"), "caustic": of_kind("caustic"), "error": error}))
}

/// The header of the mean: the header of the first render with sums over all renders.
fn header(sources: &[Source], total: u64) -> Value {
    let mut header: Map<String, Value> =
        sources.first().and_then(|source| source.header.as_object().cloned()).unwrap_or_default();
    let sum = |key: &str| sources.iter().map(|source| source.header[key].as_f64().unwrap_or(0.0)).sum::<f64>();
    // Errors of estimates are independent, so their squares add with squared weights. Errors of finished pictures are
    // correlated by the denoiser, so the bound is the mean of their squares.
    let weight = |source: &Source| {
        let own = source.iterations as f64;
        if have_finished_errors(sources) { own * total as f64 } else { own * own }
    };
    let squares = sources.iter().map(|source| Some(weight(source) * source.header["error"].as_f64()?.powi(2)));
    let error = squares.sum::<Option<f64>>().map(|squares| squares.sqrt() / total as f64);
    for (key, value) in [
        ("iterations", json!(total)),
        ("light_paths", json!(sum("light_paths") as u64)),
        ("rejected", json!(sum("rejected") as u64)),
        ("rejected_by", rejected_by(sources)),
        ("seconds", json!(sum("seconds"))),
        ("seed", Value::Null),
        ("error", json!(error)),
        ("history", json!([])),
        ("combined", Value::Null),
    ] {
        header.insert(key.into(), value);
    }
    // They describe the first render alone.
    ["accuracy", "error_noisy", "worst"].iter().for_each(|key| drop(header.remove(*key)));
    header.extend(unseen(sources).map(|unseen| ("unseen".to_owned(), unseen)));
    let names: Vec<String> = sources.iter().map(|source| source.path.display().to_string()).collect();
    let seeds: Vec<u64> = sources.iter().flat_map(|source| source.seeds.iter().copied()).collect();
    header.insert("merged".into(), json!({"renders": names, "seeds": seeds, "weights": "iterations"}));
    header.into()
}
