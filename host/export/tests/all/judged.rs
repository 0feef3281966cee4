//! The judgement of a calibration reaches every export, and no error that is said to remain is below the held-out one.

use mimu::calibration::{Calibration, Judged};
use mimu::judgement::{Judgement, JudgementKind};
use mimu::quantity::Sensor;
use mimu_export::core::Core;
use mimu_export::fusion::Fusion;
use mimu_export::json::Json;
use mimu_export::rust::Rust;
use mimu_export::{Nothing, Sources, Target};

/// Held-out error of the accelerometer, m/s².
const HELD_OUT: f64 = 0.0115;

fn misfit() -> Calibration {
    let mut calibration = crate::unit::calibration(false);
    calibration.judgement = Some(Judgement::new(JudgementKind::Misfit, "43 times the noise"));
    let accel = calibration.accel.as_mut().unwrap();
    accel.judged = Some(Judged {
        estimator: "joint".into(),
        figure: "compensated dwell mean minus known input".into(),
        unit: "m/s^2".into(),
        rms: 1e-4,
        held_out_rms: Some(HELD_OUT),
        noise_floor: Some(1e-4),
        dwells: 20,
        condition: 3.0,
    });
    calibration
}

#[test]
fn an_export_says_how_its_calibration_is_judged_and_how_much_unseen_data_erred() {
    let calibration = misfit();
    let from = Sources {
        calibration: Some((&calibration, "cal.toml")),
        ..Sources::default()
    };
    let none = Nothing {};
    let exports = [
        Rust::export(&from, &none),
        Json::export(&from, &none),
        Fusion::export(&from, &none),
        Core::export(&from, &none),
    ];
    for export in exports.map(mimu_recording::error::Result::unwrap) {
        let [judged] = &export.judgements[..] else {
            panic!("{:?}", export.judgements);
        };
        assert_eq!(judged.judgement, calibration.judgement);
        let [error] = &export.calibration_errors[..] else {
            panic!("{:?}", export.calibration_errors);
        };
        assert_eq!((error.sensor, error.rms), (Sensor::Accel, Some(HELD_OUT)));
        // The bytes of a device have no place for comments.
        if let Ok(text) = std::str::from_utf8(&export.content) {
            assert!(text.contains("misfit: 43 times the noise"), "{}", export.to);
        }
    }
}
