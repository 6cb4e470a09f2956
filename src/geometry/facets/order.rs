//! Order of facets for sums: by material slot, then by normal, so that equal normals are adjacent.

use glam::Vec3;
use rayon::prelude::*;

use super::MIN_ITEMS_PER_TASK;
use crate::geometry::Facets;
use crate::geometry::families::rounded::rounded;

impl Facets {
    /// Sorts stably by slot and normal, so that facets that share a normal are adjacent.
    pub fn sort_for_sums(&mut self) {
        let keyed = |(s, (slot, normal)): (usize, (&u16, &Vec3))| (sum_key(*slot, *normal), s as u32);
        let pairs = self.slots.par_iter().zip(&self.normals).with_min_len(MIN_ITEMS_PER_TASK);
        let mut order: Vec<(u64, u32)> = pairs.enumerate().map(keyed).collect();
        // The facet's index breaks ties, which gives the order of a stable sort in less time.
        order.sort_unstable();
        fn permuted<T: Copy + Send + Sync>(values: &[T], order: &[(u64, u32)]) -> Vec<T> {
            if values.is_empty() {
                return Vec::new();
            }
            order.par_iter().with_min_len(MIN_ITEMS_PER_TASK).map(|&(_, s)| values[s as usize]).collect()
        }
        self.positions = permuted(&self.positions, &order);
        self.normals = permuted(&self.normals, &order);
        self.geometric_normals = permuted(&self.geometric_normals, &order);
        self.areas = permuted(&self.areas, &order);
        self.slots = permuted(&self.slots, &order);
        self.colors = permuted(&self.colors, &order);
        self.triangles = permuted(&self.triangles, &order);
        self.replicates = permuted(&self.replicates, &order);
    }
}

/// Sort key of slot, z, y and x in this order, 16 bits each. Unit normals fit into 16 bits per component.
fn sum_key(slot: u16, normal: Vec3) -> u64 {
    const STEPS: f32 = 4096.0;
    let [x, y, z] = (normal * STEPS).to_array().map(|v| u64::from(rounded(v).clamp(-0x8000, 0x7fff) as u16 ^ 0x8000));
    u64::from(slot) << 48 | z << 32 | y << 16 | x
}
