//! Solids inside each other, deeper than a path keeps them with it.
//!
//! A stack is its last solid and the stack of those entered before, each kept once \[hash consing, Ershov 1958\]: a
//! path needs one number for any of them. What number depends on the threads, what it stands for does not. Few scenes
//! have such stacks, so that a lock is no cost.

use crate::geometry::{Mesh, Shapes};
use crate::material::Materials;
use std::collections::{BTreeMap, HashMap};
use std::sync::{PoisonError, RwLock};

/// The empty stack.
pub const EMPTY_STACK: u32 = u32::MAX;

/// More stacks are taken for those of open meshes, which are entered and never left.
const MOST: usize = 1 << 20;

/// A stack of solids, each told by the instance through whose surface it was entered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SolidStack {
    /// Those entered before the last: a stack, or [`EMPTY_STACK`].
    pub outer: u32,
    /// The last.
    pub last: u32,
    /// The one of them that fills the space.
    pub host: u32,
}

/// Ranks of the instances' solids: of two that overlap and have the same priority the one of higher rank fills the space,
/// whichever was entered first. It is the smaller one, which may lie within the other but not around it; all instances of
/// an object are one solid.
pub fn ranks(shapes: &Shapes, materials: &Materials) -> Vec<u32> {
    let mut of_mesh = HashMap::new();
    let mut volumes = BTreeMap::<u32, f64>::new();
    for instance in shapes.instances.iter().filter(|i| materials.list[i.material as usize].is_solid_glass()) {
        let own = of_mesh.entry(instance.mesh).or_insert_with(|| volume(&shapes.meshes[instance.mesh as usize]));
        let scale = instance.to_world.as_ref().map_or(1.0, |placement| placement.points.matrix3.determinant());
        *volumes.entry(instance.object).or_default() += *own * f64::from(scale.abs());
    }
    let mut order: Vec<(f64, u32)> = volumes.into_iter().map(|(object, volume)| (volume.abs(), object)).collect();
    order.sort_by(|a, b| b.0.total_cmp(&a.0));
    let rank: HashMap<u32, u32> = (0..).zip(order).map(|(rank, (_, object))| (object, rank)).collect();
    shapes.instances.iter().map(|instance| rank.get(&instance.object).copied().unwrap_or(0)).collect()
}

/// Volume within a closed mesh, in its own space.
fn volume(mesh: &Mesh) -> f64 {
    let Some(&[first, ..]) = mesh.triangles.first() else { return 0.0 };
    let origin = mesh.positions[first as usize];
    let of = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|i| (mesh.positions[i as usize] - origin).as_dvec3());
        a.dot(b.cross(c)) / 6.0
    };
    mesh.triangles.iter().map(of).sum()
}

/// The stacks that have been met in a scene.
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
    /// A stack that is not [`EMPTY_STACK`].
    #[cold]
    #[inline(never)]
    pub fn get(&self, stack: u32) -> SolidStack {
        self.stacks.read().unwrap_or_else(PoisonError::into_inner).list[stack as usize]
    }

    /// `stack.outer` with one more. `None` where there are too many.
    #[cold]
    #[inline(never)]
    pub fn push(&self, stack: SolidStack) -> Option<u32> {
        let key = (stack.outer, stack.last);
        if let Some(&known) = self.stacks.read().unwrap_or_else(PoisonError::into_inner).index.get(&key) {
            return Some(known);
        }
        let mut stacks = self.stacks.write().unwrap_or_else(PoisonError::into_inner);
        let Stacks { list, index } = &mut *stacks;
        if list.len() >= MOST {
            return None;
        }
        // Another thread may have been faster.
        Some(*index.entry(key).or_insert_with(|| {
            list.push(stack);
            list.len() as u32 - 1
        }))
    }
}
