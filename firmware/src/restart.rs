//! Reset cause and time since power-on: reset flags, and records in memory that survives a reset.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::SCB;
use embassy_stm32::pac;
use mimu_core::wire::Start;

use crate::design_parameters::WATCHDOG_US;

/// Largest number of bytes of a path; its end identifies the file.
const PATH: usize = 40;

/// Marks a record of this layout.
const MAGIC: u32 = 0x6d69_6d32;

const NOTHING: u32 = 0;
const PANIC: u32 = 1;
const FAULT: u32 = 2;

/// Record for the next start, in whole 64-bit words: the memory's error code covers 64 bits, and part of a word may be lost in a reset.
#[derive(Clone, Copy)]
#[repr(C, align(8))]
struct Record {
    magic: u32,
    /// Starts since power-on.
    starts: u32,
    kind: u32,
    /// Line of a panic, or address of a fault.
    place: u32,
    /// Fault status.
    cfsr: u32,
    length: u32,
    path: [u8; PATH],
    /// Sum of all words before.
    check: u32,
    /// A store after the last relevant one pushes that one out of the memory's write buffer.
    push: u32,
}

impl Record {
    fn sum(&self) -> u32 {
        let words = self.path.as_chunks::<4>().0.iter();
        let path = words.map(|word| u32::from_le_bytes(*word));
        [
            self.magic,
            self.starts,
            self.kind,
            self.place,
            self.cfsr,
            self.length,
        ]
        .into_iter()
        .chain(path)
        .fold(0, |sum, word| sum.rotate_left(5) ^ word)
    }
}

/// Time since power-on. It fills one 64-bit word of the memory's error code, so that a reset during writing leaves the old value, the new
/// one, or one with a wrong check.
#[derive(Clone, Copy)]
#[repr(C, align(8))]
struct Powered {
    ms: u32,
    /// Check value, from the inverted bits of `ms` and [`MAGIC`].
    check: u32,
    /// As in [`Record`].
    push: [u32; 2],
}

/// Memory that survives a reset: integers, for which any bits are valid.
struct Kept<T: Copy>(UnsafeCell<MaybeUninit<T>>);

// SAFETY: `KEPT` is used by `take`, before other tasks run, and by handlers that are never interrupted and never return; `POWERED` by
// `take`, and then by the single task that stores the time.
#[allow(unsafe_code)]
unsafe impl<T: Copy> Sync for Kept<T> {}

// SAFETY: the section is neither loaded nor cleared at a start.
#[allow(unsafe_code)]
#[unsafe(link_section = ".uninit.restart")]
static KEPT: Kept<Record> = Kept(UnsafeCell::new(MaybeUninit::uninit()));

// SAFETY: as above.
#[allow(unsafe_code)]
#[unsafe(link_section = ".uninit.powered")]
static POWERED: Kept<Powered> = Kept(UnsafeCell::new(MaybeUninit::uninit()));

impl<T: Copy> Kept<T> {
    /// The contents of the memory.
    fn read(&self) -> T {
        // SAFETY: any bits are a valid `T`, see above; volatile, because they were written before the reset.
        #[allow(unsafe_code)]
        unsafe {
            self.0.get().cast::<T>().read_volatile()
        }
    }

    fn write(&self, value: T) {
        // SAFETY: nothing else uses it at this time; see `Sync`.
        #[allow(unsafe_code)]
        unsafe {
            self.0.get().cast::<T>().write_volatile(value);
        }
        cortex_m::asm::dsb();
    }
}

fn load() -> Option<Record> {
    let record = KEPT.read();
    (record.magic == MAGIC && record.check == record.sum()).then_some(record)
}

fn save(mut record: Record) {
    record.check = record.sum();
    KEPT.write(record);
}

/// Stores the time since power-on, ms, for the next start; `None`: unknown.
pub fn keep_powered(ms: Option<u32>) {
    let check = match ms {
        Some(ms) => !ms ^ MAGIC,
        // A check value that fits no time.
        None => MAGIC,
    };
    let ms = ms.unwrap_or_default();
    let push = [0; 2];
    POWERED.write(Powered { ms, check, push });
}

fn powered() -> Option<u32> {
    let Powered { ms, check, .. } = POWERED.read();
    (check == !ms ^ MAGIC).then_some(ms)
}

const EMPTY: Record = Record {
    magic: MAGIC,
    starts: 0,
    kind: NOTHING,
    place: 0,
    cfsr: 0,
    length: 0,
    path: [0; PATH],
    check: 0,
    push: 0,
};

/// The record of the previous run.
pub struct Before {
    record: Record,
    flags: pac::rcc::regs::Rsr,
    powered_for_ms: Option<u32>,
}

/// Reads and clears the record and the reset flags. Call it once, at the start.
pub fn take() -> Before {
    let flags = pac::RCC.rsr().read();
    pac::RCC.rsr().modify(|w| w.set_rmvf(true));
    let power_on = flags.porrstf() || flags.borrstf();
    let mut record = load().filter(|_| !power_on).unwrap_or(EMPTY);
    record.starts = record.starts.saturating_add(1);
    save(Record {
        starts: record.starts,
        ..EMPTY
    });
    let powered_for_ms = match power_on {
        true => Some(0),
        // The watchdog resets this long after it was fed, and the time was stored then. The duration of the reset itself is unknown.
        false if flags.iwdg1rstf() => powered().map(|ms| ms.saturating_add(WATCHDOG_US / 1000)),
        false => powered(),
    };
    keep_powered(powered_for_ms);
    Before {
        record,
        flags,
        powered_for_ms,
    }
}

impl Before {
    /// Starts since power-on, including this one.
    pub fn starts(&self) -> u32 {
        self.record.starts
    }

    /// Time since power-on when the clock of this start began, ms; `None` if the record is invalid.
    pub fn powered_for_ms(&self) -> Option<u32> {
        self.powered_for_ms
    }

    /// Why it started.
    pub fn start(&self) -> Start<'_> {
        let Record {
            kind,
            place,
            cfsr,
            length,
            path,
            ..
        } = &self.record;
        let flags = self.flags;
        match *kind {
            PANIC => {
                let path = path.get(..*length as usize).unwrap_or(&[]);
                Start::Panic {
                    file: core::str::from_utf8(path).unwrap_or("?"),
                    line: *place,
                }
            }
            FAULT => Start::Fault {
                pc: *place,
                cfsr: *cfsr,
            },
            // Every internal reset also pulls the pin low and sets its flag, so specific causes are tested first.
            _ if flags.porrstf() || flags.borrstf() => Start::PowerOn,
            _ if flags.iwdg1rstf() || flags.wwdg1rstf() => Start::Watchdog,
            _ if flags.sftrstf() => Start::Software,
            _ if flags.pinrstf() => Start::ResetPin,
            _ => Start::Other,
        }
    }
}

/// Records a panic, logs it with `log`, and restarts.
pub fn after_panic(info: &PanicInfo<'_>, log: impl FnOnce()) -> ! {
    let mut record = Record {
        starts: load().map_or(0, |before| before.starts),
        kind: PANIC,
        ..EMPTY
    };
    if let Some(location) = info.location() {
        let path = location.file().as_bytes();
        let end = &path[path.len().saturating_sub(PATH)..];
        record.path[..end.len()].copy_from_slice(end);
        record.length = end.len() as u32;
        record.place = location.line();
    }
    leave(record, log)
}

/// Records a fault at the instruction `pc`, logs it with `log`, and restarts.
pub fn after_fault(pc: u32, log: impl FnOnce()) -> ! {
    // SAFETY: reads a register that always exists.
    #[allow(unsafe_code)]
    let cfsr = unsafe { (*SCB::PTR).cfsr.read() };
    let record = Record {
        starts: load().map_or(0, |before| before.starts),
        kind: FAULT,
        place: pc,
        cfsr,
        ..EMPTY
    };
    leave(record, log)
}

/// Writes the record before logging, because the program may have stopped in the log, which would stop it again. A second fault follows
/// from the first and is not recorded.
fn leave(record: Record, log: impl FnOnce()) -> ! {
    static LEFT: AtomicBool = AtomicBool::new(false);
    if !LEFT.swap(true, Ordering::Relaxed) {
        save(record);
        log();
    }
    SCB::sys_reset()
}
