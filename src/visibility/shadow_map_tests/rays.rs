//! Exact visibility by ray casting in f64, the reference of the shadow map tests.

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use crate::geometry::{Facets, TileMesh};
use crate::visibility::PackedVisibility;

/// Exact ray casting through explicit copies of the tile, in f64. A grid over the tile lists the triangles above each
/// cell. A ray walks the cells from tile to tile until it is above all triangles.
pub struct RayCaster<'a> {
    mesh: &'a TileMesh,
    cells: i64,
    /// Per cell: each triangle and the tile copy of it that overlaps the cell.
    lists: Vec<Vec<(u32, [i64; 2])>>,
}

impl<'a> RayCaster<'a> {
    pub fn new(mesh: &'a TileMesh, cells: i64) -> Self {
        let mut lists = vec![Vec::new(); (cells * cells) as usize];
        for k in 0..mesh.triangles.len() {
            let corners = mesh.corners(k).map(|p| p.truncate().as_dvec2() / mesh.size.as_dvec2() * cells as f64);
            let lo = corners.iter().fold(DVec2::INFINITY, |m, p| m.min(*p)).floor();
            let hi = corners.iter().fold(DVec2::NEG_INFINITY, |m, p| m.max(*p)).floor();
            for y in lo.y as i64 - 1..=hi.y as i64 + 1 {
                for x in lo.x as i64 - 1..=hi.x as i64 + 1 {
                    let cell = y.rem_euclid(cells) * cells + x.rem_euclid(cells);
                    lists[cell as usize].push((k as u32, [-x.div_euclid(cells), -y.div_euclid(cells)]));
                }
            }
        }
        Self { mesh, cells, lists }
    }

    fn is_blocked(&self, p: Vec3, own: u32, direction: Vec3) -> bool {
        let (p, w) = (p.as_dvec3(), direction.as_dvec3().normalize());
        let top = f64::from(self.mesh.z_range().1);
        let cell_size = self.mesh.size.as_dvec2() / self.cells as f64;
        let end = (top - p.z) / w.z;
        let mut t = 0.0;
        let mut cell = (p.truncate() / cell_size).floor();
        loop {
            let (cx, cy) = (cell.x as i64, cell.y as i64);
            let tile = [cx.div_euclid(self.cells), cy.div_euclid(self.cells)];
            let list = cy.rem_euclid(self.cells) * self.cells + cx.rem_euclid(self.cells);
            for &(k, copy) in &self.lists[list as usize] {
                let shift = [tile[0] + copy[0], tile[1] + copy[1]];
                let offset = (DVec2::new(shift[0] as f64, shift[1] as f64) * self.mesh.size.as_dvec2()).extend(0.0);
                let [a, b, c] = self.mesh.corners(k as usize).map(|corner| corner.as_dvec3() + offset);
                if let Some(hit) = moller_trumbore(p, w, a, b, c) {
                    // Only the facet's own triangle, not its copies in other tiles, lies at distance 0 up to rounding.
                    let is_own = k == own && hit < 1e-5;

                    if hit > 1e-7 && !is_own {
                        return true;
                    }
                }
            }
            let next = DVec2::select(w.truncate().cmpgt(DVec2::ZERO), cell + 1.0, cell) * cell_size;
            let until = (next - p.truncate()) / w.truncate();
            let until = DVec2::select(w.truncate().cmpeq(DVec2::ZERO), DVec2::INFINITY, until);
            if until.x <= until.y {
                cell.x += w.x.signum();
                t = until.x.max(t);
            } else {
                cell.y += w.y.signum();
                t = until.y.max(t);
            }
            if t > end {
                return false;
            }
        }
    }

    pub fn visibility(&self, facets: &Facets, directions: &[Vec3]) -> PackedVisibility {
        let mut visibility = PackedVisibility::new(facets.len(), directions.len());
        let words = visibility.words_per_row();
        visibility.words.par_chunks_mut(words).zip(directions).for_each(|(row, &w)| {
            for s in 0..facets.len() {
                if facets.geometric_normals[s].dot(w) > 0.0
                    && !self.is_blocked(facets.positions[s], facets.triangles[s], w)
                {
                    row[s / 32] |= 1 << (s % 32);
                }
            }
        });
        visibility
    }
}

/// Distance along `w` from `p` to the triangle, from either side.
fn moller_trumbore(p: DVec3, w: DVec3, a: DVec3, b: DVec3, c: DVec3) -> Option<f64> {
    let (ab, ac) = (b - a, c - a);
    let h = w.cross(ac);
    let det = ab.dot(h);
    if det == 0.0 {
        return None;
    }
    let s = (p - a) / det;
    let u = s.dot(h);
    let q = s.cross(ab);
    let v = w.dot(q);
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| ac.dot(q))
}
