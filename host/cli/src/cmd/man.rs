//! `mimu man`.

use std::path::{Path, PathBuf};

use clap::Args;
use clap_mangen::Man;
use mimu_recording::error::{Error, Result};
use mimu_recording::result_file::{Staged, stage};

use crate::examples;

#[derive(Args)]
pub struct ManArgs {
    /// Folder for the pages (`mimu.1`, `mimu-fit.1`, ...); created if it does not exist
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
}

pub fn run(args: &ManArgs) -> Result<()> {
    let folder = &args.output;
    if folder.exists() && !folder.is_dir() {
        let problem = "a file has the name of the folder for the pages";
        return Err(Error::new(folder.display(), problem, "name a folder"));
    }
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, &e))?;
    let mut command = examples::command();
    // Names the subcommands as they are typed.
    command.build();
    let mut pages = Vec::new();
    add(&command, folder, &mut pages)?;
    pages.into_iter().try_for_each(Staged::publish)
}

/// Adds the page of `command` and those of its subcommands.
fn add(command: &clap::Command, folder: &Path, pages: &mut Vec<Staged>) -> Result<()> {
    let name = command.get_display_name().unwrap_or(command.get_name());
    let path = folder.join(format!("{name}.1"));
    let mut page = Vec::new();
    Man::new(command.clone())
        .manual("mimu")
        .render(&mut page)
        .map_err(|e| Error::io(&path, &e))?;
    pages.push(stage(&path, page)?);
    let below = command.get_subcommands().filter(|c| c.get_name() != "help");
    below.into_iter().try_for_each(|c| add(c, folder, pages))
}
