//! The command `mimu`.

fn main() -> std::process::ExitCode {
    mimu_cli::run(std::env::args_os()).into()
}
