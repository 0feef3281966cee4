//! Warnings in words. These sentences are for people; no code may depend on them.

use std::fmt;

use mimu_recording::RAW_COLUMNS;

use super::Warning;
use crate::fault::{Fault, SHORTEST_S};
use crate::quantity::{Sensor, duration, normal_gravity, plural, significant};

/// How uncertain `parameter` would be without a dwell or a turn.
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
        "its magnitude of specific force differs by {} mm/s² from what the other dwells predict",
        significant(1e3 * error)
    )
}

/// The first eight names.
fn few(names: &[String]) -> String {
    let more = if names.len() > 8 { ", ..." } else { "" };
    names[..names.len().min(8)].join(", ") + more
}

/// What a calibration that does no better was compared with.
fn without(readings_in_si: bool) -> &'static str {
    match readings_in_si {
        true => "the uncalibrated readings",
        false => "its own mean scale factor and mean bias on all three axes, without misalignment",
    }
}

fn degrees(rad: f64) -> String {
    significant(rad.abs().to_degrees())
}

/// What to do about a channel that never changes.
pub(crate) const CHECK_WIRING: &str = "check its wiring, and that the right column was imported";

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Of(sensor, warning) => write!(f, "{sensor}: {warning}"),
            Self::Channel(name, warning) => write!(f, "{name}: {warning}"),
            Self::Reading(warning) => write!(f, "{warning}"),
            Self::RateOff(hz, off, given) => write!(f, "the rate of the time stamps is {hz:.3} Hz, {off:+.2} % off the {given} Hz of its recording.toml; the stamps are used"),
            Self::ImplausibleRate(hz) => write!(f, "{} Hz is not the sample rate of an inertial unit: are the times in ms or µs instead of s? All rates and the scale factors of the gyro would be wrong by the same factor", significant(*hz)),
            Self::CalibrationOfOther(times) => write!(f, "with the calibration the specific force at rest is {} times gravity: it belongs to another unit, or to readings in another unit", significant(*times)),
            Self::NoisierThanGyros(n) => write!(f, "its white noise of {} deg/s/sqrt(Hz) exceeds that of any gyro: check whether the readings are in deg/s, and the calibration belongs to this unit", degrees(*n)),
            Self::Gaps(count, missing_s, row) => write!(f, "{}, {missing_s:.3} s missing in all, the first before data row {row}: turns are not integrated across gaps", plural(*count, "gap")),
            Self::Repeated(1) => f.write_str("1 row repeats the row before, time included: left out"),
            Self::Repeated(n) => write!(f, "{n} rows repeat the row before, time included: left out"),
            Self::Empty(count, channel) => write!(f, "{} of {channel} empty or not a number: masked", plural(*count, "sample")),
            Self::Held(sensor, held, rate_hz) => f.write_str(&held.words(sensor.name(), *rate_hz)),
            Self::LogFault(fault) => write!(f, "from data row {} on {}: no calibration holds before and after it", fault.row + 1, fault.change),
            Self::DwellsCut(count, s) => write!(f, "{} cut at the ends, by {s:.1} s in all: the readings change there, as while the unit moves", plural(*count, "dwell")),
            Self::SlowTurns(steps) => write!(f, "{} ({}) used as a pose only, not as a rest of the gyro: neither its bias in the other dwells nor g-sensitivity explains its reading; the unit probably turned slowly about the vertical", plural(steps.len() as u64, "dwell"), steps.join(", ")),
            Self::DwellsNotUsed(names, fault, sensor) => {
                let verb = if names.len() == 1 { "is" } else { "are" };
                let count = plural(names.len() as u64, "dwell");
                write!(f, "{count} ({}) {verb} not used: ", few(names))?;
                match (fault, sensor) {
                    (Fault::TooShort, _) => write!(f, "shorter than {SHORTEST_S} s"),
                    (Fault::Turning, _) => f.write_str("the unit turns evenly instead of resting"),
                    (Fault::NotStill, Some(sensor)) => write!(f, "not still enough for the {sensor}"),
                    (Fault::TooFast, Some(sensor)) => write!(f, "the input of the {sensor} moves too far within a tenth of a second, by two fifths of its range"),
                    (other, _) => write!(f, "{other}"),
                }
            }
            Self::Clipped(count) => write!(f, "{} within dwells at a rail of the converter: masked", plural(*count, "sample")),
            Self::DwellWithEffect(step, sensor, fault, effect) => write!(f, "dwell {step}: not used for the {sensor}: {fault}, and {effect} cannot be removed without it"),
            Self::EndOfConverter(count, value) => write!(f, "{} at {value}, the end of a 16-bit converter: treated as a rail", plural(*count, "sample")),
            Self::FullScale(count, value) => write!(f, "{} at {value}, the full scale of a sensor: treated as a rail", plural(*count, "sample")),
            Self::RunAtEnd(high, value, longest, chance) => write!(f, "the {} value {value} occurs {longest} times in a row, and chance explains {chance:.0}: treated as a rail", extreme(*high)),
            Self::CalmEnd(high, from) => write!(f, "at its {} values, from {from} on, the noise vanishes: treated as a rail of the sensor", extreme(*high)),
            Self::NoLatitude => f.write_str("no latitude is given, so the Earth's rate (0.004 deg/s, 15 deg/h) is unknown and in the intervals of the biases: give the latitude"),
            Self::HeadingLost(times) => write!(
                f,
                "the heading of the table is lost {} between dwells (samples are missing there, or the gyro clips), so the horizontal component of the Earth's rate is in the intervals of the biases: record the table's motion without gaps",
                plural(*times as u64, "time")
            ),
            Self::Gravity(gravity, latitude) => {
                let normal = normal_gravity(*latitude);
                let ppm = ((gravity - normal) / normal * 1e6).abs();
                write!(f, "gravity is given as {gravity} m/s², but at sea level at latitude {latitude}° it is {normal:.5}, and no height explains the difference. If gravity is wrong, every scale factor of the accelerometer is wrong by {ppm:.0} ppm: check both")
            }
            Self::NotSi(at_rest, times, cause) => {
                let what = match at_rest {
                    true => "at rest the readings, biases included, are about",
                    false => "the readings are",
                };
                write!(f, "raw_unit = \"SI\", but {what} {} times the input: {cause}", significant(*times))
            }
            Self::NotCounts(scale, unit, remedy) => write!(f, "raw_unit = \"count\", but the readings are fractions, and the fit gives {} of them per SI unit: they are in {unit}; import them with {remedy}", significant(*scale)),
            Self::Turning(rate) => write!(f, "at rest it reads {} deg/s, more than any bias: the unit turns evenly, or the readings are in deg/s", degrees(*rate)),
            Self::BiasRemoved(removal) => write!(f, "gyro: {removal}; its scale factors and angles are calibrated, but the bias is not that of the sensor, so none is given"),
            Self::Restless(rms) => write!(f, "from dwell to dwell the calibrated rate at rest differs by {} deg/s rms, more than any bias: in some dwells the unit turned evenly, about the vertical if the accelerometer shows nothing; leave these dwells out", degrees(*rms)),
            Self::OtherGravity([ours, theirs], mean, contradicted) => {
                let ppm = 1e6 * (theirs / ours - 1.0).abs();
                write!(f, "gravity is {ours} m/s² in the calibration and {theirs} m/s² in the recording, a difference of {ppm:.0} ppm, and the calibrated force at rest has a magnitude of {mean:.5} m/s²: ")?;
                f.write_str(match contradicted {
                    true => "the readings contradict the gravity of the recording; give both the gravity of their place",
                    false => "if both were recorded at one place, one of the two is wrong",
                })
            }
            Self::NoiseOfAnother(file, recording) => write!(f, "the noise file belongs to {file:?}, the recording to {recording:?}"),
            Self::NoisierThanFile(times, file) => write!(f, "within the dwells the mean over a second is {} times as noisy as in {file}, so the noise within the dwells is used", significant(*times)),
            Self::MeansWithoutNoise => f.write_str("the table has no standard deviations: the scatter about the fit is taken as the noise, and the noise floor is unknown"),
            Self::WhiteMeans => f.write_str("the noise of a mean is assumed to be white: the standard deviation over the root of the number of samples. Other noise in the means appears as scatter about the fit"),
            Self::MeansMissing(without, of) => write!(f, "{without} of {of} rows lack the mean of an axis and are not used for it"),
            Self::MeansOfTurns => f.write_str("not calibrated: turns need samples, and this is a table of means; give it dwells at known rates (ref_rate_ columns, reference = \"table\"), or record samples"),
            Self::WithoutTemperature(low, high, sensor) => {
                let whose = match sensor {
                    None => "the model",
                    Some(Sensor::Gyro) => "the gyro's model",
                    Some(Sensor::Accel) => "the accelerometer's model",
                };
                write!(f, "the dwells range from {low:.1} to {high:.1} °C, but {whose} does not depend on temperature")
            }
            Self::NoDwell(unused) => write!(f, "no dwell can be used{unused}"),
            Self::NoInput(unused) => write!(f, "not calibrated: no usable dwell has a known input{unused}"),
            Self::OneInput => f.write_str("not calibrated: all dwells have the same input"),
            Self::ExactTurns => f.write_str("angle and axis of the given turns are assumed to be exact; no interval includes their errors"),
            Self::MeansAlone(count, method) => write!(f, "{} {} an input that moves; {method} uses its mean only, least squares also how the readings follow it", plural(*count, "dwell"), if *count == 1 { "has" } else { "have" }),
            Self::NoTurn => f.write_str("not calibrated: no turn connects two usable dwells"),
            Self::DwellLeftOut(step, error, sigmas) => write!(f, "dwell {step} is not used for the accelerometer: {}, by {sigmas:.0} sigma of that prediction; to use it all the same, keep dwell {step}", off(*error)),
            Self::DwellKept(step, error, parameter, grows) => {
                let why = if error.is_finite() { off(*error) } else { "it is suspect".into() };
                write!(f, "dwell {step} is kept for the accelerometer, although {why}: {}, so it cannot be tested; repeat its pose", open(parameter, *grows))
            }
            Self::TurnLeftOut(from, to, error, sigmas) => write!(f, "the turn from dwell {from} to {to} is not used: it ends {} deg from where the other turns predict, {sigmas:.0} sigma of that prediction; to use it all the same, keep dwell {to}", significant(error.to_degrees())),
            Self::TurnKept(from, to, parameter, grows) => write!(f, "the turn from dwell {from} to {to} is kept, although it is suspect: {}; repeat it", open(parameter, *grows)),
            Self::TurnNotUsed(from, to, fault) => {
                write!(f, "the turn from dwell {from} to {to} is not used: ")?;
                match fault {
                    Some(Fault::Saturated(c)) => write!(f, "{} is at its rail", RAW_COLUMNS[*c]),
                    Some(Fault::Stuck(c)) => write!(f, "{} is stuck", RAW_COLUMNS[*c]),
                    Some(other) => write!(f, "{other}"),
                    None => f.write_str("samples are missing"),
                }
            }
            Self::WideTurn(angle) => write!(f, "after one turn gravity is {:.0} degrees from its predicted direction: samples are missing or clipped, or the gyro's columns are wrong", angle.to_degrees()),
            Self::NoResiduals => f.write_str("there are as many parameters as residuals: neither the model nor the intervals can be judged, and the intervals include only the noise within dwells"),
            Self::FewResiduals => f.write_str("there are hardly more dwells than parameters: the data cannot contradict the model, and the intervals include only the noise within dwells"),
            Self::PoorlyDetermined(condition) => write!(f, "the experiment determines some parameters poorly (condition {condition:.0}); their intervals say which"),
            Self::LeftHanded => f.write_str("the axes are left-handed: one axis of gyro or accelerometer has the wrong sign, or two are exchanged"),
            Self::NoOpposite(count) => write!(f, "{count} rates have no opposite and are not used by the inverse form"),
            Self::NoDelay => f.write_str("a delay of the readings cannot be distinguished from a misalignment and is assumed to be zero: turn in both directions, or at several rates"),
            Self::WithTurns => f.write_str("the poses alone hardly determine it, so the turns between them, as measured by the gyro, are used too"),
            Self::MatrixGiven(true) => f.write_str("the matrix and its intervals are given; the biases are those of this recording, and the intervals include both uncertainties"),
            Self::MatrixGiven(false) => f.write_str("the matrix is given without intervals, so no interval includes its error; the biases are those of this recording"),
            Self::NotHeldOut(blocks, parts, problem) => {
                let name = if *blocks { "block" } else { "part" };
                match &parts[..] {
                    [one] => write!(f, "{name} {one} cannot be held out: without it, {problem}"),
                    all => {
                        let all: Vec<String> = all.iter().map(usize::to_string).collect();
                        write!(f, "{name}s {} cannot be held out: without the first of these, {problem}", all.join(", "))
                    }
                }
            }
            Self::Interleaved(parts, why) => write!(f, "one dwell in {parts} is held out instead of blocks: {why}"),
            Self::LeftOutChanges(0, _, largest) => write!(f, "leaving out dwells or turns changes no parameter by more than its interval; the largest change: {}", largest.join("; ")),
            Self::LeftOutChanges(moved, of, largest) => write!(f, "leaving out dwells or turns changes {moved} of {of} parameters by more than their intervals, most of all: {}", largest.join("; ")),
            Self::NoBetter([came, calibrated], unit, held_out, undecided) => {
                let how = if *held_out { "on held-out data" } else { "in sample" };
                let [came, calibrated] = [came, calibrated].map(|v| significant(*v));
                write!(f, "the error of the uncalibrated readings is {came} {unit}, that of the calibrated ones {calibrated} {unit} {how}: ")?;
                match undecided {
                    None => f.write_str("this calibration does not improve the readings"),
                    Some(count) => write!(f, "{count} errors do not show whether this calibration improves the readings"),
                }
            }
            Self::UnseenPoses(names, worst, typical) => {
                let [worst, typical] = [worst, typical].map(|v| significant(1e3 * v));
                write!(f, "no pose is near {} up, where the calibration is uncertain by {worst} mm/s² (one sigma); in the recorded poses it is {typical} mm/s². Add such poses before you use it there", names.join(", "))
            }
            Self::FollowsTemperature(without, with, mean_c) => {
                let [without, with] = [without, with].map(|share| significant(100.0 * share));
                write!(f, "a model without temperature leaves {without} % of the readings unexplained, one with temperature {with} %. The parameters are valid at about {mean_c:.1} °C, the mean of the dwells, and their intervals include the effect of temperature; `mimu diagnose` finds this effect")
            }
            Self::Outliers(turns, names, worst, unit, ratio) => {
                let what = if *turns { "turn to dwell" } else { "dwell" };
                write!(f, "{} ({what} {}): errors of up to {} {unit}, {ratio:.0} times the median; look for the cause, because they widen all intervals", plural(names.len() as u64, "outlier"), few(names), significant(*worst))
            }
            Self::RateError(rates, error) => {
                let list: Vec<String> = rates.iter().map(|r| significant(*r)).collect();
                let factors = match rates.len() {
                    1 => "its error is a common factor of all scale factors",
                    _ => "each rate has a separate error, and these are factors of all scale factors",
                };
                write!(f, "the turntable's rate of {} deg/s is known to ±{} % (95 %): {factors}. Their intervals include it, and no number of dwells reduces it", list.join(" and "), significant(100.0 * error))
            }
            Self::RatesContradict(rate, off) => write!(f, "the rates of the turntable contradict each other: by the fit, {} deg/s is {:+.2} % off; check the rates (33 1/3 rpm is 200 deg/s, 45 rpm is 270 deg/s) and their error", significant(rate.to_degrees()), 100.0 * off),
            Self::NoRestsToFit(problem) => write!(f, "not calibrated, because the dwells at rest do not determine it ({problem}); at the rates of the turntable it also senses an unknown centripetal force"),
            Self::Turned(angle, table) => {
                let against = if *table { "those of the ref_ columns" } else { "the accelerometer's" };
                write!(f, "its axes are rotated by {:.0} degrees relative to {against}: unless it is mounted so, columns are swapped or have the wrong sign", angle.to_degrees())
            }
            Self::NoTemperatures(none) => write!(f, "temp_c: {}", none.warning().unwrap_or_default()),
            Self::Dead(why) => write!(f, "{why}: it has no noise and is left out of a noise file; {CHECK_WIRING}"),
            Self::OffLevel(angle) => write!(f, "the errors are perpendicular to the known force, as if the dwells were off level by {} deg rms: level the faces, or use only the magnitude of gravity (reference = \"gravity\")", degrees(*angle)),
            Self::OtherUnit(ours, theirs) => write!(f, "the calibration belongs to unit {ours}, the recording to unit {theirs}"),
            Self::UnnamedUnit(unnamed) => {
                let who = match unnamed {
                    [true, true] => "calibration and recording name no unit",
                    [true, false] => "the calibration names no unit",
                    [false, _] => "the recording names no unit",
                };
                write!(f, "{who}, so they are taken to belong to one; to have this checked, give each import the name of its unit")
            }
            Self::OtherDevice(ours, theirs) => write!(f, "the calibration belongs to {ours:?}, the recording to {theirs:?}"),
            Self::SameRecording => f.write_str("the calibration was made from this recording: the figures say nothing about new data"),
            Self::OutOfRange([count, of], [from, to], farthest, curves) => {
                write!(f, "{count} of {of} samples are outside the {from:.1} to {to:.1} °C that the calibration was made from, by up to {farthest:.1} K: ")?;
                match curves {
                    Some(beyond) => write!(f, "its curves continue in a straight line for {beyond} K and are constant beyond"),
                    None => f.write_str("it has no curves over temperature: fit one with recordings over temperature"),
                }
            }
            Self::NoTemperature => f.write_str("the recording has no temp_c: the calibration's model at one temperature is used instead of its curves"),
            Self::NothingToJudge => f.write_str("the recording has no data to judge it"),
            Self::Worse(readings_in_si) => {
                let question = if *readings_in_si { "this unit" } else { "this unit, in this state" };
                write!(f, "worse than with {}: is it the calibration of {question}?", without(*readings_in_si))
            }
            Self::Undecided(count, turns, readings_in_si) => {
                let noun = if *turns { "turn" } else { "dwell" };
                write!(f, "{} do not show whether it is better than {}: record more", plural(*count, noun), without(*readings_in_si))
            }
            Self::NotCalibrated(sensor) => write!(f, "the calibration is not for the {sensor}: its columns are left out"),
            Self::Uncertain => f.write_str("the calibration has no uncertainty, like one that was read from a device. Its matrix is taken as exact: an error of it may be found as an effect, and the intervals of a new calibration do not include it"),
            Self::NotJudged(Some(recording), why) => write!(f, "{recording} cannot judge the calibration: {why}"),
            Self::NotJudged(None, why) => write!(f, "{why}"),
            Self::EffectLost(effect, sensor) => write!(f, "{effect} of the calibration is missing in the new one, because the {sensor} was not recorded"),
            Self::UnsteadyLines => f.write_str("unsteady lines were removed, and the spectrum still exceeds its floor: the coefficients contain part of that"),
            Self::FollowsChamber(span_c, r) => write!(f, "follows temp_c, which changes by {} °C (correlation {r:.2}): the long end of its curve shows temperature, not the sensor's noise", significant(*span_c)),
            Self::Drifts(share, longest_s) => write!(f, "a drift makes {:.0} % of the variance at {}: the long end of its curve shows warm-up or the chamber, not noise", 100.0 * share, duration(*longest_s)),
            Self::EmptyCells(row, length_s, from) => write!(f, "empty cells, the first in data row {row}; the longest segment without any is used: {} from data row {from}", duration(*length_s)),
            Self::Disturbed(count, share, first_s) => write!(f, "{}, {} % of the time, are disturbed, first at {first_s:.1} s: masked", plural(*count, "sample"), significant(100.0 * share)),
            Self::Moves([count, of], window_s, first_s, channel) => write!(f, "the unit moves, or something shakes it, in {count} of {of} windows of {}, {} % of the time, first at {first_s:.1} s ({channel})", duration(*window_s), significant(100.0 * *count as f64 / *of as f64)),
            Self::LongestStretch(gaps, first_s, row, length_s, from_s) => write!(f, "{}, the first of {} before data row {row}; the longest segment without any is used: {} from {from_s:.3} s", plural(*gaps, "gap"), duration(*first_s), duration(*length_s)),
        }
    }
}

fn extreme(high: bool) -> &'static str {
    if high { "highest" } else { "lowest" }
}
