//! Options and checks that all commands with output files share.

use caustique::argument::{Elsewhere, Ranged};
use caustique::error::{Error, ErrorKind, Result};
use caustique::film::{LayerSet, Naming};
use caustique::image::exr::{self, ColourSpace, Compression};
use caustique::image::tonemap::{Contrast, Look, ToneMap};
use caustique::image::{atomic, png};
use caustique::options::FinishOptions;
use caustique::scene::description::PictureDefaults;
use serde::Serialize;
use std::io::IsTerminal;
use std::ops::Bound::Unbounded;
use std::path::{Path, PathBuf};

/// Options about the PNG and the compression of the EXR.
#[derive(clap::Args, Clone, Serialize)]
#[serde(rename_all = "kebab-case")]
#[command(next_help_heading = "Output")]
pub struct PictureArgs {
    /// Also write a PNG to look at
    #[arg(long, value_name = "FILE.png")]
    #[serde(skip)]
    #[arg(not_in_python = "an argument of Image.save")]
    pub png: Option<PathBuf>,
    /// Exposure of the PNG in stops [default: the scene's, else 0]
    #[arg(long, value_name = "EV", between = (Unbounded, Unbounded), allow_negative_numbers = true)]
    #[serde(skip)]
    #[arg(hide_short_help = true)]
    #[arg(not_in_python = "an argument of Image.save")]
    pub exposure: Option<f64>,
    /// Tone curve of the PNG [default: the scene's, else agx]
    #[arg(long, value_enum)]
    #[serde(skip)]
    #[arg(hide_short_help = true)]
    #[arg(not_in_python = "an argument of Image.save")]
    pub tonemap: Option<ToneMap>,
    /// Contrast of the tone curves agx and filmic, as Blender's looks [default: the scene's, else medium]
    #[arg(long, value_enum)]
    #[serde(skip)]
    #[arg(hide_short_help = true)]
    #[arg(not_in_python = "an argument of Image.save")]
    pub contrast: Option<Contrast>,
    /// Compression of the EXR; all are lossless
    #[arg(long, value_enum, default_value_t)]
    #[arg(hide_short_help = true)]
    #[arg(not_in_python = "an argument of Image.save", in_stages = true)]
    pub compression: Compression,
    /// Store layers for which half floats suffice as such, as --layers comp does: the picture, its finished parts, albedo
    /// and normals
    #[arg(long)]
    #[serde(skip)]
    #[arg(hide_short_help = true)]
    #[arg(not_in_python = "an argument of Image.save", in_stages = true)]
    pub half: bool,
    /// Store each layer as a part of the EXR, for programs that unpack all channels of a part
    #[arg(long)]
    #[serde(skip)]
    #[arg(hide_short_help = true)]
    #[arg(not_in_python = "an argument of Image.save", in_stages = true)]
    pub multi_part: bool,
    /// Linear colour space of the pictures in the EXR
    #[arg(long, value_enum, default_value_t)]
    #[serde(skip)]
    #[arg(hide_short_help = true)]
    #[arg(not_in_python = "an argument of Image.save", in_stages = true)]
    pub colorspace: ColourSpace,
}

impl PictureArgs {
    /// Checks that the PNG can be written with the wanted look.
    pub fn check(&self) -> Result<()> {
        if self.contrast.is_some() && matches!(self.tonemap, Some(ToneMap::Neutral | ToneMap::Srgb)) {
            let error = Error::usage("--contrast: the tone curve of --tonemap has only one");
            return Err(error.hint("choose --tonemap agx or filmic, or leave --contrast out"));
        }
        self.png.as_deref().map_or(Ok(()), |path| check(path, "png"))
    }

    /// How the EXR is written: its compression, and its channel names.
    pub fn exr_options(&self, naming: Naming) -> exr::Options {
        let PictureArgs { compression, half, multi_part, colorspace, .. } = *self;
        exr::Options { compression, naming, half, multi_part, colour_space: colorspace }
    }

    /// The look of the PNG: the user's, else the scene's.
    pub fn look(&self, made_for: &PictureDefaults) -> Look {
        Look {
            exposure: self.exposure.map(|ev| ev as f32).or(made_for.exposure).unwrap_or_default(),
            tonemap: self.tonemap.or(made_for.tonemap).unwrap_or_default(),
            contrast: self.contrast.or(made_for.contrast).unwrap_or_default(),
        }
    }

    /// Writes the PNG, if the user wants one.
    pub fn write_png(&self, set: &LayerSet, made_for: &PictureDefaults) -> Result<()> {
        let Some(path) = &self.png else { return Ok(()) };
        let look = self.look(made_for);
        let alpha = set.get("").and_then(|beauty| beauty.plane("A")).filter(|_| made_for.film_transparent);
        match alpha {
            Some(alpha) => png::write_transparent(path, &set.beauty()?, &alpha.values, look),
            None => png::write_tonemapped(path, &set.beauty()?, look),
        }
    }
}

/// Checks that `path` has the extension and that a file can be written there.
///
/// # Errors
/// The extension is another, or the folder is missing or not writable.
pub fn check(path: &Path, extension: &str) -> Result<()> {
    let named = path.extension().is_some_and(|own| own.eq_ignore_ascii_case(extension));
    // Devices, such as /dev/null, need no extension, and folders are reported by the check below.
    let is_no_file = path.exists() && !path.is_file();
    if !named && !is_no_file {
        let error = Error::new(ErrorKind::Usage, path.display(), format!("the name does not end in .{extension}"));
        return Err(match extension {
            "exr" => error.hint("the output is an EXR; --png writes a picture to look at beside it"),
            _ => error.hint(format!("name it .{extension}")),
        });
    }
    atomic::check_writable(path)
}

/// The file of the network that finishes a picture; `None` if there is none, or it is one of the program's.
pub fn model_file(finish: &FinishOptions) -> Option<&Path> {
    finish.model.as_deref().map(Path::new).filter(|path| path.is_file())
}

/// Whether a picture is there and whole, so that it need not be made again.
pub fn is_whole(path: &Path) -> bool {
    path.is_file() && exr::check_whole(path).is_ok()
}

/// Whether a path, `-`, stands for standard output.
pub fn is_stdout(path: &Path) -> bool {
    path == Path::new("-")
}

/// Checks that the EXR of a render can be written to a file or to standard output.
///
/// # Errors
/// Errors of [`check`]; standard output is a terminal.
pub fn check_render(path: &Path) -> Result<()> {
    if !is_stdout(path) {
        return check(path, "exr");
    }
    if std::io::stdout().is_terminal() {
        let error = Error::usage("--output -: standard output is a terminal");
        return Err(error.hint("send it to a program or a file, such as '-o - > out.exr'"));
    }
    Ok(())
}
