//! Reads photometric profiles: IESNA LM-63 files of 1986, 1991, 1995, 2002 and 2019. Photometry of each type keeps the
//! angles of its file, so that hard edges stay hard and the flux is that of the file.

use crate::error::{Error, ErrorKind, Result};
use crate::light::Profile;
use crate::math::{Mat3, Vec3};
use std::fmt::Display;

/// Maximum size of a file (bytes). Files of luminaires have some kilobytes.
pub const MAX_BYTES: u64 = 64 << 20;
/// Largest number of angles of a kind.
const MAX_ANGLES: usize = 1 << 16;
const DAMAGED: &str = "get the file again from the maker of the luminaire, or export it again";

/// Angles between the samples of scaled profiles of type A and B: half of the smallest angle of the file, within these
/// limits (degrees).
const RESAMPLED_STEPS: [f32; 2] = [0.125, 1.0];

/// How the angles of a file give a direction (IES LM-75). Each letter is the type's own.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// Horizontal angles turn about the axis of the light, vertical angles lean away from it.
    C,
    /// Vertical angles turn about the light's X axis, horizontal angles lean from the plane across it towards it.
    B,
    /// Horizontal angles turn about the light's Y axis, vertical angles lean from the plane across it towards it.
    A,
}

/// The content of a profile's file.
#[derive(Clone, Debug, PartialEq)]
pub struct Photometry {
    kind: Kind,
    /// Angles to the pole (degrees), ascending, from 0 to 180. The pole of type C is the direction in which the light points,
    /// that of type B its X axis, that of type A its Y axis.
    vertical: Vec<f32>,
    /// Angles about the pole (degrees), ascending, each with the index of its measurements in `candela`. Those of type C
    /// span a whole turn, and those of types A and B are 0 in the direction in which the light points.
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
/// The file is damaged.
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
    let kind = [Kind::C, Kind::B, Kind::A][numbers.count("its photometric type", 1, 3)? - 1];
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
    let [lean, turn] = [[-90.0, 90.0], [-180.0, 180.0]];
    let (allowed, across) = match kind {
        Kind::C => ([0.0, 180.0], None),
        Kind::B => (turn, Some(lean)),
        Kind::A => (lean, Some(turn)),
    };
    let outside = |angles: &[f32], [low, high]: [f32; 2]| angles[0] < low || angles[angles.len() - 1] > high;
    if outside(&vertical, allowed) {
        let [low, high] = allowed;
        return Err(fault(numbers.line, format!("a vertical angle is outside {low} to {high} degrees")).hint(DAMAGED));
    }
    let angles = numbers.angles("horizontal angle", horizontal)?;
    if let Some(across) = across
        && (angles.len() < 2 || outside(&angles, across))
    {
        let ([low, high], count) = (across, angles.len());
        let cause = format!(
            "photometry of type {kind:?} has at least two horizontal angles from {low} to {high} degrees, this file {count} from {} to {}",
            angles[0],
            angles[count - 1]
        );
        return Err(fault(numbers.line, cause).hint(DAMAGED));
    }
    let around = whole_turn(&angles).filter(|_| kind == Kind::C);
    if kind == Kind::C && around.is_none() {
        let (start, end) = (angles[0], angles[angles.len() - 1]);
        let cause = format!(
            "its horizontal angles run from {start} to {end}; type C has one angle, or 0 to 90, 0 to 180, 90 to 270 or 0 to 360 degrees"
        );
        return Err(fault(numbers.line, cause).hint(DAMAGED));
    }
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
    Ok(match around {
        Some(horizontal) => Photometry { kind, vertical, horizontal, candela },
        None => about_pole(kind, &vertical, &angles, &candela),
    })
}

/// Photometry of type A or B from the angles and intensities of its file. Angles that start at 0 are mirrored. There is no
/// light beyond the angles.
fn about_pole(kind: Kind, vertical: &[f32], horizontal: &[f32], candela: &[f32]) -> Photometry {
    // Each angle with its index in the file.
    let mirrored = |angles: &[f32]| -> Vec<(f32, usize)> {
        let own = || angles.iter().copied().zip(0..);
        let below = own().skip(1).map(|(angle, i)| (-angle, i)).filter(|_| angles[0] == 0.0);
        below.collect::<Vec<_>>().into_iter().rev().chain(own()).collect()
    };
    let rows = vertical.len();
    let (vertical, horizontal) = (mirrored(vertical), mirrored(horizontal));
    // Vertical angles of type A and horizontal ones of type B lean towards the pole, the others turn about it.
    let (leaning, turning) = if kind == Kind::A { (vertical, horizontal) } else { (horizontal, vertical) };
    let value = |lean: usize, turn: usize| {
        let (vertical, horizontal) = if kind == Kind::A { (lean, turn) } else { (turn, lean) };
        candela[horizontal * rows + vertical]
    };
    let column = |turn: usize| leaning.iter().rev().map(move |&(_, lean)| (lean, turn));
    Photometry {
        kind,
        vertical: leaning.iter().rev().map(|&(angle, _)| 90.0 - angle).collect(),
        candela: turning.iter().flat_map(|&(_, turn)| column(turn)).map(|(lean, turn)| value(lean, turn)).collect(),
        horizontal: turning.iter().enumerate().map(|(k, &(angle, _))| (angle, k)).collect(),
    }
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

    /// The luminous flux (lm): the integral of the intensity over all directions.
    pub fn flux(&self) -> f64 {
        let n = self.vertical.len();
        let column = |index: usize| -> f64 {
            let values = &self.candela[index * n..(index + 1) * n];
            let cell = |k: usize| {
                let [a, b] = [self.vertical[k], self.vertical[k + 1]].map(|angle| f64::from(angle).to_radians());
                let (from, to) = (f64::from(values[k]), f64::from(values[k + 1]));
                let slope = (to - from) / (b - a);
                // The integral of a linear function times the sine.
                from * a.cos() - to * b.cos() + slope * (b.sin() - a.sin())
            };
            (0..n - 1).map(cell).sum()
        };
        let part = |pair: &[(f32, usize)]| {
            let width = f64::from(pair[1].0 - pair[0].0).to_radians();
            0.5 * width * (column(pair[0].1) + column(pair[1].1))
        };
        self.horizontal.windows(2).map(part).sum()
    }

    /// The profile with the angles to its axis multiplied by `scale`, if it is positive, or the angles to the opposite
    /// axis by `-scale`, if it is negative \[UsdLux, shaping:ies:angleScale\]. `None` if no light is left.
    pub fn scaled(&self, scale: f32) -> Option<Photometry> {
        if self.kind != Kind::C {
            return self.resampled()?.scaled(scale);
        }
        let moved: Vec<f32> = self
            .vertical
            .iter()
            .map(|&angle| if scale > 0.0 { angle * scale } else { 180.0 + (180.0 - angle) * scale })
            .collect();
        // Angles between which the scaled profile has light, with the share of the later node at either end.
        let at = |angle: f32| {
            let after = moved.partition_point(|&a| a <= angle).clamp(1, moved.len() - 1);
            (after - 1, ((angle - moved[after - 1]) / (moved[after] - moved[after - 1])).clamp(0.0, 1.0))
        };
        let (start, end) = (moved[0].max(0.0), moved[moved.len() - 1].min(180.0));
        if start >= end || !start.is_finite() || !end.is_finite() {
            return None;
        }
        let inside = || moved.iter().copied().filter(|&angle| angle > start && angle < end);
        let vertical: Vec<f32> = std::iter::once(start).chain(inside()).chain([end]).collect();
        let n = self.vertical.len();
        let value = |column: usize, angle: f32| {
            let (k, share) = at(angle);
            let values = &self.candela[column * n..];
            values[k] + (values[k + 1] - values[k]) * share
        };
        let columns = self.candela.len() / n;
        let candela: Vec<f32> = (0..columns)
            .flat_map(|column| vertical.iter().map(move |&angle| (column, angle)))
            .map(|(c, a)| value(c, a))
            .collect();
        candela.iter().any(|&x| x > 0.0).then(|| Photometry {
            kind: Kind::C,
            vertical,
            horizontal: self.horizontal.clone(),
            candela,
        })
    }

    /// The luminous intensity of photometry of type A or B along a direction given by its components to the right, up and
    /// ahead, seen from behind the light.
    fn intensity(&self, [x, y, z]: [f32; 3]) -> f32 {
        let (pole, across) = if self.kind == Kind::A { (y, x) } else { (x, y) };
        let place = |first: f32, last: f32, after: usize, count: usize, angle: f32| {
            // Rounding must not lose the rim.
            let inside = angle >= first - 1e-3 && angle <= last + 1e-3;
            inside.then(|| after.clamp(1, count - 1))
        };
        let share = |low: f32, high: f32, angle: f32| ((angle - low) / (high - low)).clamp(0.0, 1.0);
        let (lean, turn) = (pole.clamp(-1.0, 1.0).acos().to_degrees(), across.atan2(z).to_degrees());
        let (rows, columns) = (&self.vertical, &self.horizontal);
        let (n, m) = (rows.len(), columns.len());
        let row = place(rows[0], rows[n - 1], rows.partition_point(|&a| a <= lean), n, lean);
        let column = place(columns[0].0, columns[m - 1].0, columns.partition_point(|&(a, _)| a <= turn), m, turn);
        let (Some(i), Some(j)) = (row, column) else { return 0.0 };
        let s = share(rows[i - 1], rows[i], lean);
        let at = |(_, index): (f32, usize)| {
            let values = &self.candela[index * n + i - 1..][..2];
            values[0] + (values[1] - values[0]) * s
        };
        at(columns[j - 1]) + (at(columns[j]) - at(columns[j - 1])) * share(columns[j - 1].0, columns[j].0, turn)
    }

    /// About the same light as photometry of type C, with the same flux; `None` if no light is left.
    fn resampled(&self) -> Option<Photometry> {
        let steps = self.vertical.windows(2).map(|pair| pair[1] - pair[0]);
        let least =
            steps.chain(self.horizontal.windows(2).map(|pair| pair[1].0 - pair[0].0)).fold(f32::INFINITY, f32::min);
        let [low, high] = RESAMPLED_STEPS;
        let step = 180.0 / (180.0 / (0.5 * least).clamp(low, high)).ceil();
        let count = (180.0 / step).round() as usize;
        let turn = 2 * count;
        let columns: Vec<Vec<f32>> = (0..turn)
            .map(|j| {
                let (sin, cos) = (step * j as f32).to_radians().sin_cos();
                let along = |i: usize| {
                    let (out, ahead) = (step * i as f32).to_radians().sin_cos();
                    self.intensity([out * cos, out * sin, ahead])
                };
                (0..=count).map(along).collect()
            })
            .collect();
        // Rows after the last one with light would only cost memory.
        let lit = columns.iter().filter_map(|column| column.iter().rposition(|&x| x > 0.0)).max()?;
        let rows = (lit + 2).clamp(2, count + 1);
        let mut made = Photometry {
            kind: Kind::C,
            vertical: (0..rows).map(|i| (step * i as f32).min(180.0)).collect(),
            horizontal: (0..=turn).map(|j| (step * j as f32, j % turn)).collect(),
            candela: columns.iter().flat_map(|column| &column[..rows]).copied().collect(),
        };
        let factor = (self.flux() / made.flux()) as f32;
        made.candela.iter_mut().for_each(|x| *x *= factor);
        factor.is_finite().then_some(made)
    }

    /// The transform from the frame of a light to that of the pole of photometry of type A or B: x ahead, z the pole.
    fn to_pole(&self, turn: Turn) -> Mat3 {
        let (sin, cos) = turn.degrees.to_radians().sin_cos();
        let sense = if turn.clockwise { -1.0 } else { 1.0 };
        // The file's axes to the right and up in the frame of the light, whose y axis points down.
        let (right, up) = (Vec3::new(cos, -sin, 0.0), Vec3::new(-sin, -cos, 0.0) * sense);
        let (pole, across) = if self.kind == Kind::A { (up, right) } else { (right, up) };
        Mat3::from_cols(Vec3::Z, across, pole).transpose()
    }

    /// The relative intensity, for a light whose axis is that of the profile. `None` if rounding leaves no profile.
    pub fn profile(&self, turn: Turn) -> Option<Profile> {
        if self.kind != Kind::C {
            let polar = self.vertical.iter().map(|angle| angle.to_radians().min(std::f32::consts::PI)).collect();
            let azimuth = self.horizontal.iter().map(|(angle, _)| angle / 360.0).collect();
            return Profile::about_pole(self.to_pole(turn), polar, azimuth, self.candela.clone());
        }
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
    use crate::math::Vec2;
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

    fn distribution(profile: Profile) -> crate::light::Distribution {
        crate::light::Distribution::new(std::sync::Arc::new(crate::light::Pattern::Profile(profile)), None)
            .expect("light")
    }

    /// Relative intensity in a direction of the light's space.
    fn relative(distribution: &crate::light::Distribution, d: Vec3) -> f32 {
        // The frame of a light: its normal is the axis -Z, its x axis the light's.
        distribution.relative(Vec3::new(d.x, -d.y, -d.z)).x
    }

    /// Relative intensity in a direction of the light's space.
    fn along(profile: &Profile, d: Vec3) -> f32 {
        relative(&distribution(profile.clone()), d)
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

    /// In random directions, files of types A and B have the intensity of the formula that they tabulate, also where half
    /// of the angles is left to symmetry. With exchanged types they do not.
    #[test]
    fn angles_of_types_a_and_b_give_their_directions() {
        // Linear in both angles between -60 and 60 degrees, or symmetric about 0.
        let whole = |h: f32, v: f32| 100.0 + h + 0.5 * v;
        let mirrored = |h: f32, v: f32| 100.0 - h.abs() - 0.5 * v.abs();
        let text = |kind: u32, angles: &[f32], value: &dyn Fn(f32, f32) -> f32| {
            let words = |list: Vec<f32>| list.iter().map(f32::to_string).collect::<Vec<_>>().join(" ");
            let rows: Vec<String> =
                angles.iter().map(|&h| words(angles.iter().map(|&v| value(h, v)).collect())).collect();
            let (n, list) = (angles.len(), words(angles.to_vec()));
            format!(
                "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 {n} {n} {kind} 2 0 0 0\n1 1 30\n{list}\n{list}\n{}",
                rows.join("\n")
            )
        };
        let worst = |text: &str, kind: u32, value: &dyn Fn(f32, f32) -> f32| {
            let photometry = read(text);
            let (profile, peak) = (photometry.profile(Turn::default()).expect("a profile"), photometry.peak());
            let made = distribution(profile);
            let mut worst = 0.0f32;
            for i in 0..400 {
                let u = Stream::new(4, 0, Domain::Test, i).vertex(0).two(Purpose::Direction);
                let (h, v) = (110.0 * u.x - 55.0, 110.0 * u.y - 55.0);
                let ((sh, ch), (sv, cv)) = (h.to_radians().sin_cos(), v.to_radians().sin_cos());
                let [x, y, z] = if kind == 3 { [sh * cv, sv, ch * cv] } else { [sh, ch * sv, ch * cv] };
                let found = peak * relative(&made, Vec3::new(x, y, -z));
                worst = worst.max((found - value(h, v)).abs());
            }
            worst
        };
        let (all, half) = ([-60.0, -30.0, 0.0, 30.0, 60.0], [0.0, 30.0, 60.0]);
        for (own, other) in [(2, 3), (3, 2)] {
            let error = worst(&text(own, &all, &whole), own, &whole);
            assert!(error < 0.01, "{own}: {error}");
            let error = worst(&text(own, &half, &mirrored), own, &mirrored);
            assert!(error < 0.01, "{own}, mirrored: {error}");
            let error = worst(&text(own, &all, &whole), other, &whole);
            assert!(error > 3.0, "{own} is not told from {other}: {error}");
        }
    }

    /// The flux of a random file of type A (3), B (2) or C (1), with hard edges down to a tenth of a degree: the file, and the
    /// integrals of the file's angles if it is of its type, and if it is of type A or B instead.
    fn random_file(seed: u64, kind: u32) -> (String, [f64; 2]) {
        let draw = |k: usize| f64::from(Stream::new(6, k as u64, Domain::Test, seed).vertex(0).one(Purpose::Lobe));
        let angles = |k: usize, most: f64| -> Vec<f64> {
            let (n, half) = (2 + (4.0 * draw(k)) as usize, 0.1 * (most / 0.1).powf(draw(k + 1)));
            let start = [0.0, -half, -half * draw(k + 2)][(3.0 * draw(k + 3)) as usize];
            let start = if kind == 1 { 0.0 } else { start };
            (0..n)
                .map(|i| start + (half - start) * ((i as f64 + 0.4 * draw(k + 4 + i)) / (n as f64 - 0.6)).min(1.0))
                .collect()
        };
        let round = |angle: f64| (angle * 1e4).round() / 1e4;
        let vertical: Vec<f64> = angles(0, if kind == 1 { 170.0 } else { 85.0 }).into_iter().map(round).collect();
        let mut vertical = vertical;
        vertical[0] = if kind == 1 { 0.0 } else { vertical[0] };
        let horizontal: Vec<f64> = match kind {
            1 => [vec![0.0], vec![0.0, 30.0, 90.0], vec![0.0, 100.0, 180.0]][seed as usize % 3].clone(),
            _ => angles(50, 85.0).into_iter().map(round).collect(),
        };
        let value = |k: usize| if draw(k + 200) < 0.2 { 0.0 } else { (1e4 * draw(k + 300)).round() + 1.0 };
        let rows = vertical.len();
        let mut candela: Vec<f64> = (0..rows * horizontal.len()).map(value).collect();
        candela[rows - 1] = 9000.0;
        let words = |list: &[f64]| list.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
        let text = format!(
            "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 {rows} {} {kind} 2 0 0 0\n1 1 30\n{}\n{}\n{}",
            horizontal.len(),
            words(&vertical),
            words(&horizontal),
            words(&candela)
        );
        // Simpson's rule of the bilinear interpolation times the weight of the angle that leans towards the pole.
        let integral = |weight: &dyn Fn(f64, f64) -> f64| -> f64 {
            let mut sum = 0.0;
            for (i, v) in vertical.windows(2).enumerate() {
                for (j, h) in horizontal.windows(2).enumerate() {
                    let at = |i: usize, j: usize| candela[j * rows + i];
                    for (a, b) in (0..=20).flat_map(|a| (0..=20).map(move |b| (a, b))) {
                        let simpson = |k: i32| if k % 20 == 0 { 1.0 } else { f64::from(2 + 2 * (k % 2)) } / 60.0;
                        let (s, t) = (f64::from(a) / 20.0, f64::from(b) / 20.0);
                        let (low, high) = (
                            at(i, j) + (at(i + 1, j) - at(i, j)) * s,
                            at(i, j + 1) + (at(i + 1, j + 1) - at(i, j + 1)) * s,
                        );
                        let angles = [v[0] + (v[1] - v[0]) * s, h[0] + (h[1] - h[0]) * t].map(f64::to_radians);
                        let area = ((v[1] - v[0]).to_radians()) * ((h[1] - h[0]).to_radians());
                        sum += simpson(a) * simpson(b) * area * (low + (high - low) * t) * weight(angles[0], angles[1]);
                    }
                }
            }
            sum
        };
        // Symmetry repeats what the file has.
        let repeated = |angles: &[f64]| if angles[0] == 0.0 { 2.0 } else { 1.0 };
        let whole = repeated(&vertical) * repeated(&horizontal);
        let [a, b] = [integral(&|v, _| v.cos()) * whole, integral(&|_, h| h.cos()) * whole];
        match kind {
            1 if horizontal.len() == 1 => {
                let column = |i: usize, s: f64| candela[i] + (candela[i + 1] - candela[i]) * s;
                let part = |(i, v): (usize, &[f64])| {
                    let cell = |k: u32| {
                        let s = (f64::from(k) + 0.5) / 2000.0;
                        column(i, s) * (v[0] + (v[1] - v[0]) * s).to_radians().sin() * (v[1] - v[0]).to_radians()
                            / 2000.0
                    };
                    (0..2000).map(cell).sum::<f64>()
                };
                let sum = vertical.windows(2).enumerate().map(part).sum::<f64>() * std::f64::consts::TAU;
                (text, [sum, sum])
            }
            1 => {
                let turns = 360.0 / (horizontal[horizontal.len() - 1] - horizontal[0]);
                let sum = turns * integral(&|v, _| v.sin());
                (text, [sum, sum])
            }
            2 => (text, [b, a]),
            _ => (text, [a, b]),
        }
    }

    /// Profiles of each type carry the flux of their file, as it is sampled and as it is stated, turned and scaled by 1. The
    /// angles of another type would not.
    #[test]
    fn profiles_of_each_type_keep_the_flux_of_their_file() {
        let mut different = 0;
        for seed in 0..90 {
            let kind = 1 + seed as u32 % 3;
            let (text, [expected, other]) = random_file(seed, kind);
            let photometry = read(&text);
            let within = |flux: f64, tolerance: f64| (flux / expected - 1.0).abs() < tolerance;
            assert!(within(photometry.flux(), 1e-3), "{kind} {seed}: {} is not {expected}\n{text}", photometry.flux());
            if kind != 1 && seed < 12 {
                let scaled = photometry.scaled(1.0).map(|scaled| scaled.flux());
                assert!(scaled.is_none_or(|flux| within(flux, 2e-3)), "{kind} {seed}: scaled {scaled:?}, {expected}");
            }
            let turn = Turn { degrees: 50.0 * seed as f32, clockwise: seed % 2 == 0 };
            let made = distribution(photometry.profile(turn).expect("a profile"));
            let (n, mut sum, mut squares) = (120u32, 0.0f64, 0.0f64);
            for i in 0..n * n {
                let within = Stream::new(7, seed, Domain::Test, u64::from(i)).vertex(0).two(Purpose::Pixel);
                let u = (Vec2::new((i % n) as f32, (i / n) as f32) + within) / n as f32;
                let (d, pdf) = made.sample(u).expect("a direction");
                let weight = f64::from(photometry.peak() * made.relative(d).x / pdf);
                sum += weight;
                squares += weight * weight;
            }
            let count = f64::from(n * n);
            let mean = sum / count;
            // Four standard errors of independent samples; stratified ones vary less: one false alarm in 15,000 files.
            let error = 4.0 * ((squares / count - mean * mean).max(0.0) / count).sqrt() / expected;
            assert!(error < 0.03 && within(mean, error + 1e-3), "{kind} {seed}: {mean} is not {expected}\n{text}");
            different += u32::from(kind != 1 && (other / mean - 1.0).abs() > error + 1e-3);
        }
        assert!(different > 20, "{different}: types A and B are told apart");
    }

    /// Scaled profiles have the intensity of the scaled angle, and the flux of a profile is its integral.
    #[test]
    fn profiles_are_scaled_about_either_end_of_their_axis() {
        let value = |i: usize, j: usize| [90.0, 60.0, 30.0][i] - 10.0 * j as f32;
        let read = read(&file("IESNA:LM-63-1995\nTILT=NONE", &[0.0, 90.0, 180.0], value));
        for scale in [0.5f32, 1.5, 3.0, -0.75, -1.5] {
            let scaled = read.scaled(scale).expect("light is left");
            let [own, moved] =
                [&read, &scaled].map(|p| (distribution(p.profile(Turn::default()).expect("a profile")), p.peak()));
            for i in 0..200 {
                let u = Stream::new(5, 0, Domain::Test, i).vertex(0).two(Purpose::Direction);
                let (vertical, horizontal) = (180.0 * u.x, 360.0 * u.y);
                let before = if scale > 0.0 { vertical / scale } else { (vertical - 180.0) / -scale + 180.0 };
                let known = (0.0..=90.0).contains(&before);
                let expected = if known { own.1 * relative(&own.0, direction(before, horizontal)) } else { 0.0 };
                let found = moved.1 * relative(&moved.0, direction(vertical, horizontal));
                let near_rim = (before - 90.0).abs() < 0.1 || before.abs() < 0.1;
                assert!(near_rim || (found - expected).abs() < 0.05, "{scale} {vertical}: {found}, {expected}");
            }
        }
        assert!(read.scaled(-3.0).is_none());
        // A uniform hemisphere of 100 cd, times 0.5 and the multiplier 2.
        let even = file("IESNA:LM-63-1995\nTILT=NONE", &[0.0], |_, _| 100.0);
        let flux = parse(even.as_bytes(), &mut Vec::new()).expect("a profile").flux();
        assert!((flux - 200.0 * std::f64::consts::PI).abs() < 1e-2, "{flux}");
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
            (good.replace(" 3 1 1 2 ", " 3 1 2 2 "), "line 6", "type B has at least two horizontal angles"),
            (good.replace(" 3 1 1 2 ", " 3 1 4 2 "), "line 3", "its photometric type is 4"),
            (good.replace(" 3 1 1 2 ", " 3 1 3 2 ").replace("0 45 90", "0 45 95"), "line 5", "outside -90 to 90"),
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
