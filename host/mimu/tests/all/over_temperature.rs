//! A calibration file with curves over temperature: read, checked, written, and evaluated against Hermite polynomials written here.

use mimu::calibration::Calibration;
use mimu::quantity::Sensor;

const PLAIN: &str = include_str!("written_files/calibration-0.1.toml");

/// Numbers of a triad at a node: C and o, and their derivatives.
fn triad(seed: f64) -> [[f64; 12]; 2] {
    let value = |k: usize, scale: f64| scale * (seed + 1.7 * k as f64).sin();
    let mut numbers: [f64; 12] = std::array::from_fn(|k| value(k, 0.1));
    for diagonal in [0, 4, 8] {
        numbers[diagonal] += 3.0;
    }
    [numbers, std::array::from_fn(|k| value(k + 5, 0.003))]
}

fn table(sensor: &str, [numbers, slopes]: &[[f64; 12]; 2]) -> String {
    let rows = |n: &[f64; 12]| format!("[{:?}, {:?}, {:?}]", &n[0..3], &n[3..6], &n[6..9]);
    format!(
        "[temperature.node.{sensor}]\nC = {}\no = {:?}\nslope_C = {}\nslope_o = {:?}\n",
        rows(numbers),
        &numbers[9..],
        rows(slopes),
        &slopes[9..]
    )
}

fn node(temp_c: f64) -> String {
    let [gyro, accel] = [temp_c, temp_c + 0.5].map(triad);
    format!(
        "[[temperature.node]]\ntemp_c = {temp_c:?}\n{}{}",
        table("gyro", &gyro),
        table("accel", &accel)
    )
}

const NODES: [f64; 4] = [-10.0, 4.0, 31.0, 60.0];

fn text_with(head: &str, nodes: &str) -> String {
    let plain = PLAIN.replace("mimu-calibration/1", "mimu-calibration/2");
    format!("{plain}\n[temperature]\n{head}\n{nodes}")
}

fn text() -> String {
    let nodes: String = NODES.map(node).concat();
    text_with(
        "range_c = [-8.0, 58.5]\ndies.gyro = { lag_s = 61.2, interval_lag_s = [55.0, 67.0] }\ndies.accel = { lag_s = -12.5 }",
        &nodes,
    )
}

fn parse(text: &str) -> Result<Calibration, String> {
    Calibration::parse(text, "cal.toml").map_err(|e| e.to_string())
}

/// Value of a Hermite polynomial between nodes, and of its tangents outside.
fn expected(of: impl Fn(f64) -> [f64; 2], t: f64) -> f64 {
    let (first, last) = (NODES[0], NODES[3]);
    if t < first || t > last {
        let end = if t < first { first } else { last };
        let [value, slope] = of(end);
        return value + slope * (t - end).clamp(-5.0, 5.0);
    }
    let k = (0..3).find(|k| t <= NODES[k + 1]).unwrap();
    let (a, b) = (NODES[k], NODES[k + 1]);
    let ([p0, m0], [p1, m1]) = (of(a), of(b));
    let (h, s) = (b - a, (t - a) / (b - a));
    (2.0 * s.powi(3) - 3.0 * s.powi(2) + 1.0) * p0
        + (s.powi(3) - 2.0 * s.powi(2) + s) * h * m0
        + (3.0 * s.powi(2) - 2.0 * s.powi(3)) * p1
        + (s.powi(3) - s.powi(2)) * h * m1
}

#[test]
fn the_models_between_and_beyond_the_nodes_are_hermites() {
    let read = parse(&text()).unwrap();
    for step in 0..1400 {
        let t = -30.0 + 0.1 * f64::from(step);
        for (sensor, shift) in [(Sensor::Gyro, 0.0), (Sensor::Accel, 0.5)] {
            let found = read.inverse_at(sensor, t).unwrap();
            for k in 0..12 {
                let of = |node: f64| triad(node + shift).map(|numbers| numbers[k]);
                let found = match k {
                    0..9 => found.matrix[(k / 3, k % 3)],
                    _ => found.offset[k - 9],
                };
                let expected = expected(of, t);
                assert!(
                    (found - expected).abs() < 1e-12,
                    "{t} {k}: {found} {expected}"
                );
            }
        }
    }
}

#[test]
fn what_cannot_be_applied_is_refused_and_a_bad_node_is_named_by_its_number() {
    let good = text();
    let nodes: Vec<String> = NODES.iter().map(|t| node(*t)).collect();
    let swapped = [&nodes[0], &nodes[2], &nodes[1]]
        .map(String::as_str)
        .concat();
    let half = nodes[1].split("[temperature.node.accel]").next().unwrap();
    let half = [nodes[0].as_str(), half].concat();
    let many: String = (0..17).map(|k| node(f64::from(k))).collect();
    let singular = table("gyro", &[[0.0; 12]; 2]) + &table("accel", &triad(1.0));
    let singular = format!("{}[[temperature.node]]\ntemp_c = 0.0\n{singular}", nodes[0]);
    let range = "range_c = [0.0, 50.0]";
    #[rustfmt::skip]
    let cases = [
        (text_with(range, &swapped), &["node 3", "temp_c is 4", "31"][..]),
        (text_with(range, &half), &["node 2", "no [accel]"]),
        (text_with(range, &many), &["17 nodes", "1 to 16"]),
        (text_with(range, ""), &["0 nodes"]),
        (text_with(range, &singular), &["node 2", "[gyro]", "a column of C"]),
        (text_with("range_c = [50.0, 0.0]", &nodes[0]), &["range_c"]),
        (text_with("range_c = [70.0, 90.0]", &nodes.concat()), &["70", "from -10 to 60"]),
        (text_with("range_c = [0.0, nan]", &nodes[0]), &["range_c"]),
        (good.replace("lag_s = 61.2", "lag_s = 700.0"), &["lag_s is 700", "-120 to 600"]),
        (good.replace("[55.0, 67.0]", "[67.0, 55.0]"), &["interval_lag_s"]),
        (good.replace("lag_s = 61.2, ", ""), &["it has interval_lag_s"]),
        (good.replace("temp_c = 31.0", "temp_c = nan"), &["node 3"]),
        (good.replace("slope_o = [", "slope_o = [inf, "), &["node 1", "not a number"]),
        (good.replace("calibration/2", "calibration/1"), &["[temperature]", "format"]),
        (PLAIN.replace("calibration/1", "calibration/2"), &["no [temperature]"]),
        (PLAIN.replace("calibration/1", "calibration/3"), &["mimu-calibration/2", "version of mimu"]),
    ];
    for (text, words) in cases {
        let refused = parse(&text).expect_err(words[0]);
        for word in words {
            assert!(refused.contains(word), "{word}: {refused}");
        }
    }
    assert!(parse(&good).is_ok());
}
