//! A USD layer that describes a rendered EXR: RenderSettings, a RenderProduct with the path of the EXR, and a RenderVar
//! for each EXR layer (UsdRender).

use super::atomic;
use crate::error::Result;
use crate::film::{Layer, LayerSet};
use std::collections::HashSet;
use std::path::Path;

/// Name of the beauty, which has no name in the EXR.
const BEAUTY: &str = "beauty";

/// Writes the USD file that describes the layers of an EXR, `product`, to `path`. The path of the EXR is relative if it
/// lies in the folder of the USD file or below.
///
/// # Errors
/// Errors of the file system, with the path.
pub fn write(path: &Path, product: &Path, set: &LayerSet) -> Result<()> {
    atomic::write_bytes(path, text(&relative(path, product), set).as_bytes())
}

/// The path of the EXR `product` as the USD file `layer` names it: relative if it lies in its folder or below.
fn relative(layer: &Path, product: &Path) -> String {
    let whole = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let (layer, product) = (whole(layer), whole(product));
    let below = layer.parent().and_then(|folder| product.strip_prefix(folder).ok());
    below.map_or_else(|| product.display().to_string(), |below| format!("./{}", below.display()))
}

fn text(product: &str, set: &LayerSet) -> String {
    let mut taken = HashSet::new();
    let vars: Vec<(String, &Layer)> = set.layers.iter().map(|layer| (prim_name(layer, &mut taken), layer)).collect();
    let targets: Vec<String> = vars.iter().map(|(name, _)| format!("                </Render/Vars/{name}>")).collect();
    let defined: String = vars.iter().map(|(name, layer)| var(name, layer)).collect();
    format!(
        r#"#usda 1.0
(
    defaultPrim = "Render"
    doc = "caustique {version}"
    metersPerUnit = 1
    renderSettingsPrimPath = "/Render/Settings"
    upAxis = "Y"
)

def Scope "Render"
{{
    def RenderSettings "Settings"
    {{
        rel products = </Render/Products/Picture>
        uniform int2 resolution = ({width}, {height})
    }}

    def Scope "Products"
    {{
        def RenderProduct "Picture"
        {{
            rel orderedVars = [
{targets}
            ]
            token productName = {product}
            uniform token productType = "raster"
            uniform int2 resolution = ({width}, {height})
        }}
    }}

    def Scope "Vars"
    {{
{defined}    }}
}}
"#,
        version = env!("CARGO_PKG_VERSION"),
        width = set.width,
        height = set.height,
        targets = targets.join(",\n"),
        product = quoted(product),
    )
}

/// The text of the USD prim RenderVar that describes a layer of the EXR.
fn var(name: &str, layer: &Layer) -> String {
    let components: String = layer.planes.iter().map(|plane| plane.component.as_str()).collect();
    let kind = match components.as_str() {
        "RGB" => "color3f",
        "RGBA" | "rgba" => "color4f",
        "XYZ" => "vector3f",
        _ if components.len() == 2 => "float2",
        _ => "float",
    };
    let source = quoted(if layer.name.is_empty() { BEAUTY } else { &layer.name });
    format!(
        "        def RenderVar \"{name}\"\n        {{\n            uniform token dataType = \"{kind}\"\n            \
         uniform string sourceName = {source}\n            uniform token sourceType = \"raw\"\n        }}\n"
    )
}

/// A unique USD identifier for a layer of the EXR; added to `taken`.
fn prim_name(layer: &Layer, taken: &mut HashSet<String>) -> String {
    let name = if layer.name.is_empty() { BEAUTY } else { &layer.name };
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let mut name: String = name.chars().map(plain).collect();
    if name.starts_with(|c: char| c.is_ascii_digit()) {
        name.insert(0, '_');
    }
    while !taken.insert(name.clone()) {
        name.push('_');
    }
    name
}

/// The text as a USD string literal.
fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            '\n' => out.push_str("\\n"),
            '\r' => out.push_str("\\r"),
            c => out.push(c),
        }
    }
    out + "\""
}
