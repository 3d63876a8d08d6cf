//! Stacks of nested solids that are deeper than the array that a path carries.
//!
//! A stack is its last solid and the index of the stack of those entered before. Equal stacks are stored once \[hash
//! consing, Ershov 1958\], so a path carries one index for a stack of any depth. The index depends on the order of the
//! threads, the stack does not. Few scenes have such deep stacks, so the lock does not matter.

use crate::geometry::{Instance, Mesh, Shapes};
use crate::material::Objects;
use crate::math::warp;
use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, PoisonError, RwLock};

/// Index of the empty stack of solids.
pub const EMPTY_STACK: u32 = u32::MAX;

/// Bit of an instance's index in a stack of solids: alpha has decided that the solid does not exist for the path.
pub const ABSENT: u32 = 1 << 31;

/// Maximum number of stacks of solids that a scene stores. More of them come from open meshes, which paths enter and
/// never leave.
const MAX_STACKS: usize = 1 << 20;

/// A stack of the nested solids that a path is in. Each solid is identified by the instance whose surface was crossed
/// to enter it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SolidStack {
    /// Index of the stack of solids entered before the last one, or [`EMPTY_STACK`].
    pub outer: u32,
    /// Index of the instance of the solid that was entered last, with the bit [`ABSENT`] if it does not exist.
    pub last: u32,
    /// Index of the instance of the solid that fills the space, among the solids of the stack; `None` if none exists.
    pub host: Option<u32>,
}

/// Relative change of a solid's volume between moments that is taken for rounding, so that solids of equal size keep
/// their order while they turn.
const MAX_ROUNDING: f64 = 1e-5;

/// Volumes of the solids of a scene (m3).
#[derive(Default)]
pub struct Volumes {
    /// By mesh, in its local space.
    of_mesh: HashMap<u32, f64>,
    /// By object, in world space. All instances of an object are one solid.
    of_object: BTreeMap<u32, f64>,
}

impl Volumes {
    /// Measures the solids of a scene.
    pub fn of(objects: Objects<'_>) -> Volumes {
        Volumes::default().measured(objects, |_| false)
    }

    /// Measures the solids at a moment. `self` are their volumes at the frame, whose shapes are `own`.
    pub fn at_moment(&self, own: &Shapes, objects: Objects<'_>) -> Volumes {
        let meshes = &objects.shapes.meshes;
        let is_same = |mesh: usize| own.meshes.get(mesh).is_some_and(|own| Arc::ptr_eq(own, &meshes[mesh]));
        let mut now = self.measured(objects, is_same);
        for (object, volume) in &mut now.of_object {
            let before = self.of_object.get(object).copied().unwrap_or(0.0);
            if (*volume - before).abs() <= MAX_ROUNDING * before.abs() {
                *volume = before;
            }
        }
        now
    }

    /// Measures the solids. Meshes for which `is_known` is true have the volumes that they have in `self`.
    fn measured(&self, objects: Objects<'_>, is_known: impl Fn(usize) -> bool) -> Volumes {
        let mut volumes = Volumes::default();
        for instance in objects.shapes.instances.iter().filter(|instance| objects.material(instance).is_solid()) {
            let known = self.of_mesh.get(&instance.mesh).copied().filter(|_| is_known(instance.mesh as usize));
            let own = *volumes
                .of_mesh
                .entry(instance.mesh)
                .or_insert_with(|| known.unwrap_or_else(|| volume(objects.mesh(instance))));
            let scale = instance.to_world.as_ref().map_or(1.0, |placement| placement.points.matrix3.determinant());
            *volumes.of_object.entry(instance.object).or_default() += own * f64::from(scale.abs());
        }
        volumes
    }

    /// Rank of the solid that each instance belongs to. Where two solids of equal priority overlap, the one of higher
    /// rank fills the space, in any order of entry. Smaller solids have higher ranks, because a small solid may be
    /// inside a large one.
    pub fn ranks(&self, shapes: &Shapes) -> Arc<[u32]> {
        let mut order: Vec<(f64, u32)> =
            self.of_object.iter().map(|(object, volume)| (volume.abs(), *object)).collect();
        order.sort_by(|a, b| b.0.total_cmp(&a.0));
        let rank: HashMap<u32, u32> = (0..).zip(order).map(|(rank, (_, object))| (object, rank)).collect();
        shapes.instances.iter().map(|instance| rank.get(&instance.object).copied().unwrap_or(0)).collect()
    }
}

/// Volume of a closed mesh in its local space (m3).
fn volume(mesh: &Mesh) -> f64 {
    let Some(&[first, ..]) = mesh.triangles.first() else { return 0.0 };
    let origin = mesh.positions[first as usize];
    let of = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|i| (mesh.positions[i as usize] - origin).as_dvec3());
        a.dot(b.cross(c)) / 6.0
    };
    mesh.triangles.iter().map(of).sum()
}

/// A solid that alpha lets exist for a part of the paths through it.
#[derive(Clone, Copy, Debug)]
pub struct AlphaSolid {
    /// Probability that the solid exists for a path.
    pub chance: f32,
    /// Code of the object, 0 to 15. The exclusive or of the codes of the absent solids around a point tells, up to
    /// collisions of codes, which of them are absent: exactly if the scene has at most four objects with such solids, or
    /// if at most two of the first fifteen overlap.
    pub code: u8,
}

/// Codes of the objects of [`AlphaSolid`]s, in turn.
const CODES: [u8; 15] = [1, 2, 4, 8, 15, 3, 5, 6, 9, 10, 12, 7, 11, 13, 14];

/// Number of points of a solid at which its alpha is evaluated, if it varies.
const ALPHA_POINTS: usize = 1024;

/// Smallest probability of a solid with alpha, and of its absence, if both occur. It bounds the weight of connections.
const MIN_CHANCE: f64 = 1e-3;

/// The solids of all instances, with the probability that alpha lets them exist: the mean over the object if it varies.
/// Empty if all solids exist for all paths.
pub fn alpha_solids(objects: Objects<'_>) -> Vec<AlphaSolid> {
    let Objects { shapes, materials } = objects;
    let mut sums = BTreeMap::<u32, (f64, f64)>::new();
    for (index, instance) in shapes.instances.iter().enumerate() {
        let material = objects.material(instance);
        if !material.has_alpha_per_entry() {
            continue;
        }
        let mesh = objects.mesh(instance);
        let varies = material.base_color_texture.is_some() || !mesh.colors.is_empty();
        let triangles = if varies { mesh.triangles.len() } else { mesh.triangles.len().min(1) };
        let points = if varies { (ALPHA_POINTS / triangles.max(1)).max(1) } else { 1 };
        let (sum, area) = sums.entry(instance.object).or_default();
        for primitive in 0..triangles as u32 {
            let [a, b, c] = instance.corners(mesh, primitive);
            let weight = f64::from((b - a).cross(c - a).length()) / points as f64;
            for point in 0..points {
                // Rotations by irrational angles cover the triangle evenly.
                let u = [0.754_877_7, 0.569_840_3].map(|step| (0.5 + step * point as f32).fract());
                let at = warp::triangle_uniform(u.into());
                let Some(surface) = shapes.surface(index as u32, primitive, [at.x, at.y]) else { continue };
                *sum += weight * f64::from(material.coverage(&surface, &materials.textures));
                *area += weight;
            }
        }
    }
    // Paths meet both cases if alpha varies, also where rounding or too few points miss one.
    let inside = |mean: f64| if mean > 0.0 && mean < 1.0 { mean.clamp(MIN_CHANCE, 1.0 - MIN_CHANCE) } else { mean };
    let chance = |(sum, area): (f64, f64)| if area > 0.0 { inside(sum / area) as f32 } else { 1.0 };
    let partial = sums.into_iter().map(|(object, of)| (object, chance(of))).filter(|(_, chance)| *chance < 1.0);
    let codes = CODES.into_iter().cycle();
    let solids: HashMap<u32, AlphaSolid> =
        partial.zip(codes).map(|((object, chance), code)| (object, AlphaSolid { chance, code })).collect();
    if solids.is_empty() {
        return Vec::new();
    }
    let certain = AlphaSolid { chance: 1.0, code: 0 };
    let of = |instance: &Instance| {
        let alpha = objects.material(instance).has_alpha_per_entry();
        solids.get(&instance.object).copied().filter(|_| alpha).unwrap_or(certain)
    };
    shapes.instances.iter().map(of).collect()
}

/// The deep stacks of nested solids that paths in a scene have entered so far.
#[derive(Default)]
pub struct SolidStacks {
    stacks: RwLock<Stacks>,
}

impl Clone for SolidStacks {
    /// No stacks: paths enter them again.
    fn clone(&self) -> SolidStacks {
        SolidStacks::default()
    }
}

#[derive(Default)]
struct Stacks {
    list: Vec<SolidStack>,
    index: HashMap<(u32, u32), u32>,
}

impl SolidStacks {
    /// The stack of solids at an index, which must not be [`EMPTY_STACK`].
    #[cold]
    #[inline(never)]
    pub fn get(&self, stack: u32) -> SolidStack {
        self.stacks.read().unwrap_or_else(PoisonError::into_inner).list[stack as usize]
    }

    /// The index of the stack of solids `stack`, which is added if it is new. `None` if there are too many stacks.
    #[cold]
    #[inline(never)]
    pub fn push(&self, stack: SolidStack) -> Option<u32> {
        let key = (stack.outer, stack.last);
        if let Some(&known) = self.stacks.read().unwrap_or_else(PoisonError::into_inner).index.get(&key) {
            return Some(known);
        }
        let mut stacks = self.stacks.write().unwrap_or_else(PoisonError::into_inner);
        let Stacks { list, index } = &mut *stacks;
        if list.len() >= MAX_STACKS {
            return None;
        }
        // Another thread may have added the stack since the lookup.
        Some(*index.entry(key).or_insert_with(|| {
            list.push(stack);
            list.len() as u32 - 1
        }))
    }
}
