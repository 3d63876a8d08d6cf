//! `caustique compare`: the error of an image against a reference.

use super::progress::Form;
use super::{output, print, print_json};
use caustique::error::{Error, ErrorKind, Result};
use caustique::film::{Layer, LayerSet, Size};
use caustique::image::window::check_sizes;
use caustique::image::{
    Comparison, Floor, Inside, Outputs, Windowed, atomic, compare_windows, exr, heat, png, smooth_pixels,
};
use caustique::report::errors;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Measure the error of an image against a reference
///
/// relMSE is the mean over pixels of the squared difference over the squared reference plus 0.01; trimmed leaves out
/// the worst 0.5 % of pixels. FLIP estimates the visible difference when one image replaces the other. Grain is the part
/// of relMSE that neighbouring pixels do not share: the mean over 3 x 3 pixels is subtracted from the error. The errors inside
/// glass and mirrors are those of the pixels that show smooth glass or a mirror.
#[derive(clap::Args)]
pub struct CompareArgs {
    /// EXR to measure
    #[arg(value_name = "A.exr")]
    image: PathBuf,
    /// Reference EXR
    #[arg(value_name = "B.exr")]
    reference: PathBuf,
    /// Layer to compare, such as Noisy or Level1 [default: the picture itself]
    #[arg(long, value_name = "NAME")]
    layer: Option<String>,
    /// Add 0.01 times the squared mean radiance of the reference instead of 0.01 in relMSE and grain, so that both are
    /// independent of the brightness of the lamps
    #[arg(long)]
    relative: bool,
    /// EXR whose pixels show glass and mirrors, by its cryptomatte of materials, or where the first channel of LAYER is above
    /// 0.5 [default: A.exr, else B.exr]
    #[arg(long, value_name = "FILE[:LAYER]")]
    mask: Option<PathBuf>,
    /// Also write a heat map of FLIP: black is no difference, pale yellow a large one
    #[arg(long, value_name = "FILE.png")]
    png: Option<PathBuf>,
    /// Also write a page with both pictures and the errors of their pixels, and with the estimated errors if the image has
    /// a layer Error
    #[arg(long, value_name = "FILE.html")]
    page: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Compares an EXR with a reference and prints the errors.
pub fn run(args: &CompareArgs) -> Result<()> {
    if let Some(png) = &args.png {
        output::check(png, "png")?;
    }
    if let Some(page) = &args.page {
        output::check(page, "html")?;
    }
    let outputs = Outputs::new(args.png.iter().chain(&args.page).cloned())?;
    outputs.check(
        [args.image.as_path(), &args.reference].into_iter().chain(args.mask.as_deref().map(|mask| mask_parts(mask).0)),
    )?;
    let image = read(&args.image, args.layer.as_deref())?;
    let reference = read(&args.reference, args.layer.as_deref())?;
    let floor = if args.relative { Floor::Relative } else { Floor::Papers };
    let compared = Form::for_output(args.json).during("comparing", || compare_windows(&image.0, &reference.0, floor));
    let (mut comparison, common) = compared.map_err(|e| e.within(args.image.display()))?;
    let mask = args.mask.as_deref().map(|mask| read_mask(mask, image.0.whole)).transpose()?;
    let mut readings = mask.iter().chain([&image, &reference]);
    if let Some((picture, inside)) = readings.find_map(|(picture, inside)| Some((picture, inside.as_ref()?))) {
        comparison.measure_inside(&picture.values_in(&common[0], inside)?);
    }
    let [image, reference] = common;
    if let Some(path) = &args.png {
        let map = image.expand_values(&comparison.flip_map)?;
        png::write(path, image.whole, map.iter().map(|&error| heat::magma(error)))?;
    }
    if let Some(path) = &args.page {
        let names = [&args.image, &args.reference].map(|path| path.display().to_string());
        comparison.flip_map = image.expand_values(&comparison.flip_map)?;
        let page =
            errors::html(&image.expand()?, &reference.expand()?, names.each_ref().map(String::as_str), &comparison)?;
        atomic::write_bytes(path, page.as_bytes())?;
    }
    if args.json { print_json(&json!(comparison)) } else { print(&text(&comparison)) }
}

/// The layers of an EXR, and which of its pixels show smooth glass or a mirror, if it says so.
type Reading = (Windowed, Option<Vec<bool>>);

/// Reads the layers of an EXR, and which of its pixels show smooth glass or a mirror, if it says so. If a layer is named, it
/// becomes the picture, without the other layers.
fn read(path: &Path, layer: Option<&str>) -> Result<Reading> {
    let (mut windowed, attributes) = exr::read_window(path)?;
    let inside = smooth_pixels(&windowed.set, &attributes);
    if let Some(name) = layer {
        name_picture(&mut windowed.set, path, name)?;
    }
    Ok((windowed, inside))
}

/// Makes the layer of this name the picture, and removes the other layers.
fn name_picture(set: &mut LayerSet, path: &Path, name: &str) -> Result<()> {
    let names: Vec<String> = set.layers.iter().map(describe_layer).collect();
    set.layers.retain(|layer| layer.name == name);
    let Some(layer) = set.layers.first_mut() else {
        let error = Error::new(ErrorKind::Usage, path.display(), format!("there is no layer \"{name}\""));
        return Err(error.hint(format!("it has {}", names.join(", "))));
    };
    layer.name.clear();
    Ok(())
}

/// The file and the layer of the argument of --mask, `FILE` or `FILE:LAYER`.
fn mask_parts(argument: &Path) -> (&Path, Option<&str>) {
    let named = argument.to_str().filter(|_| !argument.exists()).and_then(|text| text.rsplit_once(':'));
    named.map_or((argument, None), |(file, layer)| (Path::new(file), Some(layer)))
}

/// Reads the argument of --mask, for a picture of this size.
fn read_mask(argument: &Path, whole: Size) -> Result<Reading> {
    let (path, layer) = mask_parts(argument);
    let fault = |cause: &str| Error::new(ErrorKind::Usage, path.display(), cause);
    let (mask, smooth) = read(path, layer)?;
    check_sizes(mask.whole, whole).map_err(|e| e.within(path.display()))?;
    let first = mask.set.get("").and_then(|layer| layer.planes.first());
    let inside = match (layer, first) {
        (Some(_), Some(plane)) => plane.values.iter().map(|value| *value > 0.5).collect(),
        (Some(_), None) => return Err(fault("its layer is empty")),
        (None, _) => smooth.ok_or_else(|| {
            let error = fault("it does not say which pixels show glass and mirrors");
            error.hint("render it with --layers that include CryptoMaterial, or name a layer: FILE:LAYER")
        })?,
    };
    Ok((mask, Some(inside)))
}

/// The name of a layer for messages, or the channels of the beauty layer, which has no name.
fn describe_layer(layer: &Layer) -> String {
    let components: Vec<&str> = layer.planes.iter().map(|plane| plane.component.as_str()).collect();
    if layer.name.is_empty() { components.join(" ") } else { layer.name.clone() }
}

fn text(comparison: &Comparison) -> String {
    let ratio = comparison.mean_ratio.map_or("the reference is black".into(), |ratio| format!("{ratio:.6}"));
    let whole = format!(
        "relMSE            {:.6e}\nrelMSE, trimmed   {:.6e}\nMSE               {:.6e}\nmean ratio        {ratio}\n\
         FLIP              {:.6}\ngrain             {:.6e}\npixels not finite {}\n",
        comparison.relmse,
        comparison.relmse_trimmed,
        comparison.mse,
        comparison.flip,
        comparison.grain,
        comparison.pixels_not_finite
    );
    let inside = comparison.inside.map_or_else(String::new, |Inside { pixels, relmse, flip, grain }| {
        format!(
            "in glass and mirrors, {pixels} pixels:\n  relMSE          {relmse:.6e}\n  FLIP            {flip:.6}\n  \
             grain           {grain:.6e}\n"
        )
    });
    whole + &inside
}
