//! Layers by the lobe of the first hit in files: sums after the finish, equal bytes, merging and resuming.

use crate::{Folder, values};
use caustique::film::LayerSet;
use std::fs;

const COMMON: &str = "render scene.glb --width 40 --height 24 --progress none --overwrite --reproducible";

fn run(folder: &Folder, arguments: &str) {
    let outcome = folder.run(arguments);
    assert_eq!(outcome.code, Some(0), "{arguments}: {}", outcome.stderr);
}

/// The layers, and the picture that they are to add up to.
fn check_sum(set: &LayerSet, beginning: &str, whole: &str, what: &str) {
    let kinds = ["Transmission", "Glossy", "Diffuse", "Volume"];
    let mut names: Vec<String> =
        kinds.iter().flat_map(|kind| ["Direct", "Indirect"].map(|end| format!("{kind}{end}"))).collect();
    names.extend(["Emit".into(), "Environment".into()]);
    let layers: Vec<_> = names.iter().map(|name| values(set, &format!("{beginning}{name}"))).collect();
    let whole = values(set, whole);
    assert!(whole.iter().any(|pixel| pixel[1] > 0.0), "{what}: the picture is black");
    for (index, pixel) in whole.iter().enumerate() {
        let sum: f32 = layers.iter().map(|layer| layer[index][1]).sum();
        assert!((sum - pixel[1]).abs() <= 1e-5 * pixel[1].max(1e-3), "{what}, pixel {index}: {sum} of {pixel:?}");
    }
}

/// All layers whose names begin with `Combined` add up to the picture once.
fn check_prefix(set: &LayerSet, what: &str) {
    let names = set.layers.iter().map(|layer| &layer.name).filter(|name| name.starts_with("Combined"));
    let parts: Vec<_> = names.map(|name| values(set, name)).collect();
    for (index, pixel) in values(set, "").iter().enumerate() {
        let sum: f32 = parts.iter().map(|part| part[index][1]).sum();
        assert!((sum - pixel[1]).abs() <= 1e-5 * pixel[1].max(1e-3), "{what}, pixel {index}: {sum} of {pixel:?}");
    }
}

/// The layers add up before and after the finish, also if the finish is a command of its own.
#[test]
fn layers_add_up_after_the_finish() {
    for method in ["path", "vcm", "sppm"] {
        let folder = Folder::new();
        let arguments = format!("{COMMON} --method {method} --iterations 8 --layers all,lobes");
        run(&folder, &format!("{arguments} --denoise own -o done.exr"));
        let (done, _) = folder.read("done.exr");
        check_sum(&done, "", "Noisy", method);
        check_sum(&done, "Lobe", "", method);
        check_prefix(&done, method);
        check_black(&done, method);
        run(&folder, &format!("{arguments},Quarter --no-finish -o raw.exr"));
        run(&folder, "finish raw.exr -o later.exr --denoise own");
        let (later, _) = folder.read("later.exr");
        check_sum(&later, "Lobe", "", method);
        assert!(values(&later, "LobeGlossyDirect") == values(&done, "LobeGlossyDirect"), "{method}");
        assert!(done.get("DiffuseColor").is_some() && later.get("TransmissionColor").is_some());
    }
}

/// The finish brings no light to lobes of black colour, which compositors divide by.
fn check_black(set: &LayerSet, what: &str) {
    let mut black = 0;
    for lobe in ["Diffuse", "Glossy", "Transmission"] {
        let color = values(set, &format!("{lobe}Color"));
        for end in ["Direct", "Indirect"] {
            let [light, finished] = ["", "Lobe"].map(|beginning| values(set, &format!("{beginning}{lobe}{end}")));
            for (index, color) in color.iter().enumerate() {
                for c in (0..3).filter(|c| color[*c] == 0.0 && light[index][*c] == 0.0) {
                    black += 1;
                    assert_eq!(finished[index][c], 0.0, "{what}: {lobe}{end}, pixel {index}");
                }
            }
        }
    }
    assert!(black > 1000, "{what}: {black}");
}

/// The temporal finish of frames divides them among the lobes, too.
#[test]
fn layers_add_up_after_the_temporal_finish() {
    let folder = Folder::new();
    let arguments = format!("{COMMON} --method path --iterations 4 --layers all,lobes --denoise own");
    run(&folder, &format!("{arguments} --frames 1-3 --temporal -o out.#.exr"));
    for frame in 1..=3 {
        run(&folder, &format!("{arguments} --frames {frame} -o alone.#.exr"));
        let set = folder.read(&format!("out.{frame}.exr")).0;
        check_sum(&set, "Lobe", "", &format!("frame {frame}"));
        check_black(&set, &format!("frame {frame}"));
        let alone = folder.read(&format!("alone.{frame}.exr")).0;
        assert!(values(&set, "LobeDiffuseDirect") != values(&alone, "LobeDiffuseDirect"), "frame {frame}");
    }
}

/// Threads, shards and interruptions change no byte.
#[test]
fn layers_have_the_same_bytes_from_threads_shards_and_checkpoints() {
    for method in ["vcm", "sppm", "mlt"] {
        let folder = Folder::new();
        let arguments = format!("{COMMON} --method {method} --layers beauty,lobes --no-finish");
        run(&folder, &format!("{arguments} --iterations 6 --threads 1 -o one.exr"));
        run(&folder, &format!("{arguments} --iterations 6 --threads 3 -o three.exr"));
        let [one, three] = ["one.exr", "three.exr"].map(|name| fs::read(folder.path(name)).expect("it is there"));
        assert!(one == three, "{method}: threads change the bytes");
        for index in 0..2 {
            run(&folder, &format!("{arguments} --iterations 6 --shard {index}/2 -o s{index}.exr"));
        }
        run(&folder, "merge s1.exr s0.exr -o merged.exr --no-finish");
        run(&folder, &format!("{arguments} --iterations 3 --checkpoint state -o part.exr"));
        run(&folder, &format!("{arguments} --iterations 6 --resume state -o resumed.exr"));
        let (whole, _) = folder.read("one.exr");
        for name in ["merged.exr", "resumed.exr"] {
            let (set, _) = folder.read(name);
            for layer in &whole.layers {
                let found = set.get(&layer.name).expect("all layers are there");
                assert!(found.planes == layer.planes, "{method}, {name}: {}", layer.name);
            }
        }
    }
}

/// A checkpoint without the sums cannot give the layers. One with them gives a picture without.
#[test]
fn checkpoints_lack_layers_that_were_not_asked_for() {
    let folder = Folder::new();
    let arguments = format!("{COMMON} --method path --no-finish");
    run(&folder, &format!("{arguments} --iterations 2 --checkpoint without -o a.exr"));
    let outcome =
        folder.run(&format!("{arguments} --iterations 4 --resume without --layers all,DiffuseDirect -o b.exr"));
    assert_eq!(outcome.code, Some(2), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("does not hold the light by the lobe of the first hit"), "{}", outcome.stderr);
    run(&folder, &format!("{arguments} --iterations 2 --layers lobes --checkpoint with -o c.exr"));
    run(&folder, &format!("{arguments} --iterations 4 --resume with -o d.exr"));
    run(&folder, &format!("{arguments} --iterations 4 -o e.exr"));
    let [resumed, whole] = ["d.exr", "e.exr"].map(|name| folder.read(name).0);
    assert!(values(&resumed, "Noisy") == values(&whole, "Noisy"));
}
