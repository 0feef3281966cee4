//! Feeds the rows of a file to the detectors of [`crate::health`], and refuses the file or warns by what they find.

use super::row::Row;
use crate::columns::Column;
use crate::error::Result;
use crate::health::{
    At, Fault, Finding, HeldReadings, RowKind, SENSORS, Temperatures, TwoSources, Zeros,
    accel_at_rest,
};

/// Counts and checks of the readings of a file.
#[derive(Debug, Clone)]
pub(super) struct Plausibility {
    /// Places of the channels among the values of a row.
    places: [Option<usize>; 6],
    /// Whether there is a channel of gyro or accelerometer.
    has_raw: bool,
    temperature: Option<usize>,
    zeros: Zeros,
    /// Of both sensors.
    held: [HeldReadings; 2],
    two_sources: TwoSources,
    temperatures: Temperatures,
    /// Whether what the readings look like gives a warning instead of a refusal.
    trusted: bool,
}

impl Plausibility {
    /// For a file with these columns.
    pub fn new(columns: impl Iterator<Item = Column>, trusted: bool) -> Self {
        let (mut places, mut temperature) = ([None; 6], None);
        for (place, column) in columns.enumerate() {
            match column {
                Column::Raw(c) => places[c] = Some(place),
                Column::Temperature => temperature = Some(place),
                _ => {}
            }
        }
        let has = [&places[..3], &places[3..]].map(|half| half.iter().all(Option::is_some));
        Plausibility {
            places,
            has_raw: places.iter().any(Option::is_some),
            temperature,
            zeros: Zeros::new(has),
            held: Default::default(),
            two_sources: TwoSources::default(),
            temperatures: Temperatures::default(),
            trusted,
        }
    }

    /// Readings of a row; NaN of absent channels.
    fn raw(&self, row: &Row) -> [f64; 6] {
        self.places
            .map(|place| place.map_or(f64::NAN, |place| row.values[place]))
    }

    /// Whether `row` has no reading of gyro and accelerometer; of a file with further triads alone, none at all.
    pub fn is_empty(&self, row: &Row) -> bool {
        match self.has_raw {
            true => self.raw(row).iter().all(|value| value.is_nan()),
            false => row.values.iter().all(|value| value.is_nan()),
        }
    }

    /// Whether `row` is padding of a buffer, or comes from a time when nothing was connected. Other rows are counted and checked; impossible values
    /// in them become NaN.
    pub fn is_padding(&mut self, row: &mut Row, zero_stamp: bool, begun: bool) -> bool {
        let mut raw = self.raw(row);
        match self.zeros.take(&raw, zero_stamp && begun) {
            RowKind::Padding => return true,
            RowKind::NoForce => {
                raw[3..].fill(f64::NAN);
                for place in self.places[3..].iter().flatten() {
                    row.values[*place] = f64::NAN;
                }
            }
            RowKind::Readings => {}
        }
        for (held, half) in self.held.iter_mut().zip([&raw[..3], &raw[3..]]) {
            held.take(row.number, [half[0], half[1], half[2]]);
        }
        self.two_sources.take(row.number, &raw);
        if let Some(place) = self.temperature {
            let at = At::Row(row.number);
            row.values[place] = self.temperatures.take(row.values[place], at);
        }
        false
    }

    /// Counts a cell of the thermometer with its reading, °C, and returns whether the cell is a zero.
    pub fn is_zero_temperature(&mut self, cell: f64, reading_c: f64) -> bool {
        self.temperatures.take_cell(cell, reading_c);
        cell == 0.0
    }

    /// Which fault zeros of the thermometer are, if they are no temperatures.
    pub fn zero_temperatures(&self) -> Option<Fault> {
        self.temperatures.zeros().map(|found| found.fault)
    }

    /// Rows that were left out because all readings are 0.
    pub fn padding(&self) -> u64 {
        self.zeros.padding
    }

    /// For gyro and accelerometer, the finding that all of its readings are 0.
    pub fn not_connected(&self) -> [Option<Finding>; 2] {
        self.zeros.not_connected()
    }

    /// Refuses a file at `place` if all its readings are 0, if they alternate between two sources, or if most of its temperatures are impossible.
    pub fn check(&self, place: &str) -> Result<()> {
        let channels = self.two_sources.channels();
        let refused = channels
            .into_iter()
            .find(|found| found.is_suspicion() && !self.trusted);
        let nothing = self.zeros.nothing();
        let found = nothing
            .or(refused)
            .or(self.temperatures.mostly_impossible());
        found.map_or(Ok(()), |found| Err(found.refusal(place)))
    }

    /// The finding that an accelerometer's readings are probably not in m/s².
    pub fn wrong_unit(&self, gravity_mps2: f64) -> Option<Finding> {
        accel_at_rest(self.two_sources.usual_force()?, gravity_mps2)
    }

    /// What was left out or looks wrong in a file whose rows come at `rate_hz`.
    pub fn found(&self, rate_hz: f64) -> Vec<Finding> {
        let sensors = SENSORS.iter().zip(&self.held);
        let held = sensors.filter_map(|(sensor, held)| held.found(sensor, rate_hz));
        let mut all: Vec<Finding> = held.collect();
        all.extend(self.two_sources.two_magnitudes());
        let channels = self.two_sources.channels().into_iter();
        all.extend(channels.filter(|found| self.trusted || !found.is_suspicion()));
        all.extend(self.zeros.found());
        let temperatures = &self.temperatures;
        all.extend(temperatures.impossible());
        all.extend(temperatures.zeros());
        all.extend(temperatures.unusual());
        all
    }
}
