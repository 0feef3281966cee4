//! The device behind its serial line: its identity and its samples.

use mimu_board::schematic::{DIVIDER_RATIO, Net, Volts, WIRING};
use mimu_board_tests::conversation::{Answer, Conversation, Sample};
use mimu_board_tests::{MS, STARTED, still};
use mimu_core::wire::Request;

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
