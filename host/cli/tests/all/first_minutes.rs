//! The first minutes of a user: a log in, a file out, and what the command says when something is given in the wrong place.

use super::command::{done, example, mimu, refused};
use crate::command::says;

fn json(text: &str) -> serde_json::Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

/// A folder with the example as a log in m/s² and rad/s, without units in its names.
fn log() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    example(at);
    done(
        at,
        "apply counts --calibration counts.toml --format csv -o clean",
    );
    let text = std::fs::read_to_string(at.join("clean/samples.csv")).unwrap();
    let (head, rows) = text.split_once('\n').unwrap();
    let names = head.replace("gyro_", "g").replace("accel_", "a");
    std::fs::write(at.join("log.csv"), format!("{names}\n{rows}")).unwrap();
    folder
}

#[test]
fn a_log_becomes_a_header_in_two_commands_and_nothing_is_replaced_by_mistake() {
    let folder = log();
    let at = folder.path();
    let said = done(at, "fit log.csv -o cal.toml --save rec");
    assert!(said.contains("calibration: cal.toml"), "{said}");
    done(at, "export c cal.toml -o cal.h");
    done(at, "export c --calibration cal.toml -o again.h");
    let [one, other] = ["cal.h", "again.h"].map(|name| std::fs::read(at.join(name)).unwrap());
    assert_eq!(one, other);
    let out = mimu(at, "export c cal.toml --calibration cal.toml -o third.h");
    assert_eq!(out.status, Some(2));

    // The recording was kept, and a file of mimu is written again.
    for command in [
        "fit rec -o cal.toml",
        "export c cal.toml -o cal.h",
        "design -n 12 --reference gravity -o plan.toml",
        "design -n 12 --reference gravity -o plan.toml",
    ] {
        done(at, command);
    }
    done(at, "verify log.csv --calibration cal.toml");
    // A file of anything else is not.
    let own = "thesis, chapter 3: mimu, a comparison\n";
    std::fs::write(at.join("notes"), own).unwrap();
    let said = "mimu: notes: the file exists, and mimu did not write it; choose another name, or remove it";
    for command in ["fit rec", "diagnose rec"] {
        let error = refused(at, &format!("{command} -o notes"));
        assert_eq!(error, format!("{said} (--replace)"));
    }
    for command in [
        "export c cal.toml",
        "convert cal.toml --to json",
        "allan rec",
        "design -n 12 --reference gravity",
        "report rec",
    ] {
        assert_eq!(
            refused(at, &format!("{command} -o notes")),
            said,
            "{command}"
        );
    }
    assert_eq!(std::fs::read_to_string(at.join("notes")).unwrap(), own);
    done(at, "fit rec -o notes --replace");
}

#[test]
fn a_file_in_the_wrong_place_is_called_what_it_is() {
    let folder = log();
    let at = folder.path();
    std::fs::write(at.join("noise.toml"), "format = \"mimu-noise/1\"\n").unwrap();
    done(at, "design -n 12 --reference gravity -o plan.toml");
    let error = refused(at, "verify counts --calibration noise.toml");
    let said = "mimu: noise.toml: this is a noise file (`mimu allan -o`); give a calibration (`mimu fit -o`)";
    assert_eq!(error, said);
    assert_eq!(refused(at, "export c noise.toml -o x.h"), said);
    let error = refused(at, "fit counts --noise counts.toml");
    assert!(
        error.contains("this is a calibration (`mimu fit -o`); give a noise file"),
        "{error}"
    );
    let error = refused(at, "export c plan.toml -o x.h");
    assert!(error.contains("this is a plan"), "{error}");
}

#[test]
fn every_refusal_on_standard_output_is_json_with_its_judgement() {
    let folder = log();
    let at = folder.path();
    let of = |arguments: &str| {
        let out = mimu(at, arguments);
        assert_eq!(out.status, Some(1), "{arguments}");
        let refusal = json(&out.stdout);
        assert_eq!(refusal["format"], "mimu-refusal/1", "{arguments}");
        let problem = refusal["error"]["problem"].as_str().unwrap();
        says(&out.stderr, &[problem]);
        refusal
    };
    let missing = of("import nowhere.csv -o x --json -");
    assert!(missing["judgement"].is_null(), "{missing}");
    of("verify counts --calibration nowhere.toml --json -");
    of("export kalibr --calibration counts.toml -o x.yaml --json -");
    // A unit that lies still shows no scale factor.
    let text = std::fs::read_to_string(at.join("log.csv")).unwrap();
    let still: Vec<&str> = text.lines().take(100).collect();
    std::fs::write(at.join("still.csv"), still.join("\n")).unwrap();
    done(at, "import still.csv --units m/s2,rad/s -o still");
    let refusal = of("fit still --json -");
    let kind = refusal["judgement"]["kind"].as_str().unwrap();
    assert!(["untested", "suspect"].contains(&kind), "{refusal}");
    // A result that is refused afterwards is printed once, as a result.
    let out = done(at, "fit counts --json -");
    assert_eq!(json(&out)["format"], "mimu-fit/1");
}

#[test]
fn units_that_are_given_hold_for_named_columns_too() {
    let folder = log();
    let at = folder.path();
    let text = std::fs::read_to_string(at.join("log.csv")).unwrap();
    let head = text.lines().next().unwrap();
    let place = |name: &str| head.split(',').position(|n| n == name).unwrap();
    let axes = ["gx", "gy", "gz", "ax", "ay", "az"].map(place);
    let t = place("t_s");
    let row = |line: &str| {
        let cells: Vec<f64> = line
            .split(',')
            .map(|c| c.parse().unwrap_or(f64::NAN))
            .collect();
        let [g, a] = [axes[..3].to_vec(), axes[3..].to_vec()];
        let g = g.iter().map(|k| cells[*k].to_degrees());
        let all: Vec<String> = std::iter::once(cells[t])
            .chain(g)
            .chain(a.iter().map(|k| cells[*k] / 9.80665))
            .map(|v| v.to_string())
            .collect();
        all.join(",")
    };
    let rows: Vec<String> = text.lines().skip(1).map(row).collect();
    std::fs::write(at.join("bare.csv"), rows.join("\n")).unwrap();
    let list = "--columns t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z";
    done(
        at,
        &format!("import bare.csv {list} --units g,deg/s -o bare"),
    );
    let manifest = std::fs::read_to_string(at.join("bare/recording.toml")).unwrap();
    assert!(manifest.contains("raw_unit = \"SI\""), "{manifest}");
    let fit = json(&done(at, "fit bare --json -"));
    let scale = &fit["sensors"]["accel"]["parameters"];
    let scale = scale
        .as_array()
        .unwrap()
        .iter()
        .find(|p| p["name"] == "scale_x")
        .unwrap();
    assert!(
        (scale["value"].as_f64().unwrap() - 1.0).abs() < 1e-2,
        "{scale}"
    );
    // Without units they are found, and are those that were given.
    done(at, &format!("import bare.csv {list} -o found"));
    let found = json(&done(at, "fit found --json -"));
    assert_eq!(found["sensors"], fit["sensors"]);
    let error = refused(
        at,
        &format!("import bare.csv {list} --units g,count -o again"),
    );
    says(&error, &["a recording has one unit for both"]);
}

#[test]
fn a_table_is_compensated_into_a_table_with_its_stamps_and_its_other_columns() {
    let folder = log();
    let at = folder.path();
    done(at, "fit log.csv -o cal.toml");
    let text = std::fs::read_to_string(at.join("log.csv")).unwrap();
    let row = |(k, line): (usize, &str)| match k {
        0 => format!("{line},mode (a)\n"),
        300 => format!("ready\n{line},\"turn, {k}\"\n"),
        _ => format!("{line},rest {k}\n"),
    };
    let more: String = text.lines().enumerate().map(row).collect();
    std::fs::write(at.join("more.csv"), more).unwrap();
    let said = done(at, "apply more.csv --calibration cal.toml -o made/out.csv");
    assert!(said.starts_with("made/out.csv: "), "{said}");
    done(
        at,
        "apply more.csv --calibration cal.toml --format csv -o clean2",
    );
    // The eighth cell may contain commas.
    let [copy, clean, log] = ["made/out.csv", "clean2/samples.csv", "log.csv"].map(|name| {
        let text = std::fs::read_to_string(at.join(name)).unwrap();
        let cells = |line: &str| line.splitn(8, ',').map(str::to_owned).collect();
        text.lines().map(cells).collect::<Vec<Vec<String>>>()
    });
    let column = |table: &[Vec<String>], name: &str| -> Vec<String> {
        let at = table[0].iter().position(|n| n == name);
        let at = at.unwrap_or_else(|| panic!("{name}: {:?}", table[0]));
        table[1..].iter().map(|row| row[at].clone()).collect()
    };
    assert_eq!(column(&copy, "t_s"), column(&log, "t_s"));
    for axis in ["x", "y", "z"] {
        assert_eq!(
            column(&copy, &format!("gyro_{axis}_rad_s")),
            column(&clean, &format!("gyro_{axis}"))
        );
        assert_eq!(
            column(&copy, &format!("accel_{axis}_m_s2")),
            column(&clean, &format!("accel_{axis}"))
        );
    }
    let modes = column(&copy, "mode (a)");
    assert_eq!(
        (modes[0].as_str(), modes[299].as_str()),
        ("rest 1", "\"turn, 300\"")
    );
    let error = refused(at, "apply more.csv --calibration cal.toml -o made/out.csv");
    assert!(error.ends_with("replace it (--replace)"), "{error}");
    // What is imported in full again is a recording in SI.
    done(at, "import made/out.csv -o again");
}

#[test]
fn messages_about_a_log_name_the_log() {
    let folder = log();
    let at = folder.path();
    let text = std::fs::read_to_string(at.join("log.csv")).unwrap();
    let still: Vec<&str> = text.lines().take(100).collect();
    std::fs::write(at.join("still.csv"), still.join("\n")).unwrap();
    let error = refused(at, "fit still.csv --units m/s2,rad/s");
    assert!(error.starts_with("mimu: still.csv, "), "{error}");
    let found = json(&done(at, "fit log.csv --json -"));
    assert!(!found.to_string().contains("samples.parquet"), "{found}");
    let found = json(&done(at, "allan still.csv --units m/s2,rad/s --json -"));
    assert!(!found.to_string().contains("/still.csv"), "{found}");
}

#[test]
fn a_command_takes_the_options_of_the_import_for_a_log() {
    let folder = log();
    let at = folder.path();
    let text = std::fs::read_to_string(at.join("log.csv")).unwrap();
    let mut rows: Vec<&str> = text.lines().collect();
    let broken = rows[2000].replacen(',', ",?", 1);
    rows[2000] = &broken;
    std::fs::write(at.join("broken.csv"), rows.join("\n")).unwrap();
    let error = refused(at, "fit broken.csv --units m/s2,rad/s");
    assert!(error.ends_with("(--skip-broken)"), "{error}");
    let options = "broken.csv --units m/s2,rad/s --skip-broken=1 --rows ..6000 --device lab";
    done(at, &format!("import {options} --gravity 9.8 -o lab"));
    let of_log = json(&done(at, &format!("fit {options} --gravity 9.8 --json -")));
    let of_recording = json(&done(at, "fit lab --json -"));
    assert_eq!(of_log["sensors"], of_recording["sensors"]);
    assert_eq!(of_log["device"], "lab");
    // The command to complete is the one that was typed. A recording is put right by another import.
    let nameless: Vec<&str> = rows[1..300].to_vec();
    std::fs::write(
        at.join("names.csv"),
        format!("t,a,b,c,d,e,f\n{}", nameless.join("\n")),
    )
    .unwrap();
    let error = refused(at, "allan names.csv -o n.toml");
    says(&error, &["say it: mimu allan names.csv -o n.toml --"]);
}
