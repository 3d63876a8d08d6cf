//! Frames of an animation, and frame numbers in file names.

use crate::argument::whole;
use crate::error::{Error, ErrorKind};
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// `--frames A-B[,STEP]`: every STEPth frame from A to B.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frames {
    first: u32,
    last: u32,
    step: u32,
}

/// Largest number of a frame.
const MAX_FRAME: u32 = 10_000_000;

impl Frames {
    /// A range of frames with one frame alone.
    pub fn one(frame: u32) -> Frames {
        Frames { first: frame, last: frame, step: 1 }
    }

    /// The numbers of the frames, in order.
    pub fn iter(self) -> impl ExactSizeIterator<Item = u32> {
        let count = (self.last - self.first) / self.step + 1;
        (0..count).map(move |i| self.first + i * self.step)
    }

    /// The number of the frame, if there is only one; `None` otherwise.
    pub fn single(self) -> Option<u32> {
        (self.iter().len() == 1).then_some(self.first)
    }
}

impl FromStr for Frames {
    type Err = String;

    fn from_str(text: &str) -> Result<Frames, String> {
        let expected = || "it must be A-B, A-B,STEP or a single frame, such as 1-100 or 1-100,2".to_string();
        let number = |text: &str| whole(0..=MAX_FRAME)(text.trim()).map_err(|_| expected());
        let (range, step) = text.split_once(',').map_or((text, Ok(1)), |(range, step)| (range, number(step)));
        let (first, last) = range.split_once('-').unwrap_or((range, range));
        let frames = Frames { first: number(first)?, last: number(last)?, step: step? };
        match frames {
            Frames { step: 0, .. } => Err("the step must be 1 or more".into()),
            Frames { first, last, .. } if last < first => Err("the last frame comes before the first".into()),
            frames => Ok(frames),
        }
    }
}

impl fmt::Display for Frames {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Frames { first, last, .. } if first == last => write!(f, "{first}"),
            Frames { first, last, step: 1 } => write!(f, "{first}-{last}"),
            Frames { first, last, step } => write!(f, "{first}-{last},{step}"),
        }
    }
}

impl Serialize for Frames {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// The path of one frame of a sequence: the frame number replaces `%d`, `%04d`, and each run of `#` (padded to the
/// length of the run) in the file name. `None` if the file name has no such placeholder.
pub fn path_of_frame(path: &Path, frame: u32) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?;
    let (mut made, mut rest, mut found) = (String::new(), name, false);
    while let Some((before, digits, after)) = placeholder(rest) {
        made += before;
        made += &format!("{frame:0digits$}");
        (rest, found) = (after, true);
    }
    found.then(|| path.with_file_name(made + rest))
}

/// The files that exist under the name `pattern`, such as `shot.####.exr`, by the numbers of their frames.
///
/// # Errors
/// The folder cannot be read.
pub fn files_of_frames(pattern: &Path) -> std::io::Result<BTreeMap<u32, PathBuf>> {
    let folder = pattern.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(folder)? {
        let name = entry?.file_name();
        let digits = name.to_str().into_iter().flat_map(|name| name.split(|c: char| !c.is_ascii_digit()));
        let of_frame = |number: u32| {
            let path = path_of_frame(pattern, number)?;
            (path.file_name() == Some(&name)).then_some((number, path))
        };
        found.extend(digits.filter_map(|digits| digits.parse().ok()).find_map(of_frame));
    }
    Ok(found)
}

/// The error that no file has the name `pattern`.
pub fn no_frames(pattern: &Path) -> Error {
    let error = Error::new(ErrorKind::Io, pattern.display(), "no file has such a name");
    error.hint("'####' stands for the number of the frame, as in shot.0001.exr")
}

/// Whether a file name is certainly meant as a pattern. A single `#` is not, because it may be part of the name.
pub fn is_pattern(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    name.contains("##") || name.contains('%') && path_of_frame(path, 0).is_some_and(|_| !name.contains('#'))
}

/// Finds the first placeholder for a frame's number in a file name. Returns the text before it, its minimum number of
/// digits, and the text after it; `None` without a placeholder.
fn placeholder(name: &str) -> Option<(&str, usize, &str)> {
    name.char_indices().find_map(|(at, sign)| {
        let rest = &name[at + sign.len_utf8()..];
        match sign {
            '#' => {
                let behind = rest.trim_start_matches('#');
                Some((&name[..at], 1 + rest.len() - behind.len(), behind))
            }
            '%' => {
                let (digits, behind) = rest.split_once('d')?;
                let width = if digits.is_empty() { 1 } else { digits.strip_prefix('0')?.parse().ok()? };
                (width <= 20).then_some((&name[..at], width, behind))
            }
            _ => None,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_frames_are_parsed_and_printed() {
        let list = |text: &str| text.parse::<Frames>().map(|frames| frames.iter().collect::<Vec<u32>>());
        assert_eq!(list("5"), Ok(vec![5]));
        assert_eq!(list("0-3"), Ok(vec![0, 1, 2, 3]));
        assert_eq!(list("1-10,4"), Ok(vec![1, 5, 9]));
        assert_eq!(list("7-7,3"), Ok(vec![7]));
        for (text, fault) in [
            ("3-1", "the last frame comes before the first"),
            ("1-9,0", "the step must be 1 or more"),
            ("1-", "it must be A-B, A-B,STEP or a single frame, such as 1-100 or 1-100,2"),
            ("-3", "it must be A-B, A-B,STEP or a single frame, such as 1-100 or 1-100,2"),
            ("1-99999999999", "it must be A-B, A-B,STEP or a single frame, such as 1-100 or 1-100,2"),
        ] {
            assert_eq!(list(text), Err(fault.to_string()), "{text}");
        }
        for text in ["5", "1-100", "1-100,2"] {
            assert_eq!(text.parse::<Frames>().map(|frames| frames.to_string()).as_deref(), Ok(text));
        }
        assert_eq!((Frames::one(3).single(), Frames { first: 1, last: 2, step: 1 }.single()), (Some(3), None));
    }

    #[test]
    fn frame_numbers_replace_placeholders_in_file_names() {
        let name =
            |pattern: &str, frame| path_of_frame(Path::new(pattern), frame).map(|path| path.display().to_string());
        assert_eq!(name("a##/out.####.exr", 7).as_deref(), Some("a##/out.0007.exr"));
        assert_eq!(name("#.exr", 12345).as_deref(), Some("12345.exr"));
        assert_eq!(name("é_##_%03d.exr", 5).as_deref(), Some("é_05_005.exr"));
        assert_eq!(name("out%d.exr", 5).as_deref(), Some("out5.exr"));
        for plain in ["out.exr", "50%.exr", "%s.exr", "%99d.exr", "%5d.exr", "a##/out.exr"] {
            assert_eq!(name(plain, 5), None, "{plain}");
        }
        for (path, pattern) in
            [("out.####.exr", true), ("out.%04d.exr", true), ("take#3.exr", false), ("out.exr", false)]
        {
            assert_eq!(is_pattern(Path::new(path)), pattern, "{path}");
        }
    }
}
