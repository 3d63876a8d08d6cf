//! Reading Blender's files (`.blend`). Blender itself runs the exporter (`scripts/blender`, embedded in the program),
//! which writes a .glb for [`gltf`].

mod program;

pub use program::Blender;

use super::converter::{self, Converter};
use super::description::Description;
use super::gltf::{MovingFile, ReadOptions};
use crate::error::{Error, Result};
use crate::stop::Stop;
use std::path::Path;

/// Names and contents of the exporter's files (in Python), embedded in the program.
const SOURCES: [(&str, &str); 33] = [
    ("attributes.py", include_str!("../../../scripts/blender/attributes.py")),
    ("bake.py", include_str!("../../../scripts/blender/bake.py")),
    ("bake_cache.py", include_str!("../../../scripts/blender/bake_cache.py")),
    ("camera_coordinates.py", include_str!("../../../scripts/blender/camera_coordinates.py")),
    ("camera_export.py", include_str!("../../../scripts/blender/camera_export.py")),
    ("closures.py", include_str!("../../../scripts/blender/closures.py")),
    ("direct_images.py", include_str!("../../../scripts/blender/direct_images.py")),
    ("export.py", include_str!("../../../scripts/blender/export.py")),
    ("export_blend.py", include_str!("../../../scripts/blender/export_blend.py")),
    ("export_guard.py", include_str!("../../../scripts/blender/export_guard.py")),
    ("glb.py", include_str!("../../../scripts/blender/glb.py")),
    ("gltfmaterial.py", include_str!("../../../scripts/blender/gltfmaterial.py")),
    ("graph.py", include_str!("../../../scripts/blender/graph.py")),
    ("lamp_nodes.py", include_str!("../../../scripts/blender/lamp_nodes.py")),
    ("lamp_pictures.py", include_str!("../../../scripts/blender/lamp_pictures.py")),
    ("lamp_profiles.py", include_str!("../../../scripts/blender/lamp_profiles.py")),
    ("lighting.py", include_str!("../../../scripts/blender/lighting.py")),
    ("linking.py", include_str!("../../../scripts/blender/linking.py")),
    ("lobes.py", include_str!("../../../scripts/blender/lobes.py")),
    ("matching.py", include_str!("../../../scripts/blender/matching.py")),
    ("material_plan.py", include_str!("../../../scripts/blender/material_plan.py")),
    ("motion.py", include_str!("../../../scripts/blender/motion.py")),
    ("motion_gltf.py", include_str!("../../../scripts/blender/motion_gltf.py")),
    ("objects.py", include_str!("../../../scripts/blender/objects.py")),
    ("panorama.py", include_str!("../../../scripts/blender/panorama.py")),
    ("shading.py", include_str!("../../../scripts/blender/shading.py")),
    ("sky.py", include_str!("../../../scripts/blender/sky.py")),
    ("standin.py", include_str!("../../../scripts/blender/standin.py")),
    ("subsurface.py", include_str!("../../../scripts/blender/subsurface.py")),
    ("surfaces.py", include_str!("../../../scripts/blender/surfaces.py")),
    ("visibility.py", include_str!("../../../scripts/blender/visibility.py")),
    ("volumes.py", include_str!("../../../scripts/blender/volumes.py")),
    ("world.py", include_str!("../../../scripts/blender/world.py")),
];

/// Environment variable that limits the time of an export, in seconds.
const SECONDS_VARIABLE: &str = "CAUSTIQUE_BLENDER_SECONDS";

/// Whether a path has the extension of Blender's files.
pub fn is_blend(path: &Path) -> bool {
    path.extension().is_some_and(|own| own.eq_ignore_ascii_case("blend"))
}

/// Reads the .blend at `path` at the frame in `options`, or at the frame that was current when it was saved. Also
/// returns the exported file for other moments, as [`MovingFile::open`] does.
///
/// # Errors
/// There is no Blender, it cannot open or export the file, [`super::gltf::read`] of the exported file fails, or `stop`
/// ends the export.
pub fn read(path: &Path, options: &ReadOptions, stop: &Stop) -> Result<(Description, Option<MovingFile>)> {
    let of_file = ReadOptions { scene: None, ..options.clone() };
    let remedy = "choose what is rendered in Blender; --frames chooses the time, --scene the scene";
    converter::check_choices(path, &of_file, "files of Blender", remedy)?;
    let converter = Converter::new(path, "caustique-blend-", "scripts/blender", &SOURCES)?;
    let glb = converter.path("scene.glb");
    let own = std::path::absolute(path).map_err(|cause| Error::io(path, &cause))?;
    let mut command = Blender::find()?.command(&converter.path("export_blend.py"));
    command.arg(own).arg(&glb);
    // Joined, because a name may begin with a dash.
    let mut scene = std::ffi::OsString::from("--scene=");
    if let Some(name) = &options.scene {
        scene.push(name);
        command.arg(scene);
    }
    if let Some(frame) = options.frame {
        command.arg(format!("--frame={}", frame.number));
    }
    if options.motion_vectors {
        command.arg("--motion-vectors");
    }
    if options.allow_outside {
        command.arg("--allow-outside");
    }
    let seconds = converter::max_seconds(SECONDS_VARIABLE)?;
    command.arg(format!("--seconds={seconds}")).arg(format!("--bytes={}", converter::memory_limit()));
    // Blender's temporary files are removed with the folder.
    command.current_dir(converter.path("")).env("TMPDIR", converter.path(""));
    let printed = converter.run(command, program::HINT, stop)?;
    converter.read(&glb, &printed, &of_file)
}
