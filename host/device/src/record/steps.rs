//! Where dwells begin and end.

use std::time::Duration;

/// How samples get their step.
#[derive(Debug, Clone, PartialEq)]
pub enum Steps {
    /// Not at all: the dwells are detected in the samples later on.
    Detected,
    /// So long a dwell, then so long in transit, again and again from the first sample on.
    Every(Duration, Duration),
    /// By marks: each begins a dwell, or ends the one that runs.
    Marks(Marks),
}

/// Marks so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Marks {
    begun: i32,
    dwells: bool,
}

impl Steps {
    /// By marks, in transit before the first.
    pub fn marks() -> Self {
        Self::Marks(Marks::default())
    }

    /// Begins a dwell, or ends it.
    pub(super) fn mark(&mut self) {
        if let Self::Marks(marks) = self {
            marks.dwells = !marks.dwells;
            marks.begun += i32::from(marks.dwells);
        }
    }

    /// Step of a sample so long after the first, -1 in transit; `None`: samples have none.
    pub(super) fn at(&self, since: Duration) -> Option<i32> {
        match self {
            Self::Detected => None,
            Self::Every(dwell, transit) => {
                // Whole nanoseconds: a quotient of floats can put the first sample of a dwell into the transit before it.
                let cycle = (*dwell + *transit).as_nanos().max(1);
                let (step, within) = (since.as_nanos() / cycle, since.as_nanos() % cycle);
                let step = i32::try_from(step).unwrap_or(i32::MAX);
                Some(if within < dwell.as_nanos() { step } else { -1 })
            }
            Self::Marks(marks) if marks.dwells => Some(marks.begun - 1),
            Self::Marks(_) => Some(-1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dwells_and_transits_alternate_by_time() {
        let ms = Duration::from_millis;
        let steps = Steps::Every(ms(200), ms(100));
        let at = |t| steps.at(ms(t)).unwrap();
        assert_eq!(
            [at(0), at(199), at(200), at(299), at(300)],
            [0, 0, -1, -1, 1]
        );
        // 0.9 / 0.3 is below 3 in floating point.
        assert_eq!([at(899), at(900)], [-1, 3]);
    }

    #[test]
    fn marks_begin_and_end_dwells_in_turn() {
        let mut steps = Steps::marks();
        let mut seen = vec![steps.at(Duration::ZERO)];
        for _ in 0..4 {
            steps.mark();
            seen.push(steps.at(Duration::ZERO));
        }
        assert_eq!(seen, [-1, 0, -1, 1, -1].map(Some));
    }
}
