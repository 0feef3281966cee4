//! The command `mimu-board`.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

use mimu_board::image::release_image;

/// The command, in the root of the repository.
fn mimu_board() -> Command {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let image = std::env::var_os("MIMU_FIRMWARE").map_or_else(release_image, PathBuf::from);
    let mut command = Command::new(env!("CARGO_BIN_EXE_mimu-board"));
    command
        .current_dir(root)
        .arg("serve")
        .arg("--image")
        .arg(image);
    command
}

/// Ends the process when the test ends, in whatever way.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn port_and_control_are_printed_on_a_line_each_and_a_plan_gives_all_but_its_steps() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("port");
    let child = mimu_board()
        .args([
            "--plan",
            "rig/plans/hands.toml",
            "--seed",
            "7",
            "--pace",
            "fast",
        ])
        .args(["--control", "127.0.0.1:0", "--link"])
        .arg(&link)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut running = Running(child);
    let mut lines = BufReader::new(running.0.stdout.take().unwrap()).lines();
    let mut line = || lines.next().unwrap().unwrap();
    assert_eq!(PathBuf::from(line()), link);
    let control = line();
    let address = control.strip_prefix("control: ").expect(&control);
    let mut stream = TcpStream::connect(address).unwrap();
    stream.write_all(b"*IDN?\nPOSITION?\n").unwrap();
    stream.shutdown(std::net::Shutdown::Write).unwrap();
    let mut answers = String::new();
    stream.read_to_string(&mut answers).unwrap();
    // The person begins with this face.
    assert_eq!(answers, "mimu-bench,hands,7,1\n0 0 -1 NaN\n");
    assert!(link.exists());
    let mut stderr = running.0.stderr.take().unwrap();
    drop(running);
    let mut warning = String::new();
    stderr.read_to_string(&mut warning).unwrap();
    let wanted = "rig/plans/hands.toml: its entries are not carried out";
    assert!(warning.contains(wanted), "{warning}");
}

#[test]
fn a_control_that_cannot_be_is_refused_in_a_line() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    let file = file.display().to_string();
    for (arguments, problem) in [
        (&["--control", "nowhere"][..], "127.0.0.1:0"),
        (&["--link", &file], "is not a symbolic link"),
        (&["--carrier", "hands"], "--control"),
    ] {
        let Output { status, stderr, .. } = mimu_board().args(arguments).output().unwrap();
        let stderr = String::from_utf8(stderr).unwrap();
        assert!(!status.success() && stderr.contains(problem), "{stderr}");
    }
}
