//! Whole turns that a session asks for: each axis upright against an edge, turned both ways, and put back.

use mimu::quantity::AXES;
use mimu_equipment::step::Step;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::part::Part;

/// Turns of each, unless another number is stated: they take half a minute, and put back to a degree they show a scale factor to 0.03 %.
pub const TURNS: u32 = 10;

/// Whole turns about an axis of the unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Spin {
    /// The axis, 0 to 2.
    pub axis: usize,
    /// How many, by the right-hand rule about the axis.
    pub turns: i32,
}

impl Spin {
    /// Those of a recording: for the calibration each axis both ways, the flattest side of most boards first; for the verification any one.
    pub fn all(part: Part, turns: u32) -> Vec<Self> {
        let turns = turns as i32;
        let both = |axis| [turns, -turns].map(|turns| Self { axis, turns });
        match part {
            Part::Calibration => [2, 0, 1].into_iter().flat_map(both).collect(),
            Part::Verification => vec![Self { axis: 2, turns }],
            Part::Confirmation => Vec::new(),
        }
    }

    /// Those of `asked` that are not among `made`. A spin for the verification may be about any axis.
    pub fn left(part: Part, asked: &[Self], made: &[Self]) -> Vec<Self> {
        let like = |a: &Self, b: &Self| {
            part == Part::Verification || a.axis == b.axis && a.turns.signum() == b.turns.signum()
        };
        let missing = asked.iter().filter(|a| !made.iter().any(|m| like(a, m)));
        missing.copied().collect()
    }

    /// Its axis in the body.
    pub fn about(&self) -> Vector3<f64> {
        Vector3::ith(self.axis, 1.0)
    }

    /// The rest before it: the axis points up.
    pub fn rest(&self, dwell_s: f64) -> Step {
        Step::at_rest(self.about(), dwell_s)
    }

    /// Name of the axis with the sign of the turns: `+z`.
    pub fn name(&self) -> String {
        let sign = if self.turns < 0 { '-' } else { '+' };
        format!("{sign}{}", AXES[self.axis])
    }

    /// What to do, in a sentence.
    pub fn words(&self) -> String {
        let way = match self.turns < 0 {
            true => "clockwise",
            false => "counterclockwise",
        };
        let Self { axis, turns } = self;
        format!(
            "+{axis} face up against an edge, at rest; then turn it {} whole times about {axis}, {way} seen from above, put it back against the edge, and let it rest",
            turns.abs(),
            axis = AXES[*axis],
        )
    }
}

/// How far a spin is, for the views.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpinState {
    /// The axis asked for, with the sign of the turns: `+z`.
    pub axis: String,
    /// Turns asked for.
    pub asked: u32,
    /// Turns so far, about any axis; `None` until the unit has rested against its edge.
    pub turns: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_turned_the_other_way_or_about_another_axis_is_not_asked_again_and_the_rest_is() {
        let asked = Spin::all(Part::Calibration, 10);
        assert_eq!(asked.len(), 6);
        let made = [Spin { axis: 0, turns: -9 }, Spin { axis: 2, turns: 10 }];
        let left = Spin::left(Part::Calibration, &asked, &made);
        assert_eq!(left.len(), 4);
        assert_eq!(
            left[0],
            Spin {
                axis: 2,
                turns: -10
            }
        );
        let one = Spin::all(Part::Verification, 10);
        assert_eq!(Spin::left(Part::Verification, &one, &made[..1]), []);
    }
}
