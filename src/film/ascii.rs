//! JSON for headers, which hold ASCII only.

/// JSON in ASCII: other characters, which JSON allows within strings only, become `\u` escapes (surrogate pairs above
/// U+FFFF).
pub fn ascii_json(json: &str) -> String {
    let mut ascii = String::with_capacity(json.len());
    for c in json.chars() {
        if c.is_ascii() {
            ascii.push(c);
        } else {
            for unit in c.encode_utf16(&mut [0; 2]) {
                ascii.push_str(&format!("\\u{unit:04x}"));
            }
        }
    }
    ascii
}
