//! The folder of the cache.

use std::ffi::OsString;
use std::path::PathBuf;

/// Returns the cache folder: the one that `BISCALE_CACHE` names, or else the system's folder for caches. Returns `None`
/// if the variable is `off` or there is no such folder. `variable` returns the value of an environment variable.
pub fn default_folder(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    let path = |name: &str| variable(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    if let Some(named) = path("BISCALE_CACHE") {
        return (named.as_os_str() != "off").then_some(named);
    }
    let base = if cfg!(windows) {
        path("LOCALAPPDATA")
    } else if cfg!(target_os = "macos") {
        path("HOME").map(|home| home.join("Library/Caches"))
    } else {
        // A relative path must be ignored (XDG Base Directory Specification 0.8).
        let named = path("XDG_CACHE_HOME").filter(|folder| folder.is_absolute());
        named.or_else(|| path("HOME").map(|home| home.join(".cache")))
    };
    base.map(|base| if cfg!(windows) { base.join("biscale").join("cache") } else { base.join("biscale") })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(variables: &[(&str, &str)]) -> Option<PathBuf> {
        default_folder(|name| variables.iter().find(|(known, _)| *known == name).map(|(_, value)| value.into()))
    }

    #[test]
    fn the_folder_is_the_named_one_or_the_systems_or_off() {
        let home = [("HOME", "/home/a"), ("LOCALAPPDATA", "/home/a")];
        let with = |name, value| of(&[home[0], home[1], (name, value)]);
        assert_eq!(with("BISCALE_CACHE", "/tmp/b"), Some("/tmp/b".into()));
        assert_eq!(with("BISCALE_CACHE", "off"), None);
        assert!(of(&home).unwrap().starts_with("/home/a"));
        assert_eq!(with("BISCALE_CACHE", ""), of(&home));
        assert_eq!(of(&[]), None);
    }

    #[cfg(all(unix, not(target_os = "macos")))]
    #[test]
    fn the_xdg_folder_is_used_only_if_it_is_absolute() {
        assert_eq!(of(&[("XDG_CACHE_HOME", "/c"), ("HOME", "/h")]), Some("/c/biscale".into()));
        assert_eq!(of(&[("XDG_CACHE_HOME", "c"), ("HOME", "/h")]), Some("/h/.cache/biscale".into()));
    }
}
