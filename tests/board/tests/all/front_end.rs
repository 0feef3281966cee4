//! What a calibration depends on: the converter's calibration factors, and the offsets of the TEMP pins from their mean. The layout in flash is
//! written out here.

use mimu_board::flash::SECTOR;
use mimu_board_tests::conversation::{Answer, Conversation};
use mimu_board_tests::{MS, STARTED, still};
use mimu_core::stored::hash;
use mimu_core::wire::Request;

use super::power::calibration;
use super::serial::at_rest;

/// Registers of ADC1 (RM0433 25.6): calibration factors of the offset and of the linearity.
const CALFACT: u64 = 0x4002_20c4;
const CALFACT2: u64 = 0x4002_20c8;

/// Position of the first slot in bank 2, and of the two flash words in it that are tested here.
const SLOT: usize = 6 * SECTOR as usize;
const KEPT: std::ops::Range<usize> = SLOT + 32..SLOT + 96;

/// Bits for the stored quantities.
const CONVERTER: u32 = 1;

fn stores(device: &mut Conversation, bytes: &[u8]) {
    device.upload(bytes);
    assert_eq!(device.ask(Request::UploadCommit), Answer::Done);
}

/// Cycles the supply, with these flash words in place of the present ones.
fn powered_again(device: &mut Conversation, kept: Option<&[u8]>) -> Option<u64> {
    let mut store = device.board.store().unwrap();
    if let Some(kept) = kept {
        store[KEPT].copy_from_slice(kept);
    }
    device.board.cut_supply(1).unwrap();
    device.run_for(MS);
    device.board.set_store(store).unwrap();
    device.board.restore_supply().unwrap();
    match device.greeting() {
        Answer::Greeting { hash, .. } => hash,
        other => panic!("{other:?}"),
    }
}

/// The manufacturer's reference manual has software save these factors and write them back (RM0433 25.4.8).
#[test]
fn the_converter_goes_on_with_the_factors_that_were_kept_with_the_calibration() {
    let bytes = calibration(2, 3.5);
    let mut device = Conversation::new(still(at_rest(3.3)));
    device.greeting();
    device.run_for(STARTED);
    stores(&mut device, &bytes);
    let kept = device.board.store().unwrap()[KEPT].to_vec();
    let known = u32::from_le_bytes(kept[..4].try_into().unwrap());
    // The offsets of the pins are not yet known.
    assert_eq!(known, CONVERTER);

    // Factors as of a real converter; those of the emulated one are zero.
    let factors: [u32; 7] = [0x5a3, 0x2aaa_aaaa, 0x1555_5555, 7, 8, 9, 0x155];
    let mut words = [0; 64];
    let numbers = [CONVERTER].into_iter().chain(factors);
    for (to, number) in words.chunks_mut(4).zip(numbers) {
        to.copy_from_slice(&number.to_le_bytes());
    }
    let check = hash(&words[..56]);
    words[56..].copy_from_slice(&check.to_le_bytes());
    assert_eq!(powered_again(&mut device, Some(&words)), Some(hash(&bytes)));
    device.run_for(STARTED);
    assert_eq!(device.board.register(CALFACT).unwrap(), 0x5a3);
    // The last word written is the first one.
    assert_eq!(device.board.register(CALFACT2).unwrap(), 0x2aaa_aaaa);
    // The next calibration, in the other slot, contains them too.
    stores(&mut device, &calibration(3, 3.5));
    let store = device.board.store().unwrap();
    let other = SECTOR as usize + KEPT.start..SECTOR as usize + KEPT.end;
    assert_eq!(store[other], words);

    // An incomplete word: the calibration is used all the same, and the converter calibrates itself.
    let mut device = Conversation::new(still(at_rest(3.3)));
    device.greeting();
    device.run_for(STARTED);
    stores(&mut device, &bytes);
    words[9] ^= 1;
    assert_eq!(powered_again(&mut device, Some(&words)), Some(hash(&bytes)));
    device.run_for(STARTED);
    assert_eq!(device.board.register(CALFACT).unwrap(), 0);
}
