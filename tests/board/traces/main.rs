//! Records the traces again from the release image, after an intended change of the computation or the protocol. The change then shows in the commit.
//!
//! ```text
//! cargo build -p mimu-firmware --profile image --target thumbv7em-none-eabihf
//! cargo run -p mimu-board-tests --bin traces [NAME...]
//! ```
//!
//! Names select steps. This is a program, because nightly tests must not change their references.

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
