//! An experiment in words, and as the plan that a table or a person carries out.

use nalgebra::Vector3;

use super::super::model::Setting;
use super::super::plan::{Sheet, sheet};
use super::super::reach::Carrier;
use super::Answer;
use crate::quantity::AXES;
use crate::quantity::plural;

impl Answer {
    /// The experiment in a sentence: `24 dwells of 10 s, each twice, by lot: ±150, ±300 deg/s about x, y, z`.
    pub fn words(&self) -> String {
        if !self.possible() {
            return format!("no experiment of this kind can ({})", self.kind());
        }
        let n = self.stops.len();
        let mut words = format!("{} of {} s", plural(n as u64, "dwell"), short(self.dwell_s));
        if self.passes > 1 {
            words += ", each attitude and rate twice, in an order drawn by lot";
        }
        let minutes = (self.time_s / 60.0).ceil();
        if !self.chamber_c.is_empty() {
            let [first, others @ ..] = &self.temperatures()[..] else {
                return words;
            };
            let others: Vec<String> = others.iter().map(|c| short(*c)).collect();
            words += &format!(
                " in {minutes:.0} min, while a chamber goes from {} to {} °C, {} at each",
                short(*first),
                others.join(" to "),
                minutes_of(self.soak_s())
            );
        } else if self.passes == 1 {
            words += &format!(" spread over {minutes:.0} min, in an order drawn by lot");
        }
        if self.cold {
            words += ", from a cold start";
        }
        words += ": ";
        words += &self.settings_in_words();
        if self.together {
            words += "; beside this recording";
        }
        for settled in self.settled.iter().filter(|s| s.possible() && !s.done()) {
            words += &format!(
                "; {} is then seen at {:.1} sigmas only: longer dwells, or less noise",
                settled.id, settled.sigmas
            );
        }
        for settled in self.settled.iter().filter(|s| !s.lost.is_empty()) {
            words += &format!(
                "; no experiment of this kind ({}) can show {} of {}",
                self.kind(),
                settled.lost.join(", "),
                settled.id
            );
            if !settled.twins.is_empty() {
                words += &format!(" beside {}", settled.twins.join(", "));
            }
        }
        words
    }

    /// What the experiment could be made with.
    fn kind(&self) -> &'static str {
        match self.carrier {
            Carrier::ThreeAxis => "dwells on a table that turns about the vertical",
            Carrier::TwoAxis => "dwells at rest on a table of two axes",
            Carrier::Faces => "dwells on six faces",
            Carrier::Hand => "poses at rest, by hand",
        }
    }

    /// Temperatures in turn, °C.
    fn temperatures(&self) -> Vec<f64> {
        let mut all: Vec<f64> = self.chamber_c.iter().map(|c| c.1).collect();
        all.dedup();
        all
    }

    fn soak_s(&self) -> f64 {
        self.chamber_c.get(1).map_or(0.0, |c| c.0)
    }

    /// Attitudes and rates, the common ones by name.
    fn settings_in_words(&self) -> String {
        let mut rest: Vec<Vector3<f64>> = Vec::new();
        let mut rates: Vec<(Vector3<f64>, Vec<f64>)> = Vec::new();
        for Setting { up, rate } in self.stops.iter().map(|s| s.setting) {
            let same = |a: &Vector3<f64>, b: &Vector3<f64>| (a - b).norm() < 1e-6;
            if rate == 0.0 {
                if !rest.iter().any(|r| same(r, &up)) {
                    rest.push(up);
                }
                continue;
            }
            let dps = rate.to_degrees();
            match rates.iter_mut().find(|r| same(&r.0, &up)) {
                Some((_, list)) => {
                    if !list.iter().any(|r| (r - dps).abs() < 1e-6) {
                        list.push(dps);
                    }
                }
                None => rates.push((up, vec![dps])),
            }
        }
        let mut parts = Vec::new();
        // Directions with the same rates are told together.
        let mut by_rates: Vec<(String, Vec<String>)> = Vec::new();
        rates.sort_by(|a, b| order(&a.0).total_cmp(&order(&b.0)));
        for (up, mut list) in rates {
            list.sort_by(|a, b| a.abs().total_cmp(&b.abs()).then(b.total_cmp(a)));
            let shown = signed(&list);
            match by_rates.iter_mut().find(|(r, _)| *r == shown) {
                Some((_, ups)) => ups.push(direction(&up)),
                None => by_rates.push((shown, vec![direction(&up)])),
            }
        }
        for (rates, ups) in by_rates {
            parts.push(format!("{rates} deg/s with {} up", ups.join(", ")));
        }
        rest.sort_by(|a, b| order(a).total_cmp(&order(b)));
        if !rest.is_empty() {
            let ups: Vec<String> = rest.iter().map(direction).collect();
            parts.push(format!("at rest with {} up", ups.join(", ")));
        }
        parts.join("; ")
    }

    /// The experiment as `mimu-plan/1`, with what it is for in front.
    pub fn plan(&self, device: Option<&str>, sample_rate_hz: f64) -> String {
        let mut about = self.words();
        for s in &self.settled {
            about += &format!(
                "\n{}: {:.1} sigmas at least, {} wanted",
                s.id, s.sigmas, s.wanted
            );
        }
        let about = &about;
        let settings: Vec<Setting> = self.stops.iter().map(|s| s.setting).collect();
        sheet(&Sheet {
            about,
            device,
            sample_rate_hz,
            carrier: self.carrier,
            chamber_c: &self.chamber_c,
            settings: &settings,
            dwell_s: self.dwell_s,
            left_there: true,
        })
    }
}

/// Rates with their signs: `±150, 300`.
fn signed(sorted: &[f64]) -> String {
    let mut shown: Vec<String> = Vec::new();
    let mut i = 0;
    while i < sorted.len() {
        let pair = sorted
            .get(i + 1)
            .is_some_and(|next| (next + sorted[i]).abs() < 1e-6);
        if pair {
            shown.push(format!("±{}", short(sorted[i].abs())));
            i += 2;
        } else {
            shown.push(short(sorted[i]));
            i += 1;
        }
    }
    shown.join(", ")
}

/// Faces before edges before corners, each from x to z.
fn order(up: &Vector3<f64>) -> f64 {
    let components = up.iter().filter(|c| c.abs() > 1e-9).count() as f64;
    100.0 * components - 4.0 * up.x - 2.0 * up.y - up.z
}

/// `x`, `-y`, `x+z`; with factors where they differ.
fn direction(up: &Vector3<f64>) -> String {
    let largest = up.amax();
    let mut out = String::new();
    for (axis, c) in AXES.iter().zip(up.iter()) {
        if c.abs() < 1e-9 {
            continue;
        }
        let sign = match (*c < 0.0, out.is_empty()) {
            (true, _) => "-",
            (false, true) => "",
            (false, false) => "+",
        };
        let share = c.abs() / largest;
        let factor = match (share - 1.0).abs() < 1e-6 {
            true => String::new(),
            false => format!("{share:.2}"),
        };
        out += &format!("{sign}{factor}{axis}");
    }
    out
}

fn short(value: f64) -> String {
    let rounded = (value * 10.0).round() / 10.0 + 0.0;
    format!("{rounded}")
}

fn minutes_of(seconds: f64) -> String {
    format!("{} min", short(seconds / 60.0))
}
