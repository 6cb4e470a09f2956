//! Planar samples of the small-scale surface.

use glam::Vec3;

/// Samples of the surface, one entry a facet in every array. Areas sum to the surface area of the tile.
#[derive(Debug, Clone, Default)]
pub struct Facets {
    /// Centres, wrapped into the tile in x and y.
    pub positions: Vec<Vec3>,
    /// Unit normals that reflect: interpolated where the mesh has normals, else geometric.
    pub normals: Vec<Vec3>,
    /// Unit geometric normals.
    pub geometric_normals: Vec<Vec3>,
    /// Areas ΔA in squared tile units.
    pub areas: Vec<f32>,
    /// Material slot of each.
    pub slots: Vec<u16>,
    /// Colour weight of the tile's colour field at each centre.
    pub colors: Vec<Vec3>,
    /// The triangle each lies on: a ray that leaves a facet ignores it.
    pub triangles: Vec<u32>,
}

impl Facets {
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }
}
