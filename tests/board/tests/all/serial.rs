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
