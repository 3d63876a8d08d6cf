//! Reports of samples that are not finite.

use crate::{Folder, support, values};
use serde_json::Value;

/// Non-finite samples are counted in the layer `Rejected` and, by cause, in the header; many of them give a warning.
/// The picture is finite. Merged shards have the counts of the whole render, and merged renders of other seeds the sum.
#[test]
fn samples_that_are_not_finite_are_counted_and_reported() {
    let folder = Folder::new();
    support::glb::write_blinding(&folder.path("blinding.glb"));
    let small = "--width 64 --height 48 --iterations 6 --method path --denoise own";
    let render = |scene: &str, name: &str, more: &str| {
        let outcome = folder.run(&format!("render {scene}.glb -o {name}.exr {small} {more}"));
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        (folder.read(&format!("{name}.exr")), outcome.stderr)
    };
    let warning = "samples were not finite";
    let ((_, header), stderr) = render("scene", "usual", "");
    assert!(header["rejected"] == 0 && !stderr.contains(warning), "{stderr}");
    assert!(header["rejected_by"].as_object().is_some_and(|counts| counts.values().all(|count| *count == 0)));

    let ((set, whole), stderr) = render("blinding", "whole", "");
    let counted = whole["rejected"].as_u64().expect("a number");
    let layer: f32 = values(&set, "Rejected").iter().map(|pixel| pixel[0]).sum();
    assert!(counted > 0 && layer == counted as f32 && whole["rejected_by"]["direct_light"] == counted, "{whole}");
    let sentence = format!(
        "{counted} of 18432 {warning} and are left out (direct light {counted}); the layer Rejected shows where"
    );
    assert!(stderr.contains(&format!("warning: whole.exr: {sentence}\n")), "{stderr}");
    assert!(whole["warnings"].as_array().is_some_and(|warnings| warnings.contains(&Value::from(sentence))), "{whole}");
    let planes = set.layers.iter().flat_map(|layer| &layer.planes);
    assert!(planes.flat_map(|plane| &plane.values).all(|value| value.is_finite()));

    let ((_, a), _) = render("blinding", "a", "--shard 0/2");
    let ((_, b), _) = render("blinding", "b", "--shard 1/2");
    let sum = |key: &str| a[key].as_u64().unwrap_or(0) + b[key].as_u64().unwrap_or(0);
    let outcome = folder.run("merge a.exr b.exr -o joined.exr");
    assert!(outcome.code == Some(0) && outcome.stderr.contains(warning), "{}", outcome.stderr);
    let (_, joined) = folder.read("joined.exr");
    assert_eq!((&joined["rejected"], &joined["rejected_by"]), (&whole["rejected"], &whole["rejected_by"]));
    assert_eq!(sum("rejected"), counted);

    let ((_, other), _) = render("blinding", "other", "--seed 5");
    let outcome = folder.run("merge whole.exr other.exr -o seeds.exr");
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let (_, seeds) = folder.read("seeds.exr");
    let both = counted + other["rejected"].as_u64().expect("a number");
    assert!(seeds["rejected"] == both && seeds["rejected_by"]["direct_light"] == both, "{seeds}");
}
