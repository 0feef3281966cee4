//! The bench in front of the converter: voltages at its pins at any instant of the virtual clock.

use std::fmt;

use mimu_rig::filter::LowPass;
use mimu_rig::hands::Hands;
use mimu_rig::motion::Carrier;
use mimu_rig::pins::Pins;
use mimu_rig::plan::{CarriedBy, Plan};
use mimu_rig::random::Random;
use mimu_rig::rig_file::RigTruth;
use mimu_rig::table::Table;
use mimu_rig::unit::Unit;

use crate::schematic::{Drives, Filters, Volts};

/// Steps of the physics per second. One for each conversion of a firmware that scans ten inputs twice a
/// millisecond; faster ones are served by straight lines, which the slowest filter (1.6 kHz) leaves nothing of.
const STEPS_PER_S: u64 = 20_000;
const STEP_NS: u64 = 1_000_000_000 / STEPS_PER_S;

/// Change of an ADXRS300's output by its inputs ST1 and ST2, V, typically (data sheet, recalled: 150 to 450 mV).
const SELF_TEST_V: [f64; 2] = [-0.27, 0.27];

/// Bandwidth of the gyros, Hz, which the deflection passes like any rate.
const GYRO_BANDWIDTH_HZ: f64 = 40.0;

/// Sensitivity of an MMA7260QT by g-Select2 and g-Select1 as a binary number, over that of its finest range: 800, 600,
/// 300 and 200 mV/g.
const RANGES: [f64; 4] = [1.0, 0.75, 0.375, 0.25];

/// What stands in front of the pins.
pub enum Front {
    /// Voltages that a test sets, without noise.
    Still(Volts),
    /// A unit that is carried through a plan.
    Bench(Box<Bench>),
}

impl Front {
    /// A unit of known truth carried through a plan, which begins as the board is switched on first. Behind the
    /// plan's end the last instant lasts.
    ///
    /// Errors: the plan asks for what the table cannot do, or a sensor is not analog.
    pub fn bench(plan: &Plan, truth: &RigTruth, seed: u64) -> Result<Self, String> {
        for (kind, triad) in [("gyro", &truth.unit.gyro), ("accel", &truth.unit.accel)] {
            if !triad.analog {
                return Err(format!(
                    "rig: `unit.{kind}` is a digital part, and the board's pins are analog; name one with \
                     output in volts"
                ));
            }
        }
        let mut at = plan.clone();
        if !truth.earth_rate {
            at.place.rotation = 0.0;
        }
        let mut carrier: Box<dyn Carrier + Send> = match plan.carrier {
            CarriedBy::Table => Box::new(Table::new(&at, &truth.table)?),
            CarriedBy::Hands => Box::new(Hands::new(&at, &truth.hands, seed)?),
        };
        let dt_s = 1.0 / STEPS_PER_S as f64;
        let mut unit = Unit::new(&truth.unit, seed, dt_s);
        let mut filters = Filters::new(dt_s);
        let pins = unit.step(&carrier.at(0.0).motion, plan.chamber_c(0.0));
        let first = filters.step(&pins);
        Ok(Self::Bench(Box::new(Bench {
            plan: at,
            carrier,
            unit,
            filters,
            before: first,
            after: first,
            began_ns: 0,
            steps: 0,
            drives: Drives::default(),
            deflection: LowPass::of_bandwidth(GYRO_BANDWIDTH_HZ, dt_s),
            accel_null: truth.unit.accel.axes.each_ref().map(|a| a.null),
            accel_supply_v: truth.unit.supply.nominal_v,
            noise_v: truth.converter.noise_codes * pins.converter_reference_v
                / f64::from(truth.converter.bits).exp2(),
            stream: Random::new(seed, "converter noise"),
        })))
    }

    /// The same, with the plan's beginning at an instant, ns, that is not yet past.
    pub fn begun_at(mut self, ns: u64) -> Self {
        if let Self::Bench(bench) = &mut self {
            bench.began_ns = ns;
        }
        self
    }

    /// What the microcontroller drives from now on.
    pub fn drive(&mut self, drives: Drives) {
        if let Self::Bench(bench) = self {
            bench.drives = drives;
        }
    }

    /// Voltages at an instant, ns. Instants do not go back.
    pub fn at(&mut self, ns: u64) -> Volts {
        match self {
            Self::Still(volts) => *volts,
            Self::Bench(bench) => bench.at(ns),
        }
    }
}

impl fmt::Debug for Front {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Still(volts) => f.debug_tuple("Still").field(volts).finish(),
            Self::Bench(bench) => f.debug_tuple("Bench").field(&bench.steps).finish(),
        }
    }
}

/// A plan being carried out in front of the pins.
pub struct Bench {
    plan: Plan,
    carrier: Box<dyn Carrier + Send>,
    unit: Unit,
    filters: Filters,
    /// At the steps `steps - 1` and `steps`.
    before: Volts,
    after: Volts,
    /// The virtual clock at step 0.
    began_ns: u64,
    steps: u64,
    drives: Drives,
    /// Self-test of the gyros behind their filter, V.
    deflection: LowPass,
    /// Output without input, V at the nominal supply, and that.
    accel_null: [f64; 3],
    accel_supply_v: f64,
    noise_v: f64,
    stream: Random,
}

impl Bench {
    /// What the sensors' own inputs do to their outputs.
    fn deflect(&mut self, pins: &mut Pins) {
        let [st1, st2] = SELF_TEST_V;
        let of = |on: bool, v: f64| if on { v } else { 0.0 };
        let deflected = of(self.drives.st1, st1) + of(self.drives.st2, st2);
        let deflection = self.deflection.step(deflected);
        for v in &mut pins.gyro_v {
            *v += deflection;
        }
        let [low, high] = self.drives.g_select.map(usize::from);
        let range = RANGES[2 * high + low];
        for (v, null) in pins.accel_v.iter_mut().zip(self.accel_null) {
            let null = null * pins.supply_v / self.accel_supply_v;
            *v = null + range * (*v - null);
        }
    }

    fn at(&mut self, ns: u64) -> Volts {
        let ns = ns.saturating_sub(self.began_ns);
        while self.steps * STEP_NS <= ns {
            self.steps += 1;
            let t_s = self.steps as f64 / STEPS_PER_S as f64;
            let motion = self.carrier.at(t_s.min(self.carrier.duration_s())).motion;
            let mut pins = self.unit.step(&motion, self.plan.chamber_c(t_s));
            self.deflect(&mut pins);
            self.before = std::mem::replace(&mut self.after, self.filters.step(&pins));
        }
        let since = ns - (self.steps - 1) * STEP_NS;
        let mut volts = self
            .before
            .between(&self.after, since as f64 / STEP_NS as f64);
        // One input is converted at an instant, so that one draw is each conversion's own.
        let noise = self.noise_v * self.stream.normal();
        for v in &mut volts.input {
            *v += noise;
        }
        volts
    }
}
