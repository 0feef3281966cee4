//! Stored calibrations: two flash sectors, so that a write is either complete or has not happened.
//!
//! # Why a write is never half done
//!
//! Each sector is a slot: a header word, two words of [`FrontEnd`], and the calibration. A new calibration goes to the slot that is not in
//! use. The slot is erased, everything except the header is written and read back, and last the header is written, in a single programming
//! operation, with the next generation and a CRC of itself. Until the header is complete the slot is invalid; from then on it is the
//! younger one. The slot in use is not touched before the next calibration.
//!
//! # Why not a key-value store
//!
//! `sequential-storage` appends within a sector, and finds the end by words that read as erased. A word of this memory whose programming
//! was interrupted may read as erased without being so: programming it again leaves a wrong error code (RM0433 4.3.9), and the item is lost
//! after it was reported as stored. Here a sector is always erased completely in the same operation before it is written. The cost is about
//! a second of erasing for each calibration, and a life of 10 000 calibrations; neither matters.

use embedded_storage_async::nor_flash::NorFlash;
use heapless::Vec;
use mimu_core::stored::{MAX_LENGTH, hash};
use mimu_core::wire::Slot;

use crate::design_parameters::FLASH_WORD as WORD;
use crate::front_end::{FRONT_END_WORDS, FrontEnd};
use crate::source::usable;

const MAGIC: [u8; 4] = *b"slt2";

/// Position of the calibration in a slot, bytes.
const BODY: usize = WORD * (1 + FRONT_END_WORDS);

/// Header word of a calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Front {
    generation: u32,
    length: u32,
    hash: u64,
}

impl Front {
    fn to_word(self) -> [u8; WORD] {
        let mut word = [0; WORD];
        let [g0, g1, g2, g3] = self.generation.to_le_bytes();
        let [l0, l1, l2, l3] = self.length.to_le_bytes();
        word[..4].copy_from_slice(&MAGIC);
        word[4..12].copy_from_slice(&[g0, g1, g2, g3, l0, l1, l2, l3]);
        word[12..20].copy_from_slice(&self.hash.to_le_bytes());
        let check = hash(&word[..24]);
        word[24..].copy_from_slice(&check.to_le_bytes());
        word
    }

    fn from_word(word: &[u8; WORD]) -> Option<Self> {
        let (body, check) = word.split_last_chunk::<8>()?;
        let u32_at = |at: usize| Some(u32::from_le_bytes(*body.get(at..)?.first_chunk()?));
        let front = Self {
            generation: u32_at(4)?,
            length: u32_at(8)?,
            hash: u64::from_le_bytes(*body.get(12..)?.first_chunk()?),
        };
        let whole = body.starts_with(&MAGIC) && hash(body).to_le_bytes() == *check;
        (whole && (front.length as usize) <= MAX_LENGTH).then_some(front)
    }
}

/// The flash memory reported an error, or did not keep the written data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Failed;

/// The calibration in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct InUse {
    slot: usize,
    front: Front,
}

/// Two slots in a flash memory of two sectors.
pub struct Slots<F> {
    flash: F,
    state: [Slot; 2],
    in_use: Option<InUse>,
    /// Highest generation found.
    generation: u32,
    /// See [`Self::younger_unusable`].
    younger_unusable: bool,
}

impl<F: NorFlash> Slots<F> {
    const SECTOR: usize = F::ERASE_SIZE;

    /// Searches the slots for calibrations. Afterwards `buffer` contains the one in use.
    pub async fn open(flash: F, buffer: &mut Vec<u8, MAX_LENGTH>) -> Self {
        const { assert!(F::WRITE_SIZE == WORD && MAX_LENGTH + BODY <= F::ERASE_SIZE) };
        let mut slots = Self {
            flash,
            state: [Slot::Empty; 2],
            in_use: None,
            generation: 0,
            younger_unusable: false,
        };
        // Generations of the unusable ones; of a damaged header it is unknown.
        let mut unusable = [None; 2];
        for (slot, unusable) in unusable.iter_mut().enumerate() {
            let (state, front) = slots.look(slot, buffer).await;
            slots.state[slot] = state;
            *unusable = match state {
                Slot::Empty | Slot::Whole { .. } => None,
                _ => Some(front.map_or(u32::MAX, |front| front.generation)),
            };
            let Some(front) = front else { continue };
            slots.generation = slots.generation.max(front.generation);
            let younger = slots
                .in_use
                .is_none_or(|other| front.generation > other.front.generation);
            if younger && matches!(state, Slot::Whole { .. }) {
                slots.in_use = Some(InUse { slot, front });
            }
        }
        let used = slots.in_use.map_or(0, |it| it.front.generation);
        slots.younger_unusable = unusable.iter().flatten().any(|unusable| *unusable > used);
        buffer.clear();
        if let Some(InUse { slot, front }) = slots.in_use {
            slots.read_all(slot, front.length, buffer).await;
        }
        slots
    }

    /// Contents of the slots.
    pub fn state(&self) -> [Slot; 2] {
        self.state
    }

    /// Length, bytes, and hash of the calibration in use.
    pub fn in_use(&self) -> Option<(u32, u64)> {
        self.in_use.map(|it| (it.front.length, it.front.hash))
    }

    /// Whether a slot contains a calibration that cannot be used and that may be younger than the one in use: damaged, of another version of the
    /// firmware, or not completely written.
    pub fn younger_unusable(&self) -> bool {
        self.younger_unusable
    }

    /// The flash memory.
    pub fn flash(&self) -> &F {
        &self.flash
    }

    /// Reads a part of the calibration in use; `None` if there is no calibration, or the part is outside it or unreadable.
    pub async fn part(&mut self, offset: usize, bytes: &mut [u8]) -> Option<()> {
        let InUse { slot, front } = self.in_use?;
        let end = offset.checked_add(bytes.len())?;
        let within = end <= front.length as usize;
        (within && self.read(slot, BODY + offset, bytes).await).then_some(())
    }

    /// Front end of the calibration in use; `None` if there is none or it is unreadable. The calibration is then used with a front end that
    /// calibrates itself.
    pub async fn front_end(&mut self) -> Option<FrontEnd> {
        let InUse { slot, .. } = self.in_use?;
        let mut words = [[0; WORD]; FRONT_END_WORDS];
        let read = self.read(slot, WORD, words.as_flattened_mut()).await;
        read.then(|| FrontEnd::from_words(&words)).flatten()
    }

    /// Stores a calibration and its front end. When this returns, or if the supply fails meanwhile, either the new calibration is in use,
    /// complete, or the previous one. If it is in use already, with a readable front end and beside no unusable one, it is not written again: a sector lasts for
    /// 10 000 erases.
    pub async fn store(&mut self, bytes: &[u8], front_end: &FrontEnd) -> Result<(), Failed> {
        let sound = |slot: &Slot| matches!(slot, Slot::Empty | Slot::Whole { .. });
        let sound = self.state.iter().all(sound) && self.front_end().await.is_some();
        if sound && self.holds(bytes).await {
            return Ok(());
        }
        let slot = match self.in_use {
            Some(InUse { slot: 0, .. }) => 1,
            _ => 0,
        };
        let front = Front {
            generation: self.generation.checked_add(1).ok_or(Failed)?,
            length: u32::try_from(bytes.len()).map_err(|_| Failed)?,
            hash: hash(bytes),
        };
        if bytes.len() > MAX_LENGTH {
            return Err(Failed);
        }
        self.state[slot] = Slot::Unfinished;
        let from = slot * Self::SECTOR;
        let erased = self.flash.erase(from as u32, (from + Self::SECTOR) as u32);
        erased.await.map_err(|_| Failed)?;
        for (k, word) in front_end.to_words().iter().enumerate() {
            self.write(slot, WORD * (k + 1), word).await?;
        }
        for (k, part) in bytes.chunks(WORD).enumerate() {
            let mut word = [0xff; WORD];
            word[..part.len()].copy_from_slice(part);
            self.write(slot, BODY + WORD * k, &word).await?;
        }
        self.write(slot, 0, &front.to_word()).await?;
        let generation = front.generation;
        self.generation = generation;
        self.state[slot] = Slot::Whole { generation };
        self.in_use = Some(InUse { slot, front });
        self.younger_unusable = false;
        Ok(())
    }

    /// Whether the calibration in use equals this one, byte by byte in the flash.
    async fn holds(&mut self, bytes: &[u8]) -> bool {
        let Some(InUse { slot, front }) = self.in_use else {
            return false;
        };
        if front.length as usize != bytes.len() || front.hash != hash(bytes) {
            return false;
        }
        for (k, part) in bytes.chunks(WORD).enumerate() {
            let mut word = [0; WORD];
            let kept = &mut word[..part.len()];
            if !self.read(slot, BODY + WORD * k, kept).await || kept != part {
                return false;
            }
        }
        true
    }

    /// Writes a word and reads it back.
    async fn write(&mut self, slot: usize, at: usize, word: &[u8; WORD]) -> Result<(), Failed> {
        let written = self.flash.write((slot * Self::SECTOR + at) as u32, word);
        written.await.map_err(|_| Failed)?;
        let mut back = [0; WORD];
        let kept = self.read(slot, at, &mut back).await && back == *word;
        kept.then_some(()).ok_or(Failed)
    }

    async fn read(&mut self, slot: usize, at: usize, bytes: &mut [u8]) -> bool {
        let offset = (slot * Self::SECTOR + at) as u32;
        self.flash.read(offset, bytes).await.is_ok()
    }

    /// Reads the calibration of a slot, with this number of bytes.
    async fn read_all(
        &mut self,
        slot: usize,
        length: u32,
        buffer: &mut Vec<u8, MAX_LENGTH>,
    ) -> bool {
        buffer.clear();
        buffer.resize(length as usize, 0).is_ok() && self.read(slot, BODY, buffer).await
    }

    async fn look(
        &mut self,
        slot: usize,
        buffer: &mut Vec<u8, MAX_LENGTH>,
    ) -> (Slot, Option<Front>) {
        let mut words = [[0; WORD]; 2];
        let [first, second] = &mut words;
        let readable = self.read(slot, 0, first).await & self.read(slot, WORD, second).await;
        let Some(front) = Front::from_word(&words[0]) else {
            let empty = readable && words.as_flattened().iter().all(|byte| *byte == 0xff);
            let state = if empty { Slot::Empty } else { Slot::Unfinished };
            return (state, None);
        };
        let whole = self.read_all(slot, front.length, buffer).await && hash(buffer) == front.hash;
        let state = match whole.then(|| usable(buffer)) {
            None => Slot::Damaged,
            Some(Err(refused)) => Slot::NotUsable(refused),
            Some(Ok(_)) => Slot::Whole {
                generation: front.generation,
            },
        };
        (state, Some(front))
    }
}

#[cfg(test)]
mod tests;
