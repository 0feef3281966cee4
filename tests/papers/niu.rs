//! niu: consistency of its tables, and curves of the units that are made from them.

use mimu_rig::random::Random;
use mimu_tests::niu::{TABLE_9, TABLE_10, TABLE_11};
use mimu_tests::page::{Block, Table, significant};

/// Drifts over -10 to 70 °C from Tables 5 (MTi-G) and 7 (NV-IMU100); the key is the beginning of the names in Table 9.
const DRIFTS: [(&str, &str, [f64; 2]); 6] = [
    ("gyro bias, deg/h", "b_g", [2100.0, 13.0]),
    ("gyro scale factor, ppm", "δs_g", [11000.0, 10000.0]),
    ("gyro non-orthogonality, ppm", "n_", [6000.0, 1000.0]),
    ("accel bias, µg", "b_a", [3800.0, 14000.0]),
    ("accel scale factor, ppm", "δs_a", [400.0, 1800.0]),
    ("accel non-orthogonality, ppm", "m_", [1000.0, 600.0]),
];

/// Rate of the dynamic tests, 10 deg/s, in deg/h (Table 8 and 5.1).
const RATE: f64 = 36000.0;
/// The power of ten that is missing in two coefficients.
const MENDED: f64 = 1e-5;

/// Coefficients of a row for a unit, 0 or 1. The third is multiplied by `power` if its own is missing.
fn cubic(name: &str, unit: usize, power: f64) -> [f64; 4] {
    let row = TABLE_9.iter().find(|r| r.0 == name).expect("in Table 9").1;
    let mut a: [f64; 4] = std::array::from_fn(|k| row[4 * unit + k]);
    if unit == 1 && ["b_gx", "b_gy"].contains(&name) {
        a[3] *= power;
    }
    a
}

/// Values of a cubic from -10 to 70 °C, every 0.1 K.
fn course(a: [f64; 4]) -> Vec<f64> {
    let at = |t: f64| a[0] + t * (a[1] + t * (a[2] + t * a[3]));
    (0..=800).map(|k| at(0.1 * f64::from(k) - 10.0)).collect()
}

fn drift(course: &[f64]) -> f64 {
    let [low, high] = [f64::min, f64::max].map(|f| course.iter().copied().reduce(f));
    high.expect("some") - low.expect("some")
}

/// Mean and root mean square.
fn moments(course: &[f64]) -> [f64; 2] {
    let n = course.len() as f64;
    let squares = course.iter().map(|x| x * x).sum::<f64>();
    [course.iter().sum::<f64>() / n, (squares / n).sqrt()]
}

/// Largest drift of the axes by the cubics, against Tables 5 and 7.
fn drifts() -> Table {
    let mut table = Table::new(&[
        "drift of -10 to 70 °C",
        "MTi-G, printed",
        "by Table 9",
        "NV-IMU100, printed",
        "by Table 9, as printed",
        "mended",
    ]);
    for (name, prefix, printed) in DRIFTS {
        let of = |unit: usize, power: f64| {
            let rows = TABLE_9.iter().filter(|r| r.0.starts_with(prefix));
            let each = rows.map(|r| drift(&course(cubic(r.0, unit, power))));
            significant(each.fold(0.0, f64::max))
        };
        table.row([
            name.to_string(),
            format!("{}", printed[0]),
            of(0, 1.0),
            format!("{}", printed[1]),
            of(1, 1.0),
            of(1, MENDED),
        ]);
    }
    table
}

/// How the power of ten changes the two curves and the uncompensated error at 10 deg/s, which Table 11 reports.
fn powers() -> Table {
    let mut table = Table::new(&[
        "power of ten of A3",
        "drift of b_gx, deg/h",
        "of b_gy",
        "x at 10 deg/s, mean and rms, deg/h",
        "y",
    ]);
    for exponent in [0, -4, -5, -6] {
        let power = 10f64.powi(exponent);
        let bias = ["b_gx", "b_gy"].map(|name| course(cubic(name, 1, power)));
        let scale = ["δs_gx", "δs_gy"].map(|name| course(cubic(name, 1, power)));
        let error = [0, 1].map(|i| {
            let both = bias[i].iter().zip(&scale[i]);
            let sum: Vec<f64> = both.map(|(b, s)| b + 1e-6 * s * RATE).collect();
            moments(&sum).map(significant).join(", ")
        });
        table.row(
            [format!("{exponent}")]
                .into_iter()
                .chain(bias.map(|b| significant(drift(&b))))
                .chain(error),
        );
    }
    let printed = [0, 1].map(|i| {
        let [_, _, rms, mean] = TABLE_11[i].1;
        format!("{mean}, {rms}")
    });
    let first = [
        "printed".to_string(),
        "13 at most".into(),
        "13 at most".into(),
    ];
    table.row(first.into_iter().chain(printed));
    table
}

/// A test of Table 8: a gyro turning at 10 deg/s about its axis, or an accelerometer at rest along it, in one direction or the other.
struct Direction {
    name: &'static str,
    /// deg/h or µg, signed.
    input: f64,
    /// Of bias and scale factor in Table 9, and of the rows of Tables 10 and 11.
    names: [&'static str; 3],
}

/// The two directions of each kind of test.
#[rustfmt::skip]
const DIRECTIONS: [Direction; 4] = [
    Direction { name: "accelerometers, axis up (Table 8), µg", input: 1e6, names: ["b_a", "δs_a", "accel"], },
    Direction { name: "axis down (5.1), µg", input: -1e6, names: ["b_a", "δs_a", "accel"], },
    Direction { name: "gyros at +10 deg/s, deg/h", input: RATE, names: ["b_g", "δs_g", "gyro"], },
    Direction { name: "at -10 deg/s, deg/h", input: -RATE, names: ["b_g", "δs_g", "gyro"], },
];

/// Rms distance over the axes between the raw mean by Table 9 and the printed one, for each direction of the tests; MTi-G, NV-IMU100, both.
fn means_by_direction() -> [[f64; 3]; 4] {
    DIRECTIONS.each_ref().map(|direction| {
        let [bias, scale, row] = direction.names;
        let squares = [(0, &TABLE_10), (1, &TABLE_11)].map(|(unit, printed)| {
            let axes = ["x", "y", "z"].map(|axis| {
                let of = |name: &str| course(cubic(&format!("{name}{axis}"), unit, MENDED));
                let (bias, scale) = (of(bias), of(scale));
                let both = bias.iter().zip(&scale);
                let error: Vec<f64> = both.map(|(b, s)| b + 1e-6 * s * direction.input).collect();
                let named = format!("{row} {axis}");
                let printed = printed.iter().find(|r| r.0 == named).expect("a row").1[3];
                moments(&error)[0] - printed
            });
            axes.iter().map(|e| e * e).sum::<f64>()
        });
        let [a, b] = squares;
        [a / 3.0, b / 3.0, (a + b) / 6.0].map(f64::sqrt)
    })
}

/// Which direction of the tests of Table 8 agrees with the printed means.
fn directions() -> Table {
    let mut table = Table::new(&["test", "MTi-G", "NV-IMU100", "both"]);
    for (direction, distances) in DIRECTIONS.iter().zip(means_by_direction()) {
        let cells = distances.map(|d| format!("{d:.0}"));
        table.row([direction.name.to_string()].into_iter().chain(cells));
    }
    table
}

/// White noise of the gyro in 3.3, deg/√h.
const ARW: f64 = 3.0;
/// Length of a position, of a turn, s, and angle of a turn, deg (3.2).
const POSITION_S: f64 = 10.0;
const TURN_S: f64 = 9.0;
const TURN_DEG: f64 = 90.0;
/// Positions and turns of a scheme.
const EACH: usize = 8;
/// Simulated schemes, and samples a second.
const SCHEMES: u64 = 400;
const RATE_HZ: f64 = 100.0;

/// What the noise of the gyro does to the results of one scheme: by niu's 3.3, and in schemes simulated sample by sample that are evaluated by
/// (a.7) to (a.10).
fn noise_of_a_scheme() -> Table {
    let per_root_s = ARW / 60.0;
    let sigma = per_root_s * RATE_HZ.sqrt();
    let (mut pair, mut single, mut all, mut scale) = (0.0, 0.0, 0.0, 0.0);
    for run in 0..SCHEMES {
        let mut random = Random::new(run, "niu scheme");
        let mut mean_of = |seconds: f64| {
            let n = (seconds * RATE_HZ) as usize;
            (0..n).map(|_| sigma * random.normal()).sum::<f64>() / n as f64
        };
        let rests: [f64; EACH] = std::array::from_fn(|_| mean_of(POSITION_S));
        let turns = [(); 2].map(|()| mean_of(TURN_S) * TURN_S);
        let squared = |x: f64| x * x / SCHEMES as f64;
        // (a.7): x from the positions with x up and down. (a.8): z from one position.
        pair += squared((rests[0] + rests[1]) / 2.0);
        single += squared(rests[2]);
        all += squared(rests.iter().sum::<f64>() / EACH as f64);
        // (a.9): half the difference of the integrals of both turns.
        scale += squared((turns[0] - turns[1]) / 2.0 / TURN_DEG);
    }
    let bias = |positions: f64| per_root_s / (positions * POSITION_S).sqrt() * 3600.0;
    let by_formula = per_root_s * TURN_S.sqrt() / 2f64.sqrt() / TURN_DEG * 1e6;
    let mut table = Table::new(&[
        "noise of one scheme",
        "printed (3.3)",
        "by formula",
        "simulated",
    ]);
    #[rustfmt::skip]
    let cases = [
        ("bias, all eight positions, deg/h", "about 20", bias(8.0), all.sqrt() * 3600.0),
        ("b_x, b_y by (a.7), two positions, deg/h", "-", bias(2.0), pair.sqrt() * 3600.0),
        ("b_z by (a.8), one position, deg/h", "-", bias(1.0), single.sqrt() * 3600.0),
        ("scale factor, one turn each way, ppm", "about 1200", by_formula, scale.sqrt() * 1e6),
    ];
    for (name, printed, formula, simulated) in cases {
        let figures = [formula, simulated].map(significant);
        table.row(
            [name.to_string(), printed.to_string()]
                .into_iter()
                .chain(figures),
        );
    }
    table
}

/// All blocks of this study.
pub fn blocks() -> Vec<Block> {
    vec![
        Block::table("niu, drifts", &drifts()),
        Block::table("niu, powers of ten", &powers()),
        Block::table("niu, directions", &directions()),
        Block::table("niu, noise of a scheme", &noise_of_a_scheme()),
    ]
}
