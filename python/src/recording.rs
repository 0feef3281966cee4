//! A recording: arrays that Python holds, or a folder on disk.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mimu::prepared::Prepared;
use mimu::quantity::normal_gravity;
use mimu::readable::STANDARD_GRAVITY;
use mimu::warning::Warning;
use mimu_cli::called::{self, Open};
use mimu_cli::report::fragment;
use mimu_recording::error::{Error, Result};
use mimu_recording::{
    Column, InMemory as _, Manifest, PoseMeans, Reference, SampleFormat, Writer, usual_rate_hz,
};
use numpy::ndarray::{Array2, ArrayView1, s};
use numpy::{IntoPyArray, PyArray1, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PySlice};
use tempfile::TempDir;

use crate::arrays::{
    Arrays, FIELDS, Field, TIME, array, factor_of, is_of_dates, units_of, without_times,
};
use crate::error::{keywords, raised, refused};
use crate::work::{computed, done, json, loaded};

/// A recording of a unit, of arrays. Lists, slices of one table and columns of pandas are arrays too.
///
/// Parameters
/// ----------
/// t : array_like of shape (n,), optional
///     Times of the samples, s, ascending; dates and durations of numpy or pandas count from the first. By default the index of a table, or `rate_hz`.
/// gyro : array_like of shape (n, 3), optional
///     Readings of the gyro in x, y, z, in `unit` or `units`.
/// accel : array_like of shape (n, 3), optional
///     Readings of the accelerometer, likewise.
/// temp : array_like of shape (n,), optional
///     Temperatures, degrees Celsius.
/// unit : {"V", "count", "SI"}, optional
///     Unit of the readings; SI is rad/s and m/s².
/// units : str, optional
///     Units of gyro and accelerometer that are converted to SI, such as "deg/s,g"; in place of `unit`.
/// gravity : float, optional
///     Local gravity, m/s². By default that of `latitude_deg`, or 9.80665 with a warning.
/// reference : {"gravity", "table", "turntable-rate"}
///     What is known of the true input: the magnitude of gravity at rest, `ref_rate_dps` and `ref_force_mps2`, or the magnitude of a turntable's rate.
/// rate_hz : float, optional
///     Samples a second, Hz. By default that of `t`.
/// step : array_like of shape (n,), optional
///     Number of the dwell of each sample, -1 in transit. By default the dwells are found by stillness.
/// ref_rate_dps : array_like of shape (n, 3), optional
///     Known rates, deg/s.
/// ref_force_mps2 : array_like of shape (n, 3), optional
///     Known specific forces, m/s².
/// device : str
///     Name of the unit.
/// latitude_deg : float, optional
///     Latitude, degrees.
/// power_on_s : float, optional
///     Time at which the unit was switched on, s, on the clock of `t`.
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

    /// What reads it for estimation.
    pub(crate) fn opener(&self) -> Box<Open> {
        let source = self.clone();
        Box::new(move |search| match &source {
            Self::Samples(recording) => Prepared::read(recording, search, |_| {}),
            Self::Means(means) => Prepared::of_means(means),
        })
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

    pub(crate) fn manifest(&self) -> &Manifest {
        match self {
            Self::Samples(recording) => &recording.manifest,
            Self::Means(means) => &means.manifest,
        }
    }
}

/// An array of a recording, if it has one.
type Values<'py> = Option<Bound<'py, PyArrayDyn<f64>>>;

/// A word of a setting.
fn parsed<T: std::str::FromStr<Err = Error>>(py: Python<'_>, name: &str) -> PyResult<T> {
    name.parse().map_err(|error| raised(py, &error))
}

#[pymethods]
impl Recording {
    #[new]
    #[pyo3(signature = (t=None, gyro=None, accel=None, temp=None, *, unit=None, units=None, gravity=None, reference="gravity", rate_hz=None,
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
        // A table of pandas may have its dates as the index.
        let index = gyro.or(accel).and_then(|table| table.getattr("index").ok());
        let t = match (
            t.or(index.as_ref().filter(|index| is_of_dates(index))),
            rate_hz,
        ) {
            (Some(t), _) => array(t, TIME, None)?,
            (None, Some(rate)) => {
                let rows = gyro.or(accel).map_or(Ok(0), |table| table.len())?;
                let times = PyArray1::from_iter(py, (0..rows).map(|row| row as f64 / rate));
                times.to_dyn().clone()
            }
            (None, None) => return Err(without_times(py)),
        };
        let rows = t.len();
        let rate_hz = match rate_hz {
            Some(rate) => rate,
            None => {
                let times: Vec<f64> = t.readonly().as_array().iter().copied().collect();
                usual_rate_hz(&times).map_err(|error| raised(py, &error))?
            }
        };
        let (gravity_mps2, warning) = gravity_at(gravity, latitude_deg, reference);
        let of_rate = Warning::of_rate(rate_hz).map(|warning| warning.to_string());
        let mut manifest = Manifest::new(device, rate_hz, gravity_mps2, unit, reference);
        manifest.latitude_deg = latitude_deg;
        manifest.power_on_s = power_on_s;
        let arrays = Arrays::of(|field| {
            let value = match field.name {
                "t" => return Ok(Some(t.clone())),
                "step" => step,
                "temp" => temp,
                "gyro" => gyro,
                "accel" => accel,
                "ref_rate_dps" => ref_rate_dps,
                _ => ref_force_mps2,
            };
            let Some(value) = value else {
                return Ok(None);
            };
            let given = array(value, field, Some(rows))?;
            Ok(Some(match factor_of(py, factors, field)? {
                1.0 => given,
                factor => (given.readonly().as_array().map(|x| x * factor)).into_pyarray(py),
            }))
        })?;
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
        let arrays = Arrays::of(|field| {
            let Some(array) = self.field(py, field)? else {
                return Ok(None);
            };
            Ok(Some(array.get_item(rows)?.cast_into()?))
        })?;
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
            for field in FIELDS {
                said.set_item(field.name, self.field(py, field)?)?;
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
    fn t<'py>(&self, py: Python<'py>) -> PyResult<Values<'py>> {
        self.field(py, FIELDS[0])
    }

    /// Readings of the gyro, a row for each sample, in `unit`; None without a gyro.
    #[getter]
    fn gyro<'py>(&self, py: Python<'py>) -> PyResult<Values<'py>> {
        self.field(py, FIELDS[3])
    }

    /// Readings of the accelerometer, a row for each sample, in `unit`; None without one.
    #[getter]
    fn accel<'py>(&self, py: Python<'py>) -> PyResult<Values<'py>> {
        self.field(py, FIELDS[4])
    }

    /// Temperatures, degrees Celsius; None without a thermometer.
    #[getter]
    fn temp_c<'py>(&self, py: Python<'py>) -> PyResult<Values<'py>> {
        self.field(py, FIELDS[2])
    }

    /// Number of the dwell of each sample, -1 in transit; None if the dwells are found by stillness.
    #[getter]
    fn step<'py>(&self, py: Python<'py>) -> PyResult<Values<'py>> {
        self.field(py, FIELDS[1])
    }

    /// Known rates, deg/s; None without any.
    #[getter]
    fn ref_rate_dps<'py>(&self, py: Python<'py>) -> PyResult<Values<'py>> {
        self.field(py, FIELDS[5])
    }

    /// Known specific forces, m/s²; None without any.
    #[getter]
    fn ref_force_mps2<'py>(&self, py: Python<'py>) -> PyResult<Values<'py>> {
        self.field(py, FIELDS[6])
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
            (_, Some(arrays)) => Ok(arrays.rows()),
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
            arrays: Some(arrays),
            warnings,
            ..Self::of(Source::Samples(Arc::new(made)))
        })
    }

    fn of(source: Source) -> Self {
        Self {
            source,
            arrays: None,
            imported: None,
            warnings: Vec::new(),
            directory: None,
            folder: None,
            units: None,
        }
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

    /// The array of `field`, if there is one.
    fn field<'py>(&self, py: Python<'py>, field: Field) -> PyResult<Values<'py>> {
        if let Some(arrays) = &self.arrays {
            return Ok(arrays.get(py, field));
        }
        let samples = self.source.samples().map_err(|error| raised(py, &error))?;
        let columns = field.columns;
        let has = |column: &Column| samples.columns.has(*column);
        // The input may be known for some axes only.
        let there: Vec<Column> = columns.iter().copied().filter(has).collect();
        if there.is_empty() {
            return Ok(None);
        }
        let mut values = self.read(py, &there)?;
        if columns.len() == 1 {
            let values = PyArray1::from_vec(py, values.remove(0));
            return Ok(Some(values.to_dyn().clone()));
        }
        let mut triad = Array2::from_elem((values[0].len(), 3), f64::NAN);
        for (column, values) in there.iter().zip(&values) {
            let axis = columns.iter().position(|c| c == column).unwrap_or_default();
            triad
                .slice_mut(s![.., axis])
                .assign(&ArrayView1::from(values));
        }
        Ok(Some(triad.into_dyn().into_pyarray(py)))
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
        directory: Some(directory),
        ..Recording::of(source)
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
    let arrays = Arrays::of(|field| pickled(said, field.name))?;
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
        imported: pickled(said, "imported")?,
        warnings: pickled(said, "warnings")?,
        directory: Some(folder.0.path().to_owned()),
        folder: Some(Arc::new(folder)),
        ..Recording::of(source)
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
        imported: Some(json(&summary)?),
        warnings: summary
            .warnings
            .iter()
            .map(|w| keywords(py, w))
            .collect::<PyResult<_>>()?,
        directory: Some(directory),
        folder,
        ..Recording::of(source)
    })
}

/// Sources of `recordings`. Refuses an empty list.
pub(crate) fn sources(
    py: Python<'_>,
    recordings: &[PyRef<'_, Recording>],
) -> PyResult<Vec<Source>> {
    if recordings.is_empty() {
        let error = Error::new("recordings", "there is none", "give one recording at least");
        return Err(raised(py, &error));
    }
    Ok(recordings.iter().map(|r| r.source.clone()).collect())
}
