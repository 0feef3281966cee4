//! Why the device started: the reset flags, and a record in memory that outlives a reset.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use embassy_stm32::pac;
use mimu_core::wire::Start;

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

struct Kept(UnsafeCell<MaybeUninit<Record>>);

// SAFETY: it is used by `take`, before anything runs beside it, and by handlers that nothing interrupts and that never return.
#[allow(unsafe_code)]
unsafe impl Sync for Kept {}

// SAFETY: the section is one that is neither loaded nor cleared at a start.
#[allow(unsafe_code)]
#[unsafe(link_section = ".uninit.restart")]
static KEPT: Kept = Kept(UnsafeCell::new(MaybeUninit::uninit()));

fn load() -> Option<Record> {
    // SAFETY: all bits of a record are integers, so that whatever the memory holds is one; volatile, because it was written in
    // another life. Whether it makes sense is asked next.
    #[allow(unsafe_code)]
    let record = unsafe { KEPT.0.get().cast::<Record>().read_volatile() };
    (record.magic == MAGIC && record.check == record.sum()).then_some(record)
}

fn save(mut record: Record) {
    record.check = record.sum();
    // SAFETY: nothing else uses it at the time; see `Kept`.
    #[allow(unsafe_code)]
    unsafe {
        KEPT.0.get().cast::<Record>().write_volatile(record);
    }
    cortex_m::asm::dsb();
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
    Before { record, flags }
}

impl Before {
    /// Starts since the power came, this one counted.
    pub fn starts(&self) -> u32 {
        self.record.starts
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

/// Leaves a record of a panic and starts anew.
pub fn after_panic(info: &PanicInfo<'_>) -> ! {
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
    save(record);
    SCB::sys_reset()
}

/// Leaves a record of a fault at the instruction `pc` and starts anew.
pub fn after_fault(pc: u32) -> ! {
    // SAFETY: reading a register that is always there.
    #[allow(unsafe_code)]
    let cfsr = unsafe { (*SCB::PTR).cfsr.read() };
    save(Record {
        starts: load().map_or(0, |before| before.starts),
        kind: FAULT,
        place: pc,
        cfsr,
        ..EMPTY
    });
    SCB::sys_reset()
}
