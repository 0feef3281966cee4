//! `mimu device upload` and `mimu device download`.

use std::path::PathBuf;

use crate::report;
use clap::Args;
use mimu::calibration::Calibration;
use mimu_core::stored::{Refused, VERSION};
use mimu_device::{DeviceResult, Image, contents, download, unusable, upload};
use mimu_recording::error::{Error, Result};
use mimu_recording::result_file::stage;

use super::{PortArgs, open};
use crate::arguments::JsonArgs;
use crate::output::{check_outputs, print, progress};

#[derive(Args)]
pub struct UploadArgs {
    /// Calibration file
    calibration: PathBuf,
    #[command(flatten)]
    port: PortArgs,
    #[command(flatten)]
    json: JsonArgs,
}

#[derive(Args)]
pub struct DownloadArgs {
    /// File to write the bytes to, as the device stores them
    #[arg(short, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    port: PortArgs,
    #[command(flatten)]
    json: JsonArgs,
}

pub fn run_upload(args: &UploadArgs) -> Result<()> {
    check_outputs(&[args.json.file()], &[&args.calibration])?;
    let place = args.calibration.display().to_string();
    let calibration = Calibration::read(&args.calibration)?;
    let image = Image::new(&calibration, &place)?;
    let mut session = open(&args.port)?;
    image.check_device(&calibration, session.who(), &place)?;
    let bar = progress("uploading");
    let done = upload(&mut session, &image, |share| {
        bar.set_position((share * 1000.0) as u64)
    })?;
    bar.finish_and_clear();
    let result = DeviceResult::new("upload", session.port(), done);
    print(&args.json, &report::upload_text(&result), &result, None)
}

pub fn run_download(args: &DownloadArgs) -> Result<()> {
    check_outputs(&[Some(&args.output), args.json.file()], &[])?;
    let mut session = open(&args.port)?;
    let bytes = download(&mut session)?;
    let port = session.port();
    let contents = contents(&bytes, &args.output).map_err(|refused| {
        let problem = format!(
            "this program cannot read what it stores: {}",
            unusable(&refused)
        );
        let remedy = match refused {
            Refused::Version { found } if found < VERSION => {
                "upload the calibration file again: the device keeps the numbers in an older layout"
            }
            Refused::Version { .. } => "update mimu on this computer",
            _ => "upload the calibration file again",
        };
        Error::new(port, problem, remedy)
    })?;
    let file = stage(&args.output, bytes.as_slice())?;
    let result = DeviceResult::new("download", port, contents);
    let text = report::download_text(&result);
    print(&args.json, &text, &result, Some(file))
}
