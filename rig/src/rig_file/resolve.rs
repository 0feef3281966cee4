//! From a rig file and a seed to the truth.

use std::array::from_fn;

use super::check::parts;
use super::{AffineFile, AxesFile, ConverterFile, EffectFile, RigFile, UnitFile};
use crate::body::FurtherTruth;
use crate::catalog::{MeasuredQuantity, Sensor};
use crate::converter::{ConverterTruth, RawUnit};
use crate::effects::{EffectTruth, draw_ids};
use crate::field::FieldTruth;
use crate::flaws::FlawsTruth;
use crate::hands::HandsTruth;
use crate::noise::Coefficients;
use crate::random::Random;
use crate::refusal::Refusal;
use crate::rotation::{Rotation, Vector, add, norm, scale};
use crate::sensor::{AxisTruth, TriadTruth};
use crate::table::TableTruth;
use crate::thermal::ThermalTruth;
use crate::unit::{TemperatureSensor, TemperatureTruth, UnitTruth, VoltageTruth};

/// The complete truth of a bench.
#[derive(Debug, Clone, PartialEq)]
pub struct RigTruth {
    /// The same as a rig file with nothing left to draw.
    pub file: RigFile,
    /// Whether the Earth turns.
    pub earth_rate: bool,
    /// The sensors.
    pub unit: UnitTruth,
    /// The converter.
    pub converter: ConverterTruth,
    /// The turntable.
    pub table: TableTruth,
    /// The person.
    pub hands: HandsTruth,
    /// Flaws of the recording.
    pub flaws: FlawsTruth,
    /// The magnetic field.
    pub field: FieldTruth,
    /// Triads beyond the first gyro and accelerometer, in the order of their columns.
    pub further: Vec<FurtherTruth>,
}

impl RigTruth {
    /// Draws the values that the file does not give. Each quantity has a separate stream, so a given value leaves the others unchanged.
    ///
    /// Errors: a file constructed in memory that [`RigFile::parse`] would refuse.
    pub fn resolve(file: &RigFile, seed: u64) -> Result<Self, String> {
        file.check()?;
        let mut file = file.clone();
        let gyro = parts("unit.gyro", MeasuredQuantity::Gyro, file.unit.gyro.as_ref())?;
        let accel = parts(
            "unit.accel",
            MeasuredQuantity::Accel,
            file.unit.accel.as_ref(),
        )?;

        let effects = effects(&mut file, seed)?;
        let earth_rate = *file.earth_rate.get_or_insert(true);
        let unit = &mut file.unit;
        let affine = unit.gyro_affine.as_ref();
        let mut gyro_truth = triad(&mut unit.gyro_axes, affine, gyro, "gyro", seed);
        let affine = unit.accel_affine.as_ref();
        let mut accel_truth = triad(&mut unit.accel_axes, affine, accel, "accel", seed);
        let history = std::mem::take(&mut file.history);
        if !history.is_empty() {
            history.apply(&mut gyro_truth, true, seed);
            history.apply(&mut accel_truth, false, seed);
            changed(&mut unit.gyro_affine, &mut unit.gyro_axes, &gyro_truth);
            changed(&mut unit.accel_affine, &mut unit.accel_axes, &accel_truth);
        }
        let gyro_reference_v = gyro_reference_pins(unit, gyro, seed);
        let temperature = temperature(unit, gyro[0], seed);
        let supply = supply(unit, accel[0], seed);

        let converter_reference = converter_reference(&mut file.converter, seed);
        let nominal_v = converter_reference.nominal_v;
        let analog = gyro_truth.analog && accel_truth.analog;
        let sensors = [gyro[0], accel[0]];
        let converter = converter(&mut file.converter, nominal_v, sensors, analog);
        set_codes(&mut gyro_truth, nominal_v / converter.gyro_divider);
        set_codes(&mut accel_truth, nominal_v / converter.accel_divider);

        let further = file.further(nominal_v / f64::from(converter.bits).exp2(), seed)?;
        if further.iter().any(|f| f.kind == MeasuredQuantity::Mag) {
            file.field.get_or_insert_default();
        }
        let curves = file.curves.resolve(seed);
        let thermal = thermal(&mut file, [gyro[0], gyro[1], gyro[2], accel[0]], seed);
        let (table, hands, flaws) = (file.table.clone(), file.hands.clone(), file.flaws.clone());
        let field = file.field.clone().unwrap_or_default();
        Ok(Self {
            file,
            earth_rate,
            unit: UnitTruth {
                gyro: gyro_truth,
                accel: accel_truth,
                thermal,
                temperature,
                supply,
                converter_reference,
                gyro_reference_nominal_v: gyro[0].reference_v.unwrap_or(0.0),
                gyro_reference_v,
                effects,
                curves,
            },
            converter,
            table,
            hands,
            flaws,
            field,
            further,
        })
    }
}

/// Puts the model of `truth` into the file, in the form in which the file has it.
fn changed(affine: &mut Option<AffineFile>, axes: &mut AxesFile, truth: &TriadTruth) {
    let (matrix, bias) = truth.affine();
    match affine {
        Some(affine) => *affine = AffineFile { matrix, bias },
        None => {
            axes.directions = Some(truth.axes.each_ref().map(|a| a.direction));
            axes.sensitivity_raw_per_si = Some(truth.axes.each_ref().map(|a| a.sensitivity));
            axes.null_raw = Some(truth.axes.each_ref().map(|a| a.null));
        }
    }
}

/// True voltages of the gyros' reference pins; 0 without pins.
fn gyro_reference_pins(file: &mut UnitFile, gyro: [&Sensor; 3], seed: u64) -> [f64; 3] {
    if let Some(nominal_v) = gyro[0].reference_v {
        file.gyro_reference_v.get_or_insert_with(|| {
            let mut r = Random::new(seed, "gyro reference pins");
            gyro.map(|s| nominal_v + r.within(s.reference_tolerance_v.unwrap_or(0.0)))
        });
    }
    file.gyro_reference_v.unwrap_or_default()
}

fn temperature(file: &mut UnitFile, gyro: &Sensor, seed: u64) -> TemperatureTruth {
    // In the catalog, parts with a reference pin also have a TEMP pin.
    let usual = if gyro.reference_v.is_some() {
        TemperatureSensor::Dies
    } else {
        TemperatureSensor::Board
    };
    TemperatureTruth {
        at: *file.temperature.get_or_insert(usual),
        lag_s: *file.temperature_lag_s.get_or_insert(0.0),
        offset_c: *file
            .temperature_offset_c
            .get_or_insert_with(|| Random::new(seed, "temperature offset").within(2.0)),
        noise_c: *file.temperature_noise_c.get_or_insert(0.02),
    }
}

/// The accelerometer's supply.
fn supply(file: &mut UnitFile, accel: &Sensor, seed: u64) -> VoltageTruth {
    let error = || Random::new(seed, "supply error").within(5000.0);
    VoltageTruth {
        nominal_v: accel.supply_v,
        error: 1e-6 * *file.supply_error_ppm.get_or_insert_with(error),
        per_c: 1e-6 * *file.supply_ppm_per_c.get_or_insert(0.0),
        noise: 1e-6 * *file.supply_noise_ppm.get_or_insert(0.0),
    }
}

fn converter_reference(file: &mut ConverterFile, seed: u64) -> VoltageTruth {
    let error = || Random::new(seed, "converter reference error").within(5000.0);
    VoltageTruth {
        nominal_v: *file.reference_v.get_or_insert(3.3),
        error: 1e-6 * *file.reference_error_ppm.get_or_insert_with(error),
        per_c: 1e-6 * *file.reference_ppm_per_c.get_or_insert(0.0),
        noise: 1e-6 * *file.reference_noise_ppm.get_or_insert(0.0),
    }
}

/// The converter for a gyro and an accelerometer; `analog` if the outputs of both are voltages.
fn converter(
    file: &mut ConverterFile,
    nominal_v: f64,
    [gyro, accel]: [&Sensor; 2],
    analog: bool,
) -> ConverterTruth {
    // By the part, even if its output range is given, because boards are designed from data sheets.
    let divider = |part: &Sensor| match part.output {
        RawUnit::V => (20.0 * (nominal_v / part.high).min(1.0)).floor() / 20.0,
        RawUnit::Count => 1.0,
    };
    ConverterTruth {
        bits: *file.bits.get_or_insert(16),
        gyro_divider: *file.gyro_divider.get_or_insert(divider(gyro)),
        accel_divider: *file.accel_divider.get_or_insert(divider(accel)),
        conversions: *file.conversions.get_or_insert(4),
        noise_codes: *file.noise_codes.get_or_insert(1.5),
        take_out_reference: *file.take_out_reference.get_or_insert(false),
        raw_unit: *file
            .raw_unit
            .get_or_insert(if analog { RawUnit::V } else { RawUnit::Count }),
    }
}

/// Sets the readings that the converter's codes cover: up to `full_scale_v` at an analog part's output.
fn set_codes(triad: &mut TriadTruth, full_scale_v: f64) {
    (triad.code_low, triad.code_span) = if triad.analog {
        (0.0, full_scale_v)
    } else {
        (-32768.0, 65536.0)
    };
}

/// Draws the effects and adds them to the file.
fn effects(file: &mut RigFile, seed: u64) -> Result<Vec<EffectTruth>, Refusal> {
    let count = file.draw_effects.take().unwrap_or(0);
    let stated = file.effect.len();
    let drawn = draw_ids(count + stated, seed).into_iter();
    let new: Vec<_> = drawn
        .filter(|id| file.effect.iter().all(|e| e.id != *id))
        .take(count)
        .collect();
    file.effect.extend(new.into_iter().map(|id| EffectFile {
        id: id.to_owned(),
        parameters: toml::Table::new(),
    }));
    let mut truths = Vec::new();
    for (i, effect) in file.effect.iter_mut().enumerate() {
        let numbers = effect.numbers(i)?;
        let truth = EffectTruth::draw(&effect.id, numbers, 1.0, seed).expect("the id was checked");
        *effect = EffectFile::from(&truth);
        truths.push(truth);
    }
    Ok(truths)
}

fn thermal(file: &mut RigFile, parts: [&Sensor; 4], seed: u64) -> ThermalTruth {
    let random = |cause: &str| Random::new(seed, cause);
    let t = &mut file.thermal;
    ThermalTruth {
        board_lag_s: *t
            .board_lag_s
            .get_or_insert_with(|| 300.0 + random("board lag").within(100.0)),
        die_lag_s: *t.die_lag_s.get_or_insert_with(|| {
            let mut r = random("die lag");
            from_fn(|_| 5.5 + r.within(2.5))
        }),
        board_heating_c: *t
            .board_heating_c
            .get_or_insert_with(|| 4.5 + random("board heating").within(1.5)),
        die_heating_c: *t.die_heating_c.get_or_insert_with(|| {
            let mut r = random("die heating");
            parts.map(|s| s.heating_c * (1.0 + r.within(0.2)))
        }),
        on_before_s: *t.on_before_s.get_or_insert(0.0),
    }
}

/// Axes from the catalog, except for given values. Directions, sensitivities and nulls are those of the forward model, if there is one.
pub(super) fn triad(
    file: &mut AxesFile,
    affine: Option<&AffineFile>,
    parts: [&Sensor; 3],
    name: &str,
    seed: u64,
) -> TriadTruth {
    let si = parts[0].kind.si();
    let random = |cause: &str| Random::new(seed, &format!("{name} {cause}"));
    // Noise differs from part to part, but data sheets do not give by how much.
    let noise = |slot: &mut Option<[f64; 3]>, cause: &str, typical: [f64; 3]| {
        *slot.get_or_insert_with(|| {
            let mut r = random(cause);
            typical.map(|x| x * (1.0 + r.within(0.2)))
        })
    };
    let white = noise(
        &mut file.white_si,
        "white",
        parts.map(|s| si * s.noise_density / 2_f64.sqrt()),
    );
    let instability = noise(
        &mut file.instability_si,
        "instability",
        parts.map(|s| si * s.instability),
    );
    let walk = noise(&mut file.walk_si, "walk", parts.map(|s| si * s.walk));
    let white_per_sample = *file.white_per_sample.get_or_insert([0.0; 3]);
    let bandwidth_hz = *file
        .bandwidth_hz
        .get_or_insert(from_fn(|i| parts[i].bandwidth_hz[i]));
    let rc_hz = *file.rc_hz.get_or_insert(parts[0].rc_hz);
    let low = *file.low_raw.get_or_insert(parts[0].low);
    let high = *file.high_raw.get_or_insert(parts[0].high);

    let (mut directions, mut sensitivity, mut null) = ([[0.0; 3]; 3], [0.0; 3], [0.0; 3]);
    if affine.is_none() {
        directions = *file
            .directions
            .get_or_insert_with(|| draw_directions(parts, &mut random("directions")));
        sensitivity = *file.sensitivity_raw_per_si.get_or_insert_with(|| {
            let mut r = random("sensitivity");
            parts.map(|s| s.sensitivity / si * (1.0 + r.within(s.sensitivity_tolerance)))
        });
        null = *file.null_raw.get_or_insert_with(|| {
            let mut r = random("null");
            parts.map(|s| s.null + r.within(s.null_tolerance))
        });
    }
    let mut triad = TriadTruth {
        axes: from_fn(|i| AxisTruth {
            direction: unit(directions[i]),
            sensitivity: sensitivity[i],
            null: null[i],
            bandwidth_hz: bandwidth_hz[i],
            rc_hz,
            noise: Coefficients {
                white: white[i],
                instability: instability[i],
                walk: walk[i],
            },
            white_per_sample: white_per_sample[i],
            low,
            high,
        }),
        ratiometric: parts[0].ratiometric,
        analog: parts[0].output == RawUnit::V,
        code_low: 0.0,
        code_span: 0.0,
    };
    if let Some(affine) = affine {
        triad.set_affine(&affine.matrix, &affine.bias);
    }
    triad
}

/// A length of exactly 1 is left unchanged, bit by bit.
fn unit(v: Vector) -> Vector {
    let length = norm(v);
    if length == 0.0 || (length - 1.0).abs() < 1e-15 {
        v
    } else {
        scale(1.0 / length, v)
    }
}

fn draw_directions(parts: [&Sensor; 3], random: &mut Random) -> [Vector; 3] {
    let mut turn = |s: &Sensor| {
        let angles: Vector = from_fn(|_| (random.normal() * s.misalignment_deg).to_radians());
        Rotation::about(angles, norm(angles))
    };
    let mut package = turn(parts[0]);
    let mut directions = [[0.0; 3]; 3];
    for i in 0..3 {
        if i > 0 && parts[i].packages > 1 {
            package = turn(parts[i]);
        }
        directions[i][i] = 1.0;
        directions[i] = package.turn(directions[i]);
    }
    for i in 0..3 {
        let across: Vector = from_fn(|j| {
            if i == j {
                0.0
            } else {
                random.within(parts[i].cross_axis)
            }
        });
        directions[i] = unit(add(directions[i], across));
    }
    directions
}
