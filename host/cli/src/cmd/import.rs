//! `mimu import`.

use mimu_recording::error::Result;

use crate::arguments::JsonArgs;
pub(crate) use crate::importing::ImportArgs;
use crate::importing::imported;
use crate::output::{print, quoted};
use crate::report;

pub(crate) fn run(args: ImportArgs) -> Result<()> {
    let json = JsonArgs {
        path: args.json.path.clone(),
    };
    let (summary, _) = imported(args)?;
    let mut text = report::import_text(&summary);
    text += &format!(
        "next: mimu fit {0} -o cal.toml; if the unit lay still: mimu allan {0} -o noise.toml\n",
        quoted(&summary.recording)
    );
    print(&json, &text, &summary, None)
}
