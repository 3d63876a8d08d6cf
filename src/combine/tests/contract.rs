//! Agreement with the training code (`scripts/lab/train/fixture.py` writes the numbers), and checks of network files.

use super::model::{Metadata, OutputForm};
use super::output::{NetworkOutput, Rect};
use super::*;
use std::collections::HashMap;

/// The unread bytes of the fixture, the file with inputs and outputs of a network.
struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn floats(&mut self, count: usize) -> Vec<f32> {
        let (head, rest) = self.0.split_at(4 * count);
        self.0 = rest;
        head.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
    }

    fn rgb(&mut self, size: Size) -> Picture {
        Picture::new(size, self.floats(3 * size.pixels()).chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect())
    }
}

#[test]
fn input_and_equation_equal_the_training_codes() {
    let mut reader = Reader(include_bytes!("../testdata/contract.f32"));
    let header: Vec<usize> = reader.floats(5).iter().map(|v| *v as usize).collect();
    let [levels, height, width, dimensions, side] = header[..] else { panic!() };
    let size = Size { width, height };
    let n = size.pixels();
    let stack = LevelStack {
        size,
        levels: (0..levels).map(|_| reader.rgb(size)).collect(),
        variances: (0..levels).map(|_| reader.rgb(size)).collect(),
        albedo: reader.rgb(size),
        normal: reader.rgb(size),
        depth: reader.floats(n),
    };
    let bright = stack.levels.iter().flatten().flatten().copied().fold(0.0, f32::max);
    let rect = Rect { x0: 0, y0: 0, x1: width, y1: height };

    let want = reader.floats(tensor::channels(levels) * n);
    let got = tensor::fill(&stack, &Normalisation::of(&stack), rect);
    for (k, (got, want)) in got.iter().zip(&want).enumerate() {
        assert!((got - want).abs() < 1e-5, "channel {}: {got}, not {want}", k / n);
    }

    let tile = Tile { core: rect, input: rect };
    let data = reader.floats((levels - 1) * (dimensions + affinity::SCALARS) * n);
    let features = Weights::Features(NetworkOutput::new(rect, 15, data));
    let got = combine_tile(&stack, &stack.valid(), &tile, &features);
    assert!(distance(&got, &reader.rgb(size), bright) < 1e-5);

    let got = combiner().run(&stack).unwrap();
    assert!(distance(&got, &reader.rgb(size), bright) < 1e-5);

    let corner = Rect { x0: 0, y0: 0, x1: width / 2, y1: height / 2 };
    let size = Size { width: corner.x1, height: corner.y1 };
    let cut = |plane: &Picture| Picture::from_fn(size, |i| plane[i / size.width * width + i % size.width]);
    let part = LevelStack { size, levels: stack.levels.iter().map(cut).collect(), ..LevelStack::default() };
    let n = size.pixels();
    let data = reader.floats((levels - 1) * side * side * n);
    let weights = Weights::Kernel(NetworkOutput::new(corner, side, data));
    let got = combine_tile(&part, &part.valid(), &Tile { core: corner, input: corner }, &weights);
    assert!(distance(&got, &reader.rgb(size), bright) < 1e-5);
    assert!(reader.0.is_empty());
}

#[test]
fn the_shipped_network_has_its_metadata() {
    let combiner = combiner();
    let metadata = combiner.metadata();
    assert_eq!((metadata.levels, metadata.window), (5, 15));
    assert_eq!(tensor::channels(metadata.levels), 27);
    assert!(matches!(metadata.form, OutputForm::Features { .. }));
    assert!(Model::compact().bytes.len() < 2 << 20);
}

#[test]
fn wrong_metadata_are_refused() {
    let good = [
        ("kind", "features"),
        ("levels", "5"),
        ("window", "19"),
        ("features", "4"),
        ("stride", "4"),
        ("halo", "32"),
        ("normalisation", "1"),
    ];
    let read = |change: &[(&'static str, &'static str)]| {
        let mut map: HashMap<&str, &str> = good.into_iter().collect();
        map.extend(change.iter().copied());
        Metadata::read(|key| map.get(key).filter(|value| !value.is_empty()).map(ToString::to_string))
    };
    assert_eq!(read(&[]).unwrap().output_channels(), 28);
    assert_eq!(read(&[("kind", "weights"), ("window", "3")]).unwrap().output_channels(), 36);
    let wide = read(&[("dilations", "1,4"), ("identities", "0,1,2,3")]).unwrap();
    assert_eq!((wide.output_channels(), wide.neighbour_radius()), (60, 36));
    let of_finish = read(&[("kind", "finish"), ("version", "2"), ("normalisation", "")]).unwrap();
    assert_eq!((of_finish.levels, of_finish.output_channels(), of_finish.neighbour_radius()), (1, 3, 0));
    let refused = read(&[("kind", "weights"), ("identities", "0")]).unwrap_err();
    assert_eq!(refused, "it has dilations or identities, which need the kind features");
    for (change, message) in [
        (("kind", ""), "its metadata lacks caustique.kind"),
        (("kind", "magic"), "its caustique.kind is \"magic\", not features, weights or finish"),
        (("levels", "1"), "its caustique.levels is \"1\", not a number from 2 to 16"),
        (("window", "18"), "its window of 18 pixels has no centre"),
        (("features", "9"), "its caustique.features is \"9\", not a number from 1 to 8"),
        (("stride", "-4"), "its caustique.stride is \"-4\", not a number from 1 to 64"),
        (("normalisation", "2"), "it expects input version 2, this program makes 1"),
        (("pairs", "dual3"), "it combines the pictures \"dual3\", this program those of \"multi\""),
        (("dilations", "1,0"), "its caustique.dilations is \"1,0\", not numbers from 1 to 16"),
        (("dilations", ","), "it has 0 dilations, not 1 to 4"),
        (("identities", "4"), "its caustique.identities is \"4\", not numbers from 0 to 3"),
    ] {
        assert_eq!(read(&[change]).unwrap_err(), message);
    }
}

#[test]
fn files_that_are_no_networks_are_errors_with_advice() {
    let runtime = Runtime::find().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("wrong.onnx");
    let error = Model::from_file(&path).unwrap_err();
    assert_eq!(error.kind, ErrorKind::Io);
    let compact = Model::compact().bytes;
    for bytes in [&b""[..], b"not a network", &compact[..compact.len() / 2]] {
        std::fs::write(&path, bytes).unwrap();
        let error = Network::load(&Model::from_file(&path).unwrap(), &runtime, 1).err().unwrap();
        assert_eq!(error.kind, ErrorKind::Model);
        assert!(error.to_string().starts_with(&format!("model {}: ", path.display())), "{error}");
        assert!(error.hint.unwrap().contains("export_network.py"));
    }
    let error = Model::open("paper").unwrap_err();
    assert!(error.hint.unwrap().contains("--arch paper"));
}
