//! The two calibration sectors of bank 2 as a flash memory that can be waited for.
//!
//! embassy-stm32 0.6 erases this family's flash by waiting in a loop, a second in which no other task runs; its asynchronous half
//! clears error flags by writing to the status register, which does not clear them. So this is on the registers, and it polls with
//! pauses: nothing is in a hurry, and an interrupt would only add a vector.
//!
//! # Reading a word that is not whole
//!
//! A word whose programming was cut off has an error code that does not match. Reading it raises a bus error (RM0433 4.7.7), which is a
//! hard fault, at every start again. Such a read is therefore done where the processor ignores bus errors of data accesses: at the
//! priority of a hard fault (FAULTMASK) with CCR.BFHFNMIGN set (ARMv7-M B3.2.8), for the eight loads of one word; then the memory's
//! own flags tell whether to believe them.

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::SCB;
use embassy_stm32::pac;
use embassy_time::{Duration, Instant, Timer};
use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

use crate::board::CALIBRATION_SECTORS;
use crate::design_parameters::FLASH_WORD as WORD;

/// Size of a sector, bytes: what is erased.
const SECTOR: usize = 128 * 1024;
/// Bank 2 (RM0433 4.3.4).
const BANK_START: usize = 0x0810_0000;
/// Where the first sector is.
const START: usize = BANK_START + CALIBRATION_SECTORS[0] as usize * SECTOR;
/// Bytes in all of them.
const LENGTH: usize = CALIBRATION_SECTORS.len() * SECTOR;

/// Keys that unlock the control register (RM0433 4.5.1).
const KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];

/// Words whose single wrong bit was corrected when they were read.
pub static CORRECTED: AtomicU32 = AtomicU32::new(0);
/// Words with more than one.
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
    /// Not within the sectors, or not by whole words.
    Range,
    /// The memory refused; its status register.
    Refused(u32),
    /// A word has more than one wrong bit.
    Uncorrectable,
    /// An operation does not end, or one from before has not.
    Stalled,
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
    /// To be called once: nobody else may use the controller of bank 2.
    ///
    /// # Panics
    ///
    /// If `memory.x` has the sectors elsewhere.
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
        // A load from a bank that is busy would hold the processor until it is not (RM0433 4.3.8).
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
        let _unlocked = Unlocked::new();
        for sector in &CALIBRATION_SECTORS[from / SECTOR..to / SECTOR] {
            let bank = pac::FLASH.bank(1);
            bank.cr().modify(|w| {
                w.set_ser(true);
                w.set_snb(*sector);
            });
            bank.cr().modify(|w| w.set_start(true));
            // About a second; looked at a hundred times.
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
            bank.cr().modify(|w| w.set_pg(true));
            let start = START + offset + k * WORD;
            for (k, part) in word.as_chunks::<4>().0.iter().enumerate() {
                let value = u32::from_le_bytes(*part);
                // SAFETY: a word of the calibration sectors, by the test above; nothing has a reference to them. With PG set a
                // store goes to the controller's buffer, and programming begins with the eighth.
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

/// The control register of bank 2 is unlocked as long as this lives.
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

/// Flags of errors stand until they are cleared, and some forbid the next operation.
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

/// Most that erasing a sector takes, µs: 4 s whatever the parallelism (DS12110, table 140), and a quarter more. The host waits for 15 s.
const ERASE_US: u64 = 5_000_000;

/// Most that programming a word takes, µs: 0.6 ms in that table; nothing else waits for it.
const WRITE_US: u64 = 10_000;

/// Refuses to begin while an operation runs that did not end in its time: its outcome is not known, and another behind it would wait as well.
fn idle() -> Result<(), Error> {
    match pac::FLASH.bank(1).sr().read().qw() {
        true => Err(Error::Stalled),
        false => Ok(()),
    }
}

/// Waits until the queue is empty, looking every `pause_us`, for `most_us` at most: samples go on meanwhile and feed the watchdog, so that
/// nothing else would end it.
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

/// Bit of CCR by which the highest priorities ignore bus errors of data.
const BFHFNMIGN: u32 = 1 << 8;
/// Bits of CFSR by which a data bus error is reported, precise or not, and its address is valid.
const DATA_BUS_ERRORS: u32 = 1 << 9 | 1 << 10 | 1 << 15;

/// Reads a word of the calibration sectors, by its number.
fn read_word(number: usize) -> Result<[u8; WORD], Error> {
    let from = core::ptr::with_exposed_provenance::<u32>(START + number * WORD);
    let mut bytes = [0; WORD];
    clear_flags();
    // SAFETY: the address is within the sectors, since the callers check their ranges. With FAULTMASK set nothing interrupts, so that
    // the two registers are this function's; both are as before when it returns. CFSR's bits are cleared by writing ones.
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
