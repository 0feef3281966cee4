//! Tables and people that get commands while they move.

use mimu_rig::command::{Command, Commanded};
use mimu_rig::hands::{Hands, HandsTruth};
use mimu_rig::motion::Motion;
use mimu_rig::plan::Plan;
use mimu_rig::rotation::{Vector, norm, scale};
use mimu_rig::table::{Table, TableTruth};

use super::table::plan;
use super::{assert_near, minus};

const H: f64 = 1e-3;
const G: f64 = 9.793;
const ARCSEC: f64 = std::f64::consts::PI / 648_000.0;

fn at_rest() -> Plan {
    plan("lead_in_s = 1\n[[step]]\nup = [0, 0, 1]\ndwell_s = 1")
}

fn go(up: Vector) -> Command {
    let up = scale(1.0 / norm(up), up);
    Command::Move { up, heading: None }
}

fn dps(rate: f64) -> f64 {
    rate.to_radians()
}

/// A table or a person, and its progress in steps of H.
struct Course<'a> {
    carrier: &'a mut dyn Commanded,
    steps: u64,
    motions: Vec<Motion>,
}

impl<'a> Course<'a> {
    fn new(carrier: &'a mut dyn Commanded) -> Self {
        let mut course = Self {
            carrier,
            steps: 0,
            motions: Vec::new(),
        };
        course.step();
        course
    }

    fn t_s(&self) -> f64 {
        self.motions.last().unwrap().t_s
    }

    fn step(&mut self) -> Motion {
        let motion = self.carrier.at(self.steps as f64 * H).motion;
        self.steps += 1;
        self.motions.push(motion);
        motion
    }

    fn run(&mut self, seconds: f64) -> Motion {
        let end_s = self.t_s() + seconds;
        while self.t_s() + 0.5 * H < end_s {
            self.step();
        }
        *self.motions.last().unwrap()
    }

    fn tell(&mut self, command: Command) {
        self.carrier.command(self.t_s(), command).unwrap();
    }

    /// Runs until the command is done. Returns how long that took, s.
    fn wait(&mut self) -> f64 {
        let began_s = self.t_s();
        while self.carrier.busy(self.t_s()) {
            assert!(self.t_s() < began_s + 100.0, "never done");
            self.step();
        }
        self.t_s() - began_s
    }

    /// Checks that neither attitude nor rate jumps: from one time to the next, the attitude changes by the rate, and the rate by at most this angular
    /// acceleration (rad/s²).
    fn is_continuous(&self, acceleration: f64) {
        for pair in self.motions.windows(2) {
            let [a, b] = [pair[0], pair[1]];
            let (axis, angle) = (a.attitude.inverse() * b.attitude).axis_angle();
            // The error of the mean of both rates is h²/12 of the jerk or, at a corner, h/2 of the jump of the acceleration.
            let mean = scale(0.5, minus(a.rate, scale(-1.0, b.rate)));
            assert_near(scale(angle / H, axis), mean, H * acceleration + 1e-4);
            assert!(
                norm(minus(a.rate, b.rate)) < H * acceleration,
                "the rate jumps at {} s: {:?} to {:?}",
                a.t_s,
                a.rate,
                b.rate
            );
        }
    }
}

#[test]
fn a_rate_is_about_up_whatever_the_pose_and_lasts_until_it_is_told_another_or_to_move() {
    let truth = TableTruth::default();
    let mut table = Table::commanded(&at_rest(), &truth).unwrap();
    let mut course = Course::new(&mut table);
    // The move is commanded in the lead-in, and the rate during the move: each waits for the previous one.
    course.tell(go([1.0, 0.0, 0.0]));
    course.tell(Command::Rate(dps(90.0)));
    course.wait();
    for wanted in [90.0, -45.0] {
        if wanted < 0.0 {
            course.tell(Command::Rate(dps(wanted)));
            // 135 deg/s at 200 deg/s², plus the settling time.
            let took = course.wait();
            assert!((took - 1.675).abs() < 2.0 * H, "{took}");
        }
        let mut sum = [0.0; 3];
        let n = (360.0 / f64::abs(wanted) / H).round();
        for _ in 0..n as usize {
            let motion = course.step();
            let earth = motion.attitude.inverse().turn(at_rest().place.earth_rate());
            sum = minus(sum, scale(-1.0 / n, minus(motion.rate, earth)));
        }
        // Over a whole turn periodic errors of the angle cancel: the 5 ppm of the rate and 40 arcseconds remain.
        let up = scale(dps(wanted) * (1.0 + 5e-6), [1.0, 0.0, 0.0]);
        assert_near(sum, up, dps(90.0) * 60.0 * ARCSEC);
        assert!((norm(sum) / dps(wanted.abs()) - 1.0 - 5e-6).abs() < 1e-7);
    }
    course.tell(Command::Spin(dps(20.0)));
    course.wait();
    let motion = course.step();
    assert!((motion.rate[2] - dps(20.0)).abs() < 1e-3);
    course.tell(go([0.0, 0.0, 1.0]));
    course.wait();
    assert!(norm(course.run(1.0).rate) < 1e-4);
}

#[test]
fn no_command_makes_a_table_jump_whenever_it_comes() {
    let truth = TableTruth::default();
    let mut table = Table::commanded(&at_rest(), &truth).unwrap();
    let mut course = Course::new(&mut table);
    let commands = [
        go([1.0, 0.0, 0.0]),
        Command::Rate(dps(90.0)),
        go([0.0, -1.0, 0.3]),
        Command::Spin(dps(-120.0)),
        Command::Stop,
        Command::Rate(dps(-30.0)),
        go([0.0, 0.0, -1.0]),
    ];
    course.run(1.0);
    // Times that fall into ramps, moves, rest and constant rates.
    for (k, command) in commands.iter().cycle().take(50).enumerate() {
        course.tell(*command);
        course.run(0.05 + 0.137 * ((k * k) % 17) as f64);
    }
    // Three axes at 200 deg/s², each with a load that swings by a fifth, superposed at up to 150 deg/s.
    course.is_continuous(3.0 * 1.4 * dps(200.0) + 2.0 * dps(150.0) * dps(150.0));
}

#[test]
fn a_stop_ends_a_move_where_it_is_and_with_it_what_was_to_follow() {
    let truth = TableTruth::ideal();
    let mut table = Table::commanded(&at_rest(), &truth).unwrap();
    let mut course = Course::new(&mut table);
    course.run(1.0);
    course.tell(go([0.0, 1.0, 0.0]));
    course.tell(Command::Rate(dps(100.0)));
    course.run(0.8);
    course.tell(Command::Stop);
    // 60 deg/s at 200 deg/s².
    let took = course.wait();
    assert!((took - 1.3).abs() < 2.0 * H, "{took}");
    let motion = course.run(5.0);
    assert!(norm(motion.rate) < 1e-4);
    let up = course.carrier.position(course.t_s()).up;
    assert_near(motion.force, scale(G, up), 1e-9);
    // Half a second at 60 deg/s, and 9 degrees for each ramp.
    let tilt = up[2].acos().to_degrees();
    assert!((tilt - (0.5 * 60.0 + 9.0 + 9.0)).abs() < 0.2, "{tilt}");
}

#[test]
fn a_table_refuses_what_is_beyond_it_and_stays_as_it_was() {
    let truth = TableTruth {
        axes: 2,
        middle_min_deg: -95.0,
        middle_max_deg: 95.0,
        ..TableTruth::default()
    };
    let mut table = Table::commanded(&at_rest(), &truth).unwrap();
    let mut refused = |command| table.command(0.0, command).unwrap_err();
    assert!(refused(go([0.0, 0.0, -1.0])).contains("95"));
    assert!(refused(Command::Spin(dps(401.0))).contains("400"));
    assert!(refused(Command::Fidget(3)).contains("table"));
    let heading = Some(1.0);
    let up = [1.0, 0.0, 0.0];
    assert!(refused(Command::Move { up, heading }).contains("outer axis"));
    assert!(!table.busy(0.0));
    // About the vertical only if the inner axis is upright.
    table.command(0.0, Command::Rate(dps(10.0))).unwrap();
    table.command(0.0, go(up)).unwrap();
    let refusal = table.command(0.0, Command::Rate(dps(10.0))).unwrap_err();
    assert!(
        refusal.contains("no vertical axis in this pose"),
        "{refusal}"
    );
    // A first pose that is out of reach is refused with its line.
    let plan = plan("[[step]]\nup = [0, 0, -1]\ndwell_s = 1");
    let refusal = Table::commanded(&plan, &truth).unwrap_err();
    assert!(refusal.starts_with("PLAN.toml:"), "{refusal}");
}

fn hand(truth: &HandsTruth, seed: u64) -> Hands {
    Hands::commanded(&at_rest(), truth, seed).unwrap()
}

const FACES: [Vector; 6] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, -1.0],
    [-1.0, 0.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.0, 0.0, 1.0],
];

#[test]
fn a_hand_that_moves_in_every_third_pose_does_so_after_it_has_come_to_rest_and_in_no_other() {
    let truth = HandsTruth {
        jolt_probability: 0.0,
        ..HandsTruth::default()
    };
    let mut moved = Vec::new();
    let mut told = hand(&truth, 5);
    let mut course = Course::new(&mut told);
    course.tell(Command::Fidget(3));
    for up in FACES.iter().cycle().take(9) {
        course.tell(go(*up));
        course.wait();
        let first = course.run(0.5).attitude;
        let last = course.run(8.0);
        assert!(norm(last.rate) < 1e-4, "it lies still again");
        let turned = (first.inverse() * last.attitude).axis_angle().1;
        moved.push(turned.to_degrees());
    }
    for (k, turned) in moved.iter().enumerate() {
        let wanted = if k % 3 == 2 { 2.9..8.1 } else { -1.0..1e-6 };
        assert!(wanted.contains(turned), "pose {k}: {turned} degrees");
    }
}
