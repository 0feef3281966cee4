//! The release image when its program fails: it restarts, samples, and reports the reason.
//!
//! The faults replace an instruction while the program runs, and are removed as soon as it has restarted.

use mimu_board::fault::Fault;
use mimu_board::inertial::Other;
use mimu_board::running::Board;
use mimu_board::schematic::Volts;
use mimu_board_tests::{MS, STARTED, digital_image, image, still};
use mimu_core::wire::{
    Call, Decoder, Greeting, MAX_FRAME, Message, Request, Start, WrongRegister, encode,
};

/// The start as reported in a greeting.
#[derive(Debug)]
struct Greeted {
    /// `Start::Panic` and `Start::Fault` with their places.
    start: String,
    starts: u32,
    /// Time since power-on when sampling began.
    powered_for_ms: Option<u32>,
}

impl Greeted {
    fn told(&self) -> (&str, u32) {
        (&self.start, self.starts)
    }
}

/// Calls `look` with the greeting that the device sends after a start.
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

/// The start as reported in that greeting.
fn greeting(board: &mut Board) -> Greeted {
    greeted(board, |greeting| Greeted {
        start: match greeting.start {
            Start::Panic { file, line } => format!("panic {file}:{line}"),
            Start::Fault { pc, cfsr } => format!("fault {pc:#x} {cfsr:#x}"),
            other => format!("{other:?}"),
        },
        starts: greeting.starts,
        powered_for_ms: greeting.powered_for_ms,
    })
}

#[test]
fn the_firmware_names_the_commit_that_it_was_built_from() {
    let firmware = greeted(&mut still(Volts::GROUND), |g| g.firmware.to_owned());
    let (version, commit) = match firmware.split_once('-') {
        Some((version, commit)) => (version, Some(commit)),
        // The sources were in no repository.
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
    assert_eq!(first.told(), ("PowerOn", 1));
    board.run_for(STARTED).unwrap();
    board
}

/// Inserts the fault and runs until the part restarts. Returns the milliseconds until then, the cause according to the part, and the next greeting.
/// The device must sample in step again.
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
        assert!(ms < 25_000, "it does not restart");
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

/// Address of an instruction from which on the image panics: it loads the source location and calls the panic for a task that is polled after its
/// end, which never happens.
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
        // The two halves of R0: MOVW, encoding T3 (A7.7.76), and MOVT (A7.7.79).
        let low = half(*at - 8) & 0xfbf0 == 0xf240 && half(*at - 6) & 0x8f00 == 0;
        let high = half(*at - 4) & 0xfbf0 == 0xf2c0 && half(*at - 2) & 0x8f00 == 0;
        let loads = low && high;
        let target = (FLASH + *at as u64 + 4).wrapping_add_signed(i64::from(distance));
        is_call && loads && target == panic
    };
    // The source location that it loads, because dependencies contain such calls as well.
    let of_firmware = |at: &usize| {
        let part = |upper: u32, lower: u32| {
            (upper & 0xf) << 12 | (upper >> 10 & 1) << 11 | (lower >> 12 & 7) << 8 | (lower & 0xff)
        };
        let place = part(half(*at - 8), half(*at - 6)) | part(half(*at - 4), half(*at - 2)) << 16;
        let word = |address: u64| {
            let from = usize::try_from(address.checked_sub(FLASH)?).ok()?;
            let four = bytes.get(from..)?.first_chunk()?;
            Some(u64::from(u32::from_le_bytes(*four)))
        };
        let file = word(u64::from(place)).zip(word(u64::from(place) + 4));
        let file = file.and_then(|(from, length)| {
            let from = usize::try_from(from.checked_sub(FLASH)?).ok()?;
            bytes.get(from..from.checked_add(length as usize)?)
        });
        file.is_some_and(|name| String::from_utf8_lossy(name).contains("firmware/src"))
    };
    let mut calls = (8..bytes.len() - 4).step_by(2).filter(calls_it);
    let call = calls.find(of_firmware);
    FLASH + call.expect("the image has such a call") as u64 - 8
}

#[test]
fn a_program_that_stands_still_is_bitten_by_the_watchdog() {
    let mut board = sampling();
    // In the task that processes samples, then in the interrupt that takes them, which blocks everything of lower priority.
    for (starts, name) in [(2, "process"), (3, "sample")] {
        let (ms, cause, greeted) = restarted(&mut board, task(name), Fault::Hang);
        // The watchdog is fed every 250 ms, first a quarter of a second after the start of sampling, and resets 2 s after the last time.
        assert!((1650..=2010).contains(&ms), "{name}: after {ms} ms");
        assert!(cause.contains("IWDG"), "{name}: {cause}");
        assert_eq!(greeted.told(), ("Watchdog", starts));
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
    assert_eq!(greeted.told(), (start.as_str(), 2));
    // The next fault is reported with its own address.
    let at = task("sample");
    let (_, _, greeted) = restarted(&mut board, at, Fault::Undefined);
    let start = format!("fault {at:#x} {:#x}", 1 << 16);
    assert_eq!(greeted.told(), (start.as_str(), 3));
}

#[test]
fn a_panic_restarts_the_device_which_tells_the_line() {
    let mut board = sampling();
    let (ms, cause, greeted) = restarted(&mut board, task("process"), Fault::Jump(panics()));
    assert!(ms <= 2 && cause == "Core", "{cause} after {ms} ms");
    assert_eq!(greeted.starts, 2);
    let place = greeted.start.strip_prefix("panic ").expect("a panic");
    let (file, line) = place.rsplit_once(':').unwrap();
    // The file and the line exist in the firmware.
    let file = file
        .rsplit_once("firmware/")
        .expect("a file of the firmware")
        .1;
    let path = format!("{}/../../firmware/{file}", env!("CARGO_MANIFEST_DIR"));
    let lines = std::fs::read_to_string(&path).unwrap().lines().count();
    assert!((1..=lines).contains(&line.parse().unwrap()), "{place}");
    // After a pin reset the old panic is not reported again.
    board.reset_by_pin(1).unwrap();
    let greeted = greeting(&mut board);
    assert_eq!(greeted.told(), ("ResetPin", 3));
}

/// The guard below the stack: the fault is told, and the static memory below it is as it was.
#[test]
#[ignore = "nightly: another fault; by day an undefined instruction"]
fn a_stack_that_overflows_is_a_fault_of_its_own_and_clobbers_nothing() {
    let mut board = sampling();
    let (ms, cause, greeted) = restarted(&mut board, task("process"), Fault::Push);
    // 480 KiB at 32 bytes for two instructions take less than a millisecond.
    assert!(ms <= 3 && cause == "Core", "{cause} after {ms} ms");
    assert_eq!(greeted.starts, 2);
    let place = greeted.start.strip_prefix("fault ").expect("a fault");
    let (_, cfsr) = place.split_once(" 0x").unwrap();
    let cfsr = u32::from_str_radix(cfsr, 16).unwrap();
    // DACCVIOL or MSTKERR (ARMv7-M B3.2.15).
    assert!(cfsr & 0x12 != 0, "{place}");
    // The record of the time since power-on lies at the upper end of static memory.
    assert!(greeted.powered_for_ms.is_some());
}

/// A request in whose middle the task is never woken again: samples and frames go on.
#[test]
#[ignore = "nightly: another place that waits; by day the watchdog bites a task and an interrupt"]
fn a_command_that_waits_for_ever_restarts_the_device() {
    let mut board = sampling();
    board.send(&call(Request::SelfTest));
    board.run_for(50 * MS).unwrap();
    let (ms, cause, greeted) = restarted(&mut board, task("commands"), Fault::Pending);
    assert!(
        (19_500..20_600).contains(&ms) && cause == "Core",
        "{cause} after {ms} ms"
    );
    assert!(greeted.start.contains("main.rs"), "{}", greeted.start);
}

#[test]
fn without_its_sensor_or_with_another_one_the_device_stays_up_and_says_what_it_reads() {
    // None on the line; an ICM-42686-P; the accelerometer's filter as after a write that was lost.
    for (register, reads, wrong) in [
        (None, 0x00, (0x75, 0x47)),
        (Some(0x75), 0x44, (0x75, 0x47)),
        (Some(0x53), 0x05, (0x53, 0x0d)),
    ] {
        let other = Other { register, reads };
        let mut board = Board::other_sensor(&digital_image(), other, [7; 12]).unwrap();
        let early = greeted(&mut board, |g| g.rate_measured);
        board.run_for(8_000 * MS).unwrap();
        board.receive();
        board.send(&call(Request::Hello));
        let (starts, found) = greeted(&mut board, |g| (g.starts, g.wrong_register));
        let (register, expected) = wrong;
        let told = WrongRegister {
            register,
            identifies: register == 0x75,
            found: reads,
            expected,
        };
        assert_eq!((starts, found, early), (1, Some(told), false));
        assert_eq!(bites(&mut board), 0);
    }
}

/// A call as the host sends it.
fn call(request: Request<'_>) -> Vec<u8> {
    let mut frame = [0; MAX_FRAME];
    let length = encode(&Call { id: 7, request }, &mut frame).unwrap();
    frame[..length].to_vec()
}

/// Number of restarts; checks that the watchdog caused each.
fn bites(board: &mut Board) -> usize {
    let restarts = board.restarts().unwrap();
    assert!(
        restarts.iter().all(|r| r.cause.contains("IWDG")),
        "{restarts:?}"
    );
    restarts.len()
}

/// Sampling is started again and again, and never succeeds.
#[test]
#[ignore = "nightly: another place that waits; by day the watchdog bites a task and an interrupt"]
fn a_converter_that_gives_no_sample_is_bitten_by_the_watchdog() {
    let mut board = sampling();
    board.stop_converter().unwrap();
    // The watchdog may be fed once more for earlier samples.
    board.run_for(2300 * MS).unwrap();
    assert_eq!(bites(&mut board), 1);
}

/// As if the log itself caused the failure, or the program stopped during a log.
#[test]
#[ignore = "nightly: a second fault within the panic"]
fn a_panic_is_told_also_if_the_log_of_it_faults() {
    let mut board = sampling();
    let log = image().find("acquire_and_header").unwrap();
    let faults = [
        (log, Fault::Undefined),
        (task("process"), Fault::Jump(panics())),
    ];
    let replaced = faults.map(|(at, fault)| board.inject(at, fault).unwrap());
    while board.restarts().unwrap().is_empty() {
        board.run_for(MS / 10).unwrap();
        assert!(board.state().ns < 1000 * MS, "it does not restart");
    }
    for one in replaced {
        board.heal(one).unwrap();
    }
    let greeted = greeting(&mut board);
    assert!(greeted.start.starts_with("panic "), "{}", greeted.start);
}

/// A debugger that has disconnected leaves the log in blocking mode.
#[test]
#[ignore = "nightly: four seconds of the board"]
fn a_log_that_nobody_reads_does_not_stop_the_program() {
    // The up channel of SEGGER's RTT, after 24 bytes of header: name, buffer, size, written, read, flags.
    const SIZE: u64 = 24 + 8;
    let mut board = sampling();
    let rtt = image().address("_SEGGER_RTT").unwrap();
    let word = |board: &mut Board, at: u64| {
        let bytes = board.memory(rtt + at, 4).unwrap();
        u32::from_le_bytes(bytes.try_into().unwrap())
    };
    let (size, written) = (word(&mut board, SIZE), word(&mut board, SIZE + 4));
    // Full: the write position is just before the read position.
    let read = (written + 1) % size;
    let block_if_full: u32 = 2;
    let bytes = [read, block_if_full].map(u32::to_le_bytes).concat();
    board.set_memory(rtt + SIZE + 8, bytes).unwrap();
    board.conversions().unwrap();
    board.run_for(4000 * MS).unwrap();
    assert_eq!(bites(&mut board), 0);
    assert_eq!(board.conversions().unwrap().count, 80_000);
}

#[test]
#[ignore = "nightly: three starts of the board; by day the command is told of a reset"]
fn time_since_power_on_goes_on_over_resets_and_is_unknown_once_its_record_is_lost() {
    let mut board = still(Volts::GROUND);
    let first = greeting(&mut board).powered_for_ms.unwrap();
    assert!((1..150).contains(&first), "{first}");
    board.run_to(3000 * MS).unwrap();
    board.reset_by_pin(1).unwrap();
    // It is stored every 250 ms, and the start takes as long as the first one.
    let second = greeting(&mut board);
    let after = second.powered_for_ms.unwrap();
    assert!((2750..3150).contains(&after), "{after}");
    board.run_for(STARTED).unwrap();
    let before_ms = board.state().ns / MS;
    let (ms, _, third) = restarted(&mut board, task("process"), Fault::Hang);
    let truth = before_ms as u32 + ms + first;
    let after = third.powered_for_ms.unwrap();
    // The largest loss by two resets.
    assert!(
        (truth - 600..=truth + 300).contains(&after),
        "{after} of {truth}"
    );
    // A write that a reset interrupted.
    let kept = image().find("restart7POWERED").unwrap();
    let byte = board.memory(kept, 1).unwrap()[0];
    board.set_memory(kept, vec![byte ^ 1]).unwrap();
    for _ in 0..2 {
        board.reset_by_pin(1).unwrap();
        assert_eq!(greeting(&mut board).powered_for_ms, None);
        board.run_for(1000 * MS).unwrap();
    }
    board.cut_supply(1).unwrap();
    board.run_for(MS).unwrap();
    board.restore_supply().unwrap();
    assert_eq!(greeting(&mut board).powered_for_ms, Some(first));
}
