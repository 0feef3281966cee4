//! Files that follow one another, one for each pose.

use super::*;

/// Twenty rows of a unit at rest that reads `force` counts along z, by a clock that begins at `from_us`.
fn pose(from_us: u64, force: i32) -> String {
    let row = |i: u64| format!("{},1,2,3,4,5,{force}\n", from_us + 10_000 * i);
    format!("us,a,b,c,d,e,f\n{}", (0..20).map(row).collect::<String>())
}

const LIST: &str = "t_s=us,gyro_x=a,gyro_y=b,gyro_z=c,accel_x=d,accel_y=e,accel_z=f";

fn six_faces() -> (Bench, ImportOptions) {
    // The clock of the second restarts; that of the third is a minute after the first.
    let files = [pose(500_000, 800), pose(0, -800), pose(60_000_000, 10)];
    let inputs = "step,ref_force_z_mps2\nz_up,9.81\nz_down,-9.81\nz_gone,0\n";
    let bench = Bench::new(&[
        ("z_up.csv", &files[0]),
        ("z_down.csv", &files[1]),
        ("level.csv", &files[2]),
        ("inputs", inputs),
    ]);
    let mut options = bench.options(&["z_up.csv", "z_down.csv", "level.csv"], &[LIST]);
    options.sequence = true;
    options.reference = Reference::Table;
    options.log.inputs = Some(bench.path("inputs"));
    (bench, options)
}

#[test]
fn each_file_is_a_step_with_the_input_of_its_name_and_no_time_is_shared() {
    let (bench, options) = six_faces();
    let (summary, batch, manifest) = bench.import(&options).unwrap();
    assert_eq!(manifest.step_labels, ["z_up", "z_down", "level"]);
    assert_eq!(manifest.sources.len(), 4);
    assert_eq!((summary.rows, summary.time.len()), (60, 3));
    let steps: Vec<i32> = (0..60).map(|i| i / 20).collect();
    assert_eq!(batch.step, steps);
    assert!(batch.t_s.windows(2).all(|w| w[1] > w[0]), "{:?}", batch.t_s);
    assert!((batch.t_s[0] - 0.5).abs() < 1e-9 && (batch.t_s[40] - 60.0).abs() < 1e-9);
    assert!(batch.t_s[20] - batch.t_s[19] > 9.0);
    let force = &batch.reference[5];
    assert_eq!([force[0], force[20]], [9.81, -9.81]);
    assert!(force[40].is_nan());
    let said = |words: &str| summary.warnings.iter().any(|w| w.contains(words));
    assert!(said("unknown: \"level\"") && said("z_gone"), "{summary:?}");
    assert!(!said("z_down"), "{summary:?}");
    assert!(manifest.imported_with.contains(&"--sequence".to_owned()));
}

#[test]
fn files_that_are_no_sequence_are_refused() {
    let (bench, mut options) = six_faces();
    std::fs::write(bench.path("level.csv"), pose(0, 1).replace("us,", "ms,")).unwrap();
    assert!(bench.refused(&options).contains("\"us\""));
    let fast = |text: String| -> String {
        let row = |(i, line): (usize, &str)| match i {
            0 => format!("{line}\n"),
            _ => format!("{},{}\n", 4_000 * i, line.split_once(',').unwrap().1),
        };
        text.lines().enumerate().map(row).collect()
    };
    std::fs::write(bench.path("level.csv"), fast(pose(0, 1))).unwrap();
    let error = bench.refused(&options);
    says(&error, &["250 Hz", "level.csv"]);
    options.files = ["z_up.csv", "z_up.csv"]
        .map(|name| bench.path(name))
        .to_vec();
    says(&bench.refused(&options), &["two files have the name z_up"]);
}

fn faces(names: &[&str]) -> Vec<Face> {
    names.iter().map(|name| name.parse().unwrap()).collect()
}

#[test]
fn a_file_for_each_face_has_the_specific_force_of_the_axis_that_was_up() {
    let bench = Bench::new(&[
        ("a.csv", &pose(0, 800)),
        ("b.csv", &pose(0, -800)),
        ("c.csv", &pose(0, 10)),
    ]);
    let mut options = bench.options(&["a.csv", "b.csv", "c.csv"], &[LIST]);
    options.faces = faces(&["+z", "-z", "-y"]);
    options.reference = Reference::Table;
    let (summary, batch, manifest) = bench.import(&options).unwrap();
    assert_eq!(manifest.step_labels, ["+z", "-z", "-y"]);
    // The turns from face to face are unknown: neither a rate nor a turn may enter a fit.
    assert!(manifest.turn_steps.is_empty());
    assert!(batch.reference[..3].iter().all(Vec::is_empty));
    assert!(batch.t_s[20] - batch.t_s[19] > 9.0);
    let force = |row: usize| [3, 4, 5].map(|i| batch.reference[i][row]);
    assert_eq!(force(0), [0.0, 0.0, 9.81]);
    assert_eq!(force(20), [0.0, 0.0, -9.81]);
    assert_eq!(force(59), [0.0, -9.81, 0.0]);
    let said = |words: &str| summary.warnings.iter().any(|w| w.contains(words));
    assert!(
        said("+x, -x, +y have") && said("does not determine its scale factors"),
        "{summary:?}"
    );
    let with = manifest.imported_with.join(" ");
    assert!(
        with.starts_with("--faces +z=a.csv -z=b.csv -y=c.csv --columns"),
        "{with}"
    );
}

#[test]
fn faces_that_contradict_each_other_are_refused() {
    let bench = Bench::new(&[
        ("a.csv", &pose(0, 800)),
        ("b.csv", &pose(0, -800)),
        ("inputs", ""),
    ]);
    let mut options = bench.options(&["a.csv", "b.csv"], &[LIST]);
    options.faces = faces(&["+z", "+z"]);
    says(&bench.refused(&options), &["the face +z is given twice"]);
    options.faces = faces(&["+z"]);
    assert!(bench.refused(&options).contains("2 files but 1 faces"));
    options.faces = faces(&["+z", "-z"]);
    options.log.inputs = Some(bench.path("inputs"));
    says(&bench.refused(&options), &["a table of inputs is given"]);
}
