//! The classical six positions, for comparison.

use nalgebra::{Matrix3, Vector3};

use super::inputs::span;
use super::least_squares::extra_variance;
use super::{Estimated, Failure, Observation};
use crate::observable::Observable;
use crate::quantity::AXES;
use crate::triad::{Covariance, Forward, Part, Triad};

/// An input is along an axis if its part across is below this share.
const ALONG_SHARE: f64 = 0.02;

/// The classical six positions, as baseline: every axis up and down, or turned both ways. Scale factor
/// `(u⁺ - u⁻) / (x⁺ - x⁻)` and bias `(u⁺ + u⁻) / 2` of each sensor by itself; misalignments are taken to be zero.
///
/// If none is repeated, the two positions of a sensor leave its two parameters no residual. Its readings in the other four then show whether the
/// model holds: with faces 4 degrees off level and a misalignment of 2, they were off by 438 mm/s², while the noise of the two positions alone gave a
/// bias of ± 0.15 mg.
pub fn six_positions(observations: &[Observation]) -> Result<Estimated, Failure> {
    let mut model = Forward {
        matrix: Matrix3::zeros(),
        bias: Vector3::zeros(),
    };
    let (mut parts, mut scatter) = (Vec::new(), Vec::new());
    for axis in 0..3 {
        let mut covariance = Covariance::zeros();
        let mut ends = [(0.0, 0.0, 0.0, 0.0); 2]; // sums of reading, input, variance; number
        let mut used = Vec::new();
        let along = |o: &&Observation| {
            let size = o.input.norm();
            size > 1e-3 * span(observations)
                && o.input[axis].abs() > size * (1.0 - ALONG_SHARE * ALONG_SHARE).sqrt()
        };
        for o in observations.iter().filter(along) {
            let end = &mut ends[usize::from(o.input[axis] > 0.0)];
            end.0 += o.raw[axis];
            end.1 += o.input[axis];
            end.2 += o.variance[axis];
            end.3 += 1.0;
            used.push(o);
        }
        if ends.iter().any(|e| e.3 == 0.0) {
            return Err(Failure::Undetermined {
                parameters: format!("scale factor and bias {} (six-position method)", AXES[axis]),
                add: format!(
                    "add dwells with {0} along +{0} and -{0}, or use least squares",
                    AXES[axis]
                )
                .into(),
            });
        }
        let [mut down, mut up] = ends.map(|e| (e.0 / e.3, e.1 / e.3, e.2 / (e.3 * e.3)));
        let (width, middle) = (up.1 - down.1, up.1 + down.1);
        let scale = (up.0 - down.0) / width;
        model.matrix[(axis, axis)] = scale;
        model.bias[axis] = 0.5 * (up.0 + down.0 - scale * middle);
        // Repeated positions show errors beyond the noise; if there are none, those along the other axes do.
        if used.len() == 2 {
            used = observations.iter().collect();
        }
        let residuals: Vec<f64> = used
            .iter()
            .map(|o| o.raw[axis] - scale * o.input[axis] - model.bias[axis])
            .collect();
        let variances: Vec<f64> = used
            .iter()
            .map(|o| o.variance[axis].max(f64::MIN_POSITIVE))
            .collect();
        let of_axis = extra_variance(&residuals, &variances, used.len() as f64 - 2.0);
        down.2 += of_axis.extra_variance / ends[0].3;
        up.2 += of_axis.extra_variance / ends[1].3;
        scatter.push((Observable::Axis(axis), of_axis));
        // Bias at the middle of the two inputs, which is zero to the table's repeatability.
        covariance[(4 * axis, 4 * axis)] = (up.2 + down.2) / (width * width);
        covariance[(9 + axis, 9 + axis)] = 0.25 * (up.2 + down.2);
        let both = 0.5 * (up.2 - down.2) / width;
        covariance[(4 * axis, 9 + axis)] = both;
        covariance[(9 + axis, 4 * axis)] = both;
        parts.push(Part {
            covariance,
            dof: of_axis.variance_dof(),
            known: of_axis.known,
        });
    }
    let triad = Triad::from_forward(model, parts)
        .ok_or_else(|| Failure::NoSolution("a sensor does not respond".into()))?;
    Ok(Estimated {
        triad,
        scatter,
        condition: 1.0,
        delays: None,
        earth: Vec::new(),
        follows_accel: None,
        notes: Vec::new(),
    })
}
