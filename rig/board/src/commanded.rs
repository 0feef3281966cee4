//! A board under command, served in a separate thread: for programs and tests that calibrate it with the real command.

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::rig_file::RigTruth;

use crate::front::Front;
use crate::image::Image;
use crate::running::Board;
use crate::serve::{Pace, Served};

/// Gravity at its place, m/s².
pub const GRAVITY: f64 = 9.793;
/// Latitude, degrees.
pub const LATITUDE_DEG: f64 = 30.5;

/// Longest wait for an answer, long enough for a busy machine.
const PATIENCE: Duration = Duration::from_secs(60);

/// Which board is emulated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// NUCLEO-H743ZI2 with analog sensors.
    Nucleo,
    /// Matek H743 with its digital sensor.
    Matek {
        /// As in [`Board::digital`].
        crystal: f64,
    },
}

/// A board with its unit on a fixture, at the fast pace. Its folder contains `port`, a link to the serial port, and `flash`, the stored contents of
/// the device.
#[derive(Debug)]
pub struct Commanded {
    folder: PathBuf,
    address: SocketAddr,
    control: BufReader<TcpStream>,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<Result<f64, String>>>,
}

/// The bench's place, with the unit at rest, z up.
fn place(fixture: &str) -> Result<Plan, String> {
    let text = format!(
        "format = \"mimu-plan/1\"\ndevice = \"unit-007\"\nsample_rate_hz = 1000.0\ncarrier = \"{fixture}\"\n\
         latitude_deg = {LATITUDE_DEG}\ngravity_mps2 = {GRAVITY}\nlead_in_s = 1.0\n[[step]]\nup = [0.0, 0.0, 1.0]\ndwell_s = 1.0\n"
    );
    Plan::parse(Source::new("place", text))
}

impl Commanded {
    /// Switches it on. `fixture`: `table` or `hands`.
    ///
    /// Errors: the folder cannot be written to, the unit is refused, or no terminal is available.
    pub fn start(
        kind: Kind,
        image: &Image,
        fixture: &str,
        truth: &RigTruth,
        seed: u64,
        unit_id: [u8; 12],
        folder: &Path,
    ) -> Result<Self, String> {
        let place = place(fixture)?;
        let board = match kind {
            Kind::Nucleo => {
                Board::numbered(image, Front::commanded(&place, truth, seed)?, unit_id)?
            }
            Kind::Matek { crystal } => {
                let front = Front::commanded_digital(&place, truth, seed, crystal)?;
                Board::matek(image, front, unit_id)?
            }
        };
        Self::serve(board, seed, folder)
    }

    fn serve(board: Board, seed: u64, folder: &Path) -> Result<Self, String> {
        std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        let mut served = Served::new(board, Pace::Fast, Some(&folder.join("flash")))?;
        let address = served.listen("127.0.0.1:0", seed)?;
        served.link(&folder.join("port"))?;
        served.start()?;
        let end = Arc::new(AtomicBool::new(false));
        let ended = end.clone();
        let thread = std::thread::spawn(move || {
            while !ended.load(Ordering::Relaxed) {
                served.step()?;
            }
            Ok(served.board().state().ns as f64 * 1e-9)
        });
        let connected = TcpStream::connect(address).and_then(|stream| {
            stream.set_read_timeout(Some(PATIENCE))?;
            Ok(stream)
        });
        let stream = connected.map_err(|e| format!("{address}: {e}"))?;
        Ok(Self {
            folder: folder.to_owned(),
            address,
            control: BufReader::new(stream),
            end,
            thread: Some(thread),
        })
    }

    /// Address for commands.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Path of a file in its folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Sends a line and returns the answer.
    ///
    /// Errors: no answer in time.
    pub fn ask(&mut self, line: &str) -> Result<String, String> {
        let broken = |e: std::io::Error| format!("the bench, told {line:?}: {e}");
        let said = self
            .control
            .get_mut()
            .write_all(format!("{line}\n").as_bytes());
        said.map_err(broken)?;
        let mut answer = String::new();
        self.control.read_line(&mut answer).map_err(broken)?;
        Ok(answer.trim().to_owned())
    }

    /// Sends a line whose answer must be `OK`.
    ///
    /// Errors: another answer, or none.
    pub fn tell(&mut self, line: &str) -> Result<(), String> {
        match self.ask(line)? {
            answer if answer == "OK" => Ok(()),
            answer => Err(format!("the bench, told {line:?}: {answer}")),
        }
    }

    /// Switches it off and returns how long it ran by its own clock, s.
    ///
    /// Errors: the reason for which it ended before.
    pub fn stop(mut self) -> Result<f64, String> {
        self.end.store(true, Ordering::Relaxed);
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(ran)) => ran,
            _ => Err("the board's thread failed".into()),
        }
    }
}

impl Drop for Commanded {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
