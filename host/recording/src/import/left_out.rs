//! What an import leaves out, because a first reading of all rows showed that it is no readings.

use crate::error::Result;

/// Parts of a file that an import leaves out, because a first reading of all rows showed that they are no readings.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct LeftOut {
    /// Whether gyro and accelerometer read only zeros.
    pub sensors: [bool; 2],
    /// Whether the thermometer reads only zeros.
    pub thermometer: bool,
    /// Whether zeros of the thermometer are missing answers.
    pub zero_temperatures: bool,
}

/// Calls `import` again with what it says is to be left out, until it leaves a result.
pub(super) fn repeated<T>(
    mut import: impl FnMut(LeftOut) -> Result<std::result::Result<T, LeftOut>>,
) -> Result<T> {
    let mut left_out = LeftOut::default();
    loop {
        match import(left_out)? {
            Ok(done) => return Ok(done),
            Err(more) => left_out = more,
        }
    }
}
