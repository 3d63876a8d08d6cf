//! The commands of `caustique serve`: one JSON object per line, checked as far as that is possible without the scene.

use caustique::error::{Error, ErrorKind, Result};
use caustique::math::DAffine3;
use caustique::pipeline::edit::Edit;
use caustique::scene::description::{CameraDescription, Projection};
use caustique::scene::gltf;
use serde::Deserialize;
use serde_json::Value;
use std::f64::consts::PI;
use std::path::PathBuf;

/// Longest identifier of a command, in bytes.
const MAX_ID_BYTES: usize = 256;
/// Largest ratio of the sides of a picture to those of its coarse picture.
const MAX_COARSE: u32 = 64;
/// Largest coordinate of a camera.
const MAX_COORDINATE: f64 = 1e9;
/// Where the commands are described.
const DOCUMENT: &str = "docs/server.md describes the commands";

/// A command with the identifier that its answers repeat.
#[derive(Debug)]
pub struct Command {
    /// A number or a text; null if the command has none.
    pub id: Value,
    pub kind: Kind,
}

/// What a command asks for.
#[derive(Debug)]
pub enum Kind {
    /// Read a scene. The options of `caustique render` in `arguments` say how.
    Load { scene: PathBuf, arguments: Vec<String> },
    /// Change the scene.
    Edit(Vec<Edit>),
    /// Send pictures while they render.
    View(View),
    /// Render to a file, with these options of `caustique render`.
    Render { arguments: Vec<String> },
    /// End the render or the pictures under way, and forget those that wait.
    Stop,
    /// End the program.
    Quit,
}

/// A picture to send while it renders.
#[derive(Debug)]
pub struct View {
    /// Options of `caustique render`.
    pub arguments: Vec<String>,
    /// The camera; `None`: one of the scene.
    pub camera: Option<CameraDescription>,
    pub width: Option<u32>,
    pub height: Option<u32>,
    /// Ratio of the sides of the picture to those of the coarse picture that comes first; 1: none comes.
    pub coarse: u32,
}

#[derive(Deserialize)]
#[serde(tag = "command", rename_all = "lowercase", deny_unknown_fields)]
enum Line {
    Load {
        scene: PathBuf,
        #[serde(default)]
        arguments: Vec<String>,
    },
    Edit {
        #[serde(default)]
        remove: Vec<String>,
        #[serde(default)]
        files: Vec<PathBuf>,
        #[serde(default)]
        place: Vec<Placed>,
    },
    View {
        #[serde(default)]
        arguments: Vec<String>,
        camera: Option<CameraLine>,
        width: Option<u32>,
        height: Option<u32>,
        coarse: Option<u32>,
    },
    Render {
        #[serde(default)]
        arguments: Vec<String>,
    },
    Stop {},
    Quit {},
}

/// An object or a light, and its place.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Placed {
    name: String,
    matrix: [f64; 16],
}

/// A camera, by the names of glTF.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraLine {
    matrix: [f64; 16],
    yfov: Option<f64>,
    ymag: Option<f64>,
    #[serde(default)]
    shift: [f64; 2],
    #[serde(default)]
    aperture_radius: f64,
    #[serde(default = "one")]
    focus_distance: f64,
}

fn one() -> f64 {
    1.0
}

/// Parses a line. An error comes with the identifier of the command, as far as the line has one.
pub fn parse(line: &[u8]) -> std::result::Result<Command, (Value, Error)> {
    let fault = |cause: String| Error::new(ErrorKind::Usage, "command", cause).hint(DOCUMENT);
    let value: Value = serde_json::from_slice(line).map_err(|e| (Value::Null, fault(format!("it is no JSON: {e}"))))?;
    let Value::Object(mut fields) = value else {
        return Err((Value::Null, fault("it is no JSON object".into())));
    };
    let id = fields.remove("id").unwrap_or_default();
    if !(id.is_null() || id.is_number() || id.as_str().is_some_and(|id| id.len() <= MAX_ID_BYTES)) {
        let cause = format!("its id is neither a number nor a text of at most {MAX_ID_BYTES} bytes");
        return Err((Value::Null, fault(cause)));
    }
    let name = fields.get("command").and_then(Value::as_str).unwrap_or_default().to_owned();
    let line: Line = match serde_json::from_value(Value::Object(fields)) {
        Ok(line) => line,
        Err(cause) => return Err((id, fault(format!("\"{name}\": {cause}")))),
    };
    match line.checked() {
        Ok(kind) => Ok(Command { id, kind }),
        Err(error) => Err((id, error.within(format!("command \"{name}\"")))),
    }
}

impl Line {
    fn checked(self) -> Result<Kind> {
        Ok(match self {
            Line::Load { scene, arguments } => Kind::Load { scene, arguments },
            Line::Edit { remove, files, place } => {
                let removed = remove.into_iter().map(|name| Ok(Edit::Remove(name)));
                let replaced = files.into_iter().map(|path| Ok(Edit::Replace(path)));
                let placed = place.into_iter().map(|Placed { name, matrix }| {
                    let to_world = transform(matrix).map_err(|error| error.within(format!("object \"{name}\"")))?;
                    Ok(Edit::Place(name, to_world))
                });
                Kind::Edit(removed.chain(replaced).chain(placed).collect::<Result<_>>()?)
            }
            Line::View { arguments, camera, width, height, coarse } => {
                let coarse = coarse.unwrap_or(1);
                if !(1..=MAX_COARSE).contains(&coarse) {
                    return Err(fault(format!("coarse is {coarse}"), &format!("give 1 to {MAX_COARSE}")));
                }
                let camera = camera.map(CameraLine::described).transpose()?;
                Kind::View(View { arguments, camera, width, height, coarse })
            }
            Line::Render { arguments } => Kind::Render { arguments },
            Line::Stop {} => Kind::Stop,
            Line::Quit {} => Kind::Quit,
        })
    }
}

impl CameraLine {
    fn described(self) -> Result<CameraDescription> {
        let within = |error: Error| error.within("camera");
        let projection = match (self.yfov, self.ymag) {
            (Some(yfov), None) if yfov > 0.0 && yfov < PI => {
                Projection::Perspective { yfov: yfov as f32, aspect: None }
            }
            (None, Some(ymag)) if ymag > 0.0 && ymag <= MAX_COORDINATE => {
                Projection::Orthographic { xmag: 0.0, ymag: ymag as f32 }
            }
            _ => {
                let hint =
                    "give a perspective camera its yfov, between 0 and pi, or an orthographic one its ymag, above 0";
                return Err(within(fault("it has no valid field of view", hint)));
            }
        };
        let to_world = transform(self.matrix).map_err(within)?;
        let numbers = [self.shift[0], self.shift[1], self.aperture_radius, self.focus_distance];
        if numbers.iter().any(|number| number.abs() > MAX_COORDINATE) || self.aperture_radius < 0.0 {
            return Err(within(fault(
                "its shift or its lens is out of range",
                "give an aperture_radius of at least 0",
            )));
        }
        Ok(CameraDescription {
            name: "view".into(),
            to_world,
            projection,
            aperture_radius: self.aperture_radius as f32,
            focus_distance: self.focus_distance as f32,
            shift: self.shift.map(|shift| shift as f32),
        })
    }
}

/// The transform of a column-major matrix, as glTF writes it.
fn transform(matrix: [f64; 16]) -> Result<DAffine3> {
    let within = matrix.iter().all(|number| number.abs() <= MAX_COORDINATE);
    gltf::affine(matrix).filter(|_| within).ok_or_else(|| {
        let cause = "its matrix is no transform within 1e9 m, column by column, whose last row is 0, 0, 0, 1";
        fault(cause, "transpose a matrix that is stored row by row")
    })
}

fn fault(cause: impl std::fmt::Display, hint: &str) -> Error {
    Error::new(ErrorKind::Usage, "", cause).hint(hint)
}

#[cfg(test)]
mod tests {
    use super::*;

    const IDENTITY: &str = "[1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]";

    fn message(line: &str) -> String {
        let (_, error) = parse(line.as_bytes()).expect_err("it is malformed");
        assert!(error.hint.is_some(), "{line}: {error}");
        error.to_string()
    }

    #[test]
    fn commands_are_read() {
        let line = format!(
            r#"{{"command": "view", "id": 7, "camera": {{"matrix": {IDENTITY}, "yfov": 0.5}}, "width": 8, "coarse": 4}}"#
        );
        let Command { id, kind } = parse(line.as_bytes()).expect("it is well formed");
        let Kind::View(View { camera: Some(camera), width: Some(8), height: None, coarse: 4, .. }) = kind else {
            panic!("{kind:?}")
        };
        assert_eq!((id, camera.to_world), (7.into(), DAffine3::IDENTITY));
        let line =
            format!(r#"{{"command": "edit", "place": [{{"name": "a", "matrix": {IDENTITY}}}], "remove": ["b"]}}"#);
        let Kind::Edit(edits) = parse(line.as_bytes()).expect("it is well formed").kind else { panic!() };
        assert_eq!(edits, [Edit::Remove("b".into()), Edit::Place("a".into(), DAffine3::IDENTITY)]);
    }

    #[test]
    fn malformed_commands_are_named_with_their_fault_and_remedy() {
        for (line, expected) in [
            ("", "no JSON"),
            ("{", "no JSON"),
            ("[]", "no JSON object"),
            (r#"{"command": "dance"}"#, "\"dance\": unknown variant"),
            (r#"{"id": [], "command": "stop"}"#, "its id is neither"),
            (r#"{"command": "stop", "now": true}"#, "\"stop\": unknown field"),
            (r#"{"command": "load"}"#, "missing field `scene`"),
            (r#"{"command": "view", "width": -1}"#, "\"view\": invalid value"),
            (r#"{"command": "view", "coarse": 0}"#, "coarse is 0"),
            (r#"{"command": "view", "camera": {"matrix": [1]}}"#, "\"view\": invalid length"),
        ] {
            assert!(message(line).contains(expected), "{line}: {}", message(line));
        }
        let camera = |rest: &str| format!(r#"{{"command": "view", "camera": {{"matrix": {IDENTITY}{rest}}}}}"#);
        assert!(message(&camera("")).contains("camera: it has no valid field of view"));
        assert!(message(&camera(r#", "yfov": 4"#)).contains("no valid field of view"));
        assert!(message(&camera(r#", "yfov": 1, "aperture_radius": -1"#)).contains("out of range"));
        let skewed = camera(r#", "yfov": 1"#).replace("0,0,0,1]", "0,0,1,1]").replace("[1,0,0,0", "[1,0,0,1");
        assert!(message(&skewed).contains("camera: its matrix is no transform"));
    }
}
