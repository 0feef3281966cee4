//! Error figures, judged by the size of the input and by what is predicted of them.

use crate::judgement::{Judgement, JudgementKind};
use crate::quantity::{Sensor, significant};
use crate::unseen::Test;

/// Largest share of the input that a calibration may leave unexplained. Consumer parts leave their factory with scale factors within 3 %
/// and zeros within 50 to 80 mg (MPU-6050, BMI160, LSM6DS3), so a calibration that errs by more does worse than the data sheet.
pub const UNEXPLAINED_SHARE: f64 = 0.05;

/// Error figures of a sensor, all in one unit: SI, or that of the readings.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorFigures {
    /// The sensor.
    pub sensor: Sensor,
    /// Factor and unit in which people read them.
    pub readable: (f64, &'static str),
    /// Rms error: of data that were held out or belong to another recording, or else of those that the model was fitted to.
    pub error: f64,
    /// Whether the model has not seen the data of [`Self::error`].
    pub unseen: bool,
    /// Size of the input: the share of it that remains is the error over this.
    pub input: f64,
    /// How the errors compare with what is predicted of them; `None` if the noise is unknown.
    pub test: Option<Test>,
    /// What is known of the causes of the error, as a sentence fragment.
    pub cause: Option<String>,
    /// How many data would test the model, if these are too few, as a sentence fragment.
    pub too_few: Option<String>,
}

impl ErrorFigures {
    /// Share of the input that remains unexplained.
    pub fn share(&self) -> f64 {
        self.error / self.input
    }

    fn ratio(&self) -> f64 {
        self.test.map_or(f64::NAN, |test| test.ratio)
    }

    fn written(&self, error: f64) -> String {
        let (factor, unit) = self.readable;
        format!("{} {unit}", significant(error * factor))
    }

    /// How the error was found.
    fn how(&self) -> &'static str {
        match self.unseen {
            true => "of unseen data",
            false => "in sample",
        }
    }

    /// Judges the figures of one sensor. `Good` is left to [`judge`], which names the figures of all sensors.
    fn judge(&self) -> Option<Judgement> {
        let Self { sensor, .. } = self;
        let cause = match &self.cause {
            Some(cause) => format!("; {cause}"),
            None => String::new(),
        };
        let (error, how) = (self.written(self.error), self.how());
        let untested = |reason: String| {
            Some(Judgement::new(
                JudgementKind::Untested,
                format!("{sensor}: {reason}"),
            ))
        };
        let share = |kind: JudgementKind| {
            let reason = format!(
                "{sensor}: the error {how} is {error}, {} % of the input (at most {} % may remain){cause}",
                significant(100.0 * self.share()),
                100.0 * UNEXPLAINED_SHARE
            );
            Some(Judgement::new(kind, reason))
        };
        // An error that is not a number is none that a model may have.
        let large = !(self.share() <= UNEXPLAINED_SHARE);
        let Some(test) = &self.test else {
            return match (large, self.unseen) {
                (true, _) => share(JudgementKind::Misfit),
                (false, true) => untested(format!(
                    "the noise is unknown, so the error {how}, {error}, cannot be compared with it"
                )),
                (false, false) => untested(NOTHING_HELD_OUT.into()),
            };
        };
        match (test.fails(), large) {
            (true, true) => share(JudgementKind::Misfit),
            (true, false) => {
                let reason = format!(
                    "{sensor}: the error {how} is {error}, {} times what noise predicts (at most {} by chance){cause}",
                    significant(test.ratio),
                    significant(test.limit)
                );
                Some(Judgement::new(JudgementKind::Unexplained, reason))
            }
            (false, _) if !self.unseen => untested(NOTHING_HELD_OUT.into()),
            (false, true) if test.noise > UNEXPLAINED_SHARE * self.input => {
                let reason = format!(
                    "{sensor}: the noise alone is {}, {} % of the input: unit or sample rate is wrong",
                    self.written(test.noise),
                    significant(100.0 * test.noise / self.input)
                );
                Some(Judgement::new(JudgementKind::Suspect, reason))
            }
            (false, true) => untested(format!(
                "the error {how} is {error}, as is predicted: the data leave the parameters open"
            )),
            (false, false) if !test.can_fail() => untested(match &self.too_few {
                Some(few) => few.clone(),
                None => format!(
                    "an error of {} times the noise would not show: the held-out data depend on parameters that the others leave open; record each pose twice",
                    significant(test.visible)
                ),
            }),
            (false, false) => None,
        }
    }
}

const NOTHING_HELD_OUT: &str = "nothing was held out, so no unseen data test it";

/// Judges the figures of all sensors of a result. The worse kind wins; of two errors beyond the noise, the larger ratio.
pub fn judge(all: &[ErrorFigures]) -> Judgement {
    let mut sorted: Vec<&ErrorFigures> = all.iter().collect();
    sorted.sort_by(|a, b| b.ratio().total_cmp(&a.ratio()));
    let bad = sorted.iter().filter_map(|figures| figures.judge());
    Judgement::worst(bad).unwrap_or_else(|| {
        let each = |of: fn(&Test) -> f64| -> String {
            let each = all.iter().filter_map(|f| {
                Some(format!("{} ({})", significant(of(f.test.as_ref()?)), f.sensor))
            });
            each.collect::<Vec<_>>().join(" and ")
        };
        let reason = format!(
            "the error of unseen data is {} times what noise predicts; an error of {} times the noise would be noticed",
            each(|t| t.ratio),
            each(|t| t.visible)
        );
        Judgement::new(JudgementKind::Good, reason)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quantity::Figure;
    use crate::unseen::{BEYOND_NOISE, VISIBLE};
    use JudgementKind::{Good, Misfit, Unexplained, Untested};

    fn figures(sensor: Sensor, ratio: f64, unseen: bool) -> ErrorFigures {
        ErrorFigures {
            sensor,
            readable: Figure::GravityMagnitude.readable(sensor),
            error: 0.001 * ratio,
            unseen,
            input: 9.8,
            test: Some(Test::of_ratio(ratio, BEYOND_NOISE, 30)),
            cause: None,
            too_few: None,
        }
    }

    fn accel(ratio: f64) -> ErrorFigures {
        figures(Sensor::Accel, ratio, true)
    }

    fn kind(f: ErrorFigures) -> JudgementKind {
        judge(&[f]).kind
    }

    #[test]
    fn an_error_is_judged_by_its_prediction_then_by_the_input_then_by_what_could_contradict_it() {
        assert_eq!(kind(accel(1.1)), Good);
        assert_eq!(kind(figures(Sensor::Accel, 1.1, false)), Untested);
        assert_eq!(kind(figures(Sensor::Accel, 3.1, false)), Unexplained);
        assert_eq!(kind(accel(3.1)), Unexplained);
        assert_eq!(kind(accel(3200.0)), Misfit);
        assert_eq!(kind(accel(f64::NAN)), Misfit);
        let unknown = |error| ErrorFigures {
            test: None,
            error,
            ..accel(1.0)
        };
        assert_eq!(kind(unknown(0.0011)), Untested);
        assert_eq!(kind(unknown(3.2)), Misfit);
        assert_eq!(kind(unknown(f64::NAN)), Misfit);
    }

    #[test]
    fn data_that_hide_an_error_do_not_test_the_model_unless_the_error_shows_nonetheless() {
        let of_few = |ratio| {
            let test = Test {
                visible: 2.0 * VISIBLE,
                ..Test::of_ratio(ratio, 3.0, 12)
            };
            judge(&[ErrorFigures {
                test: Some(test),
                too_few: Some("record at least 18".into()),
                ..accel(ratio)
            }])
        };
        assert_eq!(of_few(2.5).kind, Untested);
        assert_eq!(of_few(3.1).kind, Unexplained);
        assert_eq!(of_few(900.0).kind, Misfit);
        assert!(of_few(2.5).reason.contains("at least 18"));
    }

    #[test]
    fn an_error_that_was_predicted_is_no_misfit_however_large() {
        let open = ErrorFigures {
            error: 1.0,
            ..accel(1.1)
        };
        assert_eq!(kind(open), Untested);
    }

    #[test]
    fn the_reason_names_the_sensor_that_errs_most() {
        let both = judge(&[accel(3.0), figures(Sensor::Gyro, 9.0, true)]);
        assert_eq!(both.kind, Unexplained);
        assert!(both.reason.starts_with("gyro"), "{both}");
    }
}
