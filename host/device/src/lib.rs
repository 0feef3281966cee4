//! The device, seen from the PC: who is at the port, and what can be asked of it.
//!
//! | module       | what it is                                                                             |
//! |--------------|----------------------------------------------------------------------------------------|
//! | `port`       | the serial port, and why it cannot be opened                                           |
//! | `heard`      | bytes into messages; what is garbled is counted                                        |
//! | `line`, `session` | calls, each repeated until it is answered or refused                              |
//! | `who`        | the greeting: what is there, and whether it can be talked to                           |
//! | `nominal`    | the sensors by their data sheets                                                       |
//! | `image`      | a calibration file as the bytes that the device stores                                 |
//! | `origin`     | the unit, the date and the recording of a calibration                                  |
//! | `upload`     | sending them and fetching them back                                                    |
//! | `contents`   | contents of stored calibrations                                                        |
//! | `trim`       | offsets of the stored calibration set anew while the unit lies still                   |
//! | `self_test`  | the self-test, and whether the unit stood still for it                                 |
//! | `flagged`    | samples that carry a flag, counted                                                     |
//! | `stream`     | samples as they come                                                                   |
//! | `check`      | the device's compensation against the PC's, sample by sample                           |
//! | [`record`]   | recording its raw stream                                                               |
//! | `result`     | what a command found, with where: the JSON that it writes                              |
//! | `kalman`     | the device's Kalman bank against the PC's, on the same samples                         |

mod check;
mod contents;
mod flagged;
mod heard;
mod identity;
mod image;
mod kalman;
mod line;
mod nominal;
mod origin;
mod port;
pub mod record;
mod result;
mod self_test;
mod session;
mod stream;
mod trim;
mod upload;

pub use check::{Checked, Difference, check, rounding, ulps};
pub use contents::{Contents, Inverse, NodeContents, calibration, contents};
pub use flagged::Flagged;
pub use heard::{Answer, Event, Heard, LineCount, Receiver, Samples};
pub use identity::{Hash, Held, Identity, Room, Started, unit_name};
pub use image::Image;
pub use kalman::{Applied, AxisEstimate, Converging, KalmanPlan, KalmanRun, SHORTEST, kalman};
pub use nominal::nominal;
pub use port::{BAUD, Port, Ports, SerialPair, ports, serial_pair};
pub use result::{Counted, DeviceResult};
pub use self_test::{Passed, SelfTested, self_test};
pub use session::{Session, refused};
pub use stream::{Moments, Stream, Streamed, stream};
pub use trim::{Pose, SHORTEST_TRIM_S, Trimmed, TrimmedTriad, trim};
pub use upload::{Uploaded, download, outside_now, upload};
