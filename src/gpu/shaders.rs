//! The shaders in `shaders/` and the one import step.
//!
//! A line `//!import name` is replaced by `shaders/name.wgsl`, which may import in turn; a file is taken in only once, at
//! its first import. To WGSL the line is a comment, so every file stays plain WGSL for editors.

use super::GpuError;

/// Every file in `shaders/`, by name without the ending.
pub const SHADERS: &[(&str, &str)] = &[
    ("gbuffer", include_str!("../../shaders/gbuffer.wgsl")),
    ("light_rays", include_str!("../../shaders/light_rays.wgsl")),
    ("shadow_map", include_str!("../../shaders/shadow_map.wgsl")),
    (
        "shadow_view",
        include_str!("../../shaders/shadow_view.wgsl"),
    ),
    ("vectors", include_str!("../../shaders/vectors.wgsl")),
];

const IMPORT: &str = "//!import ";

/// The source of a shader with its imports in place.
pub fn shader_source(name: &str) -> Result<String, GpuError> {
    let (mut source, mut taken) = (String::new(), Vec::new());
    take_in(name, &mut source, &mut taken)?;
    Ok(source)
}

fn take_in(name: &str, source: &mut String, taken: &mut Vec<String>) -> Result<(), GpuError> {
    if taken.iter().any(|known| known == name) {
        return Ok(());
    }
    taken.push(name.to_owned());
    let (_, text) = SHADERS
        .iter()
        .find(|(known, _)| *known == name)
        .ok_or_else(|| GpuError::UnknownShader(name.to_owned()))?;
    for line in text.lines() {
        match line.strip_prefix(IMPORT) {
            Some(import) => take_in(import.trim(), source, taken)?,
            None => {
                source.push_str(line);
                source.push('\n');
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn imports_are_taken_in_once_and_unknown_names_are_errors() {
        let source = shader_source("shadow_map").unwrap();
        assert_eq!(source.matches("struct View").count(), 1);
        assert!(!source.contains(IMPORT));
        assert_eq!(
            shader_source("nothing"),
            Err(GpuError::UnknownShader("nothing".to_owned()))
        );
    }
}
