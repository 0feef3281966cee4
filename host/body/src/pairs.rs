//! The pairs of a body: a gyro and an accelerometer with one number each.

use mimu::fit::{Fit, Options as FitOptions, fit};
use mimu::judgement::Judgement;
use mimu::prepared::Prepared;
use mimu::result::fit::FitResult;
use mimu::signal::stillness::DwellSearch;
use mimu_recording::error::Result;
use mimu_recording::{Recording, TriadKind, TriadName};
use nalgebra::Rotation3;

use crate::split::{self, Split, TurnErrors};
use crate::{Body, Options};

/// What the pairs of a body err by in one or several recordings.
#[derive(Debug, Clone)]
pub struct Pairs {
    /// What their turns err by, split into the part that all share and the part of each.
    pub split: Split,
    /// Each recording of the first pair without the part that all share. `None` for fewer than three pairs, or if noise explains what they share.
    pub first: Vec<Option<Prepared>>,
}

/// A pair of one recording: its number, its fit, and the rotation into the frame of the first.
type Pair = (u8, Fit, Rotation3<f64>);

impl Pairs {
    /// Each pair of these recordings fitted like the first of each (the fit beside it), their errors in its frame. `None` if there is only one in each, or if turns that
    /// two of them share are too few.
    ///
    /// # Errors
    /// The samples cannot be read.
    pub fn of(recordings: &[(&Recording, &Fit)], search: DwellSearch) -> Result<Option<Self>> {
        let all = recordings.iter();
        let all = all.map(|(recording, unit)| fitted(recording, unit, search));
        let all: Vec<Vec<Pair>> = all.collect::<Result<_>>()?;
        let of = |pairs: &[Pair]| {
            let pairs: Vec<_> = pairs
                .iter()
                .map(|(n, fit, turn)| (*n, fit, *turn))
                .collect();
            let errors = split::turn_errors(&pairs).filter(|_| pairs.len() > 1)?;
            Some((split::own_turns(&pairs, &errors), errors))
        };
        let (own, errors): (Vec<_>, Vec<_>) = all.iter().map(|pairs| of(pairs).unzip()).unzip();
        let errors: Vec<TurnErrors> = errors.into_iter().flatten().collect();
        let Some(mut split) = TurnErrors::joined(&errors).and_then(|of| split::split(&of)) else {
            return Ok(None);
        };
        let own: Vec<_> = own
            .into_iter()
            .map(|of| of.filter(|_| split.exceeds_noise).unwrap_or_default())
            .collect();
        for (number, prepared) in own.iter().flatten() {
            let Ok(fit) = fit(prepared.clone(), FitOptions::default()) else {
                continue;
            };
            let mut next = FitResult::of(&fit).judgement;
            if recordings.len() > 1 {
                next.reason = format!("{}: {}", prepared.place, next.reason);
            }
            let worst = Judgement::worst(split.judged.remove(number).into_iter().chain([next]));
            split.judged.extend(worst.map(|worst| (*number, worst)));
        }
        let first = own
            .into_iter()
            .map(|of| of.into_iter().find(|(number, _)| *number == 1));
        Ok(Some(Self {
            split,
            first: first.map(|of| Some(of?.1)).collect(),
        }))
    }
}

/// The pairs of a recording that are determined, the first (`unit`) included.
fn fitted(recording: &Recording, unit: &Fit, search: DwellSearch) -> Result<Vec<Pair>> {
    let triads = recording.triads();
    let names = |number| [TriadKind::Gyro, TriadKind::Accel].map(|kind| TriadName { kind, number });
    let numbers =
        (2..=TriadName::MOST).filter(|n| names(*n).iter().all(|name| triads.contains(name)));
    let numbers: Vec<u8> = numbers.collect();
    let mut pairs = vec![(1, unit.clone(), Rotation3::identity())];
    let body = match numbers.is_empty() {
        true => None,
        false => Body::of(recording, unit, &Options::default())?,
    };
    let Some(body) = body else {
        return Ok(pairs);
    };
    for number in numbers {
        // The accelerometer of a pair gives the frame of its fit.
        let [gyro, accel] =
            names(number).map(|name| body.triads.iter().find(|triad| triad.name == name));
        let Some(gyro) = gyro else {
            continue;
        };
        let prepared = Prepared::read(&recording.pair(number)?, search, |_| ())?;
        // A pair that is not determined for itself says nothing of turns.
        if let Ok(fit) = fit(prepared, FitOptions::IN_SAMPLE) {
            pairs.push((number, fit, accel.unwrap_or(gyro).rotation));
        }
    }
    Ok(pairs)
}
