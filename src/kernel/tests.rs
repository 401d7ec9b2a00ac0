//! The kernel against its slow twins: the scalar watertight test over all triangles, bit by bit,
//! and a textbook test in double precision.

use super::{
    InstanceBvh, Positions, TriangleBvh, TriangleHit,
    node::{Boxes, Node, WIDTH},
    parts::UNDIVIDED,
    shear::{Shear, exact_edges},
    simd::{Job, LEAF_TRIANGLES, Lanes, Portable, run_widest},
    slabs::Slabs,
    stack::{Key, SLOT, Stack},
    triangles::{Any, Closest},
};
use crate::math::{Ray, statistics::Random};
use glam::{DVec3, Vec3, Vec3A, vec3};
use obvhs::aabb::Aabb;

/// A mesh by value.
struct Mesh {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

/// In [-1, 1).
fn signed(random: &mut Random) -> f32 {
    2.0 * random.next() - 1.0
}

/// In the cube of half edge 1.
fn point(random: &mut Random) -> Vec3 {
    vec3(signed(random), signed(random), signed(random))
}

/// The twin: the watertight test of Woop et al. 2013, Appendix A, one triangle at a time.
fn meet(shear: &Shear, triangle: u32, corners: [Vec3; 3], t_max: f32) -> Option<TriangleHit> {
    let [a, b, c] = corners.map(|corner| {
        let [x, y, z] = shear.axes.map(|k| corner[k] - shear.origin[k]);
        let [sx, sy, sz] = shear.shear;
        vec3(x - sx * z, y - sy * z, sz * z)
    });
    let mut edges = [
        c.x * b.y - c.y * b.x,
        a.x * c.y - a.y * c.x,
        b.x * a.y - b.y * a.x,
    ];
    if edges.contains(&0.0) {
        edges = exact_edges([a.x, b.x, c.x], [a.y, b.y, c.y]);
    }
    let [u, v, w] = edges;
    if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
        return None;
    }
    let determinant = u + v + w;
    if determinant == 0.0 {
        return None;
    }
    let t = (u * a.z + v * b.z + w * c.z) / determinant;
    (t >= shear.t_min && t <= t_max).then(|| TriangleHit {
        t,
        triangle,
        u: v / determinant,
        v: w / determinant,
    })
}

impl Mesh {
    fn build(&self) -> TriangleBvh {
        TriangleBvh::build(Positions::still(&self.positions), &self.triangles)
    }

    fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|v| self.positions[v as usize])
    }

    /// Triangles of edge about `size` scattered in a cube of half edge `scale`.
    fn soup(count: usize, scale: f32, size: f32, random: &mut Random) -> Self {
        let mut positions = Vec::new();
        for _ in 0..count {
            let center = point(random) * scale;
            positions.extend([(); 3].map(|()| center + point(random) * size));
        }
        let triangles = (0..count as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
        Self {
            triangles: triangles.collect(),
            positions,
        }
    }

    /// A closed surface of `4 n^2` triangles around `center`: an octahedron's faces, divided and
    /// blown up to a sphere with uneven radius.
    fn pebble(n: u32, center: Vec3, radius: f32) -> Self {
        let (rows, columns) = (n, 2 * n);
        let mut positions = vec![center + Vec3::Z * radius, center - Vec3::Z * radius];
        for row in 1..rows {
            for column in 0..columns {
                let polar = row as f32 / rows as f32 * std::f32::consts::PI;
                let azimuth = column as f32 / columns as f32 * std::f32::consts::TAU;
                let bump = 1.0 + 0.2 * (3.0 * polar).sin() * (5.0 * azimuth).cos();
                let direction = vec3(
                    polar.sin() * azimuth.cos(),
                    polar.sin() * azimuth.sin(),
                    polar.cos(),
                );
                positions.push(center + direction * radius * bump);
            }
        }
        let at = |row, column| 2 + (row - 1) * columns + column % columns;
        let mut triangles = Vec::new();
        for column in 0..columns {
            triangles.push([0, at(1, column), at(1, column + 1)]);
            triangles.push([1, at(rows - 1, column + 1), at(rows - 1, column)]);
            for row in 1..rows - 1 {
                let (a, b) = (at(row, column), at(row, column + 1));
                let (c, d) = (at(row + 1, column), at(row + 1, column + 1));
                triangles.extend([[a, c, d], [a, d, b]]);
            }
        }
        Self {
            positions,
            triangles,
        }
    }

    /// The unit square at z = 0 in `n * n` cells of two triangles.
    fn grid(n: u32) -> Self {
        let positions = (0..=n).flat_map(|y| {
            (0..=n).map(move |x| vec3(x as f32 / n as f32, y as f32 / n as f32, 0.0))
        });
        let triangles = (0..n * n).flat_map(|cell| {
            let a = cell / n * (n + 1) + cell % n;
            [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]
        });
        Self {
            positions: positions.collect(),
            triangles: triangles.collect(),
        }
    }

    /// All hits by the scalar test.
    fn hits(&self, ray: &Ray) -> impl Iterator<Item = TriangleHit> {
        let shear = Shear::new(ray);
        (0..self.triangles.len())
            .filter_map(move |i| meet(&shear, i as u32, self.corners(i), ray.t_max))
    }

    /// The first of all hits by the scalar test.
    fn brute_force(&self, ray: &Ray) -> Option<TriangleHit> {
        self.hits(ray)
            .min_by(|a, b| a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle)))
    }
}

/// Rays from around the mesh, half of them aimed at a random triangle, with bounds on `t`.
fn rays(mesh: &Mesh, scale: f32, count: usize, random: &mut Random) -> Vec<Ray> {
    let ray = |i: usize, random: &mut Random| {
        let origin = point(random) * scale * 1.5;
        let mut direction = point(random) * scale;
        if i.is_multiple_of(2) && !mesh.triangles.is_empty() {
            let [a, b, c] = mesh.corners((random.next() * mesh.triangles.len() as f32) as usize);
            direction = (a + b + c) / 3.0 - origin;
        }
        if i.is_multiple_of(5) {
            direction[i % 3] = 0.0;
        }
        Ray {
            origin: origin.into(),
            direction: direction.into(),
            t_min: if i.is_multiple_of(3) { 0.4 } else { 0.0 },
            t_max: if i.is_multiple_of(4) {
                1.1
            } else {
                f32::INFINITY
            },
            time: random.next(),
        }
    };
    (0..count).map(|i| ray(i, random)).collect()
}

fn assert_twins(mesh: &Mesh, rays: &[Ray]) {
    assert_tree_twins(&mesh.build(), mesh, rays);
}

fn assert_tree_twins(bvh: &TriangleBvh, mesh: &Mesh, rays: &[Ray]) {
    for ray in rays {
        let expected = mesh.brute_force(ray);
        assert_eq!(bvh.closest_hit(ray), expected, "{ray:?}");
        assert_eq!(bvh.occluded(ray), expected.is_some(), "{ray:?}");
        let accept = |_: &TriangleHit| true;
        let portable = Closest { bvh, ray, accept }.run::<Portable>();
        assert_eq!(portable, expected, "{ray:?}");
        let portable = Any { bvh, ray, accept }.run::<Portable>();
        assert_eq!(portable, expected.is_some(), "{ray:?}");
    }
}

#[test]
fn soups_of_every_size_and_scale_have_the_hits_of_the_brute_force_twin() {
    let mut random = Random::new(1);
    for count in [1, 2, 3, 4, 5, 9, 33, 500, 3000] {
        for scale in [1e-4, 1.0, 1e6] {
            let mesh = Mesh::soup(count, scale, 0.3 * scale, &mut random);
            assert_twins(&mesh, &rays(&mesh, scale, 400, &mut random));
        }
    }
}

#[test]
fn thin_triangles_far_from_the_origin_have_the_hits_of_the_twin() {
    let mut random = Random::new(2);
    let mut mesh = Mesh::soup(1000, 1.0, 0.5, &mut random);
    for position in &mut mesh.positions {
        *position = *position * vec3(1.0, 1e-3, 1.0) + vec3(0.0, 300.0, -5000.0);
    }
    let mut rays = rays(&mesh, 1.0, 2000, &mut random);
    for ray in &mut rays {
        ray.origin += Vec3A::new(0.0, 300.0, -5000.0);
    }
    assert_twins(&mesh, &rays);
}

#[test]
fn hits_agree_with_a_textbook_test_in_double_precision() {
    let mut random = Random::new(3);
    let mesh = Mesh::soup(300, 1.0, 0.4, &mut random);
    let bvh = mesh.build();
    let mut compared = 0;
    for ray in rays(&mesh, 1.0, 3000, &mut random) {
        let Some(hit) = bvh.closest_hit(&ray) else {
            continue;
        };
        // Cramer's rule for origin + t direction = a + u (b - a) + v (c - a).
        let [a, b, c] = mesh.corners(hit.triangle as usize).map(DVec3::from);
        let origin = Vec3::from(ray.origin).as_dvec3();
        let direction = Vec3::from(ray.direction).as_dvec3();
        let (e1, e2, s) = (b - a, c - a, origin - a);
        let normal = e1.cross(e2);
        let determinant = -direction.dot(normal);
        // Where the ray grazes the plane, single precision knows less.
        if determinant.abs() < 0.05 * normal.length() * direction.length() {
            continue;
        }
        let t = s.dot(normal) / determinant;
        let (u, v) = (s.cross(direction).dot(e2), s.cross(direction).dot(-e1));
        let close = |x: f32, y: f64, scale: f64| (f64::from(x) - y).abs() < 1e-4 * scale;
        assert!(close(hit.t, t, t.max(0.01)), "{hit:?} {t}");
        assert!(
            close(hit.u, u / determinant, 1.0),
            "{hit:?} {}",
            u / determinant
        );
        assert!(
            close(hit.v, v / determinant, 1.0),
            "{hit:?} {}",
            v / determinant
        );
        compared += 1;
    }
    assert!(compared > 500, "{compared}");
}

#[test]
fn no_ray_leaves_a_closed_mesh_through_an_edge_or_vertex() {
    let mut random = Random::new(4);
    for (center, radius) in [
        (Vec3::ZERO, 1.0),
        (Vec3::ZERO, 1e-4),
        (Vec3::ZERO, 1e6),
        (vec3(100.0, -2000.0, 0.3), 1.0),
    ] {
        let mesh = Mesh::pebble(24, center, radius);
        let bvh = mesh.build();
        for _ in 0..40 {
            let origin = center + point(&mut random) * radius * 0.4;
            for triangle in 0..mesh.triangles.len() {
                let [a, b, c] = mesh.corners(triangle);
                let share = 0.5 + 0.5 * signed(&mut random);
                for target in [a, a + (b - a) * share, (b + c) * 0.5] {
                    let ray = Ray::new(origin.into(), (target - origin).into());
                    assert!(bvh.closest_hit(&ray).is_some(), "{ray:?}");
                    assert!(bvh.occluded(&ray), "{ray:?}");
                }
            }
        }
    }
}

#[test]
fn axis_rays_through_the_vertices_of_a_grid_hit_it_from_both_sides() {
    let bvh = Mesh::grid(32).build();
    for side in [1.0, -1.0] {
        for i in 0..=64 {
            for j in 0..=64 {
                let origin = Vec3A::new(i as f32 / 64.0, j as f32 / 64.0, side);
                let hit = bvh
                    .closest_hit(&Ray::new(origin, Vec3A::Z * -side))
                    .unwrap();
                assert_eq!(hit.t, 1.0);
                // Negative zeros count as zeros.
                let direction = Vec3A::new(-0.0, -0.0, -2.0 * side);
                assert_eq!(
                    bvh.closest_hit(&Ray::new(origin, direction)).unwrap().t,
                    0.5
                );
            }
        }
    }
    // Within the plane of the grid, and beside it.
    for axis in [Vec3A::X, Vec3A::Y] {
        assert!(!bvh.occluded(&Ray::new(Vec3A::new(-1.0, -1.0, 0.5), axis)));
        assert!(!bvh.occluded(&Ray::new(Vec3A::splat(-1.0), axis)));
    }
}

#[test]
fn an_edge_function_that_rounds_to_zero_keeps_its_sign() {
    // (1 + h) (1 - h) - 1 = -h^2 is zero in single precision. The ray passes the edge from the
    // second to the third vertex by about h^2, outside in one case and inside in the other.
    let h = 1.0 / (1 << 13) as f32;
    let outside = [
        vec3(-1.0, 1.0, 0.0),
        vec3(1.0 + h, 1.0, 0.0),
        vec3(-1.0, h - 1.0, 0.0),
    ];
    let inside = [
        vec3(-1.0, 1.0, 0.0),
        vec3(1.0, 1.0 - h, 0.0),
        vec3(-1.0 - h, -1.0, 0.0),
    ];
    let ray = Ray::new(Vec3A::NEG_Z, Vec3A::Z);
    for (positions, hit) in [(outside, false), (inside, true)] {
        let mesh = Mesh {
            positions: positions.to_vec(),
            triangles: vec![[0, 1, 2]],
        };
        assert_eq!(mesh.build().occluded(&ray), hit);
        assert_twins(&mesh, &[ray]);
    }
}

#[test]
fn of_equal_hits_the_smallest_index_counts() {
    let one = [
        vec3(0.0, 0.0, 0.0),
        vec3(1.0, 0.0, 0.0),
        vec3(0.0, 1.0, 0.0),
    ];
    let mesh = Mesh {
        positions: one.to_vec(),
        triangles: vec![[0, 1, 2]; 50],
    };
    let bvh = mesh.build();
    let ray = Ray::new(Vec3A::new(0.2, 0.3, 1.0), Vec3A::NEG_Z);
    assert_eq!(bvh.closest_hit(&ray).unwrap().triangle, 0);
    let odd = |hit: &TriangleHit| hit.triangle > 16;
    assert_eq!(bvh.closest_hit_where(&ray, odd).unwrap().triangle, 17);
}

#[test]
fn barycentrics_name_the_second_and_third_vertex() {
    let mesh = Mesh {
        positions: vec![
            vec3(0.0, 0.0, 0.0),
            vec3(2.0, 0.0, 0.0),
            vec3(0.0, 4.0, 0.0),
        ],
        triangles: vec![[0, 1, 2]],
    };
    let ray = Ray::new(Vec3A::new(0.5, 2.0, 3.0), Vec3A::new(0.0, 0.0, -1.0));
    let hit = mesh.build().closest_hit(&ray).unwrap();
    assert_eq!((hit.t, hit.u, hit.v), (3.0, 0.25, 0.5));
}

#[test]
fn refused_hits_do_not_count() {
    let mut random = Random::new(5);
    let mesh = Mesh::soup(400, 1.0, 0.5, &mut random);
    let bvh = mesh.build();
    let accept = |hit: &TriangleHit| hit.triangle.is_multiple_of(3) && hit.u < 0.5;
    for ray in rays(&mesh, 1.0, 1000, &mut random) {
        let expected = mesh
            .hits(&ray)
            .filter(accept)
            .min_by(|a, b| a.t.total_cmp(&b.t));
        assert_eq!(bvh.closest_hit_where(&ray, accept), expected);
        assert_eq!(bvh.occluded_where(&ray, accept), expected.is_some());
    }
}

#[test]
fn meshes_without_area_are_never_hit() {
    let ray = Ray::new(Vec3A::splat(-1.0), Vec3A::ONE);
    let empty = TriangleBvh::build(Positions::still(&[]), &[]);
    assert!(empty.closest_hit(&ray).is_none() && !empty.occluded(&ray));
    assert!(empty.bounds().is_none());
    let points = [Vec3::ZERO, Vec3::ONE, Vec3::ONE * 2.0, Vec3::NAN];
    let flat = TriangleBvh::build(
        Positions::still(&points),
        &[[0, 0, 0], [0, 1, 1], [0, 1, 2], [0, 1, 3]],
    );
    assert!(flat.closest_hit(&ray).is_none() && !flat.occluded(&ray));
    assert!(flat.bounds().is_none());
}

#[test]
fn rays_that_are_not_rays_meet_nothing_and_end() {
    let mut random = Random::new(6);
    let bvh = Mesh::soup(500, 1.0, 0.5, &mut random).build();
    for bad in [0.0, 1e-40, f32::NAN, f32::INFINITY, f32::MAX] {
        for direction in [Vec3A::splat(bad), Vec3A::new(bad, 0.0, 0.0)] {
            bvh.closest_hit(&Ray::new(Vec3A::ZERO, direction));
            bvh.occluded(&Ray::new(Vec3A::ONE, direction));
        }
        bvh.closest_hit(&Ray::new(Vec3A::splat(bad), Vec3A::X));
        bvh.closest_hit(&Ray::segment(Vec3A::ZERO, Vec3A::X, f32::NAN));
    }
    assert!(!bvh.occluded(&Ray::new(Vec3A::ZERO, Vec3A::ZERO)));
}

/// The keys and children that a walk gets from a node.
struct Meet<'a> {
    node: &'a Node,
    slabs: &'a Slabs,
    by_distance: bool,
}

impl Job for Meet<'_> {
    type Output = Vec<(Key, u32)>;

    fn run<L: Lanes>(self) -> Self::Output {
        let mut stack = Stack::new(0);
        stack.pop();
        let meet = if self.by_distance {
            L::meet_by_distance
        } else {
            L::meet_in_order
        };
        let met = meet(self.node, self.slabs, 2.0, stack.room());
        // SAFETY: they have been written.
        unsafe { stack.grow(met.count) };
        let mut all: Vec<_> = std::iter::from_fn(|| stack.pop()).collect();
        if let Some(&(_, child)) = all.first() {
            assert_eq!(child, met.next);
        }
        all.reverse();
        all
    }
}

/// Results do not depend on the order of visits, so the other tests do not see it.
#[test]
fn children_are_visited_by_distance_or_in_their_order() {
    let mut random = Random::new(12);
    let mut met = [0; WIDTH + 1];
    for _ in 0..2000 {
        let mut node = Node {
            boxes: Boxes::EMPTY,
            children: std::array::from_fn(|slot| 100 + slot as u32),
        };
        for slot in 0..(9.0 * random.next()) as usize {
            let center = Vec3A::from(point(&mut random));
            let half = Vec3A::splat(random.next());
            node.boxes
                .set(slot, &Aabb::new(center - half, center + half));
        }
        let (origin, target) = (2.0 * point(&mut random), 0.5 * point(&mut random));
        let ray = Ray::new(origin.into(), (target - origin).into());
        let slabs = Slabs::new(&ray, (-2.0 * Vec3A::ONE, 2.0 * Vec3A::ONE)).unwrap();
        let job = |by_distance| Meet {
            node: &node,
            slabs: &slabs,
            by_distance,
        };
        let (sorted, listed) = (run_widest(job(true)), run_widest(job(false)));
        assert!(sorted.is_sorted_by(|a, b| a.0 > b.0), "{sorted:?}");
        assert!(listed.is_sorted_by(|a, b| a.1 < b.1), "{listed:?}");
        let mut children: Vec<u32> = sorted.iter().map(|(_, child)| *child).collect();
        children.sort_unstable();
        assert!(children.iter().eq(listed.iter().map(|(_, child)| child)));
        assert!(
            sorted
                .iter()
                .all(|(key, child)| 100 + (key & SLOT) as u32 == *child)
        );
        let plain = job(true).run::<Portable>();
        assert_eq!(plain.len(), sorted.len());
        for (a, b) in plain.iter().zip(&sorted) {
            let [a, b] = [a.0, b.0].map(|key| f32::from_bits((key & !SLOT) as u32));
            assert!((a - b).abs() < 1e-5, "{a} {b}");
        }
        assert_eq!(job(false).run::<Portable>(), listed);
        met[sorted.len()] += 1;
    }
    assert!(met.iter().take(6).all(|&count| count > 10), "{met:?}");
}

#[test]
fn trees_deeper_than_usual_work() {
    // Each triangle half the size of the one before, down to the smallest normal numbers.
    let mut positions = Vec::new();
    for i in 0..110 {
        let size = 0.5f32.powi(i);
        positions.extend([Vec3::X, Vec3::Y, Vec3::Z].map(|axis| axis * size));
    }
    let triangles = (0..110).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let mesh = Mesh {
        positions,
        triangles,
    };
    let rays = rays(&mesh, 1.0, 500, &mut Random::new(7));
    assert_twins(&mesh, &rays);
}

#[test]
fn bounds_hold_all_vertices() {
    let mesh = Mesh::soup(100, 3.0, 0.5, &mut Random::new(8));
    let (lower, upper) = mesh.build().bounds().unwrap();
    let fold = |f: fn(Vec3, Vec3) -> Vec3| mesh.positions.iter().copied().reduce(f).unwrap();
    assert_eq!(Vec3::from(lower), fold(Vec3::min));
    assert_eq!(Vec3::from(upper), fold(Vec3::max));
}

#[test]
fn instances_are_visited_where_a_loop_over_boxes_meets_them() {
    let mut random = Random::new(9);
    let mut boxes: Vec<_> = (0..300)
        .map(|_| {
            let center = Vec3A::from(point(&mut random));
            let half = Vec3A::from(point(&mut random)).abs() * 0.1;
            (center - half, center + half)
        })
        .collect();
    boxes[7] = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    let bvh = InstanceBvh::build(&boxes);
    // The contents of a box are its surface where the ray enters.
    let entry = |(lower, upper): (Vec3A, Vec3A), ray: &Ray| {
        let a = (lower - ray.origin) / ray.direction;
        let b = (upper - ray.origin) / ray.direction;
        let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
        (near <= far && near >= 0.0).then_some(near)
    };
    for _ in 0..1000 {
        let ray = Ray::new((point(&mut random) * 1.5).into(), point(&mut random).into());
        let all = boxes.iter().filter_map(|&b| entry(b, &ray));
        let expected = all.min_by(f32::total_cmp);
        let mut best = None;
        bvh.closest(&ray, |instance, t_max| {
            let t = entry(boxes[instance as usize], &ray).filter(|&t| t <= t_max)?;
            best = Some(t);
            best
        });
        assert_eq!(best, expected);
        let met = bvh.any(&ray, |i| entry(boxes[i as usize], &ray).is_some());
        assert_eq!(met, expected.is_some());
    }
    assert!(InstanceBvh::build(&[]).bounds().is_none());
}

#[test]
fn refitted_trees_have_the_hits_of_the_twin() {
    let mut random = Random::new(10);
    let mut mesh = Mesh::pebble(16, Vec3::ZERO, 1.0);
    // A triangle without area at first, one that loses its area.
    mesh.triangles.push([0, 0, 1]);
    let bvh = mesh.build();
    let rays = rays(&mesh, 1.0, 500, &mut random);
    let mut moved = |mesh: &mut Mesh, amount: f32| {
        for position in &mut mesh.positions {
            *position += amount * point(&mut random);
        }
        bvh.refitted(Positions::still(&mesh.positions), &mesh.triangles)
    };
    let shape = |bvh: &TriangleBvh| -> Vec<u32> { bvh.leaf_triangles().collect() };

    let slight = moved(&mut mesh, 0.01);
    assert_eq!(shape(&slight), shape(&bvh));
    assert_tree_twins(&slight, &mesh, &rays);

    mesh.positions[7] = mesh.positions[8];
    let flattened = moved(&mut mesh, 0.0);
    assert_eq!(shape(&flattened), shape(&bvh));
    assert_tree_twins(&flattened, &mesh, &rays);
    mesh.positions[7] = Vec3::splat(0.3);
    let risen = flattened.refitted(Positions::still(&mesh.positions), &mesh.triangles);
    assert_tree_twins(&risen, &mesh, &rays);

    // A leaf of which nothing is left.
    let mut dented = Mesh {
        positions: mesh.positions.clone(),
        triangles: mesh.triangles.clone(),
    };
    let leaf: Vec<u32> = bvh.leaf_triangles().take(LEAF_TRIANGLES).collect();
    for &id in leaf.iter().filter(|id| **id != u32::MAX) {
        for vertex in mesh.triangles[id as usize] {
            dented.positions[vertex as usize] = Vec3::splat(0.3);
        }
    }
    let dent = bvh.refitted(Positions::still(&dented.positions), &dented.triangles);
    assert_eq!(shape(&dent), shape(&bvh));
    assert_tree_twins(&dent, &dented, &rays);

    // Where the old tree would be bad, and where it lacks a triangle, there is a new one.
    let scattered = moved(&mut mesh, 2.0);
    assert_ne!(shape(&scattered), shape(&bvh));
    assert_tree_twins(&scattered, &mesh, &rays);
    mesh.triangles.pop();
    mesh.triangles.push([0, 5, 1]);
    assert_tree_twins(&moved(&mut mesh, 0.0), &mesh, &rays);

    let nothing = vec![Vec3::ZERO; mesh.positions.len()];
    assert!(
        bvh.refitted(Positions::still(&nothing), &mesh.triangles)
            .bounds()
            .is_none()
    );
}

#[test]
fn moving_triangles_have_the_hits_of_the_twin_at_every_time() {
    let mut random = Random::new(12);
    let start = Mesh::soup(400, 1.0, 0.3, &mut random);
    let moved = |p: &Vec3, random: &mut Random| *p + 0.4 * point(random);
    let end: Vec<Vec3> = start
        .positions
        .iter()
        .map(|p| moved(p, &mut random))
        .collect();
    let built = TriangleBvh::build(Positions::moving(&start.positions, &end), &start.triangles);
    let refitted = start
        .build()
        .refitted(Positions::moving(&start.positions, &end), &start.triangles);
    let mut hits = 0;
    for ray in rays(&start, 1.0, 2000, &mut random) {
        let s = ray.time;
        let at = |(a, b): (&Vec3, &Vec3)| *a * (1.0 - s) + *b * s;
        let frozen = Mesh {
            positions: start.positions.iter().zip(&end).map(at).collect(),
            triangles: start.triangles.clone(),
        };
        assert_tree_twins(&built, &frozen, &[ray]);
        assert_tree_twins(&refitted, &frozen, &[ray]);
        hits += usize::from(frozen.brute_force(&ray).is_some());
    }
    assert!(hits > 500, "{hits}");
}

#[test]
fn trees_of_many_parts_are_the_same_for_any_number_of_threads() {
    let mut random = Random::new(21);
    let mesh = Mesh::soup(UNDIVIDED + 1000, 1.0, 0.02, &mut random);
    let bent: Vec<Vec3> = mesh.positions.iter().map(|p| *p * 1.01).collect();
    let built_by = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let built = mesh.build();
            let refitted = built.refitted(Positions::still(&bent), &mesh.triangles);
            (built, refitted)
        })
    };
    let (built, refitted) = built_by(1);
    assert_tree_twins(&built, &mesh, &rays(&mesh, 2.0, 60, &mut random));
    let bent = Mesh {
        positions: bent.clone(),
        triangles: mesh.triangles.clone(),
    };
    let rays = rays(&bent, 2.0, 60, &mut random);
    assert_tree_twins(&refitted, &bent, &rays);
    // All of both, to the last bit: NaN of empty lanes is printed like any number.
    let one = format!("{built:?} {refitted:?}");
    for threads in [2, 5] {
        let (built, refitted) = built_by(threads);
        assert!(one == format!("{built:?} {refitted:?}"), "{threads}");
    }
}
