//! The command with the firmware itself: the release image on the emulated board, with a unit of known truth at its pins.
//!
//! The bench defines the truth: the inputs follow from the plan, the readings from the published matrices of its rig file.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use mimu_board::front::Front;
use mimu_board::running::Board;
use mimu_board::schematic::{DIVIDER_RATIO, Volts, WIRING};
use mimu_board::serve::{Pace, Served};
use mimu_core::stored;
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::rig_file::{RigFile, RigTruth};
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;

use super::super::wizard::bench::{image, in_repository};
use super::calibration::{Forward, text_of};
use super::{Place, Ran, mimu};

pub const GRAVITY: f64 = 9.793;
/// Voltage of a gyro's reference pin as assumed by the firmware (data sheet).
const NOMINAL_REFERENCE_V: f64 = 2.5;

/// A board that runs while its port is open.
pub struct Bench {
    port: String,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<Served>>,
}

impl Bench {
    /// Switched on; its own greeting has been received.
    fn new(front: Front) -> Self {
        Self::of(Board::new(&image(), front).unwrap())
    }

    /// The same with a board that has not run yet.
    pub fn of(mut board: Board) -> Self {
        // A digital board first measures the rate of its sensor.
        let started_ms = if board.is_digital() { 900 } else { 100 };
        board.run_to(started_ms * 1_000_000).unwrap();
        assert!(!board.receive().is_empty(), "the firmware greets");
        let mut served = Served::new(board, Pace::Fast, None).unwrap();
        let port = served.path().display().to_string();
        let end = Arc::new(AtomicBool::new(false));
        let ended = end.clone();
        let thread = std::thread::spawn(move || {
            while !ended.load(Ordering::Relaxed) {
                served.step().unwrap();
            }
            served
        });
        Self {
            port,
            end,
            thread: Some(thread),
        }
    }

    /// A unit moved through a plan.
    pub fn carried(plan: &str, truth: &RigTruth) -> Self {
        let plan = Plan::parse(Source::new("plan", plan)).unwrap();
        Self::new(Front::bench(&plan, truth, 7).unwrap())
    }

    pub fn run(&self, place: &Place, arguments: &[&str]) -> Ran {
        mimu(place, &[arguments, &["--port", &self.port]].concat())
    }

    pub fn json(&self, place: &Place, arguments: &[&str]) -> Value {
        self.run(place, &[arguments, &["--json", "-"]].concat())
            .json()
    }

    /// Ends it. Checks that nothing was lost on the line, and that no rule of the part's manual was broken.
    pub fn end(self) {
        self.end_but_for(&[]);
    }

    /// The same, but for rules whose text contains one of these.
    pub fn end_but_for(mut self, allowed: &[&str]) {
        self.end.store(true, Ordering::Relaxed);
        let mut served = self.thread.take().unwrap().join().unwrap();
        assert_eq!(served.traffic().lost, 0);
        let mut broken = served.board().findings().unwrap().broken;
        broken.retain(|rule| !allowed.iter().any(|text| rule.contains(text)));
        assert_eq!(broken, [""; 0]);
        assert_eq!(served.board().restarts().unwrap(), []);
    }
}

/// The unit of fang's table 4.
pub fn unit() -> RigTruth {
    let file = RigFile::read(&in_repository("rig/rigs/fang.toml")).unwrap();
    RigTruth::resolve(&file, 7).unwrap()
}

/// Its forward model in the firmware's volts: gyros relative to the reference pin of the first, accelerometer relative to its supply, which is
/// nominal in the rig file.
pub fn forward(truth: &RigTruth) -> Forward {
    let matrix = |m: [[f64; 3]; 3]| Matrix3::from_fn(|i, j| m[i][j]);
    let unit = &truth.file.unit;
    let (gyro, accel) = (
        unit.gyro_affine.as_ref().unwrap(),
        unit.accel_affine.as_ref().unwrap(),
    );
    let reference = unit.gyro_reference_v.unwrap()[0];
    let ratio = NOMINAL_REFERENCE_V / reference;
    [
        (
            matrix(gyro.matrix) * ratio,
            Vector3::from(gyro.bias) * ratio,
        ),
        (matrix(accel.matrix), Vector3::from(accel.bias)),
    ]
}

pub const AT_REST: &str = "format = \"mimu-plan/1\"\ndevice = \"unit-007\"\nsample_rate_hz = 1000.0\ncarrier = \"table\"\n\
     latitude_deg = 30.5\ngravity_mps2 = 9.793\nlead_in_s = 1.0\n[[step]]\nup = [0.0, 0.0, 1.0]\ndwell_s = 1000.0\n";

fn significant(value: &Value) -> Vector3<f64> {
    Vector3::from_fn(|i, _| value[i].as_f64().unwrap())
}

/// Largest difference.
fn off(value: &Value, wanted: Vector3<f64>) -> f64 {
    (significant(value) - wanted).amax()
}

#[test]
fn a_session_from_the_greeting_to_the_counters() {
    let (place, truth) = (Place::new(), unit());
    let bench = Bench::carried(AT_REST, &truth);
    let up = Vector3::new(0.0, 0.0, GRAVITY);

    let info = bench.json(&place, &["device", "info"]);
    assert_eq!(info["board"], "NUCLEO-H743ZI2");
    assert_eq!(info["start"]["reason"], "power-on");
    assert_eq!(info["sample_rate_hz"], 1000.0);
    assert_eq!(info["sensors"]["accel"]["part"], "MMA7260QT");
    assert!(info["stored"].is_null());
    bench
        .run(&place, &["device", "stream", "compensated"])
        .refused(&["stores no calibration", "mimu device upload"]);

    raw_stream(&bench, &place);
    let models = forward(&truth);
    let raw = bench.json(&place, &["device", "stream", "--for", "500ms"]);
    assert_eq!((&raw["samples"], &raw["missing"]), (&500.into(), &0.into()));
    // 3.5 mV of noise with 40 Hz of bandwidth over half a second: sigma 0.6 mV.
    let [(_, gyro_v), (p, accel_v)] = models;
    assert!(off(&raw["gyro"]["mean"], gyro_v) < 3e-3, "{raw}");
    assert!(off(&raw["accel"]["mean"], p * up + accel_v) < 3e-3, "{raw}");

    calibration(&bench, &place, &models);
    let si = bench.json(
        &place,
        &["device", "stream", "compensated", "--for", "500ms"],
    );
    assert!(off(&si["gyro"]["mean"], Vector3::zeros()) < 0.01, "{si}");
    assert!(off(&si["accel"]["mean"], up) < 0.035, "{si}");

    let tested = bench.json(&place, &["device", "self-test"]);
    let rows = tested["results"].as_array().unwrap();
    let named = |verdict: &str| -> Vec<&str> {
        let of = rows.iter().filter(|row| row["verdict"] == verdict);
        of.map(|row| row["name"].as_str().unwrap()).collect()
    };
    assert_eq!(named("failed"), [""; 0], "{tested}");
    assert_eq!(rows.len(), 15, "{tested}");
    // The unit lies on its back: this pose does not show the responses of the two other axes to gravity.
    assert_eq!(named("not-shown"), ["accel x, null", "accel y, null"]);
    assert!(tested["moved"].is_null(), "{tested}");
    // Responses of the bench's sensors (data sheet: 0.27 V typically), in the firmware's volts.
    for axis in ["x", "y", "z"] {
        for (input, expected_v) in [("ST1", -0.27), ("ST2", 0.27)] {
            let name = format!("gyro {axis}, {input}");
            let row = rows.iter().find(|row| row["name"] == name).unwrap();
            let off_v = row["value"].as_f64().unwrap() - expected_v;
            assert!(off_v.abs() < 8e-3, "{row}");
        }
    }

    let force = format!("0,0,{GRAVITY}");
    let filtered = bench.json(
        &place,
        &["device", "kalman", "--force-mps2", &force, "--for", "1s"],
    );
    let distance = filtered["largest_distance_sigma"].as_f64().unwrap();
    assert!(distance < 0.05, "{distance}");
    for i in 0..3 {
        // One input determines one combination: the sensor's reading under it.
        let mean: Vec<f64> = (0..4)
            .map(|k| filtered["device"][i]["mean"][k].as_f64().unwrap())
            .collect();
        let reads = mean[0] + GRAVITY * mean[3];
        let wanted = (p * up + accel_v)[i];
        assert!((reads - wanted).abs() < 3e-3, "{reads} V, not {wanted}");
    }

    let counted = bench.json(&place, &["device", "counters"]);
    for name in [
        "late",
        "converter_overruns",
        "stalls",
        "queue_overruns",
        "batches_dropped",
        "frames_garbled",
        "receiver_overruns",
        "flash_uncorrectable",
    ] {
        assert_eq!(counted["counters"][name], 0, "{name}: {counted}");
    }
    // The request for a stream without a calibration.
    assert_eq!(counted["counters"]["refused"], 1);
    bench.end();
}

/// Checks that samples follow each other in number and time.
fn raw_stream(bench: &Bench, place: &Place) {
    let ran = bench.run(place, &["device", "stream", "--for", "200ms"]);
    assert_eq!(ran.status, Some(0), "{}", ran.stderr);
    let mut lines = ran.stdout.lines();
    assert!(
        lines
            .next()
            .unwrap()
            .starts_with("n,t_s,temp_c,flags,gyro_x")
    );
    let numbers: Vec<(u32, f64)> = lines
        .map(|line| {
            let mut cells = line.split(',');
            let mut next = || cells.next().unwrap();
            (next().parse().unwrap(), next().parse().unwrap())
        })
        .collect();
    assert_eq!(numbers.len(), 200);
    for (k, (number, t_s)) in (0..).zip(&numbers) {
        assert_eq!(*number, numbers[0].0 + k);
        assert_eq!(*t_s, f64::from(*number) / 1000.0);
    }
}

/// Uploads and downloads a calibration, and checks the device's results with it.
fn calibration(bench: &Bench, place: &Place, models: &Forward) {
    let file = place.path("unit.toml");
    std::fs::write(&file, text_of(models, "V", "")).unwrap();
    let sent = bench.json(place, &["device", "upload", "unit.toml"]);
    assert_eq!(sent["was_there"], false);
    let again = bench.json(place, &["device", "upload", "unit.toml"]);
    assert_eq!(
        (&again["was_there"], &again["hash"]),
        (&true.into(), &sent["hash"])
    );
    let info = bench.json(place, &["device", "info"]);
    assert_eq!(info["stored"]["hash"], sent["hash"]);

    let got = bench.json(place, &["device", "download", "--bytes", "unit.bin"]);
    let bytes = std::fs::read(place.path("unit.bin")).unwrap();
    assert_eq!(sent["hash"], format!("{:016x}", stored::hash(&bytes)));
    for (sensor, (p, _)) in ["gyro", "accel"].into_iter().zip(models) {
        let c = &got["nodes"][0][sensor]["C"];
        let product = Matrix3::from_fn(|i, j| c[i][j].as_f64().unwrap()) * p;
        assert!(
            (product - Matrix3::identity()).amax() < 1e-6,
            "{sensor}: {product}"
        );
    }

    let checked = bench.json(
        place,
        &[
            "device",
            "check",
            "--calibration",
            "unit.toml",
            "--for",
            "1s",
        ],
    );
    assert_eq!(checked["holds"], true, "{checked}");
    assert_eq!(
        (&checked["gyro"]["ulps"], &checked["accel"]["ulps"]),
        (&0.into(), &0.into())
    );
}

/// Turned by hand without a pause.
const TURNED: &str = "format = \"mimu-plan/1\"\ndevice = \"unit-007\"\nsample_rate_hz = 1000.0\ncarrier = \"hands\"\n\
     latitude_deg = 30.5\ngravity_mps2 = 9.793\nlead_in_s = 0.0\n[[step]]\nposes = 100\ndwell_s = 0.01\n";

#[test]
#[ignore = "nightly: the emulated board; by day `self_test` of mimu-device tells motion from noise"]
fn a_self_test_of_a_unit_that_is_turned_and_one_of_open_pins_are_told_apart() {
    let place = Place::new();
    let mut truth = unit();
    // Two or three turns within a self-test, about different axes: no two states have the same rates.
    truth.hands.turn_s = [0.4, 0.5];
    truth.hands.pause_s = [0.01, 0.02];
    let moving = Bench::carried(TURNED, &truth);
    let told = moving.run(&place, &["device", "self-test"]);
    told.refused(&["self-test failed", "the unit moved", "keep the unit still"]);
    assert!(told.stdout.contains("FAILED"), "{}", told.stdout);
    moving.end();

    // Fixed voltages: no sensor responds to its self-test pin.
    let mut volts = Volts::GROUND;
    for (k, (_, _, input)) in WIRING.into_iter().enumerate() {
        let of_accel = (3..6).contains(&k);
        volts.input[input] = if of_accel { 1.65 } else { 2.5 * DIVIDER_RATIO };
    }
    let open = Bench::new(Front::Still(volts));
    let told = open.run(&place, &["device", "self-test"]);
    let line = told.refused(&[
        "gyro x, ST1; gyro x, ST2; gyro y, ST1",
        "gyro z, ST2; gravity",
        "check the wiring",
    ]);
    assert!(!line.contains("moved"), "{line}");
    open.end();
}
