//! `mimu fleet`.

use std::path::PathBuf;

use clap::Args;
use mimu::data_sheet::Part;
use mimu_fleet::labels::LabelTable;
use mimu_fleet::tree::{Search, Tree};
use mimu_fleet::{fleet, fleet_and_prior};
use mimu_recording::error::Result;

use crate::arguments::{JsonArgs, VerboseArgs};
use crate::output::{Results, check_outputs, progress};
use crate::overwriting::check_overwritten;
use crate::report::{Made, fleet_page, fleet_text};

#[derive(Args)]
pub struct FleetArgs {
    /// Folders with calibration files of units, at any depth; files too
    ///
    /// Parquet files of `mimu.fit_table` count as a calibration file in each row, at the path in the column `label`.
    ///
    /// A folder `fixture=B` labels the files below it. Files with the same unit are repeated measurements. The unit is the label `unit`, or else the number or
    /// name in the file, or else the name of the file; the day is the label `date`, or else that of the file's creation.
    #[arg(required = true, value_name = "DIR")]
    folders: Vec<PathBuf>,
    /// Table of labels (CSV): its first column is `file` or `unit`, the others are labels such as operator, fixture, date, batch
    #[arg(long, value_name = "TABLE.csv")]
    labels: Option<PathBuf>,
    /// Names of folders without `=`, from the outermost: `line,batch`; `-` skips one
    #[arg(long = "folders", value_name = "NAMES", value_delimiter = ',')]
    names: Vec<String>,
    /// Limits for Cpk: the data sheet of a part (icm42688p, mpu6050, lsm6dso, lsm6dsv16x, bmi088, bmi270), or a file of your own
    /// (mimu-part/1)
    #[arg(long, visible_alias = "part", value_name = "NAME|FILE.toml")]
    limits: Option<String>,
    /// Page to write
    #[arg(short = 'o', long = "out", value_name = "FILE.html")]
    out: Option<PathBuf>,
    /// Prior to write: the population, for `mimu fit --prior` of a further unit
    #[arg(long, value_name = "FILE.toml")]
    prior: Option<PathBuf>,
    #[command(flatten)]
    verbose: VerboseArgs,
    #[command(flatten)]
    json: JsonArgs,
}

pub fn run(args: &FleetArgs, command_line: &str) -> Result<()> {
    let part = args.limits.as_deref().map(Part::find).transpose()?;
    let outputs = [args.out.as_deref(), args.prior.as_deref(), args.json.file()];
    check_outputs(&outputs, &args.labels)?;
    check_overwritten(&outputs[..2])?;
    let table = args.labels.as_deref().map(LabelTable::read).transpose()?;
    let search = Search {
        folders: &args.names,
        table: table.as_ref(),
        part: part.as_ref(),
    };
    let bar = progress("reading");
    let tree = Tree::read(&args.folders, search, &|share| bar.reach(share));
    bar.finish();
    let (result, prior) = match args.prior.is_some() {
        true => {
            let (result, prior) = fleet_and_prior(tree?, part.as_ref())?;
            (result, Some(prior))
        }
        false => (fleet(tree?, part.as_ref())?, None),
    };
    let mut out = Results::new(fleet_text(&result, args.verbose.verbose));
    let made = Made::of(&args.folders, command_line);
    out.file("page", args.out.as_ref(), || Ok(fleet_page(&result, &made)))?;
    if let Some(prior) = prior {
        out.file("prior", args.prior.as_ref(), || Ok(prior.to_toml()))?;
    }
    out.print(&args.json, &result)
}
