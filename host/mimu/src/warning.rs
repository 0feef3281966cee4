//! Warnings about a recording, a fit or a verdict, by kind.

mod words;

use words::{degrees, off, open};

use std::fmt::Display;
use std::mem::discriminant;

use mimu_recording::health::Finding;
use mimu_recording::{ClockRate, Error, RAW_COLUMNS, RawUnit, TriadName};
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

use crate::bias_removal::BiasRemoval;
use crate::fault::Fault;
use crate::quantity::{Sensor, duration, normal_gravity, p_value, plural, significant};

/// Range of the difference of local gravity from normal gravity at sea level, m/s²: heights of up to 5500 m subtract 0.017, and depths of
/// 400 m add 0.001. Anomalies of the Earth's field are up to 0.003 either way (0.005 on a few peaks and islands).
const GRAVITY_OFF_MPS2: [f64; 2] = [-0.020, 0.005];

/// Sample rates of inertial units, Hz. The fastest parts give 32 kHz; 0.05 Hz are 50 Hz whose stamps are in ms.
const RATES_HZ: std::ops::RangeInclusive<f64> = 1.0..=40e3;

/// What a person should know. JSON has its kind, what it is about, and the sentence.
#[expect(
    missing_docs,
    reason = "the comment of a variant says what its fields are"
)]
#[derive(Debug, Clone, PartialEq, thiserror::Error, strum::IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
pub enum Warning {
    /// One about a sensor.
    #[error("{0}: {1}")]
    Of(Sensor, Box<Warning>),
    /// One about a channel.
    #[error("{0}: {1}")]
    Channel(&'static str, Box<Warning>),
    /// One about a recording of several.
    #[error("{0}: {1}")]
    In(String, Box<Warning>),
    /// A warning from reading a recording.
    #[error("{0}")]
    Reading(mimu_recording::Warning),
    /// Rate of the time stamps, Hz, its difference in per cent from the rate in the manifest, and that rate, Hz.
    #[error(
        "the rate of the time stamps is {stamps_hz:.3} Hz, {off_percent:+.2} % off the {manifest_hz} Hz of its recording.toml; the stamps are used"
    )]
    RateOff {
        stamps_hz: f64,
        off_percent: f64,
        manifest_hz: f64,
    },
    /// Parameters that stay at the default of data sheets, with that value, and what would show them.
    #[error("not calibrated, because nothing here shows it: {}; each stays at the default of data sheets, with their limits as its interval; {add}", .parameters.join(", "))]
    LeftOpen {
        parameters: Vec<String>,
        add: &'static str,
    },
    /// An axis that differs between dwells on one face: the difference and the noise of a dwell, in the unit of the readings.
    #[error("{axis} differs by up to {} {unit} between dwells on one face, and their noise is {} {unit}: its bias has moved, or the unit did not lie on that face", significant(*spread), significant(*noise))]
    FaceDiffers {
        axis: &'static str,
        spread: f64,
        noise: f64,
        unit: RawUnit,
    },
    /// The accelerometer's angles are those of data sheets.
    #[error(
        "not calibrated: its turns depend on the angles between the accelerometer's axes, which the poses leave open"
    )]
    FewTurns,
    /// A clock that the user trusts although it does not agree with the computer's.
    #[error("{}, and it was trusted: if the computer's is right, the gyro's scale factors err by that factor", .0.words())]
    TrustedClock(ClockRate),
    /// Power-ons within the recording before the last one.
    #[error("the device restarted within it: {} its own biases, and those given are of the last", match .others { 1 => "the power-on before has".to_string(), n => format!("each of the {n} power-ons before has") })]
    PowerOns { others: usize },
    /// The bias of a sensor in a power-on beside the one that a calibration is judged in: from when on, s, by how much it is more, and half of the 95 % intervals, SI.
    #[error("{}", words::bias_moved(*sensor, *t_s, moved, half_width))]
    BiasMoved {
        sensor: Sensor,
        t_s: f64,
        moved: [f64; 3],
        half_width: [f64; 3],
    },
    /// Sample rate that no inertial unit has, Hz.
    #[error("{} Hz is not the sample rate of an inertial unit: are the times in ms or µs instead of s? All rates and the scale factors of the gyro would be wrong by the same factor", significant(*.rate_hz))]
    ImplausibleRate { rate_hz: f64 },
    /// How many times gravity the specific force at rest is with the given calibration.
    #[error("with the calibration the specific force at rest is {} times gravity: it belongs to another unit, or to readings in another unit", significant(*.times))]
    CalibrationOfOther { times: f64 },
    /// White noise, rad/s/√Hz, that exceeds that of any gyro.
    #[error("its white noise of {} deg/s/sqrt(Hz) exceeds that of any gyro: check whether the readings are in deg/s, and the calibration belongs to this unit", degrees(*.white))]
    NoisierThanGyros { white: f64 },
    /// Gaps, the missing time in all, s, and the first data row after one.
    #[error("{}, {missing_s:.3} s missing in all, the first before data row {row}: turns are not integrated across longer ones than 135 ms", plural(*.count, "gap"))]
    Gaps {
        count: u64,
        missing_s: f64,
        row: u64,
    },
    /// Rows that repeat the row before.
    #[error("{} the row before, time included: left out", match rows { 1 => "1 row repeats".to_owned(), n => format!("{n} rows repeat") })]
    Repeated { rows: u64 },
    /// Samples of a channel that are empty or not a number.
    #[error("{} of {channel} empty or not a number: masked", plural(*.count, "sample"))]
    Empty { count: u64, channel: &'static str },
    /// A fault of the readings.
    #[error("{0}")]
    Health(Finding),
    /// Dwells that were cut at their ends, and by how much in all, s.
    #[error("{} cut at the ends, by {cut_s:.1} s in all: the readings change there, as while the unit moves", plural(*.count, "dwell"))]
    DwellsCut { count: u64, cut_s: f64 },
    /// Dwells that are poses of the accelerometer but not rests of the gyro.
    #[error("{} ({}) used as a pose only, not as a rest of the gyro: neither its bias in the other dwells nor g-sensitivity explains its reading; the unit probably turned slowly about the vertical", plural(.dwells.len() as u64, "dwell"), .dwells.join(", "))]
    SlowTurns { dwells: Vec<String> },
    /// A dwell whose reading contradicts the rate that it is given, and the rate that it shows, deg/s.
    #[error("dwell {dwell} is not used: its given rate is {} deg/s, and its reading shows {}", significant(*label_dps), found_dps.map_or_else(|| "none of the rates".to_owned(), |dps| match dps > 0.0 { true => format!("{} deg/s", significant(dps)), false => "a rest".into() }))]
    RateOfDwell {
        dwell: String,
        label_dps: f64,
        found_dps: Option<f64>,
    },
    /// Dwells that are not used, and why: for both sensors alike or for one.
    #[error("{}", words::not_used(dwells, fault, *sensor))]
    DwellsNotUsed {
        dwells: Vec<String>,
        fault: Fault,
        sensor: Option<Sensor>,
    },
    /// Samples within dwells at a rail.
    #[error("{} within dwells at a rail of the converter: masked", plural(*.count, "sample"))]
    Clipped { count: u64 },
    /// A dwell that is not used for a sensor, because an effect cannot be removed from it.
    #[error(
        "dwell {dwell}: not used for the {sensor}: {fault}, and {effect} cannot be removed without it"
    )]
    DwellWithEffect {
        dwell: i32,
        sensor: Sensor,
        fault: Fault,
        effect: String,
    },
    /// Gravity that no height explains, m/s², and the latitude, degrees.
    #[error("{}", words::gravity(*gravity_mps2, *latitude_deg))]
    Gravity {
        gravity_mps2: f64,
        latitude_deg: f64,
    },
    /// Gravity of the calibration and of the recording, m/s²; the mean magnitude of the calibrated force at rest, and whether it agrees with the
    /// former.
    #[error("{}", words::other_gravity(*gravity_mps2, *force_mps2, *contradicted))]
    OtherGravity {
        gravity_mps2: [f64; 2],
        force_mps2: f64,
        contradicted: bool,
    },
    /// The Earth's rate is in the intervals of the gyro's biases, because no latitude is given.
    #[error(
        "no latitude is given, so the Earth's rate (0.004 deg/s, 15 deg/h) is unknown and in the intervals of the biases: give the latitude"
    )]
    NoLatitude,
    /// The horizontal component of the Earth's rate is in the intervals of the gyro's biases, because the heading was lost this often.
    #[error("the heading of the table is lost {} between dwells (samples are missing there, or the gyro clips), so the horizontal component of the Earth's rate is in the intervals of the biases: record the table's motion without gaps", plural(*.times as u64, "time"))]
    HeadingLost { times: usize },
    /// Firmware removes the bias of the gyro before it is recorded.
    #[error(
        "gyro: {0}; its scale factors and angles are calibrated, but the bias is not that of the sensor, so none is given"
    )]
    BiasRemoved(BiasRemoval),
    /// Calibrated rate at rest, rad/s rms, by which dwells differ.
    #[error("from dwell to dwell the calibrated rate at rest differs by {} deg/s rms, more than any bias: in some dwells the unit turned evenly, about the vertical if the accelerometer shows nothing; leave these dwells out", degrees(*.rms))]
    Restless { rms: f64 },
    /// Unit of the noise file, and that of the recording.
    #[error("the noise file belongs to {file:?}, the recording to {recording:?}")]
    NoiseOfAnother { file: String, recording: String },
    /// How many times noisier a channel is within the dwells than the noise file says, and that file.
    #[error("within the dwells the mean over a second is {} times as noisy as in {file}, so the noise within the dwells is used", significant(*.times))]
    NoisierThanFile { times: f64, file: String },
    /// Means without standard deviations.
    #[error(
        "the table has no standard deviations: the scatter about the fit is taken as the noise, and the noise floor is unknown"
    )]
    MeansWithoutNoise,
    /// Means whose noise is taken to be white.
    #[error(
        "the noise of a mean is assumed to be white: the standard deviation over the root of the number of samples. Other noise in the means appears as scatter about the fit"
    )]
    WhiteMeans,
    /// Number of rows of a table that lack the mean of an axis, and of all rows.
    #[error("{missing} of {rows} rows lack the mean of an axis and are not used for it")]
    MeansMissing { missing: usize, rows: usize },
    /// A gyro in a table of means whose only reference is gravity.
    #[error(
        "not calibrated: turns need samples, and this is a table of means; give it dwells at known rates (ref_rate_ columns, reference = \"table\"), or record samples"
    )]
    MeansOfTurns,
    /// Range of temperatures that the model of both sensors or of one lacks, °C.
    #[error("the dwells range from {low_c:.1} to {high_c:.1} °C, but {} does not depend on temperature", words::model(*sensor))]
    WithoutTemperature {
        low_c: f64,
        high_c: f64,
        sensor: Option<Sensor>,
    },
    /// No dwell can be used, for these reasons.
    #[error("no dwell can be used{why}")]
    NoDwell { why: String },
    /// No dwell has a known input, for these reasons.
    #[error("not calibrated: no usable dwell has a known input{why}")]
    NoInput { why: String },
    /// All dwells have one input.
    #[error("not calibrated: all dwells have the same input")]
    OneInput,
    /// Given turns that are assumed to be exact.
    #[error(
        "angle and axis of the given turns are assumed to be exact; no interval includes their errors"
    )]
    ExactTurns,
    /// Position of the accelerometer from the point where the axes of the table meet, mm, body axes, with the halves of 95 % intervals.
    #[error(
        "from the point where the axes of the table meet it is {} mm: its place on the table, which is not stored",
        words::vector(arm_mm, interval_mm)
    )]
    BesideAxis {
        arm_mm: [f64; 3],
        interval_mm: [f64; 3],
    },
    /// The data contradict the prior of the unit's population: the probability that they do, the parameter that has moved most, and by how many standard deviations of the population.
    #[error("the unit is not of the population of the prior ({}: {parameter} {sigmas:+.1} sigmas): the prior is given up for it", p_value(*.p))]
    NotOfPopulation {
        p: f64,
        parameter: String,
        sigmas: f64,
    },
    /// No turn lies between two usable dwells.
    #[error("not calibrated: no turn connects two usable dwells")]
    NoTurn,
    /// A dwell that is not used for the accelerometer: its error, m/s², against what the others predict, and the same in sigmas.
    #[error("dwell {dwell} is not used for the accelerometer: {}, by {sigmas:.0} sigma of that prediction; to use it all the same, keep dwell {dwell}", off(*.error))]
    DwellLeftOut { dwell: i32, error: f64, sigmas: f64 },
    /// A dwell that is kept for the accelerometer though it is suspect: its error, m/s², the parameter that the others hardly determine,
    /// and how many times as wide its interval would be without the dwell.
    #[error("dwell {dwell} is kept for the accelerometer, although {}: {}, so it cannot be tested; repeat its pose", match error.is_finite() { true => off(*error), false => "it is suspect".into() }, open(parameter, *wider))]
    DwellKept {
        dwell: i32,
        error: f64,
        parameter: &'static str,
        wider: f64,
    },
    /// A turn, from dwell to dwell, that is not used: its error, rad, against what the others predict, and the same in sigmas.
    #[error("the turn from dwell {from} to {to} is not used: it ends {} deg from where the other turns predict, {sigmas:.0} sigma of that prediction; to use it all the same, keep dwell {to}", significant(.error.to_degrees()))]
    TurnLeftOut {
        from: i32,
        to: i32,
        error: f64,
        sigmas: f64,
    },
    /// A whole turn, from dwell to dwell, that is no longer than a turn from pose to pose, because the unit was not put back: the number of turns, and how
    /// far off it ended, rad.
    #[error("the {turns:.1} turns from dwell {from} to {to} are not used as whole turns: they end {} deg from where they began; put the unit back as it lay, or state how well it is put back", significant(.off.to_degrees()))]
    NotPutBack {
        from: i32,
        to: i32,
        turns: f64,
        off: f64,
    },
    /// The whole turns together contradict the turns between rests: rms of their errors by the latter, rad, and the probability of that.
    #[error("by the turns between rests, the whole turns end {} deg rms from where they began, which has a probability of {chance:.0e}: the unit was put back elsewhere each time, or the poses are wrong", significant(.off.to_degrees()))]
    WholeTurnsContradict { off: f64, chance: f64 },
    /// Whole turns whose error exceeds the stated placement: the error, rad, and the same in sigmas.
    #[error("the whole turns from dwell {from} to {to} are not used: they end {} deg from where the others predict, {sigmas:.0} sigma; repeat them, and put the unit back as it lay", significant(.off.to_degrees()))]
    WholeTurnLeftOut {
        from: i32,
        to: i32,
        off: f64,
        sigmas: f64,
    },
    /// Whole turns whose number is not the stated one.
    #[error(
        "from dwell {from} to {to} the unit turned {turned:.2} times, not {counted}: the number that the gyro shows is used"
    )]
    Miscounted {
        from: i32,
        to: i32,
        counted: u32,
        turned: f64,
    },
    /// Whole turns whose number the scale factor leaves open.
    #[error(
        "the turns from dwell {from} to {to}, about {turns:.1}, are not used as whole turns: the scale factor is not known well enough to count them; say how many turns each has, or record ten poses as well"
    )]
    WholeTurnsOpen { from: i32, to: i32, turns: f64 },
    /// Whole turns with clipped readings: their axis (0..3), and the rate not to exceed, rad/s.
    #[error("the turns from dwell {from} to {to} reach the end of the range of gyro {axis}: turn more slowly than {} deg/s", significant(.fastest.to_degrees()))]
    WholeTurnClipped {
        from: i32,
        to: i32,
        axis: &'static str,
        fastest: f64,
    },
    /// Whole turns were stated, and none was found.
    #[error(
        "no whole turns were found: turn the unit several times about one axis, put it back where it lay, and let it rest before and after"
    )]
    NoWholeTurn,
    /// The accelerometer is not calibrated, because the poses do not determine it; the gyro takes it as delivered.
    #[error("the poses do not determine the accelerometer, so it is not calibrated: the gyro's frame is that of its readings as delivered, {} deg in doubt", significant(.doubt.to_degrees()))]
    AccelAsDelivered { doubt: f64 },
    /// A turn that is kept though it is suspect: the parameter that the others hardly determine, and how many times as wide its interval
    /// would be without the turn.
    #[error("the turn from dwell {from} to {to} is kept, although it is suspect: {}; repeat it", open(.parameter, *.wider))]
    TurnKept {
        from: i32,
        to: i32,
        parameter: String,
        wider: f64,
    },
    /// A turn that cannot be integrated: by the fault of a channel, or because samples are missing.
    #[error(
        "the turn from dwell {from} to {to} is not used: {}",
        words::turn_fault(fault)
    )]
    TurnNotUsed {
        from: i32,
        to: i32,
        fault: Option<Fault>,
    },
    /// Angle between gravity after a turn and its prediction, rad.
    #[error("after one turn gravity is {:.0} degrees from its predicted direction: samples are missing or clipped, or the gyro's columns are wrong", .angle.to_degrees())]
    WideTurn { angle: f64 },
    /// As many parameters as residuals.
    #[error(
        "there are as many parameters as residuals: neither the model nor the intervals can be judged, and the intervals include only the noise within dwells"
    )]
    NoResiduals,
    /// Hardly more dwells than parameters.
    #[error(
        "there are hardly more dwells than parameters: the data cannot contradict the model, and the intervals include only the noise within dwells"
    )]
    FewResiduals,
    /// Condition of a fit whose parameters are poorly determined.
    #[error(
        "the experiment determines some parameters poorly (condition {condition:.0}); their intervals say which"
    )]
    PoorlyDetermined { condition: f64 },
    /// Axes that form a left-handed triad.
    #[error(
        "the axes are left-handed: one axis of gyro or accelerometer has the wrong sign, or two are exchanged"
    )]
    LeftHanded,
    /// A delay that is not distinguished from a misalignment.
    #[error(
        "a delay of the readings cannot be distinguished from a misalignment and is assumed to be zero: turn in both directions, or at several rates"
    )]
    NoDelay,
    /// Poses that need the turns between them.
    #[error(
        "the poses alone hardly determine it, so the turns between them, as measured by the gyro, are used too"
    )]
    WithTurns,
    /// A given matrix, and whether its intervals are known.
    #[error("the matrix {}", match with_intervals { true => "and its intervals are given; the biases are those of this recording, and the intervals include both uncertainties", false => "is given without intervals, so no interval includes its error; the biases are those of this recording" })]
    MatrixGiven { with_intervals: bool },
    /// Parts of a recording (blocks or not) that cannot be held out, and why the first cannot.
    #[error("{}", words::not_held_out(*blocks, parts, why))]
    NotHeldOut {
        blocks: bool,
        parts: Vec<usize>,
        why: String,
    },
    /// One dwell in so many is held out in place of blocks, and why.
    #[error("one dwell in {one_in} is held out instead of blocks: {why}")]
    Interleaved { one_in: usize, why: Box<Warning> },
    /// Number of parameters that leaving out dwells or turns changes, of all parameters, and the largest changes.
    #[error("{}", words::left_out_changes(*changed, *of, largest))]
    LeftOutChanges {
        changed: usize,
        of: usize,
        largest: Vec<String>,
    },
    /// Errors of the uncalibrated and the calibrated readings, and their unit; whether the latter are held out; their number if they do not
    /// decide.
    #[error("the error of the uncalibrated readings is {} {unit}, that of the calibrated ones {} {unit} {}: {}", significant(errors[0]), significant(errors[1]), if *held_out { "on held-out data" } else { "in sample" }, words::improves(*undecided))]
    NoBetter {
        errors: [f64; 2],
        unit: &'static str,
        held_out: bool,
        undecided: Option<usize>,
    },
    /// Directions without a pose nearby, and the errors there and in the poses, m/s².
    #[error("no pose is near {} up, where the calibration is uncertain by {} mm/s² (one sigma); in the recorded poses it is {} mm/s². Add such poses before you use it there", directions.join(", "), significant(1e3 * worst), significant(1e3 * typical))]
    UnseenPoses {
        directions: Vec<String>,
        worst: f64,
        typical: f64,
    },
    /// Shares of the readings that models without and with temperature leave unexplained, and the mean temperature, °C.
    #[error("a model without temperature leaves {} % of the readings unexplained, one with temperature {} %. The parameters are valid at about {mean_c:.1} °C, the mean of the dwells, and their intervals include the effect of temperature; `mimu diagnose` finds this effect", significant(100.0 * without), significant(100.0 * with))]
    FollowsTemperature {
        without: f64,
        with: f64,
        mean_c: f64,
    },
    /// Dwells, or else turns, that are outliers; the largest error, its unit, and its ratio to the median.
    #[error("{} ({} {}): errors of up to {} {unit}, {times:.0} times the median; look for the cause, because they widen all intervals", plural(names.len() as u64, "outlier"), if *turns { "turn to dwell" } else { "dwell" }, words::few(names), significant(*worst))]
    Outliers {
        turns: bool,
        names: Vec<String>,
        worst: f64,
        unit: &'static str,
        times: f64,
    },
    /// Rates of the turntable, deg/s, and the error of each, as a share of it.
    #[error("{}", words::rate_error(rates_dps, *share))]
    RateError { rates_dps: Vec<f64>, share: f64 },
    /// Rate of the turntable, rad/s, that the other rates contradict, and the share by which the fit moves it.
    #[error("the rates of the turntable contradict each other: by the fit, {} deg/s is {:+.2} % off; check the rates (33 1/3 rpm is 200 deg/s, 45 rpm is 270 deg/s) and their error", significant(.rate.to_degrees()), 100.0 * .off)]
    RatesContradict { rate: f64, off: f64 },
    /// Why the rests on a turntable do not calibrate the accelerometer.
    #[error(
        "not calibrated, because the dwells at rest do not determine it ({why}); at the rates of the turntable it also senses an unknown centripetal force"
    )]
    NoRestsToFit { why: String },
    /// Angle between the axes and those that they are referred to, rad, and whether these are the table's.
    #[error("its axes are rotated by {:.0} degrees relative to {}: unless it is mounted so, columns are swapped or have the wrong sign", angle.to_degrees(), if *to_table { "those of the ref_ columns" } else { "the accelerometer's" })]
    Turned { angle: f64, to_table: bool },
    /// Angle by which the dwells appear to be off level, rad rms.
    #[error("the errors are perpendicular to the known force, as if the dwells were off level by {} deg rms: level the faces, or use only the magnitude of gravity (reference = \"gravity\")", degrees(*.angle))]
    OffLevel { angle: f64 },
    /// Numbers of the calibration's unit and of the recording's.
    #[error("the calibration belongs to unit {calibration}, the recording to unit {recording}")]
    OtherUnit {
        calibration: String,
        recording: String,
    },
    /// Names of the calibration's unit and of the recording's.
    #[error("the calibration belongs to {calibration:?}, the recording to {recording:?}")]
    OtherDevice {
        calibration: String,
        recording: String,
    },
    /// Whether the calibration and the recording name no unit.
    #[error("{}, so they are taken to belong to one; to have this checked, give each import the name of its unit", words::unnamed(*unnamed))]
    UnnamedUnit { unnamed: [bool; 2] },
    /// The calibration was made from the recording.
    #[error("the calibration was made from this recording: the figures say nothing about new data")]
    SameRecording,
    /// Samples outside the temperatures of the calibration, of so many; the range, °C; the farthest, K; whether there are curves, and
    /// how far they reach beyond it, K.
    #[error("{} of {} samples are outside the {:.1} to {:.1} °C that the calibration was made from, by up to {farthest_k:.1} K: {}", samples[0], samples[1], range_c[0], range_c[1], words::beyond(*beyond_k))]
    OutOfRange {
        samples: [u64; 2],
        range_c: [f64; 2],
        farthest_k: f64,
        beyond_k: Option<f64>,
    },
    /// A recording without temperature, and a calibration with curves.
    #[error(
        "the recording has no temp_c: the calibration's model at one temperature is used instead of its curves"
    )]
    NoTemperature,
    /// The recording has nothing to judge a sensor by.
    #[error("the recording has no data to judge it")]
    NothingToJudge,
    /// Worse than the uncalibrated readings, or else than their mean scale factor and bias.
    #[error("worse than with {}: is it the calibration of this unit{}?", words::without(*readings_in_si), if *readings_in_si { "" } else { ", in this state" })]
    Worse { readings_in_si: bool },
    /// The errors do not show whether the calibration is better. Their number; whether they are of turns (else of dwells); what they are compared with, as
    /// in [`Self::Worse`].
    #[error("{} do not show whether it is better than {}: record more", plural(*errors, if *turns { "turn" } else { "dwell" }), words::without(*readings_in_si))]
    Undecided {
        errors: u64,
        turns: bool,
        readings_in_si: bool,
    },
    /// A calibration that lacks a sensor of the recording.
    #[error("the calibration is not for the {sensor}: its columns are left out")]
    NotCalibrated { sensor: Sensor },
    /// A calibration that lacks a further triad of the recording.
    #[error("the calibration is not for {triad}: its columns are left out")]
    TriadNotCalibrated { triad: TriadName },
    /// A calibration whose uncertainty is not known.
    #[error(
        "the calibration has no uncertainty, like one that was read from a device. Its matrix is taken as exact: an error of it may be found as an effect, and the intervals of a new calibration do not include it"
    )]
    Uncertain,
    /// A recording that cannot judge the calibration, with its name if there are several, and why.
    #[error("{}{why}", match recording { Some(recording) => format!("{recording} cannot judge the calibration: "), None => String::new() })]
    NotJudged {
        recording: Option<String>,
        why: Error,
    },
    /// An effect of the given calibration that is missing in the new one, because its sensor is not recorded.
    #[error(
        "{effect} of the calibration is missing in the new one, because the {sensor} was not recorded"
    )]
    EffectLost { effect: String, sensor: Sensor },
    /// Frequencies of the lines of a spectrum, Hz.
    #[error("lines of the spectrum at {} Hz are not noise of the sensor, and B, K, Q and R contain what they add to the curve: record where the source (a building, a fan, the mains) does not reach", hz.iter().map(|f| significant(*f)).collect::<Vec<_>>().join(", "))]
    Lines { hz: Vec<f64> },
    /// Range of the temperature that a channel follows, °C, and the correlation.
    #[error("follows temp_c, which changes by {} °C (correlation {correlation:.2}): the long end of its curve shows temperature, not the sensor's noise", significant(*.span_c))]
    FollowsChamber { span_c: f64, correlation: f64 },
    /// Share of a drift in the variance at an averaging time, s.
    #[error("a drift makes {:.0} % of the variance at {}: the long end of its curve shows warm-up or the chamber, not noise", 100.0 * .share, duration(*.longest_s))]
    Drifts { share: f64, longest_s: f64 },
    /// First data row with an empty cell; length of the segment that is used, s, and its first data row.
    #[error("empty cells, the first in data row {row}; the longest segment without any is used: {} from data row {from_row}", duration(*.length_s))]
    EmptyCells {
        row: usize,
        length_s: f64,
        from_row: usize,
    },
    /// Samples that are masked, their share, and the instant of the first, s.
    #[error("{}, {} % of the time, are disturbed, first at {first_s:.1} s: masked", plural(*.samples, "sample"), significant(100.0 * .share))]
    Disturbed {
        samples: u64,
        share: f64,
        first_s: f64,
    },
    /// Windows in which the unit moves, of so many; their length, s; the first instant, s, and the channel.
    #[error("{}", words::moves(*windows, *window_s, *first_s, channel))]
    Moves {
        windows: [usize; 2],
        window_s: f64,
        first_s: f64,
        channel: &'static str,
    },
    /// Share of the samples that are one of two codes.
    #[error("{:.0} % of the samples are one of two neighbouring codes: the step is several times the noise, and the curve shows the rounding as much as the sensor (B may be wrong by a third); record with a smaller range or more bits", 100.0 * .share)]
    CoarseReadings { share: f64 },
    /// Gaps, or runs of empty cells, the number of samples in them, and their share.
    #[error("{} with {}, {:.2} % of all, bridged with the noise before each", plural(*.gaps, "gap"), plural(*.samples as u64, "lost sample"), 100.0 * .share)]
    Bridged {
        gaps: u64,
        samples: usize,
        share: f64,
    },
    /// Gaps, the first one, s, and the data row after it; length of the segment that is used, s, and its beginning, s.
    #[error("{}, the first of {} before data row {row}; the longest segment without one that cannot be bridged is used: {} from {from_s:.3} s", plural(*.gaps, "gap"), duration(*.first_s), duration(*.length_s))]
    LongestStretch {
        gaps: u64,
        first_s: f64,
        row: usize,
        length_s: f64,
        from_s: f64,
    },
}

impl Warning {
    /// This warning, about `sensor`.
    pub(crate) fn of(self, sensor: Sensor) -> Self {
        Self::Of(sensor, Box::new(self))
    }

    /// Its name: that of the variant, in small letters. Scripts rely on it, but not on the sentence.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Of(_, warning) | Self::Channel(_, warning) | Self::In(_, warning) => {
                warning.kind()
            }
            Self::Reading(warning) => warning.kind(),
            Self::Health(finding) => finding.kind(),
            _ => self.into(),
        }
    }

    /// The sensor or the channel that it is about.
    pub fn about(&self) -> Option<&'static str> {
        match self {
            Self::Of(sensor, _) => Some(sensor.name()),
            Self::Channel(channel, _) => Some(channel),
            Self::In(_, warning) => warning.about(),
            Self::Health(finding) => finding.about,
            _ => None,
        }
    }

    /// A warning if gravity, m/s², is impossible at the latitude, degrees. Nothing in a recording shows which of the two is wrong: the
    /// scale factors of an accelerometer calibrated by gravity are proportional to it, and the residuals do not change. A wrong latitude
    /// also changes the Earth's rate, but by less than the bias wander of a gyro.
    pub fn of_gravity(gravity_mps2: f64, latitude_deg: f64) -> Option<Self> {
        let off = gravity_mps2 - normal_gravity(latitude_deg);
        let [least, most] = GRAVITY_OFF_MPS2;
        (off < least || off > most).then_some(Self::Gravity {
            gravity_mps2,
            latitude_deg,
        })
    }

    /// A warning if no inertial unit is sampled at `rate_hz`: the time stamps are then in another unit. A log over temperature may have a
    /// sample a minute, but it is neither integrated nor judged by its noise.
    pub fn of_rate(rate_hz: f64) -> Option<Self> {
        (!RATES_HZ.contains(&rate_hz)).then_some(Self::ImplausibleRate { rate_hz })
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
            (Self::Health(one), Self::Health(other)) => {
                let of_channel = |found: &Finding| {
                    found
                        .about
                        .is_some_and(|about| RAW_COLUMNS.contains(&about))
                };
                let alike = one.about == other.about || of_channel(one) && of_channel(other);
                alike && one.kind() == other.kind()
            }
            (
                Self::DwellsNotUsed {
                    fault: f,
                    sensor: s,
                    ..
                },
                Self::DwellsNotUsed {
                    fault: g,
                    sensor: t,
                    ..
                },
            ) => s == t && discriminant(f) == discriminant(g),
            _ => true,
        }
    }

    /// Whether it says that a prior is given up.
    pub fn gives_prior_up(&self) -> bool {
        match self {
            Self::Of(_, warning) => warning.gives_prior_up(),
            other => matches!(other, Self::NotOfPopulation { .. }),
        }
    }

    /// If the warning is about a dwell or turn that was left out: the dwell to keep, so that it is used.
    pub fn left_out(&self) -> Option<i32> {
        match self {
            Self::DwellLeftOut { dwell: step, .. } | Self::TurnLeftOut { to: step, .. } => {
                Some(*step)
            }
            _ => None,
        }
    }
}

impl Serialize for Warning {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        as_data(self.kind(), self.about(), self, serializer)
    }
}

/// A warning as JSON has it: its kind, the sensor or channel that it is about, and the sentence.
///
/// # Errors
/// Those of `serializer`.
pub fn as_data<S: Serializer>(
    kind: &str,
    about: Option<&str>,
    text: &dyn Display,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let mut data = serializer.serialize_struct("Warning", 3)?;
    data.serialize_field("kind", kind)?;
    match about {
        Some(about) => data.serialize_field("about", about)?,
        None => data.skip_field("about")?,
    }
    data.serialize_field("text", &format!("{text}"))?;
    data.end()
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
