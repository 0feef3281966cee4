//! What a dwell shows beside its mean, where a known input moves within it: contrasts.
//!
//! A table whose axis is level turns gravity through the accelerometer's axes. The mean of such a dwell says next to nothing; what says
//! something is how the reading follows the reference. A contrast is a sum over the blocks of a dwell whose weights add to zero: the
//! bias is not in it, and of what a bias wanders only the part that goes as fast as the input. The weights are functions of the known
//! inputs alone, orthogonal and of mean square one: of white noise each contrast has a share of its own, as large as that of the mean of the
//! dwell, and together with the mean they hold all that is linear in those functions. A turn at a constant rate has six, however
//! long it lasts: sine and cosine of the angle, of twice and of three times it. As many short stretches of the dwell would be more rows
//! and hold no more.

use nalgebra::{DVector, Vector3};

use crate::quantity::Sensor;
use crate::signal::blocks::Condensed;
use crate::signal::course::Course;
use crate::signal::dwell::Dwell;

/// Most contrasts of a dwell. A tumble about two axes has more functions than that; those of the inputs themselves come first.
const MOST: usize = 12;
/// Part of a function that has to be its own for a contrast.
const OF_ITS_OWN: f64 = 0.05;
/// A function that moves by less than this share of its largest value stands.
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
    /// Mean time between changes of sign of the weights, s: noise that is slower is not in it.
    pub half_period_s: f64,
}

/// Functions of the inputs of a block, in the order in which they are taken: the inputs, how they change, products of two, cubes.
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

/// The contrasts of `dwell`, the one of index `index`, in order of what they say; none where the input stands.
pub(crate) fn contrasts(
    condensed: &Condensed,
    course: &Course,
    dwell: &Dwell,
    index: usize,
) -> Vec<Contrast> {
    if !Sensor::BOTH.iter().any(|s| dwell.moves(*s)) {
        return Vec::new();
    }
    // In units in which the mean over the samples is a scalar product.
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
