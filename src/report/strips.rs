//! Crops of all curves side by side, at equal time and at equal error.

use super::crop::{self, Window};
use super::curve::Curve;
use super::entry::Metric;
use super::number::{iterations, short};
use super::outcome::Outcome;
use super::point::Point;
use super::subject::{ReportOptions, Subject};
use crate::error::Result;
use crate::film::Picture;
use crate::image::metrics::compare_pictures;
use crate::image::{Comparison, Floor};

/// Crops of one picture, the same windows of it as of other pictures, with a caption.
pub struct Crops {
    /// Name of the curve to which the picture belongs, or of the reference.
    pub name: String,
    /// Iterations, seconds and error of the picture, in words; empty for the reference.
    pub caption: String,
    /// The bytes of one PNG for each window.
    pub pictures: Vec<Vec<u8>>,
    /// The bytes of one PNG for each window, a heat map of the error; empty for the reference.
    pub heat_maps: Vec<Vec<u8>>,
}

/// A row of the report: crops of all curves at equal time or at equal error.
pub struct Strip {
    /// Heading of the row.
    pub title: String,
    /// Crops of the picture of each curve.
    pub runs: Vec<Crops>,
    /// The relative error that has the palest colour in the heat maps.
    pub largest: f64,
}

/// The errors that an eye sees in the picture of a curve at equal time: of the whole picture, and inside glass and mirrors.
pub struct Seen {
    /// Index of the curve.
    pub line: usize,
    /// Iterations of the picture; samples per pixel for other renderers.
    pub iterations: u64,
    /// Wall-clock seconds of the picture.
    pub seconds: f64,
    /// The picture against the reference.
    pub errors: Comparison,
}

impl Seen {
    fn of(subject: &Subject, point: &Point, picture: &Picture) -> Result<Seen> {
        let mut errors = compare_pictures(picture, &subject.reference.picture, Floor::Papers, 0)?;
        errors.measure_inside(&subject.inside);
        Ok(Seen { line: point.line, iterations: point.iterations, seconds: point.seconds, errors })
    }
}

/// The measurements of the curve with index `line` whose pictures are stored.
fn stored(points: &[Point], line: usize) -> impl Iterator<Item = &Point> {
    points.iter().filter(move |point| point.line == line && point.picture.is_some())
}

/// The measurement of each curve that is nearest to a common time, and to a common error.
struct Alignment {
    time: f64,
    error: f64,
    at_time: Vec<Point>,
    at_error: Vec<Point>,
}

impl Alignment {
    fn of(runs: usize, outcome: &Outcome, metric: Metric) -> Alignment {
        let raw = |point: &Point| metric.of(&point.errors);
        // The time that all curves reach.
        let last = |run: usize| stored(&outcome.points, run).last();
        let ends: Vec<&Point> = (0..runs).filter_map(last).collect();
        let time = ends.iter().map(|p| p.seconds).fold(f64::INFINITY, f64::min);
        // The final error that most curves cross; among equals the smallest.
        let passes = |error: f64, run: usize| {
            let errors = || stored(&outcome.points, run).map(raw);
            errors().any(|e| e >= error) && errors().any(|e| e <= error)
        };
        let count = |error: f64| (0..runs).filter(|&run| passes(error, run)).count();
        let mut finals: Vec<f64> = ends.iter().map(|p| raw(p)).collect();
        finals.sort_by(f64::total_cmp);
        let error = finals.iter().rev().copied().max_by_key(|&error| count(error)).unwrap_or(0.0);
        let nearest = |distance: &dyn Fn(&Point) -> f64| -> Vec<Point> {
            let of_run = |run| stored(&outcome.points, run).min_by(|a, b| distance(a).total_cmp(&distance(b))).cloned();
            (0..runs).filter_map(of_run).collect()
        };
        let at_time = nearest(&|p| (p.seconds / time).ln().abs());
        let at_error = nearest(&|p| (raw(p) / error).ln().abs());
        Alignment { time, error, at_time, at_error }
    }
}

/// All crops of pictures in a report.
pub(super) struct Gallery {
    /// Rectangles of pixels that are cropped.
    pub(super) windows: Vec<Window>,
    /// The whole reference and its crops.
    pub(super) reference: Crops,
    /// Crops of the curves at equal time and at equal error.
    pub(super) strips: Vec<Strip>,
    /// The visible errors of the curves at equal time.
    pub(super) seen: Vec<Seen>,
}

/// Cuts the crops of the reference and of the curves, in the windows of `options`, or if there are none in those in which
/// the curves differ most.
///
/// # Errors
/// A stored picture cannot be read.
pub(super) fn gallery(
    subject: &Subject,
    outcome: &mut Outcome,
    options: &ReportOptions,
    curves: &[Curve],
) -> Result<Gallery> {
    let (metric, reference, look) = (subject.metric, &subject.reference, options.look);
    let lines = outcome.lines.clone();
    let Alignment { time, error, at_time, at_error } = Alignment::of(lines.len(), outcome, metric);
    let mut load = |points: &[Point]| -> Result<Vec<Picture>> {
        points.iter().filter_map(|point| outcome.picture(point).transpose()).collect()
    };
    let (timed, equal) = (load(&at_time)?, load(&at_error)?);
    let mut windows = options.windows.clone();
    if windows.is_empty() && !timed.is_empty() {
        windows = crop::choose(&timed, &reference.picture, 2);
    }
    let strip = |title: String, points: &[Point], pictures: &[Picture]| -> Result<Strip> {
        let largest = crop::scale(pictures, &reference.picture, &windows);
        let shown = |(point, picture): (&Point, &Picture)| -> Result<Crops> {
            let curve_point = curves[point.line].by_seed.first().and_then(|curve| {
                curve.iter().find(|curve_point| curve_point.iterations == point.iterations && curve_point.reported)
            });
            let figure = curve_point.map_or("below the reference's error".into(), |curve_point| {
                format!("{} {}", metric.name(), short(curve_point.figure))
            });
            let line = &lines[point.line];
            let count = match line.source.is_ours() {
                true => iterations(point.iterations),
                false => format!("{} samples a pixel", point.iterations),
            };
            Ok(Crops {
                name: line.name.clone(),
                caption: format!("{count}, {} s, {figure}", short(point.seconds)),
                pictures: windows.iter().map(|w| crop::picture(picture, *w, look)).collect::<Result<_>>()?,
                heat_maps: windows
                    .iter()
                    .map(|w| crop::heat_map(picture, &reference.picture, *w, largest))
                    .collect::<Result<_>>()?,
            })
        };
        Ok(Strip { title, runs: points.iter().zip(pictures).map(shown).collect::<Result<_>>()?, largest })
    };
    let mut strips = Vec::new();
    if !timed.is_empty() {
        strips.push(strip(format!("At equal time: about {} s", short(time)), &at_time, &timed)?);
        let own = reference.error.of(metric).unwrap_or(0.0);
        let title = format!("At equal error: {} about {}", metric.name(), short((error - own).max(0.0)));
        strips.push(strip(title, &at_error, &equal)?);
    }
    let mut parts = vec![Window::whole(reference.picture.size())];
    parts.extend(&windows);
    let whole = Crops {
        name: "reference".into(),
        caption: String::new(),
        pictures: parts.into_iter().map(|part| crop::picture(&reference.picture, part, look)).collect::<Result<_>>()?,
        heat_maps: Vec::new(),
    };
    let of = |(point, picture): (_, &_)| Seen::of(subject, point, picture);
    let seen = at_time.iter().zip(&timed).map(of).collect::<Result<_>>()?;
    Ok(Gallery { windows, reference: whole, strips, seen })
}
