//! From the calibrations of a tree to the result.

use std::collections::{BTreeMap, HashMap};

use mimu::data_sheet::{Part, Row};
use mimu::sessions::contradiction::FALSE_FINDING;
use mimu::{Error, Prior, RawUnit, Reference, Sensor};

use crate::capability;
use crate::charts;
use crate::judge::judge;
use crate::labels::DATE;
use crate::levels::{self, Levels, Units};
use crate::measured::Setting;
use crate::population::{Distance, FEWEST};
use crate::prior;
use crate::remeasured::{self, Change};
use crate::repeats::by_unit;
use crate::result::{ChangedUnit, DifferentLevel, Fleet, Stranger};
use crate::tree::{LeftOut, Measurement, Tree};
use crate::triad::{Estimated, Triad};

/// Everything that the calibrations of `tree` say together. `part` is the one whose limits were compared while they were read.
///
/// # Errors
/// Fewer than five comparable units, or a triad whose covariances are singular.
pub fn fleet(tree: Tree, part: Option<&Part>) -> Result<Fleet, Error> {
    Ok(analysed(tree, part)?.0)
}

/// The same, with the population as a prior of a further unit.
///
/// # Errors
/// Those of [`fleet`], and fewer units than a prior needs.
pub fn fleet_and_prior(tree: Tree, part: Option<&Part>) -> Result<(Fleet, Prior), Error> {
    let (result, triads, of) = analysed(tree, part)?;
    let prior = prior::prior(&result.tool, &triads, of)?;
    Ok((result, prior))
}

/// What the readings of the fleet are in, and what was known of their input.
type Readings = (RawUnit, Option<Reference>);

fn analysed(mut tree: Tree, part: Option<&Part>) -> Result<(Fleet, Vec<Triad>, Readings), Error> {
    let (setting, reference) = keep_comparable(&mut tree);
    let all = &tree.measurements;
    let raw_unit = all.first().map_or(RawUnit::Si, |m| m.of.raw_unit);
    let names = by_unit(all.iter().map(|m| m.unit.as_str()));
    let units: Vec<Vec<usize>> = names.into_values().collect();
    if units.len() < FEWEST {
        return Err(too_few(&tree, units.len()));
    }
    let estimated: Vec<Estimated> = Sensor::BOTH
        .iter()
        .filter_map(|s| Estimated::of(*s, reference, all))
        .collect();
    let changes = remeasured::changes(all, &units, &estimated);
    let sensors: Vec<Sensor> = estimated.iter().map(|e| e.basis.sensor).collect();
    let constant = constant(&units, &changes);
    let triads: Vec<Triad> = estimated
        .into_iter()
        .filter_map(|e| Triad::of(e, &constant))
        .collect();
    if triads.is_empty() {
        let problem = "no triad has five units with a regular covariance";
        return Err(Error::new(
            "the calibrations",
            problem,
            "fit the recordings again, with more poses",
        ));
    }
    let strangers = strangers(all, &triads);
    let contradicting = contradicting(all, &triads);
    let levels = all_levels(all);
    let is_stranger = of_strangers(all, &strangers);
    let is_further = repeated(&units, all.len());
    let different = different(&triads, &levels, &is_stranger, &is_further);
    let is_left_out: Vec<bool> = is_stranger
        .iter()
        .zip(&is_further)
        .map(|(a, b)| *a || *b)
        .collect();
    let charts = charts::charts(all, &triads, &levels, &different, &is_left_out);
    let rows = units.iter().map(|u| {
        u.iter()
            .map(|m| &all[*m].properties[..])
            .collect::<Vec<&[Row]>>()
    });
    let collected = capability::collect(rows);
    let changed_units = changes.iter().filter_map(|change| {
        let triad = triads
            .iter()
            .find(|t| t.basis.sensor == sensors[change.of.0])?;
        let members = &units[change.unit];
        Some(ChangedUnit {
            unit: all[members[0]].unit.clone(),
            measurements: members.len(),
            chart: charts::of_parameter(triad, change.of.1, &change.chart),
        })
    });
    let changed_units = changed_units.collect();
    let mut result = Fleet {
        format: "mimu-fleet/1",
        tool: format!("mimu {}", env!("CARGO_PKG_VERSION")),
        judgement: mimu::Judgement::new(mimu::JudgementKind::Good, ""),
        units: units.len(),
        measurements: all.len(),
        other_files: tree.others,
        unlabelled: tree.unlabelled,
        raw_unit: setting.raw_unit,
        reference: setting.reference,
        labels: levels
            .iter()
            .map(|(name, of)| (name.clone(), of.len()))
            .collect(),
        days: first_and_last_day(all),
        sensors: mimu::PerSensor::default(),
        strangers,
        contradicting,
        changed_units,
        different,
        changed: charts.changed,
        drift: charts.drift,
        part: part.map(|p| p.name.clone()),
        capability: capability::indices(&collected),
        left_out: Vec::new(),
    };
    for triad in &triads {
        result.sensors[triad.basis.sensor] = Some(triad.result());
    }
    result.left_out = tree.left_out;
    result.judgement = judge(&result);
    Ok((result, triads, (raw_unit, reference)))
}

/// Whether each of `count` measurements repeats an earlier one of its unit: it does not count as another unit.
fn repeated(units: &[Vec<usize>], count: usize) -> Vec<bool> {
    let mut repeated = vec![false; count];
    let all = units.iter().flat_map(|u| &u[1..]);
    all.for_each(|m| repeated[*m] = true);
    repeated
}

/// The first and the last day of measurements; `None` if no measurement has a day.
fn first_and_last_day(all: &[Measurement]) -> Option<[String; 2]> {
    let days = || all.iter().filter_map(|m| m.day);
    Some([days().min()?, days().max()?].map(|day| day.to_string()))
}

/// The units, with the first measurement only of those that change: a unit that ages shows neither how well measurements repeat nor what a unit of the kind is.
fn constant(units: &[Vec<usize>], changes: &[Change]) -> Vec<Vec<usize>> {
    let changed: Vec<usize> = changes.iter().map(|c| c.unit).collect();
    let each = units
        .iter()
        .enumerate()
        .map(|(k, unit)| match changed.contains(&k) {
            true => unit[..1].to_vec(),
            false => unit.clone(),
        });
    each.collect()
}

fn too_few(tree: &Tree, units: usize) -> Error {
    let first = tree.left_out.first();
    let first = first.map_or_else(String::new, |l| {
        format!(", the first of them {}: {}", l.file, l.reason)
    });
    let problem = format!(
        "{units} comparable units, and a fleet needs {FEWEST}; {} calibrations were left out{first}",
        tree.left_out.len()
    );
    let remedy = "name a folder with calibration files (`mimu fit -o`) of more units; the units' names are in the files, in folders `unit=NAME`, or in --labels";
    Error::new("the folders", problem, remedy)
}

/// Leaves out calibrations with other readings, or another frame, than most.
fn keep_comparable(tree: &mut Tree) -> (Setting, Option<Reference>) {
    let mut counts: HashMap<Setting, (usize, Option<Reference>)> = HashMap::new();
    for one in &tree.measurements {
        counts
            .entry(one.of.setting.clone())
            .or_insert((0, one.of.reference))
            .0 += 1;
    }
    let most = counts
        .into_iter()
        .max_by(|a, b| a.1.0.cmp(&b.1.0).then(b.0.cmp(&a.0)));
    let (most, (_, reference)) = most.unwrap_or_else(|| {
        let unknown = || "unknown".to_string();
        (
            Setting {
                raw_unit: unknown(),
                reference: unknown(),
            },
            (0, None),
        )
    });
    let measurements = std::mem::take(&mut tree.measurements);
    for one in measurements {
        if one.of.setting == most {
            tree.measurements.push(one);
            continue;
        }
        let of = |s: &Setting| {
            format!(
                "readings in {} with reference \"{}\"",
                s.raw_unit, s.reference
            )
        };
        tree.left_out.push(LeftOut {
            reason: format!("{}, most others {}", of(&one.of.setting), of(&most)),
            file: one.file,
        });
    }
    (most, reference)
}

/// An entry of a unit, or of a calibration.
fn stranger(
    all: &[Measurement],
    members: &[usize],
    triad: &Triad,
    distance: &Distance,
    p: f64,
    change: f64,
) -> Stranger {
    let first = &all[members[0]];
    Stranger {
        unit: first.unit.clone(),
        files: members.iter().map(|m| all[*m].file.clone()).collect(),
        labels: first.labels.clone(),
        sensor: triad.basis.sensor,
        distance: distance.distance,
        p,
        parameter: triad.basis.parameter(distance.most).to_string(),
        parameter_unit: triad.basis.unit(distance.most),
        change,
        sigmas: distance.sigmas,
    }
}

/// Units that do not belong to the population, the least probable first; each once, by the triad that shows it most.
fn strangers(all: &[Measurement], triads: &[Triad]) -> Vec<Stranger> {
    let tried = triads.iter().map(|t| t.repeats.units.len()).sum::<usize>() as f64;
    let mut found: BTreeMap<&str, Stranger> = BTreeMap::new();
    for triad in triads {
        let each = triad.repeats.units.iter().zip(&triad.population.distances);
        for (k, (members, distance)) in each.enumerate() {
            let p = (tried * distance.p).min(1.0);
            if p >= FALSE_FINDING {
                continue;
            }
            let change = triad.repeats.estimates[k].values[distance.most]
                - triad.population.mean[distance.most];
            let one = stranger(all, members, triad, distance, p, change);
            let unit = all[members[0]].unit.as_str();
            match found.get(unit) {
                Some(other) if (other.p, -other.distance) <= (p, -one.distance) => {}
                _ => {
                    found.insert(unit, one);
                }
            }
        }
    }
    sorted(found.into_values().collect())
}

fn sorted(mut all: Vec<Stranger>) -> Vec<Stranger> {
    all.sort_by(|a, b| {
        a.p.total_cmp(&b.p)
            .then(b.distance.total_cmp(&a.distance))
            .then(a.unit.cmp(&b.unit))
    });
    all
}

/// Calibrations that contradict the others of their unit.
fn contradicting(all: &[Measurement], triads: &[Triad]) -> Vec<Stranger> {
    let several = triads.len() as f64;
    let each = triads.iter().flat_map(|triad| {
        triad
            .repeats
            .contradicting
            .iter()
            .filter_map(move |(m, distance, p)| {
                let p = (several * p).min(1.0);
                let others = triad.repeats.units.iter().find(|u| u.contains(m))?;
                let values = |m: &usize| {
                    triad.estimates[*m]
                        .as_ref()
                        .map(|e| e.values[distance.most])
                };
                let rest: Vec<f64> = others
                    .iter()
                    .filter(|o| *o != m)
                    .filter_map(values)
                    .collect();
                let change = values(m)? - rest.iter().sum::<f64>() / rest.len() as f64;
                (p < FALSE_FINDING).then(|| stranger(all, &[*m], triad, distance, p, change))
            })
    });
    let mut once: BTreeMap<String, Stranger> = BTreeMap::new();
    for one in each {
        let file = one.files[0].clone();
        if once.get(&file).is_none_or(|other| one.p < other.p) {
            once.insert(file, one);
        }
    }
    sorted(once.into_values().collect())
}

/// Levels of all labels but the day.
fn all_levels(all: &[Measurement]) -> BTreeMap<String, Levels> {
    let mut labels: BTreeMap<String, Levels> = BTreeMap::new();
    for (k, one) in all.iter().enumerate() {
        for (name, level) in one.labels.iter().filter(|(name, _)| *name != DATE) {
            labels
                .entry(name.clone())
                .or_default()
                .entry(level.clone())
                .or_default()
                .push(k);
        }
    }
    labels
}

/// Whether each measurement is of a unit that does not belong.
fn of_strangers(all: &[Measurement], strangers: &[Stranger]) -> Vec<bool> {
    let names: std::collections::HashSet<&str> =
        strangers.iter().map(|s| s.unit.as_str()).collect();
    all.iter()
        .map(|m| names.contains(m.unit.as_str()))
        .collect()
}

/// Levels of labels that differ, by the first measurement of each unit.
fn different(
    triads: &[Triad],
    labels: &BTreeMap<String, Levels>,
    is_stranger: &[bool],
    is_further: &[bool],
) -> Vec<DifferentLevel> {
    let tried = labels
        .values()
        .map(|l| l.values().filter(|m| m.len() >= levels::FEWEST).count());
    let tried = (tried.sum::<usize>() * triads.len()).max(1);
    let mut found: Vec<DifferentLevel> = Vec::new();
    for triad in triads {
        let has: Vec<bool> = triad.estimates.iter().map(Option::is_some).collect();
        let values = triad.estimates.iter();
        let mut units = Units {
            values: values.map(|e| Some(e.as_ref()?.values.clone())).collect(),
            covariance: triad.of_one(),
        };
        let with = |members: &Vec<usize>| -> Vec<usize> {
            let of_unit = members.iter().copied();
            of_unit.filter(|m| has[*m] && !is_further[*m]).collect()
        };
        let own = labels.iter().map(|(label, levels)| {
            let levels = levels.iter().map(|(name, m)| (name.clone(), with(m)));
            (label, levels.collect::<Levels>())
        });
        let own: Vec<(&String, Levels)> = own.collect();
        let mut named: Vec<(&String, String)> = Vec::new();
        loop {
            let each = own.iter().filter_map(|(label, levels)| {
                Some((*label, levels, levels::different(&units, levels, tried)?))
            });
            let most = each.min_by(|a, b| a.2.p.total_cmp(&b.2.p));
            let Some((label, levels, one)) =
                most.filter(|(label, _, one)| !named.contains(&(*label, one.level.clone())))
            else {
                break;
            };
            let members = &levels[&one.level];
            units.without(&one, members);
            named.push((label, one.level.clone()));
            found.push(DifferentLevel {
                label: label.clone(),
                strangers: members.iter().filter(|m| is_stranger[**m]).count(),
                count: one.count,
                sensor: triad.basis.sensor,
                p: (one.p * tried as f64).min(1.0),
                parameter: triad.basis.parameter(one.most).to_string(),
                parameter_unit: triad.basis.unit(one.most),
                change: one.change,
                sigmas: one.sigmas,
                level: one.level,
            });
        }
    }
    found.sort_by(|a, b| {
        a.p.total_cmp(&b.p)
            .then(b.sigmas.abs().total_cmp(&a.sigmas.abs()))
    });
    found
}
