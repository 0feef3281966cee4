//! The output of a board, as the page shows it before a session begins: the numbers of its lines, and their guessed roles.

use std::path::Path;

use mimu_recording::error::{Error, Result};
use mimu_recording::labelled::Line;
use serde::Serialize;

use mimu_recording::Decimal;
use mimu_recording::look::{Guess, Units, guess};

/// Last lines that are examined; earlier ones may be a greeting.
const LOOKED_AT: usize = 200;
/// Lines that are shown.
const SHOWN: usize = 3;

/// The lines of a board.
#[derive(Debug, Serialize, PartialEq, Default)]
pub struct Lines {
    /// The last ones as they came.
    shown: Vec<String>,
    /// Names of the numbers in the line, if it has any.
    names: Vec<String>,
    /// The numbers of the last lines.
    rows: Vec<Vec<f64>>,
    /// Role of each number for `mimu wizard --text`.
    columns: Vec<&'static str>,
    /// Whether the roles follow from the readings alone.
    by_readings: bool,
    /// Whether the readings are in SI; `None` if one sensor's are, and those of the other may be.
    si: Option<bool>,
}

/// The unit of a clock, from its progress in a second. A replay may be tens of times faster than the board was.
fn clock(per_second: f64) -> &'static str {
    match per_second.log10() {
        e if e < 2.0 => "t_s",
        e if e < 5.0 => "t_ms",
        _ => "t_us",
    }
}

/// Interprets the lines in `file`, which came within `seconds`.
pub fn of(file: &Path, seconds: f64) -> Result<Lines> {
    let bytes = std::fs::read(file).map_err(|error| Error::io(file, &error))?;
    Ok(look(&String::from_utf8_lossy(&bytes), seconds))
}

fn look(text: &str, seconds: f64) -> Lines {
    let mut lines: Vec<&str> = text.split(['\n', '\r']).map(str::trim).collect();
    // The last line is incomplete, and the first may be cut.
    lines.pop();
    lines.retain(|line| !line.is_empty());
    let all = lines.len();
    let header = lines[..all.saturating_sub(1)].iter().find_map(|line| {
        let words: Vec<&str> = line.split([',', ';', '\t']).map(str::trim).collect();
        let is = words.len() > 5 && words.iter().all(|w| w.parse::<f64>().is_err());
        is.then_some(words)
    });
    let lines = &lines[all.saturating_sub(LOOKED_AT).max(usize::from(all > 1))..];
    let shown = lines[lines.len().saturating_sub(SHOWN)..].iter();
    let mut found = Lines {
        shown: shown.map(|line| line.chars().take(120).collect()).collect(),
        ..Lines::default()
    };
    let parsed = lines.iter().filter_map(|line| Line::parse(line));
    let read: Vec<(Line, Vec<f64>)> = parsed
        .filter_map(|line| line.values(false).map(|numbers| (line, numbers)))
        .filter(|(_, numbers)| numbers.len() > 5)
        .collect();
    // MotionCal's boards also write the same readings in SI, in alternate lines.
    let raw = read.iter().any(|(line, _)| line.labels() == "Raw");
    let of_data = |(line, _): &&(Line, Vec<f64>)| !raw || line.labels() == "Raw";
    let Some((line, first)) = read.iter().rev().find(of_data) else {
        return found;
    };
    let like = read.iter().filter(of_data);
    let rows: Vec<Vec<f64>> = like
        .map(|(_, numbers)| numbers.clone())
        .filter(|numbers| numbers.len() == first.len())
        .collect();
    let header = header.filter(|words| words.len() == first.len());
    found.names = match line.names() {
        Some(names) => names,
        None => header
            .unwrap_or_default()
            .into_iter()
            .map(str::to_owned)
            .collect(),
    };
    let guessed = match raw {
        true => Guess {
            roles: vec![
                "accel_x", "accel_y", "accel_z", "gyro_x", "gyro_y", "gyro_z", "mag_x", "mag_y",
                "mag_z",
            ],
            ..Guess::default()
        },
        false => guess("board", &found.names, &[], &rows, None),
    };
    let column = |(at, role): (usize, &&'static str)| match *role {
        "accel_x" => "ax",
        "accel_y" => "ay",
        "accel_z" => "az",
        "gyro_x" => "gx",
        "gyro_y" => "gy",
        "gyro_z" => "gz",
        "mag_x" => "mx",
        "mag_y" => "my",
        "mag_z" => "mz",
        "temp_c" => "temp_c",
        "t_s" => match guessed.time_unit {
            Some(Decimal::Microsecond) => "t_us",
            Some(Decimal::Millisecond) => "t_ms",
            Some(Decimal::Second) => "t_s",
            _ => clock((rows[rows.len() - 1][at] - rows[0][at]) / seconds),
        },
        _ => "-",
    };
    found.columns = guessed.roles.iter().enumerate().map(column).collect();
    found.by_readings = guessed.by_readings;
    found.si = match Units::of(&[&guessed], std::slice::from_ref(&rows)).known() {
        [Some("rad/s"), Some("m/s²")] => Some(true),
        [None, Some("m/s²")] => None,
        _ => Some(false),
    };
    found.rows = rows[rows.len().saturating_sub(SHOWN)..].to_vec();
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lines of a board at rest with z up, 100 a second.
    fn lines(line: impl Fn(usize) -> String) -> String {
        let all = (0..300).map(|k| line(k) + "\r\n");
        format!("ut\r\nMPU6050 OK\r\n{}half", all.collect::<String>())
    }

    #[test]
    fn a_line_without_names_is_taken_by_its_readings_and_its_clock_by_how_far_it_goes() {
        for (per_second, is) in [(1e6, "t_us"), (1e3, "t_ms"), (1.0, "t_s")] {
            let text = lines(|k| {
                format!(
                    "{},{},9,16384,-3,{},2",
                    k as f64 * per_second / 100.0,
                    k % 3,
                    k % 2
                )
            });
            let found = look(&text, 3.0);
            assert_eq!(found.columns, [is, "ax", "ay", "az", "gx", "gy", "gz"]);
            assert!(found.by_readings);
            assert_eq!(found.shown.len(), 3);
        }
    }

    #[test]
    fn names_are_those_of_the_labels_or_of_the_header() {
        let labelled = lines(|k| format!("gx:{},gy:2,gz:3,ax:0,ay:0,az:4096,temp:25.5", k % 3));
        let found = look(&labelled, 3.0);
        assert_eq!(
            found.columns,
            ["gx", "gy", "gz", "ax", "ay", "az", "temp_c"]
        );
        let tabs = lines(|k| format!("{}\t1\t2\t{}\t0\t0\t4096", 10 * k, k % 2));
        let tabs = tabs.replace("MPU6050 OK", "time_ms\tgx\tgy\tgz\tax\tay\taz");
        let found = look(&tabs, 3.0);
        assert_eq!(found.columns, ["t_ms", "gx", "gy", "gz", "ax", "ay", "az"]);
        assert!(!found.by_readings);
        let compass = lines(|k| format!("1,2,{},0,0,4096,9,8,-{k}", k % 2));
        let compass = compass.replace("MPU6050 OK", "gx,gy,gz,ax,ay,az,mx,my,mz");
        let found = look(&compass, 3.0);
        assert_eq!(found.columns[6..], ["mx", "my", "mz"]);
    }

    #[test]
    fn motion_cal_is_known_by_its_label() {
        let text = lines(|k| match k % 2 {
            0 => "Raw:10,20,8192,1,2,3,400,500,600".into(),
            _ => "Uni:0.01,0.02,9.8,0.1,0.2,0.3,40,50,60".into(),
        });
        let found = look(&text, 3.0);
        assert_eq!(
            found.columns,
            ["ax", "ay", "az", "gx", "gy", "gz", "mx", "my", "mz"]
        );
        assert_eq!(found.rows[0][2], 8192.0);
    }

    #[test]
    fn garbage_has_no_columns_and_is_shown() {
        let found = look("\u{fffd}x\u{fffd}\n\u{7f}~}\n\u{fffd}1,2\n", 3.0);
        assert!(found.columns.is_empty());
        assert!(!found.shown.is_empty());
    }
}
