//! Compares the compensated stream with this program's compensation of the raw stream, sample by sample.

mod host_reference;

use std::time::{Duration, Instant};

use mimu_core::effects::DeviceEffect;
use mimu_core::wire::Request;
use nalgebra::Vector3;
use serde::Serialize;

use super::image::{Image, effects_of};
use super::received::{Event, Samples};
use super::session::Session;
use host_reference::HostReference;
use mimu::{Calibration, Sensor};
use mimu_recording::error::{Error, Result};

pub use host_reference::rounding;

/// Largest differences found in one triad.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Difference {
    /// Device minus PC in the same single precision, in units of the last place of the larger of the two.
    pub ulps: u32,
    /// The same difference in [`Self::unit`].
    pub single: f64,
    /// Device minus the PC in double precision from the calibration file, in [`Self::unit`].
    pub double: f64,
    /// [`Self::double`] divided by the largest error that rounding can cause ([`rounding`]).
    pub rounding_share: f64,
    /// rad/s or m/s^2.
    pub unit: &'static str,
}

/// Result of `mimu device check`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Checked {
    /// Samples compared.
    pub samples: u64,
    /// Samples of one stream whose counterpart in the other was lost on the line.
    pub unpaired: u64,
    /// Differences of the gyro.
    pub gyro: Difference,
    /// Differences of the accelerometer.
    pub accel: Difference,
    /// Largest difference of the dies' temperature, K: the one the device compensated at, minus the PC's from the thermometer. `None` if no lag is
    /// applied.
    pub die_temperature_k: Option<f64>,
    /// Lowest and highest temperature of the dies during the comparison, °C. Only this segment of the curves was compared.
    pub die_range_c: Option<[f32; 2]>,
    /// Ids of effects that depend on samples from before the comparison. Double precision could not be judged with them.
    pub not_judged_for: Vec<String>,
    /// Whether device and PC differ by rounding only.
    pub holds: bool,
}

/// Largest difference of the dies' temperature, K. Both sides add up rounding steps of some microkelvin, which decay within the lag.
const DIE_K: f64 = 1e-3;

/// Compares for `duration` of samples. Refuses a device that stores another calibration than the file.
pub fn check(
    session: &mut Session,
    calibration: &Calibration,
    place: &str,
    duration: Duration,
    mut progress: impl FnMut(f64),
) -> Result<Checked> {
    let image = Image::new(calibration, place)?;
    let effects = effects_of(calibration, place)?;
    let remembering = effects.iter().filter(|e| e.remembers());
    let not_judged_for = remembering.map(DeviceEffect::to_string).collect();
    let who = session.hello()?;
    let held = who.stored_hash();
    let powered_for_ms = who.powered_for_ms;
    if held != Some(image.hash) {
        let problem = match held {
            None => "the device stores no calibration".to_string(),
            Some(hash) => format!(
                "the device stores another calibration ({hash}) than the file ({})",
                image.hash
            ),
        };
        let remedy = format!("upload it first: `mimu device upload {place}`");
        return Err(Error::device(session.port(), problem, remedy));
    }
    let mut host_reference = HostReference::new(calibration, &image, powered_for_ms, place)?;
    let wanted = (duration.as_secs_f64() * session.who().sample_rate_hz) as u64;
    let mut found = Checked {
        samples: 0,
        unpaired: 0,
        gyro: Difference::none(Sensor::Gyro),
        accel: Difference::none(Sensor::Accel),
        die_temperature_k: None,
        die_range_c: None,
        holds: false,
        not_judged_for,
    };
    let both = Request::Stream {
        raw: true,
        compensated: true,
    };
    session.begin_stream(both)?;
    let mut raw: Option<Samples> = None;
    let mut last = Instant::now();
    while found.samples < wanted {
        match session.stream_event(last, "compensated stream")? {
            // The raw batch is always sent before the compensated one of the same samples.
            Some(Event::Raw(batch)) => {
                let lost = raw.replace(batch);
                found.unpaired += lost.map_or(0, |b| b.values.len() as u64);
            }
            Some(Event::Compensated(batch)) => {
                let pair = raw.take().filter(|r| r.head.first == batch.head.first);
                match pair.filter(|r| r.values.len() == batch.values.len()) {
                    Some(raw) => host_reference.compare(&raw, &batch, &mut found),
                    None => found.unpaired += batch.values.len() as u64,
                }
                if found.unpaired > wanted.max(1000) {
                    let problem = "more samples were lost on the line than compared";
                    let remedy = "check the cable, and close other programs";
                    return Err(Error::device(session.port(), problem, remedy));
                }
                last = Instant::now();
                progress(found.samples as f64 / wanted as f64);
            }
            Some(Event::Started(_) | Event::Kalman(_)) | None => {}
        }
    }
    session.done(Request::Stop, "to stop streaming")?;
    session.forget_events();
    found.holds = found.samples > 0
        && found.gyro.rounding_share <= 1.0
        && found.accel.rounding_share <= 1.0
        && found.die_temperature_k.is_none_or(|off| off <= DIE_K);
    Ok(found)
}

impl Difference {
    fn none(sensor: Sensor) -> Self {
        Self {
            ulps: 0,
            single: 0.0,
            double: 0.0,
            rounding_share: 0.0,
            unit: sensor.unit(),
        }
    }

    fn note(
        &mut self,
        device: &Vector3<f32>,
        single: &Vector3<f32>,
        double: &Vector3<f64>,
        bound: &Vector3<f64>,
    ) {
        for i in 0..3 {
            self.ulps = self.ulps.max(ulps(device[i], single[i]));
            let device = f64::from(device[i]);
            // A NaN on one side counts as an infinite difference.
            let off = |of: f64| match (device - of).abs() {
                x if x.is_nan() => f64::INFINITY,
                x => x,
            };
            self.single = self.single.max(off(f64::from(single[i])));
            self.double = self.double.max(off(double[i]));
            self.rounding_share = self
                .rounding_share
                .max(off(double[i]) / bound[i].max(f64::MIN_POSITIVE));
        }
    }
}

/// Number of floating-point values from one to the other.
pub fn ulps(a: f32, b: f32) -> u32 {
    // Maps the bits to the order of the numbers, so that neighbours differ by one, also across zero.
    let place = |x: f32| match x.to_bits() {
        bits if bits >> 31 == 0 => i64::from(bits),
        bits => -i64::from(bits & 0x7fff_ffff),
    };
    match a.is_nan() || b.is_nan() {
        true => u32::MAX,
        false => u32::try_from((place(a) - place(b)).unsigned_abs()).unwrap_or(u32::MAX),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_one_unit_apart_across_zero_too() {
        assert_eq!(ulps(1.0, 1.0 + f32::EPSILON), 1);
        assert_eq!(ulps(0.0, -0.0), 0);
        assert_eq!(ulps(f32::from_bits(1), -f32::from_bits(1)), 2);
        assert_eq!(ulps(1.0, 2.0), 1 << 23);
        assert_eq!(ulps(f32::NAN, 1.0), u32::MAX);
    }
}
