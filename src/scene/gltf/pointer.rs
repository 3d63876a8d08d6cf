//! Values of a document by JSON pointers (RFC 6901), as animations name what they move.

use serde_json::{Map, Value};

/// Why nothing is at a pointer.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Nowhere {
    /// A list on the way has no such item.
    Missing,
    /// It leads to a part that is not read from moment to moment.
    Unread,
}

/// Parts of a document that animations may move.
const MOVABLE: [&str; 5] = ["nodes", "cameras", "materials", "meshes", "extensions"];

/// Puts the numbers of an animation at a pointer, in the form that the value there has: true or false, a number, or a
/// list, as weights always are. What a file leaves at its default is added; `is_read` says whether an extension on the
/// way is.
pub(super) fn put(
    root: &mut Value,
    pointer: &str,
    numbers: &[f64],
    is_read: impl Fn(&str) -> bool,
) -> Result<(), Nowhere> {
    let words: Vec<String> = pointer.split('/').skip(1).map(|w| w.replace("~1", "/").replace("~0", "~")).collect();
    let unread = |pair: &[String]| pair[0] == "extensions" && !is_read(&pair[1]);
    if words.len() < 2 || !MOVABLE.contains(&&*words[0]) || words.windows(2).any(unread) {
        return Err(Nowhere::Unread);
    }
    let mut at = root;
    for word in &words {
        at = match at {
            Value::Array(items) => word.parse().ok().and_then(|i: usize| items.get_mut(i)).ok_or(Nowhere::Missing)?,
            Value::Object(object) => object.entry(word.as_str()).or_insert(Value::Null),
            place @ Value::Null => {
                *place = Value::Object(Map::new());
                &mut place[word.as_str()]
            }
            _ => return Err(Nowhere::Unread),
        };
    }
    *at = match (&*at, numbers) {
        _ if pointer.ends_with("/weights") => numbers.into(),
        (Value::Bool(_), [x]) => (*x != 0.0).into(),
        (Value::Array(_), _) | (_, [_, _, ..]) => numbers.into(),
        (_, [x]) => (*x).into(),
        (_, []) => return Err(Nowhere::Unread),
    };
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn values_keep_their_form() {
        let mut root = json!({"nodes": [{"extensions": {"KHR_node_visibility": {"visible": true}}}],
            "materials": [{}], "images": [{}], "asset": {}});
        let mut put =
            |pointer: &str, numbers: &[f64]| put(&mut root, pointer, numbers, |name| name.starts_with("KHR_"));
        assert_eq!(put("/nodes/0/weights", &[0.5]), Ok(()));
        assert_eq!(put("/nodes/0/extensions/KHR_node_visibility/visible", &[0.0]), Ok(()));
        assert_eq!(put("/materials/0/pbrMetallicRoughness/roughnessFactor", &[0.25]), Ok(()));
        assert_eq!(put("/materials/0/emissiveFactor", &[1.0, 2.0, 3.0]), Ok(()));
        assert_eq!(put("/nodes/1/scale", &[1.0, 2.0, 3.0]), Err(Nowhere::Missing));
        for unread in ["/images/0/uri", "/nodes", "/nodes/0/weights/0/x", "/materials/0/extensions/EXT_odd/x", ""] {
            assert_eq!(put(unread, &[1.0]), Err(Nowhere::Unread), "{unread}");
        }
        let material = json!({"pbrMetallicRoughness": {"roughnessFactor": 0.25}, "emissiveFactor": [1.0, 2.0, 3.0]});
        assert_eq!(root["materials"][0], material);
        assert_eq!(root["nodes"][0]["weights"], json!([0.5]));
        assert_eq!(root["nodes"][0]["extensions"]["KHR_node_visibility"]["visible"], false);
    }
}
