//! `mimu verify`.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;
use mimu::calibration::Calibration;
use mimu::calibration::verify::{Verification, verify};
use mimu::data_sheet::DataSheet;
use mimu::judgement::Judgement;
use mimu::noise::noise_file::NoiseFile;
use mimu::prepared::Prepared;
use mimu::signal::stillness::DwellSearch;
use mimu_body::TriadVerification;
use mimu_recording::Recording;
use mimu_recording::error::Result;
use serde::Serialize;
use serde_json::json;

use crate::arguments::{
    JsonArgs, NoiseArgs, PartArgs, StillArgs, StrictArgs, VerboseArgs, WholeTurnArgs, with_noise,
};
use crate::hint::OF_A_LOG;
use crate::output::print;
use crate::reading::{LogArgs, read_with_samples};
use crate::report::data_sheet::{WithDataSheet, data_sheet_text};
use crate::report::{self, Joined};
use crate::status::Status;

/// Arguments of `mimu verify`.
#[derive(Args)]
pub struct VerifyArgs {
    /// Recording, of samples or of means, or a log that `mimu import` reads
    recording: PathBuf,
    /// Calibration file
    #[arg(long, value_name = "FILE")]
    calibration: PathBuf,
    #[command(flatten)]
    still: StillArgs,
    #[command(flatten)]
    whole: WholeTurnArgs,
    #[command(flatten)]
    noise: NoiseArgs,
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
    let calibration = Calibration::read(&args.calibration)?;
    let outputs = [args.json.file()];
    let log = args.log.or_gravity(calibration.recording.gravity_mps2);
    let inputs = [Some(args.calibration.as_path()), args.noise.file.as_deref()];
    let samples = RefCell::new(None);
    let open = |search| {
        let read = read_with_samples(&args.recording, &log, search, &outputs, &inputs)?;
        samples.replace(read.1);
        Ok(read.0)
    };
    let noise = args.noise.read()?;
    let made = args.judged(&open, noise.as_ref(), &calibration)?;
    let made = made.with_body(samples.take().as_ref(), &calibration)?;
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
        let part = self.part.part()?;
        let prepared = with_noise(open(self.still.search())?, noise)?;
        Ok(Verified {
            result: verify(&self.whole.apply(prepared)?, calibration)?,
            sheet: part.map(|part| DataSheet::of(calibration, noise, &part)),
            further: BTreeMap::new(),
        })
    }
}

/// A verification, and what the command prints of it.
pub struct Verified {
    /// The verification.
    pub result: Verification,
    sheet: Option<DataSheet>,
    further: BTreeMap<String, TriadVerification>,
}

impl Verified {
    /// With the further triads that both the calibration and the recording have.
    ///
    /// # Errors
    /// The samples cannot be read.
    pub fn with_body(mut self, samples: Option<&Recording>, by: &Calibration) -> Result<Self> {
        if let Some(samples) = samples {
            self.further = mimu_body::verify(samples, by)?;
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
        WithDataSheet {
            result: Joined::of(&self.result, further.as_ref()),
            data_sheet: self.sheet.as_ref(),
        }
    }

    /// What the command prints.
    pub fn text(&self, verbose: bool) -> String {
        let mut text = report::verify_text(&self.result, verbose);
        if !self.further.is_empty() {
            text += &report::body_errors_text(&self.further);
        }
        text.extend(self.sheet.as_ref().map(data_sheet_text));
        text
    }
}
