//! `mimu thermal record` with a scripted device, which lies with z up, and a table and a chamber that record their commands.

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};

use mimu_core::wire::Start;
use mimu_recording::{Manifest, Recording, Reference};

use super::peer::{Act, Peer, Script};
use super::{Place, mimu, start};
use crate::command::says;

/// A table with a chamber behind a TCP address; it reports busy for two queries after each motion.
struct Equipment {
    told: Arc<Mutex<Vec<String>>>,
}

fn answer(stream: TcpStream, told: &Mutex<Vec<String>>) {
    let (mut busy, mut chamber) = (0, "21.5".to_owned());
    let mut out = stream.try_clone().unwrap();
    for line in BufReader::new(stream).lines().map_while(Result::ok) {
        let answer = match line.as_str() {
            "INTERLOCK?" => "1".into(),
            "CHAMBER?" => format!("T={chamber} C"),
            "BUSY?" => {
                busy = (busy - 1).max(0);
                i32::from(busy > 0).to_string()
            }
            _ => {
                if let Some(temp_c) = line.strip_prefix("CHAMBER ") {
                    temp_c.clone_into(&mut chamber);
                } else {
                    busy = 3;
                }
                told.lock().unwrap().push(line);
                "OK".into()
            }
        };
        if writeln!(out, "{answer}").is_err() {
            return;
        }
    }
}

impl Equipment {
    /// With its driver file in the folder.
    fn new(place: &Place) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let driver = std::fs::read_to_string(crate::wizard::bench::in_repository(
            "tests/board/demo/turntable.toml",
        ))
        .unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let driver = driver.replace("HOST:PORT", &address);
        std::fs::write(place.path("driver.toml"), driver).unwrap();
        let told = Arc::new(Mutex::new(Vec::new()));
        let keep = told.clone();
        // It ends with the test.
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                answer(stream, &keep);
            }
        });
        Self { told }
    }

    fn told(&self) -> Vec<String> {
        self.told.lock().unwrap().clone()
    }
}

fn plan(place: &Place, steps: &str) {
    let head = "format = \"mimu-plan/1\"\nsample_rate_hz = 100.0\ncarrier = \"table\"\ngravity_mps2 = 9.8\n\
                chamber_c = [[0.0, 21.0], [20.0, 25.0]]\n";
    std::fs::write(place.path("plan.toml"), format!("{head}{steps}")).unwrap();
}

const UP: &str = "[[step]]\nup = [0.0, 0.0, 1.0]\n";

fn arguments<'a>(peer: &'a Peer, name: &'a str) -> Vec<&'a str> {
    let words = "thermal record plan.toml --driver driver.toml --json - --port";
    let mut all: Vec<&str> = words.split(' ').collect();
    all.extend([peer.path.as_str(), "-o", name]);
    all
}

fn quick() -> Script {
    Script {
        speed: 4.0,
        start: Start::PowerOn,
        ..Script::default()
    }
}

#[test]
fn dwells_and_turns_are_recorded_with_their_inputs_and_the_chamber_is_left_at_rest() {
    let place = Place::new();
    let (equipment, peer) = (Equipment::new(&place), Peer::new(quick()));
    let turn = "[[step]]\nturn_axis = \"inner\"\nturn_deg = 90.0\nturn_dps = 45.0\n";
    plan(
        &place,
        &format!("rounds = 2\n{UP}dwell_s = 2.0\n{turn}[[step]]\nstay = true\ndwell_s = 1.0\n"),
    );
    let ran = mimu(&place, &arguments(&peer, "rec"));
    let made = ran.json();
    assert_eq!(made["dwells_done"], 6, "{}", ran.stderr);
    assert!(ran.stderr.contains("round 2 of 2"), "{}", ran.stderr);
    let told = equipment.told();
    let motions: Vec<&str> = told
        .iter()
        .map(String::as_str)
        .filter(|l| !l.starts_with("CHAMBER"))
        .collect();
    let turn = "TURN inner 90.000000 45.000000";
    let pose = "MOVE 0.000000 0.000000 1.000000";
    assert_eq!(
        motions,
        ["STOP", pose, turn, turn, "STOP"],
        "where it stands already, it is not sent"
    );
    let sets: Vec<f64> = told
        .iter()
        .filter_map(|l| l.strip_prefix("CHAMBER ")?.parse().ok())
        .collect();
    assert_eq!((sets[0], sets[sets.len() - 1]), (21.0, 25.0));
    assert_eq!(
        made["set_points"].as_u64().unwrap() as usize,
        sets.len() - 1
    );

    let manifest = Manifest::read(&place.path("rec/recording.toml")).unwrap();
    assert_eq!(manifest.reference, Reference::Table);
    assert_eq!(manifest.turn_steps, [1, 4]);
    assert!(manifest.dropped_steps.is_empty() && !manifest.unfinished);
    let mut samples = [0.0; 6];
    let mut turned = [0.0; 6];
    let recording = Recording::open(&place.path("rec")).unwrap();
    let read = recording.for_each_batch(
        |_| {},
        |batch| {
            for (row, step) in batch.step.iter().enumerate() {
                let input = [2, 5].map(|i: usize| batch.reference[i][row]);
                match step {
                    -1 => assert!(input.iter().all(|x| x.is_nan())),
                    1 | 4 => assert!(input[1].is_nan()),
                    _ => assert_eq!(input, [0.0, 9.8]),
                }
                if let Ok(step) = usize::try_from(*step) {
                    samples[step] += 1.0;
                    turned[step] += input[0] / 1000.0;
                }
            }
            Ok(())
        },
    );
    read.unwrap();
    for (step, length) in [(0, 2000.0), (2, 1000.0), (3, 2000.0), (5, 1000.0)] {
        assert!(
            (0.0..100.0).contains(&(samples[step] - length)),
            "{samples:?}"
        );
    }
    for step in [1, 4] {
        assert!((turned[step] - 90.0_f64).abs() < 1e-6, "{turned:?}");
    }
}

#[test]
fn a_device_that_loses_its_power_ends_it_and_what_stands_is_kept() {
    let place = Place::new();
    let acts = vec![(6_000, Act::Restart)];
    let (equipment, peer) = (
        Equipment::new(&place),
        Peer::new(Script { acts, ..quick() }),
    );
    plan(&place, &format!("{UP}dwell_s = 600.0\n"));
    let ran = mimu(&place, &arguments(&peer, "rec"));
    ran.refused(&["a recording has one power-on", "0 of 1 dwells"]);
    let told = equipment.told();
    assert_eq!(told[told.len() - 2..], ["STOP", "CHAMBER 25.000000"]);
    let manifest = Manifest::read(&place.path("rec/recording.toml")).unwrap();
    assert!(!manifest.unfinished && manifest.recorded.unwrap().restarts.is_empty());
}

#[test]
fn samples_that_are_missing_from_a_turn_take_it_out_of_the_count() {
    let place = Place::new();
    // The turn is by far the longest part: the table is busy for some tenths of a second by the PC's clock, each of them ten seconds here.
    let acts = vec![
        (12_000, Act::Drop),
        (24_000, Act::Drop),
        (36_000, Act::Drop),
    ];
    let script = Script {
        speed: 40.0,
        acts,
        ..quick()
    };
    let (_equipment, peer) = (Equipment::new(&place), Peer::new(script));
    let turn = "[[step]]\nup = [0.0, 0.0, 1.0]\nturn_axis = \"outer\"\nturn_deg = 360.0\nturn_dps = 45.0\n";
    plan(&place, &format!("rounds = 6\n{turn}"));
    let ran = mimu(&place, &arguments(&peer, "rec"));
    let made = ran.json();
    let dropped = made["recorded"]["dropped"].as_array().unwrap().clone();
    assert!(!dropped.is_empty() && dropped.len() < 6, "{made}");
    let manifest = Manifest::read(&place.path("rec/recording.toml")).unwrap();
    assert_eq!(manifest.dropped_steps.len(), dropped.len());
}

#[test]
fn a_pose_that_the_unit_does_not_have_ends_it_and_the_dwell_does_not_count() {
    let place = Place::new();
    let (equipment, peer) = (Equipment::new(&place), Peer::new(quick()));
    plan(&place, "[[step]]\nup = [1.0, 0.0, 0.0]\ndwell_s = 100.0\n");
    let ran = mimu(&place, &arguments(&peer, "rec"));
    ran.refused(&["dwell 0", "by the accelerometer", "+x face up was planned"]);
    assert_eq!(equipment.told().last().unwrap(), "CHAMBER 25.000000");
    let manifest = Manifest::read(&place.path("rec/recording.toml")).unwrap();
    assert_eq!(manifest.dropped_steps, [0]);
}

#[test]
fn an_interrupted_procedure_is_a_recording_that_says_it_is_cut_short() {
    let place = Place::new();
    let (equipment, peer) = (Equipment::new(&place), Peer::new(quick()));
    plan(&place, &format!("{UP}dwell_s = 600.0\n"));
    let mut child = start(&place, &arguments(&peer, "rec"));
    while equipment.told().len() < 5 {
        assert!(child.try_wait().unwrap().is_none(), "it has ended");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let id = rustix::process::Pid::from_child(&child);
    rustix::process::kill_process(id, rustix::process::Signal::INT).unwrap();
    let out = child.wait_with_output().unwrap();
    let told = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(1), "{told}");
    says(&told, &["it was interrupted and is incomplete"]);
    let all = equipment.told();
    assert_eq!(all[all.len() - 2..], ["STOP", "CHAMBER 25.000000"]);
    let manifest = Manifest::read(&place.path("rec/recording.toml")).unwrap();
    assert!(!manifest.unfinished && manifest.dropped_steps.is_empty());
}
