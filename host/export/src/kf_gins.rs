//! Noise for KF-GINS: `imunoise` of its kf-gins.yaml.
//!
//! arw and vrw are N in deg/√h and m/s/√h, gbstd and abstd the standard deviations of the biases in deg/h and mGal, corrtime their correlation time in h, for
//! x, y and z (forward, right, down). gsstd and asstd are those of scale factors, which noise at rest does not show. Source: i2Nav-WHU/KF-GINS,
//! dataset/kf-gins.yaml (units); src/kf_gins.cpp, `LoadOptions`; src/kf-gins/gi_engine.cpp, `GIEngine` (driving noise `2 std²/corrtime`).

use std::fmt::Write as _;

use mimu::quantity::Sensor::{Accel, Gyro};
use mimu_recording::error::Result;

use crate::gauss_markov::{Options, keys};
use crate::layout::{NoiseKey, walk, white};
use crate::{Export, Noise, Page, Sources, Target};

/// deg/√h, and deg/h, in SI.
const DEG: f64 = std::f64::consts::PI / 180.0;

/// The format.
pub struct KfGins;

impl Target for KfGins {
    type Options = Options;
    const NAME: &str = "kf-gins";
    const ABOUT: &str = "Noise for KF-GINS";
    const CONTENTS: &str = "noise of each axis";
    const READERS: &str = "KF-GINS";
    const NOISE: Noise = Noise::Only;
    const NOISE_KEYS: &[NoiseKey] = &[
        white("imunoise/arw", "deg/sqrt(hr)", Gyro).in_si(DEG / 60.0),
        white("imunoise/vrw", "m/s/sqrt(hr)", Accel).in_si(1.0 / 60.0),
        walk("imunoise/gbstd", "deg/hr", Gyro)
            .in_si(DEG / 3600.0)
            .gauss_markov("imunoise/corrtime", 3600.0 / 2.0),
        walk("imunoise/abstd", "mGal", Accel)
            .in_si(1e-5)
            .gauss_markov("imunoise/corrtime", 3600.0 / 2.0),
    ];
    const PAGES: &[Page] = &[Page::of("KF-GINS", "kf-gins.yaml")];

    /// # Errors
    /// The noise is missing, or an error of [`crate::worst_axis::WalkOptions::axes`].
    fn export(from: &Sources, options: &Options) -> Result<Export> {
        let (mut export, keys) = keys::<Self>(from, options, f64::sqrt(0.5))?;
        export.formula("arw, vrw = N; gbstd, abstd = K sqrt(corrtime/2); of x, y, z");
        export.note("Copy these keys into imunoise of kf-gins.yaml. gsstd and asstd stay its own: noise at rest does not show how scale factors change.");
        let mut out = export.head("#", from) + "imunoise:\n";
        for (key, values) in keys {
            let name = key.key.rsplit('/').next().unwrap_or(key.key);
            let _ = writeln!(out, "  {name}: [{values}]  # {}", key.unit);
        }
        let hours = options.correlation_time / 3600.0;
        let _ = writeln!(out, "  corrtime: {hours:?}  # hr");
        Ok(export.with(out))
    }
}
