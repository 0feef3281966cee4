//! Judgements of clean sessions, and of sessions with an effect of five times the noise. `blind judged` counts hundreds of each kind.

use mimu::judgement::JudgementKind;
use mimu_tests::judged::{Judged, Kind};
use rayon::prelude::*;

/// Names and judgements of those among `sessions` of the kinds whose names contain one of `names` that `is_wrong` selects.
fn wrong<F>(names: &[&str], sessions: u64, is_wrong: F) -> Vec<String>
where
    F: Fn(&Kind, u64) -> Vec<String> + Sync,
{
    let kinds: Vec<Kind> = Kind::all()
        .into_iter()
        .filter(|k| names.iter().any(|n| k.name().contains(n)))
        .collect();
    assert!(kinds.len() >= names.len());
    let jobs = kinds
        .iter()
        .flat_map(|k| (0..sessions).map(move |s| (k, s)));
    let jobs: Vec<(&Kind, u64)> = jobs.collect();
    let all = jobs.into_par_iter();
    all.flat_map_iter(|(kind, seed)| is_wrong(kind, seed))
        .collect()
}

fn told(kind: &Kind, seed: u64, what: &str, judged: &Judged) -> String {
    let (name, judged, reason) = (kind.name(), judged.name(), &judged.reason);
    format!("{name}, seed {seed}, {what}: {judged} ({reason})")
}

fn objected(kind: &Kind, seed: u64) -> Vec<String> {
    let clean = kind.clean(seed);
    let all = [("fit", Some(clean.judged)), ("verified", clean.verified)];
    let given = all.into_iter().filter_map(|(what, j)| Some((what, j?)));
    given
        .filter(|(_, judged)| !judged.is_unobjected())
        .map(|(what, judged)| told(kind, seed, what, &judged))
        .collect()
}

fn called_good(kind: &Kind, seed: u64) -> Vec<String> {
    let with_effect = kind.with_effect(seed, false).expect("it shows");
    let all = [
        ("fit", Some(with_effect.judged)),
        ("verified", with_effect.verified),
    ];
    let given = all.into_iter().filter_map(|(what, j)| Some((what, j?)));
    given
        .filter(|(_, judged)| judged.kind == Some(JudgementKind::Good))
        .map(|(what, judged)| told(kind, seed, &format!("{} {what}", with_effect.id), &judged))
        .collect()
}

#[test]
fn clean_sessions_are_good_or_untested_and_so_is_their_file_on_another_session() {
    let names = [
        "by hand, 18 poses, 20 Hz",
        "by hand, 24 poses, 100 Hz",
        "table, consumer",
    ];
    let wrong = wrong(&names, 1, objected);
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn an_effect_of_five_times_the_noise_is_never_called_good() {
    let wrong = wrong(
        &["by hand, 24 poses, 100 Hz", "table, consumer"],
        1,
        called_good,
    );
    assert!(wrong.is_empty(), "{wrong:#?}");
}
