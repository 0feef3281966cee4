//! Gyro errors that estimators do not know.

use super::{DPS, G, Spec, axes, form, input, matrix};
use crate::filter::LowPass;
use crate::rotation::dot;

pub(super) const SPECS: &[Spec] = &[
    // A resonator driven off its axis rectifies vibration. Size assumed: a tenth of the g-sensitivity per g².
    Spec {
        id: "x_gyro_vibration_rectification",
        about: "bias = size · square of the force above the corner frequency",
        parameters: &[axes("dps_per_g2", 0.05), form("corner_hz", 5.0, 20.0)],
        build: |b| {
            let size = b.list::<3>("dps_per_g2");
            let mut slow = [LowPass::of_bandwidth(b.number("corner_hz"), b.dt_s); 3];
            let mut started = false;
            input(move |at, add| {
                let mut square = 0.0;
                for (filter, f) in slow.iter_mut().zip(at.motion.force) {
                    if !started {
                        filter.settle(f);
                    }
                    let fast = (f - filter.step(f)) / G;
                    square += fast * fast;
                }
                started = true;
                for i in 0..3 {
                    add.gyro[i] += DPS * size[i] * square;
                }
            })
        },
    },
    // Two springs of unequal stiffness at an angle to the force turn the proof mass. Size assumed: a tenth of
    // the g-sensitivity per g.
    Spec {
        id: "x_gyro_g_squared",
        about: "anisoelastic: error = row of matrix · (fx fy, fy fz, fz fx), body axes",
        parameters: &[matrix("matrix_dps_per_g2", 0.05)],
        build: |b| {
            let m = b.matrix("matrix_dps_per_g2");
            input(move |at, add| {
                let f = at.motion.force.map(|f| f / G);
                let products = [f[0] * f[1], f[1] * f[2], f[2] * f[0]];
                for i in 0..3 {
                    add.gyro[i] += DPS * dot(m[i], products);
                }
            })
        },
    },
    // At small rates coupled resonators lock to each other, like ring lasers by backscatter: √(ω² - w²) beyond the dead zone. Size assumed: a
    // fraction of the null's stability.
    Spec {
        id: "x_gyro_dead_zone",
        about: "no output below the half width w, sign · √(rate² - w²) above",
        parameters: &[axes("half_width_dps", 0.3)],
        build: |b| {
            let width = b.list::<3>("half_width_dps").map(|w| w * DPS);
            input(move |at, add| {
                for i in 0..3 {
                    let w = at.gyro[i];
                    let out = w.signum() * (w * w - width[i] * width[i]).max(0.0).sqrt();
                    add.gyro[i] += out - w;
                }
            })
        },
    },
    // The drive current in the Earth's field pulls the resonator. Field: 0.2 G north and 0.45 G down, middle
    // latitudes. Size assumed.
    Spec {
        id: "x_gyro_magnetic",
        about: "bias = size · Earth's field along the gyro in gauss: it follows the heading",
        parameters: &[axes("dps_per_gauss", 0.3)],
        build: |b| {
            let size = b.list::<3>("dps_per_gauss");
            let directions = b.sensors.gyro.axes.each_ref().map(|a| a.direction);
            input(move |at, add| {
                let field = at.motion.attitude.inverse().turn([0.0, 0.2, -0.45]);
                for i in 0..3 {
                    add.gyro[i] += DPS * size[i] * dot(directions[i], field);
                }
            })
        },
    },
    // The charge that an overdriven demodulator leaves on its filter decays slowly. Size assumed.
    Spec {
        id: "x_gyro_saturation_recovery",
        about: "bias of this size while the rate is beyond the limit, then decaying",
        parameters: &[
            axes("dps", 0.5),
            form("limit_dps", 100.0, 300.0),
            form("time_constant_s", 2.0, 30.0),
        ],
        build: |b| {
            let size = b.list::<3>("dps");
            let limit = DPS * b.number("limit_dps");
            let keep = (-b.dt_s / b.number("time_constant_s")).exp();
            let mut charge = [0.0; 3];
            input(move |at, add| {
                for i in 0..3 {
                    charge[i] = if at.gyro[i].abs() > limit {
                        1.0
                    } else {
                        keep * charge[i]
                    };
                    add.gyro[i] += DPS * size[i] * charge[i];
                }
            })
        },
    },
    // A single trap at the input of the amplifier: burst noise, two levels, exponential dwell times. Size
    // assumed.
    Spec {
        id: "x_gyro_bias_jumps",
        about: "bias jumps between plus and minus half the size at random (telegraph signal)",
        parameters: &[axes("dps", 0.1), form("mean_dwell_s", 60.0, 600.0)],
        build: |b| {
            let mut half = b.list::<3>("dps").map(|s| 0.5 * DPS * s);
            let chance = 1.0 - (-b.dt_s / b.number("mean_dwell_s")).exp();
            let mut random = b.random();
            input(move |_, add| {
                for i in 0..3 {
                    if random.uniform() < chance {
                        half[i] = -half[i];
                    }
                    add.gyro[i] += half[i];
                }
            })
        },
    },
];
