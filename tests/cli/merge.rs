//! `caustique merge`: joins shards to the bits of one render, and renders of other seeds to their mean.

use crate::{Folder, Outcome, values};
use caustique::film::LayerSet;
use serde_json::Value;

const COMMON: &str = "render scene.glb --width 40 --height 24 --progress none";

/// Renders all shards of a render, and returns their file names.
fn shards(folder: &Folder, arguments: &str, count: u32) -> Vec<String> {
    let shard = |index: u32| {
        let name = format!("s{index}.exr");
        let outcome = folder.run(&format!("{COMMON} {arguments} --shard {index}/{count} -o {name}"));
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        name
    };
    (0..count).map(shard).collect()
}

fn merge(folder: &Folder, names: &[String], more: &str) -> Outcome {
    folder.run(&format!("merge {} -o merged.exr {more}", names.join(" ")))
}

/// For every method with independent iterations, merged shards have the bits of one render in every channel: in any
/// order, finished or not, with quarters and cryptomattes.
#[test]
fn shards_make_the_bits_of_one_render_in_any_order() {
    let finished = "--layers all";
    let sums =
        "--no-combine --layers beauty,Noisy,Level,Variance,Error,Quarter,albedo,normal,depth,Z,P,Rejected,CryptoObject";
    for (method, more, count) in [
        ("path", finished, 3),
        ("light", sums, 2),
        ("bdpt", sums, 3),
        ("pm", sums, 2),
        ("sppm", finished, 2),
        ("sppm", "--no-combine --eye-paths 2 --kernel gaussian", 5),
        ("bpm", sums, 2),
        ("vcm", finished, 4),
        ("auto", finished, 2),
    ] {
        let folder = Folder::new();
        let arguments = format!("--method {method} --iterations 9 --seed 3 {more}");
        let whole = folder.run(&format!("{COMMON} {arguments} -o whole.exr"));
        assert_eq!(whole.code, Some(0), "{method}: {}", whole.stderr);
        let mut names = shards(&folder, &arguments, count);
        names.rotate_left(1);
        let outcome = merge(&folder, &names, "");
        assert_eq!(outcome.code, Some(0), "{method}: {}", outcome.stderr);
        let [(whole, first), (merged, header)] = ["whole.exr", "merged.exr"].map(|name| folder.read(name));
        assert_eq!(different(&whole, &merged), Vec::<String>::new(), "{method}: {count} shards");
        for key in ["iterations", "method", "light_paths", "plan", "arguments", "levels", "seed"] {
            assert_eq!(header[key], first[key], "{method}: {key}");
        }
        assert_eq!(header["merged"]["shards"].as_array().map(Vec::len), Some(count as usize));
        // The error of the estimate. The error of the finished picture also depends on earlier iterations.
        let noisy = |header: &Value| header.get("error_noisy").unwrap_or(&header["error"]).clone();
        assert_eq!(noisy(&header), noisy(&first), "{method}");
        let last = header["history"].as_array().and_then(|history| history.last()).expect("there is a last moment");
        assert_eq!((&last["iterations"], &last["error"]), (&9.into(), &noisy(&first)), "{method}");
    }
}

/// Names of the layers that differ in any bit, or are missing in one of the two.
fn different(a: &LayerSet, b: &LayerSet) -> Vec<String> {
    let mut names: Vec<&str> = a.layers.iter().chain(&b.layers).map(|layer| layer.name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    let bits = |set: &LayerSet, name: &str| -> Option<Vec<Vec<u32>>> {
        let planes = &set.get(name)?.planes;
        Some(planes.iter().map(|plane| plane.values.iter().map(|value| value.to_bits()).collect()).collect())
    };
    names.into_iter().filter(|name| bits(a, name) != bits(b, name)).map(String::from).collect()
}

#[test]
fn a_shard_that_was_interrupted_and_resumed_merges_to_the_same_bits() {
    let folder = Folder::new();
    let arguments = "--method vcm --iterations 12 --no-combine";
    let names = shards(&folder, arguments, 2);
    assert_eq!(merge(&folder, &names, "").code, Some(0));
    let whole = folder.read("merged.exr").0;
    // Renders half of the iterations with a checkpoint, then the other half.
    let shard = format!("{COMMON} --method vcm --no-combine --shard 1/2 -o s1.exr");
    assert_eq!(folder.run(&format!("{shard} --iterations 6 --checkpoint state")).code, Some(0));
    let early = merge(&folder, &names, "");
    assert_eq!(early.code, Some(2), "{}", early.stderr);
    assert!(early.stderr.contains("another --iterations than s0.exr: 6 here, 12 there"), "{}", early.stderr);
    let resumed = folder.run(&format!("{shard} --iterations 12 --resume state"));
    assert_eq!(resumed.code, Some(0), "{}", resumed.stderr);
    assert_eq!(merge(&folder, &names, "").code, Some(0));
    assert_eq!(different(&whole, &folder.read("merged.exr").0), Vec::<String>::new());
}

#[test]
fn shards_that_do_not_belong_together_are_rejected_by_name() {
    let folder = Folder::new();
    let names = shards(&folder, "--method path --iterations 6 --layers beauty", 3);
    let refused = |names: &[&str], more: &str, cause: &str, hint: &str| {
        let names: Vec<String> = names.iter().map(|name| name.to_string()).collect();
        let outcome = merge(&folder, &names, more);
        assert_eq!(outcome.code, Some(2), "{names:?}: {}", outcome.stderr);
        assert_eq!(outcome.stderr, format!("{cause}\nhint: {hint}\n"), "{names:?}");
        assert!(!folder.path("merged.exr").exists());
    };
    let one = "merge shards of one render";
    refused(
        &["s2.exr", "s0.exr"],
        "",
        "command line: shard 1 of 3 is missing",
        "render it with --shard 1/3, or give --partial to do without",
    );
    refused(
        &["s2.exr"],
        "",
        "command line: shard 0 of 3 is missing, and 1 more",
        "render it with --shard 0/3, or give --partial to do without",
    );
    std::fs::copy(folder.path("s1.exr"), folder.path("copy.exr")).expect("it can be copied");
    refused(
        &["s0.exr", "s1.exr", "copy.exr", "s2.exr"],
        "",
        "copy.exr: is shard 1 as s1.exr is",
        "name each shard once",
    );
    for (options, name, key) in [
        ("--method path --iterations 6 --seed 1", "seed.exr", "seed than s0.exr: 1 here, 0 there"),
        ("--method bdpt --iterations 6", "method.exr", "method than s0.exr: \"bdpt\" here, \"path\" there"),
        ("--method path --iterations 6 --max-depth 3", "depth.exr", "max-depth than s0.exr: 3 here, null there"),
    ] {
        let outcome = folder.run(&format!("{COMMON} {options} --layers beauty --shard 1/3 -o {name}"));
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        refused(&["s0.exr", name, "s2.exr"], "", &format!("{name}: was rendered with another --{key}"), one);
    }
    let other = folder.run(&format!("{COMMON} --method path --iterations 6 --layers beauty --shard 1/2 -o two.exr"));
    assert_eq!(other.code, Some(0), "{}", other.stderr);
    refused(
        &["s0.exr", "two.exr", "s2.exr"],
        "",
        "two.exr: is one of 2 shards by path at 40 x 24, s0.exr is one of 3 shards by path at 40 x 24",
        "render all shards with the same I/N, size and --method",
    );
    folder.run(&format!("{COMMON} --method path --iterations 6 -o whole.exr"));
    refused(
        &["s0.exr", "whole.exr"],
        "",
        "whole.exr: is no shard of a render",
        "merge files that --shard I/N made, or whole renders of other seeds alone",
    );
    // The sums of the shard are damaged, but its picture is not.
    let mut bytes = std::fs::read(folder.path("s1.exr")).expect("it is there");
    let at = bytes.len() - 200;
    bytes[at] ^= 1;
    std::fs::write(folder.path("damaged.exr"), bytes).expect("it can be written");
    assert!(caustique::image::exr::read(&folder.path("damaged.exr")).is_ok());
    let damaged = folder.run("merge s0.exr damaged.exr s2.exr -o merged.exr");
    assert_eq!(damaged.code, Some(1), "{}", damaged.stderr);
    let error = "damaged.exr: the sums behind its picture are damaged\nhint: render this shard again\n";
    assert_eq!(damaged.stderr, error);
    // --partial merges the shards that are present.
    let partial = merge(&folder, &[names[0].clone(), names[2].clone()], "--partial");
    assert_eq!(partial.code, Some(0), "{}", partial.stderr);
    assert!(partial.stderr.starts_with("warning: shard 1 is missing"), "{}", partial.stderr);
    let (_, header) = folder.read("merged.exr");
    assert_eq!((&header["iterations"], &header["merged"]["missing"]), (&4.into(), &serde_json::json!([1])));
}

/// Merged renders of other seeds are their mean weighted by iterations. Variances are weighted by squared shares,
/// counts are summed, and cryptomattes averaged.
#[test]
fn renders_of_other_seeds_give_their_mean() {
    let folder = Folder::new();
    for (seed, iterations) in [(0, 6), (5, 12)] {
        let outcome =
            folder.run(&format!("{COMMON} --method bdpt --iterations {iterations} --seed {seed} -o {seed}.exr"));
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    }
    let names = ["0.exr", "5.exr"].map(String::from);
    let twice = merge(&folder, &[names[0].clone(), names[0].clone()], "");
    assert_eq!(
        (twice.code, twice.stderr.as_str()),
        (Some(2), "0.exr: has the seed 0 as 0.exr has: the same noise twice\nhint: render each with another --seed\n")
    );
    let outcome = merge(&folder, &names, "");
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let [(a, _), (b, _), (merged, header)] = ["0.exr", "5.exr", "merged.exr"].map(|name| folder.read(name));
    assert_eq!((&header["iterations"], &header["merged"]["seeds"]), (&18.into(), &serde_json::json!([0, 5])));
    let check = |layer: &str, expected: fn(f32, f32) -> f32| {
        let [a, b, merged] = [&a, &b, &merged].map(|set| values(set, layer).concat());
        for (index, ((a, b), merged)) in a.into_iter().zip(b).zip(merged).enumerate() {
            let expected = expected(a, b);
            assert!((merged - expected).abs() <= 1e-5 * expected.abs(), "{layer}, {index}: {merged} {expected}");
        }
    };
    for layer in ["Noisy", "Level1", "Indirect", "albedo"] {
        check(layer, |a, b| (a + 2.0 * b) / 3.0);
    }
    check("Variance1", |a, b| (a + 4.0 * b) / 9.0);
    check("Rejected", |a, b| a + b);
    check("Z", |a, _| a);
    // The merged picture is finished from the mean, and differs from both pictures.
    assert!(header["combined"].is_object() && values(&merged, "") != values(&a, ""));
    let mean = |set: &LayerSet| {
        let all = values(set, "").concat();
        all.iter().sum::<f32>() / all.len() as f32
    };
    assert!((mean(&merged) / ((mean(&a) + 2.0 * mean(&b)) / 3.0) - 1.0).abs() < 0.02);
    // The first cryptomatte layer has the mean coverage of the same object.
    let share =
        |set: &LayerSet| set.get("CryptoObject00").and_then(|layer| layer.plane("g").or(layer.plane("G")).cloned());
    let [a, b, merged] = [&a, &b, &merged].map(|set| share(set).expect("there are cryptomattes").values);
    let middle = a.len() / 2 + 20;
    assert!((merged[middle] - (a[middle] + 2.0 * b[middle]) / 3.0).abs() < 1e-5, "{}", merged[middle]);
    // A render by another method is rejected.
    folder.run(&format!("{COMMON} --method path --iterations 6 --seed 9 -o path.exr"));
    let outcome = merge(&folder, &["0.exr".into(), "path.exr".into()], "");
    assert_eq!(outcome.code, Some(2));
    assert!(
        outcome.stderr.starts_with("path.exr: was rendered with another --method than 0.exr"),
        "{}",
        outcome.stderr
    );
}

/// A shard with valid checksums, but with sums that do not fit its header, is rejected as damaged.
#[test]
fn forged_shards_are_rejected() {
    use caustique::pipeline::shard::{ShardFile, ShardSums};
    let folder = Folder::new();
    let names = shards(&folder, "--method vcm --iterations 4 --no-combine", 2);
    let open = || ShardFile::open(&folder.path(&names[0])).expect("it can be read").expect("it is a shard");
    let forged = |change: &dyn Fn(&mut ShardSums)| {
        let mut pixels = Vec::new();
        let mut whole = open();
        whole.pixels(&folder.path(&names[0]), |block| pixels.extend(block)).expect("it is whole");
        let ShardFile { head, facts, part, .. } = whole;
        let mut sums = ShardSums { head, facts, part, pixels };
        change(&mut sums);
        let mut file = std::fs::File::create(folder.path("forged.exr")).expect("it can be made");
        sums.write(&mut file).expect("it can be written");
        folder.run("merge --partial forged.exr -o merged.exr --no-combine --layers all")
    };
    let few = || caustique::estimator::PixelAccumulator::new(1, 0, [0.0; 2]);
    let many = || caustique::estimator::PixelAccumulator::new(5, 0, [0.0; 2]).with_groups(3);
    let changes: [&dyn Fn(&mut ShardSums); 10] = [
        &|sums| sums.facts.shape.levels = 67,
        &|sums| sums.facts.shape.own = 66,
        &|sums| sums.facts.shape.compared = 9,
        &|sums| sums.facts.shape.groups = vec!["a".into()],
        &|sums| sums.facts.frame.corner = [u32::MAX, 7],
        &|sums| sums.facts.frame.display = [0, 0],
        &|sums| sums.head.arguments = serde_json::json!([1]),
        &|sums| sums.pixels[7] = few(),
        &|sums| sums.pixels[7] = many(),
        &|sums| sums.part.settings.levels.count = 3,
    ];
    for (i, change) in changes.into_iter().enumerate() {
        let outcome = forged(change);
        let error = "forged.exr: the sums behind its picture are damaged\nhint: render this shard again\n";
        assert!(outcome.code == Some(1) && outcome.stderr.ends_with(error), "change {i}: {}", outcome.stderr);
    }
    assert_eq!(forged(&|_| {}).code, Some(0));
}
