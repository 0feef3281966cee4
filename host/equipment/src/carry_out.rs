//! Carries out a procedure over temperature: sets the chamber's temperatures, moves the table through dwells and turns, and makes one recording of it
//! all.

mod checked;
mod equipment;
mod needs;
mod progress;
mod sequence;

use std::cell::RefCell;

use mimu_device::Session;
use mimu_device::record::{
    Known, Procedure, RecordOptions, RecordSummary, RecordingState, UserRequest, record,
};
use mimu_recording::error::{Error, Result};
use serde::{Serialize, Serializer};

use checked::Checked;
use equipment::Equipment;
use sequence::{Seen, Sequence};

pub use needs::Equipped;
pub use progress::Progress;

/// Result of `mimu thermal record`.
#[derive(Debug, Serialize)]
pub struct CarriedOut {
    /// `mimu-thermal-record/1`.
    pub format: &'static str,
    /// Completed dwells and turns.
    pub dwells_done: usize,
    /// Planned dwells and turns.
    pub dwells_planned: usize,
    /// Completed rounds.
    pub rounds_done: usize,
    /// Planned rounds.
    pub rounds_planned: usize,
    /// Whether a table moved the unit. Then the inputs are known; otherwise only gravity is.
    pub table: bool,
    /// Number of temperatures that the chamber was set to.
    pub set_points: usize,
    /// Temperature that the chamber was left at, °C; `None` without a chamber.
    pub rest_c: Option<f64>,
    /// Why it ended early. The recording is complete up to that point.
    #[serde(serialize_with = "as_words")]
    pub cut_short: Option<Error>,
    /// Equipment that could not be brought to rest.
    #[serde(serialize_with = "each_as_words")]
    pub not_at_rest: Vec<Error>,
    /// The recording.
    pub recorded: RecordSummary,
}

fn as_words<S: Serializer>(of: &Option<Error>, to: S) -> std::result::Result<S::Ok, S::Error> {
    of.as_ref().map(Error::to_string).serialize(to)
}

fn each_as_words<S: Serializer>(of: &[Error], to: S) -> std::result::Result<S::Ok, S::Error> {
    to.collect_seq(of.iter().map(Error::to_string))
}

/// Carries out `procedure` with `equipped`, and records with `options`. `stop` is called many times a second, and returns true to end the procedure;
/// `show` is given the progress; `finishing` as for [`record`].
///
/// An error means that no recording was made. In every case the table is stopped and the chamber is set to its rest temperature.
pub fn carry_out(
    session: &mut Session,
    options: &RecordOptions,
    procedure: &Procedure,
    equipped: Equipped,
    stop: impl Fn() -> bool,
    mut show: impl FnMut(&Progress),
    finishing: impl Fn(f64),
) -> Result<CarriedOut> {
    let known = match options.table {
        true => Some(Known::of_plan(procedure.dwells.clone())),
        false => None,
    };
    let has_table = equipped.table.is_some();
    let (rest_c, chamber) = (equipped.rest_c(), equipped.chamber.is_some());
    let run = RefCell::new(Run {
        procedure,
        equipment: Some(Equipment::start(equipped)?),
        sequence: Sequence::new(procedure, has_table, chamber),
        checked: has_table.then(|| Checked::new(session.who().nominal())),
        cut_short: None,
        not_at_rest: Vec::new(),
    });
    let look = |state: &RecordingState| {
        let mut run = run.borrow_mut();
        let request = run.look(state, &stop);
        show(&run.progress(state));
        request
    };
    let recorded = record(session, options, known, look, finishing);
    let mut run = run.into_inner();
    // If the recording could not even begin, `look` was never called.
    run.rest();
    let done = run.sequence.done();
    let planned = procedure.dwells.len();
    let recorded = match recorded {
        Ok(recorded) => recorded,
        Err(error) => return Err(run.cut_short.unwrap_or(error)),
    };
    let cut_short = recorded.broken_off.clone().or(run.cut_short);
    let whole = format!(
        "; {done} of {planned} dwells and turns were recorded; they are kept in {}",
        recorded.recording
    );
    Ok(CarriedOut {
        format: "mimu-thermal-record/1",
        dwells_done: done,
        dwells_planned: planned,
        rounds_done: done / procedure.per_round,
        rounds_planned: procedure.rounds,
        table: has_table,
        set_points: run.sequence.set_points(),
        rest_c,
        cut_short: cut_short.map(|error| error.map(|e| e.problem += &whole)),
        not_at_rest: run.not_at_rest,
        recorded,
    })
}

struct Run<'a> {
    procedure: &'a Procedure,
    equipment: Option<Equipment>,
    sequence: Sequence<'a>,
    /// Compares the unit's motion with the commands; `None` without a table.
    checked: Option<Checked>,
    cut_short: Option<Error>,
    not_at_rest: Vec<Error>,
}

impl Run<'_> {
    /// Advances the procedure, and returns the requests to the recording.
    fn look(&mut self, state: &RecordingState, stop: &impl Fn() -> bool) -> UserRequest {
        if state.ended {
            self.rest();
        }
        let Some(equipment) = &mut self.equipment else {
            return UserRequest::default();
        };
        if let Some(error) = equipment.take_news() {
            return self.end(error, true);
        }
        if stop() {
            let place = state.last_s.unwrap_or_default();
            let place = format!("at {place:.1} s");
            let problem = "it was interrupted and is incomplete";
            return self.end(
                Error::new(place, problem, "record the rest as a new recording"),
                false,
            );
        }
        let seen = Seen {
            now_s: self.sequence.clock(state),
            line_lost: state.waiting,
            arrived: equipment.is_done(),
            chamber_c: equipment.chamber_c(),
        };
        let actions = self.sequence.look(&seen);
        for order in actions.orders {
            equipment.order(order);
        }
        let running = self.sequence.running();
        let wrong = self
            .checked
            .as_mut()
            .and_then(|checked| checked.look(running, &self.procedure.dwells, state));
        if let Some((dwell, error)) = wrong {
            let mut request = self.end(error, false);
            (request.marks, request.drop) = (actions.marks, Some(dwell as i32));
            return request;
        }
        UserRequest {
            end: false,
            marks: actions.marks,
            drop: None,
        }
    }

    /// Ends the procedure. If `spoiled`, the running dwell is discarded.
    fn end(&mut self, error: Error, spoiled: bool) -> UserRequest {
        self.cut_short = Some(error);
        self.rest();
        let running = self.sequence.running().filter(|_| spoiled);
        UserRequest {
            end: true,
            marks: 0,
            drop: running.map(|k| k as i32),
        }
    }

    fn rest(&mut self) {
        if let Some(equipment) = self.equipment.take() {
            self.not_at_rest = equipment.rest();
        }
    }

    fn progress(&self, state: &RecordingState) -> Progress {
        let chamber_c = self.equipment.as_ref().and_then(Equipment::chamber_c);
        Progress::of(self.procedure, &self.sequence, state, chamber_c)
    }
}
