//! The device behind its serial line: its identity and its samples.

use std::path::Path;

use mimu_board::front::Front;
use mimu_board::running::Board;
use mimu_board::schematic::{DIVIDER_RATIO, Net, Volts, WIRING};
use mimu_board_tests::conversation::{Answer, Conversation, Sample, Tested};
use mimu_board_tests::{MS, STARTED, image, still};
use mimu_core::wire::{Request, Verdict, flags};
use mimu_rig::plan::Plan;
use mimu_rig::rig_file::{RigFile, RigTruth};

pub const STREAM: Request<'_> = Request::Stream {
    raw: true,
    compensated: false,
};

#[test]
fn a_device_that_is_switched_on_says_so_and_has_no_calibration() {
    let mut device = Conversation::new(still(Volts::GROUND));
    let Answer::Greeting { hash, start } = device.greeting() else {
        panic!("no greeting");
    };
    assert_eq!((hash, start.as_str()), (None, "PowerOn"));
    assert_eq!(device.download(), None);

    device.board.reset_by_pin(1).unwrap();
    let Answer::Greeting { start, .. } = device.greeting() else {
        panic!("no greeting");
    };
    assert_eq!(start, "ResetPin");
}

#[test]
fn no_sample_is_lost_or_out_of_order_and_all_are_1_ms_apart() {
    stream_for(5);
}

#[test]
#[ignore = "nightly: ten minutes of samples take minutes"]
fn in_ten_minutes_no_sample_is_lost_or_out_of_order() {
    stream_for(600);
}

/// Checks every sample of so many seconds.
fn stream_for(seconds: u64) {
    let mut device = Conversation::new(still(Volts::GROUND));
    device.greeting();
    device.run_for(STARTED);
    assert_eq!(device.ask(STREAM), Answer::Done);
    device.run_for(100 * MS);
    device.board.conversions().unwrap();
    let first = device.samples.first().expect("samples come").number;
    let mut expected = first;
    for _ in 0..seconds {
        device.run_for(1000 * MS);
        for Sample { number, .. } in device.samples.drain(..) {
            assert_eq!(number, expected);
            expected += 1;
        }
        // The converter's clock spaces the samples: 20 conversions each, all of the same length.
        let second = device.board.conversions().unwrap();
        assert_eq!(second.count, 20_000);
        assert_eq!((second.shortest_ns, second.longest_ns), (50_000, 50_000));
    }
    // Minus those still on their way, at most two batches of twenty.
    let taken = u64::from(expected - first);
    assert!(taken + 40 >= 1000 * seconds + 100, "{taken} samples");
    assert_eq!(device.lost, (0, 0));
    assert_eq!(device.garbled(), 0);
    println!(
        "{taken} samples in {} s: {} lost, {} frames garbled, none out of order, all 20 conversions of 50 µs apart",
        seconds,
        device.lost.0,
        device.garbled()
    );
    assert_eq!(device.board.findings().unwrap().broken, [""; 0]);
    assert_eq!(device.board.restarts().unwrap(), []);
}

#[test]
fn the_raw_stream_holds_the_voltages_of_the_pins() {
    let mut volts = Volts::GROUND;
    for (k, (_, _, input)) in WIRING.into_iter().enumerate() {
        volts.input[input] = 0.4 + 0.2 * k as f64;
    }
    let reference = WIRING[9].2;
    volts.input[reference] = 2.5 * DIVIDER_RATIO;
    let mut device = Conversation::new(still(volts));
    device.greeting();
    device.run_for(STARTED);
    assert_eq!(device.ask(STREAM), Answer::Done);
    device.run_for(200 * MS);
    assert!(device.samples.len() > 100);
    for Sample { number, counts, .. } in &device.samples {
        for (k, &sum) in counts.gyro.iter().chain(&counts.accel).enumerate() {
            let (net, pin, input) = WIRING[k];
            // The converter rounds down, and a sum has two conversions.
            let code = (volts.input[input] / volts.rail * 65_535.0 + 1e-6).floor();
            let off = f64::from(sum) - 2.0 * code;
            assert!(off.abs() <= 2.0, "{number}: {net:?} at {pin}: {off}");
        }
    }
}

fn self_test(device: &mut Conversation) -> Vec<Tested> {
    match device.ask(Request::SelfTest) {
        Answer::SelfTest(result) => result,
        other => panic!("{other:?}"),
    }
}

/// Names of the rows that fail.
fn failed(result: &[Tested]) -> Vec<&str> {
    let of = result.iter().filter(|row| row.verdict == Verdict::Failed);
    of.map(|row| row.name.as_str()).collect()
}

fn value(result: &[Tested], name: &str) -> f32 {
    result.iter().find(|row| row.name == name).unwrap().value
}

#[test]
fn a_unit_of_the_usual_parts_that_lies_still_passes_the_self_test() {
    let plan = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../rig/plans/rest.toml");
    let plan = Plan::read(&plan).unwrap();
    let truth = RigTruth::resolve(&RigFile::default(), 7).unwrap();
    let front = Front::bench(&plan, &truth, 7).unwrap();
    let mut device = Conversation::new(Board::new(&image(), front).unwrap());
    device.greeting();
    device.run_for(STARTED);
    let result = self_test(&mut device);
    assert_eq!((failed(&result).len(), result.len()), (0, 15), "{result:?}");
    // Without sensors nothing responds to the self-test; the converter still has its supply.
    device.board.set_front(Front::Still(Volts::GROUND)).unwrap();
    let result = self_test(&mut device);
    let passed = result.iter().filter(|row| row.verdict != Verdict::Failed);
    let passed: Vec<&str> = passed.map(|row| row.name.as_str()).collect();
    assert_eq!(passed, ["supply"], "{result:?}");
}

/// Pins of a unit at rest and 25 °C, with the converter's supply at `rail`, V.
pub fn at_rest(rail: f64) -> Volts {
    let mut volts = Volts {
        rail,
        ..Volts::GROUND
    };
    for (net, _, input) in WIRING {
        volts.input[input] = match net {
            Net::Force(2) => 2.45 * rail / 3.3,
            Net::Force(_) => 1.65 * rail / 3.3,
            _ => 2.5 * DIVIDER_RATIO,
        };
    }
    volts
}

#[test]
#[ignore = "nightly: by day the firmware's own tests of each row"]
fn the_self_test_tells_a_supply_a_reference_and_a_temperature_by_name() {
    let input = |net| {
        let wire = WIRING.iter().find(|(of, ..)| *of == net);
        wire.expect("it is wired").2
    };
    let mut device = Conversation::new(still(at_rest(3.3)));
    device.greeting();
    device.run_for(STARTED);
    let mut seen = |volts: Volts| {
        device.board.set_front(Front::Still(volts)).unwrap();
        let result = self_test(&mut device);
        let supplies = ["temperature", "reference", "supply"];
        let failed = failed(&result).into_iter();
        // Fixed voltages do not respond to the self-test inputs.
        let failed = failed.filter(|name| supplies.iter().any(|of| name.starts_with(of)));
        let failed: Vec<String> = failed.map(str::to_owned).collect();
        (failed, result)
    };
    let (found, result) = seen(at_rest(3.3));
    assert!(found.is_empty(), "{result:?}");
    assert!((value(&result, "supply") - 3.3).abs() < 2e-3);
    assert!((value(&result, "reference") - 2.5).abs() < 2e-3);
    // A regulator that is 0.3 V low; relative to it, the gyros' reference is right.
    let (found, result) = seen(at_rest(3.0));
    assert_eq!(found, ["supply"], "{result:?}");
    assert!((value(&result, "supply") - 3.0).abs() < 2e-3, "{result:?}");
    let mut volts = at_rest(3.3);
    volts.input[input(Net::Reference(0))] = 2.35 * DIVIDER_RATIO;
    let (found, result) = seen(volts);
    // Temperatures are fractions of it: all of them step by 19 °C, which dies cannot.
    let expected = [
        "temperature x",
        "temperature y",
        "temperature z",
        "reference",
    ];
    assert_eq!(found, expected, "{result:?}");
    let mut volts = at_rest(3.3);
    volts.input[input(Net::Temperature(1))] = 0.0;
    let (found, result) = seen(volts);
    assert_eq!(found, ["temperature y"], "{result:?}");
}

#[test]
fn an_open_temperature_pin_is_flagged_within_two_batches_and_leaves_the_temperature_alone() {
    let mut device = Conversation::new(still(at_rest(3.3)));
    device.greeting();
    device.run_for(STARTED);
    assert_eq!(device.ask(STREAM), Answer::Done);
    device.run_for(100 * MS);
    let (head, temps_c) = device.last.unwrap();
    assert_eq!(head.flags, 0);
    assert!(
        temps_c.iter().all(|c| (c - 25.0).abs() < 0.1),
        "{temps_c:?}"
    );
    let (_, _, open) = WIRING[7];
    for volts in [0.0, 5.0 * DIVIDER_RATIO] {
        let mut pins = at_rest(3.3);
        pins.input[open] = volts;
        device.board.set_front(Front::Still(pins)).unwrap();
        device.run_for(60 * MS);
        for _ in 0..20 {
            device.run_for(100 * MS);
            let (head, _) = device.last.unwrap();
            assert_eq!(head.flags, flags::TEMPERATURE_LEFT_OUT[1]);
            assert!((head.temp_c - 25.0).abs() < 0.1, "{}", head.temp_c);
        }
    }
    // The reading itself is still sent: 5 V are 25 + 2.5 / 0.0084 °C, minus the 14 % that the filter lacks after two seconds.
    let (_, [x, y, z]) = device.last.unwrap();
    assert!(y > 200.0 && (x - 25.0).abs() < 0.1 && (z - 25.0).abs() < 0.1);
}

#[test]
fn a_garbled_line_costs_frames_and_nothing_else() {
    let mut device = Conversation::new(still(Volts::GROUND));
    device.greeting();
    device.board.garble(20_000).unwrap();
    let mut answered = 0;
    for _ in 0..200 {
        let id = device.send(Request::Hello);
        device.run_for(20 * MS);
        answered += u32::from(device.answer(id).is_some());
    }
    // A call of about 9 bytes arrives intact five times out of six.
    assert!((120..200).contains(&answered), "{answered} of 200");
    device.board.garble(0).unwrap();
    // The rest of a broken frame ends with the first zero of the next.
    let id = device.send(Request::Hello);
    device.run_for(20 * MS);
    assert!(device.answer(id).is_some());
}
