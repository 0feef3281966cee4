//! `mimu thermal record` with the firmware's release image on the emulated board, with its table and its chamber.
#![cfg(unix)]

use crate::command::mimu;

const PLAN: &str = "format = \"mimu-plan/1\"\nsample_rate_hz = 1000.0\ncarrier = \"table\"\ngravity_mps2 = 9.793\n\
                    chamber_c = [[0.0, 12.0], [85.0, 25.0]]\n[[step]]\nup = [0.0, 0.0, 1.0]\nrate_dps = 60.0\ndwell_s = 2.5\n";

#[test]
fn what_cannot_be_carried_out_is_refused_in_a_line_before_anything_is_opened() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let write = |name: &str, text: &str| std::fs::write(path(name), text).unwrap();
    write("plan.toml", PLAN);
    write("cold.toml", &PLAN.replace("chamber_c", "# chamber_c"));
    std::fs::create_dir(path("there")).unwrap();
    write("there/samples.csv", "");
    write(
        "none.toml",
        "format = \"mimu-driver/1\"\ntcp = \"127.0.0.1:9\"\n",
    );
    for (arguments, words) in [
        ("plan.toml -o rec", "no driver is given"),
        ("cold.toml -o rec", "no temperatures (chamber_c)"),
        ("plan.toml -o there", "it exists already"),
        (
            "plan.toml -o rec --driver none.toml",
            "neither `move` nor [chamber]",
        ),
        ("nowhere.toml -o rec", "nowhere.toml"),
    ] {
        mimu(folder.path(), &format!("thermal record {arguments}")).refused(&[words]);
        assert!(!path("rec").exists());
    }
}
