//! The thermometer: the gyros' TEMP pins, some of which may be faulty.
//!
//! The offset of each pin to the others is learnt while it is used, because their references differ by up to 12 °C. The common temperature
//! is the mean of the pins minus these offsets, so losing a pin makes no step. The offsets are stored with a calibration, so a pin that is
//! open at power-on makes no error either.
//!
//! A pin is used while it is in the range of a working gyro, agrees with another pin, does not jump faster than a die can, and keeps its
//! offset to the others. A pin that was left out is used again when it has returned to its offset. If all pins are left out at once, the
//! last good temperature is used, until a reading is one that the dies may have reached since.

use crate::design_parameters::{
    GYRO_TEMPERATURE_BEGINNING_S, GYRO_TEMPERATURE_DEPARTURE_C, GYRO_TEMPERATURE_OFFSET_S,
    GYRO_TEMPERATURE_RANGE_C, GYRO_TEMPERATURE_RATE_C_PER_S, GYRO_TEMPERATURE_SPREAD_C,
    GYRO_TEMPERATURE_STEP_C,
};

/// A TEMP pin.
#[derive(Clone, Copy, Debug)]
struct Pin {
    /// Last reading, °C.
    read_c: f32,
    /// Offset to the others, °C, once it has been used.
    offset_c: Option<f32>,
    /// Time over which the offset was learnt, s.
    learnt_s: f32,
    /// Whether it is used.
    counts: bool,
}

/// The TEMP pins of gyro x, y, z, batch after batch.
#[derive(Clone, Copy, Debug)]
pub struct Thermometer {
    pins: [Pin; 3],
    /// Last common temperature, °C, if any, and its age, s.
    together_c: Option<f32>,
    since_s: f32,
}

impl Thermometer {
    /// Before the first reading.
    pub const NEW: Self = Self {
        pins: [Pin {
            read_c: 0.0,
            offset_c: None,
            learnt_s: 0.0,
            counts: false,
        }; 3],
        together_c: None,
        since_s: 0.0,
    };

    /// Before the first reading, with stored offsets between the pins, °C.
    pub const fn of_pins(pins_c: [f32; 3]) -> Self {
        let mut new = Self::NEW;
        let mut i = 0;
        // `while`, because `for` is not allowed in a constant function.
        while i < 3 {
            new.pins[i].offset_c = Some(pins_c[i]);
            new.pins[i].learnt_s = GYRO_TEMPERATURE_BEGINNING_S;
            i += 1;
        }
        new
    }

    /// Offsets between the pins, °C, once all three have been used long enough. If one is open or shorted, its offset is the one from
    /// `before`. If one is in the range of a gyro but not used, the pins have changed, and the offsets are unknown.
    pub fn to_keep(&self, before: Option<[f32; 3]>) -> Option<[f32; 3]> {
        let learnt = |pin: &Pin| pin.learnt_s >= GYRO_TEMPERATURE_BEGINNING_S;
        if self.pins.iter().all(|pin| pin.counts && learnt(pin)) {
            return Some(self.pins.map(|pin| pin.offset_c.unwrap_or(0.0)));
        }
        let disagrees = |pin: &Pin| !pin.counts && in_range(pin.read_c);
        before.filter(|_| !self.pins.iter().any(disagrees))
    }

    /// Which pins are used.
    pub fn that_count(&self) -> [bool; 3] {
        self.pins.map(|pin| pin.counts)
    }

    /// Processes the mean readings of the pins over the next `seconds`, °C; returns the temperature of those that are used, or `None`.
    pub fn take(&mut self, pins_c: [f32; 3], seconds: f32) -> Option<f32> {
        self.since_s += seconds;
        let plausible = plausible(pins_c);
        let steady = core::array::from_fn(|i| {
            let pin = &self.pins[i];
            let step_c = (pins_c[i] - pin.read_c).abs();
            plausible[i] && pin.counts && step_c <= GYRO_TEMPERATURE_STEP_C
        });
        let counts: [bool; 3] =
            core::array::from_fn(|i| plausible[i] && self.may_be(i, pins_c, plausible, steady));
        // A pin that has never been used has no offset yet; it is computed from the others.
        let known = core::array::from_fn(|i| counts[i] && self.pins[i].offset_c.is_some());
        let together_c = self
            .mean(known, pins_c)
            .or_else(|| self.mean(counts, pins_c));
        for (i, pin) in self.pins.iter_mut().enumerate() {
            (pin.counts, pin.read_c) = (counts[i], pins_c[i]);
            if let (true, Some(together_c)) = (pin.counts, together_c) {
                pin.learn(pins_c[i] - together_c, seconds);
            }
        }
        if together_c.is_some() {
            (self.together_c, self.since_s) = (together_c, 0.0);
        }
        together_c
    }

    /// Whether a pin may be right, judged by its history and by the other steady pins.
    fn may_be(&self, i: usize, pins_c: [f32; 3], plausible: [bool; 3], steady: [bool; 3]) -> bool {
        let pin = &self.pins[i];
        let Some(offset_c) = pin.offset_c else {
            return true;
        };
        let others = core::array::from_fn(|j| j != i && steady[j]);
        let away = |from_c: f32| (pins_c[i] - offset_c - from_c).abs();
        match (pin.counts, self.mean(others, pins_c)) {
            (true, None) => steady[i],
            (true, Some(others_c)) => steady[i] && away(others_c) <= GYRO_TEMPERATURE_DEPARTURE_C,
            (false, Some(others_c)) => away(others_c) <= GYRO_TEMPERATURE_STEP_C,
            (false, None) => match self.together_c {
                // Distance that the dies may have changed since.
                Some(together_c) => {
                    let gone_c = GYRO_TEMPERATURE_RATE_C_PER_S * self.since_s;
                    away(together_c) <= GYRO_TEMPERATURE_STEP_C + gone_c
                }
                // First reading with stored offsets: a pin is right if it has its offset to another pin, or is the only one.
                None => {
                    let mut others = (0..3).filter(|&j| j != i && plausible[j]).peekable();
                    others.peek().is_none()
                        || others.any(|j| {
                            let other_c = pins_c[j] - self.pins[j].offset_c.unwrap_or(0.0);
                            away(other_c) <= GYRO_TEMPERATURE_DEPARTURE_C
                        })
                }
            },
        }
    }

    /// Mean of the readings of some pins minus their offsets, °C.
    fn mean(&self, which: [bool; 3], pins_c: [f32; 3]) -> Option<f32> {
        let all = (0..3).filter(|i| which[*i]);
        let (sum, count) = all.fold((0.0, 0.0), |(sum, count), i| {
            let offset_c = self.pins[i].offset_c.unwrap_or(0.0);
            (sum + pins_c[i] - offset_c, count + 1.0)
        });
        (count > 0.0).then(|| sum / count)
    }
}

impl Pin {
    /// Updates the offset: at first the mean, then a lag. A mean of everything so far would, after a minute, follow a pin that departs
    /// within the next minute.
    fn learn(&mut self, beside_c: f32, seconds: f32) {
        let before = self.offset_c.unwrap_or(beside_c);
        self.learnt_s = (self.learnt_s + seconds).min(GYRO_TEMPERATURE_BEGINNING_S);
        let over_s = match self.learnt_s < GYRO_TEMPERATURE_BEGINNING_S {
            true => self.learnt_s,
            false => GYRO_TEMPERATURE_OFFSET_S,
        };
        self.offset_c = Some(before + seconds / over_s * (beside_c - before));
    }
}

/// Whether each pin may be right, judged by the three simultaneous readings, °C.
///
/// A pin may be right if it is in the range of a working gyro and agrees with another such pin, or is the only one. If only two are left
/// and they disagree, neither is used: it is unknown which is wrong, and their mean would certainly be wrong.
fn plausible(pins_c: [f32; 3]) -> [bool; 3] {
    let in_range = pins_c.map(in_range);
    core::array::from_fn(|i| {
        let mut others = (0..3).filter(|&j| j != i && in_range[j]).peekable();
        let alone = others.peek().is_none();
        let agrees = others.any(|j| (pins_c[i] - pins_c[j]).abs() <= GYRO_TEMPERATURE_SPREAD_C);
        in_range[i] && (alone || agrees)
    })
}

/// Whether a working gyro can have this reading, °C.
fn in_range(temp_c: f32) -> bool {
    let [least, most] = GYRO_TEMPERATURE_RANGE_C;
    (least..=most).contains(&temp_c)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A batch.
    const BATCH_S: f32 = 0.02;
    /// Where the pins stand beside each other for good.
    const APART_C: [f32; 3] = [3.0, -1.0, -2.0];

    /// What the pins read where the dies are.
    fn pins(die_c: f32) -> [f32; 3] {
        APART_C.map(|apart| die_c + apart)
    }

    /// After a minute at this temperature.
    fn learnt(die_c: f32) -> Thermometer {
        let mut thermometer = Thermometer::NEW;
        for _ in 0..3000 {
            thermometer.take(pins(die_c), BATCH_S);
        }
        thermometer
    }

    #[test]
    fn a_pin_out_of_range_or_that_disagrees_with_both_others_may_not_be_right() {
        assert_eq!(plausible([20.0, 32.0, 25.0]), [true; 3]);
        // Open or at ground, and at 5 V.
        assert_eq!(plausible([-272.6, 25.0, 26.0]), [false, true, true]);
        assert_eq!(plausible([25.0, 322.6, 26.0]), [true, false, true]);
        assert_eq!(plausible([25.0, 26.0, 60.0]), [true, true, false]);
    }

    #[test]
    fn the_only_one_may_and_of_two_that_disagree_neither() {
        assert_eq!(plausible([-272.6, 40.0, 322.6]), [false, true, false]);
        assert_eq!(plausible([-272.6, 40.0, 70.0]), [false; 3]);
        assert_eq!(plausible([-20.0, 40.0, 70.0]), [false; 3]);
        assert_eq!(plausible([f32::NAN, -272.6, 322.6]), [false; 3]);
    }

    #[test]
    fn a_pin_that_is_lost_takes_no_step_with_it_and_comes_back_without_one() {
        let mut thermometer = learnt(30.0);
        for k in 0..500 {
            // The dies warm up by 3 °C meanwhile.
            let die_c = 30.0 + 0.006 * k as f32;
            let mut read = pins(die_c);
            if (100..400).contains(&k) {
                read[0] = -272.6;
            }
            let found = thermometer.take(read, BATCH_S).unwrap();
            assert!((found - die_c).abs() < 0.02, "{k}: {found} {die_c}");
            let lost = (100..400).contains(&k);
            assert_eq!(thermometer.that_count(), [!lost, true, true], "{k}");
        }
    }

    #[test]
    fn a_pin_that_is_open_when_the_power_comes_moves_nothing_where_the_offsets_were_kept() {
        let kept = learnt(30.0).to_keep(None).expect("all three count");
        for (kept, apart) in kept.iter().zip(APART_C) {
            assert!((kept - apart).abs() < 0.01, "{kept}");
        }
        for open in 0..3 {
            for wrong_c in [-272.6, 322.6] {
                let mut thermometer = Thermometer::of_pins(kept);
                let mut read = pins(40.0);
                read[open] = wrong_c;
                for _ in 0..1000 {
                    let found = thermometer.take(read, BATCH_S).unwrap();
                    assert!((found - 40.0).abs() < 0.02, "{open}: {found}");
                    let counts = [0, 1, 2].map(|pin| pin != open);
                    assert_eq!(thermometer.that_count(), counts);
                }
                // As before, while it is open.
                assert_eq!(thermometer.to_keep(Some(kept)), Some(kept));
                // And comes back without a step.
                let found = thermometer.take(pins(40.0), BATCH_S).unwrap();
                assert!((found - 40.0).abs() < 0.02, "{open}: {found}");
                assert_eq!(thermometer.that_count(), [true; 3]);
            }
        }
    }

    #[test]
    fn a_pin_that_stands_elsewhere_than_was_kept_does_not_count_from_the_first_reading_on() {
        let mut thermometer = Thermometer::of_pins(APART_C);
        let mut read = pins(20.0);
        // Within what two references may differ by, and 6 °C from where it stood.
        read[2] += 6.0;
        for _ in 0..100 {
            let found = thermometer.take(read, BATCH_S).unwrap();
            assert!((found - 20.0).abs() < 0.02, "{found}");
            assert_eq!(thermometer.that_count(), [true, true, false]);
        }
        // Another gyro has been soldered in: with the next calibration nothing is kept, and the next start learns anew.
        assert_eq!(thermometer.to_keep(Some(APART_C)), None);
    }

    #[test]
    fn nothing_is_kept_before_it_is_learnt() {
        let mut thermometer = Thermometer::NEW;
        for _ in 0..499 {
            thermometer.take(pins(20.0), BATCH_S);
            assert_eq!(thermometer.to_keep(None), None);
        }
        for _ in 0..2 {
            thermometer.take(pins(20.0), BATCH_S);
        }
        assert!(thermometer.to_keep(None).is_some());
    }

    #[test]
    fn a_step_that_no_die_makes_is_left_out_as_long_as_it_lasts() {
        for step_c in [1.5, -4.0, 15.0] {
            for pin in 0..3 {
                let mut thermometer = learnt(30.0);
                let mut read = pins(30.0);
                read[pin] += step_c;
                for _ in 0..10_000 {
                    let found = thermometer.take(read, BATCH_S).unwrap();
                    assert!((found - 30.0).abs() < 0.01, "{step_c}: {found}");
                    assert!(!thermometer.that_count()[pin]);
                }
                thermometer.take(pins(30.0), BATCH_S);
                assert_eq!(thermometer.that_count(), [true; 3]);
            }
        }
    }

    /// Air of a hot-air gun warms the dies by 0.5 °C/s.
    #[test]
    fn the_fastest_that_dies_warm_up_is_followed() {
        let mut thermometer = learnt(20.0);
        for k in 0..5000 {
            let die_c = 20.0 + 0.5 * BATCH_S * k as f32;
            let found = thermometer.take(pins(die_c), BATCH_S).unwrap();
            assert!((found - die_c).abs() < 0.01, "{found} {die_c}");
        }
        assert_eq!(thermometer.that_count(), [true; 3]);
    }

    #[test]
    fn when_all_step_the_last_good_one_holds_until_the_dies_may_be_there() {
        let mut thermometer = learnt(30.0);
        let mut held_s = 0.0;
        while thermometer.take(pins(40.0), BATCH_S).is_none() {
            assert_eq!(thermometer.that_count(), [false; 3]);
            held_s += BATCH_S;
        }
        // 9 of the 10 °C at 0.5 °C/s.
        assert!((held_s - 18.0).abs() < 0.1, "{held_s}");
    }

    #[test]
    fn a_pin_that_stands_still_is_found_once_the_others_have_moved_by_five_degrees() {
        let mut thermometer = learnt(30.0);
        let stuck = pins(30.0)[1];
        // 2 °C a minute.
        let mut found_at = None;
        for k in 0..30_000 {
            let die_c = 30.0 + BATCH_S * k as f32 / 30.0;
            let mut read = pins(die_c);
            read[1] = stuck;
            thermometer.take(read, BATCH_S);
            let counts = thermometer.that_count();
            assert!(counts[0] && counts[2], "{k}");
            if !counts[1] && found_at.is_none() {
                found_at = Some(die_c);
            }
        }
        let found_at = found_at.expect("found");
        assert!((35.0..37.0).contains(&found_at), "{found_at}");
    }
}
