//! Calibrations as bytes, and interpolation between nodes, against a reader and a line written out here in double precision.

use mimu_core::compensation::{Affine, Compensation, Sample};
use mimu_core::effects::{Sensor, Variable};
use mimu_core::single;
use mimu_core::stored::{NODES, Origin, ROOM, Record, Refused, decode, encode, hash};
use mimu_core::table::{self, Node, Place, Table};
use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;

fn affine(numbers: &[f32]) -> Affine<f32> {
    Affine {
        matrix: Matrix3::from_row_slice(&numbers[..9]),
        offset: Vector3::from_row_slice(&numbers[9..12]),
    }
}

/// A node of 24 numbers: C by rows and o of the gyro, then of the accelerometer.
fn node(temp_c: f32, numbers: &[f32; 24]) -> Node<f32> {
    Node {
        temp_c,
        model: Compensation {
            gyro: affine(&numbers[..12]),
            accel: affine(&numbers[12..]),
        },
    }
}

fn numbers_of(model: &Compensation<f32>) -> Vec<f32> {
    [&model.gyro, &model.accel]
        .into_iter()
        .flat_map(|a| {
            let rows = a.matrix.transpose();
            let all: Vec<f32> = rows.iter().chain(a.offset.iter()).copied().collect();
            all
        })
        .collect()
}

fn regular() -> [f32; 24] {
    std::array::from_fn(|k| match k {
        0 | 4 | 8 => 3.5,
        12 | 16 | 20 => 12.0,
        k => 0.01 * k as f32,
    })
}

fn bytes(nodes: &[Node<f32>], effects: &[Record<'_>]) -> Vec<u8> {
    let mut out = [0; 4096];
    let matrix = Matrix3::from_diagonal_element(3.5);
    let length = encode(
        &Origin::UNKNOWN,
        [&matrix, &matrix],
        nodes,
        effects,
        &mut out,
    )
    .unwrap();
    out[..length].to_vec()
}

/// CRC-32/ISO-HDLC, bit by bit from its definition.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            crc >> 1 ^ if crc & 1 == 1 { 0xEDB8_8320 } else { 0 }
        })
    })
}

fn resealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let end = bytes.len() - 4;
    let check = crc32(&bytes[..end]);
    bytes[end..].copy_from_slice(&check.to_le_bytes());
    bytes
}

#[test]
fn the_layout_is_that_of_the_table_in_the_documentation() {
    let effects = [
        Record::Named {
            id: "gyro_warm_up",
            coefficients: &[1.0, 2.0, 3.0],
            nonlinear: Some(60.0),
        },
        Record::Term {
            sensor: Sensor::Accel,
            axis: 1,
            coefficient: -2.0,
            variables: &[Variable::RateX, Variable::ForceY],
        },
        Record::Code {
            sensor: Sensor::Gyro,
            axis: None,
            weight: 1.65,
            zero: 0.0,
            errors: &[0.001, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.0005],
        },
        Record::Code {
            sensor: Sensor::Accel,
            axis: Some(2),
            weight: 2.0,
            zero: -1.25,
            errors: &[0.0, -0.002, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        },
    ];
    // Sensors that look along -y, x and z, 2, 4 and 0.5 V per unit; and C of a gyro that looks along y, -x and z.
    let accel = Matrix3::new(0.0, 0.25, 0.0, -0.5, 0.0, 0.0, 0.0, 0.0, 2.0);
    let gyro = Matrix3::new(0.0, -2.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.5);
    let mut all = [0; 4096];
    let one = [node(25.0, &regular())];
    let origin = Origin {
        unit_id: Some([1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]),
        // 2026-01-01, in seconds since 1970.
        created_s: Some(0x6955_b900),
        samples_sha256: Some([0xab; 32]),
    };
    let length = encode(&origin, [&gyro, &accel], &one, &effects, &mut all).unwrap();
    let all = &all[..length];
    let mut expected = b"mimc\x04\x00".to_vec();
    expected.extend((all.len() as u16).to_le_bytes());
    expected.extend([1, 4, 0, 0]);
    expected.extend([1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]);
    expected.extend([0x00, 0xb9, 0x55, 0x69, 0, 0, 0, 0]);
    expected.extend([0xab; 32]);
    // D by rows, and R: of right angles the one is the other transposed.
    for rows in [
        [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
        [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
        [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
        [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
    ] {
        for value in rows.as_flattened() {
            expected.extend((*value as f32).to_le_bytes());
        }
    }
    expected.extend(25.0_f32.to_le_bytes());
    for value in regular() {
        expected.extend(value.to_le_bytes());
    }
    expected.extend(b"\x00\x0cgyro_warm_up\x03");
    for value in [1.0_f32, 2.0, 3.0, 60.0] {
        expected.extend(value.to_le_bytes());
    }
    expected.extend([1, 1, 1, 2, 1, 5]);
    expected.extend((-2.0_f32).to_le_bytes());
    // Half of the converter's 3.3 V, and nine bits.
    expected.extend([2, 0, 3]);
    let all_axes = [
        1.65_f32, 0.0, 0.001, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.0005,
    ];
    for value in all_axes {
        expected.extend(value.to_le_bytes());
    }
    expected.extend([2, 1, 2]);
    let one_axis = [
        2.0_f32, -1.25, 0.0, -0.002, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    ];
    for value in one_axis {
        expected.extend(value.to_le_bytes());
    }
    expected.extend(crc32(&expected).to_le_bytes());
    assert_eq!(all, &expected[..]);
    let stored = decode(all).unwrap();
    assert_eq!((stored.table.len(), stored.effect_count), (1, 4));
    assert_eq!(stored.origin, origin);
    // 384 of 256 codes to 1.65 V are bits 0 and -1, and 255 are bits -1 to -8; half a code more, so that no error turns any.
    let right = Vector3::new(384.5, 0.5, 255.5) * (1.65 / 256.0);
    let read = Sample {
        gyro: right + Vector3::new(0.001, 0.0, -0.0005) * 1.65,
        // 2.25 V at the converter of the third axis, whose second bit is of 1 V and not set; and 1.25 V, where it is.
        accel: Vector3::new(2.475, 0.0, 1.0),
    };
    let clean = single::without_code_errors(stored.effects.as_ref().unwrap(), &read);
    assert_eq!(clean.accel, read.accel);
    assert!((clean.gyro - right).amax() < 1e-6, "{}", clean.gyro);
    let set = Sample {
        accel: Vector3::new(2.475, 0.0, 0.0),
        ..read
    };
    let clean = single::without_code_errors(stored.effects.as_ref().unwrap(), &set);
    assert_eq!(clean.accel, Vector3::new(2.475, 0.0, 0.004));
}

/// The same as version 3 has it: no origin, and its own number.
fn of_version_3(bytes: &[u8]) -> Vec<u8> {
    let mut older = [&bytes[..12], &bytes[64..]].concat();
    older[4] = 3;
    let length = older.len() as u16;
    older[6..8].copy_from_slice(&length.to_le_bytes());
    resealed(older)
}

#[test]
fn a_calibration_of_version_3_is_read_as_one_of_no_unit() {
    let nodes = [node(0.0, &regular()), node(50.0, &regular())];
    let effects = [Record::Named {
        id: "gyro_warm_up",
        coefficients: &[1.0, 2.0, 3.0],
        nonlinear: Some(60.0),
    }];
    let older = decode(&of_version_3(&bytes(&nodes, &effects))).unwrap();
    assert_eq!(older.origin, Origin::UNKNOWN);
    assert_eq!((older.table.len(), older.effect_count), (2, 1));
    let mut oldest = of_version_3(&bytes(&nodes, &effects));
    oldest[4] = 2;
    let refused = decode(&resealed(oldest)).err();
    assert_eq!(refused, Some(Refused::Version { found: 2 }));
}

#[test]
fn what_is_not_known_of_an_origin_is_zero() {
    let unknown = bytes(&[node(25.0, &regular())], &[]);
    assert_eq!(unknown[12..64], [0; 52]);
    assert_eq!(decode(&unknown).unwrap().origin, Origin::UNKNOWN);
}

#[test]
fn a_code_of_no_axis_is_not_one_of_all() {
    let code = |axis| Record::Code {
        sensor: Sensor::Accel,
        axis,
        weight: 1.0,
        zero: 0.0,
        errors: &[0.0; 9],
    };
    let refused = |all: &[Record<'_>]| decode(&bytes(&[node(0.0, &regular())], all)).err();
    assert_eq!(refused(&[code(None)]), None);
    let three = [0, 1, 2].map(|axis| code(Some(axis)));
    assert_eq!(refused(&three), None);
    for axis in 3..=u8::MAX {
        let at = Some(Refused::EffectValue { at: 0 });
        assert_eq!(refused(&[code(Some(axis))]), at, "{axis}");
    }
    let full = Some(Refused::EffectsFull { at: 1 });
    assert_eq!(refused(&[code(None), code(Some(1))]), full);
    assert_eq!(refused(&[code(Some(1)), code(None)]), full);
}

#[test]
fn everything_at_its_longest_has_room() {
    let nodes: Vec<_> = (0..NODES).map(|k| node(k as f32, &regular())).collect();
    let named = |id, coefficients| Record::Named {
        id,
        coefficients,
        nonlinear: None,
    };
    let mut all = Vec::new();
    for (fast, slow) in [
        ("gyro_cross_axis_product", "gyro_thermal_misalignment"),
        ("accel_cross_axis_product", "accel_thermal_misalignment"),
    ] {
        all.extend([named(fast, &[0.0; 9]); ROOM]);
        all.extend([named(slow, &[0.0; 6]); ROOM]);
    }
    for sensor in [Sensor::Gyro, Sensor::Accel] {
        all.extend([0, 1, 2].map(|axis| Record::Code {
            sensor,
            axis: Some(axis),
            weight: 1.0,
            zero: 0.0,
            errors: &[0.0; 9],
        }));
    }
    let stored = decode(&bytes(&nodes, &all)).unwrap();
    assert_eq!(stored.effect_count, 2 * (2 * ROOM as u8 + 3));
}

#[test]
fn the_hash_is_crc_64_xz() {
    // The check value of the catalogue of CRC algorithms.
    assert_eq!(hash(b"123456789"), 0x995d_c9bb_df19_39fa);
    let one = bytes(&[node(25.0, &regular())], &[]);
    let two = bytes(&[node(26.0, &regular())], &[]);
    assert_ne!(hash(&one), hash(&two));
}

#[test]
fn every_refusal_has_its_name() {
    let good = bytes(&[node(0.0, &regular()), node(50.0, &regular())], &[]);
    let with = |at: usize, value: u8| {
        let mut bytes = good.clone();
        bytes[at] = value;
        resealed(bytes)
    };
    let refused = |bytes: &[u8]| decode(bytes).err();
    assert_eq!(refused(&good), None);
    assert_eq!(refused(b""), Some(Refused::NotACalibration));
    assert_eq!(refused(&with(0, b'x')), Some(Refused::NotACalibration));
    assert_eq!(refused(&with(4, 1)), Some(Refused::Version { found: 1 }));
    assert_eq!(refused(&with(8, 0)), Some(Refused::Node { at: 0 }));
    assert_eq!(refused(&with(8, 1)), Some(Refused::Length));
    assert_eq!(refused(&with(8, 3)), Some(Refused::Length));
    for end in 4..good.len() {
        assert_eq!(refused(&good[..end]), Some(Refused::Length), "{end}");
    }
    let longer = [&good[..], &[0]].concat();
    assert_eq!(refused(&longer), Some(Refused::Length));
    let nodes = |temperatures: &[f32]| {
        let all: Vec<_> = temperatures.iter().map(|t| node(*t, &regular())).collect();
        refused(&bytes(&all, &[]))
    };
    assert_eq!(nodes(&[0.0, 0.0]), Some(Refused::Node { at: 1 }));
    assert_eq!(nodes(&[0.0, 9.0, 5.0]), Some(Refused::Node { at: 2 }));
    assert_eq!(nodes(&[f32::NAN]), Some(Refused::Node { at: 0 }));
    let many: Vec<f32> = (0..=NODES).map(|k| k as f32).collect();
    assert_eq!(nodes(&many[..NODES]), None);
    assert_eq!(nodes(&many), Some(Refused::Node { at: 17 }));
    let flat = Matrix3::zeros();
    let mut out = [0; 4096];
    let length = encode(
        &Origin::UNKNOWN,
        [&flat, &flat],
        &[node(0.0, &regular())],
        &[],
        &mut out,
    )
    .unwrap();
    assert_eq!(refused(&out[..length]), Some(Refused::Singular));

    let named = |id, coefficients| Record::Named {
        id,
        coefficients,
        nonlinear: None,
    };
    let one = [node(0.0, &regular())];
    let effects = |all: &[Record<'_>]| refused(&bytes(&one, all));
    let known = named("gyro_scale_cubic", &[0.0; 3]);
    let unknown = named("gyro_of_the_future", &[0.0; 3]);
    assert_eq!(
        effects(&[known, unknown]),
        Some(Refused::EffectUnknown { at: 1 })
    );
    let short = named("gyro_scale_cubic", &[0.0; 2]);
    assert_eq!(effects(&[short]), Some(Refused::EffectValue { at: 0 }));
    let eight = [known; 8];
    assert_eq!(effects(&eight), None);
    let nine = [known; 9];
    assert_eq!(effects(&nine), Some(Refused::EffectsFull { at: 8 }));
}

#[test]
fn every_flipped_bit_is_noticed() {
    let good = bytes(&[node(0.0, &regular()), node(50.0, &regular())], &[]);
    for bit in 0..8 * good.len() {
        let mut bytes = good.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        assert!(decode(&bytes).is_err(), "bit {bit}");
    }
}

#[test]
fn outside_the_nodes_the_nearest_is_used_and_said_so() {
    let low = regular();
    let high = low.map(|v| 2.0 * v);
    let table = Table::<f32, 16>::new([node(0.0, &low), node(50.0, &high)]).unwrap();
    let mut state = table.state();
    // At 25 °C to begin with: halfway.
    assert_eq!(numbers_of(&state.model)[0], 1.5 * low[0]);
    for (temp_c, numbers, place) in [
        (-1.0, low, Place::Below),
        (0.0, low, Place::Inside),
        (50.0, high, Place::Inside),
        (51.0, high, Place::Above),
    ] {
        table.follow(&mut state, temp_c);
        assert_eq!(numbers_of(&state.model), numbers);
        assert_eq!(state.place, place);
    }
    table.follow(&mut state, f32::NAN);
    assert_eq!(state.place, Place::Above);
    let alone = Table::<f32, 16>::new([node(0.0, &low)]).unwrap();
    alone.follow(&mut state, 90.0);
    assert_eq!(state.place, Place::Inside);
    let none = Table::<f32, 16>::new([]);
    assert_eq!(none.err(), Some(table::Refused::Count));
}

proptest! {
    /// The version for the device, to the last bit.
    #[test]
    fn compensation_on_the_device_is_that_of_the_model(
        numbers in prop::collection::vec(-20.0_f32..20.0, 24), raw in prop::collection::vec(0.0_f32..5.0, 6),
    ) {
        let model = node(0.0, &numbers.try_into().unwrap()).model;
        let raw = Sample {
            gyro: Vector3::new(raw[0], raw[1], raw[2]),
            accel: Vector3::new(raw[3], raw[4], raw[5]),
        };
        prop_assert_eq!(single::compensate(&model, &raw), model.apply(&raw));
    }

    /// Every number on the line between its neighbours, in double precision.
    #[test]
    fn between_nodes_everything_is_linear(
        steps in prop::collection::vec(0.5_f32..30.0, 1..16),
        values in prop::collection::vec(-20.0_f32..20.0, 24 * 16),
        at in 0.0..1.0_f64,
    ) {
        let mut temp_c = -40.0;
        let mut nodes = Vec::new();
        for (k, step) in steps.iter().enumerate() {
            let numbers: [f32; 24] = values[24 * k..24 * k + 24].try_into().unwrap();
            nodes.push(node(temp_c, &numbers));
            temp_c += step;
        }
        let table = Table::<f32, 16>::new(nodes.clone()).unwrap();
        let (first, last) = (f64::from(nodes[0].temp_c), f64::from(nodes[nodes.len() - 1].temp_c));
        let wanted = (first + at * (last - first)) as f32;
        let mut state = table.state();
        table.follow(&mut state, wanted);
        let t = f64::from(wanted);
        let pair = nodes.windows(2).find(|w| t <= f64::from(w[1].temp_c));
        let found = numbers_of(&state.model);
        for k in 0..24 {
            let of = |n: &Node<f32>| (f64::from(n.temp_c), f64::from(numbers_of(&n.model)[k]));
            let expected = match pair {
                Some(w) => {
                    let ((t0, v0), (t1, v1)) = (of(&w[0]), of(&w[1]));
                    v0 + (v1 - v0) * (t - t0) / (t1 - t0)
                }
                None => of(&nodes[0]).1,
            };
            // Two roundings of numbers up to 20, and that of the weight, whose temperatures are up to 440 apart.
            prop_assert!((f64::from(found[k]) - expected).abs() < 2e-5, "{} {}", found[k], expected);
        }
    }

    /// Whatever the bytes are, they are refused or make a calibration; the check is made to hold, or nothing would get past it.
    #[test]
    fn no_bytes_are_too_bad_to_be_refused(noise in prop::collection::vec(any::<u8>(), 0..600), at in 12..360_usize) {
        let named = Record::Named { id: "gyro_scale_cubic", coefficients: &[0.0; 3], nonlinear: None };
        let code = Record::Code { sensor: Sensor::Gyro, axis: Some(1), weight: 1.0, zero: 0.0, errors: &[0.0; 9] };
        let mut all = bytes(&[node(0.0, &regular())], &[named, code]);
        for (place, byte) in all.iter_mut().skip(at).zip(&noise) {
            *place = *byte;
        }
        let _ = decode(&resealed(all));
        let _ = decode(&noise);
    }
}
