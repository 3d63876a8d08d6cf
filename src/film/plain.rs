//! Names and axes of Blender's layers back to ours.

use super::kind::LAYERS;
use super::layers::{Layer, LayerSet, Plane};
use super::naming::{Naming, check, has_axes};

/// Names as Blender gives them back to ours. Layers with names that we cannot write are left out and returned.
pub fn take_plain_names(set: &mut LayerSet) -> Vec<String> {
    let known: Vec<&str> = LAYERS.iter().filter(|kind| kind.blender.is_some()).map(|kind| kind.name).collect();
    for layer in &mut set.layers {
        if let Some(plain) = known.iter().find(|plain| Naming::Blender.layer(plain) == layer.name) {
            layer.name = (*plain).into();
            turn_back(layer);
        } else if let Some(pass) = layer.name.strip_prefix("ViewLayer.") {
            layer.name = pass.into();
        }
    }
    let fits = |layer: &Layer| {
        let empty = |plane: &Plane| Plane { component: plane.component.clone(), sample: plane.sample, values: vec![] };
        let planes = layer.planes.iter().map(empty).collect();
        let alone = LayerSet { width: 0, height: 0, layers: vec![Layer { name: layer.name.clone(), planes }] };
        check(&alone, Naming::Plain).is_ok()
    };
    let (kept, left): (Vec<Layer>, Vec<Layer>) = std::mem::take(&mut set.layers).into_iter().partition(fits);
    set.layers = kept;
    left.into_iter().map(|layer| layer.name).collect()
}

/// Positions and normals from Blender's axes to ours: (x, y, z) there is (x, z, -y) here.
fn turn_back(layer: &mut Layer) {
    if !has_axes(&layer.name) {
        return;
    }
    for plane in &mut layer.planes {
        match plane.component.as_str() {
            "Y" => {
                plane.component = "Z".into();
                plane.values.iter_mut().for_each(|value| *value = -*value);
            }
            "Z" => plane.component = "Y".into(),
            _ => {}
        }
    }
    layer.planes.sort_by(|a, b| a.component.cmp(&b.component));
}
