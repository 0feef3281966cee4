//! The device's Kalman filters during the session: they receive the input of each dwell while it runs, and are restored if the dwell is discarded.

use mimu::fit::Fit;
use mimu::quantity::{AXES, PerSensor, Sensor};
use mimu::triad::{Forward, Triad};
use mimu_core::wire::{KalmanState, Prior, Request};
use mimu_device::{Answer, Session};
use mimu_recording::error::{Argument, Error, Result};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use std::time::Duration;

use crate::station::Station;

/// Longest wait for an answer of the device.
const PATIENCE: Duration = Duration::from_secs(1);
/// Largest difference between the device's and the PC's estimate, in standard deviations of the PC's. Both use the same dwells, but not the same
/// samples: the device begins half a second later, when a dwell is recognised. With short dwells they are almost independent; the largest of 24
/// differences then exceeds 6 once in a thousand sessions.
const MOST_APART: f64 = 6.0;

/// `[b, P1, P2, P3]` of the sensors x, y, z of a triad, SI to raw: V, and V per rad/s or per m/s².
type Rows = [[f64; 4]; 3];

/// Estimates of the device's filters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ByDevice(PerSensor<Rows>);

/// The two banks of a device.
#[derive(Debug, Clone, Default)]
pub struct DeviceBanks {
    runs: bool,
    /// Whether they used samples of a discarded dwell, and have to be restored first.
    spoiled: bool,
    /// Why they lack a dwell.
    incomplete_because: Option<String>,
}

impl DeviceBanks {
    /// Banks that have missed dwells already.
    pub fn incomplete(why: &str) -> Self {
        Self {
            incomplete_because: Some(why.into()),
            ..Self::default()
        }
    }

    /// Begins a dwell. `noise`: variances of single readings, V²; `input`: rates, rad/s, and specific forces, m/s²; `spans`: largest magnitudes of
    /// both.
    pub fn begin(&mut self, station: &Station, noise: &[f64; 6], input: [f64; 6], spans: [f64; 2]) {
        if self.incomplete_because.is_some() {
            return;
        }
        let (begin, spoiled) = (!self.runs, self.spoiled);
        let noise = noise.map(|v| v as f32);
        let input = input.map(|v| v as f32);
        let sent = station.aside(move |session| {
            for (k, sensor) in Sensor::BOTH.into_iter().enumerate() {
                let three = |of: &[f32; 6]| [0, 1, 2].map(|i| of[3 * k + i]);
                if begin {
                    let prior = Prior::Diffuse {
                        span: spans[k] as f32,
                    };
                    let noise = three(&noise);
                    done(
                        session,
                        Request::KalmanStart {
                            sensor,
                            noise,
                            prior,
                        },
                    )?;
                } else if spoiled {
                    done(session, Request::KalmanBack { sensor })?;
                }
                let input = Some(three(&input));
                done(session, Request::KalmanInput { sensor, input })?;
            }
            Ok(())
        });
        // If only one filter received its input, the next dwell restores both.
        (self.runs, self.spoiled) = (true, true);
        self.heed(sent);
    }

    /// Ends a dwell that is accepted.
    pub fn keep(&mut self, station: &Station) {
        if self.incomplete_because.is_some() {
            return;
        }
        let sent = station.aside(|session| {
            for sensor in Sensor::BOTH {
                done(
                    session,
                    Request::KalmanInput {
                        sensor,
                        input: None,
                    },
                )?;
            }
            Sensor::BOTH
                .into_iter()
                .try_for_each(|sensor| done(session, Request::KalmanKeep { sensor }))
        });
        self.spoiled = sent.is_err();
        self.heed(sent);
    }

    /// Restores the filters after a discarded dwell.
    pub fn back(&mut self, station: &Station) {
        if self.incomplete_because.is_some() || !self.runs {
            return;
        }
        let sent = station.aside(|session| {
            Sensor::BOTH
                .into_iter()
                .try_for_each(|sensor| done(session, Request::KalmanBack { sensor }))
        });
        // If the line is lost, they are restored once it is back.
        self.spoiled = sent.is_err();
    }

    /// Records that an accepted dwell was discarded, or that the device has restarted.
    pub fn mark_incomplete(&mut self, why: &str) {
        if self.runs {
            self.incomplete_because.get_or_insert_with(|| why.into());
        }
    }

    fn heed(&mut self, sent: Result<()>) {
        if let Err(error) = sent {
            self.incomplete_because
                .get_or_insert_with(|| error.to_string());
        }
    }

    /// Ends the filters. The error says why their estimate cannot be the calibration.
    pub fn end(&mut self, station: &Station) -> std::result::Result<ByDevice, String> {
        if let Some(why) = &self.incomplete_because {
            return Err(why.clone());
        }
        if !self.runs {
            return Err("they have received no dwell".into());
        }
        self.runs = false;
        let spoiled = self.spoiled;
        let ended = station.aside(move |session| {
            let mut all = PerSensor::<Rows>::default();
            for (sensor, rows) in all.as_mut() {
                if spoiled {
                    done(session, Request::KalmanBack { sensor })?;
                }
                let end = Request::KalmanEnd { sensor };
                match session.call(end, "for its estimate", PATIENCE)? {
                    Answer::Kalman(state) => *rows = rows_of(&state),
                    _ => return Err(session.unexpected("for its estimate")),
                }
            }
            Ok(ByDevice(all))
        });
        ended.map_err(|e| e.to_string())
    }
}

fn done(session: &mut Session, request: Request<'_>) -> Result<()> {
    session.done(request, "to run its Kalman filters")
}

fn rows_of(state: &KalmanState) -> Rows {
    state.axes.map(|axis| axis.mean.map(f64::from))
}

impl ByDevice {
    fn forward(&self, sensor: Sensor) -> Forward {
        let rows = &self.0[sensor];
        Forward {
            matrix: Matrix3::from_fn(|i, j| rows[i][1 + j]),
            bias: Vector3::from_fn(|i, _| rows[i][0]),
        }
    }

    /// Replaces the PC's estimate by the device's, and says how far apart they are. The uncertainties remain the PC's: the filters only know the
    /// white noise of the readings.
    ///
    /// Errors: the two estimates contradict each other.
    pub fn replace(&self, fitted: &mut Fit, unit: &str) -> Result<String> {
        let mut most = (0.0, String::new());
        for sensor in &mut fitted.sensors {
            let before = &sensor.estimated.triad;
            let inverse = self.forward(sensor.sensor).inverse();
            let triad = inverse.and_then(|c| Triad::from_inverse(c, before.inverse_parts()));
            let Some(triad) = triad else {
                let problem = format!("the device's estimate of the {} is singular", sensor.sensor);
                let remedy = "run it again with the PC's estimate";
                return Err(Error::new(unit, problem, remedy).about(Argument::EstimatedBy));
            };
            let both = before.forward_estimates().into_iter();
            let names = AXES
                .into_iter()
                .flat_map(|i| AXES.map(|j| format!("P of {} {i}{j}", sensor.sensor)))
                .chain(AXES.map(|i| format!("bias of {} {i}", sensor.sensor)));
            for ((a, b), name) in both.zip(triad.forward_estimates()).zip(names) {
                let apart = (a.value - b.value).abs() / a.sigma;
                if !(apart <= most.0) {
                    most = (apart, name);
                }
            }
            sensor.estimated.triad = triad;
        }
        let (apart, name) = most;
        if !(apart <= MOST_APART) {
            let problem = format!(
                "the device's Kalman filters and the PC's fit of the same dwells differ by {apart:.1} standard deviations in {name}"
            );
            let remedy = "run it again with the PC's estimate, and report this";
            return Err(Error::new(unit, problem, remedy).about(Argument::EstimatedBy));
        }
        Ok(format!(
            "the calibration is the device's estimate; it differs from the PC's by at most {apart:.2} standard deviations ({name})"
        ))
    }
}
