//! Why a calibration errs on another recording: a bias that has changed since, a matrix that is wrong, or neither.
//!
//! With a unit of `u = P x + b`, a calibration of C and o gives `C u + o`. Its error is `A x + d`, with the matrix error `A = C P - 1` and the
//! bias error `d = C b + o`, both SI. It is linear in A and d, so both are found by least squares from the errors that the recording shows:
//!
//! - at known inputs, the error itself;
//! - where only the magnitude of x is known, its part along x: `n·(A x + d)`. It shows the symmetric part of A only;
//! - for a gyro judged by gravity, the direction errors of the turns and the rates at rest. The directions come from the accelerometer,
//!   so A and d of that are estimated too, from its magnitudes and from the turns.

use std::ops::Range;

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, SVector, Vector3};
use serde::Serialize;

use crate::calibration::Calibration;
use crate::estimate::least_squares::{Errors, Group, Observability, Solution, solve_groups};
use crate::factor::{Factor, Factors, Kind};
use crate::judging::Judging;
use crate::observable::Observable;
use crate::observation::{ByTriad, of_output, slope};
use crate::prepared::Prepared;
use crate::quantity::{Figure, Sensor};
use crate::triad::Covariance;

/// Half-width of a 95 % interval in standard deviations.
pub(super) const INTERVAL: f64 = 1.96;
/// Condition of the design above which bias and matrix look alike.
const ALIKE: f64 = 300.0;

/// Part of a mean square error that a cause explains, with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Share {
    /// Estimate, from 0 to 1.
    pub value: f64,
    /// Lower end.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
}

/// Causes of the error of a sensor. The values of all shares add up to 1; `rest` is what neither explains, noise included.
#[derive(Debug, Clone, Serialize)]
pub struct Causes {
    /// A bias that has changed since the calibration.
    pub bias: Share,
    /// A wrong matrix: scale factors, misalignment, non-orthogonality.
    pub matrix: Share,
    /// For a gyro judged by gravity: errors of the accelerometer's directions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accel: Option<Share>,
    /// Neither.
    pub rest: Share,
    /// Output without input, x, y, z, SI: the bias has changed by this since the calibration.
    pub bias_change: [f64; 3],
    /// Half of the 95 % interval of each.
    pub bias_change_interval: [f64; 3],
}

/// Rows of one group of errors: a column for each of d, then for each entry of A.
struct Rows {
    design: DMatrix<f64>,
    errors: DVector<f64>,
    variances: DVector<f64>,
}

/// A triad with its calibration, and the columns of its d and A.
type Columns<'a> = (Sensor, &'a Affine<f64>, fn(&ByTriad) -> Vec<f64>);

impl Rows {
    fn of(rows: Vec<(Vec<f64>, f64, f64)>, columns: usize) -> Self {
        let n = rows.len();
        Self {
            design: DMatrix::from_fn(n, columns, |i, j| rows[i].0[j]),
            errors: DVector::from_fn(n, |i, _| rows[i].1),
            variances: DVector::from_fn(n, |i, _| rows[i].2),
        }
    }

    /// Those of each group of `factors`, by what the calibrations of `triads` err by: a calibration is (1 + A) C and (1 + A) o + d of the true one.
    fn of_groups(factors: &Factors, triads: &[Columns]) -> Vec<Self> {
        let models: Vec<_> = triads
            .iter()
            .map(|(sensor, model, _)| (*sensor, *model))
            .collect();
        let values = factors.values(&models);
        let (at, variances) = (factors.at(&values), factors.variances(&values));
        let of_rows = factors.list.iter().zip(factors.ranges());
        let of_rows: Vec<(&Factor, usize)> = of_rows
            .flat_map(|(factor, rows)| rows.map(move |row| (factor, row)))
            .collect();
        let row = |i: usize| {
            let of_triad = |(k, (_, model, columns)): (usize, &Columns)| {
                let by = at.jacobian.fixed_view::<1, 12>(i, 12 * k).transpose();
                let by_output = of_output(&by, model);
                columns(&of_input(of_rows[i].0, by_output, at.residuals[i]))
            };
            let by: Vec<f64> = triads.iter().enumerate().flat_map(of_triad).collect();
            (by, at.residuals[i], variances[i])
        };
        let group = |(_, rows): (Option<Observable>, Range<usize>)| {
            let rows: Vec<_> = rows.map(&row).collect();
            let columns = rows.first().map_or(0, |row| row.0.len());
            Self::of(rows, columns)
        };
        factors.groups().map(group).collect()
    }

    fn group(&self, kept: &[usize]) -> Group {
        Group {
            design: self.design.select_columns(kept),
            observations: self.errors.clone(),
            errors: Errors::Independent(self.variances.clone()),
        }
    }
}

/// Symmetric entries of A: xx, yy, zz, xy, xz, yz.
const SYMMETRIC: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];
/// Columns of d and of the symmetric part of A.
const OF_MAGNITUDE: usize = 9;
/// Columns of d and of A.
const OF_TRIAD: usize = 12;

/// Derivatives by d, then by A.
fn all(by: &ByTriad) -> Vec<f64> {
    (9..12).chain(0..9).map(|k| by[k]).collect()
}

/// Derivatives by d and the symmetric part of A.
fn symmetric(by: &ByTriad) -> Vec<f64> {
    let of_a = SYMMETRIC.map(|(i, j)| match i == j {
        true => by[4 * i],
        false => by[3 * i + j] + by[3 * j + i],
    });
    (9..12).map(|k| by[k]).chain(of_a).collect()
}

/// A row's derivatives, which are by the output, by the true input: that of a known size, where the output contains the error, and none at rest.
fn of_input(factor: &Factor, mut by: ByTriad, residual: f64) -> ByTriad {
    match &factor.kind {
        Kind::Magnitude { known, .. } => {
            let share = known / (known + residual);
            by.fixed_rows_mut::<9>(0).scale_mut(share);
            by
        }
        Kind::Input { known, .. } => {
            let along = by.fixed_rows::<3>(9).into_owned();
            match factor.group {
                Some(Observable::Rest) => slope(&along, &Vector3::zeros()),
                _ => slope(&along, known),
            }
        }
        _ => by,
    }
}

/// The errors that judge a triad, group by group: those that its figure describes, then the rates at rest, then the magnitudes that its directions come from.
fn rows(prepared: &Prepared, judging: &Judging, calibration: &Calibration) -> Option<Vec<Rows>> {
    let model = calibration.inverse(judging.sensor)?;
    let accel = calibration.inverse(Sensor::Accel);
    let mut factors = judging.factors.clone();
    factors.rests(&judging.rests);
    let columns = match judging.figure {
        Figure::Input | Figure::Direction => all,
        Figure::GravityMagnitude | Figure::RateMagnitude => symmetric,
    };
    let mut triads: Vec<Columns> = vec![(judging.sensor, &model, columns)];
    if judging.figure == Figure::Direction {
        let accel = accel.as_ref()?;
        factors.list.extend(prepared.magnitudes(accel).0.list);
        triads.push((Sensor::Accel, accel, symmetric));
    }
    Some(Rows::of_groups(&factors, &triads))
}

/// The causes of the errors of a triad; `None` if the recording does not distinguish them.
pub(super) fn of(
    prepared: &Prepared,
    judging: &Judging,
    calibration: &Calibration,
) -> Option<Causes> {
    let rows = rows(prepared, judging, calibration)?;
    let causes = match judging.figure {
        Figure::Input => &[0..3, 3..12][..],
        Figure::GravityMagnitude | Figure::RateMagnitude => &[0..3, 3..9],
        Figure::Direction => &[0..3, 3..12, 12..21],
    };
    separate(&rows, causes)
}

/// How uncertain the parameters of each sensor are: the covariance of C by rows and o, and the half-width of a 95 % interval in standard deviations.
pub(super) type Uncertainty<'a> = &'a dyn Fn(Sensor) -> Option<(Covariance, f64)>;

/// Rms of the errors of `sensor` in this recording that this uncertainty of its parameters causes: the largest in 95 % of cases. For the turns of a gyro, that of the
/// accelerometer's directions too. `None` if it is not known.
pub(super) fn announced(
    prepared: &Prepared,
    judging: &Judging,
    calibration: &Calibration,
    uncertainty: Uncertainty,
) -> Option<f64> {
    let sensor = judging.sensor;
    let model = calibration.inverse(sensor)?;
    let (own, sigmas) = of_errors(&model, uncertainty(sensor)?)?;
    let mut of_accel = Covariance::zeros();
    // A turn has two errors, and its figure is their size.
    let mut each = 1.0;
    if judging.figure == Figure::Direction {
        each = 2.0;
        if let Some(known) = uncertainty(Sensor::Accel) {
            of_accel = of_errors(&calibration.inverse(Sensor::Accel)?, known)?.0;
        }
    }
    let rows = rows(prepared, judging, calibration)?.swap_remove(0);
    let square = |row: &[f64]| {
        let part = |row: &[f64], covariance: &Covariance| {
            let by = spread(row);
            by.dot(&(covariance * by))
        };
        match row.len() {
            n if n > OF_TRIAD => part(&row[..OF_TRIAD], &own) + part(&row[OF_TRIAD..], &of_accel),
            _ => part(row, &own),
        }
    };
    let n = rows.design.nrows();
    let row = |i: usize| -> Vec<f64> { rows.design.row(i).iter().copied().collect() };
    let sum: f64 = (0..n).map(|i| square(&row(i))).sum();
    (n > 0).then(|| sigmas * (each * sum.max(0.0) / n as f64).sqrt())
}

/// The covariance of d and A instead of C and o.
pub(super) fn of_errors(
    model: &Affine<f64>,
    (covariance, sigmas): (Covariance, f64),
) -> Option<(Covariance, f64)> {
    let by = changes(model)?;
    Some((by * covariance * by.transpose(), sigmas))
}

/// Derivatives of d and A by C by rows and o.
fn changes(model: &Affine<f64>) -> Option<Covariance> {
    let rows: [Vec<f64>; 12] =
        std::array::from_fn(|k| all(&of_output(&ByTriad::ith(k, 1.0), model)));
    Covariance::from_fn(|k, j| rows[k][j]).try_inverse()
}

/// A row's derivatives by d and A; one by d and the symmetric part of A is spread over both halves. Columns of the accelerometer are left out.
fn spread(row: &[f64]) -> SVector<f64, 12> {
    let mut by = SVector::<f64, 12>::zeros();
    if row.len() != OF_MAGNITUDE {
        by.copy_from_slice(&row[..OF_TRIAD]);
        return by;
    }
    by.fixed_rows_mut::<3>(0).copy_from_slice(&row[..3]);
    for ((i, j), value) in SYMMETRIC.iter().zip(&row[3..]) {
        by[3 + 3 * i + j] += 0.5 * value;
        by[3 + 3 * j + i] += 0.5 * value;
    }
    by
}

/// Separates the mean square of the first group into what each range of columns explains: bias, matrix and, if there is a third, the accelerometer.
/// Columns of inputs that the recording lacks are dropped.
fn separate(groups: &[Rows], causes: &[Range<usize>]) -> Option<Causes> {
    let columns = groups.first()?.design.ncols();
    let size = |j: usize| {
        groups
            .iter()
            .map(|g| g.design.column(j).norm())
            .sum::<f64>()
    };
    let kept: Vec<usize> = (0..columns).filter(|j| size(*j) > 0.0).collect();
    let count: usize = groups.iter().map(|g| g.errors.len()).sum();
    if count <= kept.len() || groups[0].errors.is_empty() || !determined(groups, &kept) {
        return None;
    }
    let by_group: Vec<Group> = groups.iter().map(|g| g.group(&kept)).collect();
    let (solution, _) = solve_groups(&by_group)?;
    let judged = &by_group[0];
    let of = |range: &Range<usize>| {
        let ours = (0..kept.len()).filter(|k| range.contains(&kept[*k]));
        Part::of(judged, &solution, &ours.collect::<Vec<_>>())
    };
    let mut parts: Vec<Part> = causes.iter().map(of).collect();
    let rest = &judged.observations - &judged.design * &solution.parameters;
    let dof = (count - kept.len()) as f64;
    parts.push(Part {
        square: rest.norm_squared(),
        sigma: rest.norm_squared() * (2.0 / dof).sqrt(),
    });
    let total: f64 = parts.iter().map(|p| p.square).sum();
    let shares: Vec<Share> = parts.iter().map(|p| p.share(total)).collect();
    let change = |k: usize| kept.iter().position(|column| *column == k);
    let at = |k: usize| change(k).map_or(0.0, |p| solution.parameters[p]);
    let half =
        |k: usize| change(k).map_or(f64::NAN, |p| INTERVAL * solution.covariance[(p, p)].sqrt());
    Some(Causes {
        bias: shares[0],
        matrix: shares[1],
        accel: shares.get(2).copied().filter(|_| causes.len() > 2),
        rest: shares[causes.len()],
        bias_change: [0, 1, 2].map(at),
        bias_change_interval: [0, 1, 2].map(half),
    })
}

/// Whether the errors distinguish all columns.
fn determined(groups: &[Rows], kept: &[usize]) -> bool {
    let rows: usize = groups.iter().map(|g| g.errors.len()).sum();
    let mut white = DMatrix::zeros(rows, kept.len());
    let mut from = 0;
    for group in groups {
        for (i, row) in group.design.row_iter().enumerate() {
            let sigma = group.variances[i].max(f64::MIN_POSITIVE).sqrt();
            for (k, column) in kept.iter().enumerate() {
                white[(from + i, k)] = row[*column] / sigma;
            }
        }
        from += group.errors.len();
    }
    for mut column in white.column_iter_mut() {
        let norm = column.norm();
        column /= norm;
    }
    Observability::of(&white).condition < ALIKE
}

/// Sum of squares that a cause explains, and its standard deviation.
struct Part {
    square: f64,
    sigma: f64,
}

impl Part {
    /// With estimates β of covariance V and `G = Xᵀ X`, `βᵀ G β` exceeds the true sum of squares by the trace of `G V` on average, and has the
    /// variance `4 βᵀ G V G β + 2 tr (G V)²`.
    fn of(judged: &Group, solution: &Solution, ours: &[usize]) -> Self {
        let x = judged.design.select_columns(ours);
        let beta = DVector::from_iterator(ours.len(), ours.iter().map(|k| solution.parameters[*k]));
        let v = DMatrix::from_fn(ours.len(), ours.len(), |i, j| {
            solution.covariance[(ours[i], ours[j])]
        });
        let g = x.tr_mul(&x);
        let gv = &g * &v;
        let with_g = &g * &beta;
        let variance = 4.0 * with_g.dot(&(&v * &with_g)) + 2.0 * (&gv * &gv).trace();
        Self {
            square: (beta.dot(&with_g) - gv.trace()).max(0.0),
            sigma: variance.max(0.0).sqrt(),
        }
    }

    fn share(&self, total: f64) -> Share {
        let others = total - self.square;
        let of = |square: f64| {
            let square = square.max(0.0);
            if square + others > 0.0 {
                square / (square + others)
            } else {
                0.0
            }
        };
        Share {
            value: of(self.square),
            lower: of(self.square - INTERVAL * self.sigma),
            upper: of(self.square + INTERVAL * self.sigma),
        }
    }
}
