//! Two sessions by Ferraris' method (six faces, three full turns by hand) with the calibrations that imucal publishes for them.
//!
//! imucal's model goes from SI to raw: accelerometer `K_a R_a f + b_a`, gyro `K_g R_g w + K_ga f + b_g`, w in deg/s.

use std::fmt::Write as _;
use std::path::Path;

use mimu::fit::Fit;
use mimu::quantity::Sensor;
use mimu::triad::invert;
use mimu_core::compensation::Affine;
use mimu_recording::RawUnit;
use mimu_tests::recordings::{Foreign, Samples, data_set, numbers};
use nalgebra::{Matrix3, Vector3};
use tempfile::TempDir;

const GRAVITY: f64 = 9.81;

/// Known inputs; `x_p`: the positive x axis points up and measures +g.
fn inputs(turn_deg: Option<f64>) -> String {
    let mut text = String::from("step,ref_force_x_mps2,ref_force_y_mps2,ref_force_z_mps2");
    if turn_deg.is_some() {
        text += ",ref_rate_x_dps,ref_rate_y_dps,ref_rate_z_dps,turn_x_deg,turn_y_deg,turn_z_deg";
    }
    text.push('\n');
    let axes = ["x", "y", "z"];
    let along = |axis: usize, value: f64| -> String {
        let cells: [String; 3] = std::array::from_fn(|k| {
            if k == axis {
                value.to_string()
            } else {
                "0".into()
            }
        });
        cells.join(",")
    };
    for (axis, name) in axes.iter().enumerate() {
        for (end, force) in [("p", GRAVITY), ("a", -GRAVITY)] {
            let _ = write!(text, "{name}_{end},{}", along(axis, force));
            text += if turn_deg.is_some() {
                ",0,0,0,,,\n"
            } else {
                "\n"
            };
        }
    }
    if let Some(angle) = turn_deg {
        for (axis, name) in axes.iter().enumerate() {
            let _ = writeln!(text, "{name}_rot,,,,,,,{}", along(axis, angle));
        }
    }
    text
}

/// imucal's calibration as in its JSON files.
struct Published {
    accel: Affine<f64>,
    gyro: Affine<f64>,
    k_ga: Matrix3<f64>,
}

impl Published {
    /// `turn_sign`: -1 if imucal took turns of +360 degrees for -360, its default; R_g then has the wrong sign.
    fn read(path: &Path, turn_sign: f64) -> Self {
        let text = std::fs::read_to_string(path).expect("it stands beside the recording");
        let json: serde_json::Value = serde_json::from_str(&text).expect("it is JSON");
        let number = |v: &serde_json::Value| v.as_f64().expect("a number");
        let matrix = |key: &str| Matrix3::from_fn(|i, j| number(&json[key][i][j]));
        let vector = |key: &str| Vector3::from_fn(|i, _| number(&json[key][i]));
        Self {
            accel: Affine {
                matrix: matrix("K_a") * matrix("R_a"),
                offset: vector("b_a"),
            },
            gyro: Affine {
                matrix: matrix("K_g") * matrix("R_g") * turn_sign,
                offset: vector("b_g"),
            },
            k_ga: matrix("K_ga"),
        }
    }
}

/// Samples of one part of a session, raw.
struct Part {
    label: String,
    seconds: f64,
    accel: Vec<Vector3<f64>>,
}

impl Part {
    fn mean(&self) -> Vector3<f64> {
        self.accel.iter().sum::<Vector3<f64>>() / self.accel.len() as f64
    }
}

/// One session: mimu's recording and imucal's calibration.
pub(crate) struct Session {
    foreign: Foreign<'static>,
    parts: Vec<Part>,
    turn_deg: f64,
    published: Published,
    /// Keeps the files of the test.
    _folder: TempDir,
}

impl Session {
    fn part(&self, label: &str) -> &Part {
        let found = self.parts.iter().find(|p| p.label == label);
        found.expect("the session has all nine parts")
    }

    fn fit(&self, turns: bool) -> Fit {
        let text = inputs(turns.then_some(self.turn_deg));
        self.with(&text).fit().expect("it can be fitted")
    }

    fn with<'a>(&'a self, inputs: &'a str) -> Foreign<'a> {
        Foreign {
            inputs: Some(inputs),
            ..self.foreign.clone()
        }
    }

    /// Imports it with its faces and turns.
    pub(crate) fn import(&self, folder: &TempDir) {
        let text = inputs(Some(self.turn_deg));
        self.with(&text).import(folder).expect("importable");
    }
}

fn temporary() -> TempDir {
    TempDir::new().expect("there is a temporary folder")
}

/// The session whose samples are labelled with the name of their part. Raw counts.
pub(crate) fn annotated() -> Option<Session> {
    let data = data_set("imucal_ferraris")?;
    let file = data.join("annotated_session.csv");
    let text = std::fs::read_to_string(&file).expect("it is in the data set");
    let rate_hz = 204.8;
    let mut parts: Vec<Part> = Vec::new();
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        if parts.last().is_none_or(|p| p.label != cells[0]) {
            parts.push(Part {
                label: cells[0].into(),
                seconds: 0.0,
                accel: Vec::new(),
            });
        }
        let Some(part) = parts.last_mut() else {
            continue;
        };
        part.seconds += 1.0 / rate_hz;
        part.accel.push(Vector3::from_fn(|i, _| {
            cells[2 + i].parse().expect("a number")
        }));
    }
    let foreign = Foreign {
        // The parts are sorted by name, so the running number of a sample is not a time.
        files: vec![(file, "step,-,accel_x,accel_y,accel_z,gyro_x,gyro_y,gyro_z")],
        rate_hz: Some(rate_hz),
        gravity_mps2: GRAVITY,
        raw_unit: RawUnit::Count,
        scales: &[],
        inputs: None,
    };
    Some(Session {
        foreign,
        parts,
        turn_deg: 360.0,
        published: Published::read(&data.join("example_cal.json"), -1.0),
        _folder: temporary(),
    })
}

/// The uninterrupted session with its list of parts. Its samples are in m/s² and deg/s by the data sheet; the published calibration is for counts of
/// a converter with 2048 counts per g and 32768 counts for 2000 deg/s.
const TO_COUNTS: [f64; 2] = [2048.0 / GRAVITY, 32768.0 / 2000.0];
const SESSION_RATE_HZ: f64 = 102.4;

/// Its samples in counts; the sample rate gives the time.
fn session_samples(file: &Path) -> Samples {
    let rows = numbers(file);
    let triple = |r: &[f64], from: usize, scale: f64| {
        Vector3::new(r[from], r[from + 1], r[from + 2]) * scale
    };
    Samples {
        t_s: rows.iter().map(|r| r[0] / SESSION_RATE_HZ).collect(),
        gyro: rows.iter().map(|r| triple(r, 1, TO_COUNTS[1])).collect(),
        accel: rows.iter().map(|r| triple(r, 4, TO_COUNTS[0])).collect(),
    }
}

/// Names and rows of its parts, in order of time.
fn session_parts(data: &Path) -> Vec<(String, std::ops::Range<usize>)> {
    let file = data.join("example_ferraris_session_list.json");
    let text = std::fs::read_to_string(file).expect("it is in the data set");
    let json: serde_json::Value = serde_json::from_str(&text).expect("it is JSON");
    let index = |v: &serde_json::Value| v.as_u64().expect("a row number") as usize;
    let mut parts: Vec<_> = json
        .as_object()
        .expect("parts by name")
        .iter()
        .map(|(name, at)| (name.clone(), index(&at["start"])..index(&at["end"])))
        .collect();
    parts.sort_by_key(|(_, rows)| rows.start);
    parts
}

pub(crate) fn uninterrupted() -> Option<(Session, Samples)> {
    let data = data_set("imucal_ferraris")?;
    let samples = session_samples(&data.join("example_ferraris_session.csv"));
    let folder = temporary();
    let mut text = String::from("part,sample,gx,gy,gz,ax,ay,az\n");
    let ranges = session_parts(&data);
    for k in 0..samples.t_s.len() {
        let label = ranges.iter().find(|(_, rows)| rows.contains(&k));
        let (g, a) = (samples.gyro[k], samples.accel[k]);
        let label = label.map_or("", |(name, _)| name);
        let _ = writeln!(
            text,
            "{label},{k},{},{},{},{},{},{}",
            g.x, g.y, g.z, a.x, a.y, a.z
        );
    }
    let file = folder.path().join("labelled.csv");
    std::fs::write(&file, text).expect("the temporary folder is writable");
    let parts = ranges
        .into_iter()
        .map(|(label, rows)| Part {
            label,
            seconds: rows.len() as f64 / SESSION_RATE_HZ,
            accel: samples.accel[rows].to_vec(),
        })
        .collect();
    let foreign = Foreign {
        files: vec![(
            file,
            "step,sample,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z",
        )],
        rate_hz: Some(SESSION_RATE_HZ),
        gravity_mps2: GRAVITY,
        raw_unit: RawUnit::Count,
        scales: &[],
        inputs: None,
    };
    let published = Published::read(&data.join("legacy_calibration_pre_2.0.json"), 1.0);
    let session = Session {
        foreign,
        parts,
        turn_deg: -360.0,
        published,
        _folder: folder,
    };
    Some((session, samples))
}

/// Runs `check` on both sessions.
fn on_both(check: impl Fn(&Session)) {
    if let Some(session) = annotated() {
        check(&session);
    }
    if let Some((session, _)) = uninterrupted() {
        check(&session);
    }
}

fn forward(fit: &Fit, sensor: Sensor) -> Affine<f64> {
    let fit = fit.sensor(sensor).expect("it was fitted");
    let forward = fit.estimated.triad.forward;
    Affine {
        matrix: forward.matrix,
        offset: forward.bias,
    }
}

#[test]
fn least_squares_on_six_faces_is_imucals_matrix_and_the_mean_of_all_its_biases() {
    on_both(|session| {
        let fit = session.fit(false);
        let ours = forward(&fit, Sensor::Accel);
        let theirs = &session.published.accel;
        // Six opposite inputs are an orthogonal design, for which least squares uses the same differences as imucal. Only the weights differ: the
        // lengths of the faces make the variances of the means differ by some 0.1 % of the extra white variance, which acts on a residual of up to 17
        // counts on 2 g.
        let worst = (ours.matrix - theirs.matrix).amax();
        assert!(worst < 2e-3, "{worst} counts per m/s^2");
        // imucal takes the bias of a sensor only from the pair along its axis, least squares from all three pairs.
        let triad = &fit.sensor(Sensor::Accel).expect("fitted").estimated.triad;
        for i in 0..3 {
            let pairs = ["x", "y", "z"].map(|a| {
                let [p, n] = ["p", "a"].map(|end| session.part(&format!("{a}_{end}")).mean()[i]);
                0.5 * (p + n)
            });
            let b = ours.offset[i];
            let interval = triad.forward_estimates()[9 + i].interval;
            assert!((pairs[i] - theirs.offset[i]).abs() < 1e-6, "{pairs:?}");
            // Weighted as above, so within 0.1 % of the scatter of the pairs.
            let spread = pairs.iter().fold(0.0, |m: f64, p| m.max((p - b).abs()));
            let mean = pairs.iter().sum::<f64>() / 3.0;
            assert!((b - mean).abs() < 2e-3 * spread, "{b} for {mean}");
            // Pairs that disagree by 26 counts leave each of them uncertain by as much, and the interval must include this.
            assert!((b - theirs.offset[i]).abs() < interval, "{b} +- {interval}");
        }
    });
}

#[test]
fn turns_give_imucals_gyro_once_its_term_in_specific_force_is_added_back() {
    on_both(|session| {
        let fit = session.fit(true);
        assert_eq!(fit.prepared.manifest.turn_steps.len(), 3);
        let ours = forward(&fit, Sensor::Gyro);
        let published = &session.published;
        let per_degree = ours.matrix * 1f64.to_radians();
        // If noise explains the scatter of the rests, as here, they are weighted by length, and their mean over all samples is imucal's bias.
        // Otherwise all rests have the same weight, and the difference is up to their scatter, which sigma includes.
        let triad = &fit.sensor(Sensor::Gyro).expect("fitted").estimated.triad;
        for i in 0..3 {
            let sigma = triad.forward_covariance[(9 + i, 9 + i)].sqrt();
            let off = (ours.offset[i] - published.gyro.offset[i]).abs();
            assert!(off < sigma, "{off} with a sigma of {sigma}");
        }
        // Three turns determine nine numbers, so both reproduce the mean reading of each turn: mimu as P w + b, imucal with the additional term K_ga
        // f. A difference beyond the Earth's rate would mean another duration of the turn or another bias. Without a latitude that rate is an error
        // that turns and rests share; the rests show a part of it, which is taken out of the turns.
        let (mut term, mut largest) = (Matrix3::zeros(), 0.0_f64);
        for (axis, letter) in ["x", "y", "z"].iter().enumerate() {
            let part = session.part(&format!("{letter}_rot"));
            let rate_dps = Vector3::ith(axis, session.turn_deg / part.seconds);
            let force = invert(&published.accel)
                .expect("regular")
                .apply(&part.mean());
            let by_force = published.k_ga * force;
            term.set_column(axis, &(by_force / rate_dps[axis]));
            let reading = published.gyro.apply(&rate_dps) + by_force;
            let ours = Affine {
                matrix: per_degree,
                offset: ours.offset,
            }
            .apply(&rate_dps);
            largest = largest.max((reading - ours).amax());
        }
        let scale = per_degree.diagonal().map(f64::abs).mean();
        let earth = scale * mimu::estimate::earth::RATE.to_degrees();
        assert!(largest < 0.5 * earth, "{largest} counts of {earth}");
        let share = term.amax() / scale;
        // The model without K_ga turns that term into scale factor and misalignment. The error is far below that of turns by hand, whose axes are up
        // to 1.5 degrees off.
        assert!(share.to_degrees() < 0.05, "{term}");
    });
}
