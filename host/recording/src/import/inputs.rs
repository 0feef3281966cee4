//! The known input of each step, from a table beside the samples.

use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};

use super::faces::Face;
use super::step_labels::StepLabels;
use crate::cell::{self, shorten};
use crate::columns::REFERENCE_COLUMNS;
use crate::csv_file::BOM;
use crate::error::{Error, Result};

/// Angle turned during a whole step, in degrees.
const TURN_COLUMNS: [&str; 3] = ["turn_x_deg", "turn_y_deg", "turn_z_deg"];

/// Longest table of inputs in bytes; one row a step does not fill a hundredth of it.
const LONGEST: u64 = 64 << 20;

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

impl Inputs {
    /// Reads the table at `path`.
    pub fn read(path: &Path) -> Result<Inputs> {
        let io = |error: std::io::Error| Error::io(path, &error);
        if std::fs::metadata(path).map_err(io)?.len() > LONGEST {
            let problem = "this is too long for a table with one row for each dwell";
            return Err(Error::new(
                path.display(),
                problem,
                "give the table of inputs, not the samples",
            ));
        }
        let bytes = std::fs::read(path).map_err(io)?;
        super::binary::refuse_binary(path, &bytes[..bytes.len().min(4096)])?;
        Self::parse(&bytes, path)
    }

    /// Inputs of steps that are labelled with the face that is up.
    pub(super) fn of_faces(faces: &[Face], gravity_mps2: f64) -> Inputs {
        let step = |(row, face): (u64, &Face)| {
            let step = Step {
                row,
                input: face.inputs(gravity_mps2),
                turn_deg: [f64::NAN; 3],
                used: false,
            };
            (face.to_string(), step)
        };
        Inputs {
            path: PathBuf::from("faces"),
            columns: [false, false, false, true, true, true],
            has_turns: false,
            turns: BTreeSet::new(),
            steps: (1..).zip(faces).map(step).collect(),
        }
    }

    fn parse(bytes: &[u8], path: &Path) -> Result<Inputs> {
        let at = |row: u64| format!("{}, row {row}", path.display());
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .from_reader(bytes.strip_prefix(BOM).unwrap_or(bytes));
        let mut record = csv::ByteRecord::new();
        let mut names: Vec<String> = Vec::new();
        let mut inputs = Inputs {
            path: path.to_owned(),
            columns: [false; 6],
            has_turns: false,
            turns: BTreeSet::new(),
            steps: HashMap::new(),
        };
        while reader
            .read_byte_record(&mut record)
            .map_err(|error| Error::new(path.display(), error, "correct the file"))?
        {
            let row = record.position().map_or(1, csv::Position::line);
            if names.is_empty() {
                names = inputs.header(&record, &at(row))?;
                continue;
            }
            if record.iter().all(<[u8]>::is_empty) {
                continue;
            }
            if record.len() != names.len() {
                let problem = format!(
                    "the row has {} cells, the header {}",
                    record.len(),
                    names.len()
                );
                return Err(Error::new(at(row), problem, "correct the row"));
            }
            inputs.step(&record, &names, row)?;
        }
        if inputs.steps.is_empty() {
            let remedy = "write a header with the column step, and one row for each dwell";
            return Err(Error::new(path.display(), "the table has no row", remedy));
        }
        Ok(inputs)
    }

    fn header(&mut self, record: &csv::ByteRecord, place: &str) -> Result<Vec<String>> {
        let names: Vec<String> = record
            .iter()
            .map(|name| String::from_utf8_lossy(name).into_owned())
            .collect();
        for (i, name) in names.iter().enumerate() {
            let shown = shorten(name.as_bytes());
            if names[..i].contains(name) {
                let problem = format!("column {shown} appears twice");
                return Err(Error::new(place, problem, "remove one of them"));
            }
            let reference = REFERENCE_COLUMNS.iter().position(|known| known == name);
            let turn = TURN_COLUMNS.iter().position(|known| known == name);
            match reference.or(turn) {
                Some(column) => self.columns[column] = true,
                None if name == "step" => {}
                None => {
                    return Err(Error::new(
                        place,
                        format!("column {shown} is unknown"),
                        "use step, the ref_ columns of a recording, and turn_x_deg, turn_y_deg, turn_z_deg",
                    ));
                }
            }
        }
        if !names.iter().any(|name| name == "step") {
            return Err(Error::new(
                place,
                "column step is missing",
                "add it: the label or number of the dwell",
            ));
        }
        if self.columns == [false; 6] {
            return Err(Error::new(
                place,
                "the table has no column with an input",
                "add a ref_ or turn_ column",
            ));
        }
        Ok(names)
    }

    fn step(&mut self, record: &csv::ByteRecord, names: &[String], row: u64) -> Result<()> {
        let path = self.path.display().to_string();
        let at = |name: &str| format!("{path}, row {row}, column {name}");
        let mut label = String::new();
        let mut step = Step {
            row,
            input: [f64::NAN; 6],
            turn_deg: [f64::NAN; 3],
            used: false,
        };
        for (text, name) in record.iter().zip(names) {
            if name == "step" {
                label = String::from_utf8_lossy(text).into_owned();
                continue;
            }
            let value = cell::number(text)
                .map_err(|refusal| Error::new(at(name), refusal.problem, refusal.remedy))?;
            if let Some(i) = REFERENCE_COLUMNS.iter().position(|known| known == name) {
                step.input[i] = value;
            } else if let Some(i) = TURN_COLUMNS.iter().position(|known| known == name) {
                step.turn_deg[i] = value;
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
            return Err(Error::new(
                at("step"),
                "the cell is empty",
                "write the label or number of the dwell",
            ));
        }
        let place = at("step");
        if self.steps.insert(label.clone(), step).is_some() {
            let problem = format!(
                "{} appears twice in the column step",
                shorten(label.as_bytes())
            );
            return Err(Error::new(place, problem, "keep one row for each dwell"));
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
        let mut unused: Vec<(u64, &str)> = self
            .steps
            .iter()
            .filter(|(_, step)| !step.used)
            .map(|(label, step)| (step.row, label.as_str()))
            .collect();
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
        Inputs::parse(text.as_bytes(), Path::new("inputs.csv"))
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
        assert_eq!(inputs.unused().unwrap().matches("1").count(), 2);
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
