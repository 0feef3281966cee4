//! Files written by version 0.1, before serde was used: they are still read, and today's output reads back to the last bit.

use mimu::calibration::Calibration;
use mimu::noise::noise_file::NoiseFile;
use mimu::quantity::Sensor;

#[test]
fn a_calibration_written_before_is_read_with_its_effects_and_written_again_without_a_loss() {
    let text = include_str!("calibration-0.1.toml");
    let read = Calibration::parse(text, "calibration-0.1.toml").unwrap();
    assert_eq!(read.effects()[0].id(), "gyro_g_sensitivity");
    assert_eq!(read.effects()[0].values[0], 0.00018432764334673672);
    let forward = read.table(Sensor::Accel).unwrap().forward.clone();
    assert_eq!(forward.P[1][1], 1640.2717802251002);
    let written = read.to_toml();
    let again = Calibration::parse(&written, "again").unwrap();
    assert_eq!(again.to_toml(), written);
    for sensor in Sensor::BOTH {
        let [a, b] = [&read, &again].map(|c| c.table(sensor).unwrap());
        assert_eq!((a.C, a.o, a.sigma_C), (b.C, b.o, b.sigma_C));
        assert_eq!(a.covariance, b.covariance);
    }
    assert_eq!(read.effects(), again.effects());
}

#[test]
fn a_noise_file_written_before_is_read_and_written_again_without_a_loss() {
    let text = include_str!("noise-0.1.toml");
    let read = NoiseFile::parse(text, "noise").unwrap();
    assert_eq!(
        read.channel[0].n.as_ref().unwrap().value,
        2.2050087804444782e-4
    );
    assert!(
        read.channel[0]
            .q_reason
            .as_ref()
            .unwrap()
            .starts_with("not seen")
    );
    let again = NoiseFile::parse(&read.to_toml(), "noise").unwrap();
    assert_eq!(read, again);
}
