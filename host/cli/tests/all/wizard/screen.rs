//! The full screen on a pseudo-terminal: it appears, and the terminal is restored.

use std::fs::File;
use std::io::{Read as _, Write as _};
use std::os::fd::OwnedFd;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Termios, Winsize, tcgetattr, tcsetwinsize};

use super::playback::Playback;
use super::text::lines;
use crate::command::says;

const ENTERED: &str = "\x1b[?1049h";
const LEFT: &str = "\x1b[?1049l";

/// The wizard on a separate terminal.
struct WizardSession {
    keys: File,
    other: File,
    before: Termios,
    output: Receiver<String>,
    seen: String,
    child: Child,
}

impl WizardSession {
    fn begin(size: [u16; 2], arguments: &[&str]) -> Self {
        let side = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&side).unwrap();
        unlockpt(&side).unwrap();
        let path = ptsname(&side, Vec::new()).unwrap().into_string().unwrap();
        let other = File::options().read(true).write(true).open(path).unwrap();
        let size = Winsize {
            ws_col: size[0],
            ws_row: size[1],
            ws_xpixel: 0,
            ws_ypixel: 0,
        };
        tcsetwinsize(&other, size).unwrap();
        let before = tcgetattr(&other).unwrap();
        let at = || Stdio::from(OwnedFd::from(other.try_clone().unwrap()));
        let child = Command::new(env!("CARGO_BIN_EXE_mimu"))
            .args(arguments)
            .stdin(at())
            .stdout(at())
            .stderr(at())
            .spawn()
            .unwrap();
        let keys = File::from(side);
        let mut screen = keys.try_clone().unwrap();
        let (tell, output) = channel();
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(count) = screen.read(&mut bytes) {
                let text = String::from_utf8_lossy(&bytes[..count]).into_owned();
                if count == 0 || tell.send(text).is_err() {
                    return;
                }
            }
        });
        Self {
            keys,
            other,
            before,
            output,
            seen: String::new(),
            child,
        }
    }

    fn until(&mut self, words: &str) {
        while !self.seen.contains(words) {
            match self.output.recv_timeout(Duration::from_secs(600)) {
                Ok(text) => self.seen.push_str(&text),
                Err(_) => panic!("{words:?} is not in {:?}", self.seen),
            }
        }
    }

    /// Waits for the end. Returns the output, and whether the terminal was restored.
    fn end(mut self) -> (String, bool, Option<i32>) {
        let status = self.child.wait().unwrap();
        let is = tcgetattr(&self.other).unwrap();
        // Once nobody has the terminal open, its output ends.
        drop(self.other);
        self.seen.extend(self.output.iter());
        let same = is.local_modes == self.before.local_modes
            && is.input_modes == self.before.input_modes
            && is.output_modes == self.before.output_modes;
        (self.seen, same, status.code())
    }
}

fn session(size: [u16; 2], more: &[&str]) -> (WizardSession, Playback, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let playback = Playback::begin(lines(), 4000.0);
    let out = folder.path().join("out").display().to_string();
    let mut arguments = vec!["wizard", "-o", &out, "--gravity", "9.8", "--warm-up", "0"];
    arguments.extend([
        "--text",
        "t_us,ax,ay,az,gx,gy,gz",
        "--trust-clock",
        "--port",
        playback.path(),
    ]);
    arguments.extend(more);
    let session = WizardSession::begin(size, &arguments);
    (session, playback, folder)
}

#[test]
fn the_terminal_is_given_back_after_the_end_by_a_key_and_by_control_c() {
    for key in [b"q", b"\x03"] {
        let (mut at, _playback, _folder) = session([100, 30], &[]);
        at.until("accel");
        at.keys.write_all(key).unwrap();
        let (seen, same, code) = at.end();
        assert!(same, "{seen:?}");
        let (entered, left) = (seen.find(ENTERED).unwrap(), seen.rfind(LEFT).unwrap());
        assert!(entered < left, "{seen:?}");
        let rest = &seen[left..];
        says(rest, &["ended; the same command resumes here"]);
        assert_eq!(code, Some(0), "{seen:?}");
    }
}

#[test]
fn the_terminal_is_given_back_before_an_error_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out").display().to_string();
    #[rustfmt::skip]
    let arguments = ["wizard", "-o", &out, "--gravity", "9.8", "--text", "--port", "/nowhere"];
    let (seen, same, code) = WizardSession::begin([80, 24], &arguments).end();
    let left = seen.rfind(LEFT).unwrap();
    assert!(seen.contains(ENTERED) && same, "{seen:?}");
    assert!(seen[left..].contains("the port does not exist"), "{seen:?}");
    assert_ne!(code, Some(0));
}

#[test]
fn a_small_terminal_and_plain_get_lines_of_text() {
    for (size, more) in [([79, 24], &[][..]), ([100, 30], &["--plain"][..])] {
        let (mut at, _playback, _folder) = session(size, more);
        at.until("calibration: 14 dwells are planned");
        at.keys.write_all(b"quit\n").unwrap();
        let (seen, same, code) = at.end();
        assert!(!seen.contains(ENTERED) && same, "{seen:?}");
        assert_eq!(code, Some(0), "{seen:?}");
    }
}
