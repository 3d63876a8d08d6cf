//! Arguments of the command line: parsers of their values, and what other faces of the program make of them.

use clap::Arg;
use clap::builder::ArgExt;
use serde::Serialize;
use serde_json::Number;
use std::fmt::Display;
use std::ops::Bound::{self, Excluded, Included, Unbounded};
use std::ops::RangeInclusive;
use std::str::FromStr;

/// Range of the values of a numeric option.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ValueRange {
    /// The smallest value or bound; `None` if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min: Option<Number>,
    /// Whether the range excludes `min` itself.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub above_min: bool,
    /// The largest value or bound; `None` if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max: Option<Number>,
    /// Whether the range excludes `max` itself.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub below_max: bool,
}

impl ArgExt for ValueRange {}

/// Extends clap's arguments by numeric options, which have a parser and a range.
pub trait Ranged {
    /// Makes the option take a whole number in a range.
    fn whole<T>(self, range: RangeInclusive<T>) -> Self
    where
        T: FromStr + PartialOrd + Display + Clone + Send + Sync + 'static;
    /// Makes the option take a time above zero in seconds ([`duration`]).
    fn seconds(self, above: f64) -> Self;
    /// Makes the option take a finite number in a range.
    fn between(self, range: (Bound<f64>, Bound<f64>)) -> Self;
}

impl Ranged for Arg {
    fn whole<T>(self, range: RangeInclusive<T>) -> Arg
    where
        T: FromStr + PartialOrd + Display + Clone + Send + Sync + 'static,
    {
        let number = |end: &T| end.to_string().parse().ok();
        let described = ValueRange { min: number(range.start()), max: number(range.end()), ..ValueRange::default() };
        self.value_parser(whole(range)).add(described)
    }

    fn seconds(self, above: f64) -> Arg {
        let described = ValueRange { min: Number::from_f64(above), above_min: true, ..ValueRange::default() };
        self.value_parser(duration).add(described)
    }

    fn between(self, (low, high): (Bound<f64>, Bound<f64>)) -> Arg {
        let number = |bound: Bound<f64>| match bound {
            Included(x) | Excluded(x) => Number::from_f64(x),
            Unbounded => None,
        };
        let described = ValueRange {
            min: number(low),
            above_min: matches!(low, Excluded(_)),
            max: number(high),
            below_max: matches!(high, Excluded(_)),
        };
        self.value_parser(between(low, high)).add(described)
    }
}

/// Extends clap's arguments by what Python and USD make of an option.
pub trait Elsewhere {
    /// The option is no argument in Python, for this reason.
    fn not_in_python(self, reason: &'static str) -> Self;
    /// The option is an argument of this name in Python, where it differs from the name of the field.
    fn in_python(self, name: &'static str) -> Self;
    /// The option is an argument of this name of Python's `Scene`.
    fn of_scene(self, name: &'static str) -> Self;
    /// Whether the render settings of a USD stage may set the option, where its heading does not tell.
    fn in_stages(self, allowed: bool) -> Self;
}

/// Why an option is no argument in Python.
#[derive(Clone, Copy, Debug)]
pub struct NotInPython(pub &'static str);
/// Name of an option in Python.
#[derive(Clone, Copy, Debug)]
pub struct InPython(pub &'static str);
/// Name of an option as an argument of Python's `Scene`.
#[derive(Clone, Copy, Debug)]
pub struct OfScene(pub &'static str);
/// Whether the render settings of a USD stage may set an option.
#[derive(Clone, Copy, Debug)]
pub struct InStages(pub bool);

impl ArgExt for NotInPython {}
impl ArgExt for InPython {}
impl ArgExt for OfScene {}
impl ArgExt for InStages {}

impl Elsewhere for Arg {
    fn not_in_python(self, reason: &'static str) -> Arg {
        self.add(NotInPython(reason))
    }

    fn in_python(self, name: &'static str) -> Arg {
        self.add(InPython(name))
    }

    fn of_scene(self, name: &'static str) -> Arg {
        self.add(OfScene(name))
    }

    fn in_stages(self, allowed: bool) -> Arg {
        self.add(InStages(allowed))
    }
}

/// Makes a parser of finite numbers between two bounds.
pub fn between(low: Bound<f64>, high: Bound<f64>) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync {
    move |text| {
        let value: f64 = text.trim().parse().map_err(|_| "it is not a number".to_string())?;
        if !value.is_finite() {
            return Err("it is not a finite number".into());
        }
        let above = match low {
            Included(l) => value >= l,
            Excluded(l) => value > l,
            Unbounded => true,
        };
        let below = match high {
            Included(h) => value <= h,
            Excluded(h) => value < h,
            Unbounded => true,
        };
        if above && below { Ok(value) } else { Err(describe(low, high)) }
    }
}

/// Describes a range in an error: `it must be in (0, 1]`, `it must be above 0`.
fn describe(low: Bound<f64>, high: Bound<f64>) -> String {
    match (low, high) {
        (Included(l), Unbounded) => format!("it must be at least {l}"),
        (Excluded(l), Unbounded) => format!("it must be above {l}"),
        (Unbounded, Included(h)) => format!("it must be at most {h}"),
        (Unbounded, Excluded(h)) => format!("it must be below {h}"),
        _ => {
            let left = match low {
                Included(l) => format!("[{l}"),
                Excluded(l) => format!("({l}"),
                Unbounded => "(-inf".into(),
            };
            let right = match high {
                Included(h) => format!("{h}]"),
                Excluded(h) => format!("{h})"),
                Unbounded => "inf)".into(),
            };
            format!("it must be in {left}, {right}")
        }
    }
}

/// Parses a finite number.
pub fn finite(text: &str) -> Result<f64, String> {
    between(Unbounded, Unbounded)(text)
}

/// Parses a finite number above zero.
pub fn positive(text: &str) -> Result<f64, String> {
    between(Excluded(0.0), Unbounded)(text)
}

/// Parses a time above zero: seconds, or numbers with units as in `1h30m`, `5m` and `60s`. Returns seconds.
pub fn duration(text: &str) -> Result<f64, String> {
    let mut rest = text.trim();
    if !rest.ends_with(['h', 'm', 's']) {
        return positive(rest);
    }
    let expected = "it must be a time, such as 90, 90s, 5m or 1h30m";
    let mut seconds = 0.0;
    for (unit, length) in [('h', 3600.0), ('m', 60.0), ('s', 1.0)] {
        if let Some((number, after)) = rest.split_once(unit) {
            seconds += length * between(Included(0.0), Unbounded)(number).map_err(|_| expected)?;
            rest = after;
        }
    }
    if rest.is_empty() { positive(&seconds.to_string()) } else { Err(expected.into()) }
}

/// Makes a parser of whole numbers in a range.
pub fn whole<T>(range: RangeInclusive<T>) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync
where
    T: FromStr + PartialOrd + Display + Clone + Send + Sync,
{
    move |text| {
        let refusal = || format!("it must be a whole number from {} to {}", range.start(), range.end());
        text.trim().parse().ok().filter(|n| range.contains(n)).ok_or_else(refusal)
    }
}

/// Parses a relative error, above 0 and below 1.
pub fn relative_error(text: &str) -> Result<f64, String> {
    between(Excluded(0.0), Excluded(1.0))(text)
}

/// Parses a number of threads; 0 means all cores.
pub fn threads(text: &str) -> Result<usize, String> {
    whole(0..=1024)(text)
}

/// Range of a colour channel of radiance. Sums over pixels of larger values would overflow single precision.
const CHANNEL_RANGE: RangeInclusive<f64> = 0.0..=1e30;

/// Parses a factor on radiance, a number in the range of a colour channel.
pub fn strength(text: &str) -> Result<f64, String> {
    let factor = finite(text)?;
    if CHANNEL_RANGE.contains(&factor) {
        Ok(factor)
    } else {
        Err(format!("it must be from 0 to {:e}", CHANNEL_RANGE.end()))
    }
}

/// Parses a colour, three numbers separated by commas, each in the range of a channel. `None` if the text is not a list
/// of numbers.
pub fn rgb(text: &str) -> Option<Result<[f32; 3], String>> {
    let values: Vec<f64> = text.split(',').map(|part| part.trim().parse().ok()).collect::<Option<_>>()?;
    let color: Result<[f64; 3], _> = values.try_into();
    Some(match color {
        Err(values) => Err(format!("a colour has three numbers R,G,B, not {}", values.len())),
        Ok(color) if color.iter().all(|c| CHANNEL_RANGE.contains(c)) => Ok(color.map(|c| c as f32)),
        Ok(_) => Err(format!("a colour has three numbers from 0 to {:e}", CHANNEL_RANGE.end())),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_outside_a_range_are_rejected_with_the_range() {
        let alpha = between(Excluded(0.0), Included(1.0));
        assert_eq!(alpha("1"), Ok(1.0));
        assert_eq!(alpha("0"), Err("it must be in (0, 1]".into()));
        assert_eq!(positive("0"), Err("it must be above 0".into()));
        assert_eq!(strength("-1"), Err("it must be from 0 to 1e30".into()));
        assert_eq!(finite("nan"), Err("it is not a finite number".into()));
        assert_eq!(finite("1e999"), Err("it is not a finite number".into()));
        assert_eq!(finite("one"), Err("it is not a number".into()));
        assert_eq!(finite("-1.5"), Ok(-1.5));
        assert_eq!(relative_error("1"), Err("it must be in (0, 1)".into()));
        assert_eq!(threads("1024"), Ok(1024));
        assert_eq!(threads("-1"), Err("it must be a whole number from 0 to 1024".into()));
    }

    #[test]
    fn times_have_units() {
        for (text, seconds) in
            [("90", 90.0), ("0.5", 0.5), ("60s", 60.0), ("5m", 300.0), ("1h30m", 5400.0), ("1h 2.5s", 3602.5)]
        {
            assert_eq!(duration(text), Ok(seconds), "{text}");
        }
        for wrong in ["5 minutes", "1m2h", "5mm", "m", "-5m", "5d", "", "1h30", "infs", "0s", "0"] {
            assert!(duration(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn colours_are_distinguished_from_file_names() {
        assert_eq!(rgb("1,0.5,0"), Some(Ok([1.0, 0.5, 0.0])));
        assert_eq!(rgb("sky,1.exr"), None);
        assert!(rgb("1,2").is_some_and(|r| r.is_err()));
        for wrong in ["1,2,-3", "1e39,0,0", "inf,0,0", "nan,0,0"] {
            assert!(rgb(wrong).is_some_and(|r| r.is_err()), "{wrong}");
        }
    }
}
