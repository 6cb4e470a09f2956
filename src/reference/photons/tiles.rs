//! Photons through explicit tiles: rays into the endless tiling, with refraction and reflection at each triangle.

use std::sync::Arc;

use glam::{DVec3, Vec2};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::lobe::PhotonSource;
use crate::base::{InputError, Result};
use crate::geometry::{PeriodicGrid, TileMesh};
use crate::slab::fresnel::{reflectance, refract};
use crate::slab::{Channel, Exit, Tally};

/// A tile as a face of a slab, with its rays.
#[derive(Debug, Clone)]
pub struct TracedTile {
    mesh: Arc<TileMesh>,
    grid: Arc<PeriodicGrid>,
    bottom: f32,
}

/// Place at which light arrives at the other face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Positions {
    /// Anywhere, as if the faces were far apart.
    Random,
    /// Place that its ray reaches, with this distance between the mean levels [tile units].
    Kept(f32),
}

/// Two faces, `None` for a level one, and one colour channel of the material between them.
#[derive(Debug, Clone)]
pub struct TileSlab {
    pub top: Option<TracedTile>,
    pub bottom: Option<TracedTile>,
    pub channel: Channel,
    pub positions: Positions,
}

/// Distance by which a ray starts off the surface, in units of the tile's diagonal.
const LIFT: f32 = 2e-6;
/// Largest number of facets that a photon meets on one face in a row, and number of faces that it meets.
const MAX_HITS: usize = 64;
const MAX_FACES: usize = 64;

/// Outcome of a photon's encounter with a face.
struct Passage {
    direction: DVec3,
    position: Vec2,
    hits: usize,
    /// False if the photon was lost after too many hits.
    is_alive: bool,
}

impl TracedTile {
    /// # Errors
    /// The mesh leaves holes, so that rays pass it without a hit.
    pub fn new(mesh: Arc<TileMesh>) -> Result<Self> {
        if !mesh.closes_plane {
            return Err(InputError::new(
                "tile.geometry",
                "a mesh with holes",
                "a surface without holes, as a face of a slab",
            )
            .into());
        }
        let grid = Arc::new(PeriodicGrid::new(&mesh));
        grid.prepare_rays();
        let bottom = mesh.z_range().0;
        Ok(Self { mesh, grid, bottom })
    }

    /// Follows a photon that arrives along `d` at `position` of the plane above or below the tile until it leaves. `eta` is
    /// the index below the surface over that above.
    fn pass(&self, d: DVec3, position: Vec2, eta: f64, rng: &mut ChaCha8Rng) -> Passage {
        let size = self.mesh.size;
        let lift = LIFT * size.length();
        let start = if d.z < 0.0 { self.grid.top() + lift } else { self.bottom - lift };
        let mut origin = (position.rem_euclid(size)).extend(start);
        let (mut direction, mut own) = (d, u32::MAX);
        for hits in 0..MAX_HITS {
            let to = direction.as_vec3();
            let Some(hit) = self.grid.first_hit(origin, to, own, self.bottom) else {
                // A ray that is nearly horizontal and finds nothing far away leaves to its side.
                return Passage { direction, position: origin.truncate(), hits, is_alive: true };
            };
            let up = self.mesh.geometric_normal(hit.triangle as usize).as_dvec3();
            let from_above = direction.dot(up) < 0.0;
            let h = if from_above { up } else { -up };
            let ratio = if from_above { eta } else { 1.0 / eta };
            let c = (-direction.dot(h)).max(0.0);
            let refracted =
                if rng.random::<f64>() < reflectance(c, ratio) { None } else { refract(direction, h, ratio) };
            let mirrored = (direction + 2.0 * c * h).try_normalize().unwrap_or(direction);
            direction = refracted.unwrap_or(mirrored);
            let side = if refracted.is_some() { -h } else { h };
            let at = hit.position + lift * side.as_vec3();
            origin = at.truncate().rem_euclid(size).extend(at.z);
            own = hit.triangle;
        }
        Passage { direction, position: origin.truncate(), hits: MAX_HITS, is_alive: false }
    }
}

/// A level face.
fn pass_level(d: DVec3, position: Vec2, eta: f64, rng: &mut ChaCha8Rng) -> Passage {
    let (h, ratio) = if d.z < 0.0 { (DVec3::Z, eta) } else { (-DVec3::Z, 1.0 / eta) };
    let is_reflected = rng.random::<f64>() < reflectance(d.z.abs(), ratio);
    let refracted = if is_reflected { None } else { refract(d, h, ratio) };
    Passage { direction: refracted.unwrap_or(d * DVec3::new(1.0, 1.0, -1.0)), position, hits: 1, is_alive: true }
}

impl PhotonSource for TileSlab {
    fn photon(&self, i: DVec3, rng: &mut ChaCha8Rng, exit: &mut dyn FnMut(Exit)) -> Tally {
        let eta = self.channel.eta;
        let mut losses = Tally::default();
        let (mut direction, mut weight, mut hits, mut at_top) = (-i, 1.0, 0, true);
        let mut position = Vec2::ZERO;
        let is_level = self.top.is_none() && self.bottom.is_none();
        for faces in 0..MAX_FACES {
            let (face, eta) = if at_top { (&self.top, eta) } else { (&self.bottom, 1.0 / eta) };
            let size = face.as_ref().map_or(Vec2::ONE, |face| face.mesh.size);
            if faces == 0 || self.positions == Positions::Random {
                position = Vec2::new(rng.random::<f32>(), rng.random::<f32>()) * size;
            }
            let passage = match face {
                Some(face) => face.pass(direction, position, eta, rng),
                None => pass_level(direction, position, eta, rng),
            };
            hits += passage.hits;
            if !passage.is_alive {
                break;
            }
            direction = passage.direction;
            let is_outside = (direction.z > 0.0) == at_top;
            if is_outside {
                let bounces = if at_top { usize::from(faces > 0) } else { hits.saturating_sub(2) };
                exit(Exit { direction, weight, bounces, is_straight: is_level });
                return losses;
            }
            if faces == 1 {
                losses.first_total_reflection += weight;
            }
            let part = self.channel.transmission(direction);
            losses.absorbed += weight * (1.0 - part);
            weight *= part;
            if let Positions::Kept(distance) = self.positions {
                let slope = direction.truncate() / direction.z.abs().max(1e-9);
                position = passage.position + slope.as_vec2() * distance;
            }
            at_top = !at_top;
        }
        losses.masked += weight;
        losses
    }
}
