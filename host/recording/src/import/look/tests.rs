//! Heads and lines of logs as programs and people write them.

use super::*;

const SAMPLES: usize = 600;
const G: f64 = 9.80665;

/// Time in s, specific force in m/s² and rate in rad/s of a unit that rests for 2 s, turns about x by 0.6 rad/s for 2 s, and rests.
fn samples() -> Vec<(f64, [f64; 3], [f64; 3])> {
    let sample = |i: usize| {
        let t = 0.01 * i as f64;
        let angle = 0.6 * (t - 2.0).clamp(0.0, 2.0);
        let rate = if (2.0..4.0).contains(&t) { 0.6 } else { 0.0 };
        let noise = |c: usize| 1e-3 * ((7 * i * c + 13 * i) % 11) as f64 - 5e-3;
        let force = [
            noise(1),
            G * angle.sin() + noise(2),
            G * angle.cos() + noise(3),
        ];
        (
            t,
            force,
            [rate + 0.01 + noise(4) / 5.0, 0.02 + noise(5) / 5.0, -0.01],
        )
    };
    (0..SAMPLES).map(sample).collect()
}

fn joined(values: [f64; 3], factor: f64, between: &str) -> String {
    values.map(|v| format!("{:.5}", v * factor)).join(between)
}

/// Looks at a log with this head; `row` writes a sample.
fn look(head: &str, row: impl Fn(usize, f64, [f64; 3], [f64; 3]) -> String) -> Look {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.txt");
    let rows = samples().into_iter().enumerate();
    let rows: String = rows
        .map(|(i, (t, force, rate))| row(i, t, force, rate))
        .collect();
    std::fs::write(&path, format!("{head}{rows}")).unwrap();
    Look::at(&[path], None, &Given::default()).unwrap()
}

fn roles(look: &Look) -> Vec<&'static str> {
    let roles = look.files[0].guess.roles.iter();
    roles.copied().filter(|role| *role != "-").collect()
}

fn asked(look: &Look) -> String {
    let refusal = look.refusal(Path::new("log.txt"), "mimu import log.txt -o DIR");
    refusal.map_or(String::new(), |error| error.to_string())
}

const TIMED: [&str; 7] = [
    "t_s", "accel_x", "accel_y", "accel_z", "gyro_x", "gyro_y", "gyro_z",
];

#[test]
fn a_first_column_that_grows_evenly_is_the_time_under_any_name() {
    let named = |name: &str, per_s: f64| {
        look(
            &format!("{name},ax,ay,az,gx,gy,gz\n"),
            |_, t, force, rate| {
                let stamp = ((t + 3.0) * per_s).round();
                format!(
                    "{stamp},{},{}\n",
                    joined(force, 1.0, ","),
                    joined(rate, 1.0, ",")
                )
            },
        )
    };
    for (name, per_s, unit) in [
        ("ustime", 1e6, Some(Decimal::Microsecond)),
        ("tus", 1e6, Some(Decimal::Microsecond)),
        ("usec", 1e6, Some(Decimal::Microsecond)),
        ("msecs", 1e3, Some(Decimal::Millisecond)),
        ("tms", 1e3, Some(Decimal::Millisecond)),
        ("uptime_ms", 1e3, Some(Decimal::Millisecond)),
        ("boot_ms", 1e3, Some(Decimal::Millisecond)),
        ("uptime", 1e3, None),
        ("tick", 1e3, None),
        ("since_start", 1e3, None),
        ("czas", 1e6, None),
        ("时间", 1e3, None),
    ] {
        let look = named(name, per_s);
        assert_eq!(
            (roles(&look), look.time_unit()),
            (TIMED.to_vec(), unit),
            "{name}"
        );
        assert_eq!(asked(&look), "", "{name}");
        assert!(
            look.words()
                .contains(&format!("{name} grows evenly, so it is the time"))
        );
        assert_eq!(look.gyro.unwrap().unit, Some("rad/s"), "{name}");
    }
    // A million in a row are 1 kHz in nanoseconds, or 1 Hz in microseconds.
    let says = asked(&named("laufzeit", 1e8));
    let both = "in nanoseconds (ns) or microseconds (us)";
    assert!(
        says.contains(both) && says.contains("--time-unit UNIT"),
        "{says}"
    );
    // One by one it is a counter, and under the name of something else no time.
    assert!(asked(&named("tick", 100.0)).contains("counts the rows one by one"));
    let says = asked(&named("altitude in m", 1e3));
    assert!(
        says.contains("--columns 't_s=altitude in m,accel_x=ax"),
        "{says}"
    );
}

#[test]
fn units_behind_the_names_of_axes_and_rates_named_after_angles_are_understood() {
    #[rustfmt::skip]
    let cases = [
        ("ax_g,ay_g,az_g,gx_dps,gy_dps,gz_dps", 1.0 / G, 57.29578, ["g", "deg/s"]),
        ("Ax_mg,Ay_mg,Az_mg,Gx_mdps,Gy_mdps,Gz_mdps", 1e3 / G, 57_295.78, ["mg", "mdeg/s"]),
        ("acc_x,acc_y,acc_z,roll_rate,pitch_rate,yaw_rate", 1.0, 1.0, ["m/s²", "rad/s"]),
        ("xacc,yacc,zacc,rollspeed,pitchspeed,yawspeed", 1.0, 1.0, ["m/s²", "rad/s"]),
    ];
    for (names, accel, gyro, units) in cases {
        let look = look(&format!("t,{names}\n"), |_, t, force, rate| {
            format!(
                "{t},{},{}\n",
                joined(force, accel, ","),
                joined(rate, gyro, ",")
            )
        });
        assert_eq!(roles(&look), TIMED, "{names}");
        assert_eq!(asked(&look), "", "{names}");
        let found = [&look.accel, &look.gyro].map(|found| found.as_ref().and_then(|f| f.unit));
        assert_eq!(found, units.map(Some), "{names}");
    }
}

#[test]
fn three_columns_that_may_be_the_missing_sensor_are_asked_about_with_the_whole_answer() {
    for (names, answer) in [
        (
            "foo_x,foo_y,foo_z",
            "gyro_x=foo_x,gyro_y=foo_y,gyro_z=foo_z",
        ),
        ("Rx,Ry,Rz", "gyro_x=Rx,gyro_y=Ry,gyro_z=Rz"),
        (
            "wert x,wert y,wert z",
            "gyro_x=wert x,gyro_y=wert y,gyro_z=wert z'",
        ),
    ] {
        let look = look(&format!("t,ax,ay,az,{names}\n"), |_, t, force, rate| {
            format!(
                "{t},{},{}\n",
                joined(force, 1.0, ","),
                joined(rate, 1.0, ",")
            )
        });
        let says = asked(&look);
        assert!(
            says.contains("may be the gyro") && says.ends_with(answer),
            "{says}"
        );
        let list = says.split("--columns ").nth(1).unwrap().trim_matches('\'');
        assert_eq!(list.parse::<ColumnList>().unwrap().roles().len(), 7);
    }
}

#[test]
fn dumps_of_bags_and_of_data_frames_are_understood() {
    let covariance = "0.0,".repeat(9);
    let names = |of: &str, joint: &str| {
        (0..9)
            .map(|k| format!("{of}{joint}{k},"))
            .collect::<String>()
    };
    let fields = |before: &str, joint: &str| {
        let triad = |of: &str| {
            ["x", "y", "z"]
                .map(|axis| format!("{before}{of}.{axis},"))
                .concat()
        };
        let covariance = |of: &str| names(&format!("{before}{of}_covariance"), joint);
        let quaternion = ["x", "y", "z", "w"].map(|axis| format!("{before}orientation.{axis},"));
        let three =
            ["angular_velocity", "linear_acceleration"].map(|of| triad(of) + &covariance(of));
        (quaternion.concat() + &covariance("orientation") + &three.concat())
            .trim_end_matches(',')
            .to_owned()
    };
    let message = |force: [f64; 3], rate: [f64; 3]| {
        let [force, rate] = [force, rate].map(|values| joined(values, 1.0, ","));
        let all = format!("0,0,0,1,{covariance}{rate},{covariance}{force},{covariance}");
        all.trim_end_matches(',').to_owned()
    };
    let parts = |i: usize| ((90 + i) / 100 + 1_600_000_000, (90 + i) % 100 * 10_000_000);
    let bagpy = look(
        &format!(
            "Time,header.seq,header.stamp.secs,header.stamp.nsecs,header.frame_id,{}\n",
            fields("", "_")
        ),
        |i, t, force, rate| {
            let (s, ns) = parts(i);
            format!(
                "{:.4},{i},{s},{ns},imu,{}\n",
                1_600_000_000.901_3 + t,
                message(force, rate)
            )
        },
    );
    assert_eq!(roles(&bagpy)[..2], ["t_s", "t_ns"]);
    assert_eq!(bagpy.files[0].guess.roles[2], "t_s");
    let rostopic = look(
        &format!(
            "%time,field.header.seq,field.header.stamp,field.header.frame_id,{}\n",
            fields("field.", "")
        ),
        |i, _, force, rate| {
            let (s, ns) = parts(i);
            let stamp = s as u64 * 1_000_000_000 + ns as u64;
            format!("{stamp},{i},{stamp},imu,{}\n", message(force, rate))
        },
    );
    let frame = look(",time,ax,ay,az,gx,gy,gz\n", |i, t, force, rate| {
        format!(
            "{i},{t:.2},{},{}\n",
            joined(force, 1.0, ","),
            joined(rate, 1.0, ",")
        )
    });
    for (look, of) in [(bagpy, "bagpy"), (rostopic, "rostopic"), (frame, "pandas")] {
        let found = roles(&look);
        assert!(
            TIMED.iter().all(|role| found.contains(role)),
            "{of}: {found:?}"
        );
        assert_eq!(asked(&look), "", "{of}");
        let units = [&look.accel, &look.gyro].map(|found| found.as_ref().and_then(|f| f.unit));
        assert_eq!(units, [Some("m/s²"), Some("rad/s")], "{of}");
    }
}

#[test]
fn lines_with_labels_are_read_and_a_proposed_list_has_as_many_names_as_they_have_cells() {
    let counts = |values: [f64; 3], factor: f64| values.map(|v| (v * factor).round().to_string());
    type Write = fn(usize, f64, [f64; 3], [f64; 3]) -> String;
    #[rustfmt::skip]
    let lines: [(&str, Write); 4] = [
        ("esp", |i, _, f, w| { format!("I ({}) IMU: {} {}\n", 400 + 10 * i, joined(f, 1.0, ", "), joined(w, 1.0, " ")) }),
        ("json", |_, t, f, w| { format!("{{\"t\":{t:.2},\"acc\":[{}],\"gyro\":[{}]}}\n", joined(f, 1.0, ","), joined(w, 1.0, ",")) }),
        ("teleplot", |_, t, f, w| {
            let all = ["t", "ax", "ay", "az", "gx", "gy", "gz"]
                .into_iter()
                .zip([t].into_iter().chain(f).chain(w));
            all.map(|(name, value)| format!(">{name}:{value:.5}\n"))
                .collect()
        }),
        ("sentence", |_, t, f, w| {
            let text = format!(
                "PIMU,{t:.2},{},{}",
                joined(f, 1.0, ","),
                joined(w, 1.0, ",")
            );
            format!(
                "${text}*{:02X}\n",
                text.bytes().fold(0, |all, byte| all ^ byte)
            )
        }),
    ];
    for (of, line) in lines {
        let look = look("Starting ...\n", line);
        // Members of JSON come in the order of their names.
        let mut found = roles(&look);
        found.sort_by_key(|role| TIMED.iter().position(|timed| timed == role));
        assert_eq!(found, TIMED, "{of}");
        assert_eq!(asked(&look), "", "{of}");
    }
    let i2cdevlib = look("MPU6050 connection successful\n", |_, _, force, rate| {
        let [force, rate] = [counts(force, 16_384.0 / G), counts(rate, 7505.7)];
        format!("a/g:\t{}\t{}\n", force.join("\t"), rate.join("\t"))
    });
    assert_eq!(roles(&i2cdevlib), TIMED[1..]);
    let says = asked(&i2cdevlib);
    assert!(
        says.ends_with("no column is a time; say it: mimu import log.txt -o DIR --rate-hz RATE"),
        "{says}"
    );
    // Eight cells of which nobody knows what they are.
    let unknown = look("", |i, _, _, _| {
        format!("{} 1 2 3 4 5 6 {}\n", i % 7, i % 5)
    });
    let says = asked(&unknown);
    let list = says
        .split("--columns ")
        .nth(1)
        .unwrap()
        .split(' ')
        .next()
        .unwrap();
    assert_eq!(list.split(',').count(), 8, "{says}");
}

#[test]
fn a_date_beside_a_clock_needs_no_unit_and_a_clock_that_starts_again_no_end() {
    let day = look("", |i, _, force, rate| {
        let (minute, s) = if i < 300 {
            ("23:59", 57 + i / 100)
        } else {
            ("00:00", i / 100 - 3)
        };
        let clock = format!("{minute}:{s:02}.{:02}", i % 100);
        format!(
            "2024-03-04 {clock} {} {}\n",
            joined(force, 1.0, " "),
            joined(rate, 1.0, " ")
        )
    });
    assert_eq!((roles(&day), asked(&day)), (TIMED.to_vec(), String::new()));
    let restarted = look("millis,ax,ay,az,gx,gy,gz\n", |i, _, force, rate| {
        let again = if i == 150 {
            "MPU6050 ready\nmillis,ax,ay,az,gx,gy,gz\n"
        } else {
            ""
        };
        let stamp = 10 * if i < 150 { i + 9 } else { i - 148 };
        format!(
            "{again}{stamp},{},{}\n",
            joined(force, 1.0, ","),
            joined(rate, 1.0, ",")
        )
    });
    assert_eq!(restarted.gyro.unwrap().unit, Some("rad/s"));
}

/// As those of IMU-TK.
#[test]
fn two_files_with_the_names_of_their_sensors_need_no_names_of_columns() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, z: i32| {
        let row = |i: usize| format!("  {:.7e}  331{}  333  {z}\n", 0.01 * i as f64, i % 10);
        let path = folder.path().join(name);
        std::fs::write(&path, (0..60).map(row).collect::<String>()).unwrap();
        path
    };
    let files = [write("unit_acc.mat", 36_400), write("unit_gyro.mat", 500)];
    let given = Given {
        raw_unit: true,
        ..Given::default()
    };
    let look = Look::at(&files, None, &given).unwrap();
    assert_eq!(look.questions, []);
    assert_eq!(
        look.files[1].guess.roles,
        ["t_s", "gyro_x", "gyro_y", "gyro_z"]
    );
}

#[test]
fn units_are_found_for_given_columns_as_for_those_that_the_names_say() {
    let folder = tempfile::tempdir().unwrap();
    let write = |file: &str, row: &dyn Fn(f64, [f64; 3], [f64; 3]) -> String| {
        let path = folder.path().join(file);
        let rows = samples().into_iter().map(|(t, f, w)| row(t, f, w));
        std::fs::write(&path, rows.collect::<String>()).unwrap();
        path
    };
    let degrees = 1f64.to_degrees();
    let both = write("log.csv", &|t, f, w| {
        let head = if t == 0.0 { "when,a,b,c,d,e,f\n" } else { "" };
        let [force, rate] = [joined(f, 1.0 / G, ","), joined(w, degrees, ",")];
        format!("{head}{t:.2},{force},{rate}\n")
    });
    let one = |file: &str, force: bool| {
        write(file, &|t, f, w| {
            let values = if force {
                joined(f, 1.0 / G, ",")
            } else {
                joined(w, degrees, ",")
            };
            format!("{t:.2},{values}\n")
        })
    };
    let apart = [one("1.csv", true), one("2.csv", false)];
    let [force, rate] = ["accel_x,accel_y,accel_z", "gyro_x,gyro_y,gyro_z"];
    let by_name = "t_s=when,accel_x=a,accel_y=b,accel_z=c,gyro_x=d,gyro_y=e,gyro_z=f".to_owned();
    let look = |files: &[PathBuf], columns: &[String]| {
        let columns: Vec<ColumnList> = columns.iter().map(|list| list.parse().unwrap()).collect();
        Look::with_columns(files, &columns, None, &Given::default()).unwrap()
    };
    let each = [format!("t_s,{force}"), format!("t_s,{rate}")];
    for (files, columns) in [
        (std::slice::from_ref(&both), vec![by_name]),
        (
            std::slice::from_ref(&both),
            vec![format!("t_s,{force},{rate}")],
        ),
        (&apart[..], each.to_vec()),
    ] {
        let look = look(files, &columns);
        let units = [&look.accel, &look.gyro].map(|found| found.as_ref().and_then(|f| f.unit));
        assert_eq!(units, [Some("g"), Some("deg/s")], "{columns:?}");
        assert_eq!(
            (asked(&look), look.raw_unit),
            (String::new(), Some(RawUnit::Si))
        );
        assert_eq!(look.scales.len(), 2, "{columns:?}");
    }
    // Rows without a time show no turn, so that a person has to say the gyro's unit.
    let open = look(&[both], &[format!("-,{force},{rate}")]);
    let says = asked(&open);
    assert!(
        says.ends_with("mimu import log.txt -o DIR --units GYRO_UNIT"),
        "{says}"
    );
    let magnetometer = look(&apart[..1], &["t_s,mag_x,mag_y,mag_z".to_owned()]);
    assert_eq!(magnetometer.raw_unit, None);
}

#[test]
fn without_names_the_triad_of_steady_magnitude_is_the_accelerometer_and_a_third_may_be_a_field() {
    // A gyro that turns by 34 deg/s and more reads larger numbers than an accelerometer in g, or than one in coarse counts.
    let write = |counts: f64| {
        look("", move |i, t, f, w| {
            let fast = if (200..400).contains(&i) { 60.0 } else { 1.0 };
            let field = [120.0 + (i % 3) as f64, -30.0, 200.0];
            let force = joined(f.map(|v| (v * counts / G * 1e3).round() / 1e3), 1.0, ",");
            let rate = joined(w.map(|v| v.to_degrees() * fast * counts), 1.0, ",");
            format!("{t:.2},{force},{rate},{}\n", joined(field, 1.0, ","))
        })
    };
    let in_g = write(1.0);
    assert_eq!(roles(&in_g), TIMED);
    assert_eq!(in_g.accel.as_ref().and_then(|found| found.unit), Some("g"));
    let unknown = write(2.5);
    let says = asked(&unknown);
    let list = TIMED.join(",") + ",mag_x,mag_y,mag_z";
    assert!(says.contains(&format!("--columns {list} ")), "{says}");
    assert!(
        says.contains("the usual magnitude of specific force is 2.5"),
        "{says}"
    );
}
