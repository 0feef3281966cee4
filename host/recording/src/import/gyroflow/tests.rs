//! Files as the format's documentation gives them, with made-up numbers.

use super::*;
use crate::tests::says;

const HEAD: &str = "GYROFLOW IMU LOG\nversion,1.3\nid,potatocam\norientation,YxZ\nnote,\nfwversion,FIRMWARE_0.1.0\n";
const SCALES: &str = "tscale,0.0005\ngscale,0.00122173047\nascale,0.00048828125\n";

fn read_text(text: &str) -> Result<Readings> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("video.gcsv");
    std::fs::write(&path, text).unwrap();
    read(&path, Choice::default()).map(|mut all| all.remove(0))
}

fn rows(readings: Readings) -> (Vec<i64>, Vec<f64>) {
    (readings.stamps_of(), readings.values_of())
}

#[test]
fn readings_are_in_si_by_the_factors_of_the_header() {
    let text = format!(
        "{HEAD}{SCALES}t,gx,gy,gz,ax,ay,az\n0,39,86,183,-1137,-15689,-2986\r\n1,56,100,202,-1179,-15694,-2887\n"
    );
    let (stamps, values) = rows(read_text(&text).unwrap());
    assert_eq!(stamps, [0, 500_000]);
    // 86 counts of 0.07 deg/s; -15689 counts of 1/2048 g.
    assert!((values[1].to_degrees() - 86.0 * 0.07).abs() < 1e-6);
    assert!((values[4] + 15689.0 / 2048.0 * 9.80665).abs() < 1e-9);
    assert_eq!(values.len(), 12);
}

#[test]
fn stamps_are_milliseconds_without_a_factor_and_a_magnetometer_is_in_gauss() {
    let text = "CAMERA IMU LOG\ngscale,1\nascale,1\nmscale,0.001\ntime,gx,gy,gz,ax,ay,az,mx,my,mz\n20,1,2,3,0,0,1,70,-80,90\n21,1,2,3,0,0,1,,,\n";
    let readings = read_text(text).unwrap();
    let roles = readings.roles();
    let mag = roles[7..].iter().map(|role| role.name());
    assert_eq!(mag.collect::<Vec<_>>(), ["mag_x", "mag_y", "mag_z"]);
    let (stamps, values) = rows(readings);
    assert_eq!(stamps, [20_000_000, 21_000_000]);
    assert_eq!(values[..6], [1.0, 2.0, 3.0, 0.0, 0.0, 9.80665]);
    let off = values[6..9]
        .iter()
        .zip([7.0, -8.0, 9.0])
        .map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f64::max) < 1e-12, "{values:?}");
    assert!(values[15..].iter().all(|value| value.is_nan()));
    // Without its factor its readings have no unit.
    let without = read_text(&text.replace("mscale,0.001\n", "")).unwrap();
    assert_eq!(without.roles().len(), 7);
}

#[test]
fn rows_that_are_cut_or_no_numbers_are_counted() {
    let text = format!(
        "{HEAD}{SCALES}t,gx,gy,gz,ax,ay,az\n0,1,2,3,4,5,6\n1,1,2,,4,5,6\n2,1,2,3,4,5,6\n3,1,2"
    );
    let readings = read_text(&text).unwrap();
    assert_eq!(readings.len(), 2);
    let warning = readings.warnings.join(" ");
    says(&warning, &["2 rows", "line 12"]);
}

#[test]
fn a_header_that_leaves_a_unit_open_is_refused_and_so_is_another_file() {
    let refused = |text: &str| read_text(text).unwrap_err().to_string();
    let no_scale = refused("GYROFLOW IMU LOG\ngscale,1\nt,gx,gy,gz,ax,ay,az\n0,1,2,3,4,5,6\n");
    says(&no_scale, &["ascale", "g per count"]);
    assert!(refused("GYROFLOW IMU LOG\ngscale,fast\nt,gx,gy,gz\n").contains("\"fast\""));
    assert!(refused("t,gx,gy,gz\n0,1,2,3\n").contains("GYROFLOW IMU LOG"));
    assert!(refused(HEAD).contains("t,gx,gy,gz"));
    assert!(refused("GYROFLOW IMU LOG\ngscale,1\nt,ax,ay,az\n0,1,2,3\n").contains("t,ax,ay,az"));
}
