//! Evaluates materials at a surface point: factors times textures, as the glTF specification defines.

use super::Material;
use crate::bsdf::{Parameters, mean_path};
use crate::geometry::Surface;
use crate::math::{Frame, Rgb, Vec2, Vec3, Vec4, sqr};
use crate::texture::{Texture, TextureRef};

/// Looks up a texture at a surface point. White if there is no texture, or if its index is past the list.
#[inline]
pub(super) fn look_up(texture: &Option<TextureRef>, surface: &Surface, textures: &[Texture]) -> Vec4 {
    let Some(reference) = texture else { return Vec4::ONE };
    match textures.get(reference.texture as usize) {
        Some(texture) => texture.sample(reference.coordinates(surface.uv)),
        None => Vec4::ONE,
    }
}

/// Clamps a number to `[0, 1]`; NaN becomes 0.
#[inline]
pub(super) fn unit(x: f32) -> f32 {
    if x > 0.0 { x.min(1.0) } else { 0.0 }
}

/// Clamps every channel of a colour to `[0, 1]`; NaN becomes 0.
#[inline]
pub(super) fn unit_color(c: Rgb) -> Rgb {
    Rgb::new(unit(c.x), unit(c.y), unit(c.z))
}

impl Material {
    /// Base colour and alpha: the product of factor, texture and vertex colour.
    #[inline]
    fn base(&self, surface: &Surface, textures: &[Texture]) -> Vec4 {
        Vec4::from_array(self.base_color) * surface.color * look_up(&self.base_color_texture, surface, textures)
    }

    /// The parameters of the scattering model that are not part of the interface: base colour, metalness, and
    /// transmission (share of the dielectric that transmits), all in `[0, 1]`.
    #[inline]
    pub fn base_and_shares(&self, surface: &Surface, textures: &[Texture]) -> (Rgb, f32, f32) {
        let base = unit_color(self.base(surface, textures).truncate());
        (base, self.metallic.at(surface, textures), self.transmission.at(surface, textures))
    }

    /// [`Material::base_and_shares`] of a material without textures for them, with a base colour that is neither
    /// multiplied by the vertex colour nor clamped. `None` if there are such textures.
    pub(super) fn untextured_shares(&self) -> Option<(Vec4, f32, f32)> {
        let (metallic, transmission) = (unit(self.metallic.factor), unit(self.transmission.factor));
        let textured = self.base_color_texture.is_some()
            || (metallic > 0.0 && self.metallic.texture.is_some())
            || (transmission > 0.0 && self.transmission.texture.is_some());
        (!textured).then_some((Vec4::from_array(self.base_color), metallic, transmission))
    }

    /// Whether shading frames depend only on the interpolated normal: there is neither a normal map nor anisotropy.
    pub(super) fn has_plain_frame(&self) -> bool {
        self.normal_texture.is_none() && self.clearcoat_normal_texture.is_none() && self.anisotropy == 0.0
    }

    /// Normal of the clear coat: the interpolated normal, or the one of the coat's own map, which the mesh must have
    /// tangents for.
    pub fn coat_normal(&self, surface: &Surface, textures: &[Texture]) -> Vec3 {
        let map = self.clearcoat_normal_texture.as_ref().filter(|_| self.clearcoat.factor > 0.0);
        map.and_then(|map| mapped_normal(map, surface, textures)).unwrap_or(surface.ns)
    }

    /// The parameters of the scattering model at a surface point. `eta` is the index of refraction behind the surface
    /// over the index in front of it.
    #[inline]
    pub fn parameters(&self, surface: &Surface, textures: &[Texture], eta: f32) -> Parameters {
        if self.unlit {
            return Parameters { base_color: Rgb::ZERO, ..Parameters::default() };
        }
        let (base_color, metallic, transmission) = self.base_and_shares(surface, textures);
        let mut p = Parameters {
            base_color,
            diffuse_roughness: self.diffuse_roughness.at(surface, textures),
            metallic,
            eta,
            transmission,
            thin: self.thin,
            specular: self.specular.at(surface, textures),
            specular_color: self.specular_color.factor.max(Rgb::ZERO),
            reflection_color: self.reflection_color,
            single_scattering: self.single_scattering,
            ..Parameters::default()
        };
        let alpha = sqr(self.roughness.at(surface, textures));
        (p.alpha_x, p.alpha_y) = (alpha, alpha);
        if self.anisotropy != 0.0 {
            // KHR_materials_anisotropy: alpha along the direction is a mix of alpha and 1.
            let texel = look_up(&self.anisotropy_texture, surface, textures);
            p.alpha_x = alpha + (1.0 - alpha) * sqr(unit(self.anisotropy * texel.z));
        }
        if self.specular_color.texture.is_some() {
            p.specular_color *= self.specular_color.texel(surface, textures).truncate().max(Rgb::ZERO);
        }
        if self.diffuse_transmission.factor > 0.0 {
            p.diffuse_transmission = self.diffuse_transmission.at(surface, textures);
            p.diffuse_transmission_color = self.diffuse_transmission_color.at(surface, textures);
        }
        if self.iridescence.factor > 0.0 {
            self.thin_film(&mut p, surface, textures);
        }
        if self.clearcoat.factor > 0.0 {
            p.clearcoat = self.coat(surface, textures);
            p.clearcoat_alpha = sqr(self.clearcoat_roughness.at(surface, textures));
            p.clearcoat_eta = self.coat_ior(surface, textures);
            p.clearcoat_color = self.clearcoat_color.at(surface, textures);
        }
        if self.sheen_color.factor.max_element() > 0.0 {
            p.sheen_color = self.sheen_color.at(surface, textures);
            p.sheen_alpha = sqr(self.sheen_roughness.at(surface, textures));
            p.sheen_model = self.sheen_model;
        }
        p
    }

    /// Sets the thin film in the parameters of the scattering model, whose relative index is set.
    fn thin_film(&self, p: &mut Parameters, surface: &Surface, textures: &[Texture]) {
        p.film = self.iridescence.at(surface, textures);
        let around = if self.ior.is_finite() { self.ior / p.eta } else { 1.0 };
        p.film_eta = self.iridescence_ior / around;
        let [thin, thick] = self.iridescence_thickness.factor;
        let share = unit(self.iridescence_thickness.texel(surface, textures).y);
        p.film_path = 2.0 * self.iridescence_ior * (thin + (thick - thin) * share).max(0.0);
    }

    /// The shading frame. Its z axis is the interpolated or mapped normal, which stays on the side of the geometric
    /// normal. Its x axis is the direction of anisotropy. If the mesh has no tangents, a normal map is ignored.
    #[inline]
    pub fn shading_frame(&self, surface: &Surface, textures: &[Texture]) -> Frame {
        if self.has_plain_frame() {
            return Frame::from_normal(surface.ns);
        }
        let tangent = surface.tangent.truncate();
        let mut frame = Frame::from_normal_tangent(surface.ns, tangent);
        if let Some(n) = self.normal_texture.as_ref().and_then(|map| mapped_normal(map, surface, textures)) {
            frame = Frame::from_normal_tangent(n, tangent);
        }
        if self.anisotropy != 0.0 {
            let texel = look_up(&self.anisotropy_texture, surface, textures);
            let read = match self.anisotropy_texture {
                Some(_) => Vec2::new(texel.x, texel.y) * 2.0 - Vec2::ONE,
                None => Vec2::X,
            };
            let direction = Vec2::from_angle(self.anisotropy_rotation).rotate(read);
            let along = frame.t * direction.x + frame.b * (direction.y * handedness(surface));
            frame = Frame::from_normal_tangent(frame.n, along);
        }
        frame
    }

    /// Alpha (opacity) at a surface point: the product of the alphas of base colour, texture and vertex colour.
    #[inline]
    pub fn alpha(&self, surface: &Surface, textures: &[Texture]) -> f32 {
        self.base_color[3] * surface.color.w * look_up(&self.base_color_texture, surface, textures).w
    }

    /// Strength of the clear coat at a surface point, 0 to 1.
    #[inline]
    pub fn coat(&self, surface: &Surface, textures: &[Texture]) -> f32 {
        self.clearcoat.at(surface, textures)
    }

    /// Index of refraction of the clear coat at a surface point, at least 1.
    #[inline]
    pub fn coat_ior(&self, surface: &Surface, textures: &[Texture]) -> f32 {
        match self.clearcoat_ior.texture {
            None => self.clearcoat_ior.factor,
            Some(_) => 1.0 + (self.clearcoat_ior.factor - 1.0) * unit(self.clearcoat_ior.texel(surface, textures).x),
        }
    }

    /// Whether textures change the tint that the clear coat gives to the emission below it, which the emission itself
    /// does not include then.
    pub fn has_textured_tint(&self) -> bool {
        let textured = self.clearcoat.texture.is_some() || self.clearcoat_ior.texture.is_some();
        let by_share = textured && self.clearcoat_color.factor != Rgb::ONE;
        self.clearcoat.factor > 0.0 && (self.clearcoat_color.texture.is_some() || by_share)
    }

    /// Whether the radiance that surfaces emit varies with textures.
    pub fn has_textured_emission(&self) -> bool {
        self.unlit || self.emission_texture.is_some() || self.has_textured_tint()
    }

    /// The share of emitted light that passes a clear coat of this strength, index and colour once. It does not depend
    /// on the direction, because light is taken along its mean path in the coat.
    fn coat_tint(coat: f32, ior: f32, color: Rgb) -> Rgb {
        let path = 0.5 * mean_path(ior);
        color.map(|c| 1.0 + (c.powf(path) - 1.0) * coat)
    }

    /// Lets the coat's colour tint the emission, unless textures change the tint, which [`Material::emitted`] then
    /// applies at each point.
    pub fn tint_emission(&mut self) {
        if !self.has_textured_tint() {
            self.emission *=
                Material::coat_tint(self.clearcoat.factor, self.clearcoat_ior.factor, self.clearcoat_color.factor);
        }
    }

    /// Emitted radiance (W/sr/m2), before the clear coat attenuates it. Unlit materials emit their base colour.
    #[inline]
    pub fn emitted(&self, surface: &Surface, textures: &[Texture]) -> Rgb {
        if self.unlit {
            return self.base(surface, textures).truncate();
        }
        if !self.has_textured_emission() {
            return self.emission;
        }
        let emitted = self.emission * look_up(&self.emission_texture, surface, textures).truncate();
        if !self.has_textured_tint() {
            return emitted;
        }
        let (ior, color) = (self.coat_ior(surface, textures), self.clearcoat_color.at(surface, textures));
        emitted * Material::coat_tint(self.coat(surface, textures), ior, color)
    }
}

/// Handedness of the tangent space: -1 on mirrored texture coordinates, else 1.
#[inline]
fn handedness(surface: &Surface) -> f32 {
    if surface.tangent.w < 0.0 { -1.0 } else { 1.0 }
}

/// The normal of a normal map, given with the scale of its slopes, on the side of the geometric normal. `None` if the
/// mesh has no tangents.
#[inline]
fn mapped_normal((texture, scale): &(TextureRef, f32), surface: &Surface, textures: &[Texture]) -> Option<Vec3> {
    let tangent = surface.tangent.truncate();
    if tangent == Vec3::ZERO {
        return None;
    }
    let texel = look_up(&Some(*texture), surface, textures).truncate() * 2.0 - Vec3::ONE;
    let local = Vec3::new(texel.x * scale, texel.y * scale * handedness(surface), texel.z);
    let n = Frame::from_normal_tangent(surface.ns, tangent).to_world(local).try_normalize()?;
    Some(move_to_side_of(n, surface.ng))
}

/// Moves the mapped normal `n` to the side of the geometric normal `ng`, if it is not there.
#[inline]
fn move_to_side_of(n: Vec3, ng: Vec3) -> Vec3 {
    /// Smallest cosine between a mapped normal and the geometric one.
    const MIN_COSINE: f32 = 0.05;
    let cos = n.dot(ng);
    if cos >= MIN_COSINE { n } else { (n + ng * (MIN_COSINE - cos)).normalize() }
}
