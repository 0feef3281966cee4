//! The slots on a flash memory that does what a real one does when its supply fails.

extern crate std;
use std::vec;
use std::vec::Vec;

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::{
    ErrorType, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use mimu_core::compensation::{Affine, Compensation};
use mimu_core::stored;
use mimu_core::table::Node;
use nalgebra::{Matrix3, Vector3};

use super::*;
use crate::front_end::Factors;

/// What a word holds.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Cell {
    Erased,
    Written([u8; WORD]),
    /// Cut off while it was written or erased: it reads as an error, or as this.
    Torn(Option<[u8; WORD]>),
}

#[derive(Debug, PartialEq)]
enum Error {
    NoSupply,
    Uncorrectable,
    WrittenTwice,
}

impl NorFlashError for Error {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

/// What the tests' calibrations are tied to.
const FRONT_END: FrontEnd = FrontEnd {
    converter: Some(Factors {
        offset: 0x123,
        linearity: [1, 2, 3, 4, 5, 6],
    }),
    pins_c: Some([1.0, -3.0, 2.0]),
};

/// Words of the two sectors; only the first `USED` of each are kept, as many as a calibration takes.
#[derive(Clone)]
struct Memory {
    cells: Vec<Cell>,
    /// Operations until the supply fails.
    left: usize,
    /// Operations so far.
    done: usize,
    /// What a word reads like that was torn: 0 nothing at all, 1 as erased, 2 as written, 3 as half of both.
    tear: u8,
}

const SECTOR: usize = 128 * 1024;
const USED: usize = BODY / WORD + MAX_LENGTH / WORD;
const PER_SECTOR: usize = SECTOR / WORD;

impl Memory {
    fn new() -> Self {
        Self {
            cells: vec![Cell::Erased; 2 * USED],
            left: usize::MAX,
            done: 0,
            tear: 0,
        }
    }

    fn place(word: usize) -> usize {
        let (sector, at) = (word / PER_SECTOR, word % PER_SECTOR);
        assert!(sector < 2 && at < USED);
        sector * USED + at
    }

    /// Whether the supply holds for one more operation.
    fn step(&mut self) -> bool {
        self.left = self.left.saturating_sub(1);
        self.done += 1;
        self.left > 0
    }
}

impl ErrorType for Memory {
    type Error = Error;
}

impl ReadNorFlash for Memory {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        for (k, byte) in bytes.iter_mut().enumerate() {
            let at = offset as usize + k;
            let word = match self.cells[Self::place(at / WORD)] {
                Cell::Erased => [0xff; WORD],
                Cell::Written(word) | Cell::Torn(Some(word)) => word,
                Cell::Torn(None) => return Err(Error::Uncorrectable),
            };
            *byte = word[at % WORD];
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        2 * SECTOR
    }
}

impl NorFlash for Memory {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        assert_eq!(to - from, SECTOR as u32);
        let first = Self::place(from as usize / WORD);
        let alive = self.step();
        for (k, cell) in self.cells[first..first + USED].iter_mut().enumerate() {
            *cell = match (alive, *cell, self.tear) {
                (true, ..) => Cell::Erased,
                // Some words have gone, some are there, some are neither.
                (false, Cell::Written(word), 2) => Cell::Written(word),
                (false, Cell::Written(word), 3) if k % 2 == 0 => Cell::Torn(Some(word)),
                (false, _, 1) => Cell::Torn(Some([0xff; WORD])),
                (false, ..) => Cell::Torn(None),
            };
        }
        alive.then_some(()).ok_or(Error::NoSupply)
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        assert_eq!((offset as usize % WORD, bytes.len()), (0, WORD));
        let alive = self.step();
        let cell = &mut self.cells[Self::place(offset as usize / WORD)];
        let word: [u8; WORD] = bytes.try_into().unwrap();
        if *cell != Cell::Erased {
            return Err(Error::WrittenTwice);
        }
        *cell = match (alive, self.tear) {
            (true, _) => Cell::Written(word),
            (_, 1) => Cell::Torn(Some([0xff; WORD])),
            (_, 2) => Cell::Torn(Some(word)),
            (_, 3) => {
                let mut half = [0xff; WORD];
                half[..WORD / 2].copy_from_slice(&word[..WORD / 2]);
                Cell::Torn(Some(half))
            }
            _ => Cell::Torn(None),
        };
        alive.then_some(()).ok_or(Error::NoSupply)
    }
}

/// A calibration of so many nodes, different for each `k`.
fn calibration(k: u8, nodes: usize) -> Vec<u8> {
    let affine = Affine {
        matrix: Matrix3::from_diagonal_element(3.0 + f32::from(k)),
        offset: Vector3::repeat(f32::from(k)),
    };
    let model = Compensation {
        gyro: affine,
        accel: affine,
    };
    let nodes: Vec<_> = (0..nodes)
        .map(|n| Node::constant(n as f32, model))
        .collect();
    let mut bytes = vec![0; MAX_LENGTH];
    let found_with = mimu_core::PerSensor::both(&affine.matrix);
    let length = stored::encode(
        &stored::Origin::UNKNOWN,
        found_with,
        &stored::Curves::of(&nodes),
        &[],
        &mut bytes,
    )
    .unwrap();
    bytes.truncate(length);
    bytes
}

/// What a device finds when it starts.
fn found(memory: &Memory) -> (Option<Vec<u8>>, [Slot; 2]) {
    let mut memory = memory.clone();
    memory.left = usize::MAX;
    let mut buffer = heapless::Vec::new();
    let slots = block_on(Slots::open(memory, &mut buffer));
    let in_use = slots.in_use();
    let bytes = in_use.map(|(length, _)| {
        assert_eq!(buffer.len(), length as usize);
        buffer.to_vec()
    });
    if let (Some(bytes), Some((_, expected))) = (&bytes, in_use) {
        assert_eq!(hash(bytes), expected);
    }
    (bytes, slots.state())
}

/// Stores on a memory whose supply fails after so many operations; whether it reported that it has.
fn store(memory: &mut Memory, bytes: &[u8], left: usize, tear: u8) -> bool {
    memory.left = left;
    memory.tear = tear;
    let mut buffer = heapless::Vec::new();
    let mut slots = block_on(Slots::open(memory.clone(), &mut buffer));
    let stored = block_on(slots.store(bytes, &FRONT_END)).is_ok();
    *memory = slots.flash;
    stored
}

#[test]
fn an_empty_memory_holds_none_and_then_the_last_that_was_stored() {
    let mut memory = Memory::new();
    assert_eq!(found(&memory), (None, [Slot::Empty; 2]));
    for k in 0..5 {
        let bytes = calibration(k, 1 + usize::from(k) * 3);
        assert!(store(&mut memory, &bytes, usize::MAX, 0));
        assert_eq!(found(&memory).0, Some(bytes));
    }
    let whole = |generation| Slot::Whole { generation };
    assert_eq!(found(&memory).1, [whole(5), whole(4)]);
}

#[test]
fn the_calibration_in_use_is_not_written_again_unless_it_is_damaged() {
    let (one, other) = (calibration(1, 3), calibration(2, 3));
    let mut memory = Memory::new();
    assert!(store(&mut memory, &one, usize::MAX, 0));
    let (done, before) = (memory.done, memory.cells.clone());
    assert!(store(&mut memory, &one, usize::MAX, 0));
    assert_eq!((memory.done, &memory.cells), (done, &before));
    // Also not when it is the older one, which is not in use.
    assert!(store(&mut memory, &other, usize::MAX, 0));
    let done = memory.done;
    assert!(store(&mut memory, &one, usize::MAX, 0));
    assert!(memory.done > done);
    assert_eq!(found(&memory).0.as_ref(), Some(&one));

    // A bit that flips after the start: what is in use is not what is asked for any more.
    let mut buffer = heapless::Vec::new();
    let mut slots = block_on(Slots::open(memory, &mut buffer));
    let InUse { slot, .. } = slots.in_use.unwrap();
    let Cell::Written(word) = &mut slots.flash.cells[slot * USED + BODY / WORD + 1] else {
        panic!()
    };
    word[5] ^= 1;
    let done = slots.flash.done;
    assert_eq!(block_on(slots.store(&one, &FRONT_END)), Ok(()));
    assert!(slots.flash.done > done);
    assert_eq!(found(&slots.flash).0.as_ref(), Some(&one));
}

#[test]
fn wherever_the_supply_fails_the_old_or_the_new_one_is_whole() {
    let (old, new, third) = (calibration(1, 3), calibration(2, 5), calibration(3, 4));
    // Erase, the words of the front end, those of the calibration, and the word in front.
    let operations = 1 + FRONT_END_WORDS + new.len().div_ceil(WORD) + 1;
    for older in 0..=2 {
        let mut before = Memory::new();
        for k in (0..older).rev() {
            // The last one is `old`, and no two in a row are the same.
            let bytes = if k == 0 { &old } else { &third };
            assert!(store(&mut before, bytes, usize::MAX, 0));
        }
        let old = (older > 0).then(|| old.clone());
        for tear in 0..4 {
            for left in 1..=operations + 1 {
                let mut memory = before.clone();
                let reported = store(&mut memory, &new, left, tear);
                let (after, _) = found(&memory);
                assert!(
                    after == old || after.as_ref() == Some(&new),
                    "{left} {tear}"
                );
                assert!(!reported || after.as_ref() == Some(&new), "{left} {tear}");
                assert_eq!(reported, left > operations, "{left} {tear}");
                // The same one again leaves none that is unusable beside it.
                if let Some(after) = &after {
                    let mut again = memory.clone();
                    assert!(store(&mut again, after, usize::MAX, 0));
                    let (in_use, slots) = found(&again);
                    let sound = |slot: &Slot| matches!(slot, Slot::Empty | Slot::Whole { .. });
                    assert!(
                        in_use.as_ref() == Some(after) && slots.iter().all(sound),
                        "{left} {tear}: {slots:?}"
                    );
                }
                // And it can go on from there.
                assert!(store(&mut memory, &third, usize::MAX, 0));
                assert_eq!(found(&memory).0.as_ref(), Some(&third), "{left} {tear}");
            }
        }
    }
}

#[test]
fn damage_is_told_and_the_other_one_is_used() {
    let (old, new) = (calibration(1, 2), calibration(2, 2));
    let mut memory = Memory::new();
    assert!(store(&mut memory, &old, usize::MAX, 0));
    assert!(store(&mut memory, &new, usize::MAX, 0));
    let whole = |generation| Slot::Whole { generation };
    let younger_unusable = |memory: &Memory| {
        let mut buffer = heapless::Vec::new();
        block_on(Slots::open(memory.clone(), &mut buffer)).younger_unusable()
    };
    assert!(!younger_unusable(&memory));
    for word in (0..BODY / WORD + new.len().div_ceil(WORD)).filter(|word| !(1..=2).contains(word)) {
        for bit in [0, 77, 255] {
            let mut memory = memory.clone();
            let Cell::Written(bytes) = &mut memory.cells[USED + word] else {
                panic!()
            };
            bytes[bit / 8] ^= 1 << (bit % 8);
            let (in_use, slots) = found(&memory);
            // Behind the end of the calibration nothing is looked at.
            if word * WORD + bit / 8 >= BODY + new.len() {
                assert_eq!((in_use, slots), (Some(new.clone()), [whole(1), whole(2)]));
                continue;
            }
            assert_eq!(in_use.as_ref(), Some(&old));
            assert!(younger_unusable(&memory), "{word} {bit}");
            let expected = if word == 0 {
                Slot::Unfinished
            } else {
                Slot::Damaged
            };
            assert_eq!(slots, [whole(1), expected], "{word} {bit}");
        }
        let mut memory = memory.clone();
        memory.cells[USED + word] = Cell::Torn(None);
        assert_eq!(found(&memory).0.as_ref(), Some(&old));
        assert!(younger_unusable(&memory));
        // A third one replaces the damaged one.
        let mut buffer = heapless::Vec::new();
        let mut slots = block_on(Slots::open(memory, &mut buffer));
        block_on(slots.store(&calibration(3, 2), &FRONT_END)).unwrap();
        assert!(!slots.younger_unusable());
    }
    // Damage of the older one changes nothing.
    for word in 3..5 {
        let mut memory = memory.clone();
        memory.cells[word] = Cell::Torn(None);
        assert_eq!(found(&memory).0.as_ref(), Some(&new));
        assert!(!younger_unusable(&memory));
    }
}
