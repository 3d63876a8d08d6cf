//! Messages about environment images and EXR files.

use super::{Said, message};
use caustique::image::exr;
use caustique::scene::environment_file;
use std::fs;
use std::path::Path;

/// The messages about bytes as an environment image.
fn environment(folder: &Path, bytes: &[u8]) -> Vec<String> {
    let path = folder.join("sky");
    fs::write(&path, bytes).expect("it can be written");
    of_environment(&path)
}

fn of_environment(path: &Path) -> Vec<String> {
    let mut warnings = Vec::new();
    let read = environment_file::read(path, &mut warnings);
    read.err().map(|error| message(&error)).into_iter().chain(warnings).collect()
}

/// The messages about bytes as a picture.
fn picture(folder: &Path, bytes: &[u8]) -> Vec<String> {
    let path = folder.join("picture");
    fs::write(&path, bytes).expect("it can be written");
    vec![message(&exr::read(&path).expect_err("it is refused"))]
}

/// The header of an EXR file.
struct Header {
    /// Type and flags of the file, in the version field.
    flags: u32,
    compression: u8,
    sampling: i32,
    /// Left, top, right and bottom, inclusive.
    data: [i32; 4],
    display: [i32; 4],
    /// Number of chunk offsets behind the header.
    offsets: usize,
}

const SMALL: Header =
    Header { flags: 0, compression: 0, sampling: 1, data: [0, 0, 1, 0], display: [0, 0, 1, 0], offsets: 1 };

impl Header {
    /// The bytes of the file without pixels.
    fn bytes(&self) -> Vec<u8> {
        let four = |numbers: [i32; 4]| numbers.map(i32::to_le_bytes).concat();
        let channel = |name: &str| {
            let sampling = self.sampling.to_le_bytes();
            [name.as_bytes(), b"\0", &1i32.to_le_bytes(), &[0; 4], &sampling, &sampling].concat()
        };
        let mut channels: Vec<u8> = ["B", "G", "R"].map(channel).concat();
        channels.push(0);
        let attributes: [(&str, &str, Vec<u8>); 8] = [
            ("channels", "chlist", channels),
            ("compression", "compression", vec![self.compression]),
            ("dataWindow", "box2i", four(self.data)),
            ("displayWindow", "box2i", four(self.display)),
            ("lineOrder", "lineOrder", vec![0]),
            ("pixelAspectRatio", "float", 1f32.to_le_bytes().to_vec()),
            ("screenWindowCenter", "v2f", vec![0; 8]),
            ("screenWindowWidth", "float", 1f32.to_le_bytes().to_vec()),
        ];
        let mut bytes = [20_000_630u32.to_le_bytes(), (2 | self.flags).to_le_bytes()].concat();
        for (name, kind, value) in attributes {
            let size = (value.len() as u32).to_le_bytes();
            bytes.extend([name.as_bytes(), b"\0", kind.as_bytes(), b"\0", &size, &value].concat());
        }
        bytes.push(0);
        bytes.resize(bytes.len() + 8 * self.offsets, 0);
        bytes
    }

    /// The bytes of the file with one chunk: a line number, a number of bytes, and these bytes.
    fn with_chunk(&self, chunk: &[u8]) -> Vec<u8> {
        let mut bytes = Header { offsets: 0, ..*self }.bytes();
        let offset = (bytes.len() + 8) as u64;
        bytes.extend(offset.to_le_bytes());
        bytes.extend(0i32.to_le_bytes());
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(chunk);
        bytes
    }
}

pub fn said() -> String {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let mut said = Said::default();
    said.case("no environment", &of_environment(&folder.join("nothing")));
    said.case("a folder as an environment", &of_environment(folder));
    said.case("an environment of another kind", &environment(folder, b"\x89PNG\r\n\x1a\n----"));
    said.case("an environment that ends early", &environment(folder, &SMALL.bytes()));
    let flat = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x80\x80\x80\x40\x40\x40\x81";
    said.case("half of a Radiance file", &environment(folder, &flat[..flat.len() - 3]));
    let huge = String::from_utf8_lossy(flat).replace("-Y 1 +X 2", "-Y 90000 +X 90000");
    said.case("a Radiance file of many texels", &environment(folder, huge.as_bytes()));
    let wide = Header { data: [0, 0, 30_000, 30_000], ..SMALL };
    said.case("an environment larger than its file", &environment(folder, &wide.bytes()));
    let dark = SMALL.with_chunk(&[0.0f32, 0.0, 1.0, 2.0, -1.0, f32::NAN].map(f32::to_le_bytes).concat());
    said.case("an environment below zero", &environment(folder, &float(dark)));

    said.case("no picture", &[message(&exr::read(&folder.join("nothing")).expect_err("nothing is there"))]);
    said.case("an empty picture", &picture(folder, b""));
    said.case("a picture of another kind", &picture(folder, b"\x89PNG\r\n\x1a\n----"));
    said.case("a picture that ends in its header", &picture(folder, &SMALL.bytes()[..100]));
    said.case("a picture without its pixels", &picture(folder, &SMALL.bytes()));
    said.case(
        "samples of every other pixel",
        &picture(folder, &Header { sampling: 2, data: [0, 0, 1, 1], ..SMALL }.bytes()),
    );
    said.case("a deep picture", &picture(folder, &deep()));
    let lines = Header { data: [0, 0, 0, 99], display: [0, 0, 0, 99], ..SMALL };
    said.case("more lines than bytes", &picture(folder, &lines.bytes()));
    let large = Header { data: [0, 0, 60_000, 0], display: [0, 0, 60_000, 0], ..SMALL };
    said.case("a picture larger than its file", &picture(folder, &large.bytes()));
    let far = Header { display: [0, 0, 30_000, 30_000], ..SMALL };
    said.case("a display window larger than its file", &picture(folder, &far.with_chunk(&[0; 12])));
    let whole = SMALL.with_chunk(&[0; 12]);
    said.case("a picture that ends in its pixels", &picture(folder, &whole[..whole.len() - 4]));
    let sections: Vec<u8> = [2u64, 1 << 60].map(u64::to_le_bytes).concat();
    let packed = Header { compression: 8, ..SMALL }.with_chunk(&[sections, vec![0; 80]].concat());
    said.case("a chunk that asks for all memory", &picture(folder, &packed));
    said.0.replace(&folder.display().to_string(), "DIR")
}

/// The file with channels of type float.
fn float(mut bytes: Vec<u8>) -> Vec<u8> {
    for name in [b"B\0", b"G\0", b"R\0"] {
        let at = bytes.windows(6).position(|w| w.starts_with(name) && w[2] == 1).expect("the channel") + 2;
        bytes[at] = 2;
    }
    bytes
}

/// A header of a deep part.
fn deep() -> Vec<u8> {
    let mut bytes = Header { flags: 1 << 11, ..SMALL }.bytes();
    let said = [b"type\0string\0".to_vec(), 12u32.to_le_bytes().to_vec(), b"deepscanline".to_vec()];
    let name = [b"name\0string\0".to_vec(), 1u32.to_le_bytes().to_vec(), b"a".to_vec()];
    let version = [b"version\0int\0".to_vec(), 4u32.to_le_bytes().to_vec(), 1u32.to_le_bytes().to_vec()];
    let samples = [b"maxSamplesPerPixel\0int\0".to_vec(), 4u32.to_le_bytes().to_vec(), 1u32.to_le_bytes().to_vec()];
    let chunks = [b"chunkCount\0int\0".to_vec(), 4u32.to_le_bytes().to_vec(), 1u32.to_le_bytes().to_vec()];
    bytes.splice(8..8, [said, name, version, samples, chunks].concat().concat());
    bytes
}

#[test]
fn about_images() {
    let said = said();
    assert_eq!(super::silent(&said), [] as [&str; 0], "cases of which nothing is said");
    insta::assert_snapshot!("image", said);
}
