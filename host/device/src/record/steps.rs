//! Where dwells begin and end.

use std::time::Duration;

/// How dwells are numbered while samples arrive.
#[derive(Debug, Clone, PartialEq)]
pub enum Steps {
    /// Not during the recording: dwells are detected in the samples later.
    Detected,
    /// Alternately a dwell and a transit of these lengths, from the first sample on.
    Every(Duration, Duration),
    /// By marks: each begins a dwell, or ends the running one.
    Marks(Marks),
    /// By a plan: begin and end of each dwell, counted from the first sample. No two overlap.
    Planned(Vec<[Duration; 2]>),
}

/// Dwells marked so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Marks {
    begun: i32,
    dwells: bool,
    /// Planned number of dwells.
    most: Option<i32>,
}

impl Steps {
    /// By marks, in transit before the first.
    pub fn marks() -> Self {
        Self::Marks(Marks::default())
    }

    /// By marks, for a planned number of dwells.
    pub fn marks_for(dwells: usize) -> Self {
        Self::Marks(Marks {
            most: i32::try_from(dwells).ok(),
            ..Marks::default()
        })
    }

    /// Dwells of these lengths, with a transit after each.
    pub fn planned(lead_in: Duration, lengths: &[Duration], transit: Duration) -> Self {
        let mut begin = lead_in;
        let each = lengths.iter().map(|length| {
            let dwell = [begin, begin + *length];
            begin = dwell[1] + transit;
            dwell
        });
        Self::Planned(each.collect())
    }

    /// End of the last dwell, if there is a plan.
    pub(super) fn end(&self) -> Option<Duration> {
        match self {
            Self::Planned(dwells) => dwells.last().map(|d| d[1]),
            _ => None,
        }
    }

    /// Whether the last planned dwell was ended by a mark.
    pub(super) fn is_done(&self) -> bool {
        matches!(self, Self::Marks(marks) if !marks.dwells && marks.most == Some(marks.begun))
    }

    /// The dwell begun by a mark and not yet ended.
    pub(super) fn running(&self) -> Option<i32> {
        match self {
            Self::Marks(marks) if marks.dwells => Some(marks.begun - 1),
            _ => None,
        }
    }

    /// Begins or ends a dwell.
    pub(super) fn mark(&mut self) {
        if let Self::Marks(marks) = self {
            marks.dwells = !marks.dwells;
            marks.begun += i32::from(marks.dwells);
        }
    }

    /// Number of the dwell at `since` the first sample, -1 in transit; `None` if dwells are not numbered.
    pub(super) fn at(&self, since: Duration) -> Option<i32> {
        match self {
            Self::Detected => None,
            Self::Every(dwell, transit) => {
                // Counted in whole nanoseconds: with a quotient of floats, the first sample of a dwell could fall into the transit before it.
                let cycle = (*dwell + *transit).as_nanos().max(1);
                let (step, within) = (since.as_nanos() / cycle, since.as_nanos() % cycle);
                let step = i32::try_from(step).unwrap_or(i32::MAX);
                Some(if within < dwell.as_nanos() { step } else { -1 })
            }
            Self::Planned(dwells) => {
                let step = dwells.partition_point(|d| d[0] <= since).checked_sub(1);
                let running = step.filter(|step| since < dwells[*step][1]);
                Some(running.and_then(|s| i32::try_from(s).ok()).unwrap_or(-1))
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
    fn the_dwells_of_a_plan_follow_each_other_by_time() {
        let ms = Duration::from_millis;
        let steps = Steps::planned(ms(100), &[ms(200), ms(50)], ms(300));
        let at = |t| steps.at(ms(t)).unwrap();
        assert_eq!([at(0), at(99), at(100), at(299)], [-1, -1, 0, 0]);
        assert_eq!(
            [at(300), at(599), at(600), at(649), at(650)],
            [-1, -1, 1, 1, -1]
        );
        assert_eq!(steps.end(), Some(ms(650)));
    }

    #[test]
    fn marks_of_a_plan_are_done_with_its_last_dwell() {
        let mut steps = Steps::marks_for(2);
        let mut done = Vec::new();
        for _ in 0..4 {
            steps.mark();
            done.push(steps.is_done());
        }
        assert_eq!(done, [false, false, false, true]);
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
