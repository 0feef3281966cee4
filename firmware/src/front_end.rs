//! State of the front end that a calibration depends on, stored with it.
//!
//! - **The converter's calibration.** At each power-on the converter measures its own offset, 11 bits, and linearity. Two such measurements
//!   differ by noise, temperature and supply. The reference manual does not give the weight of a step of the offset; one code is 50 µV at a
//!   pin, 0.017 deg/s or 0.06 mg, so each power-on would have another bias. Repeating the calibration at some temperature would make a step
//!   in the stream and stop it for 21 ms. With stored factors the converter is a fixed function of code and temperature, and the curves of
//!   the calibration include its drift. RM0433 (25.4.8) provides for writing factors back.
//! - **The offsets between the TEMP pins.** The temperature is the mean of three pins. Without their offsets, a pin that is open at
//!   power-on would change the mean by a third of the difference between the references, some degrees.
//!
//! Both are stored in the slot of the calibration and used from the next start on. They are those at the time of storing. The recording
//! behind the calibration should therefore be of the same power-on, or of a device that already used stored values.

use mimu_core::stored::hash;

use crate::design_parameters::FLASH_WORD as WORD;

/// Words of the converter's linearity factor (RM0433 25.4.8).
pub const LINEARITY_WORDS: usize = 6;

/// Number of flash words that it needs.
pub const FRONT_END_WORDS: usize = 2;

/// Calibration factors of the converter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Factors {
    /// Offset, single-ended: 11 bits.
    pub offset: u16,
    /// Linearity: 30 bits each.
    pub linearity: [u32; LINEARITY_WORDS],
}

impl Factors {
    /// Whether the values fit the registers.
    fn is_possible(&self) -> bool {
        self.offset < 1 << 11 && self.linearity.iter().all(|word| *word < 1 << 30)
    }
}

/// State of the front end.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct FrontEnd {
    /// The converter's factors, if known.
    pub converter: Option<Factors>,
    /// Offsets between the TEMP pins of gyro x, y, z, °C, if known.
    pub pins_c: Option<[f32; 3]>,
}

const CONVERTER: u32 = 1;
const PINS: u32 = 1 << 1;

impl FrontEnd {
    /// As flash words.
    pub fn to_words(&self) -> [[u8; WORD]; FRONT_END_WORDS] {
        let factors = self.converter.unwrap_or(Factors {
            offset: 0,
            linearity: [0; LINEARITY_WORDS],
        });
        let known = [
            (self.converter.is_some(), CONVERTER),
            (self.pins_c.is_some(), PINS),
        ];
        let known = known.iter().filter(|(known, _)| *known);
        let known = known.fold(0, |bits, (_, bit)| bits | bit);
        let numbers = [known, u32::from(factors.offset)]
            .into_iter()
            .chain(factors.linearity)
            .chain(self.pins_c.unwrap_or_default().map(f32::to_bits));
        let mut words = [[0; WORD]; FRONT_END_WORDS];
        let (bytes, _) = words.as_flattened_mut().as_chunks_mut::<4>();
        for (bytes, number) in bytes.iter_mut().zip(numbers) {
            *bytes = number.to_le_bytes();
        }
        let [first, second] = &mut words;
        let check = check(first, second);
        if let Some(end) = second.last_chunk_mut() {
            *end = check;
        }
        words
    }

    /// From flash words; `None` if the words are torn or their values are impossible.
    pub fn from_words(words: &[[u8; WORD]; FRONT_END_WORDS]) -> Option<Self> {
        let [first, second] = words;
        if second.last_chunk::<8>() != Some(&check(first, second)) {
            return None;
        }
        let (chunks, _) = words.as_flattened().as_chunks::<4>();
        let mut numbers = chunks.iter().map(|bytes| u32::from_le_bytes(*bytes));
        let mut next = || numbers.next();
        let known = next()?;
        let factors = Factors {
            offset: u16::try_from(next()?).ok()?,
            linearity: [next()?, next()?, next()?, next()?, next()?, next()?],
        };
        let pins_c = [next()?, next()?, next()?].map(f32::from_bits);
        let possible = factors.is_possible() && pins_c.iter().all(|c| c.is_finite());
        possible.then_some(Self {
            converter: (known & CONVERTER != 0).then_some(factors),
            pins_c: (known & PINS != 0).then_some(pins_c),
        })
    }
}

/// CRC over everything except the end of the second word.
fn check(first: &[u8; WORD], second: &[u8; WORD]) -> [u8; 8] {
    let mut body = [0; 2 * WORD - 8];
    let (head, tail) = body.split_at_mut(WORD);
    head.copy_from_slice(first);
    tail.copy_from_slice(&second[..WORD - 8]);
    hash(&body).to_le_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEPT: FrontEnd = FrontEnd {
        converter: Some(Factors {
            offset: 0x5a3,
            linearity: [0x3fff_ffff, 1, 2, 3, 4, 0x3ff],
        }),
        pins_c: Some([3.25, -1.5, -1.75]),
    };

    #[test]
    fn what_is_kept_is_read_back_and_any_flipped_bit_is_noticed() {
        for kept in [
            KEPT,
            FrontEnd::default(),
            FrontEnd {
                pins_c: None,
                ..KEPT
            },
            FrontEnd {
                converter: None,
                ..KEPT
            },
        ] {
            assert_eq!(FrontEnd::from_words(&kept.to_words()), Some(kept));
        }
        for bit in 0..8 * 2 * WORD {
            let mut words = KEPT.to_words();
            words[bit / 8 / WORD][bit / 8 % WORD] ^= 1 << (bit % 8);
            assert_eq!(FrontEnd::from_words(&words), None, "bit {bit}");
        }
        // Erased and never written.
        assert_eq!(FrontEnd::from_words(&[[0xff; WORD]; 2]), None);
        assert_eq!(FrontEnd::from_words(&[[0; WORD]; 2]), None);
    }

    #[test]
    fn factors_that_no_register_holds_are_none() {
        let mut kept = KEPT;
        kept.converter.as_mut().unwrap().offset = 1 << 11;
        assert_eq!(FrontEnd::from_words(&kept.to_words()), None);
        let mut kept = KEPT;
        kept.converter.as_mut().unwrap().linearity[5] = 1 << 30;
        assert_eq!(FrontEnd::from_words(&kept.to_words()), None);
        let kept = FrontEnd {
            pins_c: Some([f32::NAN, 0.0, 0.0]),
            ..KEPT
        };
        assert_eq!(FrontEnd::from_words(&kept.to_words()), None);
    }
}
