//! Turns lines of text into readings, and recognises lines without data.
//!
//! [`Line`] knows how sketches separate and label their numbers. A greeting comes first. MotionCal's boards alternately write `Raw:` with nine integers
//! and `Uni:` with the same nine in SI.

use mimu_recording::error::{Argument, Error, Result};
use mimu_recording::labelled::Line;
use mimu_recording::look::column_named;
use mimu_recording::{Column, Decimal, TriadName};

/// Longest line, bytes. No board writes a line as long as this with ten numbers.
const LONGEST: usize = 400;
/// Largest reading: counts have at most 32 bits. One number garbled to more (`1.4e99`) would spoil the fit of all others.
const LARGEST: f64 = BITS;
/// Number of lines without data that are kept for display.
const SHOWN: usize = 3;

/// The columns of a line.
#[derive(Debug, Clone, PartialEq)]
pub struct Columns {
    names: String,
    /// `None`: a column to ignore.
    columns: Vec<Option<Column>>,
    /// Unit of the board's clock, if it has one.
    clock: Option<Decimal>,
}

/// Names of the raw columns of a recording in sketches.
const CHANNELS: [&str; 6] = ["gx", "gy", "gz", "ax", "ay", "az"];
/// The same of a magnetometer.
const MAG: [&str; 3] = ["mx", "my", "mz"];
/// Units of the clock columns `t_us`, `t_ms` and `t_s`.
const CLOCKS: [Decimal; 3] = [Decimal::Microsecond, Decimal::Millisecond, Decimal::Second];
/// Range of counters with 32 bits.
const BITS: f64 = 4_294_967_296.0;

/// Length of a unit of time, s.
fn seconds(unit: Decimal) -> f64 {
    1.0 / unit.per_second() as f64
}

/// Time after which a clock in this unit wraps, s.
fn wraps_s(unit: Decimal) -> f64 {
    match unit {
        Decimal::Second => f64::INFINITY,
        _ => BITS * seconds(unit),
    }
}

impl Columns {
    /// Parses names separated by commas: `ax`, `ay`, `az`, `gx`, `gy`, `gz` or what loggers call them (`AccX`, `gyro_y`), `mx`, `my`, `mz` (all or none),
    /// at most one of `t_us`, `t_ms` and `t_s`, `temp_c`, and `-` for a column to ignore.
    ///
    /// Errors: an unknown or repeated name, or a missing axis.
    pub fn parse(names: &str) -> Result<Self> {
        let refused = |problem: String| {
            let remedy = "name ax, ay, az, gx, gy and gz in the order of the line, also mx, my and mz, t_us, t_ms or t_s, temp_c, and `-` for what is not needed";
            Error::new(format!("columns {names:?}"), problem, remedy).about(Argument::TextColumns)
        };
        let (mut columns, mut clock) = (Vec::new(), None);
        for name in names.split(',').map(str::trim) {
            // `millis` and `micros` are what a sketch calls.
            let of_clock = |unit: &Decimal| match name {
                "millis" => *unit == Decimal::Millisecond,
                "micros" => *unit == Decimal::Microsecond,
                _ => name.strip_prefix("t_") == Some(unit.symbol()),
            };
            let at = |names: &[&str]| names.iter().position(|c| *c == name);
            let channel = at(&CHANNELS).map(Column::Raw);
            let channel = channel.or(at(&MAG).map(|axis| Column::of(TriadName::MAG, axis)));
            let column = match (name, CLOCKS.into_iter().find(of_clock)) {
                ("-", _) => None,
                (_, Some(unit)) => {
                    clock.get_or_insert(unit);
                    Some(Column::Time)
                }
                _ => {
                    let known = channel.or(Column::from_name(name));
                    let known = known.or_else(|| column_named(name));
                    let known = known.filter(|c| match c {
                        Column::More(triad, _) => *triad == TriadName::MAG,
                        c => matches!(c, Column::Raw(_) | Column::Temperature),
                    });
                    let none = || refused(format!("{name:?} is not a column"));
                    Some(known.ok_or_else(none)?)
                }
            };
            if column.is_some() && columns.contains(&column) {
                return Err(refused(format!("{name} occurs twice")));
            }
            columns.push(column);
        }
        let of_mag = (0..3).map(|axis| Some(Column::of(TriadName::MAG, axis)));
        let with_mag = of_mag.clone().any(|column| columns.contains(&column));
        let wanted = (0..6).map(|k| Some(Column::Raw(k))).chain(of_mag);
        let wanted = wanted.zip(CHANNELS.iter().chain(&MAG));
        for (column, name) in wanted.take(if with_mag { 9 } else { 6 }) {
            if !columns.contains(&column) {
                return Err(refused(format!("{name} is missing")));
            }
        }
        Ok(Self {
            names: names.into(),
            columns,
            clock,
        })
    }

    /// `Raw:` of MotionCal: accelerometer, gyro and magnetometer.
    fn motion_cal() -> Self {
        let mut columns = [3, 4, 5, 0, 1, 2].map(|c| Some(Column::Raw(c))).to_vec();
        columns.extend([0, 1, 2].map(|axis| Some(Column::of(TriadName::MAG, axis))));
        Self {
            names: "Raw:ax,ay,az,gx,gy,gz,mx,my,mz".into(),
            columns,
            clock: None,
        }
    }

    /// Whether the lines contain the board's clock.
    pub fn has_clock(&self) -> bool {
        self.clock.is_some()
    }

    /// Whether the lines contain a magnetometer.
    fn has_mag(&self) -> bool {
        let mag = Some(Column::of(TriadName::MAG, 0));
        self.columns.contains(&mag)
    }
}

/// The values of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Gyro x, y, z, accelerometer x, y, z, raw.
    pub raw: [f64; 6],
    /// Magnetometer x, y, z, raw, if there is one.
    pub mag: Option<[f64; 3]>,
    /// Temperature, °C; NaN if there is none.
    pub temp_c: f64,
    /// The board's clock, s, if there is one.
    pub t_s: Option<f64>,
}

/// Converts bytes into readings.
#[derive(Debug)]
pub struct Lines {
    columns: Columns,
    open: Vec<u8>,
    /// Whether the start of the current line was received: text before the first line end may be the second half of a line.
    whole: bool,
    /// Labels among the numbers of the data lines.
    labels: Option<String>,
    count: u64,
    refused: u64,
    /// Lines of numbers with another label than the data lines.
    others: u64,
    first_seen: Vec<String>,
    last_clock: Option<f64>,
    wrapped_s: f64,
}

impl Lines {
    /// For lines with these columns, or for MotionCal's.
    pub fn new(columns: Columns) -> Self {
        Self {
            columns,
            open: Vec::new(),
            whole: false,
            labels: None,
            count: 0,
            refused: 0,
            others: 0,
            first_seen: Vec::new(),
            last_clock: None,
            wrapped_s: 0.0,
        }
    }

    /// Takes bytes. Returns the readings of the data lines that they complete.
    pub fn take(&mut self, bytes: &[u8]) -> Vec<Reading> {
        let mut readings = Vec::new();
        for byte in bytes {
            match byte {
                b'\n' | b'\r' => {
                    let line = std::mem::take(&mut self.open);
                    if !self.whole {
                        self.whole = true;
                        continue;
                    }
                    let text = String::from_utf8_lossy(&line);
                    if !text.trim().is_empty() {
                        readings.extend(self.line(text.trim()));
                    }
                }
                // A longer line cannot be data, whatever follows.
                _ if self.open.len() > LONGEST => {}
                byte => self.open.push(*byte),
            }
        }
        readings
    }

    fn line(&mut self, text: &str) -> Option<Reading> {
        let width = self.columns.columns.len();
        // The time that an operating system writes before the numbers is a column only if one is named.
        let parsed = Line::parse(text).and_then(|line| {
            let timed = line.numbers.len() < width;
            Some((line.labels(), line.values(timed)?))
        });
        let other = |(labels, numbers): &(String, Vec<f64>)| {
            numbers.len() == width && self.labels.as_ref().is_some_and(|own| own != labels)
        };
        if parsed.as_ref().is_some_and(other) {
            self.others += 1;
            return None;
        }
        let found = parsed.and_then(|(labels, numbers)| self.reading(labels, &numbers));
        match found {
            Some(reading) => {
                self.count += 1;
                Some(reading)
            }
            None => {
                self.refused += 1;
                if self.first_seen.len() < SHOWN {
                    let short: String = text.chars().take(60).collect();
                    self.first_seen.push(short);
                }
                None
            }
        }
    }

    fn reading(&mut self, labels: String, numbers: &[f64]) -> Option<Reading> {
        if numbers.len() != self.columns.columns.len() {
            let motion_cal = Columns::motion_cal();
            let is = self.labels.is_none() && labels == "Raw";
            if !is || numbers.len() != motion_cal.columns.len() {
                return None;
            }
            self.columns = motion_cal;
        }
        self.labels.get_or_insert(labels);
        let mut reading = Reading {
            raw: [0.0; 6],
            mag: None,
            temp_c: f64::NAN,
            t_s: None,
        };
        for (column, number) in self.columns.columns.iter().zip(numbers) {
            match (column, self.columns.clock) {
                (Some(column), _) if *column != Column::Time && number.abs() > LARGEST => {
                    return None;
                }
                (Some(Column::Raw(c)), _) => reading.raw[*c] = *number,
                (Some(Column::More(_, axis)), _) => {
                    reading.mag.get_or_insert_default()[*axis] = *number;
                }
                (Some(Column::Temperature), _) => reading.temp_c = *number,
                (Some(Column::Time), Some(unit)) => {
                    let (t_s, wraps_s) = (number * seconds(unit), wraps_s(unit));
                    // 32 bits of microseconds wrap after 71 minutes. A clock that goes back at another time was reset.
                    let near = 10.0;
                    let last = self.last_clock.unwrap_or(t_s);
                    if last > wraps_s - near && t_s < near {
                        self.wrapped_s += wraps_s;
                    }
                    self.last_clock = Some(t_s);
                    reading.t_s = Some(t_s + self.wrapped_s);
                }
                _ => {}
            }
        }
        Some(reading)
    }

    /// Number of data lines.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Number of lines without data, except for the first, which may be incomplete.
    pub fn refused(&self) -> u64 {
        self.refused
    }

    /// Counts lines that were found not to be data by their times.
    pub fn refuse(&mut self, count: u64) {
        self.refused += count;
        self.count -= count.min(self.count);
        if count > 0 && self.first_seen.is_empty() {
            self.first_seen.push("an impossible time".into());
        }
    }

    /// The first lines without data.
    pub fn first_seen(&self) -> &[String] {
        &self.first_seen
    }

    /// Number of lines without data, and the first of them; `None` if there are none.
    pub fn refused_in_words(&self) -> Option<String> {
        let first = self.first_seen.first()?;
        Some(format!(
            "{} of {} lines are not data, the first {first:?}",
            self.refused,
            self.refused + self.count
        ))
    }

    /// Number of lines of numbers with another label; `None` if zero.
    pub fn others_in_words(&self) -> Option<String> {
        let labels = self.labels.as_deref().unwrap_or_default();
        let others = self.others;
        (others > 0).then(|| match labels {
            "" => format!("{others} lines with a label are left out"),
            labels => format!("{others} lines without the label {labels:?} are left out"),
        })
    }

    /// Whether the lines contain the board's clock.
    pub fn has_clock(&self) -> bool {
        self.columns.has_clock()
    }

    /// Whether the lines contain a magnetometer.
    pub fn has_mag(&self) -> bool {
        self.columns.has_mag()
    }

    /// Name of the clock column if its time ran `factor` times more slowly.
    pub fn clock_in_words(&self, factor: f64) -> String {
        let unit_s = self.columns.clock.map_or(f64::NAN, seconds) / factor;
        let near = |unit: &Decimal| (0.2..5.0).contains(&(seconds(*unit) / unit_s));
        match CLOCKS.into_iter().find(near) {
            Some(unit) => format!("t_{}", unit.symbol()),
            None => format!("in units of {} s", mimu::quantity::significant(unit_s)),
        }
    }

    /// Describes a data line.
    pub fn description(&self) -> String {
        format!(
            "{} numbers, {}",
            self.columns.columns.len(),
            self.columns.names
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIX: &str = "ax,ay,az,gx,gy,gz";

    fn read(columns: &str, text: &str) -> (Vec<Reading>, Lines) {
        let mut lines = Lines::new(Columns::parse(columns).unwrap());
        let readings = lines.take(format!("cut,1\n{text}").as_bytes());
        (readings, lines)
    }

    #[test]
    fn columns_have_the_names_that_loggers_write() {
        for names in [
            "AccX,AccY,AccZ,GyroX,GyroY,GyroZ",
            "accel.x,accel.y,accel.z,wx,wy,wz",
        ] {
            let (readings, _) = read(names, "1,2,3,4,5,6\n");
            assert_eq!(readings[0].raw, [4.0, 5.0, 6.0, 1.0, 2.0, 3.0], "{names}");
        }
        assert!(Columns::parse("AccX,AccY,AccZ,GyroX,GyroY,heading").is_err());
    }

    #[test]
    fn sketches_separate_and_label_their_numbers_in_many_ways() {
        for line in [
            "1,2,3,4,5,6\r\n",
            "1, 2, 3, 4, 5, 6,\n",
            "1;2;3;4;5;6\n",
            "1\t2\t3\t4\t5\t6\t\r\n",
            "1.0 2.00 3e0  +4 5 6\r",
            "a/g:\t1\t2\t3\t4\t5\t6\n",
            "ax:1,ay:2,az:3,gx:4,gy:5,gz:6\n",
            "ax=1 ay=2 az=3 gx=4 gy=5 gz=6\n",
            "Accel: 1, 2, 3 Gyro: 4, 5, 6\n",
            "I (123456) imu: 1 2 3 4 5 6\n",
            "{\"acc\":[1,2,3],\"gyro\":{\"x\":4,\"y\":5,\"z\":6}}\n",
            "ax: 1 m/s^2, ay: 2 m/s^2, az: 3 m/s^2, gx: 4 dps, gy: 5 dps, gz: 6 dps\n",
        ] {
            let (readings, lines) = read(SIX, line);
            assert_eq!(readings.len(), 1, "{line}");
            assert_eq!(readings[0].raw, [4.0, 5.0, 6.0, 1.0, 2.0, 3.0], "{line}");
            assert_eq!(lines.refused(), 0, "{line}");
        }
    }

    #[test]
    fn what_is_no_data_is_counted_and_the_first_of_it_is_shown() {
        let (readings, lines) = read(
            SIX,
            "MPU6050 OK\n1,2,3,4,5,6\n1,2,3,4,5\n1,2,3,4,5,nan\n1,2,3,4,5,6,7\n\u{fffd},2,3,4,5,6\n\n9,2,3,4,5,6\n",
        );
        assert_eq!((readings.len(), lines.refused()), (2, 5));
        let words = lines.refused_in_words().unwrap();
        assert_eq!(words, "5 of 7 lines are not data, the first \"MPU6050 OK\"");
    }

    #[test]
    fn a_reading_that_no_converter_gives_is_no_data() {
        let text = "1,2,3,4,5,6\n1,2,1.4e99,4,5,6\n1,2,-4294967296,4,5,6\n1,2,4294967297,4,5,6\n";
        let (readings, lines) = read(SIX, text);
        assert_eq!((readings.len(), lines.refused()), (2, 2));
    }

    #[test]
    fn the_first_line_may_be_cut_and_never_counts() {
        let mut lines = Lines::new(Columns::parse(SIX).unwrap());
        assert!(lines.take(b"34,2,3,4,5,6\n").is_empty());
        assert_eq!(lines.take(b"1234,2,3,4,").len(), 0);
        assert_eq!(lines.take(b"5,6\n")[0].raw[3], 1234.0);
    }

    #[test]
    fn motion_cal_is_known_by_itself_and_its_lines_in_si_are_left_out() {
        let raw = "Raw:10,20,8192,1,2,3,400,500,600\r\nUni:0.01,0.02,9.8,0.1,0.2,0.3,40,50,60\r\n";
        let (readings, lines) = read(SIX, &raw.repeat(3));
        assert_eq!((readings.len(), lines.refused()), (3, 0));
        let words = lines.others_in_words().unwrap();
        assert_eq!(words, "3 lines without the label \"Raw\" are left out");
        assert_eq!(readings[0].raw, [1.0, 2.0, 3.0, 10.0, 20.0, 8192.0]);
        assert_eq!(readings[0].mag, Some([400.0, 500.0, 600.0]));
    }

    #[test]
    fn a_magnetometer_is_read_with_all_its_axes_or_refused() {
        for names in ["mx,my,mz", "MagX,MagY,MagZ", "mag_x,mag_y,mag_z"] {
            let (readings, lines) = read(&format!("{SIX},{names}"), "1,2,3,4,5,6,7,-8,9\n");
            assert_eq!(readings[0].raw, [4.0, 5.0, 6.0, 1.0, 2.0, 3.0], "{names}");
            assert_eq!(readings[0].mag, Some([7.0, -8.0, 9.0]), "{names}");
            assert!(lines.has_mag());
        }
        let (readings, lines) = read(SIX, "1,2,3,4,5,6\n");
        assert!(readings[0].mag.is_none() && !lines.has_mag());
        let (none, _) = read(&format!("{SIX},mx,my,mz"), "1,2,3,4,5,6,7,1.4e99,9\n");
        assert!(none.is_empty());
    }

    #[test]
    fn columns_may_be_left_out_and_a_clock_and_a_temperature_be_there() {
        let (readings, _) = read(
            "t_ms,ax,ay,az,-,gx,gy,gz,temp_c",
            "1500,1,2,3,99,4,5,6,25.5\n",
        );
        assert_eq!(readings[0].t_s, Some(1.5));
        assert_eq!(readings[0].temp_c, 25.5);
        assert_eq!(readings[0].raw, [4.0, 5.0, 6.0, 1.0, 2.0, 3.0]);
    }

    #[test]
    fn columns_may_have_the_names_of_a_recording() {
        let names = "accel_x,accel_y,accel_z,gyro_x,gyro_y,gyro_z,temp_c";
        let (readings, _) = read(names, "1,2,3,4,5,6,25.5\n");
        assert_eq!(readings[0].raw, [4.0, 5.0, 6.0, 1.0, 2.0, 3.0]);
        assert_eq!(readings[0].temp_c, 25.5);
        let error = Columns::parse("ax,ay,az,gx,gy,gz,accel_x").unwrap_err();
        assert!(error.to_string().contains("accel_x occurs twice"));
    }

    #[test]
    fn microseconds_go_on_behind_32_bits() {
        let (readings, _) = read(
            "t_us,ax,ay,az,gx,gy,gz",
            "4294960000,1,2,3,4,5,6\n2704,1,2,3,4,5,6\n",
        );
        let t = |k: usize| readings[k].t_s.unwrap();
        assert!((t(1) - t(0) - 0.01).abs() < 1e-9);
    }

    #[test]
    fn columns_that_cannot_be_are_refused_with_the_name() {
        for (names, says) in [
            ("ax,ay,az,gx,gy", "gz is missing"),
            ("ax,ay,az,gx,gy,gz,ax", "ax occurs twice"),
            ("t_s,t_ms,ax,ay,az,gx,gy,gz", "t_ms occurs twice"),
            ("ax,ay,az,gx,gy,gz,mx,mz", "my is missing"),
            ("ax,ay,az,gx,gy,gz,gyro2_x", "\"gyro2_x\" is not a column"),
        ] {
            let error = Columns::parse(names).unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
    }

    #[test]
    fn a_line_without_an_end_takes_no_memory() {
        let mut lines = Lines::new(Columns::parse(SIX).unwrap());
        lines.take(&vec![b'7'; 1_000_000]);
        assert!(lines.open.len() <= LONGEST + 1);
    }
}
