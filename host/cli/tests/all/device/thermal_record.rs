//! `mimu thermal record` with a scripted device, which lies with z up, and a table and a chamber that record their commands.

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use mimu_core::wire::Start;
use mimu_recording::Manifest;

use super::peer::{Peer, Script};
use super::{Place, mimu};

/// A table with a chamber behind a TCP address; it reports busy for two queries after each motion.
struct Equipment {
    told: Arc<Mutex<Vec<String>>>,
    /// Set in its fourth motion, which lasts until it is taken.
    lose: Arc<AtomicBool>,
}

fn answer(stream: TcpStream, told: &Mutex<Vec<String>>, lose: &AtomicBool) {
    let (mut busy, mut motions, mut chamber) = (0, 0, "21.5".to_owned());
    let mut out = stream.try_clone().unwrap();
    for line in BufReader::new(stream).lines().map_while(Result::ok) {
        let answer = match line.as_str() {
            "INTERLOCK?" => "1".into(),
            "CHAMBER?" => format!("T={chamber} C"),
            "BUSY?" => {
                let waits = lose.load(Ordering::Relaxed);
                busy = (busy - i32::from(!waits)).max(0);
                i32::from(busy > 0).to_string()
            }
            _ => {
                if let Some(temp_c) = line.strip_prefix("CHAMBER ") {
                    temp_c.clone_into(&mut chamber);
                } else {
                    (busy, motions) = (3, motions + 1);
                    lose.fetch_or(motions == 4, Ordering::Relaxed);
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
        let lose = Arc::default();
        let keep = (told.clone(), Arc::clone(&lose));
        // It ends with the test.
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                answer(stream, &keep.0, &keep.1);
            }
        });
        Self { told, lose }
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
fn samples_that_are_missing_from_a_turn_take_it_out_of_the_count() {
    let place = Place::new();
    let equipment = Equipment::new(&place);
    let script = Script {
        speed: 40.0,
        lose: equipment.lose.clone(),
        ..quick()
    };
    let peer = Peer::new(script);
    let turn = "[[step]]\nup = [0.0, 0.0, 1.0]\nturn_axis = \"outer\"\nturn_deg = 360.0\nturn_dps = 45.0\n";
    plan(&place, &format!("rounds = 6\n{turn}"));
    let ran = mimu(&place, &arguments(&peer, "rec"));
    let made = ran.json();
    let dropped = made["recorded"]["dropped"].as_array().unwrap().clone();
    assert_eq!(dropped.len(), 1, "{made}");
    let manifest = Manifest::read(&place.path("rec/recording.toml")).unwrap();
    assert_eq!(manifest.dropped_steps.len(), 1);
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
