//! Solids inside each other, deeper than a path keeps them with it.
//!
//! A stack is its last solid and the stack of those entered before, each kept once \[hash consing, Ershov 1958\]: a
//! path needs one number for any of them. What number depends on the threads, what it stands for does not. Few scenes
//! have such stacks, so that a lock is no cost.

use std::collections::HashMap;
use std::sync::{PoisonError, RwLock};

/// The empty stack.
pub const OPEN: u32 = u32::MAX;

/// More stacks are taken for those of open meshes, which are entered and never left.
const MOST: usize = 1 << 20;

/// A stack of solids, each told by the instance through whose surface it was entered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stack {
    /// Those entered before the last: a stack, or [`OPEN`].
    pub outer: u32,
    /// The last.
    pub last: u32,
    /// The one of them that fills the space.
    pub host: u32,
}

/// The stacks that have been met in a scene.
#[derive(Default)]
pub struct Nestings {
    stacks: RwLock<Stacks>,
}

#[derive(Default)]
struct Stacks {
    list: Vec<Stack>,
    index: HashMap<(u32, u32), u32>,
}

impl Nestings {
    /// A stack that is not [`OPEN`].
    #[cold]
    #[inline(never)]
    pub fn get(&self, stack: u32) -> Stack {
        self.stacks.read().unwrap_or_else(PoisonError::into_inner).list[stack as usize]
    }

    /// `stack.outer` with one more. `None` where there are too many.
    #[cold]
    #[inline(never)]
    pub fn push(&self, stack: Stack) -> Option<u32> {
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
