//! From a cell of a file to a reading: first the converter's code, then the factor and the offset.

use crate::cell::{Refusal, is_reading};
use crate::signed_low_byte::corrected;

/// Conversion of the cells of a column, in the order of the fields.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Conversion {
    pub twos_complement: Option<u32>,
    /// Whether a firmware took its low byte for a signed number.
    pub signed_low_byte: bool,
    pub zero: f64,
    pub factor: f64,
    pub offset: f64,
}

impl Conversion {
    /// Reading of a cell that contains `number`; NaN if the cell is empty.
    pub fn reading(&self, number: f64) -> std::result::Result<f64, Refusal> {
        let mut code = number;
        if let Some(bits) = self.twos_complement {
            code = signed(number, bits)?;
        }
        if self.signed_low_byte {
            if code.is_finite() && code.fract() != 0.0 {
                return Err(Refusal {
                    problem: format!("{code} has a fraction, but two bytes are whole counts"),
                    remedy: "give the log as it was recorded, without factors or means",
                });
            }
            code = corrected(code);
        }
        let value = (code - self.zero) * self.factor + self.offset;
        match is_reading(value) {
            true => Ok(value),
            false => Err(Refusal {
                problem: format!(
                    "{number:e} times {:e} is too large for a reading",
                    self.factor
                ),
                remedy: "correct the cell or the factor",
            }),
        }
    }
}

/// The signed number that an unsigned code of `bits` bits means in two's complement.
fn signed(code: f64, bits: u32) -> std::result::Result<f64, Refusal> {
    if code.is_nan() {
        return Ok(code);
    }
    let codes = f64::from(bits).exp2();
    if code.fract() != 0.0 || !(0.0..codes).contains(&code) {
        return Err(Refusal {
            problem: format!(
                "{code} is not a code of {bits} bits (a whole number from 0 to {})",
                codes - 1.0
            ),
            remedy: "correct the number of bits, or leave it out if the codes have signs already",
        });
    }
    Ok(match code >= 0.5 * codes {
        true => code - codes,
        false => code,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_of_twelve_bits_is_the_number_that_a_sign_extension_makes_of_it() {
        for code in 0..1_u16 << 12 {
            let extended = ((code << 4) as i16) >> 4;
            assert_eq!(signed(f64::from(code), 12).ok(), Some(f64::from(extended)));
        }
        assert!(signed(f64::NAN, 12).is_ok_and(f64::is_nan));
        for wrong in [-1.0, 4096.0, 0.5] {
            let refusal = signed(wrong, 12).unwrap_err();
            assert!(refusal.problem.contains("4095"), "{}", refusal.problem);
        }
        assert_eq!(signed(4_294_967_295.0, 32).ok(), Some(-1.0));
    }

    #[test]
    fn codes_are_shifted_before_the_factor_and_readings_after_it() {
        let conversion = Conversion {
            twos_complement: None,
            signed_low_byte: false,
            zero: 2048.0,
            factor: 0.5,
            offset: 7.0,
        };
        assert_eq!(conversion.reading(2050.0).ok(), Some(8.0));
    }
}
