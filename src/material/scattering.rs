//! How the materials of a scene scatter: what of it can be made before the first path.

use super::evaluate::unit_color;
use super::{Material, Materials};
use crate::bsdf::{Bsdf, EnergyTables, Interface, Parameters, Shading};
use crate::geometry::Surface;
use crate::math::{Frame, Rgb, Vec2, Vec3, Vec4};
use bumpalo::Bump;
use std::sync::{Arc, OnceLock};

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
    /// Base colour before vertex colours, share of metal, share of the dielectric that transmits; `None` where textures
    /// say.
    shares: Option<(Vec4, f32, f32)>,
    /// The interface with the open space and its relative index of refraction; none where textures change it.
    open: Option<(f32, Interface<'static>)>,
    /// The same with the solids around, by falling index: made when a path first meets it, for few pairs of materials
    /// ever do.
    nested: Vec<(f32, OnceLock<Box<Interface<'static>>>)>,
}

impl Ready {
    /// The interface of relative index `eta`, made by `make` where it is asked for the first time; none where it is not
    /// to be kept.
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

/// The interface of a material whose textures do not change it: the same wherever it is made.
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

fn distinct(indices: impl Iterator<Item = f32>) -> Vec<f32> {
    let mut indices: Vec<f32> = indices.collect();
    indices.sort_by(f32::total_cmp);
    indices.dedup();
    indices
}

/// Indices of refraction of the solids that may surround surfaces.
fn solids(materials: &[Material]) -> Vec<f32> {
    distinct(materials.iter().filter(|m| m.is_solid_glass() && m.ior.is_finite()).map(|m| m.ior))
}

impl EnergyTables {
    /// Tables for all interfaces that surfaces of these materials make with the open space, and with each other's solids.
    pub fn for_materials(materials: &[Material]) -> EnergyTables {
        let (open, around) = (distinct(materials.iter().map(|m| m.ior)), solids(materials));
        let nested = open.iter().flat_map(|ior| around.iter().map(move |n| ior / n));
        EnergyTables::new(open.iter().copied().chain(nested))
    }
}

impl Scattering {
    /// For a scene with these materials.
    pub fn new(materials: &[Material]) -> Scattering {
        Scattering::with(Arc::new(EnergyTables::for_materials(materials)), materials)
    }

    /// For the scene with other materials, which have no indices of refraction that the first ones lack: the tables are
    /// shared.
    pub fn for_materials(&self, materials: &[Material]) -> Scattering {
        Scattering::with(Arc::clone(&self.tables), materials)
    }

    fn with(tables: Arc<EnergyTables>, materials: &[Material]) -> Scattering {
        let around = solids(materials);
        let ready = |material: &Material| {
            let plain = !material.unlit && material.has_plain_interface();
            let open = || (material.ior, plain_interface(material, material.ior, &tables));
            let nested = around.iter().filter(|_| plain).map(|n| (material.ior / n, OnceLock::new()));
            Ready {
                unlit: material.unlit,
                plain_frame: material.has_plain_frame(),
                shares: material.plain_shares(),
                open: plain.then(open),
                nested: nested.collect(),
            }
        };
        let of_materials = materials.iter().map(ready).collect();
        Scattering { tables, of_materials }
    }

    /// Scattering at a surface seen along the unit direction `wo`; `eta` is the index of refraction behind the surface
    /// (its back) over the one before it. An interface that textures change is made in `arena`.
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
        let bsdf = self.bsdf(ready, materials, surface, eta, arena);
        if ready.plain_frame {
            return Shading::new(Frame::from_normal(surface.ns), surface.ng, bsdf, wo);
        }
        Shading::new(materials.shading_frame(surface), surface.ng, bsdf, wo).mapped(surface.ns)
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
        let plain = || plain_interface(&materials.list[surface.material as usize], eta, &self.tables);
        let interface = match ready.interface(eta, plain) {
            Some(interface) => interface,
            None => Interface::new_in(&materials.parameters(surface, eta), &self.tables, arena),
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
