//! The folders of a result, created if they are missing.

use std::fs;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// Folders that were created for a result. When dropped, it removes those that are still empty, so that a command that refuses leaves nothing behind.
#[derive(Debug)]
pub struct Parents {
    /// From the outermost to the innermost.
    made: Vec<PathBuf>,
}

impl Parents {
    /// Creates the missing folders above `target`.
    pub fn create(target: &Path) -> Result<Self> {
        let folder = folder(target);
        let missing = folder
            .ancestors()
            .take_while(|path| !path.as_os_str().is_empty() && !path.exists());
        let mut missing: Vec<PathBuf> = missing.map(Path::to_owned).collect();
        missing.reverse();
        let mut parents = Self { made: Vec::new() };
        for path in missing {
            match fs::create_dir(&path) {
                Ok(()) => parents.made.push(path),
                // Another command created it meanwhile, so this one must not remove it.
                Err(_) if path.is_dir() => {}
                Err(error) => return Err(refused(target, &path, &error)),
            }
        }
        match folder.is_dir() {
            true => Ok(parents),
            false => Err(refused(
                target,
                folder,
                &std::io::ErrorKind::NotADirectory.into(),
            )),
        }
    }
}

fn refused(target: &Path, folder: &Path, error: &std::io::Error) -> Error {
    Error::io(target, error).map(|refused| {
        refused.problem = format!(
            "its folder {} cannot be created: {}",
            folder.display(),
            refused.problem
        );
    })
}

impl Drop for Parents {
    fn drop(&mut self) {
        // The folder of the result is not empty, and stays.
        for path in self.made.iter().rev() {
            let _ = fs::remove_dir(path);
        }
    }
}

/// The folder that contains `path`.
pub(crate) fn folder(path: &Path) -> &Path {
    let parent = path.parent().filter(|p| !p.as_os_str().is_empty());
    parent.unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_stay_if_something_was_written_into_them_and_only_then() {
        let place = tempfile::tempdir().unwrap();
        let target = place.path().join("a/b/x.toml");
        let parents = Parents::create(&target).unwrap();
        assert!(place.path().join("a/b").is_dir());
        drop(parents);
        assert!(!place.path().join("a").exists());
        let parents = Parents::create(&target).unwrap();
        fs::write(&target, "x").unwrap();
        drop(parents);
        assert!(target.is_file());
        // What was there before stays, empty or not.
        fs::create_dir(place.path().join("empty")).unwrap();
        drop(Parents::create(&place.path().join("empty/c/x")).unwrap());
        assert!(place.path().join("empty").is_dir() && !place.path().join("empty/c").exists());
    }

    #[test]
    fn a_folder_that_cannot_be_created_is_named() {
        let place = tempfile::tempdir().unwrap();
        fs::write(place.path().join("file"), "").unwrap();
        for below in ["file/x.toml", "file/deeper/x.toml"] {
            let error = Parents::create(&place.path().join(below)).unwrap_err();
            let error = error.to_string();
            assert!(
                error.contains(below) && error.contains("cannot be created: not a directory"),
                "{error}"
            );
        }
    }
}
