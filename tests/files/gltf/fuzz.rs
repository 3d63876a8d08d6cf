//! Mutants of valid files: each is read or refused with a message. None panics, hangs or exhausts memory.

use super::everything::everything;
use super::glb::{Glb, pack};
use crate::support::promises;
use caustique::scene::description::EnvironmentSource;
use caustique::scene::environment_file;
use caustique::scene::gltf::{ReadOptions, read_bytes};
use serde_json::Value;
use std::panic::catch_unwind;
use std::path::Path;

/// A file like those that Blender exports.
fn exported() -> Glb {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/gems.glb");
    let bytes = std::fs::read(path).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let json: Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    Glb { json, binary: bytes[28 + length..].to_vec() }
}

/// A random number generator (SplitMix64), so that a failure identifies its mutant.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
}

/// One damaged version of a file.
fn mutant(file: &Glb, random: &mut Random) -> Vec<u8> {
    let mut json = file.json.to_string().into_bytes();
    let mut binary = file.binary.clone();
    match random.below(6) {
        // Digits change or multiply.
        0 | 1 => {
            let digits: Vec<usize> = (0..json.len()).filter(|i| json[*i].is_ascii_digit()).collect();
            for _ in 0..=random.below(3) {
                json[digits[random.below(digits.len())]] = b'0' + random.below(10) as u8;
            }
            if random.below(4) == 0 {
                let at = digits[random.below(digits.len())];
                json.splice(at..at, std::iter::repeat_n(b'9', random.below(25)));
            }
        }
        // A number is replaced by another value.
        2 => {
            let digits: Vec<usize> = (0..json.len()).filter(|i| json[*i].is_ascii_digit()).collect();
            let at = digits[random.below(digits.len())];
            let others: [&[u8]; 8] = [b"-1", b"null", b"1e30", b"-0", b"[]", b"\"x\"", b"4294967295", b"1e999"];
            json.splice(at..at + 1, others[random.below(8)].iter().copied());
        }
        // A letter of a key or a value changes.
        3 => {
            let at = random.below(json.len());
            json[at] = b"abcXYZ_019{}[],:\"\\ "[random.below(19)];
        }
        // Bits flip in either chunk.
        4 => {
            for _ in 0..=random.below(4) {
                let at = random.below(json.len() + binary.len());
                let bit = 1 << random.below(8);
                match at.checked_sub(json.len()) {
                    None => json[at] ^= bit,
                    Some(at) => binary[at] ^= bit,
                }
            }
        }
        // The file is truncated, with or without a corrected header.
        _ => {
            if random.below(2) == 0 {
                binary.truncate(random.below(binary.len()));
            } else {
                let mut file = pack(&json, &binary);
                file.truncate(random.below(file.len()));
                if file.len() >= 12 && random.below(2) == 0 {
                    let length = (file.len() as u32).to_le_bytes();
                    file[8..12].copy_from_slice(&length);
                }
                return file;
            }
        }
    }
    let mut file = pack(&json, &binary);
    // Sometimes the words of the container are changed.
    if random.below(20) == 0 {
        file[random.below(20)] ^= 1 << random.below(8);
    }
    file
}

#[test]
fn mutants_are_read_or_refused() {
    let path = Path::new("mutant.glb");
    let options = ReadOptions::default();
    for (name, base, count) in [("everything", everything(), 6000), ("exported", exported(), 600)] {
        let whole = read_bytes(&base.bytes(), path, &options).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(whole.instances.len() > 2 && !whole.lights.is_empty() && !whole.textures.is_empty());
        let (mut good, mut refused) = (0, 0);
        for seed in 0..count {
            let bytes = mutant(&base, &mut Random(seed));
            match catch_unwind(|| read_bytes(&bytes, path, &options)) {
                Ok(Ok(scene)) => {
                    good += 1;
                    promises::check(&scene, &format!("{name}, mutant {seed}"));
                }
                Ok(Err(error)) => {
                    refused += 1;
                    assert!(
                        !error.cause.is_empty() && error.place.starts_with("mutant.glb"),
                        "{name} {seed}: {error:?}"
                    );
                }
                Err(_) => panic!("{name}, mutant {seed} brought the reader down"),
            }
        }
        println!("{name}: {good} read, {refused} refused");
        // Both outcomes must be frequent, or the mutations are unsuitable.
        assert!(good > count / 10 && refused > count / 10, "{name}: {good} read, {refused} refused");
    }
}

/// Environment images with flipped bits are either read with finite values or refused.
#[test]
fn damaged_environment_images() {
    let folder = tempfile::tempdir().unwrap();
    let sky = |x: usize, y: usize| (x as f32, y as f32, 0.5);
    exr::prelude::write_rgb_file(folder.path().join("sky.exr"), 16, 8, sky).unwrap();
    let radiance = image::Rgb32FImage::from_fn(16, 8, |x, y| image::Rgb([x as f32, y as f32, 0.5]));
    radiance.save(folder.path().join("sky.hdr")).unwrap();
    let path = folder.path().join("damaged");
    for name in ["sky.exr", "sky.hdr"] {
        let whole = std::fs::read(folder.path().join(name)).unwrap();
        for seed in 0..300 {
            let mut random = Random(seed);
            let mut bytes = whole.clone();
            for _ in 0..=random.below(4) {
                let at = random.below(bytes.len());
                bytes[at] ^= 1 << random.below(8);
            }
            std::fs::write(&path, &bytes).unwrap();
            if let Ok(EnvironmentSource::Image { width, height, texels }) =
                environment_file::read(&path, &mut Vec::new())
            {
                assert_eq!(texels.len(), (width * height) as usize, "{name} {seed}");
                assert!(texels.iter().flatten().all(|x| x.is_finite() && *x >= 0.0), "{name} {seed}");
            }
        }
    }
}
