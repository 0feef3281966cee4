//! A recording: arrays that Python holds, or a folder on disk.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mimu::prepared::Prepared;
use mimu::quantity::normal_gravity;
use mimu::warning::Warning;
use mimu_cli::called;
use mimu_cli::report::fragment;
use mimu_recording::error::{Argument, Error, Result};
use mimu_recording::look::Given;
use mimu_recording::{
    Column, Columns, InMemory, Manifest, PoseMeans, RawUnit, Reference, SampleFormat, Writer,
    usual_rate_hz,
};
use numpy::ndarray::{Array2, ArrayView1, s};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyBytes, PyDict, PySlice};
use tempfile::TempDir;

use crate::error::{keywords, raised, refused};
use crate::preparation::Preparation;
use crate::work::{computed, done, json, loaded};

/// Gravity if it is not given, m/s².
const STANDARD_GRAVITY: f64 = 9.80665;

/// A recording of a unit.
#[pyclass(frozen, module = "mimu")]
pub(crate) struct Recording {
    pub(crate) source: Source,
    arrays: Option<Arc<Arrays>>,
    /// Result of the import, as JSON.
    imported: Option<String>,
    warnings: Vec<String>,
    /// Its folder, unless it is of arrays.
    directory: Option<PathBuf>,
    /// Kept as long as the recording is used, if the folder is a temporary one.
    folder: Option<Arc<OwnFolder>>,
    /// Units of the arrays that it was made of, if they were converted to SI.
    pub(crate) units: Option<String>,
}

/// A temporary folder, which only the process that made it removes: a forked child has a copy of this.
struct OwnFolder(TempDir, u32);

impl OwnFolder {
    fn new() -> Result<Self> {
        let made = TempDir::with_prefix("mimu-");
        let folder = made.map_err(|e| Error::io(&std::env::temp_dir(), &e))?;
        Ok(Self(folder, std::process::id()))
    }
}

impl Drop for OwnFolder {
    fn drop(&mut self) {
        self.0.disable_cleanup(self.1 != std::process::id());
    }
}

/// Where the samples are.
#[derive(Clone)]
pub(crate) enum Source {
    Samples(Arc<mimu_recording::Recording>),
    Means(Arc<PoseMeans>),
}

impl Source {
    fn open(directory: &Path) -> Result<Self> {
        Ok(match PoseMeans::file(directory) {
            Some(_) => Self::Means(Arc::new(PoseMeans::open(directory)?)),
            None => Self::Samples(Arc::new(mimu_recording::Recording::open(directory)?)),
        })
    }

    /// The recording, prepared for estimation.
    pub(crate) fn prepared(&self, by: &Preparation) -> Result<Prepared> {
        let prepared = match self {
            Self::Samples(recording) => Prepared::read(recording, by.search(), |_| {})?,
            Self::Means(means) => Prepared::of_means(means)?,
        };
        by.complete(prepared)
    }

    /// The samples.
    ///
    /// # Errors
    /// There are only means.
    pub(crate) fn samples(&self) -> Result<&Arc<mimu_recording::Recording>> {
        match self {
            Self::Samples(recording) => Ok(recording),
            Self::Means(means) => Err(Error::new(
                &means.manifest.device,
                "it contains means of poses, but this function needs samples",
                "give the recording of samples from which they were computed",
            )),
        }
    }

    fn manifest(&self) -> &Manifest {
        match self {
            Self::Samples(recording) => &recording.manifest,
            Self::Means(means) => &means.manifest,
        }
    }
}

/// The Python arrays of a recording.
#[derive(Debug)]
struct Arrays {
    t: Py<PyArray1<f64>>,
    step: Option<Py<PyArray1<f64>>>,
    temp: Option<Py<PyArray1<f64>>>,
    gyro: Option<Py<PyArray2<f64>>>,
    accel: Option<Py<PyArray2<f64>>>,
    rate_dps: Option<Py<PyArray2<f64>>>,
    force_mps2: Option<Py<PyArray2<f64>>>,
    rows: usize,
}

impl InMemory for Arrays {
    fn rows(&self) -> usize {
        self.rows
    }

    fn columns(&self) -> Columns {
        let [rate, force] = [self.rate_dps.is_some(), self.force_mps2.is_some()];
        Columns {
            step: self.step.is_some(),
            temp_c: self.temp.is_some(),
            gyro: self.gyro.is_some(),
            accel: self.accel.is_some(),
            reference: [rate, rate, rate, force, force, force],
        }
    }

    /// Holds the interpreter's lock, so that Python cannot write into an array meanwhile; for 65,536 rows at a time.
    fn append(&self, column: Column, rows: Range<usize>, values: &mut Vec<f64>) -> Result<()> {
        let changed = || {
            let problem = "the array was resized, or is being written to";
            Error::new(
                column.name(),
                problem,
                "leave the array unchanged until the function returns",
            )
        };
        Python::attach(|py| {
            let mut extend = |view: ArrayView1<f64>| values.extend(view.iter());
            let (array, axis) = match column {
                Column::Time | Column::Step | Column::Temperature => {
                    let array = match column {
                        Column::Time => Some(&self.t),
                        Column::Step => self.step.as_ref(),
                        _ => self.temp.as_ref(),
                    };
                    let Some(array) = array else { return Ok(()) };
                    let array = array.bind(py).try_readonly().map_err(|_| changed())?;
                    let view = array.as_array();
                    if view.len() < rows.end {
                        return Err(changed());
                    }
                    extend(view.slice(s![rows]));
                    return Ok(());
                }
                Column::Raw(i) => (if i < 3 { &self.gyro } else { &self.accel }, i % 3),
                Column::Reference(i) => (
                    if i < 3 {
                        &self.rate_dps
                    } else {
                        &self.force_mps2
                    },
                    i % 3,
                ),
            };
            let Some(array) = array else { return Ok(()) };
            let array = array.bind(py).try_readonly().map_err(|_| changed())?;
            let view = array.as_array();
            if view.nrows() < rows.end || view.ncols() != 3 {
                return Err(changed());
            }
            extend(view.slice(s![rows, axis]));
            Ok(())
        })
    }
}

/// `value` as an array of doubles; the same array if it is one already.
///
/// # Errors
/// Arrays whose meaning numpy would drop without a word: masked ones, and quantities with a unit of their own.
fn doubles<'py>(value: &Bound<'py, PyAny>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    let py = value.py();
    let numpy = py.import("numpy")?;
    let refused = |problem: &str, remedy: &str| {
        let error = Error::new(name, problem, remedy);
        Err(raised(py, &error))
    };
    if value.is_instance(&numpy.getattr("ma")?.getattr("MaskedArray")?)? {
        return refused(
            "it is a masked array, and a sample without a value is NaN here",
            "give array.filled(numpy.nan)",
        );
    }
    // pint's quantities, and astropy's.
    for (number, unit) in [("magnitude", "units"), ("value", "unit")] {
        if value.hasattr(number)? && value.hasattr(unit)? {
            let problem = format!("it carries the unit {}", value.getattr(unit)?.str()?);
            let remedy = format!("give its numbers (.{number}), and their units as units=");
            return refused(&problem, &remedy);
        }
    }
    let kwargs = [("dtype", "float64")].into_py_dict(py)?;
    numpy.call_method("asarray", (value,), Some(&kwargs))
}

fn shape(array: &Bound<'_, PyAny>) -> String {
    array
        .getattr("shape")
        .map_or_else(|_| "?".into(), |s| s.to_string())
}

/// A number for each sample.
fn column<'py>(
    value: &Bound<'py, PyAny>,
    name: &str,
    rows: Option<usize>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let array = doubles(&ordered(value)?, name)?;
    let fits = |a: &Bound<'py, PyArray1<f64>>| rows.is_none_or(|rows| a.len() == rows);
    match array.cast::<PyArray1<f64>>() {
        Ok(column) if fits(column) => Ok(column.clone()),
        _ => {
            let all = rows.map_or("n".into(), |rows| rows.to_string());
            let problem = format!("its shape is {}, but ({all},) is needed", shape(&array));
            let error = Error::new(name, problem, "give a number for each sample");
            Err(raised(value.py(), &error))
        }
    }
}

/// A table whose three columns differ in x, y and z alone, in the order x, y, z; everything else unchanged.
pub(crate) fn ordered<'py>(value: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let names = match value.getattr_opt("columns")? {
        Some(columns) => columns.try_iter()?.collect::<PyResult<Vec<_>>>()?,
        None => return Ok(value.clone()),
    };
    let text: Vec<Vec<char>> = names
        .iter()
        .map(|name| Ok(name.str()?.to_string().to_lowercase().chars().collect()))
        .collect::<PyResult<_>>()?;
    let [a, b, c] = &text[..] else {
        return Ok(value.clone());
    };
    let differ = |k: &usize| a.get(*k) != b.get(*k) || a.get(*k) != c.get(*k);
    let places: Vec<usize> = (0..a.len().max(b.len()).max(c.len()))
        .filter(differ)
        .collect();
    let at = |axis: char| {
        text.iter()
            .position(|name| name.get(places[0]) == Some(&axis))
    };
    let order = match places[..] {
        [_] => ['x', 'y', 'z'].map(at),
        _ => return Ok(value.clone()),
    };
    match order {
        [Some(x), Some(y), Some(z)] => value.get_item(vec![&names[x], &names[y], &names[z]]),
        _ => Ok(value.clone()),
    }
}

/// Three numbers for each sample.
pub(crate) fn triad<'py>(
    value: &Bound<'py, PyAny>,
    name: &str,
    rows: Option<usize>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let array = doubles(&ordered(value)?, name)?;
    let fits = |a: &Bound<'py, PyArray2<f64>>| {
        a.shape()[1] == 3 && rows.is_none_or(|rows| a.shape()[0] == rows)
    };
    match array.cast::<PyArray2<f64>>() {
        Ok(triad) if fits(triad) => Ok(triad.clone()),
        _ => {
            let all = rows.map_or("n".into(), |rows| rows.to_string());
            let problem = format!("its shape is {}, but ({all}, 3) is needed", shape(&array));
            let error = Error::new(name, problem, "give x, y and z of each sample in a row");
            Err(raised(value.py(), &error))
        }
    }
}

/// A unit of readings, or a reference, by its name.
fn parsed<T: std::str::FromStr<Err = Error>>(py: Python<'_>, name: &str) -> PyResult<T> {
    name.parse().map_err(|error| raised(py, &error))
}

/// Unit of the readings, and the factors of gyro and accelerometer to it.
pub(crate) fn units_of(
    py: Python<'_>,
    unit: Option<&str>,
    units: Option<&str>,
) -> PyResult<(RawUnit, [Option<f64>; 2])> {
    match (unit, units) {
        (Some(unit), None) => Ok((parsed(py, unit)?, [Some(1.0); 2])),
        (None, Some(units)) => {
            let given = Given::default().with_units(units);
            let conversion = given.and_then(|given| given.conversion());
            conversion.map_err(|error| raised(py, &error))
        }
        (None, None) => {
            let problem = "the unit of the readings is not given";
            let remedy =
                "give units=\"deg/s,g\" or what they are in, or unit=\"count\", \"V\" or \"SI\"";
            Err(raised(py, &Error::new("units", problem, remedy)))
        }
        (Some(_), Some(_)) => {
            let problem = "unit and units say the same";
            Err(raised(
                py,
                &Error::new("units", problem, "give one of them"),
            ))
        }
    }
}

#[pymethods]
impl Recording {
    #[new]
    #[pyo3(signature = (t, gyro=None, accel=None, temp=None, *, unit=None, units=None, gravity=None, reference="gravity", rate_hz=None,
        step=None, ref_rate_dps=None, ref_force_mps2=None, device="unit", latitude_deg=None, power_on_s=None))]
    #[expect(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        t: Option<&Bound<'_, PyAny>>,
        gyro: Option<&Bound<'_, PyAny>>,
        accel: Option<&Bound<'_, PyAny>>,
        temp: Option<&Bound<'_, PyAny>>,
        unit: Option<&str>,
        units: Option<&str>,
        gravity: Option<f64>,
        reference: &str,
        rate_hz: Option<f64>,
        step: Option<&Bound<'_, PyAny>>,
        ref_rate_dps: Option<&Bound<'_, PyAny>>,
        ref_force_mps2: Option<&Bound<'_, PyAny>>,
        device: &str,
        latitude_deg: Option<f64>,
        power_on_s: Option<f64>,
    ) -> PyResult<Self> {
        let reference: Reference = parsed(py, reference)?;
        let (unit, factors) = units_of(py, unit, units)?;
        let first = |value: Option<&Bound<'_, PyAny>>| value.and_then(|v| v.len().ok());
        let t = match (t, rate_hz, first(gyro).or(first(accel))) {
            (Some(t), ..) => column(t, "t", None)?,
            (None, Some(rate), Some(rows)) => {
                let times = (0..rows).map(|row| row as f64 / rate);
                PyArray1::from_iter(py, times)
            }
            _ => {
                let problem = "neither times nor a sample rate are given";
                let remedy = "give the times in seconds as t, or rate_hz";
                let error = Error::new("t", problem, remedy).about(Argument::SampleRate);
                return Err(raised(py, &error));
            }
        };
        let rows = t.len();
        let of_triad = |value: Option<&Bound<'_, PyAny>>, name: &str, factor: Option<f64>| {
            let scaled = |v: &Bound<'_, PyAny>| {
                let given = triad(v, name, Some(rows))?;
                match factor {
                    Some(1.0) => Ok(given.unbind()),
                    Some(factor) => {
                        let scaled = given.readonly().as_array().map(|x| x * factor);
                        Ok(scaled.into_pyarray(py).unbind())
                    }
                    None => {
                        let problem = format!("the unit of the {name} is not given");
                        let remedy = "give both units, as in units=\"deg/s,g\"";
                        Err(raised(py, &Error::new("units", problem, remedy)))
                    }
                }
            };
            value.map(scaled).transpose()
        };
        let of_column = |value: Option<&Bound<'_, PyAny>>, name| {
            value
                .map(|v| Ok::<_, PyErr>(column(v, name, Some(rows))?.unbind()))
                .transpose()
        };
        let rate_hz = match rate_hz {
            Some(rate) => rate,
            None => usual_rate_hz(&t.readonly().as_array().to_vec())
                .map_err(|error| raised(py, &error))?,
        };
        let (gravity_mps2, warning) = gravity_at(gravity, latitude_deg, reference);
        let of_rate = Warning::of_rate(rate_hz).map(|warning| warning.to_string());
        let mut manifest = Manifest::new(device, rate_hz, gravity_mps2, unit, reference);
        manifest.latitude_deg = latitude_deg;
        manifest.power_on_s = power_on_s;
        let arrays = Arrays {
            step: of_column(step, "step")?,
            temp: of_column(temp, "temp")?,
            gyro: of_triad(gyro, "gyro", factors[0])?,
            accel: of_triad(accel, "accel", factors[1])?,
            rate_dps: of_triad(ref_rate_dps, "ref_rate_dps", Some(1.0))?,
            force_mps2: of_triad(ref_force_mps2, "ref_force_mps2", Some(1.0))?,
            rows,
            t: t.unbind(),
        };
        let warnings = warning.into_iter().chain(of_rate).collect();
        let made = Self::of_arrays(py, manifest, arrays, warnings)?;
        Ok(Self {
            units: units.map(str::to_owned),
            ..made
        })
    }

    /// Rows of it, as a recording of arrays: `rec[1000:]`, `rec[:-500]`.
    fn __getitem__(&self, py: Python<'_>, rows: &Bound<'_, PySlice>) -> PyResult<Self> {
        let samples = self.source.samples().map_err(|error| raised(py, &error))?;
        let length = isize::try_from(self.__len__(py)?).unwrap_or(isize::MAX);
        if rows.indices(length)?.step != 1 {
            let problem = "a step in a slice changes the sample rate";
            let error = Error::new(
                "slice",
                problem,
                "slice without a step, as in rec[1000:2000]",
            );
            return Err(raised(py, &error));
        }
        let column = |array: Option<Bound<'_, PyArray1<f64>>>| -> PyResult<_> {
            let part = array.map(|array| array.get_item(rows)).transpose()?;
            let typed = |part: Bound<'_, PyAny>| {
                Ok::<_, PyErr>(part.cast_into::<PyArray1<f64>>()?.unbind())
            };
            part.map(typed).transpose()
        };
        let triad = |array: Option<Bound<'_, PyArray2<f64>>>| -> PyResult<_> {
            let part = array.map(|array| array.get_item(rows)).transpose()?;
            let typed = |part: Bound<'_, PyAny>| {
                Ok::<_, PyErr>(part.cast_into::<PyArray2<f64>>()?.unbind())
            };
            part.map(typed).transpose()
        };
        let t = self.t(py)?.get_item(rows)?.cast_into::<PyArray1<f64>>()?;
        let arrays = Arrays {
            step: column(self.step(py)?)?,
            temp: column(self.temp_c(py)?)?,
            gyro: triad(self.gyro(py)?)?,
            accel: triad(self.accel(py)?)?,
            rate_dps: triad(self.ref_rate_dps(py)?)?,
            force_mps2: triad(self.ref_force_mps2(py)?)?,
            rows: t.len(),
            t: t.unbind(),
        };
        let made = Self::of_arrays(py, samples.manifest.clone(), arrays, self.warnings.clone())?;
        Ok(Self {
            units: self.units.clone(),
            ..made
        })
    }

    /// For pickle and for other processes: the path of a folder, the files of a temporary one, or the arrays.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let module = py.import("mimu._mimu")?;
        let said = PyDict::new(py);
        said.set_item("imported", &self.imported)?;
        said.set_item("units", &self.units)?;
        said.set_item("warnings", &self.warnings)?;
        let Some(directory) = &self.directory else {
            let samples = self.source.samples().map_err(|error| raised(py, &error))?;
            let manifest = samples.manifest.to_toml();
            said.set_item("manifest", manifest.map_err(|error| raised(py, &error))?)?;
            let columns = [
                ("t", self.t(py)?.into_any()),
                ("step", self.step(py)?.into_pyobject(py)?.into_any()),
                ("temp", self.temp_c(py)?.into_pyobject(py)?.into_any()),
                ("gyro", self.gyro(py)?.into_pyobject(py)?.into_any()),
                ("accel", self.accel(py)?.into_pyobject(py)?.into_any()),
                (
                    "rate_dps",
                    self.ref_rate_dps(py)?.into_pyobject(py)?.into_any(),
                ),
                (
                    "force_mps2",
                    self.ref_force_mps2(py)?.into_pyobject(py)?.into_any(),
                ),
            ];
            for (name, array) in columns {
                said.set_item(name, array)?;
            }
            return Ok((
                module.getattr("unpickled_arrays")?,
                (said,).into_pyobject(py)?.into_any(),
            ));
        };
        if self.folder.is_none() {
            return Ok((
                module.getattr("open")?,
                (directory,).into_pyobject(py)?.into_any(),
            ));
        }
        let files = PyDict::new(py);
        for entry in std::fs::read_dir(directory)? {
            let entry = entry?;
            let content = PyBytes::new(py, &std::fs::read(entry.path())?);
            files.set_item(entry.file_name(), content)?;
        }
        Ok((
            module.getattr("unpickled_files")?,
            (files, said).into_pyobject(py)?.into_any(),
        ))
    }

    /// All samples as a table of pandas, in the columns of the files: `t_s`, `step`, `temp_c`, `gyro_x` to `accel_z` in `unit`, and the known
    /// inputs.
    fn to_dataframe<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let frame = slf.py().import("mimu._frame")?;
        frame.call_method1("of_recording", (slf,))
    }

    /// Latitude, degrees; None if it is unknown.
    #[getter]
    fn latitude_deg(&self) -> Option<f64> {
        self.source.manifest().latitude_deg
    }

    /// Times of the samples, s.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        match &self.arrays {
            Some(arrays) => Ok(arrays.t.bind(py).clone()),
            None => Ok(self.read(py, &[Column::Time])?.remove(0).into_pyarray(py)),
        }
    }

    /// Readings of the gyro, a row for each sample, in `unit`; None without a gyro.
    #[getter]
    fn gyro<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        self.triad(py, Column::Raw, 0, |arrays| &arrays.gyro)
    }

    /// Readings of the accelerometer, a row for each sample, in `unit`; None without one.
    #[getter]
    fn accel<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        self.triad(py, Column::Raw, 3, |arrays| &arrays.accel)
    }

    /// Temperatures, degrees Celsius; None without a thermometer.
    #[getter]
    fn temp_c<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
        self.column(py, Column::Temperature, |arrays| &arrays.temp)
    }

    /// Number of the dwell of each sample, -1 in transit; None if the dwells are found by stillness.
    #[getter]
    fn step<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
        self.column(py, Column::Step, |arrays| &arrays.step)
    }

    /// Known rates, deg/s; None without any.
    #[getter]
    fn ref_rate_dps<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        self.triad(py, Column::Reference, 0, |arrays| &arrays.rate_dps)
    }

    /// Known specific forces, m/s²; None without any.
    #[getter]
    fn ref_force_mps2<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        self.triad(py, Column::Reference, 3, |arrays| &arrays.force_mps2)
    }

    /// Name of the unit.
    #[getter]
    fn device(&self) -> &str {
        &self.source.manifest().device
    }

    /// Local gravity, m/s².
    #[getter]
    fn gravity_mps2(&self) -> f64 {
        self.source.manifest().gravity_mps2
    }

    /// Unit of the readings: V, count or SI.
    #[getter]
    fn unit(&self) -> String {
        self.source.manifest().raw_unit.to_string()
    }

    /// What is known of the true input: table or gravity.
    #[getter]
    fn reference(&self) -> String {
        self.source.manifest().reference.to_string()
    }

    /// Samples a second.
    #[getter]
    fn rate_hz(&self) -> f64 {
        self.source.manifest().sample_rate_hz
    }

    /// Whether it contains means of poses instead of samples.
    #[getter]
    fn means(&self) -> bool {
        matches!(self.source, Source::Means(_))
    }

    /// Folder of a recording on disk; None for arrays, and for a file that was read without an output.
    #[getter]
    fn directory(&self) -> Option<PathBuf> {
        self.directory.clone().filter(|_| self.folder.is_none())
    }

    /// Warnings about how it was made.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    /// Result of the import of its files, as `mimu import --json` writes it; None if it was not imported.
    #[getter]
    fn imported<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let json = self.imported.as_deref();
        json.map(|json| loaded(py, json)).transpose()
    }

    /// Writes it as a folder that the command and other programs read: recording.toml beside samples.parquet or samples.csv.
    #[pyo3(signature = (directory, *, format="parquet", replace=false))]
    fn save(
        &self,
        py: Python<'_>,
        directory: PathBuf,
        format: &str,
        replace: bool,
    ) -> PyResult<PathBuf> {
        let format: SampleFormat = parsed(py, format)?;
        let source = self.source.clone();
        computed(py, move || {
            let samples = source.samples()?;
            let mut writer = Writer::create(&directory, samples.columns, format, replace)?;
            samples.for_each_batch(|_| {}, |batch| writer.write(batch))?;
            writer.finish(&samples.manifest)
        })
    }

    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        match (&self.source, &self.arrays) {
            (_, Some(arrays)) => Ok(arrays.rows),
            (Source::Means(_), _) => Ok(0),
            (Source::Samples(samples), _) => match samples.rows() {
                Some(rows) => Ok(rows as usize),
                None => Ok(self.read(py, &[Column::Time])?[0].len()),
            },
        }
    }

    fn __repr__(&self) -> String {
        let Manifest {
            device,
            sample_rate_hz,
            gravity_mps2,
            raw_unit,
            reference,
            ..
        } = self.source.manifest();
        format!(
            "<mimu.Recording {device:?}: {} at {sample_rate_hz:.6} Hz in {raw_unit}, gravity {gravity_mps2} m/s², reference {reference}>",
            self.sensors()
        )
    }

    fn _repr_html_(&self) -> String {
        let manifest = self.source.manifest();
        let mut terms = vec![
            ("sensors", self.sensors()),
            ("unit", manifest.raw_unit.to_string()),
            ("sample rate", format!("{:.6} Hz", manifest.sample_rate_hz)),
            ("gravity", format!("{} m/s²", manifest.gravity_mps2)),
            ("reference", manifest.reference.to_string()),
        ];
        terms.extend(self.warnings.iter().map(|w| ("warning", w.clone())));
        fragment::of_terms(&format!("Recording of {}", manifest.device), &terms)
    }
}

impl Recording {
    fn of_arrays(
        py: Python<'_>,
        manifest: Manifest,
        arrays: Arrays,
        warnings: Vec<String>,
    ) -> PyResult<Self> {
        let arrays = Arc::new(arrays);
        let made = mimu_recording::Recording::in_memory(manifest, arrays.clone());
        let made = made.map_err(|error| raised(py, &error))?;
        Ok(Self {
            source: Source::Samples(Arc::new(made)),
            arrays: Some(arrays),
            imported: None,
            warnings,
            directory: None,
            folder: None,
            units: None,
        })
    }

    fn sensors(&self) -> String {
        let columns = match &self.source {
            Source::Means(_) => return "means of poses".into(),
            Source::Samples(samples) => samples.columns,
        };
        match (columns.gyro, columns.accel) {
            (true, true) => "gyro and accelerometer",
            (true, false) => "gyro",
            _ => "accelerometer",
        }
        .into()
    }

    /// Columns of a recording on disk.
    fn read(&self, py: Python<'_>, columns: &[Column]) -> PyResult<Vec<Vec<f64>>> {
        let (source, columns) = (self.source.clone(), columns.to_vec());
        computed(py, move || source.samples()?.read_columns(&columns, |_| {}))
    }

    fn column<'py>(
        &self,
        py: Python<'py>,
        column: Column,
        of: impl Fn(&Arrays) -> &Option<Py<PyArray1<f64>>>,
    ) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
        if let Some(arrays) = &self.arrays {
            return Ok(of(arrays).as_ref().map(|array| array.bind(py).clone()));
        }
        let samples = self.source.samples().map_err(|error| raised(py, &error))?;
        match samples.columns.has(column) {
            true => Ok(Some(self.read(py, &[column])?.remove(0).into_pyarray(py))),
            false => Ok(None),
        }
    }

    fn triad<'py>(
        &self,
        py: Python<'py>,
        column: impl Fn(usize) -> Column,
        first: usize,
        of: impl Fn(&Arrays) -> &Option<Py<PyArray2<f64>>>,
    ) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        if let Some(arrays) = &self.arrays {
            return Ok(of(arrays).as_ref().map(|array| array.bind(py).clone()));
        }
        let samples = self.source.samples().map_err(|error| raised(py, &error))?;
        let columns = [0, 1, 2].map(|axis| column(first + axis));
        // The input may be known for some axes only.
        if !columns.iter().any(|column| samples.columns.has(*column)) {
            return Ok(None);
        }
        let there: Vec<Column> = columns
            .iter()
            .copied()
            .filter(|c| samples.columns.has(*c))
            .collect();
        let values = self.read(py, &there)?;
        let mut triad = Array2::from_elem((values[0].len(), 3), f64::NAN);
        for (column, values) in there.iter().zip(&values) {
            let axis = columns.iter().position(|c| c == column).unwrap_or_default();
            triad
                .slice_mut(s![.., axis])
                .assign(&ArrayView1::from(values));
        }
        Ok(Some(triad.into_pyarray(py)))
    }
}

/// Local gravity, m/s², and a warning if it was not given or does not fit the latitude.
fn gravity_at(
    given: Option<f64>,
    latitude: Option<f64>,
    reference: Reference,
) -> (f64, Option<String>) {
    match (given, latitude) {
        (Some(gravity), Some(at)) => {
            (gravity, Warning::of_gravity(gravity, at).map(|w| w.to_string()))
        }
        (Some(gravity), None) => (gravity, None),
        (None, Some(at)) => (normal_gravity(at), None),
        (None, None) => (
            STANDARD_GRAVITY,
            (reference == Reference::Gravity).then(|| {
                "gravity is assumed to be 9.80665 m/s²; every scale factor of the accelerometer errs by the same ratio as gravity: give gravity or latitude_deg"
                    .to_owned()
            }),
        ),
    }
}

/// Opens a recording on disk.
#[pyfunction]
pub(crate) fn open(py: Python<'_>, directory: PathBuf) -> PyResult<Recording> {
    let opened = directory.clone();
    let source = computed(py, move || Source::open(&opened))?;
    Ok(Recording {
        source,
        arrays: None,
        imported: None,
        warnings: Vec::new(),
        directory: Some(directory),
        folder: None,
        units: None,
    })
}

/// What a pickle says of a recording, by `name`.
fn pickled<'py, T>(said: &Bound<'py, PyDict>, name: &str) -> PyResult<T>
where
    T: for<'a> FromPyObject<'a, 'py>,
{
    let value = said.get_item(name)?;
    let value = value.unwrap_or_else(|| said.py().None().into_bound(said.py()));
    value.extract::<T>().map_err(Into::into)
}

/// A recording of arrays out of a pickle.
#[pyfunction]
pub(crate) fn unpickled_arrays(py: Python<'_>, said: &Bound<'_, PyDict>) -> PyResult<Recording> {
    let text: String = pickled(said, "manifest")?;
    let manifest = Manifest::parse(&text, "pickle").map_err(|error| raised(py, &error))?;
    let column = |name| {
        pickled::<Option<Bound<'_, PyArray1<f64>>>>(said, name).map(|a| a.map(Bound::unbind))
    };
    let triad = |name| {
        pickled::<Option<Bound<'_, PyArray2<f64>>>>(said, name).map(|a| a.map(Bound::unbind))
    };
    let t: Bound<'_, PyArray1<f64>> = pickled(said, "t")?;
    let arrays = Arrays {
        step: column("step")?,
        temp: column("temp")?,
        gyro: triad("gyro")?,
        accel: triad("accel")?,
        rate_dps: triad("rate_dps")?,
        force_mps2: triad("force_mps2")?,
        rows: t.len(),
        t: t.unbind(),
    };
    let made = Recording::of_arrays(py, manifest, arrays, pickled(said, "warnings")?)?;
    Ok(Recording {
        units: pickled(said, "units")?,
        ..made
    })
}

/// A recording in a temporary folder out of a pickle.
#[pyfunction]
pub(crate) fn unpickled_files(
    py: Python<'_>,
    files: BTreeMap<OsString, Vec<u8>>,
    said: &Bound<'_, PyDict>,
) -> PyResult<Recording> {
    let work = move || {
        let folder = OwnFolder::new()?;
        for (name, content) in files {
            let path = folder.0.path().join(name);
            std::fs::write(&path, content).map_err(|e| Error::io(&path, &e))?;
        }
        Ok((Source::open(folder.0.path())?, folder))
    };
    let (source, folder) = computed(py, work)?;
    Ok(Recording {
        source,
        arrays: None,
        imported: pickled(said, "imported")?,
        warnings: pickled(said, "warnings")?,
        directory: Some(folder.0.path().to_owned()),
        folder: Some(Arc::new(folder)),
        units: None,
    })
}

/// Imports files by the arguments of `mimu import`, to `output` or to a temporary folder that is removed with the recording.
#[pyfunction]
#[pyo3(signature = (arguments, output=None))]
pub(crate) fn read(
    py: Python<'_>,
    arguments: Vec<OsString>,
    output: Option<PathBuf>,
) -> PyResult<Recording> {
    let work = move || {
        let (directory, folder) = match output {
            Some(directory) => (directory, None),
            None => {
                let folder = OwnFolder::new()?;
                (folder.0.path().join("recording"), Some(Arc::new(folder)))
            }
        };
        let to = ["-o".into(), directory.clone().into_os_string()];
        // Placed before the files, because everything after `--` is a file.
        let summary = called::import(to.into_iter().chain(arguments).collect())?;
        Ok((Source::open(&directory)?, summary, directory, folder))
    };
    let (source, summary, directory, folder) = done(py, work, refused)?;
    Ok(Recording {
        source,
        arrays: None,
        imported: Some(json(&summary)?),
        warnings: summary.warnings.iter().map(|w| keywords(w)).collect(),
        directory: Some(directory),
        folder,
        units: None,
    })
}

/// Sources of `recordings`. Refuses an empty list, by the name of the argument.
pub(crate) fn sources(recordings: &[PyRef<'_, Recording>], name: &str) -> PyResult<Vec<Source>> {
    if recordings.is_empty() {
        return Err(PyValueError::new_err(format!(
            "{name}: give one recording at least"
        )));
    }
    Ok(recordings.iter().map(|r| r.source.clone()).collect())
}
