//! What one frame leaves for the others: a structure of arrays, one row of pixels after the other.
//!
//! A row holds its columns one after the other, each padded on both sides, so that a block of
//! pixels is a few short runs of memory and eight neighbours load at once: the layout decides
//! whether borrowing pays (docs/method.md). What the columns mean is the estimator's affair.

/// Pixels of padding on each side of a row: half the largest block, and a vector beyond it.
pub const PADDING: usize = 16;

/// Columns of floats for each pixel of a frame.
pub struct RecordBuffer {
    columns: usize,
    stride: usize,
    data: Vec<f32>,
}

impl RecordBuffer {
    /// Zeros for `width` x `height` pixels.
    pub fn new(columns: usize, width: usize, height: usize) -> Self {
        let stride = width + 2 * PADDING;
        Self {
            columns,
            stride,
            data: vec![0.0; columns * stride * height],
        }
    }

    /// The rows, from the lowest.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = Row<'_>> {
        let rows = self.data.chunks_exact(self.columns * self.stride);
        rows.map(|data| Row {
            data,
            stride: self.stride,
        })
    }

    /// The row number `y`.
    pub fn row(&self, y: usize) -> Row<'_> {
        let length = self.columns * self.stride;
        Row {
            data: &self.data[y * length..(y + 1) * length],
            stride: self.stride,
        }
    }

    /// Floats of one row, for parallel writers; hand each chunk to [`RowMut::new`].
    pub fn row_length(&self) -> usize {
        self.columns * self.stride
    }

    /// All rows as one run of floats.
    pub fn data_mut(&mut self) -> &mut [f32] {
        &mut self.data
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        self.data.len() * size_of::<f32>()
    }
}

/// A row to read.
#[derive(Clone, Copy)]
pub struct Row<'a> {
    data: &'a [f32],
    stride: usize,
}

impl<'a> Row<'a> {
    /// `N` neighbouring values of a column, starting at pixel `x`, which may lie in the padding;
    /// `None` beyond it.
    #[inline(always)]
    pub fn lanes<const N: usize>(&self, column: usize, x: i64) -> Option<&'a [f32; N]> {
        let start = column * self.stride + (x + PADDING as i64) as usize;
        self.data.get(start..)?.first_chunk::<N>()
    }

    /// One value.
    #[inline(always)]
    pub fn get(&self, column: usize, x: usize) -> f32 {
        self.data[column * self.stride + PADDING + x]
    }
}

/// A row to write.
pub struct RowMut<'a> {
    data: &'a mut [f32],
    stride: usize,
}

impl<'a> RowMut<'a> {
    /// The row in a chunk of [`RecordBuffer::data_mut`] for a frame `width` pixels wide.
    pub fn new(data: &'a mut [f32], width: usize) -> Self {
        Self {
            data,
            stride: width + 2 * PADDING,
        }
    }

    /// Sets one value.
    #[inline(always)]
    pub fn set(&mut self, column: usize, x: usize, value: f32) {
        self.data[column * self.stride + PADDING + x] = value;
    }
}
