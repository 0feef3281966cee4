//! A recording cut into pieces of time, and the scatter of groups of residuals.

/// Longest piece, s: what differs by place or pose differs from piece to piece.
const PIECE_S: f64 = 5.0;
/// Pieces of a short recording: with fewer, the scatter between pieces is itself badly known.
const PIECES: f64 = 40.0;
/// A piece whose rms error by the others is this many times the median is left out.
const CONTRADICTED: f64 = 3.0;

/// Equal pieces of time.
#[derive(Debug, Clone)]
pub(crate) struct Pieces {
    from: f64,
    length: f64,
    /// How many.
    pub count: usize,
}

impl Pieces {
    /// Over the times of a series; `None` without two times.
    pub fn over(t: &[f64]) -> Option<Self> {
        let (from, to) = (*t.first()?, *t.last()?);
        let length = ((to - from) / PIECES).min(PIECE_S);
        (length > 0.0).then(|| Self {
            from,
            length,
            count: ((to - from) / length).ceil() as usize,
        })
    }

    /// The piece of a time.
    pub fn of(&self, t: f64) -> usize {
        (((t - self.from) / self.length) as usize).min(self.count - 1)
    }

    /// Which pieces the others do not contradict, by the mean squares of their held-out errors.
    pub fn kept(&self, held_out: &[f64]) -> Vec<bool> {
        let finite = held_out.iter().copied().filter(|h| h.is_finite());
        let median = mimu_recording::units::median(finite.collect()).unwrap_or(f64::NAN);
        let limit = CONTRADICTED.powi(2) * median;
        held_out.iter().map(|h| !(*h > limit)).collect()
    }

    /// Times of the pieces that are not used, neighbours together, s.
    pub fn spans(&self, used: &[bool]) -> Vec<[f64; 2]> {
        let left = used.iter().enumerate().filter(|(_, used)| !**used);
        let spans = left.map(|(k, _)| [k, k + 1].map(|k| self.from + self.length * k as f64));
        joined(spans.collect())
    }
}

/// Spans of time in their order, those that touch or overlap as one.
pub(crate) fn joined(mut spans: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    spans.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut all: Vec<[f64; 2]> = Vec::new();
    for [from, to] in spans {
        match all.last_mut() {
            Some(last) if last[1] >= from - 1e-9 => last[1] = last[1].max(to),
            _ => all.push([from, to]),
        }
    }
    all
}

/// Scatter of groups of residuals, which weighs them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Groups {
    variance: [Option<f64>; 3],
    sums: [[f64; 2]; 3],
    change: f64,
}

/// Relative change of a scatter that is none.
const SETTLED: f64 = 1e-3;

impl Groups {
    /// Begins to sum anew.
    pub fn begin(&mut self) {
        self.sums = [[0.0; 2]; 3];
    }

    /// Counts the squares of so many residuals of a group.
    pub fn count(&mut self, group: usize, squares: f64, residuals: f64) {
        self.sums[group][0] += squares;
        self.sums[group][1] += residuals;
    }

    /// The scatter is that of the residuals that were counted.
    pub fn end(&mut self) {
        self.change = 0.0;
        for (variance, [squares, count]) in self.variance.iter_mut().zip(self.sums) {
            // A group of a few residuals, or without errors, keeps a finite weight.
            let next = (count > 30.0 && squares > 0.0).then(|| squares / count);
            if let Some(next) = next {
                let before = variance.replace(next).unwrap_or(0.0);
                self.change = f64::max(self.change, (next - before).abs() / next);
            }
        }
    }

    /// Weight of a residual of a group.
    pub fn weight(&self, group: usize) -> f64 {
        let any = self.variance.iter().flatten().copied();
        let other = any.fold(f64::NAN, f64::max);
        let variance = self.variance[group].unwrap_or(other);
        if variance.is_nan() {
            1.0
        } else {
            variance.recip()
        }
    }

    /// Whether the last residuals had the scatter of those before.
    pub fn are_settled(&self) -> bool {
        self.change < SETTLED
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbouring_pieces_that_are_left_out_are_one_span() {
        let t: Vec<f64> = (0..=200).map(f64::from).collect();
        let pieces = Pieces::over(&t).unwrap();
        assert_eq!(
            (pieces.count, pieces.of(200.0), pieces.of(9.9)),
            (40, 39, 1)
        );
        let mut held = vec![1.0; 40];
        (held[3], held[4], held[20], held[7]) = (10.0, 99.0, 9.5, f64::NAN);
        let used = pieces.kept(&held);
        assert_eq!(pieces.spans(&used), [[15.0, 25.0], [100.0, 105.0]]);
    }

    #[test]
    fn a_group_weighs_by_its_scatter_and_a_small_one_as_the_widest() {
        let mut groups = Groups::default();
        assert_eq!(groups.weight(1), 1.0);
        groups.begin();
        groups.count(0, 400.0, 100.0);
        groups.count(1, 1.0, 3.0);
        groups.end();
        assert_eq!((groups.weight(0), groups.weight(1)), (0.25, 0.25));
        assert!(!groups.are_settled());
        groups.end();
        assert!(groups.are_settled());
    }
}
