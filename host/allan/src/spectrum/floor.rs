//! The floor of a spectrum: its level at each frequency without lines and bumps.

/// Frequency at the near end of a window over that of the floor, a quarter of an octave, and at its far end, an octave and a half. With
/// windows up to the frequency itself and half as far, a bump as wide as a third of its frequency raised its own floor: it was found in 3
/// of 40 records, although it was 14 times as high as the floor.
const NEAR: f64 = 1.19;
pub(super) const REACH: f64 = 2.83;
/// First bin that has a floor: below it there are too few bins for the window beneath.
pub(super) const FIRST: usize = 8;
/// Floors are computed this many times in an octave and interpolated.
const PER_OCTAVE: f64 = 12.0;
/// Bins that a window needs.
const FEWEST: usize = 3;

/// Floor at one frequency.
#[derive(Debug, Clone, Copy)]
pub(super) struct Level {
    /// The floor itself: between the medians of both sides, on a straight line over logarithms.
    pub between: f64,
    /// The highest of it and both medians. Only what exceeds this stands out: at the edge of a filter's band the spectrum stands above the
    /// line between both sides, and on the slope of a random walk above one of them.
    pub highest: f64,
    /// Bins of the smaller window.
    pub bins: f64,
}

/// Floor of a spectrum.
#[derive(Debug, Clone)]
pub(super) struct Floor {
    /// Logarithms of the bin, of both levels; and the number of bins.
    knots: Vec<[f64; 4]>,
}

impl Floor {
    /// From densities by bin, each of `dof` degrees of freedom.
    pub fn of(power: &[f64], dof: f64) -> Self {
        let last = power.len().saturating_sub(2);
        // Median of a chi-square over its mean (Wilson and Hilferty).
        let bias = 3.0 * (1.0 - 2.0 / (9.0 * dof)).ln();
        let median = |from: usize, to: usize| {
            if to < from {
                return None;
            }
            let mut window: Vec<f64> = power[from..=to].to_vec();
            let n = window.len();
            (n >= FEWEST && window.iter().all(|p| *p > 0.0)).then(|| {
                let (_, middle, _) = window.select_nth_unstable_by(n / 2, f64::total_cmp);
                let centre = 0.5 * (from + to) as f64;
                (centre.ln(), middle.ln() - bias, n as f64)
            })
        };
        let knot = |at: f64| {
            let below = median((at / REACH).ceil() as usize, (at / NEAR) as usize)?;
            let above = median(
                (at * NEAR).ceil() as usize,
                ((at * REACH).floor() as usize).min(last),
            );
            let x = at.ln();
            let (between, highest, bins) = match above {
                Some(above) => {
                    let slope = (above.1 - below.1) / (above.0 - below.0);
                    let between = below.1 + slope * (x - below.0);
                    (
                        between,
                        between.max(below.1).max(above.1),
                        below.2.min(above.2),
                    )
                }
                None => (below.1, below.1, below.2),
            };
            Some([x, between, highest, bins])
        };
        let octaves = (last.max(FIRST) as f64 / FIRST as f64).log2();
        let steps = (PER_OCTAVE * octaves).ceil() as usize;
        let knots = (0..=steps)
            .map(|i| FIRST as f64 * 2f64.powf(i as f64 / PER_OCTAVE))
            .map(|at| at.min(last as f64))
            .filter_map(knot)
            .collect();
        Self { knots }
    }

    /// At `bin`, from [`FIRST`] on; below, that of [`FIRST`]. `None` for a spectrum too short to have one.
    pub fn at(&self, bin: usize) -> Option<Level> {
        let x = (bin.max(1) as f64).ln();
        let above = self.knots.partition_point(|knot| knot[0] < x);
        let after = self.knots.get(above).or(self.knots.last())?;
        let before = &self.knots[above.saturating_sub(1)];
        let share = match after[0] > before[0] {
            true => ((x - before[0]) / (after[0] - before[0])).clamp(0.0, 1.0),
            false => 0.0,
        };
        let at = |i: usize| before[i] + share * (after[i] - before[i]);
        Some(Level {
            between: at(1).exp(),
            highest: at(2).exp(),
            bins: at(3),
        })
    }
}
