//! One judgement of every result: may it be used, and if not, the one reason. [`judge`](crate::judge) has the rules.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Kinds of judgements, from the best to the worst.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    Serialize,
    Deserialize,
    strum::Display,
    strum::IntoStaticStr,
)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum JudgementKind {
    /// Errors of data that were held out are those of noise.
    Good,
    /// The data cannot contradict the result.
    Untested,
    /// The input is doubtful: its unit, rate, sign, range or columns.
    Suspect,
    /// The error exceeds what noise explains.
    Unexplained,
    /// The model does not describe the readings.
    Misfit,
}

impl JudgementKind {
    /// As in files.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// A judgement with its reason. Displayed as `kind: reason`.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
#[error("{kind}: {reason}")]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Judgement {
    /// Kind.
    pub kind: JudgementKind,
    /// What decided it, in one sentence with the figure.
    pub reason: String,
}

impl Judgement {
    /// A judgement of this kind, for this reason.
    pub fn new(kind: JudgementKind, reason: impl fmt::Display) -> Self {
        Self {
            kind,
            reason: reason.to_string(),
        }
    }

    /// The worst of several judgements; of equally bad ones the first. `None` if there are none.
    pub fn worst(all: impl IntoIterator<Item = Self>) -> Option<Self> {
        all.into_iter()
            .reduce(|worst, next| if next.kind > worst.kind { next } else { worst })
    }

    /// Why a calibration that is judged so is written, stored or uploaded only if a person agrees: a file, a board and a page ask alike. `None` if it may be.
    ///
    /// A model that does not describe the readings makes them worse. Anything better than that is stored with its judgement: on real units by hand `unexplained`
    /// is the rule, and still a tenth of the error before.
    pub fn needs_consent(&self) -> Option<String> {
        (self.kind == JudgementKind::Misfit).then(|| format!("it is judged a {self}"))
    }

    /// Whether it is `good`.
    pub fn is_good(&self) -> bool {
        self.kind == JudgementKind::Good
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use JudgementKind::{Good, Misfit, Suspect, Unexplained, Untested};

    #[test]
    fn the_worst_judgement_wins_with_its_own_reason() {
        let of = |kinds: &[JudgementKind]| {
            let each = kinds.iter().enumerate();
            let worst = Judgement::worst(each.map(|(i, kind)| Judgement::new(*kind, i)));
            worst.map(|j| (j.kind, j.reason))
        };
        assert_eq!(of(&[]), None);
        assert_eq!(of(&[Good, Untested, Good]), Some((Untested, "1".into())));
        assert_eq!(
            of(&[Suspect, Misfit, Unexplained, Misfit]),
            Some((Misfit, "1".into()))
        );
        assert_eq!(
            of(&[Untested, Unexplained, Suspect]),
            Some((Unexplained, "1".into()))
        );
    }

    #[test]
    fn a_judgement_is_written_in_lower_case_and_read_back() {
        for kind in [Good, Untested, Suspect, Unexplained, Misfit] {
            let judgement = Judgement::new(kind, "the error is 3.2 m/s²");
            let file = crate::toml_layout::to_toml("", &judgement);
            assert!(file.contains(&format!("kind = \"{kind}\"")), "{file}");
            assert_eq!(toml::from_str::<Judgement>(&file).unwrap(), judgement);
        }
    }
}
