//! Effects in a calibration file that cannot be right, or do not fit into the device.

use mimu::calibration::Calibration;
use mimu::effects;
use mimu::effects::candidate::{Candidate, CandidateKind};
use mimu::quantity::Sensor;

use super::unit::{fitted, fitted_effect, named, record};
use crate::command::says;

#[test]
fn an_effect_that_was_edited_or_that_nobody_knows_is_refused_by_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    record(&path, false, true);
    let fit = fitted(&path);
    let effect = effects::by_id("gyro_warm_up").unwrap();
    let candidate = Candidate::new(Sensor::Gyro, CandidateKind::Effect(effect));
    let warm_up = fitted_effect(candidate, 90.0, &[1e-3, 2e-3, 3e-3]);
    let sag = named("gyro_g_sensitivity", &[1e-5; 9]);
    let text = Calibration::of(&fit, &[warm_up, sag], "2026-01-01T00:00:00Z")
        .unwrap()
        .to_toml();
    let calibration = Calibration::parse(&text, "cal.toml").unwrap();
    let device = calibration.core_effects::<f32, 8>();
    assert!(device.is_ok());

    #[rustfmt::skip]
    let edits = [
        ("id = \"gyro_warm_up\"", "id = \"gyro_magnetic\"", "gyro_magnetic", "does not know an effect"),
        ("id = \"gyro_warm_up\"", "id = \"accel_warm_up\"", "accel_warm_up", "sensor is"),
        ("id = \"gyro_warm_up\"", "id = \"gyro_g_sensitivity\"", "gyro_g_sensitivity", "no nonlinear parameter"),
        ("{ name = \"y\", value", "{ name = \"w\", value", "gyro_warm_up", "its coefficients are x, y, z"),
        ("{ name = \"y\", value", "{ name = \"x\", value", "gyro_warm_up", "twice"),
        ("unit = \"rad/s\" }", "unit = \"deg/s\" }", "gyro_warm_up", "unit of"),
        ("value = 0.002", "value = nan", "gyro_warm_up", "not a number"),
        ("sigma = 2e-5", "sigma = -1.0", "gyro_warm_up", "not a number"),
        ("value = 90.0", "value = 0.0", "gyro_warm_up", "time_constant_s"),
        ("nonlinear_parameter = {", "# nonlinear_parameter = {", "gyro_warm_up", "time_constant_s"),
        ("x = C (u - S e) + o", "x = C (u + S e) + o", "gyro_warm_up", "can be applied"),
    ];
    for (from, to, id, says) in edits {
        assert!(text.contains(from), "{from}");
        let at = text.find("[[effect]]").unwrap();
        let (triads, effects) = text.split_at(at);
        let edited = format!("{triads}{}", effects.replacen(from, to, 1));
        let refusal = Calibration::parse(&edited, "cal.toml")
            .unwrap_err()
            .to_string();
        assert!(refusal.contains(id) && refusal.contains(says), "{refusal}");
        assert!(!refusal.contains('\n'), "{refusal}");
    }
    let (first, rest) = text.split_once("\n[[effect]]").unwrap();
    let twice = format!(
        "{first}\n[[effect]]{rest}\n[[effect]]{}",
        rest.split("\n[[effect]]").next().unwrap()
    );
    let refusal = Calibration::parse(&twice, "cal.toml")
        .unwrap_err()
        .to_string();
    assert!(refusal.contains("occurs twice"), "{refusal}");
    // The sag depends on the force.
    let from = text.find("\n[accel]").unwrap();
    let gyro_only = format!("{}\n[[effect]]{rest}", &text[..from]);
    let refusal = Calibration::parse(&gyro_only, "cal.toml")
        .unwrap_err()
        .to_string();
    says(&refusal, &["gyro_g_sensitivity", "[accel]"]);
}
