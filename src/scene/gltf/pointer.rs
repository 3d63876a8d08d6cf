//! Writes animated values into a document by JSON pointer (RFC 6901).

use serde_json::{Map, Value};

/// Why an animated value cannot be written at a JSON pointer.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum PointerError {
    /// A list of the document has no item with the index in the pointer.
    Missing,
    /// The reader does not support animation of this value.
    Unread,
}

/// Lists of the document whose values animations may change.
const ANIMATED_PARTS: [&str; 5] = ["nodes", "cameras", "materials", "meshes", "extensions"];

/// Writes the numbers of an animation at a JSON pointer, with the type of the present value: a boolean, a number, or a
/// list. Weights are always a list. Adds values that the file leaves at their default. `is_supported` says whether the
/// reader supports a glTF extension.
pub(super) fn put(
    root: &mut Value,
    pointer: &str,
    numbers: &[f64],
    is_supported: impl Fn(&str) -> bool,
) -> Result<(), PointerError> {
    let words: Vec<String> = pointer.split('/').skip(1).map(|w| w.replace("~1", "/").replace("~0", "~")).collect();
    let unread = |pair: &[String]| pair[0] == "extensions" && !is_supported(&pair[1]);
    if words.len() < 2 || !ANIMATED_PARTS.contains(&&*words[0]) || words.windows(2).any(unread) {
        return Err(PointerError::Unread);
    }
    let mut at = root;
    for word in &words {
        at = match at {
            Value::Array(items) => {
                word.parse().ok().and_then(|i: usize| items.get_mut(i)).ok_or(PointerError::Missing)?
            }
            Value::Object(object) => object.entry(word.as_str()).or_insert(Value::Null),
            place @ Value::Null => {
                *place = Value::Object(Map::new());
                &mut place[word.as_str()]
            }
            _ => return Err(PointerError::Unread),
        };
    }
    *at = match (&*at, numbers) {
        _ if pointer.ends_with("/weights") => numbers.into(),
        (Value::Bool(_), [x]) => (*x != 0.0).into(),
        (Value::Array(_), _) | (_, [_, _, ..]) => numbers.into(),
        (_, [x]) => (*x).into(),
        (_, []) => return Err(PointerError::Unread),
    };
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn written_values_keep_the_type_of_the_present_value() {
        let mut root = json!({"nodes": [{"extensions": {"KHR_node_visibility": {"visible": true}}}],
            "materials": [{}], "images": [{}], "asset": {}});
        let mut put =
            |pointer: &str, numbers: &[f64]| put(&mut root, pointer, numbers, |name| name.starts_with("KHR_"));
        assert_eq!(put("/nodes/0/weights", &[0.5]), Ok(()));
        assert_eq!(put("/nodes/0/extensions/KHR_node_visibility/visible", &[0.0]), Ok(()));
        assert_eq!(put("/materials/0/pbrMetallicRoughness/roughnessFactor", &[0.25]), Ok(()));
        assert_eq!(put("/materials/0/emissiveFactor", &[1.0, 2.0, 3.0]), Ok(()));
        assert_eq!(put("/nodes/1/scale", &[1.0, 2.0, 3.0]), Err(PointerError::Missing));
        for unread in ["/images/0/uri", "/nodes", "/nodes/0/weights/0/x", "/materials/0/extensions/EXT_odd/x", ""] {
            assert_eq!(put(unread, &[1.0]), Err(PointerError::Unread), "{unread}");
        }
        let material = json!({"pbrMetallicRoughness": {"roughnessFactor": 0.25}, "emissiveFactor": [1.0, 2.0, 3.0]});
        assert_eq!(root["materials"][0], material);
        assert_eq!(root["nodes"][0]["weights"], json!([0.5]));
        assert_eq!(root["nodes"][0]["extensions"]["KHR_node_visibility"]["visible"], false);
    }
}
