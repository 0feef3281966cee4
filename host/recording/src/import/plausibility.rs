//! Feeds the rows of a file to the detectors of [`crate::health`], and refuses the file or warns by what they find.

use crate::columns::Column;
use crate::error::Result;
use crate::health::{
    At, Fault, Finding, HeldReadings, RowKind, SENSORS, Temperatures, Zeros, accel_at_rest,
    across_16_bits,
};
use crate::units::median;

/// Rows at the beginning in which jumps between the ends of 16 bits are searched for.
const WATCHED: usize = 20_000;

/// Counts and checks of the readings of a file.
#[derive(Debug, Clone)]
pub(super) struct Plausibility {
    /// Places of the channels among the values of a row.
    places: [Option<usize>; 6],
    temperature: Option<usize>,
    zeros: Zeros,
    /// Of both sensors.
    held: [HeldReadings; 2],
    /// Channels whose codes are put together wrongly.
    codes: Vec<Finding>,
    /// Median magnitude of specific force.
    usual_force: Option<f64>,
    temperatures: Temperatures,
    /// Whether what the readings look like gives a warning instead of a refusal.
    trusted: bool,
}

impl Plausibility {
    /// For a file with these columns.
    pub fn new(columns: &[Column], trusted: bool) -> Self {
        let at = |column: Column| columns.iter().position(|own| *own == column);
        let places: [_; 6] = std::array::from_fn(|c| at(Column::Raw(c)));
        let has = [&places[..3], &places[3..]].map(|half| half.iter().all(Option::is_some));
        Plausibility {
            places,
            temperature: at(Column::Temperature),
            zeros: Zeros::new(has),
            held: Default::default(),
            codes: Vec::new(),
            usual_force: None,
            temperatures: Temperatures::default(),
            trusted,
        }
    }

    /// Readings of a row; NaN of absent channels.
    fn raw(&self, row: &[f64]) -> [f64; 6] {
        self.places
            .map(|place| place.map_or(f64::NAN, |place| row[place]))
    }

    /// Whether a row has no reading of gyro and accelerometer; of a file with further triads alone, none at all.
    pub fn is_empty(&self, row: &[f64]) -> bool {
        match self.places.iter().any(Option::is_some) {
            true => self.raw(row).iter().all(|value| value.is_nan()),
            false => row.iter().all(|value| value.is_nan()),
        }
    }

    /// Whether row `number` is padding of a buffer, or comes from a time when nothing was connected; `may_pad`: its time is 0, after times above 0. Other
    /// rows are counted and checked; impossible values in them become NaN.
    pub fn is_padding(&mut self, number: u64, row: &mut [f64], may_pad: bool) -> bool {
        let mut raw = self.raw(row);
        match self.zeros.take(&raw, may_pad) {
            RowKind::Padding => return true,
            RowKind::NoForce => {
                raw[3..].fill(f64::NAN);
                for place in self.places[3..].iter().flatten() {
                    row[*place] = f64::NAN;
                }
            }
            RowKind::Readings => {}
        }
        for (held, half) in self.held.iter_mut().zip([&raw[..3], &raw[3..]]) {
            held.take(number, [half[0], half[1], half[2]]);
        }
        if let Some(place) = self.temperature {
            row[place] = self.temperatures.take(row[place], At::Row(number));
        }
        false
    }

    /// Counts a cell of the thermometer with its reading, °C.
    pub fn take_temperature_cell(&mut self, cell: f64, reading_c: f64) {
        self.temperatures.take_cell(cell, reading_c);
    }

    /// Takes all rows that were kept, column by column.
    pub fn finish(&mut self, values: &[Vec<f64>]) {
        let channel = |c: usize| self.places[c].map(|place| values[place].as_slice());
        let codes = (0..6).filter_map(|c| {
            let readings = channel(c)?;
            across_16_bits(c, &readings[..readings.len().min(WATCHED)])
        });
        let codes = codes.collect();
        if let [Some(x), Some(y), Some(z)] = [3, 4, 5].map(channel) {
            let sizes = (0..x.len()).map(|row| x[row].hypot(y[row]).hypot(z[row]));
            self.usual_force = median(sizes.filter(|size| *size > 0.0).collect());
        }
        self.codes = codes;
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

    /// Refuses a file at `place` if all its readings are 0, if its codes look wrong, or if most of its temperatures are impossible.
    pub fn check(&self, place: &str) -> Result<()> {
        let refused = |found: &&Finding| found.is_suspicion() && !self.trusted;
        let nothing = self.zeros.nothing();
        let found = nothing
            .or(self.codes.iter().find(refused).copied())
            .or(self.temperatures.mostly_impossible());
        found.map_or(Ok(()), |found| Err(found.refusal(place)))
    }

    /// The finding that an accelerometer's readings are probably not in m/s².
    pub fn wrong_unit(&self, gravity_mps2: f64) -> Option<Finding> {
        accel_at_rest(self.usual_force?, gravity_mps2)
    }

    /// What was left out or looks wrong in a file whose rows come at `rate_hz`.
    pub fn found(&self, rate_hz: f64) -> Vec<Finding> {
        let sensors = SENSORS.iter().zip(&self.held);
        let held = sensors.filter_map(|(sensor, held)| held.found(sensor, rate_hz));
        let mut all: Vec<Finding> = held.collect();
        let codes = self.codes.iter();
        all.extend(codes.filter(|found| self.trusted || !found.is_suspicion()));
        all.extend(self.zeros.found());
        let temperatures = &self.temperatures;
        all.extend(temperatures.impossible());
        all.extend(temperatures.zeros());
        all.extend(temperatures.unusual());
        all
    }
}
