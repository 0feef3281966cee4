//! The published Xsens session in two halves of time: the effect is sought in one and judged by the other.

use mimu::diagnose::{Diagnosis, Recordings, diagnose};
use mimu::fit::Options;
use mimu::prepared::Prepared;
use mimu_tests::recordings::xsens_session;

/// The two halves; `None` if the data are missing.
fn halves() -> Option<[Prepared; 2]> {
    Some(xsens_session()?.halves().map(|(half, _)| half))
}

fn judged(first: Prepared, second: Prepared) -> Diagnosis {
    let recordings = Recordings {
        second: Some(second),
        ..first.into()
    };
    diagnose(recordings, Options::IN_SAMPLE).expect("a diagnosis")
}

#[test]
fn an_effect_found_in_either_half_of_a_real_session_lowers_the_error_of_the_other() {
    let Some([a, b]) = halves() else { return };
    let found = [judged(a.clone(), b.clone()), judged(b, a)].map(|diagnosis| {
        let accepted: Vec<_> = diagnosis
            .sensors
            .iter()
            .flat_map(|s| s.decision.accepted.clone())
            .collect();
        let [one] = &accepted[..] else {
            panic!("{accepted:?}")
        };
        assert_eq!(one.chosen.candidate.id(), "gyro_g_sensitivity");
        let on_other = one.second.expect("turns and rests judge it");
        assert!(on_other.shows && on_other.rms_after < 0.5 * on_other.rms_before);
        one.clone()
    });
    // The coefficients agree: nine squares in units of their sigmas, below what chance exceeds once in a thousand.
    let [a, b] = &found;
    assert_eq!([a.effect.values.len(), b.effect.values.len()], [9, 9]);
    let square = |i: usize| {
        let variance = a.covariance[(i, i)] + b.covariance[(i, i)];
        (a.effect.values[i] - b.effect.values[i]).powi(2) / variance
    };
    let chi2: f64 = (0..9).map(square).sum();
    assert!(chi2 < 27.9);
}
