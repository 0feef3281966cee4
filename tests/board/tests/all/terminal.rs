//! The emulated board behind its pseudo-terminal, as seen by a program that opens serial ports.

use std::path::Path;
use std::time::{Duration, Instant};

use mimu_board::front::Front;
use mimu_board::schematic::Volts;
use mimu_board::serve::{Pace, Served};
use mimu_board_tests::{MS, STARTED, still};
use mimu_rig::plan::Plan;
use mimu_rig::rig_file::{RigFile, RigTruth};

#[test]
fn at_the_pace_of_the_wall_a_second_takes_no_less_than_a_second() {
    let mut board = still(Volts::GROUND);
    board.run_to(STARTED).unwrap();
    let mut served = Served::new(board, Pace::Wall, None).unwrap();
    let began = Instant::now();
    while served.board().state().ns < STARTED + 500 * MS {
        served.step().unwrap();
    }
    assert!(began.elapsed() >= Duration::from_millis(500));
}

#[test]
fn the_command_that_the_page_of_the_bench_shows_is_served() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let page = std::fs::read_to_string(root.join("docs/bench.md")).unwrap();
    let with_unit = |l: &&str| l.contains("mimu-board -- serve") && l.contains("--unit");
    let mut commands = page.lines().filter(with_unit);
    let words: Vec<&str> = commands.next().unwrap().split_whitespace().collect();
    assert_eq!(commands.next(), None);
    let option = |name: &str| {
        let at = words.iter().position(|w| *w == name).unwrap();
        words[at + 1]
    };
    let seed: u64 = option("--seed").parse().unwrap();
    let rig = RigFile::read(&root.join(option("--unit"))).unwrap();
    let truth = RigTruth::resolve(&rig, seed).unwrap();
    let plan = Plan::read(&root.join(option("--plan"))).unwrap();
    // A digital part has no voltages for the board's pins, and is refused here.
    Front::bench(&plan, &truth, seed).unwrap();
}
