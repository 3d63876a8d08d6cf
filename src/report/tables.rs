//! Tables of the page.

use super::curve::Mean;
use super::entry::PictureSource;
use super::number::{minus, plain, short, short_with_error, with_error};
use super::outcome::Outcome;
use super::overhead::Overhead;
use super::plot::colour;
use super::summary::{MeanRatio, Subject, Summary};
use super::target::Reached;
use maud::{Markup, html};

/// HTML of the name of the curve with index `line`, in the curve's colour.
fn name(subject: &Subject, line: usize) -> Markup {
    let ((r, g, b), curve) = (colour(subject, line), &subject.lines[line]);
    let style = match curve.source.is_raw() {
        true => format!("background:rgb({r},{g},{b})"),
        false => format!("border:2px solid rgb({r},{g},{b})"),
    };
    html! { span.dot style=(style) {} (curve.name) }
}

/// HTML of the name of the curve whose pictures come from `source`, in the curve's colour.
fn name_of(subject: &Subject, source: PictureSource) -> Markup {
    subject.lines.iter().position(|line| line.source == source).map_or_else(|| html! {}, |line| name(subject, line))
}

/// HTML tables of the times that runs take to reach target errors.
pub(super) fn targets(subject: &Subject, summary: &Summary) -> Markup {
    if summary.targets.is_empty() {
        return html! {};
    }
    html! {
        section {
            h2 { "Time to a given error" }
            div.targets { @for (target, reached) in summary.targets.iter().zip(&summary.reached) {
                div.wide { table {
                    thead {
                        tr.group { th colspan="5" { (subject.metric.name()) " ≤ " (plain(target.error))
                            @if !target.origin.is_empty() { small { " as " (target.origin) } } } }
                        tr { th { "Run" } th.number { "iterations" } th.number { "seconds" } th.number { "relative" }
                            th.number { "core-seconds" } }
                    }
                    tbody { @for line in 0..subject.lines.len() {
                        tr { td { (name(subject, line)) } (answer(&reached[line], base(reached))) }
                    } }
                } }
            } }
            @if let Some(own) = subject.reference.error.of(subject.metric) {
                p { "The limit: the reference's own error is " (subject.metric.name()) " " (short(own)) ". Errors \
                    at or below it cannot be measured." }
            }
            p.note { "The time after which the error stays at or below the target; between two measurements it is \
                interpolated as a power of iterations and of seconds. "
                "“Relative” is the time over that of the first listed run that reaches the target. “≤”: the first \
                    measurement was below the target already."
                @if subject.rules.seeds.len() > 1 { " Standard errors are the jackknife's over seeds." } }
        }
    }
}

/// Seconds of the first listed run that reaches a target error, to which others are relative; `None` if none reaches
/// it.
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
            td.number.dim { "> " (iterations) } td.number.dim { "> " (short(*seconds)) }
            td.number.dim { "–" } td.number.dim { "–" }
        },
        Reached::BelowReference => html! { td.number.dim colspan="4" { "below the reference's error" } },
        Reached::Unknown => html! { td.number.dim colspan="4" { "not measured" } },
    }
}

/// The text of an interpolated number of iterations: with one decimal below 10, else rounded.
fn whole(n: f64) -> String {
    if n < 10.0 { format!("{n:.1}") } else { format!("{n:.0}") }
}

/// HTML table of the curves' fitted exponents beside theory.
pub(super) fn fits(subject: &Subject, summary: &Summary) -> Markup {
    let how = if subject.rules.seeds.len() > 1 {
        "over seeds"
    } else {
        "from the scatter about the line; successive errors of one run are not independent, so that it is \
            too small (--seeds gives a correct one)"
    };
    html! {
        section {
            h2 { "Exponents" }
            div.wide { table {
                thead { tr { th { "Run" } th.number { "in iterations" } th.number { "theory" }
                    th.number { "in seconds" }
                    th.number { "points" } th.number { "iterations" } th { "Theory" } } }
                tbody { @for (line, curve) in subject.lines.iter().enumerate().filter(|(_, line)| line.source.is_raw()) {
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
                                td.dim colspan="3" { small { (why.to_string()) } }
                            }
                        }
                        @let unknown = if curve.source.is_ours() { "no closed form" } else { "–" };
                        td { small { (theory.map_or(unknown, |t| t.because)) } }
                    }
                } }
            } }
            p.note { "Slopes of the squared error in the log-log plots, by least squares over the last decade of \
                iterations: of four measurements or more that span a factor of four, lie on a line (± 0.17), are \
                above the reference's own error, and are not dominated by fireflies. Standard errors are "
                (how) ". Theory is the limit of many iterations." }
        }
    }
}

/// HTML table of the errors that an eye sees in the pictures at equal time.
pub(super) fn seen(subject: &Subject, summary: &Summary) -> Markup {
    if summary.seen.is_empty() {
        return html! {};
    }
    let inside = summary.seen.iter().any(|seen| seen.errors.inside.is_some());
    html! {
        section {
            h2 { "Visible errors at equal time" }
            div.wide { table {
                thead { tr { th { "Run" } th.number { "seconds" } th.number { "FLIP" } th.number { "grain" }
                    @if inside { th.number { "FLIP" br; small { "in glass and mirrors" } }
                        th.number { "grain" br; small { "in glass and mirrors" } } } } }
                tbody { @for seen in &summary.seen { tr {
                    td { (name(subject, seen.line)) }
                    td.number { (short(seen.seconds)) }
                    td.number { (short(seen.errors.flip)) }
                    td.number { (short(seen.errors.grain)) }
                    @if let Some(inside) = seen.errors.inside {
                        td.number { (short(inside.flip)) }
                        td.number { (short(inside.grain)) }
                    }
                } } }
            } }
            p.note { "FLIP estimates the visible difference from the reference. Grain is the part of relMSE that \
                neighbouring pixels do not share. Pictures are those of the crops at equal time." }
        }
    }
}

/// HTML table of other renderers: whether the scene is the same, startup times, approximations, and why some are left
/// out.
pub(super) fn peers(subject: &Subject, outcome: &Outcome, summary: &Summary) -> Markup {
    if subject.peers.is_empty() {
        return html! {};
    }
    let seconds = |values: &[f64]| Mean::of(values).map_or("–".into(), |mean| short(mean.value));
    html! {
        section {
            h2 { "Other renderers" }
            div.wide { table {
                thead { tr { th { "Renderer" } th { "Version" } th.number { "mean" br; small { "over the reference's" } }
                    th { "Same scene" }
                    th.number { "starting up" br; small { "s, not counted" } } th { "Approximations" } } }
                tbody { @for (peer, account) in outcome.peers.iter().enumerate() { tr {
                    td { (name_of(subject, PictureSource::Peer(peer))) }
                    td { (if account.version.is_empty() { "–" } else { &account.version }) }
                    td.number { (summary.mean_ratios[peer].as_ref().map_or("–".into(), ratio)) }
                    td { (summary.mean_ratios[peer].as_ref().map_or("–".into(), same_scene)) }
                    td.number { (seconds(&account.startups)) }
                    td { small {
                        @if let Some(why) = &account.left_out { b { "Left out: " } (why) ". " }
                        @if account.unfinished > 0 { (account.unfinished) " renders ended before every pixel had a \
                            sample. " }
                        (account.approximations.join("; "))
                    } }
                } } }
            } }
            p.note { "The mean is that of the longest render, its error taking pixels for independent; a picture of \
                the same scene has the reference's within 1 % and twice that error. "
                "Settings are public ones: one sample a pixel from a box filter, 32 segments, nothing clamped, no \
                    adaptive sampling, the same threads. OIDN gets albedo and normal from our own path tracing, the \
                    same for all and not counted." }
        }
    }
}

fn ratio(mean: &MeanRatio) -> String {
    with_error(&Mean { value: mean.ratio, error: Some(mean.error) }, 4)
}

fn same_scene(mean: &MeanRatio) -> String {
    let off = 100.0 * (mean.ratio - 1.0);
    match mean.is_same() {
        true if off.abs() <= 1.0 => "within 1 %".into(),
        true => "within 1 % and its noise".into(),
        false => minus(&format!("no: {off:+.1} %")),
    }
}

/// HTML table of the cost of an iteration of each entry by phase.
pub(super) fn overheads(subject: &Subject, summary: &Summary) -> Markup {
    let cell = |row: &Option<Overhead>, get: &dyn Fn(&Overhead) -> Option<f64>| {
        row.as_ref().and_then(get).map_or("–".into(), short)
    };
    let percent = |ratio: f64| minus(&format!("{:+.1} %", 100.0 * (ratio - 1.0)));
    html! {
        section {
            h2 { "Cost" }
            div.wide { table {
                thead { tr { th { "Run" } th.number { "iterations" } th.number { "render" br; small { "s" } }
                    th.number { "finish" br; small { "s, once" } }
                    th.number { "per iteration" br; small { "s" } } th.number { "over first" }
                    th.number { "over same method" }
                    th.number { "pilot" br; small { "core-s, once" } }
                    th.number { "light" br; small { "core-s" } } th.number { "map" br; small { "core-s" } }
                    th.number { "eye" br; small { "core-s" } } } }
                tbody { @for (run, row) in summary.overhead.iter().enumerate() { tr {
                    td { (name_of(subject, PictureSource::Estimate(run))) }
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
            p.note { "Seconds per iteration are those of pilot, iterations and finish over the number of iterations. \
                “Over same method” compares with the first run of that method. "
                "Light, map and eye are processor seconds of one iteration; methods that weight techniques path \
                    by path count their light paths under eye." }
        }
    }
}

/// HTML table of the settings of the runs.
pub(super) fn runs(subject: &Subject) -> Markup {
    html! {
        section {
            h2 { "Runs" }
            div.wide { table {
                thead { tr { th { "Run" } th { "Method" } th.number { "levels" } th { "finish" }
                    th.number { "light paths" } th.number { "alpha" } th { "options of caustique render" } } }
                tbody { @for (run, entry) in subject.entries.iter().enumerate() {
                    @let (settings, method) = (&entry.settings, entry.settings.method);
                    tr {
                        td { (name_of(subject, PictureSource::Estimate(run))) }
                        td { (method.name()) }
                        td.number { (settings.levels.count) }
                        td { (entry.finish.as_deref().unwrap_or("off")) }
                        td.number { (if method.takes_photon_count() { settings.photons.to_string() } else { "–".into() }) }
                        td.number { (if method.has_bandwidths() { short(settings.alpha) } else { "–".into() }) }
                        td { code { (entry.options) } }
                    }
                } }
            } }
        }
    }
}
