//! Optima by trial, independent of the code under test.

/// Best value of `criterion` over points in a box, from many random starts by shrinking random steps: slow, and without any code under test.
pub fn best(variables: usize, within: f64, criterion: impl Fn(&[f64]) -> f64) -> f64 {
    let mut state = 7_u64;
    let mut uniform = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    let mut best = 0.0_f64;
    for _ in 0..12 {
        let mut x: Vec<f64> = (0..variables).map(|_| within * uniform()).collect();
        let mut value = criterion(&x);
        let mut step = 1.0;
        while step > 1e-7 {
            let mut better = 0;
            for _ in 0..20 * variables {
                let mut next = x.clone();
                let k = ((uniform() + 1.0) * 0.5 * variables as f64) as usize % variables;
                next[k] = (next[k] + step * uniform()).clamp(-within, within);
                let new = criterion(&next);
                if new > value {
                    (x, value) = (next, new);
                    better += 1;
                }
            }
            if better < 2 * variables {
                step /= 2.0;
            }
        }
        best = best.max(value);
    }
    best
}
