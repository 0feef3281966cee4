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
        let mut all: Vec<String> = self.findings.iter().map(|f| self.sentence(f)).collect();
        all.extend(self.moving_together());
        all
    }

    /// The findings that contradict the model: sessions and steps. A drift is part of the model.
    pub fn contradictions(&self) -> Vec<String> {
        let all = self.findings.iter().filter(|f| f.kind != Kind::Drift);
        all.map(|f| self.sentence(f)).collect()
    }

    fn sentence(&self, found: &Finding) -> String {
        let count = self.fits.len();
        let change = self.changed(found.most, found.change);
        let p = p_value(found.p);
        match found.kind {
            Kind::Session(s) if self.used[s] => format!(
                "sessions 1 and 2 contradict each other, most in the {change} ({p}); record a third"
            ),
            Kind::Session(s) if s + 1 == count => format!(
                "session {count}, the last, contradicts the others and is not used, most in the {change} ({p}); if the unit was dropped or repaired since, fit only the sessions after that"
            ),
            Kind::Session(s) => format!(
                "session {} contradicts the others and is not used, most in the {change} ({p})",
                s + 1
            ),
            Kind::Step(first) => format!(
                "between sessions {first} and {} the unit changed, as by a shock or a repair, most in the {change} ({p}); only the sessions since are used",
                first + 1
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
