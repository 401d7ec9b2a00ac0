//! Shadow catchers: what is not seen itself, but lets shadows fall on what the picture is laid over.
//!
//! As in Cycles a catcher shows the light that it gets among all things over that which it would get
//! alone. Where the film is transparent what is missing of it covers the picture in black; elsewhere it
//! dims the background.

use glam::Vec3A;

/// Sums over the camera rays that met a catcher, and the background behind all of them.
#[derive(Debug, Clone, Copy, Default)]
pub struct CatcherSums {
    among_all: [f32; 3],
    alone: [f32; 3],
    background: [f32; 3],
}

/// What one camera ray found on a catcher.
#[derive(Debug, Clone, Copy)]
pub struct Caught {
    /// Radiance of the catcher among all things.
    pub among_all: Vec3A,
    /// Radiance of the catcher without any but other catchers.
    pub alone: Vec3A,
}

fn add(sum: &mut [f32; 3], term: Vec3A) {
    *sum = (Vec3A::from(*sum) + term).into();
}

impl CatcherSums {
    /// Adds what a camera ray found, and the background that it saw.
    pub fn add(&mut self, caught: Option<Caught>, background: Vec3A) {
        add(&mut self.background, background);
        let finite = |c: &Caught| c.among_all.is_finite() && c.alone.is_finite();
        if let Some(caught) = caught.filter(finite) {
            add(&mut self.among_all, caught.among_all);
            add(&mut self.alone, caught.alone);
        }
    }

    /// Share of the light that is left; one without a catcher.
    pub fn left(&self) -> Vec3A {
        let (among_all, alone) = (Vec3A::from(self.among_all), Vec3A::from(self.alone));
        let lit = alone.cmpgt(Vec3A::ZERO);
        if !lit.any() {
            return Vec3A::ONE;
        }
        // A channel without any light says nothing: it is taken for the others.
        let left = Vec3A::select(lit, among_all / alone, Vec3A::ZERO);
        let count = lit.bitmask().count_ones() as f32;
        Vec3A::select(lit, left, Vec3A::splat(left.element_sum() / count))
    }

    /// A pixel without its catchers, with their shadows; `mean` is one over the number of samples.
    pub fn shaded(&self, [r, g, b, alpha]: [f32; 4], mean: f32) -> [f32; 4] {
        // A grey shadow, laid over the background with the rest.
        let shadow = (1.0 - self.left().element_sum() / 3.0).max(0.0);
        let hidden = shadow * mean * Vec3A::from(self.background);
        let [r, g, b] = (Vec3A::new(r, g, b) - hidden).to_array();
        [r, g, b, alpha + (1.0 - alpha) * shadow]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sums(among_all: Vec3A, alone: Vec3A, background: f32) -> CatcherSums {
        let mut sums = CatcherSums::default();
        for _ in 0..4 {
            sums.add(Some(Caught { among_all, alone }), Vec3A::splat(background));
        }
        sums
    }

    #[test]
    fn a_shadow_covers_a_transparent_film_and_dims_a_background() {
        let half = sums(Vec3A::splat(0.2), Vec3A::splat(0.4), 0.0);
        assert_eq!(half.shaded([0.0; 4], 0.25), [0.0, 0.0, 0.0, 0.5]);
        let red = sums(Vec3A::new(0.5, 0.25, 0.0), Vec3A::splat(0.5), 2.0);
        assert_eq!(red.shaded([2.0, 2.0, 2.0, 1.0], 0.25), [1.0, 1.0, 1.0, 1.0]);
    }

    #[test]
    fn without_light_or_catcher_there_is_no_shadow() {
        let pixel = [0.5, 0.25, 1.0, 0.75];
        assert_eq!(CatcherSums::default().shaded(pixel, 1.0), pixel);
        let dark = sums(Vec3A::ZERO, Vec3A::ZERO, 1.0);
        assert_eq!(dark.shaded(pixel, 0.25), pixel);
        let blue = sums(Vec3A::Z, 2.0 * Vec3A::Z, 0.0);
        assert_eq!(blue.shaded([0.0; 4], 0.25)[3], 0.5);
    }

    #[test]
    fn light_that_is_no_number_is_left_out() {
        let mut half = sums(Vec3A::splat(0.2), Vec3A::splat(0.4), 0.0);
        for (among_all, alone) in [(f32::NAN, 1.0), (1.0, f32::INFINITY)] {
            let (among_all, alone) = (Vec3A::splat(among_all), Vec3A::splat(alone));
            half.add(Some(Caught { among_all, alone }), Vec3A::ZERO);
        }
        assert_eq!(half.shaded([0.0; 4], 0.25)[3], 0.5);
    }
}
