//! `[curves]` of a rig file: the sensors over temperature.

use serde::{Deserialize, Serialize};

use crate::curves::{Cubic, CurvesTruth, TriadCurves};
use crate::effects::{DPS, G};
use crate::located::written;
use crate::random::Random;
use crate::refusal::{Refusal, within};
use crate::rotation::Vector;

/// A degree per hour in rad/s.
const DEG_PER_H: f64 = DPS / 3600.0;
/// A thousandth of standard gravity, m/s².
const MG: f64 = 1e-3 * G;
/// Off-diagonal elements of a misalignment, by rows: xy, xz, yx, yz, zx, zy. The first letter is the sensor, the second the body axis that it should
/// not sense.
const BESIDE: [(usize, usize); 6] = [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)];

/// `[curves]`. Four numbers are the coefficients A0 to A3 of `A0 + A1 ΔT + A2 ΔT² + A3 ΔT³`, ΔT in K from `reference_c`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CurvesFile {
    /// Temperature from which the curves count. Default 25.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_c: Option<f64>,
    /// `[curves.gyro]`.
    #[serde(skip_serializing_if = "GyroCurvesFile::is_empty")]
    pub gyro: GyroCurvesFile,
    /// `[curves.accel]`.
    #[serde(skip_serializing_if = "AccelCurvesFile::is_empty")]
    pub accel: AccelCurvesFile,
}

/// `[curves.gyro]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GyroCurvesFile {
    /// Cubics of the biases x, y, z.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bias_deg_per_h: Option<[[f64; 4]; 3]>,
    /// Cubics of the scale factor errors x, y, z.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale_ppm: Option<[[f64; 4]; 3]>,
    /// Cubics of the misalignments xy, xz, yx, yz, zx, zy: sensor, then the body axis that it also senses.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub misalignment_ppm: Option<[[f64; 4]; 6]>,
    /// Scatter of the biases from power-on to power-on, standard deviation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub power_on_sigma_deg_per_h: Option<[f64; 3]>,
    /// Biases of this power-on. Default: drawn by the scatter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub power_on_deg_per_h: Option<[f64; 3]>,
    /// Half the height of the biases' hysteresis loop.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hysteresis_deg_per_h: Option<[f64; 3]>,
    /// Width of the loop. Default 10.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hysteresis_width_c: Option<f64>,
    /// Temperature, and the standard deviation of a reading of each axis at it, raw.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_at_c_raw: Option<Vec<[f64; 4]>>,
}

/// `[curves.accel]`: as [`GyroCurvesFile`].
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AccelCurvesFile {
    /// Cubics of the biases x, y, z.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bias_mg: Option<[[f64; 4]; 3]>,
    /// Cubics of the scale factor errors x, y, z.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale_ppm: Option<[[f64; 4]; 3]>,
    /// Cubics of the misalignments xy, xz, yx, yz, zx, zy: sensor, then the body axis that it also senses.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub misalignment_ppm: Option<[[f64; 4]; 6]>,
    /// Scatter of the biases from power-on to power-on, standard deviation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub power_on_sigma_mg: Option<[f64; 3]>,
    /// Biases of this power-on. Default: drawn by the scatter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub power_on_mg: Option<[f64; 3]>,
    /// Half the height of the biases' hysteresis loop.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hysteresis_mg: Option<[f64; 3]>,
    /// Width of the loop. Default 10.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hysteresis_width_c: Option<f64>,
    /// Temperature, and the standard deviation of a reading of each axis at it, raw.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_at_c_raw: Option<Vec<[f64; 4]>>,
}

impl GyroCurvesFile {
    fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

impl AccelCurvesFile {
    fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// Fields that both kinds of triad share, borrowed from either file.
struct Triad<'a> {
    path: &'static str,
    /// Unit of a bias in its keys, and its SI value.
    unit: &'static str,
    si: f64,
    bias: &'a Option<[[f64; 4]; 3]>,
    scale_ppm: &'a Option<[[f64; 4]; 3]>,
    misalignment_ppm: &'a Option<[[f64; 4]; 6]>,
    power_on_sigma: &'a Option<[f64; 3]>,
    power_on: &'a mut Option<[f64; 3]>,
    hysteresis: &'a Option<[f64; 3]>,
    width_c: &'a Option<f64>,
    noise: &'a Option<Vec<[f64; 4]>>,
}

impl CurvesFile {
    fn triads(&mut self) -> [Triad<'_>; 2] {
        let (g, a) = (&mut self.gyro, &mut self.accel);
        [
            Triad {
                path: "curves.gyro",
                unit: "deg_per_h",
                si: DEG_PER_H,
                bias: &g.bias_deg_per_h,
                scale_ppm: &g.scale_ppm,
                misalignment_ppm: &g.misalignment_ppm,
                power_on_sigma: &g.power_on_sigma_deg_per_h,
                power_on: &mut g.power_on_deg_per_h,
                hysteresis: &g.hysteresis_deg_per_h,
                width_c: &g.hysteresis_width_c,
                noise: &g.noise_at_c_raw,
            },
            Triad {
                path: "curves.accel",
                unit: "mg",
                si: MG,
                bias: &a.bias_mg,
                scale_ppm: &a.scale_ppm,
                misalignment_ppm: &a.misalignment_ppm,
                power_on_sigma: &a.power_on_sigma_mg,
                power_on: &mut a.power_on_mg,
                hysteresis: &a.hysteresis_mg,
                width_c: &a.hysteresis_width_c,
                noise: &a.noise_at_c_raw,
            },
        ]
    }

    /// Returns the first error.
    pub(super) fn check(&self) -> Result<(), Refusal> {
        within(
            "curves.reference_c",
            self.reference_c.as_slice(),
            [-100.0, 200.0],
        )?;
        self.clone().triads().iter().try_for_each(Triad::check)
    }

    /// The truth. Drawn values are written into the file.
    pub(super) fn resolve(&mut self, seed: u64) -> CurvesTruth {
        let reference_c = self.reference_c.unwrap_or(25.0);
        let [gyro, accel] = self.triads().map(|triad| triad.resolve(seed));
        CurvesTruth {
            reference_c,
            gyro,
            accel,
        }
    }
}

impl Triad<'_> {
    fn check(&self) -> Result<(), Refusal> {
        let at = |key: &str| format!("{}.{key}", self.path);
        let in_unit = |key: &str| format!("{}.{key}_{}", self.path, self.unit);
        // A hundred thousand degrees per hour and a hundred g, for a coefficient of 1 K³.
        let (size, any) = ([0.0, 1e6], [-1e6, 1e6]);
        for (path, values, range) in [
            (
                in_unit("bias"),
                self.bias.as_slice().as_flattened().as_flattened(),
                any,
            ),
            (
                at("scale_ppm"),
                self.scale_ppm.as_slice().as_flattened().as_flattened(),
                any,
            ),
            (
                at("misalignment_ppm"),
                self.misalignment_ppm
                    .as_slice()
                    .as_flattened()
                    .as_flattened(),
                any,
            ),
            (
                in_unit("power_on_sigma"),
                self.power_on_sigma.as_slice().as_flattened(),
                size,
            ),
            (
                in_unit("power_on"),
                self.power_on.as_slice().as_flattened(),
                any,
            ),
            (
                in_unit("hysteresis"),
                self.hysteresis.as_slice().as_flattened(),
                any,
            ),
            (
                at("hysteresis_width_c"),
                self.width_c.as_slice(),
                [0.01, 300.0],
            ),
        ] {
            within(&path, values, range)?;
        }
        self.check_noise(&at("noise_at_c_raw"))
    }

    fn check_noise(&self, path: &str) -> Result<(), Refusal> {
        let points = self.noise.as_deref().unwrap_or_default();
        for point in points {
            within(path, &point[..1], [-100.0, 200.0])?;
            within(path, &point[1..], [0.0, 1e10])?;
        }
        if let Some(pair) = points.windows(2).find(|pair| pair[1][0] <= pair[0][0]) {
            let problem = format!(
                "`noise_at_c_raw`: {} °C follows {} °C",
                written(pair[1][0]),
                written(pair[0][0])
            );
            let remedy = "give [°C, x, y, z] in order of temperature";
            return Err(Refusal::new(path, problem, remedy));
        }
        Ok(())
    }

    fn resolve(self, seed: u64) -> TriadCurves {
        if let Some(sigma) = self.power_on_sigma {
            self.power_on.get_or_insert_with(|| {
                let mut random = Random::new(seed, &format!("{} power-on", self.path));
                sigma.map(|s| s * random.normal())
            });
        }
        let cubic = |a: &[f64; 4], unit: f64| Cubic(a.map(|x| unit * x));
        let mut truth = TriadCurves {
            power_on: si(*self.power_on, self.si),
            hysteresis: si(*self.hysteresis, self.si),
            width_c: self.width_c.unwrap_or(10.0),
            noise: self.noise.clone().unwrap_or_default(),
            ..TriadCurves::default()
        };
        if let Some(bias) = self.bias {
            truth.bias = bias.each_ref().map(|a| cubic(a, self.si));
        }
        for (i, a) in self.scale_ppm.iter().flatten().enumerate() {
            truth.matrix[i][i] = cubic(a, 1e-6);
        }
        for ((i, j), a) in BESIDE.iter().zip(self.misalignment_ppm.iter().flatten()) {
            truth.matrix[*i][*j] = cubic(a, 1e-6);
        }
        truth
    }
}

fn si(values: Option<[f64; 3]>, unit: f64) -> Vector {
    values.unwrap_or_default().map(|x| unit * x)
}
