//! The catalogue of scene keys: name, unit, range and meaning of each. Validation, the editor's sliders and the
//! documentation read the same entries.

use crate::base::capitalized;

/// One key of a scene file.
#[derive(Debug, Clone)]
pub struct Field {
    pub key: &'static str,
    /// Unit such as `tile units` or `degrees`, or empty.
    pub unit: &'static str,
    pub shape: FieldShape,
    /// Default of a numeric key.
    pub default: Option<f64>,
    pub required: bool,
    /// One line that explains the key, for tooltips and the documentation.
    pub doc: &'static str,
}

impl Field {
    pub fn new(
        key: &'static str,
        unit: &'static str,
        shape: FieldShape,
        default: Option<f64>,
        doc: &'static str,
    ) -> Self {
        Self { key, unit, shape, default, required: false, doc: doc.trim_ascii() }
    }

    pub fn required(key: &'static str, shape: FieldShape, doc: &'static str) -> Self {
        Self { required: true, ..Self::new(key, "", shape, None, doc) }
    }

    /// The key as a caption: `side_angle_deg` becomes `Side angle`.
    pub fn label(&self) -> String {
        capitalized(&self.key.trim_end_matches("_deg").replace('_', " "))
    }
}

/// Type and range of a key's value. Ranges are inclusive.
#[derive(Debug, Clone, Copy)]
pub enum FieldShape {
    /// Any number in `min..=max`. A slider ends at `soft_max`; larger values are legal but rarely useful.
    Number {
        min: f64,
        max: f64,
        soft_max: f64,
    },
    Integer {
        min: i64,
        max: i64,
    },
    /// A linear RGB triple of numbers in `0..=max`, or one number for all three.
    Color {
        max: f64,
    },
    Vector {
        length: usize,
        min: f64,
        max: f64,
    },
    Bool,
    Text,
    /// A file, relative to the scene file, or `asset:name` for one that ships in the binary.
    Path,
    Choice(&'static [&'static str]),
    /// Gradient stops `[value, [r, g, b]]` of ascending values; colours reach up to `max_color`.
    Stops {
        max_color: f64,
    },
    Table(fn() -> Vec<Field>),
    /// A table whose `kind` selects its keys.
    Tagged(fn() -> Vec<Kind>),
    List {
        of: &'static FieldShape,
        min: usize,
        max: usize,
    },
    /// Alternatives; the first one with the value's TOML type applies.
    AnyOf(&'static [FieldShape]),
}

/// One alternative of a table with `kind`, such as a geometry family, a BRDF model or a face of a slab.
#[derive(Debug, Clone)]
pub struct Kind {
    pub kind: &'static str,
    pub doc: &'static str,
    pub fields: Vec<Field>,
}

/// A number in `min..=max`.
pub const fn number(min: f64, max: f64) -> FieldShape {
    FieldShape::Number { min, max, soft_max: max }
}

/// A length in tile units, at most a hundred times the largest tile size; sliders end at `soft_max`.
pub const fn length(min: f64, soft_max: f64) -> FieldShape {
    FieldShape::Number { min, max: 1e8, soft_max }
}

/// Default of a field in the catalogue; only numbers have one.
pub trait DefaultNumber {
    fn default_number(&self) -> Option<f64> {
        None
    }
}

macro_rules! numeric_defaults {
    ($($number:ty),*) => { $(impl DefaultNumber for $number {
        fn default_number(&self) -> Option<f64> {
            Some(*self as f64)
        }
    })* };
}
numeric_defaults!(f32, u32, u64, usize);

impl<T> DefaultNumber for Option<T> {}
impl DefaultNumber for bool {}
impl DefaultNumber for String {}
impl DefaultNumber for glam::Vec2 {}
impl DefaultNumber for glam::Vec3 {}
impl<T> DefaultNumber for Vec<T> {}

/// Declares a scene table: its serde struct, its defaults and its catalogue entries (`Type::fields()`).
macro_rules! scene_table {
    ($(#[doc = $struct_doc:literal])* $name:ident {
        $( #[doc = $doc:literal] $(#[$attribute:meta])* $field:ident: $type:ty = $default:expr, $shape:expr, $unit:literal; )*
    }) => {
        $(#[doc = $struct_doc])*
        #[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct $name {
            $( #[doc = $doc] $(#[$attribute])* pub $field: $type, )*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $( $field: $default, )* }
            }
        }

        impl $name {
            /// The catalogue entries of this table, in the order of the fields.
            pub fn fields() -> Vec<$crate::scene::Field> {
                let defaults = Self::default();
                vec![ $( $crate::scene::Field::new(
                    stringify!($field), $unit, $shape,
                    $crate::scene::schema::DefaultNumber::default_number(&defaults.$field), $doc,
                ), )* ]
            }
        }
    };
}
pub(super) use scene_table;

/// Declares a field-less enum that is read and written as the given names, and the list of these names.
macro_rules! scene_choice {
    ($(#[doc = $enum_doc:literal])* $name:ident { $( #[doc = $doc:literal] $variant:ident = $text:literal, )* }) => {
        $(#[doc = $enum_doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
        pub enum $name {
            $( #[doc = $doc] #[serde(rename = $text)] $variant, )*
        }

        impl $name {
            pub const NAMES: &[&str] = &[$($text),*];
            pub const ALL: &[Self] = &[$(Self::$variant),*];

            pub fn name(self) -> &'static str {
                match self { $( Self::$variant => $text, )* }
            }
        }

        impl $crate::scene::schema::DefaultNumber for $name {}
    };
}
pub(super) use scene_choice;
