//! The limits that the documentation lists: the program states each of them about a scene or an option that meets it.

use crate::{Folder, support};
use caustique::limits::LIMITS;
use serde_json::{Value, json};

/// What the program says about the small scene with a limit, and about the scene itself where that is no limit.
fn said(name: &str, plain: bool) -> String {
    let folder = Folder::new();
    let with = |arguments: &str, edit: fn(&mut Value)| {
        support::glb::write_edited(&folder.path("scene.glb"), |document| {
            if !plain {
                edit(document)
            }
        });
        let mut command = folder.command(arguments);
        if name == "denoiser" && !plain {
            command.env("CAUSTIQUE_OIDN", "/no/such/library.so");
        }
        let output = command.output().expect("the program starts");
        String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned()
    };
    match name {
        "lines" => with("plan scene.glb --method path", |document| {
            document["meshes"][1]["primitives"][0]["mode"] = 1.into();
        }),
        "media" => with("plan scene.glb --method pm", |document| {
            document["scenes"][0]["extras"]["caustique"]["medium"] = json!({"sigma_s": [0.1, 0.1, 0.1]});
        }),
        "catchers" => with("plan scene.glb --method vcm", |document| {
            document["nodes"][0]["extras"] = json!({"caustique": {"shadow_catcher": true}});
        }),
        "shadow linking" => with("plan scene.glb --method vcm", |document| {
            document["nodes"][0]["extras"] = json!({"caustique": {"collections": ["things"]}});
            for node in document["nodes"].as_array_mut().expect("a list") {
                if node.get("extensions").is_some() {
                    node["extras"] = json!({"caustique": {"blockers": {"exclude": ["things"]}}});
                }
            }
        }),
        "dispersion" => with("plan scene.glb --method path", |document| {
            document["extensionsUsed"].as_array_mut().expect("a list").push("KHR_materials_dispersion".into());
            document["materials"][0]["extensions"] = json!({"KHR_materials_dispersion": {"dispersion": 1}});
        }),
        "connections" => {
            let method = if plain { "vcm" } else { "bdpt" };
            with(&format!("plan scene.glb --method {method}"), |_| ())
        }
        "denoiser" => with("render scene.glb --width 16 --height 12 --iterations 1 --method path -o out.exr", |_| ()),
        "extension" => with("plan scene.glb --method path", |document| {
            document["extensionsUsed"].as_array_mut().expect("a list").push("EXT_odd".into());
            document["materials"][0]["extensions"] = json!({"EXT_odd": {}});
        }),
        "clipping" => with("plan scene.glb --method path", |document| {
            document["cameras"][0]["perspective"]["znear"] = 5.into();
        }),
        "range" => with("plan scene.glb --method path", |document| {
            document["extensions"]["KHR_lights_punctual"]["lights"][0]["range"] = 5.into();
        }),
        other => panic!("no case meets the limit \"{other}\""),
    }
}

#[test]
fn the_program_states_every_limit() {
    for limit in LIMITS {
        let [met, plain] = [said(limit.name, false), said(limit.name, true)];
        assert!(met.contains(limit.message), "{}: {met}", limit.name);
        assert!(!plain.contains(limit.message), "{}: {plain}", limit.name);
    }
}
