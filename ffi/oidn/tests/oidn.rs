//! Tests the binding with the Open Image Denoise that `CAUSTIQUE_OIDN` names, or that is found.

use std::path::Path;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use caustique_oidn::{Content, Device, Error, Folders, Input, Library, MAX_SIDE, MAX_THREADS, Quality, Version};

const QUALITIES: [Quality; 3] = [Quality::Fast, Quality::Balanced, Quality::High];

/// The folder in which `scripts/setup.sh` installs the library.
fn folders() -> Folders {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../.deps/oidn");
    Folders { last: vec![own], ..Folders::default() }
}

/// The library under test, loaded once.
fn library() -> &'static Library {
    static LIBRARY: OnceLock<Library> = OnceLock::new();
    LIBRARY
        .get_or_init(|| Library::load(&folders()).unwrap_or_else(|error| panic!("{error}\nhint: {:?}", error.hint())))
}

fn device(threads: usize) -> Device {
    Device::new(library(), threads).unwrap()
}

/// A constant picture of 1 with noise: uniform values in [0, 2), by SplitMix64.
fn noise(pixels: usize, seed: u64) -> Vec<[f32; 3]> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 40) as f32 / (1 << 23) as f32
    };
    (0..pixels).map(|_| std::array::from_fn(|_| next())).collect()
}

/// Root mean square of the pixels' difference from 1.
fn deviation(pixels: &[[f32; 3]]) -> f64 {
    let squares: f64 = pixels.iter().flatten().map(|&value| (f64::from(value) - 1.0).powi(2)).sum();
    (squares / (3 * pixels.len()) as f64).sqrt()
}

fn bits(pixels: &[[f32; 3]]) -> Vec<u32> {
    pixels.iter().flatten().map(|value| value.to_bits()).collect()
}

/// An input of the denoiser with both guides, albedo and normals.
fn guided<'a>(
    (width, height): (usize, usize),
    color: &'a [[f32; 3]],
    albedo: &'a [[f32; 3]],
    normal: &'a [[f32; 3]],
) -> Input<'a> {
    Input { albedo: Some(albedo), normal: Some(normal), ..Input::new(width, height, color) }
}

#[test]
fn the_library_reports_its_version_and_is_loaded_once() {
    let library = library();
    assert!(library.version() >= Version { major: 2, minor: 0, patch: 0 }, "{library:?}");
    assert!(library.version().to_string().starts_with("2."), "{library:?}");
    let path = library.path();
    assert!(path.is_absolute() && path.is_file() && !path.is_symlink(), "{library:?}");
    assert!(path.file_name().unwrap().to_string_lossy().starts_with("libOpenImageDenoise.so"), "{library:?}");
    let second = Library::load(&folders()).unwrap();
    assert_eq!((second.path(), second.version()), (path, library.version()));
}

#[test]
fn noise_on_a_constant_picture_is_removed() {
    let (width, height) = (96, 80);
    let color = noise(width * height, 1);
    let before = deviation(&color);
    assert!((0.55..0.6).contains(&before), "{before}");
    let flat = vec![[0.5; 3]; width * height];
    let up = vec![[0.0, 0.0, 1.0]; width * height];
    let device = device(1);
    for quality in QUALITIES {
        let mut input = Input { quality, ..Input::new(width, height, &color) };
        let check = |input: &Input, name: &str| {
            let output = device.denoise(input).unwrap();
            assert_eq!(output.len(), color.len());
            let after = deviation(&output);
            assert!(after < 0.15 * before, "{quality:?}, {name}: {after} of {before}");
        };
        check(&input, "alone");
        input.albedo = Some(&flat);
        check(&input, "albedo");
        input.normal = Some(&up);
        check(&input, "albedo and normal");
        input.clean_aux = true;
        check(&input, "clean guides");
    }
}

/// Guides are denoised alone; normals may be negative.
#[test]
fn noise_of_guides_is_removed() {
    let (width, height) = (96, 80);
    for (content, clean) in [(Content::Albedo, [0.6, 0.3, 0.5]), (Content::Normal, [-0.6, 0.8, 0.0])] {
        let difference = |pixels: &[[f32; 3]]| -> f32 {
            pixels.iter().flat_map(|p| (0..3).map(|c| (p[c] - clean[c]).powi(2))).sum::<f32>().sqrt()
        };
        let noisy: Vec<[f32; 3]> =
            noise(width * height, 3).iter().map(|p| std::array::from_fn(|c| clean[c] + 0.4 * (p[c] - 1.0))).collect();
        for quality in QUALITIES {
            let input = Input { content, quality, ..Input::new(width, height, &noisy) };
            let denoised = device(1).denoise(&input).unwrap();
            assert!(difference(&denoised) < 0.2 * difference(&noisy), "{content:?}, {quality:?}");
            // Guides of a guide do not matter.
            let guided = Input { albedo: Some(&noisy), clean_aux: true, ..input };
            assert_eq!(bits(&device(1).denoise(&guided).unwrap()), bits(&denoised));
        }
    }
}

/// An edge that is noisy in the picture but sharp in the guides is preserved.
#[test]
fn guides_preserve_edges() {
    let (width, height) = (64, 64);
    let left = |k: usize| k % width < width / 2;
    let shade = |k: usize| if left(k) { 0.2 } else { 1.0 };
    let color: Vec<[f32; 3]> =
        noise(width * height, 2).iter().enumerate().map(|(k, p)| p.map(|v| v * shade(k))).collect();
    let albedo: Vec<[f32; 3]> = (0..width * height).map(|k| [shade(k); 3]).collect();
    let error = |output: Vec<[f32; 3]>| -> f32 {
        let near = |k: &usize| (width / 2 - 2..width / 2 + 2).contains(&(k % width));
        (0..width * height).filter(near).flat_map(|k| output[k].map(|v| (v - shade(k)).powi(2))).sum()
    };
    let device = device(1);
    let alone = Input::new(width, height, &color);
    let guided = Input { albedo: Some(&albedo), clean_aux: true, ..alone };
    let (without, with) = (error(device.denoise(&alone).unwrap()), error(device.denoise(&guided).unwrap()));
    assert!(with < 0.5 * without, "{with} with, {without} without");
}

/// The determinism that the crate's documentation promises: the same bytes with any number of threads, in repeated
/// calls, from a new filter or a used one, with and without tiles.
#[test]
fn bytes_do_not_depend_on_threads_filters_or_tiles() {
    for (width, height) in [(1, 1), (1, 50), (2, 3), (64, 64), (320, 180), (641, 359), (1280, 720)] {
        let pixels = width * height;
        let (color, albedo, normal) = (noise(pixels, 3), noise(pixels, 4), noise(pixels, 5));
        let [mut one, mut two] = [1, 2].map(|threads| device(threads).filter().unwrap());
        // The large picture serves to test tiles. It takes long, so only one quality is tested.
        let large = pixels > 300_000;
        let qualities = if large { &QUALITIES[..1] } else { &QUALITIES[..] };
        for &quality in qualities {
            let input = Input { quality, ..guided((width, height), &color, &albedo, &normal) };
            let first = bits(&one.denoise(&input).unwrap());
            let name = format!("{width}x{height}, {quality:?}");
            assert!(bits(&two.denoise(&input).unwrap()) == first, "{name}: two threads");
            let tiles = Input { max_memory_mib: Some(100), ..input };
            assert!(bits(&two.denoise(&tiles).unwrap()) == first, "{name}: tiles");
            if !large {
                assert!(bits(&one.denoise(&input).unwrap()) == first, "{name}: repeated");
                assert!(bits(&device(5).denoise(&input).unwrap()) == first, "{name}: five threads");
            }
        }
    }
}

/// The result of a filter does not depend on earlier pictures of other sizes, guides and settings.
#[test]
fn a_filter_does_not_depend_on_earlier_pictures() {
    let device = device(2);
    let mut filter = device.filter().unwrap();
    let (albedo, normal) = (noise(40 * 30, 6), noise(40 * 30, 7));
    let colors = [noise(40 * 30, 8), noise(40 * 30, 9)];
    let plain = Input::new(40, 30, &colors[0]);
    let both = guided((40, 30), &colors[0], &albedo, &normal);
    let small = Input::new(7, 5, &colors[1][..35]);
    let inputs = [
        both,
        Input { color: &colors[1], ..both },
        plain,
        small,
        Input { quality: Quality::Fast, ..both },
        Input { hdr: false, ..both },
        Input { clean_aux: true, ..plain },
        Input { clean_aux: true, ..both },
        Input { albedo: Some(&albedo), ..plain },
        Input { max_memory_mib: Some(0), ..both },
        Input { max_memory_mib: Some(u32::MAX), ..small },
        both,
    ];
    let mut seen = Vec::new();
    for (k, input) in inputs.iter().enumerate() {
        let found = filter.denoise(input).unwrap();
        // The same guides at other addresses, after which the old memory may be freed.
        let copies = [input.albedo, input.normal].map(|guide| guide.map(<[_]>::to_vec));
        let moved = Input { albedo: copies[0].as_deref(), normal: copies[1].as_deref(), ..*input };
        assert!(bits(&filter.denoise(&moved).unwrap()) == bits(&found), "picture {k}, moved");
        assert!(bits(&device.denoise(input).unwrap()) == bits(&found), "picture {k}, another filter");
        seen.push(bits(&found));
    }
    assert!(seen[0] == seen[11] && seen[0] != seen[1] && seen[0] != seen[5] && seen[0] != seen[7]);
    assert!(seen[2] == seen[6], "clean guides that are none");
}

#[test]
fn threads_may_share_a_device_or_use_their_own() {
    let (width, height) = (150, 100);
    let pictures: Vec<_> = (0..4).map(|seed| noise(width * height, 10 + seed)).collect();
    let alone = device(1);
    let denoise =
        |device: &Device, color: &[[f32; 3]]| bits(&device.denoise(&Input::new(width, height, color)).unwrap());
    let expected: Vec<_> = pictures.iter().map(|picture| denoise(&alone, picture)).collect();
    for shared in [false, true] {
        std::thread::scope(|scope| {
            for half in 0..2 {
                let device = if shared { alone.clone() } else { device(1 + half) };
                let (pictures, expected) = (&pictures[2 * half..][..2], &expected[2 * half..][..2]);
                scope.spawn(move || {
                    for _ in 0..3 {
                        for (picture, expected) in pictures.iter().zip(expected) {
                            assert!(denoise(&device, picture) == *expected, "shared: {shared}");
                        }
                    }
                });
            }
        });
    }
    // A filter may move to another thread, and may outlive its device.
    let mut filter = device(1).filter().unwrap();
    let picture = &pictures[0];
    let moved = std::thread::spawn({
        let picture = picture.clone();
        move || bits(&filter.denoise(&Input::new(width, height, &picture)).unwrap())
    });
    assert!(moved.join().unwrap() == expected[0]);
}

/// Invalid pictures are refused before the library is called.
#[test]
fn sizes_and_lengths_are_checked() {
    let device = device(1);
    let mut filter = device.filter().unwrap();
    let mut refused = |input: &Input| {
        let error = device.denoise(input).unwrap_err();
        assert_eq!(filter.denoise(input).unwrap_err(), error);
        error.to_string()
    };
    let pixels = noise(12, 20);
    let limits = "pixels cannot be denoised: sides from 1 to 65536 can";
    for (width, height) in
        [(0, 0), (0, 5), (5, 0), (usize::MAX, 2), (2, usize::MAX), (MAX_SIDE + 1, 1), (1 << 63, 1 << 63)]
    {
        for color in [&[][..], &pixels] {
            let text = refused(&Input::new(width, height, color));
            assert_eq!(text, format!("a picture of {width} x {height} {limits}"));
        }
    }
    let right = Input::new(4, 3, &pixels);
    assert_eq!(refused(&Input { color: &pixels[1..], ..right }), "color: 11 pixels are not 4 x 3");
    assert_eq!(refused(&Input { height: 4, ..right }), "color: 12 pixels are not 4 x 4");
    assert_eq!(
        refused(&Input { width: MAX_SIDE, height: MAX_SIDE, ..right }),
        "color: 12 pixels are not 65536 x 65536"
    );
    assert_eq!(refused(&Input { albedo: Some(&[]), ..right }), "albedo: 0 pixels are not 4 x 3");
    let guides = Input { albedo: Some(&pixels), normal: Some(&pixels[..6]), ..right };
    assert_eq!(refused(&guides), "normal: 6 pixels are not 4 x 3");
    assert_eq!(refused(&Input { normal: Some(&pixels), ..right }), "normals guide only together with albedo");
    assert_eq!(Error::NormalWithoutAlbedo.hint().as_deref(), Some("give albedo, too, or leave normals out"));
    assert!(filter.denoise(&right).is_ok(), "the filter stays usable");
}

/// A run that is ended has no picture, and takes a small part of the time; the filter denoises as before afterwards.
#[test]
fn a_run_that_is_ended_has_no_picture_and_leaves_the_filter_usable() {
    let (width, height) = (320, 240);
    let pixels = noise(width * height, 22);
    let input = Input::new(width, height, &pixels);
    let mut filter = device(2).filter().unwrap();
    let whole = filter.denoise(&input).unwrap();
    let polls = AtomicUsize::new(0);
    let counted = filter.denoise_while(&input, &|| polls.fetch_add(1, Ordering::Relaxed) < usize::MAX).unwrap();
    assert!(counted.as_ref() == Some(&whole), "polling changes nothing");
    let all = polls.load(Ordering::Relaxed);
    assert!(all > 10, "{all} polls are few");
    for last in [0, all / 2] {
        polls.store(0, Ordering::Relaxed);
        let ended = filter.denoise_while(&input, &|| polls.fetch_add(1, Ordering::Relaxed) < last).unwrap();
        assert!(ended.is_none());
        assert!(polls.load(Ordering::Relaxed) <= last + 2, "it works on after its end");
        assert!(filter.denoise(&input).unwrap() == whole, "the filter stays usable");
    }
}

#[test]
fn extreme_values_give_finite_pictures() {
    let (width, height) = (33, 17);
    let (clean, device) = (noise(width * height, 21), device(1));
    for odd in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -1.0, f32::MIN_POSITIVE / 4.0] {
        let mut dirty = clean.clone();
        dirty[0] = [odd; 3];
        dirty[width * height / 2][1] = odd;
        let everywhere = vec![[odd; 3]; width * height];
        for hdr in [false, true] {
            for (color, guide) in [(&dirty, &clean), (&clean, &dirty), (&everywhere, &everywhere)] {
                let input = Input { hdr, ..guided((width, height), color, guide, guide) };
                for input in [input, Input { albedo: None, normal: None, ..input }] {
                    let output = device.denoise(&input).unwrap();
                    let bad = output.iter().flatten().find(|value| !value.is_finite() || **value < 0.0);
                    assert!(bad.is_none(), "{odd}, hdr {hdr}: {bad:?}");
                }
            }
        }
    }
}

#[test]
fn too_many_threads_are_refused() {
    let error = Device::new(library(), MAX_THREADS + 1).err().unwrap();
    assert_eq!(error.to_string(), "4097 threads are more than 4096");
    assert!(matches!(Device::new(library(), usize::MAX), Err(Error::TooManyThreads(usize::MAX))));
    for threads in [0, MAX_THREADS] {
        assert_eq!(device(threads).denoise(&Input::new(1, 1, &[[1.0; 3]])).unwrap().len(), 1);
    }
}
