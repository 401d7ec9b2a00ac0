//! Which nodes of a binary tree become those of a wide one: so that a ray costs least (Ylitie, Karras
//! and Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", HPG 2017,
//! Section 3). By dynamic programming from the leaves up: the least cost of a subtree that fills so many
//! slots of a wide node is that of the best way to share them between its halves.
//!
//! Departure: what a leaf holds has been decided before.

use super::node::WIDTH;
use obvhs::bvh2::Bvh2;

/// What a visit of a leaf costs beside one of a node.
const LEAF_COST: f32 = 1.5;

/// For a binary node that fills up to 2, 3 ... 8 slots, how many of them its first half does. Zero where
/// one slot less is not worse.
type Shares = [u8; WIDTH - 1];

/// The least cost of a subtree that fills up to 1, 2 ... 7 slots: areas of boxes, times that of visits.
type Costs = [f32; WIDTH - 1];

/// How the nodes of a binary tree are joined.
pub struct Collapse<'a> {
    tree: &'a Bvh2,
    shares: Vec<Shares>,
}

impl<'a> Collapse<'a> {
    pub fn new(tree: &'a Bvh2) -> Self {
        let mut shares = vec![[0; WIDTH - 1]; tree.nodes.len()];
        // Of subtrees whose parents come later, the first half above the second.
        let mut costs: Vec<Costs> = Vec::new();
        for index in parents_first(tree).into_iter().rev() {
            let node = &tree.nodes[index as usize];
            let area = node.aabb().half_area();
            let halves = if node.is_leaf() {
                None
            } else {
                costs.pop().zip(costs.pop())
            };
            costs.push(match halves {
                Some(halves) => join(area, halves, &mut shares[index as usize]),
                None => [area * LEAF_COST; WIDTH - 1],
            });
        }
        Self { tree, shares }
    }

    /// The binary nodes that become the children of the wide one that `root` becomes, the smallest box
    /// first.
    pub fn children(&self, root: u32) -> Vec<u32> {
        let mut children = Vec::with_capacity(WIDTH);
        let mut todo = vec![(root, WIDTH)];
        while let Some((index, mut slots)) = todo.pop() {
            let first = |slots: usize| usize::from(self.shares[index as usize][slots - 2]);
            while slots > 1 && first(slots) == 0 {
                slots -= 1;
            }
            if slots == 1 {
                children.push(index);
            } else {
                let half = self.tree.nodes[index as usize].first_index;
                todo.extend([(half, first(slots)), (half + 1, slots - first(slots))]);
            }
        }
        let area = |index: u32| self.tree.nodes[index as usize].aabb().half_area();
        children.sort_by(|&i, &j| area(i).total_cmp(&area(j)));
        children
    }
}

/// The costs of a node by those of its halves.
fn join(area: f32, (first, second): (Costs, Costs), shares: &mut Shares) -> Costs {
    let mut best = [f32::INFINITY; WIDTH - 1];
    for slots in 2..=WIDTH {
        for k in 1..slots {
            let cost = first[k - 1] + second[slots - k - 1];
            if cost < best[slots - 2] {
                best[slots - 2] = cost;
                shares[slots - 2] = k as u8;
            }
        }
    }
    // As a child it is a wide node with all slots of its own.
    let mut costs = [area + best[WIDTH - 2]; WIDTH - 1];
    for slots in 2..WIDTH {
        if best[slots - 2] < costs[slots - 2] {
            costs[slots - 1] = best[slots - 2];
        } else {
            costs[slots - 1] = costs[slots - 2];
            shares[slots - 2] = 0;
        }
    }
    costs
}

/// All nodes, each before its first half, and that before the second.
fn parents_first(tree: &Bvh2) -> Vec<u32> {
    let mut order = Vec::with_capacity(tree.nodes.len());
    let mut todo = vec![0];
    while let Some(index) = todo.pop() {
        order.push(index);
        let node = &tree.nodes[index as usize];
        if !node.is_leaf() {
            todo.extend([node.first_index + 1, node.first_index]);
        }
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{kernel::subtree::build_binary, math::statistics::Random};
    use glam::Vec3A;
    use obvhs::aabb::Aabb;

    /// All sets of nodes that cover a subtree, each once.
    fn covers(tree: &Bvh2, root: u32) -> Vec<Vec<u32>> {
        let node = &tree.nodes[root as usize];
        let mut all = vec![vec![root]];
        if !node.is_leaf() {
            let seconds = covers(tree, node.first_index + 1);
            for first in covers(tree, node.first_index) {
                all.extend(seconds.iter().map(|second| [&first[..], second].concat()));
            }
        }
        all
    }

    /// What a ray that meets a node pays for it, if that node has such children.
    fn cost(tree: &Bvh2, root: u32, children: &dyn Fn(u32) -> Vec<u32>) -> f32 {
        let node = &tree.nodes[root as usize];
        let area = node.aabb().half_area();
        if node.is_leaf() {
            return area * LEAF_COST;
        }
        let below = children(root).into_iter();
        area + below.map(|child| cost(tree, child, children)).sum::<f32>()
    }

    /// The least cost, by trying all covers.
    fn least(tree: &Bvh2, root: u32) -> f32 {
        let node = &tree.nodes[root as usize];
        let area = node.aabb().half_area();
        if node.is_leaf() {
            return area * LEAF_COST;
        }
        let fits = |cover: &Vec<u32>| (2..=WIDTH).contains(&cover.len());
        let covers = covers(tree, root).into_iter().filter(fits);
        let sum = |cover: Vec<u32>| cover.into_iter().map(|child| least(tree, child)).sum();
        area + covers.map(sum).fold(f32::INFINITY, f32::min)
    }

    #[test]
    fn no_other_wide_tree_costs_less() {
        let mut random = Random::new(3);
        for count in [1, 2, 7, 8, 9, 10, 12, 14] {
            let mut number = || random.next() * random.next();
            let boxes: Vec<Aabb> = (0..count)
                .map(|_| {
                    let lower = Vec3A::new(number(), number(), number());
                    Aabb::new(lower, lower + Vec3A::new(number(), number(), number()))
                })
                .collect();
            let tree = build_binary(&boxes, 1);
            let collapse = Collapse::new(&tree);
            let found = cost(&tree, 0, &|root| collapse.children(root));
            let least = least(&tree, 0);
            assert!(
                (found / least - 1.0).abs() < 1e-5,
                "{count}: {found} {least}"
            );
        }
    }
}
