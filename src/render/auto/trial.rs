//! One candidate tried on a small picture.

use super::bias::{Bias, Differences};
use super::missing::Caustics;
use super::room::Room;
use super::tail::Tail;
use super::{Balance, Free, Way};
use crate::estimator::{InitialBandwidth, Pixel};
use crate::light::Guide;
use crate::math::DVec3;
use crate::photon::MAX_NEIGHBOURS;
use crate::render::cost::Cost;
use crate::render::method::Method;
use crate::render::session::{Session, Stage};
use crate::render::settings::{Levels, Settings, Shard};
use crate::transport::MAX_LEVELS;

/// Light paths of a trial over those of the render, at least and at most. As many neighbours are then found in as many times the area.
pub(super) const PHOTONS: (f64, f64) = (0.125, 1.0);
/// Squared error of what bandwidths rule where they follow the photons' counts, over that where they follow the iteration's number: about what the diffuse box
/// and the box with glass show after ten seconds, and less than the paper says of long renders [CPPM 2020, Table 1].
const COUNTED: f64 = 0.7;
/// Added to a pixel's squared value: relMSE.
pub(super) const DARK: f64 = 0.01;

/// A candidate and how it did.
#[derive(Clone, Copy, Debug)]
pub struct Trial {
    /// The candidate.
    pub way: Way,
    /// Share of caustics in the picture's light.
    pub caustics: f64,
    /// Counted core-seconds of an iteration of the whole picture.
    pub seconds_per_iteration: f64,
    /// The counts behind it.
    pub(super) cost: Cost,
    /// Expected relMSE when the budget is spent.
    pub expected: f64,
    /// What suits it.
    pub balance: Balance,
}

/// Settings of a trial: those of the render with a share of its photons, and all levels, which tell the bias.
pub(super) fn settings(of: &Settings, photons: f64) -> Settings {
    // Bandwidths that follow counts tell neither noise nor bias apart.
    let method = if of.method == Method::Cppm { Method::Sppm } else { of.method };
    // One level alone is what of several is the second largest, of half the area.
    let larger = if of.levels.count == 1 { 2 } else { 1 };
    let initial = match of.initial {
        InitialBandwidth::Nearest(k) => InitialBandwidth::Nearest((larger * k).min(MAX_NEIGHBOURS)),
        other => other,
    };
    let area = larger as f32 / photons as f32;
    Settings {
        method,
        levels: Levels::new(if method.has_levels() { MAX_LEVELS } else { 1 }),
        photons: ((f64::from(of.photons) * photons) as u32).max(1),
        // Where so many fewer are as many neighbours as in the render.
        widest: [of.widest[0] * area.sqrt(), of.widest[1] * area.cbrt()],
        initial,
        iterations: None,
        time: None,
        target_error: None,
        techniques: false,
        shard: Shard { index: 0, count: 1 },
        ..of.clone()
    }
}

pub(super) fn mean(v: DVec3) -> f64 {
    v.element_sum() / 3.0
}

/// What pixels are worth, so that errors can be relative to it: the median of the neighbourhood, at the smoothest of `levels`. A pixel's own mean would not
/// do: where one bright sample is all that it has, it is as large as its error. It counts where two eye paths agree on it, for lamps stand out.
pub(super) fn values(pixels: &[Pixel], (width, height): (u32, u32), levels: Levels) -> Vec<f64> {
    let smoothest = levels.count - 1;
    const REACH: usize = 2;
    let (width, height) = (width as usize, height as usize);
    let value = |index: usize| {
        let (x, y) = (index % width, index / width);
        let around = |at: usize, end: usize| at.saturating_sub(REACH)..(at + REACH + 1).min(end);
        let near = around(y, height).flat_map(|y| around(x, width).map(move |x| y * width + x));
        let mut near: Vec<f64> = near.map(|index| mean(pixels[index].levels[smoothest].mean)).collect();
        let middle = near.len() / 2;
        let median = *near.select_nth_unstable_by(middle, f64::total_cmp).1;
        let own = &pixels[index].levels;
        if levels.two_paths { median.max(mean(own[0].mean).min(mean(own[smoothest].mean))) } else { median }
    };
    (0..pixels.len()).map(value).collect()
}

/// What a trial is told.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan {
    /// Share of the light paths.
    pub photons: f64,
    /// What the render may take (core-seconds).
    pub budget: f64,
    /// Settings that may be balanced.
    pub free: Free,
    /// Pixels of the whole picture.
    pub pixels: f64,
}

/// Share of the pixels that are left out of means, those of the largest variance: a bright sample in a hundred or so of pixels says next to nothing about how often
/// there is one. For them stands the power law of those below ([`Tail`]), up to the worst pixels, which are nobody's measure.
pub(super) const WORST: f64 = 0.01;
const NOBODYS: f64 = 0.001;

/// What makes squares relative to the value of a pixel.
pub(super) fn scale(value: f64) -> f64 {
    1.0 / (value * value + DARK)
}

/// Sums over pixels of relative squares.
#[derive(Default)]
struct Sums {
    /// Relative variance of the mean by level.
    variance: [f64; MAX_LEVELS],
    /// Relative noise of photons, by pixel and right on average but for a factor; 0 where a pixel is left out.
    noise: Vec<f64>,
    /// The largest at the own level.
    tail: Tail,
    differences: Differences,
    /// Number of pixels in these.
    pixels: f64,
    /// Light of all pixels, and its caustics.
    light: f64,
    caustics: f64,
}

impl Sums {
    /// `values`: what pixels are relative to.
    fn of(pixels: &[Pixel], levels: Levels, values: &[f64]) -> Sums {
        let own = levels.own();
        let relative = |pixel: &Pixel, level: usize, value: f64| {
            mean(pixel.levels[level].variance_of_mean(f64::from(pixel.iterations))) * scale(value)
        };
        let mut variances: Vec<f64> =
            pixels.iter().zip(values).map(|(pixel, value)| relative(pixel, own, *value)).collect();
        let worst = (variances.len() as f64 * WORST) as usize;
        let last = variances.len().saturating_sub(1 + worst);
        let most = *variances.select_nth_unstable_by(last, f64::total_cmp).1;
        let noise = vec![0.0; pixels.len()];
        let mut sums = Sums { noise, tail: Tail::of(&mut variances), ..Sums::default() };
        for (index, (pixel, value)) in pixels.iter().zip(values).enumerate() {
            if pixel.iterations < 2 {
                continue;
            }
            let n = f64::from(pixel.iterations);
            let parts = &pixel.parts;
            let all = parts.emission + parts.direct + parts.indirect + parts.caustic + parts.volume;
            sums.light += mean(all) / n;
            sums.caustics += mean(parts.caustic) / n;
            let variance: [f64; MAX_LEVELS] = std::array::from_fn(|level| relative(pixel, level, *value));
            if variance[own] > most {
                continue;
            }
            sums.variance.iter_mut().zip(variance).for_each(|(sum, variance)| *sum += variance);
            // That of eye paths is the same at all levels.
            sums.noise[index] = variance[own.saturating_sub(1)] - variance[levels.count - 1];
            sums.differences.add(pixel, scale(*value));
            sums.pixels += 1.0;
        }
        sums
    }
}

/// Parts of the variance of levels that share a path: that which is the same at all, and that which falls with the area (1 at the own level). By least
/// squares over levels 2 to 5, whose areas are 1/4, 1/2, 1 and 2.
fn split(variance: &[f64; MAX_LEVELS]) -> (f64, f64) {
    let x = [4.0, 2.0, 1.0, 0.5];
    let y = [variance[1], variance[2], variance[3], variance[4]];
    let (mx, my) = (x.iter().sum::<f64>() / 4.0, y.iter().sum::<f64>() / 4.0);
    let slope = x.iter().zip(&y).map(|(x, y)| (x - mx) * (y - my)).sum::<f64>()
        / x.iter().map(|x| (x - mx) * (x - mx)).sum::<f64>();
    let own = y[2];
    let photons = slope.clamp(0.0, 0.98 * own);
    (own - photons, photons)
}

/// A candidate being tried.
pub(super) struct Running<'a> {
    way: Way,
    /// Settings of the render.
    of: &'a Settings,
    stage: &'a Stage<'a>,
    session: Session<'a>,
    cost: Cost,
    /// Counted core-seconds of an iteration, and of all so far with what came before them.
    once: f64,
    spent: f64,
    found: Caustics,
    /// The largest that bandwidths in media may be, by pixel; empty where no photons are gathered there.
    widest: Vec<f32>,
    iterations: u64,
}

impl<'a> Running<'a> {
    /// An iteration takes `once` (counted core-seconds), what comes before them as much as `setup` of them. `cost_with` counts work with the guide that is learnt
    /// here, if any.
    pub fn new(
        stage: &'a Stage<'a>,
        (way, of): &'a (Way, Settings),
        (once, setup): (f64, f64),
        cost_with: impl Fn(Option<&Guide>) -> Cost,
    ) -> Running<'a> {
        let session = Session::new(stage);
        let cost = cost_with(session.guide());
        let (found, spent) = (Caustics::default(), setup * once);
        let in_media = session.pixels().iter().any(|pixel| pixel.volume_bandwidth > 0.0);
        let widest = if in_media { stage.widest_in_media() } else { Vec::new() };
        Running { way: *way, of, stage, session, cost, once, spent, found, widest, iterations: 0 }
    }

    /// Adds as many iterations as so many core-seconds allow, up to at least and at most so many in all; no more than the least once `stop` holds.
    pub fn advance(&mut self, seconds: f64, (least, most): (u64, u64), stop: &dyn Fn() -> bool) {
        let to = (self.iterations + (seconds / self.once) as u64).clamp(least, most);
        while self.iterations < to && !(self.iterations >= least && stop()) {
            self.session.step();
            self.found.add(self.session.pixels(), self.width());
            self.iterations += 1;
            self.spent += self.once;
        }
    }

    /// Counted core-seconds so far.
    pub fn spent(&self) -> f64 {
        self.spent
    }

    /// Pixels of a row.
    pub fn width(&self) -> usize {
        self.stage.size().0 as usize
    }

    /// What it has found of the caustics so far.
    pub fn found(&self) -> &Caustics {
        &self.found
    }

    /// What its pixels are worth.
    pub fn values(&self) -> Vec<f64> {
        values(self.session.pixels(), self.stage.size(), self.stage.settings().levels)
    }

    /// How it has done so far, relative to what pixels are worth.
    pub fn trial(&self, plan: &Plan, values: &[f64]) -> Trial {
        let (way, of, cost) = (self.way, self.of, self.cost);
        let levels = self.stage.settings().levels;
        let sums = Sums::of(self.session.pixels(), levels, values);
        let (done, pixels) = (self.iterations as f64, sums.pixels.max(1.0));
        let relative = |sum: f64| sum / pixels;
        let room = Room::of(self.session.pixels(), &self.widest, &sums.noise);
        let gathers = of.method.gathers();
        let variance = relative(sums.variance[levels.own()]);
        let (fixed, photons) = if gathers { split(&sums.variance.map(relative)) } else { (variance, 0.0) };
        let (all, light) = (cost.of(way, of, plan.pixels), cost.of(way, of, 0.0));
        // What media scatter rules where they do: there bandwidths follow the iteration's number.
        let alpha = if room.is_some() { of.volume_alpha } else { of.alpha };
        let counted = of.method == Method::Cppm && room.is_none();
        // The same neighbours in a smaller area.
        let bias = if gathers { sums.differences.bias(pixels).scaled(plan.photons) } else { Bias::default() };
        // After n times as many iterations as in the trial: noise of photons and bias.
        let ruled = |n: f64| {
            let counted = if counted { COUNTED } else { 1.0 };
            let bias = bias.scaled(n.powf(alpha - 1.0));
            (counted * photons / n.powf(alpha), Bias { squared: counted * bias.squared, ..bias })
        };
        let usual = plan.budget / all / done;
        let tail = |n: f64| sums.tail.sum(NOBODYS, WORST) * sums.tail.after(n);
        // relMSE after as many; where photons are counted, bandwidths follow the number of all that are sent.
        let expected = |balance: Balance, n: f64| {
            let area = balance.neighbours / balance.photons;
            let (sent, area) = if counted { (n * balance.photons, 1.0) } else { (n, area) };
            let (photons, bias) = ruled(sent);
            let (photons, bias) = match &room {
                Some(room) => (photons * room.noise(balance.photons), room.mean(area, |volume| bias.at(volume))),
                None => (photons / balance.neighbours, bias.at(area)),
            };
            (1.0 - WORST) * (fixed / n + photons + bias) + tail(n)
        };
        let mut balance = if counted || room.is_some() {
            Balance::expecting(|balance, n| expected(balance, n * usual), all - light, light)
        } else if gathers {
            let (photons, bias) = ruled(usual);
            Balance::new(fixed / usual, photons, bias, all - light, light)
        } else {
            Balance::USUAL
        };
        balance.keep(plan.free);
        let mut balanced = of.clone();
        balance.apply(&mut balanced);
        let seconds_per_iteration = cost.of(way, &balanced, plan.pixels);
        let n = plan.budget / seconds_per_iteration / done;
        Trial {
            way,
            caustics: sums.caustics / sums.light.max(f64::MIN_POSITIVE),
            seconds_per_iteration,
            cost,
            expected: expected(balance, n),
            balance,
        }
    }
}
