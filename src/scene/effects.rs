//! The `[effects]` table: effects that the plan decides unless the user forces them.

use super::FieldShape;
use super::schema::{scene_choice, scene_table};

scene_choice! {
    /// State of an effect.
    Switch {
        /// The plan decides.
        Auto = "auto",
        /// Always computed.
        On = "on",
        /// Never computed.
        Off = "off",
    }
}

const SWITCH: FieldShape = FieldShape::Choice(Switch::NAMES);

scene_table! {
    /// Effects: the plan decides each one, or the user forces it on or off.
    Effects {
        /// Occlusion between facets, towards the light and the viewer.
        visibility: Switch = Switch::Auto, SWITCH, "";
        /// One exact lobe evaluation for all facets that share a normal.
        exact_lobes: Switch = Switch::Auto, SWITCH, "";
        /// Colours that differ between the facets of one material; off uses their mean.
        color_weights: Switch = Switch::Auto, SWITCH, "";
        /// Shading table: images read a table of the sum over facets if it is accurate enough.
        picture_table: Switch = Switch::Auto, SWITCH, "";
        /// Several materials; off gives all facets the material that covers the largest area.
        material_groups: Switch = Switch::Auto, SWITCH, "";
        /// Black materials are included in the sum.
        black_materials: Switch = Switch::Auto, SWITCH, "";
        /// Interreflection between facets. Auto means on where it adds more light than the preset tolerates.
        interreflection: Switch = Switch::Auto, SWITCH, "";
        /// Largest number of bounces that interreflection follows.
        bounces: usize = 64, FieldShape::Integer { min: 1, max: 64 }, "";
        /// Mirror planes of the tile halve the directions to compute; on assumes that the tile has both planes.
        mirror_symmetry: Switch = Switch::Auto, SWITCH, "";
        /// Dependence of the result on the tile's rotation; off exports `.bsdf` over three angles instead of four.
        anisotropy: Switch = Switch::Auto, SWITCH, "";
        /// Shadows that the object casts on itself.
        self_shadow: Switch = Switch::Auto, SWITCH, "";
        /// Lights that no part of the object faces, and lights too faint to change a pixel.
        faint_lights: Switch = Switch::Auto, SWITCH, "";
    }
}

impl Effects {
    /// Returns true if no effect is forced.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }
}
