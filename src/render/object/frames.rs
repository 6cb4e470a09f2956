//! Tangent frames: perpendicular unit vectors, and averaged normals and tangents for a mesh that has none.

use std::collections::HashMap;

use glam::{DVec3, Vec2, Vec3};

/// Returns the normalized component of `along` perpendicular to the unit `normal`; any perpendicular if it vanishes.
pub(super) fn perpendicular(along: DVec3, normal: DVec3) -> DVec3 {
    let along = along.try_normalize().unwrap_or_default();
    let across = along - normal * along.dot(normal);
    if across.length_squared() > 1e-12 { across.normalize_or_zero() } else { normal.any_orthonormal_vector() }
}

/// Averages normals over the triangles at each position, weighted by area. Vertices split at a UV seam stay smooth.
pub(super) fn smooth_normals(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let welded = weld(positions);
    let mut sums = vec![DVec3::ZERO; positions.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|k| positions[k as usize].as_dvec3());
        let area_vector = (b - a).cross(c - a);
        for &k in triangle {
            sums[welded[k as usize] as usize] += area_vector;
        }
    }
    welded.iter().map(|&first| sums[first as usize].try_normalize().unwrap_or(DVec3::Y).as_vec3()).collect()
}

/// Returns, for each vertex, the first vertex at exactly the same position.
pub(super) fn weld(positions: &[Vec3]) -> Vec<u32> {
    let mut first_at = HashMap::with_capacity(positions.len());
    // Adding zero turns -0 into 0.
    let key = |p: &Vec3| (*p + Vec3::ZERO).to_array().map(f32::to_bits);
    positions.iter().enumerate().map(|(k, p)| *first_at.entry(key(p)).or_insert(k as u32)).collect()
}

/// Averages tangents along ∂P/∂u over the triangles of each vertex, weighted by area. Also returns the number of
/// triangles with mirrored UVs.
pub(super) fn tangents_from_uvs(
    positions: &[Vec3],
    normals: &[Vec3],
    uvs: &[Vec2],
    triangles: &[[u32; 3]],
) -> (Vec<Vec3>, usize) {
    let mut sums = vec![DVec3::ZERO; positions.len()];
    let mut mirrored = 0;
    for triangle in triangles {
        let [a, b, c] = triangle.map(|k| positions[k as usize].as_dvec3());
        let [uv_a, uv_b, uv_c] = triangle.map(|k| uvs[k as usize].as_dvec2());
        let (edge_1, edge_2, uv_1, uv_2) = (b - a, c - a, uv_b - uv_a, uv_c - uv_a);
        let determinant = uv_1.perp_dot(uv_2);
        mirrored += usize::from(determinant < 0.0);
        let along_u = (edge_1 * uv_2.y - edge_2 * uv_1.y) * determinant.signum();
        let weight = edge_1.cross(edge_2).length();
        let along_u = along_u.try_normalize().unwrap_or_default() * weight;
        for &k in triangle {
            let normal = normals[k as usize].as_dvec3();
            sums[k as usize] += along_u - normal * along_u.dot(normal);
        }
    }
    let tangent = |(sum, normal): (&DVec3, &Vec3)| {
        let normal = normal.as_dvec3();
        match sum.try_normalize() {
            Some(tangent) => perpendicular(tangent, normal).as_vec3(),
            None => around_vertical(normal).as_vec3(),
        }
    };
    (sums.iter().zip(normals).map(tangent).collect(), mirrored)
}

/// Returns the horizontal tangent, for meshes without UVs. Tile y is then the vertical direction projected onto the
/// surface. The frame is smooth except where the normal is vertical.
pub(super) fn around_vertical(normal: DVec3) -> DVec3 {
    let tangent = DVec3::Y.cross(normal);
    if tangent.length_squared() > 1e-12 { tangent.normalize_or_zero() } else { perpendicular(DVec3::X, normal) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smoothed_normals_of_a_cube_corner_are_the_area_weighted_mean() {
        // Three faces of areas 1, 2, 2 (as triangles) meet at the origin.
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(0.0, 0.0, 2.0), Vec3::ZERO];
        let normals = smooth_normals(&positions, &[[0, 1, 2], [4, 2, 3], [0, 3, 1]]);
        let expected = Vec3::new(2.0, 2.0, 1.0) / 3.0;
        assert!((normals[0] - expected).length() < 1e-6);
        assert_eq!(normals[0], normals[4], "split vertices share the normal of their position");
    }

    #[test]
    fn tangents_follow_u_also_if_the_uvs_are_mirrored() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let normals = [Vec3::Z; 3];
        let uvs = [Vec2::ZERO, Vec2::new(0.0, 1.0), Vec2::new(-1.0, 0.0)];
        let (tangents, mirrored) = tangents_from_uvs(&positions, &normals, &uvs, &[[0, 1, 2]]);
        assert!((tangents[0] - Vec3::NEG_Y).length() < 1e-6, "{}", tangents[0]);
        assert_eq!(mirrored, 0);
        let uvs = [Vec2::ZERO, Vec2::new(-1.0, 0.0), Vec2::new(0.0, 1.0)];
        let (tangents, mirrored) = tangents_from_uvs(&positions, &normals, &uvs, &[[0, 1, 2]]);
        assert!((tangents[0] - Vec3::NEG_X).length() < 1e-6, "{}", tangents[0]);
        assert_eq!(mirrored, 1);
    }
}
