//! M of each material, factored as the paper does (Wu et al. 2011, Sec. 3.4).

use std::sync::Arc;

use crate::base::Result;
use crate::brdf::Material;
use crate::cache::KeyBuilder;
use crate::effective::{MaterialFactors, Wu2011Settings};
use crate::pipeline::Env;
use crate::pipeline::stage::Stage;

/// Factors M of each material. Colours are no input, so that an edit of a colour finds the factors in the memo.
pub struct PaperTables<'a> {
    pub materials: &'a [Material],
    pub settings: &'a Wu2011Settings,
}

impl Stage for PaperTables<'_> {
    type Output = Vec<Option<Arc<MaterialFactors>>>;
    const NAME: &'static str = "basis";

    fn hash_into(&self, key: &mut KeyBuilder) {
        for material in self.materials {
            material.hash_brdf_into(key);
        }
        key.numbers("seed", &[self.settings.seed]).counts("colors", [self.settings.colors]);
    }

    fn run(&self, _: &Env) -> Result<Self::Output> {
        let mut factors: Self::Output = Vec::with_capacity(self.materials.len());
        for (k, material) in self.materials.iter().enumerate() {
            // Two colours of one BRDF share its factors.
            let known = (0..k).find(|&earlier| self.materials[earlier].same_brdf(material));
            factors.push(match known {
                Some(earlier) => factors[earlier].clone(),
                None => Some(Arc::new(MaterialFactors::new(material, self.settings)?)),
            });
        }
        Ok(factors)
    }
}
