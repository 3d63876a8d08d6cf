//! `caustique plan` and `--effects`.

use crate::Folder;
use serde_json::{Value, json};

#[test]
fn the_plan_of_a_small_scene_is_printed_word_for_word() {
    let folder = Folder::new();
    let outcome = folder.run("plan scene.glb --method bdpt --env 0.5,0.5,0.5 --effects -textures,+alpha");
    let table = r#"scene.glb: bdpt, asked for
  effect          simulated by  because
  emission        camera paths  the environment
  direct          connections   light "Lamp"
                                the environment
  indirect        connections   "Floor", "Mirror" under light "Lamp", the environment
  glossy          -             nothing in the scene calls for it
  caustic         connections   material "silver" on "Mirror" under light "Lamp", the environment
  sds             left out      caustics seen in material "silver" on "Mirror"
  volume          -             nothing in the scene calls for it
  dispersion      -             nothing in the scene calls for it
  depth_of_field  -             nothing in the scene calls for it
  environment     all paths     the environment
  alpha           -             nothing in the scene calls for it
  textures        -             nothing in the scene calls for it
light is left out that the scene calls for (nothing bounds the error by it)
warning: --method bdpt does not find all light of the effect 'sds'
warning: --effects +alpha: nothing in the scene calls for it
"#;
    assert_eq!((outcome.code, outcome.stdout, outcome.stderr), (Some(0), table.to_string(), String::new()));
    assert_eq!(folder.files(), [""; 0]);
}

/// The plan of a short render says with which time limit its figures are measured, and with that limit they are.
#[test]
fn a_plan_without_figures_says_how_to_get_them() {
    let folder = Folder::new();
    let short = folder.run("plan scene.glb --width 64 --iterations 1").stdout;
    let advice = short.split_once("plan with --time ").map(|(_, rest)| rest).expect(&short);
    let (seconds, rest) = advice.split_once(' ').expect(advice);
    assert!(rest.starts_with("and without --iterations, which takes about "), "{advice}");
    let long = folder.run(&format!("plan scene.glb --width 64 --time {seconds}")).stdout;
    assert!(long.contains("of the light") && !long.contains("nothing is measured"), "{long}");
}

/// The JSON has the documented keys, and the effects in order. An effect that is switched off is present, but not
/// simulated.
#[test]
fn the_plan_as_json_has_the_documented_keys() {
    let folder = Folder::new();
    let outcome = folder.run("plan scene.glb --width 16 --json --env 1,1,1 --effects -environment");
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(0), ""));
    let plan = outcome.json();
    assert_eq!(plan["scene"], "scene.glb");
    assert!(plan["because"].as_str().is_some_and(|because| because.starts_with("auto: ")), "{plan}");
    let effects = plan["effects"].as_array().expect("a list");
    let names: Vec<&str> = effects.iter().filter_map(|effect| effect["name"].as_str()).collect();
    let all = "emission direct indirect glossy caustic sds volume dispersion depth_of_field environment alpha textures";
    assert_eq!(names.join(" "), all);
    let effect = |name: &str| effects.iter().find(|effect| effect["name"] == name).expect("it is listed");
    let unmeasured = |mut effect: Value| {
        // `by` depends on the method that `auto` chooses.
        for figure in ["energy", "seconds_per_iteration", "time", "error_if_off", "by"] {
            effect[figure] = Value::Null;
        }
        effect
    };
    let caustic = json!({"name": "caustic", "present": true, "simulated": true, "by": null, "energy": null,
        "because": ["material \"silver\" on \"Mirror\" under light \"Lamp\""], "seconds_per_iteration": null, "time": null, "error_if_off": null});
    assert_eq!(unmeasured(effect("caustic").clone()), caustic);
    let environment = effect("environment");
    assert_eq!((&environment["present"], &environment["simulated"]), (&true.into(), &false.into()));
    assert_eq!((&environment["by"], &environment["because"]), (&Value::Null, &json!(["the environment"])));
    assert_eq!(effect("volume")["present"], false);
    assert_eq!(plan["warnings"], json!(["--effects -environment: left out, though called for by the environment"]));
}

/// The render of a scene without an environment has the same bits as one with the environment switched off. The header
/// of the latter names the removed effect.
#[test]
fn an_effect_switched_off_gives_the_picture_of_a_scene_without_it() {
    let folder = Folder::new();
    folder.render("-o plain.exr --iterations 2 --no-combine");
    let outcome = folder.render("-o off.exr --iterations 2 --no-combine --env 1,1,1 --effects -environment");
    let warning = "warning: scene.glb: --effects -environment: left out, though called for by the environment\n";
    assert!(outcome.stderr.contains(warning), "{}", outcome.stderr);
    let ((plain, _), (off, header)) = (folder.read("plain.exr"), folder.read("off.exr"));
    for (a, b) in plain.layers.iter().zip(&off.layers) {
        assert!(a.name == b.name && a.planes == b.planes, "{}", a.name);
    }
    assert_eq!(header["arguments"]["effects"], "-environment");
    assert_eq!(
        header["plan"]["warnings"],
        json!(["--effects -environment: left out, though called for by the environment"])
    );
}

/// A warning names each path class that is switched off, and its layers are missing. Other layers do not change.
#[test]
fn path_classes_can_be_left_out() {
    let folder = Folder::new();
    let options = "--iterations 2 --no-combine --initial-bandwidth 0.2 --method";
    for method in ["sppm", "vcm"] {
        let photons = if method == "vcm" { "" } else { "--photons 2000" };
        let render = format!("render scene.glb --width 64 --height 48 {photons} {options} {method} -o");
        assert_eq!(folder.run(&format!("{render} all.exr")).code, Some(0));
        let outcome = folder.run(&format!("{render} off.exr --effects -caustic,-sds,-direct,-glossy"));
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        for warning in [
            "warning: scene.glb: --effects -direct: left out, though called for by light \"Lamp\"\n",
            "warning: scene.glb: --effects -caustic: left out, though called for by material \"silver\"",
            "warning: scene.glb: --effects -sds: left out, though called for by caustics seen in material \"silver\"",
        ] {
            assert!(outcome.stderr.contains(warning), "{}", outcome.stderr);
        }
        let ((all, _), (off, header)) = (folder.read("all.exr"), folder.read("off.exr"));
        assert!(off.get("Caustic").is_none() && off.get("Direct").is_none());
        assert_eq!(off.get("Indirect"), all.get("Indirect"), "{method}");
        let effects = header["plan"]["effects"].as_array().expect("a list");
        let caustic = effects.iter().find(|effect| effect["name"] == "caustic").expect("it is listed");
        assert_eq!((&caustic["present"], &caustic["simulated"]), (&true.into(), &false.into()));
    }
    // Without the classes that photons carry, there are no light paths.
    let none = folder.run(
        "render scene.glb --width 64 --height 48 --no-combine --method sppm --iterations 1 -o none.exr --effects -caustic,-sds,-indirect,-glossy",
    );
    assert_eq!(none.code, Some(0), "{}", none.stderr);
    assert_eq!(folder.read("none.exr").1["light_paths"], 0);
    // A layer of left-out classes is black if the user names it, with a warning.
    let small = "render scene.glb -o out.exr --no-combine --width 16 --iterations 1";
    let asked = folder.run(&format!("{small} --layers Direct --effects -direct,-glossy"));
    assert_eq!(asked.code, Some(0), "{}", asked.stderr);
    assert!(asked.stderr.contains("layer \"Direct\" is black"), "{}", asked.stderr);
    let (layers, _) = folder.read("out.exr");
    let black = layers.get("Direct").expect("it is there");
    assert!(black.planes.iter().all(|plane| plane.values.iter().all(|value| *value == 0.0)));
}

/// The header of a render has the plan that `plan` prints for the same options, with the measurements of the pilot and
/// all warnings. All shards have the same plan.
#[test]
fn the_header_has_the_plan_that_plan_prints() {
    let folder = Folder::new();
    let options = "scene.glb --width 24 --height 24 --photons 1000 --levels 1 --no-combine --iterations 4000 --env 1,1,1 --seed 3 --effects +alpha";
    let outcome = folder.run(&format!("plan {options} --json"));
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let plan = outcome.json();
    let environment = plan["effects"].as_array().expect("a list").iter().find(|effect| effect["name"] == "environment");
    for figure in ["energy", "seconds_per_iteration", "time", "error_if_off"] {
        assert!(environment.is_some_and(|effect| effect[figure].is_number()), "{figure}: {environment:?}");
    }
    assert_eq!(plan["warnings"], json!(["--effects +alpha: nothing in the scene calls for it"]));
    assert_eq!(folder.run(&format!("render {options} -o out.exr")).code, Some(0));
    assert_eq!(folder.read("out.exr").1["plan"], plan);
    // All shards choose the same method.
    let shards = ["0/2", "1/2"].map(|shard| folder.run(&format!("plan {options} --shard {shard} --json")).json());
    assert_eq!(shards[0], shards[1]);
}

#[test]
fn plan_takes_and_checks_the_options_of_render() {
    let folder = Folder::new();
    let guided = folder.run("plan scene.glb --method sppm --indirect paths --guide on --knn 5 --json");
    assert_eq!((guided.code, &guided.json()["method"]), (Some(0), &"sppm".into()), "{}", guided.stderr);
    let contradiction = folder.run("plan scene.glb --method path --photons 5");
    assert_eq!(contradiction.code, Some(2));
    assert!(contradiction.stderr.contains("--photons has no effect with --method path"), "{}", contradiction.stderr);
}

#[test]
fn plan_fails_for_a_missing_camera_and_with_strict() {
    let folder = Folder::new();
    let outcome = folder.run("plan scene.glb --camera Top");
    assert_eq!(
        (outcome.code, outcome.stderr.as_str()),
        (Some(2), "scene.glb: there is no camera \"Top\"\nhint: it has \"Camera\", \"Side\"\n")
    );
    crate::support::glb::write(&folder.path("dark.glb"), false);
    let outcome = folder.run("plan dark.glb --width 16 --strict --json");
    assert_eq!((outcome.code, outcome.json()["warnings"].as_array().map(Vec::len)), (Some(1), Some(1)));
    assert!(outcome.stderr.starts_with("dark.glb: 1 thing is ignored or approximated"), "{}", outcome.stderr);
}

/// `auto` takes no more than a tenth of `--time` for its pilot, and says so if that is too short for one.
#[test]
fn the_pilot_ends_after_a_tenth_of_the_time() {
    let plan = Folder::new().run("plan scene.glb --width 16 --json --time 0.0001").json();
    let because = plan["because"].as_str().expect("a reason");
    assert!(because.ends_with("for the time for a pilot is over"), "{because}");
}

/// `vcm` merges nothing in media, and the plan says which technique finds their light.
#[test]
fn the_plan_says_that_nothing_merges_in_media() {
    let fog = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/fog.glb");
    let volume = |method| {
        let plan = Folder::new().run(&format!("plan {fog} --json --method {method}")).json();
        let effects = plan["effects"].as_array().expect("a list").clone();
        let volume = effects.into_iter().find(|effect| effect["name"] == "volume").expect("it is listed");
        (volume["by"].clone(), volume["because"].clone())
    };
    let reason = "nothing merges in media: connections find this light";
    assert_eq!(volume("vcm"), (json!("connections"), json!(["the scene's medium", reason])));
    assert_eq!(volume("sppm"), (json!("photons"), json!(["the scene's medium"])));
}

/// Glass calls for caustics; the boundary of smoke, which has the index of air, does not.
#[test]
fn boundaries_that_bend_no_light_make_no_caustics() {
    let folder = Folder::new();
    for (ior, expected) in [(1.5, true), (1.0, false)] {
        crate::support::glb::write_edited(&folder.path("box.glb"), |document| {
            let materials = document["materials"].as_array_mut().expect("a list");
            let silver = materials.iter_mut().find(|material| material["name"] == "silver").expect("it is there");
            silver["pbrMetallicRoughness"] = json!({"metallicFactor": 0.0, "roughnessFactor": 0.0});
            silver["extensions"] =
                json!({"KHR_materials_transmission": {"transmissionFactor": 1.0}, "KHR_materials_ior": {"ior": ior}});
        });
        let plan = folder.run("plan box.glb --width 16 --method path --json").json();
        let effects = plan["effects"].as_array().expect("a list");
        for effect in effects.iter().filter(|effect| effect["name"] == "caustic" || effect["name"] == "sds") {
            assert_eq!(effect["present"], expected, "{ior}: {effect}");
        }
    }
}
