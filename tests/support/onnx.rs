//! Minimal ONNX networks in the wire format of protocol buffers.

/// A field of bytes: its number and its content.
fn field(number: u8, bytes: &[u8]) -> Vec<u8> {
    let mut out = vec![number << 3 | 2];
    out.extend(varint(bytes.len() as u64));
    out.extend(bytes);
    out
}

/// A field with an integer.
fn number(field: u8, value: u64) -> Vec<u8> {
    [vec![field << 3], varint(value)].concat()
}

fn varint(mut value: u64) -> Vec<u8> {
    let mut out = Vec::new();
    while value > 127 {
        out.push(value as u8 | 128);
        value >>= 7;
    }
    out.push(value as u8);
    out
}

/// An image tensor with this number of channels (ValueInfoProto).
fn image(name: &str, channels: u64) -> Vec<u8> {
    let size = |n: u64| field(1, &number(1, n));
    let open = |name: &str| field(1, &field(2, name.as_bytes()));
    let shape = [size(1), size(channels), open("h"), open("w")].concat();
    let tensor = [number(1, 1), field(2, &shape)].concat();
    [field(1, name.as_bytes()), field(2, &field(1, &tensor))].concat()
}

/// The metadata of a network.
fn metadata(kind: &str, others: &[(&str, &str)]) -> Vec<u8> {
    let right = [
        ("normalisation", "1"),
        ("version", "2"),
        ("kind", kind),
        ("features", "1"),
        ("levels", "2"),
        ("window", "3"),
        ("stride", "1"),
        ("halo", "0"),
        // Keys that a network may lack.
        ("pairs", ""),
        ("dilations", ""),
    ];
    let mut metadata: Vec<u8> = Vec::new();
    for (key, value) in right {
        let value = others.iter().find(|(other, _)| *other == key).map_or(value, |(_, value)| value);
        let entry = [field(1, format!("caustique.{key}").as_bytes()), field(2, value.as_bytes())].concat();
        metadata.extend(if value.is_empty() { Vec::new() } else { field(14, &entry) });
    }
    metadata
}

/// A network for two levels, or of the finish: one convolution with zero weights. `kind` is its contract. `others`
/// replaces metadata, or removes it if the value is empty.
pub fn network(kind: &str, others: &[(&str, &str)]) -> Vec<u8> {
    with_planes(if kind == "finish" { 27 } else { 4 * 2 + 7 }, kind, others)
}

/// A [`network`] with this number of input channels.
pub fn with_planes(input: u64, kind: &str, others: &[(&str, &str)]) -> Vec<u8> {
    let (output, name) = match kind {
        "features" => (1 + 3, kind),
        "finish" => (3, "picture"),
        _ => (3 * 3, kind),
    };
    let shape: Vec<u8> = [output, input, 1, 1].into_iter().flat_map(|n| number(1, n)).collect();
    let zeros = vec![0; (4 * output * input) as usize];
    let weights = [shape, number(2, 1), field(8, b"w"), field(9, &zeros)].concat();
    let node = [field(1, b"input"), field(1, b"w"), field(2, name.as_bytes()), field(4, b"Conv")].concat();
    let graph = [
        field(1, &node),
        field(2, b"g"),
        field(5, &weights),
        field(11, &image("input", input)),
        field(12, &image(name, output)),
    ];
    let opset = number(2, 13);
    [number(1, 8), field(7, &graph.concat()), field(8, &opset), metadata(kind, others)].concat()
}

/// The network of features with an input that is a vector instead of an image.
pub fn flat() -> Vec<u8> {
    let tensor = [number(1, 1), field(2, &field(1, &number(1, 15)))].concat();
    let value = |name: &str| [field(1, name.as_bytes()), field(2, &field(1, &tensor))].concat();
    let node = [field(1, b"input"), field(2, b"features"), field(4, b"Identity")].concat();
    let graph = [field(1, &node), field(2, b"g"), field(11, &value("input")), field(12, &value("features"))].concat();
    [number(1, 8), field(7, &graph), field(8, &number(2, 13)), metadata("features", &[])].concat()
}
