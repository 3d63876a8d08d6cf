//! A render's options from keyword arguments.

use crate::error::usage;
use crate::keywords::{Keywords, choice};
use caustique::camera::{Filter, WIDEST};
use caustique::error::Error;
use caustique::estimator::InitialBandwidth;
use caustique::estimator::rule::chi_squared::ChiSquaredSettings;
use caustique::finish::{DenoiserChoice, Finish};
use caustique::pipeline::{finish, sized};
use caustique::plan::Switches;
use caustique::render::{DEFAULT_ITERATIONS, Levels, Method, RadiusRule, Settings, Shard, Strategy};
use caustique::scene::{Crop, View};
use caustique::stat::sum::MOST_TERMS;
use caustique::transport::MAX_LEVELS;
use pyo3::prelude::*;
use std::ops::Bound as End;

/// Methods by name; `None` is auto.
const METHODS: [(&str, Option<Method>); 12] = [
    ("auto", None),
    ("path", Some(Method::Path)),
    ("light", Some(Method::Light)),
    ("bdpt", Some(Method::Bdpt)),
    ("pm", Some(Method::Pm)),
    ("ppm", Some(Method::Ppm)),
    ("sppm", Some(Method::Sppm)),
    ("appm", Some(Method::Appm)),
    ("cppm", Some(Method::Cppm)),
    ("bpm", Some(Method::Bpm)),
    ("vcm", Some(Method::Vcm)),
    ("mlt", Some(Method::Mlt)),
];
const DENOISERS: [(&str, DenoiserChoice); 4] = [
    ("auto", DenoiserChoice::Auto),
    ("oidn", DenoiserChoice::Oidn),
    ("own", DenoiserChoice::Own),
    ("none", DenoiserChoice::None),
];
/// Parts that a render may have.
const MOST_SHARDS: u64 = 1_000_000;
/// Lengths that a bandwidth may have (scene units).
const LENGTHS: std::ops::RangeInclusive<f64> = 1e-9..=1e9;

/// How light is found and how the estimate becomes the picture: what may differ from run to run.
pub struct Approach {
    /// `None`: chosen.
    pub method: Option<Method>,
    /// Light paths of an iteration.
    pub photons: Option<u32>,
    levels: Option<usize>,
    alpha: Option<f64>,
    bandwidth: Option<Bandwidth>,
    knn: Option<u32>,
    guide: Option<bool>,
    chi_squared: Option<ChiSquaredSettings>,
    /// How the estimate becomes the picture, if it does.
    pub finish: Option<(DenoiserChoice, Option<String>)>,
}

/// What sets the largest bandwidth to begin with.
#[derive(Clone, Copy, PartialEq)]
enum Bandwidth {
    Neighbours,
    Footprint,
    Length(f32),
}

/// What all runs have in common: seed, ends, and what of the light there is.
#[derive(Clone, Copy, Default)]
pub struct Common {
    /// Seed.
    pub seed: u64,
    /// Longest light path in segments.
    pub max_depth: Option<u32>,
    /// Stop after so many iterations.
    pub iterations: Option<u64>,
    /// Stop after so many seconds.
    pub time: Option<f64>,
    /// Stop at this estimated relative error.
    pub target_error: Option<f64>,
    /// Effects that are switched.
    pub switches: Switches,
    /// Which iterations are rendered; `None`: all.
    pub shard: Option<Shard>,
}

/// A method by name; `None` is auto.
pub fn method(place: &str, name: &str) -> PyResult<Option<Method>> {
    choice(place, name, &METHODS)
}

/// What is asked of a finish.
pub fn finish_order(call: &str, denoise: &str, model: Option<String>) -> PyResult<finish::Order> {
    Ok(finish::Order { denoiser: choice(&format!("{call}: denoise"), denoise, &DENOISERS)?, model })
}

/// The warning that our own denoiser takes the place of one that is missing.
pub fn missing(error: &Error) -> String {
    let hint = error.hint.as_ref().map(|hint| format!("; {hint}")).unwrap_or_default();
    format!("{error}: our own denoiser takes its place, whose pictures are grainier{hint}")
}

impl Approach {
    /// From the keywords `method photons levels alpha initial_bandwidth knn guide finish denoise model` and those of
    /// [`chi_squared`]; `usual` is what method, levels and finish are where they are left out.
    ///
    /// # Errors
    /// An argument is of another type or out of range.
    pub fn take(keywords: &mut Keywords<'_>, usual: &Approach) -> PyResult<Approach> {
        let method = keywords.choice("method", &METHODS)?.unwrap_or(usual.method);
        let finishes = keywords.take::<bool>("finish")?;
        let denoise = keywords.choice("denoise", &DENOISERS)?;
        let model = keywords.take::<String>("model")?;
        if finishes == Some(false) && (denoise.is_some() || model.is_some()) {
            return Err(usage("finish=False leaves nothing to denoise or combine", "leave denoise and model out"));
        }
        let asked = finishes.unwrap_or(denoise.is_some() || model.is_some() || usual.finish.is_some());
        Ok(Approach {
            method,
            photons: keywords.number("photons", 1..=50_000_000, "from 1 to 50000000")?,
            levels: keywords.number("levels", 1..=MAX_LEVELS, "from 1 to 5")?.or(usual.levels),
            alpha: keywords.number("alpha", (End::Excluded(0.0), End::Included(1.0)), "above 0, and 1 at most")?,
            bandwidth: bandwidth(keywords)?,
            knn: keywords.number("knn", 1..=1024, "from 1 to 1024")?,
            guide: keywords.take("guide")?,
            chi_squared: chi_squared(keywords)?,
            finish: asked.then(|| (denoise.unwrap_or_default(), model)),
        })
    }

    /// A render's own: auto, finished.
    pub fn usual() -> Approach {
        Approach { finish: Some((DenoiserChoice::Auto, None)), ..Approach::bare(None) }
    }

    /// A method with one level and no finish, as a comparison takes it.
    pub fn single(method: Option<Method>) -> Approach {
        let levels = method.is_none_or(Method::has_levels).then_some(1);
        Approach { levels, ..Approach::bare(method) }
    }

    fn bare(method: Option<Method>) -> Approach {
        Approach {
            method,
            photons: None,
            levels: None,
            alpha: None,
            bandwidth: None,
            knn: None,
            guide: None,
            chi_squared: None,
            finish: None,
        }
    }

    /// What is asked of the finish.
    pub fn finish_order(&self) -> Option<finish::Order> {
        let (denoiser, model) = self.finish.clone()?;
        Some(finish::Order { denoiser, model })
    }

    /// The finish of auto's pilots.
    pub fn pilot_finish(&self) -> Finish {
        Finish::of_pilots(self.finish.as_ref().map_or(DenoiserChoice::None, |(denoiser, _)| *denoiser))
    }

    fn plus(&self) -> bool {
        self.chi_squared.is_some_and(|rule| rule.plus)
    }

    /// The way that is asked for; with auto the one by which options are checked.
    pub fn way(&self) -> Strategy {
        let method = self.method.unwrap_or(Strategy::GATHERING.method);
        Strategy { guided: self.guide == Some(true), ..Strategy::plain(method) }
    }

    /// Settings of a way that auto may choose, for a picture of a size; `None` where the options rule it out.
    pub fn allowed(&self, common: &Common, way: Strategy, size: (u32, u32)) -> Option<Settings> {
        let guide = self.guide.is_none_or(|on| if on { way.guided || !way.method.guides() } else { !way.guided });
        // A network combines as many levels as it has learnt.
        let combines = self.finish.as_ref().is_some_and(|(_, model)| model.is_some());
        let usual = self.settings(common, self.way()).ok()?.levels;
        let settings = self.settings(common, way).ok().filter(|of| guide && (!combines || of.levels == usual));
        settings.map(|settings| sized(settings, self.photons, size))
    }

    /// Settings of a way.
    ///
    /// # Errors
    /// An option that says nothing to the method.
    pub fn settings(&self, common: &Common, way: Strategy) -> PyResult<Settings> {
        let method = way.method;
        self.check(method)?;
        let count = self.levels.unwrap_or(if method.has_levels() { MAX_LEVELS } else { 1 });
        let combines = self.finish.as_ref().is_some_and(|(_, model)| model.is_some());
        let levels = if combines { Levels::decorrelated(count) } else { Levels::new(count) };
        let usual = Settings::default();
        let shard = common.shard.unwrap_or(usual.shard);
        let limited = common.time.is_some() || common.target_error.is_some();
        let settings = Settings {
            method,
            seed: common.seed,
            photons: self.photons.unwrap_or(method.photons()),
            levels,
            initial: self.initial(method, count),
            alpha: self.alpha.unwrap_or(method.alpha()),
            volume_alpha: self.alpha.unwrap_or(usual.volume_alpha),
            radius_rule: if method == Method::Ppm { RadiusRule::Local } else { RadiusRule::Memoryless },
            max_depth: common.max_depth.unwrap_or(u32::MAX),
            iterations: common.iterations.or((!limited).then_some(DEFAULT_ITERATIONS)),
            time: common.time,
            target_error: common.target_error,
            guided: way.guided,
            indirect: way.indirect,
            classes: common.switches.classes(),
            chi_squared: self.chi_squared.unwrap_or(usual.chi_squared),
            shard,
            ..usual
        };
        check_shard(&settings)?;
        Ok(settings)
    }

    fn initial(&self, method: Method, levels: usize) -> InitialBandwidth {
        let usual = if method.counts_photons() { Bandwidth::Neighbours } else { Bandwidth::Footprint };
        match self.bandwidth.unwrap_or(usual) {
            Bandwidth::Neighbours => {
                InitialBandwidth::Nearest(self.knn.map_or(method.neighbours(levels), |k| k as usize))
            }
            Bandwidth::Footprint => InitialBandwidth::Footprint,
            Bandwidth::Length(r) => InitialBandwidth::Fixed(r),
        }
    }

    /// Errors: an option that says nothing to the method.
    fn check(&self, method: Method) -> PyResult<()> {
        let name = method.name();
        let by_neighbours = self.bandwidth.is_none_or(|given| given == Bandwidth::Neighbours);
        let idle = [
            (self.photons.is_some() && !method.counts_photons(), "photons"),
            (self.levels.is_some_and(|m| m > 1) && !method.has_levels(), "levels"),
            (self.knn.is_some() && !(method.counts_photons() && by_neighbours), "knn"),
            (self.bandwidth.is_some() && !method.has_bandwidths(), "initial_bandwidth"),
            (self.bandwidth == Some(Bandwidth::Neighbours) && !method.counts_photons(), "initial_bandwidth"),
            (
                self.alpha.is_some() && (!method.has_bandwidths() || matches!(method, Method::Appm | Method::Cppm)),
                "alpha",
            ),
            (self.guide == Some(true) && (self.plus() || !method.guides()), "guide"),
        ];
        if let Some((_, option)) = idle.iter().find(|(idle, _)| *idle) {
            let cause = format!("{option} has no effect with method='{name}' and the other arguments");
            return Err(usage(cause, format!("leave {option} out, or choose method='sppm'")));
        }
        if self.chi_squared.is_some() && method != Method::Cppm {
            let cause = format!("the arguments cppm_* have no effect with method='{name}'");
            return Err(usage(cause, "leave them out, or choose method='cppm'"));
        }
        if method == Method::Pm && self.knn == Some(1) {
            return Err(usage("knn must be 2 or more with method='pm'", "the default is 100"));
        }
        Ok(())
    }
}

/// Errors: a shard that has nothing to render, or that would need the others.
fn check_shard(settings: &Settings) -> PyResult<()> {
    let Settings { shard: Shard { index, count }, iterations, .. } = *settings;
    if let Some(n) = iterations.filter(|n| index >= *n) {
        let cause = format!("shard=({index}, {count}) holds none of {n} iterations");
        return Err(usage(cause, "use fewer shards or more iterations"));
    }
    if settings.is_shard() && !settings.is_memoryless() {
        let name = settings.method.name();
        let cause = format!("shard cannot divide method='{name}': its bandwidths depend on all iterations before");
        return Err(usage(cause, "choose method='sppm', or render in one process"));
    }
    Ok(())
}

/// Parameters of the chi-squared rule, from the keywords `cppm_grid cppm_k cppm_beta cppm_significance cppm_plus`;
/// `None` where all are left out.
fn chi_squared(keywords: &mut Keywords<'_>) -> PyResult<Option<ChiSquaredSettings>> {
    let usual = ChiSquaredSettings::default();
    let grid = keywords.take::<(usize, usize)>("cppm_grid")?;
    let between = (End::Excluded(0.0), End::Excluded(1.0));
    let k = keywords.number("cppm_k", between, "between 0 and 1")?;
    let beta = keywords.number("cppm_beta", 1.0..=1000.0, "from 1 to 1000")?;
    let significance = keywords.number("cppm_significance", between, "between 0 and 1")?;
    let plus = keywords.take("cppm_plus")?.unwrap_or(false);
    if let Some((annuli, sectors)) = grid
        && !annuli.checked_mul(sectors).is_some_and(|cells| (2..=64).contains(&cells))
    {
        return Err(usage(format!("cppm_grid=({annuli}, {sectors}) is out of range"), "there are 2 to 64 cells"));
    }
    let (annuli, sectors) = grid.unwrap_or((usual.annuli, usual.sectors));
    let asked = ChiSquaredSettings {
        annuli,
        sectors,
        k: k.unwrap_or(usual.k),
        beta: beta.unwrap_or(usual.beta),
        significance: significance.unwrap_or(usual.significance),
        plus,
    };
    let given = grid.is_some() || k.is_some() || beta.is_some() || significance.is_some() || plus;
    Ok(given.then_some(asked))
}

/// The shard (index, count) of the keyword `shard`.
///
/// # Errors
/// There is no such shard.
pub fn shard(keywords: &mut Keywords<'_>) -> PyResult<Option<Shard>> {
    let Some((index, count)) = keywords.take::<(u64, u64)>("shard")? else { return Ok(None) };
    if index >= count || count > MOST_SHARDS {
        let hint = format!("(index, count), the index below the count, and at most {MOST_SHARDS} shards");
        return Err(usage(format!("shard=({index}, {count}) does not exist"), hint));
    }
    Ok(Some(Shard { index, count }))
}

fn bandwidth(keywords: &mut Keywords<'_>) -> PyResult<Option<Bandwidth>> {
    let Some(given) = keywords.take::<Bound<'_, PyAny>>("initial_bandwidth")? else { return Ok(None) };
    if let Ok(length) = given.extract::<f64>() {
        return match LENGTHS.contains(&length) {
            true => Ok(Some(Bandwidth::Length(length as f32))),
            false => Err(usage(format!("initial_bandwidth={length} is out of range"), "a length is from 1e-9 to 1e9")),
        };
    }
    let all = [("knn", Bandwidth::Neighbours), ("footprint", Bandwidth::Footprint)];
    keywords.choice("initial_bandwidth", &all)
}

impl Common {
    /// From the keywords `seed max_depth iterations time target_error`.
    ///
    /// # Errors
    /// An argument is of another type or out of range.
    pub fn take(keywords: &mut Keywords<'_>, switches: Switches) -> PyResult<Common> {
        Ok(Common {
            seed: keywords.take("seed")?.unwrap_or_default(),
            max_depth: keywords.number("max_depth", 1..=1_000_000, "from 1 to 1000000")?,
            iterations: iterations(keywords, "iterations")?,
            time: seconds(keywords, "time")?,
            target_error: keywords.number("target_error", positive(), "a relative error above 0, such as 0.05")?,
            switches,
            shard: None,
        })
    }
}

/// Numbers above zero.
pub fn positive() -> (End<f64>, End<f64>) {
    (End::Excluded(0.0), End::Included(f64::MAX))
}

/// A number of iterations.
pub fn iterations(keywords: &mut Keywords<'_>, name: &'static str) -> PyResult<Option<u64>> {
    keywords.number(name, 1..=MOST_TERMS, "a whole number above 0")
}

/// A time.
pub fn seconds(keywords: &mut Keywords<'_>, name: &'static str) -> PyResult<Option<f64>> {
    keywords.number(name, positive(), "a number of seconds above 0")
}

/// The picture asked for, from the keywords `width height camera crop filter`.
///
/// # Errors
/// An argument is of another type, a window that is empty, or a filter that there is not.
pub fn view(keywords: &mut Keywords<'_>) -> PyResult<View> {
    let (camera, width, height) = (keywords.take("camera")?, keywords.take("width")?, keywords.take("height")?);
    let crop = match keywords.take::<Bound<'_, PyAny>>("crop")? {
        None => None,
        Some(given) => Some(match given.extract::<[u32; 4]>() {
            Ok(pixels) => Crop::Pixels(pixels),
            Err(_) => shares(&given)?,
        }),
    };
    let filter = keywords.take::<Bound<'_, PyAny>>("filter")?.map(|given| filter(&given)).transpose()?;
    Ok(View { camera, width, height, crop, filter: filter.unwrap_or_default() })
}

/// A pixel filter by its name, or by its name and width in pixels.
fn filter(given: &Bound<'_, PyAny>) -> PyResult<Filter> {
    let (name, width) = match given.extract::<(String, f32)>() {
        Ok((name, width)) => (name, Some(width)),
        Err(_) => (given.extract::<String>()?, None),
    };
    if let Some(width) = width.filter(|width| !(0.1..=WIDEST).contains(width)) {
        return Err(usage(format!("filter: the width {width} is out of range"), format!("0.1 to {WIDEST} pixels")));
    }
    let bell = width.unwrap_or(1.5);
    let all = [
        ("box", Filter::Box(width.unwrap_or(1.0))),
        ("gaussian", Filter::Gaussian(bell)),
        ("blackman-harris", Filter::BlackmanHarris(bell)),
    ];
    choice("filter", &name, &all)
}

fn shares(given: &Bound<'_, PyAny>) -> PyResult<Crop> {
    match given.extract::<[f64; 4]>() {
        Ok(shares) if shares.iter().all(|x| (0.0..=1.0).contains(x)) => Ok(Crop::Shares(shares)),
        _ => Err(usage(
            format!("crop={given} is no window"),
            "(left, top, width, height) in pixels, (320, 0, 640, 720), or in shares, (0.25, 0.0, 0.5, 1.0)",
        )),
    }
}
