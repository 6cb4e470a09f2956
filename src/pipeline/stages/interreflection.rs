//! Interreflection: mirror planes that save work, rays between facets, and the light that they carry.

use crate::base::Result;
use crate::brdf::Material;
use crate::cache::{Key, KeyBuilder};
use crate::geometry::{Facets, PeriodicGrid, mirror_planes_in};
use crate::interreflection::{InterreflectionSettings, InterreflectionTable, Transport, gather};
use crate::pipeline::Env;
use crate::pipeline::stage::{Keyed, Stage};
use crate::visibility::Visibility;

use super::TileShape;

/// Finds the planes x = const and y = const that mirror the tile.
pub struct FindMirrorPlanes<'a> {
    pub tile: &'a Keyed<TileShape>,
    /// The grid of the tile's triangles, if it is at hand.
    pub cells: Option<&'a PeriodicGrid>,
}

impl Stage for FindMirrorPlanes<'_> {
    type Output = [bool; 2];
    const NAME: &'static str = "mirrors";

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("tile", &self.tile.key);
    }

    fn run(&self, _: &Env) -> Result<[bool; 2]> {
        Ok(mirror_planes_in(&self.tile.mesh, self.cells))
    }
}

/// Casts rays between facets.
pub struct CastTransport<'a> {
    pub tile: &'a Keyed<TileShape>,
    pub facets: &'a Keyed<Facets>,
    pub settings: &'a InterreflectionSettings,
}

impl Stage for CastTransport<'_> {
    type Output = Transport;
    const NAME: &'static str = "transport";

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("tile", &self.tile.key).key("facets", &self.facets.key);
        key.counts("rays", [self.settings.elements, self.settings.rays]);
    }

    fn run(&self, env: &Env) -> Result<Transport> {
        Transport::new(&self.tile.mesh, self.facets, self.settings.elements, self.settings.rays, &env.cancel)
    }
}

/// Gathers the light that facets send to each other.
pub struct Interreflect<'a> {
    pub tile: &'a Keyed<TileShape>,
    pub facets: &'a Keyed<Facets>,
    pub visibility: &'a Keyed<Visibility>,
    pub transport: &'a Keyed<Transport>,
    /// The key of the materials and their slots.
    pub assignment: Key,
    pub material_of_slot: &'a [usize],
    pub materials: &'a [Material],
    pub settings: &'a InterreflectionSettings,
}

impl Stage for Interreflect<'_> {
    type Output = InterreflectionTable;
    const NAME: &'static str = "interreflection";

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("transport", &self.transport.key).key("visibility", &self.visibility.key);
        key.key("materials", &self.assignment).counts("material of slot", self.material_of_slot.iter().copied());
        key.debug("settings", self.settings);
    }

    fn run(&self, env: &Env) -> Result<InterreflectionTable> {
        gather(
            &self.tile.mesh,
            self.facets,
            &self.visibility.value,
            &self.transport.value,
            (self.material_of_slot, self.materials),
            self.settings,
            &env.cancel,
        )
    }
}
