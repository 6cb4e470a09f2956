//! Interreflection: the share of it that decides whether it is computed, mirror planes that save work, rays between
//! facets, and the light that they carry.

use std::sync::Arc;

use crate::base::Result;
use crate::brdf::Material;
use crate::cache::{Key, KeyBuilder};
use crate::geometry::{Facets, PeriodicGrid, mirror_planes_in};
use crate::interreflection::{
    BouncedShare, InterreflectionSettings, InterreflectionTable, LobeSampler, Transport, WalkedTile, gather,
    measure_share,
};
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

/// The materials of a surface with what walks over it need.
pub struct Reflection<'a> {
    /// The key of the materials and their slots.
    pub assignment: Key,
    pub material_of_slot: &'a [usize],
    pub materials: &'a [Material],
    pub samplers: &'a [LobeSampler],
}

impl Reflection<'_> {
    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("materials", &self.assignment).counts("material of slot", self.material_of_slot.iter().copied());
    }
}

/// Prepares the sampling of the materials' lobes.
pub struct PrepareSamplers<'a> {
    pub materials: &'a [Material],
}

impl Stage for PrepareSamplers<'_> {
    type Output = Vec<LobeSampler>;
    const NAME: &'static str = "lobe_samplers";

    fn hash_into(&self, key: &mut KeyBuilder) {
        self.materials.iter().for_each(|material| material.hash_brdf_into(key));
    }

    fn run(&self, _: &Env) -> Result<Vec<LobeSampler>> {
        Ok(self.materials.iter().map(|material| LobeSampler::new(&material.brdf)).collect())
    }
}

/// Measures the part of the reflected light that was reflected more than once.
pub struct MeasureBouncedShare<'a> {
    pub tile: &'a Keyed<TileShape>,
    pub grid: &'a PeriodicGrid,
    pub reflection: &'a Reflection<'a>,
}

impl Stage for MeasureBouncedShare<'_> {
    type Output = BouncedShare;
    const NAME: &'static str = "bounced_share";

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("tile", &self.tile.key);
        self.reflection.hash_into(key);
    }

    fn run(&self, env: &Env) -> Result<BouncedShare> {
        let Reflection { material_of_slot, materials, samplers, .. } = *self.reflection;
        let tile = WalkedTile { mesh: &self.tile.mesh, grid: self.grid, material_of_slot, materials, samplers };
        measure_share(&tile, &env.cancel)
    }
}

/// Casts rays between facets.
pub struct CastTransport<'a> {
    pub tile: &'a Keyed<TileShape>,
    pub grid: &'a Arc<PeriodicGrid>,
    pub facets: &'a Keyed<Facets>,
    pub settings: &'a InterreflectionSettings,
    /// True if the settings are refined: the rays of the main settings stay in the memo.
    pub refined: bool,
}

impl Stage for CastTransport<'_> {
    type Output = Transport;
    const NAME: &'static str = "transport";

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("tile", &self.tile.key).key("facets", &self.facets.key);
        key.counts("rays", [self.settings.elements, self.settings.useful_rays]);
    }

    fn slot(&self) -> &'static str {
        if self.refined { "refined transport" } else { Self::NAME }
    }

    fn run(&self, env: &Env) -> Result<Transport> {
        let surface = (&self.tile.mesh, self.grid.clone());
        Transport::new(surface, self.facets, self.settings.elements, self.settings.useful_rays, &env.cancel)
    }
}

/// Gathers the light that facets send to each other.
pub struct Interreflect<'a> {
    pub tile: &'a Keyed<TileShape>,
    pub facets: &'a Keyed<Facets>,
    pub visibility: &'a Keyed<Visibility>,
    pub transport: &'a Keyed<Transport>,
    pub reflection: &'a Reflection<'a>,
    pub settings: &'a InterreflectionSettings,
    /// True if the settings are refined: the light of the main settings stays in the memo.
    pub refined: bool,
}

impl Stage for Interreflect<'_> {
    type Output = InterreflectionTable;
    const NAME: &'static str = "interreflection";

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("transport", &self.transport.key).key("visibility", &self.visibility.key);
        self.reflection.hash_into(key);
        key.debug("settings", self.settings);
    }

    fn slot(&self) -> &'static str {
        if self.refined { "refined interreflection" } else { Self::NAME }
    }

    fn run(&self, env: &Env) -> Result<InterreflectionTable> {
        let Reflection { material_of_slot, materials, samplers, .. } = *self.reflection;
        gather(
            &self.tile.mesh,
            self.facets,
            &self.visibility.value,
            &self.transport.value,
            (material_of_slot, materials, samplers),
            self.settings,
            &env.cancel,
        )
    }
}
