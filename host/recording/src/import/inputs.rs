//! The known input of each step, from a table beside the samples.

use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};

use super::broken::Unreadable;
use super::comment_signs::CommentSigns;
use super::faces::Face;
use super::head::{self, LineFormat};
use super::lines::{LONGEST_LINE, Lines};
use super::noticed::Noticed;
use super::step_labels::StepLabels;
use crate::cell::{self, shorten};
use crate::columns::REFERENCE_COLUMNS;
use crate::error::{Error, Result};
use crate::separator::Separator;

/// Angle turned during a whole step, in degrees.
const TURN_COLUMNS: [&str; 3] = ["turn_x_deg", "turn_y_deg", "turn_z_deg"];

/// A column of the table.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Slot {
    Step,
    /// An input, by its place among [`REFERENCE_COLUMNS`].
    Input(usize),
    /// An angle, by its place among [`TURN_COLUMNS`].
    Turn(usize),
}

/// Known inputs by step.
///
/// A CSV file with the column `step` (label or number), any of the `ref_` columns of a recording, and `turn_x_deg` and so on: the total angle of a
/// turn. Divided by the duration of the step it gives the mean rate.
#[derive(Debug)]
pub struct Inputs {
    path: PathBuf,
    /// Which of the `ref_` columns it fills.
    pub columns: [bool; 6],
    /// Whether it has an angle anywhere, so that the samples of each step must be counted.
    pub has_turns: bool,
    /// Numbers of the steps met so far that are turns.
    pub turns: BTreeSet<i32>,
    steps: HashMap<String, Step>,
}

#[derive(Debug, Clone, Copy)]
struct Step {
    row: u64,
    input: [f64; 6],
    turn_deg: [f64; 3],
    used: bool,
}

impl Step {
    fn new(row: u64, input: [f64; 6]) -> Self {
        Self {
            row,
            input,
            turn_deg: [f64::NAN; 3],
            used: false,
        }
    }
}

impl Inputs {
    fn new(path: &Path) -> Inputs {
        Inputs {
            path: path.to_owned(),
            columns: [false; 6],
            has_turns: false,
            turns: BTreeSet::new(),
            steps: HashMap::new(),
        }
    }

    /// Reads the table at `path`.
    pub fn read(path: &Path) -> Result<Inputs> {
        let format = LineFormat {
            separator: Separator::Comma,
            comments: CommentSigns::default(),
        };
        let opened = head::open(path, LONGEST_LINE)?;
        let mut lines = Lines::new(path, format, None, opened, 1)?;
        let (mut record, mut noticed) = (csv::ByteRecord::new(), Noticed::default());
        let mut slots: Vec<Slot> = Vec::new();
        let mut inputs = Inputs::new(path);
        while let Some((row, _)) = lines
            .next(&mut record, &mut noticed)
            .map_err(Unreadable::into_error)?
        {
            let place = format!("{}, row {row}", path.display());
            if slots.is_empty() {
                slots = inputs.header(&record, &place)?;
                continue;
            }
            let (cells, expected) = (record.len(), slots.len());
            if cells != expected {
                let problem = format!("the row has {cells} cells, the header {expected}");
                return Err(Error::new(place, problem, "correct the row"));
            }
            inputs.step(&record, &slots, row)?;
        }
        if inputs.steps.is_empty() {
            let remedy = "write a header with the column step, and one row for each dwell";
            return Err(Error::new(path.display(), "the table has no row", remedy));
        }
        Ok(inputs)
    }

    /// Inputs of steps that are labelled with the face that is up.
    pub(super) fn of_faces(faces: &[Face], gravity_mps2: f64) -> Inputs {
        let steps = (1..).zip(faces);
        let step = |(row, face): (u64, &Face)| {
            (face.to_string(), Step::new(row, face.inputs(gravity_mps2)))
        };
        Inputs {
            columns: [false, false, false, true, true, true],
            steps: steps.map(step).collect(),
            ..Self::new(Path::new("faces"))
        }
    }

    fn header(&mut self, record: &csv::ByteRecord, place: &str) -> Result<Vec<Slot>> {
        let refuse = |problem: String, remedy: &str| Err(Error::new(place, problem, remedy));
        let mut slots = Vec::new();
        for name in head::texts(record) {
            let at = |names: &[&str]| names.iter().position(|known| *known == name);
            let input = at(&REFERENCE_COLUMNS).map(Slot::Input);
            let step = (name == "step").then_some(Slot::Step);
            let shown = shorten(name.as_bytes());
            match input.or(at(&TURN_COLUMNS).map(Slot::Turn)).or(step) {
                Some(slot) if slots.contains(&slot) => {
                    let problem = format!("column {shown} appears twice");
                    return refuse(problem, "remove one of them");
                }
                Some(slot) => slots.push(slot),
                None => {
                    return refuse(
                        format!("column {shown} is unknown"),
                        "use step, the ref_ columns of a recording, and turn_x_deg, turn_y_deg, turn_z_deg",
                    );
                }
            }
        }
        if !slots.contains(&Slot::Step) {
            let remedy = "add it: the label or number of the dwell";
            return refuse("column step is missing".into(), remedy);
        }
        if slots.len() == 1 {
            let remedy = "add a ref_ or turn_ column";
            return refuse("the table has no column with an input".into(), remedy);
        }
        for slot in &slots {
            if let Slot::Input(i) | Slot::Turn(i) = slot {
                self.columns[*i] = true;
            }
        }
        Ok(slots)
    }

    fn step(&mut self, record: &csv::ByteRecord, slots: &[Slot], row: u64) -> Result<()> {
        let path = self.path.display().to_string();
        let at = |name: &str| format!("{path}, row {row}, column {name}");
        let mut label = String::new();
        let mut step = Step::new(row, [f64::NAN; 6]);
        for (text, slot) in record.iter().zip(slots) {
            let number = |name: &str| {
                let number = cell::number(text);
                number.map_err(|refusal| Error::new(at(name), refusal.problem, refusal.remedy))
            };
            match *slot {
                Slot::Step => label = String::from_utf8_lossy(text).into_owned(),
                Slot::Input(i) => step.input[i] = number(REFERENCE_COLUMNS[i])?,
                Slot::Turn(i) => step.turn_deg[i] = number(TURN_COLUMNS[i])?,
            }
        }
        for ((turn, rate), name) in step.turn_deg.iter().zip(step.input).zip(TURN_COLUMNS) {
            self.has_turns |= !turn.is_nan();
            if !turn.is_nan() && !rate.is_nan() {
                let problem = "both rate and angle are given";
                return Err(Error::new(at(name), problem, "leave one of them empty"));
            }
        }
        if label.is_empty() {
            let remedy = "write the label or number of the dwell";
            return Err(Error::new(at("step"), "the cell is empty", remedy));
        }
        if self.steps.insert(label.clone(), step).is_some() {
            let label = shorten(label.as_bytes());
            let problem = format!("{label} appears twice in the column step");
            return Err(Error::new(
                at("step"),
                problem,
                "keep one row for each dwell",
            ));
        }
        Ok(())
    }

    /// Labels of its rows in order. If the samples have no labels, these belong to the steps 0, 1 and so on. Empty if all labels are numbers.
    pub fn labels(&self) -> Vec<String> {
        let mut rows: Vec<(u64, &String)> = self.steps.iter().map(|(l, s)| (s.row, l)).collect();
        rows.sort_unstable();
        let labels = rows.into_iter().map(|(_, label)| label.clone());
        match self.steps.keys().all(|label| label.parse::<i32>().is_ok()) {
            true => Vec::new(),
            false => labels.collect(),
        }
    }

    /// Input during step `number`, which lasts `duration_s`, in deg/s and m/s²; `None` if the table lacks the step.
    pub(super) fn input(
        &mut self,
        number: i32,
        labels: &StepLabels,
        duration_s: f64,
    ) -> Option<[f64; 6]> {
        self.of_step(number, labels.label(number), duration_s)
    }

    /// The same for a step with this label, or without one.
    pub fn of_step(
        &mut self,
        number: i32,
        label: Option<&str>,
        duration_s: f64,
    ) -> Option<[f64; 6]> {
        let key = label
            .filter(|label| self.steps.contains_key(*label))
            .map_or_else(|| number.to_string(), str::to_owned);
        let step = self.steps.get_mut(&key)?;
        step.used = true;
        // A turn by 0 about every axis is rest. When such a step counted as a turn, its 20 s at rest did not show the noise, and the intervals lacked
        // it.
        if step
            .turn_deg
            .iter()
            .any(|turn| !turn.is_nan() && *turn != 0.0)
        {
            self.turns.insert(number);
        }
        let mut input = step.input;
        for (rate, turn) in input.iter_mut().zip(step.turn_deg) {
            if !turn.is_nan() {
                *rate = turn / duration_s;
            }
        }
        Some(input)
    }

    /// A warning about the rows without a sample, if there are any.
    pub fn unused(&self) -> Option<String> {
        let unused = self.steps.iter().filter(|(_, step)| !step.used);
        let mut unused: Vec<(u64, &str)> = unused.map(|(l, s)| (s.row, l.as_str())).collect();
        unused.sort_unstable();
        let names: Vec<&str> = unused.iter().take(10).map(|(_, label)| *label).collect();
        (!names.is_empty()).then(|| {
            format!(
                "{}: {} of its dwells have no sample: {}",
                self.path.display(),
                unused.len(),
                names.join(", ")
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Inputs> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("inputs.csv");
        std::fs::write(&path, text).unwrap();
        Inputs::read(&path)
    }

    #[test]
    fn an_angle_becomes_the_mean_rate_of_its_step() {
        let mut inputs = parse("step,turn_x_deg,ref_force_z_mps2\nx_rot,360,\n1,,-9.81\n").unwrap();
        assert!(inputs.has_turns);
        assert_eq!(inputs.columns, [true, false, false, false, false, true]);
        let mut labels = StepLabels::default();
        labels.number(b"x_rot").unwrap();
        let input = inputs.input(0, &labels, 4.0).unwrap();
        assert_eq!(input[0], 90.0);
        assert!(input[5].is_nan());
        let unused = inputs.unused().unwrap();
        assert!(
            unused.ends_with("1 of its dwells have no sample: 1"),
            "{unused}"
        );
        assert_eq!(inputs.input(1, &labels, 4.0).unwrap()[5], -9.81);
        assert_eq!(inputs.unused(), None);
        assert!(inputs.input(2, &labels, 4.0).is_none());
    }

    #[test]
    fn a_step_that_turns_by_no_angle_is_rest() {
        let mut inputs = parse("step,turn_x_deg,turn_y_deg\nrest,0,0\nx_rot,360,0\n").unwrap();
        let mut labels = StepLabels::default();
        for (number, label) in ["rest", "x_rot"].into_iter().enumerate() {
            labels.number(label.as_bytes()).unwrap();
            let rate = inputs.input(number as i32, &labels, 4.0).unwrap();
            assert_eq!(rate[..2], [[0.0, 0.0], [90.0, 0.0]][number]);
        }
        assert_eq!(inputs.turns.into_iter().collect::<Vec<i32>>(), [1]);
    }

    #[test]
    fn a_bad_table_is_refused_with_row_and_column() {
        for (text, words) in [
            ("", "no row"),
            ("step,turn_x_deg\n", "no row"),
            ("turn_x_deg\n1\n", "column step"),
            ("step\n1\n", "no column"),
            ("step,turn_w_deg\n", "turn_w_deg"),
            ("step,step,turn_x_deg\n", "twice"),
            ("step,turn_x_deg\na,1\na,2\n", "row 3, column step"),
            ("step,turn_x_deg\na,b\n", "row 2, column turn_x_deg"),
            ("step,turn_x_deg\na\n", "row 2: the row has 1"),
            ("step,turn_x_deg,ref_rate_x_dps\na,1,1\n", "both rate"),
            ("step,turn_x_deg\n,1\n", "empty"),
        ] {
            let error = parse(text).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }
}
