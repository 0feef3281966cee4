//! Implausible readings: rows padded with zeros, impossible temperatures, and readings that are repeated or come from two sources.

use super::row::Row;
use super::thermometer::{ZeroTally, Zeros};
use super::two_sources::TwoSources;
use crate::columns::Column;
use crate::error::{Argument, Error, Result};
use crate::health::{Constant, HeldReadings};
use crate::no_temperature::NoTemperatures;

/// Temperatures that silicon and thermal chambers reach, °C.
const USUAL_C: std::ops::RangeInclusive<f64> = -100.0..=200.0;
/// Possible temperatures in °C, from absolute zero on. Counts of a converter are mostly outside.
const POSSIBLE_C: std::ops::RangeInclusive<f64> = -273.15..=1000.0;
/// Sensors have rows of their own if each is alone in more than this share of the rows.
const APART_SHARE: f64 = 0.2;
/// Remedy for a column that is not in °C.
const CONVERT: &str = "convert it to degrees Celsius (counts of an MPU-6050 or MPU-9150: a factor of 0.00294118 and an offset of 36.53), or skip the column";

/// Remedy if `c` cannot be a temperature in °C.
pub(super) fn no_temperature(c: f64) -> Option<&'static str> {
    (!c.is_nan() && !POSSIBLE_C.contains(&c)).then_some(CONVERT)
}

/// Counts and checks of the readings of a file.
#[derive(Debug, Clone)]
pub(super) struct Plausibility {
    /// Of both sensors: places among the values of a row, and channels.
    sensors: [Vec<(usize, usize)>; 2],
    temperature: Option<usize>,
    /// Rows that were left out because all readings are 0.
    pub padding: u64,
    /// Rows in which only the accelerometer has zeros.
    empty_accel: u64,
    /// Rows in which only the gyro has a reading, and those in which only the accelerometer has one.
    alone: [u64; 2],
    channels: [Constant; 6],
    rows: u64,
    /// Of both sensors.
    held: [HeldReadings; 2],
    two_sources: TwoSources,
    lowest_c: f64,
    highest_c: f64,
    no_temperatures: NoTemperatures,
    zero_temperatures: ZeroTally,
}

impl Plausibility {
    /// For a file with these columns.
    pub fn new(columns: impl Iterator<Item = Column>) -> Self {
        let mut sensors: [Vec<(usize, usize)>; 2] = Default::default();
        let mut temperature = None;
        for (place, column) in columns.enumerate() {
            match column {
                Column::Raw(c) => sensors[c / 3].push((place, c)),
                Column::Temperature => temperature = Some(place),
                _ => {}
            }
        }
        let channels = sensors.iter().flatten().copied();
        Plausibility {
            two_sources: TwoSources::new(channels),
            sensors,
            temperature,
            padding: 0,
            empty_accel: 0,
            alone: [0; 2],
            channels: Default::default(),
            rows: 0,
            held: Default::default(),
            lowest_c: f64::INFINITY,
            highest_c: f64::NEG_INFINITY,
            no_temperatures: NoTemperatures::default(),
            zero_temperatures: ZeroTally::default(),
        }
    }

    /// Whether `row` has no reading of gyro and accelerometer.
    pub fn is_empty(&self, row: &Row) -> bool {
        let mut all = self.sensors.iter().flatten();
        all.all(|(place, _)| row.values[*place].is_nan())
    }

    /// Whether `row` is padding of a buffer, or comes from a time when nothing was connected. Other rows are counted and checked; impossible values
    /// in them become NaN.
    ///
    /// An accelerometer whose three axes are exactly 0 has measured nothing, because gravity is always there. A gyro at rest may well read 0. Without
    /// an accelerometer, its zeros are padding only if the time stamp is 0 too, after stamps above 0.
    pub fn is_padding(&mut self, row: &mut Row, zero_stamp: bool, begun: bool) -> bool {
        let zero =
            |sensor: &[(usize, usize)]| sensor.iter().all(|(place, _)| row.values[*place] == 0.0);
        let [gyro, accel] = &self.sensors;
        let no_force = accel.len() == 3 && zero(accel);
        let empty =
            |sensor: &[(usize, usize)]| sensor.iter().all(|(place, _)| row.values[*place].is_nan());
        if !gyro.is_empty() && !accel.is_empty() {
            self.alone[0] += u64::from(!empty(gyro) && empty(accel));
            self.alone[1] += u64::from(empty(gyro) && !empty(accel));
        }
        let padding = match accel.is_empty() {
            false => no_force && zero(gyro),
            true => gyro.len() == 3 && zero(gyro) && zero_stamp && begun,
        };
        if padding {
            self.padding += 1;
            return true;
        }
        if no_force {
            self.empty_accel += 1;
            for (place, _) in accel {
                row.values[*place] = f64::NAN;
            }
        }
        for &(place, channel) in self.sensors.iter().flatten() {
            self.channels[channel].take(row.values[place]);
        }
        for (sensor, held) in self.sensors.iter().zip(&mut self.held) {
            if let [x, y, z] = sensor[..] {
                held.take(row.number, [x, y, z].map(|(place, _)| row.values[place]));
            }
        }
        self.two_sources.push(row);
        self.rows += 1;
        if let Some(place) = self.temperature {
            row.values[place] = self.temperature(row.values[place], row.number);
        }
        false
    }

    /// Counts a cell of the thermometer with its reading, °C, and returns whether the cell is a zero.
    pub fn is_zero_temperature(&mut self, cell: f64, reading_c: f64) -> bool {
        self.zero_temperatures.push(cell, reading_c);
        cell == 0.0
    }

    /// Zeros of the thermometer that are no temperatures.
    pub fn zero_temperatures(&self) -> Zeros {
        self.zero_temperatures.found()
    }

    /// The temperature `c` of a row, or NaN if it is impossible.
    fn temperature(&mut self, c: f64, number: u64) -> f64 {
        if c.is_nan() {
            return c;
        }
        self.no_temperatures.of += 1;
        if !POSSIBLE_C.contains(&c) {
            let at = || format!("in row {number}");
            self.no_temperatures.add(c, at);
            return f64::NAN;
        }
        self.lowest_c = self.lowest_c.min(c);
        self.highest_c = self.highest_c.max(c);
        c
    }

    /// For gyro and accelerometer, the number of rows if all of them read 0.
    pub fn dead(&self) -> [Option<u64>; 2] {
        [0, 1].map(|s| {
            let all = &self.sensors[s];
            let dead = !all.is_empty() && all.iter().all(|(_, c)| self.channels[*c].is_zero());
            (dead && self.rows > 0).then_some(self.rows)
        })
    }

    /// Refuses a file at `place` if all its readings are 0, if they alternate between two sources, or if most of its temperatures are impossible.
    pub fn check(&self, place: &str) -> Result<()> {
        if self.rows == 0 && self.padding > 0 {
            return Err(Error::new(
                place,
                format!("all readings are 0, in {}", rows(self.padding)),
                "check that the right columns were named, and that the sensor was connected",
            )
            .about(Argument::Columns));
        }
        self.two_sources.check(place)?;
        let none = &self.no_temperatures;
        if let Some(problem) = none.problem()
            && 2 * none.count > none.of
        {
            let place = format!("{place}, column temp_c");
            return Err(Error::new(place, problem, CONVERT)
                .about(Argument::Scale)
                .about(Argument::Offset));
        }
        Ok(())
    }

    /// A warning if an accelerometer's readings are probably not in m/s².
    pub fn wrong_unit(&self, place: &str, gravity_mps2: f64) -> Option<String> {
        self.two_sources.wrong_unit(place, gravity_mps2)
    }

    /// One warning for each thing that was left out or looks wrong; `place` is the file, whose rows come at `rate_hz`.
    pub fn warnings(&self, place: &str, rate_hz: f64) -> Vec<String> {
        let mut warnings = Vec::new();
        for (sensor, held) in ["gyro", "accel"].iter().zip(&self.held) {
            let held = held.found(sensor, rate_hz);
            warnings.extend(held.map(|held| format!("{place}: {held}")));
        }
        warnings.extend(self.two_sources.warning(place));
        warnings.extend(self.two_sources.overflows(place));
        let apart = |rows: &u64| *rows as f64 > APART_SHARE * self.rows as f64;
        if self.alone.iter().all(apart) {
            let [gyro, accel] = self.alone;
            warnings.push(format!(
                "{place}: {gyro} rows have the gyro alone and {accel} the accelerometer alone, so no turn is complete: give a list of columns with the time for each, and they are joined on it"
            ));
        }
        if self.padding > 0 {
            warnings.push(format!(
                "{place}: {} left out as padding: all readings are exactly 0",
                rows(self.padding)
            ));
        }
        if self.empty_accel > 0 && self.dead()[1].is_none() {
            warnings.push(format!(
                "{place}: in {} the accelerometer reads exactly 0 on all axes, which is impossible at rest: its cells are left empty",
                rows(self.empty_accel)
            ));
        }
        for (s, sensor) in self.sensors.iter().enumerate() {
            if self.rows == 0 || self.dead()[s].is_some() {
                continue;
            }
            // Zeros are those of a channel that is not connected. Another constant may be a rest with coarse steps, which a fit judges.
            let zeros = sensor.iter().filter(|(_, c)| self.channels[*c].is_zero());
            let dead = zeros.filter_map(|(_, c)| self.channels[*c].found(*c, self.rows));
            warnings.extend(dead.map(|dead| format!("{place}: {dead}")));
        }
        let none = self.no_temperatures.warning();
        warnings.extend(none.map(|none| format!("{place}, column temp_c: {none}")));
        warnings.extend(match self.zero_temperatures() {
            Zeros::None => None,
            Zeros::Missing(count) => Some(format!(
                "{place}, column temp_c: it is exactly 0 in {}, far from all other temperatures: left empty, because the thermometer did not answer",
                rows(count)
            )),
            Zeros::Throughout(count) => Some(format!(
                "{place}, column temp_c: it is exactly 0 in all of its {}: there is no thermometer, and the column is left out",
                rows(count)
            )),
        });
        let range = [self.lowest_c, self.highest_c];
        if range[0] <= range[1] && !range.iter().all(|c| USUAL_C.contains(c)) {
            let [low, high] = range;
            let kelvin = if low > 200.0 && high < 400.0 {
                "; kelvins need an offset of -273.15"
            } else {
                ""
            };
            warnings.push(format!(
                "{place}, column temp_c: sensors do not work at {low} to {high} °C: {CONVERT}{kelvin}"
            ));
        }
        warnings
    }
}

fn rows(count: u64) -> String {
    match count {
        1 => "1 row".into(),
        _ => format!("{count} rows"),
    }
}
