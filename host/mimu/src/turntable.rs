//! Which dwells of a recording turned at which rate of the turntable, where only its magnitude is known.
//!
//! The manifest says it of the steps that a person named. Of the others the readings show it: those at rest are the bias, and those at a rate
//! lie at a distance from it that is the rate times about one scale factor.

use nalgebra::Vector3;

use crate::estimate::earth;
use crate::estimate::turn::Rest;
use crate::estimate::{Observation, magnitude};
use crate::prepared::Prepared;
use crate::quantity::{Sensor, significant};
use crate::signal::dwell::Fault;
use mimu_recording::error::{Argument, Error, Result};
use mimu_recording::{RawUnit, Turntable};

/// Half of a 95 % interval of a normal variable, in sigmas.
const NORMAL_95: f64 = 1.959_963_984_540_054;
/// Root mean square of distances off the nearest rate, over the largest rate, from which on the readings show no rates. Scale factors of 10 % apart
/// make 0.05 of it.
const UNLIKE: f64 = 0.12;
/// Share of its rate by which a dwell may be off in a fit of all: beyond, it turned at another rate. 33 1/3 and 45 rpm are 26 % apart.
const OTHER_RATE: f64 = 0.1;
/// Scale factors of readings in SI, over one, among which the dwells are assigned: wider than any part, so that a wrong rate is seen in the fit.
const SCALE_IN_SI: [f64; 2] = [0.5, 2.0];

/// The usable dwells of the gyro by their rates.
#[derive(Debug, Clone)]
pub struct RatedDwells {
    /// Magnitudes of the rates, rad/s, ascending.
    pub rates: Vec<f64>,
    /// Standard deviation of each, as a share of it.
    pub rate_sigma: f64,
    /// Dwells at a rate.
    pub turning: Vec<Observation>,
    /// Index of the rate of each of them.
    pub rate_of: Vec<usize>,
    /// Dwells at rest, where nothing but the Earth turns the gyro.
    pub rests: Vec<Rest>,
}

impl RatedDwells {
    /// Of a recording whose reference is the rate of a turntable.
    ///
    /// # Errors
    /// A step that is named and is not there; readings that do not show which dwell has which rate.
    pub fn of(prepared: &Prepared) -> Result<Self> {
        let none = Turntable {
            rates_dps: Vec::new(),
            rate_error: 0.0,
            step_rates_dps: Default::default(),
        };
        let turntable = prepared.manifest.turntable.as_ref().unwrap_or(&none);
        let mut rates: Vec<f64> = turntable.rates_dps.iter().map(|r| r.to_radians()).collect();
        rates.sort_by(f64::total_cmp);
        let observations = prepared.observations(Sensor::Gyro);
        let given = given(prepared, turntable, &observations)?;
        let level = |dps: f64| rates.iter().position(|r| *r == dps.to_radians());
        let classes: Vec<Option<usize>> = match given.iter().all(Option::is_some) {
            true => given.iter().map(|dps| level(dps.unwrap_or(0.0))).collect(),
            false => {
                let fixed: Vec<Option<Option<usize>>> =
                    given.iter().map(|dps| dps.map(level)).collect();
                let in_si = prepared.manifest.raw_unit == RawUnit::Si;
                assigned(&observations, &rates, &fixed, in_si)
                    .ok_or_else(|| unclear(prepared, &rates))?
            }
        };
        let mut turning = Vec::new();
        let mut rate_of = Vec::new();
        let mut rests = Vec::new();
        for (o, class) in observations.into_iter().zip(classes) {
            match class {
                Some(rate) => {
                    turning.push(o);
                    rate_of.push(rate);
                }
                // The Earth's rate lies anywhere in the frame of a gyro whose axes are not known yet.
                None => rests.push(Rest {
                    dwell: o.dwell,
                    raw: o.raw,
                    variance: o.variance,
                    rate: Vector3::zeros(),
                    rate_variance: Vector3::repeat(earth::RATE * earth::RATE / 3.0),
                }),
            }
        }
        // About the vertical the Earth's rate adds to the turntable's, by 2e-5 of 200 deg/s: all dwells have the same error of it.
        let slowest = rates.first().copied().unwrap_or(f64::INFINITY);
        Ok(Self {
            rate_sigma: (turntable.rate_error / NORMAL_95).hypot(earth::RATE / slowest),
            rates,
            turning,
            rate_of,
            rests,
        })
    }

    /// Rate of each of the turning dwells, rad/s.
    pub fn magnitudes(&self) -> impl Iterator<Item = f64> {
        self.rate_of.iter().map(|r| self.rates[*r])
    }

    /// Sets the turning dwells aside for the accelerometer: beside the axis it feels a centripetal force there that nothing says.
    pub fn keep_accel_at_rest(&self, prepared: &mut Prepared) {
        for o in &self.turning {
            let dwell = &mut prepared.dwells.list[o.dwell];
            dwell.accel_fault.get_or_insert(Fault::Spinning);
        }
    }

    /// Refuses a dwell that turns at another rate than its own by a fit of all; `fitted` are their magnitudes, rad/s.
    pub(crate) fn refuse_other_rate(&self, prepared: &Prepared, fitted: &[f64]) -> Result<()> {
        let off = |i: usize| (fitted[i] / self.rates[self.rate_of[i]] - 1.0).abs();
        let worst = (0..fitted.len()).max_by(|a, b| off(*a).total_cmp(&off(*b)));
        let Some(i) = worst.filter(|i| off(*i) > OTHER_RATE) else {
            return Ok(());
        };
        let step = prepared.dwells.list[self.turning[i].dwell].step;
        let [rate, found] =
            [self.rates[self.rate_of[i]], fitted[i]].map(|r| significant(r.to_degrees()));
        Err(Error::new(
            format!("{}, dwell {}", prepared.place, prepared.manifest.step_name(step)),
            format!("it is to turn at {rate} deg/s, and by the fit of all dwells it turns at {found} deg/s"),
            "give this step its own rate, or leave it out if that is beyond the range of the gyro; look also whether the rates of the others are right (33 1/3 rpm is 200 deg/s, 45 rpm is 270 deg/s)",
        )
        .about(Argument::TurntableRates))
    }
}

/// Rate of each observation, deg/s, where the manifest gives it by its step.
fn given(
    prepared: &Prepared,
    turntable: &Turntable,
    observations: &[Observation],
) -> Result<Vec<Option<f64>>> {
    let steps: Vec<i32> = prepared.dwells.list.iter().map(|d| d.step).collect();
    let rates = &turntable.step_rates_dps;
    let names = |step: i32| [prepared.manifest.step_name(step), step.to_string()];
    let there = |name: &String| steps.iter().any(|s| names(*s).contains(name));
    if let Some(name) = rates.keys().find(|name| !there(name)) {
        let mut all: Vec<String> = steps
            .iter()
            .take(8)
            .map(|s| prepared.manifest.step_name(*s))
            .collect();
        if steps.len() > all.len() {
            all.push("...".into());
        }
        let error = Error::new(
            format!("{}, turntable.step_rates_dps", prepared.place),
            format!("there is no step {name}"),
            format!("name one of the steps that there are: {}", all.join(", ")),
        );
        return Err(error.about(Argument::TurntableRates));
    }
    let of = |o: &Observation| {
        let step = prepared.dwells.list[o.dwell].step;
        names(step).iter().find_map(|name| rates.get(name).copied())
    };
    Ok(observations.iter().map(of).collect())
}

fn unclear(prepared: &Prepared, rates: &[f64]) -> Error {
    let list: Vec<String> = rates.iter().map(|r| significant(r.to_degrees())).collect();
    let (problem, remedy) = match rates.len() {
        1 => (
            format!(
                "the dwells are not at {} deg/s and at rest: their readings have other distances from each other",
                list[0]
            ),
            "give all rates of the turntable, or the rate of each step (STEP=RATE)",
        ),
        _ => (
            format!(
                "which dwell turned at which of {} deg/s does not show: there is no dwell at rest, or a rate that no dwell has",
                list.join(", ")
            ),
            "give the rate of each step (STEP=RATE), or only the rates that occur, and record rests between them",
        ),
    };
    Error::new(format!("{}, gyro", prepared.place), problem, remedy).about(Argument::TurntableRates)
}

/// The rate of each of the readings `raw`, `None` at rest, where the readings show it; `fixed` are those that are given.
///
/// Each reading is tried as the bias, and each distance from it as each of the rates; where there is one rate only, the readings may also all be at
/// it, about the centre of their sphere. What fits best is taken.
fn assigned(
    observations: &[Observation],
    rates: &[f64],
    fixed: &[Option<Option<usize>>],
    in_si: bool,
) -> Option<Vec<Option<usize>>> {
    let largest = rates.last()?;
    let off = |share: f64, class: Option<usize>| share - class.map_or(0.0, |k| rates[k] / largest);
    let nearest = |share: f64| {
        let classes = (0..rates.len()).map(Some).chain([None]);
        classes.min_by(|a, b| off(share, *a).abs().total_cmp(&off(share, *b).abs()))
    };
    let mut best: Option<(f64, Vec<Option<usize>>)> = None;
    for Observation { raw: centre, .. } in observations {
        let distances = observations.iter().map(|o| (o.raw - centre).norm());
        let distances: Vec<f64> = distances.collect();
        for (distance, rate) in distances
            .iter()
            .flat_map(|d| rates.iter().map(move |r| (d, r)))
        {
            let scale = distance / rate;
            let possible = !in_si || (SCALE_IN_SI[0]..SCALE_IN_SI[1]).contains(&scale);
            if !(scale > 0.0) || !possible {
                continue;
            }
            let share = |d: &f64| d / (scale * largest);
            let classes: Vec<Option<usize>> = distances
                .iter()
                .zip(fixed)
                .map(|(d, fixed)| fixed.unwrap_or_else(|| nearest(share(d)).flatten()))
                .collect();
            let occurs = |k: usize| classes.contains(&Some(k));
            if !(0..rates.len()).all(occurs) {
                continue;
            }
            let cost: f64 = distances
                .iter()
                .zip(&classes)
                .map(|(d, class)| off(share(d), *class).powi(2))
                .sum();
            if best.as_ref().is_none_or(|b| cost < b.0) {
                best = Some((cost, classes));
            }
        }
    }
    let rms = |cost: f64| (cost / observations.len() as f64).sqrt();
    if let Some((_, classes)) = best.filter(|b| rms(b.0) < UNLIKE) {
        return Some(classes);
    }
    let at_one = rates.len() == 1 && fixed.iter().all(|f| f.is_none_or(|class| class.is_some()));
    let sphere = magnitude::first_guess(observations, *largest).filter(|_| at_one)?;
    let off = observations
        .iter()
        .map(|o| sphere.apply(&o.raw).norm() / largest - 1.0);
    let cost: f64 = off.map(|off| off * off).sum();
    (rms(cost) < UNLIKE).then(|| vec![Some(0); observations.len()])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Readings of rates (an index, or rest) in these directions, by a gyro whose scale factors differ by 10 % and whose bias is 2048 counts.
    fn readings(of: &[(Option<usize>, [f64; 3])], rates: &[f64]) -> Vec<Observation> {
        let scale = Vector3::new(95.0, 100.0, 105.0);
        let reading = |(rate, along): &(Option<usize>, [f64; 3])| {
            let rate = rate.map_or(0.0, |k| rates[k]);
            let along = Vector3::from(*along).normalize();
            Observation {
                dwell: 0,
                raw: scale.component_mul(&(along * rate)) + Vector3::repeat(2048.0),
                variance: Vector3::zeros(),
                input: Vector3::repeat(f64::NAN),
                change: Vector3::zeros(),
            }
        };
        of.iter().map(reading).collect()
    }

    const DIRECTIONS: [[f64; 3]; 8] = [
        [1.0, 0.0, 0.0],
        [-1.0, 0.1, 0.0],
        [0.0, 1.0, 0.1],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.1, 0.0, -1.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, -1.0],
    ];

    #[test]
    fn readings_show_which_dwells_are_at_rest_and_which_at_which_rate() {
        let rates = [200f64.to_radians(), 270f64.to_radians()];
        let mut of: Vec<(Option<usize>, [f64; 3])> = Vec::new();
        for along in DIRECTIONS {
            of.extend([(None, along), (Some(0), along), (Some(1), along)]);
        }
        let truth: Vec<Option<usize>> = of.iter().map(|o| o.0).collect();
        let free = vec![None; of.len()];
        let raw = readings(&of, &rates);
        assert_eq!(assigned(&raw, &rates, &free, false), Some(truth));
        // Three rests among the turns of one rate.
        let one = [rates[0]];
        let mut few: Vec<_> = DIRECTIONS.map(|along| (Some(0), along)).into();
        few.extend([(None, [1.0; 3]); 3]);
        let truth: Vec<Option<usize>> = few.iter().map(|o| o.0).collect();
        let raw = readings(&few, &one);
        assert_eq!(
            assigned(&raw, &one, &vec![None; few.len()], false),
            Some(truth)
        );
    }

    #[test]
    fn turns_at_one_rate_without_rests_are_all_at_that_rate_and_of_two_rates_nothing_shows_which() {
        let rates = [200f64.to_radians(), 270f64.to_radians()];
        let of: Vec<_> = DIRECTIONS.map(|along| (Some(0), along)).into();
        let raw = readings(&of, &rates);
        let free = vec![None; of.len()];
        let all = vec![Some(0); of.len()];
        assert_eq!(assigned(&raw, &rates[..1], &free, false), Some(all));
        assert_eq!(assigned(&raw, &rates, &free, false), None);
        // Rests and two rates, of which one is given.
        let mut three: Vec<(Option<usize>, [f64; 3])> = Vec::new();
        for along in DIRECTIONS {
            three.extend([(None, along), (Some(0), along), (Some(1), along)]);
        }
        let raw = readings(&three, &rates);
        assert_eq!(
            assigned(&raw, &rates[..1], &vec![None; raw.len()], false),
            None
        );
    }
}
