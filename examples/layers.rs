//! Reads the layers of a render as arrays: the share of caustics in the light.

use caustique::{Method, Render};

/// Renders the prism by `vcm`, and compares the means of two layers.
pub fn main() -> caustique::Result<()> {
    let render = Render::open(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/prism.glb"))?;
    let image = render.width(80).iterations(4).method(Method::Vcm).unfinished().layers("beauty,Caustic,Z")?.run()?;
    let mean = |name: &str| {
        let values = image.layer(name).map(|layer| layer.triples()).unwrap_or_default();
        values.iter().flatten().map(|x| f64::from(*x)).sum::<f64>() / (3 * values.len().max(1)) as f64
    };
    let (width, height) = image.size();
    println!("{width} x {height} pixels: {:.1} % of the light is caustics", 100.0 * mean("Caustic") / mean(""));
    Ok(())
}
