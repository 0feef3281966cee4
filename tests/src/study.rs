//! What the studies share: what a diagnosis says of a recording, and tables of what became of many cases.

use mimu::diagnose::Diagnosis;
use mimu_recording::error::Result;

/// What a diagnosis says.
#[derive(Debug, Clone)]
pub struct Said {
    /// Accepted effects, each with those that the recording does not distinguish from it.
    pub found: Vec<Vec<String>>,
    /// Verdict, or `refused`.
    pub verdict: &'static str,
    /// Effects that were not accepted and remaining errors, or the reason of the refusal, in words.
    pub reasons: Vec<String>,
}

impl Said {
    /// What it says of a diagnosis or of a refusal.
    pub fn of(diagnosis: &Result<Diagnosis>) -> Self {
        let diagnosis = match diagnosis {
            Ok(diagnosis) => diagnosis,
            // If an error is so large that the readings no longer follow their inputs, the recording is refused before the diagnosis.
            Err(refusal) => {
                return Self {
                    found: Vec::new(),
                    verdict: "refused",
                    reasons: vec![refusal.to_string()],
                };
            }
        };
        let (mut found, mut reasons) = (Vec::new(), Vec::new());
        for sensor in &diagnosis.sensors {
            let decision = &sensor.decision;
            found.extend(decision.accepted.iter().map(|a| {
                let alike = a.chosen.alternatives.iter().map(|other| other.id.clone());
                let own = a.chosen.candidate.id();
                std::iter::once(own).chain(alike).collect()
            }));
            let rejected = decision.rejected.iter();
            reasons.extend(rejected.map(|r| format!("{}: {}", r.id, r.reason)));
            reasons.extend(decision.leftover.iter().map(|l| {
                let usual = if l.usual { " (usual)" } else { "" };
                let (stratum, against, strength) = (&l.stratum, &l.against, l.strength);
                format!(
                    "{}_{stratum} against {against} {strength:.2e}{usual}",
                    sensor.sensor
                )
            }));
            let undecided = decision.undecided.iter();
            reasons.extend(undecided.map(|u| format!("{} or {}", u.id, u.law)));
        }
        Self {
            found,
            verdict: diagnosis.verdict.name(),
            reasons,
        }
    }

    /// The accepted effects themselves.
    pub fn ids(&self) -> Vec<&str> {
        self.found.iter().map(|f| f[0].as_str()).collect()
    }

    /// Whether `id` is accepted, perhaps as one that the recording does not distinguish from another.
    pub fn names(&self, id: &str) -> bool {
        self.found.iter().flatten().any(|f| f == id)
    }
}

/// How the values of a column become one figure.
#[derive(Debug, Clone, Copy)]
pub enum Figure {
    /// Their sum.
    Sum,
    /// Their mean, %.
    Percent,
    /// Their median.
    Median,
}

/// A table with a row for each kind of case, in the order in which these are named first.
#[derive(Debug)]
pub struct Table {
    columns: Vec<(&'static str, Figure)>,
    rows: Vec<(String, Vec<Vec<f64>>)>,
}

impl Table {
    /// A table without rows.
    pub fn new(columns: &[(&'static str, Figure)]) -> Self {
        Self {
            columns: columns.to_vec(),
            rows: Vec::new(),
        }
    }

    /// Adds a case to the row `name`: a value for each column, or not a number.
    pub fn add(&mut self, name: impl Into<String>, values: &[f64]) {
        let name = name.into();
        let known = self.rows.iter().position(|row| row.0 == name);
        let place = known.unwrap_or(self.rows.len());
        if known.is_none() {
            self.rows.push((name, vec![Vec::new(); self.columns.len()]));
        }
        for (all, value) in self.rows[place].1.iter_mut().zip(values) {
            all.extend(Some(*value).filter(|v| v.is_finite()));
        }
    }

    /// Prints it as Markdown, unless it is empty.
    pub fn print(&self, title: &str) {
        if self.rows.is_empty() {
            return;
        }
        let names: Vec<&str> = self.columns.iter().map(|c| c.0).collect();
        let ruler = "---:|".repeat(names.len());
        println!("\n{title}\n\n| | {} |\n|---|{ruler}", names.join(" | "));
        for (name, values) in &self.rows {
            let cells = self
                .columns
                .iter()
                .zip(values)
                .map(|((_, of), v)| figure(*of, v));
            println!("| {name} | {} |", cells.collect::<Vec<_>>().join(" | "));
        }
    }
}

fn figure(of: Figure, values: &[f64]) -> String {
    let sum: f64 = values.iter().sum();
    match of {
        Figure::Sum => sum.to_string(),
        _ if values.is_empty() => "-".into(),
        Figure::Percent => format!("{:.1}", 100.0 * sum / values.len() as f64),
        Figure::Median => {
            let mut sorted = values.to_vec();
            sorted.sort_by(f64::total_cmp);
            format!("{:.2}", sorted[sorted.len() / 2])
        }
    }
}

/// 1 for a case that a column counts.
pub fn counted(is: bool) -> f64 {
    f64::from(u8::from(is))
}

/// Name of the class of a strength; `None` if it is not a number.
pub fn class(strength: f64, classes: &[(f64, &'static str)]) -> Option<&'static str> {
    Some(classes.iter().find(|c| strength < c.0)?.1)
}
