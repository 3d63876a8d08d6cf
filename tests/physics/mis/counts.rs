//! The weights for other numbers of samples: light paths, connections, probability of merging.

use super::*;

/// Bugs that concern every path. Where few paths are merged, bugs of merging are too rare to be detected.
const BUGS_OF_ALL_PATHS: [Bug; 3] = [Bug::Cosine, Bug::Reverse, Bug::OneConnection];

/// Fewest and most light paths, connections and merges, and no connections at all.
#[test]
fn weights_sum_to_one_for_any_numbers_of_samples() {
    let mut description = room();
    let lamp = quad(Vec3::new(-0.4, 1.9, -0.4), Vec3::X * 0.8, Vec3::Z * 0.8);
    add(&mut description, "lamp", lamp, Material { double_sided: true, ..matte(0.2, 8.0) });
    add(&mut description, "glass", sphere(Vec3::new(0.45, 0.45, 0.0), 0.4, 64), glass(1.5));
    let scene = build(description);
    for (light_paths, connections, merging) in
        [(0.0625, 1.0, 1.0), (0.25, 0.0, 0.5), (0.5, 4.0, 0.05), (1.0, 0.0, 1.0), (2.0, 2.0, 1.0), (4.0, 4.0, 0.25)]
    {
        let samples = Samples { light_paths, connections, merging };
        check_samples(&format!("{samples:?}"), &scene, 0.1, 1000, samples, &BUGS_OF_ALL_PATHS);
    }
}

/// In fog, where connections join vertices in the medium.
#[test]
fn weights_in_fog_sum_to_one_for_any_numbers_of_samples() {
    let mut description = room();
    add(&mut description, "mirror", sphere(Vec3::new(-0.45, 0.4, 0.0), 0.4, 64), mirror());
    description.lights.push(point_light(DVec3::new(0.1, 1.7, 0.2), 3.0));
    description.medium = Some(MediumParameters { sigma_a: Rgb::ZERO, sigma_s: Rgb::splat(0.8), g: -0.3 });
    let scene = build(description);
    for (light_paths, connections, merging) in [(0.0625, 0.0, 1.0), (0.25, 3.0, 0.1), (4.0, 2.0, 1.0)] {
        let samples = Samples { light_paths, connections, merging };
        check_samples(&format!("{samples:?}"), &scene, 0.1, 1000, samples, &BUGS_OF_ALL_PATHS);
    }
}
