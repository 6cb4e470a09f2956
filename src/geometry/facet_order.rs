//! Facets in the order that sums over them want: by material slot, then equal normals together.

use super::Facets;

impl Facets {
    /// Sorts by slot and normal; facets that share a normal become neighbours. Stable, so the order stays deterministic.
    pub fn sort_for_sums(&mut self) {
        const STEPS: f32 = 4096.0;
        let mut order: Vec<u32> = (0..self.len() as u32).collect();
        order.sort_by_key(|&s| {
            let s = s as usize;
            let [x, y, z] = (self.normals[s] * STEPS).to_array().map(|v| v.round() as i32);
            (self.slots[s], z, y, x)
        });
        fn permuted<T: Copy>(values: &[T], order: &[u32]) -> Vec<T> {
            order.iter().map(|&s| values[s as usize]).collect()
        }
        self.positions = permuted(&self.positions, &order);
        self.normals = permuted(&self.normals, &order);
        self.geometric_normals = permuted(&self.geometric_normals, &order);
        self.areas = permuted(&self.areas, &order);
        self.slots = permuted(&self.slots, &order);
        self.colors = permuted(&self.colors, &order);
        self.triangles = permuted(&self.triangles, &order);
    }
}
