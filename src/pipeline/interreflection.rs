//! Light between facets, as a stage.

use std::sync::Arc;

use super::stage::Version;
use super::{OutcomeKey, Pipeline, StageTimes, TileShape};
use crate::base::Result;
use crate::effective::Material;
use crate::geometry::{Facets, mirror_planes};
use crate::interreflection::{InterreflectionTable, Transport, gather};
use crate::plan::Settings;
use crate::scene::Switch;
use crate::visibility::Visibility;

impl Pipeline {
    /// Planes that mirror the tile, looked for where light between facets would use them.
    pub(super) fn mirror_planes(
        &mut self,
        shape: &TileShape,
        version: Version,
        settings: &Settings,
        times: &mut StageTimes,
    ) -> Result<Option<[bool; 2]>> {
        let effects = &settings.effects;
        match (effects.interreflection, effects.mirror_symmetry) {
            (Switch::On, Switch::Auto) if !shape.flat => {
                let find = || Ok(mirror_planes(&shape.mesh));
                Ok(Some(*self.mirrors.get("mirrors", version, times, &self.cancel, find)?.0))
            }
            _ => Ok(None),
        }
    }

    /// What facets send to each other; rays are cast anew only for other facets.
    pub(super) fn between_facets(
        &mut self,
        shape: &TileShape,
        (facets, visibility, materials, material_of_slot): (&Facets, &Visibility, &[Material], &[usize]),
        settings: &Settings,
        mirrors: [bool; 2],
        (facets_version, key): (Version, OutcomeKey),
        times: &mut StageTimes,
    ) -> Result<Arc<InterreflectionTable>> {
        let mut knobs = settings.interreflection();
        knobs.mirrors = mirrors;
        let cancel = &self.cancel;
        let rays = (facets_version, knobs.elements, knobs.rays);
        let (transport, _) = self.transport.get("transport", rays, times, cancel, || {
            Transport::new(&shape.mesh, facets, knobs.elements, knobs.rays, cancel)
        })?;
        let (table, _) = self.interreflection.get("interreflection", key, times, cancel, || {
            gather(&shape.mesh, facets, visibility, &transport, (material_of_slot, materials), &knobs, cancel)
        })?;
        Ok(table)
    }
}
