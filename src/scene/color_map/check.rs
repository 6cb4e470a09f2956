//! Rules that relate several keys of a colour map.

use glam::Vec3;

use super::{ColorLayer, ColorMap, Combine, Driver, GaussianSurface, MAX_CELLS};
use crate::scene::check::{PathStep, Problem};
use crate::scene::{Geometry, Scene};

/// Makes the error of a key: path, found, expected.
type MakeProblem<'a> = dyn Fn(&[PathStep], &str, &str) -> Result<(), Problem> + 'a;

impl ColorMap {
    /// Checks rules that relate several keys.
    pub(in crate::scene) fn check(&self, scene: &Scene) -> Result<(), Problem> {
        let key = |name: &str| PathStep::Key(name.to_owned());
        let problem = |path: &[PathStep], found: &str, expected: &str| {
            let path: Vec<PathStep> = std::iter::once(key("color_map")).chain(path.iter().cloned()).collect();
            Err(Problem::new(&path, found, expected))
        };
        if self.layer.is_empty() {
            return problem(&[key("layer")], "no layers", "at least one `[[color_map.layer]]`");
        }
        if !matches!(self.taps, 1 | 4 | 16) {
            return problem(&[key("taps")], &self.taps.to_string(), "1, 4 or 16");
        }
        if let Some(GaussianSurface { slope_covariance: Vec3 { x, y, z }, .. }) = self.surface {
            let is_sound =
                x >= 0.0 && z >= 0.0 && f64::from(y) * f64::from(y) <= f64::from(x) * f64::from(z) * (1.0 + 1e-6);
            if !is_sound {
                let path = [key("surface"), key("slope_covariance")];
                return problem(
                    &path,
                    &format!("[{x}, {y}, {z}]"),
                    "a positive semi-definite matrix: xx ≥ 0, yy ≥ 0, xy² ≤ xx yy",
                );
            }
        }
        let no_relief = matches!(scene.tile.geometry, Geometry::Flat(_)) && self.surface.is_none();
        for (index, layer) in self.layer.iter().enumerate() {
            let entry = PathStep::Entry(index, Some(layer.name.clone()).filter(|name| !name.is_empty()));
            let at = [key("layer"), entry.clone(), key("driver")];
            let earlier = &self.layer[..index];
            if !layer.name.is_empty() && earlier.iter().any(|other| other.name == layer.name) {
                let path = [key("layer"), entry, key("name")];
                return problem(&path, &format!("`{}` a second time", layer.name), "each name once");
            }
            for driver in layer.drivers().flat_map(Driver::parts) {
                match driver {
                    Driver::Texture(texture) if texture.path.as_os_str().is_empty() => {
                        return problem(&[&at[..], &[key("path")]].concat(), "nothing", "an image");
                    }
                    Driver::Noise(noise) if noise.cells << (noise.octaves - 1) > MAX_CELLS => {
                        let found = format!("{} cells in {} octaves", noise.cells, noise.octaves);
                        let expected =
                            format!("at most {MAX_CELLS} cells in the finest octave: cells x 2^(octaves - 1)");
                        return problem(&[&at[..], &[key("cells")]].concat(), &found, &expected);
                    }
                    driver if driver.is_of_surface() && no_relief => {
                        let found = format!("`{}` on a flat tile", driver.kind());
                        return problem(&at, &found, "a tile with relief, or `[color_map.surface]`");
                    }
                    _ => {}
                }
            }
        }
        self.check_dependence(&problem)
    }

    /// Refuses products of layers whose drivers depend on each other and that cannot be merged.
    fn check_dependence(&self, problem: &MakeProblem<'_>) -> Result<(), Problem> {
        let key = |name: &str| PathStep::Key(name.to_owned());
        for (index, layer) in self.layer.iter().enumerate() {
            let with_blend: Vec<&Driver> = layer.drivers().collect();
            let earlier = self.layer[..index].iter().flat_map(ColorLayer::drivers);
            let others: Vec<&Driver> = if self.combine == Combine::Product { earlier.collect() } else { Vec::new() };
            let pairs = with_blend.iter().flat_map(|a| others.iter().map(move |b| (*a, *b)));
            let own = (with_blend.len() == 2).then(|| (with_blend[0], with_blend[1]));
            for (a, b) in pairs.chain(own) {
                if !can_multiply(a, b) {
                    let path = [key("layer"), PathStep::Entry(index, None), key("driver")];
                    let found =
                        format!("a product of maps of `{}` and `{}`, which depend on each other", a.kind(), b.kind());
                    return problem(&path, &found, "equal drivers, independent ones, or one map of their sum");
                }
            }
        }
        Ok(())
    }
}

/// Returns true if the mean of the product of two maps can be computed: the drivers are equal, independent, or both are
/// functions of the slope.
fn can_multiply(a: &Driver, b: &Driver) -> bool {
    let is_slope = |driver: &Driver| matches!(driver, Driver::Slope(_) | Driver::Steepness(_));
    let depends = |a: &Driver, b: &Driver| match (a, b) {
        (Driver::Height(_), Driver::Height(_)) => true,
        (a, b) if is_slope(a) && is_slope(b) => true,
        (a, b) => a == b,
    };
    if a == b || is_slope(a) && is_slope(b) || matches!((a, b), (Driver::Height(_), Driver::Height(_))) {
        return true;
    }
    !a.parts().iter().any(|a| b.parts().iter().any(|b| depends(a, b)))
}
