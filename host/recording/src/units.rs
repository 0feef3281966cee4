//! Units of readings, by physics: the magnitude of gravity at rest, and how fast gravity turns compared with what the gyro reads.
//!
//! The name of a column may be wrong or missing, but gravity is 9.8 m/s², 1 g or 1000 mg, and a turn moves it by the angle that the gyro has
//! to read. Between rad/s, deg/s and mdeg/s lie factors of 57 and 1000, so a rough ratio decides.

use std::ops::Range;

use serde::Serialize;

use crate::health::LARGEST_BIAS;

/// Length of the blocks between which gravity turns, s: a hand turns by 3 to 30 degrees in it.
const BLOCK_S: f64 = 0.25;
/// Least and largest angle between the forces of successive blocks, rad. Below it noise decides, above it the axis of the turn changes within it.
const ANGLES: Range<f64> = 0.1..1.0;
/// Largest such angle of a rest, rad.
const REST: f64 = 0.02;
/// Largest share by which a force may differ from gravity in a turn that is used: a hand also accelerates.
const ACCELERATED: f64 = 0.15;
/// Fewest turned blocks that decide.
const FEWEST: usize = 5;
/// Largest ratio of a unit's turns to those of gravity, and inverse of the smallest. Analog gyros in volts begin at a factor of 1.9.
const TURNS_WITHIN: f64 = 1.5;
/// Standard gravity, for g, mg and µg, m/s².
pub const STANDARD_GRAVITY: f64 = 9.80665;
/// Gravity in each unit of an accelerometer, to within offsets of 0.15 g.
const GRAVITY: [(&str, f64); 3] = [("m/s²", STANDARD_GRAVITY), ("g", 1.0), ("mg", 1000.0)];
const OFF_GRAVITY: f64 = 0.15;
/// Units of a gyro, rad/s.
const RATES: [(&str, f64); 3] = [
    ("rad/s", 1.0),
    ("deg/s", std::f64::consts::PI / 180.0),
    ("mdeg/s", std::f64::consts::PI / 180_000.0),
];
/// Share of a recording in which a unit rests at least. Of one that is turned ten times about each axis it is a sixth.
const RESTS: f64 = 0.03;
/// Counts for 1 deg/s of common gyros of 16 bits: TDK, Bosch and Analog Devices have 131 and its halves, ST 1 over 4.375 mdeg/s and its halves, the ITG-3200 14.375.
const SENSITIVITIES: [f64; 13] = [
    262.4, 228.6, 131.0, 114.3, 65.5, 57.14, 32.8, 28.57, 16.4, 14.375, 14.29, 8.2, 7.14,
];
/// Largest error of the counts for 1 deg/s by the turns of gravity, as a share: it took 65.5 for 59.8.
const ROUGHLY: f64 = 0.12;
/// Readings of a converter.
const COUNTS: &str = "count";

/// Readings of a triad.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Series {
    /// Times, s; empty if they are not known.
    pub t_s: Vec<f64>,
    /// Readings, one for each time.
    pub readings: Vec<[f64; 3]>,
}

/// The unit of the readings of a sensor.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct UnitFound {
    /// `m/s²`, `g`, `mg`, `rad/s`, `deg/s`, `mdeg/s` or `count`; `None` if the readings allow several, so that a person has to say.
    pub unit: Option<&'static str>,
    /// The evidence in a sentence, without a full stop.
    pub reason: String,
    /// Usual magnitude of an accelerometer's readings.
    #[serde(skip)]
    pub size: Option<f64>,
}

impl UnitFound {
    fn new(unit: Option<&'static str>, reason: String) -> Self {
        Self {
            unit,
            reason,
            size: None,
        }
    }
}

fn norm(v: &[f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// The median of the finite values; of an even number of them, the larger of the two in the middle. `None` without any.
pub fn median(values: Vec<f64>) -> Option<f64> {
    quantile(values, 0.5)
}

fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.retain(|v| v.is_finite());
    let at = (share * values.len() as f64) as usize;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(at, f64::total_cmp).1)
}

fn is_whole(series: &Series) -> bool {
    let mut finite = series.readings.iter().flatten().filter(|x| x.is_finite());
    finite.all(|x| x.fract() == 0.0)
}

/// A number for people: three digits.
fn shown(x: f64) -> String {
    let digits = (2.0 - x.abs().log10().floor()).clamp(0.0, 9.0);
    format!("{x:.*}", digits as usize)
}

/// Unit of an accelerometer; `named`: the unit in the names of its columns.
///
/// The median magnitude of its readings is gravity, because a unit rests most of the time, and a hand accelerates it in all directions.
pub fn accel_unit(accel: &Series, named: Option<&'static str>) -> UnitFound {
    let size = median(accel.readings.iter().map(norm).collect());
    UnitFound {
        size,
        ..of_size(accel, size, named)
    }
}

fn of_size(accel: &Series, size: Option<f64>, named: Option<&'static str>) -> UnitFound {
    let Some(size) = size else {
        return UnitFound::new(named, "there are no readings".into());
    };
    let near = |gravity: f64| (size / gravity - 1.0).abs() < OFF_GRAVITY;
    let by_size = GRAVITY.iter().find(|(_, gravity)| near(*gravity));
    let whole = is_whole(accel);
    let kind = if whole {
        "a whole number"
    } else {
        "a fraction"
    };
    let seen = format!("the usual magnitude of specific force is {}", shown(size));
    match (by_size, named) {
        // Converters with 1024 counts for 1 g exist.
        (Some(("mg", _)), None) if whole => UnitFound::new(
            None,
            format!("{seen}, in whole numbers: mg, or counts of which 1 g is about 1000"),
        ),
        (Some((unit, _)), Some(name)) if *unit != name => UnitFound::new(
            Some(unit),
            format!("{seen}, so the unit is {unit}, although the names contain {name}"),
        ),
        (Some((unit, _)), _) => UnitFound::new(Some(unit), seen),
        (None, None) if whole => UnitFound::new(Some(COUNTS), format!("{seen}, in whole numbers")),
        (None, Some(name)) => UnitFound::new(
            whole.then_some(COUNTS),
            format!("{seen}, {kind}, which is not gravity in {name}, the unit in the names"),
        ),
        (None, None) => UnitFound::new(
            None,
            format!("{seen}, {kind}, which is gravity in none of m/s², g and mg"),
        ),
    }
}

/// Unit of a gyro, by the turns of gravity in the readings of the accelerometer if there are any; `named`: the unit in the names of its columns.
pub fn gyro_unit(gyro: &Series, accel: &Series, named: Option<&'static str>) -> UnitFound {
    let whole = is_whole(gyro);
    let rest = quantile(gyro.readings.iter().map(norm).collect(), RESTS);
    let Some(rest) = rest else {
        return UnitFound::new(named, "there are no readings".into());
    };
    let may_rest = |per: f64| rest * per < LARGEST_BIAS;
    let ratio = rad_per_reading(gyro, accel);
    let by_turns = ratio.and_then(|ratio| {
        let fits = |per: &f64| (TURNS_WITHIN.recip()..TURNS_WITHIN).contains(&(ratio / per));
        RATES.iter().find(|(_, per)| fits(per) && may_rest(*per))
    });
    match (by_turns, ratio) {
        // Some converters have about 1000 counts for 1 deg/s.
        (Some(("mdeg/s", _)), _) if whole && named.is_none() => UnitFound::new(
            None,
            "gravity turns as the gyro reads in mdeg/s, in whole numbers: mdeg/s, or counts".into(),
        ),
        (Some((unit, _)), _) => {
            let but = match named {
                Some(name) if name != *unit => format!(", although the names contain {name}"),
                _ => String::new(),
            };
            let reason = format!("gravity turns as the gyro reads in {unit}{but}");
            UnitFound::new(Some(unit), reason)
        }
        (None, Some(ratio)) => {
            if whole && named.is_none() {
                let per_dps = 1f64.to_radians() / ratio;
                let near = SENSITIVITIES.into_iter();
                let near = near.filter(|per| (per / per_dps - 1.0).abs() < ROUGHLY);
                let near: Vec<String> = near.map(|per| per.to_string()).collect();
                let data_sheets = match near.is_empty() {
                    true => String::new(),
                    false => format!("; data sheets have {}", near.join(" and ")),
                };
                let reason = format!(
                    "whole numbers, about {} for 1 deg/s by its turns{data_sheets}",
                    shown(per_dps)
                );
                return UnitFound::new(Some(COUNTS), reason);
            }
            let of = |unit: &str| RATES.iter().find(|(name, _)| *name == unit);
            let reason = match named.and_then(of) {
                Some((name, per)) => format!(
                    "gravity turns {} times as fast as the gyro reads in {name}, the unit in the names: its range, or the time stamps, are wrong by this factor",
                    shown(ratio / per)
                ),
                None => format!(
                    "a unit of its readings is {} deg/s by how gravity turns, which is none of rad/s, deg/s and mdeg/s",
                    shown(ratio.to_degrees())
                ),
            };
            UnitFound::new(whole.then_some(COUNTS), reason)
        }
        (None, None) => at_rest(whole, rest, named),
    }
}

/// Unit of a gyro whose readings show no turn; `rest`: the magnitude that they have or exceed but for [`RESTS`] of them.
fn at_rest(whole: bool, rest: f64, named: Option<&'static str>) -> UnitFound {
    let per = |unit: &str| RATES.iter().find(|(name, _)| *name == unit);
    let plausible = |unit: &&str| per(unit).is_some_and(|(_, per)| rest * per < LARGEST_BIAS);
    match named {
        Some(unit) if plausible(&unit) => {
            UnitFound::new(Some(unit), "by the names alone: no turn shows it".into())
        }
        Some(unit) => UnitFound::new(
            whole.then_some(COUNTS),
            format!(
                "the gyro always reads about {} or more, too much for a bias in {unit}, the unit in the names",
                shown(rest)
            ),
        ),
        None if whole => UnitFound::new(Some(COUNTS), "its readings are whole numbers".into()),
        None => UnitFound::new(
            None,
            "its readings are fractions, and no turn shows whether they are rad/s or deg/s".into(),
        ),
    }
}

/// Means over a block.
struct Block {
    t_s: f64,
    rate: [f64; 3],
    force: [f64; 3],
}

/// How fast gravity turns, rad/s, over what the gyro reads: the median over all blocks in which gravity turns. `None` if too few do, or if they differ by
/// more than units do.
///
/// Over a short time `Δf = -(ω × f) Δt` for the direction f of gravity (Poisson's equation); the magnitudes of both sides do not depend on the
/// direction of the axes, if the two triads have the same ones.
pub fn rad_per_reading(gyro: &Series, accel: &Series) -> Option<f64> {
    let blocks = blocks(gyro, accel);
    let gravity = median(blocks.iter().map(|b| norm(&b.force)).collect())?;
    let mut turns = Vec::new();
    let mut rests = Vec::new();
    for pair in blocks.windows(2) {
        let [a, b] = pair else { continue };
        let dt_s = b.t_s - a.t_s;
        let still = |block: &Block| (norm(&block.force) / gravity - 1.0).abs() < ACCELERATED;
        if !(dt_s < 1.5 * BLOCK_S && still(a) && still(b)) {
            continue;
        }
        let unit = |f: &[f64; 3]| f.map(|x| x / norm(f));
        let [from, to] = [unit(&a.force), unit(&b.force)];
        let angle = 2.0 * (0.5 * norm(&[0, 1, 2].map(|i| to[i] - from[i]))).asin();
        let rate = [0, 1, 2].map(|i| 0.5 * (a.rate[i] + b.rate[i]));
        if angle < REST {
            rests.push(rate);
        } else if ANGLES.contains(&angle) {
            turns.push((
                rate,
                unit(&[0, 1, 2].map(|i| from[i] + to[i])),
                angle / dt_s,
            ));
        }
    }
    let bias = [0, 1, 2].map(|i| median(rests.iter().map(|rate| rate[i]).collect()).unwrap_or(0.0));
    let ratios = turns.iter().map(|(rate, up, turned)| {
        let rate = [0, 1, 2].map(|i| rate[i] - bias[i]);
        let across = [(1, 2), (2, 0), (0, 1)].map(|(j, k)| rate[j] * up[k] - rate[k] * up[j]);
        turned / norm(&across)
    });
    let ratios = ratios.filter(|ratio| ratio.is_finite());
    let mut ratios: Vec<f64> = ratios.collect();
    if ratios.len() < FEWEST {
        return None;
    }
    ratios.sort_by(f64::total_cmp);
    let quarter = ratios.len() / 4;
    let [low, high] = [ratios[quarter], ratios[ratios.len() - 1 - quarter]];
    (high < 3.0 * low).then(|| ratios[ratios.len() / 2])
}

/// Means of both triads over blocks in which each has a sample.
fn blocks(gyro: &Series, accel: &Series) -> Vec<Block> {
    let timed = |s: &Series| s.t_s.len() == s.readings.len() && s.t_s.is_sorted();
    let (Some(first), true) = (gyro.t_s.first(), timed(gyro) && timed(accel)) else {
        return Vec::new();
    };
    let mut all = Vec::new();
    let (mut g, mut a) = (0, 0);
    let last = *gyro.t_s.last().unwrap_or(first);
    let (mut from, count) = (*first, ((last - first) / BLOCK_S).min(1e6) as usize);
    for _ in 0..count {
        let to = from + BLOCK_S;
        let means = [mean(gyro, &mut g, from..to), mean(accel, &mut a, from..to)];
        if let [Some(rate), Some(force)] = means {
            let t_s = from + 0.5 * BLOCK_S;
            all.push(Block { t_s, rate, force });
        }
        from = to;
    }
    all
}

/// Mean of the readings in `span`, from the one at `next` on, which is moved behind them.
fn mean(series: &Series, next: &mut usize, span: Range<f64>) -> Option<[f64; 3]> {
    let (mut sum, mut n) = ([0.0; 3], 0.0);
    while let Some(t) = series.t_s.get(*next)
        && *t < span.end
    {
        let reading = &series.readings[*next];
        if *t >= span.start && reading.iter().all(|x| x.is_finite()) {
            (0..3).for_each(|i| sum[i] += reading[i]);
            n += 1.0;
        }
        *next += 1;
    }
    (n > 0.0).then(|| sum.map(|s| s / n))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit that is turned by 90 degrees about x and y in turn, with rests between, 100 Hz: rates in rad/s and forces in g, by rotating gravity
    /// step by step.
    fn session() -> [Series; 2] {
        let (mut gyro, mut accel) = (Series::default(), Series::default());
        let mut up = [0.0, 0.0, 1.0];
        for k in 0..4000 {
            let at = k % 400;
            let rate = match (k / 400) % 2 {
                _ if at < 300 => [0.0; 3],
                0 => [std::f64::consts::FRAC_PI_2, 0.3, 0.0],
                _ => [0.0, std::f64::consts::FRAC_PI_2, -0.2],
            };
            // df/dt = -ω × f, in steps of a hundredth of a second.
            let cross = [(1, 2), (2, 0), (0, 1)].map(|(j, k)| rate[j] * up[k] - rate[k] * up[j]);
            (0..3).for_each(|i| up[i] -= 0.01 * cross[i]);
            let length = norm(&up);
            up = up.map(|x| x / length);
            let noise = |scale: f64, i: usize| scale * (((k * 7 + i * 13) % 11) as f64 - 5.0);
            gyro.t_s.push(0.01 * k as f64);
            accel.t_s.push(0.01 * k as f64);
            gyro.readings
                .push([0, 1, 2].map(|i| rate[i] + 0.02 + noise(3e-4, i)));
            accel
                .readings
                .push([0, 1, 2].map(|i| up[i] + noise(4e-4, i)));
        }
        [gyro, accel]
    }

    fn scaled(series: &Series, by: f64, round: bool) -> Series {
        let one = |x: f64| if round { (x * by).round() } else { x * by };
        Series {
            t_s: series.t_s.clone(),
            readings: series.readings.iter().map(|r| r.map(one)).collect(),
        }
    }

    #[test]
    fn turns_of_gravity_give_the_unit_of_the_gyro_whatever_that_of_the_accelerometer() {
        let [gyro, accel] = session();
        for g in [9.80665, 1.0, 1000.0, 16384.0] {
            let accel = scaled(&accel, g, g > 2000.0);
            for (unit, per) in RATES {
                let gyro = scaled(&gyro, per.recip(), false);
                assert_eq!(gyro_unit(&gyro, &accel, None).unit, Some(unit), "{g}");
                let wrong = gyro_unit(&gyro, &accel, Some("bananas/s"));
                assert_eq!(wrong.unit, Some(unit));
                assert!(wrong.reason.contains("bananas"));
            }
        }
    }

    #[test]
    fn whole_numbers_are_counts_unless_gravity_turns_as_they_say() {
        let [gyro, accel] = session();
        // 131 and 16.4 counts for 1 deg/s, and 16384 for 1 g.
        for per_dps in [131.0, 16.4] {
            let counts = scaled(&gyro, per_dps * 1f64.to_degrees(), true);
            let accel = scaled(&accel, 16384.0, true);
            assert_eq!(gyro_unit(&counts, &accel, None).unit, Some("count"));
            assert_eq!(
                gyro_unit(&counts, &accel, Some("deg/s")).unit,
                Some("count")
            );
            assert_eq!(accel_unit(&accel, Some("g")).unit, Some("count"));
        }
        let milli = scaled(&gyro, 1e3 * 1f64.to_degrees(), true);
        assert_eq!(gyro_unit(&milli, &accel, None).unit, None);
        assert_eq!(
            gyro_unit(&milli, &accel, Some("mdeg/s")).unit,
            Some("mdeg/s")
        );
    }

    #[test]
    fn gravity_gives_the_unit_of_the_accelerometer_against_a_wrong_name() {
        let [_, accel] = session();
        for (unit, g) in GRAVITY {
            let accel = scaled(&accel, 1.07 * g, false);
            assert_eq!(accel_unit(&accel, None).unit, Some(unit));
            assert_eq!(accel_unit(&accel, Some("V")).unit, Some(unit));
        }
        assert_eq!(accel_unit(&scaled(&accel, 1000.0, true), None).unit, None);
        assert_eq!(accel_unit(&scaled(&accel, 2.9, false), None).unit, None);
    }

    #[test]
    fn a_gyro_that_rests_is_asked_about_unless_its_readings_are_whole() {
        let [gyro, accel] = session();
        let rest = |s: &Series| Series {
            t_s: s.t_s[..300].to_vec(),
            readings: s.readings[..300].to_vec(),
        };
        let [gyro, accel] = [rest(&gyro), rest(&accel)];
        assert_eq!(gyro_unit(&gyro, &accel, None).unit, None);
        assert_eq!(gyro_unit(&gyro, &accel, Some("deg/s")).unit, Some("deg/s"));
        // 0.035 · 100 rad/s at rest is no bias.
        let large = scaled(&gyro, 100.0, false);
        assert_eq!(gyro_unit(&large, &accel, Some("rad/s")).unit, None);
        let counts = scaled(&gyro, 7505.7, true);
        assert_eq!(gyro_unit(&counts, &accel, None).unit, Some("count"));
    }
}
