//! Boards from hobby sensors to tactical ones.

use mimu_tests::text_board::{Random, TextBoard};

/// A board that writes text.
pub struct Sensor {
    /// Its part.
    pub name: &'static str,
    /// Unit of its readings, as on the command line.
    pub unit: &'static str,
    /// The board.
    pub board: TextBoard,
    /// Ends of its ranges, deg/s and g.
    pub range: [f64; 2],
}

/// A part by its data sheet: gyro and accelerometer with raw per deg/s and per g (0: SI), standard deviations of a sample, deg/s and mg, at 100
/// lines a second, ends of the ranges, deg/s and g, and scatter of scale factors and axes.
type Part = (&'static str, [f64; 2], [f64; 2], [f64; 2], f64);

#[rustfmt::skip]
const PARTS: [Part; 10] = [
    ("MPU-6050", [65.5, 16384.0], [0.05, 2.7], [500.0, 2.0], 0.012),
    ("MPU-9250", [16.4, 2048.0], [0.1, 3.0], [2000.0, 16.0], 0.012),
    ("L3GD20+ADXL", [14.3, 256.0], [0.3, 4.0], [2000.0, 16.0], 0.015),
    ("LSM6DS3", [57.1, 8197.0], [0.05, 0.9], [500.0, 4.0], 0.008),
    ("BMI160", [32.8, 8192.0], [0.07, 1.8], [1000.0, 4.0], 0.008),
    ("BMI270", [16.4, 4096.0], [0.07, 1.6], [2000.0, 8.0], 0.005),
    ("ICM-42688-P", [65.5, 8192.0], [0.028, 0.7], [500.0, 4.0], 0.005),
    ("LSM6DSV", [57.1, 8197.0], [0.028, 0.6], [500.0, 4.0], 0.005),
    ("ADIS16470", [0.0, 0.0], [0.05, 0.4], [2000.0, 40.0], 0.002),
    ("tactical", [0.0, 0.0], [0.008, 0.1], [490.0, 10.0], 0.0005),
];
/// Lines a second.
const RATES: [f64; 3] = [50.0, 100.0, 200.0];

impl Sensor {
    /// The board of a seed: each part at each rate in turn.
    pub fn of(seed: u64) -> Self {
        let (name, raw, noise, range, scatter) = PARTS[(seed % 10) as usize];
        let rate_hz = RATES[(seed / 10 % 3) as usize];
        let mut random = Random::new(seed ^ 0x5e50);
        let mut board = TextBoard::new(seed);
        // Raw per SI, and SI of the unit of the noise.
        let si = [1.0_f64.to_radians(), 9.80665];
        for (k, triad) in board.truth.triads.iter_mut().enumerate() {
            let counts = raw[k] > 0.0;
            let scale = if counts { raw[k] / si[k] } else { 1.0 };
            triad.matrix = [0, 1, 2].map(|i| {
                [0, 1, 2].map(|j| scale * (f64::from(u8::from(i == j)) + scatter * random.normal()))
            });
            // Zeros of 20 times the scatter in deg/s, and of 2.5 times in g: 0.24 deg/s and 30 mg of an MPU-6050.
            let zero = [20.0 * scatter, 2.5 * scatter][k] * si[k] * scale;
            triad.bias = [0.0; 3].map(|_| zero * random.normal());
            let sigma = noise[k] * [1.0, 1e-3][k] * si[k] * scale;
            board.noise[k] = sigma * (rate_hz / 100.0).sqrt();
            board.steps[k] = if counts { 1.0 } else { 0.0 };
        }
        board.rate_hz = rate_hz;
        Self {
            name,
            unit: if raw[0] > 0.0 { "count" } else { "SI" },
            board,
            range,
        }
    }
}
