//! How the materials of a scene scatter: what of it can be made before the first path.

use super::evaluate::unit_color;
use super::{Material, Materials};
use crate::bsdf::{Bsdf, Coverings, EnergyTables, Interface, Parameters, Shading};
use crate::geometry::Surface;
use crate::math::{Frame, Rgb, Vec2, Vec3, Vec4};
use bumpalo::Bump;
use std::sync::Arc;

/// Energy compensation tables, and what of all materials no texture changes.
pub struct Scattering {
    tables: Arc<EnergyTables>,
    of_materials: Vec<Ready>,
}

/// A material as it is at every surface, on its own in memory: a [`Material`] is ten times as large.
struct Ready {
    unlit: bool,
    /// It has neither a normal map nor a direction.
    plain_frame: bool,
    /// Base colour before vertex colours, share of metal, share of the dielectric that transmits; `None` where textures say.
    shares: Option<(Vec4, f32, f32)>,
    /// Relative indices of refraction, and the interface there; none where textures change it.
    interfaces: Vec<(f32, Interface)>,
}

/// Indices of refraction that surround surfaces: the open space's and the solids'.
fn around(materials: &[Material]) -> Vec<f32> {
    let index = |m: &Material| if m.ior.is_finite() { m.ior } else { 1.0 };
    let mut around: Vec<f32> = materials.iter().filter(|m| m.is_solid_glass()).map(index).chain([1.0]).collect();
    around.sort_by(f32::total_cmp);
    around.dedup();
    around
}

impl EnergyTables {
    /// Tables for all interfaces that surfaces of these materials make with the open space and with each other's solids.
    pub fn for_materials(materials: &[Material]) -> EnergyTables {
        let around = around(materials);
        let etas = materials.iter().flat_map(|m| around.iter().map(|n| m.ior / n));
        let coverings = Coverings {
            coat: materials.iter().any(|m| m.clearcoat > 0.0),
            sheen: materials.iter().any(|m| m.sheen_color.max_element() > 0.0),
        };
        EnergyTables::new(etas, coverings)
    }
}

impl Scattering {
    /// For a scene with these materials.
    pub fn new(materials: &[Material]) -> Scattering {
        Scattering::with(Arc::new(EnergyTables::for_materials(materials)), materials)
    }

    /// For the scene with other materials, which have no indices of refraction and no coverings that the first ones lack: the tables, which take
    /// a thirtieth of a core-second for each pair of indices, are shared.
    pub fn again(&self, materials: &[Material]) -> Scattering {
        Scattering::with(Arc::clone(&self.tables), materials)
    }

    fn with(tables: Arc<EnergyTables>, materials: &[Material]) -> Scattering {
        let around = around(materials);
        // Anywhere: no texture is looked at.
        let surface = Surface {
            p: Vec3::ZERO,
            ng: Vec3::Z,
            ns: Vec3::Z,
            tangent: Vec4::ZERO,
            uv: [Vec2::ZERO; 2],
            color: Vec4::ONE,
            instance: 0,
            primitive: 0,
            material: 0,
            touching: false,
        };
        let interfaces = |material: &Material| {
            if material.unlit || !material.has_plain_interface() {
                return Vec::new();
            }
            let at = |n: &f32| {
                let eta = material.ior / n;
                (eta, Interface::new(&material.parameters(&surface, &[], eta), &tables))
            };
            around.iter().map(at).collect()
        };
        let ready = |material: &Material| Ready {
            unlit: material.unlit,
            plain_frame: material.has_plain_frame(),
            shares: material.plain_shares(),
            interfaces: interfaces(material),
        };
        let of_materials = materials.iter().map(ready).collect();
        Scattering { tables, of_materials }
    }

    /// Scattering at a surface seen along the unit direction `wo`; `eta` is the index of refraction behind the surface (its back) over the one before it. An
    /// interface that textures change is made in `arena`.
    #[inline(always)]
    pub fn shading<'a>(
        &'a self,
        materials: &Materials,
        surface: &Surface,
        eta: f32,
        wo: Vec3,
        arena: &'a Bump,
    ) -> Shading<'a> {
        let ready = &self.of_materials[surface.material as usize];
        let frame = if ready.plain_frame { Frame::from_normal(surface.ns) } else { materials.shading_frame(surface) };
        Shading::new(frame, surface.ng, self.bsdf(ready, materials, surface, eta, arena), wo)
    }

    #[inline(always)]
    fn bsdf<'a>(
        &'a self,
        ready: &'a Ready,
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
        let made = ready.interfaces.iter().find(|(e, _)| *e == eta);
        let interface = match made {
            Some((_, interface)) => interface,
            None => arena.alloc_with(|| Interface::new(&materials.parameters(surface, eta), &self.tables)),
        };
        Bsdf::of(base, metallic, transmission, interface)
    }
}

/// What textures say, out of the way of what needs none.
impl Materials {
    #[inline(never)]
    fn shading_frame(&self, surface: &Surface) -> Frame {
        self.list[surface.material as usize].shading_frame(surface, &self.textures)
    }

    #[inline(never)]
    fn base_and_shares(&self, surface: &Surface) -> (Rgb, f32, f32) {
        self.list[surface.material as usize].base_and_shares(surface, &self.textures)
    }

    fn parameters(&self, surface: &Surface, eta: f32) -> Parameters {
        self.list[surface.material as usize].parameters(surface, &self.textures, eta)
    }
}
