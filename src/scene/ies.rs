//! Reads photometric profiles: IESNA LM-63 files of 1986, 1991, 1995, 2002 and 2019, with type C photometry.

use crate::error::{Error, ErrorKind, Result};
use crate::light::Profile;
use std::fmt::Display;

/// Maximum size of a file (bytes). Files of luminaires have some kilobytes.
pub const MAX_BYTES: u64 = 64 << 20;
/// Largest number of angles of a kind.
const MAX_ANGLES: usize = 1 << 16;
const DAMAGED: &str = "get the file again from the maker of the luminaire, or export it again";

/// The content of a profile's file.
#[derive(Clone, Debug, PartialEq)]
pub struct Photometry {
    /// Angles to the axis (degrees), ascending, from 0 to 180; 0 is the direction in which the light points.
    vertical: Vec<f32>,
    /// Angles about the axis (degrees), ascending over a whole turn, each with the index of its measurements in
    /// `candela`; the last is a turn after the first.
    horizontal: Vec<(f32, usize)>,
    /// Luminous intensity (cd), with all factors of the file: all vertical angles of a horizontal angle together.
    candela: Vec<f32>,
}

/// The rotation of a profile about the axis of its light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Turn {
    /// Angle from the light's X axis to horizontal angle 0, counter-clockwise as seen from behind the light (degrees).
    pub degrees: f32,
    /// Whether the horizontal angles run clockwise, as seen from behind the light.
    pub clockwise: bool,
}

/// The numbers of a file after its TILT line, with their lines.
struct Numbers<'t> {
    words: Box<dyn Iterator<Item = (usize, &'t str)> + 't>,
    line: usize,
}

fn fault(line: usize, cause: impl Display) -> Error {
    Error::new(ErrorKind::Scene, format!("line {line}"), cause)
}

impl<'t> Numbers<'t> {
    /// The numbers of the lines from `first` on; `lines` are all lines of the file.
    fn new(lines: &[&'t str], first: usize) -> Numbers<'t> {
        let rest: Vec<&'t str> = lines[first..].to_vec();
        let words = rest.into_iter().enumerate().flat_map(move |(i, line)| {
            let separates = |c: char| c.is_whitespace() || c == ',';
            line.split(separates).filter(|word| !word.is_empty()).map(move |word| (first + i + 1, word))
        });
        Numbers { words: Box::new(words), line: first + 1 }
    }

    /// The next number, which messages call `what`.
    fn next(&mut self, what: impl Display) -> Result<f64> {
        let Some((line, word)) = self.words.next() else {
            return Err(fault(self.line, format!("the file ends before {what}")).hint(DAMAGED));
        };
        self.line = line;
        match word.parse::<f64>() {
            Ok(number) if number.is_finite() && number.abs() < 1e30 => Ok(number),
            _ => Err(fault(line, format!("{what}: \"{}\" is not a number", shortened(word))).hint(DAMAGED)),
        }
    }

    /// The next number, which must be a whole one from `least` to `most`.
    fn count(&mut self, what: &str, least: usize, most: usize) -> Result<usize> {
        let number = self.next(what)?;
        if number.fract() == 0.0 && (least as f64..=most as f64).contains(&number) {
            return Ok(number as usize);
        }
        let cause = format!("{what} is {number}; it must be a whole number from {least} to {most}");
        Err(fault(self.line, cause).hint(DAMAGED))
    }

    /// The next `count` angles (degrees), which must ascend.
    fn angles(&mut self, what: &str, count: usize) -> Result<Vec<f32>> {
        let mut angles: Vec<f32> = Vec::new();
        for k in 1..=count {
            let angle = self.next(format_args!("{what} {k} of {count}"))? as f32;
            if angles.last().is_some_and(|&last| last >= angle) {
                return Err(fault(self.line, format!("{what} {k} is {angle}, not above the one before")).hint(DAMAGED));
            }
            angles.push(angle);
        }
        Ok(angles)
    }
}

/// A word of the file for messages.
fn shortened(word: &str) -> String {
    word.chars().take(24).collect()
}

/// Reads the bytes of a file. Adds warnings about features that are ignored; the errors name the line.
///
/// # Errors
/// The file is damaged, or has photometry of another type than C.
pub fn parse(bytes: &[u8], warnings: &mut Vec<String>) -> Result<Photometry> {
    let text = String::from_utf8_lossy(bytes).replace("\r\n", "\n").replace('\r', "\n");
    let text = text.trim_start_matches('\u{feff}');
    let lines: Vec<&str> = text.split('\n').collect();
    let first = lines[0].trim();
    let tilt = lines.iter().position(|line| line.trim_start().to_ascii_uppercase().starts_with("TILT"));
    let Some(tilt) = tilt else {
        let cause = "it has no line TILT=, so it is not an IES profile (IESNA LM-63)";
        return Err(fault(1, cause).hint("give a photometric file (.ies) of the luminaire"));
    };
    let mut numbers = Numbers::new(&lines, tilt + 1);
    match lines[tilt].split_once('=').map(|(_, kind)| kind.trim().to_ascii_uppercase()).as_deref() {
        Some("NONE") => {}
        Some("INCLUDE") => {
            numbers.count("the geometry of its tilt", 0, 3)?;
            let pairs = numbers.count("the number of its tilt angles", 0, MAX_ANGLES)?;
            for k in 1..=pairs {
                numbers.next(format_args!("tilt angle {k} of {pairs}"))?;
            }
            let mut changes = false;
            for k in 1..=pairs {
                changes |= numbers.next(format_args!("tilt factor {k} of {pairs}"))? != 1.0;
            }
            if changes {
                warnings.push("its tilt is ignored: it shines as in its upright position".into());
            }
        }
        Some(_) => warnings.push("its file of tilt factors is ignored: it shines as in its upright position".into()),
        None => {
            return Err(fault(tilt + 1, "the line TILT has no =").hint(DAMAGED));
        }
    }
    numbers.next("the number of its lamps")?;
    numbers.next("the lumens of a lamp")?;
    let multiplier = numbers.next("its multiplier")?;
    let vertical = numbers.count("the number of vertical angles", 2, MAX_ANGLES)?;
    let horizontal = numbers.count("the number of horizontal angles", 1, MAX_ANGLES)?;
    match numbers.count("its photometric type", 1, 3)? {
        1 => {}
        other => {
            let cause = format!("its photometry is of type {}, only type C is read", ["B", "A"][other - 2]);
            return Err(fault(numbers.line, cause).hint("convert the profile to type C photometry"));
        }
    }
    for what in ["its unit of length", "its width", "its length", "its height"] {
        numbers.next(what)?;
    }
    let ballast = numbers.next("its ballast factor")?;
    let lamp = numbers.next("its ballast-lamp factor")?;
    numbers.next("its watts")?;
    // From 1995 on the second factor has another meaning.
    let old = !first.to_ascii_uppercase().starts_with("IES") || first.to_ascii_uppercase().starts_with("IESNA91");
    let factor = multiplier * ballast * if old { lamp } else { 1.0 };
    if !(factor > 0.0 && factor < 1e20) {
        return Err(fault(numbers.line, format!("its factors multiply the light by {factor}")).hint(DAMAGED));
    }
    let vertical = numbers.angles("vertical angle", vertical)?;
    if vertical[0] < 0.0 || vertical[vertical.len() - 1] > 180.0 {
        return Err(fault(numbers.line, "a vertical angle is outside 0 to 180 degrees").hint(DAMAGED));
    }
    let angles = numbers.angles("horizontal angle", horizontal)?;
    let horizontal = whole_turn(&angles).ok_or_else(|| {
        let (start, end) = (angles[0], angles[angles.len() - 1]);
        let cause = format!("its horizontal angles run from {start} to {end}; type C has one angle, or 0 to 90, 0 to 180, 90 to 270 or 0 to 360 degrees");
        fault(numbers.line, cause).hint(DAMAGED)
    })?;
    let count = vertical.len() * angles.len();
    let (mut candela, mut negative) = (Vec::new(), 0);
    for k in 1..=count {
        let value = numbers.next(format_args!("intensity {k} of {count}"))?;
        negative += usize::from(value < 0.0);
        candela.push((value.max(0.0) * factor) as f32);
    }
    if negative > 0 {
        warnings.push(format!("{negative} of its intensities are negative; they are taken as zero"));
    }
    if !candela.iter().any(|&x| x > 0.0) {
        return Err(fault(numbers.line, "all its intensities are zero").hint(DAMAGED));
    }
    Ok(Photometry { vertical, horizontal, candela })
}

/// Extends the horizontal angles of a file by its symmetry to a whole turn: ascending angles, each with the index of its
/// measurements. `None` if the angles are not those of type C photometry.
fn whole_turn(angles: &[f32]) -> Option<Vec<(f32, usize)>> {
    let (start, end) = (*angles.first()?, *angles.last()?);
    let own = || angles.iter().copied().zip(0..);
    let mut all: Vec<(f32, usize)> = match (start, end) {
        _ if angles.len() == 1 => vec![(0.0, 0)],
        (0.0, 90.0) => {
            let half: Vec<(f32, usize)> = own().chain(own().map(|(a, i)| (180.0 - a, i))).collect();
            half.iter().copied().chain(half.iter().map(|&(a, i)| (a + 180.0, i))).collect()
        }
        (0.0, 180.0) => own().chain(own().map(|(a, i)| (360.0 - a, i))).collect(),
        (90.0, 270.0) => own().chain(own().map(|(a, i)| (540.0 - a, i))).collect(),
        // Some files leave 360 out, because it repeats 0.
        (0.0, end) if end > 180.0 && end <= 360.0 => own().collect(),
        _ => return None,
    };
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.dedup_by_key(|(angle, _)| *angle);
    let (first, index) = all[0];
    all.retain(|&(angle, _)| angle < first + 360.0);
    all.push((first + 360.0, index));
    Some(all)
}

impl Photometry {
    /// The largest luminous intensity (cd).
    pub fn peak(&self) -> f32 {
        self.candela.iter().copied().fold(0.0, f32::max)
    }

    /// The relative intensity, for a light whose axis is that of the profile. `None` if rounding leaves no profile.
    pub fn profile(&self, turn: Turn) -> Option<Profile> {
        // Azimuths of the light's frame run clockwise, as seen from behind the light.
        let azimuth = |angle: f32| {
            let counter_clockwise = turn.degrees + if turn.clockwise { -angle } else { angle };
            -counter_clockwise / 360.0
        };
        let mut columns: Vec<(f32, usize)> = self.horizontal.iter().map(|&(angle, i)| (azimuth(angle), i)).collect();
        columns.sort_by(|a, b| a.0.total_cmp(&b.0));
        // Whole turns would cost digits.
        let whole = columns[0].0.floor();
        columns.iter_mut().for_each(|(turns, _)| *turns -= whole);
        columns.dedup_by_key(|(turns, _)| *turns);
        let n = self.vertical.len();
        let mut polar: Vec<f32> = self.vertical.iter().map(|angle| angle.to_radians()).collect();
        let values = columns.iter().flat_map(|&(_, i)| &self.candela[i * n..(i + 1) * n]).copied().collect();
        polar[n - 1] = polar[n - 1].min(std::f32::consts::PI);
        Profile::new(polar, columns.into_iter().map(|(turns, _)| turns).collect(), values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::random::{Domain, Purpose, Stream};

    /// A file with the given first lines, horizontal angles and intensities at vertical angles 0, 45 and 90.
    fn file(head: &str, horizontal: &[f32], value: impl Fn(usize, usize) -> f32) -> String {
        let angles: Vec<String> = horizontal.iter().map(f32::to_string).collect();
        let rows: Vec<String> = (0..horizontal.len())
            .map(|j| (0..3).map(|i| value(i, j).to_string()).collect::<Vec<_>>().join(" "))
            .collect();
        format!(
            "{head}\r\n1 1000 2 3 {} 1 2 0.1, 0.2, 0.3\r\n0.5 0.25 30\r\n0 45 90\r\n{}\r\n{}\r\n",
            horizontal.len(),
            angles.join(" "),
            rows.join("\r\n")
        )
    }

    fn read(text: &str) -> Photometry {
        let mut warnings = Vec::new();
        let read = parse(text.as_bytes(), &mut warnings).unwrap_or_else(|error| panic!("{error}: {text}"));
        assert!(warnings.is_empty(), "{warnings:?}");
        read
    }

    /// The direction in the light's space (-Z ahead, X to the right and Y up, seen from behind) at angles in degrees.
    fn direction(vertical: f32, horizontal: f32) -> Vec3 {
        let (sin, cos) = vertical.to_radians().sin_cos();
        let (y, x) = horizontal.to_radians().sin_cos();
        Vec3::new(sin * x, sin * y, -cos)
    }

    /// Relative intensity in a direction of the light's space.
    fn along(profile: &Profile, d: Vec3) -> f32 {
        // The frame of a light: its normal is the axis -Z, its x axis the light's.
        let d = Vec3::new(d.x, -d.y, -d.z);
        let distribution =
            crate::light::Distribution::new(std::sync::Arc::new(crate::light::Pattern::Profile(profile.clone())), None);
        distribution.expect("light").relative(d).x
    }

    #[test]
    fn the_factors_of_each_year_multiply_the_intensities() {
        let value = |i: usize, _: usize| [100.0, 50.0, 0.0][i];
        for (head, factor) in [
            ("TILT=NONE", 0.25),
            ("A luminaire\nwith a name\nTILT=NONE", 0.25),
            ("IESNA91\n[TEST] 7\nTILT=NONE", 0.25),
            ("IESNA:LM-63-1995\n[MANUFAC] a, b\nTILT=NONE", 1.0),
            ("IESNA:LM-63-2002\n[LUMCAT] x\nTILT = NONE", 1.0),
            ("IES:LM-63-2019\nTILT=NONE", 1.0),
            ("IESNA:LM-63-2002\nTILT=INCLUDE\n1\n2\n0 90\n1.0 1.0", 1.0),
        ] {
            let read = read(&file(head, &[0.0], value));
            assert_eq!(read.peak(), 100.0 * 2.0 * 0.5 * factor, "{head}");
        }
        let tilted = file("IESNA:LM-63-2002\nTILT=INCLUDE\n1\n2\n0 90\n1.0 0.8", &[0.0], value);
        let mut warnings = Vec::new();
        assert!(parse(tilted.as_bytes(), &mut warnings).is_ok() && warnings[0].contains("tilt"), "{warnings:?}");
    }

    /// For each symmetry, the intensity at random directions is the interpolated value at the mirrored angle.
    #[test]
    fn symmetries_extend_the_angles_to_a_turn() {
        let value = |i: usize, j: usize| [90.0, 60.0, 30.0][i] - 10.0 * j as f32;
        type Mirror = fn(f32) -> f32;
        let cases: [(&[f32], Mirror); 6] = [
            (&[0.0], |_| 0.0),
            (&[0.0, 45.0, 90.0], |a| if a % 180.0 > 90.0 { 180.0 - a % 180.0 } else { a % 180.0 }),
            (&[0.0, 90.0, 180.0], |a| if a > 180.0 { 360.0 - a } else { a }),
            (&[90.0, 180.0, 270.0], |a| if !(90.0..=270.0).contains(&a) { (540.0 - a) % 360.0 } else { a }),
            (&[0.0, 180.0, 360.0], |a| a),
            (&[0.0, 120.0, 240.0], |a| a),
        ];
        for (horizontal, mirror) in cases {
            // The last measurement of a whole turn repeats the first.
            let value = |i: usize, j: usize| value(i, if horizontal[j] == 360.0 { 0 } else { j });
            let read = read(&file("IESNA:LM-63-1995\nTILT=NONE", horizontal, value));
            for turn in [0.0f32, 37.0, -290.0] {
                for clockwise in [false, true] {
                    let profile = read.profile(Turn { degrees: turn, clockwise }).expect("a profile");
                    for i in 0..200 {
                        let u = Stream::new(3, 0, Domain::Test, i).vertex(0).two(Purpose::Direction);
                        let (vertical, angle) = (90.0 * u.x, 360.0 * u.y);
                        let own = mirror(angle);
                        let k = horizontal.iter().rposition(|&a| a <= own).unwrap_or(0);
                        let next = if k + 1 < horizontal.len() { horizontal[k + 1] } else { 360.0 };
                        let t =
                            if horizontal.len() == 1 { 0.0 } else { (own - horizontal[k]) / (next - horizontal[k]) };
                        let row = |i: usize| {
                            let after = value(i, (k + 1) % horizontal.len());
                            value(i, k) + (after - value(i, k)) * t
                        };
                        let (i, x) = ((vertical / 45.0) as usize, (vertical / 45.0).fract());
                        let expected = (row(i) + (row((i + 1).min(2)) - row(i)) * x) / 90.0;
                        let seen = turn + if clockwise { -angle } else { angle };
                        let found = along(&profile, direction(vertical, seen));
                        assert!(
                            (found - expected).abs() < 1e-4,
                            "{horizontal:?} {turn} {clockwise} {angle} {vertical}: {found}, {expected}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn errors_name_the_line_the_fault_and_the_remedy() {
        let good = file("IESNA:LM-63-1995\nTILT=NONE", &[0.0], |i, _| [100.0, 50.0, 0.0][i]);
        let cases = [
            ("no profile".to_string(), "line 1", "no line TILT="),
            (good.replace("TILT=NONE", "TILT"), "line 2", "no ="),
            (good.replace("1 1000", "1 many"), "line 3", "\"many\" is not a number"),
            (good.replace("1 1000", "1 nan"), "line 3", "\"nan\" is not a number"),
            (good.replace(" 3 1 1 2 ", " 3.5 1 1 2 "), "line 3", "number of vertical angles is 3.5"),
            (good.replace(" 3 1 1 2 ", " 3 1 2 2 "), "line 3", "type B"),
            (good.replace(" 3 1 1 2 ", " 3 1 3 2 "), "line 3", "type A"),
            (good.replace("0 45 90", "0 45 45"), "line 5", "vertical angle 3 is 45, not above"),
            (good.replace("0 45 90", "0 45 190"), "line 5", "outside 0 to 180"),
            (good.replace("100 50 0", "100 50"), "line 7", "ends before intensity 3 of 3"),
            (good.replace("100 50 0", "0 0 0"), "line 7", "all its intensities are zero"),
            (good.replace("0.5 0.25", "0 0.25"), "line 4", "multiply the light by 0"),
            (
                file("IESNA:LM-63-1995\nTILT=NONE", &[10.0, 90.0], |_, _| 1.0),
                "line 6",
                "its horizontal angles run from 10 to 90",
            ),
        ];
        for (text, place, cause) in cases {
            let error = parse(text.as_bytes(), &mut Vec::new()).expect_err(cause);
            assert!(error.place == place && error.cause.contains(cause) && error.hint.is_some(), "{error:?}: {cause}");
        }
    }

    /// Files with random damage are read or refused, without a panic, and quickly. Profiles that are read shine.
    #[test]
    fn damaged_files_are_read_or_refused() {
        let words = ["-1", "0", "1e300", "nan", "999999999", "0.5", "", ",", "TILT=NONE", "\u{fffd}", "360", "1e-300"];
        let (mut read, mut refused) = (0, 0);
        for seed in 0..3000u64 {
            let draw = |k: u64| Stream::new(8, k, Domain::Test, seed).vertex(0).one(Purpose::Lobe);
            let horizontal: &[f32] =
                [&[0.0f32][..], &[0.0, 90.0], &[0.0, 90.0, 180.0], &[0.0, 180.0, 360.0]][seed as usize % 4];
            let mut bytes =
                file("IESNA:LM-63-1995\nTILT=INCLUDE\n1 2 0 90 1 1", horizontal, |i, j| (i + j) as f32).into_bytes();
            for k in 0..1 + seed % 4 {
                let at = (draw(3 * k) * bytes.len() as f32) as usize % bytes.len();
                match (draw(3 * k + 1) * 4.0) as u32 {
                    0 => bytes[at] = (draw(3 * k + 2) * 256.0) as u8,
                    1 => bytes.truncate(at.max(1)),
                    2 => drop(bytes.remove(at)),
                    _ => {
                        let word = words[(draw(3 * k + 2) * words.len() as f32) as usize % words.len()];
                        let end = bytes[at..].iter().position(u8::is_ascii_whitespace).map_or(bytes.len(), |n| at + n);
                        bytes.splice(at..end, word.bytes());
                    }
                }
                if bytes.is_empty() {
                    bytes.push(b' ');
                }
            }
            match parse(&bytes, &mut Vec::new()) {
                Ok(photometry) => {
                    read += 1;
                    assert!(photometry.peak() > 0.0 && photometry.peak().is_finite());
                    let turn = Turn { degrees: 720.0 * draw(50) - 360.0, clockwise: seed % 3 == 0 };
                    if let Some(profile) = photometry.profile(turn) {
                        assert!(along(&profile, direction(30.0, 10.0)).is_finite());
                    }
                }
                Err(error) => {
                    refused += 1;
                    assert!(error.place.starts_with("line ") && error.hint.is_some() && !error.cause.is_empty());
                }
            }
        }
        assert!(read > 300 && refused > 300, "{read} {refused}");
    }
}
