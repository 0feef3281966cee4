//! Why the device started, and for how long it has had its power: the reset flags, and records in memory that outlive a reset.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::SCB;
use embassy_stm32::pac;
use mimu_core::wire::Start;

use crate::design_parameters::WATCHDOG_US;

/// Most bytes of a path: its end says which file it is.
const PATH: usize = 40;

/// That the record is one, and of this layout.
const MAGIC: u32 = 0x6d69_6d32;

const NOTHING: u32 = 0;
const PANIC: u32 = 1;
const FAULT: u32 = 2;

/// What is left for the next start. Whole words: the memory's error code is over 64 bits, and part of one may be lost in a reset.
#[derive(Clone, Copy)]
#[repr(C, align(8))]
struct Record {
    magic: u32,
    /// Starts since the power came.
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
    /// A store behind the last one that counts pushes that out of the memory's write buffer.
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

/// How long the power had been there. A word of the memory's error code by itself, so that a reset while it is written leaves the one
/// before, the new one, or one whose check does not hold.
#[derive(Clone, Copy)]
#[repr(C, align(8))]
struct Powered {
    ms: u32,
    /// `ms`, all bits turned, and [`MAGIC`].
    check: u32,
    /// As in [`Record`].
    push: [u32; 2],
}

/// What is kept over a reset: integers, of which any bits are some.
struct Kept<T: Copy>(UnsafeCell<MaybeUninit<T>>);

// SAFETY: `KEPT` is used by `take`, before anything runs beside it, and by handlers that nothing interrupts and that never return; `POWERED`
// by `take`, and then by the one task that keeps the time.
#[allow(unsafe_code)]
unsafe impl<T: Copy> Sync for Kept<T> {}

// SAFETY: the section is one that is neither loaded nor cleared at a start.
#[allow(unsafe_code)]
#[unsafe(link_section = ".uninit.restart")]
static KEPT: Kept<Record> = Kept(UnsafeCell::new(MaybeUninit::uninit()));

// SAFETY: as above.
#[allow(unsafe_code)]
#[unsafe(link_section = ".uninit.powered")]
static POWERED: Kept<Powered> = Kept(UnsafeCell::new(MaybeUninit::uninit()));

impl<T: Copy> Kept<T> {
    /// Whatever the memory holds.
    fn read(&self) -> T {
        // SAFETY: whatever the memory holds is a `T`, see there; volatile, because it was written in another life.
        #[allow(unsafe_code)]
        unsafe {
            self.0.get().cast::<T>().read_volatile()
        }
    }

    fn write(&self, value: T) {
        // SAFETY: nothing else uses it at the time; see `Sync`.
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

/// Keeps for how long the power has been there, ms, for the next start; `None`: that it is not known.
pub fn keep_powered(ms: Option<u32>) {
    let check = match ms {
        Some(ms) => !ms ^ MAGIC,
        // Holds for no number beside it.
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

/// What the life before left.
pub struct Before {
    record: Record,
    flags: pac::rcc::regs::Rsr,
    powered_for_ms: Option<u32>,
}

/// To be called once, at the start: reads and clears the record and the reset flags.
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
        // The watchdog bites so long after it was fed, which is when the time was kept. How long the reset itself took nobody knows.
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
    /// Starts since the power came, this one counted.
    pub fn starts(&self) -> u32 {
        self.record.starts
    }

    /// For how long the power had been there when the clock of this start began, ms; `None` if the record does not hold.
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
            // Every reset from within also pulls the pin low and sets its flag, so the order is from the particular to the general.
            _ if flags.porrstf() || flags.borrstf() => Start::PowerOn,
            _ if flags.iwdg1rstf() || flags.wwdg1rstf() => Start::Watchdog,
            _ if flags.sftrstf() => Start::Software,
            _ if flags.pinrstf() => Start::ResetPin,
            _ => Start::Other,
        }
    }
}

/// Leaves a record of a panic, then logs it by `log`, and starts anew.
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

/// Leaves a record of a fault at the instruction `pc`, then logs it by `log`, and starts anew.
pub fn after_fault(pc: u32, log: impl FnOnce()) -> ! {
    // SAFETY: reading a register that is always there.
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

/// The record first: the log may be what the program has stopped in, and then stops it again. What comes second tells of the first
/// only, and is not kept.
fn leave(record: Record, log: impl FnOnce()) -> ! {
    static LEFT: AtomicBool = AtomicBool::new(false);
    if !LEFT.swap(true, Ordering::Relaxed) {
        save(record);
        log();
    }
    SCB::sys_reset()
}
