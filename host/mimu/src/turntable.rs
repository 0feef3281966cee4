//! Finds which dwells of a recording turned at which rate of the turntable, if only its magnitude is known.
//!
//! The manifest gives the rates of the steps that a person named. The readings show those of the others: at rest they are the bias, and at
//! a rate their distance from the bias is the rate times a scale factor, which is about the same for all axes.

use mimu_core::compensation::Affine;
use nalgebra::Vector3;

use crate::estimate::earth;
use crate::estimate::{Observation, magnitude};
use crate::factor::Factors;
use crate::observation::turn::Rest;
use crate::prepared::{Prepared, si_covariance};
use crate::quantity::{Sensor, significant};
use crate::signal::dwell::Fault;
use crate::warning::Warning;
use mimu_recording::{Argument, Error, NORMAL_95, RawUnit, Result, Turntable};

/// Expected standard deviation of a reading at rest over the largest rate, by the wander of the bias; and of a reading at a rate over that rate, by scale
/// factors that differ from axis to axis.
const REST_SIGMA: f64 = 0.02;
const RATE_SIGMA: f64 = 0.06;
/// Cost of a dwell at none of the rates, in squared sigmas.
const AT_NONE: f64 = 9.0;
/// If the mean of the squared sigmas reaches this, the readings do not show the rates.
const UNLIKE: f64 = 4.0;
/// Fewest dwells that are accepted as rests. A single one may be a turn, because turns about perpendicular axes are at two distances from
/// it.
const FEWEST_RESTS: f64 = 2.0;
/// Largest deviation of a dwell from its rate in a fit of all, as a share of the rate; beyond it, the dwell turned at another rate. 33 1/3
/// and 45 rpm are 26 % apart.
const OTHER_RATE: f64 = 0.1;
/// Range of scale factors of readings in SI in which dwells are assigned: wider than that of any part, so that the fit shows a wrong rate.
const SCALE_IN_SI: [f64; 2] = [0.5, 2.0];

/// Largest number of dwells at none of the rates, per dwell at a rate. With more of them the given rates are wrong. For example, if a unit
/// turned as often at 200 as at 270 deg/s and only 200 is given, either half fits that rate.
const MOST_AT_NONE: f64 = 0.6;

/// Largest share of the dwells whose given rate may be contradicted.
const MOST_MISLABELLED: f64 = 0.25;

/// The rate at which a dwell turned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Class {
    Rest,
    /// At the rate with this index.
    Rate(usize),
    Other,
}

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
    /// Dwells at rest, where only the Earth turns the gyro.
    pub rests: Vec<Rest>,
    /// Indices of the dwells that turned at another rate.
    pub others: Vec<usize>,
    /// Those of them whose given rate the readings contradict.
    contradicted: Vec<Contradicted>,
}

/// A dwell whose reading contradicts its given rate.
#[derive(Debug, Clone, Copy)]
struct Contradicted {
    dwell: usize,
    label_dps: f64,
    /// The rate that its reading shows; `None` if it is none of those that occur.
    found_dps: Option<f64>,
}

impl RatedDwells {
    /// For a recording whose reference is the rate of a turntable.
    ///
    /// # Errors
    /// A named step does not exist, or the readings do not show which dwell has which rate.
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
        let class = |dps: f64| match rates.iter().position(|r| *r == dps.to_radians()) {
            Some(k) => Class::Rate(k),
            None => Class::Rest,
        };
        let given: Vec<Option<Class>> = given.into_iter().map(|dps| dps.map(class)).collect();
        let in_si = prepared.manifest.raw_unit == RawUnit::Si;
        let mut classes = match given.iter().copied().collect::<Option<Vec<Class>>>() {
            Some(all) => all,
            None => assigned(&observations, &rates, &given, in_si)
                .ok_or_else(|| unclear(prepared, &rates))?,
        };
        let contradicted = contradicted(&observations, &rates, &given, in_si);
        let contradicted: Vec<Contradicted> = contradicted
            .into_iter()
            .map(|(k, found)| {
                let label = classes[k];
                classes[k] = Class::Other;
                let dps = |class| match class {
                    Class::Rate(rate) => rates[rate].to_degrees(),
                    Class::Rest | Class::Other => 0.0,
                };
                Contradicted {
                    dwell: observations[k].dwell,
                    label_dps: dps(label),
                    found_dps: (found != Class::Other).then(|| dps(found)),
                }
            })
            .collect();
        let (mut turning, mut rate_of) = (Vec::new(), Vec::new());
        let (mut rests, mut others) = (Vec::new(), Vec::new());
        for (o, class) in observations.into_iter().zip(classes) {
            match class {
                Class::Rate(rate) => {
                    turning.push(o);
                    rate_of.push(rate);
                }
                Class::Other => others.push(o.dwell),
                // The axes of the gyro are not known yet, so the Earth's rate may have any direction in its frame.
                Class::Rest => rests.push(Rest {
                    dwell: o.dwell,
                    raw: o.raw,
                    variance: o.variance,
                    rate: Vector3::zeros(),
                    rate_variance: Vector3::repeat(earth::RATE * earth::RATE / 3.0),
                    vertical_variance: Vector3::zeros(),
                }),
            }
        }
        // About the vertical the Earth's rate adds to the turntable's, by 2e-5 of 200 deg/s: an error that all dwells share.
        let slowest = rates.first().copied().unwrap_or(f64::INFINITY);
        Ok(Self {
            rate_sigma: (turntable.rate_error / NORMAL_95).hypot(earth::RATE / slowest),
            rates,
            turning,
            rate_of,
            rests,
            others,
            contradicted,
        })
    }

    /// The magnitudes of the turning dwells, with their noise by the `gyro`.
    pub(crate) fn factors(&self, gyro: &Affine<f64>) -> Factors<'static> {
        let mut factors = Factors::default();
        let known = self.turning.iter().zip(self.magnitudes());
        for ((o, rate), variance) in known.zip(variances(gyro, &self.turning)) {
            factors.magnitude(Sensor::Gyro, (o.dwell, o.raw), (rate, None), variance);
        }
        factors
    }

    /// Rate of each of the turning dwells, rad/s.
    pub fn magnitudes(&self) -> impl Iterator<Item = f64> {
        self.rate_of.iter().map(|r| self.rates[*r])
    }

    /// Excludes the turning dwells for the accelerometer, which senses an unknown centripetal force off the axis, and those at another rate
    /// for both sensors. Returns the warnings about the latter.
    pub fn exclude_dwells(&self, prepared: &mut Prepared) -> Vec<Warning> {
        let turning = self.turning.iter().map(|o| o.dwell);
        for dwell in turning.chain(self.others.iter().copied()) {
            let dwell = &mut prepared.dwells.list[dwell];
            dwell.faults.accel.get_or_insert(Fault::Spinning);
        }
        for dwell in &self.others {
            prepared.dwells.list[*dwell].faults.gyro = Some(Fault::OtherRate);
        }
        let name = |dwell: usize| {
            let step = prepared.dwells.list[dwell].step;
            prepared.manifest.step_name(step)
        };
        let by_label = self.contradicted.iter().map(|c| Warning::RateOfDwell {
            dwell: name(c.dwell),
            label_dps: c.label_dps,
            found_dps: c.found_dps,
        });
        let mut warnings: Vec<Warning> = by_label.collect();
        let named = |dwell: &usize| self.contradicted.iter().any(|c| c.dwell == *dwell);
        let rest = self.others.iter().filter(|dwell| !named(dwell));
        let dwells: Vec<String> = rest.map(|dwell| name(*dwell)).collect();
        if !dwells.is_empty() {
            warnings.push(Warning::DwellsNotUsed {
                dwells,
                fault: Fault::OtherRate,
                sensor: None,
            });
        }
        warnings
    }

    /// Refuses a dwell whose rate in a fit of all dwells differs from its given rate; `fitted` are the fitted magnitudes, rad/s.
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
            format!("its given rate is {rate} deg/s, and by the fit of all dwells its rate is {found} deg/s"),
            "give this dwell its true rate, or leave it out if that exceeds the range of the gyro; check the rates of the others too (33 1/3 rpm is 200 deg/s, 45 rpm is 270 deg/s)",
        )
        .about(Argument::TurntableRates))
    }
}

/// Variances of the compensated magnitudes by noise, (rad/s)²; zero if the noise is unknown.
pub(crate) fn variances(inverse: &Affine<f64>, observations: &[Observation]) -> Vec<f64> {
    let along = |o: &Observation| {
        let up = inverse.apply(&o.raw).normalize();
        up.dot(&(si_covariance(&inverse.matrix, &o.variance) * up))
    };
    observations.iter().map(along).collect()
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
            format!("no dwell has the number or label {name}"),
            format!("name one of these: {}", all.join(", ")),
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
                "the readings of the dwells do not fit {} deg/s and rest: the differences between them have other ratios",
                list[0]
            ),
            "give all rates of the turntable, or the rate of each dwell (STEP=RATE)",
        ),
        _ => (
            format!(
                "the readings do not show which dwell turned at which of {} deg/s: no dwell is at rest, or no dwell has one of the rates",
                list.join(", ")
            ),
            "give the rate of each dwell (STEP=RATE), or give only the rates that occur and record rests between them",
        ),
    };
    Error::new(format!("{}, gyro", prepared.place), problem, remedy).about(Argument::TurntableRates)
}

/// The rate at which each of the `observations` turned, if the readings show it; `given` are the known ones.
///
/// Each reading is tried as the bias, and each distance from it as each of the rates. If there is only one rate, all readings may also be
/// at it, on a sphere about the bias. The best fit is taken.
fn assigned(
    observations: &[Observation],
    rates: &[f64],
    given: &[Option<Class>],
    in_si: bool,
) -> Option<Vec<Class>> {
    let largest = rates.last()?;
    let n = observations.len() as f64;
    let off = |share: f64, class: Class| match class {
        Class::Rest => (share / REST_SIGMA).powi(2),
        Class::Rate(k) => ((share * largest / rates[k] - 1.0) / RATE_SIGMA).powi(2),
        // A table that still turns slowly, or that a hand turns.
        Class::Other => AT_NONE,
    };
    let nearest = |share: f64| {
        let known = (0..rates.len())
            .map(Class::Rate)
            .chain([Class::Rest, Class::Other]);
        known.min_by(|a, b| off(share, *a).total_cmp(&off(share, *b)))
    };
    let mut best: Option<(f64, Vec<Class>)> = None;
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
            let classes = distances.iter().zip(given);
            let classes: Vec<Class> = classes
                .filter_map(|(d, given)| given.or_else(|| nearest(share(d))))
                .collect();
            let occurs = |k: usize| classes.contains(&Class::Rate(k));
            let count = |of: fn(&Class) -> bool| classes.iter().filter(|c| of(c)).count() as f64;
            let others = count(|c| *c == Class::Other);
            let turning = count(|c| matches!(c, Class::Rate(_)));
            let few = count(|c| *c == Class::Rest) < FEWEST_RESTS;
            if few || !(0..rates.len()).all(occurs) || others > MOST_AT_NONE * turning {
                continue;
            }
            let errors = distances.iter().zip(&classes);
            let cost: f64 = errors.map(|(d, class)| off(share(d), *class)).sum();
            if best.as_ref().is_none_or(|b| cost < b.0) {
                best = Some((cost, classes));
            }
        }
    }
    let at_one = rates.len() == 1 && given.iter().all(|g| g.is_none_or(|c| c != Class::Rest));
    let sphere = magnitude::first_guess(observations, *largest).filter(|_| at_one);
    if let Some(sphere) = sphere {
        let shares = observations.iter();
        let shares = shares.map(|o| sphere.apply(&o.raw).norm() / largest);
        let cost: f64 = shares.map(|share| off(share, Class::Rate(0))).sum();
        if best.as_ref().is_none_or(|b| cost < b.0) {
            best = Some((cost, vec![Class::Rate(0); observations.len()]));
        }
    }
    let (cost, classes) = best?;
    (cost < UNLIKE * n).then_some(classes)
}

/// The observations whose `given` rate the readings contradict, and what these show. None if more than [`MOST_MISLABELLED`] do: then the rates are wrong.
fn contradicted(
    observations: &[Observation],
    rates: &[f64],
    given: &[Option<Class>],
    in_si: bool,
) -> Vec<(usize, Class)> {
    let open = vec![None; given.len()];
    let labelled = given.iter().flatten().count();
    if labelled == 0 {
        return Vec::new();
    }
    let seen = assigned(observations, rates, &open, in_si).unwrap_or_default();
    let each = given.iter().zip(seen).enumerate();
    let other = each.filter(|(_, (given, seen))| given.is_some_and(|given| given != *seen));
    let other: Vec<_> = other.map(|(k, (_, seen))| (k, seen)).collect();
    match other.len() as f64 <= MOST_MISLABELLED * labelled as f64 {
        true => other,
        false => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::EarthShare;

    /// Readings at these rates, deg/s, in these directions, by a gyro whose scale factors differ by 10 % and whose bias is 2048 counts.
    fn readings(of: &[(f64, [f64; 3])]) -> Vec<Observation> {
        let scale = Vector3::new(95.0, 100.0, 105.0);
        let reading = |(dps, along): &(f64, [f64; 3])| Observation {
            dwell: 0,
            raw: scale.component_mul(&(Vector3::from(*along).normalize() * dps.to_radians()))
                + Vector3::repeat(2048.0),
            variance: Vector3::zeros(),
            input: Vector3::repeat(f64::NAN),
            earth: EarthShare::NONE,
            change: Vector3::zeros(),
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

    /// The classes found for dwells at these rates, deg/s, in each direction; the first `known` of 200 and 270 deg/s are given.
    fn found(dps: &[f64], known: usize) -> Option<Vec<Class>> {
        let rates = [200f64.to_radians(), 270f64.to_radians()];
        let all = DIRECTIONS.iter();
        let of: Vec<_> = all
            .flat_map(|along| dps.iter().map(|r| (*r, *along)))
            .collect();
        assigned(
            &readings(&of),
            &rates[..known],
            &vec![None; of.len()],
            false,
        )
    }

    #[test]
    fn readings_show_which_dwells_are_at_rest_and_which_at_which_rate() {
        let cycle = [Class::Rest, Class::Rate(0), Class::Rate(1)];
        assert_eq!(found(&[0.0, 200.0, 270.0], 2), Some(cycle.repeat(8)));
        assert_eq!(found(&[0.0, 200.0], 1), Some(cycle[..2].repeat(8)));
        // A table that slows down to 60 deg/s before it turns on.
        let with_other = [Class::Rest, Class::Rate(0), Class::Other, Class::Rate(1)];
        assert_eq!(
            found(&[0.0, 200.0, 60.0, 270.0], 2),
            Some(with_other.repeat(8))
        );
    }

    #[test]
    fn turns_at_one_rate_without_rests_are_all_at_that_rate_and_of_two_rates_nothing_shows_which() {
        assert_eq!(found(&[200.0], 1), Some(vec![Class::Rate(0); 8]));
        assert_eq!(found(&[200.0], 2), None);
        // As often at a rate that was not given as at the given one.
        assert_eq!(found(&[0.0, 200.0, 270.0], 1), None);
        assert_eq!(found(&[0.0, 0.0, 200.0, 270.0], 1), None);
    }
}
