//! A directory that appears whole or not at all.

use std::fs::{self, File};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use super::manifest::MANIFEST_FILE;
use crate::error::{Argument, Error, Result};
use crate::parents::{Parents, folder};

/// Files that a recording consists of; only these are ever deleted.
const OWN_FILES: [&str; 4] = [MANIFEST_FILE, "samples.csv", "samples.parquet", "means.csv"];

/// A directory under a temporary name beside the target, on the same file system, so that one
/// rename makes it appear. It is removed when dropped.
#[derive(Debug)]
pub(super) struct Staging {
    path: PathBuf,
    target: PathBuf,
    replace: bool,
    /// Dropped after the directory has been removed, so that these folders are empty.
    _parents: Parents,
}

impl Staging {
    /// Creates the temporary directory, after checking that `target` can be written in the end.
    pub fn create(target: &Path, replace: bool) -> Result<Staging> {
        check_target(target, Some(replace))?;
        let parents = Parents::create(target)?;
        let path = sibling(target, "new")?;
        Ok(Staging {
            path,
            target: target.to_owned(),
            replace,
            _parents: parents,
        })
    }

    /// Where to write the files.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Where the directory will be.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Writes a file and waits until it is on the disk.
    pub fn write_file(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let path = self.path.join(name);
        File::create(&path)
            .and_then(|mut file| {
                file.write_all(bytes)?;
                file.sync_all()
            })
            .map_err(|error| Error::io(&path, &error))
    }

    /// Gives the directory its name.
    pub fn publish(self) -> Result<()> {
        // Checked again: hours may have passed since the start.
        check_target(&self.target, Some(self.replace))?;
        sync_directory(&self.path);
        let old = if self.target.exists() {
            // A directory with files cannot be replaced by a rename, so the old one is renamed first.
            let aside = sibling(&self.target, "old")?;
            let old = aside.join("recording");
            fs::rename(&self.target, &old).map_err(|error| {
                let _ = fs::remove_dir(&aside);
                Error::io(&self.target, &error)
            })?;
            Some((aside, old))
        } else {
            None
        };
        if let Err(error) = fs::rename(&self.path, &self.target) {
            if let Some((aside, old)) = old {
                let _ = fs::rename(old, &self.target);
                let _ = fs::remove_dir(aside);
            }
            return Err(Error::io(&self.target, &error));
        }
        sync_directory(folder(&self.target));
        if let Some((aside, _)) = old {
            // The new recording is in place; remains of the old one do no harm.
            let _ = fs::remove_dir_all(aside);
        }
        Ok(())
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        // After a rename it no longer exists.
        let _ = fs::remove_dir_all(&self.path);
    }
}

/// Checks that a recording can be written at `target`. `replace`: whether an existing one is replaced; `None` if the caller does not offer that.
pub(super) fn check_target(target: &Path, replace: Option<bool>) -> Result<()> {
    let refuse = |problem: &str, remedy: &str| Err(Error::new(target.display(), problem, remedy));
    let metadata = match fs::symlink_metadata(target) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(Error::io(target, &error)),
        Ok(metadata) => metadata,
    };
    if !metadata.is_dir() {
        return refuse("a file has this name", "choose another name");
    }
    let entries = fs::read_dir(target).map_err(|error| Error::io(target, &error))?;
    let mut names = Vec::new();
    for entry in entries {
        let entry = entry.map_err(|error| Error::io(target, &error))?;
        names.push(entry.file_name().to_string_lossy().into_owned());
    }
    if !names.is_empty() && replace != Some(true) {
        let refused = |remedy| Error::new(target.display(), "it exists already", remedy);
        return Err(match replace {
            None => refused("choose another name"),
            Some(_) => refused("choose another name, or replace it").about(Argument::Replace),
        });
    }
    match names
        .iter()
        .find(|name| !OWN_FILES.contains(&name.as_str()))
    {
        None => Ok(()),
        // This program must not delete what a person has put there.
        Some(other) => refuse(
            &format!("it contains {other}, which does not belong to a recording"),
            "move that file elsewhere, or choose another name",
        ),
    }
}

/// Creates an empty hidden directory beside `target`.
fn sibling(target: &Path, purpose: &str) -> Result<PathBuf> {
    let Some(name) = target.file_name() else {
        return Err(Error::new(
            target.display(),
            "this cannot be the name of a recording",
            "give the path of a directory that does not exist yet",
        ));
    };
    let parent = folder(target);
    // WebAssembly has one process, without a number.
    let process = match cfg!(target_family = "wasm") {
        true => 0,
        false => std::process::id(),
    };
    for attempt in 0..1000 {
        let mut hidden = std::ffi::OsString::from(".");
        hidden.push(name);
        hidden.push(format!(".{purpose}-{process}-{attempt}"));
        let path = parent.join(hidden);
        match fs::create_dir(&path) {
            Ok(()) => return Ok(path),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            Err(error) => return Err(Error::io(parent, &error)),
        }
    }
    Err(Error::new(
        parent.display(),
        "temporary directories of earlier runs are in the way",
        "remove the hidden directories whose names end in -new or -old and a number",
    ))
}

/// Makes a rename durable if the system can. Windows cannot open a directory, and need not.
pub(super) fn sync_directory(path: &Path) {
    if let Ok(directory) = File::open(path) {
        let _ = directory.sync_all();
    }
}
