//! Records the traces anew from the release image, after a change that is meant to compute otherwise, or of the protocol; the change
//! then shows in what is committed.
//!
//! ```text
//! cargo build -p mimu-firmware --profile image --target thumbv7em-none-eabihf
//! cargo run -p mimu-board-tests --bin traces [NAME...]
//! ```
//!
//! Names choose among the steps. A program and not a test: the tests of a night must leave what they compare with as it is.

use mimu_board_tests::traces::STEPS;

fn main() {
    let only: Vec<String> = std::env::args().skip(1).collect();
    for step in &STEPS {
        if !only.is_empty() && !only.iter().any(|name| name == step.name) {
            continue;
        }
        let trace = step.record();
        println!(
            "{}: {} bytes of the line, {} of calibration",
            step.name,
            trace.wire.len(),
            trace.calibration.len()
        );
        trace.write(step.name);
    }
}
