//! The report as one page that needs nothing from outside: pictures, plots and style are in it.

use super::crop;
use super::curve::{Mean, Unfit};
use super::entry::{Metric, Of};
use super::number::{minus, plain, short, short_with_error, with_error};
use super::outcome::Outcome;
use super::overhead::Overhead;
use super::plot::colour;
use super::summary::{Likeness, Strip, Subject, Summary};
use super::target::Reached;
use crate::error::Result;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{DOCTYPE, Markup, PreEscaped, html};

const STYLE: &str = include_str!("page.css");

/// Plots side by side: SVG documents with the metrics that they show.
pub struct Plots {
    /// What they go under.
    pub heading: &'static str,
    /// The plots.
    pub plots: Vec<(Metric, String)>,
}

/// The page.
///
/// # Errors
/// None that memory would not have.
pub fn html(subject: &Subject, outcome: &Outcome, summary: &Summary, plots: &[Plots]) -> Result<String> {
    let bar = data_url(&crop::heat_bar()?);
    let title = format!("Accuracy against time: {}", subject.scene);
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                header {
                    h1 { (title) }
                    p.lead { (lead(subject)) }
                }
                @for row in plots.iter().filter(|row| !row.plots.is_empty()) {
                    section { h2 { (row.heading) } div.pair {
                        @for (metric, svg) in &row.plots { div.plot { h3 { (meaning(*metric)) } (PreEscaped(svg)) } }
                    } }
                }
                (marks(subject, summary))
                div.pair { (targets(subject, summary)) (fits(subject, summary)) }
                (guests(subject, outcome, summary))
                (overheads(subject, summary))
                (reference(subject, summary))
                @for strip in &summary.strips { (crops(strip, summary, &bar)) }
                (runs(subject))
                (facts(subject, summary))
                footer { "caustique " (env!("CARGO_PKG_VERSION")) }
            }
        }
    };
    Ok(page.into_string())
}

fn lead(subject: &Subject) -> String {
    let rules = &subject.rules;
    let each = match (rules.time, rules.iterations) {
        (Some(time), Some(n)) => format!("{} s or {n} iterations each", plain(time)),
        (Some(time), None) => format!("{} s each", plain(time)),
        (None, Some(n)) => format!("{n} iterations each"),
        (None, None) => "no end".into(),
    };
    let seeds = match rules.seeds.len() {
        1 => String::new(),
        n => format!(", means over {n} seeds with standard errors"),
    };
    let (width, height) = subject.size;
    let runs = match subject.entries.len() {
        1 => "1 run".into(),
        n => format!("{n} runs in turns of one iteration"),
    };
    let runs = match subject.guests.len() {
        0 => runs,
        1 => format!("{runs} and another renderer"),
        n => format!("{runs} and {n} of other renderers"),
    };
    format!("{runs}, {each}, {width} × {height} pixels{seeds}.")
}

/// What a metric is, in a few words.
fn meaning(metric: Metric) -> &'static str {
    match metric {
        Metric::RelMse => "relMSE, all pixels",
        Metric::RelMseTrimmed => "relMSE, trimmed: without the worst 0.5 % of the pixels",
        Metric::Mse => "MSE, all pixels",
    }
}

/// What the marks of the plots mean.
fn marks(subject: &Subject, summary: &Summary) -> Markup {
    let any = |found: &dyn Fn(Of) -> bool| subject.lines.iter().any(|line| found(line.of));
    html! {
        p.note {
            @if any(&|of| !of.is_raw()) { "Full lines and marks: what a method leaves. Dashes and hollow marks: the picture finished or denoised from it, the time for that added. " }
            @if summary.curves.iter().flat_map(|curve| &curve.mean).any(|spot| spot.fireflies) {
                "Crosses: fireflies rule the figure, for the worst 0.5 % of the pixels hold more than half of it. "
            }
            @if any(&|of| !of.is_ours()) { "Other renderers: each point is a render of its own, started when ours had got as far; seconds are of rendering, without starting up. " }
            "Grey lines have the exponents of theory."
        }
    }
}

/// A curve's name beside its colour.
fn name(subject: &Subject, line: usize) -> Markup {
    let ((r, g, b), of) = (colour(subject, line), &subject.lines[line]);
    let style = match of.of.is_raw() {
        true => format!("background:rgb({r},{g},{b})"),
        false => format!("border:2px solid rgb({r},{g},{b})"),
    };
    html! { span.dot style=(style) {} (of.name) }
}

/// The name of what an entry leaves, or a guest.
fn name_of(subject: &Subject, of: Of) -> Markup {
    subject.lines.iter().position(|line| line.of == of).map_or_else(|| html! {}, |line| name(subject, line))
}

fn targets(subject: &Subject, summary: &Summary) -> Markup {
    if summary.targets.is_empty() {
        return html! {};
    }
    html! {
        section {
            h2 { "Time to a given error" }
            div.wide { table {
                thead { tr { th { "Run" } th.number { "iterations" } th.number { "seconds" } th.number { "relative" } th.number { "core-seconds" } } }
                @for (target, reached) in summary.targets.iter().zip(&summary.reached) {
                    tbody {
                        tr.group { th colspan="5" { (subject.metric.name()) " ≤ " (plain(target.error))
                            @if !target.of.is_empty() { small { " as " (target.of) } } } }
                        @for line in 0..subject.lines.len() { tr { td { (name(subject, line)) } (answer(&reached[line], base(reached))) } }
                    }
                }
                @if let Some(own) = subject.reference.error.of(subject.metric) {
                    tbody { tr.group { th colspan="5" { (subject.metric.name()) " ≤ " (short(own)) small { " the reference's own error: nothing below can be told" } } } }
                }
            } }
            p.note { "From where on the error stays at or below the target; between two measurements it is taken for a power of iterations and of seconds. "
                "“Relative” is the time over that of the first run listed that gets there. “≤”: the first measurement was below the target already."
                @if subject.rules.seeds.len() > 1 { " Standard errors are the jackknife's over seeds." } }
        }
    }
}

/// Seconds of the first run that reaches a target, in the order of the list.
fn base(reached: &[Reached]) -> Option<f64> {
    reached.iter().find_map(|reached| match reached {
        Reached::After { seconds, at_once: false, .. } => Some(seconds.value),
        _ => None,
    })
}

fn answer(reached: &Reached, base: Option<f64>) -> Markup {
    match reached {
        Reached::After { iterations, seconds, core_seconds, at_once: true } => html! {
            td.number { "≤ " (whole(iterations.value)) } td.number { "≤ " (short(seconds.value)) } td.number { "–" }
            td.number { "≤ " (short(core_seconds.value)) }
        },
        Reached::After { iterations, seconds, core_seconds, .. } => html! {
            td.number { (whole(iterations.value)) @if let Some(e) = iterations.error { " ± " (whole(e)) } }
            td.number { (short_with_error(seconds)) }
            td.number { (base.map_or("–".into(), |base| format!("{:.0} %", 100.0 * seconds.value / base))) }
            td.number { (short_with_error(core_seconds)) }
        },
        Reached::Never(iterations, seconds) => html! {
            td.number.dim { "> " (iterations) } td.number.dim { "> " (short(*seconds)) } td.number.dim { "–" } td.number.dim { "–" }
        },
        Reached::BelowReference => html! { td.number.dim colspan="4" { "below the reference's error" } },
        Reached::Unknown => html! { td.number.dim colspan="4" { "not measured" } },
    }
}

/// Iterations, interpolated: whole where that says enough.
fn whole(n: f64) -> String {
    if n < 10.0 { format!("{n:.1}") } else { format!("{n:.0}") }
}

fn fits(subject: &Subject, summary: &Summary) -> Markup {
    let how = if subject.rules.seeds.len() > 1 {
        "over seeds"
    } else {
        "from the scatter about the line; errors of one run at successive moments are not independent, so that it is rather too small (--seeds gives an honest one)"
    };
    html! {
        section {
            h2 { "Exponents" }
            div.wide { table {
                thead { tr { th { "Run" } th.number { "in iterations" } th.number { "theory" } th.number { "in seconds" }
                    th.number { "points" } th.number { "iterations" } th { "Theory" } } }
                tbody { @for (line, of) in subject.lines.iter().enumerate().filter(|(_, line)| line.of.is_raw()) {
                    @let [by_iterations, by_seconds] = &summary.slopes[line];
                    @let theory = summary.theories[line];
                    tr {
                        td { (name(subject, line)) }
                        @match by_iterations {
                            Ok(fit) => {
                                td.number { (with_error(&fit.exponent, 2)) }
                                td.number { (theory.map_or("–".into(), |t| minus(&format!("{:.2}", t.exponent)))) }
                                td.number { (by_seconds.as_ref().map_or("–".into(), |s| with_error(&s.exponent, 2))) }
                                td.number { (fit.points) }
                                td.number { (fit.range.0) "–" (fit.range.1) }
                            }
                            Err(why) => {
                                td.number { "–" }
                                td.number { (theory.map_or("–".into(), |t| minus(&format!("{:.2}", t.exponent)))) }
                                td.dim colspan="3" { small { (unfit(*why)) } }
                            }
                        }
                        td { small { (theory.map_or(if of.of.is_ours() { "no closed form" } else { "its own business" }, |t| t.because)) } }
                    }
                } }
            } }
            p.note { "Slopes of the squared error in the log-log plots, by least squares over the last decade of iterations: of four measurements or more that span a factor of four, lie on a line (± 0.17), are above the reference's own error, and are not ruled by fireflies. Standard errors are "
                (how) ". Theory is the limit of many iterations." }
        }
    }
}

/// Why there is no exponent.
fn unfit(why: Unfit) -> String {
    why.to_string()
}

/// Other renderers: whether their picture is of the same scene, what they took, and why some are missing.
fn guests(subject: &Subject, outcome: &Outcome, summary: &Summary) -> Markup {
    if subject.guests.is_empty() {
        return html! {};
    }
    let seconds = |values: &[f64]| Mean::of(values).map_or("–".into(), |mean| short(mean.value));
    html! {
        section {
            h2 { "Other renderers" }
            div.wide { table {
                thead { tr { th { "Renderer" } th { "Version" } th.number { "mean" br; small { "over the reference's" } } th { "Same scene" }
                    th.number { "starting up" br; small { "s, not counted" } } th { "What is another there" } } }
                tbody { @for (guest, account) in outcome.guests.iter().enumerate() { tr {
                    td { (name_of(subject, Of::Guest(guest))) }
                    td { (if account.version.is_empty() { "–" } else { &account.version }) }
                    td.number { (summary.likeness[guest].as_ref().map_or("–".into(), ratio)) }
                    td { (summary.likeness[guest].as_ref().map_or("–".into(), verdict)) }
                    td.number { (seconds(&account.startups)) }
                    td { small {
                        @if let Some(why) = &account.out { b { "Left out: " } (why) ". " }
                        @if account.unfinished > 0 { (account.unfinished) " renders ended before every pixel had a sample. " }
                        (account.approximations.join("; "))
                    } }
                } } }
            } }
            p.note { "The mean is that of the longest render, its error taking pixels for independent; a picture of the same scene has the reference's within 1 % and twice that error. "
                "Settings are public ones: one sample a pixel from a box filter, 32 segments, nothing clamped, no adaptive sampling, the same threads. OIDN gets albedo and normal from our own path tracing, the same for all and not counted." }
        }
    }
}

fn ratio(of: &Likeness) -> String {
    with_error(&Mean { value: of.ratio, error: Some(of.error) }, 4)
}

fn verdict(of: &Likeness) -> String {
    let off = 100.0 * (of.ratio - 1.0);
    match of.is_same() {
        true if off.abs() <= 1.0 => "within 1 %".into(),
        true => "within 1 % and its noise".into(),
        false => minus(&format!("no: {off:+.1} %")),
    }
}

fn overheads(subject: &Subject, summary: &Summary) -> Markup {
    let cell = |row: &Option<Overhead>, get: &dyn Fn(&Overhead) -> Option<f64>| {
        row.as_ref().and_then(get).map_or("–".into(), short)
    };
    let percent = |ratio: f64| minus(&format!("{:+.1} %", 100.0 * (ratio - 1.0)));
    html! {
        section {
            h2 { "What it costs" }
            div.wide { table {
                thead { tr { th { "Run" } th.number { "iterations" } th.number { "render" br; small { "s" } } th.number { "finish" br; small { "s, once" } }
                    th.number { "per iteration" br; small { "s" } } th.number { "over first" } th.number { "over same method" }
                    th.number { "pilot" br; small { "core-s, once" } } th.number { "light" br; small { "core-s" } } th.number { "map" br; small { "core-s" } }
                    th.number { "eye" br; small { "core-s" } } } }
                tbody { @for (run, row) in summary.overhead.iter().enumerate() { tr {
                    td { (name_of(subject, Of::Estimate(run))) }
                    td.number { (row.as_ref().map_or("–".into(), |row| format!("{:.0}", row.iterations))) }
                    td.number { (cell(row, &|row| Some(row.render_seconds))) }
                    td.number { (cell(row, &|row| row.finish_seconds)) }
                    td.number { (cell(row, &|row| Some(row.seconds_per_iteration))) }
                    td.number { (row.as_ref().filter(|_| run > 0).map_or("–".into(), |row| percent(row.over_first))) }
                    td.number { (row.as_ref().and_then(|row| row.over_plain).map_or("–".into(), percent)) }
                    td.number { (cell(row, &|row| Some(row.pilot))) }
                    td.number { (cell(row, &|row| Some(row.light))) }
                    td.number { (cell(row, &|row| Some(row.map))) }
                    td.number { (cell(row, &|row| Some(row.eye))) }
                } } }
            } }
            p.note { "Seconds per iteration are those of pilot, iterations and finish over the number of iterations. “Over same method” compares with the first run of that method. "
                "Light, map and eye are processor seconds of one iteration; the methods that weigh strategies path by path count their light paths under eye." }
        }
    }
}

fn reference(subject: &Subject, summary: &Summary) -> Markup {
    let (width, height) = (subject.size.0 as f64, subject.size.1 as f64);
    html! {
        section.reference {
            h2 { "Reference" }
            p { (subject.reference.about) ". " (own_error(subject)) }
            div.frame {
                @if let Some(whole) = summary.reference.pictures.first() { img src=(data_url(whole)) alt="the reference"; }
                @for (i, w) in summary.windows.iter().enumerate() {
                    div.box style=(format!("left:{:.3}%;top:{:.3}%;width:{:.3}%;height:{:.3}%",
                        100.0 * w.x as f64 / width, 100.0 * w.y as f64 / height,
                        100.0 * w.width as f64 / width, 100.0 * w.height as f64 / height)) { span { (letter(i)) } }
                }
            }
        }
    }
}

fn own_error(subject: &Subject) -> String {
    let metric = subject.metric.name();
    match subject.reference.error.of(subject.metric) {
        Some(own) => format!(
            "Its own error is {metric} {}. It is taken off every figure, for independent errors add; figures at or below it are not reported.",
            short(own)
        ),
        None => format!("Its own error in {metric} is not known: figures near it say nothing."),
    }
}

fn letter(i: usize) -> char {
    char::from(b'A' + (i % 26) as u8)
}

fn crops(strip: &Strip, summary: &Summary, bar: &str) -> Markup {
    html! {
        section {
            h2 { (strip.title) }
            @for window in 0..summary.windows.len() {
                div.crops {
                    figure {
                        @if let Some(png) = summary.reference.pictures.get(window + 1) { img src=(data_url(png)) alt="reference"; }
                        figcaption { b { (letter(window)) ", reference" }
                            span.scale { img src=(bar) alt="colours of the heat maps"; span { "0" } span.end { "≥ " (format!("{:.0} %", 100.0 * strip.largest)) } } }
                    }
                    @for run in &strip.runs {
                        figure {
                            img src=(data_url(&run.pictures[window])) alt=(run.name);
                            img src=(data_url(&run.heat_maps[window])) alt=(format!("relative error of {}", run.name));
                            figcaption { b { (run.name) } br; (run.caption) }
                        }
                    }
                }
            }
            p.note { "Below each crop its relative error per pixel, the root of the pixel's share of relMSE. Figures are of the whole picture. "
                "Pictures are those of the measurements nearest to the common time or error, of the first seed." }
        }
    }
}

fn runs(subject: &Subject) -> Markup {
    html! {
        section {
            h2 { "Runs" }
            div.wide { table {
                thead { tr { th { "Run" } th { "Method" } th.number { "levels" } th { "finish" } th.number { "light paths" } th.number { "alpha" } th { "options of caustique render" } } }
                tbody { @for (run, entry) in subject.entries.iter().enumerate() {
                    @let (settings, method) = (&entry.settings, entry.settings.method);
                    tr {
                        td { (name_of(subject, Of::Estimate(run))) }
                        td { (method.name()) }
                        td.number { (settings.levels.count) }
                        td { (entry.finish.as_deref().unwrap_or("off")) }
                        td.number { (if method.counts_photons() { settings.photons.to_string() } else { "–".into() }) }
                        td.number { (if method.has_bandwidths() { short(settings.alpha) } else { "–".into() }) }
                        td { code { (entry.options) } }
                    }
                } }
            } }
        }
    }
}

fn facts(subject: &Subject, summary: &Summary) -> Markup {
    html! {
        section {
            h2 { "Conditions" }
            table.facts { tbody {
                @for (name, value) in subject.settings.iter().chain(&subject.machine) {
                    tr { th { (name) } td { (value) } }
                }
            } }
            @if !summary.notes.is_empty() {
                h2 { "Notes" }
                ul { @for note in &summary.notes { li { (note) } } }
            }
        }
    }
}

pub(super) fn data_url(png: &[u8]) -> String {
    format!("data:image/png;base64,{}", STANDARD.encode(png))
}
