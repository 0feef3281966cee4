//! Tables of a fleet.

use mimu::quantity::{Sensor, p_value};
use mimu::readable::{self, Readable};
use mimu_fleet::Fleet;
use mimu_fleet::capability::Capability;
use mimu_fleet::result::{DifferentLevel, GageStudy, ParameterOfFleet, Stranger, TriadOfFleet};

use super::signed;
use crate::report::table::{Cell, Table};

/// Unit that people read. Scale factors are relative, in per cent; units of data sheets stay.
pub(super) fn readable(unit: &str) -> Readable {
    match unit {
        "1" => Readable {
            factor: 100.0,
            unit: "%".into(),
        },
        other => readable::parameter(other),
    }
}

/// Kinds by the beginnings of their names in files.
const KINDS: [(&str, &str); 4] = [
    ("scale", "scale factor"),
    ("bias", "bias"),
    ("misalignment", "misalignment"),
    ("non_orthogonality", "non-orthogonality"),
];

/// Kind and axis of a parameter's name in files.
fn split(name: &str) -> Option<(&'static str, &str)> {
    KINDS.iter().find_map(|(key, words)| {
        let axis = name.strip_prefix(key)?.strip_prefix('_')?;
        Some((*words, axis))
    })
}

/// Words for a parameter's name in files: `gyro scale factor x`.
pub(super) fn parameter(sensor: Sensor, name: &str) -> String {
    match split(name) {
        Some((kind, axis)) => format!("{sensor} {kind} {axis}"),
        None => format!("{sensor} {name}"),
    }
}

/// Standard deviations between units, a row for each kind.
pub(super) fn spreads(fleet: &Fleet) -> Table {
    let mut table = Table::new("Standard deviation between units", "between units, 1 sigma")
        .numbers(["x, yz", "y, zy", "z, zx"]);
    for (sensor, triad) in fleet.sensors.present() {
        for (_, words) in KINDS {
            let of: Vec<&ParameterOfFleet> = triad
                .parameters
                .iter()
                .filter(|p| split(&p.name).is_some_and(|s| s.0 == words))
                .collect();
            let Some(first) = of.first() else { continue };
            let readable = readable(first.unit);
            let cells = of.iter().map(|p| Cell::number(p.sigma, readable.factor));
            let name = Cell::from(format!("{sensor} {words}, {}", readable.unit));
            table.row(std::iter::once(name).chain(cells));
        }
    }
    table
}

/// All parameters of a triad.
pub(super) fn population(sensor: Sensor, triad: &TriadOfFleet) -> Table {
    let caption = format!(
        "{sensor}: {} units; mean and scatter are of the {} that lie nearest together; scale factors relative to the median",
        triad.units, triad.used
    );
    let heads = [
        "mean",
        "between units, 1 σ",
        "of a fit, 1 σ",
        "between measurements, 1 σ",
    ];
    let within = triad.parameters.iter().any(|p| p.within_sigma.is_some());
    let mut table = Table::new(caption, sensor.to_string())
        .numbers(heads.into_iter().take(3 + usize::from(within)));
    for p in &triad.parameters {
        let readable = readable(p.unit);
        let (words, axis) = split(&p.name).unwrap_or((&p.name, ""));
        let by = readable.factor;
        let mean = Cell::Interval {
            si: p.mean,
            half: p.half_width,
            factor: by,
        };
        table.row(
            [
                Cell::from(format!("{words} {axis}, {}", readable.unit)),
                mean,
                Cell::number(p.sigma, by),
                Cell::number(p.fit_sigma, by),
                match within {
                    true => Cell::known(p.within_sigma, by),
                    false => Cell::Empty,
                },
            ]
            .into_iter()
            .take(4 + usize::from(within)),
        );
    }
    table
}

/// Units that do not belong, or calibrations that contradict others.
pub(super) fn strangers(all: &[Stranger], caption: String, shown: usize) -> Table {
    let mut table = Table::new(caption, "unit")
        .words("probability")
        .words("shown by")
        .numbers(["change", "in sigmas", "distance"])
        .on_page("labels")
        .on_page("files");
    for one in all.iter().take(shown) {
        let labels: Vec<String> = one.labels.iter().map(|(k, v)| format!("{k} {v}")).collect();
        table.row([
            Cell::Code(one.unit.clone()),
            Cell::from(p_value(one.p)),
            Cell::from(parameter(one.sensor, &one.parameter)),
            Cell::from(signed(one.parameter_unit, one.change)),
            Cell::number(one.sigmas.abs(), 1.0),
            Cell::number(one.distance, 1.0),
            Cell::from(labels.join(", ")),
            Cell::from(one.files.join(", ")),
        ]);
    }
    table
}

/// Labels that differ.
pub(super) fn different(all: &[DifferentLevel]) -> Table {
    let mut table = Table::new("Labels whose units differ from the others: how many of these units do not belong to the population, and the difference in its standard deviations", "label")
        .words("probability")
        .numbers(["units", "strangers"])
        .words("shown by")
        .numbers(["change", "sigmas"]);
    for one in all {
        table.row([
            Cell::from(format!("{} {}", one.label, one.level)),
            Cell::from(p_value(one.p)),
            Cell::Count(one.count as u64),
            Cell::Count(one.strangers as u64),
            Cell::from(parameter(one.sensor, &one.parameter)),
            Cell::from(signed(one.parameter_unit, one.change)),
            Cell::number(one.sigmas.abs(), 1.0),
        ]);
    }
    table
}

/// Repeatability and reproducibility.
pub(super) fn gage(study: &GageStudy) -> Table {
    let tolerance = study
        .parameters
        .iter()
        .any(|p| p.share_of_tolerance.is_some());
    let heads = [
        "repeatability",
        "of the fit",
        "reproducibility",
        "measurement",
        "units",
        "% variation",
        "% tolerance",
    ];
    let caption = "Standard deviations: repeatability and that of a fit in it, reproducibility, both together (the measurement), and between units; the measurement in shares of the whole variation and, six-fold, of the tolerance";
    let mut table =
        Table::new(caption, "1 σ").numbers(heads.into_iter().take(6 + usize::from(tolerance)));
    for p in &study.parameters {
        let readable = readable(&p.unit);
        let number = |v: f64| Cell::number(v, readable.factor);
        let name = parameter(p.sensor, &p.name);
        table.row(
            [
                Cell::from(format!("{name}, {}", readable.unit)),
                number(p.repeatability.value),
                number(p.fit_sigma),
                number(p.reproducibility.value),
                number(p.measurement.value),
                number(p.between_units.value),
                Cell::number(p.share_of_variation, 100.0),
                Cell::known(p.share_of_tolerance, 100.0),
            ]
            .into_iter()
            .take(7 + usize::from(tolerance)),
        );
    }
    table
}

/// Indices of capability.
pub(super) fn capability(all: &[Capability]) -> Table {
    let mut table = Table::new(
        "Capability against the limits; an index of 1.33 or more is usually called capable",
        "property",
    )
    .numbers([
        "limit",
        "mean",
        "1 σ",
        "Cp",
        "Cpk",
        "Cpk without the fits' uncertainty",
        "units beyond",
    ]);
    for one in all {
        let typical = if one.typical { " (typ)" } else { "" };
        let name = format!(
            "{} {} {}, {}{typical}",
            one.sensor,
            one.property.name(one.sensor),
            one.axis,
            one.unit
        );
        table.row([
            Cell::from(name),
            Cell::number(one.at_most, 1.0),
            Cell::number(one.mean, 1.0),
            Cell::number(one.sigma, 1.0),
            Cell::known(one.cp, 1.0),
            Cell::Interval {
                si: one.cpk,
                half: one.cpk_half_width,
                factor: 1.0,
            },
            Cell::known(one.cpk_of_process, 1.0),
            Cell::Count(one.beyond as u64),
        ]);
    }
    table
}
