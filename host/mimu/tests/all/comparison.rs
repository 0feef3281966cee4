//! Comparison of calibrations: for unchanged units hardly any parameter is named; a change is named with its size.

use mimu::calibration::Calibration;
use mimu::calibration::body::BodyTriad;
use mimu::calibration::comparison::{Comparison, compare};
use mimu_rig::random::Random;

/// Standard deviation of a bias, V.
const SIGMA: f64 = 1e-3;

/// A calibration of a gyro in volts whose biases are `bias`, with standard deviations of [`SIGMA`]; all other parameters are exact.
pub fn calibration(bias: [f64; 3], device: &str) -> Calibration {
    let o = bias.map(|b| -b);
    let nine = |v: f64| format!("{:?}", [[v; 3]; 3]);
    let covariance = vec![vec![0.0; 12]; 12];
    let text = format!(
        "format = \"mimu-calibration/1\"\ndevice = {device:?}\ntool = \"test\"\n[recording]\nraw_unit = \"V\"\n\
         [gyro]\nformula = \"x = C u + o\"\ndirection = \"raw to SI\"\nraw_unit = \"V\"\nunit = \"rad/s\"\nframe = \"body\"\n\
         C = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\no = {o:?}\nsigma_C = {nine}\nsigma_o = [{SIGMA}, {SIGMA}, {SIGMA}]\n\
         interval_C = {nine}\ninterval_o = [{half}, {half}, {half}]\nparameters = []\ncovariance = {covariance:?}\n\
         [gyro.judged]\nestimator = \"\"\nfigure = \"\"\nunit = \"rad/s\"\nrms = 0.0\ndwells = 9\ncondition = 1.0\n\
         [gyro.forward]\nformula = \"u = P x + b\"\ndirection = \"SI to raw\"\n\
         P = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\nb = {bias:?}\n\
         [gyro.physical]\nformula = \"\"\nscale_factor = [1.0, 1.0, 1.0]\nsigma_scale_factor = [0.0, 0.0, 0.0]\n\
         bias = {bias:?}\nsigma_bias = [{SIGMA}, {SIGMA}, {SIGMA}]\nmisalignment_deg = [0.0, 0.0, 0.0]\n\
         sigma_misalignment_deg = [0.0, 0.0, 0.0]\nnon_orthogonality_deg = [0.0, 0.0, 0.0]\nsigma_non_orthogonality_deg = [0.0, 0.0, 0.0]\n",
        nine = nine(0.0),
        half = 1.96 * SIGMA,
    );
    Calibration::parse(&text, "made up").unwrap()
}

/// `count` calibrations whose biases scatter by the uncertainty of the fit and, on x, by `moves` from one to the next.
fn compared(random: &mut Random, count: usize, moves: f64) -> Comparison {
    let mut one = || {
        let moved = moves * random.normal();
        [2.5 + moved, 2.4, 2.6].map(|b| b + SIGMA * random.normal())
    };
    let all: Vec<_> = (0..count)
        .map(|k| (k.to_string(), calibration(one(), "unit")))
        .collect();
    compare(&all).unwrap()
}

#[test]
fn without_a_change_one_comparison_in_twenty_names_one() {
    for count in [2, 5] {
        let mut random = Random::new(count as u64, "compare");
        const RUNS: usize = 400;
        let named = (0..RUNS).filter(|_| {
            let found = compared(&mut random, count, 0.0);
            found.parameters.iter().any(|p| p.changed)
        });
        // 20 of 400 are expected, with a standard deviation of 4.4.
        let named = named.count();
        assert!((7..=34).contains(&named), "{count}: {named}");
    }
}

#[test]
fn a_magnetometer_whose_hard_iron_moved_is_named_and_its_rotation_is_not() {
    let with = |hard_iron: f64| {
        let mut one = calibration([2.5, 2.4, 2.6], "unit");
        one.body = vec![BodyTriad {
            o: [hard_iron, 0.0, 0.0],
            sigma_o: [SIGMA; 3],
            interval_rotation_deg: Some([0.1; 3]),
            ..crate::applied_body::turned("mag", "uT")
        }];
        one
    };
    let all = [
        ("a".into(), with(-1.0)),
        ("b".into(), with(-1.0 + 20.0 * SIGMA)),
    ];
    let found = compare(&all).unwrap();
    let changed = found.parameters.iter().filter(|p| p.changed);
    let changed: Vec<String> = changed
        .map(|p| format!("{} {}", p.sensor, p.name))
        .collect();
    assert_eq!(changed, ["mag o x"]);
    let rotation = found.parameters.iter().find(|p| p.name == "rotation z");
    assert!(rotation.unwrap().p.unwrap() > 0.99);
}

#[test]
fn the_repeatability_of_sixty_switch_ons_is_found() {
    let mut random = Random::new(1, "compare");
    let found = compared(&mut random, 60, 2.0 * SIGMA);
    let changed: Vec<&str> = found
        .parameters
        .iter()
        .filter(|p| p.changed)
        .map(|p| p.name.as_str())
        .collect();
    assert_eq!(changed, ["bias x"]);
    // 60 values determine a standard deviation to 9 %; here the scatter of the fits is subtracted as well.
    let x = found
        .parameters
        .iter()
        .find(|p| p.name == "bias x")
        .unwrap();
    let ratio = x.repeatability.unwrap() / (2.0 * SIGMA);
    assert!((0.7..1.3).contains(&ratio), "{ratio}");
}
