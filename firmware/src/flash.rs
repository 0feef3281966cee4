//! Asynchronous driver of the two calibration sectors of flash bank 2.
//!
//! embassy-stm32 0.6 erases this family's flash by waiting in a loop, a second in which no other task runs; its asynchronous half
//! clears error flags by writing to the status register, which does not clear them. So this driver uses the registers, and polls with
//! pauses: speed does not matter, and an interrupt would only add a vector.
//!
//! # Reading a torn word
//!
//! A word whose programming was interrupted has a wrong error code. Reading it raises a bus error (RM0433 4.7.7), which becomes a hard
//! fault, at every start. A word is therefore read in a mode in which the processor ignores bus errors of data accesses: at the priority of
//! a hard fault (FAULTMASK) with CCR.BFHFNMIGN set (ARMv7-M B3.2.8), for the eight loads of one word. The memory's flags then show whether
//! the data are valid.

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::SCB;
use embassy_stm32::pac;
use embassy_time::{Duration, Instant, Timer};
use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

use crate::board::CALIBRATION_SECTORS;
use crate::design_parameters::FLASH_WORD as WORD;
use crate::protection::may_store;

/// Size of a sector, the unit of erasing, bytes.
const SECTOR: usize = 128 * 1024;
/// Bank 2 (RM0433 4.3.4).
const BANK_START: usize = 0x0810_0000;
/// Address of the first sector.
const START: usize = BANK_START + CALIBRATION_SECTORS[0] as usize * SECTOR;
/// Total size of the sectors, bytes.
const LENGTH: usize = CALIBRATION_SECTORS.len() * SECTOR;

/// Keys that unlock the control register (RM0433 4.5.1).
const KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];

/// Words with one wrong bit, which was corrected on reading.
pub static CORRECTED: AtomicU32 = AtomicU32::new(0);
/// Words with more than one wrong bit.
pub static UNCORRECTABLE: AtomicU32 = AtomicU32::new(0);

// SAFETY: symbols of `memory.x`, of which only the addresses are used.
#[allow(unsafe_code)]
unsafe extern "C" {
    static __calibration_start: u8;
    static __calibration_end: u8;
}

/// What went wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum Error {
    /// Outside the sectors, or not a multiple of a word.
    Range,
    /// The memory reported an error; its status register.
    Refused(u32),
    /// A word has more than one wrong bit.
    Uncorrectable,
    /// An operation does not end, or an earlier one has not ended.
    Stalled,
    /// The supply is failing, or the banks are swapped: nothing was begun.
    Unprotected,
}

impl NorFlashError for Error {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Range => NorFlashErrorKind::OutOfBounds,
            _ => NorFlashErrorKind::Other,
        }
    }
}

/// The calibration sectors.
pub struct Flash(());

impl Flash {
    /// Call it once: this driver needs exclusive use of the controller of bank 2.
    ///
    /// # Panics
    ///
    /// If `memory.x` has other addresses for the sectors.
    pub fn new() -> Self {
        let start = (&raw const __calibration_start).addr();
        let end = (&raw const __calibration_end).addr();
        defmt::assert!(start == START && end == START + LENGTH);
        Self(())
    }
}

impl Default for Flash {
    fn default() -> Self {
        Self::new()
    }
}

impl ErrorType for Flash {
    type Error = Error;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        let mut at = offset as usize;
        if at.checked_add(bytes.len()).is_none_or(|end| end > LENGTH) {
            return Err(Error::Range);
        }
        // A load from a busy bank would stall the processor (RM0433 4.3.8).
        idle()?;
        let mut rest = bytes;
        while !rest.is_empty() {
            let word = read_word(at / WORD)?;
            let from = at % WORD;
            let count = rest.len().min(WORD - from);
            let (part, others) = rest.split_at_mut(count);
            part.copy_from_slice(&word[from..from + count]);
            rest = others;
            at += count;
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        LENGTH
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        let (from, to) = (from as usize, to as usize);
        let whole = from.is_multiple_of(SECTOR) && to.is_multiple_of(SECTOR);
        if !whole || from > to || to > LENGTH {
            return Err(Error::Range);
        }
        idle()?;
        protected()?;
        let _unlocked = Unlocked::new();
        for sector in &CALIBRATION_SECTORS[from / SECTOR..to / SECTOR] {
            let bank = pac::FLASH.bank(1);
            bank.cr().modify(|w| {
                w.set_ser(true);
                w.set_snb(*sector);
            });
            bank.cr().modify(|w| w.set_start(true));
            // About a second; polled a hundred times.
            let done = finished(10_000, ERASE_US).await;
            bank.cr().modify(|w| w.set_ser(false));
            done?;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        let offset = offset as usize;
        let whole = offset.is_multiple_of(WORD) && bytes.len().is_multiple_of(WORD);
        if !whole
            || offset
                .checked_add(bytes.len())
                .is_none_or(|end| end > LENGTH)
        {
            return Err(Error::Range);
        }
        idle()?;
        let _unlocked = Unlocked::new();
        let bank = pac::FLASH.bank(1);
        for (k, word) in bytes.as_chunks::<WORD>().0.iter().enumerate() {
            protected()?;
            bank.cr().modify(|w| w.set_pg(true));
            let start = START + offset + k * WORD;
            for (k, part) in word.as_chunks::<4>().0.iter().enumerate() {
                let value = u32::from_le_bytes(*part);
                // SAFETY: the test above ensures that this is a word of the calibration sectors, to which no reference exists. With PG set,
                // stores go to the controller's buffer, and programming begins with the eighth.
                #[allow(unsafe_code)]
                unsafe {
                    core::ptr::with_exposed_provenance_mut::<u32>(start + 4 * k)
                        .write_volatile(value);
                }
            }
            cortex_m::asm::dsb();
            // Some 0.1 ms.
            let done = finished(50, WRITE_US).await;
            bank.cr().modify(|w| w.set_pg(false));
            done?;
        }
        Ok(())
    }
}

/// Keeps the control register of bank 2 unlocked until it is dropped.
struct Unlocked;

impl Unlocked {
    fn new() -> Self {
        let bank = pac::FLASH.bank(1);
        clear_flags();
        if bank.cr().read().lock() {
            for key in KEYS {
                bank.keyr().write_value(key);
            }
        }
        Self
    }
}

impl Drop for Unlocked {
    fn drop(&mut self) {
        pac::FLASH.bank(1).cr().modify(|w| w.set_lock(true));
    }
}

/// Error flags stay set until they are cleared, and some block the next operation.
fn clear_flags() {
    pac::FLASH.bank(1).ccr().write(|w| {
        w.set_clr_eop(true);
        w.set_clr_wrperr(true);
        w.set_clr_pgserr(true);
        w.set_clr_strberr(true);
        w.set_clr_incerr(true);
        w.set_clr_operr(true);
        w.set_clr_sneccerr(true);
        w.set_clr_dbeccerr(true);
    });
}

/// Longest time to erase a sector, µs: 4 s for any parallelism (DS12110, table 140), plus a quarter. The host waits 15 s.
const ERASE_US: u64 = 5_000_000;

/// Longest time to program a word, µs: 0.6 ms in that table; a large reserve is harmless, because nothing else waits.
const WRITE_US: u64 = 10_000;

/// Refuses to start while an earlier operation has not ended in its time: its outcome is unknown, and a new operation would wait too.
fn idle() -> Result<(), Error> {
    match pac::FLASH.bank(1).sr().read().qw() {
        true => Err(Error::Stalled),
        false => Ok(()),
    }
}

/// Refuses to begin an operation that the supply may not let end.
fn protected() -> Result<(), Error> {
    may_store().map_err(|_| Error::Unprotected)
}

/// Waits until the queue is empty, polling every `pause_us`, for at most `most_us`. The limit is needed because sampling continues and
/// feeds the watchdog, so nothing else would end the wait.
async fn finished(pause_us: u64, most_us: u64) -> Result<(), Error> {
    let bank = pac::FLASH.bank(1);
    let until = Instant::now() + Duration::from_micros(most_us);
    while bank.sr().read().qw() {
        if Instant::now() > until {
            return Err(Error::Stalled);
        }
        Timer::after_micros(pause_us).await;
    }
    let sr = bank.sr().read();
    let failed = sr.wrperr() || sr.pgserr() || sr.strberr() || sr.incerr() || sr.operr();
    clear_flags();
    match failed {
        true => Err(Error::Refused(sr.0)),
        false => Ok(()),
    }
}

/// Bit of CCR that makes the highest priorities ignore data bus errors.
const BFHFNMIGN: u32 = 1 << 8;
/// Bits of CFSR for a data bus error (precise or imprecise) and a valid address.
const DATA_BUS_ERRORS: u32 = 1 << 9 | 1 << 10 | 1 << 15;

/// Reads the word with this number in the calibration sectors.
fn read_word(number: usize) -> Result<[u8; WORD], Error> {
    let from = core::ptr::with_exposed_provenance::<u32>(START + number * WORD);
    let mut bytes = [0; WORD];
    clear_flags();
    // SAFETY: the callers check that the address is within the sectors. With FAULTMASK set nothing interrupts, so this function has
    // exclusive use of the two registers; both are restored when it returns. CFSR's bits are cleared by writing ones.
    #[allow(unsafe_code)]
    let bus_error = unsafe {
        let scb = &*SCB::PTR;
        core::arch::asm!("cpsid f", options(nostack));
        scb.ccr.modify(|ccr| ccr | BFHFNMIGN);
        cortex_m::asm::dsb();
        cortex_m::asm::isb();
        for (k, part) in bytes.as_chunks_mut::<4>().0.iter_mut().enumerate() {
            *part = from.add(k).read_volatile().to_le_bytes();
        }
        cortex_m::asm::dsb();
        let bus_error = scb.cfsr.read() & DATA_BUS_ERRORS != 0;
        scb.cfsr.write(DATA_BUS_ERRORS);
        scb.ccr.modify(|ccr| ccr & !BFHFNMIGN);
        core::arch::asm!("cpsie f", options(nostack));
        bus_error
    };
    let sr = pac::FLASH.bank(1).sr().read();
    clear_flags();
    if sr.dbeccerr() || bus_error {
        UNCORRECTABLE.fetch_add(1, Ordering::Relaxed);
        return Err(Error::Uncorrectable);
    }
    if sr.sneccerr1() {
        CORRECTED.fetch_add(1, Ordering::Relaxed);
    }
    Ok(bytes)
}
