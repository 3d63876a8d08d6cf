//! EXR files: written files are read back, have the same bytes every time, and no file crashes the reader.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use ::exr::meta::attribute::AttributeValue;
use caustique::error::ErrorKind;
use caustique::film::cryptomatte::{Cryptomatte, PixelRanks};
use caustique::film::{Layer, LayerSet, Naming, Picture, Role, Sample, Selection, Size};
use caustique::image::exr::{self, Attributes, ColourSpace, Compression, Options};
use caustique::image::{
    atomic, png,
    tonemap::{Look, ToneMap},
};
use caustique::scene::description::EnvironmentSource;
use caustique::scene::environment_file;

const COMPRESSIONS: [Compression; 4] = [Compression::Zip, Compression::Zips, Compression::Piz, Compression::None];

/// A picture of odd size in which every value identifies its channel and pixel, with half-float, single-channel and
/// cryptomatte-like planes.
fn fixture(width: usize, height: usize) -> LayerSet {
    let mut set = LayerSet::new(width, height);
    let n = width * height;
    let value = |layer: usize, i: usize, c: usize| ((layer * 1000 + i * 4 + c) as f32).sin() * 10f32.powi(c as i32 - 1);
    set.push(Layer::interleaved("", "RGBA", (0..n).map(|i| [0, 1, 2, 3].map(|c| value(1, i, c))))).unwrap();
    set.push(Layer::interleaved("Level1", "RGB", (0..n).map(|i| [0, 1, 2].map(|c| value(2, i, c))))).unwrap();
    let albedo = (0..n).map(|i| [0, 1, 2].map(|c| ((i + c) % 16) as f32 / 16.0));
    set.push(Layer::interleaved("albedo", "RGB", albedo).stored_as(Sample::Half)).unwrap();
    set.push(Layer::interleaved("normal", "XYZ", (0..n).map(|i| [value(4, i, 0), 0.0, -1.0]))).unwrap();
    set.push(Layer::interleaved("Z", "Z", (0..n).map(|i| [if i % 3 == 0 { 1e10 } else { i as f32 }]))).unwrap();
    set.push(Layer::interleaved("CryptoObject00", "rgba", (0..n).map(|i| [f32::from_bits(i as u32), 1.0, 0.0, 0.0])))
        .unwrap();
    set
}

fn sorted(mut set: LayerSet) -> LayerSet {
    set.layers.sort_by(|a, b| a.name.cmp(&b.name));
    set
}

fn attributes() -> Attributes {
    let mut attributes = Attributes::of(&serde_json::json!({"scene": "Bl\u{fc}te \u{1f308}.glb", "seed": 7})).unwrap();
    for key in ["name", "hash", "conversion", "manifest"] {
        attributes.texts.insert(format!("cryptomatte/abcdef0/{key}"), format!("value of {key}"));
    }
    attributes
}

fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

#[test]
fn written_files_are_read_back() {
    let folder = tempfile::tempdir().unwrap();
    for (width, height) in [(1, 1), (7, 3), (33, 50)] {
        for compression in COMPRESSIONS {
            let path = folder.path().join("a.exr");
            let set = fixture(width, height);
            exr::write(&path, &set, &attributes(), Options { compression, ..Options::default() }).unwrap();
            let (back, found) = exr::read(&path).unwrap();
            assert_eq!(sorted(back), sorted(set), "{compression:?} {width}x{height}");
            assert_eq!(found, attributes());
            assert_eq!(found.object().unwrap()["scene"], "Bl\u{fc}te \u{1f308}.glb");
        }
    }
}

/// Reading some layers gives them as reading all layers does, from one part and from many; the header has all layers
/// without values.
#[test]
fn layers_are_read_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    for (compression, multi_part) in COMPRESSIONS.into_iter().flat_map(|c| [(c, false), (c, true)]) {
        exr::write(&path, &fixture(33, 50), &attributes(), Options { compression, multi_part, ..Options::default() })
            .unwrap();
        let (all, _) = exr::read(&path).unwrap();
        for names in [&["albedo", "Z"][..], &["", "none"], &["CryptoObject00"], &[]] {
            let wanted = |name: &str| names.contains(&name);
            let (some, found) = exr::read_layers(&path, wanted).unwrap();
            let mut expected = all.clone();
            expected.layers.retain(|layer| wanted(&layer.name));
            assert_eq!((some, found), (expected, attributes()), "{compression:?} {multi_part} {names:?}");
        }
        let (mut header, found) = exr::read_header(&path).unwrap();
        assert_eq!((header.size(), found), (all.size(), attributes()));
        assert!(header.layers.iter().flat_map(|layer| &layer.planes).all(|plane| plane.values.is_empty()));
        for (layer, known) in header.layers.iter_mut().zip(&all.layers) {
            layer.planes.iter_mut().zip(&known.planes).for_each(|(plane, known)| plane.values = known.values.clone());
        }
        assert_eq!(header, all);
    }
    // The header of a file whose pixels are missing can still be read.
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    assert!(exr::read_header(&path).is_ok() && exr::read_layers(&path, |_| true).is_err());
}

/// Programs that open one part of a file find the manifest of its cryptomatte there, and in no part that of another.
#[test]
fn every_part_of_a_cryptomatte_has_its_texts() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    for naming in [Naming::Plain, Naming::Blender] {
        let mut set = LayerSet::new(2, 1);
        set.push(Layer::interleaved("", "RGB", [[0.5; 3]; 2])).unwrap();
        let mut attributes = Attributes::of(&serde_json::json!({"seed": 7})).unwrap();
        for kind in ["CryptoObject", "CryptoMaterial"] {
            let matte = Cryptomatte::new(kind, ["a".to_owned()]);
            matte.layers(&[PixelRanks::default(); 2], 1.0).into_iter().for_each(|layer| set.push(layer).unwrap());
            attributes.texts.extend(matte.attributes(naming));
        }
        exr::write(&path, &set, &attributes, Options { naming, multi_part: true, ..Options::default() }).unwrap();
        let parts = ::exr::meta::MetaData::read_from_file(&path, false).unwrap().headers;
        assert_eq!(parts.len(), 7);
        for part in &parts[1..] {
            let name = part.own_attributes.layer_name.as_ref().unwrap().to_string();
            let kind = if name.contains("Object") { "CryptoObject" } else { "CryptoMaterial" };
            let expected = BTreeMap::from(Cryptomatte::new(kind, ["a".to_owned()]).attributes(naming));
            let texts = part.own_attributes.other.iter().filter_map(|(key, value)| match value {
                AttributeValue::Text(text) => Some((key.to_string(), text.to_string())),
                _ => None,
            });
            assert_eq!(texts.collect::<BTreeMap<_, _>>(), expected, "{name}");
        }
        assert_eq!(exr::read(&path).unwrap().1, attributes);
    }
}

#[test]
fn values_that_are_not_finite_survive() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let values = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.0, f32::MIN_POSITIVE / 4.0, f32::MAX];
    let mut set = LayerSet::new(values.len(), 1);
    set.push(Layer::interleaved("Rejected", "X", values.map(|v| [v]))).unwrap();
    exr::write(&path, &set, &Attributes::default(), Options::default()).unwrap();
    let (back, _) = exr::read(&path).unwrap();
    let bits = |set: &LayerSet| set.layers[0].planes[0].values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&back), bits(&set));
}

#[test]
fn bytes_do_not_depend_on_run_or_threads() {
    let folder = tempfile::tempdir().unwrap();
    let set = fixture(129, 131);
    for compression in COMPRESSIONS {
        let bytes = |run: usize, threads: usize| {
            let path = folder.path().join(format!("{run}-{threads}.exr"));
            with_threads(threads, || {
                exr::write(&path, &set, &attributes(), Options { compression, ..Options::default() }).unwrap()
            });
            fs::read(path).unwrap()
        };
        let first = bytes(0, 1);
        for run in 1..12 {
            assert!(bytes(run, 1 + run % 3) == first, "{compression:?}, run {run}");
        }
    }
}

/// Names of the header's attributes in their order in the file.
fn attribute_names(path: &Path) -> Vec<String> {
    let bytes = fs::read(path).unwrap();
    let text = |at: &mut usize| {
        let end = *at + bytes[*at..].iter().position(|&b| b == 0).unwrap();
        let text = String::from_utf8(bytes[*at..end].to_vec()).unwrap();
        *at = end + 1;
        text
    };
    let (mut at, mut names) = (8, Vec::new());
    loop {
        let name = text(&mut at);
        if name.is_empty() {
            return names;
        }
        names.push(name);
        text(&mut at);
        let size = u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        at += 4 + size as usize;
    }
}

#[test]
fn attributes_are_sorted_and_scan_lines_are_zipped() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    exr::write(&path, &fixture(20, 40), &attributes(), Options::default()).unwrap();
    let names = attribute_names(&path);
    let mut expected = names.clone();
    expected.sort();
    assert_eq!(names, expected);
    assert!(names.contains(&"cryptomatte/abcdef0/manifest".to_owned()) && names.contains(&"caustique".to_owned()));
    let meta = ::exr::meta::MetaData::read_from_file(&path, true).unwrap();
    assert_eq!(meta.headers.len(), 1);
    assert_eq!(meta.headers[0].compression, ::exr::meta::attribute::Compression::ZIP16);
    assert_eq!(meta.headers[0].blocks, ::exr::meta::BlockDescription::ScanLines);
    assert_eq!(meta.headers[0].line_order, ::exr::meta::attribute::LineOrder::Increasing);
}

#[test]
fn blender_names() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let set = fixture(3, 2);
    exr::write(&path, &set, &Attributes::default(), Options { naming: Naming::Blender, ..Options::default() }).unwrap();
    let (back, _) = exr::read(&path).unwrap();
    let mut names: Vec<String> = Vec::new();
    for layer in &back.layers {
        names.extend(layer.planes.iter().map(|plane| format!("{}.{}", layer.name, plane.component)));
    }
    for name in [
        "ViewLayer.Combined.R",
        "ViewLayer.Combined.A",
        "ViewLayer.Depth.Z",
        "ViewLayer.Normal.X",
        "ViewLayer.Denoising Albedo.R",
        "ViewLayer.Level1.B",
        "ViewLayer.CryptoObject00.r",
    ] {
        assert!(names.contains(&name.to_owned()), "{name} in {names:?}");
    }
    // Layers are found by their role under both naming conventions.
    assert_eq!(back.beauty().unwrap(), set.beauty().unwrap());
    assert_eq!(back.find(Role::Albedo).unwrap().triples(), set.get("albedo").unwrap().triples());
    // In Blender z is up, and y points away from the viewer.
    let turned = |[x, y, z]: [f32; 3]| [x, -z, y];
    let expected: Vec<[f32; 3]> = set.get("normal").unwrap().triples().into_iter().map(turned).collect();
    assert_eq!(back.find(Role::Normal).unwrap().triples(), expected);
}

/// The header has the data window of a crop within the display window, the camera and the colour space.
#[test]
fn windows_cameras_and_colours_are_in_the_header() {
    use ::exr::math::Vec2;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let set = fixture(3, 2);
    let world_to_camera = std::array::from_fn(|i| i as f32);
    let world_to_ndc = Some(std::array::from_fn(|i| -(i as f32)));
    let frame = exr::Frame { display: [8, 5], corner: [4, 1], world_to_camera, world_to_ndc };
    let attributes = Attributes { frame: Some(frame), ..Attributes::default() };
    for naming in [Naming::Plain, Naming::Blender] {
        exr::write(&path, &set, &attributes, Options { naming, ..Options::default() }).unwrap();
        let header = ::exr::meta::MetaData::read_from_file(&path, true).unwrap().headers.remove(0);
        assert_eq!(header.shared_attributes.display_window.size, Vec2(8, 5));
        assert_eq!((header.layer_size, header.own_attributes.layer_position), (Vec2(3, 2), Vec2(4, 1)));
        assert_eq!(header.shared_attributes.chromaticities.expect("primaries").red, Vec2(0.64, 0.33));
        assert!(header.own_attributes.software_name.expect("a program").to_string().starts_with("caustique "));
        let found = header.own_attributes.world_to_camera.expect("a camera");
        // The same point in the coordinates of the file: (1, 2, 3), and (1, -3, 2) for Blender.
        let point = if naming == Naming::Plain { [1.0, 2.0, 3.0, 1.0] } else { [1.0, -3.0, 2.0, 1.0] };
        let x = |m: &[f32; 16], p: [f32; 4]| (0..4).map(|row| p[row] * m[4 * row]).sum::<f32>();
        assert_eq!(x(&found, point), x(&world_to_camera, [1.0, 2.0, 3.0, 1.0]));
        assert!(header.own_attributes.world_to_normalized_device.is_some());
        // Reading returns the whole picture, black outside of the data window.
        let (back, _) = exr::read(&path).unwrap();
        assert_eq!((back.width, back.height), (8, 5));
        let beauty = back.beauty().unwrap();
        assert_eq!(beauty[8 + 4], set.beauty().unwrap()[0]);
        assert_eq!(beauty[0], [0.0; 3]);
    }
}

/// The header of an animation frame has its number, the frame rate, and the time code.
#[test]
fn frames_of_films_are_in_the_header() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let header = |number, rate| {
        let attributes = Attributes { moment: exr::Moment { number, rate }, ..Attributes::default() };
        exr::write(&path, &fixture(3, 2), &attributes, Options::default()).unwrap();
        ::exr::meta::MetaData::read_from_file(&path, true).unwrap().headers.remove(0)
    };
    let found = header(Some(-7), Some([24000, 1001]));
    assert_eq!(found.own_attributes.frames_per_second, Some((24000, 1001)));
    let counter = |found: &::exr::meta::header::Header| {
        let other = &found.own_attributes.other;
        other.iter().find(|(name, _)| *name == "imageCounter").map(|(_, value)| value.to_i32().unwrap())
    };
    assert_eq!((counter(&found), found.shared_attributes.time_code), (Some(-7), None));
    // 1 h 2 min 3 s and 4 frames: a rate of 23.976 counts as 24 frames per second.
    let code = header(Some(((60 + 2) * 60 + 3) * 24 + 4), Some([24000, 1001])).shared_attributes.time_code.unwrap();
    assert_eq!((code.hours, code.minutes, code.seconds, code.frame, code.drop_frame), (1, 2, 3, 4, false));
    let bare = header(None, None);
    assert_eq!(
        (bare.own_attributes.frames_per_second, counter(&bare), bare.shared_attributes.time_code),
        (None, None, None)
    );
    // A time code cannot express 60 frames per second, or a time beyond one day.
    let code = |number, rate| exr::Moment { number: Some(number), rate: Some(rate) }.time_code();
    assert_eq!((code(1, [60, 1]), code(24 * 3600 * 24, [24, 1])), (None, None));
    assert_eq!(code(24 * 3600 * 24 - 1, [24, 1]), Some([23, 59, 59, 23]));
}

#[test]
fn names_that_break_other_programs_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let long = "L".repeat(30);
    for (layer, component, cause) in [
        ("1Level", "R", "a letter"),
        ("my.layer", "R", "a letter"),
        ("Level\u{e9}", "R", "a letter"),
        (&long, "R", "too long"),
        ("Level1", "Q", "a component"),
    ] {
        let mut set = LayerSet::new(1, 1);
        set.push(Layer::interleaved(layer, component, [[1.0]])).unwrap();
        let error = exr::write(&path, &set, &Attributes::default(), Options::default()).unwrap_err();
        assert!(error.cause.contains(cause), "{error}");
        assert!(!path.exists());
    }
    let mut attributes = Attributes::default();
    attributes.texts.insert("caustique".into(), "\u{fc}".into());
    let error = exr::write(&path, &fixture(1, 1), &attributes, Options::default()).unwrap_err();
    assert!(error.cause.contains("ASCII"), "{error}");
    let error = exr::write(&path, &LayerSet::new(4, 4), &Attributes::default(), Options::default()).unwrap_err();
    assert!(error.cause.contains("no picture"), "{error}");
}

#[test]
fn planes_must_fit_and_names_are_unique() {
    let mut set = LayerSet::new(2, 2);
    let error = set.push(Layer::interleaved("Noisy", "RGB", [[0.0; 3]; 3])).unwrap_err();
    assert_eq!((error.kind, error.cause.as_str()), (ErrorKind::Image, "3 values for 2 x 2 pixels"));
    set.push(Layer::interleaved("Noisy", "RGB", [[0.0; 3]; 4])).unwrap();
    set.push(Layer::interleaved("Noisy", "RGB", [[1.0; 3]; 4])).unwrap();
    assert_eq!(set.layers.len(), 1);
    assert_eq!(set.get("Noisy").unwrap().triples()[0], [1.0; 3]);
}

#[test]
fn selections() {
    let set = fixture(2, 2);
    let names = |text: &str| {
        let picked = Selection::parse(text).unwrap().apply(set.clone()).unwrap();
        picked.layers.iter().map(|layer| layer.name.clone()).collect::<Vec<_>>()
    };
    assert_eq!(names("all").len(), set.layers.len());
    assert_eq!(names("beauty"), [""]);
    assert_eq!(names("beauty,albedo, Level"), ["", "Level1", "albedo"]);
    let error = Selection::parse("beauty,albeod").unwrap_err();
    assert_eq!((error.kind, error.cause.as_str()), (ErrorKind::Usage, "no layer \"albeod\""));
    assert_eq!(error.hint.as_deref(), Some("did you mean \"albedo\"?"));
    assert_eq!(Selection::parse("").unwrap_err().kind, ErrorKind::Usage);
    // A known layer name that this picture lacks.
    let error = Selection::parse("beauty,Level9").unwrap().apply(set.clone()).unwrap_err();
    assert_eq!(error.hint.as_deref(), Some("did you mean \"Level1\"?"));
}

/// A picture written directly by the `exr` crate, with parts, windows and types that this program never writes.
mod foreign {
    use ::exr::prelude::*;

    pub fn channel(name: &str, samples: FlatSamples) -> AnyChannel<FlatSamples> {
        AnyChannel::new(name, samples)
    }

    pub fn part(
        name: &str,
        size: (usize, usize),
        position: (i32, i32),
        encoding: Encoding,
        channels: Vec<AnyChannel<FlatSamples>>,
    ) -> ::exr::image::Layer<AnyChannels<FlatSamples>> {
        let attributes = LayerAttributes::named(name).with_position(Vec2(position.0, position.1));
        ::exr::image::Layer::new(size, attributes, encoding, AnyChannels::sort(channels.into()))
    }
}

#[test]
fn foreign_parts_windows_and_types() {
    use ::exr::prelude::*;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("foreign.exr");
    // The display window is 4 x 3 at (10, 20). Part one covers all of it and more on every side.
    let display = IntegerBounds::new((10, 20), (4, 3));
    let (w, h) = (6, 5);
    let over: Vec<f32> = (0..w * h).map(|i| (i % w) as f32 * 100.0 + (i / w) as f32).collect();
    let first = foreign::part(
        "rgba",
        (w, h),
        (9, 19),
        Encoding::SMALL_LOSSLESS,
        vec![
            foreign::channel("R", FlatSamples::F32(over.clone())),
            foreign::channel("G", FlatSamples::F16(over.iter().map(|&v| f16::from_f32(v)).collect())),
            foreign::channel("B", FlatSamples::U32(over.iter().map(|&v| v as u32).collect())),
        ],
    );
    // Part two is a single tiled pixel within the window.
    let second = foreign::part(
        "N",
        (1, 1),
        (12, 21),
        Encoding {
            compression: Compression::RLE,
            blocks: Blocks::Tiles(Vec2(16, 16)),
            line_order: LineOrder::Increasing,
        },
        vec![
            foreign::channel("X", FlatSamples::F32(vec![5.0])),
            foreign::channel("N.Y", FlatSamples::F32(vec![6.0])),
            foreign::channel("other.U", FlatSamples::F32(vec![7.0])),
        ],
    );
    Image::empty(ImageAttributes::new(display)).with_layer(first).with_layer(second).write().to_file(&path).unwrap();

    let (set, _) = exr::read(&path).unwrap();
    assert_eq!((set.width, set.height), (4, 3));
    let beauty = set.get("").unwrap();
    assert_eq!(beauty.planes.iter().map(|p| p.component.as_str()).collect::<String>(), "RGB");
    assert_eq!(beauty.planes[1].sample, caustique::film::Sample::Half);
    for (i, rgb) in set.beauty().unwrap().into_iter().enumerate() {
        assert_eq!(rgb, [((i % 4 + 1) * 100 + i / 4 + 1) as f32; 3], "pixel {i}");
    }
    let normal = set.find(Role::Normal).unwrap();
    assert_eq!(normal.name, "N");
    for (i, (x, y)) in normal.planes[0].values.iter().zip(&normal.planes[1].values).enumerate() {
        assert_eq!((*x, *y), if i == 6 { (5.0, 6.0) } else { (0.0, 0.0) });
    }
    assert_eq!(set.get("N.other").unwrap().planes[0].values[6], 7.0);
}

#[test]
fn malformed_files_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let missing = exr::read(&path).unwrap_err();
    assert_eq!(missing.kind, ErrorKind::Io);
    fs::write(&path, b"").unwrap();
    assert!(exr::read(&path).unwrap_err().cause.contains("empty"));
    fs::write(&path, b"\x89PNG\r\n\x1a\n and so on").unwrap();
    assert_eq!(exr::read(&path).unwrap_err().kind, ErrorKind::Image);
    assert!(exr::read(folder.path()).is_err());

    let mut random = 0x9e37_79b9_7f4a_7c15u64;
    let mut next = move |below: usize| {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        (random >> 16) as usize % below
    };
    let (mut failed, mut read) = (0, 0);
    for compression in COMPRESSIONS {
        exr::write(&path, &fixture(19, 37), &attributes(), Options { compression, ..Options::default() }).unwrap();
        let good = fs::read(&path).unwrap();
        // Most invalid bytes are in the header and the offset table.
        let head = 1500.min(good.len());
        for mutant in 0..250 {
            let mut bytes = good.clone();
            match mutant % 5 {
                0 => bytes.truncate(next(good.len())),
                1 => bytes[next(head)] ^= 1 << next(8),
                2 => bytes[next(head)] = [0, 1, 0x7f, 0x80, 0xff][next(5)],
                3 => {
                    for _ in 0..8 {
                        let at = next(good.len());
                        bytes[at] = next(256) as u8;
                    }
                }
                _ => {
                    let at = next(head - 4);
                    bytes[at..at + 4].copy_from_slice(&[0xff, 0xff, 0xff, [0x7f, 0xff, 0x00][next(3)]]);
                }
            }
            fs::write(&path, &bytes).unwrap();
            match exr::read(&path) {
                Ok((set, _)) => {
                    read += 1;
                    assert!(set.layers.iter().flat_map(|l| &l.planes).all(|p| p.values.len() == set.pixels()));
                }
                Err(error) => {
                    failed += 1;
                    assert_eq!(error.place, path.display().to_string());
                }
            }
        }
    }
    assert!(failed > 300 && read > 100, "{failed} failed, {read} read: the mutants test nothing");
}

/// The decoder allocates the sizes that a DWA chunk declares for its sections. The reader must reject too large sizes
/// before.
#[test]
fn dwa_sections_larger_than_their_block_are_an_error() {
    use ::exr::prelude::*;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dwa.exr");
    let values: Vec<f32> = (0..64 * 64).map(|i| (i as f32 / 50.0).sin() + 2.0).collect();
    let encoding =
        Encoding { compression: Compression::DWAA(None), blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let channels = vec![foreign::channel("R", FlatSamples::F32(values.clone()))];
    Image::from_layer(foreign::part("a", (64, 64), (0, 0), encoding, channels)).write().to_file(&path).unwrap();
    let (set, _) = exr::read(&path).unwrap();
    let plane = &set.get("").unwrap().planes[0].values;
    assert!(plane.iter().zip(&values).all(|(a, b)| (a - b).abs() < 0.05), "DWA is lossy, but not that much");

    let good = fs::read(&path).unwrap();
    // Two chunks of 32 lines. The offset table is directly before the first chunk, whose sections follow its y and
    // size.
    let table = (0..good.len() - 16).find(|&i| good[i..i + 8] == ((i + 16) as u64).to_le_bytes()).unwrap();
    for number in 0..11 {
        let mut bytes = good.clone();
        let at = table + 16 + 8 + 8 * number;
        bytes[at..at + 8].copy_from_slice(&(1u64 << 47).to_le_bytes());
        fs::write(&path, bytes).unwrap();
        let error = exr::read(&path).unwrap_err();
        assert!(error.cause.contains("section"), "{error}");
    }
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect()
}

#[test]
fn a_failed_write_leaves_nothing_and_an_older_file_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    fs::write(&path, b"older").unwrap();
    let error = atomic::write(&path, |file| {
        use std::io::Write;
        file.write_all(b"half of it").unwrap();
        Err(caustique::error::Error::new(ErrorKind::Io, "", "the disk is full"))
    });
    assert!(error.is_err());
    assert_eq!(fs::read(&path).unwrap(), b"older");
    assert_eq!(entries(folder.path()).len(), 1);
    atomic::write_bytes(&path, b"newer").unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"newer");
    assert_eq!(entries(folder.path()), [path]);
}

#[test]
fn writability_is_known_beforehand() {
    let folder = tempfile::tempdir().unwrap();
    atomic::check_writable(&folder.path().join("new.exr")).unwrap();
    assert!(entries(folder.path()).is_empty());
    let error = atomic::check_writable(&folder.path().join("no/such/a.exr")).unwrap_err();
    assert_eq!((error.kind, error.cause.as_str()), (ErrorKind::Io, "its folder does not exist"));
    assert!(error.hint.unwrap().starts_with("mkdir -p "));
    let error = atomic::check_writable(folder.path()).unwrap_err();
    assert_eq!(error.cause, "is a folder");
    assert!(atomic::check_writable(Path::new("")).is_err());
    atomic::check_writable(Path::new("/dev/null")).unwrap();
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error_with_advice() {
    // The device stands for a full disk: every write to it fails with ENOSPC.
    let error =
        exr::write(Path::new("/dev/full"), &fixture(8, 8), &Attributes::default(), Options::default()).unwrap_err();
    assert_eq!((error.kind, error.place.as_str()), (ErrorKind::Io, "/dev/full"));
    assert!(error.hint.unwrap().contains("make room"));
}

#[cfg(unix)]
#[test]
fn links_stay_links_and_permissions_are_the_users() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let (target, link) = (folder.path().join("target.exr"), folder.path().join("link.exr"));
    atomic::write_bytes(&target, b"1").unwrap();
    let plain = folder.path().join("plain");
    fs::write(&plain, b"").unwrap();
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode(&target), mode(&plain));
    fs::set_permissions(&target, fs::Permissions::from_mode(0o640)).unwrap();
    std::os::unix::fs::symlink(&target, &link).unwrap();
    atomic::write_bytes(&link, b"2").unwrap();
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!((fs::read(&target).unwrap(), mode(&target)), (b"2".to_vec(), 0o640));
}

#[test]
fn pngs_hold_the_display_values() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let pixels = [[0.0, 0.5, 1.0], [f32::NAN, f32::INFINITY, -1.0]];
    let scene = Picture::new(Size { width: 2, height: 1 }, pixels.to_vec());
    png::write_tonemapped(&path, &scene, ToneMap::Srgb.into()).unwrap();
    let picture = image::open(&path).unwrap().into_rgb8();
    assert_eq!(picture.as_raw().as_slice(), [0, 188, 255, 0, 255, 0]);
    png::write_tonemapped(&path, &scene, Look { exposure: 1.0, ..ToneMap::Srgb.into() }).unwrap();
    assert_eq!(image::open(&path).unwrap().into_rgb8().as_raw()[1], 255);
    for (width, height) in [(0, 1), (1, 1), (3, 1)] {
        assert!(png::write(&path, Size { width, height }, pixels.map(Into::into)).is_err());
    }
}

/// An environment in ACEScg lights as the same one in Rec. 709, and one without chromaticities is taken as it is.
#[test]
fn environments_are_converted_from_the_colour_space_of_their_header() {
    let folder = tempfile::tempdir().unwrap();
    let texel = |i: usize| [0.2 + 0.1 * i as f32, 1.5, 0.4 + 0.05 * i as f32];
    let mut set = LayerSet::new(4, 2);
    set.push(Layer::interleaved("", "RGB", (0..8).map(texel))).unwrap();
    for (name, colour_space) in [("rec709", ColourSpace::Rec709), ("acescg", ColourSpace::AcesCg)] {
        let path = folder.path().join(name).with_extension("exr");
        exr::write(&path, &set, &attributes(), Options { colour_space, ..Options::default() }).unwrap();
        let mut warnings = Vec::new();
        let read = environment_file::read(&path, &mut warnings).unwrap();
        let EnvironmentSource::Image { width, height, texels } = read else { panic!("it is an image") };
        assert!((width, height) == (4, 2) && warnings.is_empty(), "{warnings:?}");
        for (i, found) in texels.iter().enumerate() {
            let wanted = texel(i);
            assert!((0..3).all(|c| (found[c] - wanted[c]).abs() < 1e-5), "{name}: {found:?} {wanted:?}");
        }
    }
}
