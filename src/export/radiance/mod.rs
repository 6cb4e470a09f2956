//! Radiance's BSDF in XML (the format of LBNL's WINDOW): a Klems matrix or a tensor tree, in CIE X, Y and Z.
//!
//! In Radiance, z points into the room, and WINDOW calls this side the back. Reflection on the tile's +z side is
//! therefore "Reflection Back".

mod klems;
pub mod slab;
mod tensor_tree;

use std::io::{self, Write};

use glam::Vec3;

use super::{ExportTask, Written};
use crate::scene::millimetres;

/// Division of the hemisphere into directions.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum RadianceBasis {
    /// Klems' 145 patches per hemisphere.
    #[default]
    Klems,
    /// Shirley and Chiu's equal-area squares, finer where values vary.
    TensorTree,
}

/// The parts of a file that depend on the basis.
struct Content {
    /// XML of the data definition.
    definition: String,
    /// XML that names the bases in a block of data.
    basis: &'static str,
    /// Names and values of the three channels of the reflecting side.
    channels: [(&'static str, String); 3],
    /// Values of the other side, which is black.
    black: String,
}

/// Converts linear RGB with Rec. 709 primaries to CIE X, Y, Z. X and Z are scaled so that a white surface stays
/// neutral, because Radiance's white point is equal energy.
fn xyz(rgb: Vec3) -> Vec3 {
    let rows = [
        Vec3::new(0.412_390_8, 0.357_584_3, 0.180_480_8),
        Vec3::new(0.212_639, 0.715_168_7, 0.072_192_3),
        Vec3::new(0.019_330_8, 0.119_194_8, 0.950_532_2),
    ];
    Vec3::from_array(rows.map(|row| row.dot(rgb) / row.element_sum()))
}

/// Converts back to RGB, for the reading error.
fn rgb(xyz: Vec3) -> Vec3 {
    let matrix = glam::Mat3::from_cols(self::xyz(Vec3::X), self::xyz(Vec3::Y), self::xyz(Vec3::Z));
    matrix.inverse() * xyz
}

pub fn write(task: &ExportTask<'_>, out: &mut dyn Write) -> io::Result<Written> {
    let (content, mut written) = match task.options.radiance {
        RadianceBasis::Klems => klems::tabulate(task)?,
        RadianceBasis::TensorTree => tensor_tree::tabulate(task)?,
    };
    let metres = millimetres(&task.meta.tile_unit).map_err(io::Error::other)? / 1000.0;
    header(out, &task.meta.scene, (task.meta.tile_size, 0.0, metres), &content.definition)?;
    for (name, values) in &content.channels {
        block(out, name, "Reflection Back", content.basis, values)?;
    }
    block(out, "Visible", "Reflection Front", content.basis, &content.black)?;
    writeln!(out, "</Layer>\n</Optical>\n</WindowElement>")?;
    written.conventions.extend(
        [
            "Radiance: +z of the file is our z; data are `Reflection Back` (WINDOW's name for the side towards the room), the other side is black.",
            "`BSDF` or `aBSDF` material: up vector along our y, so that x of the file is tile x.",
            "Visible (Y) is in 1/sr, no cosine; X and Z are scaled so that white is neutral in Radiance.",
        ]
        .map(str::to_owned),
    );
    Ok(written)
}

/// Everything before the blocks of data. The size and the thickness are in the unit of the tile, which has so many metres.
fn header(
    out: &mut dyn Write,
    scene: &str,
    ([x, y], thickness, metres): ([f32; 2], f32, f64),
    definition: &str,
) -> io::Result<()> {
    let [thickness, x, y] = [thickness, x, y].map(|length| (f64::from(length) * metres) as f32);
    writeln!(out, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>")?;
    writeln!(out, "<WindowElement xmlns=\"http://windows.lbl.gov\">")?;
    writeln!(out, "<WindowElementType>System</WindowElementType>\n<Optical>\n<Layer>")?;
    writeln!(out, "<Material>\n<Name>{}</Name>", escaped(scene))?;
    writeln!(out, "<Manufacturer>{}</Manufacturer>", super::meta::PROGRAM)?;
    writeln!(
        out,
        "<Thickness unit=\"meter\">{thickness}</Thickness>\n<Width unit=\"meter\">{x}</Width>\n<Height unit=\"meter\">{y}</Height>"
    )?;
    writeln!(out, "<DeviceType>Other</DeviceType>\n</Material>")?;
    writeln!(out, "<DataDefinition>\n{definition}</DataDefinition>")
}

fn block(out: &mut dyn Write, channel: &str, direction: &str, basis: &str, values: &str) -> io::Result<()> {
    let detector = if channel == "Visible" { "ASTM E308 1931 Y.dsp" } else { "None" };
    writeln!(
        out,
        "<WavelengthData>\n<LayerNumber>System</LayerNumber>\n<Wavelength unit=\"Integral\">{channel}</Wavelength>"
    )?;
    writeln!(out, "<SourceSpectrum>CIE Illuminant D65 1nm.ssp</SourceSpectrum>")?;
    writeln!(out, "<DetectorSpectrum>{detector}</DetectorSpectrum>\n<WavelengthDataBlock>")?;
    writeln!(out, "<WavelengthDataDirection>{direction}</WavelengthDataDirection>\n{basis}")?;
    writeln!(
        out,
        "<ScatteringDataType>{}</ScatteringDataType>\n<ScatteringData>\n{values}</ScatteringData>",
        if direction.starts_with("Transmission") { "BTDF" } else { "BRDF" }
    )?;
    writeln!(out, "</WavelengthDataBlock>\n</WavelengthData>")
}

/// Escapes text for XML content.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_stays_neutral_and_colours_come_back() {
        assert!((xyz(Vec3::ONE) - 1.0).abs().max_element() < 1e-6);
        let color = Vec3::new(0.2, 0.7, 0.1);
        assert!((rgb(xyz(color)) - color).abs().max_element() < 1e-5);
    }
}
