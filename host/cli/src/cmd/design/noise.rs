//! Noise of the sensor that a design is made for, and the length of a dwell.

use std::path::PathBuf;
use std::str::FromStr;

use mimu::plan::design::budget::DwellNoise;
use mimu::{Fixture, NoiseFile};
use mimu_recording::error::Result;

use super::DesignArgs;
use crate::arguments::number;

/// White noise, or the noise file.
#[derive(Clone)]
pub(super) enum NoiseArg {
    Density(f64),
    File(PathBuf),
}

impl FromStr for NoiseArg {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text.parse::<f64>() {
            Ok(_) => number(text, 1e-12, 1e3).map(Self::Density),
            Err(_) => Ok(Self::File(text.into())),
        }
    }
}

/// Default length of a dwell for an unknown unit: fang's, s.
const DWELL_S: f64 = 20.0;
/// The same by hand, s: a person does not hold still for longer.
const BY_HAND_S: f64 = 4.0;

impl DesignArgs {
    /// Noise of the sensor. Values given as options override the file.
    pub(super) fn noise(&self) -> Result<DwellNoise> {
        let at_rest = match &self.noise {
            Some(NoiseArg::File(path)) => {
                DwellNoise::from_file(&NoiseFile::read(path)?, self.sensor)?
            }
            other => {
                let fang = DwellNoise::fang(self.sensor);
                let n = match other {
                    Some(NoiseArg::Density(n)) => *n,
                    _ => fang.n,
                };
                let b = fang.b * n / fang.n;
                DwellNoise { n, b, k: 0.0 }
            }
        };
        Ok(DwellNoise {
            n: at_rest.n,
            b: self.instability.unwrap_or(at_rest.b),
            k: self.walk.unwrap_or(at_rest.k),
        })
    }

    /// Whose noise is assumed, if none is given.
    pub(super) fn assumed_noise(&self) -> Option<&'static str> {
        let given = self.sigma.is_some() || self.noise.is_some();
        (!given).then_some(self.sensor.pick("an ADXRS300", "an MMA7260QT"))
    }

    /// Length of a dwell, s.
    pub(super) fn dwell_s(&self, noise: &DwellNoise) -> f64 {
        let useful = match &self.noise {
            Some(NoiseArg::File(_)) => noise.useful_s(),
            _ => None,
        };
        // Tables are set to tenths of a second.
        self.dwell
            .or(useful.map(|s| ((10.0 * s).ceil() / 10.0).max(1.0)))
            .unwrap_or(match self.fixture() {
                Fixture::Hand => BY_HAND_S,
                _ => DWELL_S,
            })
    }

    /// Noise of the sensor, length of a dwell, s, and sigma of its mean, SI.
    pub(super) fn dwell(&self) -> Result<(DwellNoise, f64, f64)> {
        let noise = self.noise()?;
        let dwell_s = self.dwell_s(&noise);
        let sigma = self.sigma.unwrap_or_else(|| noise.sigma(dwell_s));
        Ok((noise, dwell_s, sigma))
    }
}
