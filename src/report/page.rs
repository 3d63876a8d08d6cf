//! The report as a self-contained HTML page with pictures, plots and style.

use super::crop;
use super::entry::{Metric, PictureSource};
use super::number::{plain, short};
use super::outcome::Outcome;
use super::summary::{Strip, Subject, Summary};
use super::tables::{fits, overheads, peers, runs, seen, targets};
use super::verdict::verdict;
use crate::error::Result;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{DOCTYPE, Markup, PreEscaped, html};

const STYLE: &str = include_str!("page.css");

/// Plots of error curves, side by side under a heading.
pub struct Plots {
    /// Text of the heading.
    pub heading: &'static str,
    /// Metric and SVG document of each plot.
    pub plots: Vec<(Metric, String)>,
}

/// The HTML page of the report on a comparison.
///
/// # Errors
/// None beyond lack of memory.
pub fn html(subject: &Subject, outcome: &Outcome, summary: &Summary, plots: &[Plots]) -> Result<String> {
    let bar = data_url(&crop::heat_bar()?);
    let title = format!("Accuracy against time: {}", subject.scene);
    let body = html! {
        @if let Some(verdict) = verdict(subject, summary) { p.lead { b { (verdict) "." } } }
        @for row in plots.iter().filter(|row| !row.plots.is_empty()) {
            section { h2 { (row.heading) } div.pair {
                @for (metric, svg) in &row.plots { div.plot { h3 { (meaning(*metric)) } (PreEscaped(svg)) } }
            } }
        }
        (marks(subject, summary))
        (targets(subject, summary))
        (seen(subject, summary))
        (fits(subject, summary))
        (peers(subject, outcome, summary))
        (overheads(subject, summary))
        (reference(subject, summary))
        @for strip in &summary.strips { (crops(strip, summary, &bar)) }
        (runs(subject))
        (facts(subject, summary))
    };
    Ok(document(&title, &lead(subject), &body))
}

/// An HTML document with the style of the report: its title, `lead`, a sentence below the title, and its body.
pub(super) fn document(title: &str, lead: &str, body: &Markup) -> String {
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
                    p.lead { (lead) }
                }
                (body)
                footer { "caustique " (env!("CARGO_PKG_VERSION")) }
            }
        }
    };
    page.into_string()
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
    let runs = match subject.peers.len() {
        0 => runs,
        1 => format!("{runs} and another renderer"),
        n => format!("{runs} and {n} of other renderers"),
    };
    format!("{runs}, {each}, {width} × {height} pixels{seeds}.")
}

/// Heading of a plot of errors in `metric`, in words.
fn meaning(metric: Metric) -> &'static str {
    match metric {
        Metric::RelMse => "relMSE, all pixels",
        Metric::RelMseTrimmed => "relMSE, trimmed: without the worst 0.5 % of the pixels",
        Metric::Mse => "MSE, all pixels",
    }
}

/// HTML legend of the marks in the plots.
fn marks(subject: &Subject, summary: &Summary) -> Markup {
    let any = |found: &dyn Fn(PictureSource) -> bool| subject.lines.iter().any(|line| found(line.source));
    html! {
        p.note {
            @if any(&|of| !of.is_raw()) { "Full lines and marks: pictures as rendered. Dashes and hollow marks: \
                finished or denoised pictures, the time for that included. " }
            @if summary.curves.iter().flat_map(|curve| &curve.mean).any(|curve_point| curve_point.fireflies) {
                "Crosses: fireflies dominate the error; the worst 0.5 % of the pixels hold more than half of it. "
            }
            @if any(&|of| !of.is_ours()) { "Other renderers: each point is a separate render, started when our \
                runs had taken the same time; seconds do not include startup. " }
            "Grey lines have the exponents of theory."
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
                @if let Some(whole) = summary.reference.pictures.first() {
                    img src=(data_url(whole)) alt="the reference";
                }
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
            "Its own error is {metric} {}. It is subtracted from every figure, because independent errors add; \
                figures at or below it are not reported.",
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
                        @if let Some(png) = summary.reference.pictures.get(window + 1) {
                            img src=(data_url(png)) alt="reference";
                        }
                        figcaption { b { (letter(window)) ", reference" }
                            span.scale {
                                img src=(bar) alt="colours of the heat maps";
                                span { "0" }
                                span.end { "≥ " (format!("{:.0} %", 100.0 * strip.largest)) }
                            } }
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
            p.note { "Below each crop its relative error per pixel, the root of the pixel's share of relMSE. Figures \
                are of the whole picture. "
                "Pictures are those of the measurements nearest to the common time or error, of the first seed." }
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
