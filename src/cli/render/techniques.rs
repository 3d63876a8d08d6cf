//! `--debug-techniques`: writes a picture per sampling technique.

use super::options::RenderArgs;
use caustique::error::{Error, ErrorKind, Result};
use caustique::film::{Layer, LayerSet, Picture};
use caustique::image::exr::{self, Attributes};
use caustique::image::png;
use caustique::render::TechniquePicture;
use caustique::scene::description::PictureDefaults;
use std::path::Path;

/// Creates the folder for the technique pictures, if the user wants them.
///
/// # Errors
/// The folder cannot be created.
pub fn prepare(args: &RenderArgs) -> Result<()> {
    let Some(folder) = &args.debug_techniques else { return Ok(()) };
    std::fs::create_dir_all(folder).map_err(|cause| {
        Error::new(ErrorKind::Io, folder.display(), cause)
            .hint("--debug-techniques wants a folder that can be written to")
    })
}

/// Writes the weighted and the unweighted picture of each technique as EXR and as PNG, with the exposure and the tone curve
/// of the render.
///
/// # Errors
/// A file cannot be written.
pub fn write(args: &RenderArgs, pictures: &[TechniquePicture], made_for: &PictureDefaults) -> Result<()> {
    let Some(folder) = &args.debug_techniques else { return Ok(()) };
    for picture in pictures {
        for (values, kind) in [(&picture.weighted, "weighted"), (&picture.unweighted, "unweighted")] {
            one(args, folder, &format!("{}.{kind}", picture.name()), values, made_for)?;
        }
    }
    Ok(())
}

fn one(args: &RenderArgs, folder: &Path, name: &str, picture: &Picture, made_for: &PictureDefaults) -> Result<()> {
    let mut set = LayerSet::new(picture.size().width, picture.size().height);
    set.push(Layer::interleaved("", "RGB", picture.iter().copied()))?;
    let options = args.picture.exr_options(args.run.exr_naming);
    exr::write(&folder.join(format!("{name}.exr")), &set, &Attributes::default(), options)?;
    png::write_tonemapped(&folder.join(format!("{name}.png")), picture, args.picture.look(made_for))
}
