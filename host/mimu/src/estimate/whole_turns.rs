//! Gyro calibration with whole turns: the unit is turned N times about any axis and put back where it lay, so that the heading closes too.
//!
//! The turns between rests give the first calibration. With it each whole turn is known to a small part of a turn, and its number need not be counted.
//! If there are too few of them, the nominal scale factor has to do, and may leave the number open.

use std::f64::consts::TAU;

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::least_squares::POORLY_DETERMINED;
use super::rotation::{self, Data, from, guess, mean_at_rest};
use super::{Estimated, Failure};
use crate::observation::ByTriad;
use crate::observation::closure::{Closure, ClosureError, Closures};
use crate::observation::turn::{Path, Turn};
use crate::warning::Warning;
use mimu_recording::statistics::quantile;

/// Fewest turns of a whole turn: less is a turn from pose to pose.
const FEWEST: f64 = 0.75;
/// Turns longer than this are left out of the first calibration, whose start may be wrong by a tenth: after half a turn too far the direction of gravity is
/// wrong by more than it can show.
const LONG: f64 = 1.25;
/// Rests within one whole turn.
const MOST_PARTS: usize = 3;
/// Largest angle between the axes of its parts, cosine: 20 degrees.
const SAME_AXIS: f64 = 0.94;
/// Largest error of a heading or a tilt that is still taken for a unit that was put back, in half-widths of the stated placement.
const PUT_BACK: f64 = 6.0;
/// Uncertainty of a heading, rad, above which the number of turns is open: half a turn is three of it.
const OPEN: f64 = 1.0;
/// Error of a nominal scale factor, of readings in SI.
const NOMINAL: f64 = 0.03;
/// Elements of C across the axes of a gyro as delivered, relative to its size, standard deviation. Data sheets give 1 to 2 % as largest value.
const DELIVERED: f64 = 0.01;
/// Uncertainty of headings, rad, at a start that the stated number of turns has scaled.
const SCALED: f64 = 0.1;
/// How often the stated number of turns is closed.
const CLOSED: usize = 3;
/// Ratio of an error to its sigma from which a whole turn is left out.
const OUTLYING: f64 = 5.0;
/// Cosine of the largest angle between the axis of a whole turn and that of the unit that it counts for: 25 degrees.
pub(crate) const NEAR_AXIS: f64 = 0.9;
/// Probability from which on the whole turns contradict the turns between rests.
const CONTRADICTED: f64 = 1e-4;

/// What is stated of the whole turns in a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stated {
    /// Half-width of the 95 % interval of the heading in which the unit is put back, rad.
    pub placement: f64,
    /// Number of turns of each, if it is stated.
    pub turns: Option<u32>,
    /// Known rate of the Earth about the vertical, rad/s, and the variance of the rest, rad²/s².
    pub vertical: [f64; 2],
    /// C of readings in SI.
    pub nominal: Option<Matrix3<f64>>,
}

/// How turns end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Ended {
    /// Where they began.
    Whole,
    /// So far from there, rad: the larger of heading and tilt.
    Off(f64),
    /// The heading is too uncertain to tell; the tilt, rad.
    Open(f64),
}

/// The whole turns found among the turns, and what is wrong with others.
pub struct Found {
    /// Those that are used.
    pub closures: Closures,
    /// Warnings.
    pub warnings: Vec<Warning>,
}

impl Stated {
    /// The whole turns among `turns` by a calibration of the `gyro`. `sigma` is the uncertainty of a heading by that calibration, rad.
    pub fn find(
        &self,
        turns: &[Turn],
        gyro: &Affine<f64>,
        sigma: &dyn Fn(&Path, &ByTriad) -> f64,
    ) -> Found {
        let mut found = Found {
            closures: Closures {
                list: Vec::new(),
                placement_variance: (self.placement / 1.96).powi(2),
                vertical: self.vertical,
                delivered: None,
            },
            warnings: Vec::new(),
        };
        let mut at = 0;
        while at < turns.len() {
            let longest = (turns.len() - at).min(MOST_PARTS);
            let of = |parts: usize| self.whole(turns, at..at + parts, gyro, sigma);
            let whole = (1..=longest).find_map(|parts| of(parts)?.ok());
            at = match whole {
                Some(closure) => {
                    found.warnings.extend(self.miscounted(turns, &closure));
                    let after = closure.turns.end;
                    found.closures.list.push(closure);
                    after
                }
                None => {
                    found.warnings.extend(of(1).and_then(Result::err));
                    at + 1
                }
            };
        }
        found
    }

    /// Whether these neighbouring turns are whole: `None` if they are turns from pose to pose, the reason if they look whole and cannot be used.
    fn whole(
        &self,
        all: &[Turn],
        range: std::ops::Range<usize>,
        gyro: &Affine<f64>,
        sigma: &dyn Fn(&Path, &ByTriad) -> f64,
    ) -> Option<Result<Closure, Warning>> {
        let turns = &all[range.clone()];
        let (first, last) = (turns.first()?, turns.last()?);
        let path = Path::of(turns, gyro);
        let joined = turns.windows(2).all(|w| w[0].to == w[1].from);
        let parts = turns.iter().map(|turn| Path::of(&[*turn], gyro));
        let about_one_axis = parts.clone().all(|p| p.axis.dot(&path.axis) >= SAME_AXIS);
        if !joined || path.turns() < FEWEST || turns.len() > 1 && !about_one_axis {
            return None;
        }
        let ended = self.ended(turns, gyro, &|by| sigma(&path, by))?;
        let [from, to] = [first.steps[0], last.steps[1]];
        match ended {
            Ended::Whole => Some(Ok(Closure { turns: range, path })),
            Ended::Open(tilt) => {
                let turns = path.turns();
                let open = Warning::WholeTurnsOpen { from, to, turns };
                (tilt < PUT_BACK * self.placement).then_some(Err(open))
            }
            // A turn of less than one and a half from pose to pose is no mistake.
            Ended::Off(off) => (path.turns() > 1.5).then_some(Err(Warning::NotPutBack {
                from,
                to,
                turns: path.turns(),
                off,
            })),
        }
    }

    /// How far from where they began neighbouring `turns` have ended. `sigma` is the uncertainty of a heading, rad, by its derivatives by the gyro.
    pub(crate) fn ended(
        &self,
        turns: &[Turn],
        gyro: &Affine<f64>,
        sigma: &dyn Fn(&ByTriad) -> f64,
    ) -> Option<Ended> {
        let tilt = turns.first()?.before.angle(&turns.last()?.after);
        let error = ClosureError::at(turns, gyro, self.vertical[0])?;
        let (sigma, off) = (sigma(&error.block.by(0)), error.block.residual[0].abs());
        let limit = PUT_BACK * self.placement;
        Some(match tilt < limit && off < limit + 3.0 * sigma {
            _ if sigma > OPEN => Ended::Open(tilt),
            true => Ended::Whole,
            false => Ended::Off(off.max(tilt)),
        })
    }

    /// A warning if the number of turns is not the stated one.
    fn miscounted(&self, turns: &[Turn], closure: &Closure) -> Option<Warning> {
        let (counted, turned) = (f64::from(self.turns?), closure.path.turns());
        let own = &turns[closure.turns.clone()];
        let miscounted = (turned - counted).abs() > 0.5;
        miscounted.then(|| Warning::Miscounted {
            from: own[0].steps[0],
            to: own[own.len() - 1].steps[1],
            counted: self.turns.unwrap_or_default(),
            turned,
        })
    }

    /// Fits the gyro to turns, rests and whole turns. The warnings are among its notes.
    ///
    /// # Errors
    /// Those of [`rotation::estimate`]; a number of turns that is open.
    pub fn estimate(&self, data: &Data) -> Result<Estimated, Failure> {
        let (turns, rest) = (data.turns, data.rest);
        if rest.is_empty() {
            return rotation::estimate(&Data {
                start: None,
                prior: None,
                ..*data
            });
        }
        let at_rest = mean_at_rest(rest);
        let start = data.start.map(|start| start.matrix).or(self.nominal);
        let guessed = || guess(data.motions, &at_rest, data.gravity);
        let first = start.or_else(guessed);
        let base = first.map(|first| {
            let model = about_rest(&first, &at_rest);
            let short = turns.iter().copied();
            let short: Vec<Turn> = short
                .filter(|turn| Path::of(&[*turn], &model).turns() < LONG)
                .collect();
            let short = Data {
                turns: &short,
                ..*data
            };
            from(&short, &first, &Closures::default())
        });
        let by_base = match &base {
            Some(Ok(base)) if base.condition < POORLY_DETERMINED => {
                let sigma = |_: &Path, by: &ByTriad| base.triad.variance(by).sqrt();
                let found = self.find(turns, &base.triad.inverse, &sigma);
                let open = |w: &Warning| matches!(w, Warning::WholeTurnsOpen { .. });
                let counted = !found.closures.list.is_empty() || !found.warnings.iter().any(open);
                counted.then_some((base.triad.inverse.matrix, found))
            }
            _ => None,
        };
        let (matrix, mut found) = match by_base {
            Some(found) => found,
            None => self.alone(turns, &at_rest, start)?,
        };
        if found.closures.list.is_empty() {
            found.warnings.push(Warning::NoWholeTurn);
            let base = base.unwrap_or_else(|| Err(no_scale()));
            return base.map(|mut base| {
                base.notes.extend(found.warnings);
                base
            });
        }
        let mut done = from(data, &matrix, &found.closures)?;
        while let Some((worst, warning)) = outlying(turns, &done, &found.closures) {
            found.closures.list.remove(worst);
            found.warnings.push(warning);
            done = from(data, &matrix, &found.closures)?;
        }
        if let Some(Ok(base)) = base
            && base.condition < POORLY_DETERMINED
        {
            let contradicted = contradicted(turns, &base, &done, &found.closures);
            found.warnings.extend(contradicted);
        }
        done.notes.extend(found.warnings);
        Ok(done)
    }

    /// The whole turns, and the matrix to start from, if the turns between rests do not determine it: the axes are where the maker says, and their scale
    /// factors those of `start`, or those that make the stated number of turns.
    fn alone(
        &self,
        turns: &[Turn],
        at_rest: &Vector3<f64>,
        start: Option<Matrix3<f64>>,
    ) -> Result<(Matrix3<f64>, Found), Failure> {
        let (matrix, sigma) = match (self.turns, start) {
            (Some(counted), _) => (scaled(turns, at_rest, counted)?, None),
            (None, Some(start)) => (start, Some(NOMINAL)),
            (None, None) => return Err(uncounted()),
        };
        let model = about_rest(&matrix, at_rest);
        let mut found = self.find(turns, &model, &|path, _| {
            sigma.map_or(SCALED, |share| share * path.angle)
        });
        found.closures.delivered = Some(DELIVERED);
        Ok((matrix, found))
    }
}

/// The scale factors that make turns about each axis `counted` whole ones: the median of those about it.
fn scaled(turns: &[Turn], at_rest: &Vector3<f64>, counted: u32) -> Result<Matrix3<f64>, Failure> {
    // In raw units, whose scale is not known, turns cannot be composed; their sum is near enough.
    let sum = |turn: &Turn| -> Vector3<f64> {
        let pieces = turn.increments.iter();
        pieces
            .map(|piece| Vector3::from(piece.integral) - at_rest * piece.duration_s)
            .sum()
    };
    let sums: Vec<Vector3<f64>> = turns.iter().map(sum).collect();
    let longest = sums.iter().map(Vector3::norm).fold(0.0, f64::max);
    let scale = |axis: usize| {
        let about = |sum: &&Vector3<f64>| sum.iamax() == axis && sum.norm() > 0.5 * longest;
        let mut angles: Vec<f64> = sums.iter().filter(about).map(Vector3::norm).collect();
        Some(TAU * f64::from(counted) / quantile(&mut angles, 0.5)?)
    };
    let known: Vec<f64> = (0..3).filter_map(scale).collect();
    let mean = known.iter().sum::<f64>() / known.len() as f64;
    if !mean.is_finite() {
        return Err(no_scale());
    }
    let mut scales = Vector3::from_fn(|axis, _| scale(axis).unwrap_or(mean));
    // A wobbling axis makes the sum of the turns up to 2 % shorter than the turns were; their headings tell.
    for _ in 0..CLOSED {
        let model = about_rest(&Matrix3::from_diagonal(&scales), at_rest);
        let off = turns.iter().filter_map(|turn| {
            let path = Path::of(&[*turn], &model);
            let error = ClosureError::at(&[*turn], &model, 0.0)?.block.residual[0];
            let part = turn.after.normalize().dot(&path.axis);
            let whole = (path.turns() - f64::from(counted)).abs() < 0.5 && part.abs() > 0.5;
            whole.then_some((path.axis.iamax(), error / (part * path.angle)))
        });
        let off: Vec<(usize, f64)> = off.collect();
        for axis in 0..3 {
            let own = off.iter().filter(|one| one.0 == axis);
            let count = own.clone().count().max(1) as f64;
            scales[axis] *= 1.0 - own.map(|one| one.1).sum::<f64>() / count;
        }
    }
    Ok(Matrix3::from_diagonal(&scales))
}

fn no_scale() -> Failure {
    Failure::NoSolution(
        "no scale factor of the gyro makes its turns agree with those of gravity".into(),
    )
}

fn uncounted() -> Failure {
    Failure::Undetermined {
        parameters: "C of the gyro".into(),
        add: "say how many turns each of the whole turns has, or add ten poses with turns between them: without either, the scale factor is not known well enough to count turns".into(),
    }
}

/// The model with the matrix `c` that gives zero at the reading `at_rest`.
fn about_rest(c: &Matrix3<f64>, at_rest: &Vector3<f64>) -> Affine<f64> {
    Affine {
        matrix: *c,
        offset: -c * at_rest,
    }
}

/// The whole turn whose heading errs most, if by more than the stated placement and the scatter of the others allow.
fn outlying(turns: &[Turn], done: &Estimated, closures: &Closures) -> Option<(usize, Warning)> {
    let count = closures.list.len();
    if count < 4 {
        return None;
    }
    let gyro = &done.triad.inverse;
    let c2 = gyro.matrix.norm_squared() / 3.0;
    let errors = closures.list.iter().map(|closure| {
        let own = &turns[closure.turns.clone()];
        let error = closure.error(own, gyro, closures.vertical[0]);
        (error, error * error / closures.variance(own, c2))
    });
    let errors: Vec<(f64, f64)> = errors.collect();
    let squared = |k: usize| errors[k].1;
    let worst = (0..count).max_by(|a, b| squared(*a).total_cmp(&squared(*b)))?;
    let others = (0..count).filter(|k| *k != worst).map(squared);
    let scatter = (others.sum::<f64>() / (count - 1) as f64).max(1.0);
    let sigmas = (squared(worst) / scatter).sqrt();
    let own = &turns[closures.list[worst].turns.clone()];
    (sigmas > OUTLYING).then(|| {
        let warning = Warning::WholeTurnLeftOut {
            from: own[0].steps[0],
            to: own[own.len() - 1].steps[1],
            off: errors[worst].0.abs(),
            sigmas,
        };
        (worst, warning)
    })
}

/// A warning if the whole turns contradict `base`, the gyro by the turns between rests: a person who always stops short of where the unit lay changes all scale
/// factors alike, and no whole turn contradicts another.
fn contradicted(
    turns: &[Turn],
    base: &Estimated,
    done: &Estimated,
    closures: &Closures,
) -> Option<Warning> {
    let (list, vertical) = (&closures.list, closures.vertical[0]);
    let own = |closure: &Closure| &turns[closure.turns.clone()];
    let by = |gyro: &Affine<f64>| -> Vec<f64> {
        let each = list.iter();
        each.map(|c| c.error(own(c), gyro, vertical)).collect()
    };
    let [before, after] = [base, done].map(|of| by(&of.triad.inverse));
    let c2 = done.triad.inverse.matrix.norm_squared() / 3.0;
    let known = list.iter().map(|c| closures.variance(own(c), c2));
    let known = DVector::from_iterator(list.len(), known);
    let squares = after.iter().zip(&known).map(|(error, v)| error * error / v);
    let scatter = (squares.sum::<f64>() / list.len() as f64).max(1.0);
    let errors = list.iter().map(|c| {
        let error = ClosureError::at(own(c), &base.triad.inverse, vertical)?;
        Some(error.block.by(0))
    });
    let errors = errors.collect::<Option<Vec<_>>>()?;
    let by = DMatrix::from_fn(list.len(), 12, |i, k| errors[i][k]);
    let covariance = &by * base.triad.inverse_covariance * by.transpose()
        + DMatrix::from_diagonal(&(known * scatter));
    let before = DVector::from_vec(before);
    let chi2 = before.dot(&covariance.cholesky()?.solve(&before));
    let chance = ChiSquared::new(list.len() as f64).ok()?.sf(chi2);
    let off = (before.norm_squared() / list.len() as f64).sqrt();
    (chance < CONTRADICTED).then_some(Warning::WholeTurnsContradict { off, chance })
}
