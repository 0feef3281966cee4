//! The judgement of curves over temperature.

use mimu::judge::errors::{self, ErrorFigures};
use mimu::judge::input;
use mimu::unseen::Test;
use mimu::{AXES, Figure, Judgement, JudgementKind, Sensor, readable, significant};
use mimu_recording::RawUnit;

use crate::fit::{FitVerdict, Judged, ThermalFit};
use crate::judge::{DwellError, rms};
use crate::warning::Warning;

/// Errors of curves that usual biases leave, in noise floors: their wander reaches 3 to 4 in the means of half a minute.
const USUAL: f64 = 4.0;

impl ThermalFit {
    /// The judgement: the worst that the verdict, the errors, the recordings and the warnings lead to.
    pub fn judgement(&self) -> Judgement {
        let by_input = self.warnings.iter().filter_map(|warning| {
            let kind = match warning {
                Warning::Recording(warning) => input::of_warning(warning)?,
                Warning::NotCrossed { .. } | Warning::CurvatureRefused { .. } => {
                    JudgementKind::Untested
                }
                _ => return None,
            };
            Some(Judgement::new(kind, warning))
        });
        let figures: Vec<ErrorFigures> = self
            .judged
            .present()
            .map(|(sensor, judged)| self.figures(sensor, judged))
            .collect();
        let by_errors = errors::judge(&figures);
        let all = by_input.chain(self.by_verdict()).chain([by_errors.clone()]);
        Judgement::worst(all).unwrap_or(by_errors)
    }

    fn by_verdict(&self) -> Option<Judgement> {
        match self.verdict {
            FitVerdict::Fitted => None,
            FitVerdict::OneWay => Some(Judgement::new(
                JudgementKind::Untested,
                "the temperature goes one way only, so the lag of the dies and the slopes of the curves look alike",
            )),
            FitVerdict::Misfit => {
                let in_sample = |judged: &Judged| {
                    let [own, noise_floor] = rms(&judged.errors);
                    own / noise_floor
                };
                let all = self.judged.present();
                let all = all.map(|(sensor, judged)| (sensor, in_sample(judged), judged));
                let (sensor, worst, judged) = all.max_by(|a, b| a.1.total_cmp(&b.1))?;
                let reason = format!(
                    "{sensor}: the curves err by {} times the noise in the recordings that they were fitted to, {}",
                    significant(worst),
                    where_most(judged)?
                );
                Some(Judgement::new(JudgementKind::Misfit, reason))
            }
        }
    }

    fn figures(&self, sensor: Sensor, judged: &Judged) -> ErrorFigures {
        let [own, noise_floor] = rms(&judged.errors);
        let held_out = judged.held_out.as_ref().map(|h| rms(h)[0]);
        let biases_only = self.joint.curves[sensor]
            .as_ref()
            .is_some_and(|c| c.biases_only());
        // Without scale factors biases stay in the unit of the readings.
        let readable = match self.sessions[0].raw_unit {
            RawUnit::Count if biases_only => (1.0, "count"),
            RawUnit::Volt if biases_only => (1e3, "mV"),
            _ => Figure::Input.readable(sensor),
        };
        // Biases change between power-ons; no curve over temperature predicts that.
        let unseen = judged.without_session_bias.or(held_out);
        let error = unseen.unwrap_or(own);
        ErrorFigures {
            sensor,
            readable,
            error,
            unseen: unseen.is_some(),
            // Where only biases are estimated, the input is constant.
            input: match (biases_only, sensor) {
                (true, _) => f64::INFINITY,
                (false, Sensor::Gyro) => LARGE_RATE,
                (false, Sensor::Accel) => readable::STANDARD_GRAVITY,
            },
            test: noise_floor
                .is_finite()
                .then(|| Test::of_ratio(error / noise_floor, USUAL, judged.errors.len())),
            cause: where_most(judged),
            too_few: None,
        }
    }
}

/// The axis that errs most, and the temperature of its largest error.
fn where_most(judged: &Judged) -> Option<String> {
    let errors = judged.held_out.as_ref().unwrap_or(&judged.errors);
    let square = |axis: usize| errors.iter().map(|e| e.error[axis].powi(2)).sum::<f64>();
    let axis = (0..3).max_by(|a, b| square(*a).total_cmp(&square(*b)))?;
    let size = |e: &&DwellError| e.error[axis].abs();
    let largest = errors.iter().max_by(|a, b| size(a).total_cmp(&size(b)))?;
    Some(format!(
        "most on {}, at {:.0} °C",
        AXES[axis], largest.die_c
    ))
}

/// Rate that errors of a gyro are compared with, rad/s: 100 deg/s, as in the errors that an export leaves.
const LARGE_RATE: f64 = 100.0 * std::f64::consts::PI / 180.0;
