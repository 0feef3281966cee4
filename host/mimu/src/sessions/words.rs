//! Findings in sentences.

use super::Sessions;
use super::contradiction::{Finding, Kind};
use crate::parameter::ParameterKind;
use crate::parameter::TriadParameter;
use crate::quantity::{Sensor, p_value, raw_unit, scale_unit};
use crate::readable;

impl Sessions {
    /// All findings.
    pub fn sentences(&self) -> Vec<String> {
        let mut all: Vec<String> = self.contradict_themselves().into_iter().collect();
        all.extend(self.findings.iter().map(|f| self.sentence(f)));
        all.extend(self.moving_together());
        all
    }

    /// The findings that contradict the model: sessions and steps. Drifts and walks are part of the model.
    pub fn contradictions(&self) -> Vec<String> {
        let all = self
            .findings
            .iter()
            .filter(|f| !matches!(f.kind, Kind::Drift | Kind::Walk));
        let themselves = self.contradict_themselves().into_iter();
        themselves.chain(all.map(|f| self.sentence(f))).collect()
    }

    /// Why the calibration is not made from session `s`, as in JSON; `None` if it is.
    pub fn not_used(&self, s: usize) -> Option<&'static str> {
        let contradicts = |f: &Finding| f.kind == Kind::Session(s);
        match self.used[s] {
            true => None,
            _ if self.inconsistent[s].is_some() => Some("contradicts_itself"),
            _ if self.findings.iter().any(contradicts) => Some("contradicts_others"),
            _ => Some("before_step"),
        }
    }

    /// `sessions 3 and 4 contradict themselves and are not used: gyro: the error of unseen data is 0.893 deg/s, 275 times the noise; ...`
    fn contradict_themselves(&self) -> Option<String> {
        let (who, count) = self.listed(|s| self.inconsistent[s].is_some());
        let verbs = match count {
            0 => return None,
            1 => "contradicts itself and is",
            _ => "contradict themselves and are",
        };
        let reasons: Vec<&str> = self
            .inconsistent
            .iter()
            .flatten()
            .map(String::as_str)
            .collect();
        Some(format!("{who} {verbs} not used: {}", reasons.join("; ")))
    }

    /// `sessions 1, 3 and 4`, and how many they are.
    fn listed(&self, which: impl Fn(usize) -> bool) -> (String, usize) {
        let numbers: Vec<String> = (0..self.used.len())
            .filter(|s| which(*s))
            .map(|s| (s + 1).to_string())
            .collect();
        let list = match numbers.split_last() {
            Some((last, others)) if !others.is_empty() => {
                format!("sessions {} and {last}", others.join(", "))
            }
            _ => format!("session {}", numbers.concat()),
        };
        (list, numbers.len())
    }

    fn sentence(&self, found: &Finding) -> String {
        let consistent = |s: &usize| self.inconsistent[*s].is_none();
        let change = self.changed(found.most, found.change);
        let p = p_value(found.p);
        match found.kind {
            Kind::Session(s) if self.used[s] => format!(
                "{} contradict each other, most in the {change} ({p}); record a third",
                self.listed(|s| self.used[s]).0
            ),
            Kind::Session(s) if !(s + 1..self.used.len()).any(|k| consistent(&k)) => format!(
                "session {}, the last, contradicts the others and is not used, most in the {change} ({p}); if the unit was dropped or repaired since, fit only the sessions after that",
                s + 1
            ),
            Kind::Session(s) => format!(
                "session {} contradicts the others and is not used, most in the {change} ({p})",
                s + 1
            ),
            Kind::Step(first) => format!(
                "between sessions {} and {} the unit changed, as by a shock or a repair, or is another, most in the {change} ({p}); only the sessions since are used",
                (0..first).rfind(consistent).map_or(first, |s| s + 1),
                first + 1
            ),
            Kind::Walk => format!(
                "parameters change from each session to the next, by no step, most the {change} between the earlier and the later ones ({p}); all sessions are used"
            ),
            Kind::Drift => format!(
                "parameters drift from session to session, most the {change} for each ({p}); the next one is extrapolated"
            ),
        }
    }

    /// `gyro scale factor y by -0.0214 count/(deg/s)`.
    fn changed(&self, (triad, parameter): (usize, usize), change: f64) -> String {
        let sensor = Sensor::BOTH[triad];
        let free = self.triads[sensor]
            .as_ref()
            .and_then(|t| t.free.get(parameter));
        let TriadParameter(kind, k) = TriadParameter::physical()[free.copied().unwrap_or(0)];
        let raw = self.fits[0].prepared.manifest.raw_unit;
        let unit = match kind {
            ParameterKind::Scale => scale_unit(raw, sensor.unit()),
            ParameterKind::Bias => raw_unit(raw, sensor.unit()),
            _ => "rad".into(),
        };
        let shown = readable::parameter(&unit).write(change);
        format!(
            "{sensor} {} {} by {shown}",
            kind.words(),
            TriadParameter(kind, k).axis()
        )
    }

    fn moving_together(&self) -> Option<String> {
        let found = self.together.as_ref()?;
        let temperatures = self.fits.iter().zip(&self.used).filter(|(_, used)| **used);
        let known = temperatures.clone().all(|(fit, _)| {
            let mut all = fit.prepared.dwells.list.iter();
            all.any(|d| d.temp_c.is_finite())
        });
        let remedy = match known {
            true => "if it is the temperature: mimu thermal fit SESSION ...",
            false => "a temperature moves them so: record the temperature",
        };
        Some(format!(
            "the biases of all axes move together from session to session, along one direction with {:.0} % of their variance ({}); {remedy}",
            100.0 * found.share,
            p_value(found.p)
        ))
    }
}
