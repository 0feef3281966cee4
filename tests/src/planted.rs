//! Effects of the bench, planted in recordings by other people.
//!
//! The recording gives what no simulation has: its unit's noise, its stamps, and a person's clumsiness. The bench's physics give the error of each
//! reading from the true motion, and the sum is rounded to the recording's count. The planted error is therefore known, and the calibration of the
//! recording before the planting is the reference of the one after it.
//!
//! The true motion comes from the readings by data-sheet sensitivities, the bias of the gyro at rest, and a fit of three sensitivities and three
//! biases of the accelerometer to the magnitude of gravity (`own_calibration`). It shares no code with the calibrations under test.

use std::collections::BTreeMap;
use std::sync::Arc;

use mimu::diagnose::{Diagnosis, Recordings, diagnose};
use mimu::fit::{Fit, Options};
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_recording::error::Result;
use mimu_recording::{Batch, Manifest, RawUnit, Recording};
use mimu_rig::effects::{Condition, Disturbance, EffectTruth, Sensors, Shape, spec};
use mimu_rig::motion::Motion;
use mimu_rig::noise::Coefficients;
use mimu_rig::pins::Pins;
use mimu_rig::random::Random;
use mimu_rig::rotation::{Rotation, norm, scale};
use mimu_rig::sensor::{AxisTruth, TriadTruth};
use mimu_rig::thermal::Temperatures;
use nalgebra::{DMatrix, DVector, Vector3};
use tempfile::TempDir;

use crate::recordings::{Foreign, mikoff_session, xsens_session};
use crate::sessions::of_array_recorded;
use crate::study::Said;

/// Made course of the temperature: it rises and falls by this much, K, in half a sine over the session. The recordings have no thermometer, and their
/// units are as warm as they were; only the planted error follows the course.
const SWING_C: f64 = 15.0;
/// Step of the made thermometer, K: that of an MPU-6050.
const THERMOMETER_STEP_C: f64 = 1.0 / 340.0;
/// Supply of the converter of an analog unit, V, for effects whose size is a voltage.
const CONVERTER_V: f64 = 5.0;

/// What the data sheet says about a unit.
#[derive(Debug, Clone, Copy)]
struct DataSheet {
    /// Counts per SI of gyro and accelerometer, by axis.
    sensitivity: [[f64; 3]; 2],
    /// Counts at no input.
    null: [[f64; 3]; 2],
    /// Lowest code of 16 bits.
    code_low: f64,
    /// Whether the sensors are analog, behind one converter.
    analog: bool,
    /// Readings of the file per count.
    reading: [f64; 2],
}

/// A public recording without a known error.
#[derive(Debug)]
pub struct Ground {
    /// Name in tables.
    pub name: String,
    manifest: Manifest,
    samples: Batch,
    sheet: DataSheet,
    sensors: [TriadTruth; 2],
    motions: Vec<Motion>,
    temperatures_c: Vec<f64>,
}

/// Diagnosis of a ground, as the reference of its plantings.
#[derive(Debug)]
pub struct Untouched {
    diagnosis: Diagnosis,
    /// What it says.
    pub said: Said,
}

/// One planted effect, and what the diagnosis says.
#[derive(Debug, Clone)]
pub struct Planting {
    /// Name of the ground.
    pub ground: String,
    /// The effect.
    pub truth: &'static str,
    /// Sensor that it disturbs most.
    pub sensor: Sensor,
    /// Size of the effect over the predicted standard deviation of its coefficients, rms over these: what the recording can carry.
    pub strength: f64,
    /// What the diagnosis says: of the effects, those beside the ones of the untouched recording.
    pub said: Said,
    /// Verdict on the untouched recording.
    pub verdict_untouched: &'static str,
    /// Rms of the planted error, of what remains of it after the affine calibration, and after that with the effects found; SI.
    pub errors: [f64; 3],
}

/// What became of a planting.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Outcome {
    /// The effect is named, perhaps as one that the recording does not distinguish from another.
    Named,
    /// No effect is named, and the verdict says that an error remains.
    Unexplained,
    /// Another effect is named in its place, but the verdict says that an error remains.
    AnotherAndUnexplained,
    /// Another effect is named in its place, and the verdict is `explained`.
    NamedWrong,
    /// The verdict is that of the untouched recording.
    Missed,
    /// The recording is refused.
    Refused,
}

impl Planting {
    /// What became of it.
    pub fn outcome(&self) -> Outcome {
        let said = &self.said;
        let another = said.ids().iter().any(|id| !id.starts_with("term:"));
        match said.verdict {
            "refused" => Outcome::Refused,
            _ if said.names(self.truth) => Outcome::Named,
            "unexplained" if another => Outcome::AnotherAndUnexplained,
            _ if another => Outcome::NamedWrong,
            "unexplained" if self.verdict_untouched != "unexplained" => Outcome::Unexplained,
            _ => Outcome::Missed,
        }
    }

    /// Effects that are named although they were not planted.
    pub fn not_there(&self) -> impl Iterator<Item = &str> {
        let wrong = |f: &&Vec<String>| !f.iter().any(|f| f == self.truth);
        self.said.found.iter().filter(wrong).map(|f| f[0].as_str())
    }
}

/// All grounds whose data are at hand.
pub fn grounds() -> Vec<Ground> {
    (0..5).map_while(mikoff).chain(xsens()).collect()
}

/// SI per count of an MPU-9150 at its widest range: 16.4 counts per deg/s and 2048 per g.
fn mpu9150() -> [f64; 2] {
    [(1.0 / 16.4_f64).to_radians(), 9.80665 / 2048.0]
}

/// An MPU-9150 whose file has so many `reading`s per count.
fn mpu9150_sheet(reading: [f64; 2]) -> DataSheet {
    DataSheet {
        sensitivity: mpu9150().map(|si| [1.0 / si; 3]),
        null: [[0.0; 3]; 2],
        code_low: -32768.0,
        analog: false,
        reading,
    }
}

/// One of the five MPU-9150, in whole counts: the numbers of the file are counts written in SI.
fn mikoff(unit: usize) -> Option<Ground> {
    let foreign = mikoff_session(unit)?;
    let sheet = mpu9150_sheet(mpu9150());
    Some(Ground::of(format!("MPU-9150 {unit}"), &foreign, sheet))
}

/// Diagnosis of the first of two `sessions` of a unit of H. Carlsson's array, judged by the second, with the effect `id` of these `sizes` planted in both;
/// `None` if the data are missing.
///
/// # Errors
/// A recording is refused.
pub fn in_two_sessions(
    unit: usize,
    sessions: [usize; 2],
    id: &str,
    sizes: BTreeMap<&'static str, Vec<f64>>,
) -> Option<Result<Diagnosis>> {
    let effect = EffectTruth::draw(id, sizes, 1.0, 0).expect("an effect");
    let planted = |session: usize| {
        let (_folder, recording) = of_array_recorded(unit, session)?;
        let name = format!("MPU-9150 {unit} of the array, session {session}");
        let ground = Ground::of_recording(name, recording, mpu9150_sheet([1.0; 2]));
        let samples = ground.with(&effect, session as u64);
        Some(Prepared::of(ground.manifest, &samples, STILL_FACTOR))
    };
    let [first, second] = [planted(sessions[0])?, planted(sessions[1])?];
    let diagnosed = |first: Prepared, second: Prepared| {
        let recordings = Recordings {
            second: Some(second),
            ..first.into()
        };
        diagnose(recordings, Options::IN_SAMPLE)
    };
    Some(first.and_then(|first| diagnosed(first, second?)))
}

/// The Xsens MTi, with the sensitivities and nulls of its maker.
fn xsens() -> Option<Ground> {
    let foreign = xsens_session()?;
    let sheet = DataSheet {
        sensitivity: [[4778.0, 4758.0, 4766.0], [415.0, 413.0, 415.0]],
        null: [[32768.0, 32466.0, 32485.0], [33123.0, 33276.0, 32360.0]],
        code_low: 0.0,
        analog: true,
        reading: [1.0; 2],
    };
    Some(Ground::of("Xsens MTi".into(), &foreign, sheet))
}

/// One of the eight MPU-9150 of the array in one of its nine sessions.
pub fn array(unit: usize, session: usize) -> Option<Ground> {
    // 16 g and 500 deg/s.
    let sensitivity = [65.5_f64.to_degrees(), 2048.0 / 9.80665];
    let sheet = DataSheet {
        sensitivity: sensitivity.map(|s| [s; 3]),
        null: [[0.0; 3]; 2],
        code_low: -32768.0,
        analog: false,
        reading: [1.0; 2],
    };
    let (_folder, recording) = of_array_recorded(unit, session)?;
    let name = format!("unit {unit}, session {session}");
    Some(Ground::of_recording(name, recording, sheet))
}

impl Ground {
    fn of(name: String, foreign: &Foreign, sheet: DataSheet) -> Self {
        let folder = TempDir::new().expect("there is a temporary folder");
        let recording = foreign.import(&folder).expect("it can be imported");
        Self::of_recording(name, recording, sheet)
    }

    fn of_recording(name: String, recording: Recording, sheet: DataSheet) -> Self {
        let mut samples = Batch::default();
        let collect = |batch: &Batch| {
            samples.t_s.extend(&batch.t_s);
            for (all, more) in samples.raw.iter_mut().zip(&batch.raw) {
                all.extend(more);
            }
            Ok(())
        };
        recording
            .for_each_batch(|_| {}, collect)
            .expect("it was just written");
        let mut manifest = recording.manifest;
        manifest.raw_unit = RawUnit::Count;
        for (channel, values) in samples.raw.iter_mut().enumerate() {
            for value in values.iter_mut() {
                *value = (*value / sheet.reading[channel / 3]).round();
            }
        }
        let end_s = samples.t_s[samples.t_s.len() - 1] - samples.t_s[0];
        let course = samples.t_s.iter().map(|t| {
            let share = (t - samples.t_s[0]) / end_s;
            25.0 + SWING_C * (std::f64::consts::PI * share).sin()
        });
        Self {
            name,
            temperatures_c: course.collect(),
            motions: motions(&samples, &sheet, manifest.gravity_mps2),
            sensors: [0, 1].map(|k| triad(&sheet, k)),
            manifest,
            samples,
            sheet,
        }
    }

    /// Whether `id` can act on this unit: a digital one has no voltages.
    pub fn takes(&self, id: &str) -> bool {
        let of_voltage = ["x_supply_coupling", "x_mains_hum", "x_usb_beat"].contains(&id);
        self.sheet.analog || !of_voltage
    }

    /// Time between samples on average, s.
    fn period_s(&self) -> f64 {
        let t = &self.samples.t_s;
        (t[t.len() - 1] - t[0]) / (t.len() - 1) as f64
    }

    /// The readings with `effect`, which draws random numbers by `seed`.
    fn with(&self, effect: &EffectTruth, seed: u64) -> Batch {
        let sensors = Sensors {
            gyro: &self.sensors[0],
            accel: &self.sensors[1],
            converter_reference_nominal_v: CONVERTER_V,
        };
        let mut active = effect.activate(sensors, seed, self.period_s());
        // The part of a count that the recording has lost: without it, an error below half a count would change no reading.
        let mut lost = Random::new(seed, "part of a count");
        let mut planted = self.samples.clone();
        for (row, motion) in self.motions.iter().enumerate() {
            let c = self.temperatures_c[row];
            let at = Condition {
                motion,
                gyro: motion.rate,
                accel: motion.force,
                temperatures: Temperatures {
                    board: c,
                    die: [c; 4],
                },
                on_s: motion.t_s,
            };
            let mut add = Disturbance::default();
            active.disturb(&at, &mut add);
            let lost: [[f64; 3]; 2] =
                std::array::from_fn(|_| std::array::from_fn(|_| lost.within(0.5)));
            let raw = |k: usize, error: [f64; 3]| -> [f64; 3] {
                std::array::from_fn(|i| {
                    let count = self.samples.raw[3 * k + i][row] + lost[k][i];
                    count + self.sheet.sensitivity[k][i] * error[i]
                })
            };
            let mut pins = Pins {
                gyro_v: raw(0, add.gyro),
                gyro_reference_v: [0.0; 3],
                gyro_temp_v: [0.0; 3],
                accel_v: raw(1, add.accel),
                supply_v: CONVERTER_V,
                converter_reference_v: CONVERTER_V,
                temp_c: c,
            };
            active.read_out(&at, &mut pins);
            let reference = CONVERTER_V / pins.converter_reference_v;
            let outputs = pins.gyro_v.into_iter().chain(pins.accel_v);
            for (values, output) in planted.raw.iter_mut().zip(outputs) {
                values[row] = self.read(output, reference);
            }
        }
        planted
    }

    /// The reading of an output, in counts; a converter with a reference below nominal reads higher.
    fn read(&self, output: f64, reference: f64) -> f64 {
        let low = self.sheet.code_low;
        let code = low + (output - low) * reference;
        code.round().clamp(low, low + 65535.0)
    }

    /// Diagnosis of `samples`. `heated`: with the made thermometer.
    fn diagnose(&self, mut samples: Batch, heated: bool) -> Result<Diagnosis> {
        if heated {
            let read = |c: &f64| (c / THERMOMETER_STEP_C).round() * THERMOMETER_STEP_C;
            samples.temp_c = self.temperatures_c.iter().map(read).collect();
        }
        let prepared = Prepared::of(self.manifest.clone(), &samples, STILL_FACTOR)?;
        diagnose(prepared.into(), Options::IN_SAMPLE)
    }

    /// The recording as it is, or with the effect `id`, whose first parameter is `size` along each axis.
    ///
    /// # Errors
    /// The recording is refused.
    pub fn prepared(&self, planted: Option<(&str, f64)>) -> Result<Prepared> {
        let samples = match planted {
            None => self.samples.clone(),
            Some((id, size)) => {
                let key = spec(id).expect("an effect").parameters[0].key;
                let sizes = BTreeMap::from([(key, vec![size; 3])]);
                self.with(&EffectTruth::draw(id, sizes, 1.0, 0).expect("an effect"), 0)
            }
        };
        let mut prepared = Prepared::of(self.manifest.clone(), &samples, STILL_FACTOR)?;
        // Samples in memory have no file by whose sum a verification tells recordings apart.
        Arc::make_mut(&mut prepared.condensed).sha256 = format!("{} {planted:?}", self.name);
        Ok(prepared)
    }

    /// The recording without a planted effect.
    ///
    /// # Errors
    /// The recording is refused.
    pub fn untouched(&self, heated: bool) -> Result<Untouched> {
        let diagnosis = self.diagnose(self.samples.clone(), heated);
        Ok(Untouched {
            said: Said::of(&diagnosis),
            diagnosis: diagnosis?,
        })
    }

    /// Plants the effect `id`, at `times` the size of data sheets drawn by `seed`, and diagnoses the recording. `None`: the planted error changes no
    /// reading.
    pub fn plant(
        &self,
        id: &'static str,
        times: f64,
        seed: u64,
        untouched: &Untouched,
    ) -> Option<Planting> {
        let mut effect = EffectTruth::draw(id, Default::default(), times, seed)?;
        if let Some(volts) = effect.values.get_mut("mv") {
            // The outputs of this unit are in counts.
            volts.iter_mut().for_each(|v| *v *= 65536.0 / CONVERTER_V);
        }
        let samples = self.with(&effect, seed);
        let increments = [0, 1].map(|k| self.increment(&samples, k));
        if increments == [0.0; 2] {
            return None;
        }
        let numbers = coefficients(id);
        let of_both = |errors: [[f64; 3]; 2], strengths: [f64; 2]| {
            let accel = match (id.contains("gyro"), id.contains("accel")) {
                (true, false) => false,
                (false, true) => true,
                _ => strengths[1] > strengths[0],
            };
            let k = usize::from(accel);
            (Sensor::BOTH[k], errors[k], strengths[k] / numbers.sqrt())
        };
        let diagnosis = self.diagnose(samples, id.contains("thermal"));
        let mut planting = Planting {
            ground: self.name.clone(),
            truth: effect.id,
            sensor: Sensor::Gyro,
            strength: f64::NAN,
            said: Said::of(&diagnosis),
            verdict_untouched: untouched.said.verdict,
            errors: [f64::NAN; 3],
        };
        let Ok(diagnosis) = diagnosis else {
            let errors = increments.map(|i| [i, f64::NAN, f64::NAN]);
            (planting.sensor, planting.errors, _) = of_both(errors, increments);
            return Some(planting);
        };
        let reference = &untouched.diagnosis;
        let errors = [0, 1].map(|k| {
            let left = |fit| remaining(fit, &reference.after, Sensor::BOTH[k]);
            [
                increments[k],
                left(&diagnosis.before),
                left(&diagnosis.after),
            ]
        });
        let strengths =
            Sensor::BOTH.map(|s| noncentrality(&diagnosis.before, &reference.before, s).sqrt());
        (planting.sensor, planting.errors, planting.strength) = of_both(errors, strengths);
        let known = untouched.said.ids();
        planting
            .said
            .found
            .retain(|f| !known.contains(&f[0].as_str()));
        Some(planting)
    }

    /// Rms of the change of the readings of triad `k`, SI.
    fn increment(&self, planted: &Batch, k: usize) -> f64 {
        let channels = 3 * k..3 * k + 3;
        let squares = channels.flat_map(|c| {
            let pairs = planted.raw[c].iter().zip(&self.samples.raw[c]);
            let per_si = self.sheet.sensitivity[k][c % 3];
            pairs.map(move |(a, b)| ((a - b) / per_si).powi(2))
        });
        let finite: Vec<f64> = squares.filter(|s| s.is_finite()).collect();
        (3.0 * finite.iter().sum::<f64>() / finite.len() as f64).sqrt()
    }
}

/// Number of coefficients of the size of effect `id`.
fn coefficients(id: &str) -> f64 {
    let shape = spec(id).map(|s| s.parameters[0].shape);
    match shape.expect("an effect") {
        Shape::Cross => 6.0,
        shape => shape.numbers() as f64,
    }
}

/// Rms of the difference between the calibrated readings of two recordings of the same motion over all blocks, SI: what remains of the error that one
/// has and the other lacks.
fn remaining(with: &Fit, without: &Fit, sensor: Sensor) -> f64 {
    let (Some(a), Some(b)) = (with.sensor(sensor), without.sensor(sensor)) else {
        return f64::NAN;
    };
    let [a, b] = [a, b].map(|fit| fit.estimated.triad.inverse);
    let from = sensor.channels().start;
    let blocks = with.prepared.condensed.blocks.iter();
    let pairs = blocks.zip(&without.prepared.condensed.blocks);
    let (mut sum, mut n) = (0.0, 0.0);
    for (x, y) in pairs {
        let mean =
            |block: &mimu::signal::blocks::Block| Vector3::from_fn(|i, _| block.raw[from + i].mean);
        let square = (a.apply(&mean(x)) - b.apply(&mean(y))).norm_squared();
        if square.is_finite() && x.first_row == y.first_row {
            sum += square * f64::from(x.rows);
            n += f64::from(x.rows);
        }
    }
    (sum / n).sqrt()
}

/// Sum of the squared changes of the affine residuals by the planted effect, over their variance in the untouched recording.
///
/// Both fits leave to the affine parameters what these can take. For an effect with one coefficient, this is the square of its size over the standard
/// deviation with which the recording determines it, if its residuals are white.
fn noncentrality(with: &Fit, without: &Fit, sensor: Sensor) -> f64 {
    let residuals = |fit: &Fit| -> Vec<(f64, Vector3<f64>, bool)> {
        let dwells = &fit.prepared.dwells.list;
        let Some(of) = fit.sensor(sensor) else {
            return Vec::new();
        };
        let judged = of.residuals.iter().filter(|r| !r.within);
        let mut all: Vec<_> = judged
            .map(|r| (dwells[r.dwell].start_s, r.value, false))
            .collect();
        if sensor == Sensor::Gyro {
            // The residuals of a gyro are those of its turns; its rates at rest show as much.
            let rests = dwells.iter().filter(|d| d.faults[sensor].is_none());
            let inverse = of.estimated.triad.inverse;
            all.extend(rests.map(|d| (d.start_s, inverse.apply(&d.raw_mean(sensor)), true)));
        }
        all
    };
    let (a, b) = (residuals(with), residuals(without));
    [false, true]
        .map(|rest| {
            let of = |all: &[(f64, Vector3<f64>, bool)]| -> Vec<(f64, Vector3<f64>)> {
                let kind = all.iter().filter(|r| r.2 == rest);
                kind.map(|r| (r.0, r.1)).collect()
            };
            let (a, b) = (of(&a), of(&b));
            let near = |t: f64| a.iter().find(|(s, _)| (s - t).abs() < 1.0);
            let changes = b
                .iter()
                .filter_map(|(t, v)| Some((near(*t)?.1 - v).norm_squared()));
            let scatter = b.iter().map(|(_, v)| v.norm_squared()).sum::<f64>();
            // A magnitude has one component, the direction after a turn two, a rate three.
            let parts = match (sensor, rest) {
                (Sensor::Accel, _) => 1.0,
                (Sensor::Gyro, false) => 2.0,
                (Sensor::Gyro, true) => 3.0,
            };
            match b.len() {
                0 => 0.0,
                n => changes.sum::<f64>() * parts * n as f64 / scatter,
            }
        })
        .iter()
        .sum()
}

/// The sensors as the effects get them: ideal axes.
fn triad(sheet: &DataSheet, k: usize) -> TriadTruth {
    let axis = |i: usize| AxisTruth {
        direction: std::array::from_fn(|j| f64::from(u8::from(i == j))),
        sensitivity: sheet.sensitivity[k][i],
        null: sheet.null[k][i],
        bandwidth_hz: f64::INFINITY,
        rc_hz: f64::INFINITY,
        noise: Coefficients {
            white: 0.0,
            instability: 0.0,
            walk: 0.0,
        },
        white_per_sample: 0.0,
        low: f64::NEG_INFINITY,
        high: f64::INFINITY,
    };
    TriadTruth {
        axes: [0, 1, 2].map(axis),
        ratiometric: false,
        analog: sheet.analog,
        code_low: sheet.code_low,
        code_span: 65536.0,
    }
}

/// Samples at the same place as each of those in the windows of half a second in which the gyro scatters least.
fn still_windows(samples: &Batch, rows: usize) -> Vec<std::ops::Range<usize>> {
    let windows = (0..samples.t_s.len() / rows).map(|w| w * rows..(w + 1) * rows);
    let scatter = |w: &std::ops::Range<usize>| -> f64 {
        let of = |c: usize| {
            let values = &samples.raw[c][w.clone()];
            let mean = values.iter().sum::<f64>() / rows as f64;
            values.iter().map(|v| (v - mean).powi(2)).sum::<f64>()
        };
        (0..3).map(of).sum()
    };
    let all: Vec<_> = windows.map(|w| (scatter(&w), w)).collect();
    let mut sorted: Vec<f64> = all
        .iter()
        .map(|(s, _)| *s)
        .filter(|s| s.is_finite())
        .collect();
    sorted.sort_by(f64::total_cmp);
    let limit = 4.0 * sorted[sorted.len() / 10];
    all.into_iter()
        .filter(|(s, _)| *s <= limit)
        .map(|(_, w)| w)
        .collect()
}

/// Sensitivities (SI per count) and nulls (counts) of gyro and accelerometer. The nulls of the gyro are its means at rest. Those of the accelerometer, and its
/// sensitivities, make the magnitude at rest that of gravity (Gauss-Newton, six parameters).
fn own_calibration(
    samples: &Batch,
    sheet: &DataSheet,
    still: &[std::ops::Range<usize>],
    gravity_mps2: f64,
) -> [[[f64; 3]; 2]; 2] {
    let mean = |w: &std::ops::Range<usize>, c: usize| {
        let values = &samples.raw[c][w.clone()];
        values.iter().sum::<f64>() / values.len() as f64
    };
    let null = |c: usize| still.iter().map(|w| mean(w, c)).sum::<f64>() / still.len() as f64;
    let gyro = [
        sheet.sensitivity[0].map(|s| 1.0 / s),
        std::array::from_fn(null),
    ];
    let forces: Vec<[f64; 3]> = still
        .iter()
        .map(|w| std::array::from_fn(|i| mean(w, 3 + i)))
        .collect();
    let mut per_count = sheet.sensitivity[1].map(|s| 1.0 / s);
    let mut nulls = sheet.null[1];
    for _ in 0..10 {
        let force = |f: &[f64; 3]| -> [f64; 3] {
            std::array::from_fn(|i| per_count[i] * (f[i] - nulls[i]))
        };
        let residuals = DVector::from_iterator(
            forces.len(),
            forces.iter().map(|f| gravity_mps2 - norm(force(f))),
        );
        let jacobian = DMatrix::from_fn(forces.len(), 6, |row, p| {
            let (f, i) = (force(&forces[row]), p % 3);
            let along = f[i] / norm(f);
            match p < 3 {
                // The parameters are relative to the sensitivities, and in m/s², so that they are alike in size.
                true => along * f[i],
                false => -along,
            }
        });
        let step = jacobian.svd(true, true).solve(&residuals, 1e-3);
        let step = step.expect("both factors were computed");
        for i in 0..3 {
            nulls[i] += step[3 + i] / per_count[i];
            per_count[i] *= 1.0 + step[i];
        }
    }
    [gyro, [per_count, nulls]]
}

/// The motion at each sample, from the readings.
fn motions(samples: &Batch, sheet: &DataSheet, gravity_mps2: f64) -> Vec<Motion> {
    let n = samples.t_s.len();
    let period_s = (samples.t_s[n - 1] - samples.t_s[0]) / (n - 1) as f64;
    let still = still_windows(samples, (0.5 / period_s) as usize);
    let model = own_calibration(samples, sheet, &still, gravity_mps2);
    let input = |k: usize, row: usize| -> [f64; 3] {
        let [per_count, nulls] = &model[k];
        std::array::from_fn(|i| per_count[i] * (samples.raw[3 * k + i][row] - nulls[i]))
    };
    let at_rest: Vec<bool> = {
        let mut at_rest = vec![false; n];
        for window in &still {
            at_rest[window.clone()].fill(true);
        }
        at_rest
    };
    let mut attitude = Rotation::NONE;
    let mut motions: Vec<Motion> = Vec::with_capacity(n);
    for row in 0..n {
        let (rate, force) = (input(0, row), input(1, row));
        let dt_s = match row {
            0 => 0.0,
            _ => samples.t_s[row] - samples.t_s[row - 1],
        };
        if rate.iter().all(|r| r.is_finite()) {
            attitude = attitude * Rotation::by(scale(dt_s, rate));
        }
        if (row == 0 || at_rest[row]) && norm(force) > 0.0 {
            // Gravity gives the vertical; the heading is that of the gyro alone.
            attitude = Rotation::between(attitude.turn(force), [0.0, 0.0, 1.0]) * attitude;
        }
        motions.push(Motion {
            t_s: samples.t_s[row] - samples.t_s[0],
            attitude,
            position: [0.0; 3],
            rate,
            angular_acceleration: [0.0; 3],
            force,
        });
    }
    // Over 60 ms: between neighbouring samples the noise of a gyro is larger than a hand's acceleration.
    for row in 3..n.saturating_sub(3) {
        let (from, to) = (motions[row - 3], motions[row + 3]);
        let apart_s = to.t_s - from.t_s;
        motions[row].angular_acceleration =
            std::array::from_fn(|i| (to.rate[i] - from.rate[i]) / apart_s);
    }
    motions
}
