//! Findings in words: the only place with their sentences. No code may depend on them.

use std::fmt;

use super::{Fault, Finding};
use crate::digits::{duration, plural, significant, unsigned_zero};

/// Why readings differ from what they measure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cause {
    problem: &'static str,
    remedy: &'static str,
}

const fn cause(problem: &'static str, remedy: &'static str) -> Cause {
    Cause { problem, remedy }
}

pub(super) const DEGREES_PER_SECOND: Cause = cause(
    "they are in deg/s, and SI is rad/s",
    "import them with the factor gyro=0.0174533",
);
pub(super) const RADIANS_TWICE: Cause = cause(
    "they were converted from deg/s to rad/s twice",
    "leave one conversion out",
);
pub(super) const RADIANS_TWICE_OR_RATES: Cause = cause(
    "the ref_ columns are not in deg/s, or the readings were converted to rad/s twice",
    "correct the ref_ columns, or leave one conversion out",
);
pub(super) const SLOW_TURNTABLE: Cause = cause(
    "was the turntable at 33 1/3 rpm while the rate of 45 rpm is given?",
    "give the rate at which it turned",
);
pub(super) const FAST_TURNTABLE: Cause = cause(
    "was the turntable at 45 rpm while the rate of 33 1/3 rpm is given?",
    "give the rate at which it turned",
);
pub(super) const MILLISECONDS: Cause = cause(
    "the time stamps are in ms, and must be in s",
    "import them with their unit",
);
pub(super) const TIMES: Cause = cause(
    "if the stamps or the sample rate are wrong by this factor, so is every integrated angle",
    "check the time stamps and the unit",
);
pub(super) const IN_G: Cause = cause(
    "they are in g, and SI is m/s²",
    "import them with the factor accel=9.80665",
);
pub(super) const IN_MG: Cause = cause(
    "they are in mg, and SI is m/s²",
    "import them with the factor accel=0.00980665",
);
pub(super) const GRAVITY_TWICE: Cause = cause(
    "they were multiplied by gravity twice",
    "leave one factor out",
);
pub(super) const G_AS_MG: Cause = cause(
    "they were taken for mg, and are in g",
    "import them in g: --units g",
);
pub(super) const SI_AS_MG: Cause = cause(
    "they were taken for mg, and are in m/s²",
    "import them in m/s²: --units m/s2",
);
pub(super) const MG_AS_G: Cause = cause(
    "they were taken for g, and are in mg",
    "import them in mg: --units mg",
);
pub(super) const UNKNOWN: Cause = cause(
    "the unit is another one, or the range of the part",
    "check the unit, and the range that the part was set to; counts need another raw unit",
);

impl Finding {
    /// What is wrong.
    pub fn problem(&self) -> String {
        let count = self.rows.count;
        let rows = plural(count, "row");
        match self.fault {
            Fault::Held {
                of,
                rows_per_reading,
                rate_hz,
            } => format!(
                "it repeats its reading in {count} of {of} rows: a new reading comes every {rows_per_reading:.2} rows, at {:.1} Hz, but the log has {rate_hz:.1} Hz. The certainty of a mean depends on the number of readings, not of rows, and faster noise is not the sensor's",
                rate_hz / rows_per_reading
            ),
            Fault::Unanswered => format!(
                "the last readings are repeated in {rows}, which count as missing: the sensor did not answer"
            ),
            Fault::Dead { value } => format!(
                "the channel is stuck at {} throughout",
                unsigned_zero(value)
            ),
            Fault::DeadOrCoarse { value, step } => format!(
                "the channel reads {} throughout while the unit is at rest; the sensor's other channels change by single quantisation steps of {}, so its noise may be below one step",
                unsigned_zero(value),
                significant(step)
            ),
            Fault::Stuck { value, lasts_s } => format!(
                "the channel is stuck at {} for {}",
                unsigned_zero(value),
                duration(lasts_s)
            ),
            Fault::EndOfConverter { value } => format!(
                "{} at {value}, the end of a 16-bit converter",
                plural(count, "sample")
            ),
            Fault::FullScale { value } => format!(
                "{} at {value}, the full scale of a sensor",
                plural(count, "sample")
            ),
            Fault::RunAtEnd {
                high,
                value,
                longest,
                by_chance,
            } => format!(
                "the {} value {value} occurs {longest} times in a row, and chance explains {:.0}",
                extreme(high),
                by_chance.floor()
            ),
            Fault::CalmEnd { high, from } => format!(
                "at its {} values, from {from} on, the noise vanishes",
                extreme(high)
            ),
            Fault::AtEnd => "a reading is at the end of its range".into(),
            Fault::AllZero => format!("all readings are 0, in {rows}"),
            Fault::NoAnswer => format!(
                "all six readings are the same number, in {rows}: the sensor's bus did not answer"
            ),
            Fault::NoForce => {
                format!("it reads exactly 0 on all axes in {rows}, which is impossible at rest")
            }
            Fault::NotConnected => {
                "it is exactly 0 on all axes in all rows: it was not connected".into()
            }
            Fault::SeparateRows { gyro, accel } => format!(
                "{gyro} rows have the gyro alone and {accel} the accelerometer alone, so no turn is complete"
            ),
            Fault::Unsigned => "negative readings are written as unsigned codes of 16 bits: near 0 they jump to 65535".into(),
            Fault::Overflow => format!(
                "it jumps {count} times from one end of 16 bits to the other: the firmware's integers overflow, and the sensor's range is too small for this motion, or its factor too large"
            ),
            Fault::SignedLowByte => format!(
                "{count} jumps between neighbouring samples show that readings whose low byte is 128 or more are 256 counts too low: the firmware reads the low byte as a signed number"
            ),
            Fault::RangeChanged { ratio } => format!(
                "from data row {} on the accelerometer reads {ratio} times as much at rest as before, so its range has changed",
                self.rows.first.unwrap_or(1)
            ),
            Fault::ColumnsMoved { now, before } => format!(
                "from data row {} on {now} reads what {before} read before, so the columns have changed places",
                self.rows.first.unwrap_or(1)
            ),
            Fault::Exchanged => {
                "the gyro's readings follow the pose, but the accelerometer's do not".into()
            }
            _ => self.problem_of_size(),
        }
    }

    /// What is wrong with a magnitude or a temperature.
    fn problem_of_size(&self) -> String {
        let count = self.rows.count;
        match self.fault {
            Fault::NoGravity { size } => format!(
                "the usual specific force is {size:.3} m/s², although gravity is always there: a filter has removed it"
            ),
            Fault::NotSi {
                at_rest,
                times,
                cause,
            } => {
                let what = match at_rest {
                    true => "at rest the readings, biases included, are about",
                    false => "the readings are",
                };
                format!(
                    "raw_unit = \"SI\", but {what} {} times the input: {}",
                    significant(times),
                    cause.problem
                )
            }
            Fault::Turning { rate } => format!(
                "at rest it reads {} deg/s, more than any bias",
                significant(rate.to_degrees())
            ),
            Fault::NotCounts { per_si, unit, .. } => format!(
                "raw_unit = \"count\", but the readings are fractions, and the fit gives {} of them per SI unit: they are in {unit}",
                significant(per_si)
            ),
            Fault::NoTemperatures {
                first_c, at: None, ..
            } => {
                format!("{first_c} is not a temperature in °C")
            }
            Fault::NoTemperatures {
                of,
                first_c,
                at: Some(at),
            } => format!(
                "{count} of {of} values cannot be temperatures in °C, the first is {first_c} {at}"
            ),
            Fault::UnusualTemperatures { low_c, high_c } => format!(
                "temperatures of {} to {} °C are implausible for a board",
                significant(low_c),
                significant(high_c)
            ),
            Fault::NoThermometer => format!(
                "it is exactly 0 in all of its {}: there is no thermometer",
                plural(count, "row")
            ),
            Fault::SilentThermometer => format!(
                "it is exactly 0 in {}, far from all other temperatures: the thermometer did not answer",
                plural(count, "row")
            ),
            _ => String::new(),
        }
    }

    /// What to do about it.
    pub fn remedy(&self) -> String {
        let remedy = match self.fault {
            Fault::Held { .. } => "log each reading once",
            Fault::Unanswered => "check the wires between sensor and board",
            Fault::Dead { .. } => "check its wiring, and that the right column was imported",
            Fault::DeadOrCoarse { .. } => {
                "record turns as well: they distinguish a coarse channel from a stuck one"
            }
            Fault::Stuck { .. } => "check its wiring",
            Fault::EndOfConverter { .. }
            | Fault::FullScale { .. }
            | Fault::RunAtEnd { .. }
            | Fault::CalmEnd { .. } => "give the sensor a larger range, or turn it more slowly",
            Fault::AtEnd => "put it down, or give the sensor a larger range",
            Fault::AllZero => {
                "check that the right columns were named, and that the sensor was connected"
            }
            Fault::NoForce | Fault::NoAnswer => "check its wiring",
            Fault::NotConnected => "leave the file out, or skip the columns",
            Fault::SeparateRows { .. } => {
                "give a list of columns with the time for each, and they are joined on it"
            }
            Fault::NoGravity { .. } => "log the accelerometer with gravity",
            Fault::NotSi { cause, .. } => cause.remedy,
            Fault::Turning { .. } => "the unit turns evenly, or the readings are in deg/s",
            Fault::NotCounts { import, .. } => return format!("import them with {import}"),
            Fault::Unsigned => {
                let column = self.about.unwrap_or_default();
                return format!("say that they are two's complement: {column}=16");
            }
            Fault::Overflow => "log wider integers, or give the sensor a larger range",
            Fault::SignedLowByte => {
                "correct the firmware, and import this log again with corrected readings"
            }
            Fault::UnusualTemperatures { low_c, high_c } if low_c > 200.0 && high_c < 400.0 => {
                "convert kelvins to degrees Celsius with an offset of -273.15, or skip the column"
            }
            Fault::NoTemperatures { .. } | Fault::UnusualTemperatures { .. } => {
                "convert it to degrees Celsius (counts of an MPU-6050 or MPU-9150: a factor of 0.00294118 and an offset of 36.53), or skip the column"
            }
            Fault::NoThermometer | Fault::SilentThermometer => "check the thermometer's wiring",
            Fault::RangeChanged { .. } | Fault::ColumnsMoved { .. } => {
                let row = self.rows.first.unwrap_or(1);
                return format!(
                    "import the rows before it (..{}) or those from it on ({row}..) as a recording",
                    row - 1
                );
            }
            Fault::Exchanged => "are the columns ax,ay,az and gx,gy,gz exchanged?",
        };
        remedy.into()
    }

    /// What was done about it, if a reader of the recording does something.
    fn handling(&self) -> Option<&'static str> {
        Some(match self.fault {
            Fault::EndOfConverter { .. } | Fault::FullScale { .. } | Fault::RunAtEnd { .. } => {
                "treated as a rail"
            }
            Fault::CalmEnd { .. } => "treated as a rail of the sensor",
            Fault::AllZero => "left out as padding",
            Fault::NoAnswer => "left out",
            Fault::NoForce => "its cells are left empty",
            Fault::NotConnected => "left out",
            Fault::NoTemperatures { .. } | Fault::SilentThermometer => "left empty",
            Fault::NoThermometer => "the column is left out",
            _ => return None,
        })
    }
}

fn extreme(high: bool) -> &'static str {
    if high { "highest" } else { "lowest" }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(about) = self.about {
            write!(f, "{about}: ")?;
        }
        write!(f, "{}: ", self.problem())?;
        match self.handling() {
            Some(handling) => f.write_str(handling),
            None => f.write_str(&self.remedy()),
        }
    }
}
