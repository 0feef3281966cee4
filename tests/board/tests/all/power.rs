//! The stored calibration after a supply cut at any time, and after a bit flip.

use mimu_board::flash::Change;
use mimu_board::inertial::Sensed;
use mimu_board::running::Board;
use mimu_board::schematic::Volts;
use mimu_board::serve::{Pace, Served};
use mimu_board_tests::conversation::{Answer, Conversation};
use mimu_board_tests::{MS, digital_image, still};
use mimu_core::PerSensor;
use mimu_core::compensation::{Affine, Compensation};
use mimu_core::stored::{self, Curves};
use mimu_core::table::Node;
use mimu_core::wire::{Call, Decoder, MAX_FRAME, Message, Refusal, Request, encode};
use nalgebra::{Matrix3, Vector3};

/// A calibration with this many temperature nodes, distinct for each `scale`.
pub fn calibration(nodes: u32, scale: f32) -> Vec<u8> {
    calibration_of(&stored::Origin::UNKNOWN, nodes, scale)
}

/// The same for a certain unit.
fn calibration_of(origin: &stored::Origin, nodes: u32, scale: f32) -> Vec<u8> {
    let affine = |k: u32| Affine {
        matrix: Matrix3::from_diagonal_element(scale + k as f32 * 0.001),
        offset: Vector3::repeat(-2.5 * scale),
    };
    let node = |k| {
        let model = Compensation {
            gyro: affine(k),
            accel: affine(k),
        };
        Node::constant(10.0 * k as f32, model)
    };
    let nodes: Vec<_> = (0..nodes).map(node).collect();
    let found_with = Matrix3::identity();
    let mut bytes = vec![0; stored::MAX_LENGTH];
    let (matrices, curves) = (PerSensor::both(&found_with), Curves::of(&nodes));
    let length = stored::encode(origin, matrices, &curves, &[], &mut bytes).unwrap();
    bytes.truncate(length);
    bytes
}

/// A board whose supply is cut.
#[derive(Debug, Clone, Copy)]
enum Kind {
    Nucleo,
    Matek,
}

impl Kind {
    /// At rest.
    fn board(self) -> Board {
        let at_rest = |_| Sensed {
            rate_dps: [0.0; 3],
            force_g: [0.0, 0.0, 1.0],
            die_c: 25.0,
        };
        match self {
            Self::Nucleo => still(Volts::GROUND),
            Self::Matek => {
                Board::digital(&digital_image(), Box::new(at_rest), 1.0, [7; 12]).unwrap()
            }
        }
    }

    /// A calibration of its raw unit, distinct for each `scale`.
    fn calibration(self, nodes: u32, scale: f32) -> Vec<u8> {
        let origin = match self {
            Self::Nucleo => stored::Origin::UNKNOWN,
            Self::Matek => stored::Origin {
                raw_unit: Some(stored::RawUnit::Count),
                ..stored::Origin::UNKNOWN
            },
        };
        calibration_of(&origin, nodes, scale)
    }
}

/// A device with the old calibration, which it has confirmed.
fn with_old(old: &[u8]) -> Conversation {
    on_board_with_old(Kind::Nucleo, old)
}

fn on_board_with_old(kind: Kind, old: &[u8]) -> Conversation {
    let mut device = Conversation::new(kind.board());
    device.greeting();
    device.upload(old);
    assert_eq!(device.ask(Request::UploadCommit), Answer::Done);
    device
}

/// Timing of the flash operations while the new calibration is uploaded and committed, ns.
struct Course {
    began: u64,
    committed: u64,
    done: u64,
    /// Time slices in which a word was programmed.
    words: Vec<u64>,
}

/// Carries out upload and commit once.
fn course(kind: Kind, old: &[u8], new: &[u8]) -> Course {
    let mut device = on_board_with_old(kind, old);
    let began = device.board.state().ns;
    device.upload(new);
    let committed = device.board.state().ns;
    let id = device.send(Request::UploadCommit);
    let mut words = Vec::new();
    while device.answer(id).is_none() {
        // Half the programming time of a word, so that none is missed.
        device.run_for(MS / 20);
        let at = device.board.state().ns;
        let operations = device.board.in_flight().unwrap();
        if operations
            .iter()
            .any(|o| matches!(o.change, Change::Program(_)))
        {
            words.push(at);
        }
        assert!(at < committed + 20_000 * MS, "no answer to the commit");
    }
    Course {
        began,
        committed,
        done: device.board.state().ns,
        words,
    }
}

/// Times of the cuts: evenly over the whole and slightly beyond, and evenly over the words.
fn instants(course: &Course, cuts: usize) -> Vec<u64> {
    let in_words = cuts / 2;
    let even = cuts - in_words;
    let whole = course.done + 20 * MS - course.began;
    let over_all = (0..even).map(|k| course.began + whole * k as u64 / (even as u64 - 1));
    let over_words = (0..in_words).map(|k| {
        let slice = course.words[k * (course.words.len() - 1) / (in_words - 1)];
        // In different phases of a word.
        slice + (k as u64 * 7919) % (MS / 20)
    });
    let mut all: Vec<u64> = over_all.chain(over_words).collect();
    all.sort_unstable();
    all
}

/// Starts the device with the contents after a cut, and asks for its calibration.
fn after(device: &mut Conversation, store: Vec<u8>, seed: u64) -> (Option<u64>, Option<Vec<u8>>) {
    device.board.cut_supply(seed).unwrap();
    device.run_for(MS);
    device.board.set_store(store).unwrap();
    device.board.restore_supply().unwrap();
    let Answer::Greeting { hash, .. } = device.greeting() else {
        panic!("no greeting");
    };
    (hash, device.download())
}

#[test]
fn a_served_board_starts_with_the_calibration_that_its_file_holds() {
    let bytes = calibration(7, 3.5);
    let mut device = with_old(&bytes);
    let Answer::Greeting { hash, .. } = device.ask(Request::Hello) else {
        panic!("no greeting");
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("unit.flash");
    std::fs::write(&path, device.board.store().unwrap()).unwrap();

    let mut served = Served::new(still(Volts::GROUND), Pace::Fast, Some(&path)).unwrap();
    served.start().unwrap();
    let mut frame = [0; MAX_FRAME];
    let request = Request::Hello;
    let length = encode(&Call { id: 7, request }, &mut frame).unwrap();
    let board = served.board();
    board.send(&frame[..length]);
    let mut decoder = Decoder::new();
    let stored = (0..1000).find_map(|_| {
        board.run_for(MS).unwrap();
        board.receive().into_iter().find_map(|(_, byte)| {
            match decoder.push(byte).and_then(|frame| frame.message()) {
                Some(Message::Greeting { id: 7, greeting }) => {
                    Some(greeting.stored.map(|stored| stored.hash))
                }
                _ => None,
            }
        })
    });
    assert_eq!(stored, Some(hash));
}

#[test]
#[ignore = "nightly: 300 starts of each board"]
fn at_each_of_300_instants_the_old_or_the_new_calibration_is_there_whole() {
    cut_at_instants(Kind::Nucleo, 300);
    cut_at_instants(Kind::Matek, 300);
}

/// Cuts the supply at `cuts` times. Half of them are during the programming of words, which takes a hundredth of the time.
fn cut_at_instants(kind: Kind, cuts: usize) {
    let (old, new) = (kind.calibration(7, 3.5), kind.calibration(16, 3.6));
    let course = course(kind, &old, &new);
    assert!(!course.words.is_empty());

    // The same run again. It is identical up to each cut, and the flash contents after a cut do not depend on later events.
    let mut device = on_board_with_old(kind, &old);
    assert_eq!(device.board.state().ns, course.began);
    device.upload(&new);
    assert_eq!(device.board.state().ns, course.committed);
    let mut stores = Vec::new();
    let all = instants(&course, cuts);
    // The upload itself changes nothing in flash: the contents after a cut in it equal those at its end.
    let (uploading, committing): (Vec<u64>, Vec<u64>) =
        all.iter().partition(|&&at| at <= course.committed);
    for &at in &uploading {
        stores.push((at, device.board.store().unwrap()));
    }
    device.send(Request::UploadCommit);
    for (k, &at) in committing.iter().enumerate() {
        device.board.run_to(at).unwrap();
        stores.push((at, device.board.store_if_cut(k as u64).unwrap()));
    }
    assert_eq!(stores.len(), cuts);

    // Two boards, because most machines that run this have two cores.
    let judge = |part: &[(u64, Vec<u8>)]| judge(kind, &course, [&old, &new], part);
    let (first, second) = stores.split_at(stores.len() / 2);
    let outcomes = std::thread::scope(|scope| {
        let second = scope.spawn(|| judge(second));
        [judge(first), second.join().unwrap()].concat()
    });
    assert!(outcomes.iter().any(|o| o.1) && outcomes.iter().any(|o| !o.1));
    let new = outcomes.iter().filter(|o| o.1).count();
    println!(
        "{cuts} cuts: {} left the old calibration, {new} the new one, none anything else",
        cuts - new
    );
}

/// Starts a device with the contents after each cut. Returns the times and whether the device has the new calibration.
///
/// # Panics
///
/// If it has neither the old calibration nor the new one, or the wrong one of them.
fn judge(
    kind: Kind,
    course: &Course,
    [old, new]: [&[u8]; 2],
    stores: &[(u64, Vec<u8>)],
) -> Vec<(u64, bool)> {
    let hashes = [old, new].map(stored::hash);
    let mut device = Conversation::new(kind.board());
    device.greeting();
    let mut outcomes = Vec::new();
    let mut last: Option<&(u64, Vec<u8>)> = None;
    for cut in stores {
        let (at, store) = cut;
        // If the flash has not changed, the result is known already.
        if last.is_some_and(|last| last.1 == *store) {
            let is_new = outcomes.last().is_some_and(|o: &(u64, bool)| o.1);
            outcomes.push((*at, is_new));
            continue;
        }
        last = Some(cut);
        let (hash, bytes) = after(&mut device, store.clone(), *at);
        let is_new = match hash {
            Some(hash) if hash == hashes[0] => false,
            Some(hash) if hash == hashes[1] => true,
            other => panic!("cut at {at} ns: calibration {other:?}, not {hashes:?}"),
        };
        assert_eq!(bytes.as_deref(), Some(if is_new { new } else { old }));
        outcomes.push((*at, is_new));
    }
    for &(at, is_new) in &outcomes {
        assert!(
            is_new || at < course.done,
            "cut at {at} ns, after the answer"
        );
        assert!(
            !is_new || at > course.committed,
            "cut at {at} ns, before the commit"
        );
    }
    assert_eq!(device.board.findings().unwrap().broken, [""; 0]);
    outcomes
}

#[test]
#[ignore = "nightly: seconds of the board; by day `slots` of the firmware loses its supply at every word"]
fn a_failing_supply_is_no_time_to_store_and_the_old_calibration_stays() {
    let (old, new) = (calibration(7, 3.5), calibration(16, 3.6));
    let mut device = with_old(&old);
    device.upload(&new);
    device.board.set_supply(2_700).unwrap();
    let before = device.board.store().unwrap();
    let low = Answer::Refused(Refusal::SupplyLow);
    assert_eq!(device.ask(Request::UploadCommit), low);
    assert!(
        device.board.store().unwrap() == before,
        "something was written"
    );
    // It fails while the sector is erased: no word is programmed after that.
    device.board.set_supply(3_300).unwrap();
    let id = device.send(Request::UploadCommit);
    device.run_for(500 * MS);
    device.board.set_supply(2_700).unwrap();
    let answer = std::iter::repeat_with(|| {
        device.run_for(100 * MS);
        device.answer(id)
    });
    assert_eq!(answer.take(50).find_map(|answer| answer), Some(low));
    assert_eq!(device.download().as_ref(), Some(&old));
    device.board.set_supply(3_300).unwrap();
    assert_eq!(device.ask(Request::UploadCommit), Answer::Done);
    assert_eq!(device.download(), Some(new));
}

#[test]
#[ignore = "nightly: a part that nobody has swapped"]
fn with_swapped_banks_nothing_is_erased() {
    let old = calibration(7, 3.5);
    let mut device = with_old(&old);
    device.board.swap_banks(true).unwrap();
    device.board.reset_by_pin(1).unwrap();
    device.greeting();
    device.upload(&calibration(16, 3.6));
    let before = device.board.store().unwrap();
    let swapped = Answer::Refused(Refusal::BanksSwapped);
    assert_eq!(device.ask(Request::UploadCommit), swapped);
    assert!(
        device.board.store().unwrap() == before,
        "something was written"
    );
}

/// During the erase of a sector samples continue and feed the watchdog, so only a time limit can end it.
#[test]
#[ignore = "nightly: seconds of a flash that hangs"]
fn flash_that_hangs_is_reported_and_the_old_calibration_stays_in_use() {
    let old = calibration(7, 3.5);
    let mut device = with_old(&old);
    device.upload(&calibration(16, 3.6));
    device.board.stop_flash().unwrap();
    let began = device.board.state().ns;
    let failed = Answer::Refused(Refusal::FlashFailed);
    assert_eq!(device.ask(Request::UploadCommit), failed);
    // The data sheet's maximum for a sector is 4 s (DS12110, table 140); the host waits for 15 s.
    let took = device.board.state().ns - began;
    assert!((4_000 * MS..8_000 * MS).contains(&took), "{took} ns");
    // While the operation has not ended, another upload is refused at once, and nothing restarts.
    let began = device.board.state().ns;
    assert_eq!(device.ask(Request::UploadCommit), failed);
    assert!(device.board.state().ns - began < 100 * MS);
    let Answer::Greeting { hash, start } = device.ask(Request::Hello) else {
        panic!("no greeting");
    };
    assert_eq!(
        (hash, start.as_str()),
        (Some(stored::hash(&old)), "PowerOn")
    );
}
