//! Whether known inputs distinguish the scale factors, cross terms and biases of a triad.

use mimu::quantity::{AXES, Sensor};
use mimu_recording::error::{Error, Result};
use nalgebra::{Matrix4, Vector3, Vector4};

/// Smallest eigenvalue of the correlation of inputs and bias that determines all of them.
const SMALLEST_EIGENVALUE: f64 = 1e-5;
/// The same for inputs that suffice without others: six faces have 1.
const WELL_APART: f64 = 0.1;

/// Smallest eigenvalue of the correlation of three inputs and a bias, and its direction, by their sums of products.
fn weakest(gram: &Matrix4<f64>) -> (f64, Vector4<f64>) {
    let scale = gram
        .diagonal()
        .map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    let correlation = Matrix4::from_fn(|i, j| gram[(i, j)] * scale[i] * scale[j]);
    let eigen = correlation.symmetric_eigen();
    let weakest = eigen.eigenvalues.imin();
    let along = eigen.eigenvectors.column(weakest).into_owned();
    (eigen.eigenvalues[weakest], along)
}

/// Whether these inputs distinguish all scale factors, cross terms and biases well.
pub fn tells_apart(inputs: impl Iterator<Item = Vector3<f64>>) -> bool {
    let products = inputs.map(|x| {
        let x = x.push(1.0);
        x * x.transpose()
    });
    weakest(&products.sum()).0 > WELL_APART
}

/// Refuses inputs that leave a parameter undetermined, and names it.
pub fn check(gram: &Matrix4<f64>, sensor: Sensor) -> Result<()> {
    let (eigenvalue, along) = weakest(gram);
    if eigenvalue > SMALLEST_EIGENVALUE {
        return Ok(());
    }
    let axis = (0..3)
        .max_by(|a, b| along[*a].abs().total_cmp(&along[*b].abs()))
        .unwrap_or(0);
    let (problem, remedy) = match sensor {
        Sensor::Gyro => (
            format!(
                "no turn distinguishes its scale factors along {} from its biases",
                AXES[axis]
            ),
            "turn about every axis in both directions at all temperatures",
        ),
        Sensor::Accel => (
            format!(
                "no pose distinguishes its scale factors along {} from its biases",
                AXES[axis]
            ),
            "point every axis up and down at all temperatures",
        ),
    };
    Err(Error::undetermined(sensor, problem, remedy))
}
