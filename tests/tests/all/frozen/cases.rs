//! The recordings by kind, and the commands that are frozen of each.

use mimu_rig::random::Random;
use mimu_rig::rig_file::RigFile;
use mimu_tests::bench as rig;
use mimu_tests::by_hand::{self, Grade, SHOWN, flaw};
use mimu_tests::earth::{self, Experiment};
use mimu_tests::recordings::{Foreign, data_set, mikoff_session, xsens_session};
use mimu_tests::sessions::{Life, of_array_recorded, session};
use mimu_tests::slow_bias::Kind;
use mimu_tests::whole_turns::Session;
use mimu_tests::{blind, fleet};

use super::bench::Bench;
use crate::real_ferraris;

/// Recordings and commands under one name.
pub struct Case {
    /// Kind of recording, and name of the snapshot.
    pub kind: &'static str,
    pub name: String,
    /// Makes the recordings and runs the commands; `false` if real ones are missing.
    pub run: Box<dyn Fn(&Bench) -> bool + Send + Sync>,
}

#[derive(Default)]
struct Cases(Vec<Case>);

impl Cases {
    /// A case on the bench.
    fn add(
        &mut self,
        kind: &'static str,
        name: impl Into<String>,
        run: impl Fn(&Bench) + Send + Sync + 'static,
    ) {
        self.real(kind, name, move |bench| {
            run(bench);
            true
        });
    }

    /// A case of real recordings.
    fn real(
        &mut self,
        kind: &'static str,
        name: impl Into<String>,
        run: impl Fn(&Bench) -> bool + Send + Sync + 'static,
    ) {
        self.0.push(Case {
            kind,
            name: name.into(),
            run: Box::new(run),
        });
    }
}

/// All, the longest first.
pub fn all() -> Vec<Case> {
    let mut cases = Cases::default();
    thermal(&mut cases);
    sessions(&mut cases);
    whole_turns(&mut cases);
    slow_biases(&mut cases);
    real(&mut cases);
    on_table(&mut cases);
    planted_on_table(&mut cases);
    hands(&mut cases);
    planted_by_hand(&mut cases);
    turntables(&mut cases);
    means(&mut cases);
    priors(&mut cases);
    designs(&mut cases);
    cases.0
}

/// Fit of `a`, verified on `b`, and diagnosis.
fn judged(bench: &Bench, options: &str) {
    bench
        .mimu(&format!("fit a -o cal.toml{options}"))
        .mimu(&format!("verify b --calibration cal.toml{options}"))
        .mimu(&format!("diagnose a --verify b -o effects.toml{options}"));
}

/// The same of a unit with effects: its file is verified too.
fn judged_with_effects(bench: &Bench) {
    judged(bench, "");
    bench.mimu("verify b --calibration effects.toml");
}

/// Two recordings of a unit, which differ by their noise and by the poses of a person.
fn twice(bench: &Bench, plan: &str, file: &RigFile, seed: u64) {
    bench
        .recorded("a", plan, file, seed)
        .recorded("b", plan, file, seed + 1000);
}

fn clean(seed: u64) -> RigFile {
    let mut random = Random::new(seed, "unit");
    let (gyro, accel) = (rig::gyro(&mut random), rig::accel(&mut random));
    rig::clean(gyro, accel)
}

fn hands(cases: &mut Cases) {
    for (g, grade) in Grade::ALL.into_iter().enumerate() {
        for poses in [12, 24] {
            let seed = 100 * g as u64 + poses as u64;
            cases.add(
                "by-hand",
                format!("{grade:?}, {poses} poses"),
                move |bench| {
                    twice(
                        bench,
                        &rig::hand_plan(poses),
                        &by_hand::unit(&[], grade, seed),
                        seed,
                    );
                    judged(bench, "");
                },
            );
        }
    }
    for k in [0, 5] {
        let grade = Grade::ALL[k % 3];
        cases.add("by-hand", format!("{grade:?}, flaw {k}"), move |bench| {
            let seed = 20 + 2 * k as u64;
            let mut file = by_hand::unit(&[], grade, seed);
            file.flaws = flaw(2 * k as u64);
            twice(bench, &by_hand::plan(seed), &file, seed);
            judged(bench, "");
            if k == 0 {
                bench.mimu("fit a --keep all");
            }
        });
    }
    cases.add("by-hand", "20 Hz, seed 1", |bench| {
        let plan = rig::hand_plan(18).replace("100.0", "20.0");
        twice(bench, &plan, &by_hand::unit(&[], Grade::Tactical, 1), 1);
        judged(bench, "");
    });
    cases.add("by-hand", "noise in motion", |bench| {
        let plan = by_hand::plan(9).replace("poses = ", "poses = 12 # ");
        twice(bench, &plan, &by_hand::unit(&[], Grade::Consumer, 9), 9);
        bench.recorded(
            "rest",
            &rest(300.0),
            &by_hand::unit(&[], Grade::Consumer, 9),
            5,
        );
        bench
            .mimu("fit a -o cal.toml")
            .mimu("allan rest --calibration cal.toml -o noise.toml");
        bench.mimu("noise b --calibration cal.toml --noise noise.toml");
        bench
            .mimu("fit a --noise noise.toml")
            .mimu("diagnose a --noise noise.toml");
    });
}

/// At rest on a table.
fn rest(duration_s: f64) -> String {
    format!(
        "format = \"mimu-plan/1\"\nsample_rate_hz = 100.0\ncarrier = \"table\"\n[[step]]\nup = [0.0, 0.0, 1.0]\ndwell_s = {duration_s:?}\n"
    )
}

fn planted_by_hand(cases: &mut Cases) {
    // Biases that move are `slow-biases`.
    let still = SHOWN
        .into_iter()
        .filter(|id| !["_drift", "_warm_up"].iter().any(|end| id.ends_with(end)));
    let sets = still.map(|id| vec![id]).chain([
        vec!["gyro_g_sensitivity", "accel_scale_quadratic"],
        vec!["accel_cross_axis_product"],
    ]);
    for (k, ids) in sets.enumerate().step_by(2) {
        cases.add("planted-by-hand", ids.join(" and "), move |bench| {
            let seed = 40 + k as u64;
            let file = by_hand::unit(&ids, Grade::ALL[k % 3], seed);
            twice(bench, &by_hand::plan(seed), &file, seed);
            judged_with_effects(bench);
        });
    }
}

fn slow_biases(cases: &mut Cases) {
    let kinds = [
        Kind::LinearDrift,
        Kind::ExponentialDrift,
        Kind::AccelLinearDrift,
        Kind::AccelExponentialDrift,
        Kind::LinearOverTemperature,
    ];
    for (k, kind) in kinds.into_iter().enumerate() {
        cases.add("slow-biases", kind.name(), move |bench| {
            let seed = 60 + k as u64;
            let grade = Grade::ALL[k % 3];
            bench.recorded("a", &kind.plan(seed), &kind.unit(grade, seed), seed);
            bench.mimu("fit a").mimu("diagnose a");
        });
    }
}

fn on_table(cases: &mut Cases) {
    cases.add("table", "known inputs, seed 1", |bench| {
        twice(bench, &rig::table_plan(Some(1)), &clean(1), 1);
        judged(bench, "");
    });
    cases.add("table", "moving inputs", |bench| {
        twice(bench, &rig::turning_plan(5), &clean(5), 5);
        judged(bench, "");
    });
    cases.add("table", "lever arm", |bench| {
        twice(
            bench,
            &rig::turning_plan(6),
            &blind::unit(&["accel_size_effect"], 6),
            6,
        );
        judged(bench, "");
    });
    cases.add("table", "errors of the reference", |bench| {
        let mut file = clean(7);
        file.table.middle_min_deg = 0.0;
        file.table.rate_scale_ppm = [150.0, 0.0, 0.0];
        file.table.level_arcsec = [60.0, -40.0];
        file.table.mounting_arcsec = [30.0, 40.0, -20.0];
        twice(bench, &rig::table_plan(None), &file, 7);
        bench.file(
            "reference.toml",
            "format = \"mimu-reference/1\"\nsource = \"certificate\"\nrate = 2e-4\nmounting_deg = 0.02\ntilt_deg = 0.03\northogonality_deg = 0.02\n\
             gravity_mps2 = 1e-3\nlevel_deg = 0.01\n",
        );
        bench.mimu("fit a").mimu("fit a --reference-error reference.toml -o cal.toml");
        bench.mimu("verify b --calibration cal.toml");
    });
    cases.add("table", "noise at rest", |bench| {
        twice(bench, &rig::table_plan(Some(8)), &clean(8), 8);
        bench.recorded("rest", &rest(600.0), &clean(8), 9);
        bench.mimu("allan rest -o noise.toml");
        bench.mimu("allan rest --kind hadamard");
        judged(bench, " --noise noise.toml");
    });
    for (name, experiment) in [
        ("Earth", Experiment::Table),
        ("Earth, fibre gyro", Experiment::Fibre),
    ] {
        cases.add("table", name, move |bench| {
            let mut random = Random::new(11, "the Earth's rate");
            let (file, _) = earth::unit(experiment, &mut random);
            let plan = earth::plan(experiment, 48.0, &mut random);
            twice(bench, &plan, &file, 11);
            judged(bench, "");
            bench.manifest("a", |text| text.replace("latitude_deg", "# latitude_deg"));
            bench.mimu("fit a --only gyro");
        });
    }
}

fn planted_on_table(cases: &mut Cases) {
    for (id, seed) in [
        ("gyro_g_sensitivity", 80),
        ("gyro_scale_cubic", 82),
        ("gyro_scale_asymmetry", 83),
        ("accel_scale_quadratic", 85),
        ("accel_cross_axis_product", 87),
        ("x_supply_coupling", 89),
    ] {
        cases.add("planted-on-table", id, move |bench| {
            twice(
                bench,
                &rig::table_plan(Some(seed)),
                &blind::unit(&[id], seed),
                seed,
            );
            judged_with_effects(bench);
        });
    }
    let ids = ["accel_thermal_scale", "gyro_thermal_misalignment"];
    cases.add("planted-on-table", ids.join(" and "), move |bench| {
        // A fifth of the samples: the effects move with the chamber.
        let plan = blind::plan(96).replace("sample_rate_hz = 100.0", "sample_rate_hz = 20.0");
        bench.recorded("a", &plan, &blind::unit(&ids, 96), 96);
        bench.mimu("fit a").mimu("diagnose a");
    });
}

fn turntables(cases: &mut Cases) {
    cases.add("turntable", "rates to 0.1 %", |bench| {
        let mut random = Random::new(1, "unit");
        let gyro = rig::in_own_frame(rig::gyro(&mut random));
        let file = rig::clean(gyro, rig::accel(&mut random));
        let plan = rig::record_player_plan(14, [0.0004, -0.0003], 1);
        let plan = plan.replace("carrier", "samples = \"csv\"\ncarrier");
        for (name, seed) in [("a", 1), ("b", 1001)] {
            bench.recorded(&format!("{name}-table"), &plan, &file, seed);
            bench.make(&format!(
                "import {name}-table/samples.csv --columns t_s,step,-,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z,-,-,-,-,-,- --raw-unit V --gravity 9.80665 \
                 --rate-hz 100 --rate-dps 200 --rate-dps 270 --rate-error 0.1% -o {name}"
            ));
        }
        bench.mimu("fit a -o cal.toml").mimu("verify b --calibration cal.toml").mimu("diagnose a");
    });
}

fn means(cases: &mut Cases) {
    // A table takes the poses, because by hand the bench numbers no dwells; the fit does not know the inputs.
    let attitudes = rig::hand_plan(24).replace("\"hands\"", "\"table\"");
    for (name, plan, reference) in [
        ("of poses", attitudes.clone(), "gravity"),
        ("on a table", rig::table_plan(Some(3)), "table"),
    ] {
        cases.add("means", name, move |bench| {
            let plan = plan.replace("carrier", "samples = \"csv\"\ncarrier");
            twice(bench, &plan, &clean(31), 31);
            for name in ["a", "b"] {
                bench.means(&format!("{name}.csv"), name);
                bench.make(&format!(
                    "import {name}.csv --means --raw-unit V --gravity 9.80665 --reference {reference} -o {name}-means"
                ));
            }
            bench.mimu("fit a-means --only accel -o cal.toml").mimu("fit a-means");
            bench.mimu("verify b --calibration cal.toml");
        });
    }
}

fn whole_turns(cases: &mut Cases) {
    cases.add("whole-turns", "Consumer, with poses", |bench| {
        let unit = by_hand::unit(&[], Grade::Consumer, 3);
        twice(bench, &Session::POSES_AND_TURNS.plan(), &unit, 3);
        bench.mimu("fit a");
        judged(bench, " --whole-turns");
    });
    cases.add("whole-turns", "counted", |bench| {
        twice(
            bench,
            &Session::POSES_AND_TURNS.plan(),
            &by_hand::unit(&[], Grade::Consumer, 8),
            8,
        );
        bench.mimu("fit a --whole-turns=10 --placement 0.5 -o cal.toml");
        bench.mimu("verify b --calibration cal.toml --whole-turns=10");
    });
    cases.add("whole-turns", "alone", |bench| {
        twice(
            bench,
            &Session::TURNS.plan(),
            &by_hand::unit(&[], Grade::Consumer, 9),
            9,
        );
        bench.mimu("fit a --whole-turns=10 -o cal.toml");
        bench.mimu("verify b --calibration cal.toml --whole-turns=10");
    });
}

fn sessions(cases: &mut Cases) {
    let lives = [
        (5, Life::PowerOn, 2),
        (8, Life::Dropped, 4),
        (9, Life::Temperature, 4),
    ];
    for (seed, life, count) in lives {
        cases.add(
            "sessions",
            format!("{count}, {}", life.name()),
            move |bench| {
                for number in 0..=count {
                    let (file, noise) = session(seed, life, number);
                    bench.recorded(&format!("s{number}"), &rig::hand_plan(18), &file, noise);
                }
                let all: Vec<String> = (0..count).map(|number| format!("s{number}")).collect();
                bench.mimu(&format!("fit {} -o cal.toml", all.join(" ")));
                bench.mimu(&format!("verify s{count} --calibration cal.toml"));
                if life == Life::PowerOn {
                    bench.mimu("fit s0 --class consumer -o first.toml");
                    bench.mimu(&format!("verify s{count} --calibration first.toml"));
                }
            },
        );
    }
    let ids = ["gyro_g_sensitivity", "accel_scale_quadratic"];
    cases.add("sessions", "joint diagnosis", move |bench| {
        let file = by_hand::unit(&ids, Grade::Consumer, 51);
        for number in 0..4 {
            bench.recorded(
                &format!("s{number}"),
                &rig::hand_plan(18),
                &file,
                5100 + number,
            );
        }
        bench
            .mimu("diagnose s0 s1 s2 --verify s3 -o effects.toml")
            .mimu("verify s3 --calibration effects.toml");
    });
}

/// Six faces and rates about each axis, again and again, while the chamber goes through `chamber_c`.
fn in_chamber(rounds: u32, round_s: Option<f64>, dwell_s: f64, chamber_c: &[[f64; 2]]) -> String {
    let mut plan = format!(
        "format = \"mimu-plan/1\"\nsample_rate_hz = 20.0\ncarrier = \"table\"\nrounds = {rounds}\nchamber_c = {chamber_c:?}\n"
    );
    match round_s {
        Some(round_s) => plan += &format!("round_s = {round_s:?}\nlead_in_s = 240.0\n"),
        None => plan += "lead_in_s = 5.0\n",
    }
    for axis in 0..3 {
        let up: [f64; 3] = std::array::from_fn(|i| f64::from(u8::from(i == axis)));
        for (up, rate_dps) in [(up, 0.0), (up.map(|u| -u), 0.0), (up, 50.0), (up, -50.0)] {
            plan +=
                &format!("[[step]]\nup = {up:?}\nrate_dps = {rate_dps:?}\ndwell_s = {dwell_s:?}\n");
        }
    }
    plan
}

fn warm(seed: u64) -> RigFile {
    let mut file = clean(seed);
    file.thermal.on_before_s = Some(f64::INFINITY);
    file.thermal.board_lag_s = Some(60.0);
    let line = |slope: f64| [0.0, slope, 0.0, 0.0];
    file.curves.gyro.bias_deg_per_h = Some([line(300.0), line(-360.0), line(240.0)]);
    file.curves.accel.bias_mg = Some([line(2.0), line(-1.5), line(1.0)]);
    file
}

fn thermal(cases: &mut Cases) {
    cases.add("thermal", "ramp", |bench| {
        let plan = in_chamber(
            12,
            None,
            6.0,
            &[[0.0, 0.0], [100.0, 0.0], [1000.0, 35.0], [1900.0, 0.0]],
        );
        twice(bench, &plan, &warm(4), 4);
        bench.mimu("thermal fit a --verify b -o cal.toml");
        bench
            .mimu("verify b --calibration cal.toml")
            .mimu("fit a")
            .mimu("diagnose a");
    });
    cases.add("thermal", "soak", |bench| {
        let chamber = [
            [0.0, 0.0],
            [600.0, 0.0],
            [700.0, 12.0],
            [1200.0, 12.0],
            [1300.0, 24.0],
            [1800.0, 24.0],
            [1900.0, 36.0],
            [2400.0, 36.0],
        ];
        let plan = in_chamber(4, Some(600.0), 10.0, &chamber);
        bench.recorded("a", &plan, &warm(5), 5);
        bench.mimu("thermal fit a");
    });
    cases.add("thermal", "niu, Earth", |bench| {
        let mut random = Random::new(13, "the Earth's rate");
        let (file, _) = earth::unit(Experiment::Ramp, &mut random);
        let plan = earth::plan(Experiment::Ramp, 48.0, &mut random);
        let plan = plan.replace("sample_rate_hz = 50", "sample_rate_hz = 20");
        bench.recorded("a", &plan, &file, 13);
        bench.mimu("thermal fit a");
    });
    cases.add("thermal", "at rest", |bench| {
        let plan = rest(1500.0).replace("100.0", "10.0").replace(
            "[[step]]",
            "chamber_c = [[0.0, 0.0], [1500.0, 40.0]]\n[[step]]",
        );
        twice(bench, &plan, &warm(6), 6);
        for name in ["a", "b"] {
            bench.manifest(name, |text| text.replace("\"table\"", "\"gravity\""));
        }
        bench.recorded("hand", &rig::hand_plan(18), &warm(6), 7);
        bench.make("fit hand -o base.toml");
        bench
            .mimu("thermal fit a --at-rest")
            .mimu("thermal fit a --verify b --at-rest --base base.toml");
    });
}

fn priors(cases: &mut Cases) {
    // One case, because all use one prior: of 24 units.
    cases.add("prior", "few poses of a population", |bench| {
        bench.file("prior.toml", fleet::prior(24).to_toml());
        for (seed, poses, stranger) in [
            (3000, 6, 0.0),
            (3001, 8, 0.0),
            (3002, 20, 0.0),
            (3003, 8, 8.0),
        ] {
            let unit = fleet::unit(seed, ([0, 0], stranger)).file;
            let [a, b] = ["a", "b"].map(|name| format!("{name}-{seed}"));
            bench.recorded(&a, &rig::hand_plan(poses), &unit, seed);
            bench.recorded(&b, &rig::hand_plan(12), &unit, seed + 1000);
            bench.mimu(&format!("fit {a} --prior prior.toml -o {a}.toml"));
            bench.mimu(&format!("verify {b} --calibration {a}.toml"));
        }
        bench
            .mimu("design --prior prior.toml")
            .mimu("design --prior prior.toml -n 8 --aim 5");
    });
}

fn designs(cases: &mut Cases) {
    for arguments in [
        "design -n 12",
        "design --sensor gyro -n 14 --rates 50,200",
        "design --table hand -n 14",
        "design --effects gyro_g_sensitivity,accel_scale_quadratic",
        "thermal plan --procedure soak --range=-10..50",
        "thermal plan --procedure ramp --range=-10..50",
    ] {
        cases.add("design", arguments, move |bench| {
            bench.mimu(arguments);
        });
    }
}

/// Imports a foreign recording as `a`.
fn imported(bench: &Bench, foreign: &Foreign<'_>) {
    let folder = tempfile::tempdir().expect("a folder");
    foreign.import(&folder).expect("importable");
    bench.take("a", &folder.path().join("recording"));
}

/// Sessions of a unit of the array as `s0` and so on.
fn of_array(bench: &Bench, unit: usize, sessions: &[usize]) -> bool {
    for (k, number) in sessions.iter().enumerate() {
        let Some((folder, _)) = of_array_recorded(unit, *number) else {
            return false;
        };
        bench.take(&format!("s{k}"), &folder.path().join("recording"));
    }
    true
}

/// The files of a set of small inputs.
fn copied(bench: &Bench, set: &str, names: &[&str]) -> bool {
    let Some(data) = data_set(set) else {
        return false;
    };
    for name in names {
        bench.file(
            name,
            std::fs::read(data.join(name)).expect("it is in the set"),
        );
    }
    true
}

fn real(cases: &mut Cases) {
    cases.real("real", "xsens", |bench| {
        let Some(session) = xsens_session() else {
            return false;
        };
        imported(bench, &session);
        bench.mimu("fit a -o cal.toml").mimu("diagnose a");
        true
    });
    cases.real("real", "mikoff 0", |bench| {
        let Some(session) = mikoff_session(0) else {
            return false;
        };
        imported(bench, &session);
        bench.mimu("fit a").mimu("diagnose a");
        true
    });
    cases.real("real", "imucal, uninterrupted", |bench| {
        let Some((session, _)) = real_ferraris::uninterrupted() else {
            return false;
        };
        ferraris(bench, &session);
        true
    });
    cases.real("real", "suarez", |bench| {
        let Some(data) = data_set("suarez_mpu6050") else {
            return false;
        };
        let columns = "accel_x,accel_y,accel_z,gyro_x,gyro_y,gyro_z";
        imported(
            bench,
            &Foreign {
                files: vec![(data.join("example_data_calibration.csv"), columns)],
                rate_hz: Some(100.0),
                gravity_mps2: 9.79,
                raw_unit: mimu_recording::RawUnit::Count,
                scales: &[],
                inputs: None,
            },
        );
        bench.mimu("fit a").mimu("diagnose a");
        true
    });
    cases.real("real", "affine by hand at 20 Hz", |bench| {
        let names = ["s701.csv", "faces-18-dwells.csv"];
        if !copied(bench, "cases2/affine-unexplained", &names) {
            return false;
        }
        bench
            .mimu("fit s701.csv")
            .mimu("diagnose s701.csv")
            .mimu("fit faces-18-dwells.csv");
        true
    });
    cases.real("real", "sessions with lost samples", |bench| {
        let names = ["s1.csv", "s2.csv", "s3.csv", "s4.csv", "inputs.csv"];
        if !copied(bench, "cases2/sessions-lost-samples", &names) {
            return false;
        }
        for k in 1..5 {
            bench.make(&format!(
                "import s{k}.csv --columns step,gyro_x,gyro_y,gyro_z --scale gyro=0.0174533 --raw-unit SI --rate-hz 50 --reference table --inputs inputs.csv \
                 -o s{k}"
            ));
        }
        bench.mimu("fit s1 s2 s3 s4").mimu("fit s1 s3 s2 s4").mimu("fit s1").mimu("fit s3");
        true
    });
    cases.real("array", "unit 0", |bench| {
        if !of_array(bench, 0, &[0, 1, 2, 3]) {
            return false;
        }
        bench
            .mimu("fit s0 -o one.toml")
            .mimu("verify s3 --calibration one.toml");
        bench.mimu("verify s1 --calibration one.toml");
        bench
            .mimu("fit s0 s1 s2 -o three.toml")
            .mimu("verify s3 --calibration three.toml");
        bench
            .mimu("diagnose s0 --verify s3")
            .mimu("diagnose s0 s1 s2");
        true
    });
    cases.real("array", "unit 3, nine sessions", |bench| {
        if !of_array(bench, 3, &[0, 1, 2, 3, 4, 5, 6, 7, 8]) {
            return false;
        }
        bench
            .mimu("fit s0 s1 s2 s3 s4 s5 s6 s7 -o all.toml")
            .mimu("verify s8 --calibration all.toml");
        bench.mimu("fit s4").mimu("fit s7");
        true
    });
}

fn ferraris(bench: &Bench, session: &real_ferraris::Session) {
    let folder = tempfile::tempdir().expect("a folder");
    session.import(&folder);
    bench.take("a", &folder.path().join("recording"));
    bench.mimu("fit a").mimu("diagnose a");
}
