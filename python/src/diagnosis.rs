//! The effect behind a residual.

use std::ffi::OsString;
use std::sync::Arc;

use mimu::diagnose::Recordings;
use mimu::diagnosed::{Diagnosed, diagnosed};
use mimu_cli::called::{DiagnoseArgs, Further, of_contents};
use mimu_cli::report::{self, Detail, Made, fragment};
use mimu_recording::error::Result;
use pyo3::prelude::*;

use crate::calibration::Calibration;
use crate::error::{raised, refused};
use crate::noise::Noise;
use crate::recording::{Recording, Source, sources};
use crate::work::{done, json};

/// A diagnosis of recordings.
#[pyclass(frozen, module = "mimu._mimu")]
pub(crate) struct Diagnosis {
    done: Diagnosed,
    further: Further,
    created: String,
}

#[pymethods]
impl Diagnosis {
    /// JSON of the result, as `mimu diagnose --json` writes it.
    fn json(&self) -> PyResult<String> {
        json(&self.further.json(&self.done.result))
    }

    /// The text that `mimu diagnose` prints; with `everything`, that of `--all --next`.
    fn text(&self, everything: bool) -> String {
        let detail = Detail {
            all: everything,
            next: everything,
        };
        report::diagnosis_text(&self.done.result, detail) + &self.further.text()
    }

    /// The content of the page, as a fragment of HTML.
    fn html(&self) -> String {
        let result = &self.done.result;
        let places: Vec<&str> = result.recordings.iter().map(|r| r.place.as_str()).collect();
        let made = Made {
            recording: places.join(", "),
            command: "mimu.diagnose".into(),
            created: self.created.clone(),
        };
        fragment::of_diagnosis(result, &made)
    }

    /// The calibration, with the effects that the unit has.
    fn calibration(&self, py: Python<'_>) -> PyResult<Calibration> {
        let made = self.done.calibration(&self.created);
        Ok(Calibration {
            model: Arc::new(made.map_err(|error| raised(py, &error))?),
            name: format!("diagnosis of {}", self.done.result.device),
            units: None,
        })
    }
}

/// Finds the effect behind the residual of a unit, by the arguments of `mimu diagnose`.
#[pyfunction]
#[pyo3(signature = (recordings, arguments, *, verify, calibration, noise))]
pub(crate) fn diagnose(
    py: Python<'_>,
    recordings: Vec<PyRef<'_, Recording>>,
    arguments: Vec<OsString>,
    verify: Option<&Recording>,
    calibration: Option<&Calibration>,
    noise: Option<&Noise>,
) -> PyResult<Diagnosis> {
    let all = sources(py, &recordings)?;
    let second = verify.map(|recording| recording.source.clone());
    let given = calibration.map(|c| (c.model.clone(), c.name.clone()));
    let noise = noise.map(|noise| noise.file.clone());
    let created = mimu_cli::now();
    let now = created.clone();
    let work = move || {
        let args: DiagnoseArgs = of_contents("diagnose", arguments)?;
        let samples = all
            .iter()
            .chain(&second)
            .map(|of| of.samples().map(|of| &**of));
        let samples: Vec<_> = samples.collect::<Result<_>>()?;
        let open = |source: &Source| args.opened(&*source.opener(), noise.as_deref());
        let mut prepared: Vec<_> = all.iter().map(open).collect::<Result<_>>()?;
        let second = second.as_ref().map(open).transpose()?;
        let name = second.as_ref().map(|second| second.manifest.device.clone());
        let mut recordings = Recordings {
            first: prepared.remove(0),
            more: prepared,
            second,
            given: given.as_ref().map(|(model, _)| model.as_ref()),
        };
        let split = args.split(&samples, &mut recordings)?;
        let given = given.as_ref().map(|(_, name)| name.as_str());
        let found = diagnosed(recordings, [name.as_deref(), given], &now, &|_| ())?;
        let further = Further::of(Some(samples[0]), &found, split, &args)?;
        Ok((found, further))
    };
    let (done, further) = done(py, work, refused)?;
    Ok(Diagnosis {
        done,
        further,
        created,
    })
}
