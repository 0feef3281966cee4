use mimu::plan::{Plan, TableAxis};

use super::*;

fn procedure(body: &str) -> Procedure {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plan.toml");
    let head = "format = \"mimu-plan/1\"\nsample_rate_hz = 1000.0\ncarrier = \"table\"\n";
    std::fs::write(&path, format!("{head}{body}")).unwrap();
    let plan = Plan::read(&path).unwrap();
    Procedure::of(&plan, 9.8, "plan.toml").unwrap()
}

/// Orders to a table and a chamber, with their times, and when each dwell begins and ends. Every motion takes `busy_s`.
fn carried_out(procedure: &Procedure, busy_s: f64) -> (Vec<(f64, Order)>, Vec<f64>) {
    let mut sequence = Sequence::new(procedure, true, true);
    let (mut orders, mut marks) = (Vec::new(), Vec::new());
    let mut done_s = 0.0;
    for tick in 0..200_000 {
        let now_s = f64::from(tick) * 0.02;
        let seen = Seen {
            now_s,
            line_lost: false,
            arrived: now_s >= done_s,
            chamber_c: None,
        };
        let actions = sequence.look(&seen);
        marks.extend((0..actions.marks).map(|_| now_s));
        for order in actions.orders {
            if !matches!(order, Order::Set(_)) {
                done_s = now_s + busy_s;
            }
            orders.push((now_s, order));
        }
        if sequence.phase == Phase::Done {
            return (orders, marks);
        }
    }
    panic!("it does not end: {sequence:?}");
}

fn motions(orders: &[(f64, Order)]) -> Vec<&Order> {
    let all = orders.iter().map(|(_, order)| order);
    all.filter(|o| !matches!(o, Order::Set(_))).collect()
}

#[test]
fn a_dwell_begins_once_the_table_has_arrived_and_its_last_samples_are_here() {
    let plan = procedure(
        "chamber_c = [[0.0, 20.0], [100.0, 30.0]]\nlead_in_s = 5.0\n[[step]]\nup = [0.0, 0.0, 1.0]\ndwell_s = 10.0\n\
         [[step]]\nup = [1.0, 0.0, 0.0]\nrate_dps = 30.0\ndwell_s = 4.0\n",
    );
    let (orders, marks) = carried_out(&plan, 3.0);
    let close = |a: f64, b: f64| assert!((a - b).abs() < 0.05, "{a} {b}");
    // 3 s to the first pose, then the lead-in; 3 s to the second pose, and half a second for samples that may still arrive.
    for (mark, wanted) in marks.iter().zip([8.0, 18.0, 21.5, 25.5]) {
        close(*mark, wanted);
    }
    assert_eq!(motions(&orders).len(), 2);
    assert!(matches!(motions(&orders)[1], Order::Go(step) if step.rate_dps == 30.0));
}

#[test]
fn the_chamber_is_led_along_its_temperatures() {
    let plan = procedure(
        "chamber_c = [[0.0, 20.0], [60.0, 30.0], [80.0, 30.0]]\n[[step]]\nup = [0.0, 0.0, 1.0]\ndwell_s = 100.0\n",
    );
    let (orders, _) = carried_out(&plan, 0.0);
    let sets: Vec<(f64, f64)> = orders
        .iter()
        .filter_map(|(t, order)| match order {
            Order::Set(c) => Some((*t, *c)),
            _ => None,
        })
        .collect();
    // Every 5 s during the ramp, and none while the temperature is constant.
    assert_eq!(sets.len(), 13, "{sets:?}");
    for (t, c) in sets {
        assert!((c - (20.0 + t / 6.0).min(30.0)).abs() < 0.02, "{t} {c}");
    }
}

#[test]
fn a_turn_is_marked_from_rest_to_rest_and_where_it_ends_nothing_moves() {
    let plan = procedure(
        "chamber_c = [[0.0, 20.0]]\nrounds = 2\n[[step]]\nup = [0.0, 0.0, 1.0]\ndwell_s = 2.0\n\
         [[step]]\nturn_axis = \"middle\"\nturn_deg = 90.0\nturn_dps = 30.0\n\
         [[step]]\nstay = true\ndwell_s = 2.0\n[[step]]\nturn_axis = \"middle\"\nturn_deg = -90.0\nturn_dps = 30.0\n",
    );
    let (orders, marks) = carried_out(&plan, 4.0);
    let told = motions(&orders);
    // One motion to the first pose, then turns only: each ends where the next dwell is.
    assert_eq!(told.len(), 5, "{told:?}");
    for (order, deg) in told[1..].iter().zip([90.0, -90.0, 90.0, -90.0]) {
        assert!(
            matches!(order, Order::Turn(t) if t.angle_deg == deg && t.axis == TableAxis::Middle)
        );
    }
    // A turn lasts until the table has completed it, and half a second for samples that may still arrive.
    for (k, pair) in marks.chunks(2).enumerate() {
        let wanted = if k % 2 == 0 { 2.0 } else { 4.5 };
        assert!((pair[1] - pair[0] - wanted).abs() < 0.05, "{k}: {pair:?}");
    }
    assert_eq!(plan.dwells[2].up, Some([0.0, 1.0, 0.0]));
    assert_eq!(plan.dwells[2].input, [0.0, 0.0, 0.0, 0.0, 9.8, 0.0]);
}

#[test]
fn a_round_waits_for_its_time_with_the_table_at_rest() {
    let plan = procedure(
        "chamber_c = [[0.0, 20.0]]\nrounds = 2\nround_s = 30.0\n[[step]]\nup = [0.0, 0.0, 1.0]\nrate_dps = 20.0\ndwell_s = 5.0\n",
    );
    let (orders, marks) = carried_out(&plan, 1.0);
    let told = motions(&orders);
    assert!(matches!(
        told.as_slice(),
        [Order::Go(_), Order::Go(_), Order::Halt, Order::Go(_)]
    ));
    // The plan begins after 1 s at rest. The first round is due at once, the second 30 s later.
    assert!((marks[2] - marks[0] - 30.0).abs() < 0.6, "{marks:?}");
}

#[test]
fn the_plan_begins_when_the_chamber_is_at_its_first_temperature_and_goes_on_while_the_line_is_lost()
{
    let plan = procedure(
        "chamber_c = [[0.0, 20.0], [600.0, 120.0]]\n[[step]]\nup = [0.0, 0.0, 1.0]\ndwell_s = 600.0\n",
    );
    let mut sequence = Sequence::new(&plan, true, true);
    let mut seen = Seen {
        now_s: 0.0,
        line_lost: false,
        arrived: true,
        chamber_c: Some(5.0),
    };
    let actions = sequence.look(&seen);
    assert_eq!(actions.orders[0], Order::Set(20.0));
    seen.now_s = 50.0;
    assert_eq!(sequence.look(&seen), Actions::default());
    seen.chamber_c = Some(19.5);
    sequence.look(&seen);
    seen.now_s = 60.0;
    sequence.look(&seen);
    assert_eq!(sequence.running(), Some(0));
    (seen.now_s, seen.line_lost) = (700.0, true);
    let actions = sequence.look(&seen);
    assert_eq!((actions.marks, sequence.running()), (0, Some(0)));
    assert_eq!(actions.orders, [Order::Set(120.0)]);
}
