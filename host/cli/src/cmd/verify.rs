//! `mimu verify`.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use mimu::{
    Calibration, DataSheet, DwellSearch, Judgement, NoiseFile, Prepared, Verification, verify,
};
use mimu_body::TriadVerification;
use mimu_export::fitting_convention::{self, Reading};
use mimu_recording::{Recording, Result};
use serde::Serialize;
use serde_json::json;

use super::trajectory::{self, TrajectoryArgs};
use crate::arguments::{
    JsonArgs, NoiseArgs, PartArgs, StillArgs, StrictArgs, VerboseArgs, WholeTurnArgs, with_noise,
};
use crate::hint::OF_A_LOG;
use crate::opening::{self, Opened};
use crate::output::print;
use crate::reading::{LogArgs, open, read_with_samples};
use crate::report::data_sheet::{WithDataSheet, data_sheet_text};
use crate::report::{self, Joined};
use crate::status::Status;

/// Arguments of `mimu verify`.
#[derive(Args)]
pub struct VerifyArgs {
    /// Recording, of samples or of means, or a log that `mimu import` reads
    recording: PathBuf,
    /// Calibration file, mimu's or another program's, whose conventions are tried on the recording; again for the other triad of a program that writes a file of each
    #[arg(long, value_name = "FILE", required = true)]
    calibration: Vec<PathBuf>,
    #[command(flatten)]
    still: StillArgs,
    #[command(flatten)]
    whole: WholeTurnArgs,
    #[command(flatten)]
    noise: NoiseArgs,
    #[command(flatten)]
    trajectory: TrajectoryArgs,
    #[command(flatten)]
    part: PartArgs,
    #[command(flatten)]
    strict: StrictArgs,
    #[command(flatten)]
    verbose: VerboseArgs,
    #[command(flatten)]
    json: JsonArgs,
    #[command(flatten, next_help_heading = OF_A_LOG)]
    log: LogArgs,
}

pub(crate) fn run(args: &VerifyArgs) -> Result<Status> {
    let opened = opening::open_all(&args.calibration)?;
    let outputs = [args.json.file()];
    let log = args.log.or_gravity(opened.gravity_mps2());
    let calibrations = args.calibration.iter().map(|path| Some(path.as_path()));
    let inputs: Vec<Option<&Path>> = calibrations.chain([args.noise.file.as_deref()]).collect();
    if let Some(by) = args.trajectory.read()? {
        let recording = open(&args.recording, &log)?;
        let calibration = opened.of_readings(recording.manifest.raw_unit)?;
        let (text, all, judgement) = trajectory::verified(&recording, &by, &calibration)?;
        print(&args.json, &text, &all, None)?;
        return Ok(args.strict.status(&judgement));
    }
    let samples = RefCell::new(None);
    let read_at = |search| {
        let read = read_with_samples(&args.recording, &log, search, &outputs, &inputs)?;
        samples.replace(read.1);
        Ok(read.0)
    };
    let noise = args.noise.read()?;
    let made = args.judged_as(&read_at, noise.as_ref(), &|prepared| match &opened {
        Opened::Own(own) => Ok((own.as_ref().clone(), None)),
        Opened::Foreign(other) => {
            let (calibration, readings) = fitting_convention::calibration(other, prepared)?;
            let lines = [
                other.place.as_str(),
                ": a file of ",
                other.format.name,
                "\n",
            ]
            .concat();
            let mut text = readings
                .iter()
                .fold(lines, |all, reading| all + &reading.text(other.format.name));
            text.extend(other.left_out().map(|line| line + "\n"));
            Ok((calibration, Some((text, readings))))
        }
    })?;
    let made = made.with_body(samples.take().as_ref())?;
    print(
        &args.json,
        &made.text(args.verbose.verbose),
        &made.json(),
        None,
    )?;
    Ok(args.strict.status(&made.judgement()))
}

impl VerifyArgs {
    /// `calibration` judged by the recording that `open` reads.
    ///
    /// # Errors
    /// The recording or the part is refused.
    pub fn judged(
        &self,
        open: &dyn Fn(DwellSearch) -> Result<Prepared>,
        noise: Option<&NoiseFile>,
        calibration: &Calibration,
    ) -> Result<Verified> {
        self.judged_as(open, noise, &|_| Ok((calibration.clone(), None)))
    }

    fn judged_as(
        &self,
        open: &dyn Fn(DwellSearch) -> Result<Prepared>,
        noise: Option<&NoiseFile>,
        calibration: &AsRead,
    ) -> Result<Verified> {
        let part = self.part.part()?;
        let prepared = with_noise(open(self.still.search())?, noise)?;
        let prepared = self.whole.apply(prepared)?;
        let (calibration, read) = calibration(&prepared)?;
        Ok(Verified {
            result: verify(&prepared, &calibration)?,
            sheet: part.map(|part| DataSheet::of(&calibration, noise, &part)),
            read,
            calibration,
            further: BTreeMap::new(),
        })
    }
}

/// A verification, and what the command prints of it.
pub struct Verified {
    /// The verification.
    pub result: Verification,
    sheet: Option<DataSheet>,
    read: Option<Read>,
    calibration: Calibration,
    further: BTreeMap<String, TriadVerification>,
}

/// Gives the calibration of a recording, and how the file of another program was read by it.
type AsRead<'a> = dyn Fn(&Prepared) -> Result<(Calibration, Option<Read>)> + 'a;

/// How the file of another program was read: as text, and each triad.
type Read = (String, Vec<Reading>);

/// A result with how a file of another program was read, as JSON has them.
#[derive(Serialize)]
struct WithReadings<'a, T: Serialize> {
    #[serde(flatten)]
    result: T,
    #[serde(skip_serializing_if = "Option::is_none")]
    conventions: Option<&'a [Reading]>,
}

impl Verified {
    /// With the further triads that both the calibration and the recording have.
    ///
    /// # Errors
    /// The samples cannot be read.
    pub fn with_body(mut self, samples: Option<&Recording>) -> Result<Self> {
        if let Some(samples) = samples {
            self.further = mimu_body::verify(samples, &self.calibration)?;
        }
        Ok(self)
    }

    /// The worst judgement of all triads.
    fn judgement(&self) -> Judgement {
        let first = self.result.judgement.clone();
        let further = self.further.values().map(|of| of.judgement.clone());
        further.fold(
            first,
            |worst, next| if next.kind > worst.kind { next } else { worst },
        )
    }

    /// Its result as JSON.
    pub fn json(&self) -> impl Serialize {
        let further = (!self.further.is_empty()).then(|| json!({ "sensors": self.further }));
        WithReadings {
            result: WithDataSheet {
                result: Joined::of(&self.result, further.as_ref()),
                data_sheet: self.sheet.as_ref(),
            },
            conventions: self.read.as_ref().map(|(_, all)| all.as_slice()),
        }
    }

    /// What the command prints.
    pub fn text(&self, verbose: bool) -> String {
        let mut text = self
            .read
            .as_ref()
            .map(|read| read.0.clone())
            .unwrap_or_default();
        text += &report::verify_text(&self.result, verbose);
        if !self.further.is_empty() {
            text += &report::body_errors_text(&self.further);
        }
        text.extend(self.sheet.as_ref().map(data_sheet_text));
        text
    }
}
