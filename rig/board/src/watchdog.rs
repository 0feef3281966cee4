//! The independent watchdog (RM0433 chapter 45), which the emulator does not model.

use rigless::device::{Device, DeviceContext, RegisterFile};
use rigless::soc::stm32h743::generated::iwdg::{Register, pr, rlr};
use rigless::time::{EventId, VirtualNanos};

/// The low-speed oscillator, Hz (DS12110, table 51: 32 kHz).
const LSI_HZ: u64 = 32_000;

// Keys of IWDG_KR (45.4.1).
const START: u64 = 0xCCCC;
const RELOAD: u64 = 0xAAAA;
const UNLOCK: u64 = 0x5555;

/// The watchdog. Not modelled: the window, and the delay of new values by some cycles of its own clock.
#[derive(Debug, Default)]
pub(crate) struct Watchdog {
    running: bool,
    unlocked: bool,
    prescaler: u64,
    reload: u64,
    bite: Option<EventId>,
}

impl Watchdog {
    pub(crate) fn new() -> Self {
        Self {
            reload: 0xFFF,
            ..Self::default()
        }
    }

    fn feed(&mut self, context: &mut DeviceContext<'_>) {
        if self.running {
            // 4, 8 .. 256; the last two codes are the same (45.4.2).
            let divider = 4 << self.prescaler.min(6);
            let ns = (self.reload + 1) * divider * 1_000_000_000 / LSI_HZ;
            let at = VirtualNanos(context.now().0 + ns);
            self.bite = Some(context.schedule(at));
        }
    }
}

impl Device for Watchdog {
    type Register = Register;

    fn write(
        &mut self,
        register: Register,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        match register {
            Register::Kr => {
                // Any other key locks (45.3.5).
                self.unlocked = value == UNLOCK;
                match value {
                    START => {
                        self.running = true;
                        self.feed(context);
                    }
                    RELOAD => self.feed(context),
                    _ => {}
                }
            }
            Register::Pr if self.unlocked => self.prescaler = pr::PR.get(value),
            Register::Rlr if self.unlocked => self.reload = rlr::RL.get(value),
            Register::Pr | Register::Rlr => {
                context.tell(
                    "KR",
                    "RM0433 45.3.5: written without the key 0x5555, ignored",
                );
                registers.set(Register::Pr, self.prescaler);
                registers.set(Register::Rlr, self.reload);
            }
            Register::Winr | Register::Sr => {}
        }
    }

    fn on_event(
        &mut self,
        event: EventId,
        _registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        if self.bite == Some(event) {
            self.bite = None;
            context.request_reset();
        }
    }

    fn reset(&mut self) {
        *self = Self::new();
    }
}
