//! `mimu compare`.

use std::path::PathBuf;

use clap::Args;
use mimu::calibration::comparison::compare;
use mimu_recording::error::Result;

use crate::arguments::{JsonArgs, VerboseArgs};
use crate::opening;
use crate::output::print;
use crate::report::compare_text;

#[derive(Args)]
pub struct CompareArgs {
    /// Calibrations of one unit, two or more
    #[arg(required = true, num_args = 2.., value_name = "FILE")]
    files: Vec<PathBuf>,
    #[command(flatten)]
    verbose: VerboseArgs,
    #[command(flatten)]
    json: JsonArgs,
}

pub fn run(args: &CompareArgs) -> Result<()> {
    let read = |path: &PathBuf| Ok((path.display().to_string(), opening::calibration(path)?));
    let all: Vec<_> = args.files.iter().map(read).collect::<Result<_>>()?;
    let result = compare(&all)?;
    print(
        &args.json,
        &compare_text(&result, args.verbose.verbose),
        &result,
        None,
    )
}
