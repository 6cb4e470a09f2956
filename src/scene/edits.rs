//! Small automatic edits for `biscale profile --edit`.

use toml::{Table, Value};

use super::{FieldShape, Geometry, Kind, Scene, SlabFace, TableFace, TermSpec, TileFace};

impl Scene {
    /// Changes the first numeric parameter of the geometry by 5 % and returns its path (`tile.geometry.depth`). Returns
    /// `None` if the family has no such parameter. A value at the end of its range changes in the other direction.
    pub fn nudge_geometry(&mut self) -> Option<String> {
        let (changed, key) = nudged(&self.tile.geometry, Geometry::kinds(), self.tile.geometry.kind())?;
        self.tile.geometry = changed;
        Some(format!("tile.geometry.{key}"))
    }

    /// Changes the first numeric BRDF parameter by 5 % and returns its path. It is that of the first material with one.
    pub fn nudge_brdf(&mut self) -> Option<String> {
        for material in &mut self.materials {
            for term in material.brdf.iter_mut().flat_map(|brdf| brdf.terms_mut()) {
                if let Some((changed, key)) = nudged(term, TermSpec::kinds(), term.kind()) {
                    *term = changed;
                    return Some(format!("material.{}.brdf.{key}", material.name));
                }
            }
        }
        None
    }

    /// Changes the first face of the slab that is not smooth, and returns the path of what changed: roughnesses by 5 %, other
    /// faces by a turn of 5°.
    pub fn nudge_face(&mut self) -> Option<String> {
        let slab = self.slab.as_mut()?;
        for (side, face) in [("top", &mut slab.top), ("bottom", &mut slab.bottom)] {
            let key = match face {
                SlabFace::Smooth {} => continue,
                SlabFace::Beckmann(rough) | SlabFace::Ggx(rough) => {
                    rough.roughness *= if rough.roughness.max_element() > 1.9 { 0.95 } else { 1.05 };
                    "roughness"
                }
                SlabFace::Table(TableFace { rotation_deg, .. }) | SlabFace::Tile(TileFace { rotation_deg, .. }) => {
                    *rotation_deg += if *rotation_deg > 350.0 { -5.0 } else { 5.0 };
                    "rotation_deg"
                }
            };
            return Some(format!("slab.{side}.{key}"));
        }
        None
    }

    /// Changes the index of the slab by 0.05 and returns its path. A captured sheet has an index of its own.
    pub fn nudge_eta(&mut self) -> Option<String> {
        let slab = self.slab.as_mut().filter(|slab| slab.svbtdf.is_none())?;
        slab.eta += if slab.eta.max_element() > 3.9 { -0.05 } else { 0.05 };
        Some("slab.eta".to_owned())
    }

    /// Makes the slab thicker, by 5 % or from nothing to 0.05 tile units, and returns the path of its thickness.
    pub fn nudge_thickness(&mut self) -> Option<String> {
        let slab = self.slab.as_mut().filter(|slab| slab.svbtdf.is_none())?;
        slab.thickness = if slab.thickness > 0.0 { slab.thickness * 1.05 } else { 0.05 };
        Some("slab.thickness".to_owned())
    }

    /// Makes the first material's colour 5 % darker and returns its path.
    pub fn nudge_color(&mut self) -> Option<String> {
        let material = self.materials.first_mut()?;
        material.color *= 0.95;
        Some(format!("material.{}.color", material.name))
    }
}

/// Copies the item, changes one parameter of the copy, and returns the copy and the parameter's key. The parameter is
/// the first number, else the first colour, else the first whole number.
fn nudged<T>(item: &T, kinds: Vec<Kind>, kind: &str) -> Option<(T, &'static str)>
where
    T: serde::Serialize + serde::de::DeserializeOwned,
{
    let kind = kinds.into_iter().find(|candidate| candidate.kind == kind)?;
    let mut table = Table::try_from(item).ok()?;
    let rank = |shape: &FieldShape| match shape {
        FieldShape::Number { .. } => Some(0),
        FieldShape::Color { .. } => Some(1),
        FieldShape::Integer { .. } => Some(2),
        _ => None,
    };
    let mut fields: Vec<_> = kind.fields.iter().filter_map(|field| Some((rank(&field.shape)?, field))).collect();
    fields.sort_by_key(|(rank, _)| *rank);
    let field = fields.into_iter().map(|(_, field)| field).find(|field| table.contains_key(field.key))?;
    let value = table.get_mut(field.key)?;
    *value = match (&*value, field.shape) {
        (Value::Float(number), FieldShape::Number { min, max, soft_max }) => {
            Value::Float(step(*number, min, max, soft_max - min))
        }
        (Value::Integer(number), FieldShape::Integer { min, max }) => {
            let by = (number / 20).max(1);
            Value::Integer(if number + by <= max { number + by } else { (number - by).max(min) })
        }
        (Value::Array(values), FieldShape::Color { max }) => {
            let changed =
                values.iter().filter_map(Value::as_float).map(|number| Value::Float(step(number, 0.0, max, 1.0)));
            Value::Array(changed.collect())
        }
        _ => return None,
    };
    Some((table.try_into().ok()?, field.key))
}

fn step(number: f64, min: f64, max: f64, span: f64) -> f64 {
    let by = if number == 0.0 { 0.05 * span } else { 0.05 * number };
    if (min..=max).contains(&(number + by)) { number + by } else { (number - by).clamp(min, max) }
}
