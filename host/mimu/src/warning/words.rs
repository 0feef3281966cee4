//! Warnings in words: nothing but a reader is to know these sentences.

use std::fmt;

use mimu_recording::RAW_COLUMNS;

use super::Warning;
use crate::fault::{Fault, SHORTEST_S};
use crate::quantity::{Sensor, duration, normal_gravity, plural, significant};

/// What would be open of `parameter` without a dwell or a turn.
fn open(parameter: &str, grows: f64) -> String {
    match grows < 1e3 {
        true => format!(
            "without it the interval of {parameter} would be {} times as wide",
            significant(grows)
        ),
        false => format!("nothing else determines {parameter}"),
    }
}

fn off(error: f64) -> String {
    format!(
        "its magnitude of specific force is {} mm/s² off what the other dwells predict",
        significant(1e3 * error)
    )
}

/// The first eight names.
fn few(names: &[String]) -> String {
    let more = if names.len() > 8 { ", ..." } else { "" };
    names[..names.len().min(8)].join(", ") + more
}

/// What a calibration that does no better was compared with.
fn without(as_came: bool) -> &'static str {
    match as_came {
        true => "the readings as they came",
        false => "its own mean scale factor and mean bias on all three axes and no misalignment",
    }
}

fn degrees(rad: f64) -> String {
    significant(rad.abs().to_degrees())
}

/// What to do about a channel that never changes.
pub(crate) const CHECK_WIRING: &str = "check its wiring, or that the right column was imported";

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Of(sensor, warning) => write!(f, "{sensor}: {warning}"),
            Self::Channel(name, warning) => write!(f, "{name}: {warning}"),
            Self::Reading(warning) => write!(f, "{warning}"),
            Self::RateOff(hz, off, given) => write!(f, "the time stamps run at {hz:.3} Hz, {off:+.2} % off the stated {given} Hz; the stamps are used"),
            Self::Gaps(count, missing_s, row) => write!(f, "{}, {missing_s:.3} s missing in all, the first before data row {row}: no turn is integrated across", plural(*count, "gap")),
            Self::Repeated(1) => f.write_str("1 row is the same as the row before, time included: left out"),
            Self::Repeated(n) => write!(f, "{n} rows are the same as the row before, time included: left out"),
            Self::Empty(count, channel) => write!(f, "{} of {channel} empty or not a number: masked", plural(*count, "sample")),
            Self::Held(sensor, held, rate_hz) => f.write_str(&held.words(sensor.name(), *rate_hz)),
            Self::DwellsCut(count, s) => write!(f, "{} cut at the ends, by {s:.1} s in all: the unit was not yet at rest there, or no longer", plural(*count, "dwell")),
            Self::SlowTurns(steps) => write!(f, "{} ({}) not used as a rest of the gyro, only as a pose: what it reads there is explained neither by its bias in the others nor by g-sensitivity, as in a slow turn about the vertical", plural(steps.len() as u64, "dwell"), steps.join(", ")),
            Self::DwellsNotUsed(names, fault, sensor) => {
                let verb = if names.len() == 1 { "is" } else { "are" };
                let count = plural(names.len() as u64, "dwell");
                write!(f, "{count} ({}) {verb} not used: ", few(names))?;
                match (fault, sensor) {
                    (Fault::TooShort, _) => write!(f, "shorter than {SHORTEST_S} s"),
                    (Fault::Turning, _) => f.write_str("the unit turns evenly and does not rest"),
                    (Fault::NotStill, Some(sensor)) => write!(f, "not still enough for the {sensor}"),
                    (Fault::TooFast, Some(sensor)) => write!(f, "the input of the {sensor} moves too far within a tenth of a second, by two fifths of its range"),
                    (other, _) => write!(f, "{other}"),
                }
            }
            Self::Clipped(count) => write!(f, "{} within dwells at a rail of the converter: masked", plural(*count, "sample")),
            Self::DwellWithEffect(step, sensor, fault, effect) => write!(f, "dwell {step}: not used for the {sensor}: {fault}, and {effect} cannot be removed without it"),
            Self::EndOfConverter(count, value) => write!(f, "{} at {value}, where a converter of 16 bits ends: taken for a rail", plural(*count, "sample")),
            Self::RunAtEnd(high, value, longest, chance) => write!(f, "the {} value {value} comes {longest} times in a row, chance explains {chance:.0}: taken for a rail", extreme(*high)),
            Self::CalmEnd(high, from) => write!(f, "at its {} values, from {from} on, the noise is gone: taken for a rail of the sensor", extreme(*high)),
            Self::Gravity(gravity, latitude) => {
                let normal = normal_gravity(*latitude);
                let ppm = ((gravity - normal) / normal * 1e6).abs();
                write!(f, "gravity is {gravity} m/s², and {normal:.5} at sea level at latitude {latitude}°: no height explains the difference, and if gravity is wrong, every scale factor of the accelerometer is by {ppm:.0} ppm: check both")
            }
            Self::NotSi(at_rest, times, cause) => {
                let what = match at_rest {
                    true => "at rest the readings, biases included, are about",
                    false => "the readings are",
                };
                write!(f, "raw_unit = \"SI\", but {what} {} times the input: {cause}", significant(*times))
            }
            Self::Turning(rate) => write!(f, "at rest it reads {} deg/s, and no bias is as large: the unit turns evenly, or the readings are in deg/s", degrees(*rate)),
            Self::Restless(rms) => write!(f, "from dwell to dwell the calibrated rate at rest differs by {} deg/s rms, as no bias does: in some that were taken for rest the unit turned evenly, about the vertical where the accelerometer shows nothing; leave these out", degrees(*rms)),
            Self::NoiseOfAnother(file, recording) => write!(f, "the noise file is of {file:?}, the recording of {recording:?}"),
            Self::NoisierThanFile(times, file) => write!(f, "the mean over a second is {} times as noisy within the dwells as {file} says, so the noise within the dwells is used", significant(*times)),
            Self::MeansWithoutNoise => f.write_str("the table has no standard deviations: the scatter about the fit is the only noise, and what noise alone would leave is not known"),
            Self::WhiteMeans => f.write_str("the noise of a mean is taken to be white, its standard deviation over the root of the number of samples; what else is in the means shows in the scatter about the fit"),
            Self::MeansMissing(without, of) => write!(f, "{without} of {of} rows have no mean of one axis at least, and are not used for it"),
            Self::MeansOfTurns => f.write_str("turns need samples, and this is a table of means: it is not calibrated; give it steps of known rate (ref_rate_ columns, reference = \"table\"), or record samples"),
            Self::WithoutTemperature(low, high, sensor) => {
                let whose = match sensor {
                    None => "the model",
                    Some(Sensor::Gyro) => "the gyro's model",
                    Some(Sensor::Accel) => "the accelerometer's model",
                };
                write!(f, "the dwells range from {low:.1} to {high:.1} °C, and {whose} has no temperature in it")
            }
            Self::NoDwell(unused) => write!(f, "no dwell can be used{unused}"),
            Self::NoInput(unused) => write!(f, "no usable dwell has a known input{unused}, so it is not calibrated"),
            Self::OneInput => f.write_str("all dwells have the same input, so it is not calibrated"),
            Self::ExactTurns => f.write_str("the turns are taken to be of exactly the given angle about exactly the given axis; what hands and table miss of that is in no interval"),
            Self::MeansAlone(count, method) => write!(f, "{} {} an input that moves, of which {method} uses the mean alone: least squares uses how the readings follow it", plural(*count, "dwell"), if *count == 1 { "has" } else { "have" }),
            Self::NoTurn => f.write_str("no turn lies between two usable dwells, so it is not calibrated"),
            Self::DwellLeftOut(step, error, sigmas) => write!(f, "dwell {step} is not used for the accelerometer: {}, {sigmas:.0} sigma of that prediction; keep dwell {step} to fit with it", off(*error)),
            Self::DwellKept(step, error, parameter, grows) => {
                let why = if error.is_finite() { off(*error) } else { "it is suspect".into() };
                write!(f, "dwell {step} is kept for the accelerometer, though {why}: {}, so nothing says whether it is right; repeat its pose", open(parameter, *grows))
            }
            Self::TurnLeftOut(from, to, error, sigmas) => write!(f, "the turn from dwell {from} to {to} is not used: it ends {} deg off what the other turns predict, {sigmas:.0} sigma of that prediction; keep dwell {to} to fit with it", significant(error.to_degrees())),
            Self::TurnKept(from, to, parameter, grows) => write!(f, "the turn from dwell {from} to {to} is kept, though it is suspect: {}; repeat it", open(parameter, *grows)),
            Self::TurnNotUsed(from, to, fault) => {
                write!(f, "the turn from dwell {from} to {to} is not used: ")?;
                match fault {
                    Some(Fault::Saturated(c)) => write!(f, "{} is at its rail", RAW_COLUMNS[*c]),
                    Some(Fault::Stuck(c)) => write!(f, "{} is stuck", RAW_COLUMNS[*c]),
                    Some(other) => write!(f, "{other}"),
                    None => f.write_str("samples are missing"),
                }
            }
            Self::WideTurn(angle) => write!(f, "after one turn gravity is {:.0} degrees from where it is predicted; samples are missing or clipped, or the gyro's columns are not the gyro's", angle.to_degrees()),
            Self::NoResiduals => f.write_str("as many parameters as residuals: nothing can be judged, neither the model nor the intervals, which hold the noise within dwells alone"),
            Self::FewResiduals => f.write_str("hardly more dwells than parameters: nothing can contradict the model, and the intervals rest on the noise within dwells alone"),
            Self::PoorlyDetermined(condition) => write!(f, "the experiment determines some parameters poorly (condition {condition:.0}); their intervals say which"),
            Self::LeftHanded => f.write_str("the axes come out left-handed: one of them, of gyro or accelerometer, points the other way than its column says"),
            Self::NoOpposite(count) => write!(f, "{count} rates have no opposite and are not used by the inverse form"),
            Self::NoDelay => f.write_str("a delay of the readings behind the reference is not told from a misalignment, and taken for none: turn both ways, or at several rates"),
            Self::WithTurns => f.write_str("the poses alone hardly determine it: the turns between them, which the gyro measures, are used as well"),
            Self::MatrixGiven(true) => f.write_str("the matrix is given, with its intervals; the biases are this recording's, and the intervals hold both"),
            Self::MatrixGiven(false) => f.write_str("the matrix is given, and no interval holds its error; the biases are this recording's"),
            Self::NotHeldOut(blocks, parts, problem) => {
                let name = if *blocks { "block" } else { "part" };
                match &parts[..] {
                    [one] => write!(f, "{name} {one} cannot be held out: without it {problem}"),
                    all => {
                        let all: Vec<String> = all.iter().map(usize::to_string).collect();
                        write!(f, "{name}s {} cannot be held out: without the first of these {problem}", all.join(", "))
                    }
                }
            }
            Self::Interleaved(parts, why) => write!(f, "one dwell in {parts} is held out, and no blocks: {why}"),
            Self::LeftOutChanges(moved, of, largest) => write!(f, "what was left out changes {moved} of {of} parameters by more than their intervals, most of all: {}", largest.join("; ")),
            Self::NoBetter([came, calibrated], unit, held_out, undecided) => {
                let how = if *held_out { "on data that it was not fitted to" } else { "in sample" };
                let [came, calibrated] = [came, calibrated].map(|v| significant(*v));
                write!(f, "the readings as they came err by {came} {unit}, and calibrated by {calibrated} {unit} {how}: ")?;
                match undecided {
                    None => f.write_str("this calibration is no better than none"),
                    Some(count) => write!(f, "{count} errors do not tell whether this calibration is better than none"),
                }
            }
            Self::UnseenPoses(names, worst, typical) => {
                let [worst, typical] = [worst, typical].map(|v| significant(1e3 * v));
                write!(f, "with {} up, near which no pose is, the calibration is open by {worst} mm/s² (one sigma), and in the poses held by {typical} mm/s²: add such poses before it is used there", names.join(", "))
            }
            Self::FollowsTemperature(without, with, mean_c) => {
                let [without, with] = [without, with].map(|share| significant(100.0 * share));
                write!(f, "{without} % of the known inputs is left over by a model without temperature, and {with} % by one with it: the parameters are those at about {mean_c:.1} °C, the mean of the dwells, and their intervals hold what the temperature does; `mimu diagnose` finds what follows it")
            }
            Self::Outliers(turns, names, worst, unit, ratio) => {
                let what = if *turns { "turn to dwell" } else { "dwell" };
                write!(f, "{} ({what} {}): off by up to {} {unit}, {ratio:.0} times the median; look for the cause, as it widens all intervals", plural(names.len() as u64, "outlier"), few(names), significant(*worst))
            }
            Self::RateError(rates, error) => {
                let list: Vec<String> = rates.iter().map(|r| significant(*r)).collect();
                let factors = match rates.len() {
                    1 => "it is a factor of all scale factors",
                    _ => "each rate has its own, and they are factors of all scale factors",
                };
                write!(f, "the turntable's rate of {} deg/s is known to ±{} % (95 %): {factors}, is in their intervals, and no number of dwells reduces it", list.join(" and "), significant(100.0 * error))
            }
            Self::RatesContradict(rate, off) => write!(f, "the rates of the turntable contradict each other: the fit has {} deg/s {:+.2} % off; look whether the rates (33 1/3 rpm is 200 deg/s, 45 rpm is 270 deg/s) and their error are right", significant(rate.to_degrees()), 100.0 * off),
            Self::NoRestsToFit(problem) => write!(f, "not calibrated, as the dwells at rest do not determine it ({problem}); at the rates of the turntable a centripetal force acts that nothing says"),
            Self::Turned(angle, table) => {
                let against = if *table { "those of the ref_ columns" } else { "the accelerometer's" };
                write!(f, "its axes are turned by {:.0} degrees against {against}: unless it is mounted so, columns are swapped or have the wrong sign", angle.to_degrees())
            }
            Self::NoTemperatures(none) => write!(f, "temp_c: {}", none.warning().unwrap_or_default()),
            Self::Dead(why) => write!(f, "{why}: it has no noise, and a noise file does not have it; {CHECK_WIRING}"),
            Self::OffLevel(angle) => write!(f, "the errors lie across the known force and not along it, as if the dwells were off level by {} deg rms: level the faces, or leave the directions out (reference = \"gravity\")", degrees(*angle)),
            Self::OtherUnit(ours, theirs) => write!(f, "the calibration is of the unit {ours}, the recording of the unit {theirs}"),
            Self::OtherDevice(ours, theirs) => write!(f, "the calibration is for {ours:?}, the recording of {theirs:?}"),
            Self::SameRecording => f.write_str("this is the recording that the calibration was made from: the figures say nothing about new data"),
            Self::OutOfRange([count, of], [from, to], farthest, curves) => {
                write!(f, "{count} of {of} samples are outside the {from:.1} to {to:.1} °C that the calibration was made from, by up to {farthest:.1} K: ")?;
                match curves {
                    Some(beyond) => write!(f, "beyond {beyond} K its curves are held, and before that they go on straight"),
                    None => f.write_str("it has no curves over temperature: fit one with recordings over temperature"),
                }
            }
            Self::NoTemperature => f.write_str("the recording has no temp_c: the calibration's one model is used, and not its curves"),
            Self::NothingToJudge => f.write_str("the recording has nothing to judge it by"),
            Self::Worse(as_came) => {
                let question = if *as_came { "this unit" } else { "this unit, in this condition" };
                write!(f, "worse than with {}: is it the calibration of {question}?", without(*as_came))
            }
            Self::Undecided(count, turns, as_came) => {
                let noun = if *turns { "turn" } else { "dwell" };
                write!(f, "{} do not tell whether it is better than {}: record more", plural(*count, noun), without(*as_came))
            }
            Self::NotCalibrated(sensor) => write!(f, "the calibration is not for the {sensor}: its columns are left out"),
            Self::Uncertain => f.write_str("the calibration does not say how well it is known, as one that a device kept: its matrix is taken as exact, so that what it is off by may be found as an effect, and the intervals of a new calibration lack it"),
            Self::NotJudged(Some(recording), why) => write!(f, "{recording} cannot judge the calibration: {why}"),
            Self::NotJudged(None, why) => write!(f, "{why}"),
            Self::EffectLost(effect, sensor) => write!(f, "{effect} of the calibration is not in the new one, as the {sensor} is not recorded"),
            Self::UnsteadyLines => f.write_str("lines that are not steady were set aside, and something still stands above the floor of the spectrum: the coefficients have some of it"),
            Self::FollowsChamber(span_c, r) => write!(f, "follows temp_c, which changes by {} °C (correlation {r:.2}): the long end of its curve is the chamber's and not the sensor's", significant(*span_c)),
            Self::Drifts(share, longest_s) => write!(f, "a drift makes {:.0} % of the variance at {}: the long end of its curve is warm-up or the chamber's, and not noise", 100.0 * share, duration(*longest_s)),
            Self::EmptyCells(row, length_s, from) => write!(f, "empty cells, the first in data row {row}; the longest stretch without is used: {} from data row {from}", duration(*length_s)),
            Self::Disturbed(count, share, first_s) => write!(f, "{}, {} % of the time, are disturbed, first at {first_s:.1} s: masked", plural(*count, "sample"), significant(100.0 * share)),
            Self::Moves([count, of], window_s, first_s, channel) => write!(f, "the unit moves, or something shakes it, in {count} of {of} windows of {}, {} % of the time, first at {first_s:.1} s ({channel})", duration(*window_s), significant(100.0 * *count as f64 / *of as f64)),
            Self::LongestStretch(gaps, first_s, row, length_s, from_s) => write!(f, "{}, the first of {} before data row {row}; the longest stretch without is used: {} from {from_s:.3} s", plural(*gaps, "gap"), duration(*first_s), duration(*length_s)),
        }
    }
}

fn extreme(high: bool) -> &'static str {
    if high { "highest" } else { "lowest" }
}
