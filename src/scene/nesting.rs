//! Stacks of nested solids that are deeper than the array that a path carries.
//!
//! A stack is its last solid and the index of the stack of those entered before. Equal stacks are stored once \[hash
//! consing, Ershov 1958\], so a path carries one index for a stack of any depth. The index depends on the order of the
//! threads, the stack does not. Few scenes have such deep stacks, so the lock does not matter.

use crate::geometry::{Mesh, Shapes};
use crate::material::Materials;
use std::collections::{BTreeMap, HashMap};
use std::sync::{PoisonError, RwLock};

/// Index of the empty stack of solids.
pub const EMPTY_STACK: u32 = u32::MAX;

/// Maximum number of stacks of solids that a scene stores. More of them come from open meshes, which paths enter and
/// never leave.
const MAX_STACKS: usize = 1 << 20;

/// A stack of the nested solids that a path is in. Each solid is identified by the instance whose surface was crossed
/// to enter it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SolidStack {
    /// Index of the stack of solids entered before the last one, or [`EMPTY_STACK`].
    pub outer: u32,
    /// Index of the instance of the solid that was entered last.
    pub last: u32,
    /// Index of the instance of the solid that fills the space, among the solids of the stack.
    pub host: u32,
}

/// Rank of the solid that each instance belongs to. Where two solids of equal priority overlap, the one of higher rank
/// fills the space, in any order of entry. Smaller solids have higher ranks, because a small solid may be inside a
/// large one. All instances of an object are one solid.
pub fn ranks(shapes: &Shapes, materials: &Materials) -> Vec<u32> {
    let mut of_mesh = HashMap::new();
    let mut volumes = BTreeMap::<u32, f64>::new();
    for instance in shapes.instances.iter().filter(|i| materials.list[i.material as usize].is_solid()) {
        let own = of_mesh.entry(instance.mesh).or_insert_with(|| volume(&shapes.meshes[instance.mesh as usize]));
        let scale = instance.to_world.as_ref().map_or(1.0, |placement| placement.points.matrix3.determinant());
        *volumes.entry(instance.object).or_default() += *own * f64::from(scale.abs());
    }
    let mut order: Vec<(f64, u32)> = volumes.into_iter().map(|(object, volume)| (volume.abs(), object)).collect();
    order.sort_by(|a, b| b.0.total_cmp(&a.0));
    let rank: HashMap<u32, u32> = (0..).zip(order).map(|(rank, (_, object))| (object, rank)).collect();
    shapes.instances.iter().map(|instance| rank.get(&instance.object).copied().unwrap_or(0)).collect()
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

/// The deep stacks of nested solids that paths in a scene have entered so far.
#[derive(Default)]
pub struct SolidStacks {
    stacks: RwLock<Stacks>,
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
