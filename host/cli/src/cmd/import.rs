//! `mimu import`.

use mimu_recording::error::Result;

use crate::arguments::JsonArgs;
pub(crate) use crate::importing::ImportArgs;
use crate::importing::imported;
use crate::output::print;
use crate::report;

pub(crate) fn run(args: ImportArgs) -> Result<()> {
    let json = JsonArgs {
        path: args.json.path.clone(),
    };
    let summary = imported(args)?;
    print(&json, &report::import_text(&summary), &summary, None)
}
