//! Kinds of reasons why no dwell runs. The session decides by the kind; the sentence is only for the user.

use std::fmt;
use std::mem::discriminant;

use mimu::quantity::Sensor;
use mimu_recording::error::Error;
use mimu_recording::health::Finding;
use nalgebra::Vector3;
use serde::{Serialize, Serializer};

use mimu_equipment::step::words;

/// Why a unit waits. JSON contains the sentence.
#[derive(Debug, Clone, PartialEq)]
pub enum Waiting {
    /// The stream of samples was interrupted.
    Interrupted(Interruption),
    /// The rate of change of the temperature is not known yet.
    TrendUnknown,
    /// The temperature changes faster than the limit, both in °C/min.
    Warming(f64, f64),
    /// The table has not arrived.
    TableMoves,
    /// The readings have a fault.
    Faulty(Finding),
    /// Missing samples, and the expected number in the last second.
    SamplesLost(u64, f64),
    /// A sensor is this many times noisier than accepted at rest.
    Moves(Sensor, f64),
    /// Rate where rest was requested, deg/s.
    Turns(f64),
    /// A sensor is this many times noisier than accepted at a steady rate.
    Unsteady(Sensor, f64),
    /// Rate about the vertical, and the requested one, deg/s.
    OtherRate(f64, f64),
    /// Another direction than the requested one is up: the direction, and the angle to the requested one, degrees.
    WrongPose(Vector3<f64>, f64),
    /// The direction up was recorded before: this direction, and the requested one.
    RepeatedPose(Vector3<f64>, Vector3<f64>),
    /// It rests where whole turns begin.
    ToSpin,
    /// It is turned, as was asked for.
    Spinning,
    /// It rests before its whole turns are complete: turns so far, and those asked for.
    TurnsMissing(f64, u32),
    /// It lies so far from where its whole turns began, degrees.
    NotPutBack(f64),
}

impl Waiting {
    /// Whether it is what was asked for, and needs no words.
    pub fn is_expected(&self) -> bool {
        matches!(self, Self::ToSpin | Self::Spinning)
    }

    /// Whether `other` is the same reason with other numbers; it is then reported only once.
    pub fn is_like(&self, other: &Self) -> bool {
        // In hands a unit alternates between the two several times a second.
        let in_hands = |why: &Self| matches!(why, Self::Moves(..) | Self::Turns(_));
        match (self, other) {
            (Self::Faulty(this), Self::Faulty(other)) => this.kind() == other.kind(),
            _ => discriminant(self) == discriminant(other) || in_hands(self) && in_hands(other),
        }
    }
}

impl fmt::Display for Waiting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Interrupted(why) => write!(f, "{why}"),
            Self::TrendUnknown => f.write_str("its temperature is being watched"),
            Self::Warming(trend, limit) => {
                write!(f, "warming up: {trend:+.2} °C/min, limit {limit}")
            }
            Self::TableMoves => f.write_str("the table moves"),
            Self::Faulty(finding) => write!(f, "{finding}"),
            Self::SamplesLost(missing, of) => write!(
                f,
                "samples are missing, {missing} of the last {of:.0}: check the cable"
            ),
            Self::Moves(sensor, times) => {
                write!(
                    f,
                    "it moves ({sensor} {times:.1} times the limit): hold it still, or put it down"
                )
            }
            Self::Turns(dps) => write!(
                f,
                "it turns at {dps:.1} deg/s; if it does not, put it down for 5 s: its reading at rest is then measured again"
            ),
            Self::Unsteady(sensor, times) => {
                write!(
                    f,
                    "the rate is not steady ({sensor} {times:.1} times the limit)"
                )
            }
            Self::OtherRate(is, wanted) if is * wanted < 0.0 => write!(
                f,
                "it turns the wrong way: {is:+.0} deg/s, requested {wanted:+.0}"
            ),
            Self::OtherRate(is, wanted) => {
                write!(f, "it turns at {is:+.1} deg/s, requested {wanted:+.1}")
            }
            Self::WrongPose(up, off_deg) => write!(
                f,
                "wrong pose: {}, {off_deg:.0} degrees from the requested one",
                words(up)
            ),
            Self::ToSpin => f.write_str("it rests: turn it now"),
            Self::Spinning => f.write_str("turn it, then put it back against the edge"),
            Self::TurnsMissing(turns, asked) => write!(
                f,
                "{turns:.1} turns so far, and {asked} are wanted: turn it {} more the same way, then put it back against the edge",
                match f64::from(*asked) - turns {
                    missing if missing < 1.5 => "once".into(),
                    missing => format!("{missing:.0} times"),
                }
            ),
            Self::NotPutBack(off_deg) => write!(
                f,
                "it lies {off_deg:.0} degrees from where it lay: put it back against the edge as it was"
            ),
            Self::RepeatedPose(up, wanted) => write!(
                f,
                "pose recorded already ({}): turn to {}",
                words(up),
                words(wanted)
            ),
        }
    }
}

impl Serialize for Waiting {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// What interrupted the stream of samples. JSON contains the sentence.
#[derive(Debug, Clone, PartialEq)]
pub enum Interruption {
    /// The device restarted, with its reset cause.
    Restarted(String),
    /// The port has vanished.
    Lost(Error),
    /// Another unit is at the port.
    OtherUnit(Error),
    /// The port is open again.
    Back,
}

impl fmt::Display for Interruption {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Restarted(why) => write!(f, "the device has restarted: {why}"),
            Self::Lost(why) => write!(f, "the line is lost: {why}"),
            Self::OtherUnit(why) => write!(f, "{why}"),
            Self::Back => f.write_str("the line is back"),
        }
    }
}

impl Serialize for Interruption {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {

    use super::*;
    use mimu_recording::health::Fault;

    #[test]
    fn a_reason_with_other_numbers_is_the_same_and_one_that_begins_with_the_same_word_is_not() {
        let moves = Waiting::Moves(Sensor::Accel, 3.2);
        assert!(moves.is_like(&Waiting::Moves(Sensor::Gyro, 1.1)));
        assert!(moves.is_like(&Waiting::Turns(20.0)));
        let unsteady = Waiting::Unsteady(Sensor::Gyro, 1.1);
        for other in [
            Waiting::TableMoves,
            Waiting::Faulty(Finding::of_all(0, Fault::Exchanged)),
            Waiting::Interrupted(Interruption::Back),
        ] {
            assert!(!unsteady.is_like(&other), "{other}");
        }
    }

    #[test]
    fn a_rate_with_the_other_sign_turns_the_other_way() {
        let other = Waiting::OtherRate(-98.0, 100.0).to_string();
        assert_eq!(other, "it turns the wrong way: -98 deg/s, requested +100");
        let slow = Waiting::OtherRate(61.3, 100.0).to_string();
        assert_eq!(slow, "it turns at +61.3 deg/s, requested +100.0");
    }
}
