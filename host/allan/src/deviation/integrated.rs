//! The running integral of a series of rates, slice by slice.

use rayon::prelude::*;

use crate::NotFinite;
use crate::bounds::Sampling;
use crate::spectrum::sum_over;

/// Number of samples that are summed separately before they are added to the integral.
const CHUNK: usize = 4096;
/// Number of samples of a longer slice that are integrated at a time.
const SLICE: usize = 1 << 16;

/// A series integrated over time, ready for differences of any length.
///
/// A reference is subtracted from the rates first. It cancels in second and third differences, but gravity of 9.8 m/s² with noise of 1e-3
/// m/s² would use up the digits of the integral: its ramp reaches 1e9 after 1e8 samples, with a last digit of 1e-7.
#[derive(Debug, Clone)]
pub struct Integrated {
    /// Integral at the sample borders: one more than there are rates.
    x: Vec<f64>,
    /// Mean of the first slice of rates; it need only be near the mean of all.
    reference: Option<f64>,
    end: Sum,
    dt_s: f64,
    sampling: Sampling,
}

impl Integrated {
    /// Without rates yet; they will be `dt_s` apart.
    pub fn empty(dt_s: f64) -> Self {
        Self {
            x: vec![0.0],
            reference: None,
            end: Sum::default(),
            dt_s,
            sampling: Sampling::Instants,
        }
    }

    /// Integrates rates (any unit) that are `dt_s` apart, in place: three hours at 1 kHz take 86 MB only once.
    ///
    /// # Errors
    /// The first rate that is not a finite number.
    pub fn new(mut rates: Vec<f64>, dt_s: f64) -> Result<Self, NotFinite> {
        let mut integrated = Self::empty(dt_s);
        if rates.is_empty() {
            return Ok(integrated);
        }
        integrated.refuse_not_finite(&rates)?;
        let reference = mean(&rates);
        let sums = chunk_sums(&rates, reference);
        let end = &mut integrated.end;
        let starts: Vec<f64> = sums.into_iter().map(|part| end.add(part)).collect();
        let last = end.add(0.0);
        rates
            .par_chunks_mut(CHUNK)
            .zip(starts)
            .for_each(|(chunk, start)| {
                let mut since_start = 0.0;
                for x in chunk {
                    let rate = *x;
                    *x = start + since_start;
                    since_start += rate - reference;
                }
            });
        // Exactly one more than the rates; a vector that grows automatically would double.
        rates.reserve_exact(1);
        rates.push(last);
        integrated.x = rates;
        integrated.reference = Some(reference);
        Ok(integrated)
    }

    /// Integrates the next rates (any unit). Long slices are best: 1e4 samples keep the processor busy.
    ///
    /// # Errors
    /// The first rate that is not a finite number; then nothing of the slice is integrated.
    pub fn push(&mut self, rates: &[f64]) -> Result<(), NotFinite> {
        self.refuse_not_finite(rates)?;
        let reference = match self.reference {
            Some(reference) => reference,
            None if rates.is_empty() => return Ok(()),
            None => *self.reference.insert(mean(rates)),
        };
        self.x.reserve(rates.len());
        for rates in rates.chunks(SLICE) {
            let sums = chunk_sums(rates, reference);
            let starts: Vec<f64> = sums.into_iter().map(|part| self.end.add(part)).collect();
            let before = self.x.len();
            self.x.resize(before + rates.len(), 0.0);
            self.x[before..]
                .par_chunks_mut(CHUNK)
                .zip(rates.par_chunks(CHUNK))
                .zip(starts)
                .for_each(|((x, rates), start)| {
                    let mut since_start = 0.0;
                    for (x, rate) in x.iter_mut().zip(rates) {
                        since_start += rate - reference;
                        *x = start + since_start;
                    }
                });
        }
        Ok(())
    }

    /// Takes a series that is an integral already (rad, m/s, s), sampled every `dt_s`.
    ///
    /// # Errors
    /// The first sample that is not a finite number.
    pub fn of_phase(phase: &[f64], dt_s: f64) -> Result<Self, NotFinite> {
        let mut integrated = Self {
            x: Vec::new(),
            sampling: Sampling::Means,
            ..Self::empty(dt_s)
        };
        integrated.refuse_not_finite(phase)?;
        integrated.x.extend_from_slice(phase);
        Ok(integrated)
    }

    /// The integral.
    pub(crate) fn x(&self) -> &[f64] {
        &self.x
    }

    /// Number of rates.
    pub fn samples(&self) -> usize {
        self.x.len() - 1
    }

    /// Sample period, s.
    pub fn dt_s(&self) -> f64 {
        self.dt_s
    }

    /// Meaning of the integral's samples.
    pub(crate) fn sampling(&self) -> Sampling {
        self.sampling
    }

    /// Divisor that turns a difference of the integral over one sample into a rate: rates are summed over samples, a phase is an integral
    /// over seconds.
    pub(crate) fn step(&self) -> f64 {
        match self.sampling {
            Sampling::Instants => 1.0,
            Sampling::Means => self.dt_s,
        }
    }

    fn refuse_not_finite(&self, next: &[f64]) -> Result<(), NotFinite> {
        // A chunk at a time and without leaving it early, for the vector unit.
        let sound = |chunk: &[f64]| chunk.iter().fold(true, |ok, v| ok & v.is_finite());
        let Some(chunk) = next.chunks(CHUNK).position(|c| !sound(c)) else {
            return Ok(());
        };
        let not_finite = |v: &f64| !v.is_finite();
        let at = chunk * CHUNK
            + next[chunk * CHUNK..]
                .iter()
                .position(not_finite)
                .unwrap_or(0);
        let before = self.x.len().saturating_sub(1);
        Err(NotFinite {
            sample: before + at,
            value: next[at],
        })
    }
}

/// The mean of `rates`, with a rounding error of parts in 1e12.
fn mean(rates: &[f64]) -> f64 {
    chunk_sums(rates, 0.0).into_iter().sum::<f64>() / rates.len() as f64
}

/// Sums of chunks of the rates minus a reference.
fn chunk_sums(rates: &[f64], reference: f64) -> Vec<f64> {
    let chunks = rates.chunks(CHUNK);
    chunks.map(|chunk| sum_over(chunk, reference)).collect()
}

/// A sum with compensation of rounding errors (Neumaier 1974): 1e8 samples are 24 000 chunks, and an error at a border would be a step in
/// every cluster after it.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    sum: f64,
    lost: f64,
}

impl Sum {
    /// Adds `part`, and returns the sum before it.
    fn add(&mut self, part: f64) -> f64 {
        let Self { sum, lost } = *self;
        let next = sum + part;
        self.lost += if sum.abs() >= part.abs() {
            (sum - next) + part
        } else {
            (part - next) + sum
        };
        self.sum = next;
        sum + lost
    }
}
