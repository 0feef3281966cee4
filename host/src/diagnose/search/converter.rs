//! Converters that the residuals speak of: errors by the code, of any weight and any zero.
//!
//! A bit that is worth too much is a square wave against the reading: of an unknown period, twice its weight, and an unknown phase,
//! the zero. So the residuals are looked through as a periodogram is (Lomb 1976, Scargle 1982), with the reading in place of the time,
//! and for single steps, which codes that never come leave. From the best of these the other bits of the same converter follow:
//! their weights are halves and doubles, and their turns fall together with its own. Weight and zero are then refined with all bits.
//!
//! Thousands of places are looked at, so at first the rows are taken for independent: each by what it is off from what all others
//! predict of it, with the variance of that. The readings of successive dwells have no order, and what a slow wander makes
//! neighbours share averages out. What is found is judged with the whole noise, as every candidate is.

use std::f64::consts::PI;

use mimu_core::effects::FARTHEST_ZERO;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use statrs::function::factorial::ln_binomial;

use super::{COEFFICIENT, Chosen, Search, basis, beside, exceeds, unit_columns};
use crate::diagnose::candidate::{Candidate, Kind};
use crate::diagnose::decision::EXCITED;
use crate::diagnose::effect::Moment;
use crate::diagnose::library::readout::{self, BITS, Converter, TYPICAL, first_of};
use crate::diagnose::rows::RowReading;
use crate::diagnose::spread::{By, Components, Fitted};

/// Periods are looked at so many to a cycle over the range of the readings.
const OVERSAMPLED: f64 = 2.5;
/// Most periods.
const PERIODS: usize = 4000;
/// Most places times readings: of a recording by hand every 10 ms of a turn is a reading, and all periods of all would take a minute.
const EVALUATIONS: usize = 4_000_000;
/// Places that are looked at all the same.
const FEWEST: usize = 100;
/// Cycles in a standard deviation of the readings: more, and noise has levelled five sixths of the wave.
const FINEST: f64 = 0.3;
/// Most places of a step.
const STEPS: usize = 256;
/// Waves, and steps, that are followed up. The highest wave may be a third harmonic.
const WAVES: usize = 6;
const FOLLOWED_STEPS: usize = 2;
/// Zeros of a converter of the usual weight, a power of two times the step of the readings, that are looked at.
const ZEROS: usize = 1024;
/// And followed up.
const FOLLOWED_ZEROS: usize = 4;
/// What keeps bits that turn together, or not at all, from being told apart by rounding.
const RIDGE: f64 = 1e-3;
/// Of these, the ones whose weights and zeros are refined where the noise is known; else one.
const REFINED: usize = 3;
/// Most places of a zero, on either side, that the mass of its likelihood is summed from.
const PLACES: usize = 1000;
/// Deviance from which a place has no part in it.
const NEGLIGIBLE: f64 = 20.0;
/// Deviance by which the middle of the interval may be worse than the best place.
const VALLEY: f64 = 6.0;
/// Part of it that is outside the interval, on either side.
const OUTSIDE: f64 = 0.025;
/// Phases and directions that a period stands for, as tests.
const PHASES: f64 = 4.0;
/// A first sight that chance has more often than this, after all places, is not followed up.
const PROMISING: f64 = 0.05;
/// Part of a column that the others do not span, below which it is none of its own.
const INDEPENDENT: f64 = 1e-2;
/// Part of a column's square that is left of it beside the model, below which it is in the model.
const ROUNDING: f64 = 1e-9;
/// Rows up to which the noise is taken apart by all of its covariances.
const DENSE: usize = 1500;

/// The residuals beside a model, as if rows were independent.
struct Sight {
    readings: Vec<RowReading>,
    /// Root of the weight of each row.
    root: DVector<f64>,
    /// Basis of the model, weighted, by rows: orthonormal columns.
    model: DMatrix<f64>,
    /// Residuals over their standard deviations.
    left: DVector<f64>,
    /// Sum of their squares, as the noise has it.
    total: f64,
    /// That readings are multiples of, raw, where they are.
    step: Option<f64>,
    /// Whether the noise is that beside all errors: else it is taken for what is left, errors included.
    noise_known: bool,
}

/// Normal equations of some columns beside the model.
struct Normal {
    matrix: DMatrix<f64>,
    with_left: DVector<f64>,
}

impl Normal {
    /// What the columns in `set` explain; `None` where they are not independent, or the coefficient of one of them beside the others is not
    /// known to within `sigma`: all bits together are nearly what is read, which the affine parameters take up.
    fn explains(&self, set: &[usize], sigma: f64) -> Option<f64> {
        let size = |k: usize| self.matrix[(k, k)].max(0.0).sqrt();
        let p = set.len();
        let scaled = DMatrix::from_fn(p, p, |i, j| {
            let (a, b) = (set[i], set[j]);
            self.matrix[(a, b)] / (size(a) * size(b))
        });
        let with_left = DVector::from_fn(p, |i, _| self.with_left[set[i]] / size(set[i]));
        let root = scaled.cholesky()?;
        let least = root.l_dirty().diagonal().min();
        let variance = root.inverse().diagonal();
        let known = |k: usize| variance[k].sqrt() <= sigma * size(set[k]);
        (least > INDEPENDENT && (0..p).all(known)).then(|| root.solve(&with_left).dot(&with_left))
    }

    /// What all columns together explain, those that there are.
    fn explains_with_ridge(&self) -> Option<f64> {
        let p = self.with_left.len();
        let size: Vec<f64> = (0..p)
            .map(|k| self.matrix[(k, k)].max(f64::MIN_POSITIVE).sqrt())
            .collect();
        let ridge = |i, j| if i == j { RIDGE } else { 0.0 };
        let scaled = DMatrix::from_fn(p, p, |i, j| {
            self.matrix[(i, j)] / (size[i] * size[j]) + ridge(i, j)
        });
        let with_left = DVector::from_fn(p, |i, _| self.with_left[i] / size[i]);
        Some(scaled.cholesky()?.solve(&with_left).dot(&with_left))
    }
}

/// Some bits of a converter, and how well they explain the residuals.
#[derive(Debug, Clone)]
struct Hypothesis {
    converter: Converter,
    /// From 0, the first, up.
    bits: Vec<usize>,
    /// Drop of the deviance.
    drop: f64,
    /// What that costs, [`Sight::price`].
    price: f64,
}

impl Hypothesis {
    fn score(&self) -> f64 {
        self.drop - self.price
    }
}

/// What was found of the readings of one axis, or of all.
struct Outcome {
    best: Hypothesis,
    /// Places that were looked at.
    places: f64,
    /// Bits to choose from.
    offered: usize,
    /// Probability of chance, roughly.
    p: f64,
}

impl Sight {
    /// Beside `model`, at readings without noise, which `moments` are.
    fn new(
        search: &Search,
        model: &DMatrix<f64>,
        null: &Fitted,
        moments: &[Moment],
    ) -> Option<Self> {
        let rows = search.rows;
        let n = rows.y.len();
        let whitener = search.spread.whitener(&null.components)?;
        let whitened = whitener.whiten(model);
        let y = whitener.whiten(&DMatrix::from_column_slice(n, 1, rows.y.as_slice()));
        let q = whitened.qr().q();
        let left = &y - &q * q.tr_mul(&y);
        let total = left.norm_squared();
        let (pull, weights) = if n <= DENSE {
            let whitener = whitener.whiten(&DMatrix::identity(n, n));
            let weights = DVector::from_fn(n, |i, _| whitener.column(i).norm_squared());
            (whitener.tr_mul(&left), weights)
        } else {
            let left = &rows.y - model * &null.coefficients;
            let weights = search.spread.variances(&null.components).map(|v| 1.0 / v);
            let pull = left.component_mul(&weights);
            (DMatrix::from_column_slice(n, 1, pull.as_slice()), weights)
        };
        let root = weights.map(f64::sqrt);
        let mut weighted = unit_columns(model);
        for (mut row, w) in weighted.row_iter_mut().zip(root.iter()) {
            row *= *w;
        }
        let mut readings = search.by_dwell.readings(moments);
        readings.retain(|r| r.mean.is_finite() && r.sd.is_finite());
        // With all covariances it is across the model already; without them not quite, and a column nearly in the model would seem to
        // explain what is in it.
        let model = basis(&weighted);
        let left = DVector::from_fn(n, |i, _| pull[(i, 0)] / root[i]);
        let left = &left - &model * model.tr_mul(&left);
        Some(Self {
            left,
            model: model.transpose(),
            root,
            total,
            readings,
            step: rows.step,
            noise_known: false,
        })
    }

    /// Of one axis alone.
    fn of(&self, axis: Option<usize>) -> Vec<RowReading> {
        let ours = self.readings.iter().copied();
        ours.filter(|r| axis.is_none_or(|a| a == r.axis)).collect()
    }

    /// Whether bits of this weight are what a converter with the step of the readings has.
    fn is_usual(&self, weight: f64) -> bool {
        let power = self.step.map(|step| (weight / step).log2());
        power.is_some_and(|p| (p - p.round()).abs() < 1e-9)
    }

    /// What some bits of a converter cost: each its coefficient, all that they are chosen, and weight and zero what it takes to name them,
    /// which is the more the more often the finest bit turns. A single step pays for neither, and nobody for a usual weight. Without this a
    /// step of ten noises took on two fine bits, for a deviance of 20 that the best of 1024 zeros has by chance, and they drew it from its place.
    /// At first sight errors are most of the noise, all bits but the largest are hidden, and none is asked for more than its coefficient.
    fn price(&self, bits: &[usize], weight: f64, range: f64) -> f64 {
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
    fn price_of(&self, candidate: &Candidate) -> f64 {
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

    /// Normal equations of so many functions of the reading, which `values` writes.
    fn normal(
        &self,
        readings: &[RowReading],
        count: usize,
        values: impl Fn(&RowReading, &mut [f64]),
    ) -> Normal {
        let mut of_one = vec![0.0; count];
        let mut of_row = DVector::zeros(count);
        let mut matrix = DMatrix::zeros(count, count);
        let mut with_left = DVector::zeros(count);
        let mut in_model = DMatrix::zeros(self.model.nrows(), count);
        // The readings of a row follow each other; rows of other axes are none of these.
        for of_this in readings.chunk_by(|a, b| a.row == b.row) {
            of_row.fill(0.0);
            let row = of_this[0].row;
            for r in of_this {
                values(r, &mut of_one);
                let weight = r.weight * self.root[row];
                for (sum, value) in of_row.iter_mut().zip(&of_one) {
                    *sum += weight * value;
                }
            }
            matrix.ger(1.0, &of_row, &of_row, 1.0);
            with_left.axpy(self.left[row], &of_row, 1.0);
            in_model.ger(1.0, &self.model.column(row), &of_row, 1.0);
        }
        let before = matrix.diagonal();
        matrix.gemm_tr(-1.0, &in_model, &in_model, 1.0);
        // Of what the model spans, as a bit that never turns, rounding leaves a little.
        for k in 0..count {
            if matrix[(k, k)] > ROUNDING * before[k] {
                continue;
            }
            matrix.row_mut(k).fill(0.0);
            matrix.column_mut(k).fill(0.0);
            with_left[k] = 0.0;
        }
        Normal { matrix, with_left }
    }

    /// Drop of the deviance where so much is explained.
    fn drop(&self, explained: f64) -> f64 {
        if self.noise_known {
            return explained;
        }
        let share = (explained / self.total).clamp(0.0, 0.999_999);
        -(self.root.len() as f64) * (-share).ln_1p()
    }

    /// Some bits of a converter.
    fn bits(&self, readings: &[RowReading], converter: &Converter, bits: &[usize]) -> Normal {
        self.normal(readings, bits.len(), |r, out| {
            for (bit, out) in bits.iter().zip(out) {
                *out = converter.weight * converter.share(*bit, r.mean, r.sd);
            }
        })
    }

    /// The best choice of bits, and how many there were to choose from.
    fn choose(&self, readings: &[RowReading], converter: Converter) -> Option<(Hypothesis, usize)> {
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
    fn above(&self, readings: &[RowReading], weight: f64, zero: f64) -> Converter {
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
    fn settled(&self, readings: &[RowReading], from: Hypothesis) -> Option<(Hypothesis, usize)> {
        let refined = self.refine(readings, from);
        let Converter { weight, zero, .. } = refined.converter;
        if zero.abs() > FARTHEST_ZERO * weight {
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
    fn centred(&self, readings: &[RowReading], from: Hypothesis) -> Hypothesis {
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

    /// Waves and steps against the reading, as the converter that each would be the heaviest bit of, the best first, and how many places
    /// were looked at.
    fn first_sight(&self, readings: &[RowReading]) -> (Vec<(f64, Converter)>, f64) {
        let sd = median_sd(readings);
        let cycle = 1.0 / (OVERSAMPLED * range(readings));
        let finest = (FINEST / sd / cycle).min(affordable(readings, PERIODS) as f64);
        let waves: Vec<(f64, Converter)> = (1..finest as usize)
            .into_par_iter()
            .filter_map(|k| self.wave(readings, k as f64 * cycle))
            .collect();
        let mut levels: Vec<f64> = readings.iter().map(|r| r.mean).collect();
        levels.sort_by(f64::total_cmp);
        let every = levels.len().div_ceil(STEPS).max(1);
        let between = levels.windows(2).step_by(every);
        let places: Vec<f64> = between.map(|w| 0.5 * (w[0] + w[1])).collect();
        let steps: Vec<(f64, Converter)> = places
            .par_iter()
            .filter_map(|at| self.step(readings, *at))
            .collect();
        let count = PHASES * waves.len() as f64 + 2.0 * steps.len() as f64;
        let mut followed = peaks(waves, WAVES);
        followed.extend(peaks(steps, FOLLOWED_STEPS));
        followed.sort_by(|a, b| b.0.total_cmp(&a.0));
        (followed, count)
    }

    /// Converters of the usual weight that fit best: of their zeros nothing is known, and with all bits at work no single wave says it.
    fn usual(&self, readings: &[RowReading]) -> Vec<(f64, Converter)> {
        let Some(step) = self.step else {
            return Vec::new();
        };
        let (lowest, highest) = ends(readings);
        let weight = step * ((highest - lowest) / step).log2().ceil().exp2();
        let all: [usize; BITS] = std::array::from_fn(|bit| bit);
        let zeros = affordable(readings, ZEROS);
        let at = |k: usize| {
            // Bits of a zero one weight further are the same, but for the sign of the first.
            let zero = lowest - weight * (k + 1) as f64 / zeros as f64;
            let converter = Converter::of(weight, zero);
            let normal = self.bits(readings, &converter, &all);
            Some((self.drop(normal.explains_with_ridge()?), converter))
        };
        let all: Vec<_> = (0..zeros).into_par_iter().filter_map(at).collect();
        peaks(all, FOLLOWED_ZEROS)
    }

    fn wave(&self, readings: &[RowReading], frequency: f64) -> Option<(f64, Converter)> {
        let normal = self.normal(readings, 2, |r, out| {
            let (sin, cos) = (2.0 * PI * frequency * r.mean).sin_cos();
            let left = (-2.0 * (PI * frequency * r.sd).powi(2)).exp();
            (out[0], out[1]) = (left * cos, left * sin);
        });
        let explained = normal.explains(&[0, 1], f64::INFINITY)?;
        let of = normal.matrix.cholesky()?.solve(&normal.with_left);
        // Of a bit the share is 1/2 - 2/π sin(2π f (u - zero)) and so on; of which sign its error is does not matter here.
        let zero = f64::atan2(-of[0], of[1]) / (2.0 * PI * frequency);
        let weight = 0.5 / frequency;
        Some((self.drop(explained), Converter::of(weight, zero)))
    }

    fn step(&self, readings: &[RowReading], at: f64) -> Option<(f64, Converter)> {
        // So heavy that it turns nowhere else.
        let weight = 2.0 * range(readings);
        let zero = at - weight;
        let converter = Converter::of(weight, zero);
        let normal = self.normal(readings, 1, |r, out| {
            out[0] = converter.share(0, r.mean, r.sd);
        });
        let own = normal.matrix[(0, 0)];
        (own > 0.0).then(|| (self.drop(normal.with_left[0].powi(2) / own), converter))
    }

    /// Errors by the code of an axis, or of all alike. `None` where there are no readings to speak of.
    fn look(&self, axis: Option<usize>) -> Option<Outcome> {
        let readings = self.of(axis);
        if !(range(&readings) > 0.0) {
            return None;
        }
        let (followed, places) = self.first_sight(&readings);
        let (drop, converter) = followed.first().copied()?;
        let chance = |drop: f64, columns: f64, choices: f64| {
            let n = self.root.len() as f64;
            let dof = n - self.model.nrows() as f64 - columns;
            let f = match self.noise_known {
                true => drop / columns,
                false => (drop / n).exp_m1() * dof / columns,
            };
            (exceeds(f, columns, dof) * choices).min(1.0)
        };
        let p = chance(drop, 2.0, places);
        let first = Outcome {
            best: Hypothesis {
                converter,
                bits: vec![0],
                drop,
                price: self.price(&[0], converter.weight, range(&readings)),
            },
            places,
            offered: 1,
            p,
        };
        // With all bits at work no single wave may stand out; a usual weight is tried all the same where the noise is known.
        if p > PROMISING && !self.noise_known {
            return Some(first);
        }
        // At first sight it is enough to know whether codes do better than what else there is; they are looked for again.
        let (usual, places, refined) = match self.noise_known {
            true => (
                self.usual(&readings),
                places + affordable(&readings, ZEROS) as f64,
                REFINED,
            ),
            false => (Vec::new(), places, 1),
        };
        let mut whole: Vec<Converter> = followed
            .into_par_iter()
            .map(|(_, seen)| self.above(&readings, seen.weight, seen.zero))
            .collect();
        whole.extend(usual.iter().map(|u| u.1));
        let whole = whole
            .into_par_iter()
            .filter_map(|converter| Some(self.choose(&readings, converter)?.0));
        let mut whole: Vec<Hypothesis> = whole.collect();
        whole.sort_by(|a, b| b.score().total_cmp(&a.score()));
        whole.truncate(refined);
        let all = whole
            .into_par_iter()
            .filter_map(|chosen| self.settled(&readings, chosen));
        let found = all.max_by(|a, b| a.0.score().total_cmp(&b.0.score()));
        let Some((best, offered)) = found else {
            let best = self.centred(&readings, first.best.clone());
            return Some(Outcome { best, ..first });
        };
        let choices = places * (offered as f64).exp2();
        let p = chance(best.drop, best.bits.len() as f64, choices);
        Some(Outcome {
            best,
            places,
            offered,
            p,
        })
    }
}

/// So many places, or as many as so many readings leave time for: of periods the longest.
fn affordable(readings: &[RowReading], places: usize) -> usize {
    (EVALUATIONS / readings.len().max(1)).clamp(FEWEST, places)
}

/// Lowest and highest reading.
fn ends(readings: &[RowReading]) -> (f64, f64) {
    let wider = |(a, b): (f64, f64), r: &RowReading| (a.min(r.mean), b.max(r.mean));
    readings
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), wider)
}

fn range(readings: &[RowReading]) -> f64 {
    let (lowest, highest) = ends(readings);
    highest - lowest
}

/// How far samples scatter in a dwell, raw.
fn median_sd(readings: &[RowReading]) -> f64 {
    let mut sds: Vec<f64> = readings.iter().map(|r| r.sd).collect();
    sds.sort_by(f64::total_cmp);
    sds.get(sds.len() / 2).copied().unwrap_or(0.0)
}

/// The highest of some places in a row, none beside a higher one.
fn peaks(all: Vec<(f64, Converter)>, most: usize) -> Vec<(f64, Converter)> {
    let before = |k: usize| k.checked_sub(1).map_or(f64::NEG_INFINITY, |k| all[k].0);
    let after = |k: usize| all.get(k + 1).map_or(f64::NEG_INFINITY, |a| a.0);
    let mut peaks: Vec<_> = (0..all.len())
        .filter(|k| all[*k].0 >= before(*k) && all[*k].0 > after(*k))
        .map(|k| all[k])
        .collect();
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    peaks.truncate(most);
    peaks
}

impl Search<'_> {
    /// Errors by the code beside the chosen, of converters of any weight and zero: of one that all axes share, and of one each.
    /// None if errors by the code are among the chosen.
    pub(super) fn converters_beside(&self, chosen: &[Chosen], null: &Fitted) -> Vec<Chosen> {
        if chosen.iter().any(|c| c.candidate.reads_code()) {
            return Vec::new();
        }
        let Some(effect) = readout::of_sensor(self.rows.sensor) else {
            return Vec::new();
        };
        let model = self.model(chosen);
        let moments = self.freed(&model, null);
        let Some(sight) = Sight::new(self, &model, null, &moments) else {
            return Vec::new();
        };
        let plain = Candidate::new(self.rows.sensor, Kind::Effect(effect));
        let mut found = Vec::new();
        if let Some(one) = sight.look(None) {
            let mut candidate = plain.clone().behind_one(one.best.converter);
            candidate.active.clone_from(&one.best.bits);
            candidate.converters = one.places;
            candidate.choices = one.places * (one.offered as f64).exp2();
            found.push(candidate);
        }
        let mut each = plain;
        each.active.clear();
        for (axis, one) in (0..3).filter_map(|axis| Some((axis, sight.look(Some(axis))?))) {
            if one.p > PROMISING {
                continue;
            }
            each.converters *= one.places;
            each.choices *= one.places * (one.offered as f64).exp2();
            each.codes[axis] = Some(one.best.converter);
            each.active
                .extend(one.best.bits.iter().map(|bit| first_of(axis) + bit));
        }
        if !each.active.is_empty() {
            found.push(each);
        }
        found
            .into_iter()
            .filter_map(|candidate| {
                let columns = candidate.columns_at(&self.by_dwell, &moments, 0.0);
                let both = beside(&model, &unit_columns(&columns));
                let fitted = self.spread.fit(&both, &null.components, By::Likelihood)?;
                let drop = (null.deviance - fitted.deviance).max(0.0);
                let p = self.chance(drop, columns.ncols(), model.ncols(), &candidate);
                Some(Chosen {
                    candidate,
                    form: 0.0,
                    columns,
                    p,
                    worth: drop,
                    alternatives: Vec::new(),
                })
            })
            .collect()
    }

    /// The converters of `one` again, beside `rest`, at readings and by a noise that are known better: as long as its errors were not
    /// known, they were in the affine parameters, in the readings that bits were taken from, and in the noise, which hid all but the largest.
    /// And by how much these cost more.
    pub(super) fn settle_converters(
        &self,
        one: &Candidate,
        rest: &[Chosen],
        moments: &[Moment],
        noise: &Components,
    ) -> Option<(Candidate, f64)> {
        let model = self.model(rest);
        let null = self.spread.fit_at(&model, noise)?;
        let mut sight = Sight::new(self, &model, &null, moments)?;
        sight.noise_known = true;
        let shared = one.active.iter().any(|k| *k < BITS);
        let mut again = one.clone();
        again.active.clear();
        (again.converters, again.choices) = (1.0, 1.0);
        for axis in 0..if shared { 1 } else { 3 } {
            let axes = if shared { None } else { Some(axis) };
            let readings = sight.of(axes);
            let as_it_was = one.codes[axis].and_then(|converter| {
                let (chosen, _) = sight.choose(&readings, converter)?;
                sight.settled(&readings, chosen)
            });
            let found = sight.look(axes);
            let places = found.as_ref().map_or(1.0, |f| f.places);
            let promising = found.filter(|f| f.p < PROMISING);
            let promising = promising.map(|f| (f.best, f.offered));
            let all = as_it_was.into_iter().chain(promising);
            let best = all.max_by(|a, b| a.0.score().total_cmp(&b.0.score()));
            again.codes[axis] = best.as_ref().map(|(best, _)| best.converter);
            let Some((best, offered)) = best else {
                continue;
            };
            again.converters *= places;
            again.choices *= places * (offered as f64).exp2();
            let first = if shared { 0 } else { first_of(axis) };
            again.active.extend(best.bits.iter().map(|bit| first + bit));
        }
        if shared {
            again.codes = [again.codes[0]; 3];
        }
        if again.active.is_empty() {
            return None;
        }
        let dearer = sight.price_of(&again) - sight.price_of(one);
        Some((again, dearer))
    }
}
