//! Faults that a program has no part in: an instruction that is not what the image says, as after a flash bit that nobody noticed, or where
//! a debugger has put the program counter.

use crate::memory::{program, read};
use crate::running::Board;

/// What stands in the place of an instruction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// A branch to itself: the program stands still there.
    Hang,
    /// An instruction that is none (`UDF`, ARMv7-M A7.7.194).
    Undefined,
    /// A branch to another instruction, within 16 MiB.
    Jump(u64),
}

/// What has been replaced, for [`Board::heal`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Replaced {
    address: u64,
    bytes: Vec<u8>,
}

impl Fault {
    /// The instruction, by half words.
    fn code(self, address: u64) -> Vec<u16> {
        match self {
            // B, encoding T2 (A7.7.12): four bytes ahead of itself is where it counts from.
            Self::Hang => vec![0xe7fe],
            Self::Undefined => vec![0xde00],
            // Encoding T4. The two uppermost bits of the distance are stored as whether they are the sign.
            Self::Jump(target) => {
                let distance = target.wrapping_sub(address + 4) as u32;
                let bit = |n: u32| (distance >> n) & 1;
                let sign = bit(24);
                let j = |n: u32| (bit(n) ^ sign ^ 1) as u16;
                let upper = 0xf000 | (sign << 10) as u16 | ((distance >> 12) & 0x3ff) as u16;
                let lower = 0x9000 | j(23) << 13 | j(22) << 11 | ((distance >> 1) & 0x7ff) as u16;
                vec![upper, lower]
            }
        }
    }
}

impl Board {
    /// Puts a fault in the place of the instruction at an address of the program's own flash, without the program noticing.
    ///
    /// Errors: an address that is not flash, or the emulator gave up.
    pub fn inject(&mut self, address: u64, fault: Fault) -> Result<Replaced, String> {
        let code: Vec<u8> = fault
            .code(address)
            .into_iter()
            .flat_map(u16::to_le_bytes)
            .collect();
        self.with(move |s| {
            let bytes = read(s.host, address, code.len())?;
            program(s.host, address, &code)?;
            Ok(Replaced { address, bytes })
        })?
    }

    /// Puts back what a fault has replaced.
    ///
    /// Errors: the emulator gave up.
    pub fn heal(&mut self, replaced: Replaced) -> Result<(), String> {
        self.with(move |s| program(s.host, replaced.address, &replaced.bytes))?
    }
}

#[cfg(test)]
mod tests {
    use super::Fault;

    /// Against the assembler of LLVM: `b.w` to the next instruction, forth, far forth, and back.
    #[test]
    fn branches_are_encoded_as_an_assembler_does() {
        let code = |target: u64| Fault::Jump(target).code(0x0800_0000);
        assert_eq!(code(0x0800_0004), [0xf000, 0xb800]);
        assert_eq!(code(0x0800_1000), [0xf000, 0xbffe]);
        assert_eq!(code(0x0810_0000), [0xf0ff, 0xbffe]);
        assert_eq!(code(0x07ff_f000), [0xf7fe, 0xbffe]);
    }
}
