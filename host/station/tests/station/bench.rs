//! Units of the bench at rest, as a station gets them.

use mimu_recording::error::Error;
use mimu_recording::{Batch, RawUnit};
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::random::Random;
use mimu_rig::record::samples;
use mimu_rig::rig_file::{AffineFile, RigFile, RigTruth};
use mimu_rig::table::TableTruth;
use mimu_station::document::Document;
use mimu_station::gather::Samples;
use mimu_station::limits::Limits;
use mimu_station::quantities::{Quantities, measure};
use mimu_station::scale::{Ranges, Scale};

/// Local gravity of the bench, m/s².
pub const GRAVITY: f64 = 9.8062;
/// Ranges of the unit: an MPU-6050.
pub const RANGES: Ranges = Ranges {
    accel_g: Some(2.0),
    gyro_dps: Some(500.0),
};
/// Counts per deg/s and per g of these ranges, by the data sheet.
pub const COUNTS: [f64; 2] = [65.5, 16384.0];
const RATE_HZ: f64 = 1000.0;
const LENGTH_S: f64 = 10.0;

/// A unit: what it deviates from the data sheet.
#[derive(Debug, Clone)]
pub struct Unit {
    /// Zero-rate offsets, deg/s.
    pub gyro_offset_dps: [f64; 3],
    /// Zero-g offsets, mg.
    pub accel_offset_mg: [f64; 3],
    /// Scale factors of the accelerometer over the nominal ones.
    pub accel_scale: [f64; 3],
    /// One-sided noise densities, deg/s/√Hz and µg/√Hz.
    pub density: [f64; 2],
    /// Samples a second.
    pub rate_hz: f64,
    /// Whether the Earth turns.
    pub earth: bool,
    /// Coefficients of flicker noise, deg/s and mg.
    pub flicker: [f64; 2],
    /// Share of lost samples.
    pub lost: f64,
    /// `[[step]]` of the plan.
    pub steps: String,
}

impl Default for Unit {
    fn default() -> Self {
        Self {
            gyro_offset_dps: [0.0; 3],
            accel_offset_mg: [0.0; 3],
            accel_scale: [1.0; 3],
            density: [0.005, 250.0],
            rate_hz: RATE_HZ,
            earth: true,
            flicker: [0.002, 0.03],
            lost: 0.0,
            steps: up([0.0, 0.0, 1.0], LENGTH_S),
        }
    }
}

/// A step with a side up.
pub fn up(side: [f64; 3], seconds: f64) -> String {
    format!("[[step]]\nup = {side:?}\ndwell_s = {seconds:?}\n")
}

impl Unit {
    /// A good unit of a production, drawn by the seed.
    pub fn drawn(seed: u64) -> Self {
        let mut random = Random::new(seed, "unit of a line");
        Self {
            gyro_offset_dps: std::array::from_fn(|_| 0.5 * random.normal()),
            accel_offset_mg: std::array::from_fn(|_| 10.0 * random.normal()),
            accel_scale: std::array::from_fn(|_| 1.0 + 0.004 * random.normal()),
            ..Self::default()
        }
    }

    fn truth(&self) -> RigTruth {
        let [dps, g] = [1f64.to_radians(), 9.80665];
        let diagonal = |scale: [f64; 3]| {
            std::array::from_fn(|i| std::array::from_fn(|j| if i == j { scale[i] } else { 0.0 }))
        };
        let mut file = RigFile {
            table: TableTruth::ideal(),
            earth_rate: Some(self.earth),
            ..RigFile::default()
        };
        let part = |name: &str| Some(mimu_rig::rig_file::Parts::One(name.into()));
        file.unit.gyro = part("MPU6050-gyro");
        file.unit.accel = part("MPU6050-accel");
        file.unit.gyro_affine = Some(AffineFile {
            matrix: diagonal([COUNTS[0] / dps; 3]),
            bias: self.gyro_offset_dps.map(|offset| offset * COUNTS[0]),
        });
        file.unit.accel_affine = Some(AffineFile {
            matrix: diagonal(self.accel_scale.map(|scale| scale * COUNTS[1] / g)),
            bias: self.accel_offset_mg.map(|offset| 1e-3 * offset * COUNTS[1]),
        });
        let root = 2f64.sqrt();
        for (axes, density, flicker, si) in [
            (
                &mut file.unit.gyro_axes,
                self.density[0],
                self.flicker[0],
                dps,
            ),
            (
                &mut file.unit.accel_axes,
                1e-6 * self.density[1],
                1e-3 * self.flicker[1],
                g,
            ),
        ] {
            axes.white_si = Some([density / root * si; 3]);
            axes.instability_si = Some([flicker * si; 3]);
            axes.walk_si = Some([0.0; 3]);
        }
        file.thermal.on_before_s = Some(f64::INFINITY);
        file.flaws.lost_share = self.lost;
        RigTruth::resolve(&file, 1).expect("a unit of the bench")
    }

    /// What it sends at rest.
    pub fn samples(&self, seed: u64) -> Samples {
        let text = format!(
            "format = \"mimu-plan/1\"\nsample_rate_hz = {:?}\ncarrier = \"table\"\ngravity_mps2 = {GRAVITY:?}\n{}",
            self.rate_hz, self.steps
        );
        let plan = Plan::parse(Source::new("PLAN.toml", text)).expect("a plan");
        let mut batch = Batch::default();
        for row in samples(&plan, &self.truth(), seed).expect("samples") {
            batch.t_s.push(row.stamp_s);
            batch.temp_c.push(row.readings.temp_c);
            let readings = row.readings.gyro.iter().chain(&row.readings.accel);
            for (to, value) in batch.raw.iter_mut().zip(readings) {
                to.push(*value);
            }
        }
        Samples {
            batch,
            unit: format!("unit-{seed}"),
            place: "bench".into(),
            raw_unit: RawUnit::Count,
            gravity: [GRAVITY, 0.0],
            sensors: None,
            nominal: None,
            rate_hz: None,
            self_test: Vec::new(),
        }
    }
}

/// What a station finds of `samples`.
pub fn found(samples: &Samples) -> (Quantities, Scale) {
    measured(samples).expect("the unit lies still")
}

/// Value and standard uncertainties (whole, type A) of a quantity.
pub fn figure(found: &Quantities, name: &str) -> [f64; 3] {
    let named = found.measured.iter().find(|m| m.name == name);
    let m = named.unwrap_or_else(|| panic!("{name} is not measured: {:?}", found.not_measured));
    [m.value, m.sigma, m.repeatability]
}

/// Limits of the line.
pub const LIMITS: &str = r#"
format = "mimu-limits/1"
product = "board"
up = "+z"
rows = [
    { name = "gyro_offset", lower = -2, upper = 2, unit = "deg/s" },
    { name = "gravity_error", lower = -40, upper = 40, unit = "mg" },
    { name = "gyro_noise_density", lower = 0.001, upper = 0.008, unit = "deg/s/√Hz" },
    { name = "accel_noise_density", lower = 50, upper = 400, unit = "µg/√Hz" },
    { name = "gyro_equal_run", upper = 100, unit = "sample" },
    { name = "accel_equal_run", upper = 100, unit = "sample" },
    { name = "sample_rate", lower = 990, upper = 1010, unit = "Hz" },
    { name = "tilt", upper = 3, unit = "deg" },
]
"#;

/// What a station finds of `samples`, or why not.
pub fn measured(samples: &Samples) -> Result<(Quantities, Scale), Error> {
    let scale = Scale::of(samples, None, Some(&RANGES), None)?;
    Ok((measure(samples, &scale, Some("+z"))?, scale))
}

/// The result of what was measured, by `limits`.
pub fn judge(
    samples: &Samples,
    measured: &Result<(Quantities, Scale), Error>,
    limits: &str,
) -> Document {
    let limits = Limits::parse(limits, "limits.toml").expect("limits");
    let time = "2026-01-01T00:00:00Z";
    let document = Document::new(&samples.unit, Vec::new(), time, &limits, None);
    let judged = match measured {
        Ok((found, scale)) => document.clone().judge(found, samples, &limits, None, scale),
        Err(error) => Err(error.clone()),
    };
    judged.unwrap_or_else(|error| document.refused(&error))
}

/// The result of a unit with its side z up, by `limits`.
pub fn judged(samples: &Samples, limits: &str) -> Document {
    judge(samples, &measured(samples), limits)
}

/// Names of the quantities beyond their limits.
pub fn beyond(document: &Document) -> Vec<&str> {
    document
        .failed()
        .map(|m| m.measured.name.as_str())
        .collect()
}
