//! The calibration file: TOML that a program reads and a person can apply with a pocket calculator.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use mimu_core::compensation::Affine;
use nalgebra::{Matrix3, Vector3};
use serde::Deserialize;
use tempfile::NamedTempFile;

use crate::dwell::Sensor;
use crate::error::{Error, Result};
use crate::fit::{Figure, Fit, SensorFit};
use crate::recording::{RawUnit, Reference, read_text};
use crate::triad::{Angles, Forward};

/// Version of the layout.
const FORMAT: &str = "mimu-calibration/1";

/// A calibration as a file holds it.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// `mimu-calibration/1`.
    pub format: String,
    /// Unit that it is for.
    pub device: String,
    /// When it was made, RFC 3339.
    pub created: String,
    /// Program and version that made it.
    pub tool: String,
    /// What it was made from.
    pub recording: Origin,
    /// Gyro triad.
    #[serde(default)]
    pub gyro: Option<TriadTable>,
    /// Accelerometer triad.
    #[serde(default)]
    pub accel: Option<TriadTable>,
}

/// The recording that a calibration was made from.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// SHA-256 of its samples file.
    pub sha256: String,
    /// What was known of its input.
    pub reference: Reference,
    /// Unit of its raw columns.
    pub raw_unit: RawUnit,
    /// Local gravity, m/s².
    pub gravity_mps2: f64,
    /// Mean temperature of the dwells, °C, if known.
    #[serde(default)]
    pub temp_c: Option<f64>,
}

/// One triad in a calibration file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(non_snake_case)] // C, P: the letters of the formulas, in the file as in the papers
pub struct TriadTable {
    /// `x = C u + o`.
    pub formula: String,
    /// `raw to SI`.
    pub direction: String,
    /// Unit of u.
    pub raw_unit: RawUnit,
    /// Unit of x.
    pub unit: String,
    /// Axes that x is given in.
    pub frame: String,
    /// SI per raw unit, by rows.
    pub C: [[f64; 3]; 3],
    /// SI.
    pub o: [f64; 3],
    /// Standard deviations of C.
    pub sigma_C: [[f64; 3]; 3],
    /// Standard deviations of o.
    pub sigma_o: [f64; 3],
    /// Halves of the 95 % intervals of C.
    pub interval_C: [[f64; 3]; 3],
    /// Halves of the 95 % intervals of o.
    pub interval_o: [f64; 3],
    /// Order of the covariance.
    pub parameters: Vec<String>,
    /// 12x12.
    pub covariance: Vec<Vec<f64>>,
    /// How well it did.
    pub judged: Judged,
    /// The same calibration the other way.
    pub forward: ForwardTable,
    /// And as physical quantities.
    pub physical: PhysicalTable,
}

/// Error figures of the fit.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Judged {
    /// How it was estimated.
    pub estimator: String,
    /// What the figures are about.
    pub figure: String,
    /// Unit of the figures.
    pub unit: String,
    /// On the data it was fitted to.
    pub rms: f64,
    /// On data it had not seen.
    #[serde(default)]
    pub held_out_rms: Option<f64>,
    /// If noise were all.
    pub noise_floor: f64,
    /// Dwells used.
    pub dwells: usize,
    /// Condition of the experiment.
    pub condition: f64,
}

/// Forward model, SI to raw.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(non_snake_case)]
pub struct ForwardTable {
    /// `u = P x + b`.
    pub formula: String,
    /// `SI to raw`.
    pub direction: String,
    /// Raw per SI, by rows.
    pub P: [[f64; 3]; 3],
    /// Raw.
    pub b: [f64; 3],
}

/// Physical quantities with their standard deviations.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PhysicalTable {
    /// How `P` is made of them.
    pub formula: String,
    /// Raw per SI.
    pub scale_factor: [f64; 3],
    /// Standard deviations.
    pub sigma_scale_factor: [f64; 3],
    /// Raw.
    pub bias: [f64; 3],
    /// Standard deviations.
    pub sigma_bias: [f64; 3],
    /// θx, θy, θz, degrees.
    pub misalignment_deg: [f64; 3],
    /// Standard deviations.
    pub sigma_misalignment_deg: [f64; 3],
    /// βyz, βzy, βzx, degrees.
    pub non_orthogonality_deg: [f64; 3],
    /// Standard deviations.
    pub sigma_non_orthogonality_deg: [f64; 3],
}

impl Calibration {
    /// Reads and checks a calibration file.
    pub fn read(path: &Path) -> Result<Self> {
        let text = read_text(path)?;
        Self::parse(&text, &path.display().to_string())
    }

    /// Parses and checks the text of a calibration file; `place` is its path.
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        let calibration: Self = toml::from_str(text).map_err(|e| {
            let message = e.message().trim();
            // A missing key has the table that lacks it for its place.
            let line = e.span().map_or(1, |s| {
                let before = text.get(..s.start).unwrap_or(text);
                1 + before.matches('\n').count()
            });
            let remedy = if message.starts_with("missing field") {
                "the file is cut or was edited: copy it again, or fit the recording again"
            } else {
                "correct the line, or fit the recording again"
            };
            Error::new(format!("{place}, line {line}"), message, remedy)
        })?;
        if calibration.format != FORMAT {
            let problem = format!(
                "format is {:?}, and this program reads {FORMAT:?}",
                calibration.format
            );
            return Err(Error::new(
                place,
                problem,
                "use the version of mimu that wrote it",
            ));
        }
        for sensor in Sensor::BOTH {
            let Some(table) = calibration.table(sensor) else {
                continue;
            };
            let place = format!("{place}, [{sensor}]");
            let numbers = table
                .C
                .iter()
                .flatten()
                .chain(&table.o)
                .chain(table.covariance.iter().flatten());
            if !numbers.into_iter().all(|x| x.is_finite()) {
                return Err(Error::new(
                    place,
                    "C, o or covariance has an entry that is not a number",
                    "fit the recording again",
                ));
            }
            if table.direction != "raw to SI" || table.formula != "x = C u + o" {
                let problem = format!(
                    "formula {:?}, direction {:?}: only x = C u + o, raw to SI, can be applied",
                    table.formula, table.direction
                );
                return Err(Error::new(
                    place,
                    problem,
                    "use the version of mimu that wrote it",
                ));
            }
            if table.covariance.len() != 12 || table.covariance.iter().any(|r| r.len() != 12) {
                return Err(Error::new(
                    place,
                    "covariance is not 12 by 12",
                    "fit the recording again",
                ));
            }
            let inverse = calibration.inverse(sensor);
            let Some(forward) = inverse.as_ref().and_then(Forward::of) else {
                return Err(Error::new(
                    place,
                    "C is singular",
                    "fit the recording again",
                ));
            };
            check_both_ways(table, &forward, &place)?;
        }
        if calibration.gyro.is_none() && calibration.accel.is_none() {
            return Err(Error::new(
                place,
                "there is neither [gyro] nor [accel]",
                "fit the recording again",
            ));
        }
        Ok(calibration)
    }

    /// The table of `sensor`.
    pub fn table(&self, sensor: Sensor) -> Option<&TriadTable> {
        match sensor {
            Sensor::Gyro => self.gyro.as_ref(),
            Sensor::Accel => self.accel.as_ref(),
        }
    }

    /// The inverse model of `sensor`.
    pub fn inverse(&self, sensor: Sensor) -> Option<Affine<f64>> {
        let table = self.table(sensor)?;
        Some(Affine {
            matrix: Matrix3::from_fn(|i, j| table.C[i][j]),
            offset: Vector3::from(table.o),
        })
    }
}

/// Refuses a file in which the two directions of the calibration disagree: one of them was edited.
fn check_both_ways(table: &TriadTable, forward: &Forward, place: &str) -> Result<()> {
    let (matrix, offset) = (forward.matrix, forward.bias);
    let off_p = Matrix3::from_fn(|i, j| table.forward.P[i][j] - matrix[(i, j)]);
    let off_b = Vector3::from(table.forward.b) - offset;
    // Both are written to all their digits; what an inversion loses stays far below.
    let alike = off_p.norm() <= 1e-6 * matrix.norm()
        && off_b.norm() <= 1e-6 * (offset.norm() + matrix.norm());
    if alike {
        return Ok(());
    }
    Err(Error::new(
        place,
        "C and o are not the inverse of forward.P and forward.b: the file was edited",
        "fit the recording again",
    ))
}

/// Text of the calibration file for `fit`, made at `created` (RFC 3339).
pub fn to_toml(fit: &Fit, created: &str) -> String {
    let mut out = String::new();
    // Writing to a string does not fail.
    let _ = write_file(&mut out, fit, created);
    out
}

fn write_file(out: &mut String, fit: &Fit, created: &str) -> std::fmt::Result {
    let manifest = &fit.prepared.manifest;
    writeln!(
        out,
        "# Calibration of an inertial unit. To apply it by hand to a raw reading u = (x, y, z):"
    )?;
    writeln!(
        out,
        "#   first axis  = C[0][0]*u_x + C[0][1]*u_y + C[0][2]*u_z + o[0],  and so on by rows."
    )?;
    writeln!(out, "format = \"{FORMAT}\"")?;
    writeln!(out, "device = {}", quoted(&manifest.device))?;
    writeln!(out, "created = \"{created}\"")?;
    writeln!(out, "tool = \"mimu {}\"", env!("CARGO_PKG_VERSION"))?;
    writeln!(
        out,
        "\n[recording]\nsha256 = \"{}\"  # of its samples file",
        fit.prepared.condensed.sha256
    )?;
    writeln!(
        out,
        "reference = \"{}\"\nraw_unit = \"{}\"\ngravity_mps2 = {:?}",
        manifest.reference, manifest.raw_unit, manifest.gravity_mps2
    )?;
    let temperatures: Vec<f64> = fit
        .prepared
        .dwells
        .list
        .iter()
        .map(|d| d.temp_c)
        .filter(|t| t.is_finite())
        .collect();
    if !temperatures.is_empty() {
        let mean = temperatures.iter().sum::<f64>() / temperatures.len() as f64;
        writeln!(
            out,
            "temp_c = {mean:?}  # mean of the dwells; nothing here depends on it"
        )?;
    }
    for sensor in &fit.sensors {
        write_sensor(out, fit, sensor)?;
    }
    Ok(())
}

fn write_sensor(out: &mut String, fit: &Fit, sensor: &SensorFit) -> std::fmt::Result {
    let name = sensor.sensor.name();
    let raw_unit = fit.prepared.manifest.raw_unit;
    let triad = &sensor.estimated.triad;
    let frame = match (fit.prepared.manifest.reference, sensor.sensor) {
        (Reference::Table, _) => "body: the axes of the ref_ columns",
        (Reference::Gravity, Sensor::Accel) => {
            "body: x along the accelerometer's x, xy plane through its y"
        }
        (Reference::Gravity, Sensor::Gyro) => {
            "body: the accelerometer's (x along its x, xy plane through its y)"
        }
    };
    writeln!(
        out,
        "\n[{name}]\nformula = \"x = C u + o\"\ndirection = \"raw to SI\""
    )?;
    writeln!(
        out,
        "raw_unit = \"{raw_unit}\"\nunit = \"{}\"\nframe = \"{frame}\"",
        sensor.sensor.unit()
    )?;
    let covariance = &triad.inverse_covariance;
    let estimates = triad.inverse_estimates();
    let sigma = |i: usize| estimates[i].sigma;
    let interval = |i: usize| estimates[i].interval;
    writeln!(
        out,
        "C = {}",
        matrix(|i, j| number(triad.inverse.matrix[(i, j)]))
    )?;
    writeln!(out, "o = {}", row(3, |i| number(triad.inverse.offset[i])))?;
    writeln!(
        out,
        "sigma_C = {}",
        matrix(|i, j| format!("{:.3e}", sigma(3 * i + j)))
    )?;
    writeln!(
        out,
        "sigma_o = {}",
        row(3, |i| format!("{:.3e}", sigma(9 + i)))
    )?;
    writeln!(out, "# halves of the 95 % intervals")?;
    writeln!(
        out,
        "interval_C = {}",
        matrix(|i, j| format!("{:.3e}", interval(3 * i + j)))
    )?;
    writeln!(
        out,
        "interval_o = {}",
        row(3, |i| format!("{:.3e}", interval(9 + i)))
    )?;
    let names = crate::report::inverse_names();
    writeln!(
        out,
        "parameters = {}",
        row(12, |i| format!("\"{}\"", names[i]))
    )?;
    writeln!(out, "covariance = [")?;
    for i in 0..12 {
        writeln!(out, "  {},", row(12, |j| number(covariance[(i, j)])))?;
    }
    writeln!(out, "]")?;
    writeln!(
        out,
        "\n[{name}.judged]\nestimator = \"{}\"\nfigure = \"{}\"",
        fit.estimator(sensor.sensor),
        figure(sensor.figure)
    )?;
    writeln!(
        out,
        "unit = \"{}\"\nrms = {:.6e}",
        sensor.figure.unit(sensor.sensor),
        sensor.rms()
    )?;
    if let Some(rms) = sensor.held_out_rms() {
        writeln!(
            out,
            "held_out_rms = {rms:.6e}  # {} contiguous blocks",
            fit.options.holdout_blocks
        )?;
    }
    writeln!(
        out,
        "noise_floor = {:.6e}\ndwells = {}\ncondition = {:.4}",
        sensor.noise_floor(),
        sensor.dwells,
        sensor.estimated.condition
    )?;
    writeln!(
        out,
        "\n[{name}.forward]\nformula = \"u = P x + b\"\ndirection = \"SI to raw\""
    )?;
    writeln!(
        out,
        "P = {}",
        matrix(|i, j| number(triad.forward.matrix[(i, j)]))
    )?;
    writeln!(out, "b = {}", row(3, |i| number(triad.forward.bias[i])))?;
    let physical = triad.physical(Angles::Exact);
    writeln!(
        out,
        "\n[{name}.physical]\nformula = \"P = K Mo Mp, Mp = Rz Ry Rx by the misalignments, rows of Mo of unit length\""
    )?;
    let triples = [
        ("scale_factor", &physical.scale, 1.0),
        ("bias", &physical.bias, 1.0),
        (
            "misalignment_deg",
            &physical.misalignment,
            1f64.to_degrees(),
        ),
        (
            "non_orthogonality_deg",
            &physical.non_orthogonality,
            1f64.to_degrees(),
        ),
    ];
    for (key, triple, unit) in triples {
        let order = match key {
            "misalignment_deg" => "  # x, y, z",
            "non_orthogonality_deg" => "  # yz, zy, zx",
            _ => "",
        };
        writeln!(
            out,
            "{key} = {}{order}",
            row(3, |i| number(triple[i].value * unit))
        )?;
        writeln!(
            out,
            "sigma_{key} = {}",
            row(3, |i| format!("{:.3e}", triple[i].sigma * unit))
        )?;
    }
    Ok(())
}

/// What a figure is about, as a sentence fragment.
pub fn figure(figure: Figure) -> &'static str {
    match figure {
        Figure::Input => "compensated dwell mean less known input, over dwells and axes",
        Figure::GravitySize => "size of the compensated dwell mean less gravity",
        Figure::Direction => "angle between predicted and measured gravity after each turn",
    }
}

/// All digits, so that it is read back exactly; minus zero, which only puzzles, is zero.
fn number(value: f64) -> String {
    format!("{:?}", value + 0.0)
}

fn row(n: usize, cell: impl Fn(usize) -> String) -> String {
    format!("[{}]", (0..n).map(cell).collect::<Vec<_>>().join(", "))
}

fn matrix(cell: impl Fn(usize, usize) -> String) -> String {
    let rows: Vec<String> = (0..3)
        .map(|i| format!("  {},\n", row(3, |j| cell(i, j))))
        .collect();
    format!("[\n{}]", rows.concat())
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.into()).to_string()
}

/// A result that is written, and has yet to appear under its name.
#[derive(Debug)]
pub struct Staged {
    path: PathBuf,
    file: Option<NamedTempFile>,
    text: String,
}

/// Writes `text` beside `path`, so that whatever can fail fails before any file has appeared.
pub fn stage(path: &Path, text: String) -> Result<Staged> {
    let failed = |e: std::io::Error| Error::io(path, &e);
    let path = path.to_owned();
    match std::fs::metadata(&path) {
        Ok(there) if there.is_dir() => {
            let problem = "this is a directory, and a file is to be written";
            return Err(Error::new(path.display(), problem, "name a file in it"));
        }
        // A device or a pipe is written to, never replaced: `/dev/null` has to stay what it is.
        Ok(there) if !there.is_file() => {
            let file = None;
            return Ok(Staged { path, file, text });
        }
        _ => {}
    }
    let folder = folder(&path);
    if !folder.is_dir() {
        return Err(Error::new(
            path.display(),
            "its folder does not exist",
            "create it, or check the path",
        ));
    }
    let mut file = NamedTempFile::new_in(folder).map_err(failed)?;
    file.write_all(text.as_bytes()).map_err(failed)?;
    file.as_file().sync_all().map_err(failed)?;
    // Temporary files are private; a result is for everybody who may read the folder's other files.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        let mode = std::fs::Permissions::from_mode(0o644);
        file.as_file().set_permissions(mode).map_err(failed)?;
    }
    let file = Some(file);
    Ok(Staged { path, file, text })
}

impl Staged {
    /// Folder that the file will be in, with its links resolved.
    pub fn folder(&self) -> PathBuf {
        let folder = folder(&self.path);
        folder.canonicalize().unwrap_or_else(|_| folder.to_owned())
    }

    /// Gives the file its name.
    pub fn publish(self) -> Result<()> {
        match self.file {
            Some(file) => file.persist(&self.path).map(drop).map_err(|e| e.error),
            None => std::fs::write(&self.path, self.text),
        }
        .map_err(|e| Error::io(&self.path, &e))
    }
}

fn folder(path: &Path) -> &Path {
    let parent = path.parent().filter(|p| !p.as_os_str().is_empty());
    parent.unwrap_or(Path::new("."))
}
