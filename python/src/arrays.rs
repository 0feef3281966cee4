//! Arrays of Python: what is taken for readings, and how a recording reads them.

use std::collections::BTreeMap;
use std::ops::Range;

use mimu_recording::ReadingUnits;
use mimu_recording::error::{Argument, Error, Result};
use mimu_recording::{Column, Columns, InMemory, RawUnit};
use numpy::ndarray::{Axis, Ix1};
use numpy::{PyArray2, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::IntoPyDict;

use crate::error::raised;

/// An array of a recording: its keyword, and its columns, one or x, y and z.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Field {
    pub(crate) name: &'static str,
    pub(crate) columns: &'static [Column],
}

macro_rules! triad {
    ($column:ident, $first:literal) => {
        &[
            Column::$column($first),
            Column::$column($first + 1),
            Column::$column($first + 2),
        ]
    };
}

/// All arrays, the times first.
#[rustfmt::skip]
pub(crate) const FIELDS: [Field; 7] = [
    Field { name: "t", columns: &[Column::Time] },
    Field { name: "step", columns: &[Column::Step] },
    Field { name: "temp", columns: &[Column::Temperature] },
    Field { name: "gyro", columns: triad!(Raw, 0) },
    Field { name: "accel", columns: triad!(Raw, 3) },
    Field { name: "ref_rate_dps", columns: triad!(Reference, 0) },
    Field { name: "ref_force_mps2", columns: triad!(Reference, 3) },
];
pub(crate) const TIME: Field = FIELDS[0];
pub(crate) const SENSORS: [Field; 2] = [FIELDS[3], FIELDS[4]];

/// The Python arrays of a recording, by keyword.
#[derive(Debug)]
pub(crate) struct Arrays(BTreeMap<&'static str, Py<PyArrayDyn<f64>>>, usize);

impl Arrays {
    /// Of what `each` gives for a field.
    pub(crate) fn of<'py>(
        mut each: impl FnMut(Field) -> PyResult<Option<Bound<'py, PyArrayDyn<f64>>>>,
    ) -> PyResult<Self> {
        let (mut arrays, mut rows) = (BTreeMap::new(), 0);
        for field in FIELDS {
            let Some(array) = each(field)? else { continue };
            rows = array.shape()[0];
            arrays.insert(field.name, array.unbind());
        }
        Ok(Self(arrays, rows))
    }

    pub(crate) fn get<'py>(
        &self,
        py: Python<'py>,
        field: Field,
    ) -> Option<Bound<'py, PyArrayDyn<f64>>> {
        self.0.get(field.name).map(|array| array.bind(py).clone())
    }
}

impl InMemory for Arrays {
    fn rows(&self) -> usize {
        self.1
    }

    fn columns(&self) -> Columns {
        let has = |name| self.0.contains_key(name);
        let [rate, force] = ["ref_rate_dps", "ref_force_mps2"].map(has);
        Columns {
            step: has("step"),
            temp_c: has("temp"),
            gyro: has("gyro"),
            accel: has("accel"),
            reference: [rate, rate, rate, force, force, force],
            ..Columns::default()
        }
    }

    /// Holds the interpreter's lock, so that Python cannot write into an array meanwhile; for 65,536 rows at a time.
    fn append(&self, column: Column, rows: Range<usize>, values: &mut Vec<f64>) -> Result<()> {
        let of =
            |field: &Field| Some((field.name, field.columns.iter().position(|c| *c == column)?));
        let Some((name, axis)) = FIELDS.iter().find_map(of) else {
            return Ok(());
        };
        let Some(array) = self.0.get(name) else {
            return Ok(());
        };
        let changed = || {
            let problem = "the array was resized, or is being written to";
            let remedy = "leave the array unchanged until the function returns";
            Error::new(column.name(), problem, remedy)
        };
        Python::attach(|py| {
            let array = array.bind(py).try_readonly().map_err(|_| changed())?;
            let view = array.as_array();
            let view = match view.shape() {
                [n] if *n >= rows.end => view,
                [n, 3] if *n >= rows.end => view.index_axis_move(Axis(1), axis),
                _ => return Err(changed()),
            };
            let view = view.into_dimensionality::<Ix1>().map_err(|_| changed())?;
            values.extend(view.iter().skip(rows.start).take(rows.len()));
            Ok(())
        })
    }
}

/// Kind of the elements of an array, index or column: `M` for dates, `m` for durations.
fn kind(value: &Bound<'_, PyAny>) -> Option<String> {
    value
        .getattr("dtype")
        .ok()?
        .getattr("kind")
        .ok()?
        .extract()
        .ok()
}

/// Whether `value` contains dates or durations.
pub(crate) fn is_of_dates(value: &Bound<'_, PyAny>) -> bool {
    kind(value).is_some_and(|kind| kind == "M" || kind == "m")
}

/// Dates as seconds since the first, durations as seconds.
fn seconds<'py>(value: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let numpy = value.py().import("numpy")?;
    let of_dates = kind(value).is_some_and(|kind| kind == "M");
    let dtype = if of_dates {
        "datetime64[ns]"
    } else {
        "timedelta64[ns]"
    };
    let mut since = numpy.call_method1("asarray", (value, dtype))?;
    if of_dates {
        let all = since.clone();
        let first = all.get_item(pyo3::types::PySlice::new(value.py(), 0, 1, 1))?;
        since = all.sub(first)?;
    }
    since.div(numpy.call_method1("timedelta64", (1, "s"))?)
}

/// `value` as an array of doubles; the same array if it is one already.
///
/// # Errors
/// Arrays whose meaning numpy would drop without a word: masked ones, and quantities with a unit. Elements that are no numbers.
fn doubles<'py>(value: &Bound<'py, PyAny>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    let py = value.py();
    let numpy = py.import("numpy")?;
    let refused = |problem: &str, remedy: &str| raised(py, &Error::new(name, problem, remedy));
    if value.is_instance(&numpy.getattr("ma")?.getattr("MaskedArray")?)? {
        return Err(refused(
            "it is a masked array, and a sample without a value is NaN here",
            "give array.filled(numpy.nan)",
        ));
    }
    // pint's quantities, and astropy's.
    for (number, unit) in [("magnitude", "units"), ("value", "unit")] {
        if value.hasattr(number)? && value.hasattr(unit)? {
            let problem = format!("it carries the unit {}", value.getattr(unit)?.str()?);
            let remedy = format!("give its numbers (.{number}), and their units as units=");
            return Err(refused(&problem, &remedy));
        }
    }
    if is_of_dates(value) {
        return match name {
            "t" => seconds(value),
            _ => Err(refused("it contains dates", "give numbers")),
        };
    }
    let kwargs = [("dtype", "float64")].into_py_dict(py)?;
    let array = numpy.call_method("asarray", (value,), Some(&kwargs));
    array.map_err(|error| {
        let problem = format!("it is not an array of numbers ({})", error.value(py));
        refused(&problem, "give numbers, in rows of equal length")
    })
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

/// `value` as the array of `field`, with a row for each of `rows` samples.
pub(crate) fn array<'py>(
    value: &Bound<'py, PyAny>,
    field: Field,
    rows: Option<usize>,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let array = doubles(&ordered(value)?, field.name)?;
    let array = array.cast_into::<PyArrayDyn<f64>>()?;
    let (inner, remedy): (&[usize], _) = match field.columns.len() {
        1 => (&[], "give a number for each sample"),
        _ => (&[3], "give x, y and z of each sample in a row"),
    };
    let fits = match array.shape() {
        [n, rest @ ..] => rest == inner && rows.is_none_or(|rows| *n == rows),
        [] => false,
    };
    if fits {
        return Ok(array);
    }
    let all = rows.map_or("n".into(), |rows| rows.to_string());
    let shape = array.getattr("shape")?;
    let needed = if inner.is_empty() {
        format!("({all},)")
    } else {
        format!("({all}, 3)")
    };
    let problem = format!("its shape is {shape}, but {needed} is needed");
    Err(raised(value.py(), &Error::new(field.name, problem, remedy)))
}

/// Three numbers for each sample of a sensor.
pub(crate) fn triad<'py>(
    value: &Bound<'py, PyAny>,
    field: Field,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    Ok(array(value, field, None)?.cast_into::<PyArray2<f64>>()?)
}

/// The factor of a sensor's readings to their unit, of what [`units_of`] gives.
pub(crate) fn factor_of(py: Python<'_>, factors: [Option<f64>; 2], field: Field) -> PyResult<f64> {
    let sensor = SENSORS.iter().position(|sensor| sensor.name == field.name);
    let factor = sensor.map_or(Some(1.0), |sensor| factors[sensor]);
    factor.ok_or_else(|| {
        let problem = format!("the unit of the {} is not given", field.name);
        let remedy = "give both units, as in units=\"deg/s,g\"";
        raised(py, &Error::new("units", problem, remedy))
    })
}

/// Unit of the readings, and the factors of gyro and accelerometer to it.
pub(crate) fn units_of(
    py: Python<'_>,
    unit: Option<&str>,
    units: Option<&str>,
) -> PyResult<(RawUnit, [Option<f64>; 2])> {
    let refused = |problem: &str, remedy: &str| raised(py, &Error::new("units", problem, remedy));
    match (unit, units) {
        (Some(unit), None) => {
            let unit: Result<RawUnit> = unit.parse();
            Ok((unit.map_err(|error| raised(py, &error))?, [Some(1.0); 2]))
        }
        (None, Some(units)) => {
            let units = units
                .parse()
                .and_then(|units: ReadingUnits| units.conversion());
            units.map_err(|error| raised(py, &error))
        }
        (None, None) => Err(refused(
            "the unit of the readings is not given",
            "give units=\"deg/s,g\" or what they are in, or unit=\"count\", \"V\" or \"SI\"",
        )),
        (Some(_), Some(_)) => Err(refused("unit and units say the same", "give one of them")),
    }
}

/// The refusal of arrays without times.
pub(crate) fn without_times(py: Python<'_>) -> PyErr {
    let problem = "neither times nor a sample rate are given";
    let remedy = "give the times in seconds as t, or samples a second";
    raised(
        py,
        &Error::new("t", problem, remedy).about(Argument::SampleRate),
    )
}
