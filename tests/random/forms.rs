//! Random scenes with known pictures: integrals over the film in double precision.

use super::picture::{
    Difference, Found, MEANS, SIGNIFICANCE, SIZE, Shot, TILES, TOLERANCE, confirmed, differences, pictures,
};
use super::random::Random;
use super::relation::similar;
use super::shapes::{cuboid, disc, joined, prism, quad, sphere, triangle};
use super::world::{Later, Lens, Light, LightKind, Matter, Medium, Mesh, Placement, ThingKind, World};
use caustique::render::Method;
use glam::{DAffine3, DQuat, DVec3};
use std::f64::consts::PI;

/// Kinds of scenes with a known picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// An emissive convex body over a floor.
    Glowing,
    /// A punctual light over a floor.
    Punctual,
    /// A floor lit by light of a spot that a ball reflects.
    Bounce,
    /// A wall seen through a block that absorbs but does not refract.
    Absorbing,
    /// A wall seen through a pane of absorbing glass at right angles.
    Pane,
    /// White objects of all kinds under a white sky.
    Furnace,
    /// A wall seen through blocks that absorb and overlap, some of them hidden, which may appear after the frame.
    Overlap,
    /// White objects, and the camera, in white solids that are hidden from the camera.
    Hidden,
}

pub const FORMS: [Form; 8] = [
    Form::Glowing,
    Form::Punctual,
    Form::Bounce,
    Form::Absorbing,
    Form::Pane,
    Form::Furnace,
    Form::Overlap,
    Form::Hidden,
];

/// A scene and its known picture.
pub struct Known {
    pub world: World,
    pub expected: Vec<f64>,
    pub max_depth: u32,
}

const CAMERA: &str = "camera 0";

impl Form {
    pub fn known(self, seed: u64) -> Known {
        let mut random = Random::new(seed);
        let mut known = match self {
            Form::Glowing => glowing(&mut random),
            Form::Punctual => punctual(&mut random),
            Form::Bounce => bounce(&mut random),
            Form::Absorbing => absorbing(&mut random),
            Form::Pane => pane(&mut random),
            Form::Furnace => furnace(&mut random),
            Form::Overlap => overlap(&mut random),
            Form::Hidden => hidden(&mut random),
        };
        let rotation = if random.chance(0.5) { DQuat::IDENTITY } else { random.turn() };
        let size = random.scale(1e-3, 1e3);
        let translation = if random.chance(0.7) { DVec3::ZERO } else { random.vector(-2.0, 2.0) * size };
        known.world = similar(&known.world, size, rotation, translation);
        known.world.seed = seed;
        known
    }

    /// Methods that find this light, with the tolerance for their bias.
    pub fn methods(self) -> Vec<Method> {
        use Method as M;
        let all = vec![M::Path, M::Bdpt, M::Vcm, M::Sppm, M::Light, M::Mlt, M::Appm, M::Cppm, M::Ppm, M::Pm, M::Bpm];
        match self {
            Form::Glowing | Form::Punctual => all,
            Form::Bounce => vec![M::Path, M::Bdpt, M::Vcm, M::Sppm, M::Light],
            Form::Absorbing | Form::Pane | Form::Overlap => vec![M::Path, M::Bdpt, M::Vcm, M::Sppm],
            Form::Furnace | Form::Hidden => vec![M::Path, M::Bdpt, M::Vcm, M::Sppm],
        }
    }

    fn tolerance(self, method: Method) -> f64 {
        match (self, method) {
            (_, Method::Path | Method::Bdpt | Method::Light) => TOLERANCE,
            (Form::Glowing | Form::Punctual, Method::Bpm) => 0.15,
            (Form::Glowing | Form::Punctual, _) => TOLERANCE,
            (_, Method::Vcm) => 0.06,
            _ => 0.2,
        }
    }
}

/// Compares renders of a scene with its known picture; `None` if they agree.
///
/// # Errors
/// The renderer refuses the scene.
pub fn check(form: Form, known: &Known, method: Method) -> Result<Option<Vec<Difference>>, String> {
    let shot = Shot { max_depth: known.max_depth, ..Shot::new(method, CAMERA) };
    let expected = vec![known.expected.clone(); 2];
    confirmed(|effort, seeds| {
        let set = pictures(&known.world, &Shot { effort, ..shot.clone() }, seeds)?;
        Ok(Found::new(differences(&set, &expected, form.tolerance(method), SIGNIFICANCE), &[&set]))
    })
}

/// A room with black walls and the floor at y = -1, and a camera that sees only the floor.
fn over_a_floor(random: &mut Random) -> (World, DVec3) {
    let mut world = World { size: 2.0, ..World::default() };
    let side = if random.chance(0.5) { 1.0 } else { -1.0 };
    let eye = DVec3::new(0.9 * side, random.within(-0.6, -0.2), 0.9);
    let target = DVec3::new(random.within(0.35, 0.6) * side, -1.0, random.within(0.1, 0.6));
    let lens = Lens { view: random.within(0.1, 0.3), focus: 1.0, ..Lens::default() };
    world.look(eye, target, lens);
    let base = random.vector(0.2, 0.9);
    let floor = quad(DVec3::new(-1.0, -1.0, -1.0), DVec3::Z * 2.0, DVec3::X * 2.0);
    world.add("floor", floor, Matter::matte(base), vec![Placement::IDENTITY]);
    if random.chance(0.7) {
        let walls = cuboid(DVec3::splat(-1.0), DVec3::ONE, true).part(|triangle| !(8..10).contains(&triangle));
        world.add("walls", walls, Matter::matte(DVec3::ZERO), vec![Placement::IDENTITY]);
    }
    (world, base)
}

/// Means of the picture of the first camera; `radiance` gives the radiance of a ray (origin, direction).
fn expect(world: &World, radiance: impl Fn(DVec3, DVec3) -> DVec3) -> Vec<f64> {
    const POINTS: u32 = 2;
    let camera = &world.things[0];
    let (to_world, ThingKind::Camera(lens)) = (camera.to_world(), camera.kind) else {
        panic!("the first thing is the camera");
    };
    let mut means = vec![0.0; MEANS];
    let half = (0.5 * lens.view).tan();
    let n = SIZE * POINTS;
    for index in 0..n * n {
        let (x, y) = (index % n, index / n);
        let film = |i: u32| (2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0) * half;
        let direction = to_world.transform_vector3(DVec3::new(film(x), -film(y), -1.0)).normalize();
        let light = radiance(to_world.translation, direction);
        let tile = y / (n / TILES) * TILES + x / (n / TILES);
        for channel in 0..3 {
            let share = light[channel] / f64::from(n * n);
            means[3 * tile as usize + channel] += share * f64::from(TILES * TILES);
            means[MEANS - 3 + channel] += share;
        }
    }
    means
}

/// The intersection of a ray with the floor.
fn on_floor(origin: DVec3, direction: DVec3) -> DVec3 {
    origin + direction * ((-1.0 - origin.y) / direction.y)
}

/// A position for a light, often in the middle of the room.
fn place(random: &mut Random, size: f64) -> DVec3 {
    let reach = if random.chance(0.6) { random.scale(1e-4, 0.1) } else { 0.6 - size };
    random.vector(-1.0, 1.0) * reach
}

/// Irradiance of a floor that faces up, from a triangle of radiance 1 that is above it (Lambert). Zero for its back.
fn irradiance(p: DVec3, corners: [DVec3; 3]) -> f64 {
    let front = (corners[1] - corners[0]).cross(corners[2] - corners[0]).dot(p - corners[0]) > 0.0;
    if !front {
        return 0.0;
    }
    let v = corners.map(|corner| (corner - p).normalize());
    let edge = |i: usize| {
        let (a, b) = (v[i], v[(i + 1) % 3]);
        let normal = a.cross(b);
        // Accurate also for nearly equal directions.
        normal.length().atan2(a.dot(b)) * normal.normalize().y
    };
    0.5 * (edge(0) + edge(1) + edge(2)).abs()
}

fn corners<'a>(mesh: &'a Mesh, to_world: &'a DAffine3) -> impl Iterator<Item = [DVec3; 3]> + 'a {
    let single = |p: DVec3| p.as_vec3().as_dvec3();
    mesh.triangles.iter().map(move |t| t.map(|i| to_world.transform_point3(single(mesh.positions[i as usize]))))
}

fn glowing(random: &mut Random) -> Known {
    let (mut world, base) = over_a_floor(random);
    let size = random.scale(0.003, 0.3);
    let mesh = match random.below(6) {
        0 => sphere(16, true),
        1 => disc(4 + random.below(12) as u32),
        2 => cuboid(DVec3::splat(-0.57), DVec3::splat(0.57), false),
        3 => prism(1.0, 3 + random.below(9) as u32),
        4 => triangle(),
        _ => quad(DVec3::new(-0.7, 0.0, -0.7), DVec3::Z * 1.4, DVec3::X * 1.4),
    };
    let flat = mesh.triangles.len() < 20 && mesh.positions.iter().all(|p| p.y == 0.0);
    let emission = random.vector(0.2, 1.0) / (size * size);
    let matter = if !flat && random.chance(0.25) {
        Matter { emission, ..Matter::glass(random.within(1.0, 1.8), 0.0) }
    } else {
        Matter::glowing(emission)
    };
    // Flat bodies face nearly downwards, so that no visible part of the floor is near their plane.
    let tilt = DQuat::from_rotation_x(PI + random.within(-0.15, 0.15));
    let rotation = if flat { tilt } else { random.turn() };
    let chain = vec![Placement { translation: place(random, size), rotation, scale: DVec3::splat(size) }];
    let lamp = world.add("lamp", mesh.clone(), matter, chain).to_world();
    let expected = expect(&world, |origin, direction| {
        let p = on_floor(origin, direction);
        base / PI * emission * corners(&mesh, &lamp).map(|corners| irradiance(p, corners)).sum::<f64>()
    });
    Known { world, expected, max_depth: 2 }
}

fn punctual(random: &mut Random) -> Known {
    let (mut world, base) = over_a_floor(random);
    let color = random.vector(0.2, 2.0);
    let p = place(random, 0.1);
    let down = DQuat::from_rotation_x(-PI / 2.0 + random.within(-0.5, 0.5));
    let rotation = DQuat::from_rotation_y(random.within(0.0, 2.0 * PI)) * down;
    let axis = rotation * DVec3::NEG_Z;
    let outer = random.within(0.9, 1.5);
    let kind = match random.below(4) {
        0 => LightKind::Point { radius: 0.0 },
        1 => LightKind::Point { radius: random.scale(0.002, 0.03) },
        2 => LightKind::Spot { inner: outer * random.within(0.0, 0.9), outer, radius: 0.0 },
        _ => LightKind::Sun { angle: if random.chance(0.5) { 0.0 } else { random.within(0.5, 20.0) } },
    };
    if matches!(kind, LightKind::Sun { .. }) {
        world.things.retain(|thing| !thing.name.starts_with("walls"));
    }
    world.add_kind(
        "light",
        ThingKind::Light(Light { kind, color }),
        vec![Placement { translation: p, rotation, scale: DVec3::ONE }],
    );
    let expected = expect(&world, |origin, direction| {
        let to = p - on_floor(origin, direction);
        let (distance, cosine) = (to.length(), to.normalize().y);
        let received = match kind {
            LightKind::Sun { .. } => -axis.y,
            LightKind::Point { .. } => cosine / (distance * distance),
            LightKind::Spot { inner, outer, .. } => {
                fall_off(-to.normalize().dot(axis), inner, outer) * cosine / (distance * distance)
            }
        };
        base / PI * color * received
    });
    Known { world, expected, max_depth: 2 }
}

/// The falloff of a spot that KHR_lights_punctual recommends.
fn fall_off(cosine: f64, inner: f64, outer: f64) -> f64 {
    let x = ((cosine - outer.cos()) / (inner.cos() - outer.cos()).max(1e-3)).clamp(0.0, 1.0);
    x * x
}

fn bounce(random: &mut Random) -> Known {
    let (mut world, base) = over_a_floor(random);
    let size = random.within(0.15, 0.35);
    let middle = place(random, size);
    let ball =
        if random.chance(0.5) { sphere(24, false) } else { cuboid(DVec3::splat(-0.57), DVec3::splat(0.57), false) };
    let white = random.vector(0.3, 1.0);
    let chain = vec![Placement { translation: middle, rotation: random.turn(), scale: DVec3::splat(size) }];
    let to_world = world.add("ball", ball.clone(), Matter::matte(white), chain).to_world();
    // On the side that the visible part of the floor sees; no light passes through the ball.
    let seen = world.things[0].to_world();
    let seen = on_floor(seen.translation, seen.transform_vector3(DVec3::NEG_Z)) - middle;
    let (from, p) = loop {
        let from = (seen.normalize() + random.vector(-0.5, 0.5) + 0.3 * DVec3::Y).normalize();
        let p = middle + from * random.within(2.0, 3.0) * size;
        // Walls and floor would hide the ball from a spot behind them.
        if p.abs().max_element() < 0.95 {
            break (from, p);
        }
    };
    let outer = (0.5 * size / p.distance(middle)).asin();
    let color = random.vector(1.0, 5.0) / (size * size);
    let up = if from.y.abs() > 0.9 { DVec3::X } else { DVec3::Y };
    let right = up.cross(from).normalize();
    let rotation = DQuat::from_mat3(&glam::DMat3::from_cols(right, from.cross(right), from));
    let kind = LightKind::Spot { inner: 0.5 * outer, outer, radius: 0.0 };
    world.add_kind(
        "spot",
        ThingKind::Light(Light { kind, color }),
        vec![Placement { translation: p, rotation, scale: DVec3::ONE }],
    );
    let patches = lit_patches(&ball, &to_world, p, -from, (0.5 * outer, outer));
    let expected = expect(&world, |origin, direction| {
        let floor = on_floor(origin, direction);
        let received: f64 = patches
            .iter()
            .map(|&(q, normal, flux)| {
                let to = floor - q;
                let (square, to) = (to.length_squared(), to.normalize());
                flux / PI * to.dot(normal).max(0.0) * (-to.y).max(0.0) / square
            })
            .sum();
        base / PI * white * color * received
    });
    Known { world, expected, max_depth: 3 }
}

/// Small patches of a convex mesh lit by a spot of intensity 1: centre, normal and received flux of each.
fn lit_patches(mesh: &Mesh, to_world: &DAffine3, p: DVec3, axis: DVec3, cone: (f64, f64)) -> Vec<(DVec3, DVec3, f64)> {
    let mut patches = vec![];
    for [a, b, c] in corners(mesh, to_world) {
        let cross = (b - a).cross(c - a);
        let normal = cross.normalize();
        if normal.dot(p - a) <= 0.0 {
            continue;
        }
        let n = if mesh.triangles.len() > 100 { 4 } else { 40 };
        let at = |i: u32, j: u32, shift: f64| {
            a + ((b - a) * (f64::from(i) + shift) + (c - a) * (f64::from(j) + shift)) / f64::from(n)
        };
        for i in 0..n {
            for j in 0..n - i {
                let upper = (i + j + 1 < n).then(|| at(i, j, 2.0 / 3.0));
                for q in [Some(at(i, j, 1.0 / 3.0)), upper].into_iter().flatten() {
                    let to = p - q;
                    let cosine = to.normalize().dot(normal);
                    let intensity = fall_off(-to.normalize().dot(axis), cone.0, cone.1);
                    let area = 0.5 * cross.length() / f64::from(n * n);
                    patches.push((q, normal, intensity * cosine / to.length_squared() * area));
                }
            }
        }
    }
    patches.retain(|patch| patch.2 > 0.0);
    patches
}

/// An emissive wall, and a camera that sees only the wall.
fn before_a_wall(random: &mut Random, view: f64) -> (World, DVec3) {
    let mut world = World { size: 4.0, ..World::default() };
    world.look(DVec3::Z * 2.0, DVec3::ZERO, Lens { view, focus: 2.0, ..Lens::default() });
    let emission = random.vector(0.2, 3.0);
    let wall = quad(DVec3::new(-2.0, -2.0, -1.0), DVec3::X * 4.0, DVec3::Y * 4.0);
    world.add("wall", wall, Matter::glowing(emission), vec![Placement::IDENTITY]);
    (world, emission)
}

fn absorbing(random: &mut Random) -> Known {
    let view = random.within(0.2, 0.7);
    let (mut world, emission) = before_a_wall(random, view);
    let half = random.vector(0.1, 0.45);
    let sigma_a = random.vector(0.2, 4.0);
    let medium = Some(Medium { sigma_a, sigma_s: DVec3::ZERO, g: 0.0 });
    let chain = vec![Placement { translation: random.vector(-0.1, 0.1), rotation: random.turn(), scale: DVec3::ONE }];
    let matter = Matter { medium, ..Matter::glass(1.0, 0.0) };
    let back = world.add("block", cuboid(-half, half, false), matter, chain).to_world().inverse();
    let expected = expect(&world, |origin, direction| {
        let (o, d) = (back.transform_point3(origin), back.transform_vector3(direction));
        let (t0, t1) = ((-half - o) / d, (half - o) / d);
        let chord = t0.max(t1).min_element() - t0.min(t1).max_element();
        emission * (-sigma_a * chord.max(0.0)).exp()
    });
    Known { world, expected, max_depth: u32::MAX }
}

fn pane(random: &mut Random) -> Known {
    let (mut world, emission) = before_a_wall(random, 0.05);
    let (ior, thickness, sigma_a) = (random.within(1.1, 2.2), random.scale(1e-3, 0.5), random.vector(0.1, 2.0));
    let sigma_a = sigma_a / thickness;
    let matter = Matter { medium: Some(Medium { sigma_a, sigma_s: DVec3::ZERO, g: 0.0 }), ..Matter::glass(ior, 0.0) };
    let half = DVec3::new(0.6, 0.6, 0.5 * thickness);
    world.add("pane", cuboid(-half, half, false), matter, vec![Placement::IDENTITY]);
    let reflected = ((ior - 1.0) / (ior + 1.0)).powi(2);
    let left = (-sigma_a * thickness).exp();
    let through = (1.0 - reflected).powi(2) * left / (DVec3::ONE - reflected * reflected * left * left);
    let expected = expect(&world, |_, _| emission * through);
    Known { world, expected, max_depth: u32::MAX }
}

/// A block that absorbs: the inverse of its placement, its half sides and coefficient, and what decides which block fills
/// the space: priority and volume. Hidden blocks absorb nothing where they do.
struct Block {
    back: DAffine3,
    half: DVec3,
    sigma_a: DVec3,
    priority: i32,
    hidden: bool,
}

impl Block {
    /// The distances at which a ray enters and leaves the block.
    fn chord(&self, origin: DVec3, direction: DVec3) -> Option<[f64; 2]> {
        let (o, d) = (self.back.transform_point3(origin), self.back.transform_vector3(direction));
        let (t0, t1) = ((-self.half - o) / d, (self.half - o) / d);
        let (enter, leave) = (t0.min(t1).max_element().max(0.0), t0.max(t1).min_element());
        (enter < leave).then_some([enter, leave])
    }
}

fn overlap(random: &mut Random) -> Known {
    let view = random.within(0.2, 0.7);
    let (mut world, emission) = before_a_wall(random, view);
    let mut blocks = vec![];
    for _ in 0..2 + random.below(4) {
        let around_camera = random.chance(0.15);
        let half = if around_camera { random.vector(0.2, 0.3) } else { random.vector(0.1, 0.45) };
        let middle = if around_camera { DVec3::Z * 2.0 } else { DVec3::ZERO };
        let translation = middle + random.vector(-0.1, 0.1);
        let chain = vec![Placement { translation, rotation: random.turn(), scale: DVec3::ONE }];
        let (sigma_a, priority, hidden) = (random.vector(0.2, 4.0), random.below(2) as i32, random.chance(0.3));
        let medium = Some(Medium { sigma_a, sigma_s: DVec3::ZERO, g: 0.0 });
        let matter = Matter { medium, priority, ..Matter::glass(1.0, 0.0) };
        let thing = world.add("block", cuboid(-half, half, false), matter, chain);
        thing.hidden = hidden;
        blocks.push(Block { back: thing.to_world().inverse(), half, sigma_a, priority, hidden });
    }
    let expected = expect(&world, |origin, direction| {
        let chords: Vec<_> = blocks.iter().filter_map(|block| Some((block, block.chord(origin, direction)?))).collect();
        let mut ends: Vec<f64> = chords.iter().flat_map(|(_, chord)| *chord).collect();
        ends.sort_by(f64::total_cmp);
        let depth: DVec3 = ends
            .windows(2)
            .map(|part| {
                let middle = 0.5 * (part[0] + part[1]);
                let here = chords.iter().filter(|(_, [enter, leave])| (*enter..*leave).contains(&middle));
                let volume = |block: &Block| block.half.element_product();
                let fills = here
                    .map(|(block, _)| block)
                    .max_by(|a, b| a.priority.cmp(&b.priority).then(volume(b).total_cmp(&volume(a))));
                fills.filter(|block| !block.hidden).map_or(DVec3::ZERO, |block| block.sigma_a * (part[1] - part[0]))
            })
            .sum();
        emission * (-depth).exp()
    });
    if random.chance(0.6) {
        let shutter = [[0.75, 0.75], [0.5, 0.75]][random.below(2)];
        world.later = Some(Later { seed: random.below(1 << 20) as u64, shutter });
    }
    Known { world, expected, max_depth: u32::MAX }
}

fn hidden(random: &mut Random) -> Known {
    let Known { mut world, expected, max_depth } = furnace(random);
    let places: Vec<DVec3> = world.things.iter().map(|thing| thing.to_world().translation).collect();
    for (index, p) in places.into_iter().enumerate() {
        // The first one is the camera.
        if index > 0 && random.chance(0.2) || index == 0 && random.chance(0.5) {
            continue;
        }
        let scatters = Medium { sigma_a: DVec3::ZERO, sigma_s: random.vector(0.5, 3.0), g: random.within(-0.5, 0.5) };
        let ior = if random.chance(0.2) { 1.0 } else { random.within(1.1, 1.6) };
        let medium = random.chance(0.5).then_some(scatters);
        let matter = Matter { medium, priority: -1, ..Matter::glass(ior, 0.0) };
        let (mesh, half) = match random.below(2) {
            0 => (sphere(16, false), 0.45),
            _ => (cuboid(DVec3::splat(-1.0), DVec3::ONE, false), 0.38),
        };
        let chain = vec![Placement { translation: p, rotation: random.turn(), scale: DVec3::splat(half) }];
        world.add("around", mesh, matter, chain).hidden = true;
    }
    Known { world, expected, max_depth }
}

fn furnace(random: &mut Random) -> Known {
    let mut world = World { size: 2.0, sky: Some(DVec3::ONE), ..World::default() };
    world.look(DVec3::new(0.0, 0.3, 3.0), DVec3::ZERO, Lens { view: 0.6, focus: 3.0, ..Lens::default() });
    for _ in 0..1 + random.below(3) {
        let mesh = match random.below(4) {
            0 => sphere(12 + 2 * random.below(8) as u32, false),
            1 => cuboid(DVec3::splat(-0.57), DVec3::splat(0.57), false),
            2 => joined([cuboid(DVec3::splat(-0.57), DVec3::splat(0.57), false), bubble()]),
            _ => prism(1.0, 3 + random.below(9) as u32),
        };
        let scatters = Medium { sigma_a: DVec3::ZERO, sigma_s: random.vector(0.5, 3.0), g: random.within(-0.5, 0.5) };
        let matter = match random.below(5) {
            0 => Matter::matte(DVec3::ONE),
            1 => {
                Matter { metallic: 1.0, specular: 1.0, roughness: random.within(0.0, 1.0), ..Matter::matte(DVec3::ONE) }
            }
            2 => Matter::glass(random.within(1.1, 2.0), random.within(0.1, 0.8)),
            3 => Matter { medium: Some(scatters), ..Matter::glass(random.within(1.0, 1.6), 0.0) },
            _ => Matter::glass(random.within(1.1, 2.0), 0.0),
        };
        let p = random.vector(-0.5, 0.5);
        if world.things.iter().skip(1).any(|thing| thing.to_world().translation.distance(p) < 0.75) {
            continue;
        }
        let chain =
            vec![Placement { translation: p, rotation: random.turn(), scale: DVec3::splat(random.within(0.2, 0.36)) }];
        world.add("body", mesh, matter, chain);
    }
    let expected = expect(&world, |_, _| DVec3::ONE);
    Known { world, expected, max_depth: u32::MAX }
}

/// A small sphere that faces inwards: a bubble in a solid.
fn bubble() -> Mesh {
    let mut mesh = sphere(10, false).transformed(&DAffine3::from_scale(DVec3::splat(0.3)));
    mesh.triangles.iter_mut().for_each(|triangle| triangle.reverse());
    mesh
}
