//! The calibration that results from curves over temperature.

use super::of_fit::triad_table;
use super::{Calibration, FIGURE_DIGITS, Judged, Origin, OverTemperature};
use crate::judgement::Judgement;
use crate::quantity::{Figure, PerSensor, Sensor, rounded};
use crate::triad::Triad;
use mimu_recording::{Result, SensorSettings};

/// A triad at the temperature of one node, with the error figures of its curves.
#[derive(Debug, Clone)]
pub struct TriadOfCurves {
    /// The model there.
    pub triad: Triad,
    /// How it was estimated.
    pub estimator: &'static str,
    /// Rms of the compensated dwell means minus the known input, SI, at all temperatures.
    pub rms: f64,
    /// The same, held out.
    pub held_out_rms: Option<f64>,
    /// The same by noise alone.
    pub noise_floor: f64,
    /// Dwells used.
    pub dwells: usize,
    /// Condition of the experiment at one temperature.
    pub condition: f64,
}

/// The contents of a calibration over temperature.
#[derive(Debug, Clone)]
pub struct CurvesOfUnit {
    /// Name of the unit.
    pub device: String,
    /// Its own number, if it is known.
    pub unit_id: Option<String>,
    /// Its sensors as they were set, if they are known.
    pub sensors: Option<SensorSettings>,
    /// The first recording, and the temperature of the dies that `triads` are for.
    pub recording: Origin,
    /// The triads at that temperature.
    pub triads: PerSensor<Option<TriadOfCurves>>,
    /// The models at all temperatures.
    pub temperature: OverTemperature,
    /// The judgement of the curves.
    pub judgement: Judgement,
}

impl Calibration {
    /// The calibration over temperature of `unit`, made at `created` (RFC 3339).
    ///
    /// # Errors
    /// Curves that cannot be applied, for example because C is singular at a node.
    pub fn of_curves(unit: CurvesOfUnit, created: &str) -> Result<Self> {
        let table = |sensor: Sensor| {
            let found = unit.triads[sensor].as_ref()?;
            let figure = Figure::Input;
            let judged = Judged {
                estimator: found.estimator.into(),
                figure: figure.description().into(),
                unit: figure.unit(sensor).into(),
                rms: rounded(found.rms, FIGURE_DIGITS),
                held_out_rms: found.held_out_rms.map(|r| rounded(r, FIGURE_DIGITS)),
                noise_floor: Some(rounded(found.noise_floor, FIGURE_DIGITS)),
                dwells: found.dwells,
                condition: rounded(found.condition, 5),
            };
            let frame = "body: the axes of the ref_ columns";
            Some(triad_table(
                &found.triad,
                sensor,
                unit.recording.raw_unit,
                frame,
                judged,
            ))
        };
        let calibration = Self {
            format: Self::format_of(true).into(),
            unit_id: unit.unit_id.clone(),
            created: Some(created.into()),
            judgement: Some(unit.judgement),
            sensors: unit.sensors.clone(),
            gyro: table(Sensor::Gyro),
            accel: table(Sensor::Accel),
            temperature: Some(unit.temperature),
            ..Self::empty(&unit.device, unit.recording.clone())
        };
        calibration.checked(&format!("calibration of {:?}", unit.device))
    }

    /// This calibration at one temperature with `temperature` added, made at `created` (RFC 3339). `triads` are the models of its sensors at `temp_c`
    /// of the dies, and `judgement` is that of the curves: the file has the worse of both. Error figures stay the same.
    ///
    /// # Errors
    /// Curves that cannot be applied.
    pub fn with_curves(
        &self,
        temperature: OverTemperature,
        temp_c: f64,
        triads: PerSensor<Option<Triad>>,
        judgement: Judgement,
        created: &str,
    ) -> Result<Self> {
        let mut all = self.clone();
        all.judgement = Judgement::worst(all.judgement.into_iter().chain([judgement]));
        let tables = PerSensor {
            gyro: &mut all.gyro,
            accel: &mut all.accel,
        };
        for (sensor, (table, triad)) in tables.zip(triads.as_ref()) {
            if let (Some(kept), Some(triad)) = (table, triad)
                && let Some(judged) = kept.judged.take()
            {
                *kept = triad_table(triad, sensor, kept.raw_unit, &kept.frame, judged);
            }
        }
        all.format = Self::format_of(true).into();
        all.created = Some(created.into());
        all.tool = super::TOOL.into();
        all.recording.temp_c = Some(temp_c);
        all.recording.temp_range_c = Some(temperature.range_c);
        all.temperature = Some(temperature);
        all.checked(&format!("calibration of {:?}", self.device))
    }
}
