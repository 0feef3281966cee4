//! The device, seen from the PC: its identity and its functions.
//!
//! | module            | what it is                                                               |
//! |-------------------|--------------------------------------------------------------------------|
//! | `port`            | the serial port, and why it cannot be opened                             |
//! | `received`        | decodes bytes into messages, and counts garbled ones                     |
//! | `line`, `session` | calls, each repeated until it is answered or refused                     |
//! | `identity`        | the greeting: the device's identity, and whether it is compatible        |
//! | `image`           | a calibration file as the device stores it                               |
//! | `origin`          | the unit, the date and the recording of a calibration                    |
//! | `upload`          | sends a calibration and reads it back                                    |
//! | `contents`        | contents of stored calibrations                                          |
//! | `trim`            | corrects the offsets of the stored calibration while the unit is at rest |
//! | `test_result`     | a row of the self-test                                                   |
//! | `self_test`       | the self-test, and whether the unit was at rest during it                |
//! | `flagged`         | counts samples that carry a flag                                         |
//! | `stream`          | receives samples                                                         |
//! | `check`           | compares the device's compensation with the PC's, sample by sample       |
//! | `reading`         | single-precision readings as short decimal numbers                       |
//! | [`record`]        | records the raw stream                                                   |
//! | `result`          | a command's result with port and command, as written in JSON             |
//! | `kalman`          | compares the device's Kalman bank with the PC's on the same samples      |

mod check;
mod contents;
mod flagged;
mod identity;
mod image;
mod kalman;
mod line;
mod origin;
mod port;
mod reading;
mod received;
pub mod record;
mod result;
mod self_test;
mod session;
mod stream;
mod test_result;
mod trim;
mod upload;

pub use check::{Checked, Difference, check, rounding, ulps};
pub use contents::{Contents, Inverse, NodeContents, calibration, contents};
pub use flagged::Flagged;
pub use identity::{Hash, Identity, Room, Started, StoredCalibration, TriadInfo, unit_name};
pub use image::Image;
pub use kalman::{Applied, AxisEstimate, Converging, KalmanPlan, KalmanRun, SHORTEST, kalman};
pub use line::patience;
pub use port::{BAUD, Port, Ports, SerialPair, ports, serial_pair};
pub use received::{Answer, Event, LineCount, Received, Receiver, Samples};
pub use result::{Counted, DeviceResult};
pub use self_test::{SelfTested, self_test};
pub use session::{Session, refused};
pub use stream::{Moments, Stream, Streamed, Thermometer, look, stream};
pub use test_result::{TestResult, Verdict};
pub use trim::{Pose, SHORTEST_TRIM_S, Trimmed, TrimmedTriad, trim};
pub use upload::{Uploaded, download, outside_now, upload};
