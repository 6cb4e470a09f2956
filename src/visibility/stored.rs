//! Visibility as it is kept between runs, and as an input of what is.

use super::occlusion_intervals::Overhangs;
use super::{HorizonMap, OcclusionIntervals, PackedVisibility, SoftMaps, Visibility};
use crate::cache::{KeyBuilder, Reader, Stored, Writer};
use crate::math::directions::PolarGrid;

impl Visibility {
    /// All that the visibilities of facets depend on.
    pub(crate) fn hash_into(&self, key: &mut KeyBuilder) {
        match self {
            Self::Unblocked { facets } => key.counts("unblocked", [*facets]),
            Self::HorizonMap(horizons) => identify_horizons(horizons, key),
            Self::OcclusionIntervals(slices) => {
                identify_horizons(&slices.horizons, key);
                for Overhangs { facets, low, high, .. } in &slices.hanging {
                    key.numbers("above", facets).numbers("from", low).numbers("to", high);
                }
                key.numbers("switch", &slices.switch)
            }
            Self::Maps(SoftMaps { grid, packed }) => {
                key.counts("maps", [grid.rings, grid.azimuths, packed.facet_count, packed.direction_count]);
                key.numbers("bits", &packed.words)
            }
        };
    }
}

fn identify_horizons<'a>(horizons: &HorizonMap, key: &'a mut KeyBuilder) -> &'a mut KeyBuilder {
    key.counts("horizons", [horizons.azimuths, horizons.facets]).numbers("ramp", &[horizons.ramp]);
    key.numbers("elevations", &horizons.elevations)
}

/// What stands first.
const UNBLOCKED: usize = 0;
const HORIZONS: usize = 1;
const SLICES: usize = 2;
const MAPS: usize = 3;

impl Stored for Visibility {
    fn write(&self, out: &mut Writer) {
        match self {
            Self::Unblocked { facets } => {
                out.count(UNBLOCKED);
                out.count(*facets);
            }
            Self::HorizonMap(horizons) => {
                out.count(HORIZONS);
                write_horizons(horizons, out);
            }
            Self::OcclusionIntervals(slices) => {
                out.count(SLICES);
                write_horizons(&slices.horizons, out);
                out.numbers(&slices.switch);
                for Overhangs { facets, low, high, .. } in &slices.hanging {
                    out.numbers(facets);
                    out.numbers(low);
                    out.numbers(high);
                }
            }
            Self::Maps(SoftMaps { grid, packed }) => {
                out.count(MAPS);
                let counts = [grid.rings, grid.azimuths, packed.facet_count, packed.direction_count];
                counts.into_iter().for_each(|count| out.count(count));
                out.numbers(&packed.words);
            }
        }
    }

    fn read(from: &mut Reader<'_>) -> Option<Self> {
        Some(match from.count()? {
            UNBLOCKED => Self::Unblocked { facets: from.count()? },
            HORIZONS => Self::HorizonMap(read_horizons(from)?),
            SLICES => {
                let horizons = read_horizons(from)?;
                let switch: Vec<f32> = from.numbers().filter(|switch: &Vec<f32>| switch.len() == horizons.facets)?;
                let hanging = (0..horizons.azimuths).map(|_| {
                    let (facets, low, high): (Vec<u32>, Vec<f32>, Vec<f32>) =
                        (from.numbers()?, from.numbers()?, from.numbers()?);
                    let fits = facets.is_sorted()
                        && facets.last().is_none_or(|last| (*last as usize) < horizons.facets)
                        && [low.len(), high.len()] == [facets.len(); 2];
                    let intervals =
                        facets.into_iter().zip(low).zip(high).map(|((facet, low), high)| (facet, low, high));
                    fits.then(|| Overhangs::new(intervals, &switch))
                });
                let hanging = hanging.collect::<Option<_>>()?;
                Self::OcclusionIntervals(OcclusionIntervals { horizons, hanging, switch })
            }
            MAPS => {
                let [rings, azimuths] = [from.count()?, from.count()?];
                let [facet_count, direction_count] = [from.count()?, from.count()?];
                let words: Vec<u32> = from.numbers()?;
                let fits = rings.checked_mul(azimuths)? > 0
                    && facet_count.div_ceil(32).checked_mul(direction_count)? == words.len();
                let grid =
                    fits.then(|| PolarGrid::new(rings, azimuths)).filter(|grid| grid.len() == direction_count)?;
                Self::Maps(SoftMaps { grid, packed: PackedVisibility { facet_count, direction_count, words } })
            }
            _ => return None,
        })
    }
}

fn write_horizons(horizons: &HorizonMap, out: &mut Writer) {
    [horizons.azimuths, horizons.facets, horizons.truncated].into_iter().for_each(|count| out.count(count));
    out.numbers(&[horizons.ramp]);
    out.numbers(&horizons.elevations);
}

fn read_horizons(from: &mut Reader<'_>) -> Option<HorizonMap> {
    let [azimuths, facets, truncated] = [from.count()?, from.count()?, from.count()?];
    let ramp = from.numbers()?.first().copied()?;
    let elevations: Vec<f32> = from.numbers()?;
    let fits = azimuths > 0 && azimuths.checked_mul(facets)? == elevations.len();
    fits.then_some(HorizonMap { azimuths, facets, ramp, elevations, truncated })
}
