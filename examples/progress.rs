//! Watches a render, and stops it when its error is small enough or another thread asks for it.

use caustique::Render;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Renders the prism until its error is below 20 %.
pub fn main() -> caustique::Result<()> {
    // Another thread, such as that of a window, may set this flag.
    let stop = Arc::new(AtomicBool::new(false));
    let render = Render::open(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/prism.glb"))?.width(80).iterations(1000);
    let image = render
        .stop(Arc::clone(&stop))
        .progress(|progress| {
            println!("iteration {}: error {:?} after {:.1} s", progress.iteration, progress.error, progress.seconds);
            progress.error.is_none_or(|error| error > 0.2)
        })
        .run()?;
    image.save("prism-so-far.exr")
}
