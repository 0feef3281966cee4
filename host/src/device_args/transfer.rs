//! `mimu device upload` and `mimu device download`.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use mimu::calibration::Calibration;
use mimu::device::{Image, contents, download, unusable, upload};
use mimu::error::{Error, Result};
use mimu::report;
use mimu_core::stored::{Refused, VERSION};

use super::{PortArgs, open};
use crate::{JsonArgs, check_outputs, print, progress};

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
    let port = session.port();
    let text = report::upload_text(port, &image, &done);
    print(
        &args.json,
        &text,
        &report::upload_json(port, &image, &done),
        None,
    )
}

pub fn run_download(args: &DownloadArgs) -> Result<()> {
    check_outputs(&[Some(&args.output), args.json.file()], &[])?;
    let mut session = open(&args.port)?;
    let bytes = download(&mut session)?;
    let port = session.port();
    let contents = contents(&bytes).map_err(|refused| {
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
    write_whole(&args.output, &bytes)?;
    let text = report::download_text(port, &args.output, &bytes, &contents);
    let value = report::download_json(port, &args.output, &bytes, &contents);
    print(&args.json, &text, &value, None)
}

/// Bytes, whole or not at all.
fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let io = |error: &std::io::Error| Error::io(path, error);
    if std::fs::metadata(path).is_ok_and(|there| !there.is_file()) {
        return std::fs::write(path, bytes).map_err(|e| io(&e));
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    let mut file =
        tempfile::NamedTempFile::new_in(folder.unwrap_or(Path::new("."))).map_err(|e| io(&e))?;
    file.write_all(bytes).map_err(|e| io(&e))?;
    file.as_file().sync_all().map_err(|e| io(&e))?;
    file.persist(path).map(drop).map_err(|e| io(&e.error))
}
