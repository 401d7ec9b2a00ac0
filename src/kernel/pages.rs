//! Memory in large pages: trees and meshes are read in no order, and where pages are small, looking up which one
//! an address is in takes longer than reading it.

/// An empty vector with room for so many, on large pages where the system gives them.
pub fn with_capacity<T>(capacity: usize) -> Vec<T> {
    let vector = Vec::with_capacity(capacity);
    #[cfg(target_os = "linux")]
    linux::ask_for_large_pages(&vector);
    vector
}

#[cfg(target_os = "linux")]
mod linux {
    use std::ffi::{c_int, c_void};

    unsafe extern "C" {
        fn madvise(address: *mut c_void, length: usize, advice: c_int) -> c_int;
    }

    /// `MADV_HUGEPAGE` of Linux.
    const HUGE_PAGE: c_int = 14;
    /// The usual size of small pages; where they are larger, the system refuses.
    const PAGE: usize = 4096;

    pub fn ask_for_large_pages<T>(vector: &Vec<T>) {
        let start = vector.as_ptr() as usize;
        let end = start + vector.capacity() * size_of::<T>();
        let (start, end) = (start.next_multiple_of(PAGE), end & !(PAGE - 1));
        if start < end {
            // SAFETY: advice about whole pages of the vector's own memory, which keep what they hold.
            // That it may be refused is of no account.
            unsafe { madvise(start as *mut c_void, end - start, HUGE_PAGE) };
        }
    }
}
