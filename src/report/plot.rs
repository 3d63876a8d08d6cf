//! Log-log plots of error against iterations or seconds, as SVG.

use super::curve::{Axis, Curve, CurvePoint};
use super::entry::{Metric, PictureSource};
use super::number::{minus, plain};
use super::summary::{Subject, Summary};
use crate::error::{Error, ErrorKind, Result};
use plotters::coord::combinators::{BindKeyPoints, LogCoord, WithKeyPoints};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Width and height of a plot in pixels.
const SIZE: (u32, u32) = (860, 520);
/// Margin in pixels on the right for the names of the curves.
const NAME_MARGIN: i32 = 190;
/// Maximum number of ticks on an axis.
const MAX_TICKS: usize = 12;
/// Minimum vertical distance in pixels of two curves' names.
const NAME_SPACING: i32 = 17;
const FONT: &str = "Helvetica, Arial, sans-serif";
const INK: RGBColor = RGBColor(40, 40, 40);
const GREY: RGBColor = RGBColor(150, 150, 150);
const GUIDE: RGBColor = RGBColor(190, 190, 190);
const FAINT: RGBColor = RGBColor(228, 228, 228);

/// RGB colours of curves for readers with and without colour blindness \[Okabe and Ito 2008\], without the pale yellow.
pub const COLOURS: [(u8, u8, u8); 7] =
    [(0, 114, 178), (213, 94, 0), (0, 158, 115), (204, 121, 167), (230, 159, 0), (86, 180, 233), (0, 0, 0)];

/// The RGB colour of the curve with index `line`. Curves of the same entry or peer share it.
pub fn colour(subject: &Subject, line: usize) -> (u8, u8, u8) {
    COLOURS[number(subject, line) % COLOURS.len()]
}

/// Index of the entry of the curve with index `line`, or of its peer, counted after the entries.
fn number(subject: &Subject, line: usize) -> usize {
    match subject.lines[line].source {
        PictureSource::Estimate(entry) | PictureSource::Finished(entry) => entry,
        PictureSource::Peer(peer) | PictureSource::Denoised(peer) => subject.entries.len() + peer,
    }
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
/// A logarithmic axis with explicit ticks.
type Log = WithKeyPoints<LogCoord<f64>>;
type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<Log, Log>>;

/// Contents of a plot of error curves.
struct Plot<'a> {
    subject: &'a Subject,
    summary: &'a Summary,
    metric: Metric,
    axis: Axis,
    /// Reported points of each curve.
    curves: Vec<Vec<CurvePoint>>,
}

/// The SVG document of a plot of the error in a metric against an axis; `None` if no curve has a point. Plots against
/// iterations leave other renderers out, which count samples.
///
/// # Errors
/// None beyond lack of memory.
pub fn svg(
    subject: &Subject,
    summary: &Summary,
    metric: Metric,
    curves: &[Curve],
    axis: Axis,
) -> Result<Option<String>> {
    let shown = |(line, curve): (usize, &Curve)| -> Vec<CurvePoint> {
        let counts = axis != Axis::Iterations || subject.lines[line].source.is_ours();
        curve.mean.iter().filter(|curve_point| counts && curve_point.reported).copied().collect()
    };
    let curves: Vec<Vec<CurvePoint>> = curves.iter().enumerate().map(shown).collect();
    let Some((across, up)) = ranges(&curves, axis) else { return Ok(None) };
    let mut text = String::new();
    let drawn = draw(&mut text, &Plot { subject, summary, metric, axis, curves }, (across, up));
    drawn.map_err(|cause| Error::new(ErrorKind::Image, "plot", cause))?;
    Ok(Some(text))
}

/// Ranges (least, greatest) of the horizontal and vertical axis that hold all points; `None` if there are none.
fn ranges(curves: &[Vec<CurvePoint>], axis: Axis) -> Option<((f64, f64), (f64, f64))> {
    let span = |values: &dyn Fn(&CurvePoint) -> f64, room: f64| {
        let all = || curves.iter().flatten().map(values).filter(|v| *v > 0.0 && v.is_finite());
        let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
        (high > 0.0).then(|| (low / room, (high * room).max(low * 1.5)))
    };
    Some((span(&|curve_point| axis.of(curve_point), 1.15)?, span(&|curve_point| curve_point.figure, 1.4)?))
}

/// A logarithmic axis from `low` to `high` with ticks at powers of ten, and between them on short axes.
fn log(low: f64, high: f64) -> Log {
    let decades = (high / low).log10();
    let digits: &[f64] = match decades {
        d if d < 0.7 => &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0],
        d if d < 3.0 => &[1.0, 2.0, 5.0],
        _ => &[1.0],
    };
    let powers = low.log10().floor() as i32..=high.log10().ceil() as i32;
    let every = (decades / MAX_TICKS as f64).ceil().max(1.0) as i32;
    let ticks = powers.filter(|power| power.rem_euclid(every) == 0);
    let ticks = ticks.flat_map(|power| digits.iter().map(move |digit| digit * 10f64.powi(power)));
    let ticks = ticks.filter(|tick| (low..=high).contains(tick)).collect();
    LogCoord::from((low..high).log_scale()).with_key_points(ticks)
}

fn draw(
    text: &mut String,
    plot: &Plot<'_>,
    ((left, right), (low, high)): ((f64, f64), (f64, f64)),
) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let root: Area<'_> = SVGBackend::with_string(text, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(12)
        .margin_right(NAME_MARGIN)
        .x_label_area_size(46)
        .y_label_area_size(74)
        .build_cartesian_2d(log(left, right), log(low, high))?;
    chart
        .configure_mesh()
        .x_desc(match plot.axis {
            Axis::Iterations => "iterations",
            Axis::Seconds => "seconds (wall clock)",
            Axis::CoreSeconds => "core-seconds",
        })
        .y_desc(plot.metric.name())
        .x_label_formatter(&|x| minus(&plain(*x)))
        .y_label_formatter(&|y| minus(&plain(*y)))
        .x_labels(MAX_TICKS)
        .y_labels(MAX_TICKS)
        .axis_style(GREY)
        .bold_line_style(FAINT)
        .light_line_style(WHITE)
        .label_style((FONT, 15).into_font().color(&INK))
        .axis_desc_style((FONT, 16).into_font().color(&INK))
        .draw()?;
    floor(&mut chart, plot, left, right, low)?;
    guides(&mut chart, plot)?;
    for line in 0..plot.curves.len() {
        series(&mut chart, plot, line)?;
    }
    names(&root, &chart, plot)?;
    root.present()?;
    Ok(())
}

/// Draws a curve with markers and, with several seeds, bars of one standard error. Curves of finished and denoised
/// pictures are dashed with hollow markers; points that fireflies dominate are crossed out.
fn series(
    chart: &mut Chart<'_, '_>,
    plot: &Plot<'_>,
    line: usize,
) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let (r, g, b) = colour(plot.subject, line);
    let (ink, source, curve) = (RGBColor(r, g, b), plot.subject.lines[line].source, &plot.curves[line]);
    let points: Vec<(f64, f64)> =
        curve.iter().map(|curve_point| (plot.axis.of(curve_point), curve_point.figure)).collect();
    let thick = ink.stroke_width(2);
    match source.is_raw() {
        true => chart.draw_series(LineSeries::new(points.iter().copied(), thick)).map(drop)?,
        false => chart.draw_series(DashedLineSeries::new(points.iter().copied(), 6, 4, thick)).map(drop)?,
    }
    let bar = |curve_point: &CurvePoint| {
        let spread = curve_point.spread?;
        let (x, low) = (plot.axis.of(curve_point), (curve_point.figure - spread).max(0.1 * curve_point.figure));
        Some(PathElement::new(vec![(x, low), (x, curve_point.figure + spread)], ink.stroke_width(1)))
    };
    chart.draw_series(curve.iter().filter_map(bar))?;
    let fill = if source.is_raw() { ink.filled() } else { ink.stroke_width(1) };
    // After seven curves the colours repeat with another marker.
    if number(plot.subject, line) < COLOURS.len() {
        chart.draw_series(points.iter().map(|&point| Circle::new(point, 3, fill)))?;
    } else {
        chart.draw_series(points.iter().map(|&point| TriangleMarker::new(point, 5, fill)))?;
    }
    let ruled = curve
        .iter()
        .filter(|curve_point| curve_point.fireflies)
        .map(|curve_point| (plot.axis.of(curve_point), curve_point.figure));
    chart.draw_series(ruled.map(|point| Cross::new(point, 6, INK.stroke_width(1))))?;
    Ok(())
}

/// Draws the reference's own error as a line, if it lies within the plot.
fn floor(
    chart: &mut Chart<'_, '_>,
    plot: &Plot<'_>,
    left: f64,
    right: f64,
    low: f64,
) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let Some(own) = plot.subject.reference.error.of(plot.metric).filter(|own| *own > low) else { return Ok(()) };
    let ends = [(left, own), (right, own)];
    chart.draw_series(LineSeries::new(ends, GREY.stroke_width(1)))?;
    let style = (FONT, 13).into_font().color(&GREY).pos(Pos::new(HPos::Left, VPos::Bottom));
    chart.draw_series([Text::new(" the reference's own error", (left, own), style)])?;
    Ok(())
}

/// Factor by which the line of a theoretical exponent lies below the data.
const BELOW: f64 = 0.7;

/// Draws lines with the exponents of theory against iterations, each below the last decade of the first curve with that
/// exponent.
fn guides(chart: &mut Chart<'_, '_>, plot: &Plot<'_>) -> std::result::Result<(), Box<dyn std::error::Error>> {
    if plot.axis != Axis::Iterations {
        return Ok(());
    }
    let mut drawn: Vec<f64> = Vec::new();
    for (theory, curve) in plot.summary.theories.iter().zip(&plot.curves) {
        let Some(exponent) = theory.map(|theory| theory.exponent).filter(|exponent| *exponent < 0.0) else { continue };
        let Some(last) = curve.last().map(|curve_point| curve_point.iterations as f64) else { continue };
        let decade: Vec<&CurvePoint> =
            curve.iter().filter(|curve_point| 10.0 * curve_point.iterations as f64 >= last).collect();
        let first = decade[0].iterations as f64;
        if drawn.iter().any(|other| (other - exponent).abs() < 1e-6) || first == last {
            continue;
        }
        drawn.push(exponent);
        // Below the lowest point relative to the slope, so that the line crosses no point.
        let height = |curve_point: &&CurvePoint| curve_point.figure / (curve_point.iterations as f64).powf(exponent);
        let lowest = BELOW * decade.iter().map(height).fold(f64::INFINITY, f64::min);
        let at = |x: f64| (x, lowest * x.powf(exponent));
        chart.draw_series(LineSeries::new([at(first), at(last)], GUIDE.stroke_width(2)))?;
        let style = (FONT, 13).into_font().color(&GREY).pos(Pos::new(HPos::Right, VPos::Top));
        let name = format!("N^{} ", minus(&exponent_text(exponent)));
        chart.draw_series([Text::new(name, at((first * last).sqrt()), style)])?;
    }
    Ok(())
}

/// An exponent as a short text: `-2/3`, `-1`, `-0.5`.
fn exponent_text(exponent: f64) -> String {
    let thirds = exponent * 3.0;
    if (thirds - thirds.round()).abs() < 1e-6 && thirds.round() as i64 % 3 != 0 {
        return format!("{}/3", thirds.round());
    }
    format!("{exponent}")
}

/// Writes the name of every curve beside its right end, moved apart if names would overlap.
fn names(
    root: &Area<'_>,
    chart: &Chart<'_, '_>,
    plot: &Plot<'_>,
) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let end = |(line, curve): (usize, &Vec<CurvePoint>)| {
        let curve_point = curve.last()?;
        let (x, y) = chart.backend_coord(&(plot.axis.of(curve_point), curve_point.figure));
        Some((line, x, y))
    };
    let mut ends: Vec<(usize, i32, i32)> = plot.curves.iter().enumerate().filter_map(end).collect();
    ends.sort_by_key(|end| end.2);
    let mut places: Vec<i32> = ends.iter().map(|end| end.2).collect();
    for i in 1..places.len() {
        places[i] = places[i].max(places[i - 1] + NAME_SPACING);
    }
    let limit = SIZE.1 as i32 - 60;
    for i in (0..places.len()).rev() {
        let below = if i + 1 < places.len() { places[i + 1] - NAME_SPACING } else { limit };
        places[i] = places[i].min(below);
    }
    let margin = SIZE.0 as i32 - NAME_MARGIN + 10;
    for ((line, x, y), place) in ends.into_iter().zip(places) {
        let (r, g, b) = colour(plot.subject, line);
        let ink = RGBColor(r, g, b);
        let leader = vec![(x + 5, y), (margin - 4, place)];
        root.draw(&PathElement::new(leader, ink.mix(0.35).stroke_width(1)))?;
        let style = (FONT, 15).into_font().color(&ink).pos(Pos::new(HPos::Left, VPos::Center));
        root.draw(&Text::new(clip(&plot.subject.lines[line].name), (margin, place), style))?;
    }
    Ok(())
}

/// The name of a curve, shortened to fit beside the plot; the tables of the page have the full name.
fn clip(name: &str) -> String {
    const MAX_CHARS: usize = 25;
    if name.chars().count() <= MAX_CHARS {
        name.into()
    } else {
        name.chars().take(MAX_CHARS - 1).chain(['…']).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponents_and_names_are_short() {
        assert_eq!([-1.0, -2.0 / 3.0, -0.5].map(exponent_text), ["-1", "-2/3", "-0.5"]);
        assert_eq!(clip("sppm"), "sppm");
        assert_eq!(clip(&"x".repeat(40)).chars().count(), 25);
    }
}
