//! People.

use mimu_rig::flaws::FlawsTruth;
use mimu_rig::hands::{Hands, HandsTruth};
use mimu_rig::located::Source;
use mimu_rig::motion::Carrier;
use mimu_rig::place::{EARTH_RATE, Place};
use mimu_rig::plan::Plan;
use mimu_rig::rotation::{add, cross, dot, norm, scale};

use super::{assert_near, differentiate, minus};

fn hands(steps: &str, truth: &HandsTruth, seed: u64) -> Hands {
    let head = "format = \"mimu-plan/1\"\nsample_rate_hz = 1000.0\ncarrier = \"hands\"\nlatitude_deg = 30.5\nlead_in_s = 1.0\n";
    let plan = Plan::parse(Source::new("PLAN.toml", format!("{head}{steps}"))).unwrap();
    Hands::new(&plan, truth, seed).unwrap()
}

#[test]
fn rate_and_angular_acceleration_are_derivatives_of_the_attitude_with_all_flaws_of_a_person() {
    let truth = FlawsTruth {
        settle_mrad: 50.0,
        turning_rests: 8,
        shake_turns: 2,
        // A violent shake has a jerk that is too large for the numeric differences.
        shake_mrad: 5.0,
        ..FlawsTruth::default()
    };
    let hands = hands(
        "[[step]]\nposes = 20\ndwell_s = 1",
        &HandsTruth::default(),
        3,
    );
    let mut hands = hands.with_flaws(&truth, 3);
    let compared = differentiate(&mut hands, Place::new(30.5, None), f64::INFINITY);
    assert!(compared > 5000, "{compared}");
}

#[test]
fn force_by_hand_integrates_to_rest_and_to_the_way_that_the_board_went() {
    // If the board is always put down on the same spot, its origin moves only by the rotation of its lever.
    let truth = HandsTruth {
        carry_mm: 0.0,
        lever_mm: [100.0, -50.0, 70.0],
        pause_s: [0.5, 0.5],
        jolt_probability: 0.0,
        ..HandsTruth::default()
    };
    let mut hands = hands("[[step]]\nposes = 20\ndwell_s = 0.2", &truth, 5);
    let place = Place::new(30.5, None);
    let lever = [0.1, -0.05, 0.07];
    let dt = 1e-4;
    let (mut velocity, mut way) = ([0.0; 3], [0.0; 3]);
    let (mut last, mut dwells, mut fastest) = (None, 0, 0.0_f64);
    for k in 0..(hands.duration_s() / dt) as usize {
        let instant = hands.at((k as f64 + 0.5) * dt);
        let motion = instant.motion;
        if instant.step != last
            && let Some(step) = instant.step
        {
            assert!(norm(velocity) < 1e-6, "step {step}: {velocity:?}");
            let went = minus(motion.attitude.turn(lever), way);
            if step == 0 {
                way = motion.attitude.turn(lever);
            } else {
                assert!(norm(went) < 1e-6, "step {step}: {went:?}");
            }
            dwells += 1;
        }
        last = instant.step;
        let coriolis = scale(2.0, cross(place.earth_rate(), velocity));
        let force = minus(
            motion.attitude.turn(motion.force),
            add(place.force_at_rest(), coriolis),
        );
        way = add(way, add(scale(dt, velocity), scale(0.5 * dt * dt, force)));
        velocity = add(velocity, scale(dt, force));
        fastest = fastest.max(norm(velocity));
    }
    assert_eq!(dwells, 20);
    assert!(fastest > 0.2, "a turn moves the board, {fastest} m/s");
}

#[test]
fn a_board_that_lies_there_feels_gravity_and_the_earth_and_a_held_one_trembles() {
    let truth = HandsTruth {
        jolt_probability: 0.0,
        ..HandsTruth::default()
    };
    let steps = "[[step]]\nposes = 26\ndwell_s = 2";
    let place = Place::new(30.5, None);
    let mut lying = hands(steps, &truth, 7);
    let mut held = hands(
        steps,
        &HandsTruth {
            held: true,
            ..truth
        },
        7,
    );
    let mut squares = [0.0; 2];
    let mut count = 0;
    for k in 0..(lying.duration_s() * 200.0) as usize {
        let t = k as f64 * 0.005;
        let instant = lying.at(t);
        let trembling = held.at(t).motion;
        if instant.step.is_some() {
            assert_near(
                instant.motion.force,
                instant
                    .motion
                    .attitude
                    .inverse()
                    .turn(place.force_at_rest()),
                1e-8,
            );
            assert!((norm(instant.motion.rate) - EARTH_RATE).abs() < 1e-15);
            squares[0] += dot(trembling.rate, trembling.rate);
            squares[1] += (norm(trembling.force) - place.gravity).powi(2);
            count += 1;
        }
    }
    // 0.5 mrad at 8 to 12 Hz about each of three axes, and 0.05 mm along them: 0.03 rad/s and 0.2 m/s² each.
    let [rate, force] = squares.map(|s| (s / f64::from(count)).sqrt());
    assert!(rate > 0.03 && rate < 0.1, "{rate}");
    assert!(force > 0.1 && force < 0.5, "{force}");
}
