//! What a walk through a tree has yet to visit.

use super::node::WIDTH;
use std::mem::MaybeUninit;

/// Where a ray enters a child: the bits of the parameter, which sort as it does, but for the last
/// three, which are the child's slot. So a key is never too large. What the ray enters before its
/// origin counts as entered there.
pub type Key = i32;

/// The bits of a key that are the slot.
pub const SLOT: Key = WIDTH as Key - 1;

/// The key of what a ray enters at `t`.
#[inline(always)]
pub fn key(t: f32, slot: usize) -> Key {
    t.max(0.0).to_bits() as Key & !SLOT | slot as Key
}

/// Room for the children of a node above the top of a stack.
pub struct Room<'a> {
    pub keys: &'a mut [MaybeUninit<Key>; WIDTH],
    pub children: &'a mut [MaybeUninit<u32>; WIDTH],
}

/// A stack that is not cleared before use, which would take a tenth of a ray's time.
pub struct Stack {
    len: usize,
    keys: [MaybeUninit<Key>; SIZE],
    children: [MaybeUninit<u32>; SIZE],
    /// What lies below all that, first in, where that is full.
    below: Vec<(Key, u32)>,
}

/// Enough for usual trees; only very uneven ones need more.
const SIZE: usize = 192;

impl Stack {
    /// A stack of one.
    #[inline(always)]
    pub fn new(child: u32) -> Self {
        let mut stack = Self {
            len: 1,
            keys: [const { MaybeUninit::uninit() }; SIZE],
            children: [const { MaybeUninit::uninit() }; SIZE],
            below: Vec::new(),
        };
        stack.keys[0].write(0);
        stack.children[0].write(child);
        stack
    }

    /// The entry on top, which is taken away.
    #[inline(always)]
    pub fn pop(&mut self) -> Option<(Key, u32)> {
        let Some(top) = self.len.checked_sub(1) else {
            return self.below.pop();
        };
        self.len = top;
        Some(self.get(top))
    }

    #[inline(always)]
    fn get(&self, index: usize) -> (Key, u32) {
        let (key, child) = (&self.keys[index], &self.children[index]);
        // SAFETY: only entries below `len` are asked for, or the first one, and these have been
        // written, by `new` or, as `grow` asks, before it.
        unsafe { (key.assume_init(), child.assume_init()) }
    }

    /// The child on top; one that was there before if there is none.
    #[inline(always)]
    pub fn top(&self) -> u32 {
        // Without a branch: whether it is empty nobody can predict.
        self.get(self.len.saturating_sub(1)).1
    }

    /// The room above the top.
    #[inline(always)]
    pub fn room(&mut self) -> Room<'_> {
        if self.len > SIZE - WIDTH {
            self.make_room();
        }
        // It does not get further; so the compiler knows.
        let start = self.len.min(SIZE - WIDTH);
        let (keys, children) = (&mut self.keys[start..], &mut self.children[start..]);
        match (keys.first_chunk_mut(), children.first_chunk_mut()) {
            (Some(keys), Some(children)) => Room { keys, children },
            _ => unreachable!("eight are left"),
        }
    }

    /// Pushes the first entries of the room.
    ///
    /// # Safety
    /// They have been written, since `room` was called and nothing was popped.
    #[inline(always)]
    pub unsafe fn grow(&mut self, count: usize) {
        self.len += count;
    }

    #[cold]
    fn make_room(&mut self) {
        let all = (0..self.len).map(|index| self.get(index));
        let all: Vec<_> = all.collect();
        self.below.extend(all);
        self.len = 0;
    }
}
