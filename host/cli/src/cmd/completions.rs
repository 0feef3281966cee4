//! `mimu completions`.

use clap::Args;
use clap_complete::Shell;
use mimu_recording::error::Result;

use crate::examples;
use crate::output::show;

#[derive(Args)]
pub struct CompletionsArgs {
    /// Shell for which the script is
    shell: Shell,
}

pub fn run(args: &CompletionsArgs) -> Result<()> {
    // Written to memory first: the generator panics if the reader of a pipe is gone.
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut examples::command(), "mimu", &mut script);
    show(&String::from_utf8_lossy(&script))
}
