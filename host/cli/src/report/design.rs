//! What is reported of a design: the judgement, with what it was judged under.

mod json;
mod next;
mod text;

pub use json::{comparison_json, design_json};
pub use next::{NextReport, next_json, next_text};
pub use text::{comparison_text, design_text};

use mimu::design::budget::{Budget, DwellNoise};
use mimu::design::judgement::Judgement;
use mimu::design::lack_of_fit::Notice;
use mimu::design::model::Term;
use mimu::design::schemes::{FANG_FILTERS, Scheme};
use mimu::design::tour::{Motion, Order};
use mimu::design::{Problem, plan};
use mimu::quantity::Sensor;
use mimu::quantity::significant;
use mimu_recording::Reference;

/// A judged design with what it was judged under.
#[derive(Debug, Clone)]
pub struct DesignReport {
    /// What it is: `best of 9 dwells found (seed 1)`, `scheme fang-nine`.
    pub title: String,
    /// Model, reach and optimum.
    pub problem: Problem,
    /// The design, in the order of the dwells, judged.
    pub judgement: Judgement,
    /// Length of a dwell, s.
    pub dwell_s: f64,
    /// Noise that sigma follows from; `None` if sigma was given.
    pub noise: Option<DwellNoise>,
    /// Moves between the dwells.
    pub motion: Motion,
    /// Order of the dwells; `None` as published.
    pub order: Option<Order>,
    /// Time of the moves in the shortest order found, s.
    pub shortest_moves_s: f64,
    /// The published scheme that it is.
    pub scheme: Option<Scheme>,
    /// Whether the unit had to be turned over for the table to reach the scheme's poses: see
    /// [`mimu::design::reach::Carrier::holding`].
    pub turned_over: bool,
    /// What was looked at to spend a budget, s.
    pub budget: Option<(f64, Budget)>,
}

impl DesignReport {
    fn moves_s(&self) -> f64 {
        self.motion.moves_s(&self.judgement.settings)
    }

    fn time_s(&self) -> f64 {
        self.moves_s() + self.dwell_s * self.judgement.settings.len() as f64
    }

    fn gyro(&self) -> bool {
        self.problem.reach.model.sensor == Sensor::Gyro
    }

    /// Smallest effect of a missing term that is noticed: factor and unit for people on [`Notice::size`].
    fn noticed(&self, notice: &Notice) -> (f64, &'static str) {
        let sigma = self.judgement.sigma;
        match notice.term {
            Term::GSensitivity => (sigma.to_degrees(), "(deg/s)/g"),
            _ => (1e6 * sigma / self.problem.reach.model.span.min(), "ppm FS"),
        }
    }

    /// D-efficiency and mean sigma of fang's three filters with four positions each, where that is what was
    /// judged.
    fn filters(&self) -> Option<[Judgement; 3]> {
        let model = &self.problem.reach.model;
        let as_published = model.terms.is_empty() && model.reference == Reference::Table;
        (self.scheme == Some(Scheme::FangNine) && as_published).then(|| {
            FANG_FILTERS.map(|filter| {
                let settings = filter.map(|i| self.judgement.settings[i]);
                self.problem.judge(&settings, self.judgement.sigma)
            })
        })
    }

    fn order_name(&self) -> &'static str {
        self.order.map_or("published", Order::name)
    }

    /// Sensor, model, reference and table in one line.
    fn subject(&self) -> String {
        let reach = &self.problem.reach;
        let reference = match reach.model.reference {
            Reference::Table => "known input",
            Reference::Gravity => "size of gravity",
        };
        let table = reach.carrier.name();
        format!(
            "{}, {}, {reference}, {table}",
            reach.model.sensor, reach.model
        )
    }

    /// Plan of the design, as a file.
    pub fn plan(&self) -> String {
        let about = format!(
            "{}: {}\norder {}{}\nD-efficiency {:.4}, {} with moves at {} deg/s",
            self.subject(),
            self.title,
            self.order_name(),
            if self.turned_over {
                ", unit turned over about x"
            } else {
                ""
            },
            self.judgement.d_efficiency,
            text::minutes(self.time_s()),
            significant(self.motion.slew.to_degrees()),
        );
        plan::to_toml(
            &about,
            self.problem.reach.carrier,
            &self.judgement.settings,
            self.dwell_s,
        )
    }
}
