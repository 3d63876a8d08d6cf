//! Reads punctual lights (KHR_lights_punctual) and cameras.

use super::clipping::Clip;
use super::document::{Document, get, named};
use super::extras::{self, CameraExtras, FisheyeKind, LightExtras, PanoramaExtras, Units};
use super::profiles::Profiles;
use super::texture::Textures;
use super::{LightUnits, fault};
use crate::error::Result;
use crate::geometry::Mesh;
use crate::light::{PunctualKind, SpotEdge};
use crate::math::{DAffine3, DVec3, Rgb};
use crate::scene::Description;
use crate::scene::description::{CameraDescription, GuessedUnits, PlacedMesh, Projection, PunctualLight};
use gltf::json::camera::Type;
use gltf::json::validation::Checked;
use serde::Deserialize;
use serde_json::Value;
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};
use std::sync::Arc;

/// Luminous efficacy (lm/W) with which Blender's exporter turns watts into lumens.
const EFFICACY: f32 = 683.0;
/// First version of Blender's exporter that writes lumens.
const FIRST_PHOTOMETRIC: [u32; 2] = [3, 6];
/// Smallest irradiance of a scene's lights that is visible (W/m2). Blender's default scene has about 1.
const MIN_IRRADIANCE: f64 = 0.02;
/// Maximum number of lights from which the brightness of a scene is estimated.
const MAX_SAMPLED_LIGHTS: usize = 64;
/// Maximum number of vertices at which the brightness of a scene is estimated.
const MAX_SAMPLED_POINTS: usize = 4096;

/// A light as KHR_lights_punctual writes it.
#[derive(Deserialize)]
struct Light {
    #[serde(rename = "type")]
    kind: String,
    #[serde(default)]
    name: Option<String>,
    #[serde(default = "white")]
    color: [f32; 3],
    #[serde(default = "one")]
    intensity: f32,
    #[serde(default)]
    range: Option<f32>,
    #[serde(default)]
    spot: Spot,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct Spot {
    inner_cone_angle: f32,
    outer_cone_angle: f32,
}

impl Default for Spot {
    fn default() -> Self {
        Spot { inner_cone_angle: 0.0, outer_cone_angle: FRAC_PI_4 }
    }
}

fn white() -> [f32; 3] {
    [1.0; 3]
}

fn one() -> f32 {
    1.0
}

/// Divisors that convert intensities in the file to radiometric units.
#[derive(Clone, Copy)]
pub(super) struct Divisors {
    /// Divisor for suns, to W/m2.
    sun: f32,
    /// Divisor for points and spots, to W/sr.
    point: f32,
}

impl Divisors {
    /// These divisors for intensities that are multiplied by `factor`.
    pub(super) fn over(self, factor: f32) -> Divisors {
        Divisors { sun: self.sun / factor, point: self.point / factor }
    }

    /// Divisor for points and spots, to W/sr.
    pub(super) fn point(self) -> f32 {
        self.point
    }

    const RADIOMETRIC: Divisors = Divisors { sun: 1.0, point: 1.0 };
    const PHOTOMETRIC: Divisors = Divisors { sun: EFFICACY, point: EFFICACY };
    /// Divisors for Blender's own units, where a point or spot light has the power (W) over the whole sphere.
    const WATTS: Divisors = Divisors { sun: 1.0, point: 4.0 * PI };
}

/// The divisors of light intensities for a file, and whether its units are a guess.
pub(super) fn divisors(
    document: &Document,
    units: LightUnits,
    file_units: Option<Units>,
    warnings: &mut Vec<String>,
) -> (Divisors, Option<GuessedUnits>) {
    match (units, file_units) {
        (LightUnits::Radiometric, _) | (LightUnits::Auto, Some(Units::Radiometric)) => (Divisors::RADIOMETRIC, None),
        (LightUnits::Photometric, _) | (LightUnits::Auto, Some(Units::Photometric)) => (Divisors::PHOTOMETRIC, None),
        (LightUnits::Auto, None) => {
            let generator = document.raw["asset"]["generator"].as_str();
            let from = generator.map_or("the file's generator".into(), |g| format!("generator \"{g}\""));
            let (divisors, taken) = match document.blender_version() {
                Some(version) if version >= FIRST_PHOTOMETRIC => (Divisors::PHOTOMETRIC, None),
                Some(_) => (Divisors::WATTS, Some("writes lamps in Blender's watts, without 683 lumens for each")),
                None => {
                    (Divisors::RADIOMETRIC, Some("does not state the unit of lamps: they are taken in W/sr and W/m2"))
                }
            };
            warnings.extend(taken.map(|taken| format!("{from} {taken} (--light-units decides)")));
            (divisors, Some(GuessedUnits { photometric: taken.is_none(), from }))
        }
    }
}

/// Changes guessed units from lumens to watts, if as lumens the lights would be too dark to see. Blender's exporter
/// omits the factor in its lighting mode "Unitless", and files do not state the mode. Returns the factor by which
/// intensities were multiplied.
pub(super) fn reconsider_units(out: &mut Description) -> f32 {
    let Some(guessed) = out.guessed_units.as_mut().filter(|guessed| guessed.photometric) else { return 1.0 };
    let glows = out.materials.iter().any(|material| material.emission.max_element() > 0.0);
    if glows || out.environment.as_ref().is_some_and(|environment| environment.strength > 0.0) {
        // The plan compares lights with the emissive surfaces and the environment.
        return 1.0;
    }
    let points = sample_vertices(&out.meshes, &out.instances);
    let total: f64 = out.lights.iter().take(MAX_SAMPLED_LIGHTS).map(|light| typical_irradiance(light, &points)).sum();
    if !(MIN_IRRADIANCE / f64::from(EFFICACY)..MIN_IRRADIANCE).contains(&total) {
        return 1.0;
    }
    guessed.photometric = false;
    out.lights.iter_mut().for_each(|light| light.intensity *= EFFICACY);
    out.warnings.push(format!(
        "its lamps would give {total:.1e} W/m2 if their numbers were lumens, going by {}, which is too dark to see: they are \
         taken in W/sr and W/m2, as Blender's lighting mode 'Unitless' writes them (--light-units decides)",
        guessed.from
    ));
    EFFICACY
}

/// Irradiance of a light at the median distance of the points (W/m2); infinite without points.
fn typical_irradiance(light: &PunctualLight, points: &[DVec3]) -> f64 {
    let intensity = f64::from(light.intensity.max_element());
    let mut distances: Vec<f64> = points.iter().map(|p| p.distance_squared(light.to_world.translation)).collect();
    match (light.kind, distances.is_empty()) {
        (_, true) => f64::INFINITY,
        (PunctualKind::Sun { .. }, _) => intensity,
        _ => {
            let middle = distances.len() / 2;
            intensity / *distances.select_nth_unstable_by(middle, f64::total_cmp).1
        }
    }
}

/// World positions of some vertices, spread evenly over the objects of a scene.
fn sample_vertices(meshes: &[Arc<Mesh>], instances: &[PlacedMesh]) -> Vec<DVec3> {
    let each = (MAX_SAMPLED_POINTS / instances.len().max(1)).max(1);
    let step = instances.len().div_ceil(MAX_SAMPLED_POINTS).max(1);
    let mut points = Vec::new();
    for placed in instances.iter().step_by(step) {
        let positions = &meshes[placed.mesh as usize].positions;
        let some = positions.iter().step_by(positions.len().div_ceil(each).max(1));
        points.extend(some.map(|p| placed.to_world.transform_point3(p.as_dvec3())));
    }
    points
}

/// The profiles and textures that the lights of a file share.
pub(super) struct LightAssets<'a> {
    pub profiles: &'a mut Profiles,
    pub textures: &'a mut Textures,
}

/// Reads the light with index `index` in the file, for a node that is given by its name and raw JSON.
pub(super) fn light(
    document: &Document,
    index: usize,
    node: (&str, &Value),
    to_world: DAffine3,
    divisors: Divisors,
    LightAssets { profiles, textures }: LightAssets<'_>,
    warnings: &mut Vec<String>,
) -> Result<PunctualLight> {
    let list = document.raw["extensions"]["KHR_lights_punctual"]["lights"].as_array();
    let raw = get(list.map_or(&[][..], Vec::as_slice), index, "light")?;
    let place = named("light", raw["name"].as_str().or(Some(node.0)), index);
    let light = Light::deserialize(raw).map_err(|e| super::container::malformed(&place, &e))?;
    let name =
        Some(node.0.to_owned()).filter(|n| !n.is_empty()).or(light.name).unwrap_or_else(|| format!("light {index}"));
    let divisor = if light.kind == "directional" { divisors.sun } else { divisors.point };
    let mut intensity = Rgb::from_array(light.color) * light.intensity / divisor;
    if !intensity.is_finite() {
        return Err(fault(place, "its colour or intensity is not finite"));
    }
    if intensity.min_element() < 0.0 {
        warnings.push(format!("{place}: its intensity is negative; it is taken as zero"));
        intensity = intensity.max(Rgb::ZERO);
    }
    if light.range.is_some() {
        warnings.push(format!("{place}: its range is ignored: light has no maximum distance"));
    }
    extras::check_keys(raw, &[extras::LIGHT], &place, warnings);
    let (on_light, on_node): (LightExtras, LightExtras) = (extras::read(raw, &place)?, extras::read(node.1, &place)?);
    let length = |value: Option<f32>, what: &str| match value {
        Some(x) if !(x.is_finite() && x >= 0.0) => {
            Err(fault(&place, format!("extras.caustique.{what} must be finite and not negative, it is {x}")))
        }
        value => Ok(value.unwrap_or(0.0)),
    };
    let radius = length(on_node.radius.or(on_light.radius), "radius")?;
    let angle = length(on_node.angle_deg.or(on_light.angle_deg), "angle_deg")?.to_radians();
    let kind = match light.kind.as_str() {
        "point" => PunctualKind::Point,
        "spot" => cone(&light.spot, on_node.blend.or(on_light.blend), &place, warnings)?,
        "directional" if angle <= PI => PunctualKind::Sun { angle },
        "directional" => return Err(fault(place, "extras.caustique.angle_deg is above 180")),
        other => return Err(fault(place, format!("its type \"{other}\" is unknown"))),
    };
    let sun = matches!(kind, PunctualKind::Sun { .. });
    if (sun && radius > 0.0) || (!sun && angle > 0.0) {
        let key = if sun { "radius" } else { "angle_deg" };
        warnings.push(format!("{place}: extras.caustique.{key} has no effect on a {} light", light.kind));
    }
    if !matches!(kind, PunctualKind::Spot { .. }) && on_node.blend.or(on_light.blend).is_some() {
        warnings.push(format!("{place}: extras.caustique.blend has no effect on a {} light", light.kind));
    }
    let hidden_from_camera = on_node.visible.or(on_light.visible).is_some_and(|visible| !visible.camera);
    let radius = if sun { 0.0 } else { radius };
    let light_group = on_node.light_group.or(on_light.light_group);
    let pass_through = on_node.null_bsdf.or(on_light.null_bsdf).unwrap_or(false);
    let bulb = on_node.bulb.or(on_light.bulb).unwrap_or(false);
    let mut light = PunctualLight {
        name,
        to_world,
        intensity,
        kind,
        pattern: None,
        radius,
        pass_through,
        bulb,
        hidden_from_camera,
        light_group,
        links: None,
    };
    if let Some(ies) = on_node.ies.or(on_light.ies) {
        profiles.apply(document, &ies, &mut light, &place, warnings)?;
    }
    if light.bulb && (sun || light.radius == 0.0 || light.is_sphere()) {
        let why = if sun || light.radius == 0.0 { "it needs a radius" } else { "its sphere is visible without it" };
        warnings.push(format!("{place}: extras.caustique.bulb has no effect: {why}"));
    }
    if let Some(gobo) = on_node.gobo.or(on_light.gobo) {
        profiles.apply_gobo(document, textures, &gobo, &mut light, &place, warnings)?;
    }
    Ok(light)
}

/// Checks the cone of a spot. `blend` is the width of the soft edge over that of the whole cone, both as 1 minus the
/// cosine, as in Blender; the edge then has Blender's falloff.
fn cone(spot: &Spot, blend: Option<f32>, place: &str, warnings: &mut Vec<String>) -> Result<PunctualKind> {
    let (inner, outer) = (spot.inner_cone_angle, spot.outer_cone_angle);
    if !(inner.is_finite() && outer.is_finite()) {
        return Err(fault(place, "its cone angles are not finite"));
    }
    let wide = outer.clamp(0.0, FRAC_PI_2);
    let narrow = inner.clamp(0.0, wide);
    if (narrow, wide) != (inner, outer) {
        warnings.push(format!("{place}: its cone from {inner} to {outer} radians is taken as {narrow} to {wide}"));
    }
    match blend {
        None => Ok(PunctualKind::Spot { inner: narrow, outer: wide, edge: SpotEdge::Squared }),
        Some(blend) if (0.0..=1.0).contains(&blend) => {
            // 1 - cos x = 2 sin^2 (x / 2)
            let inner = 2.0 * ((1.0 - blend).sqrt() * (0.5 * wide).sin()).asin();
            Ok(PunctualKind::Spot { inner, outer: wide, edge: SpotEdge::Smooth })
        }
        Some(blend) => Err(fault(place, format!("extras.caustique.blend must lie between 0 and 1, it is {blend}"))),
    }
}

/// The projection of a panorama. The error is the cause.
fn panorama(extras: &PanoramaExtras) -> std::result::Result<Projection, &'static str> {
    let PanoramaExtras { longitude_deg, latitude_deg, fisheye, fov_deg, half_size } = *extras;
    let Some(kind) = fisheye else {
        let within =
            |[low, high]: [f32; 2], most: f32| low < high && -most <= low && high <= most && high - low <= 360.0;
        if !(within(longitude_deg, 360.0) && within(latitude_deg, 90.0)) {
            return Err(
                "extras.caustique.panorama must have ascending longitudes over at most 360 degrees, and ascending latitudes from -90 to 90",
            );
        }
        let radians = |range: [f32; 2]| range.map(f32::to_radians);
        return Ok(Projection::Equirectangular { longitude: radians(longitude_deg), latitude: radians(latitude_deg) });
    };
    if !(fov_deg > 0.0 && fov_deg <= 360.0) {
        return Err("extras.caustique.panorama.fov_deg must be above 0 and at most 360");
    }
    let (fov, equal_area) = (fov_deg.to_radians(), kind == FisheyeKind::Equisolid);
    let whole = if equal_area { 2.0 * (0.25 * fov).sin() } else { 0.5 * fov };
    let half_size = half_size.unwrap_or([whole; 2]);
    if !half_size.iter().all(|side| side.is_finite() && *side > 0.0) {
        return Err("extras.caustique.panorama.half_size must be finite and positive");
    }
    Ok(Projection::Fisheye { fov, equal_area, half_size })
}

/// Reads the camera of a node, which is given by its name and raw JSON.
pub(super) fn camera(
    document: &Document,
    index: usize,
    node: (&str, &Value),
    to_world: DAffine3,
    warnings: &mut Vec<String>,
) -> Result<(CameraDescription, Clip)> {
    let camera = get(&document.cameras, index, "camera")?;
    let raw = document.part("cameras", index);
    let place = named("camera", camera.name.as_deref().or(Some(node.0)), index);
    let (projection, near, far) = match (&camera.type_, &camera.perspective, &camera.orthographic) {
        (Checked::Valid(Type::Perspective), Some(p), _) => {
            if !(p.yfov > 0.0 && p.yfov < PI) {
                return Err(fault(place, format!("its yfov is {}; it must lie between 0 and pi", p.yfov)));
            }
            let aspect = p.aspect_ratio.filter(|a| a.is_finite() && *a > 0.0);
            if aspect != p.aspect_ratio {
                warnings.push(format!("{place}: its aspect ratio is not positive and is ignored"));
            }
            (Projection::Perspective { yfov: p.yfov, aspect }, p.znear, p.zfar)
        }
        (Checked::Valid(Type::Orthographic), _, Some(o)) => {
            let positive = |x: f32| x.is_finite() && x.abs() > 0.0;
            if !(positive(o.xmag) && positive(o.ymag)) {
                return Err(fault(place, "xmag and ymag must be finite and not zero"));
            }
            (Projection::Orthographic { xmag: o.xmag.abs(), ymag: o.ymag.abs() }, o.znear, Some(o.zfar))
        }
        _ => return Err(fault(place, "it is neither perspective nor orthographic")),
    };
    extras::check_keys(raw, &[extras::CAMERA], &place, warnings);
    let (on_camera, on_node): (CameraExtras, CameraExtras) =
        (extras::read(raw, &place)?, extras::read(node.1, &place)?);
    let projection = match on_node.panorama.or(on_camera.panorama) {
        None => projection,
        Some(extras) => panorama(&extras).map_err(|cause| fault(&place, cause))?,
    };
    let aperture_radius = on_node.aperture_radius.or(on_camera.aperture_radius).unwrap_or(0.0);
    let focus_distance = on_node.focus_distance.or(on_camera.focus_distance);
    if !(aperture_radius.is_finite() && aperture_radius >= 0.0) {
        return Err(fault(place, "extras.caustique.aperture_radius must be finite and not negative"));
    }
    if focus_distance.is_some_and(|d| !(d.is_finite() && d > 0.0)) {
        return Err(fault(place, "extras.caustique.focus_distance must be finite and positive"));
    }
    if aperture_radius > 0.0 && focus_distance.is_none() {
        warnings.push(format!("{place}: it has an aperture but no focus_distance; 1 m is used"));
    }
    let shift = on_node.shift.or(on_camera.shift).unwrap_or_default();
    if !shift.iter().all(|x| x.is_finite()) {
        return Err(fault(place, "extras.caustique.shift must be finite"));
    }
    let name = if node.0.is_empty() { camera.name.clone().unwrap_or_else(|| place.clone()) } else { node.0.into() };
    let focus_distance = focus_distance.unwrap_or(1.0);
    let clip = Clip { near, far: far.unwrap_or(f32::INFINITY) };
    Ok((CameraDescription { name, to_world, projection, aperture_radius, focus_distance, shift }, clip))
}
