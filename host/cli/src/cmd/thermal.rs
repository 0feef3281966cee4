//! `mimu thermal`.

mod plan;

use clap::{Args, Subcommand};
use mimu_recording::error::Result;

#[derive(Args)]
pub(crate) struct ThermalArgs {
    #[command(subcommand)]
    command: ThermalCommand,
}

#[derive(Subcommand)]
enum ThermalCommand {
    /// Plan a procedure over temperature: how long it takes, and how well the curves are known afterwards
    Plan(plan::PlanArgs),
}

pub(crate) fn run(args: &ThermalArgs) -> Result<()> {
    match &args.command {
        ThermalCommand::Plan(args) => plan::run(args),
    }
}
