//! Rays per second of the kernel beside those of obvhs's own CWBVH traversal and, where it is
//! installed, of Embree, on one thread, and what it takes to fit a tree to a deformed mesh beside
//! building one.
//!
//! `cargo bench --bench accel`. Each pair takes turns within one run, so that the ratios do not
//! depend on how fast the machine is at the moment.

mod embree;

use std::hint::black_box;
use std::time::{Duration, Instant};

use dualcone::kernel::{Positions, TriangleBvh};
use dualcone::math::{Frame, Ray};
use embree::{Embree, Query};
use glam::{Vec3, Vec3A, vec3};
use obvhs::{
    BvhBuildParams,
    cwbvh::{CwBvh, builder::build_cwbvh_from_tris},
    ray::RayHit,
    triangle::Triangle,
};

/// Hills of `2 n^2` triangles with stones of various sizes on and above them.
fn landscape(n: u32, stones: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let height =
        |x: f32, y: f32| 0.6 * (0.9 * x).sin() * (1.3 * y).cos() + 0.05 * (9.0 * x * y).sin();
    let (mut positions, mut triangles) = (vec![], vec![]);
    let mut add_patch = |columns: u32, rows: u32, surface: &dyn Fn(f32, f32) -> Vec3| {
        let first = positions.len() as u32;
        for row in 0..=rows {
            for column in 0..=columns {
                let (u, v) = (column as f32 / columns as f32, row as f32 / rows as f32);
                positions.push(surface(u, v));
            }
        }
        for cell in 0..rows * columns {
            let a = first + cell / columns * (columns + 1) + cell % columns;
            let b = a + columns + 1;
            triangles.extend([[a, a + 1, b + 1], [a, b + 1, b]]);
        }
    };
    add_patch(n, n, &|u, v| {
        let (x, y) = (10.0 * u - 5.0, 10.0 * v - 5.0);
        vec3(x, y, height(x, y))
    });
    for stone in 0..stones {
        let [a, b, c] = [0.618, 0.755, 0.57].map(|step| (step * (stone + 1) as f32).fract());
        let (x, y, radius) = (9.0 * a - 4.5, 9.0 * b - 4.5, 0.05 + 0.4 * c * c * c);
        let centre = vec3(x, y, height(x, y) + radius);
        add_patch(24, 12, &|u, v| {
            let (azimuth, polar) = (u * std::f32::consts::TAU, v * std::f32::consts::PI);
            let bump = 1.0 + 0.15 * (4.0 * polar).sin() * (6.0 * azimuth).cos();
            let (s, c) = polar.sin_cos();
            centre + radius * bump * vec3(s * azimuth.cos(), s * azimuth.sin(), c)
        });
    }
    (positions, triangles)
}

/// Everything that is traced, both ways.
struct Subject {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    corners: Vec<Triangle>,
    kernel: TriangleBvh,
    obvhs: CwBvh,
}

impl Subject {
    fn new(n: u32, stones: u32) -> Self {
        let (positions, triangles) = landscape(n, stones);
        let corners: Vec<_> = triangles
            .iter()
            .map(|t| {
                let [v0, v1, v2] = t.map(|v| Vec3A::from(positions[v as usize]));
                Triangle { v0, v1, v2 }
            })
            .collect();
        let parameters = BvhBuildParams::medium_build();
        let obvhs = build_cwbvh_from_tris(&corners, parameters, &mut Duration::default());
        let in_order = obvhs.primitive_indices.iter().map(|&i| corners[i as usize]);
        Self {
            corners: in_order.collect(),
            kernel: TriangleBvh::build(Positions::still(&positions), &triangles),
            obvhs,
            positions,
            triangles,
        }
    }

    fn closest(&self, rays: &[Ray]) -> f32 {
        let t = |ray| self.kernel.closest_hit(ray).map_or(0.0, |hit| hit.t);
        rays.iter().map(t).sum()
    }

    fn any(&self, rays: &[Ray]) -> usize {
        rays.iter().filter(|ray| self.kernel.occluded(ray)).count()
    }

    /// Builds and fits the tree in turn, for a swell that runs through the hills.
    fn compare_refit(&self) {
        let moved = self.moved();
        let mut best = [Duration::MAX; 2];
        for _ in 0..3 {
            let start = Instant::now();
            black_box(TriangleBvh::build(
                Positions::still(&moved),
                &self.triangles,
            ));
            let middle = Instant::now();
            black_box(
                self.kernel
                    .refitted(Positions::still(&moved), &self.triangles),
            );
            best = [best[0].min(middle - start), best[1].min(middle.elapsed())];
        }
        let [build, refit] = best.map(|time| 1e3 * time.as_secs_f64());
        println!(
            "tree             build {build:.1} ms, refit {refit:.1} ms {:14.3}",
            refit / build
        );
    }

    /// The vertices in a swell that runs through the hills: so gentle that the tree stays a good one
    /// (beyond that `refitted` builds).
    fn moved(&self) -> Vec<Vec3> {
        let swell = |p: &Vec3| *p + 0.02 * Vec3::Z * (2.0 * p.x).sin();
        self.positions.iter().map(swell).collect()
    }

    /// The kernel's rays per second over Embree's by its fastest entry, and its refit.
    fn compare_embree(&self, primary: &[Ray], gather: &[Ray]) -> Option<()> {
        let mut embree = Embree::start(&self.positions, &self.triangles)?;
        println!("                    kernel    Embree  (Mrays/s)   ratio  target");
        let passes = [
            ("primary", primary, Query::Closest, 0.7),
            ("gather closest", gather, Query::Closest, 0.85),
            ("gather any", gather, Query::Any, 0.9),
        ];
        for (pass, rays, query, target) in passes {
            embree.set_rays(rays)?;
            let mut best = [Duration::MAX; 2];
            for _ in 0..7 {
                let start = Instant::now();
                let own = match query {
                    Query::Closest => f64::from(self.closest(rays)),
                    Query::Any => self.any(rays) as f64,
                };
                best[0] = best[0].min(start.elapsed());
                let (time, found) = embree.query(query)?;
                best[1] = best[1].min(time);
                let off = (own - found).abs() / found;
                assert!(
                    off < 1e-3,
                    "{pass}: {own} {found}: other rays, or other hits"
                );
            }
            let [ours, theirs] = best.map(|time| rays.len() as f64 / time.as_secs_f64() / 1e6);
            println!(
                "{pass:16} {ours:9.2} {theirs:9.2} {:20.2} {target:7.2}",
                ours / theirs
            );
        }
        self.compare_embree_refit(&mut embree)
    }

    fn compare_embree_refit(&self, embree: &mut Embree) -> Option<()> {
        let moved = self.moved();
        let mut best = [Duration::MAX; 2];
        for _ in 0..5 {
            let start = Instant::now();
            let positions = Positions::still(&moved);
            black_box(self.kernel.refitted(positions, &self.triangles));
            best[0] = best[0].min(start.elapsed());
            best[1] = best[1].min(embree.refit(&moved)?);
        }
        let [ours, theirs] = best.map(|time| 1e3 * time.as_secs_f64());
        let ratio = theirs / ours;
        println!(
            "refit [ms]       {ours:9.2} {theirs:9.2} {ratio:20.2} {:7.2}",
            1.0
        );
        Some(())
    }

    fn obvhs_closest(&self, rays: &[Ray]) -> f32 {
        let t = |ray| {
            let mut hit = RayHit::none();
            self.obvhs
                .ray_traverse(convert(ray), &mut hit, |r, i| self.corners[i].intersect(r));
            if hit.t < f32::INFINITY { hit.t } else { 0.0 }
        };
        rays.iter().map(t).sum()
    }

    fn obvhs_any(&self, rays: &[Ray]) -> usize {
        let met = |ray: &&Ray| {
            !self
                .obvhs
                .ray_traverse_miss(convert(ray), |r, i| self.corners[i].intersect(r))
        };
        rays.iter().filter(met).count()
    }
}

fn convert(ray: &Ray) -> obvhs::ray::Ray {
    obvhs::ray::Ray::new(ray.origin, ray.direction, ray.t_min, ray.t_max)
}

/// Rays of a pinhole camera that looks down at the hills, row by row.
fn primary_rays(side: u32) -> Vec<Ray> {
    let origin = Vec3A::new(0.0, -9.0, 5.0);
    let frame = Frame::from_normal(-origin.normalize());
    (0..side * side)
        .map(|i| {
            let [x, y] = [i % side, i / side].map(|i| (i as f32 + 0.5) / side as f32 - 0.5);
            let direction = frame.to_world(Vec3A::new(x, y, 1.0));
            Ray::new(origin, direction.normalize())
        })
        .collect()
}

/// From each point that `rays` hit, one ray into the hemisphere, cosine weighted.
fn gather_rays(bvh: &TriangleBvh, rays: &[Ray], triangles: &[Triangle], ids: &[u32]) -> Vec<Ray> {
    let mut place = vec![0; ids.len()];
    (0..ids.len()).for_each(|i| place[ids[i] as usize] = i);
    let gather = |(i, ray): (usize, &Ray)| {
        let hit = bvh.closest_hit(ray)?;
        let triangle = &triangles[place[hit.triangle as usize]];
        let normal = triangle.compute_normal();
        let normal = normal * -normal.dot(ray.direction).signum();
        let [a, b] = [0.754_877_7, 0.569_840_3].map(|step| (i as f64 * step).fract() as f32);
        let (s, c) = (std::f32::consts::TAU * a).sin_cos();
        let direction = Vec3A::new(b.sqrt() * c, b.sqrt() * s, (1.0 - b).sqrt());
        Some(Ray {
            t_min: 1e-4,
            ..Ray::new(
                ray.at(hit.t),
                Frame::from_normal(normal).to_world(direction),
            )
        })
    };
    rays.iter().enumerate().filter_map(gather).collect()
}

fn main() {
    for (name, n, stones) in [("hills 54k", 110, 50), ("hills 1M", 650, 300)] {
        let subject = Subject::new(n, stones);
        let primary = primary_rays(256);
        let ids = &subject.obvhs.primitive_indices;
        let gather = gather_rays(&subject.kernel, &primary, &subject.corners, ids);
        println!("\n{name:16}    kernel     obvhs  (Mrays/s)   ratio");
        let row = |pass: &str, [ours, theirs]: [f64; 2]| {
            println!("{pass:16} {ours:9.2} {theirs:9.2} {:20.2}", ours / theirs);
        };
        let closest =
            |rays: &[Ray]| compare(rays, |r| subject.closest(r), |r| subject.obvhs_closest(r));
        row("primary", closest(&primary));
        row("gather closest", closest(&gather));
        let any = compare(&gather, |r| subject.any(r), |r| subject.obvhs_any(r));
        row("gather any", any);
        subject.compare_refit();
        subject.compare_embree(&primary, &gather);
    }
}

/// Mrays/s of two passes over the same rays that take turns, each at its best.
fn compare<T, U>(
    rays: &[Ray],
    ours: impl Fn(&[Ray]) -> T,
    theirs: impl Fn(&[Ray]) -> U,
) -> [f64; 2] {
    let mut best = [Duration::MAX; 2];
    for _ in 0..7 {
        let start = Instant::now();
        black_box(ours(rays));
        let middle = Instant::now();
        black_box(theirs(rays));
        best = [best[0].min(middle - start), best[1].min(middle.elapsed())];
    }
    best.map(|time| rays.len() as f64 / time.as_secs_f64() / 1e6)
}
