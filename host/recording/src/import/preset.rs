//! Presets for the files of well-known makers: how to recognise them, and what their columns mean.
//!
//! A preset is data: lists of columns and factors, which are used as if they were given by hand.

mod layout;
mod table;

use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::Serialize;

use super::assignment::ColumnList;
use super::broken::Unreadable;
use super::head;
use super::log::is_log;
use super::per_column::Scale;
use super::table::{Cells, Table};
use crate::cell::shorten;
use crate::declared::RawUnit;
use crate::error::{Argument, Error, Result};
use crate::separator::Separator;
use layout::Layout;
pub use layout::Preset;
use table::PRESETS;

/// Bytes at the start of a file that contain its header and the lines above it.
const HEAD: u64 = 1 << 16;

/// The preset of an import.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PresetUse {
    /// Name of the preset.
    pub name: &'static str,
    /// The files that it reads.
    pub title: &'static str,
    /// Whether it was recognised by the headers instead of given.
    pub recognised: bool,
}

/// A preset with the files that it fits.
#[derive(Debug, Clone)]
pub struct Chosen {
    /// Which one.
    pub used: PresetUse,
    /// Unit of the readings, if the maker uses only one.
    pub raw_unit: Option<RawUnit>,
    /// The files; those in a folder if a folder was given.
    pub files: Vec<PathBuf>,
    /// What their columns mean.
    pub columns: Vec<ColumnList>,
    /// Factors, signs included.
    pub scales: Vec<Scale>,
    /// Sample rate in Hz, if a line above the data contains it.
    pub rate_hz: Option<f64>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
    /// Why a file of this maker is refused: it contains no readings of a sensor.
    refused: Option<Error>,
}

impl FromStr for Preset {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        let known = Preset::all().iter().find(|preset| preset.name == name);
        known.copied().ok_or_else(|| {
            let names: Vec<&str> = Preset::all().iter().map(|preset| preset.name).collect();
            Error::new(
                "preset",
                format!("{} is unknown", shorten(name.as_bytes())),
                format!("write one of {}", names.join(", ")),
            )
        })
    }
}

impl Preset {
    /// All of them.
    pub fn all() -> &'static [Preset] {
        &PRESETS
    }

    /// Applies `named` to `paths`, files or folders. Without `named`, applies the only preset that their headers fit; `None` if none fits.
    ///
    /// Errors: the files do not fit the named preset, fit several presets, or contain no readings of a sensor.
    pub fn choose(
        named: Option<Preset>,
        paths: &[PathBuf],
        separator: Option<Separator>,
    ) -> Result<Option<Chosen>> {
        let fits = |preset: &Preset, recognise| {
            preset
                .of(paths, separator, recognise)
                .map(|mut chosen| match chosen.refused.take() {
                    Some(refused) => Err(refused),
                    None => Ok(chosen),
                })
        };
        if let Some(preset) = named {
            return fits(&preset, false)?.map(Some);
        }
        let fitting = Preset::all()
            .iter()
            .filter_map(|preset| fits(preset, true).ok());
        let (mut fitting, useless): (Vec<_>, Vec<_>) = fitting.partition(Result::is_ok);
        let mut fitting: Vec<Chosen> = fitting.drain(..).flatten().collect();
        if fitting.len() > 1 {
            let names: Vec<&str> = fitting.iter().map(|chosen| chosen.used.name).collect();
            return Err(Error::new(
                paths[0].display(),
                format!("it has the header of {}", names.join(" and of ")),
                "name the preset",
            )
            .about(Argument::Preset));
        }
        match (fitting.pop(), useless.into_iter().next()) {
            (None, Some(useless)) => useless.map(Some),
            (chosen, _) => Ok(chosen),
        }
    }

    /// Applies the preset to `paths`; `recognise`: it was not named.
    fn of(
        &self,
        paths: &[PathBuf],
        separator: Option<Separator>,
        recognise: bool,
    ) -> Result<Chosen> {
        let mut files = Vec::new();
        for path in paths {
            match path.is_dir() {
                true => files.extend(self.files_in(path)?),
                false => files.push(path.clone()),
            }
        }
        let mut chosen = Chosen {
            used: PresetUse {
                name: self.name,
                title: self.title,
                recognised: recognise,
            },
            raw_unit: self.raw_unit,
            files: Vec::new(),
            columns: Vec::new(),
            scales: Vec::new(),
            rate_hz: None,
            warnings: Vec::new(),
            refused: None,
        };
        for file in &files {
            let (layout, list, rate_hz) = self.layout(file, separator)?;
            if let Some([problem, remedy]) = layout.refusal {
                let refused = Error::new(file.display(), problem, remedy);
                chosen.refused.get_or_insert(refused);
            }
            for text in layout.scales {
                let scale: Scale = text.parse()?;
                if !chosen.scales.contains(&scale) {
                    chosen.scales.push(scale);
                }
            }
            chosen.columns.push(list);
            chosen.rate_hz = chosen.rate_hz.or(rate_hz);
            if self.contradicted_beside(file) {
                let metadata = self.beside.map_or("", |beside| beside.file);
                let problem = format!(
                    "by {} beside {}, the file does not belong to the preset {} but to another one with the same header",
                    metadata,
                    file.display(),
                    self.name
                );
                if recognise {
                    return Err(Error::new(file.display(), problem, ""));
                }
                chosen.warnings.push(problem);
            }
        }
        chosen.files = files;
        Ok(chosen)
    }

    /// The first of its sets of files that `folder` contains.
    fn files_in(&self, folder: &Path) -> Result<Vec<PathBuf>> {
        let sets = self.in_folder.iter();
        let mut sets = sets.map(|set| set.iter().map(|file| folder.join(file)).collect());
        let mut mags = self.mag_in_folder.iter().map(|file| folder.join(file));
        let mag = mags.find(|file| file.is_file());
        sets.find(|set: &Vec<PathBuf>| set.iter().all(|file| file.is_file()))
            .map(|set| [set, Vec::from_iter(mag)].concat())
            .ok_or_else(|| {
                let sets: Vec<String> = self.in_folder.iter().map(|s| s.join(" and ")).collect();
                let problem = match sets.is_empty() {
                    true => format!(
                        "this is a folder, but the preset {} is for files",
                        self.name
                    ),
                    false => format!(
                        "this folder has no files of the preset {}: {}",
                        self.name,
                        sets.join(", or ")
                    ),
                };
                Error::new(folder.display(), problem, "name the files")
            })
    }

    /// The layout of `path`, its columns, and the sample rate in it.
    fn layout(
        &self,
        path: &Path,
        separator: Option<Separator>,
    ) -> Result<(&'static Layout, ColumnList, Option<f64>)> {
        let refused = |problem: String, remedy: &str| {
            let error = Error::new(path.display(), problem, remedy);
            Err(error.about(Argument::Columns))
        };
        if is_log(path) {
            let problem = "a preset is given, but the messages of a log have fixed columns";
            return Err(Error::new(path.display(), problem, "leave it out"));
        }
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let (head, _) = head::open(path, HEAD)?;
        let head = String::from_utf8_lossy(&head);
        let mut nearest: Option<(Vec<String>, Error)> = None;
        let fits = |layout: &&Layout| {
            layout
                .file
                .is_none_or(|own| own.eq_ignore_ascii_case(&name))
        };
        for layout in self.layouts.iter().filter(fits) {
            let list: ColumnList = layout.columns.parse()?;
            let rate_hz = layout.rate_hz(path, &head);
            let outcome = rate_hz.and_then(|rate| Ok((layout.read(path, list, separator)?, rate)));
            match outcome {
                Ok((list, rate_hz)) => return Ok((layout, list, rate_hz)),
                Err(error) => {
                    let missing = layout.missing(&head);
                    let nearer = |(least, _): &(Vec<String>, Error)| missing.len() < least.len();
                    if nearest.as_ref().is_none_or(nearer) {
                        nearest = Some((missing, error));
                    }
                }
            }
        }
        match nearest {
            None => refused(
                format!("the preset {} has no file of this name", self.name),
                "rename it as its maker names it, or name the columns",
            ),
            // The names are there, but something else is wrong.
            Some((missing, error)) if missing.is_empty() => Err(error),
            Some((missing, _)) => refused(
                format!(
                    "it does not fit the preset {}: its header lacks {}",
                    self.name,
                    missing.join(", ")
                ),
                "give the unchanged file of its maker, or name the columns",
            ),
        }
    }

    /// Whether the file beside `path` shows that it belongs to another preset.
    fn contradicted_beside(&self, path: &Path) -> bool {
        let Some(beside) = &self.beside else {
            return false;
        };
        let Ok(text) = std::fs::read_to_string(path.with_file_name(beside.file)) else {
            return false;
        };
        let mut rows = text.lines().map(|line| {
            let mut cells = csv::ByteRecord::new();
            Separator::Comma.split(line.as_bytes(), &mut cells);
            let text = |cell: &[u8]| String::from_utf8_lossy(cell).to_lowercase();
            cells.iter().map(text).collect::<Vec<String>>()
        });
        let (names, row) = (
            rows.next().unwrap_or_default(),
            rows.next().unwrap_or_default(),
        );
        let is = |(column, value): &(&str, &str)| {
            let mut cells = names.iter().zip(&row);
            cells.any(|(name, cell)| name == column && cell == value)
        };
        beside.values.iter().any(is) != beside.belongs_if_present
    }
}

impl Layout {
    /// The sample rate that a line above the data contains, if this layout has such a line.
    fn rate_hz(&self, path: &Path, head: &str) -> Result<Option<f64>> {
        let Some(words) = self.rate_after else {
            return Ok(None);
        };
        rate_after(head, words).map(Some).ok_or_else(|| {
            let problem = format!("no line above the data contains {words:?} with the sample rate");
            let remedy = "export it with its header, or name the columns";
            Error::new(path.display(), problem, remedy)
        })
    }

    /// Its columns in `path`, including the optional ones that are there. If a column is the time, the first row must have a time.
    fn read(
        &self,
        path: &Path,
        list: ColumnList,
        separator: Option<Separator>,
    ) -> Result<ColumnList> {
        let (mut list, mut columns) = (list, self.columns.to_owned());
        for group in self.optional {
            let more = format!("{columns},{group}");
            if let Ok(parsed) = more.parse()
                && Table::open(path, Some(&parsed), separator.into(), &[]).is_ok()
            {
                (list, columns) = (parsed, more);
            }
        }
        self.timed(path, list, separator)
    }

    fn timed(
        &self,
        path: &Path,
        list: ColumnList,
        separator: Option<Separator>,
    ) -> Result<ColumnList> {
        let mut table = Table::open(path, Some(&list), separator.into(), &[])?;
        let mut cells = Cells::default();
        let row = match table.next(&mut cells) {
            // The import itself reports this.
            Err(Unreadable::Row(_)) => return Ok(list),
            row => row.map_err(Unreadable::into_error)?,
        };
        if row.is_some() && self.columns.contains("t_s") && cells.stamp.value.is_nan() {
            let problem = "the column of the time is empty";
            let remedy = "name the columns without it, and give the rate";
            return Err(Error::new(path.display(), problem, remedy)
                .about(Argument::Columns)
                .about(Argument::SampleRate));
        }
        Ok(list)
    }

    /// Names of its columns that `head` lacks.
    fn missing(&self, head: &str) -> Vec<String> {
        let list: Result<ColumnList> = self.columns.parse();
        match list {
            Ok(ColumnList::ByName(names)) => {
                let names = names.into_iter().map(|(_, name)| name);
                names.filter(|name| !head.contains(name)).collect()
            }
            _ => Vec::new(),
        }
    }
}

/// The number after `words` in one of the first lines.
fn rate_after(head: &str, words: &str) -> Option<f64> {
    let behind = head.lines().find_map(|line| line.split_once(words))?.1;
    let digits = behind.trim_start();
    let end = digits.find(|c: char| !c.is_ascii_digit() && c != '.');
    let rate: f64 = digits[..end.unwrap_or(digits.len())].parse().ok()?;
    (rate > 0.0).then_some(rate)
}
