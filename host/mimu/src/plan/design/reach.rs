//! Settings that a turntable, or a hand, can reach.

use std::f64::consts::PI;
use std::str::FromStr;

use nalgebra::Vector3;

use super::model::{Model, Setting};
use super::refinement::Region;
use crate::quantity::Sensor;
use mimu_recording::Reference;

/// Fixture: what holds the unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, strum::IntoStaticStr)]
#[strum(serialize_all = "kebab-case")]
pub enum Fixture {
    /// Three-axis turntable: every attitude, and a rate about the vertical.
    ThreeAxis,
    /// Two-axis turntable as in niu, Table 1: any turn about the body's z, tilted by at most 95 degrees off
    /// the vertical. It holds no rate about the vertical.
    TwoAxis,
    /// A levelled cube, or a fixture with six faces, on a rate table or not.
    Faces,
    /// By hand: every attitude, none exactly, no rate.
    Hand,
}

/// Largest tilt of the two-axis table, niu Table 1.
const TILT_DEG: f64 = 95.0;

impl Fixture {
    /// Name as on the command line.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Whether it can point `up` upwards.
    pub fn reaches(self, up: &Vector3<f64>) -> bool {
        match self {
            Self::ThreeAxis | Self::Hand => true,
            Self::TwoAxis => up.z >= lowest() - 1e-12,
            Self::Faces => up.amax() > 1.0 - 1e-12,
        }
    }

    /// Directions `step` (rad) away from `up`, or less at the end of its reach, along two axes.
    fn around(self, up: &Vector3<f64>, step: f64) -> [Vector3<f64>; 4] {
        if self == Self::TwoAxis {
            // Along the axes of the table: its maxima are whole rings about z, and a search across them only creeps
            // along.
            let (tilt, turn) = (up.z.clamp(-1.0, 1.0).acos(), up.y.atan2(up.x));
            let at = |tilt: f64, turn: f64| {
                let tilt = tilt.min(TILT_DEG.to_radians());
                Vector3::new(tilt.sin() * turn.cos(), tilt.sin() * turn.sin(), tilt.cos())
            };
            return [
                at(tilt, turn + step),
                at(tilt, turn - step),
                at(tilt + step, turn),
                at(tilt - step, turn),
            ];
        }
        let side = up.cross(&Vector3::ith(up.iamin(), 1.0)).normalize();
        let other = up.cross(&side);
        [side, -side, other, -other].map(|direction| (up + direction * step).normalize())
    }
}

/// Smallest z of the upward direction on the two-axis table.
fn lowest() -> f64 {
    TILT_DEG.to_radians().cos()
}

/// [`Reach::optimum`] of the magnitude of gravity on the two-axis table, by a search over the heights and weights of rings about z: 11 % at the pole, 40 % at
/// z = 0.551 and 49 % at the lowest tilt.
const RINGS: f64 = -19.677_172_934;

/// Rates that a table is to turn at, as shares of the largest.
#[derive(Debug, Clone, PartialEq)]
pub enum Rates {
    /// Any rate up to the largest.
    Any,
    /// Only these, above 0 and at most 1, and rest.
    Levels(Vec<f64>),
}

/// Rates as on the command line, deg/s: `10,100,300`, or `..300` for any up to 300.
#[derive(Debug, Clone, PartialEq)]
pub struct RateList {
    /// The largest, deg/s.
    pub largest_dps: f64,
    /// Shares of it.
    pub rates: Rates,
}

impl FromStr for RateList {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let rate = |t: &str| match t.trim().parse::<f64>() {
            Ok(r) if (1e-3..=1e5).contains(&r) => Ok(r),
            _ => Err(format!(
                "{t:?} is not a rate from 0.001 to 100000 deg/s: write 10,100,300 or ..300"
            )),
        };
        if let Some(largest) = text.strip_prefix("..") {
            return Ok(Self {
                largest_dps: rate(largest)?,
                rates: Rates::Any,
            });
        }
        let list = text.split(',').map(rate).collect::<Result<Vec<_>, _>>()?;
        let largest_dps = list.iter().copied().fold(0.0, f64::max);
        let mut levels: Vec<f64> = list.iter().map(|r| r / largest_dps).collect();
        levels.sort_by(f64::total_cmp);
        levels.dedup();
        Ok(Self {
            largest_dps,
            rates: Rates::Levels(levels),
        })
    }
}

/// All settings that an experiment may use, and their regressors under a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Reach {
    /// Model.
    pub model: Model,
    /// Fixture.
    pub fixture: Fixture,
    /// Rates, for gyros.
    pub rates: Rates,
}

/// Directions on the grid for an accelerometer: 4 degrees apart. Designs are refined between them.
const DIRECTIONS: usize = 2500;
/// The same for gyros, each with several rates: 9 degrees apart.
const DIRECTIONS_WITH_RATES: usize = 500;

impl Reach {
    /// Faces, edges and corners of the cube: directions that a person finds and a fixture holds.
    pub fn plain(&self) -> Vec<Setting> {
        let steps = [0.0, 1.0, -1.0];
        let mut ups: Vec<Vector3<f64>> = Vec::new();
        for z in steps {
            for y in steps {
                ups.extend(steps.map(|x| Vector3::new(x, y, z)));
            }
        }
        // Faces first, then edges, corners.
        ups.retain(|up| *up != Vector3::zeros());
        ups.sort_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()));
        self.settings(ups.into_iter().map(|up| up.normalize()))
    }

    /// A grid over the whole reach.
    pub fn candidates(&self) -> Vec<Setting> {
        let mut all = self.plain();
        if self.fixture != Fixture::Faces {
            let n = match self.model.sensor {
                Sensor::Accel => DIRECTIONS,
                Sensor::Gyro => DIRECTIONS_WITH_RATES,
            };
            all.extend(self.settings((0..n).map(|i| fibonacci(i, n))));
            if self.fixture == Fixture::TwoAxis {
                all.extend(self.settings(lowest_ring().into_iter()));
            }
        }
        all
    }

    /// All settings with the given upward directions, as far as they are reached.
    fn settings(&self, ups: impl Iterator<Item = Vector3<f64>>) -> Vec<Setting> {
        let ups = ups.filter(|up| self.fixture.reaches(up));
        if self.model.sensor == Sensor::Accel {
            return ups.map(Setting::at_rest).collect();
        }
        let levels = match &self.rates {
            Rates::Any => &[0.25, 0.5, 0.75, 1.0],
            Rates::Levels(levels) => &levels[..],
        };
        let shares = levels.iter().flat_map(|share| [*share, -share]);
        let mut all = vec![Setting::at_rest(Vector3::z())];
        for up in ups {
            // A rate about the opposite direction is the opposite rate.
            if !upper(&up) {
                continue;
            }
            let largest = self.largest_rate(&up);
            all.extend(shares.clone().map(|share| Setting {
                up,
                rate: share * largest,
            }));
        }
        all
    }

    /// Logarithm of `det(F'F/n)` that no design exceeds: that of the continuous optimum.
    ///
    /// Inputs fill the sphere, or on a two-axis table its part above the lowest tilt. A rotation of an optimum that the reach allows is an optimum, and so is
    /// their mean (Kiefer and Wolfowitz, 1960): the optimum is even over the sphere, or over rings about z.
    pub fn optimum(&self) -> f64 {
        let of_table = self.model.reference == Reference::Table;
        match (self.fixture, of_table) {
            // A quarter at the pole, the rest on the lowest ring: w (1-w)³ is largest at w = 1/4.
            (Fixture::TwoAxis, true) => {
                let h = lowest();
                (27.0 / 1024.0 * ((1.0 - h) * (1.0 - h * h)).powi(2)).ln()
            }
            (Fixture::TwoAxis, false) => RINGS,
            // Moments of the sphere: 1 and three times 1/3.
            (_, true) => -27f64.ln(),
            // Three times 1/15 (products), three times 1/3 (inputs), and 4/675 (squares).
            (_, false) => (4.0 / 675.0 / 15f64.powi(3) / 27.0).ln(),
        }
    }

    /// Largest rate with `up` upwards, rad/s: its input, over the full input, has length 1.
    fn largest_rate(&self, up: &Vector3<f64>) -> f64 {
        1.0 / up.component_div(&self.model.span).norm()
    }
}

/// Whether the first of z, y, x that is not zero is positive: one of each pair of opposite directions.
fn upper(up: &Vector3<f64>) -> bool {
    let first = [up.z, up.y, up.x].into_iter().find(|c| c.abs() > 1e-12);
    first.is_some_and(|c| c > 0.0)
}

/// Directions 5 degrees apart at the lowest tilt of the two-axis table. They have most weight, and a grid over the
/// sphere lacks them.
fn lowest_ring() -> [Vector3<f64>; 72] {
    let r = (1.0 - lowest() * lowest()).sqrt();
    std::array::from_fn(|i| {
        let (sine, cosine) = (i as f64 / 72.0 * 2.0 * PI).sin_cos();
        Vector3::new(r * cosine, r * sine, lowest())
    })
}

/// Point `i` of `n` of the spiral that covers the sphere evenly.
fn fibonacci(i: usize, n: usize) -> Vector3<f64> {
    let z = 1.0 - (2 * i + 1) as f64 / n as f64;
    let turn = i as f64 * PI * (3.0 - 5f64.sqrt());
    let r = (1.0 - z * z).sqrt();
    Vector3::new(r * turn.cos(), r * turn.sin(), z)
}

impl Region for Reach {
    type Point = Setting;

    fn width(&self) -> usize {
        self.model.width()
    }

    fn regressors(&self, point: &Setting, row: &mut Vec<f64>) {
        self.model.regressors(point, row);
    }

    fn neighbours(&self, point: &Setting, step: f64) -> Vec<Setting> {
        let mut list = Vec::new();
        let gyro = self.model.sensor == Sensor::Gyro;
        let share = point.rate / self.largest_rate(&point.up);
        // At rest a gyro's attitude does not matter.
        if self.fixture != Fixture::Faces && (!gyro || share != 0.0) {
            for up in self.fixture.around(&point.up, step) {
                list.push(Setting {
                    up,
                    rate: share * self.largest_rate(&up),
                });
            }
        }
        if gyro && self.rates == Rates::Any {
            for change in [step, -step] {
                let share = (share + change).clamp(-1.0, 1.0);
                list.push(Setting {
                    rate: share * self.largest_rate(&point.up),
                    ..*point
                });
            }
        }
        list
    }
}
