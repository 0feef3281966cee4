//! Files for programs that take one noise figure for three axes.

use mimu::noise::noise_file::{FileCoefficient, NOISE_FORMAT, NoiseChannel, NoiseFile};
use mimu_export::fastlio::{self, FastLio};
use mimu_export::liosam::{self, LioSam};
use mimu_export::orbslam3::OrbSlam3;
use mimu_export::vins::{self, Vins};
use mimu_export::worst_axis::NoiseOptions;
use mimu_export::{Sources, Target};

/// Ends of every interval, relative to its value.
const ENDS: [f64; 2] = [0.9, 1.2];

fn coefficient(value: f64, unit: &str) -> Option<FileCoefficient> {
    Some(FileCoefficient {
        value,
        sigma: 0.1 * value,
        lower: ENDS[0] * value,
        upper: ENDS[1] * value,
        unit: unit.into(),
    })
}

fn channel(k: usize) -> NoiseChannel {
    let (sensor, unit) = match k / 3 {
        0 => ("gyro", "rad/s"),
        _ => ("accel", "m/s^2"),
    };
    let worse = 1.0 + (k % 3) as f64;
    NoiseChannel {
        name: format!("{sensor}_{}", ["x", "y", "z"][k % 3]),
        unit: unit.into(),
        raw_unit: None,
        scale_factor: None,
        samples: 100_000,
        temp_c: None,
        q: None,
        n: coefficient(1e-3 * worse, "per root of hertz"),
        b: None,
        k: coefficient(2e-5 * worse, "times root of hertz"),
        r: None,
        q_reason: None,
        n_reason: None,
        b_reason: None,
        k_reason: None,
        r_reason: None,
        k_at_most: None,
    }
}

pub fn noise() -> NoiseFile {
    NoiseFile {
        format: NOISE_FORMAT.into(),
        device: "unit".into(),
        created: None,
        judgement: None,
        sample_rate_hz: 200.0,
        duration_s: 7200.0,
        confidence: 0.95,
        channel: (0..6).map(channel).collect(),
        place: "noise.toml".into(),
    }
}

#[test]
fn the_interval_beside_a_figure_is_in_the_unit_of_the_figure() {
    let noise = noise();
    let from = Sources {
        noise: Some(&noise),
        ..Sources::default()
    };
    let common = NoiseOptions::default;
    // The power of a density: FAST-LIO takes variances.
    let vins = vins::Options {
        noise: common(),
        gravity: Default::default(),
    };
    let fastlio = fastlio::Options {
        noise: common(),
        ros2: false,
    };
    let liosam = liosam::Options {
        walks: Default::default(),
        gravity: Default::default(),
        ros2: false,
    };
    let exports = [
        (Vins::export(&from, &vins), 1),
        (FastLio::export(&from, &fastlio), 2),
        (LioSam::export(&from, &liosam), 1),
        (OrbSlam3::export(&from, &common()), 1),
    ];
    for (export, power) in exports {
        let text = String::from_utf8(export.unwrap().content).unwrap();
        let mut found = 0;
        for line in text.lines().filter(|line| line.contains("_z: ")) {
            let (figure, comment) = line.split_once(" # ").unwrap();
            let value: f64 = figure.split_once(": ").unwrap().1.trim().parse().unwrap();
            let (_, ends) = comment.split_once("_z: ").unwrap();
            let ends: Vec<f64> = ends.split(" to ").map(|end| end.parse().unwrap()).collect();
            for (end, ratio) in ends.iter().zip(ENDS) {
                // Three digits are written.
                let off = end / value / ratio.powi(power) - 1.0;
                assert!(off.abs() < 6e-3, "{line}");
            }
            found += 1;
        }
        assert_eq!(found, 4, "{text}");
    }
}
