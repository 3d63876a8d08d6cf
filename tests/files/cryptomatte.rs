//! Compares cryptomatte with the values that its authors publish.

use caustique::film::cryptomatte::{Cryptomatte, Id, PixelRanks, RANKS};
use caustique::film::{LayerSet, Naming, check_names};

#[test]
fn ids_are_those_of_the_specification() {
    // From the example manifest of the Cryptomatte API's documentation.
    assert_eq!(Id::of("bunny").0, 0x1385_1a76);
    assert_eq!(Id::of("default").0, 0x42c9_679f);
    // From the tests of the authors' Nuke decoder (cryptomatte_utilities_tests.py).
    for (name, value) in [
        ("hello", 6.070_563e-17),
        ("cube", -4.084_619_3e15),
        ("sphere", 2.790_186e15),
        ("plane", 3.665_576_2e-11),
        ("\u{440}\u{430}\u{432}\u{43d}\u{438}\u{43d}\u{430}", -1.319_263_1e-25),
        ("m\u{e4}dchen", 6.236_13e25),
    ] {
        let id = Id::of(name).to_f32();
        assert!((id / value - 1.0f32).abs() < 1e-5, "{name}: {id}");
    }
}

#[test]
fn ids_are_ordinary_floats() {
    // One name in 128 hashes to an exponent that must be changed. There are enough names for both cases.
    let mut moved = 0;
    for i in 0..2000 {
        let name = format!("object{i}");
        assert!(Id::of(&name).to_f32().is_normal(), "{name}");
        moved += usize::from(Id::of(&name).0 != murmur3::murmur3_32(&mut name.as_bytes(), 0).unwrap());
    }
    assert!(moved > 3, "{moved}");
}

#[test]
fn attributes_name_the_layers_and_stay_ascii() {
    let names = ["Glass \"A\"", "K\u{fc}gel", "\u{1f308}"].map(String::from);
    let matte = Cryptomatte::new("CryptoObject", names.clone());
    for (naming, layer) in [(Naming::Plain, "CryptoObject"), (Naming::Blender, "ViewLayer.CryptoObject")] {
        let attributes = matte.attributes(naming);
        assert!(attributes.iter().all(|(name, value)| name.is_ascii() && value.is_ascii()));
        let key = format!("{:08x}", murmur3::murmur3_32(&mut layer.as_bytes(), 0).unwrap())[..7].to_owned();
        let expect = |field: &str| {
            let name = format!("cryptomatte/{key}/{field}");
            attributes.iter().find(|(n, _)| *n == name).map(|(_, value)| value.as_str()).expect(&name).to_owned()
        };
        assert_eq!(expect("name"), layer);
        assert_eq!(expect("hash"), "MurmurHash3_32");
        assert_eq!(expect("conversion"), "uint32_to_float32");
        let manifest: serde_json::Value = serde_json::from_str(&expect("manifest")).unwrap();
        for (name, id) in names.iter().zip(matte.ids()) {
            assert_eq!(manifest[name], format!("{:08x}", id.0));
        }
    }
}

fn coverages(pixel: PixelRanks, samples: f32) -> Vec<(f32, f32)> {
    let layers = Cryptomatte::new("CryptoObject", []).layers(&[pixel], samples);
    let values = |i: usize| layers[i / 2].planes[2 * (i % 2)..][..2].iter().map(|p| p.values[0]).collect::<Vec<_>>();
    (0..RANKS).map(|i| (values(i)[0], values(i)[1])).collect()
}

#[test]
fn coverage_is_exact_up_to_six_ids_and_sorted() {
    let mut pixel = PixelRanks::default();
    let ids: Vec<Id> = (0..6).map(|i| Id::of(&format!("thing{i}"))).collect();
    for (i, &id) in ids.iter().enumerate() {
        for _ in 0..=i {
            pixel.add(id, 1.0);
        }
    }
    let found = coverages(pixel, 21.0);
    for (rank, &(id, coverage)) in found.iter().enumerate() {
        assert_eq!((id, coverage), (ids[5 - rank].to_f32(), (6 - rank) as f32 / 21.0));
    }
    assert_eq!(coverages(PixelRanks::default(), 21.0), [(0.0, 0.0); RANKS]);
}

#[test]
fn objects_of_large_coverage_are_kept_even_if_they_come_late() {
    // Forty objects of small coverage, then one that covers more than 3/7 of the pixel, then small ones again.
    let mut pixel = PixelRanks::default();
    let large = Id::of("large");
    for i in 0..20 {
        pixel.add(Id::of(&format!("splinter{i}")), 1.0);
    }
    (0..30).for_each(|_| pixel.add(large, 1.0));
    for i in 20..40 {
        pixel.add(Id::of(&format!("splinter{i}")), 1.0);
    }
    let found = coverages(pixel, 70.0);
    assert_eq!(found[0].0, large.to_f32());
    let least = found[RANKS - 1].1;
    assert!((30.0 / 70.0..=30.0 / 70.0 + least + 1e-6).contains(&found[0].1), "{found:?}");
    assert!((found.iter().map(|(_, c)| c).sum::<f32>() - 1.0).abs() < 1e-6);
}

#[test]
fn layers_have_names_that_programs_read() {
    let matte = Cryptomatte::new("CryptoMaterial", ["a".to_owned()]);
    let mut set = LayerSet::new(2, 1);
    let mut pixel = PixelRanks::default();
    pixel.add(matte.ids()[0], 0.5);
    for layer in matte.layers(&[pixel, PixelRanks::default()], 1.0) {
        set.push(layer).unwrap();
    }
    check_names(&set, Naming::Plain).unwrap();
    let names: Vec<&str> = set.layers.iter().map(|layer| layer.name.as_str()).collect();
    assert_eq!(names, ["CryptoMaterial00", "CryptoMaterial01", "CryptoMaterial02"]);
    let planes = &set.layers[0].planes;
    assert_eq!(planes.iter().map(|p| p.component.as_str()).collect::<String>(), "rgba");
    assert_eq!(planes[1].values, [0.5, 0.0]);
}
