//! Commands to the bench of a served board: one command per line, SCPI style, and one line as the answer.

use mimu_rig::command::Command;
use mimu_rig::motion::Motion;
use mimu_rig::plan::{CarriedBy, TableAxis, Turn};
use mimu_rig::rotation::direction;

use super::{SLICE_NS, Served};
use crate::front::Front;
use crate::interference::MILLION;
use crate::running::Board;

/// Every command with its arguments, in the order of docs/bench.md.
pub const COMMANDS: [(&str, &str); 25] = [
    ("*IDN?", ""),
    ("TIME?", ""),
    ("PORT?", ""),
    ("TRAFFIC?", ""),
    ("INTERLOCK", "0|1"),
    ("INTERLOCK?", ""),
    ("MOVE", "ux uy uz [heading_deg]"),
    ("RATE", "dps"),
    ("SPIN", "dps"),
    ("TURN", "outer|middle|inner deg dps"),
    ("STOP", ""),
    ("HOLD", "ON|OFF"),
    ("FIDGET", "n"),
    ("BUSY?", ""),
    ("POSITION?", ""),
    ("CHAMBER", "c [c_per_min]"),
    ("CHAMBER?", ""),
    ("POWER", "ON|OFF"),
    ("POWER?", ""),
    ("RESET", ""),
    ("GARBLE", "ppm"),
    ("BURST", "n"),
    ("LINK", "ON|OFF"),
    ("LINK?", ""),
    ("TRUTH?", ""),
];

/// State of the bench beside the board and its port.
#[derive(Debug)]
pub(super) struct BenchState {
    seed: u64,
    /// The interlock is closed: motions are allowed.
    interlock: bool,
    /// Since when the supply is off, ns.
    off_ns: Option<u64>,
    /// Number of cuts and resets so far; each interrupts the word in flight differently.
    torn: u64,
}

impl BenchState {
    pub(super) fn new(seed: u64) -> Self {
        Self {
            seed,
            interlock: true,
            off_ns: None,
            torn: 0,
        }
    }

    /// Whether the supply is off.
    pub(super) fn is_off(&self) -> bool {
        self.off_ns.is_some()
    }
}

/// Why there is no answer.
enum Problem {
    /// The bench refuses the command and continues.
    Refused(String),
    /// The bench cannot continue.
    Broken(String),
}

impl From<String> for Problem {
    fn from(broken: String) -> Self {
        Self::Broken(broken)
    }
}

fn refused<T>(why: impl Into<String>) -> Result<T, Problem> {
    Err(Problem::Refused(why.into()))
}

/// A command and its arguments.
struct Line<'a> {
    name: String,
    arguments: Vec<&'a str>,
    usage: String,
}

impl<'a> Line<'a> {
    fn parse(line: &'a str) -> Result<Self, Problem> {
        let mut words = line
            .split(|c: char| c.is_whitespace() || c == ',')
            .filter(|word| !word.is_empty());
        let Some(name) = words.next() else {
            return refused("the line is empty; send one command on each");
        };
        let name = name.to_uppercase();
        let Some((_, form)) = COMMANDS.iter().find(|(known, _)| *known == name) else {
            let known = COMMANDS.map(|(known, _)| known).join(" ");
            return refused(format!("`{name}`: unknown command; known are {known}"));
        };
        let arguments: Vec<&str> = words.collect();
        let most = form.split_whitespace().count();
        let least = most - form.matches('[').count();
        let usage = format!("send `{}`", format!("{name} {form}").trim_end());
        if !(least..=most).contains(&arguments.len()) {
            return refused(format!("`{name}`: {} arguments; {usage}", arguments.len()));
        }
        Ok(Self {
            name,
            arguments,
            usage,
        })
    }

    /// The argument `k`, if present: a number within a range.
    fn number(&self, k: usize, [low, high]: [f64; 2]) -> Result<Option<f64>, Problem> {
        let Some(word) = self.arguments.get(k) else {
            return Ok(None);
        };
        let Self { name, usage, .. } = self;
        match word.parse::<f64>() {
            Ok(x) if x >= low && x <= high => Ok(Some(x)),
            Ok(_) => refused(format!(
                "`{name}`: {word} is not within {low} to {high}; {usage}"
            )),
            Err(_) => refused(format!("`{name}`: `{word}` is not a number; {usage}")),
        }
    }

    /// As [`Line::number`], for a mandatory argument.
    fn required(&self, k: usize, range: [f64; 2]) -> Result<f64, Problem> {
        // The number of arguments was checked before.
        Ok(self.number(k, range)?.unwrap_or(range[0]))
    }

    /// The first argument, an integer up to `most`.
    fn count(&self, most: u32) -> Result<u32, Problem> {
        let x = self.required(0, [0.0, f64::from(most)])?;
        match x.fract() == 0.0 {
            true => Ok(x as u32),
            false => refused(format!(
                "`{}`: {x} is not a whole number; {}",
                self.name, self.usage
            )),
        }
    }

    /// The first argument, on or off.
    fn switch(&self) -> Result<bool, Problem> {
        let word = self.arguments.first().copied().unwrap_or_default();
        match word.to_uppercase().as_str() {
            "ON" | "1" => Ok(true),
            "OFF" | "0" => Ok(false),
            _ => refused(format!("`{}`: `{word}`; {}", self.name, self.usage)),
        }
    }
}

impl Served {
    /// Carries out a line, and returns the answer.
    ///
    /// Errors: the emulator, the terminal or the file gave up.
    pub(super) fn answer(&mut self, line: &str) -> Result<String, String> {
        match Line::parse(line).and_then(|line| self.carry_out(&line)) {
            Ok(value) if value.is_empty() => Ok("OK".into()),
            Ok(value) => Ok(value),
            Err(Problem::Refused(why)) => Ok(format!("ERR {why}")),
            Err(Problem::Broken(why)) => Err(why),
        }
    }

    /// The requested value; empty if none was requested.
    fn carry_out(&mut self, line: &Line<'_>) -> Result<String, Problem> {
        let done = Ok(String::new());
        // More than any centrifuge.
        let rate = || Ok::<f64, Problem>(line.required(0, [-36e3, 36e3])?.to_radians());
        match line.name.as_str() {
            "*IDN?" => return self.identity(),
            "TIME?" => {
                let ns = self.board.state().ns;
                return Ok(format!("{}.{:09}", ns / 1_000_000_000, ns % 1_000_000_000));
            }
            "PORT?" => return Ok(self.path().display().to_string()),
            "TRAFFIC?" => return Ok(self.traffic.to_string()),
            "INTERLOCK?" => return bit(self.bench.interlock),
            "POWER?" => return bit(!self.bench.is_off()),
            "LINK?" => return bit(self.port.is_plugged()),
            "BUSY?" => return bit(self.at_front(|front, ns| front.busy(ns))?),
            "CHAMBER?" => {
                let c = self.at_front(|front, ns| front.chamber_c(ns))?;
                return Ok(rounded(c, 6));
            }
            "POSITION?" => {
                let position = self.at_front(|front, ns| front.position(ns))?;
                let heading = position.heading.map_or(f64::NAN, f64::to_degrees);
                let up = position.up.map(|x| rounded(x, 9));
                return Ok(format!("{} {}", up.join(" "), rounded(heading, 6)));
            }
            "TRUTH?" => {
                let motion = self.at_front(|front, ns| front.motion(ns))?;
                return Ok(written(&motion));
            }
            "INTERLOCK" => {
                self.bench.interlock = line.switch()?;
                if !self.bench.interlock {
                    // Like an opened door, this stops a table; a plan continues.
                    let stop = |front: &mut Front, ns| front.command(ns, Command::Stop);
                    let _ = self.board.front(stop)?;
                }
            }
            "MOVE" => return self.go(line),
            "RATE" => return self.moved(Command::Rate(rate()?)),
            "SPIN" => return self.moved(Command::Spin(rate()?)),
            "TURN" => return self.turn(line),
            "STOP" => self.at_front(|front, ns| front.command(ns, Command::Stop))?,
            "HOLD" => {
                let held = line.switch()?;
                self.at_front(move |front, ns| front.command(ns, Command::Hold(held)))?;
            }
            "FIDGET" => {
                let every = line.count(MILLION)?;
                self.at_front(move |front, ns| front.command(ns, Command::Fidget(every)))?;
            }
            "CHAMBER" => {
                // The range of a plan; without a limit on the rate, a degree in a millisecond is a jump.
                let to_c = line.required(0, [-100.0, 200.0])?;
                let per_min = line.number(1, [1e-3, 6e4])?;
                let rate = per_min.map(|c| c / 60.0);
                self.at_front(move |front, ns| front.set_chamber(ns, to_c, rate))?;
            }
            "POWER" => match line.switch()? {
                true => self.switch_on()?,
                false => self.switch_off()?,
            },
            "RESET" => {
                if self.bench.is_off() {
                    return refused("`RESET`: the supply is off; send `POWER ON`");
                }
                self.tearing(|board, seed| board.reset_by_pin(seed))?;
            }
            "GARBLE" => {
                let per_million = line.count(MILLION)?;
                self.board.garble(per_million)?;
                self.board.seed_line(self.bench.seed)?;
                self.interference.garble(per_million);
            }
            "BURST" => self.interference.burst(u64::from(line.count(u32::MAX)?)),
            "LINK" => match line.switch()? {
                true => self.port.plug().map_err(Problem::Refused)?,
                false => {
                    self.port.unplug();
                    self.traffic.unheard += self.waiting.len() as u64;
                    self.waiting.clear();
                }
            },
            // Only names from the list of commands arrive here.
            name => return refused(format!("`{name}`: not done")),
        }
        done
    }

    fn identity(&mut self) -> Result<String, Problem> {
        let carrier = match self.board.front(|front, _| front.carried_by())? {
            Some(CarriedBy::Table) => "table",
            Some(CarriedBy::Hands) => "hands",
            None => "none",
        };
        Ok(format!("mimu-bench,{carrier},{},1", self.bench.seed))
    }

    /// Calls a function of the front end that may refuse.
    fn at_front<T: Send + 'static>(
        &mut self,
        act: impl FnOnce(&mut Front, u64) -> Result<T, String> + Send + 'static,
    ) -> Result<T, Problem> {
        self.board.front(act)?.map_err(Problem::Refused)
    }

    fn moved(&mut self, command: Command) -> Result<String, Problem> {
        if !self.bench.interlock {
            return refused("the interlock is open; close it with `INTERLOCK 1`");
        }
        self.at_front(move |front, ns| front.command(ns, command))?;
        Ok(String::new())
    }

    fn turn(&mut self, line: &Line<'_>) -> Result<String, Problem> {
        let word = line.arguments[0].to_lowercase();
        let axes = [TableAxis::Outer, TableAxis::Middle, TableAxis::Inner];
        let Some(axis) = axes.into_iter().find(|axis| axis.name() == word) else {
            return refused(format!("`TURN`: `{word}` is not an axis; {}", line.usage));
        };
        let angle = line.required(1, [-36e3, 36e3])?.to_radians();
        let rate = line.required(2, [1e-3, 36e3])?.to_radians();
        self.moved(Command::Turn(Turn { axis, angle, rate }))
    }

    fn go(&mut self, line: &Line<'_>) -> Result<String, Problem> {
        let mut up = [0.0; 3];
        for (k, component) in up.iter_mut().enumerate() {
            *component = line.required(k, [f64::MIN, f64::MAX])?;
        }
        let Some(up) = direction(up) else {
            return refused("`MOVE`: the direction has no length; send `MOVE 0 0 1` for z up");
        };
        let heading = line.number(3, [-360.0, 360.0])?.map(f64::to_radians);
        self.moved(Command::Move { up, heading })
    }

    /// Interrupts a flash operation, and writes the incomplete word or sector to the file.
    fn tearing(
        &mut self,
        tear: impl FnOnce(&mut Board, u64) -> Result<(), String>,
    ) -> Result<(), String> {
        self.bench.torn += 1;
        let seed = self.bench.seed.wrapping_mul(1000) + self.bench.torn;
        self.keep()?;
        let spans: Vec<(u64, u64)> = self
            .board
            .in_flight()?
            .iter()
            .map(|o| (o.address, o.length))
            .collect();
        tear(&mut self.board, seed)?;
        self.keep_spans(&spans)
    }

    fn switch_off(&mut self) -> Result<(), String> {
        if !self.bench.is_off() {
            self.tearing(Board::cut_supply)?;
            self.bench.off_ns = Some(self.board.state().ns);
        }
        Ok(())
    }

    fn switch_on(&mut self) -> Result<(), String> {
        if let Some(off_ns) = self.bench.off_ns.take() {
            // The part must notice that it was off.
            self.board.run_to(off_ns + SLICE_NS)?;
            self.board.restore_supply()?;
        }
        Ok(())
    }
}

fn bit(on: bool) -> Result<String, Problem> {
    Ok(u8::from(on).to_string())
}

/// A number with at most so many decimals.
fn rounded(x: f64, decimals: i32) -> String {
    let by = 10f64.powi(decimals);
    // Avoids a negative zero.
    ((x * by).round() / by + 0.0).to_string()
}

/// True rate against inertial space, deg/s, and specific force, m/s², body axes.
fn written(motion: &Motion) -> String {
    let all = [motion.rate.map(f64::to_degrees), motion.force].concat();
    let all: Vec<String> = all.into_iter().map(|x| rounded(x, 9)).collect();
    all.join(" ")
}

impl Board {
    /// Runs a function on the front end of the pins, at the board's present instant, ns.
    ///
    /// Errors: the emulator gave up.
    pub fn front<T: Send + 'static>(
        &mut self,
        act: impl FnOnce(&mut Front, u64) -> T + Send + 'static,
    ) -> Result<T, String> {
        self.with(move |s| {
            let at = s.stop.at.0;
            act(&mut s.session.board_mut().part.sampler.front, at)
        })
    }

    /// Decides which bytes are garbled on their way to the device.
    fn seed_line(&mut self, seed: u64) -> Result<(), String> {
        self.with(move |s| {
            s.session.board_mut().part.serial().errors_mut().seed = seed;
        })
    }
}
