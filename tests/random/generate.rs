//! Generates a random scene from a seed: a room or an open place, lights at any position, things on the floor and in
//! the air, with sizes from a millimetre to a kilometre.
//!
//! A scene is generated in a room whose longest side is 1, and then scaled, rotated and moved as a whole.

use super::random::Random;
use super::relation::similar;
use super::shapes::{cuboid, disc, joined, lathe, prism, quad, sphere, triangle, vessel};
use super::world::{
    Lens, Light, LightKind, Matter, Medium, Mesh, Panorama, Placement, Texture, Thing, ThingKind, World,
};
use caustique::camera::Filter;
use glam::{DQuat, DVec2, DVec3, EulerRot};
use std::f64::consts::{PI, TAU};

/// Radius of the empty space around a camera.
const CAMERA_SPACE: f64 = 0.08;
/// First seed of scenes with fires, alpha of solids and dark lights. Tests name scenes of earlier seeds for what they show.
const FIRST_WITH_ADDITIONS: u64 = 2000;
/// First seed of scenes with light linking.
const FIRST_WITH_LINKS: u64 = 3000;
/// First seed of scenes with windows.
const FIRST_WITH_WINDOWS: u64 = 4000;
/// First seed of scenes with shadow linking.
const FIRST_WITH_SHADOW_LINKS: u64 = 5000;
/// First seed of scenes with lamps outside of the room.
const FIRST_WITH_OUTER_LAMPS: u64 = 6000;
/// First seed of scenes with panoramas and pixel filters.
pub const FIRST_WITH_PANORAMAS: u64 = 7000;
/// First seed of scenes in which opaque things have an alpha.
pub const FIRST_WITH_SHEETS: u64 = 8000;
/// Number of attempts to find a place for a thing.
const ATTEMPTS: usize = 40;

struct Generator {
    random: Random,
    world: World,
    /// Half width, half height and half depth of the room.
    room: DVec3,
    closed: bool,
    /// Bounding spheres of the things placed so far.
    taken: Vec<(DVec3, f64)>,
}

/// Generates the scene of a seed.
pub fn generate(seed: u64) -> World {
    let mut random = Random::new(seed);
    let mut sides = random.vector(0.55, 1.0);
    sides[random.below(3)] = 1.0;
    let room = sides * DVec3::new(0.5, 1.0, 0.5);
    let closed = random.chance(0.7);
    let world = World { seed, size: 1.0, ..World::default() };
    let mut generator = Generator { random, world, room, closed, taken: vec![] };
    generator.walls();
    generator.cameras();
    generator.lights();
    generator.things();
    if seed >= FIRST_WITH_ADDITIONS {
        generator.additions(seed);
        // Drawn by numbers of their own, so that the rest of a seed's scene stays.
        let own = std::mem::replace(&mut generator.random, Random::new(seed ^ 0x5ca1e));
        generator.rare();
        if seed >= FIRST_WITH_LINKS && generator.random.chance(0.3) {
            generator.link(|thing| &mut thing.unlit);
        }
        if seed >= FIRST_WITH_SHADOW_LINKS && generator.random.chance(0.3) {
            generator.link(|thing| &mut thing.unblocked);
        }
        if seed >= FIRST_WITH_WINDOWS && generator.closed && generator.random.chance(0.4) {
            generator.window();
        }
        if seed >= FIRST_WITH_OUTER_LAMPS && generator.closed && generator.random.chance(0.5) {
            generator.outer_lamps();
        }
        if seed >= FIRST_WITH_PANORAMAS {
            generator.panoramas();
            generator.filter();
        }
        if seed >= FIRST_WITH_SHEETS && generator.random.chance(0.4) {
            for matter in generator.world.materials.iter_mut().filter(|matter| !matter.is_glass()) {
                if generator.random.chance(0.5) {
                    matter.alpha = generator.random.within(0.2, 0.8);
                }
            }
        }
        generator.random = own;
    }
    generator.placed()
}

impl Generator {
    fn color(&mut self, low: f64, high: f64) -> DVec3 {
        self.random.vector(low, high)
    }

    fn walls(&mut self) {
        let (low, high) = (self.room * DVec3::new(-1.0, 0.0, -1.0), self.room);
        if !self.closed {
            let reach = self.random.within(1.0, 2.5);
            let ground = quad(low * reach, DVec3::Z * 2.0 * high.z * reach, DVec3::X * 2.0 * high.x * reach);
            let matter = self.opaque();
            self.world.add("ground", ground, matter, vec![Placement::IDENTITY]);
            if self.random.chance(0.5) {
                let wall = quad(low * reach, DVec3::X * 2.0 * high.x * reach, DVec3::Y * high.y);
                let matter = self.opaque();
                self.world.add("wall", wall, matter, vec![Placement::IDENTITY]);
            }
        } else if self.random.chance(0.5) {
            let color = self.color(0.2, 0.8);
            self.world.add("walls", cuboid(low, high, true), Matter::matte(color), vec![Placement::IDENTITY]);
        } else {
            let whole = cuboid(low, high, true);
            for side in 0..6 {
                let corners = 4 * side..4 * side + 4;
                let face = Mesh {
                    positions: whole.positions[corners.clone()].to_vec(),
                    uvs: whole.uvs[corners].to_vec(),
                    normals: vec![],
                    triangles: vec![[0, 1, 2], [0, 2, 3]],
                };
                let matter = if side == 4 || self.random.chance(0.2) {
                    self.opaque()
                } else {
                    Matter::matte(self.color(0.2, 0.8))
                };
                self.world.add("wall", face, matter, vec![Placement::IDENTITY]);
            }
        }
    }

    fn cameras(&mut self) {
        for _ in 0..1 + self.random.below(2) {
            let side = |random: &mut Random| random.within(0.6, 0.85) * if random.chance(0.5) { 1.0 } else { -1.0 };
            let corner = DVec3::new(side(&mut self.random), self.random.within(0.35, 0.8), side(&mut self.random));
            let eye = self.room * corner;
            if self.taken.iter().any(|(p, radius)| p.distance(eye) < radius + CAMERA_SPACE) {
                continue;
            }
            let target = self.room * self.random.vector(-0.2, 0.2) + DVec3::Y * 0.3 * self.room.y;
            let orthographic = self.random.chance(0.08);
            let view = if orthographic { self.random.within(0.15, 0.3) } else { self.random.within(0.6, 1.3) };
            let aperture = if self.random.chance(0.15) { self.random.within(0.002, 0.01) } else { 0.0 };
            let focus = eye.distance(target);
            self.world.look(eye, target, Lens { view, orthographic, aperture, focus, panorama: None });
            self.taken.push((eye, CAMERA_SPACE));
        }
    }

    /// Finds a free place in the room for a sphere of this radius, with its centre at `height` if given.
    fn free(&mut self, radius: f64, height: Option<f64>) -> Option<DVec3> {
        for _ in 0..ATTEMPTS {
            let inner = (self.room - DVec3::splat(radius * 1.02)).max(DVec3::ZERO);
            let mut p = inner * self.random.vector(-1.0, 1.0);
            p.y = height.unwrap_or_else(|| {
                let span = self.room.y - 2.04 * radius;
                1.02 * radius + self.random.within(0.0, span.max(0.0))
            });
            if self.is_free(p, radius) {
                self.taken.push((p, radius));
                return Some(p);
            }
        }
        None
    }

    fn is_free(&self, p: DVec3, radius: f64) -> bool {
        self.taken.iter().all(|(other, taken)| p.distance(*other) > 1.02 * (radius + taken))
    }

    fn lights(&mut self) {
        let middle = DVec3::new(0.0, 0.5 * self.room.y, 0.0);
        if !self.closed {
            if self.random.chance(0.6) {
                self.world.sky = Some(self.color(0.1, 0.5));
            } else {
                let angle = if self.random.chance(0.5) { self.random.within(0.5, 10.0) } else { 0.0 };
                let color = self.color(0.5, 2.0);
                let rotation =
                    DQuat::from_euler(EulerRot::YXZ, self.random.within(0.0, TAU), self.random.within(-1.4, -0.4), 0.0);
                let sun = Light { kind: LightKind::Sun { angle }, color };
                self.world.add_kind("sun", ThingKind::Light(sun), vec![Placement::turned(rotation)]);
            }
        }
        let first = usize::from(!self.closed);
        for index in first..1 + self.random.below(3) {
            let radius = self.random.scale(0.006, 0.08);
            let near = self.random.chance(0.5);
            let place = if near && index == first {
                let reach = self.random.scale(1e-3, 0.1);
                let p = middle + self.random.vector(-reach, reach);
                let free = self.is_free(p, radius);
                free.then(|| self.taken.push((p, radius))).map(|()| p)
            } else {
                self.free(radius, None)
            };
            if let Some(p) = place {
                self.light(p, radius);
            }
        }
    }

    fn light(&mut self, p: DVec3, radius: f64) {
        let color = self.color(0.3, 1.0);
        let kind = match self.random.below(10) {
            0 => Some(LightKind::Point { radius: 0.0 }),
            1 => Some(LightKind::Point { radius }),
            2 => {
                let outer = self.random.within(0.3, 1.4);
                let radius = if self.random.chance(0.5) { radius } else { 0.0 };
                Some(LightKind::Spot { inner: outer * self.random.within(0.0, 0.9), outer, radius })
            }
            _ => None,
        };
        let rotation = self.random.turn();
        if let Some(kind) = kind {
            let place = Placement { translation: p, rotation, scale: DVec3::ONE };
            self.world.add_kind("light", ThingKind::Light(Light { kind, color: color * 0.4 }), vec![place]);
            return;
        }
        // The area is that of the mesh at scale 1.
        let (mesh, area) = match self.random.below(6) {
            0 => (sphere(16, true), 4.0 * PI),
            1 => (disc(12), PI),
            2 => (cuboid(DVec3::splat(-0.57), DVec3::splat(0.57), false), 6.0 * 1.3),
            3 => (triangle(), 1.6),
            4 => (quad(DVec3::new(-0.7, 0.0, -0.7), DVec3::Z * 1.4, DVec3::X * 1.4), 2.0),
            _ => (joined([disc(8)]).transformed(&Placement::scaled(DVec3::new(0.8, 1.0, 0.5)).affine()), 1.2),
        };
        let emission = color * (1.2 / (area * radius * radius));
        let closed = area > 3.5;
        let matter = if closed && self.random.chance(0.3) {
            Matter { emission, ..Matter::glass(self.random.within(1.1, 1.8), 0.0) }
        } else {
            Matter::glowing(emission)
        };
        let chain = self.nested(Placement { translation: p, rotation, scale: DVec3::splat(radius) });
        self.world.add("lamp", mesh, matter, chain);
    }

    /// An equal placement as a chain of nodes, some of them with reflections.
    fn nested(&mut self, place: Placement) -> Vec<Placement> {
        let mut chain = vec![];
        let mut rest = place;
        for _ in 0..self.random.below(3) {
            let scale = self.random.scale(0.2, 5.0);
            let parent = Placement {
                translation: self.random.vector(-1.0, 1.0),
                rotation: self.random.turn(),
                scale: DVec3::splat(scale),
            };
            let back = parent.rotation.inverse();
            rest = Placement {
                translation: back * (rest.translation - parent.translation) / scale,
                rotation: back * rest.rotation,
                scale: rest.scale / scale,
            };
            chain.push(parent);
        }
        chain.push(rest);
        if self.random.chance(0.2) {
            chain.push(Placement::scaled(DVec3::new(-1.0, 1.0, 1.0)));
        }
        chain
    }

    /// An opaque material.
    fn opaque(&mut self) -> Matter {
        let base = self.color(0.1, 0.85);
        let mut matter = match self.random.below(6) {
            0 => {
                Matter { metallic: 1.0, roughness: self.random.within(0.15, 0.7), specular: 1.0, ..Matter::matte(base) }
            }
            1 => Matter { metallic: 1.0, roughness: 0.0, specular: 1.0, ..Matter::matte(base) },
            2 => Matter { specular: 1.0, roughness: self.random.within(0.2, 0.8), ..Matter::matte(base) },
            3 => Matter { clearcoat: self.random.within(0.2, 1.0), ..Matter::matte(base) },
            _ => Matter::matte(base),
        };
        if self.random.chance(0.2) {
            matter.texture = Some(self.texture(true));
        }
        if self.random.chance(0.1) {
            matter.bumps = Some((self.random.within(0.2, 1.0), self.texture(false)));
        }
        matter
    }

    fn texture(&mut self, color: bool) -> usize {
        let width = 4;
        let mut texel = || {
            let rgb = self.random.vector(0.0, 1.0);
            let direction = DVec3::new(0.5 + 0.2 * (rgb.x - 0.5), 0.5 + 0.2 * (rgb.y - 0.5), 0.98);
            (if color { rgb * 0.6 + 0.4 } else { direction }).to_array().map(|x| (255.0 * x) as u8)
        };
        let texels = (0..width * width).map(|_| texel()).collect();
        self.world.textures.push(Texture { width, texels, color });
        self.world.textures.len() - 1
    }

    /// A transmitting material.
    fn transparent(&mut self) -> Matter {
        let roughness = if self.random.chance(0.25) { self.random.within(0.15, 0.6) } else { 0.0 };
        let mut matter = Matter::glass(self.random.within(1.15, 1.9), roughness);
        if self.random.chance(0.3) {
            matter.medium = Some(self.medium());
        }
        matter
    }

    fn medium(&mut self) -> Medium {
        let sigma_a = self.color(0.2, 6.0);
        let scatters = self.random.chance(0.5);
        let sigma_s = if scatters { self.color(1.0, 8.0) } else { DVec3::ZERO };
        Medium { sigma_a: if scatters { 0.3 * sigma_a } else { sigma_a }, sigma_s, g: self.random.within(-0.5, 0.7) }
    }

    fn matter(&mut self) -> Matter {
        match self.random.below(10) {
            0..6 => self.opaque(),
            6..9 => self.transparent(),
            _ => {
                let medium = Some(self.medium());
                Matter { medium, ..Matter::glass(1.0, 0.0) }
            }
        }
    }

    fn things(&mut self) {
        let count = (self.random.scale(1.5, 25.0)) as usize;
        let largest = 0.2 / (count as f64).cbrt();
        if self.closed && self.random.chance(0.1) {
            self.fog_on_the_floor();
        } else if self.closed && self.random.chance(0.06) {
            let Medium { sigma_a, sigma_s, g } = self.medium();
            self.world.fog = Some(Medium { sigma_a: 0.2 * sigma_a, sigma_s: 0.2 * sigma_s, g });
        }
        for _ in 0..count {
            let radius = self.random.within(0.5 * largest, largest);
            match self.random.below(10) {
                0 => self.drink(radius),
                1..6 => self.standing(radius),
                _ => self.floating(radius),
            }
        }
    }

    /// Fog as wide as the room, whose faces coincide with the walls.
    fn fog_on_the_floor(&mut self) {
        let top = DVec3::new(1.0, self.random.within(0.1, 0.4), 1.0);
        let mesh = cuboid(self.room * DVec3::new(-1.0, 0.0, -1.0), self.room * top, false);
        let medium = Some(self.medium());
        let matter = Matter { medium, priority: -1, ..Matter::glass(1.0, 0.0) };
        self.world.add("fog", mesh, matter, vec![Placement::IDENTITY]);
    }

    fn drink(&mut self, radius: f64) {
        let height = self.random.within(1.0, 1.6);
        let scale = radius / (0.5 * height + 1.0);
        let middle = 0.5 * height * scale;
        let Some(p) = self.free(radius, Some(middle)) else { return };
        let wall = self.random.within(0.08, 0.2);
        let level = self.random.within(0.4, 0.9) * height;
        let sides = 6 + self.random.below(14) as u32;
        let [glass, liquid] = vessel(height, wall, level, sides);
        let rotation = DQuat::from_rotation_y(self.random.within(0.0, TAU));
        let chain = vec![Placement { translation: p - DVec3::Y * middle, rotation, scale: DVec3::splat(scale) }];
        let ior = self.random.within(1.45, 1.6);
        let body = {
            let thing = self.world.add("vessel", glass, Matter::glass(ior, 0.0), chain.clone());
            thing.rests = true;
            thing.body
        };
        if self.random.chance(0.7) {
            let medium = self.random.chance(0.5).then(|| self.medium());
            let matter = Matter { medium, ..Matter::glass(1.33, 0.0) };
            let thing = self.world.add("liquid", liquid, matter, chain);
            (thing.body, thing.rests) = (body, true);
        }
    }

    /// Adds a thing with a flat bottom that stands exactly on the floor.
    fn standing(&mut self, radius: f64) {
        let height = self.random.within(0.6, 1.6);
        let scale = radius / (1.0 + 0.25 * height * height).sqrt();
        let middle = 0.5 * height * scale;
        let Some(p) = self.free(radius, Some(middle)) else { return };
        let mesh = match self.random.below(3) {
            0 => cuboid(DVec3::new(-0.7, 0.0, -0.7), DVec3::new(0.7, height, 0.7), false),
            1 => prism(height, 3 + self.random.below(14) as u32),
            _ => lathe(&[(0.0, 0.0), (1.0, 0.0), (0.3, height), (0.0, height)], 4 + self.random.below(14) as u32),
        };
        let rotation = DQuat::from_rotation_y(self.random.within(0.0, TAU));
        let place = Placement { translation: p - DVec3::Y * middle, rotation, scale: DVec3::splat(scale) };
        let matter = self.matter();
        let mut chain = vec![place];
        if self.random.chance(0.2) {
            chain.push(Placement::scaled(DVec3::new(-1.0, 1.0, 1.0)));
        }
        self.world.add("standing", mesh, matter, chain).rests = true;
    }

    fn floating(&mut self, radius: f64) {
        let Some(p) = self.free(radius, None) else { return };
        let rotation = self.random.turn();
        // Another instance of an existing thing.
        let copied = self.random.below(self.world.things.len());
        let copied = &self.world.things[copied];
        if self.random.chance(0.25) && copied.name.starts_with("floating") {
            let kind = copied.kind;
            let place = Placement { translation: p, rotation, scale: DVec3::splat(0.9 * radius) };
            let chain = self.nested(place);
            self.world.add_kind("floating", kind, chain);
            return;
        }
        let smooth = self.random.chance(0.7);
        let mesh = match self.random.below(5) {
            0 => cuboid(DVec3::splat(-0.57), DVec3::splat(0.57), false),
            1 => prism(1.0, 3 + self.random.below(9) as u32).transformed(&Placement::at(DVec3::Y * -0.5).affine()),
            2 => cuboid(DVec3::new(-0.7, -0.02, -0.7), DVec3::new(0.7, 0.02, 0.7), false),
            _ => sphere(12 + 2 * self.random.below(12) as u32, smooth),
        };
        let stretch = if self.random.chance(0.3) { self.random.vector(0.4, 0.9) } else { DVec3::splat(0.88) };
        let chain = self.nested(Placement { translation: p, rotation, scale: radius * stretch });
        let matter = self.matter();
        self.world.add("floating", mesh, matter, chain);
    }

    /// Adds fires, alpha of solids, and lights that are dark, by random numbers of their own.
    fn additions(&mut self, seed: u64) {
        let others = std::mem::replace(&mut self.random, Random::new(seed ^ 0xa1fa));
        if self.random.chance(0.15) {
            self.fires();
        }
        if self.random.chance(0.25) {
            for matter in
                self.world.materials.iter_mut().filter(|m| m.is_glass() && m.solid && m.emission == DVec3::ZERO)
            {
                if self.random.chance(0.6) {
                    matter.alpha = self.random.within(0.1, 0.9);
                }
            }
        }
        if self.random.chance(0.25) {
            for _ in 0..1 + self.random.below(3) {
                let p = self.room * self.random.vector(-0.9, 0.9);
                let radius = if self.random.chance(0.5) { 0.0 } else { 0.01 };
                let kind = match self.random.below(2) {
                    0 => LightKind::Point { radius },
                    _ => LightKind::Spot { inner: 0.2, outer: 0.7, radius },
                };
                let dark = Light { kind, color: DVec3::ZERO };
                self.world.add_kind("dark", ThingKind::Light(dark), vec![Placement::at(p.abs())]);
            }
        }
        self.random = others;
    }

    /// Adds one or two fires, the second of which overlaps the first, and a clear solid that may displace both.
    fn fires(&mut self) {
        let radius = self.random.within(0.05, 0.15);
        let Some(p) = self.free(radius, None) else { return };
        let rotation = self.random.turn();
        for _ in 0..1 + self.random.below(2) {
            let offset = self.random.vector(-0.3, 0.3) * radius;
            let scale = DVec3::splat(radius * self.random.within(0.4, 0.8));
            let chain = self.nested(Placement { translation: p + offset, rotation, scale });
            let (medium, fire) = (self.medium(), self.color(0.2, 1.0) / radius);
            let matter = Matter { medium: Some(medium), fire: Some(fire), ..Matter::glass(1.0, 0.0) };
            self.world.add("fire", cuboid(DVec3::splat(-0.57), DVec3::splat(0.57), false), matter, chain);
        }
        if self.random.chance(0.5) {
            let offset = self.random.vector(-0.3, 0.3) * radius;
            let scale = DVec3::splat(0.3 * radius);
            let place = Placement { translation: p + offset, rotation, scale };
            let priority = self.random.below(3) as i32 - 1;
            let matter = Matter { priority, ..Matter::glass(if self.random.chance(0.5) { 1.0 } else { 1.4 }, 0.0) };
            self.world.add("displacing", sphere(12, true), matter, vec![place]);
        }
    }

    /// Adds what few scenes have: priorities, solids that overlap, and things that are hidden from the camera, among
    /// them solids around the camera and around what it sees.
    fn rare(&mut self) {
        if self.random.chance(0.3) {
            for matter in self.world.materials.iter_mut().filter(|matter| matter.is_glass() && matter.priority == 0) {
                matter.priority = self.random.below(3) as i32;
            }
        }
        if self.random.chance(0.3) {
            self.overlapping();
        }
        if self.random.chance(0.2) {
            let walls = ["wall", "ground"];
            for thing in self.world.things.iter_mut().filter(|thing| !walls.iter().any(|w| thing.name.starts_with(w))) {
                thing.hidden = thing.mesh().is_some() && self.random.chance(0.3);
            }
        }
        let mut places = vec![];
        if self.random.chance(0.15) {
            let cameras = self.world.things.iter().filter(|thing| thing.is_camera());
            places.extend(cameras.map(|camera| (camera.to_world().translation, 0.9 * CAMERA_SPACE)));
        }
        if self.random.chance(0.15) {
            let things = self.world.things.iter().filter(|thing| thing.name.starts_with("floating"));
            let near = |thing: &Thing| (thing.to_world().translation, 1.2 * self.world.radius(thing));
            places.extend(things.take(1).map(near));
        }
        for (translation, radius) in places {
            let place = Placement { translation, rotation: self.random.turn(), scale: DVec3::splat(radius) };
            let matter = Matter { priority: -2, ..self.transparent() };
            let mesh = sphere(16, false);
            self.world.add("around", mesh, matter, vec![place]).hidden = true;
        }
    }

    /// Links some lights to some bodies only, by a list of those that they are not linked to.
    fn link(&mut self, list: fn(&mut Thing) -> &mut Vec<u32>) {
        let mut bodies: Vec<u32> = self.world.things.iter().filter(|t| t.mesh().is_some()).map(|t| t.body).collect();
        bodies.sort_unstable();
        bodies.dedup();
        for index in 0..self.world.things.len() {
            let thing = &self.world.things[index];
            let shines = matches!(thing.kind, ThingKind::Light(_));
            if shines || self.world.matter(thing).is_some_and(|matter| matter.glows()) {
                let unlinked = bodies.iter().copied().filter(|_| self.random.chance(0.4)).collect();
                *list(&mut self.world.things[index]) = unlinked;
            }
        }
    }

    /// Cuts a window into a wall that is a thing of its own, under a sky.
    fn window(&mut self) {
        let walls = self.world.things.iter().filter(|thing| thing.name.starts_with("wall")).filter_map(Thing::mesh);
        let is_quad = |&mesh: &usize| self.world.meshes[mesh].positions.len() == 4;
        let quads: Vec<usize> = walls.map(|(mesh, _)| mesh).filter(is_quad).collect();
        if quads.is_empty() {
            return;
        }
        let mesh = quads[self.random.below(quads.len())];
        let wall = self.world.meshes[mesh].clone();
        let [low, high] = [[0.1, 0.5], [0.55, 0.9]]
            .map(|[from, to]| DVec2::new(self.random.within(from, to), self.random.within(from, to)));
        // The corners of the wall are those of the unit square, in this order.
        let at = DVec2::new;
        let part = |low: DVec2, high: DVec2| {
            let corners = [low, at(high.x, low.y), high, at(low.x, high.y)];
            let [a, b, _, d] = [0, 1, 2, 3].map(|i| wall.positions[i]);
            let [p, q, _, s] = [0, 1, 2, 3].map(|i| wall.uvs[i]);
            Mesh {
                positions: corners.map(|c| a + (b - a) * c.x + (d - a) * c.y).to_vec(),
                uvs: corners.map(|c| p + (q - p) * c.x + (s - p) * c.y).to_vec(),
                ..wall.clone()
            }
        };
        self.world.meshes[mesh] = joined([
            part(DVec2::ZERO, at(1.0, low.y)),
            part(at(0.0, high.y), DVec2::ONE),
            part(at(0.0, low.y), at(low.x, high.y)),
            part(at(high.x, low.y), at(1.0, high.y)),
        ]);
        let things = self.world.things.iter_mut();
        for thing in things.filter(|thing| thing.mesh().is_some_and(|(own, _)| own == mesh)) {
            thing.name += " with a window";
        }
        self.world.sky = Some(self.color(0.5, 2.0));
    }

    /// Adds bright lamps behind the walls, ceiling and floor of a room.
    fn outer_lamps(&mut self) {
        let half = self.room * DVec3::new(1.0, 0.5, 1.0);
        for _ in 0..2 + self.random.below(3) {
            let mut at = self.random.vector(-0.8, 0.8);
            at[self.random.below(3)] = self.random.within(1.1, 1.3) * if self.random.chance(0.5) { 1.0 } else { -1.0 };
            let radius = self.random.within(0.01, 0.03);
            let emission = self.color(10.0, 40.0) / (4.0 * PI * radius * radius);
            let place = Placement { scale: DVec3::splat(radius), ..Placement::at(half * (DVec3::Y + at)) };
            self.world.add("lamp behind a wall", sphere(16, true), Matter::glowing(emission), vec![place]);
        }
    }

    /// Makes panoramas of some cameras.
    fn panoramas(&mut self) {
        for thing in &mut self.world.things {
            let ThingKind::Camera(lens) = &mut thing.kind else { continue };
            let random = &mut self.random;
            let panorama = match random.below(6) {
                0 | 1 => Panorama::WHOLE,
                2 => {
                    let (left, low) = (random.within(-180.0, 60.0), random.within(-90.0, 30.0));
                    Panorama::Equirectangular {
                        longitude: [left, left + random.within(60.0, 360.0)],
                        latitude: [low, random.within(low + 30.0, 90.0)],
                    }
                }
                3 => Panorama::Fisheye { fov: random.within(60.0, 360.0), equisolid: random.chance(0.5) },
                _ => continue,
            };
            *lens = Lens { view: 1.0, focus: lens.focus, panorama: Some(panorama), ..Lens::default() };
        }
    }

    fn filter(&mut self) {
        let width = self.random.within(0.5, 8.0) as f32;
        self.world.filter = match self.random.below(6) {
            0 => Filter::Box(width),
            1 => Filter::Gaussian(width),
            2 => Filter::BlackmanHarris(width),
            _ => Filter::default(),
        };
    }

    /// Adds a solid that overlaps a floating one.
    fn overlapping(&mut self) {
        let world = &self.world;
        let solid = |thing: &&Thing| {
            thing.name.starts_with("floating") && world.matter(thing).is_some_and(|matter| matter.is_glass())
        };
        let Some(thing) = world.things.iter().find(solid) else { return };
        let (p, radius) = (thing.to_world().translation, world.radius(thing));
        let translation = p + self.random.vector(-0.3, 0.3) * radius;
        let place = Placement { translation, rotation: self.random.turn(), scale: DVec3::splat(0.6 * radius) };
        let matter = Matter { priority: self.random.below(2) as i32, ..self.transparent() };
        let mesh = cuboid(DVec3::splat(-0.57), DVec3::splat(0.57), false);
        self.world.add("overlapping", mesh, matter, vec![place]);
    }

    /// Scales, rotates and moves the whole scene.
    fn placed(mut self) -> World {
        let size = self.random.scale(1e-3, 1e3);
        let middle = DVec3::new(0.0, 0.5 * self.room.y, 0.0);
        let (rotation, translation) = match self.random.below(6) {
            0 => (DQuat::IDENTITY, DVec3::ZERO),
            1 | 2 => (DQuat::IDENTITY, -middle * size),
            3 | 4 => {
                let rotation = self.random.turn();
                (rotation, -(rotation * middle) * size)
            }
            _ => (self.random.turn(), self.random.vector(-2.0, 2.0) * size),
        };
        similar(&self.world, size, rotation, translation)
    }
}
