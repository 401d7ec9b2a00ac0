//! Which records a frame still reads: what no frame reads any more needs no samples that lend.

use rayon::prelude::*;

use super::borrow::Borrow;
use super::tiles::{TILE, Tiles};
use super::veto::Lending;

/// The tiles of other frames whose records a frame reads, and of its own.
#[derive(Default)]
pub struct Reads {
    /// For each lender, a position in the window; empty as long as all may be read.
    of_frame: Vec<(usize, Tiles<bool>)>,
}

impl Reads {
    /// What pixels read that borrow so.
    pub fn of(borrow: &Borrow, lending: &[Lending]) -> Self {
        let lenders = borrow.sharing.lenders.iter().enumerate();
        let of_frame = lenders.map(|(lender, &frame)| (frame, read_from(borrow, lender, lending)));
        Self {
            of_frame: of_frame.collect(),
        }
    }

    /// The tiles of a frame that are read; `None` for all.
    pub fn tiles(&self, frame: usize) -> Option<&Tiles<bool>> {
        let mut frames = self.of_frame.iter();
        frames.find(|of| of.0 == frame).map(|of| &of.1)
    }

    /// Whether all records of the square are read that begins in column `x` of row `y` of a frame.
    /// Others may read them too, or not: a picture must not depend on that.
    pub fn includes(&self, frame: usize, x: i64, y: i64, side: i64) -> bool {
        let tiles = self.tiles(frame);
        tiles.is_none_or(|tiles| tiles.under(x, y, side).all(|tile| tiles.get(tile)))
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        let frames = self.of_frame.iter();
        frames.map(|(_, tiles)| size_of_val(tiles.values())).sum()
    }
}

/// The tiles of a lender in which blocks lie. A pixel of the frame itself always looks in the same
/// place; in other frames it depends on the point that the camera ray found, and blocks of other
/// points may lie a tile away.
fn read_from(borrow: &Borrow, lender: usize, lending: &[Lending]) -> Tiles<bool> {
    let region = borrow.sharing.view().region;
    let is_own = borrow.sharing.lenders[lender] == borrow.sharing.target;
    let (least, margin) = match is_own {
        true => (Lending::Frame, 0),
        false => (Lending::Window, TILE as i64),
    };
    let half = borrow.half_block as i64;
    let side = 2 * half + 1;
    let corner = |x: usize, y: usize| match is_own {
        // Another camera ray may find a surface where this one found none.
        true => Some((x as i64 - half, y as i64 - half)),
        false => {
            let place = borrow.place(&borrow.block(x, y)?, lender, x, y)?;
            Some((place.x, place.y))
        }
    };
    let row = |y: usize| {
        let mut tiles = Tiles::<bool>::new(region);
        let borrows = |x: &usize| lending[y * region.width + x] >= least;
        for x in (0..region.width).filter(borrows) {
            if let Some((x, y)) = corner(x, y) {
                let under = tiles.under(x - margin, y - margin, side + 2 * margin);
                under.for_each(|tile| *tiles.get_mut(tile) = true);
            }
        }
        tiles
    };
    (0..region.height)
        .into_par_iter()
        .map(row)
        .reduce(|| Tiles::new(region), |one, other| either(one, &other))
}

/// The tiles that either has.
pub fn either(mut one: Tiles<bool>, other: &Tiles<bool>) -> Tiles<bool> {
    let tiles = other.values().iter().enumerate();
    tiles
        .filter(|(_, is_read)| **is_read)
        .for_each(|(tile, _)| *one.get_mut(tile) = true);
    one
}
