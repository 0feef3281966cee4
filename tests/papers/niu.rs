//! niu: consistency of its tables, and curves of the units that are made from them.

use crate::page::{Block, Table, significant};

/// A row of a table: its name and its figures.
type Row<const N: usize> = (&'static str, [f64; N]);

/// Table 4, MTi-G: rms error against the soak at -10, 10, 30, 50 and 70 °C, and the largest; deg/h, µg, ppm.
const TABLE_4: [Row<6>; 24] = [
    ("b_gx", [353.0, 214.0, 137.0, 87.0, 158.0, 353.0]),
    ("b_gy", [224.0, 85.0, 204.0, 286.0, 5.0, 286.0]),
    ("b_gz", [215.0, 182.0, 144.0, 114.0, 130.0, 215.0]),
    ("δs_gx", [891.0, 1442.0, 655.0, 286.0, 1255.0, 1442.0]),
    ("δs_gy", [906.0, 1005.0, 936.0, 528.0, 402.0, 1005.0]),
    ("δs_gz", [256.0, 307.0, 155.0, 180.0, 953.0, 953.0]),
    ("n_xy", [364.0, 778.0, 612.0, 157.0, 361.0, 778.0]),
    ("n_xz", [1070.0, 393.0, 429.0, 525.0, 259.0, 1070.0]),
    ("n_yx", [353.0, 512.0, 265.0, 39.0, 949.0, 949.0]),
    ("n_yz", [345.0, 271.0, 375.0, 209.0, 1224.0, 1224.0]),
    ("n_zx", [412.0, 307.0, 83.0, 339.0, 1071.0, 1071.0]),
    ("n_zy", [145.0, 96.0, 108.0, 221.0, 287.0, 287.0]),
    ("b_ax", [1050.0, 367.0, 271.0, 442.0, 662.0, 1050.0]),
    ("b_ay", [801.0, 1176.0, 1166.0, 1049.0, 949.0, 1176.0]),
    ("b_az", [1146.0, 639.0, 688.0, 1030.0, 1166.0, 1166.0]),
    ("δs_ax", [20.0, 23.0, 17.0, 44.0, 50.0, 50.0]),
    ("δs_ay", [21.0, 64.0, 26.0, 33.0, 45.0, 64.0]),
    ("δs_az", [18.0, 39.0, 19.0, 21.0, 34.0, 39.0]),
    ("m_xy", [16.0, 21.0, 17.0, 25.0, 33.0, 33.0]),
    ("m_xz", [142.0, 229.0, 250.0, 259.0, 310.0, 310.0]),
    ("m_yx", [37.0, 28.0, 32.0, 36.0, 34.0, 37.0]),
    ("m_yz", [29.0, 104.0, 66.0, 31.0, 121.0, 121.0]),
    ("m_zx", [12.0, 49.0, 21.0, 20.0, 91.0, 91.0]),
    ("m_zy", [85.0, 41.0, 55.0, 67.0, 123.0, 123.0]),
];

/// Table 6, the same for the NV-IMU100.
const TABLE_6: [Row<6>; 24] = [
    ("b_gx", [5.0, 1.0, 1.0, 0.0, 2.0, 5.0]),
    ("b_gy", [0.0, 1.0, 1.0, 2.0, 3.0, 3.0]),
    ("b_gz", [3.0, 2.0, 1.0, 4.0, 4.0, 4.0]),
    ("δs_gx", [411.0, 585.0, 328.0, 72.0, 363.0, 585.0]),
    ("δs_gy", [2143.0, 2039.0, 1310.0, 372.0, 190.0, 2143.0]),
    ("δs_gz", [297.0, 467.0, 544.0, 353.0, 792.0, 792.0]),
    ("n_xy", [598.0, 571.0, 473.0, 430.0, 578.0, 598.0]),
    ("n_xz", [40.0, 92.0, 44.0, 141.0, 37.0, 141.0]),
    ("n_yx", [874.0, 522.0, 497.0, 538.0, 403.0, 874.0]),
    ("n_yz", [57.0, 41.0, 20.0, 47.0, 113.0, 113.0]),
    ("n_zx", [103.0, 81.0, 40.0, 42.0, 30.0, 103.0]),
    ("n_zy", [40.0, 51.0, 40.0, 42.0, 30.0, 103.0]),
    ("b_ax", [4133.0, 3520.0, 3417.0, 3036.0, 1337.0, 4133.0]),
    ("b_ay", [1634.0, 1368.0, 704.0, 924.0, 2325.0, 2325.0]),
    ("b_az", [829.0, 2170.0, 1514.0, 1101.0, 3860.0, 3860.0]),
    ("δs_ax", [95.0, 62.0, 49.0, 68.0, 90.0, 95.0]),
    ("δs_ay", [115.0, 607.0, 450.0, 120.0, 265.0, 607.0]),
    ("δs_az", [179.0, 146.0, 135.0, 153.0, 226.0, 226.0]),
    ("m_xy", [380.0, 443.0, 490.0, 523.0, 511.0, 523.0]),
    ("m_xz", [223.0, 106.0, 41.0, 16.0, 16.0, 223.0]),
    ("m_yx", [547.0, 398.0, 472.0, 521.0, 313.0, 521.0]),
    ("m_yz", [169.0, 149.0, 124.0, 50.0, 134.0, 169.0]),
    ("m_zx", [161.0, 83.0, 102.0, 87.0, 135.0, 161.0]),
    ("m_zy", [205.0, 112.0, 100.0, 110.0, 69.0, 205.0]),
];

/// Table 9: A0 to A3 of the MTi-G, then of the NV-IMU100, as printed; T in °C; deg/h, µg, ppm.
const TABLE_9: [Row<8>; 24] = [
    (
        "b_gx",
        [-31.0, -13.65, 0.177, 0.00142, -4.0, -0.06, 0.003, -3.24712],
    ),
    (
        "b_gy",
        [1.0, -15.33, 0.26, -0.00136, 5.0, 0.03, -0.002, 1.56754],
    ),
    (
        "b_gz",
        [-2112.0, 45.24, -0.682, 0.00352, 1.0, 0.1, -0.009, 0.00012],
    ),
    (
        "δs_gx",
        [
            -3108.0, 1.31, 0.232, -0.01783, 752.0, 14.18, -1.288, 0.02144,
        ],
    ),
    (
        "δs_gy",
        [
            -1380.0, 119.62, 0.107, -0.00931, -377.0, -44.18, 4.715, -0.02033,
        ],
    ),
    (
        "δs_gz",
        [
            -4541.0, 232.23, -1.134, -0.01477, -2211.0, 71.96, 2.405, -0.01435,
        ],
    ),
    (
        "n_xy",
        [
            611.0, 17.2, -0.906, 0.00896, -2304.0, 11.76, -0.069, -0.00083,
        ],
    ),
    (
        "n_xz",
        [4527.0, -18.12, -0.733, 0.01023, 483.0, 3.4, 0.234, -0.00288],
    ),
    (
        "n_yx",
        [701.0, -8.14, 0.077, 0.00111, 3344.0, -0.77, 0.053, -0.00069],
    ),
    (
        "n_yz",
        [
            -3371.0, 39.47, 0.62, -0.0081, 1081.0, 11.43, -0.229, 0.00277,
        ],
    ),
    (
        "n_zx",
        [
            -2017.0, -10.81, -0.783, 0.00761, -1699.0, 3.48, 0.201, -0.0023,
        ],
    ),
    (
        "n_zy",
        [593.0, 6.73, -0.293, 0.00813, -1939.0, 4.98, -0.008, 0.00038],
    ),
    (
        "b_ax",
        [
            -1472.0, -37.02, 0.12, 0.01575, -23074.0, 365.76, -0.808, -0.03441,
        ],
    ),
    (
        "b_ay",
        [
            2758.0, -6.76, 0.443, -0.00128, 7069.0, 169.46, -7.247, 0.07519,
        ],
    ),
    (
        "b_az",
        [
            411.0, 38.25, -0.876, 0.0036, -16897.0, -27.51, 13.616, -0.17003,
        ],
    ),
    (
        "δs_ax",
        [
            -100.0, 7.71, -0.073, 0.00034, -3003.0, 25.52, -0.472, 0.0035,
        ],
    ),
    (
        "δs_ay",
        [102.0, 5.25, -0.09, 0.00055, -2650.0, -8.41, -0.361, 0.00814],
    ),
    (
        "δs_az",
        [
            157.0, 4.32, -0.108, 0.00038, -3509.0, 12.56, 0.565, -0.00513,
        ],
    ),
    (
        "m_xy",
        [
            -174.0, -1.77, 0.026, 0.00052, -6614.0, -6.55, -0.221, 0.00287,
        ],
    ),
    (
        "m_xz",
        [
            9996.0, -1.75, -0.129, 0.00149, -10539.0, 4.26, 0.195, -0.00179,
        ],
    ),
    (
        "m_yx",
        [372.0, 1.5, -0.037, -3e-05, 3858.0, -10.07, 0.429, -0.00387],
    ),
    (
        "m_yz",
        [7648.0, 8.42, 0.017, -0.00088, 9956.0, 5.03, -0.257, 0.00261],
    ),
    (
        "m_zx",
        [
            -4158.0, -15.85, 0.095, -0.00034, 5713.0, -11.62, 0.127, -0.00103,
        ],
    ),
    (
        "m_zy",
        [
            -3530.0, -7.14, -0.032, 0.00018, -5912.0, -4.28, -0.109, 0.00071,
        ],
    ),
];

/// Table 10, MTi-G: rms and mean compensated, rms and mean uncompensated; deg/h and µg.
const TABLE_10: [Row<4>; 6] = [
    ("gyro x", [220.0, 15.0, 284.0, 23.0]),
    ("gyro y", [289.0, 124.0, 264.0, -37.0]),
    ("gyro z", [418.0, -279.0, 2164.0, -1974.0]),
    ("accel x", [2341.0, -2147.0, 3697.0, -3287.0]),
    ("accel y", [2081.0, -2023.0, 1490.0, 1256.0]),
    ("accel z", [1416.0, 1219.0, 1951.0, 1852.0]),
];

/// Section 5.2, MTi-G: rms compensated and uncompensated.
const SECTION_5_2: [[f64; 2]; 6] = [
    [189.0, 279.0],
    [254.0, 197.0],
    [418.0, 2167.0],
    [2342.0, 3697.0],
    [2259.0, 1097.0],
    [1055.0, 11130.0],
];

/// Table 11, NV-IMU100: as Table 10.
const TABLE_11: [Row<4>; 6] = [
    ("gyro x", [29.0, 4.0, 41.0, 29.0]),
    ("gyro y", [44.0, 27.0, 314.0, 294.0]),
    ("gyro z", [48.0, -36.0, 50.0, 32.0]),
    ("accel x", [2253.0, -6105.0, 17356.0, -16665.0]),
    ("accel y", [1687.0, -823.0, 9516.0, 9287.0]),
    ("accel z", [5410.0, 4781.0, 6894.0, -4403.0]),
];

/// Drifts over -10 to 70 °C from Tables 5 (MTi-G) and 7 (NV-IMU100); the key is the beginning of the names in Table 9.
const DRIFTS: [(&str, &str, [f64; 2]); 6] = [
    ("gyro bias, deg/h", "b_g", [2100.0, 13.0]),
    ("gyro scale factor, ppm", "δs_g", [11000.0, 10000.0]),
    ("gyro non-orthogonality, ppm", "n_", [6000.0, 1000.0]),
    ("accel bias, µg", "b_a", [3800.0, 14000.0]),
    ("accel scale factor, ppm", "δs_a", [400.0, 1800.0]),
    ("accel non-orthogonality, ppm", "m_", [1000.0, 600.0]),
];

/// Rate of the dynamic tests, 10 deg/s, in deg/h (Table 8 and 5.1).
const RATE: f64 = 36000.0;
/// The power of ten that is missing in two coefficients.
const MENDED: f64 = 1e-5;

/// Coefficients of a row for a unit, 0 or 1. The third is multiplied by `power` if its own is missing.
fn cubic(name: &str, unit: usize, power: f64) -> [f64; 4] {
    let row = TABLE_9.iter().find(|r| r.0 == name).expect("in Table 9").1;
    let mut a: [f64; 4] = std::array::from_fn(|k| row[4 * unit + k]);
    if unit == 1 && ["b_gx", "b_gy"].contains(&name) {
        a[3] *= power;
    }
    a
}

/// Values of a cubic from -10 to 70 °C, every 0.1 K.
fn course(a: [f64; 4]) -> Vec<f64> {
    let at = |t: f64| a[0] + t * (a[1] + t * (a[2] + t * a[3]));
    (0..=800).map(|k| at(0.1 * f64::from(k) - 10.0)).collect()
}

fn drift(course: &[f64]) -> f64 {
    let [low, high] = [f64::min, f64::max].map(|f| course.iter().copied().reduce(f));
    high.expect("some") - low.expect("some")
}

/// Mean and root mean square.
fn moments(course: &[f64]) -> [f64; 2] {
    let n = course.len() as f64;
    let squares = course.iter().map(|x| x * x).sum::<f64>();
    [course.iter().sum::<f64>() / n, (squares / n).sqrt()]
}

/// Rows of Tables 4 and 6 whose last figure is not the maximum of the others.
fn maxima() -> Table {
    let mut table = Table::new(&["table", "row", "maximum, printed", "largest of the row"]);
    for (name, rows) in [("4", &TABLE_4), ("6", &TABLE_6)] {
        for (row, figures) in rows {
            let largest = figures[..5].iter().copied().fold(0.0, f64::max);
            if largest != figures[5] {
                let cells = [name.to_string(), (*row).to_string()];
                let figures = [figures[5], largest].map(|f| format!("{f}"));
                table.row(cells.into_iter().chain(figures));
            }
        }
    }
    table
}

/// Largest drift of the axes by the cubics, against Tables 5 and 7.
fn drifts() -> Table {
    let mut table = Table::new(&[
        "drift of -10 to 70 °C",
        "MTi-G, printed",
        "by Table 9",
        "NV-IMU100, printed",
        "by Table 9, as printed",
        "mended",
    ]);
    for (name, prefix, printed) in DRIFTS {
        let of = |unit: usize, power: f64| {
            let rows = TABLE_9.iter().filter(|r| r.0.starts_with(prefix));
            let each = rows.map(|r| drift(&course(cubic(r.0, unit, power))));
            significant(each.fold(0.0, f64::max))
        };
        table.row([
            name.to_string(),
            format!("{}", printed[0]),
            of(0, 1.0),
            format!("{}", printed[1]),
            of(1, 1.0),
            of(1, MENDED),
        ]);
    }
    table
}

/// How the power of ten changes the two curves and the uncompensated error at 10 deg/s, which Table 11 reports.
fn powers() -> Table {
    let mut table = Table::new(&[
        "power of ten of A3",
        "drift of b_gx, deg/h",
        "of b_gy",
        "x at 10 deg/s, mean and rms, deg/h",
        "y",
    ]);
    for exponent in [0, -3, -4, -5, -6, -7] {
        let power = 10f64.powi(exponent);
        let bias = ["b_gx", "b_gy"].map(|name| course(cubic(name, 1, power)));
        let scale = ["δs_gx", "δs_gy"].map(|name| course(cubic(name, 1, power)));
        let error = [0, 1].map(|i| {
            let both = bias[i].iter().zip(&scale[i]);
            let sum: Vec<f64> = both.map(|(b, s)| b + 1e-6 * s * RATE).collect();
            moments(&sum).map(significant).join(", ")
        });
        table.row(
            [format!("{exponent}")]
                .into_iter()
                .chain(bias.map(|b| significant(drift(&b))))
                .chain(error),
        );
    }
    let printed = [0, 1].map(|i| {
        let [_, _, rms, mean] = TABLE_11[i].1;
        format!("{mean}, {rms}")
    });
    let first = [
        "printed".to_string(),
        "13 at most".into(),
        "13 at most".into(),
    ];
    table.row(first.into_iter().chain(printed));
    table
}

/// Rows of Tables 10 and 11 whose mean exceeds the root mean square, and differences between section 5.2 and Table 10.
fn contradictions() -> Table {
    let mut table = Table::new(&["where", "row", "figure", "and the other"]);
    for (name, rows) in [("Table 10", &TABLE_10), ("Table 11", &TABLE_11)] {
        for (row, [rms, mean, rms_before, mean_before]) in rows {
            for (of, rms, mean) in [
                ("compensated", rms, mean),
                ("uncompensated", rms_before, mean_before),
            ] {
                if mean.abs() > *rms {
                    let row = format!("{row}, {of}");
                    let cells = [format!("rms {rms}"), format!("mean {mean}")];
                    table.row([name.to_string(), row].into_iter().chain(cells));
                }
            }
        }
    }
    for ((row, [after, _, before, _]), said) in TABLE_10.iter().zip(SECTION_5_2) {
        for (of, printed, said) in [
            ("compensated", after, said[0]),
            ("uncompensated", before, said[1]),
        ] {
            // A difference in the last digit is rounding.
            if (printed - said).abs() > 0.005 * printed {
                let cells = [format!("{printed} in Table 10"), format!("{said} in 5.2")];
                let row = format!("rms of {row}, {of}");
                table.row(["5.2".to_string(), row].into_iter().chain(cells));
            }
        }
    }
    table
}

/// All blocks of this study.
pub fn blocks() -> Vec<Block> {
    vec![
        Block::table("niu, maxima", &maxima()),
        Block::table("niu, drifts", &drifts()),
        Block::table("niu, powers of ten", &powers()),
        Block::table("niu, contradictions", &contradictions()),
    ]
}
