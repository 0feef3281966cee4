//! Settings that a resumed session keeps, and those that may change.

use std::path::Path;

use mimu_recording::error::{Argument, Error, Result};

use crate::procedure::SessionConfig;

/// Settings that determined the recorded dwells. With other values these dwells would be wrong.
fn kept(config: &SessionConfig) -> [(Argument, &'static str, String); 7] {
    let or_none = |given: Option<String>| given.unwrap_or_else(|| "none".into());
    [
        (Argument::Fixture, "fixture", config.fixture.name().into()),
        (
            Argument::Gravity,
            "gravity",
            format!("{} m/s²", config.gravity_mps2),
        ),
        (
            Argument::Latitude,
            "latitude",
            or_none(config.latitude_deg.map(|l| l.to_string())),
        ),
        (
            Argument::DwellLength,
            "length of a dwell",
            format!("{} s", config.dwell_s),
        ),
        (
            Argument::LargestRate,
            "largest rate",
            format!("{} deg/s", config.largest_rate_dps),
        ),
        (
            Argument::TextColumns,
            "line of the board",
            or_none(config.text.clone()),
        ),
        (
            Argument::WholeTurns,
            "whole turns",
            or_none(config.whole_turns.map(|whole| {
                let turns = whole
                    .turns
                    .map_or_else(String::new, |n| format!("{n} of each, "));
                format!("{turns}put back within {} degrees", whole.placement_deg)
            })),
        ),
    ]
}

/// Settings of the resumed session at `place`: those of `begun`, except for the settings that `now` may change (when to end, how long to wait).
///
/// Errors: the recorded dwells were made with other settings. Each difference is named.
pub fn resumed(begun: &SessionConfig, now: &SessionConfig, place: &Path) -> Result<SessionConfig> {
    let failed = |e: serde_json::Error| Error::new(place.display(), e, "report this");
    // Written and read again, so that numbers are as in the file.
    let now: SessionConfig =
        serde_json::from_str(&serde_json::to_string(now).map_err(failed)?).map_err(failed)?;
    let both = kept(begun).into_iter().zip(kept(&now));
    let (mut arguments, mut differ): (Vec<Argument>, Vec<String>) = both
        .filter(|(begun, now)| begun != now)
        .map(|((argument, name, begun), (.., now))| {
            (argument, format!("{name} was {begun}, now it is {now}"))
        })
        .unzip();
    if begun.prior != now.prior {
        let [before, after] = [begun, &now].map(|c| match &c.prior {
            Some(prior) => prior.words(),
            None => "none".into(),
        });
        differ.push(match before == after {
            true => "the prior is another one".into(),
            false => format!("prior was {before}, now it is {after}"),
        });
        arguments.push(Argument::Prior);
    }
    if differ.is_empty() && begun.steps != now.steps {
        differ.push("the planned poses differ".into());
        arguments.extend([Argument::Plan, Argument::Seed]);
    }
    if !differ.is_empty() {
        let problem = format!(
            "the session was started with other settings: {}",
            differ.join(", ")
        );
        let remedy = "give the same settings, or another folder";
        arguments.push(Argument::Output);
        let error = Error::new(place.display(), problem, remedy);
        return Err(arguments.into_iter().fold(error, Error::about));
    }
    Ok(SessionConfig {
        by_targets: now.by_targets,
        most_dwells: now.most_dwells,
        patience_s: now.patience_s,
        warm_c_per_min: now.warm_c_per_min,
        most_drift_c: now.most_drift_c,
        targets: now.targets,
        mounting_deg: now.mounting_deg,
        reference_error: now.reference_error,
        field_ut: now.field_ut,
        ..begun.clone()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::procedure::{Fixture, Targets, first_steps};

    fn config() -> SessionConfig {
        SessionConfig {
            text: None,
            fixture: Fixture::Hands,
            gravity_mps2: 9.71,
            latitude_deg: Some(48.1),
            dwell_s: 4.0,
            largest_rate_dps: 100.0,
            steps: first_steps(Fixture::Hands, 4.0, 100.0, 1),
            by_targets: true,
            most_dwells: 60,
            patience_s: 120.0,
            verification: Vec::new(),
            warm_c_per_min: None,
            most_drift_c: 5.0,
            targets: Targets::default(),
            mounting_deg: 0.02,
            reference_error: None,
            whole_turns: None,
            prior: None,
            field_ut: None,
        }
    }

    #[test]
    fn what_dwells_were_made_by_is_refused_with_each_difference_and_the_rest_is_taken() {
        let place = Path::new("session");
        let now = SessionConfig {
            gravity_mps2: 9.81,
            text: Some("ax,ay,az,gx,gy,gz in count".into()),
            ..config()
        };
        let error = resumed(&config(), &now, place).unwrap_err();
        let (line, arguments) = (error.to_string(), &error.refused().arguments);
        for says in [
            "gravity was 9.71 m/s², now it is 9.81 m/s²",
            "line of the board was none, now it is ax,ay,az,gx,gy,gz in count",
        ] {
            assert!(line.contains(says), "{line}");
        }
        assert!(!line.contains("fixture"), "{line}");
        let wanted = [Argument::Gravity, Argument::TextColumns, Argument::Output];
        assert_eq!(*arguments, wanted);
        let now = SessionConfig {
            steps: first_steps(Fixture::Hands, 4.0, 100.0, 1)[1..].to_vec(),
            ..config()
        };
        let error = resumed(&config(), &now, place).unwrap_err();
        let wanted = [Argument::Plan, Argument::Seed, Argument::Output];
        assert_eq!(error.refused().arguments, wanted);
        let now = SessionConfig {
            most_dwells: 20,
            patience_s: 7.0,
            ..config()
        };
        let kept = resumed(&config(), &now, place).unwrap();
        assert_eq!((kept.most_dwells, kept.patience_s), (20, 7.0));
    }
}
