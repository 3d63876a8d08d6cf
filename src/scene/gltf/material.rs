//! Reads a material (specification, section 5.19, and the KHR_materials_* extensions), and checks its values.

use super::container::malformed;
use super::document::{Document, extension};
use super::extras::{self, MaterialExtras};
use super::texture::{Info, Textures, Use};
use super::{fault, uri};
use crate::bsdf::SheenModel;
use crate::error::Result;
use crate::material::{Alpha, Material, MediumParameters};
use crate::math::Rgb;
use crate::medium::{DensityGrid, EmissionGrid, Grid, MediumGrids};
use crate::scene::grid_file;
use crate::texture::TextureRef;
use serde::Deserialize;
use serde_json::Value;
use std::sync::Arc;

/// Defines a JSON object whose fields are all optional and have defaults.
macro_rules! record {
    ($(#[$doc:meta])* $name:ident { $($field:ident: $kind:ty = $default:expr,)* }) => {
        $(#[$doc])*
        #[derive(Deserialize)]
        #[serde(rename_all = "camelCase", default)]
        struct $name { $($field: $kind,)* }

        impl Default for $name {
            fn default() -> Self {
                $name { $($field: $default,)* }
            }
        }
    };
}

type Texture = Option<Info>;

record! { Core {
    pbr_metallic_roughness: MetallicRoughness = MetallicRoughness::default(),
    normal_texture: Texture = None,
    occlusion_texture: Option<Value> = None,
    emissive_texture: Texture = None,
    emissive_factor: [f32; 3] = [0.0; 3],
    alpha_mode: String = "OPAQUE".into(),
    alpha_cutoff: f32 = 0.5,
    double_sided: bool = false,
}}
record! { MetallicRoughness {
    base_color_factor: [f32; 4] = [1.0; 4],
    base_color_texture: Texture = None,
    metallic_factor: f32 = 1.0,
    roughness_factor: f32 = 1.0,
    metallic_roughness_texture: Texture = None,
}}
record! { SpecularGlossiness {
    diffuse_factor: [f32; 4] = [1.0; 4],
    diffuse_texture: Texture = None,
    specular_factor: [f32; 3] = [1.0; 3],
    glossiness_factor: f32 = 1.0,
    specular_glossiness_texture: Texture = None,
}}
record! { EmissiveStrength { emissive_strength: f32 = 1.0, }}
record! { Ior { ior: f32 = 1.5, }}
record! { Transmission { transmission_factor: f32 = 0.0, transmission_texture: Texture = None, }}
record! { DiffuseTransmission {
    diffuse_transmission_factor: f32 = 0.0,
    diffuse_transmission_texture: Texture = None,
    diffuse_transmission_color_factor: [f32; 3] = [1.0; 3],
    diffuse_transmission_color_texture: Texture = None,
}}
record! { Volume {
    thickness_factor: f32 = 0.0,
    attenuation_distance: f32 = f32::INFINITY,
    attenuation_color: [f32; 3] = [1.0; 3],
}}
record! { VolumeScatter {
    multiscatter_color: [f32; 3] = [0.0; 3],
    multiscatter_color_factor: Option<[f32; 3]> = None,
    multiscatter_color_texture: Texture = None,
    scatter_anisotropy: f32 = 0.0,
}}
record! { Specular {
    specular_factor: f32 = 1.0,
    specular_texture: Texture = None,
    specular_color_factor: [f32; 3] = [1.0; 3],
    specular_color_texture: Texture = None,
}}
record! { Iridescence {
    iridescence_factor: f32 = 0.0,
    iridescence_texture: Texture = None,
    iridescence_ior: f32 = 1.3,
    iridescence_thickness_minimum: f32 = 100.0,
    iridescence_thickness_maximum: f32 = 400.0,
    iridescence_thickness_texture: Texture = None,
}}
record! { Clearcoat {
    clearcoat_factor: f32 = 0.0,
    clearcoat_texture: Texture = None,
    clearcoat_roughness_factor: f32 = 0.0,
    clearcoat_roughness_texture: Texture = None,
    clearcoat_normal_texture: Texture = None,
}}
record! { Sheen {
    sheen_color_factor: [f32; 3] = [0.0; 3],
    sheen_color_texture: Texture = None,
    sheen_roughness_factor: f32 = 0.0,
    sheen_roughness_texture: Texture = None,
}}
record! { Anisotropy {
    anisotropy_strength: f32 = 0.0,
    anisotropy_rotation: f32 = 0.0,
    anisotropy_texture: Texture = None,
}}
record! { Dispersion { dispersion: f32 = 0.0, }}

/// A material as read from the file, and whether the file declares its meshes solid or thin.
pub(super) struct Loaded {
    pub(super) material: Material,
    /// `Some(true)` if the file declares meshes solid: a volume extension with a thickness, or a medium inside.
    /// `Some(false)` for a volume extension without thickness (thin walls); `None` if it declares neither.
    pub(super) solid: Option<bool>,
    /// Whether the material has an occlusion texture, which is ignored because occlusion is simulated.
    pub(super) occlusion: bool,
}

/// Reads the material with this index in the file.
///
/// # Errors
/// A number is not finite, or a texture cannot be read.
pub(super) fn read(
    document: &Document,
    index: usize,
    place: &str,
    textures: &mut Textures,
    warnings: &mut Vec<String>,
) -> Result<Loaded> {
    let raw = document.part("materials", index);
    let core = Core::deserialize(raw).map_err(|e| malformed(place, &e))?;
    let mut reader = Reader { document, raw, place, textures, warnings };
    let pbr = core.pbr_metallic_roughness;
    let name =
        raw["name"].as_str().filter(|n| !n.is_empty()).map_or_else(|| format!("material {index}"), str::to_owned);
    let mut material = Material {
        name,
        base_color: reader.units(pbr.base_color_factor, "baseColorFactor")?,
        base_color_texture: reader.texture(pbr.base_color_texture, Use::Color, "baseColorTexture")?,
        metallic: reader.unit(pbr.metallic_factor, "metallicFactor")?.into(),
        roughness: reader.unit(pbr.roughness_factor, "roughnessFactor")?.into(),
        emission: reader.color(core.emissive_factor, f32::MAX, "emissiveFactor")?,
        emission_texture: reader.texture(core.emissive_texture, Use::Color, "emissiveTexture")?,
        alpha: match core.alpha_mode.as_str() {
            "OPAQUE" => Alpha::Opaque,
            "MASK" => Alpha::Mask(reader.range(core.alpha_cutoff, f32::MAX, "alphaCutoff")?),
            "BLEND" => Alpha::Blend,
            other => return Err(fault(place, format!("alpha mode \"{other}\" is unknown"))),
        },
        double_sided: core.double_sided,
        ..Material::default()
    };
    let texture = reader.texture(pbr.metallic_roughness_texture, Use::Data, "metallicRoughnessTexture")?;
    (material.metallic.texture, material.roughness.texture) = (texture, texture);
    material.normal_texture = reader.normal_map(core.normal_texture, "normalTexture")?;
    reader.specular_glossiness(&mut material)?;
    reader.surface(&mut material)?;
    reader.thin_film(&mut material)?;
    reader.coatings(&mut material)?;
    reader.diffuse_transmission(&mut material)?;
    let solid = reader.transmission(&mut material)?;
    // Section 3.9.5. Transmissive surfaces are not culled, because their back faces are visible from inside.
    material.culled = !material.double_sided && !material.transmits() && !material.null_bsdf;
    Ok(Loaded { material, solid, occlusion: core.occlusion_texture.is_some() })
}

struct Reader<'r> {
    document: &'r Document<'r>,
    raw: &'r Value,
    place: &'r str,
    textures: &'r mut Textures,
    warnings: &'r mut Vec<String>,
}

impl Reader<'_> {
    fn extension<T: serde::de::DeserializeOwned>(&self, name: &str) -> Result<Option<T>> {
        extension(self.raw, name, self.place)
    }

    fn finite(&self, x: f32, name: &str) -> Result<f32> {
        if x.is_finite() { Ok(x) } else { Err(fault(self.place, format!("{name} is not finite"))) }
    }

    /// Clamps a property of the material to `[0, max]`, with a warning that names it if it changes.
    fn range(&mut self, x: f32, max: f32, name: &str) -> Result<f32> {
        let inside = self.finite(x, name)?.clamp(0.0, max);
        if inside != x {
            self.warnings.push(format!("{}: {name} is {x}; {inside} is used", self.place));
        }
        Ok(inside)
    }

    fn unit(&mut self, x: f32, name: &str) -> Result<f32> {
        self.range(x, 1.0, name)
    }

    fn units<const N: usize>(&mut self, mut x: [f32; N], name: &str) -> Result<[f32; N]> {
        for value in &mut x {
            *value = self.unit(*value, name)?;
        }
        Ok(x)
    }

    fn color(&mut self, c: [f32; 3], max: f32, name: &str) -> Result<Rgb> {
        let [r, g, b] = c;
        Ok(Rgb::new(self.range(r, max, name)?, self.range(g, max, name)?, self.range(b, max, name)?))
    }

    fn texture(&mut self, info: Texture, usage: Use, name: &str) -> Result<Option<TextureRef>> {
        let Some(info) = info else { return Ok(None) };
        let place = format!("{}, {name}", self.place);
        self.textures.reference(self.document, &info, usage, &place, self.warnings).map(Some)
    }

    /// Reads KHR_materials_pbrSpecularGlossiness as a dielectric with the specular colour as reflectance at normal
    /// incidence. The legacy index 0 of KHR_materials_ior expresses this, because it makes the Fresnel factor 1.
    /// A texture of normals, and the scale of their slopes.
    fn normal_map(&mut self, info: Texture, name: &str) -> Result<Option<(TextureRef, f32)>> {
        let Some(info) = info else { return Ok(None) };
        let scale = self.finite(info.scale, &format!("{name}.scale"))?;
        Ok(self.texture(Some(info), Use::Data, name)?.map(|texture| (texture, scale)))
    }

    fn specular_glossiness(&mut self, material: &mut Material) -> Result<()> {
        const NAME: &str = "KHR_materials_pbrSpecularGlossiness";
        let Some(old) = self.extension::<SpecularGlossiness>(NAME)? else { return Ok(()) };
        self.warnings.push(format!("{}: {NAME} is translated, so highlights differ a little", self.place));
        material.base_color = self.units(old.diffuse_factor, "diffuseFactor")?;
        material.base_color_texture = self.texture(old.diffuse_texture, Use::Color, "diffuseTexture")?;
        material.metallic = 0.0.into();
        material.roughness.texture = None;
        material.ior = f32::INFINITY;
        material.specular_color.factor = self.color(old.specular_factor, 1.0, "specularFactor")?;
        let glossiness = self.unit(old.glossiness_factor, "glossinessFactor")?;
        material.roughness.factor = 1.0 - glossiness;
        if let Some(info) = old.specular_glossiness_texture {
            let name = "specularGlossinessTexture";
            material.specular_color.texture = self.texture(Some(info.clone()), Use::Color, name)?;
            material.roughness.factor = 1.0;
            let usage = Use::Glossiness(glossiness.to_bits());
            material.roughness.texture = self.texture(Some(info), usage, name)?;
        }
        Ok(())
    }

    fn surface(&mut self, material: &mut Material) -> Result<()> {
        if let Some(e) = self.extension::<EmissiveStrength>("KHR_materials_emissive_strength")? {
            material.emission *= self.range(e.emissive_strength, f32::MAX, "emissiveStrength")?;
            if !material.emission.is_finite() {
                return Err(fault(self.place, "its emission is not finite"));
            }
        }
        material.unlit = self.extension::<Value>("KHR_materials_unlit")?.is_some();
        if let Some(e) = self.extension::<Ior>("KHR_materials_ior")? {
            material.ior = match self.finite(e.ior, "ior")? {
                0.0 => f32::INFINITY,
                ior if ior < 1.0 => {
                    self.warnings.push(format!("{}: an index of refraction of {ior} is raised to 1", self.place));
                    1.0
                }
                ior => ior,
            };
        }
        if let Some(e) = self.extension::<Specular>("KHR_materials_specular")? {
            material.specular.factor = self.unit(e.specular_factor, "specularFactor")?;
            material.specular.texture = self.texture(e.specular_texture, Use::Data, "specularTexture")?;
            material.specular_color.factor = self.color(e.specular_color_factor, f32::MAX, "specularColorFactor")?;
            material.specular_color.texture =
                self.texture(e.specular_color_texture, Use::Color, "specularColorTexture")?;
        }
        if let Some(e) = self.extension::<Dispersion>("KHR_materials_dispersion")? {
            material.dispersion = self.range(e.dispersion, f32::MAX, "dispersion")?;
        }
        Ok(())
    }

    fn diffuse_transmission(&mut self, material: &mut Material) -> Result<()> {
        const NAME: &str = "KHR_materials_diffuse_transmission";
        let Some(e) = self.extension::<DiffuseTransmission>(NAME)? else { return Ok(()) };
        material.diffuse_transmission.factor = self.unit(e.diffuse_transmission_factor, "diffuseTransmissionFactor")?;
        material.diffuse_transmission.texture =
            self.texture(e.diffuse_transmission_texture, Use::Data, "diffuseTransmissionTexture")?;
        material.diffuse_transmission_color.factor =
            self.color(e.diffuse_transmission_color_factor, 1.0, "diffuseTransmissionColorFactor")?;
        material.diffuse_transmission_color.texture =
            self.texture(e.diffuse_transmission_color_texture, Use::Color, "diffuseTransmissionColorTexture")?;
        Ok(())
    }

    fn thin_film(&mut self, material: &mut Material) -> Result<()> {
        let Some(e) = self.extension::<Iridescence>("KHR_materials_iridescence")? else { return Ok(()) };
        material.iridescence.factor = self.unit(e.iridescence_factor, "iridescenceFactor")?;
        material.iridescence.texture = self.texture(e.iridescence_texture, Use::Data, "iridescenceTexture")?;
        material.iridescence_ior = self.finite(e.iridescence_ior, "iridescenceIor")?;
        if material.iridescence_ior < 1.0 {
            self.warnings.push(format!("{}: an iridescenceIor of {} is raised to 1", self.place, e.iridescence_ior));
            material.iridescence_ior = 1.0;
        }
        material.iridescence_thickness.factor = [
            self.range(e.iridescence_thickness_minimum, f32::MAX, "iridescenceThicknessMinimum")?,
            self.range(e.iridescence_thickness_maximum, f32::MAX, "iridescenceThicknessMaximum")?,
        ];
        material.iridescence_thickness.texture =
            self.texture(e.iridescence_thickness_texture, Use::Data, "iridescenceThicknessTexture")?;
        Ok(())
    }

    fn coatings(&mut self, material: &mut Material) -> Result<()> {
        if let Some(e) = self.extension::<Clearcoat>("KHR_materials_clearcoat")? {
            material.clearcoat.factor = self.unit(e.clearcoat_factor, "clearcoatFactor")?;
            material.clearcoat.texture = self.texture(e.clearcoat_texture, Use::Data, "clearcoatTexture")?;
            material.clearcoat_roughness.factor =
                self.unit(e.clearcoat_roughness_factor, "clearcoatRoughnessFactor")?;
            material.clearcoat_roughness.texture =
                self.texture(e.clearcoat_roughness_texture, Use::Data, "clearcoatRoughnessTexture")?;
            material.clearcoat_normal_texture =
                self.normal_map(e.clearcoat_normal_texture, "clearcoatNormalTexture")?;
        }
        if let Some(e) = self.extension::<Sheen>("KHR_materials_sheen")? {
            material.sheen_color.factor = self.color(e.sheen_color_factor, 1.0, "sheenColorFactor")?;
            material.sheen_color.texture = self.texture(e.sheen_color_texture, Use::Color, "sheenColorTexture")?;
            material.sheen_roughness.factor = self.unit(e.sheen_roughness_factor, "sheenRoughnessFactor")?;
            material.sheen_roughness.texture =
                self.texture(e.sheen_roughness_texture, Use::Data, "sheenRoughnessTexture")?;
        }
        if let Some(e) = self.extension::<Anisotropy>("KHR_materials_anisotropy")? {
            material.anisotropy = self.unit(e.anisotropy_strength, "anisotropyStrength")?;
            material.anisotropy_rotation = self.finite(e.anisotropy_rotation, "anisotropyRotation")?;
            material.anisotropy_texture = self.texture(e.anisotropy_texture, Use::Data, "anisotropyTexture")?;
        }
        Ok(())
    }

    /// Reads transmission and the medium of a solid. Returns whether the file declares meshes of the material solid
    /// (`Some(true)`) or thin (`Some(false)`), or neither.
    fn transmission(&mut self, material: &mut Material) -> Result<Option<bool>> {
        if let Some(e) = self.extension::<Transmission>("KHR_materials_transmission")? {
            material.transmission.factor = self.unit(e.transmission_factor, "transmissionFactor")?;
            material.transmission.texture = self.texture(e.transmission_texture, Use::Data, "transmissionTexture")?;
        }
        let mut solid = None;
        if let Some(e) = self.extension::<Volume>("KHR_materials_volume")? {
            let thick = self.range(e.thickness_factor, f32::MAX, "thicknessFactor")? > 0.0;
            solid = Some(thick);
            if thick {
                material.medium = self.absorption(e.attenuation_distance, e.attenuation_color)?;
                self.scattering(&mut material.medium)?;
            }
        }
        extras::check_keys(self.raw, &[extras::MATERIAL], self.place, self.warnings);
        let own: MaterialExtras = extras::read(self.raw, self.place)?;
        material.priority = own.priority;
        material.optical_contact = own.contact == Some(extras::Contact::Optical);
        material.null_bsdf = own.null_bsdf && material.transmission.factor == 0.0;
        if own.null_bsdf && !material.null_bsdf {
            self.warnings.push(format!("{}: its null_bsdf is ignored: it transmits light by itself", self.place));
        }
        self.own_layers(material, &own)?;
        if let Some(degrees) = own.spread_deg {
            if !(0.0..=180.0).contains(&degrees) {
                let cause = format!("extras.caustique.spread_deg must lie between 0 and 180, it is {degrees}");
                return Err(fault(self.place, cause));
            }
            material.spread = (0.5 * degrees).to_radians();
        }
        if let Some(medium) = own.medium {
            material.medium = Some(medium.parameters(self.place)?);
            material.grids = self.grids(&medium)?;
            solid = Some(true);
        }
        if !material.transmits() && material.medium.is_some_and(|m| m != MediumParameters::default()) {
            self.warnings.push(format!("{}: its medium is ignored: no light is transmitted", self.place));
            (material.medium, material.grids) = (None, None);
        }
        Ok(solid)
    }

    /// Reads the keys of diffuse reflection, facets, coat and sheen that glTF lacks.
    fn own_layers(&mut self, material: &mut Material, own: &MaterialExtras) -> Result<()> {
        // With a texture, the factor is 1 unless the file has one, as for glTF's own factors.
        let rough = own.diffuse_roughness.unwrap_or(f32::from(u8::from(own.diffuse_roughness_texture.is_some())));
        material.diffuse_roughness.factor = self.unit(rough, "extras.caustique.diffuse_roughness")?;
        material.diffuse_roughness.texture =
            self.texture(own.diffuse_roughness_texture.clone(), Use::Data, "diffuse_roughness_texture")?;
        if let Some(ior) = own.coat_ior {
            material.clearcoat_ior.factor = self.finite(ior, "extras.caustique.coat_ior")?.max(1.0);
            if ior < 1.0 {
                self.warnings.push(format!("{}: its coat_ior of {ior} is raised to 1", self.place));
            }
        }
        material.clearcoat_ior.texture = self.texture(own.coat_ior_texture.clone(), Use::Data, "coat_ior_texture")?;
        material.clearcoat_color.texture =
            self.texture(own.coat_color_texture.clone(), Use::Color, "coat_color_texture")?;
        if let Some(color) = own.coat_color {
            material.clearcoat_color.factor = self.color(color, 1.0, "extras.caustique.coat_color")?;
            material.tint_emission();
        }
        if let Some(color) = own.reflection_color {
            material.reflection_color = self.color(color, 1.0, "extras.caustique.reflection_color")?;
        }
        material.single_scattering = own.single_scattering;
        material.sheen_model = match own.sheen_model {
            extras::Sheen::Charlie => SheenModel::Charlie,
            extras::Sheen::Fibers => SheenModel::Fibers,
        };
        Ok(())
    }

    /// Reads the grids of a heterogeneous medium; `None` for a homogeneous one.
    fn grids(&mut self, medium: &extras::Medium) -> Result<Option<Arc<MediumGrids>>> {
        let Some(density) = &medium.density else {
            return match medium.emission {
                Some(_) => Err(fault(self.place, "medium.emission needs medium.density")
                    .hint("give the density of the medium as a grid, too")),
                None => Ok(None),
            };
        };
        let grid = self.grid(&density.file, "medium.density")?;
        let density =
            DensityGrid::new(grid).ok_or_else(|| fault(self.place, "medium.density must be a grid of one channel"))?;
        let emission = match &medium.emission {
            Some(emission) => {
                let color = self.color(emission.color, f32::MAX, "medium.emission.color")?;
                EmissionGrid::new(self.grid(&emission.file, "medium.emission")?, color)
            }
            None => None,
        };
        Ok(Some(Arc::new(MediumGrids { density, emission })))
    }

    /// Reads the grid that `key` of the extras names.
    fn grid(&mut self, file: &str, key: &str) -> Result<Grid> {
        let file = uri::require_path(file).and_then(|file| self.document.folder.file(file.as_ref()));
        let file = file.map_err(|e| e.within(format!("{}, {key}", self.place)))?;
        grid_file::read(&file, self.warnings)
    }

    /// Divides the extinction of a medium into absorption and scattering (KHR_materials_volume_scatter).
    fn scattering(&mut self, medium: &mut Option<MediumParameters>) -> Result<()> {
        let Some(e) = self.extension::<VolumeScatter>("KHR_materials_volume_scatter")? else { return Ok(()) };
        let color = e.multiscatter_color_factor.unwrap_or(e.multiscatter_color);
        let mut color = self.color(color, 1.0, "multiscatterColor")?;
        if let Some(texture) = self.texture(e.multiscatter_color_texture, Use::Color, "multiscatterColorTexture")? {
            // A medium is homogeneous: docs/scene-format.md explains why.
            color *= self.textures.list[texture.texture as usize].mean().truncate().clamp(Rgb::ZERO, Rgb::ONE);
            self.warnings.push(format!(
                "{}: the mean of its multiscatterColorTexture is taken; a diffuseTransmissionColorTexture varies the \
                 colour of the light that leaves",
                self.place
            ));
        }
        let g = self.finite(e.scatter_anisotropy, "scatterAnisotropy")?;
        if !(g > -1.0 && g < 1.0) {
            return Err(fault(self.place, format!("scatterAnisotropy must lie between -1 and 1, it is {g}")));
        }
        if let Some(medium) = medium {
            let (sigma_t, albedo) = (medium.sigma_a, color.map(|color| single_scattering_albedo(color, g)));
            *medium = MediumParameters { sigma_a: sigma_t * (Rgb::ONE - albedo), sigma_s: sigma_t * albedo, g };
        }
        Ok(())
    }

    /// The absorbing medium with sigma_a = -ln(c) / d, which transmits the colour c over the distance d in metres
    /// (KHR_materials_volume).
    fn absorption(&mut self, distance: f32, color: [f32; 3]) -> Result<Option<MediumParameters>> {
        /// Minimum share of light that a channel transmits, which keeps sigma_a finite.
        const MIN_COLOR: f32 = 1e-6;
        let c = self.color(color, 1.0, "attenuationColor")?;
        if c == Rgb::ONE || distance == f32::INFINITY {
            return Ok(None);
        }
        if distance.is_nan() || distance <= 0.0 {
            self.warnings
                .push(format!("{}: attenuationDistance {distance} is not positive: nothing is absorbed", self.place));
            return Ok(None);
        }
        if c.min_element() < MIN_COLOR {
            self.warnings
                .push(format!("{}: attenuationColor is raised to {MIN_COLOR}, absorption is finite", self.place));
        }
        let sigma_a = -c.max(Rgb::splat(MIN_COLOR)).map(f32::ln) / distance;
        if !sigma_a.is_finite() {
            return Err(fault(self.place, "its absorption is not finite"));
        }
        Ok(Some(MediumParameters { sigma_a, ..MediumParameters::default() }))
    }
}

/// Single-scattering albedo of a medium of anisotropy `g` that as a half-space without a boundary reflects the share
/// `color` of diffuse light \[KHR_materials_volume_scatter, from Kulla and Conty 2017; van de Hulst's similarity for
/// anisotropic media\].
fn single_scattering_albedo(color: f32, g: f32) -> f32 {
    let s = 4.09712 + 4.20863 * color - (9.59217 + 41.6808 * color + 17.7126 * color * color).sqrt();
    let s2 = s.clamp(0.0, 1.0).powi(2);
    (1.0 - s2) / (1.0 - g * s2)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The albedo gives back the colour by van de Hulst's formula for a half-space.
    #[test]
    fn albedos_of_media_invert_their_colours() {
        for g in [-0.5f32, 0.0, 0.8] {
            for albedo in [0.0f32, 0.2, 0.7, 0.95, 0.999, 1.0] {
                let s = ((1.0 - albedo) / (1.0 - g * albedo)).sqrt();
                let color = (1.0 - s) * (1.0 - 0.139 * s) / (1.0 + 1.17 * s);
                let found = single_scattering_albedo(color, g);
                assert!((found - albedo).abs() < 4e-3, "g {g}: {found} is not {albedo}");
            }
        }
    }
}
