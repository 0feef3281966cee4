//! Noise for NaveGo: fields of its structure of an IMU, in MATLAB and Octave.
//!
//! `imu_si_errors` converts them: arw and vrw are N in deg/√h and m/s/√h, gb_dyn and ab_dyn the biases in deg/s and mg, gb_corr and ab_corr their correlation
//! times in s, for x, y and z. NaveGo's filter drives a bias by `gb_dyn ./ sqrt(gb_corr)`. Source: rodralez/NaveGo, conversions/imu_si_errors.m, version 011
//! (2021-12); ins-gnss/ins_gnss.m.

use std::fmt::Write as _;

use mimu::quantity::Sensor::{Accel, Gyro};
use mimu::readable::STANDARD_GRAVITY;
use mimu_recording::error::Result;

use crate::gauss_markov::{Options, keys};
use crate::layout::{NoiseKey, walk, white};
use crate::{Export, Noise, Page, Sources, Target};

/// deg/√h, and deg/s, in SI.
const DEG: f64 = std::f64::consts::PI / 180.0;

/// The format.
pub struct NaveGo;

impl Target for NaveGo {
    type Options = Options;
    const NAME: &str = "navego";
    const ABOUT: &str = "Noise for NaveGo: fields of its structure of an IMU";
    const CONTENTS: &str = "noise of each axis";
    const READERS: &str = "NaveGo, in MATLAB and Octave";
    const NOISE: Noise = Noise::Only;
    const NOISE_KEYS: &[NoiseKey] = &[
        white("imu/arw", "deg/root(hour)", Gyro).in_si(DEG / 60.0),
        white("imu/vrw", "m/s/root(hour)", Accel).in_si(1.0 / 60.0),
        walk("imu/gb_dyn", "deg/s", Gyro)
            .in_si(DEG)
            .gauss_markov("imu/gb_corr", 1.0),
        walk("imu/ab_dyn", "mg", Accel)
            .in_si(1e-3 * STANDARD_GRAVITY)
            .gauss_markov("imu/ab_corr", 1.0),
    ];
    const RATE_KEY: Option<&str> = Some("imu/freq");
    const PAGES: &[Page] = &[Page::of("NaveGo", "imu.m")];

    /// # Errors
    /// The noise is missing, or an error of [`crate::worst_axis::WalkOptions::axes`].
    fn export(from: &Sources, options: &Options) -> Result<Export> {
        let (mut export, keys) = keys::<Self>(from, options, 1.0)?;
        export.formula("arw, vrw = N; gb_dyn, ab_dyn = K sqrt(correlation time); of x, y, z");
        export.note("Run it before imu_si_errors(imu, dt). Static biases (gb_sta, ab_sta) are 0 for calibrated readings.");
        let mut out = export.head("%", from);
        for (key, values) in keys {
            let name = key.key.replace('/', ".");
            let _ = writeln!(out, "{name} = [{values}]; % {}", key.unit);
        }
        let (t, rate) = (options.correlation_time, from.noise()?.sample_rate_hz);
        for name in ["gb_corr", "ab_corr"] {
            let _ = writeln!(out, "imu.{name} = [{t:?}, {t:?}, {t:?}]; % seconds");
        }
        let _ = writeln!(out, "imu.freq = {rate:?}; % Hz");
        Ok(export.with(out))
    }
}
