//! Error figures, judged by the size of the input and by the noise.

use crate::judgement::{Judgement, JudgementKind};
use crate::quantity::{Figure, Sensor, significant};

/// Largest share of the input that a calibration may leave unexplained. Consumer parts leave their factory with scale factors within 3 %
/// and zeros within 50 to 80 mg (MPU-6050, BMI160, LSM6DS3), so a calibration that errs by more does worse than the data sheet.
pub const UNEXPLAINED_SHARE: f64 = 0.05;

/// If the error exceeds this many noise floors, it contains more than noise. With twelve parameters and twenty dwells, the held-out error of
/// noise alone is 1.3 floors.
pub const BEYOND_NOISE: f64 = 2.0;

/// Error figures of a sensor, all in the unit of `figure`.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorFigures {
    /// The sensor.
    pub sensor: Sensor,
    /// The quantity that they describe.
    pub figure: Figure,
    /// Rms error of the data that the model was fitted to.
    pub rms: f64,
    /// Rms error of data that were held out or belong to another recording; `None` if there are none.
    pub held_out_rms: Option<f64>,
    /// Rms error by noise alone; not a number if the noise is unknown.
    pub noise_floor: f64,
    /// Size of the input: the share of it that remains is the error over this.
    pub input: f64,
    /// Largest ratio of the error to the noise floor that noise and usual biases explain.
    pub usual: f64,
    /// What is known of the causes of the error, as a sentence fragment.
    pub cause: Option<String>,
    /// Set if the data are too few for a part of them to be held out.
    pub few: Option<Few>,
}

/// Data so few for their parameters that noise alone may give a held-out error beyond `usual`.
#[derive(Debug, Clone, PartialEq)]
pub struct Few {
    /// Number of dwells or turns.
    pub residuals: usize,
    /// What they are: `dwells` or `turns`.
    pub what: &'static str,
    /// Number of parameters that each row of them helps to determine.
    pub parameters: usize,
    /// The error in sample, corrected for the degrees of freedom that the parameters took.
    pub corrected_rms: f64,
    /// Number of dwells or turns from which on the held-out error can be compared with the noise.
    pub wanted: usize,
}

/// Held-out error over the noise floor that noise alone gives, if `rows` determine `parameters` and one of `parts` is held out. For a random
/// design (Breiman and Freedman 1983): the variance of the prediction by m rows is p / (m - p - 1) of that of a row.
pub fn held_out_by_noise(rows: f64, parameters: f64, parts: usize) -> f64 {
    let parts = parts as f64;
    let spare = rows * (parts - 1.0) / parts - parameters - 1.0;
    match spare > 0.0 {
        true => (1.0 + parameters / spare).sqrt(),
        false => f64::INFINITY,
    }
}

impl ErrorFigures {
    /// The error that is judged: of unseen data; without them, that in sample. If the data are too few for that, the corrected one in sample.
    pub fn error(&self) -> f64 {
        match (&self.few, self.held_out_rms) {
            (Some(few), _) => few.corrected_rms,
            (None, Some(held_out)) => held_out,
            (None, None) => self.rms,
        }
    }

    /// [`Self::error`] over the noise floor.
    pub fn over_noise(&self) -> f64 {
        self.error() / self.noise_floor
    }

    /// Share of the input that remains unexplained.
    pub fn share(&self) -> f64 {
        self.error() / self.input
    }

    fn written(&self, error: f64) -> String {
        let (factor, unit) = self.figure.readable(self.sensor);
        format!("{} {unit}", significant(error * factor))
    }

    /// How the error was found.
    fn how(&self) -> &'static str {
        match (&self.few, self.held_out_rms) {
            (None, Some(_)) => "of unseen data",
            (Some(_), _) | (None, None) => "in sample",
        }
    }

    /// Judges the figures of one sensor. `Good` is left to [`judge`], which names the figures of all sensors.
    fn judge(&self) -> Option<Judgement> {
        let Self { sensor, .. } = self;
        let cause = match &self.cause {
            Some(cause) => format!("; {cause}"),
            None => String::new(),
        };
        let (error, how) = (self.written(self.error()), self.how());
        // An error that is not a number is none that a model may have.
        if !(self.share() <= UNEXPLAINED_SHARE) {
            let reason = format!(
                "{sensor}: the error {how} is {error}, {} % of the input (at most {} % may remain){cause}",
                significant(100.0 * self.share()),
                100.0 * UNEXPLAINED_SHARE
            );
            return Some(Judgement::new(JudgementKind::Misfit, reason));
        }
        if self.over_noise() > self.usual {
            let reason = format!(
                "{sensor}: the error {how} is {error}, {} times the noise{cause}",
                significant(self.over_noise())
            );
            return Some(Judgement::new(JudgementKind::Unexplained, reason));
        }
        if let Some(few) = &self.few {
            let reason = format!(
                "{sensor}: {} {} for {} parameters are too few to test the model; record at least {}",
                few.residuals, few.what, few.parameters, few.wanted
            );
            return Some(Judgement::new(JudgementKind::Untested, reason));
        }
        if self.held_out_rms.is_none() {
            let reason = format!("{sensor}: nothing was held out, so no unseen data test it");
            return Some(Judgement::new(JudgementKind::Untested, reason));
        }
        if !self.noise_floor.is_finite() {
            let reason = format!(
                "{sensor}: the noise is unknown, so the error {how}, {error}, cannot be compared with it"
            );
            return Some(Judgement::new(JudgementKind::Untested, reason));
        }
        None
    }
}

/// Judges the figures of all sensors of a result. The worse kind wins; of two errors beyond the noise, the larger ratio.
pub fn judge(all: &[ErrorFigures]) -> Judgement {
    let mut sorted: Vec<&ErrorFigures> = all.iter().collect();
    sorted.sort_by(|a, b| b.over_noise().total_cmp(&a.over_noise()));
    let bad = sorted.iter().filter_map(|figures| figures.judge());
    Judgement::worst(bad).unwrap_or_else(|| {
        let each = all
            .iter()
            .map(|f| format!("{} ({})", significant(f.over_noise()), f.sensor));
        let each: Vec<String> = each.collect();
        let reason = format!(
            "the error of unseen data is {} times what noise explains",
            each.join(" and ")
        );
        Judgement::new(JudgementKind::Good, reason)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use JudgementKind::{Good, Misfit, Unexplained, Untested};

    fn accel(error: f64, held_out: bool, noise_floor: f64) -> ErrorFigures {
        ErrorFigures {
            sensor: Sensor::Accel,
            figure: Figure::GravityMagnitude,
            rms: error,
            held_out_rms: held_out.then_some(error),
            noise_floor,
            input: 9.8,
            usual: BEYOND_NOISE,
            cause: None,
            few: None,
        }
    }

    #[test]
    fn an_error_is_judged_by_the_input_then_by_the_noise_then_by_what_could_contradict_it() {
        let kind = |f: ErrorFigures| judge(&[f]).kind;
        assert_eq!(kind(accel(0.0011, true, 0.001)), Good);
        assert_eq!(kind(accel(0.0011, false, 0.001)), Untested);
        assert_eq!(kind(accel(0.0011, true, f64::NAN)), Untested);
        assert_eq!(kind(accel(0.0031, false, 0.001)), Unexplained);
        assert_eq!(kind(accel(3.2, true, 0.001)), Misfit);
        assert_eq!(kind(accel(3.2, true, f64::NAN)), Misfit);
        assert_eq!(kind(accel(f64::NAN, true, 0.001)), Misfit);
    }

    #[test]
    fn an_error_by_too_few_data_is_untested_unless_the_fit_itself_is_bad() {
        let of_few = |corrected_rms| {
            let few = Few {
                residuals: 12,
                what: "dwells",
                parameters: 9,
                corrected_rms,
                wanted: 18,
            };
            judge(&[ErrorFigures {
                few: Some(few),
                ..accel(0.9, true, 0.001)
            }])
        };
        assert_eq!(of_few(0.0015).kind, Untested);
        assert_eq!(of_few(0.0031).kind, Unexplained);
        assert_eq!(of_few(0.9).kind, Misfit);
        assert!(of_few(0.0015).reason.contains("at least 18"));
    }

    #[test]
    fn the_reason_names_the_sensor_that_errs_most() {
        let gyro = ErrorFigures {
            sensor: Sensor::Gyro,
            figure: Figure::Direction,
            rms: 0.009,
            held_out_rms: Some(0.009),
            noise_floor: 0.001,
            input: 1.0,
            usual: BEYOND_NOISE,
            cause: None,
            few: None,
        };
        let both = judge(&[accel(0.003, true, 0.001), gyro]);
        assert_eq!(both.kind, Unexplained);
        assert!(both.reason.starts_with("gyro"), "{both}");
    }
}
