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
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use crate::calibration::Calibration;
use crate::estimate::earth_shared;
use crate::estimate::least_squares::{Errors, Group, Observability, Solution, solve_groups};
use crate::factor::{Factors, Kind};
use crate::fit::by_rate::magnitudes;
use crate::observable::Observable;
use crate::observation::{ByTriad, of_output, vector};
use crate::prepared::{Prepared, si_covariance};
use crate::quantity::Sensor;
use crate::triad::{Covariance, Forward};
use crate::turntable::RatedDwells;
use mimu_recording::Reference;

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

/// Rows of one group of errors: of each triad a column for each of d, then for each entry of A.
struct Rows {
    design: DMatrix<f64>,
    errors: DVector<f64>,
    variances: DVector<f64>,
}

/// Columns of a triad.
const OF_TRIAD: usize = 12;

/// Derivatives by d, then by A.
fn d_and_a(by: &ByTriad) -> ByTriad {
    ByTriad::from_fn(|k, _| by[(k + 9) % OF_TRIAD])
}

impl Rows {
    /// Those of each group of `factors`, by what the calibrations of `triads` err by: a calibration is (1 + A) C and (1 + A) o + d of the true one.
    fn of_groups(factors: &Factors, triads: &[(Sensor, &Affine<f64>)]) -> Vec<Self> {
        let values = factors.values(triads);
        let (at, variances) = (factors.at(&values), factors.variances(&values));
        let mut design = DMatrix::zeros(variances.len(), OF_TRIAD * triads.len());
        for (factor, rows) in factors.list.iter().zip(factors.ranges()) {
            // A multiplies the true input: that of a known size, where the measured one contains the error, and none at rest.
            let input = match factor.kind {
                Kind::Magnitude { known, .. } => known / (known + at.residuals[rows.start]),
                Kind::Rest(..) => 0.0,
                _ => 1.0,
            };
            for (i, (k, (_, model))) in
                rows.flat_map(|i| triads.iter().enumerate().map(move |t| (i, t)))
            {
                let first = OF_TRIAD * k;
                let by = at.jacobian.fixed_view::<1, OF_TRIAD>(i, first).transpose();
                let mut by = of_output(&by, model);
                by.fixed_rows_mut::<9>(0).scale_mut(input);
                let mut own = design.fixed_view_mut::<1, OF_TRIAD>(i, first);
                own.copy_from(&d_and_a(&by).transpose());
            }
        }
        let group = |(_, rows): (Option<Observable>, Range<usize>)| Self {
            design: design.rows_range(rows.clone()).into_owned(),
            errors: at.residuals.rows_range(rows.clone()).into_owned(),
            variances: DVector::from_column_slice(&variances[rows]),
        };
        factors.groups().map(group).collect()
    }

    /// The same with a column for each of these sums of columns.
    fn by(&self, sums: &[Vec<usize>]) -> Self {
        let design = DMatrix::from_fn(self.errors.len(), sums.len(), |i, k| {
            sums[k].iter().map(|j| self.design[(i, *j)]).sum()
        });
        Self {
            design,
            errors: self.errors.clone(),
            variances: self.variances.clone(),
        }
    }

    fn group(&self, kept: &[usize]) -> Group {
        Group {
            design: self.design.select_columns(kept),
            observations: self.errors.clone(),
            errors: Errors::Independent(self.variances.clone()),
        }
    }
}

/// The unknowns of a triad, d and A, as sums of its columns, which begin at `from`. Magnitudes show the symmetric part of A only.
fn unknowns(from: usize, symmetric: bool) -> [Vec<Vec<usize>>; 2] {
    let entry = |i: usize, j: usize| from + 3 + 3 * i + j;
    let all = (0..3).flat_map(|i| (0..3).map(move |j| (i, j)));
    let of_a = all.filter_map(|(i, j)| match symmetric && i != j {
        true => (i < j).then(|| vec![entry(i, j), entry(j, i)]),
        false => Some(vec![entry(i, j)]),
    });
    [(from..from + 3).map(|k| vec![k]).collect(), of_a.collect()]
}

/// The errors of `sensor` in this recording; the first group is judged. `None` if nothing shows them.
fn rows(
    prepared: &Prepared,
    sensor: Sensor,
    model: &Affine<f64>,
    accel: Option<&Affine<f64>>,
) -> Option<Vec<Rows>> {
    let own = [(sensor, model)];
    Some(match (prepared.manifest.reference, sensor) {
        (Reference::Table, _) => vec![known(prepared, sensor, model)?],
        (Reference::Gravity | Reference::TurntableRate, Sensor::Accel) => {
            Rows::of_groups(&prepared.magnitudes(model), &own)
        }
        (Reference::TurntableRate, Sensor::Gyro) => {
            let dwells = RatedDwells::of(prepared).ok()?;
            let mut factors = magnitudes(&dwells, model);
            factors.rests(&dwells.rests);
            Rows::of_groups(&factors, &own)
        }
        (Reference::Gravity, Sensor::Gyro) => {
            let accel = accel?;
            let (turns, _) = prepared.turns(accel);
            let mut factors = Factors::of_turns(&turns);
            factors.rests(&prepared.rest(accel));
            factors.list.extend(prepared.magnitudes(accel).list);
            let both = [(sensor, model), (Sensor::Accel, accel)];
            (!turns.is_empty()).then(|| Rows::of_groups(&factors, &both))?
        }
    })
}

/// The causes of the errors of `sensor`; `None` if the recording does not distinguish them.
pub(super) fn of(
    prepared: &Prepared,
    sensor: Sensor,
    model: &Affine<f64>,
    accel: Option<&Affine<f64>>,
) -> Option<Causes> {
    let rows = rows(prepared, sensor, model, accel)?;
    let by_turns = rows.first()?.design.ncols() > OF_TRIAD;
    let known = prepared.manifest.reference == Reference::Table;
    let mut causes = unknowns(0, !known && !by_turns).to_vec();
    if by_turns {
        causes.push(unknowns(OF_TRIAD, true).concat());
    }
    separate(&rows, &causes)
}

/// Errors at known inputs.
fn known(prepared: &Prepared, sensor: Sensor, model: &Affine<f64>) -> Option<Rows> {
    let forward = Forward::of(model)?;
    let all = earth_shared::likely(&prepared.observations(sensor), &forward.matrix);
    let n = 3 * all.len();
    let (mut design, mut errors, mut variances) = (
        DMatrix::zeros(n, OF_TRIAD),
        DVector::zeros(n),
        DVector::zeros(n),
    );
    for (k, o) in all.iter().enumerate() {
        let rows = 3 * k;
        let error = vector::at(model, &o.raw, &o.input).residual;
        errors.fixed_rows_mut::<3>(rows).copy_from(&error);
        let covariance = si_covariance(&model.matrix, &o.variance);
        variances
            .fixed_rows_mut::<3>(rows)
            .copy_from(&covariance.diagonal());
        let by = vector::at(&Affine::identity(), &o.input, &o.input);
        for i in 0..3 {
            design.set_row(rows + i, &d_and_a(&by.by(i)).transpose());
        }
    }
    Some(Rows {
        design,
        errors,
        variances,
    })
}

/// How uncertain the parameters of each sensor are: the covariance of C by rows and o, and the half-width of a 95 % interval in standard deviations.
pub(super) type Uncertainty<'a> = &'a dyn Fn(Sensor) -> Option<(Covariance, f64)>;

/// Rms of the errors of `sensor` in this recording that this uncertainty of its parameters causes: the largest in 95 % of cases. For the turns of a gyro, that of the
/// accelerometer's directions too. `None` if it is not known.
pub(super) fn announced(
    prepared: &Prepared,
    sensor: Sensor,
    calibration: &Calibration,
    uncertainty: Uncertainty,
) -> Option<f64> {
    let model = calibration.inverse(sensor)?;
    let (own, sigmas) = of_errors(&model, uncertainty(sensor)?)?;
    let accel = calibration.inverse(Sensor::Accel);
    let rows = rows(prepared, sensor, &model, accel.as_ref())?
        .into_iter()
        .next()?;
    let (n, triads) = (rows.design.nrows(), rows.design.ncols() / OF_TRIAD);
    // Errors of each observation: one for a magnitude, two for a turn.
    let each = triads as f64;
    let known = accel.zip(uncertainty(Sensor::Accel));
    let of_accel = known.and_then(|(accel, known)| of_errors(&accel, known));
    let of_accel = of_accel.map_or_else(Covariance::zeros, |known| known.0);
    // Of A of the accelerometer only the symmetric part counts.
    let transposed = |k: usize| match k {
        0..3 => k,
        k => 3 + 3 * (k % 3) + (k - 3) / 3,
    };
    let symmetric = Covariance::from_fn(|i, j| {
        0.5 * (f64::from(u8::from(i == j)) + f64::from(u8::from(i == transposed(j))))
    });
    let parts = [own, symmetric * of_accel * symmetric];
    let square = |(k, covariance): (usize, &Covariance)| {
        let by = rows.design.columns(OF_TRIAD * k, OF_TRIAD);
        (by * covariance).component_mul(&by).sum()
    };
    let sum: f64 = parts.iter().take(triads).enumerate().map(square).sum();
    (n > 0).then(|| sigmas * (each * sum.max(0.0) / n as f64).sqrt())
}

/// The covariance of d and A instead of C and o.
pub(super) fn of_errors(
    model: &Affine<f64>,
    (covariance, sigmas): (Covariance, f64),
) -> Option<(Covariance, f64)> {
    let changes = |k: usize| d_and_a(&of_output(&ByTriad::ith(k, 1.0), model));
    let changes: [ByTriad; OF_TRIAD] = std::array::from_fn(changes);
    let by = Covariance::from_columns(&changes)
        .transpose()
        .try_inverse()?;
    Some((by * covariance * by.transpose(), sigmas))
}

/// Separates the mean square of the first group into what the unknowns of each cause explain: bias, matrix and, if there is a third, the accelerometer.
/// Unknowns of inputs that the recording lacks are dropped.
fn separate(groups: &[Rows], causes: &[Vec<Vec<usize>>]) -> Option<Causes> {
    let groups: Vec<Rows> = groups.iter().map(|g| g.by(&causes.concat())).collect();
    let ends = causes.iter().scan(0, |end, cause| {
        *end += cause.len();
        Some(*end - cause.len()..*end)
    });
    let size = |j: &usize| {
        let norms = groups.iter().map(|g| g.design.column(*j).norm());
        norms.sum::<f64>()
    };
    let columns = groups.first()?.design.ncols();
    let kept: Vec<usize> = (0..columns).filter(|j| size(j) > 0.0).collect();
    let count: usize = groups.iter().map(|g| g.errors.len()).sum();
    if count <= kept.len() || groups[0].errors.is_empty() || !determined(&groups, &kept) {
        return None;
    }
    let by_group: Vec<Group> = groups.iter().map(|g| g.group(&kept)).collect();
    let (solution, _) = solve_groups(&by_group)?;
    let judged = &by_group[0];
    let of = |range: Range<usize>| {
        let ours = (0..kept.len()).filter(|k| range.contains(&kept[*k]));
        Part::of(judged, &solution, &ours.collect::<Vec<_>>())
    };
    let mut parts: Vec<Part> = ends.map(of).collect();
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
    let rows = groups.iter().flat_map(|group| {
        let sigmas = group.variances.map(|v| v.max(f64::MIN_POSITIVE).sqrt());
        let rows = group.design.select_columns(kept);
        let each = (0..sigmas.len()).map(move |i| rows.row(i) / sigmas[i]);
        each.collect::<Vec<_>>()
    });
    let mut white = DMatrix::from_rows(&rows.collect::<Vec<_>>());
    for mut column in white.column_iter_mut() {
        column.normalize_mut();
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
