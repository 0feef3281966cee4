//! The bits, the weight and the zero of a converter as they fit best together, what naming them costs, and how well the zero is known.

use mimu_core::effects::FARTHEST_ZERO;
use statrs::function::factorial::ln_binomial;

use super::Hypothesis;
use super::first_sight::affordable;
use super::sight::{Sight, ends, median_sd, range};
use crate::diagnose::candidate::Candidate;
use crate::diagnose::decision::EXCITED;
use crate::diagnose::library::readout::{BITS, Converter, TYPICAL, first_of};
use crate::diagnose::rows::RowReading;
use crate::diagnose::search::COEFFICIENT;

/// Most places of a zero, on either side, that the mass of its likelihood is summed from.
const PLACES: usize = 1000;
/// Deviance from which a place has no part in it.
const NEGLIGIBLE: f64 = 20.0;
/// Deviance by which the middle of the interval may be worse than the best place.
const VALLEY: f64 = 6.0;
/// Part of it that is outside the interval, on either side.
const OUTSIDE: f64 = 0.025;

impl Sight {
    /// Whether bits of this weight are what a converter with the step of the readings has.
    fn is_usual(&self, weight: f64) -> bool {
        let power = self.step.map(|step| (weight / step).log2());
        power.is_some_and(|p| (p - p.round()).abs() < 1e-9)
    }

    /// What some bits of a converter cost: each its coefficient, all that they are chosen, and weight and zero what it takes to name them,
    /// which is the more the more often the finest bit turns. A single step pays for neither, and nobody for a usual weight. Without this a
    /// step of ten noises took on two fine bits, for a deviance of 20 that the best of 1024 zeros has by chance, and they drew it from its place.
    /// At first sight errors are most of the noise, all bits but the largest are hidden, and none is asked for more than its coefficient.
    pub(super) fn price(&self, bits: &[usize], weight: f64, range: f64) -> f64 {
        let coefficients = COEFFICIENT * bits.len() as f64;
        if !self.noise_known {
            return coefficients;
        }
        let finest = bits.iter().max().map_or(0, |bit| *bit as i32);
        let turns = range / (weight * 0.5_f64.powi(finest));
        let named = if self.is_usual(weight) { 2.0 } else { 4.0 };
        let choice = 2.0 * ln_binomial(BITS as u64, bits.len() as u64);
        coefficients + choice + named * turns.max(1.0).ln()
    }

    /// The same of the converters of a candidate.
    pub(super) fn price_of(&self, candidate: &Candidate) -> f64 {
        let of = |first: usize, axis: usize, readings: &[RowReading]| {
            let own = candidate.active.iter().filter_map(|k| k.checked_sub(first));
            let bits: Vec<usize> = own.filter(|bit| *bit < BITS).collect();
            match candidate.codes[axis] {
                Some(converter) if !bits.is_empty() => {
                    self.price(&bits, converter.weight, range(readings))
                }
                _ => 0.0,
            }
        };
        let each = (0..3).map(|axis| of(first_of(axis), axis, &self.of(Some(axis))));
        of(0, 0, &self.readings) + each.sum::<f64>()
    }

    /// The best choice of bits, and how many there were to choose from.
    pub(super) fn choose(
        &self,
        readings: &[RowReading],
        converter: Converter,
    ) -> Option<(Hypothesis, usize)> {
        let all: [usize; BITS] = std::array::from_fn(|bit| bit);
        let normal = self.bits(readings, &converter, &all);
        let excited = |k: &usize| normal.matrix[(*k, *k)].max(0.0).sqrt() * TYPICAL > EXCITED;
        let offered: Vec<usize> = (0..BITS).filter(excited).collect();
        let range = range(readings);
        let sets = (1..1usize << offered.len()).filter_map(|set| {
            let bits: Vec<usize> = (0..offered.len())
                .filter(|k| set & (1 << k) != 0)
                .map(|k| offered[k])
                .collect();
            let drop = self.drop(normal.explains(&bits, TYPICAL / EXCITED)?);
            let price = self.price(&bits, converter.weight, range);
            Some(Hypothesis {
                converter,
                bits,
                drop,
                price,
            })
        });
        let best = sets.max_by(|a, b| a.score().total_cmp(&b.score()))?;
        Some((best, offered.len()))
    }

    /// The converter that a bit of weight `weight` belongs to, whose turns are at `zero` and every weight from there: each bit above
    /// may turn where this one turns on or where it turns off.
    pub(super) fn above(&self, readings: &[RowReading], weight: f64, zero: f64) -> Converter {
        let mut converter = Converter::of(weight, zero);
        let (lowest, highest) = ends(readings);
        for level in 1..BITS {
            if converter.weight >= highest - lowest {
                break;
            }
            let either = [0.0, converter.weight]
                .map(|by| Converter::of(2.0 * converter.weight, converter.zero + by));
            let bits: Vec<usize> = (0..=level).collect();
            let explains = |c: &Converter| {
                let normal = self.bits(readings, c, &bits);
                normal.explains_with_ridge().unwrap_or(0.0)
            };
            let [a, b] = either.each_ref().map(explains);
            converter = if b > a { either[1] } else { either[0] };
        }
        // Code 0 below all readings.
        let period = 2.0 * converter.weight;
        converter.zero -= period * ((converter.zero - lowest) / period).ceil();
        converter
    }

    /// Drop of the deviance with the bits of a hypothesis and another converter.
    fn with(&self, readings: &[RowReading], of: &Hypothesis, converter: &Converter) -> Option<f64> {
        let set: Vec<usize> = (0..of.bits.len()).collect();
        let normal = self.bits(readings, converter, &of.bits);
        Some(self.drop(normal.explains(&set, f64::INFINITY)?))
    }

    /// With weight, if it is no usual one, and zero walked uphill by ever smaller steps.
    fn refine(&self, readings: &[RowReading], from: Hypothesis) -> Hypothesis {
        let mut best = from;
        let finest = best.bits.last().copied().unwrap_or(0);
        let (lowest, highest) = ends(readings);
        let middle = 0.5 * (lowest + highest);
        let usual = self.is_usual(best.converter.weight);
        let mut step = 0.25;
        while step > 0.01 {
            let Converter { weight, zero, .. } = best.converter;
            let by = step * weight * 0.5_f64.powi(finest as i32);
            let shifted = |by: f64| Converter {
                zero: zero + by,
                ..best.converter
            };
            // About the middle of the readings: else a weight would have to be refined together with the zero.
            let scaled = |by: f64| {
                let factor = 1.0 + 2.0 * by / (highest - lowest).max(weight);
                Converter {
                    weight: weight * factor,
                    zero: middle - (middle - zero) * factor,
                    ..best.converter
                }
            };
            let tried = [shifted(by), shifted(-by), scaled(by), scaled(-by)];
            let moves = if usual { 2 } else { 4 };
            let found = tried.into_iter().take(moves).find_map(|converter| {
                let drop = self.with(readings, &best, &converter)?;
                (drop > best.drop + 1e-6).then(|| Hypothesis {
                    converter,
                    drop,
                    ..best.clone()
                })
            });
            match found {
                Some(better) => best = better,
                None => step *= 0.5,
            }
        }
        best
    }

    /// With weight, zero and bits as they fit best together, and how many bits there were to choose from; `None` of what no device could
    /// remove.
    pub(super) fn settled(
        &self,
        readings: &[RowReading],
        from: Hypothesis,
    ) -> Option<(Hypothesis, usize)> {
        let refined = self.refine(readings, from);
        if !removable(&refined.converter) {
            return None;
        }
        // With weight and zero in their places other bits may be seen.
        let (chosen, offered) = self.choose(readings, refined.converter)?;
        let refined = self.refine(readings, chosen);
        Some((self.centred(readings, refined), offered))
    }

    /// With the zero in the middle of where it is with 95 %, every place being as likely before.
    ///
    /// By the mass of the likelihood and not by its height: a step between two readings may be anywhere between them, and one that cuts
    /// into a dwell takes that dwell's own noise for its edge, which is higher, but narrow.
    pub(super) fn centred(&self, readings: &[RowReading], from: Hypothesis) -> Hypothesis {
        let Converter { weight, zero, .. } = from.converter;
        let finest = from.bits.iter().max().map_or(0, |bit| *bit as i32);
        let most = 0.5 * weight * 0.5_f64.powi(finest);
        let step = (0.5 * median_sd(readings)).max(most / affordable(readings, PLACES) as f64);
        let at = |by: f64| {
            let converter = Converter {
                zero: zero + by,
                ..from.converter
            };
            self.with(readings, &from, &converter)
        };
        let walked = |side: f64| {
            (1..)
                .map(|k| f64::from(k) * step)
                .take_while(|by| *by < most)
                .map_while(|by| Some((side * by, at(side * by)?)))
                .take_while(|(_, drop)| *drop > from.drop - NEGLIGIBLE)
                .collect::<Vec<_>>()
        };
        let mut places = walked(-1.0);
        places.reverse();
        places.push((0.0, from.drop));
        places.extend(walked(1.0));
        let highest = places.iter().map(|p| p.1).fold(from.drop, f64::max);
        let mass = |p: &(f64, f64)| (0.5 * (p.1 - highest)).exp();
        let all: f64 = places.iter().map(mass).sum();
        let reaches = |share: f64| {
            let so_far = places.iter().scan(0.0, |sum, p| {
                *sum += mass(p);
                Some((p.0, *sum))
            });
            let mut beyond = so_far.filter(|(_, sum)| *sum > share * all);
            beyond.next().map_or(0.0, |(by, _)| by)
        };
        let (down, up) = (
            reaches(OUTSIDE) - 0.5 * step,
            reaches(1.0 - OUTSIDE) + 0.5 * step,
        );
        let middle = 0.5 * (up + down);
        let moved = |by: f64, within: f64| Converter {
            zero: zero + by,
            zero_within: within,
            ..from.converter
        };
        // Between two places that do as well the middle may not.
        let there = at(middle).filter(|drop| *drop > from.drop - VALLEY);
        let (converter, drop) = match there {
            Some(drop) => (moved(middle, 0.5 * (up - down)), drop),
            None => (moved(0.0, up.max(-down)), from.drop),
        };
        Hypothesis {
            converter,
            drop,
            ..from
        }
    }
}

/// Whether a device can remove errors of it.
pub(super) fn removable(converter: &Converter) -> bool {
    converter.zero.abs() <= FARTHEST_ZERO * converter.weight
}
