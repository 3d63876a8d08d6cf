//! Additive parts of the finished picture: which are finished, their denoised pictures, and their names.
//!
//! Each part is denoised and displaced within the bound of the whole picture. Then all parts are scaled by a common factor
//! per pixel so that they sum to the finished picture. A part is never negative, and converges to the limit of its
//! estimate.

use super::bound::Noise;
use super::conserve::bounded;
use super::{Denoiser, Estimate, Finish, Quality};
use crate::error::Result;
use crate::film::{
    CAUSTIC, LIGHT_GROUP, LOBE_COLORS, Layer, LayerSet, Picture, finished_part, kind_of, lobe_names, part_names,
};
use rayon::prelude::*;
use std::array::from_fn;

/// Share of the sum of the denoised parts in the picture `D`; the denoised whole has the rest. The errors of both differ,
/// so their mean has less; parts, which are denoised at the lowest quality, have more than the whole.
const SHARE_OF_PARTS: f32 = 1.0 / 3.0;
/// Largest share of the light by which parts that sum to the picture may differ from it.
const PARTS_ROUNDING: f64 = 1e-5;

/// An additive part of the picture, such as its caustics, before the bound: its estimate and its denoised picture.
pub(super) struct Part {
    /// Estimated light of the part.
    mean: Picture,
    /// Denoised estimate of the part; the estimate itself if it has no noise.
    denoised: Picture,
}

/// A layer's name and its picture.
pub(super) type Named = (String, Picture);
/// A layer's name and its part of the picture.
pub(super) type NamedPart = (String, Part);

/// Names of the additive parts of a layer set that are finished if `wanted` accepts the names of finished parts: all or
/// none, because parts sum to the picture.
pub fn parts_to_finish(set: &LayerSet, wanted: impl Fn(&str) -> bool) -> Vec<String> {
    let names: Vec<String> = part_layers(set).map(|layer| layer.name.clone()).collect();
    let any = names.iter().filter_map(|name| finished_part(name)).any(|name| wanted(&name));
    if any { names } else { Vec::new() }
}

/// The layers of a set that are additive parts of the estimate.
pub(super) fn part_layers(set: &LayerSet) -> impl Iterator<Item = &Layer> {
    set.layers.iter().filter(|layer| finished_part(&layer.name).is_some())
}

/// The colour of the lobe that a layer, finished or not, has the light of.
pub(super) fn color_of<'c>(layer: &str, colors: &'c [Named]) -> Option<&'c Picture> {
    let part = kind_of(layer).map_or(layer, |(kind, _)| kind.name);
    let of_lobe = |color: &str| color.strip_suffix("Color").is_some_and(|lobe| part.starts_with(lobe));
    colors.iter().find(|(color, _)| of_lobe(color)).map(|(_, picture)| picture)
}

/// The layers of a set with the colours of lobes.
pub(super) fn lobe_colors(set: &LayerSet) -> Vec<Named> {
    LOBE_COLORS.iter().filter_map(|name| Some(((*name).to_owned(), set.picture(name)?))).collect()
}

impl Finish {
    /// The additive parts by effect in a layer set, denoised. None for previews, without a denoiser, and if the parts do
    /// not sum to the estimate.
    pub(super) fn effects(&mut self, set: &LayerSet, estimate: &Estimate) -> Result<Vec<NamedPart>> {
        if self.preview || matches!(self.denoiser, Denoiser::None) {
            return Ok(Vec::new());
        }
        let parts: Vec<Named> = part_names().filter_map(|name| Some((name.into(), set.picture(name)?))).collect();
        let rest = rest(&parts, &estimate.mean).map(|value| if value.is_finite() { value.abs() } else { 0.0 });
        if is_light(&rest, &estimate.mean) { Ok(Vec::new()) } else { self.denoise_parts(parts, estimate) }
    }

    /// The finished parts of the picture whose names are wanted, with their layers' names, from effects that are denoised
    /// already and from other parts. Parts that together sum to the picture, or to its caustics, are all finished if one
    /// of them is wanted. `sum` is the estimate that they sum to with the light of parts that are missing; `None` if it
    /// is unknown.
    pub(super) fn parts(
        &mut self,
        (mut effects, parts): (Vec<NamedPart>, Vec<Named>),
        sum: Option<&Picture>,
        colors: &[Named],
        picture: &Picture,
        noise: Noise<'_>,
        wanted: impl Fn(&str) -> bool,
    ) -> Result<Vec<Named>> {
        let (of_groups, parts): (Vec<Named>, _) =
            parts.into_iter().partition(|(name, _)| name.starts_with(LIGHT_GROUP));
        let (of_caustics, mut parts): (Vec<Named>, Vec<_>) =
            parts.into_iter().partition(|(name, _)| name.starts_with(CAUSTIC));
        let mut take = |names: &mut dyn Iterator<Item = &str>| -> Vec<Named> {
            let mut one = |name: &str| Some(parts.swap_remove(parts.iter().position(|(part, _)| part == name)?));
            names.filter_map(&mut one).collect()
        };
        let (other_effects, lobes) = (take(&mut part_names()), take(&mut lobe_names()));
        let named = |name: &str| !name.is_empty() && finished_part(name).is_some_and(|part| wanted(&part));
        let any = |parts: &[Named]| parts.iter().any(|(name, _)| named(name));
        let mut finished = Vec::new();
        if effects.iter().any(|(name, _)| named(name)) || any(&other_effects) || any(&of_caustics) {
            let other_effects = match sum.filter(|_| effects.is_empty()) {
                Some(sum) => with_rest(other_effects, sum),
                None => other_effects,
            };
            effects.extend(self.denoise_parts(other_effects, noise.estimate)?);
            let all_caustics = effects.iter().find(|(name, _)| name == "Caustic").map(|(_, part)| part.mean.clone());
            finished.extend(split_named(effects, picture, noise, &[]));
            let whole = finished.iter().find(|(name, _)| name == "Caustic").map(|(_, whole)| whole.clone());
            if let Some((mean, whole)) = all_caustics.zip(whole).filter(|_| any(&of_caustics)) {
                let caustics = self.denoise_parts(with_rest(of_caustics, &mean), noise.estimate)?;
                finished.extend(split_named(caustics, &whole, noise, &[]));
            }
        }
        if any(&of_groups) {
            let groups = with_rest(of_groups, sum.unwrap_or(&noise.estimate.mean));
            let groups = self.denoise_parts(groups, noise.estimate)?;
            finished.extend(split_named(groups, picture, noise, &[]));
        }
        // They sum to the picture only together. Other renderers have layers with some of these names.
        if lobes.len() == lobe_names().count() && any(&lobes) {
            let lobes = self.denoise_parts(lobes, noise.estimate)?;
            finished.extend(split_named(lobes, picture, noise, colors));
        }
        finished.retain(|(name, _)| named(name));
        Ok(finished.into_iter().filter_map(|(name, part)| Some((finished_part(&name)?, part))).collect())
    }

    /// Denoises additive parts of an estimate with its guides and standard errors.
    fn denoise_parts(&mut self, parts: Vec<Named>, estimate: &Estimate) -> Result<Vec<NamedPart>> {
        let mut of_part = estimate.clone();
        let mut denoise = |(name, mean): Named| {
            of_part.mean = mean;
            // Directly visible lights are noisy at their edges only.
            let denoised = if of_part.mean.is_black() || ["Emission", "Emit"].contains(&&*name) {
                of_part.mean.clone()
            } else {
                // Parts are looked at less closely than the picture.
                self.denoiser.run(&of_part, Quality::Fast, self.stop.as_ref())?
            };
            Ok((name, Part { mean: std::mem::take(&mut of_part.mean), denoised }))
        };
        parts.into_iter().map(&mut denoise).collect()
    }
}

/// The mean, with [`SHARE_OF_PARTS`], of a denoised picture and of the sum of its denoised parts.
pub(super) fn mean_with_parts(whole: &Picture, parts: &[NamedPart]) -> Picture {
    let sum = |index: usize, c: usize| parts.iter().map(|(_, part)| part.denoised[index][c]).sum::<f32>();
    Picture::from_fn(whole.size(), |index| {
        from_fn(|c| whole[index][c] + SHARE_OF_PARTS * (sum(index, c) - whole[index][c]))
    })
}

/// Finishes parts so that they sum to the picture `whole`, whose noise is `noise`. `colors` has the colours of lobes, if
/// the parts are those of lobes.
fn split_named(parts: Vec<NamedPart>, whole: &Picture, noise: Noise<'_>, colors: &[Named]) -> Vec<Named> {
    let (names, parts): (Vec<String>, Vec<Part>) = parts.into_iter().unzip();
    let colors: Vec<Option<&Picture>> = names.iter().map(|name| color_of(name, colors)).collect();
    names.into_iter().zip(split(&parts, whole, noise, &colors)).collect()
}

/// A picture less its parts.
fn rest(parts: &[Named], whole: &Picture) -> Picture {
    let sum = |index: usize, c: usize| parts.iter().map(|(_, part)| part[index][c]).sum::<f32>();
    Picture::from_fn(whole.size(), |index| from_fn(|c| whole[index][c] - sum(index, c)))
}

/// Whether the light in `rest` is more than rounding beside that of the picture `whole`.
fn is_light(rest: &Picture, whole: &Picture) -> bool {
    let sum = |light: &Picture| light.iter().flatten().map(|value| f64::from(*value)).sum::<f64>();
    sum(rest) > PARTS_ROUNDING * sum(whole)
}

/// Parts of `whole`, such as the light of light groups. If there is light in `whole` that none of them has, such as that of
/// lights outside all groups, it comes first, without a name; the last part takes the remainder of rounding.
fn with_rest(mut parts: Vec<Named>, whole: &Picture) -> Vec<Named> {
    let rest = rest(&parts, whole).map(|value| value.max(0.0));
    if is_light(&rest, whole) {
        parts.insert(0, (String::new(), rest));
    }
    parts
}

/// Finishes additive parts of a picture so that they sum to the finished picture `whole`. `noise` belongs to the whole
/// picture.
///
/// Light of the whole picture at a pixel where no part has any, which the denoiser has brought from around, goes to the
/// last part. `colors` has a colour for parts that compositors divide by it; such a part gets no light where its colour is
/// black, and the first part, which must not have a colour then, gets light that none of the others can have.
fn split(parts: &[Part], whole: &Picture, noise: Noise<'_>, colors: &[Option<&Picture>]) -> Vec<Picture> {
    let mut finished: Vec<Picture> = parts.iter().map(|part| bounded(&part.mean, &part.denoised, noise).0).collect();
    let is_black = |part: usize, index: usize, c: usize| {
        let color = colors.get(part).copied().flatten();
        color.is_some_and(|color| color[index][c] <= 0.0 && parts[part].mean[index][c] <= 0.0)
    };
    for (part, values) in finished.iter_mut().enumerate().filter(|(part, _)| matches!(colors.get(*part), Some(Some(_))))
    {
        values.par_iter_mut().enumerate().for_each(|(index, value)| {
            *value = from_fn(|c| if is_black(part, index, c) { 0.0 } else { value[c] });
        });
    }
    let Some((last, others)) = finished.split_last_mut() else { return finished };
    let scale = |index: usize, c: usize, last: &[f32; 3], others: &[Picture]| {
        let sum = f64::from(last[c]) + others.iter().map(|part| f64::from(part[index][c])).sum::<f64>();
        if sum > 0.0 { f64::from(whole[index][c]) / sum } else { 0.0 }
    };
    let scales: Vec<[f64; 3]> =
        (0..whole.len()).into_par_iter().map(|index| from_fn(|c| scale(index, c, &last[index], others))).collect();
    for part in others.iter_mut() {
        part.par_iter_mut().zip(&scales).for_each(|(value, scale)| {
            *value = from_fn(|c| (f64::from(value[c]) * scale[c]) as f32);
        });
    }
    // The last part takes the remainder, so that the sum has no rounding error.
    last.par_iter_mut().enumerate().for_each(|(index, value)| {
        *value = from_fn(|c| {
            let sum = others.iter().map(|part| f64::from(part[index][c])).sum::<f64>();
            (f64::from(whole[index][c]) - sum).max(0.0) as f32
        });
    });
    let final_part = parts.len() - 1;
    if let (Some(Some(_)), Some((first, _))) = (colors.get(final_part), others.split_first_mut()) {
        first.par_iter_mut().zip(&mut **last).enumerate().for_each(|(index, (first, last))| {
            for c in (0..3).filter(|c| is_black(final_part, index, *c)) {
                first[c] += std::mem::take(&mut last[c]);
            }
        });
    }
    finished
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Size;
    use crate::finish::Estimate;
    use crate::random::{Domain, Purpose, Stream};

    /// An estimate with `error` as the standard error of every pixel.
    fn estimate(mean: &Picture, error: f32) -> Estimate {
        let deviation = Picture::filled(mean.size(), [error; 3]);
        Estimate::unguided(mean.clone(), deviation)
    }

    #[test]
    fn parts_sum_to_the_picture_and_are_never_negative() {
        let size = Size { width: 30, height: 20 };
        let plane = |seed: u64| {
            let draw = |index: usize| Stream::new(seed, 0, Domain::Test, index as u64).vertex(0).one(Purpose::Pixel);
            Picture::from_fn(size, |index| [draw(index), if index % 7 == 0 { 0.0 } else { draw(index) }, 0.0])
        };
        let part = |seed| Part { mean: plane(seed), denoised: plane(seed + 10) };
        let parts = [part(1), part(2), Part { mean: Picture::filled(size, [0.0; 3]), denoised: plane(20) }];
        let (whole, spread) = (plane(3), Picture::filled(size, [0.1; 3]));
        let estimate = estimate(&whole, 0.1);
        let noise = Noise::new(&estimate, &spread);
        let finished = split(&parts, &whole, noise, &[]);
        for index in 0..size.pixels() {
            for c in 0..3 {
                let sum: f32 = finished.iter().map(|part| part[index][c]).sum();
                assert!((sum - whole[index][c]).abs() <= 2e-7 * whole[index][c].max(1.0), "{sum}");
                assert!(finished.iter().all(|part| part[index][c] >= 0.0));
            }
        }
        assert!(split(&[], &whole, noise, &[]).is_empty());
    }

    /// With standard errors of zero the finished parts are their estimates.
    #[test]
    fn exact_parts_stay() {
        let size = Size { width: 4, height: 4 };
        let plane = |value: f32| Picture::filled(size, [value; 3]);
        let part = |value: f32| Part { mean: plane(value), denoised: plane(9.0) };
        let whole = plane(0.75);
        let (sure, none) = (estimate(&whole, 0.0), plane(0.0));
        let exact = Noise::new(&sure, &none);
        let finished = split(&[part(0.25), part(0.5)], &whole, exact, &[]);
        assert_eq!(finished, [plane(0.25), plane(0.5)]);
    }

    /// Parts with colours get no light where the colour is black, and all parts still sum to the picture: the others, or
    /// the first one, take the light that the denoiser has brought. Without colours they get some.
    #[test]
    fn parts_of_black_colour_stay_black() {
        let size = Size { width: 30, height: 20 };
        let draw =
            |seed: u64, index: usize| Stream::new(seed, 0, Domain::Test, index as u64).vertex(0).one(Purpose::Pixel);
        // Black in every third pixel, and in one channel of others.
        let dark = |seed: u64, index: usize| [index.is_multiple_of(3), draw(seed + 50, index) < 0.3, false];
        let color =
            |seed: u64| Picture::from_fn(size, |index| dark(seed, index).map(|dark| if dark { 0.0 } else { 0.5 }));
        let part = |seed: u64| Part {
            mean: Picture::from_fn(size, |index| {
                dark(seed, index).map(|dark| if dark { 0.0 } else { draw(seed, index) })
            }),
            denoised: Picture::from_fn(size, |index| [draw(seed + 10, index); 3]),
        };
        let emit = Part { mean: Picture::filled(size, [0.0; 3]), denoised: Picture::filled(size, [0.0; 3]) };
        let parts = [emit, part(1), part(2)];
        let whole = Picture::from_fn(size, |index| [0.2 + draw(30, index); 3]);
        let (spread, estimate) = (Picture::filled(size, [0.5; 3]), estimate(&whole, 0.5));
        let noise = Noise::new(&estimate, &spread);
        let colors = [color(1), color(2)];
        let lit = |finished: &[Picture]| {
            let in_black = |index: usize| {
                (0..2)
                    .flat_map(move |k| (0..3).map(move |c| (k, c)))
                    .any(|(k, c)| colors[k][index][c] == 0.0 && finished[k + 1][index][c] > 0.0)
            };
            (0..size.pixels()).filter(|index| in_black(*index)).count()
        };
        let masked = split(&parts, &whole, noise, &[None, Some(&color(1)), Some(&color(2))]);
        for index in 0..size.pixels() {
            for c in 0..3 {
                let sum: f32 = masked.iter().map(|part| part[index][c]).sum();
                assert!((sum - whole[index][c]).abs() <= 2e-6 * whole[index][c], "{sum}");
            }
        }
        assert_eq!(lit(&masked), 0);
        assert!(lit(&split(&parts, &whole, noise, &[])) > 50);
    }
}
