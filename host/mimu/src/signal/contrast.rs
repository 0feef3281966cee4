//! Contrasts: what a dwell shows beyond its mean if a known input moves within it.
//!
//! A table with a level axis turns gravity through the accelerometer's axes. The mean of such a dwell shows almost nothing; the information
//! is in how the reading follows the reference. A contrast is a sum over the blocks of a dwell with weights that add to zero. The bias
//! cancels in it, and of the bias wander only the part as fast as the input remains. The weights are functions of the known inputs alone,
//! orthogonal and with mean square one. The white noise of the contrasts is therefore independent, and as large as that of the mean of the
//! dwell. Together with the mean, the contrasts contain everything that is linear in those functions. A turn at a constant rate has six
//! contrasts, however long it lasts: sine and cosine of the angle, of twice and of three times the angle. Many short segments of the dwell
//! would be more rows without more information.

use nalgebra::{DVector, Vector3};

use crate::quantity::Sensor;
use crate::signal::blocks::Condensed;
use crate::signal::course::Course;
use crate::signal::dwell::Dwell;

/// Largest number of contrasts of a dwell. A tumble about two axes has more functions; those of the inputs themselves come first.
const MOST: usize = 12;
/// Least part of a function that must be orthogonal to the earlier ones to make a contrast.
const OF_ITS_OWN: f64 = 0.05;
/// A function that varies by less than this share of its largest value counts as constant.
const STANDS: f64 = 1e-3;

/// A sum over the blocks of a dwell with weights that add to zero.
#[derive(Debug, Clone)]
pub(crate) struct Contrast {
    /// Index of the dwell.
    pub dwell: usize,
    /// Weight of each block of the dwell, in order.
    pub weights: Vec<f64>,
    /// The same sum of the known input of gyro and accelerometer, SI, and of its rate of change; `None` where it is not known.
    pub known: [Option<[Vector3<f64>; 2]>; 2],
    /// Mean time between sign changes of the weights, s: slower noise cancels.
    pub half_period_s: f64,
}

/// Functions of the inputs of a block, in the order in which they are used: the inputs, their rates of change, products of two, cubes.
fn functions(course: &Course) -> Vec<DVector<f64>> {
    let n = course.blocks.len();
    let series = |kind: usize| {
        let of = course.of.iter().flatten();
        let each =
            of.flat_map(move |s| (0..3).map(move |k| DVector::from_fn(n, |i, _| s[kind][i][k])));
        each.collect::<Vec<_>>()
    };
    let inputs = series(0);
    let mut all = inputs.clone();
    all.extend(series(1));
    for (i, a) in inputs.iter().enumerate() {
        all.extend(inputs[i..].iter().map(|b| a.component_mul(b)));
    }
    all.extend(inputs.iter().map(|a| a.map(|x| x.powi(3))));
    all
}

/// The contrasts of `dwell`, whose index is `index`, in the order of the functions; none if the inputs are constant.
pub(crate) fn contrasts(
    condensed: &Condensed,
    course: &Course,
    dwell: &Dwell,
    index: usize,
) -> Vec<Contrast> {
    if !Sensor::BOTH.iter().any(|s| dwell.moves(*s)) {
        return Vec::new();
    }
    // With each block scaled by the root of its share of the samples, a mean over the samples is a scalar product.
    let root = DVector::from_iterator(course.share.len(), course.share.iter().map(|s| s.sqrt()));
    let mut spanned = vec![root.clone()];
    for function in functions(course) {
        let largest = function.amax();
        let scaled = function.component_mul(&root);
        let centred = &scaled - &root * root.dot(&scaled);
        if !(centred.norm() > STANDS * largest) {
            continue;
        }
        let mut left = centred.clone();
        for _ in 0..2 {
            for unit in &spanned {
                left -= unit * unit.dot(&left);
            }
        }
        if left.norm() > OF_ITS_OWN * centred.norm() {
            spanned.push(left.normalize());
        }
        if spanned.len() > MOST {
            break;
        }
    }
    let contrast = |unit: &DVector<f64>| {
        let by_block = unit.component_mul(&root);
        let mut weights = vec![0.0; dwell.blocks.len()];
        for (i, w) in course.blocks.iter().zip(by_block.iter()) {
            weights[i - dwell.blocks.start] = *w;
        }
        let sum = |series: &Vec<Vector3<f64>>| -> Vector3<f64> {
            series
                .iter()
                .zip(by_block.iter())
                .map(|(x, w)| x * *w)
                .sum()
        };
        let known = course
            .of
            .each_ref()
            .map(|of| of.as_ref().map(|s| s.each_ref().map(sum)));
        let changes = unit.as_slice().windows(2).filter(|w| w[0] * w[1] < 0.0);
        let blocks = &condensed.blocks[dwell.blocks.clone()];
        Contrast {
            dwell: index,
            half_period_s: dwell.duration_s / (1 + changes.count()).clamp(2, blocks.len()) as f64,
            weights,
            known,
        }
    };
    spanned[1..].iter().map(contrast).collect()
}
