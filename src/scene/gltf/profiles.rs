//! Patterns of lights: photometric profiles, which `extras.caustique.ies` and EXT_lights_ies name, and pictures, which
//! `extras.caustique.gobo` names.

use super::document::{Document, extension, get, named};
use super::extras::{self, GoboExtras, IesExtras, LightExtras, Normalize};
use super::texture::{Textures, Use};
use super::{fault, uri};
use crate::error::{Error, Result};
use crate::git_lfs;
use crate::light::{Pattern, Picture, PunctualKind};
use crate::math::{DAffine3, Rgb};
use crate::scene::description::PunctualLight;
use crate::scene::ies::{self, Photometry, Turn};
use crate::texture::Texture;
use serde::Deserialize;
use serde_json::Value;
use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::Arc;

/// Largest angle of view of a picture (radians): 170 degrees.
const MAX_VIEW: f32 = 2.967_06;
/// Media type of a profile in a buffer view (EXT_lights_ies).
const MEDIA_TYPE: &str = "application/x-ies-lm-63";

/// The place of a profile.
#[derive(Clone, PartialEq, Eq, Hash)]
enum Source {
    /// A file beside the scene, by its name.
    File(String),
    /// A URI: a file, or the profile itself.
    Uri(String),
    BufferView(u32),
}

/// A profile as a light has it.
#[derive(Clone)]
struct Shape {
    /// The relative intensity.
    pattern: Arc<Pattern>,
    /// The largest luminous intensity (cd).
    peak: f32,
    /// The flux of the profile before its angles are scaled (lm).
    flux: f32,
}

/// The patterns of a file, each read once.
#[derive(Clone, Default)]
pub(super) struct Profiles {
    read: HashMap<Source, Arc<Photometry>>,
    /// Profiles by their source, the bits of their rotation (degrees), its sense, and the bits of their scale.
    shapes: HashMap<(Source, u32, bool, u32), Shape>,
    /// Pictures by their texture and the bits of their angle of view (radians).
    pictures: HashMap<(u32, u32), Arc<Pattern>>,
}

impl Source {
    /// The name in messages.
    fn name(&self) -> String {
        match self {
            Source::File(name) => format!("profile {name}"),
            Source::Uri(uri) if uri.starts_with("data:") => "profile in a URI".into(),
            Source::Uri(uri) => format!("profile {uri}"),
            Source::BufferView(view) => format!("profile in buffer view {view}"),
        }
    }

    fn bytes<'d>(&self, document: &'d Document) -> Result<Cow<'d, [u8]>> {
        match self {
            Source::BufferView(view) => document.view(*view as usize).map(Cow::Borrowed),
            Source::Uri(uri) => document.bytes_of(uri).map(Cow::Owned),
            Source::File(name) => {
                let path = uri::require_path(name).and_then(|name| document.folder.file(name.as_ref()))?;
                let hint = "put the profile beside the scene file, or give its bufferView";
                let io = |cause: std::io::Error| Error::io(&path, &cause).hint(hint);
                let meta = std::fs::metadata(&path).map_err(io)?;
                // Reading a device or a pipe may never end.
                if !meta.is_file() || meta.len() > ies::MAX_BYTES {
                    return Err(io(std::io::Error::other("it is not a regular file of less than 64 MiB")));
                }
                let bytes = std::fs::read(&path).map_err(io)?;
                git_lfs::check(&bytes, path.display())?;
                Ok(Cow::Owned(bytes))
            }
        }
    }
}

impl Profiles {
    /// The profile of a source. A `scale` of 0 does not change its angles.
    fn get(
        &mut self,
        document: &Document,
        source: Source,
        turn: Turn,
        scale: f32,
        warnings: &mut Vec<String>,
    ) -> Result<Shape> {
        let key = (source, turn.degrees.to_bits(), turn.clockwise, scale.to_bits());
        if let Some(known) = self.shapes.get(&key) {
            return Ok(known.clone());
        }
        let name = key.0.name();
        let photometry = match self.read.get(&key.0) {
            Some(known) => Arc::clone(known),
            None => {
                let bytes = key.0.bytes(document).map_err(|error| error.within(&name))?;
                let mut faults = Vec::new();
                let parsed = ies::parse(&bytes, &mut faults).map_err(|error| error.within(&name))?;
                warnings.extend(faults.into_iter().map(|fault| format!("{name}: {fault}")));
                let parsed = Arc::new(parsed);
                self.read.insert(key.0.clone(), Arc::clone(&parsed));
                parsed
            }
        };
        let scaled = match scale {
            0.0 => None,
            scale => Some(photometry.scaled(scale).ok_or_else(|| {
                fault(&name, format!("its angles times {scale} leave no light")).hint("give another angle_scale")
            })?),
        };
        let used = scaled.as_ref().unwrap_or(&photometry);
        let profile = used.profile(turn).ok_or_else(|| {
            fault(&name, "its angles are too near to each other").hint("remove one of each pair of equal angles")
        })?;
        let (pattern, peak) = (Arc::new(Pattern::Profile(profile)), used.peak());
        let shape = Shape { pattern, peak, flux: photometry.flux() as f32 };
        self.shapes.insert(key, shape.clone());
        Ok(shape)
    }

    /// Gives a punctual light the profile of its extras, if they name one.
    pub(super) fn apply(
        &mut self,
        document: &Document,
        extras: &IesExtras,
        light: &mut PunctualLight,
        place: &str,
        warnings: &mut Vec<String>,
    ) -> Result<()> {
        if matches!(light.kind, PunctualKind::Sun { .. }) {
            warnings.push(format!("{place}: extras.caustique.ies has no effect on a directional light"));
            return Ok(());
        }
        if !(extras.rotation_deg.is_finite() && extras.angle_scale.is_finite()) {
            return Err(fault(place, "extras.caustique.ies.rotation_deg and angle_scale must be finite"));
        }
        let source = match (&extras.file, extras.buffer_view) {
            (Some(file), None) => Source::File(file.clone()),
            (None, Some(view)) => Source::BufferView(view),
            _ => return Err(fault(place, "extras.caustique.ies must have one of file and bufferView")),
        };
        let turn = Turn { degrees: extras.rotation_deg, clockwise: extras.clockwise };
        let shape = self.get(document, source, turn, extras.angle_scale, warnings);
        let Shape { pattern, peak, flux } = shape.map_err(|error| error.within(place))?;
        light.pattern = Some(pattern);
        match extras.normalize {
            Normalize::Peak(true) => {}
            Normalize::Peak(false) => light.intensity *= peak,
            Normalize::Flux(_) => light.intensity *= peak / flux,
        }
        Ok(())
    }
}

/// The texels of a texture as linear colours, times their alpha.
fn texels(texture: &Texture) -> Vec<[f32; 3]> {
    let count = texture.width as usize * texture.height as usize;
    (0..count).map(|index| texture.texels.at(index)).map(|texel| (texel.truncate() * texel.w).to_array()).collect()
}

impl Profiles {
    /// Gives a spot the picture that its extras name.
    pub(super) fn apply_gobo(
        &mut self,
        document: &Document,
        textures: &mut Textures,
        extras: &GoboExtras,
        light: &mut PunctualLight,
        place: &str,
        warnings: &mut Vec<String>,
    ) -> Result<()> {
        let PunctualKind::Spot { outer, .. } = light.kind else {
            warnings.push(format!("{place}: extras.caustique.gobo has an effect on spots only"));
            return Ok(());
        };
        if light.pattern.is_some() {
            warnings.push(format!("{place}: extras.caustique.gobo replaces its profile"));
        }
        let view = extras.view_deg.map_or(2.0 * outer, f32::to_radians);
        if !(view > 0.0 && view <= MAX_VIEW) {
            let cause =
                format!("the view of its gobo is {} degrees; it must be above 0 and at most 170", view.to_degrees());
            return Err(fault(place, cause).hint("set extras.caustique.gobo.view_deg"));
        }
        let key = (extras.texture, view.to_bits());
        let pattern = match self.pictures.get(&key) {
            Some(known) => Arc::clone(known),
            None => {
                let index = textures.load(document, extras.texture, Use::Color, warnings);
                let texture = &textures.list[index.map_err(|error| error.within(place))? as usize];
                let (width, height) = (texture.width as usize, texture.height as usize);
                let picture = Picture::new(width, height, texels(texture), view).ok_or_else(|| {
                    fault(place, format!("its gobo \"{}\" is black", texture.name)).hint("choose another picture")
                })?;
                let pattern = Arc::new(Pattern::Picture(picture));
                self.pictures.insert(key, Arc::clone(&pattern));
                pattern
            }
        };
        light.pattern = Some(pattern);
        Ok(())
    }
}

/// A node's reference to a light of EXT_lights_ies, by index.
#[derive(Deserialize)]
struct Reference {
    light: u32,
    #[serde(default = "one")]
    multiplier: f32,
    #[serde(default = "white")]
    color: [f32; 3],
}

/// A light of EXT_lights_ies.
#[derive(Deserialize)]
struct Listed {
    #[serde(default)]
    name: Option<String>,
    #[serde(default)]
    uri: Option<String>,
    #[serde(default, rename = "bufferView")]
    buffer_view: Option<u32>,
    #[serde(default, rename = "mimeType")]
    media_type: Option<String>,
}

fn one() -> f32 {
    1.0
}

fn white() -> [f32; 3] {
    [1.0; 3]
}

/// Whether a node has a light of EXT_lights_ies.
pub(super) fn has_light(node: &Value) -> bool {
    node["extensions"]["EXT_lights_ies"].is_object()
}

/// Reads the light of EXT_lights_ies of a node, which is given by its name and raw JSON. Its intensities are in the unit
/// of the punctual lights of the file, which `divisor` converts to W/sr.
pub(super) fn light(
    document: &Document,
    node: (&str, &Value),
    place: &str,
    to_world: DAffine3,
    divisor: f32,
    profiles: &mut Profiles,
    warnings: &mut Vec<String>,
) -> Result<Option<PunctualLight>> {
    let Some(reference) = extension::<Reference>(node.1, "EXT_lights_ies", place)? else { return Ok(None) };
    let list = document.raw["extensions"]["EXT_lights_ies"]["lights"].as_array();
    let raw = get(list.map_or(&[][..], Vec::as_slice), reference.light as usize, "light of EXT_lights_ies")?;
    let place = named("light", raw["name"].as_str().or(Some(node.0)), reference.light as usize);
    let listed = Listed::deserialize(raw).map_err(|e| super::container::malformed(&place, &e))?;
    if listed.media_type.as_deref().is_some_and(|kind| kind != MEDIA_TYPE) {
        warnings.push(format!("{place}: its mimeType is not {MEDIA_TYPE}; it is read as a profile"));
    }
    let source = match (listed.uri, listed.buffer_view) {
        (Some(uri), _) => Source::Uri(uri),
        (None, Some(view)) => Source::BufferView(view),
        (None, None) => return Err(fault(&place, "it has neither uri nor bufferView").hint("export the scene again")),
    };
    let color = Rgb::from_array(reference.color);
    if !(color.is_finite() && reference.multiplier.is_finite()) {
        return Err(fault(&place, "its color or multiplier is not finite"));
    }
    let color = color.clamp(Rgb::ZERO, Rgb::ONE);
    if color != Rgb::from_array(reference.color) || reference.multiplier < 0.0 {
        warnings.push(format!("{place}: its color is limited to 0 to 1, its multiplier to at least 0"));
    }
    let extras: LightExtras = extras::read(node.1, &place)?;
    let radius = extras.radius.unwrap_or(0.0);
    if !(radius.is_finite() && radius >= 0.0) {
        let cause = format!("extras.caustique.radius must be finite and not negative, it is {radius}");
        return Err(fault(&place, cause));
    }
    // Horizontal angles start at the X axis, and run counter-clockwise as seen from behind the light.
    let shape = profiles.get(document, source, Turn::default(), 0.0, warnings);
    let Shape { pattern, peak, .. } = shape.map_err(|error| error.within(&place))?;
    let name = Some(node.0).filter(|name| !name.is_empty()).map(str::to_owned);
    Ok(Some(PunctualLight {
        name: name.or(listed.name).unwrap_or_else(|| format!("profile {}", reference.light)),
        to_world,
        intensity: color * (reference.multiplier.max(0.0) * peak / divisor),
        kind: PunctualKind::Point,
        pattern: Some(pattern),
        radius,
        pass_through: false,
        bulb: extras.bulb.unwrap_or(false),
        hidden_from_camera: extras.visible.is_some_and(|visible| !visible.camera),
        light_group: extras.light_group,
        links: None,
    }))
}
