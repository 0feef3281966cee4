//! Samples as columns, in CSV or Parquet.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::sync::Arc;

use parquet::basic::{Compression, Encoding, Repetition, Type as Physical};
use parquet::data_type::{DoubleType, Int32Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{Type, TypePtr};

use super::{Row, Run};
use crate::body::FurtherTruth;
use crate::plan::{CarriedBy, Plan};

/// Columns before those of the table; if the dwells are numbered, `step` follows the first.
const READINGS: [&str; 8] = [
    "t_s", "temp_c", "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z",
];
/// Columns of the table.
const REFERENCES: [&str; 6] = [
    "ref_rate_x_dps",
    "ref_rate_y_dps",
    "ref_rate_z_dps",
    "ref_force_x_mps2",
    "ref_force_y_mps2",
    "ref_force_z_mps2",
];
/// Number of samples written to a file at once.
const BLOCK: usize = 65_536;

/// Columns of a plan's recording, without `step`.
fn columns(plan: &Plan, further: &[FurtherTruth]) -> Vec<String> {
    let references: &[_] = match plan.carrier {
        CarriedBy::Table => &REFERENCES,
        CarriedBy::Hands => &[],
    };
    let first = READINGS.iter().chain(references);
    let further = further
        .iter()
        .flat_map(|triad| ["x", "y", "z"].map(|axis| format!("{}_{axis}", triad.name)));
    first
        .map(|name| (*name).to_owned())
        .chain(further)
        .collect()
}

/// The values of [`columns`] in their order; NaN is an empty cell.
fn values(row: &Row) -> impl Iterator<Item = f64> {
    let Row {
        instant,
        stamp_s,
        readings,
        further,
    } = row;
    let ([gx, gy, gz], [ax, ay, az]) = (readings.gyro, readings.accel);
    let first = [*stamp_s, readings.temp_c, gx, gy, gz, ax, ay, az];
    let stated_dps = instant.stated_rate.map(|rate| rate.map(f64::to_degrees));
    let references = stated_dps.into_iter().chain(instant.stated_force).flatten();
    let further = further.iter().flatten().copied();
    first.into_iter().chain(references).chain(further)
}

/// Number of the dwell, -1 between dwells.
fn step(row: &Row) -> i32 {
    row.instant.step.map_or(-1, |step| step as i32)
}

/// Writes a CSV file: every number with the fewest digits that lose no bit.
pub(super) fn csv(path: &Path, plan: &Plan, further: &[FurtherTruth], run: Run) -> io::Result<()> {
    let mut out = BufWriter::with_capacity(1 << 18, File::create(path)?);
    let columns = columns(plan, further);
    let step_title = if plan.numbered { ",step" } else { "" };
    writeln!(out, "{}{step_title},{}", columns[0], columns[1..].join(","))?;
    for row in run {
        for (i, value) in values(&row).enumerate() {
            match i {
                0 => write!(out, "{value}")?,
                _ if value.is_nan() => out.write_all(b",")?,
                _ => write!(out, ",{value}")?,
            }
            if plan.numbered && i == 0 {
                write!(out, ",{}", step(&row))?;
            }
        }
        out.write_all(b"\n")?;
    }
    out.into_inner().map_err(|e| e.into_error())?.sync_all()
}

/// Writes a Parquet file.
pub(super) fn parquet(
    path: &Path,
    plan: &Plan,
    further: &[FurtherTruth],
    run: Run,
) -> io::Result<()> {
    let columns = columns(plan, further);
    let mut fields: Vec<TypePtr> = Vec::new();
    for column in &columns {
        fields.push(field(column, Physical::DOUBLE)?);
    }
    if plan.numbered {
        fields.insert(1, field("step", Physical::INT32)?);
    }
    let schema = Type::group_type_builder("samples")
        .with_fields(fields)
        .build()?;
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        // Readings rarely repeat, and a dictionary of them would cost more time than all else.
        .set_dictionary_enabled(false)
        .set_encoding(Encoding::PLAIN)
        .build();
    let mut writer =
        SerializedFileWriter::new(File::create(path)?, Arc::new(schema), Arc::new(properties))?;
    let mut run = run.peekable();
    let mut block: Vec<Vec<f64>> = vec![Vec::with_capacity(BLOCK); columns.len()];
    let mut steps = Vec::with_capacity(BLOCK);
    while run.peek().is_some() {
        block.iter_mut().for_each(Vec::clear);
        steps.clear();
        for row in run.by_ref().take(BLOCK) {
            for (column, value) in block.iter_mut().zip(values(&row)) {
                column.push(value);
            }
            steps.push(step(&row));
        }
        let mut group = writer.next_row_group()?;
        for (i, column) in block.iter().enumerate() {
            if let Some(mut out) = group.next_column()? {
                out.typed::<DoubleType>().write_batch(column, None, None)?;
                out.close()?;
            }
            if plan.numbered
                && i == 0
                && let Some(mut out) = group.next_column()?
            {
                out.typed::<Int32Type>().write_batch(&steps, None, None)?;
                out.close()?;
            }
        }
        group.close()?;
    }
    writer.into_inner()?.sync_all()
}

fn field(name: &str, physical: Physical) -> io::Result<TypePtr> {
    let field = Type::primitive_type_builder(name, physical).with_repetition(Repetition::REQUIRED);
    Ok(Arc::new(field.build()?))
}
