//! Pictures of files without a light or a camera, and transparent backgrounds.

use crate::{Folder, support, values};
use image::GenericImageView;

const SMALL: &str = "--width 24 --height 18 --iterations 4 --method path --no-finish --progress none";
const STUDIO: &str = "warning: dark.glb: the scene has no light of its own: a neutral studio lights it (--light-preset chooses another light or none, --env an image)\n";

fn dark() -> Folder {
    let folder = Folder::new();
    support::glb::write(&folder.path("dark.glb"), false);
    folder
}

fn mean(folder: &Folder) -> [f32; 3] {
    let pixels = values(&folder.read("out.exr").0, "");
    [0, 1, 2].map(|c| pixels.iter().map(|pixel| pixel[c]).sum::<f32>() / pixels.len() as f32)
}

#[test]
fn a_scene_without_light_is_lit_by_a_studio() {
    let folder = dark();
    let outcome = folder.run(&format!("render dark.glb -o out.exr {SMALL}"));
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(0), STUDIO));
    let [r, _, b] = mean(&folder);
    assert!((0.2..1.5).contains(&r) && r > b, "{r} {b}: the floor is brown");
    // The choice of the user needs no warning.
    assert_eq!(folder.run(&format!("render dark.glb -o out.exr {SMALL} --light-preset sky")).stderr, "");
    // A scene with a light keeps it.
    let own = folder.run(&format!("render scene.glb -o out.exr {SMALL}")).stderr;
    assert!(!own.contains("studio"), "{own}");
}

#[test]
fn a_black_picture_is_explained() {
    let folder = dark();
    let outcome = folder.run(&format!("render dark.glb -o out.exr {SMALL} --light-preset none"));
    let end =
        "warning: out.exr: the picture is black: the scene has no light; --light-preset studio or --env gives one\n";
    assert!(outcome.code == Some(0) && outcome.stderr.ends_with(end), "{}", outcome.stderr);
    assert_eq!(mean(&folder), [0.0; 3]);
}

#[test]
fn presets_and_views_contradict_other_lights_and_cameras() {
    let folder = Folder::new();
    for options in ["--light-preset sky --env 1,1,1", "--orbit 0,0 --camera Side", "--orbit 0,100", "--orbit 0,0,-1"] {
        let outcome = folder.run(&format!("render scene.glb -o out.exr {SMALL} {options}"));
        assert_eq!(outcome.code, Some(2), "{options}: {}", outcome.stderr);
    }
}

/// The floor is seen from above and from below; from below it is darker, because its back is culled and the studio's
/// floor is dark.
#[test]
fn a_view_of_the_whole_scene_replaces_the_camera() {
    let folder = dark();
    let mut pictures = Vec::new();
    for orbit in ["0,90", "0,90,50%", "120,90", "-45,10,12"] {
        let outcome = folder.run(&format!("render dark.glb -o out.exr {SMALL} --orbit {orbit}"));
        assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(0), STUDIO), "{orbit}");
        pictures.push(mean(&folder));
    }
    assert!(pictures.windows(2).all(|pair| pair[0] != pair[1]), "{pictures:?}");
}

#[test]
fn a_hidden_background_is_transparent_in_the_exr_and_the_png() {
    let folder = dark();
    let view = "--orbit 30,20 --png out.png";
    for (background, transparent) in [("hide", true), ("show", false)] {
        let outcome = folder.run(&format!("render dark.glb -o out.exr {SMALL} {view} --background {background}"));
        assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(0), STUDIO));
        let (set, _) = folder.read("out.exr");
        let alpha = &set.get("").and_then(|beauty| beauty.plane("A")).expect("alpha").values;
        let png = image::open(folder.path("out.png")).expect("it can be read");
        assert_eq!(png.color().has_alpha(), transparent);
        // A corner shows the background, and the middle the floor.
        let middle = 9 * 24 + 12;
        assert_eq!((alpha[0], alpha[middle]), (if transparent { 0.0 } else { 1.0 }, 1.0));
        assert_eq!(png.get_pixel(0, 0)[3], if transparent { 0 } else { 255 });
        assert_eq!(png.get_pixel(12, 9)[3], 255);
    }
}

/// The studio's floor lies below the scene, which a view of the whole scene still fills; from below it is not seen.
#[test]
fn the_studio_may_have_a_floor() {
    let folder = dark();
    let coverage = |options: &str| {
        let outcome = folder.run(&format!("render dark.glb -o out.exr {SMALL} --background hide {options}"));
        assert_eq!(outcome.code, Some(0), "{options}: {}", outcome.stderr);
        let (set, _) = folder.read("out.exr");
        set.get("").and_then(|beauty| beauty.plane("A")).expect("alpha").values.clone()
    };
    let [without, with] =
        ["studio", "studio-floor"].map(|preset| coverage(&format!("--light-preset {preset} --orbit 30,25")));
    // The corners below show the floor; the upper ones nothing.
    let [top, bottom] = [0, 17 * 24];
    assert_eq!((without[top], without[bottom]), (0.0, 0.0));
    assert!(with[top] == 0.0 && with[bottom] > 0.9, "{} {}", with[top], with[bottom]);
    // The scene is framed as before.
    assert!(without.iter().zip(&with).all(|(a, b)| a <= b));
    let sum = |values: &[f32]| values.iter().sum::<f32>();
    assert!(sum(&with) > 1.2 * sum(&without), "{} {}", sum(&with), sum(&without));
    let below = "--orbit 30,-40";
    let [without, with] =
        ["studio", "studio-floor"].map(|preset| coverage(&format!("--light-preset {preset} {below}")));
    assert_eq!(without, with);
}
