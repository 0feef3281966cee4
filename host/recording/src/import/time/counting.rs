//! Stamps that count samples instead of time.
//!
//! A packet counter rises by 1 from sample to sample and by more where samples were lost. Taken as milliseconds, a counter with a third of its samples
//! lost is a plausible clock of 667 Hz, so whole numbers with steps of 1 are examined before their unit is.

use super::super::decimal::Decimal;
use super::super::names::{Meaning, is_number, meaning};
use super::super::unit_names::clock_unit_behind;
use super::gap::quantile;
use super::stamp::{Seen, Unit};
use super::stamps::Stamps;

/// Least share of steps of 1. Of random losses this leaves out only those of more than nineteen samples in twenty.
const SINGLE: f64 = 0.05;
/// Rows over which increments are compared. Those of a clock with jitter scatter alike over both; those of a counter with random losses scatter more by
/// the root of their ratio, 2.
const LAGS: [usize; 2] = [16, 64];
const WALKS: f64 = 1.5;
/// Least width of the middle half of the increments over the shorter lag, in counts. Rounding alone gives 1.
const WIDTH: f64 = 2.0;
/// A given rate this close to that of a clock confirms the clock; one that differs by more than the second factor contradicts it.
const CONFIRMS: f64 = 1.03;
const CONTRADICTS: f64 = 1.3;

/// What stamps count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Counting {
    /// Time.
    Clock,
    /// Samples.
    Samples,
    /// One of the two.
    Either,
}

impl Counting {
    /// What `stamps`, described by `seen`, count. Their values, the name of their column and a known rate decide.
    pub fn of(stamps: &Stamps, seen: &Seen<'_>) -> Counting {
        let named = seen.name.map_or(Named::Nothing, Named::of);
        if named == Named::Unit || Unit::of_epoch(seen).is_some() || !rises_by_ones(stamps) {
            return Counting::Clock;
        }
        if named == Named::Counter {
            return Counting::Samples;
        }
        if let Some(rate_hz) = seen.rate_hz {
            return by_rate(seen.interval, rate_hz);
        }
        match named == Named::Nothing && walks(&stamps.since_first) {
            true => Counting::Either,
            false => Counting::Clock,
        }
    }
}

/// What the name of a column says about its numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Named {
    Unit,
    Time,
    Counter,
    Nothing,
}

impl Named {
    fn of(name: &str) -> Named {
        match meaning(name) {
            _ if clock_unit_behind(name).is_some() => Named::Unit,
            // A lone t may be short for anything.
            Meaning::Time if name.len() > 2 => Named::Time,
            _ if is_number(name) => Named::Counter,
            _ => Named::Nothing,
        }
    }
}

/// Whether all stamps are whole numbers, and enough of their steps are 1.
fn rises_by_ones(stamps: &Stamps) -> bool {
    let whole = |value: f64| value.fract() == 0.0;
    if !whole(stamps.first.value) || !stamps.since_first.iter().all(|since| whole(*since)) {
        return false;
    }
    let steps = stamps.since_first.windows(2).map(|pair| pair[1] - pair[0]);
    let (mut rising, mut single) = (0.0, 0.0);
    for step in steps.filter(|step| *step > 0.0) {
        rising += 1.0;
        single += f64::from(u8::from(step == 1.0));
    }
    single > SINGLE * rising
}

/// What a given rate says about stamps that are `interval` apart on average and 1 apart at least.
fn by_rate(interval: f64, rate_hz: f64) -> Counting {
    let units = [Decimal::Second, Decimal::Millisecond].map(|unit| unit.per_second() as f64);
    let rates = units.into_iter().flat_map(|unit| [unit, unit / interval]);
    let off = rates
        .map(|rate| (rate / rate_hz).ln().abs())
        .fold(f64::INFINITY, f64::min);
    match off.exp() {
        ..CONFIRMS => Counting::Clock,
        CONTRADICTS.. => Counting::Samples,
        _ => Counting::Either,
    }
}

/// Whether the increments over many rows scatter like a random walk.
fn walks(since_first: &[f64]) -> bool {
    let width = |lag: usize| {
        let ends = since_first.iter().zip(since_first.iter().skip(lag));
        let mut all: Vec<f64> = ends.map(|(a, b)| b - a).collect();
        match all.is_empty() {
            true => 0.0,
            false => quantile(&mut all, 0.75) - quantile(&mut all, 0.25),
        }
    };
    let [short, long] = LAGS.map(width);
    short >= WIDTH && long > WALKS * short
}

#[cfg(test)]
mod tests {
    use super::super::stamp::Stamp;
    use super::*;

    fn seen(stamps: &Stamps, rate_hz: Option<f64>, name: Option<&'static str>) -> Seen<'static> {
        let lasts = stamps.since_first[stamps.since_first.len() - 1];
        Seen {
            first: stamps.first.value,
            interval: lasts / (stamps.since_first.len() - 1) as f64,
            lasts,
            rate_hz,
            name,
        }
    }

    fn from(first: f64, since_first: Vec<f64>) -> Stamps {
        Stamps {
            first: Stamp::from(first),
            since_first,
            ..Stamps::default()
        }
    }

    /// Numbers of a counter of which a third is lost at random, by a linear congruence.
    fn lossy() -> Stamps {
        let mut state = 12_345_u64;
        let mut kept = |_: &u64| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            !(state >> 33).is_multiple_of(3)
        };
        let numbers: Vec<u64> = (0..9000).filter(|n| kept(n)).collect();
        from(
            1207.0,
            numbers.iter().map(|n| (n - numbers[0]) as f64).collect(),
        )
    }

    #[test]
    fn a_counter_with_losses_is_distinguished_from_clocks_in_milliseconds() {
        let counter = lossy();
        let of =
            |stamps: &Stamps, rate_hz, name| Counting::of(stamps, &seen(stamps, rate_hz, name));
        assert_eq!(of(&counter, None, None), Counting::Either);
        assert_eq!(of(&counter, None, Some("Packet number")), Counting::Samples);
        assert_eq!(of(&counter, None, Some("PacketCounter")), Counting::Samples);
        assert_eq!(of(&counter, None, Some("time_ms")), Counting::Clock);
        assert_eq!(of(&counter, Some(100.0), None), Counting::Samples);
        // 667 Hz on average if it counts milliseconds.
        assert_eq!(of(&counter, Some(667.0), None), Counting::Clock);
        assert_eq!(of(&counter, Some(600.0), None), Counting::Either);
        // Sensors at 600 and 1000 Hz, stamped in ms; the second is stamped up to 3 ms late.
        let regular = from(
            50.0,
            (0..3000).map(|i| (f64::from(i) / 0.6).floor()).collect(),
        );
        assert_eq!(of(&regular, None, None), Counting::Clock);
        assert_eq!(of(&regular, Some(600.0), None), Counting::Clock);
        let late = (0..3000).map(|i| f64::from(i + (7 * i * i) % 4)).collect();
        assert_eq!(of(&from(50.0, late), None, None), Counting::Clock);
        // Seconds since 1970.
        let epoch = from(1.7e9, (0..3000).map(f64::from).collect());
        assert_eq!(of(&epoch, Some(100.0), None), Counting::Clock);
        let halves = from(0.5, (0..3000).map(f64::from).collect());
        assert_eq!(of(&halves, Some(100.0), None), Counting::Clock);
    }
}
