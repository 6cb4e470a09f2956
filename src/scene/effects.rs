//! The `[effects]` table: what the plan decides by itself unless a person forces it.

use super::FieldShape;
use super::schema::{scene_choice, scene_table};

scene_choice! {
    /// Whether an effect is computed.
    Switch {
        /// As the plan decides.
        Auto = "auto",
        /// In any case.
        On = "on",
        /// In no case.
        Off = "off",
    }
}

const SWITCH: FieldShape = FieldShape::Choice(Switch::NAMES);

scene_table! {
    /// Effects, each as the plan decides or forced on or off.
    Effects {
        /// Facets hide each other from light and viewer.
        visibility: Switch = Switch::Auto, SWITCH, "";
        /// One exact lobe for all facets that share a normal.
        exact_lobes: Switch = Switch::Auto, SWITCH, "";
        /// Colours that differ between the facets of one material; off takes their mean.
        color_weights: Switch = Switch::Auto, SWITCH, "";
        /// Pictures read a table of the sum over facets, where it is close enough.
        picture_table: Switch = Switch::Auto, SWITCH, "";
        /// Several materials; off gives all facets the one that covers most.
        material_groups: Switch = Switch::Auto, SWITCH, "";
        /// Black materials are summed like any other.
        black_materials: Switch = Switch::Auto, SWITCH, "";
        /// Light that facets send to each other. Auto is off: the paper's definition leaves it out.
        interreflection: Switch = Switch::Auto, SWITCH, "";
        /// Reflections between facets that are followed, where they are.
        bounces: usize = 4, FieldShape::Integer { min: 1, max: 64 }, "";
        /// Planes that mirror the tile spare half of the directions; on takes the tile to have both.
        mirror_symmetry: Switch = Switch::Auto, SWITCH, "";
        /// The result turns with the tile; off tabulates it over three angles in place of four where a format can (.bsdf).
        anisotropy: Switch = Switch::Auto, SWITCH, "";
        /// The object's shadows on itself.
        self_shadow: Switch = Switch::Auto, SWITCH, "";
        /// Lights that no part of the object faces, or too faint to be seen.
        faint_lights: Switch = Switch::Auto, SWITCH, "";
    }
}

impl Effects {
    /// Is nothing forced?
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }
}
