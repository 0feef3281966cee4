//! One recording, from power-on to power-off, as rows: means of some seconds with their known input, and the thermometer.

use mimu::calibration::Origin;
use mimu::estimate::EarthShare;
use mimu::signal::blocks::{Block, Condensed};
use mimu::{Dwell, PerSensor, Prepared, Sensor};
use mimu_allan::variance::AllanModel;
use mimu_recording::{Error, RawUnit, Reference, ReferenceError, Result, SensorSettings};
use nalgebra::Vector3;

use crate::bias_jumps::{self, BiasJump};
use crate::earth;
use crate::excitation::tells_apart;
use crate::row::Row;
use crate::thermometer::Thermometer;
use crate::warning::Warning;

/// Length of a row, s. At 5 K/min a die moves by 0.2 K in it, over which any curve is a line.
const ROW_S: f64 = 2.5;
/// Shortest row, s: the rest of a dwell.
const SHORTEST_S: f64 = 0.5;
/// Fewest samples of a shorter row, if it is a whole burst.
const FEWEST_IN_BURST: f64 = 4.0;
/// A change between two dwells is a move if it exceeds this many times the change between neighbouring rows plus this many times the
/// largest drift. A false move costs six parameters, and a missed one bends the curves.
const MOVED_SIGMAS: f64 = 6.0;
const MOVED_DRIFTS: f64 = 2.0;
/// Rows over which a drift is computed: half a minute.
const DRIFT_ROWS: usize = 12;
/// Where the specific force changes by a larger share, the gyro gets an offset of its own, because force moves its bias. A smaller change moves it by at most
/// 0.02 deg/s (0.2 deg/s/g is the largest g-sensitivity of data sheets), and an offset would hide a jump of the bias: one of 0.5 deg/s came with a
/// change of the force by 0.05.
const TILTED: f64 = 0.1;
/// Slower than this, rad/s, a unit is at rest.
const RATE: f64 = 0.02;
/// Longest dwell with a moving input, s, that is taken as one mean.
const LONGEST_MOVE_S: f64 = 60.0;

/// A recording prepared for curves over temperature.
#[derive(Debug, Clone)]
pub struct Session {
    /// Path of the samples, for messages.
    pub place: String,
    /// Unit that was recorded.
    pub device: String,
    /// Its number, if it is known.
    pub unit_id: Option<String>,
    /// Its sensors as they were set, if they are known.
    pub sensors: Option<SensorSettings>,
    /// Unit of the readings.
    pub raw_unit: RawUnit,
    /// What is known of the input.
    pub reference: Reference,
    /// Local gravity, m/s².
    pub gravity_mps2: f64,
    /// Latitude, degrees, if it is known.
    pub latitude_deg: Option<f64>,
    /// Errors of the reference, if they are stated.
    pub reference_error: Option<ReferenceError>,
    /// SHA-256 of the samples file.
    pub sha256: String,
    /// Samples a second.
    pub rate_hz: f64,
    /// The thermometer.
    pub thermometer: Thermometer,
    /// Rows of gyro and accelerometer.
    pub rows: PerSensor<Vec<Row>>,
    /// Samples of the recording.
    pub samples: f64,
    /// Noise of the six channels at rest, raw, if a noise file gives it.
    pub noise_at_rest: [Option<AllanModel>; 6],
    /// Where the input is not known: times, s, at which the unit was put into another pose, as it matters to gyro and accelerometer.
    pub moved_s: [Vec<f64>; 2],
    /// Where the input is not known: jumps of the gyro's bias.
    pub bias_jumps: Vec<BiasJump>,
    /// Why samples are not in the rows, in words.
    pub unused: String,
    /// What a person should know.
    pub warnings: Vec<Warning>,
}

impl Session {
    /// What a file says of this recording, in which the dies had these temperatures.
    pub fn origin(&self, range_c: [f64; 2]) -> Origin {
        Origin {
            sha256: Some(self.sha256.clone()).filter(|s| !s.is_empty()),
            reference: Some(self.reference),
            raw_unit: self.raw_unit,
            gravity_mps2: Some(self.gravity_mps2),
            clock: None,
            temp_c: None,
            temp_range_c: Some(range_c),
        }
    }

    /// From `prepared`.
    ///
    /// # Errors
    /// Those of the thermometer; means without samples.
    pub fn of(prepared: &Prepared) -> Result<Self> {
        let manifest = &prepared.manifest;
        if manifest.means {
            let problem = "these are means of poses, without times and temperatures";
            let remedy = "give the recording of samples from which they were computed";
            return Err(Error::new(&prepared.place, problem, remedy));
        }
        if manifest.reference == Reference::TurntableRate {
            let problem = "only the magnitude of the rate is known, but curves over temperature need known inputs or gravity";
            let remedy = "give a recording from a rate table, or of a unit that stands still (reference = \"gravity\")";
            return Err(Error::new(&prepared.place, problem, remedy));
        }
        let condensed = &prepared.condensed;
        let thermometer = Thermometer::of(condensed, manifest.power_on_s, &prepared.place)?;
        let found = condensed.warnings.iter().chain(&prepared.dwells.warnings);
        let mut warnings: Vec<Warning> = found.cloned().map(Warning::Recording).collect();
        let mut rows = PerSensor::from_fn(|sensor| rows(prepared, sensor));
        earth::complete(&mut rows[Sensor::Gyro]);
        let moved_s = match manifest.reference {
            Reference::Gravity => {
                let moves = moves(&rows[Sensor::Accel]);
                let turned = moves.iter().filter(|m| m.share > TILTED);
                [
                    turned.map(|m| m.at_s).collect(),
                    moves.iter().map(|m| m.at_s).collect(),
                ]
            }
            _ => [Vec::new(), Vec::new()],
        };
        let bias_jumps = match manifest.reference {
            Reference::Gravity => bias_jumps::find(&rows[Sensor::Gyro], &moved_s[0]),
            _ => Vec::new(),
        };
        if let Some(first_s) = moved_s[1].first() {
            warnings.push(Warning::Moved {
                times: moved_s.each_ref().map(Vec::len),
                first_s: *first_s,
            });
        }
        if !bias_jumps.is_empty() {
            warnings.push(Warning::BiasJumps {
                jumps: bias_jumps.clone(),
                raw_unit: manifest.raw_unit,
            });
        }
        Ok(Self {
            place: prepared.place.clone(),
            device: manifest.device.clone(),
            unit_id: manifest.unit_id().map(str::to_owned),
            sensors: manifest.sensors().cloned(),
            raw_unit: manifest.raw_unit,
            reference: manifest.reference,
            gravity_mps2: manifest.gravity_mps2,
            latitude_deg: manifest.latitude_deg,
            reference_error: prepared.reference_error().cloned(),
            sha256: condensed.sha256.clone(),
            rate_hz: 1.0 / condensed.period_s,
            thermometer,
            rows,
            samples: condensed.rows as f64,
            noise_at_rest: std::array::from_fn(|c| prepared.noise.largest_at_rest(c)),
            moved_s,
            bias_jumps,
            unused: unused(prepared),
            warnings,
        })
    }

    /// How often the unit was put into another pose before `t_s`, as it matters to `sensor`.
    pub fn poses_before(&self, sensor: Sensor, t_s: f64) -> usize {
        self.moved_s[sensor as usize].partition_point(|moved| *moved < t_s)
    }
}

/// Another pose.
struct Move {
    at_s: f64,
    /// Change of the accelerometer's reading over its magnitude.
    share: f64,
}

/// Times between two dwells at which the accelerometer's reading changes by more than noise and the drift with temperature: the pose
/// changes there, and with it the contribution of gravity to the biases.
fn moves(rows: &[Row]) -> Vec<Move> {
    let within = rows.windows(2).filter(|p| p[0].step == p[1].step);
    let changes: Vec<Vector3<f64>> = within.map(|p| p[1].raw - p[0].raw).collect();
    let rms = |axis: usize| {
        let squares = changes.iter().map(|c| c[axis] * c[axis]).sum::<f64>();
        (squares / changes.len().max(1) as f64).sqrt()
    };
    let noise = Vector3::from_fn(|axis, _| rms(axis));
    let drift = Vector3::from_fn(|axis, _| {
        let apart = rows.windows(1 + DRIFT_ROWS).filter_map(|w| {
            let (first, last) = (w.first()?, w.last()?);
            let over_s = last.middle_s - first.middle_s;
            (first.step == last.step).then(|| (last.raw - first.raw)[axis].abs() / over_s)
        });
        apart.fold(0.0, f64::max)
    });
    let between = rows.windows(2).filter(|p| p[0].step != p[1].step);
    let moved = between.filter(|p| {
        let gap_s = p[1].middle_s - p[0].middle_s;
        let most = noise * MOVED_SIGMAS + drift * (MOVED_DRIFTS * gap_s);
        let change = (p[1].raw - p[0].raw).abs();
        (0..3).any(|axis| change[axis] > most[axis])
    });
    moved
        .map(|p| Move {
            at_s: 0.5 * (p[0].middle_s + p[1].middle_s),
            share: (p[1].raw - p[0].raw).norm() / p[0].raw.norm(),
        })
        .collect()
}

/// Why samples of `prepared` are in no row.
fn unused(prepared: &Prepared) -> String {
    let dwells = &prepared.dwells;
    let within: u64 = dwells.list.iter().map(|d| d.rows).sum();
    let outside = 1.0 - within as f64 / prepared.condensed.rows.max(1) as f64;
    let sensor = Sensor::BOTH.into_iter().find(|s| prepared.has(*s));
    format!(
        "{:.1} % of the samples are outside of dwells{}",
        100.0 * outside,
        sensor.map_or_else(String::new, |sensor| dwells.unused(sensor))
    )
}

/// Rows of all dwells that `sensor` can use.
fn rows(prepared: &Prepared, sensor: Sensor) -> Vec<Row> {
    if !prepared.has(sensor) {
        return Vec::new();
    }
    let usable = prepared.dwells.list.iter().enumerate();
    let usable: Vec<(usize, &Dwell)> = usable.filter(|(_, d)| d.faults[sensor].is_none()).collect();
    // Readings of an input that moves within a dwell are late or early by some milliseconds. Over a whole turn that cancels for the gyro,
    // but not for a rotating force.
    let stands = usable.iter().any(|(_, d)| !d.moves(sensor) && !d.turn);
    // A turning unit senses a centripetal force from an unknown lever arm: 2 mm at 50 deg/s are 1.5 mm/s², four times the residuals of
    // curves through rest alone. Rates are needed only if the poses at rest do not distinguish everything.
    let at_rest = |d: &&Dwell| d.reference[..3].iter().map(|r| r * r).sum::<f64>() < RATE * RATE;
    let forces = usable
        .iter()
        .map(|(_, d)| *d)
        .filter(|d| at_rest(d) && !d.moves(sensor) && !d.turn);
    let forces = forces.map(|d| Vector3::from_column_slice(&d.reference[3..]));
    let leave_rates = sensor == Sensor::Accel && tells_apart(forces);
    let mut rows = Vec::new();
    for (index, dwell) in usable {
        if leave_rates && !at_rest(&dwell) {
            continue;
        }
        let whole = dwell.moves(sensor) || dwell.turn;
        if whole && (sensor == Sensor::Accel && stands || dwell.duration_s > LONGEST_MOVE_S) {
            continue;
        }
        let length_s = if whole { f64::INFINITY } else { ROW_S };
        rows.extend(of_dwell(prepared, sensor, index, length_s));
    }
    rows
}

fn of_dwell(prepared: &Prepared, sensor: Sensor, index: usize, length_s: f64) -> Vec<Row> {
    let condensed = &prepared.condensed;
    let dwell = &prepared.dwells.list[index];
    let earth = prepared.earth_on_table.as_deref();
    let earth = earth.filter(|_| sensor == Sensor::Gyro);
    let known = prepared.manifest.reference == Reference::Table;
    let mut rows: Vec<Row> = Vec::new();
    let mut open = Open {
        after_gap: dwell.blocks.start == 0,
        ..Open::default()
    };
    // At least two, because their differences show the noise.
    let least = match length_s.is_finite() && dwell.duration_s >= 2.0 * SHORTEST_S {
        true => 2.0,
        false => 1.0,
    };
    let count = (dwell.duration_s / length_s).round().max(least);
    let samples = dwell.rows as f64 / count;
    for (k, block) in condensed.blocks[dwell.blocks.clone()].iter().enumerate() {
        if open.rows > 0.0 && (open.rows + 0.5 * f64::from(block.rows) > samples || block.after_gap)
        {
            let length = open.rows;
            let rest = open.rest;
            match (open.close(condensed, dwell.step, block.after_gap), rest) {
                (Some(row), _) if !rest || length * condensed.period_s >= SHORTEST_S => {
                    rows.push(row);
                }
                // The end of a burst of 2.9 s, whose first 2.5 s are a row, belongs to that row.
                (Some(row), true) => {
                    if let Some(before) = rows.last_mut() {
                        before.join(&row);
                    }
                }
                _ => {}
            }
            open.rest = !block.after_gap;
        }
        open.after_gap |= block.after_gap;
        let rails = &prepared.dwells.rails;
        let clipped = sensor
            .channels()
            .any(|c| block.raw[c].n < block.rows || rails[c].touched_by(&block.raw[c]));
        if !clipped {
            let earth = earth.map_or(EarthShare::NONE, |earth| earth.at(index, k));
            open.add(block, sensor, known, earth);
        }
    }
    let whole = !open.rest;
    rows.extend(open.close(condensed, dwell.step, whole));
    rows
}

/// Sums of a row that is not closed yet.
#[derive(Default)]
struct Open {
    /// Whether samples are missing before it.
    after_gap: bool,
    /// Whether it continues where a row ended.
    rest: bool,
    rows: f64,
    time: f64,
    raw: Vector3<f64>,
    input: Vector3<f64>,
    force: Vector3<f64>,
    earth: EarthShare,
}

impl Open {
    fn add(&mut self, block: &Block, sensor: Sensor, known: bool, earth: EarthShare) {
        let n = f64::from(block.rows);
        let from = sensor.channels().start;
        self.rows += n;
        self.time += n * 0.5 * (block.start_s + block.last_s);
        self.raw += n * Vector3::from_fn(|k, _| block.raw[from + k].mean);
        self.input += n * Vector3::from_fn(|k, _| match (known, sensor) {
            (false, _) => f64::NAN,
            (true, Sensor::Gyro) => block.reference[from + k].mean.to_radians(),
            (true, Sensor::Accel) => block.reference[from + k].mean,
        });
        self.input += n * earth.known;
        self.force += n * Vector3::from_fn(|k, _| block.reference[3 + k].mean);
        self.earth = EarthShare {
            known: self.earth.known + n * earth.known,
            by: self.earth.by + n * earth.by,
            heading: earth.heading,
        };
    }

    /// The row, unless it is too short or its input should be known but is not; `gap`: samples are missing after it.
    fn close(&mut self, condensed: &Condensed, step: i32, gap: bool) -> Option<Row> {
        let open = std::mem::take(self);
        let known = condensed.has_reference.iter().any(|r| *r);
        let row = Row {
            middle_s: open.time / open.rows,
            samples: open.rows,
            raw: open.raw / open.rows,
            input: open.input / open.rows,
            earth: EarthShare {
                known: open.earth.known / open.rows,
                by: open.earth.by / open.rows,
                ..open.earth
            },
            up: open.force.normalize(),
            step,
        };
        let burst = (open.after_gap && open.rows >= FEWEST_IN_BURST || open.rest) && gap;
        let long = open.rows * condensed.period_s >= SHORTEST_S || burst;
        let partly = row.input.iter().any(|x| x.is_finite()) && known;
        let whole = row.input.iter().all(|x| x.is_finite());
        (long && (whole || !partly)).then_some(row)
    }
}
