//! What a person should know of curves over temperature, by kind; only readers get the sentences.

use std::fmt;

use mimu::quantity::{Sensor, plural, significant};
use mimu_recording::RawUnit;
use serde::{Serialize, Serializer};

use crate::bias_jumps::BiasJump;
use crate::used::Used;

/// Jumps of a bias that are named at most.
const NAMED: usize = 3;

/// What a person should know. JSON has the sentence.
#[derive(Debug, Clone, PartialEq)]
pub enum Warning {
    /// What was found while a recording was read and its dwells were chosen.
    Recording(mimu::warning::Warning),
    /// How often the unit was put into another pose of the gyro, and of the accelerometer; the first time of the latter, s.
    Moved([usize; 2], f64),
    /// Jumps of the gyro's bias, and the unit of the readings.
    BiasJumps(Vec<BiasJump>, RawUnit),
    /// How much of the recordings a sensor's curves rest on.
    Coverage(Sensor, Used),
    /// Temperatures that no recording crosses, °C.
    NotCrossed([f64; 2]),
    /// Temperatures, K, that are too few for curvature.
    StraightLines(f64),
    /// How many times as far as straight lines curves miss the last third of the recordings.
    CurvatureRefused(f64),
    /// The noise of the unit at rest is not known.
    WithoutNoise,
    /// Names of the units of two calibrations that are compared.
    TwoUnits(String, String),
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Recording(warning) => write!(f, "{warning}"),
            Self::Moved([turned, moved], first_s) => {
                let times = plural(*moved as u64, "time");
                write!(
                    f,
                    "the unit was moved {times}, first at {first_s:.0} s: each pose has "
                )?;
                match turned {
                    0 => f.write_str("three bias offsets of the accelerometer")?,
                    turned if turned == moved => f.write_str("six bias offsets of its own")?,
                    turned => write!(
                        f,
                        "bias offsets of the accelerometer, and {turned} of them bias offsets of the gyro as well"
                    )?,
                }
                f.write_str(", as gravity adds to them")
            }
            Self::BiasJumps(jumps, raw_unit) => {
                let size = |jump: &BiasJump| {
                    let size = jump.change.amax();
                    match raw_unit {
                        RawUnit::Si => format!("{} deg/s", significant(size.to_degrees())),
                        other => format!("{} {other}", significant(size)),
                    }
                };
                let named = jumps.iter().take(NAMED);
                let each: Vec<String> = named
                    .map(|jump| format!("by {} at {:.0} s", size(jump), jump.at_s))
                    .collect();
                let more = if jumps.len() > NAMED { ", ..." } else { "" };
                write!(
                    f,
                    "the gyro's bias jumps {}, {}{more}, while gravity stays within a tenth of where it was: no move of the unit does that, so \
                     the readings before and after are kept, the curves go between them, and the intervals hold the jumps as they hold the \
                     wander of a bias",
                    plural(jumps.len() as u64, "time"),
                    each.join(", ")
                )
            }
            Self::Coverage(sensor, used) => write!(
                f,
                "the {sensor} uses {}: the rest is not found to be at rest, or is clipped",
                used.words()
            ),
            Self::NotCrossed([low, high]) => write!(
                f,
                "no recording crosses {low:.1} to {high:.1} °C: what the biases do in between is drawn from one power-on to another, and the \
                 intervals hold nothing of how well they repeat"
            ),
            Self::StraightLines(span) => write!(
                f,
                "the recordings span {} K: curves are straight lines, as curvature needs 20 K",
                significant(*span)
            ),
            Self::CurvatureRefused(times) => write!(
                f,
                "curvature refused: fitted to the first two thirds, curves miss the last third {} times as far as straight lines do, and a \
                 drift in time is not told from curvature where the temperature goes one way only",
                significant(*times)
            ),
            Self::WithoutNoise => f.write_str(
                "intervals of the biases hold the wander that the recordings show, and nothing of what is slower: a noise file, which mimu allan \
                 writes of the unit at rest for hours, shows it",
            ),
            Self::TwoUnits(a, b) => write!(f, "they are of two units, {a:?} and {b:?}"),
        }
    }
}

impl Serialize for Warning {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
