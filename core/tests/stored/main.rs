//! Calibrations as bytes, and curves between nodes, against a separate reader, cubics and lines in double precision.

mod table;

use mimu_core::compensation::{Affine, Compensation};
use mimu_core::effects::{self, DeviceEffect, Variable};
use mimu_core::stored::{
    Curves, MAX_LENGTH, NODES, Origin, ROOM, RawUnit, Setting, StoredError, decode, encode, hash,
    read, trim,
};
use mimu_core::table::Node;
use mimu_core::{PerSensor, Sensor};
use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;

fn affine(numbers: &[f32]) -> Affine<f32> {
    Affine {
        matrix: Matrix3::from_row_slice(&numbers[..9]),
        offset: Vector3::from_row_slice(&numbers[9..12]),
    }
}

/// C by rows and o of the gyro, then of the accelerometer.
fn model(numbers: &[f32; 24]) -> Compensation<f32> {
    Compensation {
        gyro: affine(&numbers[..12]),
        accel: affine(&numbers[12..]),
    }
}

/// A node of 24 numbers that do not change with temperature.
fn node(temp_c: f32, numbers: &[f32; 24]) -> Node<f32> {
    Node::constant(temp_c, model(numbers))
}

/// A node whose numbers change with temperature.
fn sloping(temp_c: f32, numbers: &[f32; 24], slopes: &[f32; 24]) -> Node<f32> {
    Node {
        slope: model(slopes),
        ..node(temp_c, numbers)
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

fn bytes(nodes: &[Node<f32>], effects: &[DeviceEffect<f32>]) -> Vec<u8> {
    with_curves(&Curves::of(nodes), effects)
}

fn with_curves(curves: &Curves<'_>, effects: &[DeviceEffect<f32>]) -> Vec<u8> {
    let mut out = [0; MAX_LENGTH];
    let matrix = Matrix3::from_diagonal_element(3.5);
    let matrices = PerSensor::both(&matrix);
    let length = encode(&Origin::UNKNOWN, matrices, curves, effects, &mut out).unwrap();
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
        DeviceEffect::named("gyro_warm_up", &[0.25, 0.5, 0.75], Some(60.0)),
        DeviceEffect::term(Sensor::Accel, 1, -0.5, &[Variable::RateX, Variable::ForceY]),
    ]
    .map(Result::unwrap);
    // Sensors along -y, x and z with 2, 4 and 0.5 V per unit; and C of a gyro with its sensors along y, -x and z.
    let accel = Matrix3::new(0.0, 0.25, 0.0, -0.5, 0.0, 0.0, 0.0, 0.0, 2.0);
    let gyro = Matrix3::new(0.0, -2.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.5);
    let mut all = [0; MAX_LENGTH];
    let slopes: [f32; 24] = std::array::from_fn(|k| -0.001 * k as f32);
    let one = [sloping(25.0, &regular(), &slopes)];
    let curves = Curves {
        nodes: &one,
        range_c: Some([-10.5, 60.25]),
        lags_s: Some([61.5, -4.25].into()),
    };
    let origin = Origin {
        unit_id: Some([1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]),
        // 2026-01-01, in seconds since 1970.
        created_s: Some(0x6955_b900),
        samples_sha256: Some([0xab; 32]),
        // A day later.
        trimmed_s: Some(0x6957_0a80),
        raw_unit: Some(RawUnit::Count),
        settings: Some(PerSensor {
            gyro: Setting {
                range: 0.5,
                id: 0x0102,
            },
            accel: Setting {
                range: -2.0,
                id: 0x1122_3344_5566_7788,
            },
        }),
    };
    let length = encode(
        &origin,
        PerSensor {
            gyro: &gyro,
            accel: &accel,
        },
        &curves,
        &effects,
        &mut all,
    )
    .unwrap();
    let all = &all[..length];
    let mut expected = b"mimc\x07\x00".to_vec();
    expected.extend((all.len() as u16).to_le_bytes());
    // One node, two effects, the TEMP pins; range and lags are known.
    expected.extend([1, 2, 0, 3]);
    expected.extend([1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]);
    expected.extend([0x00, 0xb9, 0x55, 0x69, 0, 0, 0, 0]);
    expected.extend([0xab; 32]);
    expected.extend([0x80, 0x0a, 0x57, 0x69, 0, 0, 0, 0]);
    expected.extend([2, 0, 0, 0]);
    expected.extend([0, 0, 0, 0x3f, 0x02, 0x01, 0, 0, 0, 0, 0, 0]);
    expected.extend([
        0, 0, 0, 0xc0, 0x88, 0x77, 0x66, 0x55, 0x44, 0x33, 0x22, 0x11,
    ]);
    // D by rows, and R: for right angles, one is the transpose of the other.
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
    for value in [-10.5_f32, 60.25, 61.5, -4.25, 25.0] {
        expected.extend(value.to_le_bytes());
    }
    for value in regular().into_iter().chain(slopes) {
        expected.extend(value.to_le_bytes());
    }
    expected.extend(b"\x00\x0cgyro_warm_up\x03");
    for value in [0.25_f32, 0.5, 0.75, 60.0] {
        expected.extend(value.to_le_bytes());
    }
    expected.extend([1, 1, 1, 2, 1, 5]);
    expected.extend((-0.5_f32).to_le_bytes());
    expected.extend(crc32(&expected).to_le_bytes());
    assert_eq!(all, &expected[..]);
    let stored = decode(all).unwrap();
    assert_eq!(
        (stored.compensator.table.len(), stored.effect_count),
        (1, 2)
    );
    assert_eq!(stored.origin, origin);
    assert_eq!(stored.compensator.table.range_c(), Some([-10.5, 60.25]));
    assert_eq!(stored.lags_s, Some([61.5, -4.25].into()));
    assert_eq!(
        stored.compensator.lags.map(|lag| lag.lag_s()),
        PerSensor::from([61.5, -4.25])
    );
}

#[test]
fn a_trim_moves_the_curves_as_they_are_and_nothing_else() {
    let named = DeviceEffect::named("gyro_scale_cubic", &[1e-3; 3], None).unwrap();
    let curves = Curves {
        nodes: &two_nodes(),
        range_c: Some([1.0, 49.0]),
        lags_s: Some([-20.0, 30.0].into()),
    };
    let before = with_curves(&curves, &[named]);
    let (mut after, mut nodes) = (before.clone(), Vec::new());
    let add = PerSensor {
        gyro: [0.01, -0.02, 0.03],
        accel: [0.5, 0.25, -0.125],
    };
    trim(&mut after, add, 0x6957_0a80).unwrap();
    let stored = read(&after, |node| nodes.push(*node), |_| {}).unwrap();
    assert_eq!(stored.origin.trimmed_s, Some(0x6957_0a80));
    for (node, was) in nodes.iter().zip(two_nodes()) {
        let mut expected = was;
        for (_, (triad, add)) in expected.model.as_mut().zip(add) {
            triad.offset += Vector3::from(add);
        }
        assert_eq!(*node, expected);
    }
    // Only the offsets (three in each of two triads of two nodes), the time and the CRC may change.
    let changed = before.iter().zip(&after).filter(|(a, b)| a != b).count();
    assert!(changed <= 4 * 12 + 8 + 4, "{changed}");
    // Back again, apart from rounding.
    trim(&mut after, add.map(|triad| triad.map(|x| -x)), 1).unwrap();
    let mut back = Vec::new();
    read(&after, |node| back.push(*node), |_| {}).unwrap();
    for (node, was) in back.iter().zip(two_nodes()) {
        assert!((node.model.gyro.offset - was.model.gyro.offset).amax() < 1e-6);
        assert!((node.model.accel.offset - was.model.accel.offset).amax() < 1e-6);
    }
    assert_eq!(
        trim(&mut after, PerSensor::both([f32::NAN; 3]), 1).err(),
        Some(StoredError::Node { at: 0 })
    );
}

/// A later version's thermometer and impossible lags or ranges must not be taken for something else.
#[test]
fn a_range_a_lag_or_a_thermometer_that_makes_no_sense_is_refused() {
    let one = [node(25.0, &regular())];
    let refused = |range_c, lags_s| {
        let nodes = &one;
        let curves = Curves {
            nodes,
            range_c,
            lags_s,
        };
        decode(&with_curves(&curves, &[])).err()
    };
    let no = Some(StoredError::Temperature);
    assert_eq!(
        refused(Some([10.0, 40.0]), Some([-120.0, 0.0].into())),
        None
    );
    assert_eq!(
        refused(Some([10.0, 10.0]), Some(PerSensor::both(600.0))),
        None
    );
    assert_eq!(refused(Some([40.0, 10.0]), None), no);
    assert_eq!(refused(Some([f32::NAN, 10.0]), None), no);
    assert_eq!(refused(Some([0.0, f32::INFINITY]), None), no);
    for lag_s in [-121.0, 601.0, f32::NAN] {
        for lags_s in [[lag_s, 0.0], [0.0, lag_s]] {
            assert_eq!(refused(None, Some(lags_s.into())), no, "{lag_s}");
        }
    }
    let mut later = bytes(&one, &[]);
    later[10] = 1;
    assert_eq!(decode(&resealed(later)).err(), no);
}

/// Whatever made them: a program that uploads without checks, or a header bit of a later version.
#[test]
fn numbers_that_no_unit_has_are_refused_by_their_node() {
    let [good, other] = [node(0.0, &regular()), node(50.0, &regular())];
    let refused = |second: Node<f32>| decode(&bytes(&[good, second], &[])).err();
    let at_1 = Some(StoredError::Node { at: 1 });
    assert_eq!(refused(other), None);
    for temp_c in [1e30, 251.0] {
        assert_eq!(refused(Node { temp_c, ..other }), at_1, "{temp_c}");
    }
    let cold = Node {
        temp_c: -101.0,
        ..good
    };
    assert_eq!(
        decode(&bytes(&[cold, other], &[])).err(),
        Some(StoredError::Node { at: 0 })
    );
    let mut alike = Matrix3::from_diagonal_element(3.5);
    // Sensors y and z 0.03° apart.
    alike.set_column(2, &Vector3::new(0.0, 3.5, 0.002));
    let mut one_dead = Matrix3::from_diagonal_element(3.5);
    one_dead[(2, 2)] = 0.0;
    for matrix in [
        Matrix3::zeros(),
        Matrix3::repeat(1.0),
        Matrix3::from_diagonal_element(1e38),
        Matrix3::from_diagonal_element(1.1e4),
        Matrix3::from_diagonal_element(1e-13),
        Matrix3::from_diagonal_element(f32::MIN_POSITIVE / 4.0),
        alike,
        one_dead,
    ] {
        for triad in 0..2 {
            let mut bad = other;
            [&mut bad.model.gyro, &mut bad.model.accel][triad].matrix = matrix;
            assert_eq!(refused(bad), at_1, "{matrix}");
        }
    }
    let mut bad = other;
    bad.model.accel.offset.y = 1e7;
    assert_eq!(refused(bad), at_1);
    let mut bad = other;
    bad.slope.gyro.matrix[(0, 0)] = 4.0;
    assert_eq!(refused(bad), at_1);
    // The most oblique sensors and the largest ratio of scale factors that are accepted.
    let mut odd = other;
    odd.model.gyro.matrix = Matrix3::new(1e-9, 0.0, 0.0, 0.0, 200.0, 140.0, 0.0, 0.0, 0.3);
    assert_eq!(refused(odd), None);
}

#[test]
fn bits_of_a_later_version_and_lags_that_nothing_follows_are_refused() {
    let one = [node(25.0, &regular())];
    for bit in 2..8 {
        let mut later = bytes(&one, &[]);
        later[11] |= 1 << bit;
        assert_eq!(
            decode(&resealed(later)).err(),
            Some(StoredError::Header),
            "{bit}"
        );
    }
    let lag = |lag_s| {
        let curves = Curves {
            lags_s: Some([0.0, lag_s].into()),
            ..Curves::of(&one)
        };
        decode(&with_curves(&curves, &[])).err()
    };
    for lag_s in [1e-30, -1e-30, 9e-4] {
        assert_eq!(lag(lag_s), Some(StoredError::Temperature), "{lag_s}");
    }
    assert_eq!((lag(0.0), lag(1e-3), lag(-1e-3)), (None, None, None));
    for (constant, refused) in [
        (1e-30, true),
        (-60.0, true),
        (1e8, true),
        (f32::INFINITY, true),
        (60.0, false),
    ] {
        let effect = |constant| DeviceEffect::named("gyro_thermal_lag", &[1e-3; 3], Some(constant));
        assert_eq!(
            effect(constant).err(),
            refused.then_some(effects::EffectError::Value)
        );
        // The same from bytes: the constant is the last number before the CRC.
        let mut all = bytes(&one, &[effect(60.0).unwrap()]);
        let at = all.len() - 8;
        all[at..at + 4].copy_from_slice(&constant.to_le_bytes());
        let expected = refused.then_some(StoredError::EffectValue { at: 0 });
        assert_eq!(decode(&resealed(all)).err(), expected, "{constant}");
    }
}

#[test]
fn everything_at_its_longest_has_room() {
    let nodes: Vec<_> = (0..NODES).map(|k| node(k as f32, &regular())).collect();
    let named = |id, coefficients: &[f32]| DeviceEffect::named(id, coefficients, None).unwrap();
    let mut all = Vec::new();
    for (fast, slow) in [
        ("gyro_cross_axis_product", "gyro_thermal_misalignment"),
        ("accel_cross_axis_product", "accel_thermal_misalignment"),
    ] {
        all.extend([named(fast, &[0.0; 9]); ROOM]);
        all.extend([named(slow, &[0.0; 6]); ROOM]);
    }
    let stored = decode(&bytes(&nodes, &all)).unwrap();
    assert_eq!(stored.effect_count, 2 * 2 * ROOM as u8);
}

#[test]
fn the_hash_is_crc_64_xz() {
    // The check value from the catalogue of CRC algorithms.
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
    assert_eq!(refused(b""), Some(StoredError::NotACalibration));
    assert_eq!(refused(&with(0, b'x')), Some(StoredError::NotACalibration));
    assert_eq!(
        refused(&with(4, 1)),
        Some(StoredError::Version { found: 1 })
    );
    assert_eq!(refused(&with(8, 0)), Some(StoredError::Node { at: 0 }));
    assert_eq!(refused(&with(8, 1)), Some(StoredError::Length));
    assert_eq!(refused(&with(8, 3)), Some(StoredError::Length));
    for end in 4..good.len() {
        assert_eq!(refused(&good[..end]), Some(StoredError::Length), "{end}");
    }
    let longer = [&good[..], &[0]].concat();
    assert_eq!(refused(&longer), Some(StoredError::Length));
    let nodes = |temperatures: &[f32]| {
        let all: Vec<_> = temperatures.iter().map(|t| node(*t, &regular())).collect();
        refused(&bytes(&all, &[]))
    };
    assert_eq!(nodes(&[0.0, 0.0]), Some(StoredError::Node { at: 1 }));
    assert_eq!(nodes(&[0.0, 9.0, 5.0]), Some(StoredError::Node { at: 2 }));
    assert_eq!(nodes(&[f32::NAN]), Some(StoredError::Node { at: 0 }));
    let many: Vec<f32> = (0..=NODES).map(|k| k as f32).collect();
    assert_eq!(nodes(&many[..NODES]), None);
    assert_eq!(nodes(&many), Some(StoredError::Node { at: 17 }));
    let flat = Matrix3::zeros();
    let mut out = [0; MAX_LENGTH];
    let length = encode(
        &Origin::UNKNOWN,
        PerSensor::both(&flat),
        &Curves::of(&[node(0.0, &regular())]),
        &[],
        &mut out,
    )
    .unwrap();
    assert_eq!(refused(&out[..length]), Some(StoredError::Singular));

    let one = [node(0.0, &regular())];
    let effects = |all: &[DeviceEffect<f32>]| refused(&bytes(&one, all));
    let known = DeviceEffect::named("gyro_scale_cubic", &[0.0; 3], None).unwrap();
    let two = bytes(&one, &[known, known]);
    let mut unknown = two.clone();
    // The last letter of the second id, before its count and four numbers.
    let at = two.len() - 4 - 4 * 4 - 2;
    unknown[at] = b'x';
    assert_eq!(
        refused(&resealed(unknown)),
        Some(StoredError::EffectUnknown { at: 1 })
    );
    // Two coefficients and a constant, where three coefficients are required.
    let mut short = bytes(&one, &[known]);
    let at = short.len() - 4 - 4 * 4 - 1;
    short[at] = 2;
    short.drain(at + 1..at + 5);
    let length = short.len() as u16;
    short[6..8].copy_from_slice(&length.to_le_bytes());
    assert_eq!(
        refused(&resealed(short)),
        Some(StoredError::EffectValue { at: 0 })
    );
    let eight = [known; 8];
    assert_eq!(effects(&eight), None);
    let nine = [known; 9];
    assert_eq!(effects(&nine), Some(StoredError::EffectsFull { at: 8 }));
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

/// Every number of a node changes by 0.1 per kelvin at the lower node, and by -0.2 at the upper.
fn two_nodes() -> [Node<f32>; 2] {
    let low = regular();
    let high = low.map(|v| 2.0 * v);
    [
        sloping(0.0, &low, &[0.1; 24]),
        sloping(50.0, &high, &[-0.2; 24]),
    ]
}

proptest! {
    /// Any bytes are either refused or decoded to a calibration. Their CRC is made valid, because otherwise all would fail it.
    #[test]
    fn no_bytes_are_too_bad_to_be_refused(noise in prop::collection::vec(any::<u8>(), 0..600), at in 12..360_usize) {
        let named = DeviceEffect::named("gyro_scale_cubic", &[0.0; 3], None).unwrap();
        let term = DeviceEffect::term(Sensor::Gyro, 1, 0.0, &[Variable::Time]).unwrap();
        let mut all = bytes(&[node(0.0, &regular())], &[named, term]);
        for (place, byte) in all.iter_mut().skip(at).zip(&noise) {
            *place = *byte;
        }
        let _ = decode(&resealed(all));
        let _ = decode(&noise);
    }
}
