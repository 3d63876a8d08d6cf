//! Warnings for people: one line for each kind, with the number of its warnings and the first names.

/// Maximum number of subjects that the line of a kind names.
const MAX_SUBJECTS: usize = 10;

/// The lines to print for warnings: each one if `verbose`, else one for each kind, in the order of their first
/// warnings. Two warnings are of a kind if they have subjects, and differ only in names and numbers.
pub fn lines(warnings: &[String], verbose: bool) -> Vec<String> {
    if verbose {
        return warnings.to_vec();
    }
    let mut kinds: Vec<(Option<String>, Vec<&str>)> = Vec::new();
    for warning in warnings {
        let kind = split(warning).map(|_| kind(warning));
        match kinds.iter_mut().find(|(known, _)| known.is_some() && *known == kind) {
            Some((_, list)) => list.push(warning),
            None => kinds.push((kind, vec![warning])),
        }
    }
    kinds.into_iter().map(|(_, list)| line(&list)).collect()
}

/// The line of warnings of one kind: the first one, with the number and the subjects of the others.
fn line(warnings: &[&str]) -> String {
    let Some((first, others)) = warnings.split_first().filter(|(_, others)| !others.is_empty()) else {
        return warnings.concat();
    };
    let names = |warning: &str| split(warning).map(|(_, rest)| quoted(rest)).unwrap_or_default();
    let describe = |warning: &&str| {
        let subject = split(warning).map(|(subject, _)| subject).unwrap_or_default();
        match names(warning) {
            // The subject alone may not tell the warning from the first one.
            own if own != names(first) => format!("{subject} ({})", own.join(", ")),
            _ => subject.into(),
        }
    };
    let mut also: Vec<String> = others.iter().map(describe).collect();
    also.dedup();
    let more = if also.len() < MAX_SUBJECTS { "" } else { ", ..." };
    also.truncate(MAX_SUBJECTS - 1);
    let also = also.join(", ");
    let count = warnings.len();
    format!("{first} ({count} warnings of this kind, also {also}{more}; --verbose prints all)")
}

/// Splits a warning into its subject and the rest. The subject ends at a colon, or at the first name. `None` if the
/// warning has no subject.
fn split(warning: &str) -> Option<(&str, &str)> {
    let is_name = |at: usize| warning[..at].matches('"').count() % 2 == 1;
    let colon = warning.match_indices(": ").map(|(at, _)| at).find(|&at| !is_name(at));
    let name = || warning.match_indices('"').nth(1).map(|(at, _)| at + 1);
    colon.or_else(name).map(|at| warning.split_at(at))
}

/// The names in a text, with their quotation marks.
fn quoted(text: &str) -> Vec<String> {
    text.split('"').skip(1).step_by(2).map(|name| format!("\"{name}\"")).collect()
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
        let warnings: Vec<String> = (1..=12)
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
                "mesh \"m1\", primitive 1: 10 triangles without area left out (12 warnings of this kind, also mesh \"m2\", \
                 primitive 2, mesh \"m3\", primitive 3, mesh \"m4\", primitive 4, mesh \"m5\", primitive 5, mesh \"m6\", \
                 primitive 6, mesh \"m7\", primitive 7, mesh \"m8\", primitive 8, mesh \"m9\", primitive 9, mesh \"m10\", \
                 primitive 10, ...; --verbose prints all)",
                "the scene has no camera",
                "material \"a\": it is odd (2 warnings of this kind, also material \"b\"; --verbose prints all)",
            ]
        );
        assert_eq!(lines(&warnings, true), warnings);
    }

    /// No name is lost: each is in the line of its kind, whether it is before the colon or after it, and warnings without
    /// a subject have lines of their own.
    #[test]
    fn a_line_names_what_its_warnings_are_about() {
        let warnings = [
            "extension \"A_one\" is not supported and is ignored",
            "extension \"B: two\" is not supported and is ignored",
            "material \"m: 1\": its \"a\" is odd",
            "material \"m: 1\": its \"b\" is odd",
            "it is 1 m away",
            "it is 2 m away",
        ]
        .map(String::from);
        assert_eq!(
            lines(&warnings, false),
            [
                "extension \"A_one\" is not supported and is ignored (2 warnings of this kind, also extension \"B: two\"; \
                 --verbose prints all)",
                "material \"m: 1\": its \"a\" is odd (2 warnings of this kind, also material \"m: 1\" (\"b\"); \
                 --verbose prints all)",
                "it is 1 m away",
                "it is 2 m away",
            ]
        );
    }
}
