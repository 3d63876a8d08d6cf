//! The scattering of all materials of a scene, prepared as far as possible before the first path.

use super::evaluate::unit_color;
use super::{Material, Materials};
use crate::bsdf::{Bsdf, EnergyTables, Interface, Parameters, Shading};
use crate::geometry::Surface;
use crate::math::{Frame, Rgb, Vec2, Vec3, Vec4};
use bumpalo::Bump;
use std::sync::{Arc, OnceLock};

/// The scattering of a scene's materials: energy compensation tables, and the parts of the materials that do not depend
/// on textures.
pub struct Scattering {
    tables: Arc<EnergyTables>,
    materials: Vec<PreparedMaterial>,
}

/// The part of a material that is the same at all surface points. Stored apart from [`Material`], which is ten times as
/// large.
struct PreparedMaterial {
    unlit: bool,
    /// Whether the material has neither normal maps nor anisotropy.
    plain_frame: bool,
    /// Base colour (without the vertex colour), metalness and transmission; `None` if any of them has a texture.
    shares: Option<(Vec4, f32, f32)>,
    /// Relative index of refraction and interface of the material in empty space; `None` if textures affect the
    /// interface.
    open: Option<(f32, Interface<'static>)>,
    /// Relative index of refraction and interface of the material inside each of the scene's solids, by decreasing
    /// index. Each is created when a path first needs it, because few pairs of materials ever touch.
    nested: Vec<(f32, OnceLock<Box<Interface<'static>>>)>,
}

impl PreparedMaterial {
    /// The cached interface of relative index `eta`, created by `make` at the first call. `None` if interfaces of this
    /// material or index are not cached.
    #[inline(always)]
    fn interface(&self, eta: f32, make: impl FnOnce() -> Interface<'static>) -> Option<&Interface<'static>> {
        match &self.open {
            Some((at, interface)) if *at == eta => Some(interface),
            _ => {
                let (_, made) = &self.nested[self.nested.binary_search_by(|(at, _)| eta.total_cmp(at)).ok()?];
                Some(made.get_or_init(|| Box::new(make())))
            }
        }
    }
}

/// The interface of a material whose textures do not affect it.
fn plain_interface(material: &Material, eta: f32, tables: &EnergyTables) -> Interface<'static> {
    const ANYWHERE: Surface = Surface {
        p: Vec3::ZERO,
        ng: Vec3::Z,
        ns: Vec3::Z,
        tangent: Vec4::ZERO,
        uv: [Vec2::ZERO; 2],
        color: Vec4::ONE,
        instance: 0,
        primitive: 0,
        material: 0,
        error: 0.0,
        touching: false,
    };
    Interface::new(&material.parameters(&ANYWHERE, &[], eta), tables)
}

/// Sorts indices of refraction, and removes duplicates.
fn distinct(indices: impl Iterator<Item = f32>) -> Vec<f32> {
    let mut indices: Vec<f32> = indices.collect();
    indices.sort_by(f32::total_cmp);
    indices.dedup();
    indices
}

/// Indices of refraction of the solids that may surround a surface.
fn solids(materials: &[Material]) -> Vec<f32> {
    distinct(materials.iter().filter(|m| m.is_solid() && m.ior.is_finite()).map(|m| m.ior))
}

/// Indices of refraction of a material's coat whose tables its surfaces use: one, or those of a texture in steps by which
/// the albedo of a coat changes less than the tables' error.
fn coat_indices(material: &Material) -> impl Iterator<Item = f32> {
    /// Largest step of the index, and of steps.
    const STEP: f32 = 0.02;
    const MAX_STEPS: f32 = 200.0;
    let above = material.clearcoat_ior.factor - 1.0;
    let steps = match material.clearcoat_ior.texture {
        Some(_) => (above / STEP).ceil().clamp(1.0, MAX_STEPS),
        None => 1.0,
    };
    (1..=steps as u32).map(move |step| 1.0 + above * (step as f32 / steps))
}

impl EnergyTables {
    /// Energy compensation tables for all interfaces of these materials with empty space and with the solids among
    /// them, and for their clear coats.
    pub fn for_materials(materials: &[Material]) -> EnergyTables {
        let (open, around) = (distinct(materials.iter().map(|m| m.ior)), solids(materials));
        let nested = open.iter().flat_map(|ior| around.iter().map(move |n| ior / n));
        let coats = distinct(materials.iter().filter(|m| m.clearcoat.factor > 0.0).flat_map(coat_indices));
        EnergyTables::new(open.iter().copied().chain(nested).chain(coats))
    }
}

impl Scattering {
    /// The scattering of a scene that has these materials.
    pub fn new(materials: &[Material]) -> Scattering {
        Scattering::with(Arc::new(EnergyTables::for_materials(materials)), materials)
    }

    /// The scattering of this scene with other materials, with the present tables. All indices of refraction of the new
    /// materials must occur among the old ones.
    pub fn for_materials(&self, materials: &[Material]) -> Scattering {
        Scattering::with(Arc::clone(&self.tables), materials)
    }

    fn with(tables: Arc<EnergyTables>, materials: &[Material]) -> Scattering {
        let around = solids(materials);
        let ready = |material: &Material| {
            let plain = !material.unlit && material.has_plain_interface();
            let open = || (material.ior, plain_interface(material, material.ior, &tables));
            let nested = around.iter().filter(|_| plain).map(|n| (material.ior / n, OnceLock::new()));
            PreparedMaterial {
                unlit: material.unlit,
                plain_frame: material.has_plain_frame(),
                shares: material.untextured_shares(),
                open: plain.then(open),
                nested: nested.collect(),
            }
        };
        let materials = materials.iter().map(ready).collect();
        Scattering { tables, materials }
    }

    /// The scattering at a surface point seen along the unit direction `wo`. `eta` is the index of refraction behind
    /// the surface over the index in front of it. If textures affect the interface, it is allocated in `arena`.
    #[inline(always)]
    pub fn shading<'a>(
        &'a self,
        materials: &Materials,
        surface: &Surface,
        eta: f32,
        wo: Vec3,
        arena: &'a Bump,
    ) -> Shading<'a> {
        let ready = &self.materials[surface.material as usize];
        let bsdf = self.bsdf(ready, materials, surface, eta, arena);
        if ready.plain_frame {
            return Shading::new(Frame::from_normal(surface.ns), surface.ng, bsdf, wo);
        }
        let (frame, coat_normal) = materials.shading_frame(surface);
        Shading::new(frame, surface.ng, bsdf, wo).with_normal_map(surface.ns, coat_normal, arena)
    }

    #[inline(always)]
    fn bsdf<'a>(
        &'a self,
        ready: &'a PreparedMaterial,
        materials: &Materials,
        surface: &Surface,
        eta: f32,
        arena: &'a Bump,
    ) -> Bsdf<'a> {
        if ready.unlit {
            return Bsdf::Matte(Rgb::ZERO);
        }
        let (base, metallic, transmission) = match ready.shares {
            Some((base, metallic, transmission)) => {
                (unit_color((base * surface.color).truncate()), metallic, transmission)
            }
            None => materials.base_and_shares(surface),
        };
        let plain = || plain_interface(&materials.list[surface.material as usize], eta, &self.tables);
        let interface = match ready.interface(eta, plain) {
            Some(interface) => interface,
            None => Interface::new_in(&materials.parameters(surface, eta), &self.tables, arena),
        };
        Bsdf::from_shares(base, metallic, transmission, interface)
    }
}

/// Evaluation of materials whose textures matter. Not inlined, so that the code for untextured ones stays small.
impl Materials {
    #[inline(never)]
    fn shading_frame(&self, surface: &Surface) -> (Frame, Vec3) {
        let material = &self.list[surface.material as usize];
        (material.shading_frame(surface, &self.textures), material.coat_normal(surface, &self.textures))
    }

    #[inline(never)]
    fn base_and_shares(&self, surface: &Surface) -> (Rgb, f32, f32) {
        self.list[surface.material as usize].base_and_shares(surface, &self.textures)
    }

    fn parameters(&self, surface: &Surface, eta: f32) -> Parameters {
        self.list[surface.material as usize].parameters(surface, &self.textures, eta)
    }
}
