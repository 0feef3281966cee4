//! The calibration file of several sessions.

use super::next_power_on::{BetweenSessions, SessionOrigin};
use super::verify::verify;
use super::{Calibration, Judged, TriadTable, of_fit};
use crate::judgement::{Judgement, JudgementKind};
use crate::quantity::{PerSensor, Sensor};
use crate::sessions::{CommonTriad, Sessions};
use crate::triad::Triad;
use mimu_recording::error::{Error, Result};
use mimu_recording::statistics::root_mean_square;

/// Sessions from which on a left-out one shows whether intervals are right.
const LEAST_SESSIONS: usize = 3;
/// Of that many values of left-out sessions at least this share is inside, or the changes are not those of a normal distribution.
const LEAST_INSIDE: f64 = 0.85;

/// Sessions with their calibration and its error figures.
#[derive(Debug, Clone)]
pub struct Combined {
    /// The calibration.
    pub calibration: Calibration,
    /// Its judgement, with those of the sessions.
    pub judgement: Judgement,
    /// Figures of each triad.
    pub judged: PerSensor<Option<Judged>>,
}

impl Calibration {
    /// The calibration of `sessions`, made at `created` (RFC 3339), judged on each session by those that are left.
    ///
    /// # Errors
    /// No session determines a triad.
    pub fn of_sessions(sessions: &Sessions, created: &str) -> Result<Combined> {
        let last = sessions.used.iter().rposition(|used| *used).unwrap_or(0);
        let mut calibration = Self::of(&sessions.fits[last], &[], created)?;
        for sensor in Sensor::BOTH {
            let slot = calibration.table_mut(sensor);
            *slot = match &sessions.triads[sensor] {
                None => None,
                Some(common) => Some(table(sessions, sensor, common, created)?),
            };
        }
        let judged = PerSensor::from_fn(|sensor| figures(sessions, &calibration, sensor));
        for sensor in Sensor::BOTH {
            if let Some(table) = calibration.table_mut(sensor) {
                table.judged.clone_from(&judged[sensor]);
            }
        }
        let judgement = judgement(sessions);
        calibration.judgement = Some(judgement.clone());
        calibration.sessions = origins(sessions);
        calibration.between_sessions = Some(BetweenSessions {
            method: "random effects, REML".into(),
            prior: sessions
                .prior
                .map(|class| format!("{}: {}", class.name(), class.source())),
            predicted: Some(sessions.predicted()).filter(|[_, count]| *count > 0),
            findings: sessions.sentences(),
        });
        let place = format!("calibration of {:?}", calibration.device);
        Ok(Combined {
            calibration: calibration.checked(&place)?,
            judgement,
            judged,
        })
    }

    fn table_mut(&mut self, sensor: Sensor) -> &mut Option<TriadTable> {
        sensor.pick(&mut self.gyro, &mut self.accel)
    }
}

fn origins(sessions: &Sessions) -> Vec<SessionOrigin> {
    let each = sessions.fits.iter().zip(&sessions.used);
    each.map(|(fit, used)| SessionOrigin {
        sha256: fit.prepared.condensed.sha256.clone(),
        used: *used,
        temp_c: of_fit::mean_temperature(fit),
        judgement: Judgement::of_fit(fit),
    })
    .collect()
}

/// The table of the last used session that has the triad, with the common model in place of its own.
fn table(
    sessions: &Sessions,
    sensor: Sensor,
    common: &CommonTriad,
    created: &str,
) -> Result<TriadTable> {
    let used = sessions.fits.iter().zip(&sessions.used);
    let last = used
        .rev()
        .find(|(fit, used)| **used && fit.sensor(sensor).is_some());
    let missing = || {
        let place = &sessions.fits[0].prepared.place;
        Error::undetermined(
            place,
            format!("no session determines the {sensor}"),
            "record more poses",
        )
    };
    let (fit, _) = last.ok_or_else(missing)?;
    let own = Calibration::of(fit, &[], created)?;
    let own = own.table(sensor).cloned().ok_or_else(missing)?;
    let judged = own.judged.clone().ok_or_else(missing)?;
    let made = of_fit::triad_table(&common.common, sensor, own.raw_unit, &own.frame, judged);
    Ok(TriadTable {
        bias_removed: own.bias_removed,
        ..made.with_next_power_on(&common.next)
    })
}

/// Error figures: of each session with the calibration of all, and with that of the others.
fn figures(sessions: &Sessions, calibration: &Calibration, sensor: Sensor) -> Option<Judged> {
    let common = sessions.triads[sensor].as_ref()?;
    let own = calibration.table(sensor)?.judged.clone()?;
    let (mut all, mut held, mut floors) = (Vec::new(), Vec::new(), Vec::new());
    let mut dwells = 0;
    for (s, fit) in sessions
        .fits
        .iter()
        .enumerate()
        .filter(|(s, _)| sessions.used[*s])
    {
        let with = |triads: PerSensor<Option<&Triad>>| {
            let mut by = calibration.clone();
            for (sensor, triad) in triads.present() {
                let inverse = triad.inverse;
                if let Some(table) = by.table_mut(sensor) {
                    table.C = of_fit::by_rows(&inverse.matrix);
                    table.o = inverse.offset.into();
                    table.forward = of_fit::forward_table(&triad.forward);
                }
            }
            let found = verify(&fit.prepared, &by).ok()?;
            found.sensors[sensor]
                .as_ref()
                .map(|s| (s.rms, s.noise_floor))
        };
        if let Some((rms, floor)) = with(PerSensor::default()) {
            all.push(rms);
            floors.push(floor);
            dwells += fit.sensor(sensor).map_or(0, |f| f.dwells);
        }
        let others = PerSensor::from_fn(|sensor| {
            let triad = sessions.triads[sensor].as_ref()?;
            triad.left_out[s].as_ref()?.by_others.as_ref()
        });
        if common.left_out[s].is_some() {
            held.extend(with(others).map(|f| f.0));
        }
    }
    let rms = |all: &[f64]| root_mean_square(all.iter().copied());
    let figure = |x: f64| crate::quantity::rounded(x, super::FIGURE_DIGITS);
    Some(Judged {
        rms: figure(rms(&all)),
        held_out_rms: (!held.is_empty()).then(|| figure(rms(&held))),
        noise_floor: Some(rms(&floors)).filter(|f| f.is_finite()).map(figure),
        dwells,
        ..own
    })
}

/// The judgement of all sessions: a contradiction is worse than what a session alone shows.
fn judgement(sessions: &Sessions) -> Judgement {
    let mut all = Vec::new();
    for (k, (fit, used)) in sessions.fits.iter().zip(&sessions.used).enumerate() {
        let own = Judgement::of_fit(fit);
        // What a session has too little of to test itself, the others test.
        if *used && own.kind > JudgementKind::Untested {
            let reason = format!("session {}: {}", k + 1, own.reason);
            all.push(Judgement::new(own.kind, reason));
        }
    }
    let kind = JudgementKind::Suspect;
    let findings = sessions.contradictions();
    let findings = findings.into_iter().map(|f| Judgement::new(kind, f));
    let mut all: Vec<Judgement> = findings.chain(all).collect();
    let used = sessions.used.iter().filter(|used| **used).count();
    let [inside, count] = sessions.predicted();
    if let Some(class) = sessions.prior {
        let reason = format!(
            "{used} session{} not show how much parameters change: the intervals of the next power-on are those of the class \"{}\"; record at least {LEAST_SESSIONS} sessions",
            if used == 1 { " does" } else { "s do" },
            class.name()
        );
        all.push(Judgement::new(JudgementKind::Untested, reason));
    } else if (inside as f64) < LEAST_INSIDE * count as f64 {
        let reason = format!(
            "the other sessions predict {inside} of {count} values of a left-out session, and 95 % is expected"
        );
        all.push(Judgement::new(JudgementKind::Unexplained, reason));
    }
    let good = || {
        let reason = format!(
            "the other sessions predict {inside} of {count} values of a left-out session within 95 % intervals"
        );
        Judgement::new(JudgementKind::Good, reason)
    };
    Judgement::worst(all).unwrap_or_else(good)
}
