//! How the materials of a scene scatter: what of it can be made before the first path.

use super::{Material, Materials};
use crate::bsdf::{Bsdf, Coverings, EnergyTables, Interface};
use crate::geometry::Surface;
use crate::math::{Rgb, Vec2, Vec3, Vec4};
use bumpalo::Bump;

/// Energy compensation tables, and the interfaces of all materials whose interface no texture changes.
pub struct Scattering {
    tables: EnergyTables,
    /// By material: relative indices of refraction, and the interface there.
    interfaces: Vec<Vec<(f32, Interface)>>,
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
        let tables = EnergyTables::for_materials(materials);
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
        };
        let of_material = |material: &Material| {
            if material.unlit || !material.has_plain_interface() {
                return Vec::new();
            }
            let at = |n: &f32| {
                let eta = material.ior / n;
                (eta, Interface::new(&material.parameters(&surface, &[], eta), &tables))
            };
            around.iter().map(at).collect()
        };
        let interfaces = materials.iter().map(of_material).collect();
        Scattering { tables, interfaces }
    }

    /// The BSDF at a surface; `eta` is the index of refraction behind the surface (its back) over the one before it. An interface that
    /// textures change is made in `arena`.
    #[inline(always)]
    pub fn bsdf<'a>(&'a self, materials: &Materials, surface: &Surface, eta: f32, arena: &'a Bump) -> Bsdf<'a> {
        let (material, textures) = (&materials.list[surface.material as usize], &materials.textures);
        if material.unlit {
            return Bsdf::Matte(Rgb::ZERO);
        }
        let (base, metallic, transmission) = material.base_and_shares(surface, textures);
        let made = self.interfaces[surface.material as usize].iter().find(|(e, _)| *e == eta);
        let interface = match made {
            Some((_, interface)) => interface,
            None => arena.alloc_with(|| Interface::new(&material.parameters(surface, textures, eta), &self.tables)),
        };
        Bsdf::of(base, metallic, transmission, interface)
    }
}
