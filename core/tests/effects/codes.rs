//! Errors of a converter that depend on the code.

use mimu_core::compensation::Sample;
use mimu_core::effects::{DeviceEffect, EffectError, Effects, FARTHEST_ZERO};
use mimu_core::{PerSensor, Sensor};
use nalgebra::Vector3;

use super::{Eight, Mounted, si, with};

/// A sample in which this triad reads `own`.
fn of(sensor: Sensor, own: Vector3<f64>, other: Vector3<f64>) -> Sample<f64> {
    PerSensor::from_fn(|s| if s == sensor { own } else { other })
}

#[test]
fn a_converter_with_wrong_weights_reads_as_one_with_right_ones() {
    let unit = Mounted::crooked();
    let code_v = 3.3 / 65536.0;
    // Errors of bits 15 to 7, in units of the weight of bit 15: up to 6 codes.
    let errors = [
        1.8e-4, -1.2e-4, 1.5e-4, -1.7e-4, 1.0e-4, 0.6e-4, -0.9e-4, 1.1e-4, -0.4e-4,
    ];
    let weight = 32768.0 * code_v;
    for sensor in [Sensor::Gyro, Sensor::Accel] {
        let effect = DeviceEffect::code(sensor, None, &errors, weight, 0.0).unwrap();
        let effects = with(&[effect], &unit.inverse());
        let (mut wrong, mut largest, all) = (0, 0.0_f64, 20_000);
        for k in 0..all {
            let k = f64::from(k);
            let input = Vector3::new((0.7 * k).sin(), (1.1 * k).cos(), (1.7 * k).sin()) * 2.0;
            let codes = (unit.read(&input, &Vector3::zeros()) / code_v).map(f64::round);
            let err = codes.map(|code| {
                let bits = code as i64;
                let set = |k: usize| (bits >> (15 - k)) & 1 == 1;
                (0..9).filter(|k| set(*k)).map(|k| errors[k]).sum::<f64>() * weight
            });
            let (right, read) = (codes * code_v, codes * code_v + err);
            let other = Vector3::repeat(1.25);
            let sample = of(sensor, read, other);
            let clean = effects.without_code_errors(&sample);
            let left = clean.gyro + clean.accel - other - right;
            wrong += u32::from(left.norm() > 1e-9);
            largest = largest.max((read - right).norm());
        }
        // Within the error of the last bit around its transition, 10 of 128 codes, either side may be chosen.
        assert!(
            largest > 5e-4 && wrong < all / 10,
            "{wrong} of {all}, {largest:e}"
        );
    }
}

#[test]
fn converters_of_their_own_whose_readings_have_a_bias_subtracted_read_as_right_ones() {
    // Reference, V; the subtracted bias, V, not a multiple of a code; and errors of bits 15 to 7, in units of bit 15.
    let converters = [
        (
            3.3,
            1.503_217,
            [2e-4, -1e-4, 0.0, 1.5e-4, 0.0, 0.0, 0.0, 0.0, 0.0],
        ),
        (
            5.0,
            -0.277_731,
            [0.0, 3e-4, 0.0, 0.0, -1e-4, 0.0, 0.0, 1e-4, 0.0],
        ),
        (
            2.048,
            1.9,
            [-3e-4, 0.0, 1e-4, 0.0, 0.0, 2e-4, 0.0, 0.0, -1e-4],
        ),
    ];
    for sensor in [Sensor::Gyro, Sensor::Accel] {
        // The order of the axes must not matter.
        let effects = [2, 0, 1].map(|axis: usize| {
            let (volts, less, errors) = &converters[axis];
            DeviceEffect::code(sensor, Some(axis), errors, volts / 2.0, -less).unwrap()
        });
        let effects = with(&effects, &si());
        let (mut wrong, mut err) = ([0; 3], [0; 3]);
        let all = 20_000_u32;
        for k in 0..all {
            // All codes of the converters; each axis steps by a different amount.
            let code = [40_503, 25_717, 51_001].map(|pace| (k * pace + 977) % 65_536);
            let (mut right, mut read) = (Vector3::zeros(), Vector3::zeros());
            for (axis, (volts, less, errors)) in converters.iter().enumerate() {
                // A converter adds the weights of its bits.
                let (mut sound, mut faulty) = (0.0, 0.0);
                let mut weight = volts / 2.0;
                for bit in (0..16).rev() {
                    if code[axis] & (1 << bit) != 0 {
                        sound += weight;
                        faulty += weight + errors.get(15 - bit).unwrap_or(&0.0) * volts / 2.0;
                    }
                    weight /= 2.0;
                }
                (right[axis], read[axis]) = (sound - less, faulty - less);
            }
            let other = Vector3::new(0.1, -0.2, 0.3);
            let clean = effects.without_code_errors(&of(sensor, read, other));
            let left = clean.gyro + clean.accel - other - right;
            for axis in 0..3 {
                wrong[axis] += u32::from(left[axis].abs() > 1e-9);
                err[axis] += u32::from((read - right)[axis].abs() > 1e-9);
            }
        }
        for axis in 0..3 {
            // Within the error around a transition, up to 10 of 128 codes, either side may be chosen.
            assert!(err[axis] > all / 2, "{axis}: {} of {all}", err[axis]);
            assert!(wrong[axis] < all / 25, "{axis}: {} of {all}", wrong[axis]);
        }
    }
}

#[test]
fn readings_above_a_missing_range_of_codes_move_down_by_it() {
    let (range, missing) = (3.0, 7e-4);
    // Steps at any readings, also below 0: a different one for each axis, and one for all axes.
    let steps = [0.437_219, -0.9, 1.1];
    let weight = 2.0 * range;
    let step = |axis, at: f64| {
        let mut errors = [0.0; 9];
        errors[0] = missing / weight;
        DeviceEffect::code(Sensor::Accel, axis, &errors, weight, at - weight).unwrap()
    };
    let each = with(&[0, 1, 2].map(|i| step(Some(i), steps[i])), &si());
    let alone = with(&[step(Some(1), steps[1])], &si());
    let alike = with(&[step(None, steps[0])], &si());
    let gyro = Vector3::repeat(0.7);
    // Readings less than 1/65536 of the weight below the step are not tested; rounding in single precision is an eighth of that.
    let near = 1.15 * weight / 65_536.0;
    let mut above = 0;
    for k in 0..60_000 {
        // Over the range, and as close to the steps as tested, on them and beside them.
        let right = match k {
            0 => Vector3::from(steps),
            1 => Vector3::from(steps.map(|at| at - 1.01 * near)),
            2 => Vector3::repeat(steps[0]),
            _ => {
                Vector3::from_fn(|i, _| -1.5 + f64::from((k * (7 + 2 * i as u32)) % 60_000) * 5e-5)
            }
        };
        // The missing codes are never read.
        let skip = |right: f64, at: f64| right + if right >= at { missing } else { 0.0 };
        let told = |right: f64, at: f64| right >= at || right < at - near;
        let read = Vector3::from_fn(|i, _| skip(right[i], steps[i]));
        let accel = each
            .without_code_errors(&Sample { gyro, accel: read })
            .accel;
        let clean_alone = alone.without_code_errors(&Sample { gyro, accel: read });
        assert_eq!(
            (clean_alone.gyro, clean_alone.accel.x, clean_alone.accel.z),
            (gyro, read.x, read.z)
        );
        let same = right.map(|right| skip(right, steps[0]));
        let accel_alike = alike
            .without_code_errors(&Sample { gyro, accel: same })
            .accel;
        for i in 0..3 {
            if told(right[i], steps[i]) {
                above += u32::from(right[i] >= steps[i]);
                assert!((accel[i] - right[i]).abs() < 1e-12, "{i}: {}", right[i]);
            }
            if told(right[i], steps[0]) {
                assert!(
                    (accel_alike[i] - right[i]).abs() < 1e-12,
                    "{i}: {}",
                    right[i]
                );
            }
        }
        if told(right.y, steps[1]) {
            assert!((clean_alone.accel.y - right.y).abs() < 1e-12, "{}", right.y);
        }
    }
    assert!(above > 60_000 && above < 120_000, "{above}");
}

#[test]
fn whether_a_second_look_is_kept_is_asked_of_each_axis() {
    // The weights make the last bit worth 1. On one axis the bits of 4, 2 and 1 have errors; on the other the error of bit 128 is far smaller than
    // those of lower bits.
    let small = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.4, 1.5, 0.2].map(|e| e / 256.0);
    let large = [0.0, 0.3, 0.0, 0.0, 0.0, 0.0, 5.0, 0.0, 0.0].map(|e| e / 256.0);
    let code =
        |axis, errors| DeviceEffect::code(Sensor::Gyro, Some(axis), errors, 256.0, 0.0).unwrap();
    let effects = with(&[code(0, &large), code(1, &small)], &si());
    // 128.1 is read as 128, whose error is 0.3. Without this error the code would be 127, whose error is 5, so the first correction is kept. 3.8 with
    // errors in the bits of 2 and 1 is read as 5.5, whose bits of 4 and 1 have an error of 1.6. Corrected, it is a 3 again, and the correction
    // becomes 1.7.
    let read = Vector3::new(128.1, 3.8 + 1.7, -9.0);
    let clean = effects.without_code_errors(&of(Sensor::Gyro, read, Vector3::zeros()));
    let expected = Vector3::new(128.1 - 0.3, 3.8, -9.0);
    assert!((clean.gyro - expected).amax() < 1e-12, "{}", clean.gyro);
}

#[test]
fn what_has_no_code_is_the_same_to_the_last_bit_and_what_is_no_reading_does_no_harm() {
    let errors = [1e-3, -2e-3, 3e-3, -4e-3, 5e-3, -6e-3, 7e-3, -8e-3, 9e-3];
    let most: f32 = errors.iter().map(|e: &f32| e.abs()).sum::<f32>() * 1.65;
    let mut effects = Effects::<f32, 8>::new(&PerSensor::both(si())).unwrap();
    let code = DeviceEffect::code(Sensor::Gyro, Some(1), &errors, 1.65, -0.3).unwrap();
    effects.push(code).unwrap();
    let odd = [
        0.0,
        -0.0,
        -1e3,
        -1e30,
        1e30,
        f32::MIN,
        f32::MAX,
        f32::MIN_POSITIVE / 3.0,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::NAN,
    ];
    for value in odd {
        let same = Vector3::repeat(value);
        let read = Sample {
            gyro: same,
            accel: same,
        };
        let clean = effects.without_code_errors(&read);
        for untouched in [
            clean.gyro.x,
            clean.gyro.z,
            clean.accel.x,
            clean.accel.y,
            clean.accel.z,
        ] {
            assert_eq!(untouched.to_bits(), value.to_bits());
        }
        let removed = value - clean.gyro.y;
        assert!(!value.is_finite() || removed.abs() <= most, "{value:e}");
    }
}

#[test]
fn a_code_that_cannot_be_removed_is_refused() {
    let errors = [1e-3; 9];
    let code = |axis, errors: &[f64; 9], weight, zero| {
        DeviceEffect::code(Sensor::Gyro, axis, errors, weight, zero)
    };
    let (none, last) = (f64::NAN, f64::INFINITY);
    for axis in [None, Some(0), Some(2)] {
        for zero in [-FARTHEST_ZERO, FARTHEST_ZERO] {
            assert!(code(axis, &errors, 1.0, zero).is_ok());
            let beyond = code(axis, &errors, 1.0, 1.01 * zero);
            assert_eq!(beyond.err(), Some(EffectError::Value));
        }
        for weight in [0.0, -1.0, none, last] {
            assert_eq!(
                code(axis, &errors, weight, 0.0).err(),
                Some(EffectError::Value)
            );
        }
        for zero in [none, last, -last] {
            assert_eq!(
                code(axis, &errors, 1.0, zero).err(),
                Some(EffectError::Value)
            );
        }
        for (bit, error) in (0..9).flat_map(|bit| [(bit, none), (bit, last)]) {
            let mut errors = errors;
            errors[bit] = error;
            assert_eq!(
                code(axis, &errors, 1.0, 0.0).err(),
                Some(EffectError::Value)
            );
        }
    }
    // Finite numbers whose product under- or overflows single precision.
    let single =
        |error, weight| DeviceEffect::code(Sensor::Gyro, None, &[error; 9], weight, 0.0_f32);
    for (error, weight) in [(1e-3, 1e-37), (1e20, 1e20), (1e38, 1.0)] {
        assert_eq!(single(error, weight).err(), Some(EffectError::Value));
    }
    for axis in [3, 255, usize::MAX] {
        assert_eq!(
            code(Some(axis), &errors, 1.0, 0.0).err(),
            Some(EffectError::Value)
        );
    }

    // A converter for each axis of each triad. A refused one leaves the others unchanged.
    let rank = |axis, size: f64| {
        DeviceEffect::code(
            Sensor::Gyro,
            axis,
            &[size, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            1.0,
            0.0,
        )
    };
    let mut effects = with(&[rank(Some(1), 0.25).unwrap()], &si());
    let read = of(Sensor::Gyro, Vector3::repeat(1.5), Vector3::repeat(1.5));
    let removed = |effects: &Eight| read.gyro - effects.without_code_errors(&read).gyro;
    for (axis, result, after) in [
        (None, Err(EffectError::Full), [0.0, 0.25, 0.0]),
        (Some(1), Err(EffectError::Full), [0.0, 0.25, 0.0]),
        (Some(2), Ok(()), [0.0, 0.25, 0.125]),
        (None, Err(EffectError::Full), [0.0, 0.25, 0.125]),
        (Some(0), Ok(()), [0.125, 0.25, 0.125]),
        (Some(0), Err(EffectError::Full), [0.125, 0.25, 0.125]),
    ] {
        assert_eq!(effects.push(rank(axis, 0.125).unwrap()), result);
        assert_eq!(removed(&effects), Vector3::from(after));
    }
    let other = DeviceEffect::code(Sensor::Accel, None, &errors, 1.0, 0.0).unwrap();
    assert_eq!(effects.push(other), Ok(()));
    assert_eq!(effects.push(other), Err(EffectError::Full));
}

#[test]
fn codes_repeat_below_the_zero_as_they_do_above() {
    let errors = [0.25, 0.0, 0.03, 0.0, 0.0, 0.0, 0.0, 0.0, 0.002];
    let effects = with(
        &[DeviceEffect::code(Sensor::Accel, None, &errors, 1.0, 5.0).unwrap()],
        &si(),
    );
    let removed = |u: f64| {
        let read = of(Sensor::Accel, Vector3::repeat(u), Vector3::zeros());
        u - effects.without_code_errors(&read).accel.x
    };
    for k in 0..200 {
        let u = 5.0 + 0.01 * f64::from(k) + 0.003;
        for periods in 1..=12 {
            let below = removed(u - 2.0 * f64::from(periods));
            assert!((below - removed(u)).abs() < 1e-12, "{u} {periods}: {below}");
        }
    }
}
