//! An experiment in a sentence, and as the plan that a table or a person carries out.

use super::recipe::{Course, Experiment, Inputs, SOAK_S};
use super::{Answer, Setup};
use crate::plan::{Plan, Step};
use crate::quantity::plural;

impl Answer {
    /// What to do, in the order of doing it, with numbers and units.
    pub fn words(&self, setup: &Setup) -> String {
        let done = &self.experiment;
        let minutes = (done.time_s / 60.0).ceil();
        let states = done.recipe.inputs.settings(setup).len();
        let dwell_s = shown(done.dwell_s);
        // By hand the unit stays in a pose for several dwells, which are one entry of the plan.
        let each = match done.hold {
            1 => format!("{dwell_s} s a dwell"),
            n => format!("hold each for {n} dwells of {dwell_s} s, then turn by hand to the next"),
        };
        let go = format!(
            "repeat the {states} states in a randomised order for {minutes:.0} min, {each}"
        );
        let how = match done.recipe.course {
            Course::Dwells => format!(
                "Make {} of {dwell_s} s, {} in each of {states} states, in a randomised order ({minutes:.0} min)",
                plural(done.settings.len() as u64, "dwell"),
                done.size
            ),
            Course::ColdStart => format!(
                "Switch the unit off and let it cool down. Start to record when you switch it on, and {go}"
            ),
            Course::Chamber => format!(
                "Put the unit into a chamber. Start to record when you switch it on, and {go}, while the chamber goes from {} °C at 2 °C a minute and stays {} min at each; record temp_c too, the temperature of the unit, not that of the chamber",
                course_of(done),
                shown(SOAK_S / 60.0)
            ),
        };
        let mut words = format!("{how}: {}.", inputs(setup, done.recipe.inputs));
        for p in self.predictions.iter().filter(|p| !p.done()) {
            words += &format!(
                " Even then the sigma of {} is {:.0} % of its typical size; {:.0} % is wanted: make the dwells longer, or make several such recordings.",
                p.id,
                100.0 * p.share,
                100.0 * p.wanted
            );
        }
        words
    }

    /// The experiment as `mimu-plan/1`, with its purpose in a comment in front.
    pub fn plan(&self, setup: &Setup, device: Option<&str>, sample_rate_hz: f64) -> String {
        let mut about = self.words(setup);
        for p in &self.predictions {
            about += &format!(
                "\n{}: sigma at most {:.1} % of its size",
                p.id,
                100.0 * p.share
            );
        }
        let done = &self.experiment;
        // Equal settings in a row are one entry: the unit stays where it is.
        let same = done.settings.chunk_by(|a, b| a == b);
        let steps = same.map(|s| Step::of(&s[0], done.dwell_s).repeated(s.len() as u32));
        let mut plan = Plan::new(setup.fixture, sample_rate_hz, steps.collect());
        plan.device = device.map(str::to_owned);
        plan.in_chamber(done.chamber_c.iter().copied())
            .to_toml(&about)
    }
}

/// Attitudes and rates: `rest with each axis up and down; turn at ±150 and ±300 deg/s about each axis`.
fn inputs(setup: &Setup, inputs: Inputs) -> String {
    let settings = inputs.settings(setup);
    let (rest, turning) = (
        settings.iter().filter(|s| s.rate == 0.0).count(),
        settings.iter().any(|s| s.rate != 0.0),
    );
    let mut words = match inputs {
        Inputs::Edges => format!(
            "rest with each axis up and down and halfway between every two of these ({rest} attitudes)"
        ),
        _ => format!("rest with each axis up and down ({rest} attitudes)"),
    };
    if rest < inputs.attitudes() {
        words += ", as far as the table reaches";
    }
    if turning {
        let largest = setup.rates.largest_dps;
        let rates = inputs.levels(setup).into_iter();
        let rates: Vec<String> = rates.map(|l| format!("±{}", shown(l * largest))).collect();
        words += &format!("; turn at {} deg/s about each axis", rates.join(" and "));
        if settings.iter().any(|s| s.rate != 0.0 && s.up.amax() < 0.99) {
            words += &format!(
                ", and at ±{} deg/s about each diagonal between two axes",
                shown(largest)
            );
        }
    }
    words
}

/// Temperatures in turn: `25 to 45 to 5 to 25`.
fn course_of(experiment: &Experiment) -> String {
    let mut all: Vec<String> = experiment.chamber_c.iter().map(|c| shown(c[1])).collect();
    all.dedup();
    all.join(" to ")
}

fn shown(value: f64) -> String {
    let rounded = (value * 10.0).round() / 10.0 + 0.0;
    format!("{rounded}")
}
