//! `mimu device upload` and `mimu device download`.

use std::path::{Path, PathBuf};

use crate::report;
use clap::Args;
use mimu::calibration::Calibration;
use mimu_core::stored::{StoredError, VERSION};
use mimu_device::{
    DeviceResult, Image, calibration, contents, download, outside_now, unit_name, upload,
};
use mimu_recording::error::{Argument, Error, Result};
use mimu_recording::result_file::stage;

use super::OnDevice;
use crate::output::{check_outputs, print, progress};
use crate::overwriting::check_overwritten;

#[derive(Args)]
pub struct UploadArgs {
    /// Calibration file
    calibration: PathBuf,
    /// Store it even if the calibration belongs to another unit
    #[arg(long)]
    other_unit: bool,
    /// Store it although it is judged a misfit
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    on: OnDevice,
}

#[derive(Args)]
#[command(group(clap::ArgGroup::new("to").required(true).multiple(true).args(["output", "bytes"])))]
pub struct DownloadArgs {
    /// Calibration file to write; it lacks the uncertainties, because the device does not store them
    #[arg(short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// File to write the bytes to, as the device stores them
    #[arg(long, value_name = "FILE")]
    bytes: Option<PathBuf>,
    /// Name of the unit in the calibration file [default: its number, as in `mimu record`]
    #[arg(long)]
    device: Option<String>,
    #[command(flatten)]
    on: OnDevice,
}

pub fn run_upload(args: &UploadArgs) -> Result<()> {
    let place = args.calibration.display().to_string();
    let calibration = Calibration::read(&args.calibration)?;
    let judgement = calibration.judgement.as_ref();
    if let Some(why) = judgement.and_then(|j| j.needs_consent().filter(|_| !args.force)) {
        let problem = format!("it is not uploaded, because {why}");
        return Err(Error::new(place, problem, "calibrate the unit again").about(Argument::Force));
    }
    let image = Image::new(&calibration, &place)?;
    let mut session = args.on.open(Some(&args.calibration))?;
    if !args.other_unit {
        image.check_unit(session.who(), &place)?;
    }
    image.check_device(&calibration, session.who(), &place)?;
    let bar = progress("uploading");
    let mut done = upload(&mut session, &image, args.other_unit, |share| {
        bar.reach(share)
    })?;
    bar.finish();
    done.warnings
        .extend(outside_now(&mut session, &calibration)?);
    let result = DeviceResult::new("upload", session.port(), done);
    print(&args.on.json, &report::upload_text(&result), &result, None)
}

pub fn run_download(args: &DownloadArgs) -> Result<()> {
    let outputs = [
        args.output.as_deref(),
        args.bytes.as_deref(),
        args.on.json.file(),
    ];
    check_outputs(&outputs, None::<&Path>)?;
    check_overwritten(&outputs[..2])?;
    let mut session = args.on.open(None)?;
    let bytes = download(&mut session)?;
    let port = session.port();
    let mut contents = contents(&bytes).map_err(|refused| {
        let problem = format!(
            "this program cannot read its stored calibration: {}",
            refused
        );
        let remedy = match refused {
            StoredError::Version { found } if found < VERSION => {
                "upload the calibration file again: the device stores it in an older layout"
            }
            StoredError::Version { .. } => "update mimu on this computer",
            _ => "upload the calibration file again",
        };
        Error::new(port, problem, remedy)
    })?;
    let shown = |path: &PathBuf| path.display().to_string();
    contents.file = args.output.as_ref().map(shown);
    contents.bytes_file = args.bytes.as_ref().map(shown);
    let mut files = Vec::new();
    if let Some(path) = &args.output {
        let unit = contents.unit_id.as_ref().unwrap_or(&session.who().unit_id);
        let device = args.device.clone().unwrap_or_else(|| unit_name(unit));
        let file = calibration(&bytes, Some(session.who()), &device, port)?;
        files.push(stage(path, file.to_toml())?);
    }
    if let Some(path) = &args.bytes {
        files.push(stage(path, bytes.as_slice())?);
    }
    let result = DeviceResult::new("download", port, contents);
    print(
        &args.on.json,
        &report::download_text(&result),
        &result,
        files,
    )
}
