//! Storage of [`Visibility`] in the disk cache, and its contribution to the keys of later stages.

use glam::Vec2;

use super::occlusion_intervals::Overhangs;
use super::{HorizonMap, OcclusionIntervals, PackedVisibility, SoftMaps, Visibility};
use crate::cache::{Reader, Stored, Writer};
use crate::math::directions::PolarGrid;

/// Tags of the variants, at the start of the stored data.
const UNBLOCKED: usize = 0;
const HORIZON_MAP: usize = 1;
const INTERVALS: usize = 2;
const MAPS: usize = 3;

impl Stored for Visibility {
    fn write(&self, out: &mut Writer) {
        match self {
            Self::Unblocked { facets } => {
                out.count(UNBLOCKED);
                out.count(*facets);
            }
            Self::HorizonMap(horizon_map) => {
                out.count(HORIZON_MAP);
                write_horizon_map(horizon_map, out);
            }
            Self::OcclusionIntervals(intervals) => {
                out.count(INTERVALS);
                write_horizon_map(&intervals.horizon_map, out);
                out.numbers(&intervals.switch);
                for Overhangs { facets, low, high, .. } in &intervals.overhangs {
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
            HORIZON_MAP => Self::HorizonMap(read_horizon_map(from)?),
            INTERVALS => {
                let horizon_map = read_horizon_map(from)?;
                let switch: Vec<f32> = from.numbers().filter(|switch: &Vec<f32>| switch.len() == horizon_map.facets)?;
                let overhangs = (0..horizon_map.azimuths).map(|_| {
                    let (facets, low, high): (Vec<u32>, Vec<f32>, Vec<f32>) =
                        (from.numbers()?, from.numbers()?, from.numbers()?);
                    let fits = facets.is_sorted()
                        && facets.last().is_none_or(|last| (*last as usize) < horizon_map.facets)
                        && [low.len(), high.len()] == [facets.len(); 2];
                    let intervals =
                        facets.into_iter().zip(low).zip(high).map(|((facet, low), high)| (facet, low, high));
                    fits.then(|| Overhangs::new(intervals, &switch))
                });
                let overhangs = overhangs.collect::<Option<_>>()?;
                Self::OcclusionIntervals(OcclusionIntervals { horizon_map, overhangs, switch })
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

fn write_horizon_map(horizon_map: &HorizonMap, out: &mut Writer) {
    [horizon_map.azimuths, horizon_map.facets, horizon_map.truncated].into_iter().for_each(|count| out.count(count));
    out.numbers(&[horizon_map.transition_width]);
    out.numbers(&horizon_map.across.map_or_else(Vec::new, |across| across.to_array().to_vec()));
    out.numbers(&horizon_map.slopes);
}

fn read_horizon_map(from: &mut Reader<'_>) -> Option<HorizonMap> {
    let [azimuths, facets, truncated] = [from.count()?, from.count()?, from.count()?];
    let transition_width = from.numbers()?.first().copied()?;
    let across = from.numbers::<f32>()?.first_chunk().map(|across| Vec2::from_array(*across));
    let slopes: Vec<f32> = from.numbers()?;
    let fits = azimuths > 0
        && azimuths.checked_mul(facets)? == slopes.len()
        && (across.is_none() || azimuths == HorizonMap::AZIMUTHS_OF_GROOVES);
    fits.then(|| HorizonMap::stored([azimuths, facets, truncated], across, transition_width, slopes))
}
