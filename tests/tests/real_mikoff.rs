//! Five MPU-9150 turned by hand, with the table that A. Mikov et al. published for them (ICINS 2020).
//!
//! Their model goes from SI to raw: accelerometer `M f + b` with M upper triangular, gyro `(I + [eps x]) (M w + b)`.

use mimu::dwell::Sensor;
use mimu::fit::{Fit, Method};
use mimu::recording::RawUnit;
use mimu::triad::invert;
use mimu_core::compensation::Affine;
use mimu_tests::recordings::{
    Foreign, Models, Samples, data_set, dwell_rows, numbers, rms, upper_triangular_frame, verdict,
};
use nalgebra::{Matrix3, Vector3};

/// Parameters of one unit in the published convention and units: accelerometer s (%), m_yz m_xy m_xz (deg),
/// b (m/s²), gyro s (%), m (deg), b (deg/s), eps (deg).
type Parameters = [f64; 21];

const NAMES: [&str; 21] = [
    "accel s_x %",
    "accel s_y %",
    "accel s_z %",
    "accel m_yz deg",
    "accel m_xy deg",
    "accel m_xz deg",
    "accel b_x m/s2",
    "accel b_y m/s2",
    "accel b_z m/s2",
    "gyro s_x %",
    "gyro s_y %",
    "gyro s_z %",
    "gyro m_yz deg",
    "gyro m_xy deg",
    "gyro m_xz deg",
    "gyro b_x deg/s",
    "gyro b_y deg/s",
    "gyro b_z deg/s",
    "gyro eps_x deg",
    "gyro eps_y deg",
    "gyro eps_z deg",
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

/// What the program that belongs to the publication computes from the same files at its last revision.
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

fn column(table: &[[f64; 5]; 21], unit: usize) -> Parameters {
    std::array::from_fn(|k| table[k][unit])
}

fn fitted(unit: usize) -> Option<(Fit, Samples)> {
    let file = data_set("mikoff_mpu9150x5")?.join(format!("imu{unit}.log"));
    let foreign = Foreign {
        files: vec![(file.clone(), "accel_x,accel_y,accel_z,gyro_x,gyro_y,gyro_z")],
        rate_hz: Some(100.0),
        gravity_mps2: 9.81,
        raw_unit: RawUnit::Si,
        scales: &[],
        inputs: None,
    };
    let fit = foreign.fit(Method::LeastSquares).expect("it can be fitted");
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

#[test]
fn parameters_agree_with_the_published_ones() {
    for unit in UNITS {
        let Some((fit, _)) = fitted(unit) else { return };
        let models = Models::of(&fit);
        let ours = models.in_convention(published_convention);
        println!(
            "\nunit {unit}              mimu   +-95 %   published  in sigmas    program  in sigmas"
        );
        let mut squares = [[0.0; 2]; 2];
        for (k, &(value, sigma)) in ours.iter().enumerate() {
            let sensor = usize::from(k >= 9);
            let off = [&PUBLISHED, &PROGRAM].map(|t| (t[k][unit] - value) / sigma);
            for (s, o) in squares[sensor].iter_mut().zip(off) {
                *s += o * o;
            }
            println!(
                "{:14} {value:10.4} {:8.4} {:11.4} {:+10.2} {:10.4} {:+10.2}{}",
                NAMES[k],
                models.coverage[sensor] * sigma,
                PUBLISHED[k][unit],
                off[0],
                PROGRAM[k][unit],
                off[1],
                if off[1].abs() > models.coverage[sensor] {
                    "  *"
                } else {
                    ""
                }
            );
        }
        let r = |s: usize, t: usize, n: f64| (squares[s][t] / n as f64).sqrt();
        println!(
            "rms in sigmas: accel {:.2} {:.2}, gyro {:.2} {:.2}",
            r(0, 0, 9.0),
            r(0, 1, 9.0),
            r(1, 0, 12.0),
            r(1, 1, 12.0)
        );
    }
}

#[test]
fn nobody_predicts_gravity_better_on_turns_that_were_held_out() {
    println!(
        "                     size of gravity mm/s2        direction after turns deg     by quaternions deg        rest deg/s"
    );
    println!(
        "unit dwells turns  mimu held publ. prog.   mimu held publ. prog.   mimu publ. prog.  mimu publ. prog."
    );
    for unit in UNITS {
        let Some((fit, samples)) = fitted(unit) else {
            return;
        };
        let [a, g] = [Sensor::Accel, Sensor::Gyro].map(|s| fit.sensor(s).unwrap());
        let ours = [a, g].map(|s| s.estimated.triad.inverse);
        let candidates = [
            ours,
            models(&column(&PUBLISHED, unit)),
            models(&column(&PROGRAM, unit)),
        ];
        let dwells = dwell_rows(&fit);
        let v = candidates.map(|[a, g]| verdict(&fit, &a, &g).unwrap());
        let q =
            candidates.map(|[a, g]| rms(samples.direction_errors(&dwells, &a, &g)).to_degrees());
        println!(
            "{unit} {} {} | {:.3} {:.3} {:.3} {:.3} | {:.4} {:.4} {:.4} {:.4} | {:.4} {:.4} {:.4} | {:.4} {:.4} {:.4}",
            a.dwells,
            g.residuals.len(),
            1e3 * v[0].size_mps2,
            1e3 * a.held_out_rms().unwrap(),
            1e3 * v[1].size_mps2,
            1e3 * v[2].size_mps2,
            v[0].direction_rad.to_degrees(),
            g.held_out_rms().unwrap().to_degrees(),
            v[1].direction_rad.to_degrees(),
            v[2].direction_rad.to_degrees(),
            q[0],
            q[1],
            q[2],
            v[0].rest_rps.to_degrees(),
            v[1].rest_rps.to_degrees(),
            v[2].rest_rps.to_degrees()
        );
        println!("{:?} {:?}", g.not_held_out, fit.warnings);
        let rr: Vec<String> = g
            .residuals
            .iter()
            .map(|r| {
                format!(
                    "{:.2}/{:.2}",
                    r.value.norm().to_degrees(),
                    r.held_out.map_or(f64::NAN, |h| h.norm().to_degrees())
                )
            })
            .collect();
        println!("{}", rr.join(" "));
        println!("{:?} {:?}", a.estimated.scatter, g.estimated.scatter);
    }
}

#[test]
#[ignore]
fn explore() {
    use nalgebra::{Rotation3, UnitQuaternion};
    let stills = [10.0, 20.0, 50.0, 100.0, 200.0, 400.0];
    let mut all = vec![];
    for unit in UNITS {
        let (fit, samples) = fitted(unit).unwrap();
        let mut cands = vec![];
        let mut evals = vec![];
        for s in stills {
            let folder = data_set("mikoff_mpu9150x5").unwrap();
            let foreign = Foreign {
                files: vec![(
                    folder.join(format!("imu{unit}.log")),
                    "accel_x,accel_y,accel_z,gyro_x,gyro_y,gyro_z",
                )],
                rate_hz: Some(100.0),
                gravity_mps2: 9.81,
                raw_unit: RawUnit::Si,
                scales: &[],
                inputs: None,
            };
            let tmp = tempfile::TempDir::new().unwrap();
            let rec = foreign.import(&tmp).unwrap();
            let f = mimu::fit::fit(
                mimu::fit::Prepared::read(&rec, s, |_| {}).unwrap(),
                mimu::fit::Options {
                    method: Method::LeastSquares,
                    holdout_blocks: 4,
                    still_factor: s,
                },
            )
            .unwrap();
            let [a, g] = [Sensor::Accel, Sensor::Gyro].map(|x| f.sensor(x).unwrap());
            let c = [a, g].map(|s| s.estimated.triad.inverse);
            let p = published_convention(&c[0], &c[1]);
            println!(
                "unit {unit} still {s}: {}",
                p.iter()
                    .map(|x| format!("{x:.3}"))
                    .collect::<Vec<_>>()
                    .join(" ")
            );
            cands.push(c);
            evals.push(dwell_rows(&f));
        }
        for (n, t) in [("publ", &PUBLISHED), ("prog", &PROGRAM)] {
            println!(
                "unit {unit} {n}: {}",
                column(t, unit)
                    .iter()
                    .map(|x| format!("{x:.3}"))
                    .collect::<Vec<_>>()
                    .join(" ")
            );
            cands.push(models(&column(t, unit)));
        }
        for (e, s) in evals.iter().zip(stills) {
            let q: Vec<String> = cands
                .iter()
                .map(|[a, g]| format!("{:.4}", rms(samples.direction_errors(e, a, g)).to_degrees()))
                .collect();
            let g: Vec<String> = cands
                .iter()
                .map(|[a, _]| {
                    format!(
                        "{:.2}",
                        1e3 * rms(e.iter().map(|d| samples.force(a, d).norm() - 9.81))
                    )
                })
                .collect();
            println!(
                "  on dwells at {s}: dir {} | size {}",
                q.join(" "),
                g.join(" ")
            );
        }
        all.push((fit, samples, cands, evals));
    }
    // Are they rigid together?
    for e in 0..stills.len() {
        let n = all[0].2.len();
        let mut full = vec![vec![]; n];
        let mut size = vec![vec![]; n];
        let mut used = 0;
        for i in 0..5 {
            for j in 0..i {
                let (a, b) = (&all[i], &all[j]);
                let ratio = b.1.t_s.len() as f64 / a.1.t_s.len() as f64;
                let mut common = vec![];
                for d in &a.3[e] {
                    let c = (d.start + d.end) / 2;
                    let m = (c as f64 * ratio) as usize;
                    if let Some(o) = b.3[e].iter().find(|o| o.start + 20 < m && m + 20 < o.end) {
                        common.push((d.clone(), o.clone(), c, m));
                    }
                }
                for k in 0..n {
                    let ([aa, ag], [ba, bg]) = (&a.2[k], &b.2[k]);
                    let mut w = Matrix3::zeros();
                    let mut pairs = vec![];
                    for (d, o, _, _) in &common {
                        let (x, y) = (a.1.force(aa, d).normalize(), b.1.force(ba, o).normalize());
                        w += x * y.transpose();
                        pairs.push((x, y));
                    }
                    let svd = w.svd(true, true);
                    let (u, v) = (svd.u.unwrap(), svd.v_t.unwrap());
                    let s = u
                        * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * v).determinant()))
                        * v;
                    let s =
                        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(s));
                    if k == 0 || k == 5 {
                        println!(
                            "{i} {j} still {} common {} mounting residual {:.3} deg",
                            stills[e],
                            common.len(),
                            rms(pairs.iter().map(|(x, y)| x.angle(&(s * y)).to_degrees()))
                        );
                    }
                    for p in common.windows(2) {
                        let ra = a.1.rotation(ag, p[0].2, p[1].2);
                        let rb = b.1.rotation(bg, p[0].3, p[1].3);
                        full[k].push((ra.inverse() * (s * rb * s.inverse())).angle().to_degrees());
                        size[k].push((ra.angle() - rb.angle()).to_degrees());
                        used += 1;
                    }
                }
            }
        }
        println!(
            "still {} used {used} full {} | size {}",
            stills[e],
            full.iter()
                .map(|v| format!("{:.4}", rms(v.iter().copied())))
                .collect::<Vec<_>>()
                .join(" "),
            size.iter()
                .map(|v| format!("{:.4}", rms(v.iter().copied())))
                .collect::<Vec<_>>()
                .join(" ")
        );
    }
}
