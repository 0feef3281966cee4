//! Time and memory of the deviations: how the cost grows from 1e6 to 1e8 samples, and six channels of three hours
//! at 1 kHz.
//!
//! `cargo bench -p mimu-allan --bench allan`. Prints figures and asserts nothing: times drift on shared machines. With
//! `-- --file RATES KIND PER_DECADE` it prints the curve of a file of little-endian doubles at 1 Hz instead,
//! which is what `tests/allan_side_by_side.py` compares with AllanTools.

use std::io::Read;
use std::time::{Duration, Instant};

use mimu_allan::deviation::Integrated;
use mimu_allan::{Deviation, Point, Spacing};

const KINDS: [(&str, Deviation); 3] = [
    ("allan", Deviation::Allan),
    ("modified", Deviation::Modified),
    ("hadamard", Deviation::Hadamard),
];

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if let Some(at) = arguments.iter().position(|a| a == "--file") {
        return curve_of_file(&arguments[at + 1..]);
    }
    growth();
    six_channels();
}

/// Number of rates that are made or read, and integrated, at a time.
const SLICE: usize = 1 << 16;

/// White rates and a slow random walk from a cheap generator: the quality of the noise does not matter here.
fn generator() -> impl FnMut(&mut [f64]) {
    let (mut random, mut walk) = (0x6d69_6d75_u64, 0.0);
    move |slice| {
        for rate in slice {
            random ^= random >> 12;
            random ^= random << 25;
            random ^= random >> 27;
            let white =
                (random.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1_u64 << 53) as f64;
            walk += 1e-4 * (white - 0.5);
            *rate = white + walk;
        }
    }
}

/// The curve of `n` rates, and the time to compute it from rates in memory.
fn curve(
    n: usize,
    mut next: impl FnMut(&mut [f64]),
    kind: Deviation,
    spacing: &Spacing,
) -> (Vec<Point>, Duration) {
    let mut rates = vec![0.0; n];
    rates.chunks_mut(SLICE).for_each(&mut next);
    let start = Instant::now();
    let integrated = Integrated::new(rates, 1.0).expect("finite");
    let points = integrated.curve(kind, spacing, 0.95);
    (points, start.elapsed())
}

fn growth() {
    println!(
        "{:<10}{:<16}{:>10}{:>10}{:>10}{:>11}{:>14}",
        "kind", "times", "1e6, s", "1e7, s", "1e8, s", "1e8/1e6", "Mpoint/s, 1e8"
    );
    for (name, kind) in KINDS {
        for (label, spacing) in [
            ("octaves", Spacing::Octave),
            ("10 a decade", Spacing::PerDecade(10)),
            ("100 a decade", Spacing::PerDecade(100)),
        ] {
            let mut seconds = [0.0; 3];
            let mut points = 0;
            for (s, n) in seconds.iter_mut().zip([1_000_000, 10_000_000, 100_000_000]) {
                let (curve, spent) = curve(n, generator(), kind, &spacing);
                points = curve.len();
                *s = spent.as_secs_f64();
            }
            let [small, middle, large] = seconds;
            println!(
                "{name:<10}{label:<16}{small:>10.4}{middle:>10.3}{large:>10.2}{:>11.0}{:>14.0}",
                large / small,
                1e2 * points as f64 / large
            );
        }
    }
    println!("peak memory {} MB", peak_mb());
}

fn six_channels() {
    let seconds: f64 = (0..6)
        .map(|_| {
            curve(
                10_800_000,
                generator(),
                Deviation::Allan,
                &Spacing::PerDecade(10),
            )
            .1
        })
        .map(|spent| spent.as_secs_f64())
        .sum();
    println!("six channels of 10.8e6, 10 times a decade, Allan: {seconds:.2} s");
}

fn curve_of_file(arguments: &[String]) {
    let [path, kind, per_decade] = arguments else {
        panic!("--file RATES KIND PER_DECADE, not {arguments:?}");
    };
    let (_, kind) = KINDS.into_iter().find(|(n, _)| n == kind).expect("a kind");
    let mut file = std::fs::File::open(path).expect("a file of rates");
    let n = file.metadata().expect("its size").len() as usize / 8;
    let mut bytes = vec![0; 8 * SLICE];
    let read = |slice: &mut [f64]| {
        let bytes = &mut bytes[..8 * slice.len()];
        file.read_exact(bytes).expect("whole doubles");
        for (rate, bytes) in slice.iter_mut().zip(bytes.as_chunks().0) {
            *rate = f64::from_le_bytes(*bytes);
        }
    };
    let spacing = Spacing::PerDecade(per_decade.parse().expect("a number"));
    let (points, spent) = curve(n, read, kind, &spacing);
    println!("seconds {}", spent.as_secs_f64());
    for point in points {
        println!("{} {:e} {}", point.m, point.deviation, point.edf);
    }
}

/// Peak memory of this process, MB.
fn peak_mb() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mark = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    let kib: Option<u64> = mark.and_then(|m| m.trim().trim_end_matches(" kB").parse().ok());
    kib.unwrap_or(0) / 1024
}
