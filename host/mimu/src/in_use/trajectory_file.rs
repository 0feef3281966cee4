//! A trajectory as other programs write it: EuRoC's ground truth, the format of TUM's benchmarks, or any table with these columns.

use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::estimates::Smoothed;
use mimu_recording::{Error, Result, read_text};

/// Attitude (body to the frame of the reference) and position, m, at an instant.
#[derive(Debug, Clone, Copy)]
pub struct Pose {
    /// Time, s.
    pub t_s: f64,
    /// Body to reference.
    pub attitude: UnitQuaternion<f64>,
    /// In the frame of the reference, m.
    pub position: Vector3<f64>,
}

/// Poses of the unit by another instrument, in order of time.
#[derive(Debug, Clone)]
pub struct Trajectory {
    pub(super) poses: Vec<Pose>,
    pub(super) has_positions: bool,
    /// Its file, for messages.
    pub place: String,
}

/// Times and columns of a file.
struct Layout {
    seconds: f64,
    /// Time, then w x y z.
    attitude: [usize; 5],
    position: Option<[usize; 3]>,
}

/// Columns of a file of TUM's benchmarks, which has no names: time, position, quaternion x y z w.
const TUM: Layout = Layout {
    seconds: 1.0,
    attitude: [0, 7, 4, 5, 6],
    position: Some([1, 2, 3]),
};

impl Trajectory {
    /// Reads a file: comma, semicolon or blanks between cells; `#` begins a comment, of which the last before the numbers may name the columns.
    ///
    /// With names, the time is the first column, in ns if its name has `ns` or the numbers are stamps of 1970 in ns; the attitude is `q..._w, x, y, z`, the
    /// position `p..._x, y, z`. Without names it is TUM's: time (s), position, quaternion x y z w.
    ///
    /// # Errors
    /// The file cannot be read; a row lacks cells; a quaternion is none; time goes back; fewer than ten poses.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(&read_text(path)?, &path.display().to_string())
    }

    /// Parses the text of a file; `place` is its path.
    ///
    /// # Errors
    /// Those of [`Self::read`].
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        let mut names: Option<Vec<String>> = None;
        let mut layout: Option<Layout> = None;
        let mut poses: Vec<Pose> = Vec::new();
        for (row, line) in text.lines().enumerate() {
            let cells = cells(line);
            let first = cells.first().copied().unwrap_or("");
            if first.parse::<f64>().is_err() {
                if cells.len() >= 5 {
                    names = Some(cells.iter().map(|c| c.to_lowercase()).collect());
                }
                continue;
            }
            let at = format!("{place}, row {}", row + 1);
            let layout = match &layout {
                Some(known) => known,
                None => layout.insert(Layout::of(names.as_deref(), first, &at)?),
            };
            poses.push(layout.pose(&cells, &at)?);
            if let [.., before, last] = poses[..]
                && last.t_s <= before.t_s
            {
                let problem = format!("time goes back from {} s to {} s", before.t_s, last.t_s);
                return Err(Error::new(at, problem, "sort the rows by time"));
            }
        }
        if poses.len() < 10 {
            let problem = format!("{} poses, and at least 10 are needed", poses.len());
            let remedy = "give a trajectory: time, position and quaternion in each row";
            return Err(Error::new(place, problem, remedy));
        }
        Ok(Self {
            poses,
            has_positions: layout.is_some_and(|l| l.position.is_some()),
            place: place.to_owned(),
        })
    }

    /// Its poses.
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// Whether it has positions beside attitudes.
    pub fn has_positions(&self) -> bool {
        self.has_positions
    }

    /// The same with its times counted from `zero_s`.
    pub fn counted_from(mut self, zero_s: f64) -> Self {
        for pose in &mut self.poses {
            pose.t_s -= zero_s;
        }
        self
    }

    /// The same for the unit, by the clock of the recording, if the reference is mounted and timed as `about`.
    pub(super) fn of_unit(&self, about: &Smoothed) -> Self {
        let turned = UnitQuaternion::from_scaled_axis(-about.mounting());
        let of = |pose: &Pose| Pose {
            t_s: pose.t_s + about.clock_s(),
            attitude: pose.attitude * turned,
            position: pose.position,
        };
        Self {
            poses: self.poses.iter().map(of).collect(),
            ..self.clone()
        }
    }

    /// Velocity at a pose, by those before and after it, m/s.
    pub(super) fn velocity_at(&self, pose: &Pose) -> Vector3<f64> {
        let own = self.poses.partition_point(|p| p.t_s < pose.t_s);
        let (a, b) = (own.saturating_sub(1), (own + 1).min(self.poses.len() - 1));
        let (a, b) = (&self.poses[a], &self.poses[b]);
        (b.position - a.position) / (b.t_s - a.t_s)
    }
}

fn cells(line: &str) -> Vec<&str> {
    let line = line.trim().trim_start_matches('#').trim();
    let split: Vec<&str> = match line.contains([',', ';']) {
        true => line.split([',', ';']).map(str::trim).collect(),
        false => line.split_whitespace().collect(),
    };
    split
}

impl Layout {
    fn of(names: Option<&[String]>, first: &str, at: &str) -> Result<Self> {
        // Stamps of ten digits are seconds since 1970.
        let long = first.split('.').next().unwrap_or("").len() >= 16;
        let seconds = if long { 1e-9 } else { 1.0 };
        let Some(names) = names else {
            return Ok(Self { seconds, ..TUM });
        };
        // EuRoC: q_RS_w [], p_RS_R_x [m]; others: qw, q_w, px, tx.
        let find = |heads: &[&str], axis: char| {
            names.iter().position(|name| {
                let bare = name.split('[').next().unwrap_or("").trim();
                heads.iter().any(|head| bare.starts_with(head)) && bare.ends_with(axis)
            })
        };
        let quaternion = ['w', 'x', 'y', 'z'].map(|axis| find(&["q"], axis));
        let position = ['x', 'y', 'z'].map(|axis| find(&["p", "t"], axis));
        let [Some(w), Some(x), Some(y), Some(z)] = quaternion else {
            let problem = format!("no quaternion among the columns {}", names.join(", "));
            let remedy = "name its columns qw, qx, qy, qz; the position's px, py, pz";
            return Err(Error::new(at, problem, remedy));
        };
        let in_ns = long || names[0].contains("ns");
        Ok(Self {
            seconds: if in_ns { 1e-9 } else { 1.0 },
            attitude: [0, w, x, y, z],
            position: match position {
                [Some(x), Some(y), Some(z)] => Some([x, y, z]),
                _ => None,
            },
        })
    }

    fn pose(&self, cells: &[&str], at: &str) -> Result<Pose> {
        let number = |k: usize| -> Result<f64> {
            let value = cells.get(k).and_then(|c| c.parse::<f64>().ok());
            value.filter(|v| v.is_finite()).ok_or_else(|| {
                let problem = format!("column {} has no number", k + 1);
                Error::new(at, problem, "complete the row, or remove it")
            })
        };
        let [t, w, x, y, z] = self.attitude;
        let q = Quaternion::new(number(w)?, number(x)?, number(y)?, number(z)?);
        let norm = q.norm();
        if !(0.9..1.1).contains(&norm) {
            let problem = format!("a quaternion of magnitude {norm:.3}");
            return Err(Error::new(at, problem, "check the order of the columns"));
        }
        let position = match self.position {
            Some([x, y, z]) => Vector3::new(number(x)?, number(y)?, number(z)?),
            None => Vector3::zeros(),
        };
        Ok(Pose {
            t_s: number(t)? * self.seconds,
            attitude: UnitQuaternion::from_quaternion(q),
            position,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(line: impl Fn(usize) -> String) -> String {
        (0..12).map(line).collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn ground_truth_of_euroc_and_of_tum_is_the_same_trajectory() {
        let euroc = "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], v_RS_R_x [m s^-1]\n".to_owned()
            + &rows(|k| format!("14037152732{k:02}000000,0.5,2.1,{k},0.8,0.6,0,0,9"));
        let tum = "# timestamp tx ty tz qx qy qz qw\n".to_owned()
            + &rows(|k| format!("1403715273.2{k:02} 0.5 2.1 {k} 0.6 0 0 0.8"));
        let [a, b] = [euroc, tum].map(|text| Trajectory::parse(&text, "truth").unwrap());
        assert!(a.has_positions && b.has_positions);
        for (a, b) in a.poses.iter().zip(&b.poses) {
            assert!((a.t_s - b.t_s).abs() < 1e-4, "{} {}", a.t_s, b.t_s);
            assert!(a.attitude.angle_to(&b.attitude) < 1e-9);
            assert!((a.position - b.position).norm() < 1e-9);
        }
        let near = a.counted_from(1_403_715_273.0).poses[0].t_s;
        assert!((near - 0.2).abs() < 1e-4, "{near}");
    }

    #[test]
    fn a_row_that_is_no_pose_is_named() {
        let text = rows(|k| format!("{k} 0 0 0 0 0 0 {}", if k == 7 { 3 } else { 1 }));
        let refused = Trajectory::parse(&text, "truth").unwrap_err().to_string();
        assert!(
            refused.contains("row 8") && refused.contains("magnitude 3"),
            "{refused}"
        );
    }
}
