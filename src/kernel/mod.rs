//! The ray kernel: which triangle does a ray meet first, and does it meet any.
//!
//! It knows triangles and boxes, nothing of scenes. obvhs builds binary trees; here they become
//! 8-wide trees in single precision whose boxes are tested all at once (Wald, Benthin and Boulos,
//! "Getting rid of packets", RT 2008), with leaves of up to four triangles side by side.
//!
//! # What it promises
//! - **Watertight.** The triangle test is that of Woop, Benthin and Wald (JCGT 2(1), 2013): a ray
//!   cannot slip through an edge or vertex that triangles share, from either side. The box test
//!   is padded by more than the rounding error of both tests, so that no box hides a hit.
//! - **Exact.** Hence a result does not depend on the tree: it has the bits of a loop over all
//!   triangles. Of hits at the same `t` the smallest triangle index counts.
//! - **The same bits everywhere.** The triangle test multiplies and adds without fusing, on every
//!   instruction set. Fusing would also break the promise above: the edge function of a shared
//!   edge would no longer be the exact negative of its neighbour's.
//!
//! # Departures from Woop et al.
//! - Both sides count, hence no winding swap; `t` is divided before it is compared.
//! - The error bound is one padding per axis and ray, in place of two shifted origins: see
//!   [`slabs`].

#[cfg(target_arch = "x86_64")]
mod avx2;
mod collapse;
mod instances;
mod node;
pub mod pages;
mod parts;
mod shear;
mod simd;
mod slabs;
mod stack;
mod subtree;
mod triangles;
pub mod vector;
mod wide;

#[cfg(test)]
mod tests;

pub use instances::InstanceBvh;
pub use triangles::{Positions, TriangleBvh, TriangleHit};
