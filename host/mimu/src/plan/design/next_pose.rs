//! What one more dwell would add to those that a unit has had: for the wizard, which asks for the best one, and for the page, which shows all.

use super::information::{Inverse, Rows};
use super::model::Setting;
use super::reach::Reach;
use super::refinement::Region as _;

/// Dwells that a unit has had.
#[derive(Debug, Clone)]
pub struct Had<'a> {
    reach: &'a Reach,
    rows: Rows,
    inverse: Option<Inverse>,
}

impl<'a> Had<'a> {
    /// These dwells, for a model and a fixture.
    pub fn new(reach: &'a Reach, dwells: &[Setting]) -> Self {
        let rows = reach.rows(dwells);
        let inverse = Inverse::of_all(&rows);
        Self {
            reach,
            rows,
            inverse,
        }
    }

    /// Logarithm of the determinant of their information; `None` if they do not determine all parameters.
    pub fn log_det(&self) -> Option<f64> {
        self.inverse.as_ref().map(Inverse::log_det)
    }

    /// Logarithm of the determinant of the information after one more dwell; `None` if it still does not determine all parameters.
    pub fn log_det_with(&self, one_more: &Setting) -> Option<f64> {
        let row = self.row(one_more);
        if let Some(inverse) = &self.inverse {
            return Some(inverse.log_det() + inverse.variance(&row).ln_1p());
        }
        let mut rows = self.rows.clone();
        rows.push(&row);
        Inverse::of_all(&rows).map(|i| i.log_det())
    }

    /// Share by which one more dwell would lower the geometric mean of the parameters' sigmas; `None` if the dwells do not determine all parameters.
    pub fn gain(&self, one_more: &Setting) -> Option<f64> {
        // A sigma is a 2p-th root of the inverse determinant, which the dwell multiplies by 1 + f' M⁻¹ f.
        let factor = 1.0 + self.inverse.as_ref()?.variance(&self.row(one_more));
        Some(1.0 - factor.powf(-0.5 / self.rows.width() as f64))
    }

    fn row(&self, setting: &Setting) -> Vec<f64> {
        let mut row = Vec::new();
        self.reach.regressors(setting, &mut row);
        row
    }
}

#[cfg(test)]
mod tests {
    use super::super::model::Model;
    use super::super::reach::{Fixture, Rates};
    use super::*;
    use mimu_recording::Reference;
    use nalgebra::Vector3;

    fn reach() -> Reach {
        Reach {
            model: Model::accel(Reference::Gravity),
            fixture: Fixture::Hand,
            rates: Rates::Any,
        }
    }

    #[test]
    fn a_direction_that_no_pose_has_shown_adds_more_than_one_that_several_have() {
        let reach = reach();
        let mut dwells = reach.plain();
        dwells.retain(|s| s.up.z < 0.9);
        dwells.extend([Setting::at_rest(-Vector3::z()); 4]);
        let had = Had::new(&reach, &dwells);
        let gain = |up: Vector3<f64>| had.gain(&Setting::at_rest(up)).unwrap();
        assert!(gain(Vector3::z()) > 2.0 * gain(-Vector3::z()));
    }

    #[test]
    fn the_determinant_after_one_more_dwell_is_that_of_all_of_them() {
        let reach = reach();
        let plain = reach.plain();
        // Before and after the dwells determine all parameters.
        for n in [8, 9, 20] {
            let with = Had::new(&reach, &plain[..n]).log_det_with(&plain[n]);
            let all = Had::new(&reach, &plain[..=n]).inverse.map(|i| i.log_det());
            match (with, all) {
                (Some(with), Some(all)) => assert!((with - all).abs() < 1e-9, "{n}"),
                (with, all) => assert_eq!(with.is_some(), all.is_some(), "{n}"),
            }
        }
    }

    #[test]
    fn six_faces_do_not_determine_nine_parameters_by_the_size_of_gravity() {
        let faces = [Vector3::x(), Vector3::y(), Vector3::z()];
        let dwells: Vec<Setting> = faces
            .iter()
            .flat_map(|up| [*up, -up])
            .map(Setting::at_rest)
            .collect();
        let reach = reach();
        assert!(Had::new(&reach, &dwells).gain(&dwells[0]).is_none());
    }
}
