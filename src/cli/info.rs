//! `caustique info`: prints the contents of a scene or an EXR.

use super::progress::{Form, duration, percent};
use super::render::place;
use super::warnings::lines;
use super::{plot, print, print_json, printable, scene};
use caustique::error::{Error, ErrorKind, Result};
use caustique::files;
use caustique::film::{LayerSet, describe};
use caustique::image::exr;
use caustique::options::SceneOptions;
use caustique::pipeline::{FINISHED_PICTURE, Place, scene_info};
use serde_json::{Map, Value, json};
use std::io::Read;
use std::path::{Path, PathBuf};

/// The first bytes of every EXR.
const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Show what a scene or an EXR contains
#[derive(clap::Args)]
pub struct InfoArgs {
    /// Scene (.glb, .gltf, .blend, .usd, .usda, .usdc, .usdz) or EXR
    file: PathBuf,
    /// Allow a scene to name files (buffers, textures, its environment) outside its own folder
    #[arg(long)]
    allow_outside: bool,
    /// Print each warning; without it, the warnings of one kind are one line
    #[arg(long)]
    verbose: bool,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Prints the contents of a scene or an EXR, as `caustique info`.
pub fn run(args: &InfoArgs) -> Result<()> {
    let path = &args.file;
    if is_exr(path)? {
        let (set, attributes) = exr::read(path)?;
        let mut object = Value::Object(image_object(&set, attributes.object()));
        if args.json {
            return print_json(&object);
        }
        escape(&mut object);
        return print(&image_text(path, &set, &object));
    }
    let options = SceneOptions::of(path, args.allow_outside);
    let scene = super::pool(0)?
        .install(|| scene::read(&options, Form::for_output(args.json), rayon::current_num_threads()))?
        .scene;
    let mut object = scene_info(path, &scene);
    if args.json {
        return print_json(&object);
    }
    escape(&mut object);
    print(&scene_text(path, &object, args.verbose))
}

/// Escapes control characters in all texts of a JSON value.
fn escape(value: &mut Value) {
    match value {
        Value::String(text) => *text = printable(text),
        Value::Array(values) => values.iter_mut().for_each(escape),
        Value::Object(object) => object.values_mut().for_each(escape),
        _ => {}
    }
}

fn is_exr(path: &Path) -> Result<bool> {
    let mut start = Vec::new();
    let read = files::open(path).and_then(|file| file.take(4).read_to_end(&mut start));
    read.map_err(|cause| Error::io(path, &cause))?;
    if start.is_empty() {
        return Err(Error::new(ErrorKind::Io, path.display(), "the file is empty"));
    }
    Ok(start == EXR_MAGIC)
}

/// The header of an EXR as a JSON object, with the size and the layers of the file.
fn image_object(set: &LayerSet, header: Option<Value>) -> Map<String, Value> {
    let mut object = match header {
        Some(Value::Object(object)) => object,
        _ => Map::new(),
    };
    let layers = set.layers.iter().map(|layer| {
        let components: String = layer.planes.iter().map(|plane| plane.component.as_str()).collect();
        json!({"name": layer.name, "components": components})
    });
    object.insert("layers".into(), layers.collect());
    object.insert("width".into(), set.width.into());
    object.insert("height".into(), set.height.into());
    object.entry("history").or_insert_with(|| json!([]));
    object
}

fn image_text(path: &Path, set: &LayerSet, object: &Value) -> String {
    let name = printable(&path.display().to_string());
    let mut text = format!("{name}: {} x {} pixels, {} layers\n", set.width, set.height, set.layers.len());
    for layer in &set.layers {
        let components: Vec<&str> = layer.planes.iter().map(|plane| plane.component.as_str()).collect();
        let name = if layer.name.is_empty() { "(beauty)" } else { &layer.name };
        // Blender's names have the name of the view layer in front.
        let plain = layer.name.strip_prefix("ViewLayer.").unwrap_or(&layer.name);
        let known = describe(plain).map(|known| known.to_string());
        let [name, components] = [name, &components.concat()].map(printable);
        text += format!("  {name:<18} {components:<8} {}", known.unwrap_or_default()).trim_end();
        text.push('\n');
    }
    let number = |key: &str| object.get(key).and_then(Value::as_f64);
    if let (Some(version), Some(iterations)) = (object.get("version").and_then(Value::as_str), number("iterations")) {
        text += &format!("rendered by caustique {version}: {iterations} iterations");
        text += &number("light_paths").map(|n| format!(", {n} light paths")).unwrap_or_default();
        text += &number("seconds").map(|s| format!(", {}", duration(s))).unwrap_or_default();
        let note = match object.get("error_of").and_then(Value::as_str) {
            Some(FINISHED_PICTURE) => " (finished picture, trimmed)".into(),
            Some(of) if !of.ends_with("bias") => format!(" ({of} only)"),
            _ => String::new(),
        };
        let error = number("error").map(|e| format!(", estimated relative error {}{note}", percent(e)));
        text += &error.unwrap_or_default();
        text.push('\n');
        let halving = object.get("accuracy").and_then(|accuracy| accuracy.get("halving"));
        let half = |key: &str| halving.and_then(|halving| halving.get(key)).and_then(Value::as_f64);
        if let (Some(error), Some(seconds), Some(cores)) = (half("error"), half("seconds"), half("core_seconds")) {
            let hours = cores / 3600.0;
            text += &format!("{} would take about {} more, {hours:.2} core-hours\n", percent(error), duration(seconds));
        }
        text += &accuracy_text(object);
        let finish = &object["combined"];
        if let (Some(model), Some(hash)) = (finish["model"].as_str(), finish["model_hash"].as_str()) {
            text += &format!("finished with the network {model} (BLAKE3 {hash})\n");
        }
    }
    for warning in object.get("warnings").and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_str) {
        text += &format!("warning: {warning}\n");
    }
    let history = object.get("history").and_then(Value::as_array).cloned().unwrap_or_default();
    // Reproducible files state no times.
    let timed = history.iter().any(|moment| moment.get("seconds").is_some());
    let (key, name) = if timed { ("seconds", "seconds") } else { ("iterations", "iterations") };
    let points = |of: &str| -> Vec<(f64, f64)> {
        let point = |moment: &Value| Some((moment.get(key)?.as_f64()?, moment.get(of)?.as_f64()?));
        history.iter().filter_map(point).collect()
    };
    // The error of the finished picture, if it was estimated more than once.
    let finished = points("finished");
    let (points, of) = match finished.len() {
        0 | 1 => (points("error"), "estimated relative error"),
        _ => (finished, "estimated relative error of the finished picture"),
    };
    text + &plot::log_log(&points, name, of)
}

/// The interval of the error and the places of the largest errors, as text for people.
fn accuracy_text(object: &Value) -> String {
    let accuracy = object.get("accuracy");
    let number = |value: &Value, key: &str| value.get(key).and_then(Value::as_f64);
    let mut text = String::new();
    if let Some([low, high]) = accuracy.and_then(|accuracy| accuracy["interval"].as_array()).map(Vec::as_slice) {
        let [low, high] = [low, high].map(|end| percent(end.as_f64().unwrap_or(f64::NAN)));
        let confidence = accuracy.and_then(|accuracy| number(accuracy, "confidence")).unwrap_or(f64::NAN);
        text += &format!("the error lies between {low} and {high} in {} of all pictures\n", percent(confidence));
    }
    let bias = accuracy.and_then(|accuracy| number(accuracy, "bias")).filter(|bias| *bias > 0.0);
    if let Some(bias) = bias {
        let bias = percent(bias);
        text +=
            &format!("its bandwidths have a bias of {bias}: errors below that are cheaper by a method without one\n");
    }
    let rows = |of: &str| object.get("worst").and_then(|worst| worst[of].as_array()).into_iter().flatten();
    let name = |value: &Value, key: &str| value[key].as_str().unwrap_or_default().to_string();
    let place_of = |value: &Value| {
        let share = number(value, "share").unwrap_or(0.0);
        let [object, material, light] = ["object", "material", "light"].map(|key| name(value, key));
        place(&Place { share, object, material, light })
    };
    let by: Vec<String> = rows("by").map(place_of).collect();
    if !by.is_empty() {
        text += &format!("where the error is: {}\n", by.join("; "));
    }
    for tile in rows("tiles") {
        let [x, y, width, height] = ["x", "y", "width", "height"].map(|key| tile[key].as_u64().unwrap_or(0));
        text += &format!("  {width} x {height} pixels at {x},{y}: {}\n", place_of(tile));
    }
    text
}

/// Largest number of names of a kind (such as materials) that the text lists.
const MAX_NAMES: usize = 24;

/// The first names of a list, with their number.
fn listed(names: &[String]) -> String {
    match names.len() {
        0 => "none".to_string(),
        n if n <= MAX_NAMES => format!("{n}: {}", names.join(", ")),
        n => format!("{n}: {} and {} more (all of them with --json)", names[..MAX_NAMES].join(", "), n - MAX_NAMES),
    }
}

fn scene_text(path: &Path, object: &Value, verbose: bool) -> String {
    let list = |key: &str| object[key].as_array().into_iter().flatten();
    let with = |key: &str, text: &dyn Fn(&Value) -> String| listed(&list(key).map(text).collect::<Vec<_>>());
    let text_of = |value: &Value| value.as_str().unwrap_or_default().to_string();
    let names = |key: &str| with(key, &text_of);
    let mut text = format!("{}\n", printable(&path.display().to_string()));
    if list("scenes").count() > 1 {
        text += &format!("  scenes     {}; shown: {}\n", names("scenes"), text_of(&object["scene_shown"]));
    }
    let number = |value: &Value| value.as_f64().unwrap_or(0.0);
    let size: Vec<String> = list("dimensions").map(|length| format!("{:.3}", number(length))).collect();
    text += &format!("  dimensions {} m (X, Y, Z)\n", size.join(" x "));
    text += &format!(
        "  triangles  {} in {} meshes, placed {} times\n",
        object["triangles"], object["meshes"], object["instances"]
    );
    let objects = list("objects").zip(list("triangles_of_objects"));
    let objects: Vec<String> = objects.map(|(name, n)| format!("{} ({n} triangles)", text_of(name))).collect();
    text += &format!("  objects    {}\n  materials  {}\n", listed(&objects), names("materials"));
    let texture = |t: &Value| format!("{} ({} x {})", text_of(&t["name"]), t["width"], t["height"]);
    text += &format!("  textures   {}\n", with("texture_sizes", &texture));
    if list("animations").next().is_some() {
        let animation = |value: &Value| match value["seconds"].as_array().map(Vec::as_slice) {
            Some([start, end]) => format!("{} ({:.2} to {:.2} s)", text_of(&value["name"]), number(start), number(end)),
            _ => text_of(&value["name"]),
        };
        text += &format!("  animations {}\n", with("animations", &animation));
    }
    if list("variants").next().is_some() {
        text += &format!("  variants   {}\n", names("variants"));
    }
    let lights = object["lights"].as_object().into_iter().flatten();
    let lights: Vec<String> = lights.map(|(kind, n)| format!("{kind} {n}")).collect();
    text += &match lights.is_empty() {
        true => "  lights     none\n".into(),
        false => format!("  lights     {}; {}\n", lights.join(", "), names("light_names")),
    };
    text += &format!("  cameras    {}\n", names("cameras"));
    if list("extensions").next().is_some() {
        let fate = |value: &Value| if value["read"] == true { "read" } else { "ignored" };
        let extension = |value: &Value| format!("{} ({})", text_of(&value["name"]), fate(value));
        text += &format!("  extensions {}\n", with("extensions", &extension));
    }
    let warnings: Vec<String> = list("warnings").map(text_of).collect();
    for warning in lines(&warnings, verbose) {
        text += &format!("warning: {warning}\n");
    }
    text
}
