//! The command with the board whose sensor is digital: counts by a clock that is not the crystal's, from a unit of known truth.
//!
//! The bench defines the truth: the sensor's counts follow from the matrices below, and the rate of its samples from the crystal.

use mimu_board::front::Front;
use mimu_board::running::Board;
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::rig_file::{RigFile, RigTruth};
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;

use super::super::wizard::bench::digital_image;
use super::board::{AT_REST, Bench, GRAVITY};
use super::calibration::{EFFECTS, Forward, text_of};
use super::{Place, mimu};
use crate::command::says;

/// The crystal counts this many milliseconds between two samples.
const CRYSTAL: f64 = 0.98;

/// Counts per rad/s and per m/s², and the biases, counts: a unit within the data sheet's limits, with its axes off by a degree.
const UNIT: &str = "format = \"mimu-rig/1\"\nearth_rate = false\n\
    [unit]\ngyro = \"ICM-42688-P-gyro\"\naccel = \"ICM-42688-P-accel\"\n\
    [unit.gyro_affine]\nmatrix = [[7520.0, 90.0, -30.0], [-60.0, 7490.0, 45.0], [15.0, -80.0, 7541.0]]\nbias = [52.0, -33.0, 17.0]\n\
    [unit.accel_affine]\nmatrix = [[836.1, 9.0, -4.0], [-7.0, 833.2, 6.0], [3.0, -8.0, 838.4]]\nbias = [120.0, -75.0, 48.0]\n\
    [thermal]\non_before_s = inf\n";

fn unit() -> RigTruth {
    let file: RigFile = Source::new("unit", UNIT).parse().unwrap();
    RigTruth::resolve(&file, 7).unwrap()
}

fn forward(truth: &RigTruth) -> Forward {
    let unit = &truth.file.unit;
    [&unit.gyro_affine, &unit.accel_affine].map(|affine| {
        let affine = affine.as_ref().unwrap();
        let matrix = Matrix3::from_fn(|i, j| affine.matrix[i][j]);
        (matrix, Vector3::from(affine.bias))
    })
}

fn bench(plan: &str, truth: &RigTruth) -> Bench {
    let plan = Plan::parse(Source::new("plan", plan)).unwrap();
    let front = Front::digital(&plan, truth, 7, CRYSTAL).unwrap();
    Bench::of(Board::matek(&digital_image(), front, [7; 12]).unwrap())
}

/// `[sensors]` of a calibration for the sensors of the greeting, with this range of the accelerometer and filter of the gyro.
fn sensors(info: &Value, accel_range: f64, gyro_filter: &str) -> String {
    let of = |sensor: &str, range: f64, filter: &str| {
        let triad = &info["sensors"][sensor];
        format!(
            "[sensors.{sensor}]\npart = {}\nbits = {}\nrange = {range:?}\nfilter = \"{filter}\"\n",
            triad["part"], triad["bits"]
        )
    };
    let range = |sensor: &str| info["sensors"][sensor]["range"].as_f64().unwrap();
    let filter = info["sensors"]["accel"]["filter"].as_str().unwrap();
    of("gyro", range("gyro"), gyro_filter) + &of("accel", accel_range, filter)
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_fn(|i, _| value[i].as_f64().unwrap())
}

fn computes_what_the_pc_computes(bench: &Bench, place: &Place, file: &str) {
    let command = ["device", "check", "--calibration", file, "--for", "1s"];
    let checked = bench.json(place, &command);
    let of = |sensor: &str| checked[sensor]["ulps"].clone();
    assert_eq!(
        (&checked["holds"], of("gyro"), of("accel")),
        (&true.into(), 0.into(), 0.into()),
        "{checked}"
    );
}

#[test]
fn counts_go_the_whole_way_and_a_calibration_of_another_range_is_refused() {
    let (place, truth) = (Place::new(), unit());
    let bench = bench(AT_REST, &truth);
    let models = forward(&truth);

    let raw = bench.json(&place, &["device", "stream", "--for", "1s"]);
    assert_eq!(
        (&raw["gyro"]["unit"], &raw["missing"]),
        (&"count".into(), &0.into())
    );
    let up = Vector3::new(0.0, 0.0, GRAVITY);
    let [(_, gyro), (p, accel)] = models;
    // Noise of 0.05 deg/s is 6 counts, of a second 0.2; of 1.1 mg 9 counts.
    assert!((vector(&raw["gyro"]["mean"]) - gyro).amax() < 1.5, "{raw}");
    assert!(
        (vector(&raw["accel"]["mean"]) - (p * up + accel)).amax() < 2.0,
        "{raw}"
    );
    assert_eq!(raw["thermometers"][0]["place"], "die");

    // The rate is that of the crystal's time.
    let info = bench.json(&place, &["device", "info"]);
    assert_eq!(
        (&info["board"], &info["raw_unit"]),
        (&"Matek H743".into(), &"count".into())
    );
    let rate_hz = info["sample_rate_hz"].as_f64().unwrap();
    assert!((rate_hz * CRYSTAL / 1000.0 - 1.0).abs() < 3e-4, "{rate_hz}");

    let range = info["sensors"]["accel"]["range"].as_f64().unwrap();
    let filter = info["sensors"]["gyro"]["filter"].as_str().unwrap();
    for (name, unit, own, expected) in [
        (
            "halved.toml",
            "count",
            sensors(&info, 0.5 * range, filter),
            &["accel", "a range of", "78.5"][..],
        ),
        (
            "filter.toml",
            "count",
            sensors(&info, range, "50 Hz"),
            &["gyro", "50 Hz", filter],
        ),
        (
            "volts.toml",
            "V",
            String::new(),
            &["raw readings in V", "device's are in count"],
        ),
    ] {
        let text = text_of(&models, unit, "") + &own;
        std::fs::write(place.path(name), text).unwrap();
        bench
            .run(&place, &["device", "upload", name])
            .refused(expected);
    }
    let text = text_of(&models, "count", "") + &sensors(&info, range, filter);
    std::fs::write(place.path("unit.toml"), text).unwrap();
    let sent = bench.json(&place, &["device", "upload", "unit.toml"]);
    assert_eq!(sent["was_there"], false);
    #[rustfmt::skip]
    let back = ["device", "download", "-o", "back.toml", "--bytes", "back.bin"];
    let contents = bench.json(&place, &back);
    assert_eq!(contents["raw_unit"], "count");
    let again = bench.json(&place, &["device", "upload", "back.toml"]);
    assert_eq!(
        (&again["was_there"], &again["hash"]),
        (&true.into(), &sent["hash"])
    );
    // What the export writes is what the device stores.
    let exported = mimu(&place, &["export", "core", "back.toml", "-o", "core.bin"]);
    assert_eq!(exported.status, Some(0), "{}", exported.stderr);
    let bytes = |name| std::fs::read(place.path(name)).unwrap();
    assert_eq!(bytes("core.bin"), bytes("back.bin"));

    let si = bench.json(&place, &["device", "stream", "compensated", "--for", "1s"]);
    assert!(vector(&si["gyro"]["mean"]).amax() < 3e-4, "{si}");
    assert!((vector(&si["accel"]["mean"]) - up).amax() < 3e-3, "{si}");
    computes_what_the_pc_computes(&bench, &place, "back.toml");
    // Counts about zero leave hardly any rounding to the affine part, so that of the effects decides.
    let text = text_of(&models, "count", EFFECTS) + &sensors(&info, range, filter);
    std::fs::write(place.path("effects.toml"), text).unwrap();
    bench.json(&place, &["device", "upload", "effects.toml"]);
    computes_what_the_pc_computes(&bench, &place, "effects.toml");

    let record = ["record", "-o", "rec", "--for", "1s", "--gravity", "9.793"];
    let recorded = bench.json(&place, &record);
    let samples = recorded["samples"].as_f64().unwrap();
    assert!(
        (samples * CRYSTAL / 1000.0 - 1.0).abs() < 2e-3,
        "{recorded}"
    );
    let manifest = std::fs::read_to_string(place.path("rec/recording.toml")).unwrap();
    says(&manifest, &["raw_unit = \"count\"", "ICM-42688-P"]);
    // A crystal of 7.84 MHz is below the range of the reference that the firmware sets for one of 8.
    bench.end_but_for(&["PLLxRGE"]);
}
