//! The release image when its program goes wrong: it starts again by itself, samples, and says why it did.
//!
//! The faults are put in the place of an instruction while the program runs, and taken away as soon as it has restarted.

use mimu_board::fault::Fault;
use mimu_board::running::Board;
use mimu_board::schematic::Volts;
use mimu_board_tests::{MS, STARTED, image, still};
use mimu_core::wire::{Decoder, Greeting, Message, Start};

/// What a greeting says of the start.
#[derive(Debug, PartialEq)]
struct Greeted {
    /// `Start::Panic` and `Start::Fault` with their places.
    start: String,
    starts: u32,
}

/// Has `look` see the greeting that the device sends by itself after a start.
fn greeted<T>(board: &mut Board, look: impl Fn(&Greeting<'_>) -> T) -> T {
    let mut decoder = Decoder::new();
    for _ in 0..1000 {
        board.run_for(MS).unwrap();
        for (_, byte) in board.receive() {
            let frame = decoder.push(byte);
            let message = frame.map(|frame| frame.message().expect("a whole message"));
            if let Some(Message::Greeting { greeting, .. }) = message {
                return look(&greeting);
            }
        }
    }
    panic!("no greeting in a second");
}

/// What that greeting says of the start.
fn greeting(board: &mut Board) -> Greeted {
    greeted(board, |greeting| Greeted {
        start: match greeting.start {
            Start::Panic { file, line } => format!("panic {file}:{line}"),
            Start::Fault { pc, cfsr } => format!("fault {pc:#x} {cfsr:#x}"),
            other => format!("{other:?}"),
        },
        starts: greeting.starts,
    })
}

#[test]
fn the_firmware_names_the_commit_that_it_was_built_from() {
    let firmware = greeted(&mut still(Volts::GROUND), |g| g.firmware.to_owned());
    let (version, commit) = match firmware.split_once('-') {
        Some((version, commit)) => (version, Some(commit)),
        // Of sources in no repository.
        None => (firmware.as_str(), None),
    };
    assert_eq!(version, env!("CARGO_PKG_VERSION"));
    if let Some(commit) = commit {
        let hash = commit.strip_suffix("-dirty").unwrap_or(commit);
        let digits = hash.bytes().all(|b| b.is_ascii_hexdigit());
        assert!(hash.len() >= 8 && digits, "{firmware}");
    }
}

/// A board that samples, after its first greeting.
fn sampling() -> Board {
    let mut board = still(Volts::GROUND);
    let first = greeting(&mut board);
    assert_eq!((first.start.as_str(), first.starts), ("PowerOn", 1));
    board.run_for(STARTED).unwrap();
    board
}

/// Puts the fault there and runs until the part restarts: milliseconds until then, the cause as the part has it, and the greeting after
/// it. The device has to sample in step again.
fn restarted(board: &mut Board, address: u64, fault: Fault) -> (u32, String, Greeted) {
    let before = board.restarts().unwrap().len();
    let replaced = board.inject(address, fault).unwrap();
    let mut ms = 0;
    let cause = loop {
        board.run_for(MS).unwrap();
        ms += 1;
        if let Some(restart) = board.restarts().unwrap().get(before) {
            break restart.cause.clone();
        }
        assert!(ms < 10_000, "it does not restart");
    };
    board.heal(replaced).unwrap();
    let greeted = greeting(board);
    board.run_for(STARTED).unwrap();
    board.conversions().unwrap();
    board.run_for(100 * MS).unwrap();
    assert_eq!(board.conversions().unwrap().count, 2000);
    assert_eq!(board.restarts().unwrap().len(), before + 1);
    (ms, cause, greeted)
}

/// The first instruction of a task.
fn task(name: &str) -> u64 {
    let inner = format!("_{name}_task_inner_function0E4poll");
    image().find(&inner).unwrap()
}

/// An instruction of the image from which on it panics: it loads the place of the panic, and calls the panic of a task that is polled
/// after its end, which none is.
fn panics() -> u64 {
    const FLASH: u64 = 0x0800_0000;
    let image = image();
    let panic = image.find("panic_const_async_fn_resumed").unwrap();
    let bytes = still(Volts::GROUND)
        .memory(FLASH, image.sizes().flash as usize)
        .unwrap();
    let half = |at: usize| u32::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]));
    let calls_it = |at: &usize| {
        let (upper, lower) = (half(*at), half(*at + 2));
        // BL, encoding T1 (ARMv7-M A7.7.18).
        let is_call = upper & 0xf800 == 0xf000 && lower & 0xd000 == 0xd000;
        let sign = upper >> 10 & 1;
        let j = |n: u32| lower >> n & 1 ^ sign ^ 1;
        let distance =
            sign << 24 | j(13) << 23 | j(11) << 22 | (upper & 0x3ff) << 12 | (lower & 0x7ff) << 1;
        let distance = (distance as i32) << 7 >> 7;
        // R0 by its halves: MOVW, encoding T3 (A7.7.76), and MOVT (A7.7.79).
        let low = half(*at - 8) & 0xfbf0 == 0xf240 && half(*at - 6) & 0x8f00 == 0;
        let high = half(*at - 4) & 0xfbf0 == 0xf2c0 && half(*at - 2) & 0x8f00 == 0;
        let loads = low && high;
        let target = (FLASH + *at as u64 + 4).wrapping_add_signed(i64::from(distance));
        is_call && loads && target == panic
    };
    let call = (8..bytes.len() - 4).step_by(2).find(calls_it);
    FLASH + call.expect("the image has such a call") as u64 - 8
}

#[test]
fn a_program_that_stands_still_is_bitten_by_the_watchdog() {
    let mut board = sampling();
    // Where samples are processed, then in the interrupt that takes them, which stops everything below it.
    for (starts, name) in [(2, "process"), (3, "sample")] {
        let (ms, cause, greeted) = restarted(&mut board, task(name), Fault::Hang);
        // Fed every 250 ms, and bites 2 s after the last time: a whole number of its clock's 4 ms more.
        assert!((1740..=2010).contains(&ms), "{name}: after {ms} ms");
        assert!(cause.contains("IWDG"), "{name}: {cause}");
        let start = "Watchdog".to_owned();
        assert_eq!(greeted, Greeted { start, starts });
    }
}

#[test]
fn a_fault_restarts_the_device_which_tells_the_instruction() {
    let mut board = sampling();
    let at = task("process");
    let (ms, cause, greeted) = restarted(&mut board, at, Fault::Undefined);
    assert!(ms <= 2 && cause == "Core", "{cause} after {ms} ms");
    // UFSR.UNDEFINSTR (ARMv7-M B3.2.15).
    let start = format!("fault {at:#x} {:#x}", 1 << 16);
    assert_eq!(greeted, Greeted { start, starts: 2 });
    // Of a next one it tells the next.
    let at = task("sample");
    let (_, _, greeted) = restarted(&mut board, at, Fault::Undefined);
    let start = format!("fault {at:#x} {:#x}", 1 << 16);
    assert_eq!(greeted, Greeted { start, starts: 3 });
}

#[test]
fn a_panic_restarts_the_device_which_tells_the_line() {
    let mut board = sampling();
    let (ms, cause, greeted) = restarted(&mut board, task("process"), Fault::Jump(panics()));
    assert!(ms <= 2 && cause == "Core", "{cause} after {ms} ms");
    assert_eq!(greeted.starts, 2);
    let place = greeted.start.strip_prefix("panic ").expect("a panic");
    let (file, line) = place.rsplit_once(':').unwrap();
    // The file is one of the firmware's, and the line is one that it has.
    let file = file
        .rsplit_once("firmware/")
        .expect("a file of the firmware")
        .1;
    let path = format!("{}/../../firmware/{file}", env!("CARGO_MANIFEST_DIR"));
    let lines = std::fs::read_to_string(&path).unwrap().lines().count();
    assert!((1..=lines).contains(&line.parse().unwrap()), "{place}");
    // The reset pin after it is not taken for the panic again.
    board.reset_by_pin(1).unwrap();
    let greeted = greeting(&mut board);
    assert_eq!((greeted.start.as_str(), greeted.starts), ("ResetPin", 3));
}
