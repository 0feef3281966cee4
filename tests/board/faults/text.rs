//! A board of another maker in the hands of a person who follows the requests: lines of text over TCP, in virtual time that is faster than the wall
//! clock. Its physics are independent of the bench and of the program.

use std::io::Write as _;
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::stored::{Forward, Truth};

type Vector = [f64; 3];
type Matrix = [[f64; 3]; 3];

pub const GRAVITY: f64 = 9.793;
const RATE_HZ: f64 = 100.0;
/// Virtual time over wall-clock time.
const SPEED: f64 = 20.0;
/// Delay from a requested step to the motion of the hand, s.
const REACTION_S: f64 = 0.6;

/// If no new step comes for this long, the person tries another pose, s.
const PUZZLED_S: f64 = 40.0;

/// A board and its faults.
#[derive(Clone, Debug)]
pub struct TextBoard {
    pub truth: Truth,
    /// Standard deviation of a sample, gyro and accelerometer, raw.
    pub noise: [f64; 2],
    /// Quantisation steps, gyro and accelerometer.
    pub steps: [f64; 2],
    /// What the axis of each name reads: gyro and accelerometer.
    pub wired: [Matrix; 2],
    /// Cubic error of the accelerometer, as a fraction of its reading at gravity.
    pub cubic: f64,
    /// Unit of its stamps, s.
    pub stamps_s: f64,
    /// Share of the lines that are lost.
    pub lost: f64,
    /// Time of the one line in which a number becomes 1.4e99, s.
    pub garbled_s: Option<f64>,
    pub speed: f64,
}

pub const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Pseudo-random numbers.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5851_f42d_4c95_7f2d)
    }

    /// Uniform from 0 to 1 (splitmix64).
    pub fn even(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.even()).ln()).sqrt() * (std::f64::consts::TAU * self.even()).cos()
    }
}

impl TextBoard {
    /// An ordinary board: scale factors within 2 %, axes within a degree, the noise and counts of an MPU-6050.
    pub fn new(seed: u64) -> Self {
        let mut random = Random::new(seed);
        let mut triad = |scale: f64, bias: f64| Forward {
            matrix: [0, 1, 2].map(|i| {
                [0, 1, 2].map(|j| scale * (f64::from(u8::from(i == j)) + 0.012 * random.normal()))
            }),
            bias: [0.0; 3].map(|_| bias * random.normal()),
        };
        let gyro = triad(3754.9, 120.0);
        let accel = triad(1670.1, 450.0);
        Self {
            truth: Truth {
                triads: [gyro, accel],
                by_hand: true,
            },
            noise: [5.0, 45.0],
            steps: [1.0; 2],
            wired: [IDENTITY; 2],
            cubic: 0.0,
            stamps_s: 1e-6,
            lost: 0.0,
            garbled_s: None,
            speed: SPEED,
        }
    }

    fn line(&self, t_s: f64, rate: Vector, force: Vector, random: &mut Random) -> String {
        let mut numbers = Vec::new();
        // In the order of the lines: accelerometer, gyro.
        for k in [1, 0] {
            let input = [rate, force][k];
            let Forward { matrix, bias } = &self.truth.triads[k];
            let own: Vector = std::array::from_fn(|i| {
                let x: f64 = (0..3).map(|j| matrix[i][j] * input[j]).sum();
                let full = matrix[i][i] * GRAVITY;
                let cubic = if k == 1 {
                    self.cubic * full * (x / full).powi(3)
                } else {
                    0.0
                };
                x + cubic + bias[i] + self.noise[k] * random.normal()
            });
            for row in &self.wired[k] {
                let read: f64 = row.iter().zip(&own).map(|(a, b)| a * b).sum();
                let step = self.steps[k];
                numbers.push(if step > 0.0 {
                    (read / step).round() * step
                } else {
                    read
                });
            }
        }
        if self
            .garbled_s
            .is_some_and(|at| (t_s - at).abs() < 0.4 / RATE_HZ)
        {
            numbers[2] = 1.4e99;
        }
        let stamp = (t_s / self.stamps_s).round();
        let numbers: Vec<String> = numbers.iter().map(f64::to_string).collect();
        format!("{stamp},{}\r\n", numbers.join(","))
    }
}

fn times(m: &Matrix, v: Vector) -> Vector {
    m.map(|row| row.iter().zip(&v).map(|(a, b)| a * b).sum())
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    a.map(|row| [0, 1, 2].map(|j| (0..3).map(|k| row[k] * b[k][j]).sum()))
}

fn transposed(m: &Matrix) -> Matrix {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[j][i]))
}

/// Rotation by a rotation vector (Rodrigues).
fn rotation(v: Vector) -> Matrix {
    let angle = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let (s, c) = match angle < 1e-9 {
        true => (1.0, 0.5),
        false => (angle.sin() / angle, (1.0 - angle.cos()) / (angle * angle)),
    };
    let k = [[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]];
    let kk = product(&k, &k);
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| f64::from(u8::from(i == j)) + s * k[i][j] + c * kk[i][j]))
}

/// A turn by hand, from rest to rest, along one rotation vector in the body frame.
struct Turn {
    from: Matrix,
    by: Vector,
    begin_s: f64,
    lasts_s: f64,
}

impl Turn {
    /// From the attitude `from` (body to world) to one in which `up` of the body points up, to the accuracy of a hand.
    fn to(from: Matrix, up: Vector, begin_s: f64, random: &mut Random) -> Self {
        let held: Vector = std::array::from_fn(|i| up[i] + 0.04 * random.normal());
        let size = held.iter().map(|x| x * x).sum::<f64>().sqrt();
        let held = held.map(|x| x / size);
        let now = from[2];
        let axis = [0, 1, 2]
            .map(|i| held[(i + 1) % 3] * now[(i + 2) % 3] - held[(i + 2) % 3] * now[(i + 1) % 3]);
        let sine = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
        let cosine: f64 = held.iter().zip(&now).map(|(a, b)| a * b).sum();
        let angle = sine.atan2(cosine);
        // For a half turn any perpendicular axis will do.
        let axis = match sine > 1e-3 {
            true => axis.map(|x| x / sine),
            false if held[0].abs() < 0.7 => unit([0.0, -held[2], held[1]]),
            false => unit([held[2], 0.0, -held[0]]),
        };
        Self {
            from,
            by: axis.map(|x| x * angle),
            begin_s,
            lasts_s: 1.2 + 0.8 * angle + 0.5 * random.even(),
        }
    }

    /// Completed fraction of the way, and its rate of change, 1/s: a quintic without jerk at its ends.
    fn share(&self, t_s: f64) -> [f64; 2] {
        let x = ((t_s - self.begin_s) / self.lasts_s).clamp(0.0, 1.0);
        let done = x * x * x * (10.0 - 15.0 * x + 6.0 * x * x);
        let rate = 30.0 * x * x * (1.0 - x) * (1.0 - x) / self.lasts_s;
        [done, rate]
    }
}

fn unit(v: Vector) -> Vector {
    let size = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    v.map(|x| x / size)
}

/// Number of requested steps, and the direction of the last.
fn asked(events: &Path) -> (usize, Option<Vector>) {
    let text = std::fs::read_to_string(events).unwrap_or_default();
    let steps = text
        .lines()
        .filter(|l| l.starts_with("{\"event\":\"step\""));
    let last = steps
        .clone()
        .next_back()
        .and_then(|l| serde_json::from_str::<Value>(l).ok());
    let up = last.and_then(|e| {
        let all: Vec<f64> = e["step"]["up"]
            .as_array()?
            .iter()
            .filter_map(Value::as_f64)
            .collect();
        all.try_into().ok()
    });
    (steps.count(), up)
}

/// A board that writes lines until it is dropped.
pub struct Writing {
    pub port: String,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Writing {
    pub fn begin(board: TextBoard, seed: u64, events: PathBuf) -> Result<Self, String> {
        let listener = TcpListener::bind("127.0.0.1:0").map_err(|e| e.to_string())?;
        let port = format!(
            "tcp://{}",
            listener.local_addr().map_err(|e| e.to_string())?
        );
        listener.set_nonblocking(true).map_err(|e| e.to_string())?;
        let end = Arc::new(AtomicBool::new(false));
        let ended = end.clone();
        let thread = std::thread::spawn(move || write(&board, seed, &events, &listener, &ended));
        Ok(Self {
            port,
            end,
            thread: Some(thread),
        })
    }
}

impl Drop for Writing {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn write(board: &TextBoard, seed: u64, events: &Path, listener: &TcpListener, end: &AtomicBool) {
    let mut random = Random::new(seed ^ 0xb0a7);
    let mut line: Option<TcpStream> = None;
    let mut attitude = rotation([0.9, -0.4, 0.3]);
    let (mut turn, mut begun): (Option<Turn>, usize) = (None, 0);
    let mut k = 0_u64;
    let mut due: Option<(usize, f64)> = None;
    let mut turned_s = 0.0;
    let began = Instant::now();
    while !end.load(Ordering::Relaxed) {
        std::thread::sleep(Duration::from_millis(10));
        if let Ok((stream, _)) = listener.accept() {
            let _ = stream.set_nodelay(true);
            line = Some(stream);
        }
        let (count, up) = asked(events);
        let now_s = board.speed * began.elapsed().as_secs_f64();
        // When the command is started again, it rewrites its file of events.
        if count < begun {
            begun = 0;
        }
        if count > begun && due.is_none() {
            due = Some((count, now_s + REACTION_S));
        }
        if let (Some((count, at)), Some(up), true) = (due, up, turn.is_none())
            && now_s > at
        {
            turn = Some(Turn::to(attitude, up, k as f64 / RATE_HZ, &mut random));
            (begun, due) = (count, None);
        }
        // If no new request comes and no dwell ends, the person turns the board to another pose.
        if turn.is_none() && due.is_none() && begun > 0 && now_s > turned_s + PUZZLED_S {
            let any = [0.0; 3].map(|_| random.normal());
            turn = Some(Turn::to(
                attitude,
                unit(any),
                k as f64 / RATE_HZ,
                &mut random,
            ));
        }
        let mut text = String::new();
        while (k as f64) < now_s * RATE_HZ {
            let t_s = k as f64 / RATE_HZ;
            let mut rate = [0.0; 3];
            let mut push = [0.0; 3];
            if let Some(Turn { from, by, .. }) = &turn {
                let [done, change] = turn.as_ref().map_or([1.0, 0.0], |t| t.share(t_s));
                attitude = product(from, &rotation(by.map(|x| x * done)));
                rate = by.map(|x| x * change);
                push = [1.5 * change * (0.5 - done), 0.0, change * (0.5 - done)];
                if done >= 1.0 {
                    turn = None;
                    turned_s = t_s;
                }
            }
            let force = times(
                &transposed(&attitude),
                [push[0], push[1], GRAVITY + push[2]],
            );
            let written = board.line(t_s, rate, force, &mut random);
            if random.even() >= board.lost {
                text.push_str(&written);
            }
            k += 1;
        }
        if let Some(stream) = &mut line
            && stream.write_all(text.as_bytes()).is_err()
        {
            line = None;
        }
    }
}
