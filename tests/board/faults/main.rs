//! Faults and mistakes during a session of the wizard: each session must end with a calibration that contains the truth, or stop with a reason.
//! Prints a line for each.
//!
//! `faults [nucleo|matek] [NAME ...]`: without names, all of them.

mod mistakes;
mod run;
mod session;
mod text;
mod text_mistakes;

use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use mimu_board::commanded::{Commanded, Kind};
use run::Ended;
use session::{Bench, WizardSession};

/// Errors above these mean a wrong calibration: several times the errors from dwells of one second. deg/s, mg.
const RIGHT: [f64; 2] = [0.3, 3.0];
/// How often the command is killed in one session.
const KILLS: usize = 50;

/// To the Matek, its sensor's clock is 1 % fast.
const MATEK: Kind = Kind::Matek { crystal: 0.99 };

type OfOurs = fn(Bench<'_>) -> Result<Ended, String>;
type OfText = fn(&Path) -> Result<Ended, String>;

/// With a board of ours.
const OURS: &[(&str, OfOurs)] = &[
    ("nothing", nothing),
    ("by-device", by_device),
    ("garbled", garbled),
    ("bursts", bursts),
    ("link", link),
    ("reset", reset),
    ("supply", supply),
    ("killed", killed),
    ("other-unit", other_unit),
    ("drift", drift),
    ("wrong-axis", wrong_axis),
    ("fidget", fidget),
    ("any-order", any_order),
    ("hands", hands),
    ("hands-fixed", hands_fixed),
    ("z-inverted", mistakes::board_z_inverted),
    ("gyro-swapped", mistakes::board_gyro_swapped),
    ("table-z-inv", mistakes::table_z_inverted),
    ("changed-flag", mistakes::changed_flag),
    ("early-yes", mistakes::early_yes),
    ("table-250", mistakes::table_250),
];

/// With a board of another maker, which writes lines.
const TEXT: &[(&str, OfText)] = &[
    ("text", text_mistakes::text_nothing),
    ("text-z-inv", text_mistakes::text_z_inverted),
    ("text-negated", text_mistakes::text_negated),
    ("text-x-y", text_mistakes::text_x_for_y),
    ("text-gyro-x-y", text_mistakes::text_gyro_swapped),
    ("text-in-dps", text_mistakes::text_in_dps),
    ("text-in-g", text_mistakes::text_in_g),
    ("text-us-as-ms", text_mistakes::text_us_for_ms),
    ("text-ms-as-us", text_mistakes::text_ms_for_us),
    ("text-clock", text_mistakes::text_clock),
    ("text-dropped", text_mistakes::text_dropped),
    ("text-garbled", text_mistakes::text_garbled),
    ("text-coarse", text_mistakes::text_coarse),
    ("text-columns", text_mistakes::text_columns_swapped),
    ("text-cubic", text_mistakes::text_cubic),
    ("text-again", text_mistakes::text_again),
    ("text-units", text_mistakes::text_units),
];

fn main() -> ExitCode {
    let mut names: Vec<String> = std::env::args().skip(1).collect();
    let kind = match names.first().map(String::as_str) {
        Some("nucleo") => Some(Kind::Nucleo),
        Some("matek") => Some(MATEK),
        _ => None,
    };
    if kind.is_some() {
        names.remove(0);
    }
    let kind = kind.unwrap_or(Kind::Nucleo);
    println!(
        "{:14} {:>6} {:>7} {:>6} {:>6} {:>6}  outcome",
        "fault", "s", "unit s", "dwells", "discarded", "broken"
    );
    let wanted = |name: &str| names.is_empty() || names.iter().any(|n| n == name);
    let mut wrong = 0;
    for (name, scenario) in OURS.iter().filter(|(name, _)| wanted(name)) {
        wrong += usize::from(!ended_right(name, |folder| {
            scenario(Bench { kind, folder })
        }));
    }
    // They do not depend on our board.
    let text = if kind == Kind::Nucleo { TEXT } else { &[] };
    for (name, scenario) in text.iter().filter(|(name, _)| wanted(name)) {
        wrong += usize::from(!ended_right(name, scenario));
    }
    match wrong {
        0 => ExitCode::SUCCESS,
        _ => ExitCode::FAILURE,
    }
}

/// Plays a scenario in a folder of its own, prints a line, and returns whether nothing wrong is stored.
fn ended_right(name: &str, scenario: impl FnOnce(&Path) -> Result<Ended, String>) -> bool {
    let folder = tempfile::tempdir().map_err(|e| e.to_string());
    match folder.and_then(|folder| scenario(folder.path())) {
        Ok(ended) => report(name, &ended),
        Err(problem) => {
            println!("{name:14} {problem}");
            false
        }
    }
}

/// Prints a line and returns whether nothing wrong is stored.
fn report(name: &str, ended: &Ended) -> bool {
    let outcome = match (ended.stored, &ended.stopped) {
        (Some([gyro, accel]), _) => format!(
            "stored, errs by {gyro:.3} deg/s and {accel:.2} mg; {}",
            ended.verdict
        ),
        (None, Some(why)) => format!("stopped, nothing stored: {why}"),
        (None, None) => format!("nothing stored; {}", ended.verdict),
    };
    let recorded = ended.recorded_s.map_or("-".into(), |s| format!("{s:.0}"));
    println!(
        "{name:14} {:6.0} {recorded:>7} {:6} {:6} {:6}  {outcome}",
        ended.seconds, ended.dwells, ended.discarded, ended.interrupted
    );
    for note in &ended.notes {
        println!("{:14} note: {note}", "");
    }
    let right = |e: [f64; 2]| e[0] < RIGHT[0] && e[1] < RIGHT[1];
    ended.stored.is_none_or(right)
}

const TABLE: [&str; 9] = [
    "--fixture",
    "table",
    "--driver",
    "driver.toml",
    "--dwell",
    "1",
    "--rate",
    "60",
    "--as-planned",
];

fn on_table(seed: u64, bench: Bench<'_>) -> Result<WizardSession, String> {
    let mut session = WizardSession::new("table", seed, bench, &TABLE)?;
    session.run()?;
    Ok(session)
}

fn nothing(bench: Bench<'_>) -> Result<Ended, String> {
    on_table(1, bench)?.end()
}

fn by_device(bench: Bench<'_>) -> Result<Ended, String> {
    let arguments = [&TABLE[..], &["--by", "device"]].concat();
    let mut session = WizardSession::new("table", 2, bench, &arguments)?;
    session.run()?;
    session.end()
}

fn garbled(bench: Bench<'_>) -> Result<Ended, String> {
    let mut session = on_table(3, bench)?;
    session.board.tell("GARBLE 1000")?;
    session.end()
}

/// Does something after every few dwells, several times.
fn now_and_then(
    bench: Bench<'_>,
    seed: u64,
    times: usize,
    mut strike: impl FnMut(&mut Commanded) -> Result<(), String>,
) -> Result<Ended, String> {
    let mut session = on_table(seed, bench)?;
    for k in 1..=times {
        // Later ones would also strike verification and store, which have fewer dwells.
        if !session.wait_for(|s| s.told("step") >= 2 * k)? {
            let why = session.end()?.stopped.unwrap_or_default();
            return Err(format!("it ended after {} of {times}: {why}", k - 1));
        }
        strike(&mut session.board)?;
    }
    session.end()
}

fn bursts(bench: Bench<'_>) -> Result<Ended, String> {
    now_and_then(bench, 4, 10, |board| board.tell("BURST 200"))
}

fn link(bench: Bench<'_>) -> Result<Ended, String> {
    now_and_then(bench, 5, 10, |board| {
        board.tell("LINK OFF")?;
        std::thread::sleep(Duration::from_millis(300));
        board.tell("LINK ON")
    })
}

fn reset(bench: Bench<'_>) -> Result<Ended, String> {
    now_and_then(bench, 6, 2, |board| board.tell("RESET"))
}

fn supply(bench: Bench<'_>) -> Result<Ended, String> {
    now_and_then(bench, 7, 2, |board| {
        board.tell("POWER OFF")?;
        std::thread::sleep(Duration::from_millis(300));
        board.tell("POWER ON")
    })
}

fn killed(bench: Bench<'_>) -> Result<Ended, String> {
    let mut session = on_table(8, bench)?;
    let mut kills = 0;
    // Times independent of its work, a third of a second to three seconds after each start.
    for k in 0..4 * KILLS {
        let wait = 0.3 + 2.7 * (k as f64 * 0.618_034).fract();
        std::thread::sleep(Duration::from_secs_f64(wait));
        if kills == KILLS {
            break;
        }
        if !session.kill()? {
            break;
        }
        kills += 1;
        // Once in five it gets further; otherwise no dwell would ever end.
        if kills % 5 == 0 {
            session.run()?;
            session.wait_for(|s| s.told("dwell") >= 1)?;
        } else {
            session.run()?;
        }
    }
    let mut ended = session.end()?;
    ended.notes.push(format!("killed {kills} times"));
    Ok(ended)
}

fn other_unit(bench: Bench<'_>) -> Result<Ended, String> {
    let mut session = on_table(9, bench)?;
    session.wait_for(|s| s.told("dwell") >= 3)?;
    session.board.tell("LINK OFF")?;
    let other_folder = bench.folder.join("other");
    let image = mimu_board_tests::image_of(bench.kind);
    let mut other = Commanded::start(
        bench.kind,
        &image,
        "table",
        &bench.unit(99, "table")?,
        99,
        [9; 12],
        &other_folder,
    )?;
    // Plugged into the same port.
    let port = std::fs::read_link(other_folder.join("port")).map_err(|e| e.to_string())?;
    let link = bench.folder.join("port");
    std::os::unix::fs::symlink(port, &link).map_err(|e| e.to_string())?;
    let before = session.told("interrupted");
    session.wait_for(|s| s.told("interrupted") > before)?;
    std::thread::sleep(Duration::from_secs(3));
    let dwells = session.told("dwell");
    other.tell("LINK OFF")?;
    std::fs::remove_file(&link).map_err(|e| e.to_string())?;
    session.board.tell("LINK ON")?;
    let mut ended = session.end()?;
    ended
        .notes
        .push(format!("{dwells} dwells when the right unit was back"));
    Ok(ended)
}

fn drift(bench: Bench<'_>) -> Result<Ended, String> {
    let mut session = on_table(10, bench)?;
    session.board.tell("CHAMBER 70 20")?;
    session.end()
}

fn wrong_axis(bench: Bench<'_>) -> Result<Ended, String> {
    let arguments = [&TABLE[..], &["--patience", "10"]].concat();
    let mut session = WizardSession::new("table", 11, bench, &arguments)?;
    let path = bench.folder.join("driver.toml");
    let driver = std::fs::read_to_string(&path).map_err(|e| e.to_string())?;
    let driver = driver.replace("{x} {y} {z}", "{y} {z} {x}");
    std::fs::write(&path, driver).map_err(|e| e.to_string())?;
    session.run()?;
    session.end()
}

const HANDS: [&str; 6] = [
    "--fixture",
    "hands",
    "--driver",
    "driver.toml",
    "--dwell",
    "2",
];

fn fidget(bench: Bench<'_>) -> Result<Ended, String> {
    let mut session = WizardSession::new("hands", 12, bench, &HANDS)?;
    session.board.tell("FIDGET 3")?;
    session.run()?;
    session.end()
}

/// A person who first takes the faces, edges and corners of a box in their own order, and only then follows the requests.
fn any_order(bench: Bench<'_>) -> Result<Ended, String> {
    let mut session =
        WizardSession::new("hands", 13, bench, &["--fixture", "hands", "--dwell", "2"])?;
    session.run()?;
    let mut poses = Vec::new();
    for x in [-1, 0, 1] {
        for y in [1, 0, -1] {
            for z in [0, -1, 1] {
                if [x, y, z] != [0; 3] {
                    poses.push(format!("MOVE {x} {y} {z}"));
                }
            }
        }
    }
    // Turning the unit during its self-test would end the session.
    session.wait_for(|s| s.told("step") > 0)?;
    let mut next = 0;
    while next < 4 * poses.len() {
        let had = session.told("dwell");
        let pose = match next < poses.len() {
            true => poses[(7 * next) % poses.len()].clone(),
            false => session.asked_pose()?,
        };
        session.board.tell(&pose)?;
        next += 1;
        let asked = std::time::Instant::now();
        let patience = Duration::from_secs(12);
        let goes_on = session.wait_for(|s| s.told("dwell") > had || asked.elapsed() > patience)?;
        if !goes_on {
            break;
        }
    }
    let mut ended = session.end()?;
    ended.notes.push(format!("{next} poses were shown"));
    Ok(ended)
}

fn hands(bench: Bench<'_>) -> Result<Ended, String> {
    let mut session = WizardSession::new("hands", 14, bench, &HANDS)?;
    session.run()?;
    session.end()
}

/// The same person with all planned poses, even if fewer would suffice.
fn hands_fixed(bench: Bench<'_>) -> Result<Ended, String> {
    let arguments = [&HANDS[..], &["--as-planned"]].concat();
    let mut session = WizardSession::new("hands", 14, bench, &arguments)?;
    session.run()?;
    session.end()
}
