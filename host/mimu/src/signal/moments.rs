//! Moments of a raw channel over a block, and the rails that samples are masked by.

/// Moments of one raw channel over one block.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Moments {
    /// Number of samples that are numbers.
    pub n: u32,
    /// Their mean, raw units.
    pub mean: f64,
    /// Sum of squared deviations from the mean.
    pub m2: f64,
    /// Smallest sample.
    pub min: f64,
    /// Largest sample.
    pub max: f64,
    /// How many samples equal `min`.
    pub at_min: u32,
    /// How many samples equal `max`.
    pub at_max: u32,
    /// Longest run of identical samples.
    pub run: u32,
    /// The value of that run.
    pub run_value: f64,
    /// Number of neighbours that are equal.
    pub repeats: u32,
}

impl Moments {
    pub(crate) fn of(samples: &[f64]) -> Self {
        let mut n = 0u32;
        let mut sum = 0.0;
        let (mut min, mut max) = (f64::INFINITY, f64::NEG_INFINITY);
        for &u in samples {
            if u.is_finite() {
                n += 1;
                sum += u;
                min = min.min(u);
                max = max.max(u);
            }
        }
        if n == 0 {
            return Self::default();
        }
        let mean = sum / f64::from(n);
        let (mut m2, mut at_min, mut at_max) = (0.0, 0, 0);
        for &u in samples {
            if u.is_finite() {
                m2 += (u - mean) * (u - mean);
                at_min += u32::from(u == min);
                at_max += u32::from(u == max);
            }
        }
        let (mut run, mut run_value, mut repeats, mut length) = (1, samples[0], 0, 1);
        for pair in samples.windows(2) {
            if pair[0] == pair[1] {
                repeats += 1;
                length += 1;
                if length > run {
                    (run, run_value) = (length, pair[1]);
                }
            } else {
                length = 1;
            }
        }
        Self {
            n,
            mean,
            // The mean of a constant may be rounded, which would leave a variance.
            m2: if min == max { 0.0 } else { m2 },
            min,
            max,
            at_min,
            at_max,
            run,
            run_value,
            repeats,
        }
    }

    /// These moments without the samples at the rails, and the number of those samples.
    pub fn without_rails(&self, rails: Rails) -> (Self, u32) {
        let mut kept = *self;
        let mut masked = 0;
        if rails.low.is_some_and(|rail| self.min < rail)
            || rails.high.is_some_and(|rail| self.max > rail)
        {
            // Beyond a declared rail. The moments do not show how many samples are, so all are masked.
            (kept.n, masked) = (0, self.n);
            return (kept, masked);
        }
        let ends = [
            (rails.low, self.min, self.at_min),
            (rails.high, self.max, self.at_max),
        ];
        for (rail, extreme, count) in ends {
            if rail != Some(extreme) || masked == self.n {
                continue;
            }
            let (n, k) = (f64::from(kept.n), f64::from(count));
            masked += count;
            if count >= kept.n {
                kept.n = 0;
                continue;
            }
            let mean = (n * kept.mean - k * extreme) / (n - k);
            kept.m2 -= k * (extreme - kept.mean).powi(2) + (n - k) * (mean - kept.mean).powi(2);
            kept.m2 = kept.m2.max(0.0);
            kept.mean = mean;
            kept.n -= count;
        }
        (kept, masked)
    }
}

/// The values beyond which a converter cannot read, raw units.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Rails {
    /// Lower rail, if it was declared or reached.
    pub low: Option<f64>,
    /// Upper rail, if it was declared or reached.
    pub high: Option<f64>,
}

impl Rails {
    /// Whether a sample of `moments` is at a rail, or beyond.
    pub fn touched_by(&self, moments: &Moments) -> bool {
        moments.n > 0
            && (self.low.is_some_and(|rail| moments.min <= rail)
                || self.high.is_some_and(|rail| moments.max >= rail))
    }
}

impl Rails {
    /// Distance of the nearer rail from `reading`; infinite without one.
    pub fn nearest(&self, reading: f64) -> f64 {
        let all = [self.low, self.high].into_iter().flatten();
        all.map(|rail| (rail - reading).abs())
            .fold(f64::INFINITY, f64::min)
    }
}

/// Pooled moments of several blocks; extremes are not kept.
pub(crate) fn pool(parts: impl Iterator<Item = Moments>) -> Moments {
    parts.fold(Moments::default(), |a, b| {
        let n = a.n + b.n;
        if n == 0 {
            return a;
        }
        let (na, nb) = (f64::from(a.n), f64::from(b.n));
        let shift = b.mean - a.mean;
        Moments {
            n,
            mean: a.mean + shift * nb / f64::from(n),
            m2: a.m2 + b.m2 + shift * shift * na * nb / f64::from(n),
            ..a
        }
    })
}
