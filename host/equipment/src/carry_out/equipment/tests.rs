use std::sync::{Arc, Mutex};

use mimu::plan::{Plan, TableAxis};
use mimu_device::record::Procedure;

use super::*;
use crate::drive::{Abilities, ChamberLimits, Limits};

/// A table and a chamber that record their commands.
#[derive(Clone)]
struct Scripted {
    told: Arc<Mutex<Vec<String>>>,
    busy: Arc<Mutex<u32>>,
    open: Arc<Mutex<bool>>,
    can: Abilities,
}

impl Scripted {
    fn new() -> Self {
        Self {
            told: Arc::default(),
            busy: Arc::default(),
            open: Arc::default(),
            can: Abilities {
                place: "all.toml".into(),
                moves: true,
                rates: true,
                turns: vec![TableAxis::Middle],
                limits: Limits {
                    rate_dps: Some(100.0),
                    middle_deg: Some(120.0),
                    turn_dps: Some(30.0),
                },
                chamber: Some(ChamberLimits {
                    from_c: -20.0,
                    to_c: 80.0,
                    c_per_min: Some(3.0),
                    rest_c: 23.0,
                }),
            },
        }
    }

    fn keep(&self, what: String) -> Result<()> {
        self.told.lock().unwrap().push(what);
        Ok(())
    }

    fn told(&self) -> Vec<String> {
        self.told.lock().unwrap().clone()
    }
}

impl Driver for Scripted {
    fn interlock(&mut self) -> Result<Option<String>> {
        Ok((*self.open.lock().unwrap()).then(|| "the interlock is open".into()))
    }

    fn go(&mut self, step: &Step) -> Result<()> {
        self.keep(format!("go {:?} {}", step.up, step.rate_dps))
    }

    fn busy(&mut self) -> Result<bool> {
        let mut left = self.busy.lock().unwrap();
        *left = left.saturating_sub(1);
        Ok(*left > 0)
    }

    fn stop(&mut self) -> Result<()> {
        self.keep("stop".into())
    }

    fn power_cycle(&mut self) -> Result<bool> {
        Ok(false)
    }

    fn abilities(&self) -> Abilities {
        self.can.clone()
    }

    fn turn(&mut self, turn: &Turn) -> Result<()> {
        self.keep(format!("turn {}", turn.angle_deg))
    }

    fn set_chamber(&mut self, temp_c: f64) -> Result<()> {
        self.keep(format!("set {temp_c}"))
    }
}

fn procedure(body: &str) -> Procedure {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plan.toml");
    let head = "format = \"mimu-plan/1\"\nsample_rate_hz = 1000.0\ncarrier = \"table\"\n";
    std::fs::write(&path, format!("{head}{body}")).unwrap();
    let plan = Plan::read(&path).unwrap();
    Procedure::of(&plan, 9.8, "plan.toml").unwrap()
}

const REST: &str = "[[step]]\nup = [0.0, 0.0, 1.0]\ndwell_s = 10.0\n";

fn warm(steps: &str) -> Procedure {
    procedure(&format!(
        "chamber_c = [[0.0, 10.0], [1200.0, 50.0]]\n{steps}"
    ))
}

fn equipped(procedure: &Procedure, drivers: &[&Scripted]) -> Result<Equipped> {
    let drivers = drivers.iter().copied().cloned();
    let drivers = drivers.map(|d| Box::new(d) as Box<dyn Driver>);
    Equipped::new(procedure, "plan.toml", drivers.collect())
}

fn news(equipment: &mut Equipment, until: impl Fn(&Equipment) -> bool) -> Option<Error> {
    let since = Instant::now();
    while !until(equipment) {
        if let Some(error) = equipment.take_news() {
            return Some(error);
        }
        assert!(
            since.elapsed() < Duration::from_secs(300),
            "nothing happens"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
    None
}

#[test]
fn orders_are_done_in_order_and_in_the_end_all_of_it_is_at_rest() {
    let all = Scripted::new();
    let mut equipment = Equipment::start(equipped(&warm(REST), &[&all]).unwrap()).unwrap();
    *all.busy.lock().unwrap() = 3;
    equipment.order(Order::Set(10.0));
    equipment.order(Order::Go(Step {
        up: [1.0, 0.0, 0.0],
        rate_dps: 20.0,
        dwell_s: 1.0,
    }));
    assert!(!equipment.is_done());
    assert!(news(&mut equipment, Equipment::is_done).is_none());
    equipment.order(Order::Halt);
    assert!(equipment.rest().is_empty());
    let told = ["set 10", "go [1.0, 0.0, 0.0] 20", "stop", "stop", "set 23"];
    assert_eq!(all.told(), told);
}

#[test]
fn an_interlock_that_opens_on_the_way_ends_it_with_the_chamber_safe() {
    let all = Scripted::new();
    let mut equipment = Equipment::start(equipped(&warm(REST), &[&all]).unwrap()).unwrap();
    equipment.order(Order::Set(50.0));
    *all.open.lock().unwrap() = true;
    let error = news(&mut equipment, |_| false).unwrap().to_string();
    assert!(error.contains("interlock is open"), "{error}");
    drop(equipment);
    assert_eq!(all.told(), ["set 50", "stop", "set 23"]);
}

#[test]
fn what_nobody_has_touched_is_left_as_it_is() {
    let all = Scripted::new();
    let equipment = Equipment::start(equipped(&warm(REST), &[&all]).unwrap()).unwrap();
    assert!(equipment.rest().is_empty() && all.told().is_empty());
}

#[test]
fn what_the_drivers_lack_is_said_before_anything_moves() {
    let all = Scripted::new();
    let (mut table, mut chamber, mut fixed) = (all.clone(), all.clone(), all.clone());
    table.can.chamber = None;
    table.can.place = "table.toml".into();
    chamber.can.moves = false;
    chamber.can.place = "chamber.toml".into();
    (fixed.can.rates, fixed.can.turns) = (false, Vec::new());
    let pose = "[[step]]\nup = [1.0, 0.0, 0.0]\ndwell_s = 1.0\n";
    let spins = "[[step]]\nup = [1.0, 0.0, 0.0]\nrate_dps = 50.0\ndwell_s = 1.0\n";
    let turns = "[[step]]\nturn_axis = \"middle\"\nturn_deg = 90.0\nturn_dps = 10.0\n";
    let turns = format!("{REST}{turns}");
    let moves = format!("{REST}{pose}");
    let fast = spins.replace("50.0", "200.0");
    let swift = turns.replace("10.0\n", "60.0\n");
    let over = "[[step]]\nup = [0.0, 0.0, -1.0]\ndwell_s = 1.0\n";
    let cases: [(&str, &[&Scripted], &str); 11] = [
        (&moves, &[&chamber], "chamber.toml has none"),
        (&moves, &[], "no driver is given"),
        (&moves, &[&table], "table.toml has none"),
        (&moves, &[&table, &all], "has `move` too"),
        (&moves, &[&chamber, &all], "has [chamber] too"),
        (spins, &[&fixed], "at a rate"),
        (&turns, &[&fixed], "turn.middle"),
        (&fast, &[&all], "rate_dps = 100"),
        (&swift, &[&all], "turn_dps = 30"),
        (over, &[&all], "middle_deg = 120"),
        (REST, &[&table], "need a chamber"),
    ];
    for (steps, drivers, words) in cases {
        let Err(error) = equipped(&warm(steps), drivers) else {
            panic!("not refused: {words}");
        };
        let line = error.to_string();
        assert!(line.contains(words) && !line.contains('\n'), "{line}");
    }
    for (chamber_c, words) in [
        ("[[0.0, 10.0], [1200.0, 90.0]]", "-20 to 80"),
        ("[[0.0, 10.0], [60.0, 20.0]]", "10.00 K/min"),
    ] {
        let plan = procedure(&format!("chamber_c = {chamber_c}\n{REST}"));
        let line = equipped(&plan, &[&all]).err().unwrap().to_string();
        assert!(line.contains(words), "{line}");
    }
    // Two files, one for the table and one for the chamber; or a person who changes the temperature of a unit at rest.
    assert!(equipped(&warm(&moves), &[&table, &chamber]).is_ok());
    assert!(equipped(&warm(REST), &[&chamber]).is_ok());
    assert!(equipped(&warm(REST), &[]).is_ok());
    *all.open.lock().unwrap() = true;
    assert!(equipped(&warm(REST), &[&all]).is_err());
    assert!(all.told().is_empty());
}
