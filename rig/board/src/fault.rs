//! Faults outside the program: an instruction that differs from the image, as after an undetected bit flip in the flash, or after a debugger has
//! moved the program counter.

use crate::memory::{program, read};
use crate::running::Board;

/// The instruction that replaces the original one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// A branch to itself: the program hangs there.
    Hang,
    /// An undefined instruction (`UDF`, ARMv7-M A7.7.194).
    Undefined,
    /// A branch to another instruction, within 16 MiB.
    Jump(u64),
    /// Pushes registers for ever (`PUSH {r0-r7}`, A7.7.101, and a branch back to it).
    Push,
    /// Returns 1 at once: as the first instruction of a task's `poll`, `Pending`. The task waits for ever.
    Pending,
}

/// The replaced code, for [`Board::heal`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Replaced {
    address: u64,
    bytes: Vec<u8>,
}

impl Fault {
    /// The instruction, by half words.
    fn code(self, address: u64) -> Vec<u16> {
        match self {
            // B, encoding T2 (A7.7.12): the distance counts from four bytes after the instruction.
            Self::Hang => vec![0xe7fe],
            Self::Undefined => vec![0xde00],
            Self::Push => vec![0xb4ff, 0xe7fd],
            // MOVS r0, #1; BX lr.
            Self::Pending => vec![0x2001, 0x4770],
            // Encoding T4. The two uppermost bits of the distance are stored as whether they equal the sign.
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
    /// Replaces the instruction at an address in the program's own flash, unnoticed by the program.
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

    /// Restores the original code.
    ///
    /// Errors: the emulator gave up.
    pub fn heal(&mut self, replaced: Replaced) -> Result<(), String> {
        self.with(move |s| program(s.host, replaced.address, &replaced.bytes))?
    }
}

#[cfg(test)]
mod tests {
    use super::Fault;

    /// Against LLVM's assembler: `b.w` to the next instruction, forwards, far forwards, and backwards.
    #[test]
    fn branches_are_encoded_as_an_assembler_does() {
        let code = |target: u64| Fault::Jump(target).code(0x0800_0000);
        assert_eq!(code(0x0800_0004), [0xf000, 0xb800]);
        assert_eq!(code(0x0800_1000), [0xf000, 0xbffe]);
        assert_eq!(code(0x0810_0000), [0xf0ff, 0xbffe]);
        assert_eq!(code(0x07ff_f000), [0xf7fe, 0xbffe]);
    }
}
