//! The published schemes against the continuous optimum.

use mimu::plan::design::Problem;
use mimu::plan::design::judgement::Judgement;
use mimu::plan::design::model::Setting;
use mimu::plan::design::reach::{Fixture, Rates};
use mimu::quantity::Sensor;
use mimu_recording::Reference;

use mimu_tests::page::{Block, Table, significant};

use crate::published::Scheme;

/// Sigmas of the parameters that `belongs` selects: one number, or the lowest and the highest.
fn sigmas(judged: &Judgement, belongs: impl Fn(&str) -> bool) -> String {
    let all = judged.parameters.iter();
    let picked = all.filter(|p| belongs(&p.parameter.name)).map(|p| p.sigma);
    let [low, high] = picked.fold([f64::INFINITY, 0.0_f64], |[low, high], s| {
        [low.min(s), high.max(s)]
    });
    match (low.is_finite(), high.is_finite()) {
        (true, true) if high < 1.005 * low => significant(low),
        (true, true) => format!("{} to {}", significant(low), significant(high)),
        (true, false) => format!("{} to undetermined", significant(low)),
        _ => "undetermined".to_string(),
    }
}

fn table(problem: &Problem, sensor: Sensor, sizes: &[usize]) -> Table {
    let mut table = Table::new(&[
        "scheme",
        "dwells",
        "D-efficiency",
        "sigma of biases",
        "sigma of scale factors",
        "of misalignments",
        "dof left",
    ]);
    let mut line = |name: String, settings: &[Setting]| {
        let judged = problem.judge(settings, 1.0);
        let same = |n: &str| n.len() == 4 && n[2..3] == n[3..4];
        table.row([
            name,
            settings.len().to_string(),
            format!("{:.3}", judged.d_efficiency),
            sigmas(&judged, |n| n.len() == 3),
            sigmas(&judged, same),
            sigmas(&judged, |n| n.len() == 4 && !same(n)),
            judged.lack_of_fit_dof.to_string(),
        ]);
    };
    for scheme in Scheme::ALL {
        if let Some(settings) = scheme.settings(sensor) {
            line(scheme.name().to_string(), &settings);
        }
    }
    for &n in sizes {
        let best = problem.best(n, 1).expect("enough dwells");
        line(format!("our {n}"), &best);
    }
    table
}

/// Tables for the accelerometer and for the gyro.
pub fn blocks() -> Vec<Block> {
    let accel = Problem::accel(Reference::Table, Fixture::ThreeAxis).expect("determined");
    let span = Scheme::XuRates.rate_span();
    let gyro = Problem::gyro(span, Fixture::ThreeAxis, Rates::Any).expect("determined");
    vec![
        Block::table(
            "schemes, poses known",
            &table(&accel, Sensor::Accel, &[9, 33]),
        ),
        Block::table("schemes, rates", &table(&gyro, Sensor::Gyro, &[9, 61])),
    ]
}
