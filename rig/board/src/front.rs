//! The bench in front of the converter, or of a digital sensor: voltages at the pins, or what the sensor senses, at any time of the virtual clock.

use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use mimu_rig::command::{Command, Commanded, Position};
use mimu_rig::filter::LowPass;
use mimu_rig::hands::Hands;
use mimu_rig::motion::{Carrier, Instant, Motion};
use mimu_rig::pins::Pins;
use mimu_rig::plan::{CarriedBy, Plan};
use mimu_rig::random::Random;
use mimu_rig::rig_file::RigTruth;
use mimu_rig::table::Table;
use mimu_rig::unit::Unit;

use crate::inertial::{Feed, Sensed};
use crate::schematic::{Drives, Filters, Volts};

/// Steps of the physics per second: one per conversion of a firmware that scans ten inputs twice a millisecond. Faster conversions are interpolated
/// linearly; even the widest filter (1.6 kHz) makes the error negligible.
const STEPS_PER_S: u64 = 20_000;
const STEP_NS: u64 = 1_000_000_000 / STEPS_PER_S;

/// Typical change of an ADXRS300's output by its inputs ST1 and ST2, V (data sheet, from memory: 150 to 450 mV).
const SELF_TEST_V: [f64; 2] = [-0.27, 0.27];

/// Bandwidth of the gyros, Hz; it filters the deflection like a rate.
const GYRO_BANDWIDTH_HZ: f64 = 40.0;

/// Sensitivity of an MMA7260QT by g-Select2 and g-Select1 as a binary number, over that of its finest range: 800, 600,
/// 300 and 200 mV/g.
const RANGES: [f64; 4] = [1.0, 0.75, 0.375, 0.25];

/// Source of the voltages at the pins.
pub enum Front {
    /// Fixed voltages that a test sets, without noise.
    Still(Volts),
    /// A unit that is moved through a plan, or by commands. A digital sensor shares it with the bench's commands.
    Bench(Arc<Mutex<Bench>>),
}

/// Where the sensors' outputs go.
#[derive(Clone, Copy)]
enum Output {
    /// To the converter's pins.
    Analog,
    /// Nowhere: the sensor is digital, and senses with the unit's errors. The board's crystal relative to its nominal frequency: the bench keeps the
    /// crystal's time.
    Digital { crystal: f64 },
}

/// Counts of an ICM-42688-P per deg/s and per g: what the unit's outputs, with its errors, are converted with.
const PER_DPS: f64 = 131.072;
const PER_G: f64 = 8192.0;

impl Front {
    /// A unit of known truth moved through a plan, which begins when the board is first switched on. After the end of the plan its last state
    /// remains.
    ///
    /// Errors: the plan exceeds the table's abilities, or a sensor is not analog.
    pub fn bench(plan: &Plan, truth: &RigTruth, seed: u64) -> Result<Self, String> {
        Self::planned(plan, truth, seed, Output::Analog)
    }

    /// The same with a digital sensor, an ICM-42688-P, for [`Board::matek`](crate::running::Board::matek). `crystal` as there.
    ///
    /// Errors: the plan exceeds the table's abilities, or a sensor is not digital.
    pub fn digital(plan: &Plan, truth: &RigTruth, seed: u64, crystal: f64) -> Result<Self, String> {
        Self::planned(plan, truth, seed, Output::Digital { crystal })
    }

    fn planned(plan: &Plan, truth: &RigTruth, seed: u64, output: Output) -> Result<Self, String> {
        let carrier = |at: &Plan| {
            Ok(Carried::Plan(match at.carrier {
                CarriedBy::Table => Box::new(Table::new(at, &truth.table)?),
                CarriedBy::Hands => Box::new(Hands::new(at, &truth.hands, seed)?),
            }))
        };
        Self::carried(plan, truth, carrier, seed, output)
    }

    /// A unit of known truth that is moved by [`Front::command`]. The plan provides carrier, place, lead-in, chamber and first pose; its steps are
    /// not carried out.
    ///
    /// Errors: the table cannot reach the first pose, or a sensor is not analog.
    pub fn commanded(plan: &Plan, truth: &RigTruth, seed: u64) -> Result<Self, String> {
        Self::by_commands(plan, truth, seed, Output::Analog)
    }

    /// The same with a digital sensor, as [`Front::digital`].
    ///
    /// Errors: the table cannot reach the first pose, or a sensor is not digital.
    pub fn commanded_digital(
        plan: &Plan,
        truth: &RigTruth,
        seed: u64,
        crystal: f64,
    ) -> Result<Self, String> {
        Self::by_commands(plan, truth, seed, Output::Digital { crystal })
    }

    fn by_commands(
        plan: &Plan,
        truth: &RigTruth,
        seed: u64,
        output: Output,
    ) -> Result<Self, String> {
        let carrier = |at: &Plan| {
            Ok(Carried::Commands(match at.carrier {
                CarriedBy::Table => Box::new(Table::commanded(at, &truth.table)?),
                CarriedBy::Hands => Box::new(Hands::commanded(at, &truth.hands, seed)?),
            }))
        };
        Self::carried(plan, truth, carrier, seed, output)
    }

    fn carried(
        plan: &Plan,
        truth: &RigTruth,
        carrier: impl FnOnce(&Plan) -> Result<Carried, String>,
        seed: u64,
        output: Output,
    ) -> Result<Self, String> {
        for (kind, triad) in [("gyro", &truth.unit.gyro), ("accel", &truth.unit.accel)] {
            match output {
                Output::Analog if !triad.analog => {
                    return Err(format!(
                        "rig: `unit.{kind}` is a digital part, but the board's pins are analog; name a part with output in volts"
                    ));
                }
                Output::Digital { .. } if triad.analog => {
                    return Err(format!(
                        "rig: `unit.{kind}` is an analog part, but the board's sensor is digital; name ICM-42688-P-{kind}"
                    ));
                }
                _ => {}
            }
        }
        let mut at = plan.clone();
        if !truth.earth_rate {
            at.place.rotation = 0.0;
        }
        let mut carrier = carrier(&at)?;
        let dt_s = 1.0 / STEPS_PER_S as f64;
        let mut unit = Unit::new(&truth.unit, seed, dt_s);
        let mut filters = Filters::new(dt_s);
        let motion = carrier.at(0.0).motion;
        let pins = unit.step(&motion, plan.chamber_c(0.0));
        let first = filters.step(&pins);
        Ok(Self::Bench(Arc::new(Mutex::new(Bench {
            plan: at,
            carrier,
            motion,
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
            output,
            pins,
        }))))
    }

    fn unit(&self) -> Option<MutexGuard<'_, Bench>> {
        match self {
            Self::Still(_) => None,
            // A thread that panicked with it has ended the test already.
            Self::Bench(bench) => Some(bench.lock().unwrap_or_else(PoisonError::into_inner)),
        }
    }

    fn required(&self) -> Result<MutexGuard<'_, Bench>, String> {
        self.unit().ok_or_else(|| NO_UNIT.into())
    }

    /// What the digital sensor of the unit senses, for [`Inertial`](crate::inertial).
    ///
    /// Errors: there is no unit with a digital sensor.
    pub(crate) fn feed(&self) -> Result<Feed, String> {
        match self {
            Self::Bench(bench) if self.crystal().is_some() => {
                let bench = bench.clone();
                Ok(Box::new(move |ns| {
                    let mut bench = bench.lock().unwrap_or_else(PoisonError::into_inner);
                    bench.sensed(ns)
                }))
            }
            _ => Err("the unit at the bench has no digital sensor".into()),
        }
    }

    /// The crystal of a board with a digital sensor, relative to its nominal frequency.
    pub(crate) fn crystal(&self) -> Option<f64> {
        match self.unit()?.output {
            Output::Analog => None,
            Output::Digital { crystal } => Some(crystal),
        }
    }

    /// The same, with the plan beginning at a time, ns, that is not yet past.
    pub fn begun_at(self, ns: u64) -> Self {
        if let Some(mut bench) = self.unit() {
            bench.began_ns = ns;
        }
        self
    }

    /// Sets what the microcontroller drives from now on.
    pub fn drive(&mut self, drives: Drives) {
        if let Some(mut bench) = self.unit() {
            bench.drives = drives;
        }
    }

    /// What holds the unit, if there is one.
    pub fn carried_by(&self) -> Option<CarriedBy> {
        self.unit().map(|bench| bench.plan.carrier)
    }

    /// Gives a command to the table or the person, from a time on, ns.
    ///
    /// Errors: it cannot do this, or it carries out a plan; a one-line message names the alternative.
    pub fn command(&mut self, ns: u64, command: Command) -> Result<(), String> {
        let mut bench = self.required()?;
        let t_s = bench.advanced(ns);
        bench.taking_commands()?.command(t_s, command)
    }

    /// Whether it is still moving by command at a time, ns.
    ///
    /// Errors: it carries out a plan.
    pub fn busy(&mut self, ns: u64) -> Result<bool, String> {
        let mut bench = self.required()?;
        let t_s = bench.advanced(ns);
        Ok(bench.taking_commands()?.busy(t_s))
    }

    /// Its commanded position at a time, ns.
    ///
    /// Errors: it carries out a plan.
    pub fn position(&mut self, ns: u64) -> Result<Position, String> {
        let mut bench = self.required()?;
        let t_s = bench.advanced(ns);
        Ok(bench.taking_commands()?.position(t_s))
    }

    /// Brings the chamber to a temperature (°C) from a time (ns) on: at a steady rate (K/s), or at once.
    ///
    /// Errors: there is no chamber.
    pub fn set_chamber(&mut self, ns: u64, to_c: f64, rate: Option<f64>) -> Result<(), String> {
        let mut bench = self.required()?;
        let t_s = bench.advanced(ns);
        let from_c = bench.plan.chamber_c(t_s);
        let ramp_s = rate.map_or(0.0, |rate| (to_c - from_c).abs() / rate);
        bench.plan.chamber = match ramp_s > 0.0 {
            true => vec![[t_s, from_c], [t_s + ramp_s, to_c]],
            false => vec![[t_s, to_c]],
        };
        Ok(())
    }

    /// Temperature of the chamber's air at a time, ns, °C.
    ///
    /// Errors: there is no chamber.
    pub fn chamber_c(&mut self, ns: u64) -> Result<f64, String> {
        let mut bench = self.required()?;
        let t_s = bench.advanced(ns);
        Ok(bench.plan.chamber_c(t_s))
    }

    /// The true motion of the unit at a time, ns, or up to 50 µs after it.
    ///
    /// Errors: there is no unit.
    pub fn motion(&mut self, ns: u64) -> Result<Motion, String> {
        let mut bench = self.required()?;
        bench.advanced(ns);
        Ok(bench.motion)
    }

    /// Advances the unit to a time, ns, when no voltages are needed.
    pub fn advance(&mut self, ns: u64) {
        if let Some(mut bench) = self.unit() {
            bench.advanced(ns);
        }
    }

    /// Voltages at a time, ns. Times must not decrease.
    pub fn at(&mut self, ns: u64) -> Volts {
        match self {
            Self::Still(volts) => *volts,
            Self::Bench(bench) => {
                let mut bench = bench.lock().unwrap_or_else(PoisonError::into_inner);
                match bench.output {
                    Output::Analog => bench.at(ns),
                    Output::Digital { .. } => Volts::GROUND,
                }
            }
        }
    }
}

impl fmt::Debug for Front {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Still(volts) => f.debug_tuple("Still").field(volts).finish(),
            Self::Bench(_) => {
                let steps = self.unit().map(|bench| bench.steps);
                f.debug_tuple("Bench").field(&steps).finish()
            }
        }
    }
}

/// Message if fixed voltages replace the unit.
const NO_UNIT: &str = "no unit is at the pins of the board; start the bench with --unit";

/// What moves the unit: a plan or commands.
enum Carried {
    Plan(Box<dyn Carrier + Send>),
    Commands(Box<dyn Commanded + Send>),
}

impl Carried {
    fn at(&mut self, t_s: f64) -> Instant {
        match self {
            Self::Plan(carrier) => carrier.at(t_s.min(carrier.duration_s())),
            Self::Commands(carrier) => carrier.at(t_s),
        }
    }
}

/// A moving unit in front of the pins.
pub struct Bench {
    plan: Plan,
    carrier: Carried,
    /// Motion at the step number `steps`.
    motion: Motion,
    unit: Unit,
    filters: Filters,
    /// Voltages at the steps `steps - 1` and `steps`.
    before: Volts,
    after: Volts,
    /// Virtual time at step 0.
    began_ns: u64,
    steps: u64,
    drives: Drives,
    /// Self-test of the gyros behind their filter, V.
    deflection: LowPass,
    /// Output without input, V at the nominal supply, and the nominal supply, V.
    accel_null: [f64; 3],
    accel_supply_v: f64,
    noise_v: f64,
    stream: Random,
    output: Output,
    /// The unit's outputs at the step number `steps`.
    pins: Pins,
}

impl Bench {
    /// Applies the sensors' own inputs (self-test, range) to their outputs.
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

    /// Advances to a time, ns, and returns the time of the last step, s since the plan or the lead-in began: computed steps cannot be changed any
    /// more.
    fn advanced(&mut self, ns: u64) -> f64 {
        let ns = match self.output {
            Output::Analog => ns,
            Output::Digital { crystal } => (ns as f64 * crystal) as u64,
        };
        self.advance(ns.saturating_sub(self.began_ns));
        self.t_s()
    }

    fn taking_commands(&mut self) -> Result<&mut (dyn Commanded + Send + 'static), String> {
        match &mut self.carrier {
            Carried::Plan(_) => {
                Err("the unit follows a plan; start the bench with --control to command it".into())
            }
            Carried::Commands(carrier) => Ok(&mut **carrier),
        }
    }

    /// What the digital sensor senses at a time, ns by the crystal, or up to 50 µs after it.
    fn sensed(&mut self, ns: u64) -> Sensed {
        self.advance(ns.saturating_sub(self.began_ns));
        Sensed {
            rate_dps: self.pins.gyro_v.map(|counts| counts / PER_DPS),
            force_g: self.pins.accel_v.map(|counts| counts / PER_G),
            die_c: self.pins.temp_c,
        }
    }

    /// Time of the last step, s.
    fn t_s(&self) -> f64 {
        self.steps as f64 / STEPS_PER_S as f64
    }

    /// Steps until the last step is not before a time, ns since the start.
    fn advance(&mut self, ns: u64) {
        while self.steps * STEP_NS <= ns {
            self.steps += 1;
            let t_s = self.t_s();
            self.motion = self.carrier.at(t_s).motion;
            let mut pins = self.unit.step(&self.motion, self.plan.chamber_c(t_s));
            if matches!(self.output, Output::Digital { .. }) {
                self.pins = pins;
                continue;
            }
            self.deflect(&mut pins);
            self.before = std::mem::replace(&mut self.after, self.filters.step(&pins));
        }
    }

    fn at(&mut self, ns: u64) -> Volts {
        let ns = ns.saturating_sub(self.began_ns);
        self.advance(ns);
        let since = ns - (self.steps - 1) * STEP_NS;
        let mut volts = self
            .before
            .between(&self.after, since as f64 / STEP_NS as f64);
        // One input is converted at a time, so each conversion gets its own draw.
        let noise = self.noise_v * self.stream.normal();
        for v in &mut volts.input {
            *v += noise;
        }
        volts
    }
}
