//! Commands that know no slabs.

use anyhow::Result;

use crate::base::InputError;
use crate::scene::LoadedScene;

/// Checks that a scene has no slab, before a command that knows none reads or writes anything.
///
/// # Errors
/// The scene has a slab.
pub fn refuse(loaded: &LoadedScene, command: &str) -> Result<()> {
    if loaded.scene.slab.is_none() {
        return Ok(());
    }
    let expected = format!(
        "a scene without it: `biscale {command}` knows no slabs; `eval`, `transmit`, `render`, `export`, `fit`, `rig`, `plan` and `profile` do"
    );
    let error = InputError::new("slab", "a scene with a slab", expected).in_file(&loaded.name);
    Err(crate::Error::from(error).into())
}
