//! Noise of a dwell mean, from the Allan deviation within the dwells.
//!
//! If the noise is correlated, the sigma of a mean of n samples is not sigma/√n. The Allan variance at the length of the dwell is how much
//! two successive means differ (fang (8), section 3). Only a longer record at rest shows wander that is slower than a dwell: see its noise
//! file, and [`wander`].

pub mod noise_file;
mod pool;
pub mod wander;

use nalgebra::{DMatrix, Matrix3, Vector3};

use mimu_core::compensation::Affine;

use self::pool::{Series, block_s, pooled, within};
use self::wander::{Slow, Span};
use crate::noise::noise_file::NoiseFile;
use crate::quantity::Sensor;
use crate::signal::blocks::{Block, Condensed, Rails, quantile};
use crate::signal::course::Course;
use crate::signal::dwell::Dwell;
use crate::signal::ramp::ramps;
use crate::triad::Covariance;
use crate::warning::Warning;
use mimu_allan::variance::AllanModel;
use mimu_recording::{Error, Manifest, RAW_COLUMNS, RawUnit, Result, are_two_units};

/// Noise of one raw channel from a record at rest, at one temperature or several (fang, Table 5).
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseAtRest {
    /// Temperature, °C, ascending, and the model there; a single model applies at all temperatures.
    nodes: Vec<(f64, AllanModel)>,
}

impl NoiseAtRest {
    /// The model at `temp_c`: interpolated linearly in the variances between the temperatures of the records, beyond them that of the
    /// nearest. If `temp_c` is unknown, that of the lowest.
    fn at(&self, temp_c: f64) -> AllanModel {
        let k = self.nodes.partition_point(|n| n.0 <= temp_c);
        if k == 0 || k == self.nodes.len() {
            return self.nodes[k.saturating_sub(1)].1;
        }
        let [(t0, a), (t1, b)] = [self.nodes[k - 1], self.nodes[k]];
        let share = (temp_c - t0) / (t1 - t0);
        let mix = |a: f64, b: f64| a + share * (b - a);
        AllanModel {
            white: mix(a.white, b.white),
            flicker: mix(a.flicker, b.flicker),
            walk: mix(a.walk, b.walk),
        }
    }
}

/// Noise of one raw channel within dwells.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ChannelNoise {
    /// The three terms fitted to the Allan variance.
    pub model: AllanModel,
    /// The Allan variance itself, (averaging time in s, raw units squared), if the model does not fit it: filtered noise, or a vibration.
    pub curve: Option<Vec<(f64, f64)>>,
    /// Whether any dwell has shown it. If none has, its variance is 0 and means nothing.
    pub known: bool,
}

impl ChannelNoise {
    /// Variance of the mean over `tau_s`, raw units squared.
    ///
    /// The model is preferred, because it averages over all octaves. If it does not fit, the measured curve is used: for noise with a
    /// correlation time of half a second, the rate random walk of the model made the mean over 10 s four times too noisy. Beyond its end
    /// the curve continues with its last slope, limited to those of white noise and of a random walk.
    pub fn variance(&self, tau_s: f64) -> f64 {
        let Some(curve) = &self.curve else {
            return self.model.variance(tau_s);
        };
        let k = curve
            .partition_point(|p| p.0 < tau_s)
            .clamp(1, curve.len() - 1);
        let [(t0, v0), (t1, v1)] = [curve[k - 1], curve[k]];
        let slope = ((v1 / v0).ln() / (t1 / t0).ln()).clamp(-1.0, 1.0);
        v1 * (tau_s / t1).powf(slope)
    }
}

/// Noise of the six raw channels of a unit at rest.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Noise {
    /// Gyro x, y, z, accelerometer x, y, z: within the dwells.
    pub channels: [ChannelNoise; 6],
    /// Their noise from a record at rest, if it is used.
    at_rest: [Option<NoiseAtRest>; 6],
    /// Variances of a mean over a second, raw units squared, within the dwells and from a record at rest, if the two contradict each other.
    other: [Option<[f64; 2]>; 6],
    /// From the first dwell to the end of the last, s.
    session: Span,
    /// For a table of means: whether it gives standard deviations for gyro and accelerometer, all that is known of the noise there.
    of_table: Option<[bool; 2]>,
}

/// Rate that counts as rest where the force is not known, rad/s: 0.1 deg/s turns gravity by 3 mm/s² in a dwell of ten seconds.
const REST_RATE: f64 = 1.7e-3;
/// If the variance of an accelerometer over a dwell exceeds the lower quartile of all dwells by this factor, the unit turned in the dwell.
const SWINGS: f64 = 25.0;
/// If the force over a tenth of a second differs from that of the dwell by this angle, rad, the unit turned: 3 degrees, six times the sway
/// of hands.
const SWINGS_BY: f64 = 0.05;

/// Which of `dwells` show the noise of the readings: those at rest, or whose known input explains the readings. A dwell that turns through
/// gravity without a known force does not: its swing of several m/s² once made noise floors of 766 and 4000 mm/s².
fn still<'a>(dwells: &[&'a Dwell], sensor: Sensor) -> Vec<&'a Dwell> {
    let accel = Sensor::Accel.channels();
    let limits: Vec<f64> = accel
        .clone()
        .map(|c| {
            let mut all: Vec<f64> = dwells.iter().map(|d| d.raw[c].variance).collect();
            SWINGS * quantile(&mut all, 0.25).unwrap_or(0.0)
        })
        .collect();
    let swings = |d: &Dwell| {
        let mut own = accel.clone().zip(&limits);
        own.any(|(c, limit)| *limit > 0.0 && d.raw[c].variance > *limit)
    };
    let stands = |d: &&&Dwell| {
        let [rate, force] = Sensor::BOTH.map(|s| d.input(s));
        match (sensor, rate, force) {
            (Sensor::Accel, _, Some(_)) | (Sensor::Gyro, Some(_), _) => true,
            (Sensor::Accel, Some(rate), None) => rate.norm() < REST_RATE && !d.moves(Sensor::Gyro),
            (Sensor::Gyro, None, Some(_)) => !d.moves(Sensor::Accel),
            (_, None, None) => !swings(d),
        }
    };
    dwells.iter().filter(stands).copied().collect()
}

/// If the variance of a mean over 1 s in a noise file is wrong by this factor, up or down, the file does not describe this recording.
const ANOTHER_NOISE: f64 = 2.0;

impl Noise {
    /// Pools the overlapping Allan variance within all usable dwells at rest or at a constant rate, the Hadamard variance where the
    /// temperature ramps, and fits the model to it. If the input is constant in no dwell, the residuals of the readings about their moving
    /// input are used; `rails` are those of the channels.
    pub fn within(dwells: &[Dwell], condensed: &Condensed, rails: &[Rails; 6]) -> Self {
        let mut channels: [ChannelNoise; 6] = Default::default();
        for sensor in Sensor::BOTH {
            for c in sensor.channels() {
                if condensed.has_raw[c] {
                    let of_sensor = dwells.iter().filter(|d| d.faults[sensor].is_none());
                    let used: Vec<&Dwell> = of_sensor.filter(|d| !d.turn).collect();
                    let used = still(&used, sensor);
                    let usable = || used.iter().copied();
                    // The moving input of the other sensor may affect the reading too, and a fit does not know how: dwells without any
                    // motion are preferred.
                    let none_moves = usable().any(|d| d.moves == [false; 2]);
                    let stand = || {
                        usable().filter(|d| match none_moves {
                            true => d.moves == [false; 2],
                            false => !d.moves(sensor),
                        })
                    };
                    channels[c] = match stand().next() {
                        Some(_) => within(stand(), condensed, |b| {
                            (b.raw[c].n > 0).then_some(b.raw[c].mean)
                        }),
                        None => {
                            let left = usable().filter_map(|d| {
                                let course = Course::of(condensed, d.blocks.clone(), rails)?;
                                let blocks = course.blocks.iter();
                                let means: Vec<f64> =
                                    blocks.map(|i| condensed.blocks[*i].raw[c].mean).collect();
                                Some(Series {
                                    means: course.unfollowed(sensor, &means)?,
                                    ramps: ramps(&condensed.blocks[d.blocks.clone()], d.duration_s),
                                })
                            });
                            pooled(left, block_s(condensed).1)
                        }
                    };
                }
            }
        }
        let end = |d: &Dwell| d.start_s + d.duration_s;
        Self {
            channels,
            at_rest: Default::default(),
            other: Default::default(),
            session: [
                dwells.first().map_or(0.0, |d| d.start_s),
                dwells.last().map_or(0.0, end),
            ],
            of_table: None,
        }
    }

    /// Noise of the means of a table: white, from the standard deviation and the number of samples of each. `known`: whether the table
    /// gives standard deviations for gyro and accelerometer.
    pub fn of_table(known: [bool; 2]) -> Self {
        Self {
            of_table: Some(known),
            ..Self::default()
        }
    }

    /// Whether anything shows the noise of `sensor`. If nothing does, its variances are 0 and mean nothing.
    pub fn is_known(&self, sensor: Sensor) -> bool {
        match self.of_table {
            Some(known) => known[sensor as usize],
            None => sensor
                .channels()
                .all(|c| self.at_rest[c].is_some() || self.channels[c].known),
        }
    }

    /// The noise of a channel from a record at rest, if it is used: the largest of each term over the temperatures.
    pub fn largest_at_rest(&self, channel: usize) -> Option<AllanModel> {
        let nodes = self.at_rest[channel].as_ref()?.nodes.iter();
        let largest = nodes.fold(AllanModel::default(), |all, (_, node)| AllanModel {
            white: all.white.max(node.white),
            flicker: all.flicker.max(node.flicker),
            walk: all.walk.max(node.walk),
        });
        Some(largest)
    }

    /// Whether the variances of the means are known for each channel. If not, a fit to gravity uses the noise of the magnitude
    /// ([`Noise::of_magnitude`]).
    pub fn is_by_channel(&self, sensor: Sensor) -> bool {
        self.of_table.is_some() || self.has_noise_at_rest(sensor)
    }

    /// Uses the noise of `file` instead of that within the dwells. A channel whose dwells contradict the file keeps its own noise, with a
    /// warning.
    ///
    /// Errors: the file has no scale factor to the unit of the readings, or lacks a channel.
    pub fn use_noise_at_rest(
        &mut self,
        file: &NoiseFile,
        manifest: &Manifest,
        dwells: &[Dwell],
        warnings: &mut Vec<Warning>,
    ) -> Result<()> {
        if are_two_units(&file.device, &manifest.device) {
            let (file, recording) = (file.device.clone(), manifest.device.clone());
            warnings.push(Warning::NoiseOfAnother { file, recording });
        }
        let present = |c: &usize| dwells.iter().any(|d| d.raw[*c].n > 0);
        for c in (0..6).filter(present) {
            let name = RAW_COLUMNS[c];
            let raw = manifest.raw_unit.to_string();
            let mut nodes = Vec::new();
            for channel in file.channel.iter().filter(|k| k.name == name) {
                // A calibration of readings in SI has scale factors near 1. The noise in its file is that of calibrated readings: if the factor is 0.51, its
                // noise is twice that of the readings.
                let unit = match manifest.raw_unit {
                    RawUnit::Si if channel.raw_unit.as_ref() != Some(&raw) => {
                        Sensor::BOTH[c / 3].unit()
                    }
                    _ => raw.as_str(),
                };
                let model = channel.model_in(unit, &file.place)?;
                nodes.push((channel.temp_c.unwrap_or(f64::NAN), model));
            }
            if nodes.is_empty() {
                return Err(Error::new(
                    &file.place,
                    format!("it has no channel {name}"),
                    "run `mimu allan` on a recording that has this channel",
                ));
            }
            if nodes.len() > 1 && nodes.iter().any(|n| n.0.is_nan()) {
                return Err(Error::new(
                    format!("{}, channel {name}", file.place),
                    "it occurs more than once, and not always with a temperature",
                    "run `mimu allan` on recordings with temp_c, or on a single recording",
                ));
            }
            nodes.sort_by(|a, b| a.0.total_cmp(&b.0));
            let at_rest = NoiseAtRest { nodes };
            let mean_c = dwells.iter().map(|d| d.temp_c).sum::<f64>() / dwells.len() as f64;
            let second = [
                self.channels[c].variance(1.0),
                at_rest.at(mean_c).variance(1.0),
            ];
            let ratio = second[0] / second[1];
            if (1.0 / ANOTHER_NOISE..=ANOTHER_NOISE).contains(&ratio) {
                self.at_rest[c] = Some(at_rest);
            } else {
                self.other[c] = Some(second);
                let warning = Warning::NoisierThanFile {
                    times: ratio.sqrt(),
                    file: file.place.clone(),
                };
                warnings.push(warning.of_channel(c));
            }
        }
        Ok(())
    }

    /// Noise of the magnitude of specific force after the calibration `accel`, m/s²: the noise in a fit to the magnitude of gravity. A unit
    /// that creeps on its support tilts, which changes the channels but not the magnitude.
    pub fn of_magnitude(
        dwells: &[Dwell],
        condensed: &Condensed,
        accel: &Affine<f64>,
    ) -> ChannelNoise {
        let from = Sensor::Accel.channels().start;
        let force = |b: &Block| {
            let raw = Vector3::from_fn(|i, _| b.raw[from + i].mean);
            let all = (0..3).all(|i| b.raw[from + i].n > 0);
            all.then(|| accel.apply(&raw))
        };
        // If the unit turns, the magnitude changes with the errors of the calibration, which are not noise.
        let turns = |d: &Dwell| {
            let up = accel.apply(&d.raw_mean(Sensor::Accel)).normalize();
            let blocks = condensed.blocks[d.blocks.clone()].iter().filter_map(force);
            let mut across = blocks.map(|f| f.normalize().cross(&up).norm());
            across.any(|sin| sin > SWINGS_BY)
        };
        let usable = dwells
            .iter()
            .filter(|d| d.faults.accel.is_none() && !d.turn);
        let still = usable.filter(|d| !turns(d));
        within(still, condensed, |b| force(b).map(|f| f.norm()))
    }

    /// Whether a record at rest gives the noise of all channels of `sensor`.
    pub fn has_noise_at_rest(&self, sensor: Sensor) -> bool {
        self.at_rest[sensor.channels()].iter().all(Option::is_some)
    }

    /// If the dwells of channel `c` are noisier than its record at rest: the excess, as the standard deviation of a mean over a second,
    /// raw, and the ratio of the two standard deviations.
    pub fn beyond_noise_at_rest(&self, c: usize) -> Option<(f64, f64)> {
        let [within, at_rest] = self.other[c]?;
        let more = within > at_rest;
        more.then(|| ((within - at_rest).sqrt(), (within / at_rest).sqrt()))
    }

    /// Variance of the difference of two successive means over `tau_s` of channel `c`, halved, raw units squared.
    pub fn variance(&self, c: usize, tau_s: f64, temp_c: f64) -> f64 {
        match &self.at_rest[c] {
            Some(at_rest) => at_rest.at(temp_c).variance(tau_s),
            None => self.channels[c].variance(tau_s),
        }
    }

    /// Variances of the mean reading of `sensor` over `dwell`, raw units squared; if a record at rest gives the wander, those of the mean
    /// minus that of the session.
    pub fn of_mean(&self, sensor: Sensor, dwell: &Dwell) -> Vector3<f64> {
        let from = sensor.channels().start;
        if self.of_table.is_some() {
            return Vector3::from_fn(|i, _| {
                let mean = dwell.raw[from + i];
                mean.variance / mean.n.max(1) as f64
            });
        }
        let averaged_s = dwell.averaged_s(sensor);
        Vector3::from_fn(|i, _| match &self.at_rest[from + i] {
            None => self.channels[from + i].variance(averaged_s),
            Some(at_rest) => {
                let model = at_rest.at(dwell.temp_c);
                let wander = Slow::from(model).covariance(&[span(dwell)], self.session);
                model.white / averaged_s + wander[(0, 0)]
            }
        })
    }

    /// Covariance of a change of the biases of `sensor` from another session of this length to this one, by the noise over such a time: twice its Allan
    /// variance. Of C by rows, then o, for readings that `matrix` converts to SI.
    pub fn between_sessions(&self, sensor: Sensor, matrix: &Matrix3<f64>) -> Covariance {
        let from = sensor.channels().start;
        let length_s = self.session[1] - self.session[0];
        let mut covariance = Covariance::zeros();
        if self.of_table.is_none() && length_s > 0.0 {
            let raw = Vector3::from_fn(|i, _| 2.0 * self.variance(from + i, length_s, f64::NAN));
            let si = matrix * Matrix3::from_diagonal(&raw) * matrix.transpose();
            covariance.fixed_view_mut::<3, 3>(9, 9).copy_from(&si);
        }
        covariance
    }

    /// Covariances of the mean readings of `sensor` over `dwells` because of its wander, raw units squared, axis by axis: part of the
    /// variances of [`Noise::of_mean`]. `None` if no record at rest gives the wander.
    pub fn wander(&self, sensor: Sensor, dwells: &[Dwell]) -> Option<[DMatrix<f64>; 3]> {
        let from = sensor.channels().start;
        let at_rest = || self.at_rest[from..from + 3].iter().flatten();
        let wanders = |s: &NoiseAtRest| s.nodes.iter().any(|n| n.1.flicker + n.1.walk > 0.0);
        if !at_rest().any(wanders) {
            return None;
        }
        let spans: Vec<Span> = dwells.iter().map(span).collect();
        Some(std::array::from_fn(|i| match &self.at_rest[from + i] {
            None => DMatrix::zeros(dwells.len(), dwells.len()),
            Some(at_rest) => {
                // The noise depends on temperature, so each mean has a separate amplitude.
                let of = |part: fn(&mut AllanModel) -> &mut f64| {
                    let amplitude: Vec<f64> = dwells
                        .iter()
                        .map(|d| part(&mut at_rest.at(d.temp_c)).sqrt())
                        .collect();
                    let mut one = AllanModel::default();
                    *part(&mut one) = 1.0;
                    let c = Slow::from(one).covariance(&spans, self.session);
                    DMatrix::from_fn(spans.len(), spans.len(), |i, j| {
                        c[(i, j)] * amplitude[i] * amplitude[j]
                    })
                };
                of(|m| &mut m.flicker) + of(|m| &mut m.walk)
            }
        }))
    }
}

/// Time that a dwell takes.
fn span(dwell: &Dwell) -> Span {
    [dwell.start_s, dwell.start_s + dwell.duration_s]
}
