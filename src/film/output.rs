//! From the pixels of a render to its layers.
//!
//! - After fewer than two iterations no variance is known. `Variance` then holds the square of the mean and `Error` the
//!   mean itself: a finite error of 100 %.
//! - `Error` is the estimated standard error of `Noisy`. The finish replaces it by the error of the finished picture.
//! - `A` is the fraction of camera paths that hit a surface or scatter in a medium within a mesh. It is 1 if an
//!   environment light is visible, which makes the background part of the picture.
//! - `Volume` exists only if media scatter, `VolumeRadius` if photons are gathered in media.
//! - `CausticRadius` exists only if photons of caustics and other photons are gathered.
//! - `depth` is the mean over the camera paths that have a first rough hit, and 1e10 if none has; `albedo` and `normal`
//!   are zero then.

use super::kind::{CAUSTIC, LIGHT_GROUP, LOBE_COLORS, LOBE_LAYERS, SQUARED_BIAS, kind_of};
use super::layers::{Layer, LayerSet, Plane, Sample};
use crate::error::Result;
use crate::estimator::{BandwidthState, FAR, Parts, PixelAccumulator, QUARTERS, SquaredError, variance_ratio};
use crate::math::{DVec3, Vec3};
use crate::path_class::{ClassSet, Part};
use crate::photon::{ByKind, Kind};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Depth of pixels that see only the background, in scene units.
pub const BACKGROUND: f32 = FAR;
/// Number of pixels whose layers are all computed in turn while the pixels are in the cache.
const BLOCK: usize = 2048;

/// The properties of a render, beside its pixels, that determine which layers it has and how they are computed.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Shape {
    /// Number of bandwidth levels, which a render estimates at the same time.
    pub levels: usize,
    /// Number of bandwidth levels that the bias of level `own` is estimated from ([`SquaredError::of`]).
    pub compared: usize,
    /// Index, from 0, of the bandwidth level that is the method's own image.
    pub own: usize,
    /// Whether photons are merged with one bandwidth, so that the inner part of its photons shows the bias.
    pub merges: bool,
    /// Whether photons of each kind have bandwidths; merged light paths count as the first kind.
    pub kinds: ByKind<bool>,
    /// Whether an environment light is visible.
    pub environment: bool,
    /// Classes of light paths, such as caustics, that are simulated: a part without any has no layer.
    pub classes: ClassSet,
    /// Whether the scene's media scatter light.
    pub volume: bool,
    /// Whether photons are gathered in media.
    pub volume_photons: bool,
    /// Whether the light is recorded by the lobe of the first hit.
    pub lobes: bool,
    /// Names of the light groups that have layers.
    pub groups: Vec<String>,
    /// Indices of the instances that are shadow catchers. The sums of pixels for light groups then have one more entry:
    /// the light on catchers with and without the shadows of other objects.
    pub catchers: Vec<u32>,
}

/// The state of one pixel from which a layer's values are computed.
struct PixelInput<'a> {
    pixel: &'a PixelAccumulator,
    /// Index of the pixel, row by row from the top.
    index: usize,
    bandwidths: &'a BandwidthState,
    /// Factor that corrects the pixel's sample variances: the variance by quarters of the iterations over the sample
    /// variance.
    ratio: f64,
}

/// Computes the values of one layer at one pixel; components that the layer lacks are ignored.
type Get = Box<dyn Fn(&PixelInput<'_>) -> [f32; 4] + Sync>;

/// Returns one of the additive parts of the picture, such as the caustics, at a pixel.
type PartGetter = fn(&Parts) -> DVec3;

/// A layer to be written, with the function that computes it.
struct Column {
    name: String,
    components: &'static str,
    get: Get,
}

impl Column {
    /// A layer with the components that the [table](super::kind) gives it.
    fn new(name: impl Into<String>, get: impl Fn(&PixelInput<'_>) -> [f32; 4] + Sync + 'static) -> Column {
        let name = name.into();
        let components = kind_of(&name).map_or("", |(kind, _)| kind.components);
        Column { name, components, get: Box::new(get) }
    }

    fn rgb(name: impl Into<String>, get: impl Fn(&PixelAccumulator) -> DVec3 + Sync + 'static) -> Column {
        Column::new(name, move |at| padded(get(at.pixel).as_vec3()))
    }

    /// A layer of variances or standard errors, as RGB; values are clamped to finite ones.
    fn noise(name: impl Into<String>, get: impl Fn(&PixelInput<'_>) -> DVec3 + Sync + 'static) -> Column {
        // Squares of 1e20 and more overflow f32; a large known variance must not become infinity, which means unknown.
        let most = DVec3::splat(f64::from(f32::MAX));
        Column::new(name, move |at| padded(get(at).min(most).as_vec3()))
    }

    fn xyz(name: &str, get: impl Fn(&PixelAccumulator) -> Vec3 + Sync + 'static) -> Column {
        Column::new(name, move |at| padded(get(at.pixel)))
    }

    fn one(name: impl Into<String>, get: impl Fn(&PixelInput<'_>) -> f32 + Sync + 'static) -> Column {
        Column::new(name, move |at| [get(at), 0.0, 0.0, 0.0])
    }
}

fn padded(v: Vec3) -> [f32; 4] {
    v.extend(0.0).to_array()
}

/// The mean `sum / count`, zero when nothing was counted.
fn mean(sum: DVec3, count: u32) -> DVec3 {
    if count == 0 { DVec3::ZERO } else { sum / f64::from(count) }
}

/// Names of the layers with bandwidths, for the kinds of photons that have bandwidths: `Radius` for the first of them,
/// whichever it is.
// Inlined into its caller's loops it took minutes to compile.
#[inline(never)]
pub fn radius_layers(kinds: ByKind<bool>) -> Vec<(Kind, &'static str)> {
    let present = Kind::ALL.into_iter().filter(|kind| kinds[*kind as usize]);
    present.zip(["Radius", "CausticRadius"]).collect()
}

/// Alpha of a pixel without a visible environment: the fraction of camera paths that hit a surface. On shadow catchers it
/// is the share of light that other objects take away; `groups` is the index of the sums of that light.
fn covered(pixel: &PixelAccumulator, catchers: &[u32], groups: usize) -> f32 {
    let hit = pixel.coverage.hit_fraction();
    if catchers.is_empty() {
        return hit;
    }
    let on = pixel.coverage.fractions().filter(|(instance, _)| catchers.contains(instance));
    let caught: f32 = on.map(|(_, fraction)| fraction).sum();
    let [lit, unshadowed] = pixel.group(groups).map(|light| light.element_sum());
    let left = if unshadowed > 0.0 { (lit / unshadowed).clamp(0.0, 1.0) } else { 1.0 };
    (hit - caught * left as f32).max(0.0)
}

/// All layers of a render of this shape, except the cryptomattes.
fn columns(shape: &Shape) -> Vec<Column> {
    let Shape { levels, compared, own, kinds, environment, volume_photons, .. } = *shape;
    let (catchers, groups) = (shape.catchers.clone(), shape.groups.len());
    let mut columns = vec![
        Column::new("", move |at| {
            let alpha = if environment {
                1.0 - at.pixel.coverage.hole_fraction()
            } else {
                covered(at.pixel, &catchers, groups)
            };
            at.pixel.mean(own).as_vec3().extend(alpha).to_array()
        }),
        Column::rgb("Noisy", move |p| p.mean(own)),
    ];
    for level in 0..levels {
        columns.push(Column::rgb(format!("Level{}", level + 1), move |p| p.mean(level)));
    }
    for level in 0..levels {
        columns.push(Column::noise(format!("Variance{}", level + 1), move |at| variance(at.pixel, level) * at.ratio));
    }
    for (kind, name) in radius_layers(kinds) {
        for level in 0..levels {
            let radius = move |at: &PixelInput<'_>| at.bandwidths.bandwidth2(at.index, at.pixel, kind, level).sqrt();
            columns.push(Column::one(format!("{name}{}", level + 1), radius));
        }
    }
    for level in (0..levels).filter(|_| volume_photons) {
        let radius = move |at: &PixelInput<'_>| at.bandwidths.volume_bandwidth(at.pixel, level);
        columns.push(Column::one(format!("VolumeRadius{}", level + 1), radius));
    }
    for quarter in 0..QUARTERS {
        columns.push(Column::rgb(format!("Quarter{}", quarter + 1), move |p| p.quarter(quarter)));
    }
    if shape.merges {
        let bias = move |p: &PixelAccumulator| SquaredError::of(p, own, compared).map(|error| error.squared_bias);
        columns.push(Column::noise(SQUARED_BIAS, move |at| bias(at.pixel).unwrap_or_default()));
    }
    columns.extend(part_columns(shape));
    columns.extend([
        Column::noise("Error", move |at| match SquaredError::of(at.pixel, own, compared) {
            Some(error) => SquaredError { variance: error.variance * at.ratio, ..error }.root(),
            None => at.pixel.mean(own).abs(),
        }),
        Column::rgb("albedo", PixelAccumulator::albedo),
        Column::xyz("normal", |p| p.normal().as_vec3()),
        Column::one("depth", |at| at.pixel.depth().map_or(BACKGROUND, |depth| depth as f32)),
        Column::one("Z", |at| at.pixel.first().0),
        Column::xyz("P", |p| p.first().1),
        Column::one("Rejected", |at| at.pixel.rejected.total() as f32),
    ]);
    columns
}

/// The layers of the additive parts of the picture, and of the light of light groups.
fn part_columns(shape: &Shape) -> Vec<Column> {
    let (classes, volume) = (shape.classes, shape.volume);
    let mut columns = Vec::new();
    let parts: [(Part, &str, PartGetter); 5] = [
        (Part::Direct, "Direct", |parts| parts.direct),
        (Part::Indirect, "Indirect", |parts| parts.indirect),
        (Part::Caustic, "Caustic", |parts| parts.caustic),
        (Part::Emission, "Emission", |parts| parts.emission),
        (Part::Volume, "Volume", |parts| parts.volume),
    ];
    let present = |part: Part| classes.has_part(part) && (part != Part::Volume || volume);
    for (part, name, get) in parts {
        if present(part) {
            columns.push(Column::rgb(name, move |p| mean(get(&p.parts()), p.iterations)));
        }
    }
    for (group, name) in shape.groups.iter().enumerate() {
        columns.push(Column::rgb(format!("{LIGHT_GROUP}{name}"), move |p| p.group(group)[0]));
        if present(Part::Caustic) {
            columns.push(Column::rgb(format!("{CAUSTIC}{name}"), move |p| p.group(group)[1]));
        }
    }
    if shape.lobes {
        let light = |(layer, name): (_, &'static str)| Column::rgb(name, move |p| p.lobe_light(layer));
        columns.extend(LOBE_LAYERS.map(light));
        let color = |(lobe, name)| Column::rgb(name, move |p: &PixelAccumulator| p.lobe_colors()[lobe]);
        columns.extend(LOBE_COLORS.into_iter().enumerate().map(color));
    }
    columns
}

/// Variance of the mean radiance of a bandwidth level at a pixel; after fewer than two iterations the square of the
/// mean.
fn variance(pixel: &PixelAccumulator, level: usize) -> DVec3 {
    if pixel.iterations < 2 { pixel.mean(level) * pixel.mean(level) } else { pixel.variance_of_mean(level) }
}

/// Names of all layers that [`layers`] can compute for a render of this shape.
pub fn names(shape: &Shape) -> Vec<String> {
    columns(shape).into_iter().map(|column| column.name).collect()
}

/// Computes the layers whose names `wanted` accepts, from the sums of pixels row by row from the top.
///
/// # Errors
/// The number of pixels is not `width * height`.
pub fn layers(
    (width, height): (u32, u32),
    pixels: &[PixelAccumulator],
    bandwidths: &BandwidthState,
    shape: &Shape,
    wanted: impl Fn(&str) -> bool,
) -> Result<LayerSet> {
    let mut columns = columns(shape);
    columns.retain(|column| wanted(&column.name));
    let channels = columns.iter().map(|column| column.components.len()).sum();
    let mut values = vec![vec![0f32; pixels.len()]; channels];
    let noisy = columns.iter().any(|column| column.name.starts_with("Variance") || column.name == "Error");
    let ratios = if noisy { variance_ratio(pixels, width as usize, shape.own) } else { Vec::new() };
    // Each pixel is read once for all layers: pixels are large, and one pass per layer would take seconds.
    let mut blocks: Vec<Vec<&mut [f32]>> = Vec::new();
    blocks.resize_with(pixels.len().div_ceil(BLOCK), || Vec::with_capacity(channels));
    for plane in &mut values {
        for (block, part) in blocks.iter_mut().zip(plane.chunks_mut(BLOCK)) {
            block.push(part);
        }
    }
    blocks.par_iter_mut().zip(pixels.par_chunks(BLOCK)).enumerate().for_each(|(block, (planes, pixels))| {
        let at = |(i, pixel)| {
            let index = block * BLOCK + i;
            PixelInput { pixel, index, bandwidths, ratio: ratios.get(index).copied().map_or(1.0, f64::from) }
        };
        let mut planes = planes.as_mut_slice();
        for column in &columns {
            let (own, others) = std::mem::take(&mut planes).split_at_mut(column.components.len());
            for (i, at) in pixels.iter().enumerate().map(at).enumerate() {
                for (plane, value) in own.iter_mut().zip((column.get)(&at)) {
                    plane[i] = value;
                }
            }
            planes = others;
        }
    });
    let iterations = pixels.iter().map(|pixel| u64::from(pixel.iterations)).max();
    let mut set = LayerSet { iterations, ..LayerSet::new(width as usize, height as usize) };
    let mut values = values.into_iter();
    for column in columns {
        let components = column.components.chars().zip(values.by_ref());
        let planes =
            components.map(|(c, values)| Plane { component: c.into(), sample: Sample::Float, values }).collect();
        set.push(Layer { name: column.name, planes })?;
    }
    Ok(set)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::Schedule;
    use crate::math::Rgb;
    use crate::transport::{Features, FirstHit, PixelSample};

    fn shape() -> Shape {
        Shape {
            levels: 5,
            compared: 5,
            own: 3,
            merges: false,
            kinds: [true; 2],
            environment: false,
            classes: ClassSet::ALL,
            volume: true,
            volume_photons: true,
            lobes: true,
            groups: vec!["key".into()],
            catchers: Vec::new(),
        }
    }

    /// A camera path with the light `x` in every part; level `k` of the photons has `x + k`.
    fn measure(x: f32, hit: bool) -> PixelSample {
        let photons = std::array::from_fn(|k| Rgb::splat(x + k as f32));
        PixelSample {
            emission: Rgb::splat(x),
            direct: Rgb::new(x, 2.0 * x, 3.0 * x),
            indirect: Rgb::splat(0.5 * x),
            caustic_photons: photons,
            indirect_photons: photons,
            volume: Rgb::splat(0.3 * x),
            volume_photons: photons.map(|light| light * 0.7),
            merge_difference: Rgb::splat(0.1 * x),
            features: if hit {
                Features { albedo: Rgb::splat(0.5), normal: Vec3::Y, depth: 4.0, share: 1.0 }
            } else {
                Features::default()
            },
            rejection: None,
            first: hit.then_some(FirstHit { p: Vec3::X, instance: 3 }),
        }
    }

    /// Bandwidths of the memoryless rule after nine iterations.
    fn bandwidths() -> BandwidthState {
        BandwidthState::memoryless(Schedule::new(9, 5, 0.5, 0.5))
    }

    fn value(set: &LayerSet, layer: &str, component: &str) -> f32 {
        set.get(layer).and_then(|l| l.plane(component)).expect("the layer is there").values[0]
    }

    #[test]
    fn every_layer_is_in_the_table() {
        for column in columns(&shape()) {
            assert!(!column.components.is_empty(), "{} has no row in src/film/kind.rs", column.name);
        }
    }

    #[test]
    fn the_parts_sum_to_the_image_and_radii_halve_their_squares() {
        let mut pixel = PixelAccumulator::new(5, 0, [2.0, 4.0]).with_groups(1);
        pixel.volume_bandwidth = 3.0;
        for i in 0..5 {
            let x = 0.1 + 0.37 * i as f32;
            pixel.add(i + 1, &measure(x, true), Some(&measure(1.1 * x, i != 0)));
        }
        let set = layers((1, 1), std::slice::from_ref(&pixel), &bandwidths(), &shape(), |_| true).expect("one pixel");
        for c in ["R", "G", "B"] {
            let parts = ["Direct", "Indirect", "Caustic", "Emission", "Volume"];
            let sum: f32 = parts.iter().map(|part| value(&set, part, c)).sum();
            assert!((sum / value(&set, "Noisy", c) - 1.0).abs() < 1e-6);
            assert_eq!(value(&set, "Noisy", c), value(&set, "Level4", c));
            assert_eq!(value(&set, "Noisy", c), value(&set, "", c));
        }
        // The product of the memoryless rule after 8 steps, then 1/sqrt(2) a level, in media 1/cbrt(2).
        let product: f32 = (1..9).map(|k| (k as f32 + 0.5) / (k as f32 + 1.0)).product();
        let (surface, volume) = (product.sqrt(), product.cbrt());
        for (name, expected) in [
            ("Radius5", 2.0 * surface),
            ("Radius4", 2.0 * surface * 0.5f32.sqrt()),
            ("Radius1", 2.0 * surface * 0.25),
            ("CausticRadius5", 4.0 * surface),
            ("CausticRadius1", surface),
            ("VolumeRadius5", 3.0 * volume),
            ("VolumeRadius4", 3.0 * volume / 2f32.cbrt()),
            ("VolumeRadius2", 1.5 * volume),
        ] {
            assert!((value(&set, name, "X") - expected).abs() < 1e-6, "{name}");
        }
        let focused = Shape { kinds: [false, true], ..shape() };
        let alone = layers((1, 1), std::slice::from_ref(&pixel), &bandwidths(), &focused, |_| true).expect("one pixel");
        assert!((value(&alone, "Radius5", "X") - 4.0 * surface).abs() < 1e-6 && alone.get("CausticRadius5").is_none());
        // One of ten camera paths missed: it counts for alpha and albedo, not for depth.
        assert_eq!(value(&set, "", "A"), 0.9);
        assert!((value(&set, "albedo", "R") - 0.45).abs() < 1e-6);
        assert_eq!((value(&set, "depth", "Z"), value(&set, "normal", "Y")), (4.0, 1.0));
        let clear = Shape { volume: false, volume_photons: false, ..shape() };
        assert_eq!(names(&clear).len() + 6, names(&shape()).len());
        assert_eq!(names(&shape()), set.layers.iter().map(|l| l.name.clone()).collect::<Vec<_>>());
    }

    /// The square of a finite f32 may overflow.
    #[test]
    fn the_variance_of_a_large_radiance_is_finite() {
        let mut pixel = PixelAccumulator::new(5, 0, [1.0; 2]).with_groups(1);
        for pass in 1..=4 {
            let light = Rgb::splat(if pass % 2 == 0 { 1e20 } else { 3e20 });
            let measure = PixelSample { direct: light, ..PixelSample::default() };
            pixel.add(pass, &measure, Some(&measure));
        }
        let set = layers((1, 1), std::slice::from_ref(&pixel), &bandwidths(), &shape(), |_| true).expect("one pixel");
        assert_eq!(value(&set, "Variance2", "R"), f32::MAX);
        // Four squared deviations of (1e20)^2, over 3 for the variance and over 4 for that of the mean.
        assert!((value(&set, "Error", "R") / (1e20 / 3f32.sqrt()) - 1.0).abs() < 1e-3);
    }

    #[test]
    fn one_iteration_has_an_error_of_its_own_size_and_background_is_far() {
        let mut pixel = PixelAccumulator::new(5, 0, [1.0; 2]).with_groups(1);
        pixel.add(1, &measure(0.5, false), Some(&measure(0.5, false)));
        let set = layers((1, 1), std::slice::from_ref(&pixel), &bandwidths(), &shape(), |_| true).expect("one pixel");
        let mean = value(&set, "Level2", "R");
        assert!((value(&set, "Variance2", "R") / (mean * mean) - 1.0).abs() < 1e-6);
        assert_eq!(value(&set, "Error", "G"), value(&set, "Noisy", "G"));
        assert_eq!((value(&set, "depth", "Z"), value(&set, "Z", "Z")), (BACKGROUND, BACKGROUND));
        assert_eq!(value(&set, "", "A"), 0.0);
        let lit = Shape { environment: true, ..shape() };
        let set = layers((1, 1), &[pixel], &bandwidths(), &lit, |name| name.is_empty()).expect("one pixel");
        assert_eq!((value(&set, "", "A"), set.layers.len()), (1.0, 1));
    }
}
