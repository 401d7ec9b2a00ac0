//! Runs plain loops over arrays with the widest vectors that the machine has.

/// Work whose loops the compiler can turn into vector instructions. Mark `run` `#[inline(always)]`,
/// and what it calls in its loops too: code that is not inlined keeps the narrow baseline.
pub trait Vectorised {
    /// What the work yields.
    type Output;
    /// Does the work.
    fn run(self) -> Self::Output;
}

/// Runs `work` compiled for AVX2 where the machine has it. Rust never fuses a product and a sum by
/// itself, so the result has the same bits either way.
pub fn vectorised<W: Vectorised>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the feature was just seen to be there.
        return unsafe { run_avx2(work) };
    }
    work.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2<W: Vectorised>(work: W) -> W::Output {
    work.run()
}
