//! What a render says when its pixels are gone.

use super::options::RenderArgs;
use crate::cli::output::is_stdout;
use crate::cli::progress::{count, duration, percent};
use crate::cli::say;
use caustique::error::{Error, ErrorKind, Result};
use caustique::film::LayerSet;
use caustique::pipeline::{Delivery, Place, Reached};
use caustique::render::{ErrorCoverage, Rejections, Rendered, StopReason, peak_memory};
use std::path::Path;

/// The numbers of a render.
pub struct Summary {
    iterations: u64,
    light_paths: u64,
    seconds: f64,
    phases: String,
    error: Option<f64>,
    /// What the error before the finish tells of.
    told: ErrorCoverage,
    /// Photons are merged or gathered within bandwidths, of one level.
    has_one_bandwidth: bool,
    rejections: Rejections,
    /// Bytes of a pixel's sums and of an iteration's measures of it, and how many levels these are of.
    pixel: ([usize; 2], usize),
    stop: StopReason,
    /// Photons, light paths asked for, and bytes allowed, where the one map of `pm` became full.
    full: Option<(u64, u32, u64)>,
}

impl Summary {
    pub fn of(rendered: &Rendered) -> Summary {
        let p = rendered.stats.phases;
        Summary {
            iterations: rendered.stats.iterations,
            light_paths: rendered.stats.light_paths,
            seconds: rendered.stats.time.seconds,
            phases: format!(
                "core-seconds: pilot {:.1}, light {:.1}, map {:.1}, eye {:.1}",
                p.pilot, p.light, p.map, p.eye
            ),
            error: rendered.error.relative(),
            told: rendered.settings.error_coverage(),
            has_one_bandwidth: rendered.settings.method.has_bandwidths() && rendered.settings.levels.count < 2,
            rejections: rendered.rejections(),
            pixel: (rendered.bytes_per_pixel(), rendered.settings.levels.count),
            stop: rendered.stop,
            full: rendered.map_is_full().then(|| {
                let settings = &rendered.settings;
                (rendered.stats.photons, settings.photons, settings.photon_memory)
            }),
        }
    }

    /// For people.
    pub fn tell(&self) {
        let mut line = format!("{} iterations in {} ({})", self.iterations, duration(self.seconds), self.phases);
        if self.light_paths > 0 {
            let rate = count(self.light_paths as f64 / self.seconds.max(1e-9));
            line += &format!(", {} light paths, {rate} a second", count(self.light_paths as f64));
        }
        say(&line);
        if let Some(error) = self.error {
            say(&format!("estimated relative error before the finish {}{}", percent(error), self.told.note()));
        }
        let peak = peak_memory() as f64 / f64::from(1 << 30);
        let ([sums, measures], levels) = self.pixel;
        let levels = if levels > 1 { format!("{levels} levels") } else { "one level".into() };
        let measures = if measures > 0 { format!(", an iteration's measures of it {measures}") } else { String::new() };
        say(&format!("peak memory {peak:.2} GiB; the sums of a pixel, of {levels}, take {sums} bytes{measures}"));
    }

    /// What the error of the finished picture tells of: all quarters have the kernel's bias in common, which levels
    /// tell.
    pub fn coverage_of_finished(&self) -> ErrorCoverage {
        if self.has_one_bandwidth { ErrorCoverage::Noise } else { self.told }
    }

    /// The files that are written.
    pub fn tell_files(args: &RenderArgs, set: &LayerSet, techniques: usize) {
        tell_picture(&args.output, set);
        if let Some(png) = &args.picture.png {
            say(&png.display().to_string());
        }
        if let Some(folder) = &args.debug_techniques {
            say(&format!("{}: {techniques} techniques, weighted and unweighted", folder.display()));
        }
    }

    /// A warning if the photon map became full.
    pub fn tell_full(&self) {
        if let Some((photons, asked, bytes)) = self.full {
            say(&format!(
                "warning: the photon map was full at {photons} photons ({} MiB) after {} of {asked} light paths; --photon-memory allows more",
                bytes >> 20,
                self.light_paths
            ));
        }
    }

    /// What was left out as not finite, if anything was: a warning where that is much, else for `people` alone.
    pub fn tell_rejected(&self, output: &Path, people: bool) {
        let (name, many) = (output.display(), self.rejections.are_too_many());
        if let Some(sentence) = self.rejections.sentence().filter(|_| many || people) {
            say(&format!("{}{name}: {sentence}", if many { "warning: " } else { "" }));
        }
    }

    /// The error of a render that was stopped by a signal.
    pub fn interrupted(&self, args: &RenderArgs) -> Result<()> {
        if self.stop != StopReason::Interrupted {
            return Ok(());
        }
        let cause = format!("interrupted after {} iterations, which are written", self.iterations);
        let error = Error::new(ErrorKind::Interrupted, args.output.display(), cause);
        let of_frames = args.job.scene.frames.is_some();
        Err(match args.saving().filter(|saving| saving.path.exists()) {
            Some(_) if of_frames => error.hint("the same command with --skip-existing goes on"),
            None if of_frames => error.hint(format!(
                "remove {} before the same command with --skip-existing goes on: it is not finished",
                args.output.display()
            )),
            Some(saving) => error.hint(format!("the same command with --resume {} goes on", saving.path.display())),
            None => error,
        })
    }
}

/// The file of a picture.
pub fn tell_picture(output: &Path, set: &LayerSet) {
    let channels: usize = set.layers.iter().map(|layer| layer.planes.len()).sum();
    let name = if is_stdout(output) { "standard output".into() } else { output.display().to_string() };
    say(&format!("{name}: {} x {}, {channels} channels", set.width, set.height));
}

/// A few bright samples rule the noise where they hold more of it than all others.
const RARE: f64 = 0.5;

/// What has finished a picture, and in how many seconds; the error of that, which knows of `told`, what half of it
/// takes, and where it is.
pub fn tell_finish(name: &str, delivery: &Delivery, told: ErrorCoverage) {
    let reached = delivery.reached.as_ref();
    let error = reached.map(|reached| {
        let [low, high] = reached.interval().map(percent);
        let error = format!("; error {} ({low} to {high}){}", percent(reached.error()), told.note());
        let half = reached.seconds_to_half().map(|seconds| format!(", half of it in about {} more", duration(seconds)));
        error + &half.unwrap_or_default()
    });
    say(&format!("finished with {name} in {}{}", duration(delivery.finishing), error.unwrap_or_default()));
    if let Some(rare) = reached.map(Reached::rare).filter(|rare| *rare > RARE) {
        let share = percent(rare);
        say(&format!(
            "warning: few bright samples hold {share} of the noise: with all pixels the error is larger than told, and light that is rarely found may be missing; another --method may find it"
        ));
    }
    if let Some(worst) = delivery.worst.as_ref().filter(|worst| !worst.by.is_empty()) {
        let places: Vec<String> = worst.by.iter().take(3).map(place).collect();
        say(&format!("where the error is: {}", places.join("; ")));
    }
}

/// A warning of light that photons have hardly brought, if that is most of the error.
pub fn tell_unseen(output: &Path, delivery: &Delivery) {
    if let Some(unseen) = &delivery.unseen {
        say(&format!("warning: {}: {unseen}", output.display()));
    }
}

/// `caustics at 'Lamp' (Glass): 61 %`.
pub fn place(place: &Place) -> String {
    let Place { share, object, material, light } = place;
    let share = percent(*share);
    match (object.is_empty(), material.is_empty()) {
        (true, _) => format!("{light}: {share}"),
        (_, true) => format!("{light} at '{object}': {share}"),
        _ => format!("{light} at '{object}' ({material}): {share}"),
    }
}
