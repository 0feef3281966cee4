//! What protects flash and memory from causes outside the program: the detector of a low supply, the option bytes, a guard below the stack.
//!
//! # Option bytes are read, not written
//!
//! Two of them matter. A brown-out level of 0 lets the part run down to 1.62 V, where a write that is in progress leaves a torn word; level 3 resets it
//! at 2.6 V. With swapped banks the program runs from bank 2, and an erase of the calibration sectors would hit bank 1. The firmware tells both in its
//! greeting and refuses to store with swapped banks. It does not set them: a supply that fails while option bytes are programmed is the very case that
//! the level is for, and a debugger sets them once, with a supply that a person watches (docs/device/board.md).

use cortex_m::peripheral::MPU;
use embassy_stm32::pac;
use mimu_core::wire::Refusal;

/// Level of the detector: PLS 6, 2.76 V falling, 2.86 V rising (DS12110, table 116). The regulators give 3.3 V within 2 %; below 2.76 V the supply is
/// failing, and 2.6 V, where brown-out level 3 resets, are still to come.
const LEVEL: u8 = 6;

/// Size of the guard, bytes, a power of two. Most frames of functions here are below it, so that a stack that grows call by call does not step over it.
/// The handler of the fault works within the guard, so the memory below it, which keeps the record of the fault, stays as it is.
const GUARD: usize = 1024;

/// RASR: no access for anyone, execution never, of [`GUARD`] bytes (2^(9+1)), on (ARMv7-M B3.5.9).
const NO_ACCESS: u32 = 1 << 28 | 9 << 1 | 1;

/// CTRL: on, with the default map for everything else, and off at the priority of a hard fault, whose handler needs a stack (B3.5.5).
const ON: u32 = 1 << 2 | 1;

// SAFETY: a symbol of the linker script, of which only the address is used.
#[allow(unsafe_code)]
unsafe extern "C" {
    /// End of the static memory; the stack grows down towards it.
    static __sheap: u8;
}

/// Switches the detector on and puts the guard between static memory and stack.
pub fn begin(mpu: &MPU) {
    pac::PWR.cr1().modify(|w| {
        w.set_pls(LEVEL);
        w.set_pvde(true);
    });
    let from = (&raw const __sheap).addr().next_multiple_of(GUARD);
    // SAFETY: nothing is stored between static memory and stack, so no valid access is refused.
    #[allow(unsafe_code)]
    unsafe {
        mpu.rnr.write(0);
        mpu.rbar.write(from as u32);
        mpu.rasr.write(NO_ACCESS);
        mpu.ctrl.write(ON);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

/// Whether the supply has fallen below 2.76 V, and has not come back to 2.86 V.
pub fn supply_is_low() -> bool {
    pac::PWR.csr1().read().pvdo()
}

/// Brown-out level, 0 (the part's lowest, 1.62 V) to 3 (2.6 V).
pub fn brown_out_level() -> u8 {
    pac::FLASH.optsr_cur().read().bor_lev()
}

/// Whether the two banks of the flash have exchanged their addresses.
pub fn banks_swapped() -> bool {
    pac::FLASH.optcr().read().swap_bank()
}

/// Whether a calibration may be written now.
pub fn may_store() -> Result<(), Refusal> {
    if banks_swapped() {
        return Err(Refusal::BanksSwapped);
    }
    match supply_is_low() {
        true => Err(Refusal::SupplyLow),
        false => Ok(()),
    }
}
