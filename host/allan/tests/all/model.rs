//! Whether the intervals of the noise model contain the truth as often as they claim, on noise made by other code.

use mimu_allan::Point;
use mimu_allan::model::{
    Coefficient, Estimator, NoiseModel, Reason, Term, allan_factors, hadamard_factors,
};
use mimu_rig::noise::{Coefficients, Noise};
use mimu_rig::random::Random;
use rayon::prelude::*;

/// Truth of one case, in units of the sample period.
#[derive(Clone, Copy, Default)]
struct Truth {
    q: f64,
    n: f64,
    b: f64,
    k: f64,
    r: f64,
    samples: usize,
}

impl Truth {
    fn of(&self, term: Term) -> f64 {
        match term {
            Term::Q => self.q,
            Term::N => self.n,
            Term::B => self.b,
            Term::K => self.k,
            Term::R => self.r,
        }
    }
}

/// Steps of the generator per sample. Its flicker noise is correct from ten steps on; its random walk is 0.5/m² too strong at m steps. If
/// no white noise hides the shortest times, that must be less than the intervals of 1 %. The number is odd, because the generator redraws
/// its slow processes every 2^k steps: with 32 all were redrawn between samples, the Allan variance of one sample was 1.7 % too high, and
/// the intervals of B alone contained it in 78 % of the runs.
fn fine(of: &Truth) -> usize {
    if of.n > 0.0 { 9 } else { 31 }
}

/// Mean rates over the samples.
fn series(of: &Truth, dt_s: f64, seed: u64) -> Vec<f64> {
    let white = Coefficients {
        white: of.n,
        instability: 0.0,
        walk: 0.0,
    };
    let mut white = Noise::new(&white, "white", dt_s, seed);
    let slow = Coefficients {
        white: 0.0,
        instability: of.b,
        walk: of.k,
    };
    let fine = fine(of);
    let mut slow = Noise::new(&slow, "slow", dt_s / fine as f64, seed);
    let has_slow = of.b > 0.0 || of.k > 0.0;
    // Quantization: an angle rounded to steps of √12 Q, differenced.
    let mut phase = Random::new(seed, "phase");
    let mut angle = phase.within(3f64.sqrt() * of.q);
    (0..of.samples)
        .map(|i| {
            let slow = if has_slow {
                (0..fine).map(|_| slow.step()).sum::<f64>() / fine as f64
            } else {
                0.0
            };
            let next = phase.within(3f64.sqrt() * of.q);
            let quantization = (next - angle) / dt_s;
            angle = next;
            white.step() + slow + quantization + of.r * dt_s * i as f64
        })
        .collect()
}

/// Fang (8) as printed, and the same for third differences, at the times that the model needs.
fn curves(rates: &[f64], dt_s: f64) -> [Vec<Point>; 2] {
    let n = rates.len();
    let mean = rates.iter().sum::<f64>() / n as f64;
    let mut sums = vec![0.0; n + 1];
    for i in 0..n {
        sums[i + 1] = sums[i] + (rates[i] - mean);
    }
    let point = |m: usize, squares: f64, terms: usize| Point {
        m,
        tau_s: m as f64 * dt_s,
        deviation: (squares / terms as f64).sqrt() / m as f64,
        terms,
        alpha: 0,
        edf: f64::NAN,
        lower: f64::NAN,
        upper: f64::NAN,
        sigma_independent: f64::NAN,
    };
    let second = |m: usize| {
        let terms = n + 1 - 2 * m;
        let square = |j: usize| (sums[j + 2 * m] - 2.0 * sums[j + m] + sums[j]).powi(2);
        point(m, (0..terms).map(square).sum::<f64>() / 2.0, terms)
    };
    let third = |m: usize| {
        let terms = n + 1 - 3 * m;
        let square = |j: usize| {
            (sums[j + 3 * m] - 3.0 * sums[j + 2 * m] + 3.0 * sums[j + m] - sums[j]).powi(2)
        };
        point(m, (0..terms).map(square).sum::<f64>() / 6.0, terms)
    };
    [
        allan_factors(n).into_iter().map(second).collect(),
        hadamard_factors(n).into_iter().map(third).collect(),
    ]
}

fn fitted(estimator: &Estimator, rates: &[f64]) -> NoiseModel {
    let [allan, hadamard] = curves(rates, 1.0);
    estimator.fit(&allan, &hadamard).unwrap()
}

fn models(truth: &Truth, dt_s: f64, runs: u64) -> Vec<NoiseModel> {
    let estimator = Estimator::new(truth.samples, dt_s, 0.95);
    (0..runs)
        .into_par_iter()
        .map(|seed| {
            let [allan, hadamard] = curves(&series(truth, dt_s, seed), dt_s);
            estimator.fit(&allan, &hadamard).unwrap()
        })
        .collect()
}

fn covers(c: &Coefficient, truth: f64) -> bool {
    c.lower <= truth && truth <= c.upper
}

/// Whether the interval of a term that is found, or the bound of one that is not, contains the truth.
fn holds(model: &NoiseModel, term: Term, truth: f64) -> bool {
    match &model.coefficients[term as usize] {
        Ok(told) => covers(told, truth),
        Err(unseen) => unseen.at_most.is_none_or(|most| truth <= most),
    }
}

fn cases() -> Vec<(&'static str, Truth)> {
    const SHORT: usize = 1 << 14;
    const LONG: usize = 1 << 17;
    // Name, Q, N, B, K, R, samples.
    [
        ("N", 0.0, 1.0, 0.0, 0.0, 0.0, SHORT),
        ("B", 0.0, 0.0, 1.0, 0.0, 0.0, SHORT),
        ("K", 0.0, 0.0, 0.0, 1.0, 0.0, SHORT),
        ("Q", 1.0, 0.0, 0.0, 0.0, 0.0, SHORT),
        ("N R", 0.0, 1.0, 0.0, 0.0, 3e-5, SHORT),
        ("N B", 0.0, 1.0, 0.2, 0.0, 0.0, SHORT),
        ("N K", 0.0, 1.0, 0.0, 0.01, 0.0, SHORT),
        ("Q N", 3.0, 1.0, 0.0, 0.0, 0.0, SHORT),
        ("N, weak B", 0.0, 1.0, 0.06, 0.0, 0.0, SHORT),
        ("N, weak K", 0.0, 1.0, 0.0, 2e-3, 0.0, SHORT),
        ("N, weak R", 0.0, 1.0, 0.0, 0.0, 1.5e-5, SHORT),
        ("N B K", 0.0, 1.0, 0.2, 0.01, 0.0, LONG),
        ("N B, weak K", 0.0, 1.0, 0.2, 1e-3, 0.0, LONG),
        ("Q N B", 5.0, 1.0, 0.1, 0.0, 0.0, LONG),
        ("Q N B K R", 5.0, 1.0, 0.1, 5e-3, 1e-4, LONG),
    ]
    .map(|(name, q, n, b, k, r, samples)| {
        let truth = Truth {
            q,
            n,
            b,
            k,
            r,
            samples,
        };
        (name, truth)
    })
    .into()
}

/// With this many runs the shares scatter by 0.5 %.
const RUNS: u64 = 2000;

/// 2000 runs each, by `cargo test --release -p mimu-allan --test all table_of_coverages -- --ignored --nocapture`: how many found the term,
/// and in how many per cent of these the 95 % interval contained the truth. The interval of a term that is found only if it happens to look
/// large contains the truth less often ("weak"); interval and bound together are right as claimed.
///
/// | noise | found | contained, % | interval or bound, % |
/// |---|---|---|---|
/// | N | N 2000 | N 94.9 | N 94.9 |
/// | B | B 1999 | B 95.0 | B 95.0 |
/// | K | K 2000 | K 95.2 | K 95.2 |
/// | Q | Q 1998 | Q 94.8 | Q 94.8 |
/// | N R | N 2000, R 1853 | N 94.8, R 94.2 | N 94.8, R 94.5 |
/// | N B | N 1999, B 2000 | N 94.9, B 95.0 | N 94.9, B 95.0 |
/// | N K | N 1998, K 1980 | N 94.8, K 95.5 | N 94.8, K 95.0 |
/// | Q N | Q 1999, N 2000 | Q 95.3, N 95.2 | Q 95.3, N 95.2 |
/// | N, weak B | N 2000, B 1215 | N 95.2, B 95.5 | N 95.2, B 94.2 |
/// | N, weak K | N 1999, K 868 | N 95.5, K 95.0 | N 95.5, K 96.3 |
/// | N, weak R | N 2000, R 891 | N 94.8, R 94.5 | N 94.8, R 95.5 |
/// | N B K | N 1998, B 1998, K 2000 | N 94.3, B 94.9, K 94.2 | N 94.3, B 94.9, K 94.2 |
/// | N B, weak K | N 1997, B 1999, K 50 | N 94.5, B 95.2, K 50.0 | N 94.5, B 95.2, K 98.8 |
/// | Q N B | Q 1989, N 1994, B 1999 | Q 94.9, N 94.7, B 94.9 | Q 94.9, N 94.7, B 94.9 |
/// | Q N B K R | Q 1994, N 1999, B 1995, K 2000, R 2000 | Q 94.0, N 94.0, B 94.8, K 93.7, R 94.2 | Q 94.0, N 94.0, B 94.8, K 93.7, R 94.2 |
///
/// An absent term was found in 50 runs at most (B in "N, weak K"), and in 25 without a weak one.
#[test]
#[ignore = "nightly: 2000 runs of each case take minutes"]
fn table_of_coverages() {
    for (name, truth) in cases() {
        let begun = std::time::Instant::now();
        let models = models(&truth, 1.0, RUNS);
        println!("{name}  ({:.1} s)", begun.elapsed().as_secs_f64());
        for term in Term::ALL {
            let known = truth.of(term);
            let seen: Vec<_> = models.iter().filter_map(|m| m.get(term).ok()).collect();
            if known == 0.0 {
                println!("  {} absent, claimed in {}", term.letter(), seen.len());
                continue;
            }
            let n = seen.len() as f64;
            let inside = seen.iter().filter(|c| covers(c, known)).count();
            let below = seen.iter().filter(|c| c.upper < known).count();
            let mean = seen.iter().map(|c| c.value / known).sum::<f64>() / n;
            let width = seen.iter().map(|c| c.upper - c.lower).sum::<f64>() / n;
            let right = models.iter().filter(|m| holds(m, term, known)).count();
            println!(
                "  {}: told in {}, of which {:.1} % cover ({below} below, {} above); interval or bound: {:.1} %; mean {mean:.4}, width {:.3}",
                term.letter(),
                seen.len(),
                100.0 * inside as f64 / n,
                seen.len() - inside - below,
                100.0 * right as f64 / models.len() as f64,
                width / known,
            );
        }
        let trimmed = models.iter().filter(|m| m.range_s[0] > 1.5).count();
        let excess = models.iter().filter(|m| m.excess.is_some()).count();
        println!("  shortest time left out in {trimmed}, misfit in {excess}");
    }
}

#[test]
fn intervals_and_bounds_hold_the_truth() {
    // 95 % of 60 are 57; fewer than 51 have a probability of 1e-3.
    for (name, truth) in cases().into_iter().filter(|c| c.1.samples < 1 << 15) {
        let models = models(&truth, 1.0, 60);
        for term in Term::ALL {
            let known = truth.of(term);
            let told = models.iter().filter(|m| m.get(term).is_ok()).count();
            if known == 0.0 {
                assert!(told <= 5, "{name}: {term:?} claimed in {told} runs");
                continue;
            }
            let right = models.iter().filter(|m| holds(m, term, known)).count();
            assert!(right >= 51, "{name}: {term:?} held in {right}");
            // The ramp is near the smallest that so short a record shows.
            let least = if term == Term::R { 30 } else { 55 };
            assert!(
                told >= least || name.contains("weak"),
                "{name}: {term:?} told in {told}"
            );
        }
    }
}

#[test]
fn white_noise_behind_a_filter_keeps_its_coefficient_and_is_no_quantization() {
    let estimator = Estimator::new(1 << 15, 1.0, 0.95);
    let outside = |seed: u64| {
        let truth = Truth {
            n: 1.0,
            samples: 1 << 15,
            ..Truth::default()
        };
        let mut rates = series(&truth, 1.0, seed);
        // First order, four samples long, unit gain at zero frequency.
        let keep = (-0.25f64).exp();
        let mut state = 0.0;
        for rate in &mut rates {
            state += (1.0 - keep) * (*rate - state);
            *rate = state;
        }
        let model = fitted(&estimator, &rates);
        assert!(model.filtered && model.get(Term::Q).unwrap_err().why == Reason::Filtered);
        !covers(model.get(Term::N).unwrap(), 1.0)
    };
    // 95 % of 200 are 190; fewer than 180 have a probability of 1e-3.
    let outside = (0..200)
        .into_par_iter()
        .filter(|seed| outside(*seed))
        .count();
    assert!(outside <= 20, "{outside}");
}

#[test]
fn a_coefficient_that_is_not_seen_says_how_much_longer_to_record() {
    // Of 20 records that are longer by this time, with half the upper end as coefficient, most show it.
    let truth = Truth {
        n: 1.0,
        samples: 1 << 12,
        ..Truth::default()
    };
    let model = &models(&truth, 1.0, 1)[0];
    let unseen = model.get(Term::K).unwrap_err();
    let Reason::Small {
        longer_s: Some(longer_s),
        ..
    } = unseen.why
    else {
        panic!("{unseen:?}");
    };
    let long = Truth {
        k: 0.5 * unseen.at_most.unwrap(),
        samples: truth.samples + longer_s as usize,
        ..truth
    };
    let seen = models(&long, 1.0, 20)
        .iter()
        .filter(|m| m.get(Term::K).is_ok())
        .count();
    assert!(seen >= 10, "{unseen:?}: {seen} of 20");
}

#[test]
fn averaging_is_useful_up_to_the_minimum_of_the_curve() {
    let truth = Truth {
        n: 1.0,
        k: 0.01,
        samples: 1 << 16,
        ..Truth::default()
    };
    let model = &models(&truth, 1.0, 1)[0];
    // N²/τ + K² τ/3 is least at √3 N/K = 173 s, and 10 % above in variance at 0.64 of that.
    let useful = model.useful_average_s().unwrap();
    assert!((80.0..150.0).contains(&useful), "{useful}");
    let white = &models(
        &Truth {
            n: 1.0,
            samples: 1 << 13,
            ..Truth::default()
        },
        1.0,
        1,
    )[0];
    assert_eq!(white.useful_average_s(), None);
}
