#[path = "tests/support/mod.rs"]
mod support;
use caustique::math::*;
use caustique::render::*;
use caustique::scene::*;
use support::scenes::*;
fn main() {
    let mut d = Description::default();
    add(&mut d, "room", cuboid(Vec3::new(-4., 0., -4.), Vec3::new(4., 3., 4.), true), matte(0.7, 0.0));
    for i in 0..100 {
        let x = (i % 10) as f32 * 0.7 - 3.2;
        let z = (i / 10) as f32 * 0.7 - 3.2;
        add(&mut d, "s", sphere(Vec3::new(x, 0.3 + 0.2 * ((i * 7) % 5) as f32, z), 0.25, 32), matte(0.6, 0.0));
    }
    let lamp = quad(Vec3::new(-0.5, 2.9, -0.5), Vec3::X, Vec3::Z);
    add(&mut d, "lamp", lamp, matte(0.0, 10.0));
    d.cameras.push(look_at(DVec3::new(0.0, 1.6, 3.8), DVec3::new(0.0, 0.8, 0.0), 60.0));
    let scene = Scene::build(d, 2).unwrap();
    let camera = scene.camera(&View { camera: None, width: Some(1280), height: Some(720) }).unwrap();
    let n: usize = std::env::args().nth(1).map_or(2, |s| s.parse().unwrap());
    rayon::ThreadPoolBuilder::new().num_threads(n).build_global().unwrap();
    for levels in [5, 1] {
        let s = Settings { iterations: Some(3), levels: Levels::new(levels), ..Settings::default() };
        let c0 = control_cpu();
        let r = sppm(&scene, &camera, &s, |p, _| {
            println!("{p:?}");
            Control::Continue
        });
        println!(
            "levels {levels}: {:?} cpu {:.2} per iteration wall {:.2}",
            r.phases,
            (control_cpu() - c0) / 3.0,
            r.seconds / 3.0
        );
    }
}
fn control_cpu() -> f64 {
    let s = std::fs::read_to_string("/proc/self/stat").unwrap();
    let f: Vec<&str> = s.rsplit_once(')').unwrap().1.split_whitespace().collect();
    (f[11].parse::<f64>().unwrap() + f[12].parse::<f64>().unwrap()) / 100.0
}
