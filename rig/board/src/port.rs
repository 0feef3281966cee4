//! The port of a served board: a terminal that can be unplugged, with a constant name.

use std::fs;
use std::io::{self, ErrorKind};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use crate::terminal::Terminal;

/// A terminal, or none while it is unplugged.
#[derive(Debug)]
pub(crate) struct Port {
    terminal: Option<Terminal>,
    /// Path of the terminal, or of the last one.
    path: PathBuf,
    link: Option<PathBuf>,
}

impl Port {
    /// A plugged-in port.
    pub(crate) fn new() -> Result<Self, String> {
        let terminal = opened()?;
        let path = terminal.path().to_owned();
        Ok(Self {
            terminal: Some(terminal),
            path,
            link: None,
        })
    }

    /// Gives it a constant name: a symbolic link, which is updated when it is plugged in again.
    ///
    /// Errors: the name belongs to something other than a symbolic link, or the link cannot be made.
    pub(crate) fn link(&mut self, link: &Path) -> Result<(), String> {
        match fs::symlink_metadata(link) {
            Ok(there) if !there.is_symlink() => {
                return Err(format!(
                    "{}: exists and is not a symbolic link; name another one",
                    link.display()
                ));
            }
            Ok(_) => {}
            Err(e) if e.kind() == ErrorKind::NotFound => {}
            Err(e) => return Err(format!("{}: {e}", link.display())),
        }
        self.link = Some(link.to_owned());
        self.point()
    }

    /// Points the link to the terminal atomically: a program that opens it meanwhile gets the old or the new terminal.
    fn point(&self) -> Result<(), String> {
        let Some(link) = &self.link else {
            return Ok(());
        };
        let refused = |e: io::Error| format!("{}: {e}", link.display());
        let mut new = link.clone().into_os_string();
        new.push(format!(".{}", std::process::id()));
        symlink(&self.path, &new).map_err(refused)?;
        fs::rename(&new, link).map_err(refused)
    }

    /// The path to open: the link, if there is one.
    pub(crate) fn path(&self) -> &Path {
        self.link.as_deref().unwrap_or(&self.path)
    }

    /// Whether it is plugged in.
    pub(crate) fn is_plugged(&self) -> bool {
        self.terminal.is_some()
    }

    /// Hangs up: a program that has it open gets an error or the end of the file, and no program can open it.
    pub(crate) fn unplug(&mut self) {
        self.terminal = None;
        self.remove_link();
    }

    /// Plugs in a new terminal, unless one is plugged in.
    ///
    /// Errors: the system has no terminal available, or the link cannot be made.
    pub(crate) fn plug(&mut self) -> Result<(), String> {
        if self.terminal.is_none() {
            let terminal = opened()?;
            self.path = terminal.path().to_owned();
            self.terminal = Some(terminal);
            self.point()?;
        }
        Ok(())
    }

    /// Removes the link, unless it points elsewhere by now.
    fn remove_link(&self) {
        if let Some(link) = &self.link
            && fs::read_link(link).is_ok_and(|to| to == self.path)
        {
            // If it cannot be removed, it dangles, and opening it fails as well.
            let _ = fs::remove_file(link);
        }
    }

    /// Whether any program has it open.
    pub(crate) fn is_open(&self) -> bool {
        self.terminal.as_ref().is_some_and(Terminal::is_open)
    }

    /// As [`Terminal::wait_for_room`]; returns at once if it is unplugged.
    pub(crate) fn wait_for_room(&self, ms: u32) {
        if let Some(terminal) = &self.terminal {
            terminal.wait_for_room(ms);
        }
    }

    /// As [`Terminal::read`]; nothing if it is unplugged.
    pub(crate) fn read(&mut self, into: &mut [u8]) -> Result<usize, String> {
        match &mut self.terminal {
            Some(terminal) => terminal.read(into).map_err(broken),
            None => Ok(0),
        }
    }

    /// As [`Terminal::write`]; nothing if it is unplugged.
    pub(crate) fn write(&mut self, bytes: &[u8]) -> Result<usize, String> {
        match &mut self.terminal {
            Some(terminal) => terminal.write(bytes).map_err(broken),
            None => Ok(0),
        }
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        self.remove_link();
    }
}

fn opened() -> Result<Terminal, String> {
    Terminal::open().map_err(|e| format!("a pseudo-terminal: {e}"))
}

fn broken(e: io::Error) -> String {
    format!("the pseudo-terminal: {e}")
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::{Read, Write};

    use super::*;

    fn open(path: &Path) -> io::Result<File> {
        File::options().read(true).write(true).open(path)
    }

    #[test]
    fn an_unplugged_port_ends_for_whoever_has_it_open_and_its_name_leads_to_the_next_one() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("port");
        let mut port = Port::new().unwrap();
        port.link(&link).unwrap();
        for _ in 0..2 {
            assert_eq!(port.path(), link);
            let mut opened = open(&link).unwrap();
            assert!(port.is_open());
            port.write(b"a").unwrap();
            let mut byte = [0];
            opened.read_exact(&mut byte).unwrap();
            assert_eq!(&byte, b"a");

            port.unplug();
            assert!(!port.is_open() && !link.exists());
            assert!(opened.write_all(b"b").is_err());
            assert!(matches!(opened.read(&mut byte), Ok(0) | Err(_)));
            assert!(open(&link).is_err());
            assert_eq!(port.write(b"c").unwrap() + port.read(&mut byte).unwrap(), 0);
            port.plug().unwrap();
        }
        drop(port);
        assert!(fs::symlink_metadata(&link).is_err(), "the link is left");
    }

    #[test]
    fn a_link_replaces_one_that_is_left_over_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("port");
        symlink("/nowhere", &link).unwrap();
        Port::new().unwrap().link(&link).unwrap();
        fs::write(&link, "a file").unwrap();
        let refusal = Port::new().unwrap().link(&link).unwrap_err();
        assert!(refusal.contains("symbolic link"), "{refusal}");
        assert_eq!(fs::read_to_string(&link).unwrap(), "a file");
    }
}
