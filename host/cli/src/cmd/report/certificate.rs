//! `mimu report --certificate`: the certificate of a fit.

use std::path::{Path, PathBuf};

use clap::Args;
use mimu::calibration::Calibration;
use mimu::certificate::{AsFound, Certificate, Particulars};
use mimu::data_sheet::{DataSheet, Part};
use mimu::fit::{Fit, Options, fit};
use mimu::noise::noise_file::NoiseFile;
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::recording_problem::OfRecording;
use mimu_recording::ReferenceError;
use mimu_recording::error::{Error, Result};
use mimu_recording::result_file::stage;

use crate::opening;
use crate::output::{now, show};
use crate::report::{Made, certificate_page, refused};

#[derive(Args)]
pub(super) struct CertificateArgs {
    /// Write a calibration certificate instead, by the headings of ISO/IEC 17025; the file states laboratory, customer, item, dates (docs/report.md)
    ///
    /// The results are those of `mimu fit` of the recording, with expanded uncertainty and coverage factor.
    #[arg(long = "certificate", value_name = "FILE", conflicts_with = "verify")]
    pub particulars: Option<PathBuf>,
    /// With --certificate: the calibration that the unit had before
    #[arg(long, value_name = "FILE", requires = "particulars")]
    as_found: Option<PathBuf>,
    /// With --certificate: how well the true inputs are known, in place of what the recording states (docs/table.md)
    #[arg(long, value_name = "FILE", requires = "particulars")]
    reference_error: Option<PathBuf>,
}

/// What a certificate is made from, beside its own arguments.
pub(super) struct Given<'a> {
    /// The recording with its name.
    pub recording: (String, Prepared),
    /// The calibration file that it certifies.
    pub calibration: Option<&'a Path>,
    pub noise: Option<&'a NoiseFile>,
    pub part: Option<&'a Part>,
    pub out: &'a Path,
    pub command_line: &'a str,
}

impl CertificateArgs {
    /// Files that no result may overwrite.
    pub(super) fn inputs(&self) -> [Option<&Path>; 3] {
        [&self.particulars, &self.as_found, &self.reference_error].map(|path| path.as_deref())
    }

    /// Writes the certificate that the file `particulars` describes.
    pub(super) fn write(&self, particulars: &Path, given: Given) -> Result<()> {
        let (name, prepared) = given.recording;
        let prepared = match &self.reference_error {
            Some(file) => prepared.with_reference_error(ReferenceError::read(file)?),
            None => prepared,
        };
        let now = now();
        let today = now.split('T').next().unwrap_or_default();
        let stated = prepared.reference_error();
        let traceable = stated.is_some_and(|e| !e.traceability.trim().is_empty());
        let particulars = Particulars::read(particulars, traceable, today)?;
        let problems = OfRecording::prepared(&prepared);
        let fitted =
            fit(prepared, Options::default()).inspect_err(|_| refused(&problems, false))?;
        let made = Calibration::of(&fitted, &[], &now)?;
        if let Some(file) = given.calibration {
            refuse_other(&opening::calibration(file)?, &made, file)?;
        }
        let as_found = self
            .as_found
            .as_deref()
            .map(|file| as_found(&fitted, &made, file));
        let sheet = given
            .part
            .map(|part| DataSheet::of(&made, given.noise, part));
        let certificate =
            Certificate::of(&fitted, &made, particulars, as_found.transpose()?, sheet)?;
        let page = Made {
            recording: name,
            command: given.command_line.to_owned(),
            created: now,
        };
        let file = given.calibration.map(|path| path.display().to_string());
        let html = certificate_page(&certificate, file.as_deref(), &page);
        stage(given.out, html)?.publish()?;
        show(&format!(
            "{}\njudgement: {}\ncertificate {}: {}\n",
            certificate.device,
            certificate.judgement,
            certificate.particulars.number,
            given.out.display()
        ))
    }
}

fn as_found(fitted: &Fit, made: &Calibration, file: &Path) -> Result<AsFound> {
    let name = file.display().to_string();
    AsFound::of(fitted, made, &opening::calibration(file)?, &name)
}

/// Refuses a calibration file whose matrices are not those of the certificate.
fn refuse_other(file: &Calibration, made: &Calibration, path: &Path) -> Result<()> {
    let same = |sensor: Sensor| match (file.inverse(sensor), made.inverse(sensor)) {
        (Some(a), Some(b)) => {
            let off = (a.matrix - b.matrix).norm() / b.matrix.norm();
            let shift = (a.offset - b.offset).norm() / b.offset.norm().max(f64::MIN_POSITIVE);
            off < 1e-9 && shift < 1e-9
        }
        (a, b) => a.is_none() && b.is_none(),
    };
    let plain = file.effects().is_empty() && file.temperature.is_none();
    let same_recording = file.recording.sha256 == made.recording.sha256;
    if plain && same_recording && Sensor::BOTH.into_iter().all(same) {
        return Ok(());
    }
    let why = match (same_recording, plain) {
        (false, _) => "it was made from another recording",
        (_, false) => "it has effects or curves over temperature, which a fit does not have",
        _ => "its numbers are not those of a fit with these options",
    };
    Err(Error::new(
        path.display(),
        format!("the certificate would not be that of this file: {why}"),
        "give the recording and the options that `mimu fit` made it from, or leave --calibration out",
    ))
}
