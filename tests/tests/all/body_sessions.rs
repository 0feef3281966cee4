//! One body of several sessions, each after another power-on: what it says of the next.

use mimu::judgement::JudgementKind;
use mimu_tests::body::{Found, table, tallies};
use mimu_tests::body_sessions::lives;

fn shown(bodies: u64, sessions: u64) -> Vec<Vec<Found>> {
    let bodies = lives(bodies, sessions);
    println!(
        "{} bodies of {sessions} sessions\n{}",
        bodies.len(),
        table(&bodies)
    );
    bodies
}

#[test]
fn a_body_of_several_sessions_is_good_and_its_intervals_hold_the_next_power_on() {
    let bodies = shown(4, 3);
    for found in bodies.iter().flatten() {
        assert!(found.is_good(), "{found:?}");
    }
    let all = tallies(&bodies);
    let [inside, count] = all
        .values()
        .fold([0, 0], |[a, b], of| [a + of.inside, b + of.count]);
    // A hundred and fifty parameters of which three in a triad share what is known of their changes.
    assert!(
        f64::from(inside) > 0.88 * f64::from(count),
        "{inside} of {count}"
    );
}

#[test]
#[ignore = "nightly: more bodies"]
fn intervals_of_many_bodies_of_several_sessions_hold_the_next_power_on() {
    for found in shown(8, 2).iter().flatten() {
        assert_eq!(found.judgement.kind, JudgementKind::Untested, "{found:?}");
    }
    for sessions in [3, 4] {
        let bodies = shown(60, sessions);
        for ((name, kind), tally) in tallies(&bodies) {
            let margin = 4.0 * (0.93 * 0.07 * 3.0 / f64::from(tally.count)).sqrt();
            assert!(tally.share() > 0.93 - margin, "{name}, {kind}: {tally:?}");
        }
    }
}
