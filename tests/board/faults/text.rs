//! A board of another maker in the hands of a person who follows the requests: lines of text over TCP, in virtual time that is faster than the wall
//! clock.

use std::io::Write as _;
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::Value;

use mimu_tests::text_board::{
    GRAVITY, Random, TextBoard, Turn, Vector, product, rotation, times, transposed, unit,
};

/// Delay from a requested step to the motion of the hand, s.
const REACTION_S: f64 = 0.6;

/// If no new step comes for this long, the person tries another pose, s.
const PUZZLED_S: f64 = 40.0;

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
            turn = Some(Turn::to(
                attitude,
                up,
                k as f64 / board.rate_hz,
                &mut random,
            ));
            (begun, due) = (count, None);
        }
        // If no new request comes and no dwell ends, the person turns the board to another pose.
        if turn.is_none() && due.is_none() && begun > 0 && now_s > turned_s + PUZZLED_S {
            let any = [0.0; 3].map(|_| random.normal());
            turn = Some(Turn::to(
                attitude,
                unit(any),
                k as f64 / board.rate_hz,
                &mut random,
            ));
        }
        let mut text = String::new();
        while (k as f64) < now_s * board.rate_hz {
            let t_s = k as f64 / board.rate_hz;
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
