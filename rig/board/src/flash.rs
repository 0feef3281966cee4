//! The flash interface under observation: running program and erase operations, and the contents after a cut of the supply.
//!
//! The emulator's own model changes memory only at the end of an operation, so a run that ends during it would find the memory unchanged. A real
//! supply cut is worse: some cells have changed and others have not.

use std::collections::VecDeque;

use mimu_rig::random::Random;
use rigless::device::{Device, DeviceContext, RegisterFile};
use rigless::soc::Width;
use rigless::soc::stm32h743::generated::flash::Register;
use rigless::soc::stm32h743::peripherals::flash::{Flash, OptionBytes};
use rigless::time::EventId;

/// First address of the flash memory.
pub const BASE: u64 = 0x0800_0000;

/// Bytes in a bank.
pub const BANK: u64 = 1 << 20;

/// Bytes in a sector, the smallest unit of an erase.
pub const SECTOR: u64 = 128 << 10;

/// Bytes in a flash word, the smallest unit of programming.
pub const WORD: u64 = 32;

/// Typical durations by the register's parallelism (x8, x16, x32, x64), ns; DS12110 rev 11, table 140. The emulator uses the same, so the fraction
/// done is right.
const PROGRAM_NS: [u64; 4] = [290_000, 180_000, 130_000, 100_000];
const SECTOR_ERASE_NS: [u64; 4] = [2_000_000_000, 1_800_000_000, 1_100_000_000, 1_000_000_000];
const BANK_ERASE_NS: [u64; 4] = [13_000_000_000, 8_000_000_000, 6_000_000_000, 5_000_000_000];

// Fields of FLASH_OPTSR (RM0433 4.9.8): brown-out level, and the exchange of the banks' addresses.
const BOR_LEV: u64 = 3 << 2;
const SWAP_BANK_OPT: u64 = 1 << 31;

// Fields of FLASH_CR1 and FLASH_CR2 (RM0433 4.9.4), alike in both.
const CR_PG: u64 = 1 << 1;
const CR_SER: u64 = 1 << 2;
const CR_BER: u64 = 1 << 3;
const CR_FW: u64 = 1 << 6;
const CR_START: u64 = 1 << 7;
/// QW of FLASH_SR1 and FLASH_SR2 (RM0433 4.9.5): an operation is waiting or running.
const SR_QW: u64 = 1 << 2;

/// The change of a memory range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// Program a word with these bytes.
    Program([u8; WORD as usize]),
    /// Erase: all ones.
    Erase,
}

/// One operation of a bank.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Operation {
    /// The change.
    pub change: Change,
    /// First address.
    pub address: u64,
    /// Length, bytes.
    pub length: u64,
    /// Begin, ns.
    pub begins_ns: u64,
    /// End, ns.
    pub ends_ns: u64,
}

impl Operation {
    /// Memory after a supply cut at this time; `before` are the previous contents.
    ///
    /// Each cell has changed independently, with a probability equal to the fraction of the time elapsed. The cells of the error-correcting code are
    /// not modelled; docs/bench.md lists what is left out.
    pub fn torn(&self, before: &[u8], at_ns: u64, random: &mut Random) -> Vec<u8> {
        let took = self.ends_ns - self.begins_ns;
        let done = at_ns.saturating_sub(self.begins_ns) as f64 / took as f64;
        let wanted = |i: usize| match &self.change {
            // Programming only clears bits.
            Change::Program(bytes) => before[i] & bytes[i],
            Change::Erase => 0xFF,
        };
        let mut torn = Vec::with_capacity(before.len());
        for (i, &old) in before.iter().enumerate() {
            let mut byte = old;
            let differs = old ^ wanted(i);
            for bit in (0..8).map(|k| 1 << k).filter(|bit| differs & bit != 0) {
                if random.uniform() < done {
                    byte ^= bit;
                }
            }
            torn.push(byte);
        }
        torn
    }
}

/// Current operations of one bank.
#[derive(Debug, Default)]
struct Bank {
    /// The word being gathered, which of its bytes have arrived, and the bytes.
    word: u64,
    come: u32,
    bytes: [u8; WORD as usize],
    queue: VecDeque<Operation>,
}

/// The flash interface and its operations.
#[derive(Debug)]
pub(crate) struct Watched {
    flash: Flash,
    banks: [Bank; 2],
    landed: Vec<(u64, u64)>,
    /// Operations no longer end.
    pub(crate) stuck: bool,
}

impl Watched {
    pub(crate) fn new() -> Self {
        Self {
            flash: Flash::new(),
            banks: Default::default(),
            landed: Vec::new(),
            stuck: false,
        }
    }

    /// Sets the option bytes as docs/device/board.md asks a person to: brown-out level 3. `swapped`: the banks exchange their addresses from the next
    /// reset on. The emulator shows the bit only, so a test can see whether the program heeds it.
    pub(crate) fn set_options(&mut self, swapped: bool, registers: &mut RegisterFile) {
        let mut options = OptionBytes::FACTORY;
        options.optsr |= BOR_LEV;
        if swapped {
            options.optsr |= SWAP_BANK_OPT;
        }
        self.flash.keep_options(options, registers);
    }

    /// After a system reset: operations in flight are lost, the option bytes stay. `registers` are reset already.
    pub(crate) fn restart(&mut self, registers: &mut RegisterFile) {
        let options = self.flash.committed_options();
        self.flash = Flash::new();
        self.flash.keep_options(options, registers);
        self.banks = Default::default();
    }

    /// Operations in flight at a time.
    pub(crate) fn in_flight(&self, at_ns: u64) -> Vec<Operation> {
        let running = |o: &&Operation| o.begins_ns <= at_ns && at_ns < o.ends_ns;
        let queues = self.banks.iter().flat_map(|bank| &bank.queue);
        queues.filter(running).copied().collect()
    }

    /// Ranges (first address, bytes) that have changed since the last call, up to a time.
    pub(crate) fn take_landed(&mut self, at_ns: u64) -> Vec<(u64, u64)> {
        self.retire(at_ns);
        std::mem::take(&mut self.landed)
    }

    fn retire(&mut self, at_ns: u64) {
        for bank in &mut self.banks {
            while let Some(o) = bank.queue.pop_front_if(|o| o.ends_ns <= at_ns) {
                self.landed.push((o.address, o.length));
            }
        }
    }

    fn begin(&mut self, bank: usize, change: Change, span: (u64, u64), took: u64, now: u64) {
        self.retire(now);
        let queue = &mut self.banks[bank].queue;
        let begins_ns = queue.back().map_or(now, |last| last.ends_ns.max(now));
        queue.push_back(Operation {
            change,
            address: span.0,
            length: span.1,
            begins_ns,
            ends_ns: begins_ns + took,
        });
    }

    /// Records a word that the interface has accepted.
    fn programmed(&mut self, bank: usize, registers: &RegisterFile, now: u64) {
        let gathered = &mut self.banks[bank];
        let come = std::mem::take(&mut gathered.come);
        let (word, mut bytes) = (gathered.word, gathered.bytes);
        // If a word is forced out early, the missing bytes are ones.
        for (i, byte) in bytes.iter_mut().enumerate() {
            if come & (1 << i) == 0 {
                *byte = 0xFF;
            }
        }
        if registers.get(status(bank)) & SR_QW != 0 {
            let took = PROGRAM_NS[parallelism(registers.get(control(bank)))];
            self.begin(bank, Change::Program(bytes), (word, WORD), took, now);
        }
    }

    fn commanded(&mut self, bank: usize, written: u64, registers: &RegisterFile, now: u64) {
        if written & CR_PG == 0 {
            self.banks[bank].come = 0;
        }
        if written & CR_FW != 0 && self.banks[bank].come != 0 {
            self.programmed(bank, registers, now);
        }
        if written & CR_START == 0 || registers.get(status(bank)) & SR_QW == 0 {
            return;
        }
        let first = BASE + bank as u64 * BANK;
        let by = parallelism(written);
        if written & CR_BER != 0 {
            self.begin(bank, Change::Erase, (first, BANK), BANK_ERASE_NS[by], now);
        } else if written & CR_SER != 0 {
            let sector = first + (written >> 8 & 7) * SECTOR;
            self.begin(
                bank,
                Change::Erase,
                (sector, SECTOR),
                SECTOR_ERASE_NS[by],
                now,
            );
        }
    }
}

fn control(bank: usize) -> Register {
    [Register::Cr1, Register::Cr2][bank]
}

fn status(bank: usize) -> Register {
    [Register::Sr1, Register::Sr2][bank]
}

/// PSIZE of a control register.
fn parallelism(control: u64) -> usize {
    (control >> 4 & 3) as usize
}

impl Device for Watched {
    type Register = Register;

    fn write(
        &mut self,
        register: Register,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let now = context.now().0;
        self.flash.write(register, value, registers, context);
        match register {
            Register::Cr1 => self.commanded(0, value, registers, now),
            Register::Cr2 => self.commanded(1, value, registers, now),
            _ => {}
        }
    }

    fn write_region(
        &mut self,
        address: u64,
        width: Width,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) -> bool {
        let now = context.now().0;
        let took = self
            .flash
            .write_region(address, width, value, registers, context);
        let bank = usize::from(address >= BASE + BANK);
        if took && registers.get(control(bank)) & CR_PG != 0 {
            let gathered = &mut self.banks[bank];
            let word = address & !(WORD - 1);
            if gathered.word != word {
                gathered.word = word;
                gathered.come = 0;
            }
            let bytes = value.to_le_bytes();
            for (k, &byte) in bytes.iter().enumerate().take(width.bytes() as usize) {
                let place = (address - word) as usize + k;
                if place < WORD as usize {
                    gathered.bytes[place] = byte;
                    gathered.come |= 1 << place;
                }
            }
            if gathered.come == u32::MAX {
                self.programmed(bank, registers, now);
            }
        }
        took
    }

    fn on_event(
        &mut self,
        event: EventId,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        // The event is the end of an operation.
        if self.stuck {
            return;
        }
        self.flash.on_event(event, registers, context);
    }

    fn on_access(
        &mut self,
        token: u64,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        self.flash.on_access(token, value, registers, context);
    }

    fn on_refused(
        &mut self,
        token: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        self.flash.on_refused(token, registers, context);
    }

    fn reset(&mut self) {
        self.flash.reset();
        self.banks = Default::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn operation(change: Change) -> Operation {
        Operation {
            change,
            address: BASE + BANK,
            length: WORD,
            begins_ns: 1000,
            ends_ns: 2000,
        }
    }

    #[test]
    fn a_torn_word_only_loses_bits_that_were_to_be_cleared_and_more_of_them_later() {
        let mut random = Random::new(1, "test");
        let wanted = [0x0F; WORD as usize];
        let mut last = 0;
        for at in [1000, 1200, 1500, 1900, 1999] {
            let torn = operation(Change::Program(wanted)).torn(&[0xFF; 32], at, &mut random);
            assert!(torn.iter().all(|byte| byte & 0x0F == 0x0F));
            let cleared: u32 = torn.iter().map(|byte| byte.count_zeros()).sum();
            assert!(cleared >= last, "{cleared} bits at {at} ns");
            last = cleared;
        }
        assert!(last > 120, "{last} of 128");
    }

    #[test]
    fn a_torn_sector_is_neither_what_it_was_nor_erased() {
        let mut random = Random::new(1, "test");
        let torn = operation(Change::Erase).torn(&[0x00; 32], 1500, &mut random);
        let set: u32 = torn.iter().map(|byte| byte.count_ones()).sum();
        assert!((80..176).contains(&set), "{set} of 256");
    }
}
