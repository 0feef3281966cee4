//! A calibration: its models, and what it does to readings.

use std::path::PathBuf;
use std::sync::Arc;

use mimu::calibration::Calibration as Model;
use mimu::calibration::apply::Compensated;
use mimu::quantity::{PerSensor, Sensor, significant};
use mimu::readable::STANDARD_GRAVITY;
use mimu_cli::report::fragment;
use mimu_core::compensation::Affine;
use mimu_export::json::Json;
use mimu_export::{Nothing, Sources, Target};
use mimu_recording::error::{Error, Result};
use mimu_recording::result_file::stage;
use numpy::ndarray::{Array2, ArrayView2, Zip};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{SENSORS, factor_of, ordered, triad, units_of};
use crate::error::raised;
use crate::recording::Recording;
use crate::work::{computed, loaded};

/// Compensated readings of gyro and accelerometer.
type Both<'py> = (
    Option<Bound<'py, PyArray2<f64>>>,
    Option<Bound<'py, PyArray2<f64>>>,
);

/// The same as what they were given as: arrays, or tables of pandas.
type Applied<'py> = (Option<Bound<'py, PyAny>>, Option<Bound<'py, PyAny>>);

/// A calibration in a pickle: the function that reads it, and its text, name and units.
type Pickled<'py> = (Bound<'py, PyAny>, (String, String, Option<String>));

/// C and o of one triad.
type MatrixAndOffset<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>);

/// A calibration of a unit.
#[pyclass(frozen, module = "mimu")]
pub(crate) struct Calibration {
    pub(crate) model: Arc<Model>,
    /// Its file, or the name of the result that it comes from.
    pub(crate) name: String,
    /// Units of the arrays that it was fitted to, if these were converted to SI: arrays are taken in the same.
    pub(crate) units: Option<String>,
}

#[pymethods]
impl Calibration {
    /// Name of the unit that it is for.
    #[getter]
    fn device(&self) -> &str {
        &self.model.device
    }

    /// Unit of the readings that it is for: V, count or SI.
    #[getter]
    fn unit(&self) -> String {
        self.model.recording.raw_unit.to_string()
    }

    /// Ids of the effects that it removes.
    #[getter]
    fn effects(&self) -> Vec<String> {
        self.model
            .effects()
            .iter()
            .map(|e| e.candidate.id())
            .collect()
    }

    /// Lowest and highest temperature that it is for, degrees Celsius; None if they are unknown.
    #[getter]
    fn range_c(&self) -> Option<[f64; 2]> {
        self.model.limits()
    }

    /// Whether it has curves over temperature.
    #[getter]
    fn over_temperature(&self) -> bool {
        self.model.temperature.is_some()
    }

    /// Matrix and offset of a sensor, x = C u + o, raw to SI: at a temperature of the dies, or that of the calibration.
    #[pyo3(signature = (sensor, die_temp_c=None))]
    fn inverse<'py>(
        &self,
        py: Python<'py>,
        sensor: &str,
        die_temp_c: Option<f64>,
    ) -> PyResult<MatrixAndOffset<'py>> {
        let refused =
            |problem: String, remedy: &str| raised(py, &Error::new("sensor", problem, remedy));
        let sensor = match sensor {
            "gyro" => Sensor::Gyro,
            "accel" => Sensor::Accel,
            _ => {
                return Err(refused(
                    format!("{sensor:?} is not a sensor"),
                    "write gyro or accel",
                ));
            }
        };
        let model = match die_temp_c {
            Some(at) => self.model.inverse_at(sensor, at),
            None => self.model.inverse(sensor),
        };
        let model = model.ok_or_else(|| {
            refused(
                format!("the calibration has no {sensor}"),
                "ask for the other",
            )
        })?;
        let matrix = Array2::from_shape_fn((3, 3), |at| model.matrix[at]);
        let offset = PyArray1::from_slice(py, model.offset.as_slice());
        Ok((matrix.into_pyarray(py), offset))
    }

    /// Compensated readings of gyro and accelerometer in rad/s and m/s², a row for each sample.
    ///
    /// For arrays, or tables of pandas with three columns, this is C u + o of each row. A calibration with curves over temperature or with effects
    /// needs `temp`, the temperature of each row in degrees Celsius, and `t`, its time in s. For a recording it is what `mimu apply` writes: with
    /// effects and curves over temperature, and NaN where a sensor has no reading or is at its rail.
    ///
    /// Parameters
    /// ----------
    /// gyro : array_like of shape (n, 3), DataFrame or Recording, optional
    ///     Readings in `unit`.
    /// accel : array_like of shape (n, 3) or DataFrame, optional
    ///     Readings in `unit`.
    /// units : str, optional
    ///     Units of gyro and accel, such as ``deg/s,g``. By default those of the arrays that it was fitted to, else SI. For counts and volts there is none.
    /// temp : array_like of shape (n,), optional
    ///     Temperatures, degrees Celsius.
    /// t : array_like of shape (n,), optional
    ///     Times, s, ascending.
    ///
    /// Returns
    /// -------
    /// tuple of two arrays of shape (n, 3), or DataFrames like those given
    ///     Rates in rad/s and specific forces in m/s²; None for a sensor that was not given.
    #[pyo3(signature = (gyro=None, accel=None, *, temp=None, t=None, units=None))]
    fn apply<'py>(
        &self,
        py: Python<'py>,
        gyro: Option<&Bound<'py, PyAny>>,
        accel: Option<&Bound<'py, PyAny>>,
        temp: Option<&Bound<'py, PyAny>>,
        t: Option<&Bound<'py, PyAny>>,
        units: Option<&str>,
    ) -> PyResult<Applied<'py>> {
        let [gyro, accel] = [gyro, accel].map(|table| match table {
            Some(table) => ordered(table).map(Some),
            None => Ok(None),
        });
        let (gyro, accel) = (gyro?, accel?);
        let (gyro, accel) = (gyro.as_ref(), accel.as_ref());
        if let (Some(remembered), Some(accel), None) = (&self.units, accel, units) {
            self.check_gravity(py, accel, remembered)?;
        }
        let units = units.or(self.units.as_deref());
        let shaped_like = |(rate, force): Both<'py>| -> PyResult<Applied<'py>> {
            Ok((like(gyro, rate)?, like(accel, force)?))
        };
        match gyro.and_then(|gyro| gyro.cast::<Recording>().ok()) {
            Some(recording) if accel.is_none() => {
                let (rate, force) = self.apply_to_recording(py, recording.get())?;
                Ok((rate.map(Bound::into_any), force.map(Bound::into_any)))
            }
            Some(_) => {
                let problem = "a recording contains both sensors";
                Err(raised(py, &Error::new("accel", problem, "leave accel out")))
            }
            None if temp.is_some() || t.is_some() => {
                let given = PyDict::new(py);
                match units {
                    Some(units) => given.set_item("units", units)?,
                    None => given.set_item("unit", self.unit())?,
                }
                given.set_item("gravity", self.model.recording.gravity_mps2)?;
                given.set_item("device", self.device())?;
                let columns = [("t", t), ("gyro", gyro), ("accel", accel), ("temp", temp)];
                for (name, value) in columns {
                    given.set_item(name, value)?;
                }
                let recording = py.get_type::<Recording>().call((), Some(&given))?;
                shaped_like(self.apply_to_recording(py, recording.cast::<Recording>()?.get())?)
            }
            None => shaped_like(self.apply_to_arrays(py, gyro, accel, units)?),
        }
    }

    /// For pickle and for other processes.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Pickled<'py>> {
        let made = py.import("mimu._mimu")?.getattr("parse_calibration")?;
        Ok((
            made,
            (self.to_toml(), self.name.clone(), self.units.clone()),
        ))
    }

    /// The whole calibration, as `mimu export json` writes it.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let from = Sources {
            calibration: Some((&self.model, &self.name)),
            ..Sources::default()
        };
        let made = Json::export(&from, &Nothing {}).map_err(|error| raised(py, &error))?;
        loaded(py, &String::from_utf8_lossy(&made.content))
    }

    /// The calibration file, as the command writes it.
    fn to_toml(&self) -> String {
        self.model.to_toml()
    }

    /// Writes the calibration file, whole or not at all.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let model = self.model.clone();
        computed(py, move || stage(&path, model.to_toml())?.publish())
    }

    fn __repr__(&self) -> String {
        let effects = self.effects().join(", ");
        let with = if effects.is_empty() {
            "no effects"
        } else {
            &effects
        };
        let curves = if self.over_temperature() {
            ", over temperature"
        } else {
            ""
        };
        format!(
            "<mimu.Calibration of {:?}: {} to SI, {with}{curves}>",
            self.model.device,
            self.unit()
        )
    }

    fn _repr_html_(&self) -> String {
        fragment::of_calibration(&self.model)
    }
}

impl Calibration {
    /// Refuses specific forces that are not near gravity in the units of the fit: the attributes of a recording are in SI, and the arrays that it was made of are not.
    fn check_gravity(&self, py: Python<'_>, accel: &Bound<'_, PyAny>, units: &str) -> PyResult<()> {
        let Ok((_, [_, Some(factor)])) = units_of(py, None, Some(units)) else {
            return Ok(());
        };
        if accel.cast::<Recording>().is_ok() {
            return Ok(());
        }
        let readings = triad(accel, SENSORS[1])?.readonly();
        let rows = readings.as_array();
        let mut sizes: Vec<f64> = rows
            .rows()
            .into_iter()
            .map(|row| row.dot(&row).sqrt())
            .collect();
        sizes.retain(|size| size.is_finite());
        sizes.sort_by(f64::total_cmp);
        let Some(usual) = sizes.get(sizes.len() / 2) else {
            return Ok(());
        };
        let times = usual * factor / STANDARD_GRAVITY;
        if (0.3..3.0).contains(&times) {
            return Ok(());
        }
        let problem = format!(
            "its usual magnitude is {} times gravity in {units}, the units of the arrays that were fitted",
            significant(times)
        );
        let remedy = "give their units, as in units=\"rad/s,m/s2\"";
        Err(raised(py, &Error::new("accel", problem, remedy)))
    }

    fn apply_to_arrays<'py>(
        &self,
        py: Python<'py>,
        gyro: Option<&Bound<'py, PyAny>>,
        accel: Option<&Bound<'py, PyAny>>,
        units: Option<&str>,
    ) -> PyResult<Both<'py>> {
        let ours = self.model.recording.raw_unit;
        let (unit, factors) = match units {
            Some(units) => units_of(py, None, Some(units))?,
            None => (ours, [Some(1.0); 2]),
        };
        if unit != ours {
            let problem = format!("it is for readings in {ours}, and units are given");
            return Err(raised(
                py,
                &Error::new(&self.name, problem, "leave units out"),
            ));
        }
        let more = match (self.model.temperature.is_some(), self.model.effects()) {
            (true, _) => Some("it has curves over temperature"),
            (false, [_, ..]) => {
                Some("it has effects, which depend on other readings, time or temperature")
            }
            _ => None,
        };
        if let Some(problem) = more {
            let remedy = "give temp and t, of each row, or a mimu.Recording instead of arrays";
            return Err(raised(py, &Error::new(&self.name, problem, remedy)));
        }
        let one = |sensor: Sensor, readings: Option<&Bound<'py, PyAny>>| -> PyResult<_> {
            let Some(readings) = readings else {
                return Ok(None);
            };
            let model = self.model.inverse(sensor).ok_or_else(|| {
                let problem = format!("it has no {sensor}");
                raised(
                    py,
                    &Error::new(&self.name, problem, "leave these readings out"),
                )
            })?;
            let field = SENSORS[sensor as usize];
            let readings = triad(readings, field)?.readonly();
            let view = readings.as_array();
            let factor = factor_of(py, factors, field)?;
            let model = Affine {
                matrix: model.matrix * factor,
                ..model
            };
            let done = py.detach(|| compensated(&model, &view));
            Ok(Some(done.into_pyarray(py)))
        };
        Ok((one(Sensor::Gyro, gyro)?, one(Sensor::Accel, accel)?))
    }

    fn apply_to_recording<'py>(
        &self,
        py: Python<'py>,
        recording: &Recording,
    ) -> PyResult<Both<'py>> {
        let (source, model) = (recording.source.clone(), self.model.clone());
        let clean = computed(py, move || {
            let samples = source.samples()?;
            let mut run = Compensated::new(samples, &model, |_| {})?;
            let mut clean: PerSensor<Vec<f64>> = PerSensor::default();
            run.for_each(
                |_| {},
                |_, batch| {
                    for sensor in Sensor::BOTH {
                        let columns = &batch.raw[sensor.channels()];
                        let rows = 0..columns[0].len();
                        clean[sensor]
                            .extend(rows.flat_map(|row| [0, 1, 2].map(|axis| columns[axis][row])));
                    }
                    Ok(())
                },
            )?;
            shaped(clean)
        })?;
        let [gyro, accel] = clean.map(|values| values.map(|v| v.into_pyarray(py)));
        Ok((gyro, accel))
    }
}

/// `values` in the form of `given`: a table of pandas keeps its index and the names of its columns.
fn like<'py>(
    given: Option<&Bound<'py, PyAny>>,
    values: Option<Bound<'py, PyArray2<f64>>>,
) -> PyResult<Option<Bound<'py, PyAny>>> {
    let (Some(given), Some(values)) = (given, values) else {
        return Ok(None);
    };
    if !(given.hasattr("index")? && given.hasattr("columns")?) {
        return Ok(Some(values.into_any()));
    }
    let kept = PyDict::new(given.py());
    for name in ["index", "columns"] {
        kept.set_item(name, given.getattr(name)?)?;
    }
    given.get_type().call((values,), Some(&kept)).map(Some)
}

fn compensated(model: &Affine<f64>, readings: &ArrayView2<f64>) -> Array2<f64> {
    let mut done = Array2::zeros(readings.raw_dim());
    let each = Zip::from(done.rows_mut()).and(readings.rows());
    each.for_each(|mut x, u| {
        let clean = model.matrix * mimu::nalgebra::Vector3::new(u[0], u[1], u[2]) + model.offset;
        x.iter_mut()
            .zip(clean.iter())
            .for_each(|(x, clean)| *x = *clean);
    });
    done
}

/// Rows of three, for the sensors with readings.
fn shaped(clean: PerSensor<Vec<f64>>) -> Result<[Option<Array2<f64>>; 2]> {
    let PerSensor { gyro, accel } = clean;
    let one = |values: Vec<f64>| {
        let rows = values.len() / 3;
        let shaped = Array2::from_shape_vec((rows, 3), values);
        let broken = |error| Error::new("compensated samples", error, "report this");
        (rows > 0).then_some(shaped).transpose().map_err(broken)
    };
    Ok([one(gyro)?, one(accel)?])
}

/// A calibration from the text of its file.
#[pyfunction]
#[pyo3(signature = (text, name, units=None))]
pub(crate) fn parse_calibration(
    py: Python<'_>,
    text: String,
    name: String,
    units: Option<String>,
) -> PyResult<Calibration> {
    let place = name.clone();
    let model = computed(py, move || Model::parse(&text, &place))?;
    Ok(Calibration {
        model: Arc::new(model),
        name,
        units,
    })
}

/// Reads a calibration file.
#[pyfunction]
pub(crate) fn load_calibration(py: Python<'_>, path: PathBuf) -> PyResult<Calibration> {
    let name = path.display().to_string();
    let model = computed(py, move || Model::read(&path))?;
    Ok(Calibration {
        model: Arc::new(model),
        name,
        units: None,
    })
}
