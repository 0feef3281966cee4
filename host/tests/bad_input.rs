//! The command on recordings as they should not be.
//!
//! The contract: either exit status 1 and one line on standard error, `mimu: PLACE: PROBLEM; REMEDY`, or exit status
//! 0 with a right result and, where something was wrong with the data, a warning that names it. Every case
//! damages one of two recordings in one way. Their physics is written out here, and shares nothing with
//! the program, so that a convention that both have wrong would show.

use std::f64::consts::PI;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

type Vector = [f64; 3];
type Matrix = [[f64; 3]; 3];

const RATE_HZ: f64 = 100.0;
const GRAVITY: f64 = 9.81;

/// Raw readings (counts) of a perfect sensor's input: `u = P x + b`. The accelerometer's P is lower triangular, which
/// makes the frame of a recording by hand (x along its x, y in the plane of its x and y) the frame here.
const GYRO_P: Matrix = [
    [5020.0, 60.0, -35.0],
    [-48.0, 4910.0, 72.0],
    [25.0, -66.0, 5105.0],
];
const GYRO_B: Vector = [37.0, -61.0, 18.0];
const ACCEL_P: Matrix = [[1655.0, 0.0, 0.0], [14.0, 1602.0, 0.0], [-9.0, 21.0, 1640.0]];
const ACCEL_B: Vector = [-120.0, 64.0, 210.0];
/// Standard deviation of the noise of one sample, counts.
const GYRO_NOISE: f64 = 8.0;
const ACCEL_NOISE: f64 = 12.0;

fn times(m: &Matrix, v: &Vector) -> Vector {
    [0, 1, 2].map(|i| (0..3).map(|j| m[i][j] * v[j]).sum())
}

fn inverse(m: &Matrix) -> Matrix {
    let minor = |i: usize, j: usize| {
        let at = |r: usize, c: usize| m[(i + r) % 3][(j + c) % 3];
        at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1)
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * minor(0, j)).sum();
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| minor(j, i) / determinant))
}

/// Unit quaternion, w first: turns a vector of the body into that of the world.
#[derive(Clone, Copy)]
struct Attitude([f64; 4]);

impl Attitude {
    fn about(axis: Vector, angle: f64) -> Self {
        let size = axis.iter().map(|a| a * a).sum::<f64>().sqrt();
        let (sin, cos) = (0.5 * angle).sin_cos();
        let [x, y, z] = axis.map(|a| a / size * sin);
        Self([cos, x, y, z])
    }

    fn then(self, next: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, next.0);
        Self([
            a * e - b * f - c * g - d * h,
            a * f + b * e + c * h - d * g,
            a * g - b * h + c * e + d * f,
            a * h + b * g - c * f + d * e,
        ])
    }

    /// Specific force at rest, which points up, in the body.
    fn gravity(self) -> Vector {
        let [w, x, y, z] = self.0;
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        ]
        .map(|up| GRAVITY * up)
    }
}

/// SplitMix64: a dozen lines that give the same recording on every machine.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (2.0 * PI * self.uniform()).cos()
    }

    fn direction(&mut self) -> Vector {
        [self.normal(), self.normal(), self.normal()]
    }
}

/// A recording before it is written, to be damaged.
#[derive(Clone)]
struct Samples {
    manifest: Vec<(&'static str, String)>,
    names: Vec<String>,
    /// Not a number is an empty cell.
    rows: Vec<Vec<f64>>,
    /// Rows of each dwell.
    dwells: Vec<Range<usize>>,
}

impl Samples {
    fn new(reference: &str, names: &str) -> Self {
        let manifest = [
            ("format", "\"mimu-recording/1\"".to_string()),
            ("device", "\"unit-7\"".to_string()),
            ("sample_rate_hz", format!("{RATE_HZ:?}")),
            ("gravity_mps2", format!("{GRAVITY:?}")),
            ("raw_unit", "\"count\"".to_string()),
            ("reference", format!("\"{reference}\"")),
        ];
        Self {
            manifest: manifest.to_vec(),
            names: names.split(',').map(str::to_string).collect(),
            rows: Vec::new(),
            dwells: Vec::new(),
        }
    }

    fn column(&self, name: &str) -> usize {
        let found = self.names.iter().position(|known| known == name);
        found.unwrap_or_else(|| panic!("no column {name}"))
    }

    fn set(&mut self, key: &'static str, value: &str) {
        self.manifest.retain(|(known, _)| *known != key);
        if !value.is_empty() {
            self.manifest.push((key, value.to_string()));
        }
    }

    /// Changes the cells of `column` in `rows`.
    fn edit(&mut self, column: &str, rows: Range<usize>, change: impl Fn(f64) -> f64) {
        let column = self.column(column);
        for row in &mut self.rows[rows] {
            row[column] = change(row[column]);
        }
    }

    fn all(&self) -> Range<usize> {
        0..self.rows.len()
    }

    /// Rows between dwell `k` and the next.
    fn turn(&self, k: usize) -> Range<usize> {
        self.dwells[k].end..self.dwells[k + 1].start
    }

    fn csv(&self) -> String {
        let mut text = self.names.join(",");
        for row in &self.rows {
            let cell = |x: &f64| match x.is_nan() {
                true => String::new(),
                false => x.to_string(),
            };
            text.push('\n');
            text.push_str(&row.iter().map(cell).collect::<Vec<_>>().join(","));
        }
        text + "\n"
    }

    fn manifest(&self) -> String {
        let line = |(key, value): &(&str, String)| format!("{key} = {value}\n");
        self.manifest.iter().map(line).collect()
    }

    fn write(&self, directory: &Path) {
        fs::create_dir_all(directory).unwrap();
        fs::write(directory.join("recording.toml"), self.manifest()).unwrap();
        fs::write(directory.join("samples.csv"), self.csv()).unwrap();
    }

    fn push(&mut self, row: Vec<f64>, random: &mut Random, rate: &Vector, force: &Vector) {
        let mut row = row;
        for (p, b, x, noise) in [
            (&GYRO_P, &GYRO_B, rate, GYRO_NOISE),
            (&ACCEL_P, &ACCEL_B, force, ACCEL_NOISE),
        ] {
            let u = times(p, x);
            row.extend((0..3).map(|i| (u[i] + b[i] + noise * random.normal()).round()));
        }
        self.rows.push(row);
    }
}

/// Poses of 3 s that are held still, with smooth turns of 1.5 s between them.
fn by_hand_at(poses: usize, seed: u64, axis: impl Fn(&mut Random) -> Vector) -> Samples {
    const POSE_S: f64 = 3.0;
    const TURN_S: f64 = 1.5;
    let mut random = Random(seed);
    let mut out = Samples::new("gravity", "t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z");
    let mut attitude = Attitude([1.0, 0.0, 0.0, 0.0]);
    let time = |out: &Samples| vec![out.rows.len() as f64 / RATE_HZ];
    for pose in 0..poses {
        let from = out.rows.len();
        for _ in 0..(POSE_S * RATE_HZ) as usize {
            out.push(time(&out), &mut random, &[0.0; 3], &attitude.gravity());
        }
        out.dwells.push(from..out.rows.len());
        if pose + 1 == poses {
            break;
        }
        let (axis, angle) = (axis(&mut random), 1.2 + 1.3 * random.uniform());
        let size = axis.iter().map(|a| a * a).sum::<f64>().sqrt();
        let count = (TURN_S * RATE_HZ) as usize;
        for k in 1..count {
            // The rate is a raised cosine: it begins and ends without a jerk.
            let part = k as f64 / count as f64;
            let turned = angle * (part - (2.0 * PI * part).sin() / (2.0 * PI));
            let rate = angle * (1.0 - (2.0 * PI * part).cos()) / TURN_S;
            let now = attitude.then(Attitude::about(axis, turned));
            let rate = axis.map(|a| a / size * rate);
            out.push(time(&out), &mut random, &rate, &now.gravity());
        }
        attitude = attitude.then(Attitude::about(axis, angle));
    }
    out
}

fn by_hand() -> Samples {
    by_hand_at(20, 1, Random::direction)
}

/// Each axis up and down on a rate table, turning at five rates about the vertical.
fn on_table() -> Samples {
    on_table_at(&[-90.0, -30.0, 0.0, 30.0, 90.0], &[0, 1, 2])
}

fn on_table_at(rates_dps: &[f64], axes: &[usize]) -> Samples {
    let mut random = Random(2);
    let mut out = Samples::new(
        "table",
        "t_s,step,ref_rate_x_dps,ref_rate_y_dps,ref_rate_z_dps,ref_force_x_mps2,ref_force_y_mps2,ref_force_z_mps2,\
         gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z",
    );
    for &axis in axes {
        for up in [1.0, -1.0] {
            for &dps in rates_dps {
                let (mut rate, mut force) = ([0.0; 3], [0.0; 3]);
                (rate[axis], force[axis]) = (dps, up * GRAVITY);
                for dwelling in [false, true] {
                    let from = out.rows.len();
                    let step = match dwelling {
                        true => out.dwells.len() as f64,
                        false => -1.0,
                    };
                    let count = if dwelling { 200 } else { 30 };
                    for k in 0..count {
                        let part = if dwelling { 1.0 } else { f64::from(k) / 30.0 };
                        let mut row = vec![out.rows.len() as f64 / RATE_HZ, step];
                        let known = rate.iter().chain(&force);
                        row.extend(known.map(|x| if dwelling { *x } else { f64::NAN }));
                        let rate = rate.map(|r| part * r * PI / 180.0);
                        out.push(row, &mut random, &rate, &force);
                    }
                    if dwelling {
                        out.dwells.push(from..out.rows.len());
                    }
                }
            }
        }
    }
    out
}

/// What the command did.
struct Run {
    status: Option<i32>,
    stdout: String,
    stderr: String,
}

fn mimu<S: AsRef<std::ffi::OsStr>>(arguments: impl IntoIterator<Item = S>) -> Run {
    let output = Command::new(env!("CARGO_BIN_EXE_mimu"))
        .args(arguments)
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("output is UTF-8");
    Run {
        status: output.status.code(),
        stdout: text(output.stdout),
        stderr: text(output.stderr),
    }
}

impl Run {
    /// The line of a refusal, after checking that it is one and has its three parts.
    fn refusal(&self) -> &str {
        let line = self.stderr.strip_suffix('\n').unwrap_or(&self.stderr);
        assert_eq!(self.status, Some(1), "stderr: {line}\nstdout: {}", self.stdout);
        assert!(!line.is_empty() && !line.contains(char::is_control), "{line:?}");
        let told = line.strip_prefix("mimu: ").expect(line);
        let (place, rest) = told.split_once(": ").expect(line);
        let (problem, remedy) = rest.split_once("; ").expect(line);
        assert!([place, problem, remedy].iter().all(|p| !p.trim().is_empty()), "{line}");
        assert!(self.stdout.is_empty(), "a refusal prints no result: {}", self.stdout);
        line
    }

    fn refused(&self, words: &[&str]) {
        let line = self.refusal();
        println!("    {line}");
        for word in words {
            assert!(line.contains(word), "{word:?} is not in: {line}");
        }
    }

    fn json(&self) -> Value {
        assert_eq!(self.status, Some(0), "{}", self.stderr);
        assert!(self.stderr.is_empty(), "{}", self.stderr);
        serde_json::from_str(&self.stdout).expect("JSON on standard output")
    }
}

fn warnings(result: &Value) -> Vec<String> {
    let all = result["warnings"].as_array().expect("warnings");
    all.iter().map(|w| w.as_str().unwrap().to_string()).collect()
}

fn warned(result: &Value, words: &[&str]) {
    let all = warnings(result);
    println!("    {}", all.join("\n    "));
    for word in words {
        assert!(all.iter().any(|w| w.contains(word)), "{word:?} is not in: {all:#?}");
    }
}

/// Distance of each parameter of `sensor` from the truth, in halves of its 95 % interval; and the largest.
fn distance(result: &Value, sensor: &str) -> f64 {
    let (p, b) = match sensor {
        "gyro" => (GYRO_P, GYRO_B),
        _ => (ACCEL_P, ACCEL_B),
    };
    let c = inverse(&p);
    let o = times(&c, &b).map(|x| -x);
    let parameters = result["sensors"][sensor]["parameters"].as_array().expect(sensor);
    let mut worst: f64 = 0.0;
    for (i, row) in ["x", "y", "z"].iter().enumerate() {
        let mut check = |name: String, truth: f64| {
            let found = parameters.iter().find(|p| p["name"] == name.as_str()).unwrap();
            let number = |key: &str| found[key].as_f64().expect("a number");
            let half = 0.5 * (number("upper") - number("lower"));
            // What is zero by the choice of frame has no interval.
            if truth != 0.0 || half > 0.0 {
                worst = worst.max((number("value") - truth).abs() / half);
            } else {
                assert_eq!(number("value"), 0.0);
            }
        };
        for (j, column) in ["x", "y", "z"].iter().enumerate() {
            check(format!("C_{row}{column}"), c[i][j]);
        }
        check(format!("o_{row}"), o[i]);
    }
    worst
}

fn right(result: &Value) {
    for sensor in ["gyro", "accel"] {
        let worst = distance(result, sensor);
        assert!(worst < 2.0, "{sensor}: {worst} times half of the interval from the truth; {:#?}", warnings(result));
    }
}

/// A folder with a recording in it.
struct Place {
    folder: tempfile::TempDir,
}

impl Place {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    fn with(samples: &Samples) -> Self {
        let place = Self::new();
        samples.write(&place.recording());
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.path(name).display().to_string()
    }

    fn recording(&self) -> PathBuf {
        self.path("rec")
    }

    fn fit(&self, arguments: &[&str]) -> Run {
        let recording = self.text("rec");
        let fixed = ["fit", &recording, "--json", "-"];
        mimu(fixed.into_iter().chain(arguments.iter().copied()))
    }

    /// Names in the folder, sorted; hidden ones too.
    fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(self.folder.path()).unwrap();
        let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

#[test]
fn explore() {
    let show = |name: &str, s: &Samples, args: &[&str]| {
        let run = Place::with(s).fit(args);
        println!("== {name}: {:?} {}", run.status, run.stderr.trim());
        if run.status == Some(0) {
            let v = run.json();
            for k in ["gyro", "accel"] {
                let x = &v["sensors"][k];
                if x.is_null() { println!("   {k}: none"); continue; }
                println!("   {k}: distance {:.2} rms {} held {} floor {} cond {} static {}", distance(&v, k), x["rms"], x["held_out_rms"], x["noise_floor"], x["condition"], x["static_rms"]);
            }
            for w in warnings(&v) { println!("   W {w}"); }
        }
    };
    let hand = by_hand();
    let table = on_table();
    show("hand", &hand, &[]);
    show("hand b0", &hand, &["--holdout", "blocks=0"]);
    show("hand b1000", &hand, &["--holdout", "blocks=1000"]);
    show("table", &table, &[]);
    for m in ["kalman", "xu", "six-positions"] { show(m, &table, &["--method", m]); }
    show("table b0", &table, &["--holdout", "blocks=0"]);
    let go = |name: &str, base: &Samples, f: &dyn Fn(&mut Samples)| { let mut s = base.clone(); f(&mut s); show(name, &s, &[]); };
    go("few nan hand", &hand, &|s| { for r in [50, 340, 700] { s.edit("accel_y", r..r+3, |_| f64::NAN); } s.edit("gyro_x", 100..105, |_| f64::NAN); });
    go("nan in turn", &hand, &|s| { let t = s.turn(3); s.edit("gyro_x", t.start+50..t.start+53, |_| f64::NAN); });
    go("all nan accel_y", &hand, &|s| { let a = s.all(); s.edit("accel_y", a, |_| f64::NAN); });
    go("time empty", &hand, &|s| { s.edit("t_s", 77..78, |_| f64::NAN); });
    go("shuffled", &hand, &|s| { let mut r = Random(5); for i in (1..s.rows.len()).rev() { let j = (r.bits() % (i as u64 + 1)) as usize; s.rows.swap(i, j); } });
    go("pair", &hand, &|s| s.rows.swap(500, 501));
    go("dup", &hand, &|s| { for i in [900, 500, 100] { let r = s.rows[i].clone(); s.rows.insert(i, r); } });
    go("dup nan", &hand, &|s| { s.edit("accel_y", 100..101, |_| f64::NAN); let r = s.rows[100].clone(); s.rows.insert(100, r); });
    go("repeat", &hand, &|s| { let t = s.rows[100][0]; s.rows[101][0] = t; });
    go("wrong name", &hand, &|s| s.names[3] = "gyro_w".into());
    go("swap sensors hand", &hand, &|s| for i in 1..4 { s.names.swap(i, i+3) });
    go("swap sensors table", &table, &|s| for i in 8..11 { s.names.swap(i, i+3) });
    go("swap gyro_x accel_x hand", &hand, &|s| s.names.swap(1, 4));
    go("swap gyro_x accel_x table", &table, &|s| s.names.swap(8, 11));
    go("swap gyro_x y hand", &hand, &|s| s.names.swap(1, 2));
    go("swap accel_x y hand", &hand, &|s| s.names.swap(4, 5));
    go("swap gyro_x y table", &table, &|s| s.names.swap(8, 9));
    go("half rate", &hand, &|s| { let h = s.rows.len()/2; let mut k = 0; s.rows.retain(|_| { k += 1; k < h || k % 2 == 0 }); });
    for r in ["200.0", "1000.0", "50.0", "99.0", "99.9", "101.5", "0.1", "1e300", "1e-300"] { go(&format!("rate {r}"), &hand, &|s| s.set("sample_rate_hz", r)); }
    go("t in ms", &hand, &|s| { let a = s.all(); s.edit("t_s", a, |t| t*1000.0) });
    go("gap dwell", &hand, &|s| { let d = s.dwells[4].clone(); s.rows.drain(d.start+100..d.start+150); });
    go("gap turn", &hand, &|s| { let d = s.turn(4); s.rows.drain(d.start+50..d.start+70); });
    go("gap dwell table", &table, &|s| { let d = s.dwells[4].clone(); s.rows.drain(d.start+50..d.start+90); });
    go("stuck all", &hand, &|s| { let a = s.all(); s.edit("gyro_y", a, |_| 17.0) });
    go("stuck dwells", &hand, &|s| for k in [3,4,9] { let a = s.dwells[k].clone(); let v = s.rows[a.start][s.column("accel_y")]; s.edit("accel_y", a, |_| v) });
    go("stuck dwells gyro", &hand, &|s| for k in [3,4,9] { let a = s.dwells[k].clone(); let v = s.rows[a.start][s.column("gyro_y")]; s.edit("gyro_y", a, |_| v) });
    go("stuck turns gyro", &hand, &|s| for k in [3,4,9] { let a = s.turn(k); let v = s.rows[a.start][s.column("gyro_y")]; s.edit("gyro_y", a, |_| v) });
    go("stuck turns accel", &hand, &|s| for k in [3,4,9] { let a = s.turn(k); let v = s.rows[a.start][s.column("accel_y")]; s.edit("accel_y", a, |_| v) });
    go("stuck one third of turn", &hand, &|s| for k in [3,4,9] { let a = s.turn(k); let a = a.start+50..a.start+100; let v = s.rows[a.start][s.column("gyro_y")]; s.edit("gyro_y", a, |_| v) });
    go("stuck table gyro", &table, &|s| for k in [3,4,9] { let a = s.dwells[k].clone(); let v = s.rows[a.start][s.column("gyro_y")]; s.edit("gyro_y", a, |_| v) });
    go("stuck half", &hand, &|s| { let a = s.rows.len()/2..s.rows.len(); s.edit("gyro_y", a, |_| 17.0) });
    go("clip accel z", &hand, &|s| { let a = s.all(); s.edit("accel_z", a, |u| u.min(14000.0)) });
    go("clip accel z table", &table, &|s| { let a = s.all(); s.edit("accel_z", a, |u| u.min(14000.0)) });
    go("clip accel z mid noise table", &table, &|s| { let a = s.all(); let m = 1640.0*9.81+210.0+4.0; s.edit("accel_z", a, |u| u.min(f64::round(m))) });
    go("clip gyro", &hand, &|s| { let a = s.all(); s.edit("gyro_z", a, |u| u.clamp(-6000.0, 6000.0)) });
    go("clip gyro table", &table, &|s| { let a = s.all(); s.edit("gyro_z", a, |u| u.clamp(-6000.0, 6000.0)) });
    go("rails declared", &hand, &|s| { let a = s.all(); s.edit("accel_z", a, |u| u.min(14000.0)); s.set("rails.accel", "[-32768.0, 14000.0]") });
    go("rails declared inside", &hand, &|s| { s.set("rails.accel", "[-32768.0, 14000.0]") });
    go("rails declared mV", &hand, &|s| { s.set("rails.accel", "[0.0, 3.3]") });
    show("five poses", &by_hand_at(5, 1, Random::direction), &[]);
    show("nine poses", &by_hand_at(9, 1, Random::direction), &[]);
    show("ten poses", &by_hand_at(10, 1, Random::direction), &[]);
    show("plane poses", &by_hand_at(20, 1, |_| [1.0, 0.0, 0.0]), &[]);
    show("no z", &on_table_at(&[-90.0, 0.0, 90.0], &[0, 1]), &[]);
    show("one dir", &on_table_at(&[0.0, 30.0, 90.0], &[0, 1, 2]), &[]);
    show("one dir xu", &on_table_at(&[0.0, 30.0, 90.0], &[0, 1, 2]), &["--method", "xu"]);
    show("one dir six", &on_table_at(&[0.0, 30.0, 90.0], &[0, 1, 2]), &["--method", "six-positions"]);
    show("no rates", &on_table_at(&[0.0], &[0, 1, 2]), &[]);
    go("equal", &table, &|s| { let a = s.all(); for (n, v) in [("ref_rate_x_dps", 1.0), ("ref_rate_y_dps", 0.0), ("ref_rate_z_dps",0.0), ("ref_force_x_mps2",0.0),("ref_force_y_mps2", 0.0), ("ref_force_z_mps2", 9.81)] { s.edit(n, a.clone(), |_| v) } });
    go("vibration", &table, &|s| { let a = s.dwells[7].clone(); let c = s.column("accel_x"); for (k, r) in s.rows[a].iter_mut().enumerate() { r[c] += 400.0*(k as f64).sin(); } });
    go("vibration hand", &hand, &|s| { let a = s.dwells[7].clone(); let c = s.column("accel_x"); for (k, r) in s.rows[a].iter_mut().enumerate() { r[c] += 400.0*(k as f64).sin(); } });
    go("never rests", &hand, &|s| { let mut keep = Vec::new(); for k in 0..19 { let t = s.turn(k); keep.extend(t.start+20..t.end-20); } s.rows = keep.into_iter().map(|i| s.rows[i].clone()).collect(); for (i, r) in s.rows.iter_mut().enumerate() { r[0] = i as f64/100.0; } });
    go("tremor", &hand, &|s| { let mut r = Random(9); let mut v = [0.0; 6]; for row in &mut s.rows { for c in 0..6 { v[c] = 0.95*v[c] + 100.0*r.normal(); row[c+1] += v[c]; } } });
    go("ref in g", &table, &|s| { let a = s.all(); for n in ["ref_force_x_mps2","ref_force_y_mps2", "ref_force_z_mps2"] { s.edit(n, a.clone(), |x| x/9.81) } });
    go("ref rad", &table, &|s| { let a = s.all(); for n in ["ref_rate_x_dps","ref_rate_y_dps", "ref_rate_z_dps"] { s.edit(n, a.clone(), |x| x*PI/180.0) } });
    go("raw g SI hand", &hand, &|s| { s.set("raw_unit", "\"SI\""); let a = s.all(); for n in ["accel_x","accel_y","accel_z"] { s.edit(n, a.clone(), |x| x/1640.0/9.81) } for n in ["gyro_x","gyro_y","gyro_z"] { s.edit(n, a.clone(), |x| x/5000.0) } });
    go("raw dps SI hand", &hand, &|s| { s.set("raw_unit", "\"SI\""); let a = s.all(); for n in ["accel_x","accel_y","accel_z"] { s.edit(n, a.clone(), |x| x/1640.0) } for n in ["gyro_x","gyro_y","gyro_z"] { s.edit(n, a.clone(), |x| x/5000.0*57.3) } });
    go("counts as SI", &hand, &|s| { s.set("raw_unit", "\"SI\""); });
    go("gravity 1", &hand, &|s| s.set("gravity_mps2", "1.0"));
    go("table as gravity", &table, &|s| s.set("reference", "\"gravity\""));
    go("hand as table", &hand, &|s| s.set("reference", "\"table\""));
    go("unknown key", &hand, &|s| s.set("sample_rate", "3"));
    go("no gyro", &hand, &|s| { s.names.drain(1..4); for r in &mut s.rows { r.drain(1..4); } });
    go("no accel", &hand, &|s| { s.names.drain(4..7); for r in &mut s.rows { r.drain(4..7); } });
    go("one step wrong ref sign", &table, &|s| { let a = s.dwells[4].clone(); s.edit("ref_rate_x_dps", a, |x| -x) });
    go("step shifted by one", &table, &|s| { let n = s.rows.len(); for i in (40..n).rev() { for c in 1..8 { s.rows[i][c] = s.rows[i-40][c]; } } });
    go("noiseless", &hand, &|s| { s.set("device", "\"a\\nb\"") });
    go("huge", &hand, &|s| { s.edit("accel_x", 100..101, |_| 1e308) });
    go("tiny", &hand, &|s| { s.edit("accel_x", 100..101, |_| 1e-320) });
    go("outlier", &hand, &|s| { s.edit("accel_x", 100..101, |_| 1e9) });
    go("outlier in turn gyro", &hand, &|s| { let t = s.turn(2); s.edit("gyro_x", t.start+70..t.start+71, |_| 32767.0) });
    show("twelve still rows", &{ let mut s = hand.clone(); s.rows.truncate(12); s }, &[]);
    show("one row", &{ let mut s = hand.clone(); s.rows.truncate(1); s }, &[]);
    show("one pose", &{ let mut s = hand.clone(); s.rows.truncate(300); s }, &[]);
    go("steps every row", &table, &|s| { let c = s.column("step"); for (i, r) in s.rows.iter_mut().enumerate() { r[c] = i as f64; } });
    go("all in transit", &table, &|s| { let a = s.all(); s.edit("step", a, |_| -1.0) });
    go("short steps", &table, &|s| { for d in s.dwells.clone() { s.edit("step", d.start+50..d.end, |_| -1.0) } });
    go("big time offset", &hand, &|s| { let a = s.all(); s.edit("t_s", a, |t| t + 1.7e9) });
    go("negative time", &hand, &|s| { let a = s.all(); s.edit("t_s", a, |t| t - 1000.0) });
    go("time jump 1e15", &hand, &|s| { let a = s.rows.len()/2..s.rows.len(); s.edit("t_s", a, |t| t + 1e15) });
    go("time jump day", &hand, &|s| { let a = s.rows.len()/2..s.rows.len(); s.edit("t_s", a, |t| t + 86400.0) });
}
#[test]
fn explore2() {
    let show = |name: &str, s: &Samples, args: &[&str]| {
        let run = Place::with(s).fit(args);
        println!("== {name}: {:?} {}", run.status, run.stderr.trim());
        if run.status == Some(0) {
            let v = run.json();
            for k in ["gyro", "accel"] {
                let x = &v["sensors"][k];
                if x.is_null() { println!("   {k}: none"); continue; }
                println!("   {k}: distance {:.2} rms {} held {} floor {} cond {} static {} dwells {}", distance(&v, k), x["rms"], x["held_out_rms"], x["noise_floor"], x["condition"], x["static_rms"], x["dwells"]);
            }
            for w in warnings(&v) { println!("   W {w}"); }
        }
    };
    for (name, f) in [("constant", (|_t: f64| 0.5) as fn(f64)->f64), ("slow mod", |t| 0.3+0.25*(t*0.5).sin()), ("fast mod", |t| 0.3+0.3*(t*2.0).sin()), ("stop go", |t| 0.4*(t*0.8).sin()), ("creep", |t| if (t % 4.5) < 3.0 { 0.03 } else { 1.2*(1.0-(2.0*PI*((t%4.5)-3.0)/1.5).cos()) })] {
        let mut out = Samples::new("gravity", "t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z");
        let mut r = Random(4);
        let mut a = Attitude([1.0,0.0,0.0,0.0]);
        for k in 0..9000 {
            let t = k as f64/100.0;
            let axis = [ (0.13*t).sin(), (0.21*t+1.0).cos(), (0.17*t+2.0).sin() ];
            let size = axis.iter().map(|a| a * a).sum::<f64>().sqrt();
            let w = f(t);
            let rate = axis.map(|x| x/size*w);
            out.push(vec![t], &mut r, &rate, &a.gravity());
            a = a.then(Attitude::about(axis, w*0.01));
        }
        show(name, &out, &[]);
    }
}
