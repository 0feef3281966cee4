//! Warnings about curves over temperature, by kind. The sentences are for people only.

use std::fmt;

use mimu::quantity::{Sensor, plural, significant};
use mimu::warning::as_data;
use mimu_recording::RawUnit;
use serde::{Serialize, Serializer};

use crate::bias_jumps::BiasJump;
use crate::used::Used;

/// Jumps of a bias that are named at most.
const NAMED: usize = 3;

/// What a person should know. JSON has its kind, the sensor that it is about, and the sentence.
#[expect(
    missing_docs,
    reason = "the comment of a variant says what its fields are"
)]
#[derive(Debug, Clone, PartialEq, strum::IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
pub enum Warning {
    /// A warning from reading a recording and choosing its dwells.
    Recording(mimu::warning::Warning),
    /// How often the unit was put into another pose of the gyro, and of the accelerometer; the first time of the latter, s.
    Moved { times: [usize; 2], first_s: f64 },
    /// Jumps of the gyro's bias, and the unit of the readings.
    BiasJumps {
        jumps: Vec<BiasJump>,
        raw_unit: RawUnit,
    },
    /// How much of the recordings a sensor's curves use.
    Coverage { sensor: Sensor, used: Used },
    /// Temperatures that no recording crosses, °C.
    NotCrossed { between_c: [f64; 2] },
    /// Span of temperatures, K, over which the data do not show curvature, and the error of held-out dwells by curves over that by straight lines.
    StraightLines { span_k: f64, held_out: Option<f64> },
    /// Error of curves in the last third of the recordings, relative to that of straight lines.
    CurvatureRefused { times: f64 },
    /// The noise of the unit at rest is not known.
    WithoutNoise,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Recording(warning) => write!(f, "{warning}"),
            Self::Moved { times: [turned, moved], first_s } => {
                let times = plural(*moved as u64, "time");
                write!(
                    f,
                    "the unit was moved {times}, first at {first_s:.0} s: each pose has "
                )?;
                match turned {
                    0 => f.write_str("three bias offsets of the accelerometer")?,
                    turned if turned == moved => f.write_str("six separate bias offsets")?,
                    turned => write!(
                        f,
                        "bias offsets of the accelerometer, and {turned} of them bias offsets of the gyro as well"
                    )?,
                }
                f.write_str(", because gravity adds to them")
            }
            Self::BiasJumps { jumps, raw_unit } => {
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
                    "the gyro's bias jumps {}, {}{more}, while gravity changes by less than a tenth, so the unit was not moved. The readings before and after are kept, the curves pass between them, and the intervals include the jumps like the wander of a bias",
                    plural(jumps.len() as u64, "time"),
                    each.join(", ")
                )
            }
            Self::Coverage { sensor, used } => write!(
                f,
                "the {sensor} uses {}: the other samples are not found to be at rest, or are clipped",
                used.words()
            ),
            Self::NotCrossed { between_c: [low, high] } => write!(
                f,
                "no recording crosses {low:.1} to {high:.1} °C: there the curves connect biases of different power-ons, and the intervals do not include their repeatability"
            ),
            Self::StraightLines { span_k: span, held_out: share } => {
                let shows = match share {
                    Some(share) => format!(
                        "the held-out error of curves is {} times that of lines, and over less than 20 K drift looks like curvature",
                        significant(*share)
                    ),
                    None => "nothing shows curvature over less than 20 K".into(),
                };
                write!(
                    f,
                    "the recordings span {} K: curves are straight lines, because {shows}",
                    significant(*span)
                )
            }
            Self::CurvatureRefused { times } => write!(
                f,
                "curvature refused: fitted to the first two thirds, curves miss the last third by {} times as much as straight lines do. If the temperature goes one way only, a drift in time cannot be distinguished from curvature",
                significant(*times)
            ),
            Self::WithoutNoise => f.write_str(
                "intervals of the biases include only the wander that the recordings show. A noise file shows slower wander: run `mimu allan` on the unit at rest for hours",
            ),
        }
    }
}

impl Serialize for Warning {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (kind, about) = match self {
            Self::Recording(warning) => (warning.kind(), warning.about()),
            Self::Coverage { sensor, .. } => (self.into(), Some(sensor.name())),
            _ => (self.into(), None),
        };
        as_data(kind, about, self, serializer)
    }
}
