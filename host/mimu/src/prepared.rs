//! A recording prepared for estimation: condensed, its dwells found, their noise measured.

use std::sync::Arc;

use mimu_core::compensation::Affine;
use nalgebra::{Matrix3, Vector3};

use crate::bias_removal::BiasRemoval;
use crate::estimate::earth::{Earth, poses};
use crate::estimate::earth_on_table::EarthOnTable;
use crate::estimate::whole_turns::Stated;
use crate::estimate::{EarthShare, Failure, Observation, known_input, magnitude};
use crate::factor::Factors;
use crate::noise::Noise;
use crate::noise::noise_file::NoiseFile;
use crate::observation::turn::{Motion, Rest, Turn};
use crate::prior::Prior;
use crate::quantity::Sensor;
use crate::signal::bias_removal;
use crate::signal::blocks::Condensed;
use crate::signal::contrast::{Contrast, contrasts};
use crate::signal::course::Course;
use crate::signal::dwell::{Dwell, Dwells, Fault, LeftOut};
use crate::signal::dwells_of_files;
use crate::signal::power_ons::{PowerOns, with_one_bias};
use crate::signal::rails::refuse_dead_channels;
use crate::signal::stillness::{DwellSearch, Steps};
use crate::signal::unit_in_si;
use crate::warning::Warning;
use mimu_recording::error::{Argument, Error, Result};
use mimu_recording::{Batch, ClockRate, Manifest, Recording, Reference, ReferenceError};

/// A recording, condensed, with its dwells and their noise.
#[derive(Debug, Clone)]
pub struct Prepared {
    /// Its manifest.
    pub manifest: Manifest,
    /// Its samples, condensed. Copies of the recording share them until one changes them: four hours at 1 kHz are 85 to 225 MB.
    pub condensed: Arc<Condensed>,
    /// Its dwells.
    pub dwells: Dwells,
    /// Noise within them.
    pub noise: Noise,
    /// Path of the samples, for messages.
    pub place: String,
    /// What the firmware did to the gyro's bias, if that shows. A high-pass filter is undone in [`Self::condensed`].
    pub bias_removal: Option<BiasRemoval>,
    /// Errors of the reference.
    pub(crate) reference_error: Option<ReferenceError>,
    /// The Earth's rate in the dwells on a table; `None` without a table or a gyro.
    pub earth_on_table: Option<Arc<EarthOnTable>>,
    /// What the population of the unit's kind says of it; `None` if nothing is given.
    pub prior: Option<Arc<Prior>>,
    /// The power-ons that its dwells are of, if gravity is the only reference. The readings before the last are moved to the biases of the last.
    pub power_ons: PowerOns,
}

impl Prepared {
    /// Reads `recording` and finds its dwells. `progress` receives the share that is read.
    pub fn read(
        recording: &Recording,
        search: impl Into<DwellSearch>,
        progress: impl Fn(f64),
    ) -> Result<Self> {
        let manifest = recording.manifest.clone();
        let integrate = manifest.reference == Reference::Gravity;
        let condensed = Condensed::read(recording, integrate, progress)?;
        let place = recording.place.clone();
        Self::of_condensed(manifest, condensed, search.into(), place)
    }

    /// Finds the dwells of `samples` in memory. `search`: a number alone is the factor of stillness, such as
    /// [`crate::signal::stillness::STILL_FACTOR`].
    ///
    /// Errors: those of a recording on disk; columns of different lengths; no samples.
    pub fn of(
        mut manifest: Manifest,
        samples: &Batch,
        search: impl Into<DwellSearch>,
    ) -> Result<Self> {
        manifest.check("manifest in memory")?;
        if samples.is_empty() {
            let remedy = "give as many readings as times: t_s and raw have one row for each sample";
            return Err(Error::new("samples in memory", "there are none", remedy));
        }
        let mut by_computer = None;
        if let Some(factor) = manifest.by_computer() {
            let samples = by_computer.insert(samples.clone());
            samples.t_s.iter_mut().for_each(|t| *t /= factor);
        }
        let samples = by_computer.as_ref().unwrap_or(samples);
        let integrate = manifest.reference == Reference::Gravity;
        let condensed = Condensed::of(samples, manifest.sample_rate_hz, integrate)?;
        let place = manifest.device.clone();
        Self::of_condensed(manifest, condensed, search.into(), place)
    }

    fn of_condensed(
        mut manifest: Manifest,
        mut condensed: Condensed,
        search: DwellSearch,
        place: String,
    ) -> Result<Self> {
        for block in &mut condensed.blocks {
            if manifest.dropped_steps.contains(&block.step) {
                block.step = -1;
            }
        }
        let still_factor = search.still_factor;
        if !(1.0..f64::INFINITY).contains(&still_factor) {
            return Err(Error::new(
                "still_factor",
                format!("{still_factor} cannot be a factor of the quietest variance"),
                "give a number of at least 1; STILL_FACTOR is the usual one",
            )
            .about(Argument::StillFactor));
        }
        if manifest.is_joined() {
            without_joins(&mut condensed);
        }
        refuse_dead_channels(&condensed, &place)?;
        let on_turntable = manifest.reference == Reference::TurntableRate;
        if manifest.is_joined() && on_turntable && search.steps == Steps::AsRecorded {
            dwells_of_files::number(&mut condensed, &mut manifest, search.still_factor)
                .map_err(|e| e.map(|e| e.place = format!("{place}, {}", e.place)))?;
        }
        if let (Some(power), Some(first)) = (manifest.power_on_s, condensed.blocks.first())
            && power > first.start_s
        {
            let problem = format!(
                "power_on_s is {power:?} s, and the first sample at {:?} s",
                first.start_s
            );
            let remedy = "write the t_s of the power-on to recording.toml, or remove the key";
            return Err(Error::new(place, problem, remedy));
        }
        let by_hand = manifest.reference == Reference::Gravity;
        let bias_removal = by_hand.then(|| bias_removal::find(&condensed)).flatten();
        if let Some(BiasRemoval::HighPass(filter)) = &bias_removal {
            condensed = filter.undo(condensed);
        }
        let find = |condensed: &Condensed| {
            Dwells::find(condensed, &manifest, search)
                .map_err(|e| e.map(|e| e.place = format!("{place}, {}", e.place)))
        };
        let mut spans = Vec::new();
        if by_hand {
            (condensed, spans) = with_one_bias(condensed, &manifest, find);
        }
        let mut dwells = find(&condensed)?;
        let at = manifest.latitude_deg;
        let gravity = at.and_then(|at| Warning::of_gravity(manifest.gravity_mps2, at));
        dwells.warnings.extend(gravity);
        let trusted = manifest.clock.filter(ClockRate::is_doubtful);
        dwells.warnings.extend(trusted.map(Warning::TrustedClock));
        let in_si = unit_in_si::at_rest(&dwells.list, &manifest);
        dwells
            .warnings
            .extend(in_si.into_iter().map(Warning::Health));
        dwells
            .warnings
            .extend(bias_removal.map(Warning::BiasRemoved));
        let noise = Noise::within(&dwells.list, &condensed, &dwells.rails);
        let prepared = Self {
            power_ons: PowerOns::of(&dwells.list, spans),
            reference_error: manifest.reference_error.clone(),
            manifest,
            condensed: Arc::new(condensed),
            dwells,
            noise,
            place,
            bias_removal,
            earth_on_table: None,
            prior: None,
        };
        Ok(prepared.with_earth())
    }

    /// With the Earth's rate in the dwells on a table.
    pub(crate) fn with_earth(mut self) -> Self {
        self.earth_on_table = self.find_earth().map(Arc::new);
        self
    }

    fn find_earth(&self) -> Option<EarthOnTable> {
        if self.manifest.reference != Reference::Table || !self.has(Sensor::Gyro) {
            return None;
        }
        let observations = self.observations(Sensor::Gyro);
        let gyro = known_input::least_squares(&observations, &[], None).ok();
        let gyro = gyro.map(|g| g.triad.inverse);
        let known_force = self.condensed.has_reference[Sensor::Accel.channels()].contains(&true);
        let accel = match self.is_in_si() {
            _ if known_force || !self.has(Sensor::Accel) => None,
            true => Some(Affine::identity()),
            false => {
                let poses = self.observations_of(Sensor::Accel, |d| !d.spins() && !d.turn);
                magnitude::first_guess(&poses, self.manifest.gravity_mps2)
            }
        };
        let Self {
            manifest,
            condensed,
            dwells,
            ..
        } = self;
        let (gyro, accel) = (gyro.as_ref(), accel.as_ref());
        Some(EarthOnTable::of(manifest, condensed, dwells, gyro, accel))
    }

    /// Uses the noise of a record at rest instead of that within the dwells. Errors: see [`Noise::use_noise_at_rest`].
    pub fn with_noise(mut self, file: &NoiseFile) -> Result<Self> {
        if self.manifest.means {
            let problem = "a noise file gives the error of a mean over some seconds, and these means have no durations";
            return Err(Error::new(&self.place, problem, "leave it out"));
        }
        let Dwells { list, warnings, .. } = &mut self.dwells;
        self.noise
            .use_noise_at_rest(file, &self.manifest, list, warnings)?;
        Ok(self)
    }

    /// The fit uses this prior of the unit's parameters.
    ///
    /// # Errors
    /// The prior is of other readings, or of another frame; known inputs or whole turns, which need none.
    pub fn with_prior(mut self, prior: Arc<Prior>) -> Result<Self> {
        let ours = &self.manifest;
        let refuse = |problem: String, remedy: &str| Err(Error::new(&self.place, problem, remedy));
        if ours.raw_unit != prior.raw_unit {
            let problem = format!(
                "its readings are in {}, and those of the prior in {}",
                ours.raw_unit, prior.raw_unit
            );
            return refuse(problem, "use the prior of units that are read alike");
        }
        if ours.reference == Reference::Table || ours.reference != prior.reference {
            let problem = format!(
                "a prior is used where magnitudes are the reference, and of the same one; reference is \"{}\" here and \"{}\" in the prior",
                ours.reference, prior.reference
            );
            return refuse(problem, "leave the prior out");
        }
        if ours.whole_turns.is_some() {
            return refuse(
                "whole turns are fitted without a prior".into(),
                "leave the prior or the whole turns out",
            );
        }
        self.prior = Some(prior);
        Ok(self)
    }

    /// Excludes dwells and turns from the fit. They stay in the list of dwells, but observations and turns lack them.
    pub fn leave_out(&mut self, these: &[LeftOut]) {
        for dwell in these.iter().filter(|l| l.sensor == Sensor::Accel) {
            self.dwells.list[dwell.from].faults.accel = Some(Fault::Outlying);
        }
        self.dwells.left_out.extend_from_slice(these);
    }

    /// Adds this to what `sensor` read in this time, s: to the means of its dwells, and to the integrals of a gyro.
    pub(crate) fn add_between(&mut self, sensor: Sensor, raw: &Vector3<f64>, between_s: [f64; 2]) {
        if sensor == Sensor::Gyro {
            Arc::make_mut(&mut self.condensed).add_to_gyro(raw, between_s);
        }
        let [from_s, to_s] = between_s;
        let dwells = self.dwells.list.iter_mut();
        for dwell in dwells.filter(|d| from_s <= d.start_s && d.start_s < to_s) {
            let means = dwell.raw[sensor.channels()].iter_mut();
            means.zip(raw).for_each(|(mean, more)| mean.mean += more);
        }
    }

    /// Moves what `sensor` read in each of these power-ons, from the first on, to the bias of number 0: by how much they differ, raw.
    pub(crate) fn move_to_one_bias(
        &mut self,
        sensor: Sensor,
        power_ons: &PowerOns,
        steps: &[Vector3<f64>],
    ) {
        for (number, step) in (1..).zip(steps) {
            if let Some(between_s) = power_ons.between_s(&self.dwells.list, number) {
                self.add_between(sensor, step, between_s);
            }
        }
    }

    /// Whether the recording has the channels of `sensor`.
    pub fn has(&self, sensor: Sensor) -> bool {
        sensor.channels().all(|c| self.condensed.has_raw[c])
    }

    /// Stated errors of the reference.
    pub fn reference_error(&self) -> Option<&ReferenceError> {
        self.reference_error.as_ref()
    }

    /// The reference errs by this much, in place of what the recording states. Least squares allows for it where inputs are known.
    pub fn with_reference_error(mut self, error: ReferenceError) -> Self {
        self.reference_error = Some(error);
        self
    }

    /// Usable dwells of `sensor`; if there is a table, those with a known input. The input of a gyro includes the Earth's rate.
    pub fn observations(&self, sensor: Sensor) -> Vec<Observation> {
        let table = self.manifest.reference == Reference::Table;
        // A turn of known angle is not a pose.
        self.observations_of(sensor, |d| {
            if table {
                d.input(sensor).is_some()
            } else {
                !d.turn
            }
        })
    }

    /// The usable dwells of `sensor` that `used` accepts.
    fn observations_of(&self, sensor: Sensor, used: impl Fn(&Dwell) -> bool) -> Vec<Observation> {
        let all = self.dwells.list.iter().enumerate();
        all.filter(|(_, d)| d.faults[sensor].is_none() && used(d))
            .map(|(i, d)| {
                let input = d.input(sensor);
                let earth = self.earth_rate(sensor, i, None);
                Observation {
                    dwell: i,
                    raw: d.raw_mean(sensor),
                    variance: self.noise.of_mean(sensor, d),
                    input: input.unwrap_or_else(|| Vector3::repeat(f64::NAN)) + earth.known,
                    earth,
                    change: self.mean_change(sensor, d),
                }
            })
            .collect()
    }

    /// The Earth's rate that `sensor` senses in a dwell on a table: the mean over the dwell, or the sum of its blocks with `weights`.
    pub fn earth_rate(&self, sensor: Sensor, dwell: usize, weights: Option<&[f64]>) -> EarthShare {
        let earth = self.earth_on_table.as_deref();
        match earth.filter(|_| sensor == Sensor::Gyro) {
            Some(earth) => match weights {
                Some(weights) => earth.weighted(dwell, weights),
                None => earth.mean(dwell),
            },
            None => EarthShare::NONE,
        }
    }

    /// Course of the known inputs through a dwell.
    pub(crate) fn course(&self, dwell: &Dwell) -> Option<Course> {
        Course::of(&self.condensed, dwell.blocks.clone(), &self.dwells.rails)
    }

    /// Mean rate of change of the known input of `sensor` over `dwell`, SI/s.
    fn mean_change(&self, sensor: Sensor, dwell: &Dwell) -> Vector3<f64> {
        let course = dwell.moves(sensor).then(|| self.course(dwell)).flatten();
        course.map_or_else(Vector3::zeros, |course| {
            let change = course.of[sensor as usize].iter().flat_map(|[_, c]| c);
            change.zip(&course.share).map(|(c, share)| c * *share).sum()
        })
    }

    /// The contrasts of all dwells in which a known input moves.
    pub(crate) fn contrasts(&self) -> Vec<Contrast> {
        let moving = self.dwells.list.iter().enumerate();
        let each = moving.filter(|(_, d)| Sensor::BOTH.iter().any(|s| d.moves(*s)));
        each.filter_map(|(i, d)| Some(contrasts(&self.condensed, &self.course(d)?, d, i)))
            .flatten()
            .collect()
    }

    /// What `sensor` reads in `contrast`; `None` if the dwell is not used for it or its input is not known.
    pub(crate) fn observation(&self, sensor: Sensor, contrast: &Contrast) -> Option<Observation> {
        let dwell = &self.dwells.list[contrast.dwell];
        let [input, change] = contrast.known[sensor as usize]?;
        if dwell.faults[sensor].is_some() || !self.has(sensor) {
            return None;
        }
        let from = sensor.channels().start;
        let blocks = &self.condensed.blocks[dwell.blocks.clone()];
        let raw = Vector3::from_fn(|k, _| {
            let weighted = blocks.iter().zip(&contrast.weights);
            let used = weighted.filter(|(_, w)| **w != 0.0);
            used.map(|(b, w)| w * b.raw[from + k].mean).sum()
        });
        // White noise has the variance of the mean, because the weights have a mean square of one. Noise slower than the weights cancels.
        let tau_s = contrast.half_period_s;
        let variance = Vector3::from_fn(|k, _| {
            let of_half = self.noise.variance(from + k, tau_s, dwell.temp_c);
            of_half * tau_s / dwell.averaged_s(sensor)
        });
        let earth = self.earth_rate(sensor, contrast.dwell, Some(&contrast.weights));
        Some(Observation {
            dwell: contrast.dwell,
            raw,
            variance,
            input: input + earth.known,
            earth,
            change,
        })
    }

    /// What dwells show beyond their means if the known input of `sensor` moves within them.
    pub fn within_dwells(&self, sensor: Sensor) -> Vec<Observation> {
        let contrasts = self.contrasts();
        let moving = contrasts
            .iter()
            .filter(|c| self.dwells.list[c.dwell].moves(sensor));
        moving.filter_map(|c| self.observation(sensor, c)).collect()
    }

    /// What is known of the Earth's rate.
    pub fn earth(&self) -> Earth {
        Earth::at(self.manifest.latitude_deg)
    }

    /// Dwells in which the gyro is at rest, with the Earth's rate; `accel` gives the direction up.
    pub fn rest(&self, accel: &Affine<f64>) -> Vec<Rest> {
        let earth = self.earth();
        let rest = |o: Observation| {
            let up = accel.apply(&self.dwells.list[o.dwell].raw_mean(Sensor::Accel));
            Rest {
                dwell: o.dwell,
                raw: o.raw,
                variance: o.variance,
                rate: earth.rate(&up),
                rate_variance: earth.variance(&up),
                vertical_variance: earth.vertical_variance(&up),
            }
        };
        let observations = self.observations(Sensor::Gyro).into_iter();
        let dwells = &self.dwells;
        let rests = |o: &Observation| {
            let dwell = &dwells.list[o.dwell];
            !dwell.turns_slowly || dwells.keep.keeps(dwell.step)
        };
        observations.filter(rests).map(rest).collect()
    }

    /// Dwells in which the gyro is at rest without a table, with the Earth's rate as their input. `accel` gives the direction up. In one pose the heading
    /// may be the same, and then so is the unknown part of the rate.
    pub fn at_rest_on_the_ground(&self, accel: Option<&Affine<f64>>) -> Vec<Observation> {
        let earth = self.earth();
        let observations = self.observations(Sensor::Gyro);
        let up = |o: &Observation| match accel {
            Some(accel) => accel.apply(&self.dwells.list[o.dwell].raw_mean(Sensor::Accel)),
            None => Vector3::zeros(),
        };
        let ups: Vec<Vector3<f64>> = observations.iter().map(up).collect();
        let poses = match accel {
            Some(_) => poses(&ups),
            None => vec![0; ups.len()],
        };
        let each = observations.into_iter().zip(&ups).zip(poses);
        let at_rest = each.map(|((o, up), heading)| {
            let known = earth.rate(up);
            Observation {
                input: known,
                earth: EarthShare {
                    known,
                    heading,
                    by: earth.unknown(up),
                },
                ..o
            }
        });
        at_rest.collect()
    }

    /// Time of the power-on on the clock of the recording, s: from the manifest, or else that of the first sample.
    pub fn power_on_s(&self) -> f64 {
        let first = || self.condensed.blocks.first().map_or(0.0, |b| b.start_s);
        self.manifest.power_on_s.unwrap_or_else(first)
    }

    /// Mean time of its dwells, s: estimates that ignore time apply to it.
    pub fn middle_s(&self) -> f64 {
        let each = self.dwells.list.iter();
        let sum: f64 = each.map(|d| d.start_s + 0.5 * d.duration_s).sum();
        sum / self.dwells.list.len().max(1) as f64
    }

    /// Whether the readings are in SI.
    pub fn is_in_si(&self) -> bool {
        self.manifest.raw_unit == mimu_recording::RawUnit::Si
    }

    /// A warning if the samples have a rate that no inertial unit has.
    pub(crate) fn implausible_rate(&self) -> Option<Warning> {
        let rate_hz = self.condensed.period_s.recip();
        let of_samples = !self.manifest.means;
        of_samples.then(|| Warning::of_rate(rate_hz)).flatten()
    }

    /// Noise variances of the magnitude of specific force in each of `poses`, (m/s²)², and whether the noise is known.
    fn magnitude_noise(&self, accel: &Affine<f64>, poses: &[Observation]) -> (Vec<f64>, bool) {
        if self.noise.is_by_channel(Sensor::Accel) {
            let magnitude = |o: &Observation| {
                let by = accel.matrix.tr_mul(&accel.apply(&o.raw).normalize());
                by.component_mul(&by).dot(&o.variance)
            };
            let known = self.noise.is_known(Sensor::Accel);
            return (poses.iter().map(magnitude).collect(), known);
        }
        let noise = Noise::of_magnitude(&self.dwells.list, &self.condensed, accel);
        let averaged_s = |o: &Observation| self.dwells.list[o.dwell].averaged_s(Sensor::Accel);
        let each = poses.iter().map(|o| noise.variance(averaged_s(o)));
        (each.collect(), noise.known)
    }

    /// Noise variances of the magnitude of specific force in each of `poses`, (m/s²)².
    pub fn magnitude_variances(&self, accel: &Affine<f64>, poses: &[Observation]) -> Vec<f64> {
        self.magnitude_noise(accel, poses).0
    }

    /// The magnitudes of gravity in all poses, with their noise by `accel`, and whether that is known.
    pub(crate) fn magnitudes(&self, accel: &Affine<f64>) -> (Factors<'static>, bool) {
        let poses = self.observations(Sensor::Accel);
        let (variances, is_known) = self.magnitude_noise(accel, &poses);
        let mut factors = Factors::default();
        for (o, variance) in poses.iter().zip(variances) {
            let known = (self.manifest.gravity_mps2, None);
            factors.magnitude(Sensor::Accel, (o.dwell, o.raw), known, variance);
        }
        (factors, is_known)
    }

    /// `floor`, a figure from the noise of `sensors`; not a number if that is unknown.
    pub(crate) fn if_noise_known(&self, sensors: &[Sensor], floor: f64) -> f64 {
        match sensors.iter().all(|s| self.noise.is_known(*s)) {
            true => floor,
            false => f64::NAN,
        }
    }

    /// Turns between usable dwells, with the directions of gravity by `accel`; also a warning for each turn that cannot be used.
    pub fn turns(&self, accel: &Affine<f64>) -> (Vec<Turn<'_>>, Vec<Warning>) {
        let increments = &self.condensed.increments;
        let usable: Vec<usize> = (0..self.dwells.list.len())
            .filter(|&i| {
                let dwell = &self.dwells.list[i];
                !dwell.turn && Sensor::BOTH.iter().all(|s| dwell.faults[*s].is_none())
            })
            .collect();
        let earth = self.earth();
        let (mut turns, mut refused) = (Vec::new(), Vec::new());
        for pair in usable.windows(2) {
            let (a, b) = (&self.dwells.list[pair[0]], &self.dwells.list[pair[1]]);
            let from = increments.partition_point(|i| i.end_s <= a.last_s);
            let to = increments.partition_point(|i| i.end_s < b.start_s) + 1;
            let pieces = &increments[from.min(increments.len())..to.min(increments.len())];
            let blocks = &self.condensed.blocks[a.blocks.end..b.blocks.start];
            let outlying = self
                .dwells
                .left_out
                .iter()
                .find(|l| l.sensor == Sensor::Gyro && [l.from, l.to] == [pair[0], pair[1]]);
            if let Some(left_out) = outlying {
                let LeftOut { error, sigmas, .. } = *left_out;
                refused.push(Warning::TurnLeftOut {
                    from: a.step,
                    to: b.step,
                    error,
                    sigmas,
                });
                continue;
            }
            if pieces.iter().any(|i| !i.whole) {
                refused.push(Warning::TurnNotUsed {
                    from: a.step,
                    to: b.step,
                    fault: None,
                });
                continue;
            }
            let fault = Sensor::Gyro.channels().find_map(|c| {
                let rails = self.dwells.rails[c];
                if blocks.iter().any(|b| rails.touched_by(&b.raw[c])) {
                    return Some(Fault::Saturated(c));
                }
                // In a turn by hand no code lasts for a tenth of a second.
                let chance = self.dwells.longest_run[c];
                let stuck = |m: &crate::signal::blocks::Moments| {
                    m.m2 == 0.0 && m.n > 3 && f64::from(m.n) > chance
                };
                let stuck = blocks.iter().any(|b| stuck(&b.raw[c]));
                stuck.then_some(Fault::Stuck(c))
            });
            if fault.is_some() {
                refused.push(Warning::TurnNotUsed {
                    from: a.step,
                    to: b.step,
                    fault,
                });
                continue;
            }
            let variance = |d: &crate::signal::dwell::Dwell| {
                let si = si_covariance(&accel.matrix, &self.noise.of_mean(Sensor::Accel, d));
                si.trace() / 3.0
            };
            let g = self.manifest.gravity_mps2;
            let duration_s: f64 = pieces.iter().map(|i| i.duration_s).sum();
            // The integral is the mean times the duration.
            let gyro = Sensor::Gyro.channels();
            let rate_variance = gyro
                .map(|c| self.noise.variance(c, duration_s, a.temp_c))
                .sum::<f64>()
                / 3.0;
            turns.push(Turn {
                from: pair[0],
                to: pair[1],
                steps: [a.step, b.step],
                increments: pieces,
                before: accel.apply(&a.raw_mean(Sensor::Accel)),
                after: accel.apply(&b.raw_mean(Sensor::Accel)),
                raw: [a, b].map(|d| d.raw_mean(Sensor::Accel)),
                direction_variance: (variance(a) + variance(b)) / (g * g),
                earth_variance: earth.of_direction(duration_s),
                integral_variance: duration_s * duration_s * rate_variance
                    + pieces.iter().map(|i| i.lost_variance).sum::<f64>(),
                duration_s,
            });
        }
        (turns, refused)
    }

    /// What is stated of turns that end where they began.
    pub(crate) fn whole_turns(&self) -> Option<Stated> {
        let given = self.manifest.whole_turns?;
        Some(Stated {
            placement: given.placement_deg.to_radians(),
            turns: given.turns,
            vertical: self.earth().about_vertical(),
            nominal: self.is_in_si().then(Matrix3::identity),
        })
    }

    /// Whether a sample of the gyro in block `i` lies at a rail.
    fn gyro_clips(&self, i: usize) -> bool {
        let block = &self.condensed.blocks[i];
        let rails = &self.dwells.rails;
        Sensor::Gyro
            .channels()
            .any(|c| rails[c].touched_by(&block.raw[c]))
    }

    /// Pairs of blocks in motion, for the first guess of the gyro.
    pub fn motions(&self, accel: &Affine<f64>) -> Vec<Motion> {
        let mut still = vec![false; self.condensed.blocks.len()];
        for dwell in &self.dwells.list {
            still[dwell.blocks.clone()].fill(true);
        }
        let mean = |i: usize, s: Sensor| {
            let from = s.channels().start;
            Vector3::from_fn(|k, _| match self.condensed.blocks[i].raw[from + k] {
                moments if moments.n > 0 => moments.mean,
                _ => f64::NAN,
            })
        };
        (1..still.len())
            .filter(|&i| !still[i] && !self.condensed.blocks[i].after_gap)
            .filter(|&i| !self.gyro_clips(i - 1) && !self.gyro_clips(i))
            .map(|i| {
                let [before, after] = [i - 1, i].map(|i| accel.apply(&mean(i, Sensor::Accel)));
                let centre = |i: usize| {
                    let b = &self.condensed.blocks[i];
                    0.5 * (b.start_s + b.last_s)
                };
                Motion {
                    force: (before + after) * 0.5,
                    change: after - before,
                    raw: (mean(i - 1, Sensor::Gyro) + mean(i, Sensor::Gyro)) * 0.5,
                    duration_s: centre(i) - centre(i - 1),
                }
            })
            .filter(|m| m.change.iter().chain(&m.raw).all(|x| x.is_finite()))
            .collect()
    }

    /// The error for a failure of an estimator, with the place and the dwells that were not used.
    pub(crate) fn refused(&self, failure: Failure, sensor: Sensor) -> Error {
        let unused = self.dwells.unused(sensor);
        let undetermined = matches!(failure, Failure::Undetermined { .. });
        let error = failure.into_error(sensor).map(|e| {
            e.place = format!("{}, {}", self.place, e.place);
            e.problem += &unused;
            if undetermined && !unused.is_empty() {
                e.remedy = format!("correct the dwells that are not used, or {}", e.remedy);
            }
        });
        self.with_steps_as_given(error, sensor)
    }

    /// `error`; if dwells of `sensor` are not used because they are not still, with the remedy to take the `step` column as given.
    pub(crate) fn with_steps_as_given(&self, error: Error, sensor: Sensor) -> Error {
        if !self.dwells.are_judged_not_still(sensor) {
            return error;
        }
        let remedy =
            "; or, if the numbers of the step column are right, take these dwells as given";
        error
            .map(|e| e.remedy += remedy)
            .about(Argument::StepsGiven)
    }
}

/// Removes the pauses between joined files from the gaps: no samples are missing there.
fn without_joins(condensed: &mut Condensed) {
    let period_s = condensed.period_s;
    let pairs = condensed.blocks.windows(2);
    let gaps: Vec<(f64, u64)> = pairs
        .filter(|pair| pair[1].after_gap && pair[0].step == pair[1].step)
        .map(|pair| {
            (
                pair[1].start_s - pair[0].last_s - period_s,
                pair[1].first_row,
            )
        })
        .collect();
    condensed.gaps = (gaps.len() as u64, gaps.iter().map(|g| g.0).sum());
    condensed
        .warnings
        .retain(|w| !matches!(w, Warning::Gaps { .. }));
    if let Some((_, row)) = gaps.first() {
        let (count, missing_s) = condensed.gaps;
        condensed.warnings.push(Warning::Gaps {
            count,
            missing_s,
            row: row + 1,
        });
    }
}

/// Covariance in SI of independent raw readings with `variance`.
pub fn si_covariance(matrix: &Matrix3<f64>, variance: &Vector3<f64>) -> Matrix3<f64> {
    matrix * Matrix3::from_diagonal(variance) * matrix.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::stillness::STILL_FACTOR;
    use mimu_recording::RawUnit;

    #[test]
    fn what_is_wrong_with_arrays_is_named_where_it_enters() {
        let one = Batch {
            t_s: vec![0.0, 0.01],
            raw: [(); 6].map(|()| vec![0.5, 0.6]),
            ..Batch::default()
        };
        let refused = |rate_hz, gravity, samples: &Batch, still_factor| {
            let manifest = Manifest::new("u", rate_hz, gravity, RawUnit::Volt, Reference::Gravity);
            let error = Prepared::of(manifest, samples, still_factor).unwrap_err();
            error.to_string()
        };
        for (rate_hz, gravity, samples, still_factor, says) in [
            (-100.0, 9.8, &one, STILL_FACTOR, "sample_rate_hz: -100.0"),
            (100.0, f64::NAN, &one, STILL_FACTOR, "gravity_mps2: NaN"),
            (
                100.0,
                9.8,
                &Batch::default(),
                STILL_FACTOR,
                "there are none",
            ),
            (100.0, 9.8, &one, f64::NAN, "still_factor: NaN"),
            (100.0, 9.8, &one, 0.5, "still_factor: 0.5"),
        ] {
            let error = refused(rate_hz, gravity, samples, still_factor);
            assert!(error.contains(says), "{error}");
        }
    }
}
