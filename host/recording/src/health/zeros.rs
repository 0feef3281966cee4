//! Zeros, failed reads and empty cells in place of readings: padding, a sensor that is not connected, sensors in rows of their own.

use super::repeats::Constant;
use super::{Fault, Finding};

/// Names of the sensors.
pub(crate) const SENSORS: [&str; 2] = ["gyro", "accel"];
/// Sensors have rows of their own if each is alone in more than this share of the rows.
const APART_SHARE: f64 = 0.2;

/// What a row is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RowKind {
    Readings,
    /// Its accelerometer has measured nothing.
    NoForce,
    /// Padding of a buffer, or of a time when nothing was connected.
    Padding,
}

/// Watches rows for zeros and empty cells.
#[derive(Debug, Clone, Default)]
pub(crate) struct Zeros {
    /// Whether the rows have gyro and accelerometer.
    has: [bool; 2],
    pub padding: u64,
    /// Rows whose six readings are one number: of a bus that did not answer.
    no_answer: u64,
    /// Rows in which only the accelerometer has zeros.
    no_force: u64,
    /// Rows in which only the gyro has a reading, and those in which only the accelerometer has one.
    alone: [u64; 2],
    channels: [Constant; 6],
    rows: u64,
}

impl Zeros {
    /// For rows that have these sensors.
    pub fn new(has: [bool; 2]) -> Self {
        Self {
            has,
            ..Self::default()
        }
    }

    /// Takes a row, whose absent channels are NaN. `may_pad`: its time is 0, after times above 0.
    ///
    /// An accelerometer whose three axes are exactly 0 has measured nothing, because gravity is always there. A gyro at rest may well read 0. Without
    /// an accelerometer, its zeros are padding only if the time is 0 too.
    pub fn take(&mut self, raw: &[f64; 6], may_pad: bool) -> RowKind {
        let halves = [&raw[..3], &raw[3..]];
        let zero = halves.map(|half| half.iter().all(|value| *value == 0.0));
        let empty = halves.map(|half| half.iter().all(|value| value.is_nan()));
        if self.has == [true; 2] {
            self.alone[0] += u64::from(!empty[0] && empty[1]);
            self.alone[1] += u64::from(empty[0] && !empty[1]);
        }
        let padding = match self.has {
            [has_gyro, true] => zero[1] && (zero[0] || !has_gyro),
            [_, false] => zero[0] && may_pad,
        };
        if padding {
            self.padding += 1;
            return RowKind::Padding;
        }
        // A bus that does not answer reads as ones, -1, or as the end of the range. No pose and rate make six numbers equal.
        if self.has == [true; 2] && raw[1..].iter().all(|value| *value == raw[0]) {
            self.no_answer += 1;
            return RowKind::Padding;
        }
        self.rows += 1;
        self.no_force += u64::from(zero[1]);
        for (c, (channel, value)) in self.channels.iter_mut().zip(raw).enumerate() {
            if !(c >= 3 && zero[1]) {
                channel.take(*value);
            }
        }
        match zero[1] {
            true => RowKind::NoForce,
            false => RowKind::Readings,
        }
    }

    /// For gyro and accelerometer, the finding that all of its readings are 0.
    pub fn not_connected(&self) -> [Option<Finding>; 2] {
        [0, 1].map(|s| {
            let channels = &self.channels[3 * s..3 * s + 3];
            let dead = self.has[s] && self.rows > 0 && channels.iter().all(Constant::is_zero);
            dead.then(|| Finding::new(SENSORS[s], self.rows, Fault::NotConnected))
        })
    }

    /// The finding that there is nothing but padding.
    pub fn nothing(&self) -> Option<Finding> {
        let nothing = self.padded().or(self.unanswered());
        nothing.filter(|_| self.rows == 0)
    }

    fn unanswered(&self) -> Option<Finding> {
        let count = self.no_answer;
        (count > 0).then(|| Finding::of_all(count, Fault::NoAnswer))
    }

    fn padded(&self) -> Option<Finding> {
        let count = self.padding;
        (count > 0).then(|| Finding::of_all(count, Fault::AllZero))
    }

    /// The findings that a recording may have.
    pub fn found(&self) -> Vec<Finding> {
        let [gyro, accel] = self.alone;
        let apart = |rows: u64| rows as f64 > APART_SHARE * self.rows as f64;
        let separate = Finding::of_all(gyro + accel, Fault::SeparateRows { gyro, accel });
        let mut all = Vec::from_iter((apart(gyro) && apart(accel)).then_some(separate));
        all.extend(self.padded());
        all.extend(self.unanswered());
        let not_connected = self.not_connected();
        if self.no_force > 0 && not_connected[1].is_none() {
            all.push(Finding::new("accel", self.no_force, Fault::NoForce));
        }
        // Zeros are those of a channel that is not connected. Another constant may be a rest with coarse steps, which a fit judges.
        let live = (0..6).filter(|c| not_connected[c / 3].is_none());
        let zeros = live.filter(|c| self.channels[*c].is_zero());
        all.extend(zeros.filter_map(|c| self.channels[c].found(c, self.rows)));
        all.extend(not_connected.into_iter().flatten());
        all
    }
}
