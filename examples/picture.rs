//! Renders a scene to an EXR with all layers, and to a PNG to look at.

use caustique::Render;

/// Renders the prism at 160 pixels, and says what its error is.
pub fn main() -> caustique::Result<()> {
    let image =
        Render::open(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/prism.glb"))?.width(160).iterations(16).run()?;
    image.save("prism.exr")?;
    image.save("prism.png")?;
    if let Some(error) = image.error() {
        println!("prism.exr: error {:.1} %", 100.0 * error);
    }
    Ok(())
}
