//! The release image on the emulated board, apart from its messages: when it samples, what it samples, and the emulator's findings.

use mimu_board::running::Board;
use mimu_board::schematic::{HSE_HZ, Volts, WIRING};
use mimu_board_tests::{MS, STARTED, image, still};

/// Registers of DMA1's first stream (RM0433 15.5): remaining transfers of the round, and its destination.
const LEFT: u64 = 0x4002_0014;
const RING: u64 = 0x4002_001C;

#[test]
fn the_converter_is_paced_by_the_crystal_alone_20_conversions_a_millisecond() {
    let mut board = still(Volts::GROUND);
    board.run_to(STARTED).unwrap();
    board.conversions().unwrap();
    board.run_for(1000 * MS).unwrap();
    let second = board.conversions().unwrap();
    assert_eq!(second.count, 20_000);
    assert_eq!((second.shortest_ns, second.longest_ns), (50_000, 50_000));
}

#[test]
fn each_place_of_the_ring_holds_the_code_of_its_own_pin() {
    // A different voltage at every input, including unwired ones.
    let mut volts = Volts::GROUND;
    for (k, v) in volts.input.iter_mut().enumerate() {
        *v = 0.05 + 0.16 * k as f64;
    }
    let mut board = still(volts);
    board.run_to(STARTED).unwrap();
    let ring = board.register(RING).unwrap();
    let bytes = board.memory(ring, 80).unwrap();
    let codes: Vec<f64> = bytes
        .chunks(2)
        .map(|b| f64::from(u16::from_le_bytes([b[0], b[1]])))
        .collect();
    for (place, code) in codes.iter().enumerate() {
        let (net, pin, input) = WIRING[place % WIRING.len()];
        let exact = volts.input[input] / volts.rail * 65_535.0;
        assert!(
            *code <= exact && exact < *code + 1.01,
            "{net:?} at {pin}: {code}, not {exact}"
        );
    }
}

/// Instructions of the image that set this bit of the configuration and control register and then store it, as the crate cortex-m does: `cpsid i`, a
/// load, `orr.w` with the bit (ARMv7-M A7.7.92, A5.3.2).
fn that_set(board: &mut Board, bit: u32) -> Vec<u64> {
    const FLASH: u64 = 0x0800_0000;
    let size = image().sizes().flash as usize;
    let bytes = board.memory(FLASH, size).unwrap();
    let half = |at: usize| u32::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]));
    // 1 << bit is 0x80 rotated right by 39 - bit. The uppermost bit of this number is `i`, then three bits follow, and the last precedes the 0x80.
    let turned = 39 - bit;
    let upper = 0xf040 | (turned >> 4) << 10;
    let lower = (turned >> 1 & 7) << 12 | (turned & 1) << 7;
    let sets = |at: &usize| {
        half(*at) == 0xb672 && half(at + 4) & !0xf == upper && half(at + 6) & !0xf00 == lower
    };
    let found = (0..size - 8).step_by(2).filter(sets);
    found.map(|at| FLASH + at as u64).collect()
}

/// Bits IC and DC (ARMv7-M B3.2.8).
#[test]
fn instructions_are_cached_and_data_which_the_controllers_write_are_not() {
    let mut board = still(Volts::GROUND);
    assert_eq!(that_set(&mut board, 16), []);
    let [sets] = that_set(&mut board, 17)[..] else {
        panic!("nothing in the image sets the bit, or several do");
    };
    board.watch(sets).unwrap();
    board.run_to(MS).unwrap();
    assert_eq!(board.arrivals().unwrap().len(), 1);
}

#[test]
fn no_rule_of_the_reference_manual_is_broken() {
    let mut board = still(Volts::GROUND);
    board.run_to(2000 * MS).unwrap();
    let findings = board.findings().unwrap();
    assert_eq!(findings.broken, [""; 0]);
    assert_eq!(findings.unmodelled, [""; 0]);
    assert_eq!(board.restarts().unwrap(), []);
}

#[test]
fn after_the_reset_pin_and_after_a_power_cut_it_samples_again_in_step() {
    let mut board = still(Volts::GROUND);
    board.run_to(STARTED).unwrap();
    board.reset_by_pin(1).unwrap();
    board.run_for(STARTED).unwrap();
    board.cut_supply(1).unwrap();
    board.run_for(10 * MS).unwrap();
    board.conversions().unwrap();
    let dead = board.run_for(10 * MS).unwrap();
    assert_eq!(board.conversions().unwrap().count, 0);
    board.restore_supply().unwrap();
    let started = board.run_for(STARTED).unwrap();
    assert!(started.instructions > dead.instructions);
    board.conversions().unwrap();
    board.run_for(100 * MS).unwrap();
    let after = board.conversions().unwrap();
    assert_eq!(after.count, 2000);
    assert_eq!((after.shortest_ns, after.longest_ns), (50_000, 50_000));
    let causes: Vec<String> = board
        .restarts()
        .unwrap()
        .into_iter()
        .map(|r| r.cause)
        .collect();
    assert_eq!(causes, ["Pin", "PowerOn"]);
    assert!(board.register(LEFT).unwrap() <= 40);
    assert_eq!(board.findings().unwrap().broken, [""; 0]);
}

/// Registers of RCC (RM0433 8.7): oscillators; sources, dividers and multipliers of the PLLs; clock source of USB.
const RCC: u64 = 0x5802_4400;

/// Every image configures the third PLL as USB needs it; this one has it stopped. Full speed needs 48 MHz within 0.25 % (USB 2.0, 7.1.11), and the
/// part's own untrimmed oscillator is less accurate.
#[test]
fn the_clock_of_usb_is_48_mhz_of_the_debuggers_crystal() {
    let mut board = still(Volts::GROUND);
    board.run_to(STARTED).unwrap();
    let mut field = |offset: u64, low: u32, bits: u32| {
        let register = board.register(RCC + offset).unwrap();
        (register >> low) & ((1 << bits) - 1)
    };
    // PLLSRC: HSE. USBSEL: PLL3 Q.
    assert_eq!((field(0x28, 0, 2), field(0x54, 20, 2)), (2, 2));
    let reference = HSE_HZ / field(0x28, 20, 6);
    // PLL3RGE and PLL3VCOSEL: an input of 8 to 16 MHz, the wide VCO, which runs at 192 to 836 MHz.
    assert_eq!((field(0x2c, 10, 2), field(0x2c, 9, 1)), (3, 0));
    assert!((8_000_000..=16_000_000).contains(&reference));
    let vco = reference * (field(0x40, 0, 9) + 1);
    assert!((192_000_000..=836_000_000).contains(&vco), "{vco}");
    // DIVQ3EN; no fraction is added.
    assert_eq!((field(0x2c, 23, 1), field(0x2c, 8, 1)), (1, 0));
    assert_eq!(vco / (field(0x40, 16, 7) + 1), 48_000_000);
    // Neither the PLL nor the untrimmed oscillator runs needlessly.
    assert_eq!((field(0, 28, 1), field(0, 12, 1)), (0, 0));
}
