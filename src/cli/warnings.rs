//! Warnings for people: one line for each kind, with the number of its warnings and the first names.

/// Maximum number of names that the line of a kind has.
const MAX_NAMES: usize = 3;

/// The lines to print for warnings: each one if `verbose`, else one for each kind, in the order of their first
/// warnings. Two warnings are of a kind if they differ only in names and numbers.
pub fn lines(warnings: &[String], verbose: bool) -> Vec<String> {
    if verbose {
        return warnings.to_vec();
    }
    let mut kinds: Vec<(String, Vec<&str>)> = Vec::new();
    for warning in warnings {
        let kind = kind(warning);
        match kinds.iter_mut().find(|(known, _)| *known == kind) {
            Some((_, list)) => list.push(warning),
            None => kinds.push((kind, vec![warning])),
        }
    }
    kinds.into_iter().map(|(_, list)| line(&list)).collect()
}

/// The line of warnings of one kind: the first one, with the number and the names of the others.
fn line(warnings: &[&str]) -> String {
    let Some((first, others)) = warnings.split_first().filter(|(_, others)| !others.is_empty()) else {
        return warnings.concat();
    };
    let subject = |warning: &&str| warning.split_once(": ").map_or_else(String::new, |(subject, _)| subject.into());
    let mut names: Vec<String> = others.iter().map(subject).collect();
    names.dedup();
    let more = if names.len() < MAX_NAMES { "" } else { ", ..." };
    names.truncate(MAX_NAMES - 1);
    let names = names.join(", ");
    let count = warnings.len();
    format!("{first} ({count} warnings of this kind, also {names}{more}; --verbose prints all)")
}

/// The warning without its quoted names and its numbers.
fn kind(warning: &str) -> String {
    let unquoted = warning.split('"').step_by(2).collect::<Vec<_>>().join("\"");
    let mut kind = String::new();
    for c in unquoted.chars() {
        match c.is_ascii_digit() {
            true if kind.ends_with('0') => {}
            true => kind.push('0'),
            false => kind.push(c),
        }
    }
    kind
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_of_a_kind_are_one_line() {
        let warnings: Vec<String> = (1..=5)
            .map(|i| format!("mesh \"m{i}\", primitive {i}: {i}0 triangles without area left out"))
            .chain([
                "the scene has no camera".into(),
                "material \"a\": it is odd".into(),
                "material \"b\": it is odd".into(),
            ])
            .collect();
        assert_eq!(
            lines(&warnings, false),
            [
                "mesh \"m1\", primitive 1: 10 triangles without area left out (5 warnings of this kind, also mesh \"m2\", \
                 primitive 2, mesh \"m3\", primitive 3, ...; --verbose prints all)",
                "the scene has no camera",
                "material \"a\": it is odd (2 warnings of this kind, also material \"b\"; --verbose prints all)",
            ]
        );
        assert_eq!(lines(&warnings, true), warnings);
    }
}
