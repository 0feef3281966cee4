//! How many dwells a required sigma needs: designed poses against poses chosen by hand.

use mimu::estimate::Observation;
use mimu::plan::design::Problem;
use mimu::plan::design::model::{Model, Setting, Terms};
use mimu::plan::design::reach::Fixture;
use mimu::plan::design::schemes::Scheme;
use mimu::quantity::Sensor;
use mimu_recording::Reference;
use mimu_rig::hands::{Hands, HandsTruth};
use mimu_rig::located::Source;
use mimu_rig::motion::Carrier as _;
use mimu_rig::plan::Plan;
use nalgebra::Vector3;

use crate::plot::{Band, Chart, Line, Mark};
use mimu_tests::page::{Block, Table, significant};

/// Number of poses of the session by hand that the designs are compared with.
const BY_HAND: usize = 38;
/// Sessions by hand for each number of poses.
const SESSIONS: u64 = 200;
/// Tested numbers of dwells.
const NUMBERS: [usize; 20] = [
    4, 6, 8, 9, 10, 11, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30, 32, 36, 38, 48,
];

/// Rms over the parameters of sigma times the parameter's effect at 1 g, in units of the noise of a dwell mean.
///
/// `None` if the poses leave a parameter undetermined.
fn sigma(problem: &Problem, poses: &[Setting]) -> Option<f64> {
    let judged = problem.judge(poses, 1.0);
    let squares: f64 = judged.parameters.iter().map(|p| p.sigma * p.sigma).sum();
    let rms = (squares / judged.parameters.len() as f64).sqrt();
    rms.is_finite().then_some(rms)
}

/// Poses chosen by a person who was asked for that many in all directions.
fn by_hand(poses: usize, seed: u64) -> Vec<Setting> {
    let text = format!(
        "format = \"mimu-plan/1\"\nsample_rate_hz = 10.0\ncarrier = \"hands\"\nsteps = true\n[[step]]\nposes = {poses}\ndwell_s = 2.0\n"
    );
    let plan = Plan::parse(Source::new("plan of this study", text)).expect("a plan");
    let mut hands = Hands::new(&plan, &HandsTruth::default(), seed).expect("hands");
    let mut found: Vec<Setting> = Vec::new();
    let samples = (hands.duration_s() / 0.25) as usize;
    for k in 0..samples {
        let instant = hands.at(0.25 * k as f64);
        let Some(step) = instant.step else { continue };
        if step as usize == found.len() {
            let up = instant.motion.attitude.inverse().turn([0.0, 0.0, 1.0]);
            found.push(Setting::at_rest(Vector3::from(up)));
        }
    }
    assert_eq!(found.len(), poses, "seed {seed}");
    found
}

/// 5th percentile, median and 95th percentile of the sessions' sigmas.
fn sessions(problem: &Problem, poses: usize) -> [f64; 3] {
    let sigma = |seed| sigma(problem, &by_hand(poses, seed)).unwrap_or(f64::INFINITY);
    let mut all: Vec<f64> = (0..SESSIONS).map(sigma).collect();
    all.sort_by(f64::total_cmp);
    [0.05, 0.5, 0.95].map(|q| all[(q * (SESSIONS - 1) as f64).round() as usize])
}

/// The poses of the session with an Xsens MTi that was published with IMU-TK.
fn published_session() -> Option<Vec<Setting>> {
    let fit = mimu_tests::recordings::xsens()?;
    let accel = fit.sensor(Sensor::Accel)?;
    let ups = (fit.prepared.observations(Sensor::Accel).into_iter())
        .map(|o: Observation| Setting::at_rest(accel.estimated.triad.inverse.apply(&o.raw)));
    Some(ups.collect())
}

/// The smallest number of dwells with which our designs reach `sigma`, interpolated between the tested numbers.
fn needed(ours: &[(f64, f64)], sigma: f64) -> Option<usize> {
    let first = ours.windows(2).find(|w| w[1].1 <= sigma)?;
    let [(n0, s0), (n1, s1)] = [first[0], first[1]];
    let share = ((sigma / s0).ln() / (s1 / s0).ln()).clamp(0.0, 1.0);
    Some((n0 + share * (n1 - n0)).ceil() as usize)
}

/// The plot and the table of one kind of reference.
fn study(
    reference: Reference,
    file: &str,
    title: &str,
    fewest: usize,
    published: Option<&[Setting]>,
) -> (Table, Option<[String; 3]>, Chart) {
    let model = Model::accel(reference, &Terms::default());
    let problem = Problem::accel(model, Fixture::ThreeAxis).expect("determined");
    let numbers = NUMBERS.iter().copied().filter(|n| *n >= fewest);
    let ours: Vec<(f64, f64)> = numbers
        .clone()
        .filter_map(|n| {
            let best = problem.best(n, 1).expect("enough dwells");
            Some((n as f64, sigma(&problem, &best)?))
        })
        .collect();
    let hand: Vec<(f64, [f64; 3])> = numbers
        .filter(|n| *n >= fewest + 3)
        .map(|n| (n as f64, sessions(&problem, n)))
        .collect();
    let mut table = Table::new(&[
        "poses",
        "dwells",
        "sigma, of a dwell's noise",
        "our design does it in",
    ]);
    let mut marks = Vec::new();
    let mut line = |name: &str, dwells: usize, sigma: Option<f64>| {
        let ours = sigma.and_then(|s| needed(&ours, s));
        table.row([
            name.to_string(),
            dwells.to_string(),
            sigma.map_or_else(|| "undetermined".into(), significant),
            ours.map_or_else(|| "-".to_string(), |n| format!("{n} dwells")),
        ]);
    };
    let mut mark = |name: &str, dwells: usize, sigma: Option<f64>| {
        marks.extend(sigma.map(|sigma| Mark {
            name: name.to_string(),
            at: (dwells as f64, sigma),
        }));
    };
    let at_38 = (hand.iter().find(|h| h.0 == BY_HAND as f64))
        .expect("38 is among the numbers")
        .1;
    line("by hand, best twentieth", BY_HAND, Some(at_38[0]));
    line("by hand, middle", BY_HAND, Some(at_38[1]));
    line("by hand, worst twentieth", BY_HAND, Some(at_38[2]));
    for scheme in [
        Scheme::SixFace,
        Scheme::FangNine,
        Scheme::Xu33,
        Scheme::Niu8,
    ] {
        let poses = scheme.settings(Sensor::Accel).expect("poses");
        let sigma = sigma(&problem, &poses);
        line(scheme.name(), poses.len(), sigma);
        mark(scheme.name(), poses.len(), sigma);
    }
    let published = published.map(|poses| {
        let sigma = sigma(&problem, poses);
        mark("Xsens session", poses.len(), sigma);
        let sigma = sigma.expect("it was fitted");
        let ours = needed(&ours, sigma).map_or_else(|| "-".into(), |n| n.to_string());
        [poses.len().to_string(), significant(sigma), ours]
    });
    let chart = Chart {
        file: file.to_string(),
        title: title.to_string(),
        x: "dwells".to_string(),
        y: "sigma of a parameter, in sigmas of a dwell mean".to_string(),
        bands: vec![Band {
            name: "by hand, nine of ten sessions".to_string(),
            points: hand
                .iter()
                .map(|(n, [low, _, high])| (*n, *low, *high))
                .collect(),
        }],
        lines: vec![
            Line {
                name: "by hand, middle".to_string(),
                points: hand
                    .iter()
                    .map(|(n, [_, middle, _])| (*n, *middle))
                    .collect(),
            },
            Line {
                name: "our designs".to_string(),
                points: ours.clone(),
            },
        ],
        marks,
    };
    (table, published, chart)
}

/// Tables and plots. The plots need the published session; without it there are none.
pub fn blocks() -> (Vec<Block>, Vec<Chart>) {
    let published = published_session();
    let (by_size, session_by_size, size_chart) = study(
        Reference::Gravity,
        "dwells-gravity.svg",
        "Accelerometer, only the size of gravity known (9 parameters)",
        9,
        published.as_deref(),
    );
    let (by_input, session_by_input, input_chart) = study(
        Reference::Table,
        "dwells-table.svg",
        "Accelerometer, poses known (12 parameters)",
        4,
        published.as_deref(),
    );
    let session = session_by_size.zip(session_by_input).map(|(size, input)| {
        let mut table = Table::new(&[
            "Xsens session",
            "dwells",
            "sigma, of a dwell's noise",
            "our design does it in",
        ]);
        for (name, [dwells, sigma, ours]) in
            [("size of gravity known", size), ("poses known", input)]
        {
            table.row([name.into(), dwells, sigma, format!("{ours} dwells")]);
        }
        table.markdown()
    });
    let charts = match session {
        Some(_) => vec![size_chart, input_chart],
        None => Vec::new(),
    };
    let blocks = vec![
        Block::table("dwells, size of gravity", &by_size),
        Block::table("dwells, poses known", &by_input),
        Block {
            name: "dwells, a published session",
            text: session,
        },
    ];
    (blocks, charts)
}
