//! Results that appear whole or not at all.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::{Error, Result};
use crate::parents::{Parents, folder};

/// A result that is written, but not yet visible under its name.
#[derive(Debug)]
pub struct Staged {
    path: PathBuf,
    file: Option<NamedTempFile>,
    content: Vec<u8>,
    /// After the file in this list: dropped later, the folders are empty if the file was not published.
    _parents: Option<Parents>,
}

/// Writes `content` beside `path`, so that all failures come before any file appears. Creates missing folders.
pub fn stage(path: &Path, content: impl Into<Vec<u8>>) -> Result<Staged> {
    let content = content.into();
    let failed = |e: std::io::Error| Error::io(path, &e);
    let path = path.to_owned();
    match std::fs::metadata(&path) {
        Ok(there) if there.is_dir() => {
            let problem = "this is a directory, but a file is to be written";
            return Err(Error::new(path.display(), problem, "name a file in it"));
        }
        // A device or a pipe is written to, never replaced: `/dev/null` must stay a device.
        Ok(there) if !there.is_file() => {
            let file = None;
            return Ok(Staged {
                path,
                file,
                content,
                _parents: None,
            });
        }
        _ => {}
    }
    let parents = Parents::create(&path)?;
    let mut file = NamedTempFile::new_in(folder(&path)).map_err(failed)?;
    file.write_all(&content).map_err(failed)?;
    file.as_file().sync_all().map_err(failed)?;
    // Temporary files are private, but everybody who may read the folder may read a result.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        let mode = std::fs::Permissions::from_mode(0o644);
        file.as_file().set_permissions(mode).map_err(failed)?;
    }
    let file = Some(file);
    Ok(Staged {
        path,
        file,
        content,
        _parents: Some(parents),
    })
}

impl Staged {
    /// Folder of the file, with its links resolved.
    pub fn folder(&self) -> PathBuf {
        let folder = folder(&self.path);
        folder.canonicalize().unwrap_or_else(|_| folder.to_owned())
    }

    /// Gives the file its name.
    pub fn publish(self) -> Result<()> {
        match self.file {
            Some(file) => file.persist(&self.path).map(drop).map_err(|e| e.error),
            None => std::fs::write(&self.path, self.content),
        }
        .map_err(|e| Error::io(&self.path, &e))
    }
}
