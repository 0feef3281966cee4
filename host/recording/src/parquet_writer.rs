//! `samples.parquet`.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parquet::basic::{Compression, Encoding, Repetition, Type as Physical, ZstdLevel};
use parquet::data_type::{DoubleType, Int32Type};
use parquet::errors::ParquetError;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{ColumnPath, Type};

use super::batch::Batch;
use super::columns::{Column, Columns};
use crate::error::{Error, Result};

/// Rows in a row group: 60 MB in memory with all columns, 28 groups in four hours at 1 kHz.
pub(super) const ROW_GROUP: usize = 512 << 10;

pub(super) struct ParquetWriter {
    path: PathBuf,
    writer: SerializedFileWriter<File>,
    columns: Columns,
    waiting: Batch,
    row_group: usize,
}

impl std::fmt::Debug for ParquetWriter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ParquetWriter")
            .field("path", &self.path)
            .finish_non_exhaustive()
    }
}

impl ParquetWriter {
    pub fn create(path: &Path, columns: Columns) -> Result<ParquetWriter> {
        // Byte stream splitting puts the slowly changing exponents side by side. Bytes a row of 13
        // columns (noisy doubles, volts from 16 bits, counts): snappy plain 62, 36, 27; zstd plain
        // 48, 19, 15; zstd dictionary 53, 14, 14; zstd split 37, 14, 8. All are written at 5 million
        // rows a second or more and read at 12 to 20, so the size decides. Zstd's level 3 gains nothing.
        let mut properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            .set_dictionary_enabled(false)
            .set_statistics_enabled(EnabledStatistics::Chunk);
        for column in columns.present().filter(|&column| column != Column::Step) {
            let name = ColumnPath::from(column.name());
            properties = properties.set_column_encoding(name, Encoding::BYTE_STREAM_SPLIT);
        }
        Self::with_properties(path, columns, properties.build(), ROW_GROUP)
    }

    pub fn with_properties(
        path: &Path,
        columns: Columns,
        properties: WriterProperties,
        row_group: usize,
    ) -> Result<ParquetWriter> {
        let failed = |error: ParquetError| write_error(path, &error);
        let mut fields = Vec::new();
        for column in columns.present() {
            // Empty cells are nulls, so that other programs see them as missing too.
            let (physical, repetition) = match column {
                Column::Time => (Physical::DOUBLE, Repetition::REQUIRED),
                Column::Step => (Physical::INT32, Repetition::REQUIRED),
                _ => (Physical::DOUBLE, Repetition::OPTIONAL),
            };
            let field = Type::primitive_type_builder(column.name(), physical)
                .with_repetition(repetition)
                .build()
                .map_err(failed)?;
            fields.push(Arc::new(field));
        }
        let schema = Type::group_type_builder("samples")
            .with_fields(fields)
            .build()
            .map_err(failed)?;
        let file = File::create(path).map_err(|error| Error::io(path, &error))?;
        let writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties))
            .map_err(failed)?;
        Ok(ParquetWriter {
            path: path.to_owned(),
            writer,
            columns,
            waiting: Batch::default(),
            row_group,
        })
    }

    pub fn write(&mut self, batch: &Batch) -> Result<()> {
        let mut from = 0;
        while from < batch.len() {
            let to = batch.len().min(from + self.row_group - self.waiting.len());
            for column in self.columns.present() {
                match (self.waiting.values_mut(column), batch.values(column)) {
                    (Some(waiting), Some(values)) => waiting.extend_from_slice(&values[from..to]),
                    _ => self.waiting.step.extend_from_slice(&batch.step[from..to]),
                }
            }
            from = to;
            if self.waiting.len() == self.row_group {
                self.flush()?;
            }
        }
        Ok(())
    }

    pub fn finish(mut self) -> Result<()> {
        if !self.waiting.is_empty() {
            self.flush()?;
        }
        let file = self
            .writer
            .into_inner()
            .map_err(|error| write_error(&self.path, &error))?;
        file.sync_all()
            .map_err(|error| Error::io(&self.path, &error))
    }

    fn flush(&mut self) -> Result<()> {
        self.write_group()
            .map_err(|error| write_error(&self.path, &error))?;
        self.waiting.clear();
        Ok(())
    }

    fn write_group(&mut self) -> parquet::errors::Result<()> {
        let mut group = self.writer.next_row_group()?;
        let mut dense = Vec::new();
        for column in self.columns.present() {
            let Some(mut writer) = group.next_column()? else {
                break;
            };
            match self.waiting.values(column) {
                None => {
                    let steps = &self.waiting.step;
                    writer.typed::<Int32Type>().write_batch(steps, None, None)?;
                }
                Some(values) if column == Column::Time => {
                    writer
                        .typed::<DoubleType>()
                        .write_batch(values, None, None)?;
                }
                Some(values) => {
                    let levels: Vec<i16> = values.iter().map(|v| i16::from(!v.is_nan())).collect();
                    dense.clear();
                    dense.extend(values.iter().filter(|value| !value.is_nan()));
                    let writer = writer.typed::<DoubleType>();
                    writer.write_batch(&dense, Some(&levels), None)?;
                }
            }
            writer.close()?;
        }
        group.close()?;
        Ok(())
    }
}

fn write_error(path: &Path, error: &ParquetError) -> Error {
    if let ParquetError::External(source) = error
        && let Some(io) = source.downcast_ref::<std::io::Error>()
    {
        return Error::io(path, io);
    }
    Error::new(path.display(), error, "check the disk and its free space")
}
