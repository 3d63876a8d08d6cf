//! The summary that is printed after a render.

use super::options::RenderArgs;
use crate::cli::output::is_stdout;
use crate::cli::progress::{count, duration, percent};
use crate::cli::{events, say};
use caustique::error::{Error, ErrorKind, Result};
use caustique::film::LayerSet;
use caustique::pipeline::{Delivery, FINISHED_PICTURE, Place, Reached};
use caustique::render::{ErrorCoverage, Rejections, Rendered, StopReason, peak_memory};
use serde_json::json;
use std::path::Path;

/// Figures of a render for its report, kept after its pixels are freed.
pub struct Summary {
    iterations: u64,
    light_paths: u64,
    seconds: f64,
    phases: String,
    error: Option<f64>,
    /// Parts of the true error (noise, bias) that the error of the unfinished picture includes.
    error_coverage: ErrorCoverage,
    /// Whether photons are merged or gathered within bandwidths of a single level, which do not show bias.
    has_one_bandwidth: bool,
    rejections: Rejections,
    /// Bytes of a pixel's sums and of its samples in one iteration, and the number of bandwidth levels.
    pixel: ([usize; 2], usize),
    stop: StopReason,
    /// Number of photons, requested light paths and allowed bytes; `None` unless the photon map of `pm` became full.
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
                "core-seconds: pilot {:.1}, light paths {:.1}, photon map {:.1}, camera paths {:.1}",
                p.pilot, p.light, p.map, p.eye
            ),
            error: rendered.error.relative(),
            error_coverage: rendered.settings.error_coverage(),
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

    /// Prints time, error and memory of the render.
    pub fn print(&self) {
        let mut line = format!("{} iterations in {} ({})", self.iterations, duration(self.seconds), self.phases);
        if self.light_paths > 0 {
            let rate = count(self.light_paths as f64 / self.seconds.max(1e-9));
            line += &format!(", {} light paths, {rate} a second", count(self.light_paths as f64));
        }
        say(&line);
        if let Some(error) = self.error {
            say(&format!(
                "estimated relative error before the finish {}{}",
                percent(error),
                self.error_coverage.note()
            ));
        }
        let peak = peak_memory() as f64 / f64::from(1 << 30);
        let ([sums, measures], levels) = self.pixel;
        let levels = if levels > 1 { format!("{levels} levels") } else { "one level".into() };
        let measures = if measures > 0 { format!(", an iteration's measures of it {measures}") } else { String::new() };
        say(&format!("peak memory {peak:.2} GiB; the sums of a pixel, of {levels}, take {sums} bytes{measures}"));
    }

    /// Parts of the true error (noise, bias) that the error of the finished picture includes. All quarters share the
    /// bias of the kernel, so only levels show it.
    pub fn coverage_of_finished(&self) -> ErrorCoverage {
        if self.has_one_bandwidth { ErrorCoverage::Noise } else { self.error_coverage }
    }

    /// Prints the names of the files that the render has written.
    pub fn print_files(args: &RenderArgs, set: &LayerSet, techniques: usize) {
        print_picture(&args.output, set);
        if let Some(png) = &args.picture.png {
            say(&png.display().to_string());
        }
        if let Some(folder) = &args.debug_techniques {
            say(&format!("{}: {techniques} techniques, weighted and unweighted", folder.display()));
        }
    }

    /// Prints the events of the written files and of the end of the render.
    pub fn print_events(&self, args: &RenderArgs, delivery: &Delivery, frame: Option<u32>) {
        let LayerSet { width, height, .. } = delivery.set;
        events::print(
            "output",
            json!({
                "path": events::path(&args.output), "kind": "exr", "frame": frame, "width": width, "height": height,
            }),
        );
        let others = [("png", &args.picture.png), ("usd", &args.usd_layer), ("techniques", &args.debug_techniques)];
        for (kind, path) in others.into_iter().filter_map(|(kind, path)| path.as_ref().map(|path| (kind, path))) {
            events::print("output", json!({"path": events::path(path), "kind": kind, "frame": frame}));
        }
        let finished = delivery.reached.as_ref().map(Reached::error);
        let error_of = if finished.is_some() { FINISHED_PICTURE } else { self.error_coverage.name() };
        events::print(
            "finish",
            json!({
                "frame": frame, "iterations": self.iterations, "seconds": self.seconds, "light_paths": self.light_paths,
                "error": finished.or(self.error), "error_of": error_of,
                "interrupted": self.is_interrupted(),
            }),
        );
    }

    /// Warns if the photon map of `pm` became full.
    pub fn warn_full_map(&self) {
        if let Some((photons, light_paths, bytes)) = self.full {
            say(&format!(
                "warning: the photon map was full at {photons} photons ({} MiB) after {} of {light_paths} light paths; --photon-memory allows more",
                bytes >> 20,
                self.light_paths
            ));
        }
    }

    /// Prints the number of rejected samples, which were not finite: as a warning if there are many, else only for
    /// `people`.
    pub fn print_rejected(&self, output: &Path, people: bool) {
        let (name, many) = (output.display(), self.rejections.are_too_many());
        if let Some(sentence) = self.rejections.sentence().filter(|_| many || people) {
            say(&format!("{}{name}: {sentence}", if many { "warning: " } else { "" }));
        }
    }

    /// Whether a signal or another program has stopped the render.
    pub fn is_interrupted(&self) -> bool {
        self.stop == StopReason::Interrupted
    }

    /// Fails if a signal has stopped the render.
    pub fn check_interrupted(&self, args: &RenderArgs) -> Result<()> {
        if !self.is_interrupted() {
            return Ok(());
        }
        let cause = format!("interrupted after {} iterations, which are written", self.iterations);
        let error = Error::new(ErrorKind::Interrupted, args.output.display(), cause);
        let of_frames = args.options.scene.frames.is_some();
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

/// Prints the file, the size and the number of channels of a picture.
pub fn print_picture(output: &Path, set: &LayerSet) {
    let channels: usize = set.layers.iter().map(|layer| layer.planes.len()).sum();
    let name = if is_stdout(output) { "standard output".into() } else { output.display().to_string() };
    say(&format!("{name}: {} x {}, {channels} channels", set.width, set.height));
}

/// Share of the noise in a few bright samples above which a warning is printed.
const MAX_RARE_SHARE: f64 = 0.5;

/// Prints the denoiser and the time of the finish, the error of the finished picture, the cost of halving it, and where
/// it is largest. `coverage`: parts of the true error that it includes.
pub fn print_finish(name: &str, delivery: &Delivery, coverage: ErrorCoverage) {
    let reached = delivery.reached.as_ref();
    let error = reached.map(|reached| {
        let [low, high] = reached.interval().map(percent);
        let error = format!("; error {} ({low} to {high}){}", percent(reached.error()), coverage.note());
        let half = reached.seconds_to_half().map(|seconds| format!(", half of it in about {} more", duration(seconds)));
        error + &half.unwrap_or_default()
    });
    say(&format!("finished with {name} in {}{}", duration(delivery.finish_seconds), error.unwrap_or_default()));
    if let Some(rare) = reached.map(Reached::rare).filter(|rare| *rare > MAX_RARE_SHARE) {
        let share = percent(rare);
        say(&format!(
            "warning: few bright samples hold {share} of the noise: with all pixels the error is larger than stated, and light that is rarely found may be missing; another --method may find it"
        ));
    }
    if let Some(worst) = delivery.worst.as_ref().filter(|worst| !worst.by.is_empty()) {
        let places: Vec<String> = worst.by.iter().take(3).map(place).collect();
        say(&format!("where the error is: {}", places.join("; ")));
    }
}

/// Warns if most of the error is light that hardly any photon has carried.
pub fn warn_unseen(output: &Path, delivery: &Delivery) {
    if let Some(unseen) = &delivery.unseen {
        say(&format!("warning: {}: {unseen}", output.display()));
    }
}

/// A place of large error for people, with its share: `caustics at 'Lamp' (Glass): 61 %`.
pub fn place(place: &Place) -> String {
    let Place { share, object, material, light } = place;
    let share = percent(*share);
    match (object.is_empty(), material.is_empty()) {
        (true, _) => format!("{light}: {share}"),
        (_, true) => format!("{light} at '{object}': {share}"),
        _ => format!("{light} at '{object}' ({material}): {share}"),
    }
}
