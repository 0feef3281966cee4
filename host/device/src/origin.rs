//! Unit, sensors, time and recording of a calibration, as the file and the device write them.

use jiff::Timestamp;
use mimu::calibration::Calibration;
use mimu_core::stored::{Origin, RawUnit, Setting};
use mimu_core::wire::Triad;
use mimu_recording::SensorSetting;

/// Origin of a calibration file; `place` is its path. If the unit's number is missing, a sentence is added to `warnings`.
pub(super) fn of(calibration: &Calibration, place: &str, warnings: &mut Vec<String>) -> Origin {
    let unit_id = calibration.unit_id.as_deref().and_then(bytes);
    if unit_id.is_none() {
        warnings.push(format!(
            "{place}: the calibration does not contain the number of its unit, so it may belong to another one; fit a recording of `mimu record`, or write unit_id into the file"
        ));
    }
    let seconds = |date: &Option<String>| {
        let time: Timestamp = date.as_deref()?.parse().ok()?;
        u64::try_from(time.as_second()).ok()
    };
    let raw_unit = RawUnit::named(&calibration.recording.raw_unit.to_string());
    Origin {
        unit_id,
        created_s: seconds(&calibration.created),
        samples_sha256: calibration.recording.sha256.as_deref().and_then(bytes),
        trimmed_s: seconds(&calibration.trimmed),
        raw_unit,
        settings: settings(calibration, raw_unit),
    }
}

/// The settings of the sensors of a calibration file.
fn settings(
    calibration: &Calibration,
    raw_unit: Option<RawUnit>,
) -> Option<mimu_core::PerSensor<Setting>> {
    let (sensors, unit) = calibration.sensors.as_ref().zip(raw_unit)?;
    let of = |of: &SensorSetting| {
        Setting::of(&Triad {
            part: &of.part,
            unit: unit.name(),
            bits: of.bits,
            range: of.range as f32,
            filter: &of.filter,
            ..Triad::default()
        })
    };
    Some(mimu_core::PerSensor {
        gyro: of(&sensors.gyro),
        accel: of(&sensors.accel),
    })
}

/// Decodes N pairs of hexadecimal digits. `None` if they are no such digits, or all zero, which means unknown.
fn bytes<const N: usize>(digits: &str) -> Option<[u8; N]> {
    let mut bytes = [0; N];
    let (pairs, _) = digits.as_bytes().as_chunks::<2>();
    if digits.len() != 2 * N || !digits.bytes().all(|b| b.is_ascii_hexdigit()) {
        return None;
    }
    for (byte, pair) in bytes.iter_mut().zip(pairs) {
        let pair = std::str::from_utf8(pair).ok()?;
        *byte = u8::from_str_radix(pair, 16).ok()?;
    }
    Some(bytes).filter(|bytes| *bytes != [0; N])
}

/// Bytes as hexadecimal digits.
pub(super) fn digits<const N: usize>(bytes: &[u8; N]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Seconds of UTC since 1970 as RFC 3339.
pub(super) fn date(seconds: u64) -> Option<String> {
    let time = Timestamp::from_second(i64::try_from(seconds).ok()?).ok()?;
    Some(time.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_and_dates_come_back() {
        let id = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 0xab];
        assert_eq!(digits(&id), "000102030405060708090aab");
        assert_eq!(bytes("000102030405060708090AAB"), Some(id));
        for bad in [
            "",
            "00",
            "+00102030405060708090aab",
            "000000000000000000000000",
        ] {
            assert_eq!(bytes::<12>(bad), None, "{bad}");
        }
        // 2026-01-01 is 56 years of 365 days and 14 leap days after 1970.
        let seconds = (56 * 365 + 14) * 86_400;
        assert_eq!(date(seconds).as_deref(), Some("2026-01-01T00:00:00Z"));
        let back = "2026-01-01T01:00:00+01:00".parse::<Timestamp>().unwrap();
        assert_eq!(back.as_second() as u64, seconds);
    }
}
