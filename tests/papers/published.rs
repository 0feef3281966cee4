//! Published calibration schemes, as sequences of settings.

use mimu::plan::design::model::Setting;
use mimu::quantity::Sensor;
use nalgebra::Vector3;

/// A published scheme.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scheme {
    /// Each axis up and down: reference 5 of fang.
    SixFace,
    /// The nine positions of fang, Table 2.
    FangNine,
    /// The 33 accelerometer positions of xu, appendix: eleven attitudes in each of three half planes.
    Xu33,
    /// The rates of xu, 2.2.1: 9, 9 and 11 rates in both directions about x, y and z, and rest with each
    /// upwards.
    XuRates,
    /// The eight dwells of niu, 3.2, on a two-axis table.
    Niu8,
}

/// Positions in the order of fang, Table 2, not normalised.
const FANG: [[f64; 3]; 9] = [
    [1.0, 0.0, 0.0],
    [-1.0, 0.0, 0.0],
    [1.0, 1.0, 0.0],
    [1.0, 0.0, 1.0],
    [0.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.0, 1.0, 1.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.0, -1.0],
];

/// Rates about x and y, and about z, deg/s: xu, appendix.
const XU_XY_DPS: [f64; 9] = [6.0, 12.0, 24.0, 30.0, 60.0, 120.0, 180.0, 240.0, 300.0];
const XU_Z_DPS: [f64; 11] = [
    10.0, 40.0, 100.0, 240.0, 400.0, 720.0, 1000.0, 1800.0, 2160.0, 2880.0, 3600.0,
];
/// Angles of each half plane, degrees: xu, 2.2.2.
const XU_DEG: [f64; 11] = [
    0.0, 15.0, 30.0, 45.0, 60.0, 90.0, 120.0, 135.0, 150.0, 165.0, 180.0,
];

/// Largest rate where a scheme leaves it open, deg/s: the range of fang's gyros.
const RANGE_DPS: f64 = 300.0;

impl Scheme {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::SixFace,
        Self::FangNine,
        Self::Xu33,
        Self::XuRates,
        Self::Niu8,
    ];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::SixFace => "six-face",
            Self::FangNine => "fang-nine",
            Self::Xu33 => "xu-33",
            Self::XuRates => "xu-rates",
            Self::Niu8 => "niu-8",
        }
    }

    /// Full rate along x, y, z, rad/s: the rates of the scheme are shares of it.
    pub fn rate_span(self) -> Vector3<f64> {
        let dps = match self {
            // Its z gyro has twelve times the range of the others.
            Self::XuRates => Vector3::new(300.0, 300.0, 3600.0),
            _ => Vector3::repeat(RANGE_DPS),
        };
        dps.map(f64::to_radians)
    }

    /// The dwells in published order; `None` if the scheme is for the other sensor.
    pub fn settings(self, sensor: Sensor) -> Option<Vec<Setting>> {
        let directions: Vec<Vector3<f64>> = match (self, sensor) {
            (Self::SixFace, _) => {
                let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
                axes.into_iter().flat_map(|a| [a, -a]).collect()
            }
            (Self::FangNine, _) => FANG.map(Vector3::from).to_vec(),
            (Self::Xu33, Sensor::Accel) => {
                let plane = |at: fn(f64, f64) -> Vector3<f64>| {
                    XU_DEG.map(|deg| at(deg.to_radians().cos(), deg.to_radians().sin()))
                };
                let x = plane(|c, s| Vector3::new(-c, 0.0, -s));
                let y = plane(|c, s| Vector3::new(-s, -c, 0.0));
                let z = plane(|c, s| Vector3::new(0.0, -s, -c));
                [x, y, z].concat()
            }
            // The text lacks the figure with the sequence. Quarter turns about y, z, x, z, y, z, x, z. A test enumerates all cycles: 24 fit the text, and all
            // have these poses. This is one of the eight with two turns each about x and y.
            (Self::Niu8, Sensor::Accel) => {
                let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
                vec![-z, x, y, -z, -z, -x, -y, -z]
            }
            (Self::XuRates, Sensor::Gyro) => return Some(xu_rates()),
            (Self::Xu33 | Self::Niu8, Sensor::Gyro) | (Self::XuRates, Sensor::Accel) => {
                return None;
            }
        };
        let at = |direction: Vector3<f64>| match sensor {
            Sensor::Accel => Setting::at_rest(direction),
            Sensor::Gyro => about(direction, RANGE_DPS),
        };
        Some(directions.into_iter().map(at).collect())
    }
}

/// A rate along `direction`, with the axis upwards that makes the unit point down least: -x is the opposite rate
/// with x upwards.
fn about(direction: Vector3<f64>, rate_dps: f64) -> Setting {
    let rate = rate_dps.to_radians();
    let down = direction.sum() < 0.0;
    Setting {
        up: if down { -direction } else { direction }.normalize(),
        rate: if down { -rate } else { rate },
    }
}

fn xu_rates() -> Vec<Setting> {
    let mut settings = Vec::new();
    let axes: [(Vector3<f64>, &[f64]); 3] = [
        (Vector3::x(), &XU_XY_DPS),
        (Vector3::y(), &XU_XY_DPS),
        (Vector3::z(), &XU_Z_DPS),
    ];
    for (axis, rates) in axes {
        settings.push(Setting::at_rest(axis));
        for rate in rates {
            settings.extend([about(axis, *rate), about(-axis, *rate)]);
        }
    }
    settings
}
