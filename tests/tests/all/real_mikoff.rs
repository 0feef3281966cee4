//! Five MPU-9150 turned by hand, with the table that A. Mikov et al. published for them (ICINS 2020).
//!
//! Their model goes from SI to raw: accelerometer `M f + b` with M upper triangular, gyro `(I + [eps x]) (M w + b)`.

use mimu::fit::Fit;
use mimu::quantity::Sensor;
use mimu::triad::invert;
use mimu_core::compensation::Affine;
use mimu_tests::recordings::{
    Models, Samples, data_set, dwell_rows, mikoff, numbers, rms, upper_triangular_frame,
};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// Parameters of one unit in the published convention and units: accelerometer s (%), m_yz m_xy m_xz (deg),
/// b (m/s²), gyro s (%), m (deg), b (deg/s), eps (deg).
type Parameters = [f64; 21];

#[rustfmt::skip]
const NAMES: [&str; 21] = [
    "accel s_x %", "accel s_y %", "accel s_z %", "accel m_yz deg", "accel m_xy deg", "accel m_xz deg", "accel b_x m/s2", "accel b_y m/s2",
    "accel b_z m/s2", "gyro s_x %", "gyro s_y %", "gyro s_z %", "gyro m_yz deg", "gyro m_xy deg", "gyro m_xz deg", "gyro b_x deg/s",
    "gyro b_y deg/s", "gyro b_z deg/s", "gyro eps_x deg", "gyro eps_y deg", "gyro eps_z deg",
];

/// The published table: a row for each parameter, a column for each unit.
const PUBLISHED: [[f64; 5]; 21] = [
    [0.363, 0.471, 0.382, 0.263, 0.251],
    [0.315, 0.482, 0.355, 0.448, 0.286],
    [0.647, 0.932, 0.780, 0.721, 0.804],
    [0.123, -0.284, 0.260, -0.009, 0.056],
    [0.020, -0.010, -0.012, -0.028, 0.000],
    [0.317, 0.145, 0.282, -0.104, 0.191],
    [0.103, 0.090, 0.096, 0.065, 0.070],
    [0.097, 0.070, 0.008, 0.092, 0.036],
    [0.344, 0.338, -0.045, -0.009, 0.182],
    [0.041, 0.007, -0.058, 0.227, 0.226],
    [0.457, 0.260, 0.277, 0.599, 0.570],
    [0.826, -0.179, 0.242, 0.308, 0.853],
    [-0.034, -0.639, 0.150, -0.105, 0.080],
    [-0.120, 0.210, -0.072, 0.025, 0.178],
    [0.806, 0.262, 0.876, 0.072, 0.497],
    [1.146, -0.573, 0.573, -1.261, -1.031],
    [-0.401, 1.089, -0.344, 1.031, 0.401],
    [1.261, 0.286, 1.261, 4.813, 1.432],
    [0.030, -0.565, 0.142, -0.102, 0.077],
    [-0.364, 0.013, -0.482, -0.129, -0.223],
    [-0.074, 0.069, -0.079, 0.015, 0.075],
];

/// Results of the publication's own program, in its last revision, for the same files.
const PROGRAM: [[f64; 5]; 21] = [
    [0.3595, 0.4661, 0.3791, 0.2614, 0.2454],
    [0.3108, 0.4780, 0.3493, 0.4438, 0.2844],
    [0.6580, 0.9486, 0.8015, 0.7404, 0.8211],
    [0.1182, -0.2799, 0.2592, -0.0116, 0.0556],
    [0.0256, -0.0098, -0.0096, -0.0255, 0.0070],
    [0.3177, 0.1402, 0.2809, -0.0997, 0.2036],
    [0.1029, 0.0903, 0.0956, 0.0655, 0.0700],
    [0.0970, 0.0696, 0.0079, 0.0914, 0.0359],
    [0.3446, 0.3382, -0.0454, -0.0081, 0.1840],
    [0.0291, -0.0165, -0.0815, 0.2314, 0.2206],
    [0.4503, 0.2434, 0.2743, 0.6010, 0.5507],
    [0.8185, -0.1903, 0.2192, 0.3073, 0.8294],
    [-0.0327, -0.6487, 0.1446, -0.1002, 0.0734],
    [-0.1349, 0.2098, -0.0689, 0.0298, 0.1870],
    [0.7978, 0.2506, 0.8816, 0.0663, 0.5184],
    [1.1208, -0.6049, 0.5791, -1.2360, -1.0505],
    [-0.3853, 1.0720, -0.3654, 1.0114, 0.4037],
    [1.2416, 0.3048, 1.2681, 4.7929, 1.4421],
    [0.0316, -0.5694, 0.1357, -0.0997, 0.0706],
    [-0.3614, 0.0161, -0.4892, -0.1176, -0.2372],
    [-0.0881, 0.0664, -0.0789, 0.0186, 0.0762],
];

const UNITS: std::ops::Range<usize> = 0..5;

/// The largest difference between the published table and the program's results, by kind of parameter: accelerometer s, m, b; gyro s, m, b, eps,
/// three of each. The table was made before an index error that overwrote residuals was corrected, and its gyro biases are multiples of 0.001 rad/s.
const IRREPRODUCIBLE: [f64; 7] = [0.022, 0.0126, 0.002, 0.024, 0.0214, 0.0319, 0.0142];

fn column(table: &[[f64; 5]; 21], unit: usize) -> Parameters {
    std::array::from_fn(|k| table[k][unit])
}

/// Fit and samples of one unit.
fn fitted(unit: usize) -> Option<(Fit, Samples)> {
    let file = data_set("mikoff_mpu9150x5")?.join(format!("imu{unit}.log"));
    let fit = mikoff(unit)?;
    let rows = numbers(&file);
    let triple = |r: &[f64], from: usize| Vector3::new(r[from], r[from + 1], r[from + 2]);
    let samples = Samples {
        t_s: (0..rows.len()).map(|k| k as f64 / 100.0).collect(),
        accel: rows.iter().map(|r| triple(r, 0)).collect(),
        gyro: rows.iter().map(|r| triple(r, 3)).collect(),
    };
    Some((fit, samples))
}

/// mimu's models in the published convention.
fn published_convention(accel: &Affine<f64>, gyro: &Affine<f64>) -> Vec<f64> {
    let (accel, gyro) = (invert(accel).unwrap(), invert(gyro).unwrap());
    let (m, frame) = upper_triangular_frame(&accel.matrix);
    let mut out = triangle(&m);
    out.extend(&accel.offset);
    // P = (I + [eps x]) M: the three elements below the diagonal of (I + [eps x])^-1 P vanish.
    let p = gyro.matrix * frame.transpose();
    let turned = |eps: &Vector3<f64>| {
        (Matrix3::identity() + eps.cross_matrix())
            .try_inverse()
            .unwrap()
    };
    let mut eps = Vector3::zeros();
    for _ in 0..20 {
        let below = turned(&eps) * p;
        eps += Vector3::new(
            below[(2, 1)] / below[(1, 1)],
            -below[(2, 0)] / below[(0, 0)],
            below[(1, 0)] / below[(0, 0)],
        );
    }
    out.extend(triangle(&(turned(&eps) * p)));
    out.extend(&(turned(&eps) * gyro.offset).map(f64::to_degrees));
    out.extend(&eps.map(f64::to_degrees));
    out
}

/// s in %, then m_yz m_xy m_xz in degrees.
fn triangle(m: &Matrix3<f64>) -> Vec<f64> {
    let s = (0..3).map(|i| 100.0 * (m[(i, i)] - 1.0));
    let angles = [(1, 2), (0, 1), (0, 2)].map(|place| m[place].to_degrees());
    s.chain(angles).collect()
}

/// Inverse models of accelerometer and gyro from published parameters.
fn models(p: &Parameters) -> [Affine<f64>; 2] {
    let triple = |from: usize| Vector3::new(p[from], p[from + 1], p[from + 2]);
    let m = |from: usize| {
        let (s, a) = (triple(from) / 100.0, triple(from + 3).map(f64::to_radians));
        Matrix3::new(
            1.0 + s.x,
            a.y,
            a.z,
            0.0,
            1.0 + s.y,
            a.x,
            0.0,
            0.0,
            1.0 + s.z,
        )
    };
    let turn = Matrix3::identity() + triple(18).map(f64::to_radians).cross_matrix();
    let accel = Affine {
        matrix: m(0),
        offset: triple(6),
    };
    let gyro = Affine {
        matrix: turn * m(9),
        offset: turn * triple(15).map(f64::to_radians),
    };
    [accel, gyro].map(|forward| invert(&forward).unwrap())
}

#[test]
fn the_published_convention_is_a_change_of_frame_only() {
    for unit in UNITS {
        let given = column(&PROGRAM, unit);
        let [accel, gyro] = models(&given);
        let back = published_convention(&accel, &gyro);
        for (a, b) in given.iter().zip(&back) {
            assert!((a - b).abs() < 1e-12, "{a} became {b}");
        }
    }
}

fn in_units(unit: usize, table: &[[f64; 5]; 21]) -> [Affine<f64>; 2] {
    models(&column(table, unit))
}

fn own(fit: &Fit) -> [Affine<f64>; 2] {
    [Sensor::Accel, Sensor::Gyro].map(|s| {
        let fit = fit.sensor(s).expect("both sensors were recorded");
        fit.estimated.triad.inverse
    })
}

#[test]
fn accelerometers_agree_with_the_published_ones_and_gyros_where_the_table_can_be_trusted() {
    let mut outside = Vec::new();
    for unit in UNITS {
        let Some((fit, _)) = fitted(unit) else {
            return;
        };
        let models = Models::of(&fit);
        let ours = models.in_convention(published_convention);
        for (k, &(value, _, interval)) in ours.iter().enumerate() {
            let far = (PUBLISHED[k][unit] - value).abs() > interval + IRREPRODUCIBLE[k / 3];
            if far && k < 9 {
                outside.push((unit, NAMES[k]));
            }
            // The program leaves 0.1 deg of each turn unexplained (rms). Over its 22 turns, a third of which determine a parameter well, this gives
            // 0.04 deg or 0.06 % of it; three times that and mimu's own 0.1 make 0.2. Unit 1 is excluded: the program takes six samples for a dwell,
            // and the turns before and after it have residuals of 0.9 deg. Biases: mimu's come from seventy seconds at rest, the program's from the
            // turns alone, with residuals of 0.1 deg in 2.5 s each.
            if k >= 9 && unit != 1 {
                let limit = if (15..18).contains(&k) { 0.06 } else { 0.2 };
                let off = (PROGRAM[k][unit] - value).abs();
                assert!(off < limit, "unit {unit}, {}: {off}", NAMES[k]);
            }
        }
    }
    // The accelerometer's residual is noise, so the intervals are valid: 2 of 45 are expected outside 95 %, and the two estimates share most of their
    // samples.
    assert!(outside.len() <= 2, "{outside:?}");
}

/// A rest that two units share: the row ranges of both, and the middle row of both.
struct Common {
    rows: [std::ops::Range<usize>; 2],
    middle: [usize; 2],
}

/// The files begin and end together, so the same fraction of the rows is the same instant; at rest some tenths of a second do not matter.
fn common(rests: [&[std::ops::Range<usize>]; 2], lengths: [usize; 2]) -> Vec<Common> {
    let ratio = lengths[1] as f64 / lengths[0] as f64;
    rests[0]
        .iter()
        .filter_map(|a| {
            let middle = (a.start + a.end) / 2;
            let there = (middle as f64 * ratio) as usize;
            let b = rests[1]
                .iter()
                .find(|b| b.start + 20 < there && there + 20 < b.end)?;
            Some(Common {
                rows: [a.clone(), b.clone()],
                middle: [middle, there],
            })
        })
        .collect()
}

/// Rotation from the directions `b` to the directions `a`, by least squares (Wahba).
fn mounting(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> UnitQuaternion<f64> {
    let sum: Matrix3<f64> = a.iter().zip(b).map(|(a, b)| a * b.transpose()).sum();
    let svd = sum.svd(true, true);
    let (u, v) = (svd.u.expect("asked for"), svd.v_t.expect("asked for"));
    let proper = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * v).determinant()));
    UnitQuaternion::from_matrix(&(u * proper * v))
}

/// The five units were fixed to one board, so their estimates of its rotations must agree, heading included; no calibration used this.
#[test]
fn units_on_one_board_agree_better_on_its_rotations_than_by_the_published_calibrations() {
    let mut units = Vec::new();
    for unit in UNITS {
        let Some((fit, samples)) = fitted(unit) else {
            return;
        };
        let candidates = [
            own(&fit),
            in_units(unit, &PUBLISHED),
            in_units(unit, &PROGRAM),
        ];
        units.push((dwell_rows(&fit), samples, candidates));
    }
    let (mut rotation, mut angle) = ([const { Vec::new() }; 3], [const { Vec::new() }; 3]);
    let mut by_unit = vec![[const { Vec::new() }; 3]; 5];
    for i in UNITS {
        for j in 0..i {
            let [(rests_a, a, of_a), (rests_b, b, of_b)] = [&units[i], &units[j]];
            let rests = common([rests_a, rests_b], [a.t_s.len(), b.t_s.len()]);
            for k in 0..3 {
                let ([accel_a, gyro_a], [accel_b, gyro_b]) = (&of_a[k], &of_b[k]);
                let up = |s: &Samples, m: &Affine<f64>, side: usize| -> Vec<Vector3<f64>> {
                    rests
                        .iter()
                        .map(|r| s.force(m, &r.rows[side]).normalize())
                        .collect()
                };
                let (up_a, up_b) = (up(a, accel_a, 0), up(b, accel_b, 1));
                let mount = mounting(&up_a, &up_b);
                for pair in rests.windows(2) {
                    let turn_a = a.rotation(gyro_a, pair[0].middle[0], pair[1].middle[0]);
                    let turn_b = b.rotation(gyro_b, pair[0].middle[1], pair[1].middle[1]);
                    let off = (turn_a.inverse() * mount * turn_b * mount.inverse())
                        .angle()
                        .to_degrees();
                    rotation[k].push(off);
                    by_unit[i][k].push(off);
                    by_unit[j][k].push(off);
                    angle[k].push((turn_a.angle() - turn_b.angle()).to_degrees());
                }
            }
        }
    }
    let all = |v: [Vec<f64>; 3]| v.map(rms);
    let (rotation, angle) = (all(rotation), all(angle));
    // The angle of a rotation depends on neither mounting nor accelerometer, so this compares the gyros.
    assert!(
        rotation[0] < rotation[2] && rotation[2] < rotation[1],
        "{rotation:?}"
    );
    assert!(angle[0] < angle[2] && angle[2] < angle[1], "{angle:?}");
    for (unit, of_unit) in by_unit.iter().enumerate() {
        let [ours, program] = [0, 2].map(|k: usize| rms(of_unit[k].iter().copied()));
        assert!(ours < program, "unit {unit}: {ours} and {program} deg");
    }
}
