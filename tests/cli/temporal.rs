//! The temporal finish: frames of an animation, finished with their neighbours.

use crate::{Folder, Outcome, values};
use caustique::film::Layer;
use caustique::image::exr;

const RENDER: &str = "render scene.glb --width 48 --height 36 --iterations 4 --method path --denoise own --reproducible \
                      --progress plain --overwrite --frames 1-5";

/// A folder with five frames of a scene at rest, finished with their neighbours as `out.N.exr`.
fn folder() -> Folder {
    let folder = Folder::new();
    let outcome = folder.run(&format!("{RENDER} --temporal --layers beauty -o out.#.exr"));
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    folder
}

fn finish(folder: &Folder, arguments: &str) -> Outcome {
    let outcome = folder.run(&format!("finish {arguments} --denoise own"));
    assert_eq!(outcome.code, Some(0), "{arguments}: {}", outcome.stderr);
    outcome
}

fn bytes(folder: &Folder, name: &str) -> Vec<u8> {
    std::fs::read(folder.path(name)).unwrap_or_else(|cause| panic!("{name}: {cause}"))
}

/// Sum over pixels and pairs of frames of the squared change from frame to frame of a scene at rest.
fn flicker(folder: &Folder, name: &str) -> f64 {
    let frames = [1, 2, 3, 4, 5].map(|frame| values(&folder.read(&name.replace('#', &frame.to_string())).0, ""));
    let pairs = frames.windows(2).flat_map(|pair| pair[0].iter().flatten().zip(pair[1].iter().flatten()));
    pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum()
}

/// A frame depends on its window alone: neither on other frames, threads, the order and choice of frames, nor on whether
/// the render or a later command finishes it.
#[test]
fn a_frame_depends_on_its_window_alone() {
    let folder = folder();
    let (set, header) = folder.read("out.4.exr");
    assert_eq!(header["combined"]["window"], serde_json::json!([2, 3, 4, 5]));
    assert_eq!(header["combined"]["averaged"], serde_json::json!([2, 3, 4, 5]));
    let has = |name: &str| set.get(name).is_some();
    assert!(has("Motion") && has("Quarter4") && has("Direct") && !has("CombinedDirect"));
    finish(&folder, "out.#.exr -o again.#.exr");
    for frame in 1..=5 {
        let [out, again] = ["out", "again"].map(|name| folder.read(&format!("{name}.{frame}.exr")).0);
        assert!(values(&out, "") == values(&again, ""), "frame {frame}");
    }
    finish(&folder, "out.#.exr -o alone.#.exr --frames 3 --threads 1");
    let outcome = finish(&folder, "out.#.exr -o alone.#.exr --frames 2-3 --skip-existing --threads 2");
    assert!(outcome.stderr.contains("frame 3: alone.3.exr is finished\n"), "{}", outcome.stderr);
    std::fs::remove_file(folder.path("out.5.exr")).expect("it is there");
    finish(&folder, "out.#.exr -o short.#.exr --frames 2");
    for [a, b] in [["alone.3.exr", "again.3.exr"], ["alone.2.exr", "again.2.exr"], ["short.2.exr", "again.2.exr"]] {
        assert!(bytes(&folder, a) == bytes(&folder, b), "{a} {b}");
    }
}

/// A render that is repeated with --skip-existing leaves finished frames alone, and finishes those whose window has grown.
#[test]
fn a_render_continues_its_temporal_finish() {
    let folder = folder();
    let before = [1, 2, 3, 4, 5].map(|frame| bytes(&folder, &format!("out.{frame}.exr")));
    std::fs::remove_file(folder.path("out.5.exr")).expect("it is there");
    finish(&folder, "out.#.exr -o short.#.exr --frames 3-4");
    for frame in 3..=4 {
        let [from, to] = ["short", "out"].map(|name| folder.path(&format!("{name}.{frame}.exr")));
        std::fs::rename(from, to).expect("it is there");
    }
    assert_ne!(bytes(&folder, "out.4.exr"), before[3]);
    let outcome = folder.run(&format!("{RENDER} --temporal --layers beauty --skip-existing -o out.#.exr"));
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let text = &outcome.stderr;
    assert!(
        text.contains("frame 2: out.2.exr is finished\n") && text.contains("frame 3 (3 of 5): out.3.exr: fin"),
        "{text}"
    );
    for (frame, before) in (1..).zip(&before) {
        let now = folder.read(&format!("out.{frame}.exr")).0;
        std::fs::write(folder.path("before.exr"), before).expect("it can be written");
        assert!(values(&now, "") == values(&folder.read("before.exr").0, ""), "frame {frame}");
    }
}

#[test]
fn frames_finished_together_flicker_less() {
    let folder = folder();
    for frame in 1..=5 {
        let outcome = folder.run(&format!("{RENDER} --frames {frame} -o plain.{frame}.exr"));
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    }
    let (temporal, plain) = (flicker(&folder, "out.#.exr"), flicker(&folder, "plain.#.exr"));
    assert!(temporal < 0.5 * plain, "{temporal} {plain}");
    // The finished parts sum to the picture.
    let all = "beauty,CombinedEmission,CombinedVolume,CombinedCaustic,CombinedDirect,CombinedIndirect";
    let outcome = folder.run(&format!("{RENDER} --temporal --layers {all} -o parts.#.exr"));
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let set = folder.read("parts.3.exr").0;
    assert!(values(&set, "") == values(&folder.read("out.3.exr").0, ""));
    let parts: Vec<_> = all.split(',').skip(1).map(|name| values(&set, name)).collect();
    for (i, whole) in values(&set, "").iter().enumerate() {
        let sum: f32 = parts.iter().map(|part| part[i][1]).sum();
        assert!((sum - whole[1]).abs() <= 1e-5 * whole[1].max(1e-3), "{i}: {sum} {whole:?}");
    }
}

/// Frames on both sides of a camera cut are finished without each other, as if the others were not there.
#[test]
fn a_camera_cut_divides_the_frames() {
    let folder = folder();
    // After the cut, all surfaces face a way in which none did before.
    for frame in 3..=5 {
        let path = folder.path(&format!("out.{frame}.exr"));
        let (mut set, attributes) = exr::read(&path).expect("the file can be read");
        set.push(Layer::interleaved("normal", "XYZ", vec![[0.577; 3]; set.pixels()])).expect("it has the size");
        exr::write(&path, &set, &attributes, exr::Options::default()).expect("it can be written");
    }
    let outcome = finish(&folder, "out.#.exr -o cut.#.exr");
    let warning = "warning: out.3.exr shows hardly any surface of out.2.exr: frames on both sides of the cut are \
                   finished without each other\n";
    assert_eq!(outcome.stderr.matches(warning).count(), 1, "{}", outcome.stderr);
    assert_eq!(outcome.stderr.matches("warning").count(), 1, "{}", outcome.stderr);
    let averaged = |frame: u32| folder.read(&format!("cut.{frame}.exr")).1["combined"]["averaged"].clone();
    assert_eq!(
        [1, 2, 3, 4, 5].map(averaged),
        [[1, 2].as_slice(), &[1, 2], &[3, 4, 5], &[3, 4, 5], &[3, 4, 5]].map(|numbers| serde_json::json!(numbers))
    );
    let picture = |name: &str, frame: u32| values(&folder.read(&format!("{name}.{frame}.exr")).0, "");
    for (frames, away) in [(1..=2, 3..=5), (3..=5, 1..=2)] {
        let name = |frame: u32| folder.path(&format!("out.{frame}.exr"));
        let hidden = |frame: u32| folder.path(&format!("away.{frame}.exr"));
        away.clone().for_each(|frame| std::fs::rename(name(frame), hidden(frame)).expect("it is there"));
        finish(&folder, "out.#.exr -o alone.#.exr");
        away.for_each(|frame| std::fs::rename(hidden(frame), name(frame)).expect("it is there"));
        for frame in frames {
            assert!(picture("cut", frame) == picture("alone", frame), "frame {frame}");
        }
    }
}

#[test]
fn frames_that_do_not_fit_are_named() {
    let folder = folder();
    let fails = |arguments: &str, code: i32, fault: &str| {
        let outcome = folder.run(arguments);
        assert_eq!(
            (outcome.code, outcome.stderr.contains(fault)),
            (Some(code), true),
            "{arguments}: {}",
            outcome.stderr
        );
    };
    fails("finish out.#.exr -o one.exr", 2, "--output one.exr: all frames have the same name");
    fails(
        "finish out.1.exr -o one.exr --frames 1",
        2,
        "--frames and --skip-existing concern the frames of an animation",
    );
    fails(
        "finish out.#.exr -o x.#.exr --frames 4-6",
        1,
        "out.6.exr: there is no such frame\nhint: render it, or name other",
    );
    fails("finish none.#.exr -o x.#.exr", 1, "none.#.exr: no file has such a name");
    fails(
        &format!("{RENDER} --temporal --frame-seed same -o x.#.exr"),
        2,
        "--temporal: frames of one seed have equal noise",
    );
    fails(
        &format!("{RENDER} --temporal --shard 0/2 -o x.#.exr"),
        2,
        "--temporal: a shard is not finished\nhint: render",
    );
    let small = "render scene.glb --width 24 --height 36 --iterations 4 --method path --denoise none --progress none";
    assert_eq!(folder.run(&format!("{small} --frames 4 --layers all,Motion -o out.#.exr --overwrite")).code, Some(0));
    std::fs::remove_file(folder.path("out.2.exr")).expect("it is there");
    let outcome = finish(&folder, "out.#.exr -o x.#.exr");
    for warning in [
        "warning: frame 2 is missing: frame 1 is finished without it and the frames beyond it\n",
        "warning: frame 2 is missing: frame 3 is finished without it and the frames beyond it\n",
        "warning: out.3.exr has 48 x 36 pixels and out.4.exr 24 x 36: frames on both sides are finished without each other; \
         render all frames at one size\n",
    ] {
        assert_eq!(outcome.stderr.matches(warning).count(), 1, "{warning}{}", outcome.stderr);
    }
    assert_eq!(folder.read("x.3.exr").1["combined"]["averaged"], serde_json::json!([3]));
    std::fs::copy(folder.path("out.1.exr"), folder.path("out.2.exr")).expect("it can be copied");
    fails("finish out.#.exr -o x.#.exr --denoise none", 1, "out.2.exr: has the seed of out.1.exr");
    let plain = folder.run(&format!("{small} --frames 1-2 -o plain.#.exr"));
    assert_eq!(plain.code, Some(0), "{}", plain.stderr);
    fails(
        "finish plain.#.exr -o x.#.exr --denoise none",
        1,
        "plain.1.exr: there is no layer Motion, which says where surfaces are in the frames before and after\n\
         hint: render with --temporal, or with --layers all,Motion,Quarter; or finish each frame alone\n",
    );
}
