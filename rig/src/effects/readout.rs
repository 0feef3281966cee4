//! Errors of the converter, as changes of the voltage at an ideal one, so that they act on an emulated converter too.

use std::f64::consts::TAU;

use super::{Active, Build, Draw, Parameter, Shape, Spec, axes, form, read_out, scalar, sized};
use crate::pins::Pins;
use crate::sensor::TriadTruth;

/// Mismatch of the capacitors of the six top bits, in 16-bit codes. Assumed: a few codes, the order of magnitude of the integral nonlinearity in the
/// data sheets of 16-bit converters in microcontrollers.
const MISMATCH: [Parameter; 1] = [sized("bit_errors_lsb", Shape::List(6), 6.0)];

/// Number of missing codes, and their position. Assumed: several times a usual integral nonlinearity, away from the ends.
const MISSING: [Parameter; 2] = [scalar("codes", 20.0), form("at", 0.4, 0.6)];

/// Six errors of each of three converters, and the offset of their codes.
const CONVERTERS: [Parameter; 2] = [
    sized("bit_errors_lsb", Shape::List(18), 6.0),
    Parameter {
        key: "added_codes",
        shape: Shape::List(3),
        draw: Draw::Between(300.0, 30000.0),
    },
];

/// Number of values of the low part of a code: that of a byte.
const LOW_PART: [Parameter; 1] = [scalar("codes", 256.0)];

pub(super) const SPECS: &[Spec] = &[
    Spec {
        id: "gyro_readout_code",
        about: "each of the six top bits of the code, when set, adds this error",
        parameters: &MISMATCH,
        build: |b| mismatch(b, b.sensors.gyro, |pins| &mut pins.gyro_v),
    },
    Spec {
        id: "accel_readout_code",
        about: "each of the six top bits of the code, when set, adds this error",
        parameters: &MISMATCH,
        build: |b| mismatch(b, b.sensors.accel, |pins| &mut pins.accel_v),
    },
    // The charge that a capacitor array has lost by the middle of its range causes missing codes.
    Spec {
        id: "gyro_missing_codes",
        about: "from a code at this fraction of the converter's range, all codes are too high by this number (digital: of 16 bits)",
        parameters: &MISSING,
        build: |b| missing(b, b.sensors.gyro, |pins| &mut pins.gyro_v),
    },
    Spec {
        id: "accel_missing_codes",
        about: "from a code at this fraction of the converter's range, all codes are too high by this number (digital: of 16 bits)",
        parameters: &MISSING,
        build: |b| missing(b, b.sensors.accel, |pins| &mut pins.accel_v),
    },
    // Three converters, as in a separate part for each axis, with a bias register that is added before the conversion.
    Spec {
        id: "gyro_converters",
        about: "each axis has a separate converter whose code 0 is at another input; each of its six top bits, when set, adds this error",
        parameters: &CONVERTERS,
        build: |b| converters(b, b.sensors.gyro, |pins| &mut pins.gyro_v),
    },
    Spec {
        id: "accel_converters",
        about: "each axis has a separate converter whose code 0 is at another input; each of its six top bits, when set, adds this error",
        parameters: &CONVERTERS,
        build: |b| converters(b, b.sensors.accel, |pins| &mut pins.accel_v),
    },
    // A firmware combines two bytes to a code and takes the low one for a signed number: from 128 on the code is 256 too low.
    Spec {
        id: "gyro_sign_extension",
        about: "the low part of a code is read as a signed number: if it is in its upper half, the code is too low by the power of two nearest to the size (256: a byte)",
        parameters: &LOW_PART,
        build: |b| sign_extension(b, b.sensors.gyro, |pins| &mut pins.gyro_v),
    },
    Spec {
        id: "accel_sign_extension",
        about: "the low part of a code is read as a signed number: if it is in its upper half, the code is too low by the power of two nearest to the size (256: a byte)",
        parameters: &LOW_PART,
        build: |b| sign_extension(b, b.sensors.accel, |pins| &mut pins.accel_v),
    },
    // A short on the converter's data bus. Size: a bit low enough to pass for noise.
    Spec {
        id: "x_code_stuck_bit",
        about: "one bit of every code reads 0: the power of two nearest to the size, codes of 16 bits",
        parameters: &[scalar("lsb", 16.0)],
        build: |b| {
            let bit = power_of_two(b.number("lsb"), 0.0);
            let worth = move |code: i64| if code & bit != 0 { -bit as f64 } else { 0.0 };
            let spans = [Span::new(b, b.sensors.gyro), Span::new(b, b.sensors.accel)];
            read_out(move |_, pins| {
                let reference = pins.converter_reference_v;
                spans[0].shift(&mut pins.gyro_v, reference, worth);
                spans[1].shift(&mut pins.accel_v, reference, worth);
            })
        },
    },
    // The mains' magnetic field in the loop between gyro and converter. The grid's frequency stays within 0.1 Hz of 50 Hz.
    Spec {
        id: "x_mains_hum",
        about: "gyro outputs carry a sine of this amplitude (digital: thousandths of a count)",
        parameters: &[axes("mv", 5.0), form("frequency_hz", 49.9, 50.1)],
        build: |b| hum(b, |pins| &mut pins.gyro_v),
    },
    // The host polls a full-speed USB bridge every millisecond by its own crystal, and each poll disturbs the supply. Sampled at 1 kHz, this becomes
    // a slow wave.
    Spec {
        id: "x_usb_beat",
        about: "accelerometer outputs carry a sine near 1 kHz of this amplitude (as x_mains_hum)",
        parameters: &[axes("mv", 2.0), form("frequency_hz", 1000.002, 1000.05)],
        build: |b| hum(b, |pins| &mut pins.accel_v),
    },
];

/// Selects the disturbed outputs.
type Outputs = fn(&mut Pins) -> &mut [f64; 3];

/// Raw range of a converter, for 16-bit codes.
#[derive(Clone, Copy)]
struct Span {
    low: f64,
    span: f64,
    nominal_v: Option<f64>,
}

impl Span {
    fn new(b: &Build, triad: &TriadTruth) -> Self {
        Self {
            low: triad.code_low,
            span: triad.code_span,
            nominal_v: triad
                .analog
                .then_some(b.sensors.converter_reference_nominal_v),
        }
    }

    /// Moves each output by the error of its code, in codes.
    fn shift(&self, outputs: &mut [f64; 3], reference_v: f64, error: impl Fn(i64) -> f64) {
        self.shift_each(outputs, reference_v, |_, code| error(code));
    }

    /// The same with separate errors for each axis.
    fn shift_each(
        &self,
        outputs: &mut [f64; 3],
        reference_v: f64,
        error: impl Fn(usize, i64) -> f64,
    ) {
        let true_span = self.span * self.nominal_v.map_or(1.0, |v| reference_v / v);
        for (axis, v) in outputs.iter_mut().enumerate() {
            let code = ((*v - self.low) / true_span * 65536.0)
                .round()
                .clamp(0.0, 65535.0) as i64;
            *v += true_span / 65536.0 * error(axis, code);
        }
    }
}

/// The power of two nearest to `size`, at least that of `lowest`, within 16 bits.
fn power_of_two(size: f64, lowest: f64) -> i64 {
    1 << size.abs().log2().round().clamp(lowest, 15.0) as u32
}

fn sign_extension(b: &Build, triad: &TriadTruth, outputs: Outputs) -> Active {
    // A part of one bit cannot be split in half.
    let codes = power_of_two(b.number("codes"), 1.0);
    let span = Span::new(b, triad);
    read_out(move |_, pins| {
        let reference = pins.converter_reference_v;
        let worth = |code: i64| match code & (codes - 1) >= codes / 2 {
            true => -codes as f64,
            false => 0.0,
        };
        span.shift(outputs(pins), reference, worth);
    })
}

fn missing(b: &Build, triad: &TriadTruth, outputs: Outputs) -> Active {
    let (codes, at) = (b.number("codes"), b.number("at"));
    let first = (65536.0 * at) as i64;
    let span = Span::new(b, triad);
    read_out(move |_, pins| {
        let reference = pins.converter_reference_v;
        let worth = |code| if code >= first { codes } else { 0.0 };
        span.shift(outputs(pins), reference, worth);
    })
}

fn converters(b: &Build, triad: &TriadTruth, outputs: Outputs) -> Active {
    let errors = b.list::<18>("bit_errors_lsb");
    let added = b.list::<3>("added_codes").map(|a| a.round() as i64);
    let span = Span::new(b, triad);
    read_out(move |_, pins| {
        let reference = pins.converter_reference_v;
        span.shift_each(outputs(pins), reference, |axis, code| {
            let code = code + added[axis];
            let set = |i: usize| code & (0x8000 >> i) != 0;
            (0..6)
                .filter(|i| set(*i))
                .map(|i| errors[6 * axis + i])
                .sum()
        });
    })
}

fn mismatch(b: &Build, triad: &TriadTruth, outputs: Outputs) -> Active {
    let errors = b.list::<6>("bit_errors_lsb");
    let span = Span::new(b, triad);
    read_out(move |_, pins| {
        let reference = pins.converter_reference_v;
        span.shift(outputs(pins), reference, |code| {
            let set = |(i, e): (usize, &f64)| if code & (0x8000 >> i) != 0 { *e } else { 0.0 };
            errors.iter().enumerate().map(set).sum()
        });
    })
}

fn hum(b: &Build, outputs: Outputs) -> Active {
    let size = b.list::<3>("mv");
    let frequency_hz = b.number("frequency_hz");
    let phase = TAU * b.random().uniform();
    read_out(move |at, pins| {
        // The fraction of a turn first: after a day at 1 kHz the phase itself would lose digits.
        let wave = (TAU * (frequency_hz * at.motion.t_s).fract() + phase).sin();
        for (v, size) in outputs(pins).iter_mut().zip(size) {
            *v += 1e-3 * size * wave;
        }
    })
}
