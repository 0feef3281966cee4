//! Warnings about a recording, a fit or a verdict, by kind.

mod words;

pub(crate) use words::CHECK_WIRING;

use std::mem::discriminant;

use mimu_recording::error::Error;
use mimu_recording::{Held, NoTemperatures, RAW_COLUMNS};
use serde::{Serialize, Serializer};

use crate::bias_removal::BiasRemoval;
use crate::fault::Fault;
use crate::log_fault::LogFault;
use crate::quantity::{Sensor, normal_gravity};

/// Range of the difference of local gravity from normal gravity at sea level, m/s²: heights of up to 5500 m subtract 0.017, and depths of
/// 400 m add 0.001. Anomalies of the Earth's field are up to 0.003 either way (0.005 on a few peaks and islands).
const GRAVITY_OFF_MPS2: [f64; 2] = [-0.020, 0.005];

/// Sample rates of inertial units, Hz. The fastest parts give 32 kHz; 0.05 Hz are 50 Hz whose stamps are in ms.
const RATES_HZ: std::ops::RangeInclusive<f64> = 1.0..=40e3;

/// What a person should know. JSON contains it as a sentence.
#[derive(Debug, Clone, PartialEq)]
pub enum Warning {
    /// One about a sensor.
    Of(Sensor, Box<Warning>),
    /// One about a channel.
    Channel(&'static str, Box<Warning>),
    /// A warning from reading a recording.
    Reading(mimu_recording::Warning),
    /// Rate of the time stamps, Hz, its difference in per cent from the rate in the manifest, and that rate, Hz.
    RateOff(f64, f64, f64),
    /// Sample rate that no inertial unit has, Hz.
    ImplausibleRate(f64),
    /// How many times gravity the specific force at rest is with the given calibration.
    CalibrationOfOther(f64),
    /// White noise, rad/s/√Hz, that exceeds that of any gyro.
    NoisierThanGyros(f64),
    /// Gaps, the missing time in all, s, and the first data row after one.
    Gaps(u64, f64, u64),
    /// Rows that repeat the row before.
    Repeated(u64),
    /// Samples of a channel that are empty or not a number.
    Empty(u64, &'static str),
    /// Samples of the thermometer that cannot be temperatures.
    NoTemperatures(NoTemperatures),
    /// A channel without noise, and how it shows.
    Dead(String),
    /// A sensor that is slower than its log, of this many rows a second.
    Held(Sensor, Held, f64),
    /// A row from which on the readings mean something else.
    LogFault(LogFault),
    /// Dwells that were cut at their ends, and by how much in all, s.
    DwellsCut(u64, f64),
    /// Dwells that are poses of the accelerometer but not rests of the gyro.
    SlowTurns(Vec<String>),
    /// Dwells that are not used, and why: for both sensors alike or for one.
    DwellsNotUsed(Vec<String>, Fault, Option<Sensor>),
    /// Samples within dwells at a rail.
    Clipped(u64),
    /// A dwell that is not used for a sensor, because an effect cannot be removed from it.
    DwellWithEffect(i32, Sensor, Fault, String),
    /// How often a channel reads a value at the end of a converter, and that value.
    EndOfConverter(u64, f64),
    /// Whether the highest value is a rail or the lowest, that value, how often it occurs in a row, and how often chance explains.
    RunAtEnd(bool, f64, f64, f64),
    /// Whether the noise ends at the highest values or the lowest, and from which one on.
    CalmEnd(bool, f64),
    /// Gravity that no height explains, m/s², and the latitude, degrees.
    Gravity(f64, f64),
    /// Gravity of the calibration and of the recording, m/s²; the mean magnitude of the calibrated force at rest, and whether it agrees with the
    /// former.
    OtherGravity([f64; 2], f64, bool),
    /// The Earth's rate is in the intervals of the gyro's biases, because no latitude is given.
    NoLatitude,
    /// The horizontal component of the Earth's rate is in the intervals of the gyro's biases, because the heading was lost this often.
    HeadingLost(usize),
    /// Readings in SI: whether they are at rest (and include biases), how many times their input they are, and the likely cause.
    NotSi(bool, f64, &'static str),
    /// Readings that are declared as counts, but are fractions and have the scale factor of a unit: their number per SI unit, the unit that they
    /// are in, and how to import them.
    NotCounts(f64, &'static str, &'static str),
    /// Reading of a gyro at rest, rad/s, that is larger than any bias.
    Turning(f64),
    /// Firmware removes the bias of the gyro before it is recorded.
    BiasRemoved(BiasRemoval),
    /// Calibrated rate at rest, rad/s rms, by which dwells differ.
    Restless(f64),
    /// Unit of the noise file, and that of the recording.
    NoiseOfAnother(String, String),
    /// How many times noisier a channel is within the dwells than the noise file says, and that file.
    NoisierThanFile(f64, String),
    /// Means without standard deviations.
    MeansWithoutNoise,
    /// Means whose noise is taken to be white.
    WhiteMeans,
    /// Number of rows of a table that lack the mean of an axis, and of all rows.
    MeansMissing(usize, usize),
    /// A gyro in a table of means whose only reference is gravity.
    MeansOfTurns,
    /// Range of temperatures that the model of both sensors or of one lacks, °C.
    WithoutTemperature(f64, f64, Option<Sensor>),
    /// No dwell can be used, for these reasons.
    NoDwell(String),
    /// No dwell has a known input, for these reasons.
    NoInput(String),
    /// All dwells have one input.
    OneInput,
    /// Given turns that are assumed to be exact.
    ExactTurns,
    /// Dwells whose input moves, and the method that uses their means alone.
    MeansAlone(u64, &'static str),
    /// No turn lies between two usable dwells.
    NoTurn,
    /// A dwell that is not used for the accelerometer: its error, m/s², against what the others predict, and the same in sigmas.
    DwellLeftOut(i32, f64, f64),
    /// A dwell that is kept for the accelerometer though it is suspect: its error, m/s², the parameter that the others hardly determine,
    /// and how many times as wide its interval would be without the dwell.
    DwellKept(i32, f64, &'static str, f64),
    /// A turn, from dwell to dwell, that is not used: its error, rad, against what the others predict, and the same in sigmas.
    TurnLeftOut(i32, i32, f64, f64),
    /// A turn that is kept though it is suspect: the parameter that the others hardly determine, and how many times as wide its interval
    /// would be without the turn.
    TurnKept(i32, i32, String, f64),
    /// A turn that cannot be integrated: by the fault of a channel, or because samples are missing.
    TurnNotUsed(i32, i32, Option<Fault>),
    /// Angle between gravity after a turn and its prediction, rad.
    WideTurn(f64),
    /// As many parameters as residuals.
    NoResiduals,
    /// Hardly more dwells than parameters.
    FewResiduals,
    /// Condition of a fit whose parameters are poorly determined.
    PoorlyDetermined(f64),
    /// Axes that form a left-handed triad.
    LeftHanded,
    /// Rates without an opposite.
    NoOpposite(usize),
    /// A delay that is not distinguished from a misalignment.
    NoDelay,
    /// Poses that need the turns between them.
    WithTurns,
    /// A given matrix, and whether its intervals are known.
    MatrixGiven(bool),
    /// Parts of a recording (blocks or not) that cannot be held out, and why the first cannot.
    NotHeldOut(bool, Vec<usize>, String),
    /// One dwell in so many is held out in place of blocks, and why.
    Interleaved(usize, Box<Warning>),
    /// Number of parameters that leaving out dwells or turns changes, of all parameters, and the largest changes.
    LeftOutChanges(usize, usize, Vec<String>),
    /// Errors of the uncalibrated and the calibrated readings, and their unit; whether the latter are held out; their number if they do not
    /// decide.
    NoBetter([f64; 2], &'static str, bool, Option<usize>),
    /// Directions without a pose nearby, and the errors there and in the poses, m/s².
    UnseenPoses(Vec<String>, f64, f64),
    /// Shares of the readings that models without and with temperature leave unexplained, and the mean temperature, °C.
    FollowsTemperature(f64, f64, f64),
    /// Dwells, or else turns, that are outliers; the largest error, its unit, and its ratio to the median.
    Outliers(bool, Vec<String>, f64, &'static str, f64),
    /// Rates of the turntable, deg/s, and the error of each, as a share of it.
    RateError(Vec<f64>, f64),
    /// Rate of the turntable, rad/s, that the other rates contradict, and the share by which the fit moves it.
    RatesContradict(f64, f64),
    /// Why the rests on a turntable do not calibrate the accelerometer.
    NoRestsToFit(String),
    /// Angle between the axes and those that they are referred to, rad, and whether these are the table's.
    Turned(f64, bool),
    /// Angle by which the dwells appear to be off level, rad rms.
    OffLevel(f64),
    /// Numbers of the calibration's unit and of the recording's.
    OtherUnit(String, String),
    /// Number of readings at a value that is the full scale of a part, in SI.
    FullScale(u64, f64),
    /// Names of the calibration's unit and of the recording's.
    OtherDevice(String, String),
    /// Whether the calibration and the recording name no unit.
    UnnamedUnit([bool; 2]),
    /// The calibration was made from the recording.
    SameRecording,
    /// Samples outside the temperatures of the calibration, of so many; the range, °C; the farthest, K; whether there are curves, and
    /// how far they reach beyond it, K.
    OutOfRange([u64; 2], [f64; 2], f64, Option<f64>),
    /// A recording without temperature, and a calibration with curves.
    NoTemperature,
    /// The recording has nothing to judge a sensor by.
    NothingToJudge,
    /// Worse than the uncalibrated readings, or else than their mean scale factor and bias.
    Worse(bool),
    /// The errors do not show whether the calibration is better. Their number; whether they are of turns (else of dwells); what they are compared with, as
    /// in [`Self::Worse`].
    Undecided(u64, bool, bool),
    /// A calibration that lacks a sensor of the recording.
    NotCalibrated(Sensor),
    /// A calibration whose uncertainty is not known.
    Uncertain,
    /// A recording that cannot judge the calibration, with its name if there are several, and why.
    NotJudged(Option<String>, Error),
    /// An effect of the given calibration that is missing in the new one, because its sensor is not recorded.
    EffectLost(String, Sensor),
    /// Lines of the spectrum that are not steady.
    UnsteadyLines,
    /// Range of the temperature that a channel follows, °C, and the correlation.
    FollowsChamber(f64, f64),
    /// Share of a drift in the variance at an averaging time, s.
    Drifts(f64, f64),
    /// First data row with an empty cell; length of the segment that is used, s, and its first data row.
    EmptyCells(usize, f64, usize),
    /// Samples that are masked, their share, and the instant of the first, s.
    Disturbed(u64, f64, f64),
    /// Windows in which the unit moves, of so many; their length, s; the first instant, s, and the channel.
    Moves([usize; 2], f64, f64, &'static str),
    /// Gaps, the first one, s, and the data row after it; length of the segment that is used, s, and its beginning, s.
    LongestStretch(u64, f64, usize, f64, f64),
}

impl Warning {
    /// This warning, about `sensor`.
    pub(crate) fn of(self, sensor: Sensor) -> Self {
        Self::Of(sensor, Box::new(self))
    }

    /// A warning if gravity, m/s², is impossible at the latitude, degrees. Nothing in a recording shows which of the two is wrong: the
    /// scale factors of an accelerometer calibrated by gravity are proportional to it, and the residuals do not change. A wrong latitude
    /// also changes the Earth's rate, but by less than the bias wander of a gyro.
    pub fn of_gravity(gravity_mps2: f64, latitude_deg: f64) -> Option<Self> {
        let off = gravity_mps2 - normal_gravity(latitude_deg);
        let [least, most] = GRAVITY_OFF_MPS2;
        (off < least || off > most).then_some(Self::Gravity(gravity_mps2, latitude_deg))
    }

    /// A warning if no inertial unit is sampled at `rate_hz`: the time stamps are then in another unit. A log over temperature may have a
    /// sample a minute, but it is neither integrated nor judged by its noise.
    pub fn of_rate(rate_hz: f64) -> Option<Self> {
        (!RATES_HZ.contains(&rate_hz)).then_some(Self::ImplausibleRate(rate_hz))
    }

    /// This warning, about channel `c`.
    pub(crate) fn of_channel(self, c: usize) -> Self {
        Self::Channel(RAW_COLUMNS[c], Box::new(self))
    }

    /// Whether `other` is of the same kind, about the same sensor, with the same cause: then only one of the two need be printed.
    pub fn is_like(&self, other: &Self) -> bool {
        let same = discriminant(self) == discriminant(other);
        same && match (self, other) {
            (Self::Of(s, one), Self::Of(t, other)) => s == t && one.is_like(other),
            (Self::Channel(_, one), Self::Channel(_, other)) => one.is_like(other),
            (Self::Reading(one), Self::Reading(other)) => discriminant(one) == discriminant(other),
            (Self::DwellsNotUsed(_, f, s), Self::DwellsNotUsed(_, g, t)) => {
                s == t && discriminant(f) == discriminant(g)
            }
            _ => true,
        }
    }

    /// If the warning is about a dwell or turn that was left out: the dwell to keep, so that it is used.
    pub fn left_out(&self) -> Option<i32> {
        match self {
            Self::DwellLeftOut(step, ..) | Self::TurnLeftOut(_, step, ..) => Some(*step),
            _ => None,
        }
    }
}

impl Serialize for Warning {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Measured values of Denver (EGM2008 and absolute gravimetry, 1609 m), La Paz (3640 m) and Paris; and normal gravity at the equator
    /// and the poles.
    #[test]
    fn gravity_of_high_places_is_plausible_and_that_of_another_latitude_is_not() {
        for (gravity, latitude_deg) in [
            (9.796, 39.74),
            (9.774, -16.5),
            (9.809, 48.85),
            (9.780, 0.0),
            (9.832, 90.0),
        ] {
            assert_eq!(
                Warning::of_gravity(gravity, latitude_deg),
                None,
                "{gravity}"
            );
        }
        // 45 degrees for 30.5, standard gravity in Singapore, and g in other units.
        for (gravity, latitude_deg) in [(9.8062, 30.5), (9.80665, 1.35), (980.665, 45.0)] {
            let warning = Warning::of_gravity(gravity, latitude_deg)
                .unwrap()
                .to_string();
            assert!(warning.contains("ppm"), "{warning}");
        }
        assert!(
            Warning::of_gravity(9.8062, 30.5)
                .unwrap()
                .to_string()
                .contains("by 1282 ppm")
        );
    }
}
