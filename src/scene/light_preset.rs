//! Procedural environments that light a scene without any light.

use super::description::{Description, EnvironmentDescription, EnvironmentSource, PlacedMesh};
use crate::geometry::Mesh;
use crate::material::{Alpha, Material};
use crate::math::{DAffine3, DVec3, Vec3, Vec4};
use rayon::prelude::*;
use serde::Serialize;
use std::f32::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

/// A procedural environment, with +Z as the front of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum LightPreset {
    /// A grey photo studio with soft lights: a key light from the front left, a fill light, a rim light, one above
    Studio,
    /// The studio with a neutral grey floor below the scene, which receives its shadows
    StudioFloor,
    /// A clear sky with a sun of 3 degrees from the front left
    Sky,
    /// No light
    None,
}

impl LightPreset {
    /// The radiance of the environment; `None` for [`LightPreset::None`].
    fn environment(self) -> Option<EnvironmentSource> {
        match self {
            LightPreset::Studio | LightPreset::StudioFloor => Some(image(studio)),
            LightPreset::Sky => Some(image(Sky::new().radiance())),
            LightPreset::None => None,
        }
    }
}

/// Gives a scene the environment that the user has chosen, or that of [`LightPreset::Studio`], with a warning, if the
/// scene has no light and the user has not chosen.
pub fn apply(description: &mut Description, chosen: Option<LightPreset>) {
    if chosen.is_none() && has_light(description) {
        return;
    }
    let Some(source) = chosen.unwrap_or(LightPreset::Studio).environment() else { return };
    if chosen.is_none() {
        description.warnings.push(
            "the scene has no light of its own: a neutral studio lights it (--light-preset chooses another light or none, --env \
             an image)"
                .into(),
        );
    }
    if chosen == Some(LightPreset::StudioFloor) {
        add_floor(description);
    }
    description.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
    description.environment_hidden_from_camera = false;
    description.background = None;
    description.environment_light_group = None;
    description.environment_unknown = false;
}

/// Adds the floor of the studio: a matte disc below the scene, which cameras do not see from below, and which fades out
/// towards its edge. With motion blur there is none, with a warning.
fn add_floor(description: &mut Description) {
    /// Reflectance of the floor, at which it is about as bright as the horizon.
    const REFLECTANCE: f32 = 0.35;
    /// Radii of the part that is opaque and of the whole floor, relative to the scene's.
    const RADII: [f64; 2] = [2.0, 5.0];
    const SIDES: u32 = 96;
    const RINGS: u32 = 8;
    if description.blur().is_some() {
        description.warnings.push("the studio has no floor, because the scene has motion blur".into());
        return;
    }
    let (low, high) = description.bounds();
    if low.cmpgt(high).any() {
        return;
    }
    let scene = (0.5 * (high - low).length()).max(1e-6);
    let [inner, outer] = RADII.map(|factor| factor * scene);
    let ring = |radius: f64| {
        (0..SIDES).map(move |k| {
            let (sin, cos) = (f64::from(k) / f64::from(SIDES) * std::f64::consts::TAU).sin_cos();
            DVec3::new(radius * sin, 0.0, radius * cos).as_vec3()
        })
    };
    let around = |k: u32| (k + 1) % SIDES;
    let disc = Mesh {
        name: "studio floor".into(),
        positions: std::iter::once(Vec3::ZERO).chain(ring(inner)).collect(),
        triangles: (0..SIDES).map(|k| [0, 1 + k, 1 + around(k)]).collect(),
        ..Mesh::default()
    };
    let mut rim = Mesh { name: "edge of the studio floor".into(), ..Mesh::default() };
    for r in 0..=RINGS {
        let share = f64::from(r) / f64::from(RINGS);
        rim.positions.extend(ring(inner + (outer - inner) * share));
        rim.colors.extend((0..SIDES).map(|_| Vec4::new(1.0, 1.0, 1.0, 1.0 - smoothstep(0.0, 1.0, share as f32))));
    }
    for r in 0..RINGS {
        for k in 0..SIDES {
            let (a, b) = (r * SIDES + k, r * SIDES + around(k));
            rim.triangles.extend([[a, a + SIDES, b], [b, a + SIDES, b + SIDES]]);
        }
    }
    let middle = DVec3::new(0.5 * (low.x + high.x), low.y, 0.5 * (low.z + high.z));
    let object = description.objects.len() as u32;
    description.preset_floor = Some(object);
    description.objects.push("studio floor".into());
    for (mesh, alpha) in [(disc, Alpha::Opaque), (rim, Alpha::Blend)] {
        description.instances.push(PlacedMesh {
            name: "studio floor".into(),
            mesh: description.meshes.len() as u32,
            material: description.materials.len() as u32,
            object,
            hidden_from_camera: false,
            shadow_catcher: false,
            holdout: false,
            light_group: None,
            links: None,
            moves: false,
            to_world: DAffine3::from_translation(middle),
        });
        description.materials.push(Material {
            name: mesh.name.clone(),
            base_color: [REFLECTANCE, REFLECTANCE, REFLECTANCE, 1.0],
            metallic: 0.0.into(),
            specular: 0.0.into(),
            alpha,
            culled: true,
            ..Material::default()
        });
        description.meshes.push(Arc::new(mesh));
    }
}

/// Whether the scene has a light of any kind at any time, or says itself that its environment is black.
fn has_light(description: &Description) -> bool {
    description.environment.is_some() || description.environment_is_black || description.has_light
}

const WIDTH: u32 = 1024;
const HEIGHT: u32 = 512;

/// A latitude-longitude image of the radiance for each direction.
fn image(radiance: impl Fn(Vec3) -> Vec3 + Sync) -> EnvironmentSource {
    let texel = |i: u32| radiance(direction(i)).to_array();
    let texels = (0..WIDTH * HEIGHT).into_par_iter().map(texel).collect();
    EnvironmentSource::Image { width: WIDTH, height: HEIGHT, texels }
}

/// Direction to the centre of a texel.
fn direction(texel: u32) -> Vec3 {
    let (u, v) = ((texel % WIDTH) as f32 + 0.5, (texel / WIDTH) as f32 + 0.5);
    let ((sin, cos), (z, x)) = ((PI * v / HEIGHT as f32).sin_cos(), (TAU * (u / WIDTH as f32 - 0.5)).sin_cos());
    Vec3::new(sin * x, cos, sin * z)
}

/// Direction at an azimuth (degrees, 0 is the front, positive to the right) and an elevation (degrees).
fn towards(azimuth: f32, elevation: f32) -> Vec3 {
    let ((sa, ca), (se, ce)) = (azimuth.to_radians().sin_cos(), elevation.to_radians().sin_cos());
    Vec3::new(sa * ce, se, ca * ce)
}

fn smoothstep(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// A soft light of the studio: a rectangle with soft edges.
struct SoftBox {
    /// Azimuth and elevation of the middle (degrees).
    place: [f32; 2],
    /// Half of the width and of the height at distance 1.
    half: [f32; 2],
    radiance: f32,
}

/// The lights of the studio: key, fill, rim and top.
const SOFT_BOXES: [SoftBox; 4] = [
    SoftBox { place: [-42.0, 38.0], half: [0.55, 0.4], radiance: 4.8 },
    SoftBox { place: [62.0, 18.0], half: [0.5, 0.7], radiance: 0.9 },
    SoftBox { place: [155.0, 38.0], half: [0.7, 0.22], radiance: 2.4 },
    SoftBox { place: [0.0, 90.0], half: [0.4, 0.4], radiance: 1.2 },
];

impl SoftBox {
    fn radiance(&self, d: Vec3) -> f32 {
        let [azimuth, elevation] = self.place;
        let axis = towards(azimuth, elevation);
        let (right, up) = (towards(azimuth + 90.0, 0.0), towards(azimuth, elevation + 90.0));
        let along = d.dot(axis);
        if along <= 0.0 {
            return 0.0;
        }
        let inside = |side: Vec3, half: f32| smoothstep(1.1 * half, 0.9 * half, (d.dot(side) / along).abs());
        self.radiance * inside(right, self.half[0]) * inside(up, self.half[1])
    }
}

/// Radiance that arrives from the direction `d` in the neutral studio.
fn studio(d: Vec3) -> Vec3 {
    /// Radiance of the floor below the scene, of the horizon and of the ceiling.
    const SURROUNDINGS: [f32; 3] = [0.2, 0.4, 0.45];
    let [floor, horizon, ceiling] = SURROUNDINGS;
    let wall = if d.y < 0.0 { floor } else { ceiling };
    let around = horizon + (wall - horizon) * smoothstep(0.0, 1.0, d.y.abs());
    Vec3::splat(SOFT_BOXES.iter().map(|light| light.radiance(d)).fold(around, f32::max))
}

/// The clear sky of Preetham, Shirley and Smits ("A Practical Analytic Model for Daylight", 1999), with a sun that is
/// larger than the real one, and a grey ground.
struct Sky {
    sun: Vec3,
    /// Factor on the sky's radiance, radiance of the sun and of the ground.
    scale: f32,
    disc: Vec3,
    ground: Vec3,
}

/// Haze of the sky.
const TURBIDITY: f32 = 3.0;
/// Azimuth and elevation of the sun (degrees).
const SUN: [f32; 2] = [-42.0, 42.0];
/// Angular radius of the sun (radians).
const SUN_RADIUS: f32 = 1.5 * PI / 180.0;
/// Irradiance over pi that a level surface receives from the sky and from the sun.
const FROM_SKY: f32 = 0.3;
const FROM_SUN: f32 = 0.8;
/// Reflectance of the ground.
const GROUND: f32 = 0.25;
/// Colour of the sun, of luminance 1.
const SUN_COLOR: Vec3 = Vec3::new(1.12, 0.98, 0.83);

impl Sky {
    fn new() -> Sky {
        let sun = towards(SUN[0], SUN[1]);
        let unscaled = Sky { sun, scale: 1.0, disc: Vec3::ZERO, ground: Vec3::ZERO };
        // Irradiance of a level surface over pi.
        let level = |weight: &(dyn Fn(Vec3) -> f32 + Sync)| -> f32 {
            let solid_angle = |i: u32| TAU / WIDTH as f32 * PI / HEIGHT as f32 * direction(i).with_y(0.0).length();
            let texel = |i: u32| weight(direction(i)) * direction(i).y.max(0.0) * solid_angle(i) / PI;
            (0..WIDTH * HEIGHT / 2).map(texel).sum()
        };
        let luminance = |c: Vec3| c.dot(Vec3::new(0.2126, 0.7152, 0.0722));
        let sky = level(&|d| luminance(unscaled.clear(d)));
        let disc = level(&|d| unscaled.disc_share(d));
        let ground = Vec3::splat(GROUND * (FROM_SKY + FROM_SUN));
        Sky { sun, scale: FROM_SKY / sky, disc: SUN_COLOR * (FROM_SUN / disc), ground }
    }

    fn radiance(self) -> impl Fn(Vec3) -> Vec3 + Sync {
        move |d| {
            let above = self.scale * self.clear(d) + self.disc_share(d) * self.disc;
            self.ground.lerp(above, smoothstep(-0.02, 0.0, d.y))
        }
    }

    /// Share of the sun's radiance in a direction: 1 within the disc, 0 outside.
    fn disc_share(&self, d: Vec3) -> f32 {
        smoothstep(1.2 * SUN_RADIUS, 0.8 * SUN_RADIUS, d.angle_between(self.sun))
    }

    /// Radiance of the sky without the sun, in arbitrary units, linear Rec. 709.
    fn clear(&self, d: Vec3) -> Vec3 {
        /// Coefficients A to E of Perez' function for Y, x and y: the factor of the turbidity, and the constant.
        const PEREZ: [[[f32; 2]; 5]; 3] = [
            [[0.1787, -1.4630], [-0.3554, 0.4275], [-0.0227, 5.3251], [0.1206, -2.5771], [-0.0670, 0.3703]],
            [[-0.0193, -0.2592], [-0.0665, 0.0008], [-0.0004, 0.2125], [-0.0641, -0.8989], [-0.0033, 0.0452]],
            [[-0.0167, -0.2608], [-0.0950, 0.0092], [-0.0079, 0.2102], [-0.0441, -1.6537], [-0.0109, 0.0529]],
        ];
        /// Chromaticities x and y of the zenith: polynomials in the sun's polar angle, highest power first, for the
        /// square of the turbidity, the turbidity and 1.
        const ZENITH: [[[f32; 4]; 3]; 2] = [
            [
                [0.00166, -0.00375, 0.00209, 0.0],
                [-0.02903, 0.06377, -0.03202, 0.00394],
                [0.11693, -0.21196, 0.06052, 0.25886],
            ],
            [
                [0.00275, -0.00610, 0.00317, 0.0],
                [-0.04214, 0.08970, -0.04153, 0.00516],
                [0.15346, -0.26756, 0.06670, 0.26688],
            ],
        ];
        let polar = FRAC_PI_2 - SUN[1].to_radians();
        let cos = d.y.max(0.02);
        let angle = d.angle_between(self.sun);
        let function = |[a, b, c, d, e]: [f32; 5], cos: f32, angle: f32| {
            (1.0 + a * (b / cos).exp()) * (1.0 + c * (d * angle).exp() + e * angle.cos().powi(2))
        };
        let relative = |channel: usize| {
            let coefficients = PEREZ[channel].map(|[factor, constant]| factor * TURBIDITY + constant);
            function(coefficients, cos, angle) / function(coefficients, 1.0, polar)
        };
        let zenith = |channel: usize| {
            let polynomial = |p: [f32; 4]| p.iter().fold(0.0, |sum, c| sum * polar + c);
            ZENITH[channel].into_iter().fold(0.0, |sum, p| sum * TURBIDITY + polynomial(p))
        };
        let (luminance, x, y) = (relative(0), zenith(0) * relative(1), zenith(1) * relative(2));
        let xyz = Vec3::new(x / y, 1.0, (1.0 - x - y) / y) * luminance;
        let rgb = Vec3::new(
            xyz.dot(Vec3::new(3.2406, -1.5372, -0.4986)),
            xyz.dot(Vec3::new(-0.9689, 1.8758, 0.0415)),
            xyz.dot(Vec3::new(0.0557, -0.2040, 1.0570)),
        );
        rgb.max(Vec3::ZERO)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Irradiance over pi of a surface with the normal `n`, by channel.
    fn irradiance(source: &EnvironmentSource, n: Vec3) -> Vec3 {
        let EnvironmentSource::Image { texels, .. } = source else { panic!("it is no image") };
        let solid_angle = |d: Vec3| TAU / WIDTH as f32 * PI / HEIGHT as f32 * d.with_y(0.0).length();
        let texel = |(i, texel): (usize, &[f32; 3])| {
            let d = direction(i as u32);
            Vec3::from_array(*texel) * (d.dot(n).max(0.0) * solid_angle(d) / PI)
        };
        texels.iter().enumerate().map(texel).sum()
    }

    #[test]
    fn a_white_surface_in_the_studio_is_neutral_and_neither_dark_nor_overexposed() {
        let studio = LightPreset::Studio.environment().unwrap();
        for (n, least, most) in [
            (towards(-42.0, 42.0), 1.0, 1.6),
            (Vec3::Z, 0.7, 1.2),
            (Vec3::Y, 0.9, 1.5),
            (Vec3::X, 0.5, 1.0),
            (Vec3::NEG_Z, 0.5, 1.0),
            (Vec3::NEG_Y, 0.2, 0.5),
        ] {
            let [r, g, b] = irradiance(&studio, n).to_array();
            assert!(r == g && g == b && (least..most).contains(&r), "{n}: {r} {g} {b}");
        }
    }

    #[test]
    fn the_sky_is_blue_and_lights_a_level_surface_as_its_constants_say() {
        let sky = LightPreset::Sky.environment().unwrap();
        let luminance = irradiance(&sky, Vec3::Y).dot(Vec3::new(0.2126, 0.7152, 0.0722));
        assert!((luminance - FROM_SKY - FROM_SUN).abs() < 0.02, "{luminance}");
        let away = irradiance(&sky, towards(138.0, 30.0));
        assert!(away.z > 1.2 * away.x, "{away}");
    }
}
