//! Units on a table in a chamber whose temperature goes up and down.

use mimu_rig::rig_file::RigFile;
use nalgebra::Vector3;

use crate::bench;

/// Biases over temperature of [`thermal`]: deg/h and mg per kelvin.
const SLOPES: [[f64; 3]; 2] = [[300.0, -360.0, 240.0], [2.0, -1.5, 1.0]];

/// Six faces at rest and rates in both directions, repeated, while the chamber goes through `chamber_c`.
pub fn plan(rounds: u32, dwell_s: f64, chamber_c: &[[f64; 2]]) -> String {
    let mut plan = format!(
        "format = \"mimu-plan/1\"\nsample_rate_hz = 100.0\ncarrier = \"table\"\nrounds = {rounds}\nlead_in_s = 5.0\nchamber_c = {chamber_c:?}\n"
    );
    for axis in 0..3 {
        let up: [f64; 3] = std::array::from_fn(|i| f64::from(u8::from(i == axis)));
        let down = up.map(|u| -u);
        for (up, rate_dps) in [(up, 0.0), (down, 0.0), (up, 50.0), (up, -50.0)] {
            plan +=
                &format!("[[step]]\nup = {up:?}\nrate_dps = {rate_dps:?}\ndwell_s = {dwell_s:?}\n");
        }
    }
    plan
}

/// A unit of the usual parts, warmed up, whose die is at the temperature of its board.
pub fn unit(seed: u64) -> RigFile {
    let mut file = bench::drawn(seed, "unit");
    file.thermal.on_before_s = Some(f64::INFINITY);
    file.thermal.board_lag_s = Some(60.0);
    file.thermal.die_lag_s = Some([1.0; 4]);
    file.thermal.die_heating_c = Some([0.0; 4]);
    file
}

/// The same with biases that follow the temperature.
pub fn thermal(seed: u64) -> RigFile {
    let mut file = unit(seed);
    let line = |slope: f64| [0.0, slope, 0.0, 0.0];
    let [gyro, accel] = SLOPES;
    file.curves.gyro.bias_deg_per_h = Some(gyro.map(line));
    file.curves.accel.bias_mg = Some(accel.map(line));
    file
}

/// Change of the true biases of [`thermal`] from 25 °C to `temp_c`, along the axes of the sensors of gyro and accelerometer, SI.
pub fn bias_change(temp_c: f64) -> [Vector3<f64>; 2] {
    let si = [(1.0 / 3600.0_f64).to_radians(), 9.80665e-3];
    [0, 1].map(|k| si[k] * (temp_c - 25.0) * Vector3::from(SLOPES[k]))
}
