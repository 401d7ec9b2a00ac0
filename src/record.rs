//! What one frame leaves for the others: a structure of arrays, one row of pixels after the other.
//!
//! A row holds its columns one after the other, each padded on both sides, so that a block of
//! pixels is a few short runs of memory and eight neighbours load at once: the layout decides
//! whether borrowing pays (docs/method.md). What the columns mean is the estimator's affair.

use rayon::prelude::*;

/// Pixels of padding on each side of a row: half the largest block, and a vector beyond it.
pub const PADDING: usize = 16;

/// Columns of numbers for each pixel of a frame.
pub struct RecordBuffer<T = f32> {
    columns: usize,
    stride: usize,
    data: Vec<T>,
}

impl<T: Copy + Default + Send + Sync> RecordBuffer<T> {
    /// Zeros for `width` x `height` pixels.
    pub fn new(columns: usize, width: usize, height: usize) -> Self {
        let stride = width + 2 * PADDING;
        Self {
            columns,
            stride,
            data: vec![T::default(); columns * stride * height],
        }
    }

    /// The row number `y`.
    pub fn row(&self, y: usize) -> Row<'_, T> {
        let length = self.columns * self.stride;
        Row {
            data: &self.data[y * length..(y + 1) * length],
            stride: self.stride,
        }
    }

    /// The rows, from the lowest, for writers that work at the same time.
    pub fn rows_mut(&mut self) -> impl IndexedParallelIterator<Item = RowMut<'_, T>> {
        let stride = self.stride;
        let rows = self.data.par_chunks_exact_mut(self.columns * stride);
        rows.map(move |data| RowMut { data, stride })
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&self.data[..])
    }
}

/// A row to read.
#[derive(Clone, Copy)]
pub struct Row<'a, T = f32> {
    data: &'a [T],
    stride: usize,
}

impl<'a, T: Copy> Row<'a, T> {
    /// `N` neighbouring values of a column, starting at pixel `x`, which may lie in the padding;
    /// `None` beyond it.
    #[inline(always)]
    pub fn lanes<const N: usize>(&self, column: usize, x: i64) -> Option<&'a [T; N]> {
        let start = column * self.stride + (x + PADDING as i64) as usize;
        self.data.get(start..)?.first_chunk::<N>()
    }

    /// One value.
    #[inline(always)]
    pub fn get(&self, column: usize, x: usize) -> T {
        self.data[column * self.stride + PADDING + x]
    }
}

/// A row to write.
pub struct RowMut<'a, T = f32> {
    data: &'a mut [T],
    stride: usize,
}

impl<T> RowMut<'_, T> {
    /// Sets one value.
    #[inline(always)]
    pub fn set(&mut self, column: usize, x: usize, value: T) {
        self.data[column * self.stride + PADDING + x] = value;
    }
}
