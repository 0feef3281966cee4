//! Results that appear whole or not at all.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::{Error, Result};
use crate::parents::{Parents, folder};

/// A result that is written, and has yet to appear under its name.
#[derive(Debug)]
pub struct Staged {
    path: PathBuf,
    file: Option<NamedTempFile>,
    content: Vec<u8>,
    /// Behind the file in this list, so that they are empty when they are dropped without it.
    _parents: Option<Parents>,
}

/// Writes `content` beside `path`, so that whatever can fail fails before any file has appeared. Missing folders of it are made.
pub fn stage(path: &Path, content: impl Into<Vec<u8>>) -> Result<Staged> {
    let content = content.into();
    let failed = |e: std::io::Error| Error::io(path, &e);
    let path = path.to_owned();
    match std::fs::metadata(&path) {
        Ok(there) if there.is_dir() => {
            let problem = "this is a directory, but a file is to be written";
            return Err(Error::new(path.display(), problem, "name a file in it"));
        }
        // A device or a pipe is written to, never replaced: `/dev/null` has to stay what it is.
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
    // Temporary files are private; a result is for everybody who may read the folder's other files.
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
    /// Folder that the file will be in, with its links resolved.
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
