//! Checks of an output before the computation of its content: the place can be written, and it holds no input.

use std::fs::{self, File, Metadata};
use std::io;
use std::path::{Path, PathBuf};

use super::{InputError, Result};

/// Checks that a file can be written at `path` and that it replaces none of `inputs`. An input is recognised through
/// symbolic and hard links. Standard output (`-`), devices and pipes pass.
///
/// # Errors
/// The folder is missing or cannot be written, the place is taken by a folder or a read-only file, or it is an input.
pub fn check_output(path: &Path, inputs: &[PathBuf]) -> Result<()> {
    if path == Path::new("-") {
        return Ok(());
    }
    let refused = |found: String, expected: &str| InputError::new("output", found, expected).in_file(path).into();
    let unwritable = |error: io::Error| refused(error.to_string(), "a place that can be written");
    let ends_in_separator = path.to_string_lossy().ends_with(std::path::is_separator);
    match fs::metadata(path) {
        Ok(there) if there.is_dir() => return Err(refused("a folder".to_owned(), "a name for a file")),
        // A device or a pipe is written directly.
        Ok(there) if !there.is_file() => return Ok(()),
        Ok(there) if there.permissions().readonly() => {
            return Err(refused("a file that is read-only".to_owned(), "a place that can be written"));
        }
        Ok(there) => {
            if let Some(input) = inputs.iter().find(|input| is_same_file(input, path, &there)) {
                let found = format!("an input (`{}`)", input.display());
                return Err(refused(found, "another place, so that the input stays"));
            }
        }
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(unwritable(error)),
        Err(_) if path.file_name().is_none() || ends_in_separator => {
            return Err(refused("no name of a file".to_owned(), "a name for a file"));
        }
        Err(_) => {}
    }
    // The file replaces the target of a link, so the folder of the target counts.
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let folder = match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        return Err(refused(format!("no folder `{}`", folder.display()), "a folder that exists"));
    }
    create_and_remove(folder).map_err(unwritable)
}

/// Returns true if `input` is the file at `path`, whose metadata is `there`.
fn is_same_file(input: &Path, path: &Path, there: &Metadata) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let _ = path;
        fs::metadata(input).is_ok_and(|input| (input.dev(), input.ino()) == (there.dev(), there.ino()))
    }
    #[cfg(not(unix))]
    {
        let _ = there;
        fs::canonicalize(input).is_ok_and(|input| fs::canonicalize(path).is_ok_and(|path| input == path))
    }
}

/// Creates an empty file in a folder and removes it. Permissions alone do not tell whether that is possible.
fn create_and_remove(folder: &Path) -> io::Result<()> {
    const MAX_TRIES: u32 = 1000;
    let mut attempt = 0;
    loop {
        let probe = folder.join(format!(".biscale.{}-{attempt}.part", std::process::id()));
        match File::create_new(&probe) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists && attempt < MAX_TRIES => attempt += 1,
            created => return created.and_then(|_| fs::remove_file(probe)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_that_cannot_be_written_are_refused_and_nothing_is_left_in_the_folder() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("folder")).unwrap();
        fs::write(at("old"), "old").unwrap();
        for name in ["new", "old"] {
            check_output(&at(name), &[]).unwrap();
        }
        check_output(Path::new("-"), &[]).unwrap();
        let long = "x".repeat(300);
        for name in ["folder", "none/new", "old/new", "new/", "", long.as_str()] {
            let place = if name.is_empty() { PathBuf::new() } else { at(name) };
            let error = check_output(&place, &[]).unwrap_err();
            assert_eq!(error.exit_code(), 2, "{name}: {error}");
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
        assert_eq!(fs::read(at("old")).unwrap(), b"old");
    }

    #[test]
    fn an_input_is_refused_under_each_of_its_names() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("input"), "content").unwrap();
        fs::write(at("other"), "content").unwrap();
        let mut names = vec![at("input"), at("./input"), folder.path().join(".").join("input")];
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink("input", at("symbolic")).unwrap();
            fs::hard_link(at("input"), at("hard")).unwrap();
            names.extend([at("symbolic"), at("hard")]);
        }
        let inputs = [at("missing"), at("input")];
        for name in names {
            let error = check_output(&name, &inputs).unwrap_err();
            assert!(error.to_string().contains("input") && error.exit_code() == 2, "{error}");
        }
        check_output(&at("other"), &inputs).unwrap();
    }
}
