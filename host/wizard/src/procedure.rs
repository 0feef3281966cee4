//! Settings of a session, and its dwells: the first ones, the next one by the information that it adds, and those for the verification.

use mimu::plan::design::model::{Model, Setting};
use mimu::plan::design::next_pose::Had;
use mimu::plan::design::reach::{Fixture as Reached, Rates, Reach};
use mimu::plan::design::tour::randomised;
use mimu::{Prior, normal_gravity};
use mimu_recording::{Reference, ReferenceError, WholeTurns};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use mimu_equipment::step::Step;

/// The fixture that holds the unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, strum::IntoStaticStr)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum Fixture {
    /// A rate table: attitudes and rates are known.
    Table,
    /// A box with six faces, which can also be held by its edges. Only the magnitude of gravity is known, and the turns between the poses.
    Cube,
    /// Hands: as with a cube, but in any attitude.
    Hands,
}

impl Fixture {
    /// The reference that it provides.
    pub fn reference(self) -> Reference {
        match self {
            Self::Table => Reference::Table,
            Self::Cube | Self::Hands => Reference::Gravity,
        }
    }

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Largest angle between a pose and the requested direction, degrees. Without a calibration the null of an MMA7260QT may be off by 0.2 g, which
    /// is 12 degrees, and its axes by a few more. Faces, edges and corners are at least 35 degrees apart.
    pub fn tolerance_deg(self) -> f64 {
        match self {
            Self::Table | Self::Cube => 17.0,
            Self::Hands => 25.0,
        }
    }
}

/// Settings of a session; stored in its folder, so that it resumes with the same ones.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SessionConfig {
    /// Columns and unit of a board that writes text.
    #[serde(default)]
    pub text: Option<String>,
    /// The fixture.
    pub fixture: Fixture,
    /// Local gravity, m/s².
    pub gravity_mps2: f64,
    /// Latitude, degrees.
    pub latitude_deg: Option<f64>,
    /// Length of a dwell, s.
    pub dwell_s: f64,
    /// Largest rate of the table, deg/s.
    pub largest_rate_dps: f64,
    /// The first dwells.
    pub steps: Vec<Step>,
    /// Whether dwells continue until the targets are met, and end early once they are.
    pub by_targets: bool,
    /// Largest number of dwells.
    pub most_dwells: usize,
    /// Longest wait for a dwell to begin without a person, s.
    pub patience_s: f64,
    /// Dwells for the verification.
    pub verification: Vec<Step>,
    /// Largest rate of change of temperature after warm-up, °C/min; `None` if the session does not wait for it.
    pub warm_c_per_min: Option<f64>,
    /// Largest change of temperature since the first dwell, °C.
    pub most_drift_c: f64,
    /// Targets: half-widths of 95 % intervals.
    pub targets: Targets,
    /// Misalignment of the unit on the table: half-width of the 95 % interval of each angle, degrees.
    #[serde(default)]
    pub mounting_deg: f64,
    /// What the table does wrong, as its driver file states it. Fits count it; the mounting is then part of it, and [`Self::mounting_deg`] is 0.
    #[serde(default)]
    pub reference_error: Option<ReferenceError>,
    /// Whole turns by hand after the poses, if the session has them: how many, and how well the unit is put back.
    #[serde(default)]
    pub whole_turns: Option<WholeTurns>,
    /// The population that the units are from, by hand only. Kept with the session, because its poses do not suffice without it.
    #[serde(default)]
    pub prior: Option<Prior>,
    /// Size of the Earth's field at the place, µT, for a board with a magnetometer; without it the field counts as 1.
    #[serde(default)]
    pub field_ut: Option<f64>,
}

impl SessionConfig {
    /// Fewest dwells of a calibration. The rest must remain determined if a part is held out: half as many dwells again as that needs. Beside a prior the faces
    /// suffice.
    pub fn fewest_dwells(&self) -> usize {
        match (self.fixture, &self.prior) {
            (Fixture::Table, _) => 18,
            (Fixture::Cube | Fixture::Hands, Some(_)) => 6,
            (Fixture::Cube | Fixture::Hands, None) => 14,
        }
    }

    /// States the assumed gravity, and the effect of an error in it: no reading would reveal one.
    pub fn gravity_words(&self) -> String {
        let normal = self.latitude_deg.map(normal_gravity);
        let source = match normal == Some(self.gravity_mps2) {
            true => "normal gravity at sea level; 1000 m higher it is 315 ppm less",
            false => "as given",
        };
        let error = self
            .reference_error
            .as_ref()
            .map_or(0.0, |e| e.gravity_mps2);
        let counted = match error > 0.0 {
            true => format!("the intervals include the stated {error} m/s²"),
            false => "no interval includes it".into(),
        };
        format!(
            "gravity is assumed to be {:.4} m/s² ({source}): each ppm of its error is a ppm of every scale factor of the accelerometer, and {counted}",
            self.gravity_mps2
        )
    }
}

/// Targets: half-widths of 95 % intervals.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Targets {
    /// Gyro biases, deg/s.
    pub gyro_bias_dps: f64,
    /// Gyro scale factors, ppm.
    pub gyro_scale_ppm: f64,
    /// Angles of gyro axes, µrad.
    pub gyro_angle_urad: f64,
    /// Accelerometer biases, mg.
    pub accel_bias_mg: f64,
    /// Accelerometer scale factors, ppm.
    pub accel_scale_ppm: f64,
    /// Angles of accelerometer axes, µrad.
    pub accel_angle_urad: f64,
}

impl Default for Targets {
    /// Reachable in a quarter of an hour with analog MEMS sensors.
    fn default() -> Self {
        Self {
            gyro_bias_dps: 0.05,
            gyro_scale_ppm: 2000.0,
            gyro_angle_urad: 2000.0,
            accel_bias_mg: 1.0,
            accel_scale_ppm: 1000.0,
            accel_angle_urad: 1000.0,
        }
    }
}

/// Faces, edges and corners of a cube, in this order.
fn directions() -> [Vec<Vector3<f64>>; 3] {
    let steps = [1.0, -1.0, 0.0];
    let mut all = [const { Vec::new() }; 3];
    for x in steps {
        for y in steps {
            for z in steps {
                let up: Vector3<f64> = Vector3::new(x, y, z);
                if up != Vector3::zeros() {
                    all[up.norm_squared() as usize - 1].push(up.normalize());
                }
            }
        }
    }
    all
}

/// The first dwells, ordered so that similar ones do not follow each other.
pub fn first_steps(fixture: Fixture, dwell_s: f64, largest_rate_dps: f64, seed: u64) -> Vec<Step> {
    let [faces, edges, corners] = directions();
    let settings = match fixture {
        // Full rates in both directions on all faces determine the gyro. Half the rate on edges shows nonlinearity. Corners at rest show the
        // accelerometer with two or three axes loaded at once.
        Fixture::Table => {
            let rate = largest_rate_dps.to_radians();
            let turning = |up: &Vector3<f64>, rate: f64| Setting { up: *up, rate };
            let both = |up: &Vector3<f64>| [turning(up, rate), turning(up, -rate)];
            let mut all: Vec<Setting> = faces.iter().flat_map(both).collect();
            let some = edges.iter().step_by(2).enumerate();
            all.extend(some.map(|(k, up)| {
                let sign = if k % 2 == 0 { 0.5 } else { -0.5 };
                turning(up, sign * rate)
            }));
            all.extend(corners.iter().map(|up| turning(up, 0.0)));
            randomised(&all, seed)
        }
        Fixture::Cube => chained(&[faces, edges.into_iter().step_by(2).collect()].concat()),
        Fixture::Hands => chained(&[faces, corners].concat()),
    };
    let step = |s: Setting| Step {
        up: s.up.into(),
        // Rounded, because the conversion to radians and back is not exact.
        rate_dps: (1e9 * s.rate.to_degrees()).round() / 1e9,
        dwell_s,
    };
    settings.into_iter().map(step).collect()
}

/// The first dwells by hand beside a prior: the faces show biases and scale factors. The angles follow if the population is wider than their targets.
pub fn faces(dwell_s: f64) -> Vec<Step> {
    let [faces, ..] = directions();
    let step = |s: Setting| Step::at_rest(s.up, dwell_s);
    chained(&faces).into_iter().map(step).collect()
}

/// By hand the turns between poses calibrate the gyro: each is to be a quarter turn or more, about alternating axes.
fn chained(ups: &[Vector3<f64>]) -> Vec<Setting> {
    let mut left = ups.to_vec();
    let mut turned = TurnInformation::default();
    let mut chain = vec![left.remove(left.iter().position(|u| u.z > 0.99).unwrap_or(0))];
    while !left.is_empty() {
        let from = chain[chain.len() - 1];
        let best = (0..left.len()).max_by(|&a, &b| {
            let gain = |k: usize| turned.gain(&from, &left[k]);
            gain(a).total_cmp(&gain(b))
        });
        let next = left.remove(best.unwrap_or(0));
        turned.take(&from, &next);
        chain.push(next);
    }
    chain.into_iter().map(Setting::at_rest).collect()
}

/// Information from turns about a gyro.
#[derive(Debug, Clone)]
struct TurnInformation(Matrix3<f64>);

impl Default for TurnInformation {
    fn default() -> Self {
        Self(Matrix3::identity() * 0.1)
    }
}

impl TurnInformation {
    fn vector(from: &Vector3<f64>, to: &Vector3<f64>) -> Vector3<f64> {
        let axis = from.cross(to);
        match axis.norm() {
            // A half turn may be made about any perpendicular axis, so it is not counted on.
            size if size < 0.1 => Vector3::zeros(),
            size => axis / size * from.angle(to),
        }
    }

    fn gain(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
        let v = Self::vector(from, to);
        let inverse = self.0.try_inverse().unwrap_or_else(Matrix3::zeros);
        (1.0 + (inverse * v).dot(&v)).ln()
    }

    fn take(&mut self, from: &Vector3<f64>, to: &Vector3<f64>) {
        let v = Self::vector(from, to);
        self.0 += v * v.transpose();
    }
}

/// Which sensors still miss a target: gyro, accelerometer.
pub type Missed = [bool; 2];

/// The dwell that adds the most information to `done`, for the sensors that need it.
pub fn next_step(config: &SessionConfig, done: &[Step], missed: Missed) -> Step {
    let candidates = match config.fixture {
        Fixture::Table => {
            let seed = done.len() as u64;
            let mut all = first_steps(
                Fixture::Table,
                config.dwell_s,
                config.largest_rate_dps,
                seed,
            );
            let [faces, ..] = directions();
            all.extend(
                faces
                    .into_iter()
                    .map(|up| Step::at_rest(up, config.dwell_s)),
            );
            all
        }
        fixture => {
            let [faces, edges, corners] = directions();
            let ups = match fixture {
                Fixture::Cube => [faces, edges].concat(),
                _ => [faces, edges, corners].concat(),
            };
            let step = |up: Vector3<f64>| Step::at_rest(up, config.dwell_s);
            ups.into_iter().map(step).collect()
        }
    };
    let reference = config.fixture.reference();
    let mut models = Vec::new();
    if missed[1] || missed == [false; 2] {
        models.push((true, Model::accel(reference)));
    }
    if missed[0] && reference == Reference::Table {
        let span = Vector3::repeat(config.largest_rate_dps.to_radians());
        models.push((false, Model::gyro(span)));
    }
    let reaches = models.into_iter().map(|(of_accel, model)| {
        let reach = Reach {
            model,
            fixture: Reached::Hand,
            rates: Rates::Any,
        };
        (of_accel, reach)
    });
    let reaches: Vec<(bool, Reach)> = reaches.collect();
    // While a table turns, an accelerometer off its axis measures centripetal acceleration too.
    let shows = |of_accel: bool, s: &Setting| !of_accel || s.rate.abs() < AT_REST;
    let setting = |s: &Step| Setting {
        up: s.up(),
        rate: s.rate_dps.to_radians(),
    };
    let had: Vec<Setting> = done.iter().map(setting).collect();
    let known: Vec<(bool, Had)> = reaches
        .iter()
        .map(|(of_accel, reach)| {
            let shown: Vec<Setting> = had
                .iter()
                .filter(|s| shows(*of_accel, s))
                .copied()
                .collect();
            (*of_accel, Had::new(reach, &shown))
        })
        .collect();
    let mut turned = TurnInformation::default();
    for pair in had.windows(2) {
        turned.take(&pair[0].up, &pair[1].up);
    }
    let last = had.last().map(|s| s.up);
    let gain = |candidate: &Step| {
        let candidate_setting = setting(candidate);
        // Candidates after which a parameter is still undetermined are equal.
        let of = |(of_accel, known): &(bool, Had)| match shows(*of_accel, &candidate_setting) {
            true => known.log_det_with(&candidate_setting).unwrap_or(-1e3),
            false => known.log_det().unwrap_or(-1e3),
        };
        let mut gain: f64 = known.iter().map(of).sum();
        if let Some(last) = last.filter(|_| reference == Reference::Gravity) {
            gain += turned.gain(&last, &candidate.up()) * if missed[0] { 3.0 } else { 1.0 };
            // The same pose again is neither a turn nor a new pose.
            let near = last.angle(&candidate.up()).to_degrees() < 2.0 * SAME_POSE_DEG;
            gain -= if near { 100.0 } else { 0.0 };
            // A new pose also shows errors that the model lacks.
            let new = done
                .iter()
                .all(|d| d.up().angle(&candidate.up()).to_degrees() > SAME_POSE_DEG);
            gain += if new { NEW_POSE } else { 0.0 };
        }
        gain
    };
    let best = candidates
        .iter()
        .map(|c| (gain(c), c))
        .reduce(|a, b| if b.0 > a.0 { b } else { a });
    best.map_or(Step::at_rest(Vector3::z(), config.dwell_s), |b| *b.1)
}

/// Rate below which a dwell on a table is used for the accelerometer, rad/s ([`mimu::signal::dwell::Dwell::spins`]).
const AT_REST: f64 = 0.175;
/// Bonus of a new pose in log-determinant: as much as one more dwell after ten.
const NEW_POSE: f64 = 1.0;

/// Angle below which two poses by hand count as the same, degrees.
pub const SAME_POSE_DEG: f64 = 12.0;

/// Dwells for the verification: as far as possible from all `used` directions, and on a table at other rates.
pub fn verification(
    asked_of: Fixture,
    used: &[Step],
    dwell_s: f64,
    largest_rate_dps: f64,
) -> Vec<Step> {
    // A spiral over the sphere gives directions that no plan contains.
    let count = 200;
    let spiral = (0..count).map(|k| {
        let z = 1.0 - (2 * k + 1) as f64 / count as f64;
        let turn = k as f64 * 2.399_963;
        let across = (1.0 - z * z).sqrt();
        Vector3::new(across * turn.cos(), across * turn.sin(), z)
    });
    let [_, edges, _] = directions();
    let candidates: Vec<Vector3<f64>> = match asked_of {
        Fixture::Cube => edges,
        _ => spiral.collect(),
    };
    let mut taken: Vec<Vector3<f64>> = used.iter().map(Step::up).collect();
    let wanted = 6;
    let mut chosen = Vec::new();
    for k in 0..wanted {
        let distance = |up: &Vector3<f64>| {
            let nearest = taken.iter().map(|t| t.angle(up));
            nearest.fold(f64::INFINITY, f64::min)
        };
        let Some(up) = candidates
            .iter()
            .copied()
            .map(|up| (distance(&up), up))
            .reduce(|a, b| if b.0 > a.0 { b } else { a })
        else {
            break;
        };
        taken.push(up.1);
        let rate_dps = match (asked_of, k % 2) {
            (Fixture::Table, 0) => {
                let share = [0.7, -0.7, 0.3][k / 2 % 3];
                (10.0 * share * largest_rate_dps).round() / 10.0
            }
            _ => 0.0,
        };
        chosen.push(Step {
            up: up.1.into(),
            rate_dps,
            dwell_s,
        });
    }
    match asked_of {
        Fixture::Table => chosen,
        // By hand, turns of a quarter or more.
        _ => {
            let ups: Vec<Vector3<f64>> = chosen.iter().map(Step::up).collect();
            let order = chained(&ups);
            order
                .into_iter()
                .map(|s| Step::at_rest(s.up, dwell_s))
                .collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config(fixture: Fixture) -> SessionConfig {
        SessionConfig {
            text: None,
            fixture,
            gravity_mps2: 9.8,
            latitude_deg: None,
            dwell_s: 3.0,
            largest_rate_dps: 0.0,
            steps: Vec::new(),
            by_targets: true,
            most_dwells: 40,
            patience_s: 60.0,
            verification: Vec::new(),
            warm_c_per_min: None,
            most_drift_c: 5.0,
            targets: Targets::default(),
            mounting_deg: 0.0,
            reference_error: None,
            whole_turns: None,
            prior: None,
            field_ut: None,
        }
    }

    #[test]
    fn neighbouring_poses_by_hand_are_a_quarter_turn_apart_and_more() {
        for fixture in [Fixture::Hands, Fixture::Cube] {
            let steps = first_steps(fixture, 3.0, 0.0, 1);
            let apart = steps
                .windows(2)
                .map(|p| p[0].up().angle(&p[1].up()).to_degrees());
            let least = apart.fold(f64::INFINITY, f64::min);
            assert!(least > 50.0, "{fixture:?}: {least}");
        }
    }

    #[test]
    fn verification_uses_no_direction_of_the_calibration() {
        for fixture in [Fixture::Table, Fixture::Hands] {
            let used = first_steps(fixture, 3.0, 100.0, 1);
            for step in verification(fixture, &used, 3.0, 100.0) {
                let nearest = used.iter().map(|u| u.up().angle(&step.up()).to_degrees());
                let nearest = nearest.fold(f64::INFINITY, f64::min);
                assert!(nearest > SAME_POSE_DEG, "{fixture:?}: {nearest}");
            }
        }
    }

    #[test]
    fn an_accelerometer_that_misses_its_target_on_a_table_is_shown_at_rest() {
        let mut config = config(Fixture::Table);
        config.largest_rate_dps = 250.0;
        let done = first_steps(Fixture::Table, 3.0, 250.0, 1);
        assert_eq!(next_step(&config, &done, [false, true]).rate_dps, 0.0);
        assert_ne!(next_step(&config, &done, [true, false]).rate_dps, 0.0);
    }

    #[test]
    fn a_direction_that_was_missed_is_the_next() {
        let mut done = first_steps(Fixture::Hands, 3.0, 0.0, 1);
        // No pose so far has had the side of -x up.
        done.retain(|s| s.up[0] > -0.3);
        let config = config(Fixture::Hands);
        let next = next_step(&config, &done, [false, true]);
        assert!(next.up[0] < -0.5, "{next:?}");
    }
}
