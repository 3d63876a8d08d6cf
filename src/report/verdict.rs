//! The result of a comparison in one sentence.

use super::entry::{Metric, PictureSource};
use super::number::{plain, short};
use super::summary::{Subject, Summary};
use super::target::Reached;

/// Which pictures, as they are delivered, reach an error, and after how many seconds, such as `vcm reaches 2 % in 1.2 s;
/// path needs 40 s; bdpt does not get there in 60 s`. The error is the smallest target that one of them reaches. If there is
/// none, says which has the least error; `None` if no error is known.
pub fn verdict(subject: &Subject, summary: &Summary) -> Option<String> {
    let delivered: Vec<usize> = (0..subject.lines.len()).filter(|&line| is_delivered(subject, line)).collect();
    let reached_by_one =
        |target: &usize| delivered.iter().any(|&line| matches!(summary.reached[*target][line], Reached::After { .. }));
    let error = |target: &usize| summary.targets[*target].error;
    let target = (0..summary.targets.len()).filter(reached_by_one).min_by(|a, b| error(a).total_cmp(&error(b)));
    let Some(target) = target else { return least(subject, summary, &delivered) };
    let name = |line: usize| subject.lines[line].name.as_str();
    let (mut reach, mut fail) = (Vec::new(), Vec::new());
    for &line in &delivered {
        match &summary.reached[target][line] {
            Reached::After { seconds, at_once, .. } => reach.push((seconds.value, *at_once, name(line))),
            Reached::Never(_, seconds) => {
                fail.push(format!("{} does not get there in {} s", name(line), short(*seconds)))
            }
            Reached::BelowReference | Reached::Unknown => {}
        }
    }
    reach.sort_by(|a, b| a.0.total_cmp(&b.0));
    let goal = goal(subject.metric, error(&target));
    let say = |(i, (seconds, at_once, name)): (usize, &(f64, bool, &str))| {
        let verb = if i == 0 { format!("reaches {goal} in") } else { "needs".into() };
        format!("{name} {verb} {}{} s", if *at_once { "at most " } else { "" }, short(*seconds))
    };
    let all: Vec<String> = reach.iter().enumerate().map(say).chain(fail).collect();
    Some(all.join("; "))
}

/// The curve that ends with the least error, with that error.
fn least(subject: &Subject, summary: &Summary, delivered: &[usize]) -> Option<String> {
    let ends = delivered.iter().filter_map(|&line| Some((line, summary.curves[line].last()?)));
    let (line, end) = ends.min_by(|(_, a), (_, b)| a.figure.total_cmp(&b.figure))?;
    let (name, goal) = (&subject.lines[line].name, goal(subject.metric, end.figure));
    Some(format!("no target is reached; {name} ends with the least error, {goal} after {} s", short(end.seconds)))
}

/// Whether a curve is of pictures as they are delivered: finished or denoised where the comparison has such pictures.
fn is_delivered(subject: &Subject, line: usize) -> bool {
    let finished = match subject.lines[line].source {
        PictureSource::Estimate(entry) => PictureSource::Finished(entry),
        PictureSource::Peer(peer) => PictureSource::Denoised(peer),
        PictureSource::Finished(_) | PictureSource::Denoised(_) => return true,
    };
    !subject.lines.iter().any(|line| line.source == finished)
}

/// A target error in words: its root in per cent, if it is relative.
fn goal(metric: Metric, error: f64) -> String {
    match metric {
        Metric::RelMse | Metric::RelMseTrimmed => {
            format!("an error of {} %", short(100.0 * error.sqrt()))
        }
        Metric::Mse => format!("{} {}", metric.name(), plain(error)),
    }
}
