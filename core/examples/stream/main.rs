//! Compensates a stream of readings: `cargo run -p mimu-core --example stream -- unit.mimc 100 < samples.csv`, whose columns are gyro x, y, z
//! and accelerometer x, y, z in volts and the temperature in °C, at 100 samples a second. `mimu export core -o unit.mimc` writes the bytes.

#[rustfmt::skip] // As the README shows it.
mod calibrate;

use std::error::Error;
use std::io::BufRead;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let usage = "usage: stream CALIBRATION SAMPLE_RATE_HZ < SAMPLES";
    let calibration = std::fs::read(arguments.next().ok_or(usage)?)?;
    let sample_rate_hz = arguments.next().ok_or(usage)?.parse()?;
    let mut samples = Vec::new();
    for (row, line) in std::io::stdin().lock().lines().enumerate() {
        let line = line?;
        let cells: Result<Vec<f32>, _> = line.split(',').map(|cell| cell.trim().parse()).collect();
        let problem = || format!("row {}: {line:?} is not seven numbers", row + 1);
        let [gx, gy, gz, ax, ay, az, temp_c] = cells.map_err(|_| problem())?[..] else {
            return Err(problem().into());
        };
        samples.push(([gx, gy, gz], [ax, ay, az], temp_c));
    }
    calibrate::calibrate(
        &calibration,
        sample_rate_hz,
        samples.into_iter(),
        |si, place| {
            let ([gx, gy, gz], [ax, ay, az]) = (si.gyro.into(), si.accel.into());
            let (gx, gy, gz, ax, ay, az): (f32, f32, f32, f32, f32, f32) = (gx, gy, gz, ax, ay, az);
            println!("{gx},{gy},{gz},{ax},{ay},{az},{place:?}");
        },
    )?;
    Ok(())
}
