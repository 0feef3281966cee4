//! Whether recordings belong to one unit and were recorded alike.

use mimu_recording::{Error, Manifest, Result, are_two_units};

/// A key of a manifest, and its value as a person reads it.
pub type Setting = (&'static str, fn(&Manifest) -> String);

/// The unit of the readings.
pub const RAW_UNIT: Setting = ("raw_unit", |m| m.raw_unit.to_string());
pub(crate) const REFERENCE: Setting = ("reference", |m| m.reference.to_string());
pub(crate) const SAMPLE_RATE: Setting = ("sample_rate_hz", |m| m.sample_rate_hz.to_string());

/// Whether two units have these numbers, or if one has none, these names.
pub(crate) fn are_others(
    [ours, theirs]: [Option<&str>; 2],
    [our_name, their_name]: [&str; 2],
) -> bool {
    match (ours, theirs) {
        (Some(a), Some(b)) => !a.eq_ignore_ascii_case(b),
        _ => are_two_units(our_name, their_name),
    }
}

/// Refuses recordings, each with its place, of which two belong to two units or differ in one of the `settings`. An unnamed device is like any other, and
/// only a second named one shows that there are two.
///
/// # Errors
/// Such recordings.
pub fn refuse_unlike(all: &[(&str, &Manifest)], settings: &[Setting]) -> Result<()> {
    const DEVICE: Setting = ("device", |m| format!("{:?}", m.device));
    for (k, (first, ours)) in all.iter().enumerate() {
        for (place, theirs) in &all[k + 1..] {
            let ids = [ours.unit_id(), theirs.unit_id()];
            let other = are_others(ids, [&ours.device, &theirs.device]).then_some(&DEVICE);
            let unlike = settings.iter().find(|(_, of)| of(ours) != of(theirs));
            if let Some((what, of)) = other.or(unlike) {
                return Err(Error::new(
                    place,
                    format!(
                        "its {what} is {}, and that of {first} is {}",
                        of(theirs),
                        of(ours)
                    ),
                    "give recordings of one unit with the same settings; if they are of one unit, write the same device in both",
                ));
            }
        }
    }
    Ok(())
}
