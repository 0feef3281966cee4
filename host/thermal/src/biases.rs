//! Biases over temperature of a unit at rest, as a file: it serves the formats of autopilots, but is not a calibration.

use mimu::calibration::TOOL;
use mimu::calibration::thermal_biases::{BiasNode, FORMAT, RestReading, ThermalBiases};
use mimu::quantity::{PerSensor, Sensor};
use mimu_core::compensation::Affine;
use mimu_recording::error::{Error, Result};
use nalgebra::Matrix3;

use crate::curves::TriadCurves;
use crate::fit::{ThermalFit, range};
use crate::judge::rms;
use crate::nodes::{Inverse, fewest, with_lags};

impl ThermalFit {
    /// Whether only biases were estimated, so that the curves alone make no calibration.
    pub fn is_biases_only(&self) -> bool {
        self.joint.recorded().all(TriadCurves::biases_only)
    }

    /// The file of the biases, made at `created` (RFC 3339).
    ///
    /// # Errors
    /// Recordings that determine more than biases.
    pub fn biases(&self, created: &str) -> Result<ThermalBiases> {
        let first = &self.sessions[0];
        if !self.is_biases_only() {
            let problem = "its inputs are known, which determine all parameters";
            return Err(Error::new(&first.place, problem, "write the calibration"));
        }
        let range_c = range(&self.joint);
        let curves = self.joint.curves.as_ref();
        // Nodes contain an affine model, of which only the offset is used: a reading is as smooth.
        let of = |sensor: Sensor, temp_c: f64| {
            let curves = self.joint.curves[sensor].as_ref()?;
            let [value, slope] = curves.forward(temp_c).map(|forward| Affine {
                matrix: Matrix3::zeros(),
                offset: forward.bias,
            });
            let covariance = curves.covariance(temp_c);
            let mut sigma = [0.0; 12];
            for k in 9..12 {
                sigma[k] = covariance[(k, k)].max(0.0).sqrt();
            }
            Some(Inverse {
                model: value,
                slope,
                sigma,
                physical: None,
            })
        };
        let nodes = fewest(of, curves.map(|c| c.is_some()), range_c)?;
        let mut over = with_lags(&self.joint, range_c, nodes);
        for (sensor, dies) in over.dies.as_mut() {
            dies.hysteresis = self.hysteresis(sensor, [1.0; 3]);
        }
        let readings = over.nodes.iter().map(|node| {
            let reading = |sensor: Sensor| {
                node.table(sensor).map(|table| RestReading {
                    u: table.o,
                    slope_u: table.slope_o,
                    sigma_u: table.sigma_o.unwrap_or_default(),
                })
            };
            BiasNode {
                temp_c: node.temp_c,
                gyro: reading(Sensor::Gyro),
                accel: reading(Sensor::Accel),
            }
        });
        let made = ThermalBiases {
            format: FORMAT.into(),
            device: first.device.clone(),
            unit_id: first.unit_id.clone(),
            created: created.into(),
            tool: TOOL.into(),
            recording: first.origin(range_c),
            range_c,
            judgement: self.judgement(),
            rms: PerSensor::from_fn(|sensor| {
                let judged = self.judged[sensor].as_ref()?;
                Some(rms(judged.shown())[0])
            }),
            nodes: readings.collect(),
            dies: over.dies,
        };
        made.checked(&format!("biases of {:?}", first.device))
    }
}
