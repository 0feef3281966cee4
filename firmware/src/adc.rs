//! The converter: ADC1 scanning freely into a ring in memory, averaged to one sample a millisecond.
//!
//! embassy-stm32 0.6 starts every read of this family's converter by software and has no ring
//! buffer for it, which leaves both the rate and the gaps to the scheduler. So its driver powers up
//! and calibrates, and the rest is done here on the registers: the sequence repeats by itself
//! (CONT), and circular DMA carries every word away.
//!
//! # Why a scan is never rotated by a channel
//!
//! A word lost between converter and memory would shift every later word into its neighbour's
//! place, silently. Two things rule that out.
//!
//! - Within a stream no word can be lost unnoticed. When its FIFO overflows, the converter raises
//!   OVR and makes no further DMA request until the flag is cleared (RM0433 25.4.27), and it is
//!   cleared only between streams. What is in memory until then is in order; after that nothing
//!   comes, which the deadline in [`Stream::next`] turns into an error.
//! - After an error the stream is over: it repeats the error until it is dropped. A new one begins
//!   with the converter stopped, which resets the sequence to its first channel, the FIFO emptied,
//!   and the DMA controller set up anew at the first word of the ring. It is aligned by
//!   construction and not by skipping words. Every part is needed: with the eight words of an
//!   overflow left in the FIFO, all later scans are rotated by eight places. Pausing and resuming
//!   the controller would not do either: it resumes with what was left of the count, but at the
//!   ring's first word.

use embassy_stm32::Peri;
use embassy_stm32::adc::Adc;
use embassy_stm32::dma::{Channel, ReadableRingBuffer, TransferOptions};
use embassy_stm32::pac;
use embassy_stm32::pac::adc::vals::{Adstp, Boost, Dmngt, Ovrmod, Pcsel, Res, SampleTime};
use embassy_stm32::peripherals::{ADC1, DMA1_CH0};
use embassy_time::{Duration, Instant, with_deadline};

use crate::board::{ADC_HZ, Irqs, SAMPLING_HALF_CYCLES, SCANS, Sensors};
use crate::channels::{CHANNELS, Channels};
use crate::design_parameters::SAMPLE_HZ;
use crate::front_end::{Factors, LINEARITY_WORDS};

/// Conversions in one sample.
const BLOCK: usize = SCANS * CHANNELS;

/// The `REV_ID` of the last silicon that does not halve the kernel clock before the converter sees it, revision Y: everything would run
/// twice as fast (RM0433 25.4.3).
const LAST_REVISION_WITHOUT_DIVIDER: u16 = 0x1003;

/// Words in the ring: two samples. The controller interrupts at the half and at the end, so once a
/// sample, and the reader has the time of the other half to take it. A longer ring would give it
/// longer, and hand out samples in bunches.
pub const RING: usize = 2 * BLOCK;

/// The request multiplexer's input for ADC1 (RM0433 17.3.2).
const DMA_REQUEST: u8 = 9;

/// Depth of the converter's FIFO (RM0433 25.4.27).
const FIFO_WORDS: usize = 8;

const PERIOD: Duration = Duration::from_hz(SAMPLE_HZ as u64);
const _: () = assert!(PERIOD.as_ticks() * SAMPLE_HZ as u64 == embassy_time::TICK_HZ);

/// The register's code for [`SAMPLING_HALF_CYCLES`], so that the time that is set and the time that
/// is calculated with cannot differ.
const SAMPLE_TIME: SampleTime = match SAMPLING_HALF_CYCLES {
    3 => SampleTime::CYCLES1_5,
    5 => SampleTime::CYCLES2_5,
    17 => SampleTime::CYCLES8_5,
    33 => SampleTime::CYCLES16_5,
    65 => SampleTime::CYCLES32_5,
    129 => SampleTime::CYCLES64_5,
    775 => SampleTime::CYCLES387_5,
    1621 => SampleTime::CYCLES810_5,
    _ => panic!("the converter has no such sampling time"),
};

/// The bias current that [`ADC_HZ`] needs (RM0433 25.6.3).
const BOOST: Boost = match ADC_HZ {
    0..=6_250_000 => Boost::LT6_25,
    6_250_001..=12_500_000 => Boost::LT12_5,
    12_500_001..=25_000_000 => Boost::LT25,
    25_000_001..=50_000_000 => Boost::LT50,
    _ => panic!("faster than the converter can go"),
};

/// One millisecond of all channels.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Milliseconds from the first start to the beginning of this sample, for 49 days. Consecutive
    /// within a stream. Across a fault it advances by the time that passed, rounded up: a gap in
    /// the numbers is the gap in time, to within one sample.
    pub number: u32,
    /// Sums of the conversions of each channel.
    pub sums: Channels<u32>,
}

/// Why a stream ended. Samples were lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum Fault {
    /// The reader came after the controller had begun to overwrite the sample, by the clock or by
    /// the ring's own count.
    Late,
    /// The converter's FIFO overflowed: the controller did not fetch for 400 µs.
    ConverterOverrun,
    /// No data, and no flag that says why.
    Stalled,
}

/// ADC1 with its DMA channel and ring, powered up, calibrated and set to the scan, not yet running.
pub struct Converter {
    // Keeps the peripheral from anybody else.
    _adc: Adc<'static, ADC1>,
    dma: Peri<'static, DMA1_CH0>,
    ring: &'static mut [u16; RING],
    factors: Option<Factors>,
    first_start: Option<Instant>,
    next_number: u32,
}

impl Converter {
    /// Powers up, calibrates and configures. Takes 42 ms, nearly all of it calibration; half of that with factors that were `kept`, which
    /// then stand in place of its own.
    ///
    /// `ring` must be where DMA1 reaches it, which is all RAM of `memory.x`; the data cache stays off, as after reset, so what the
    /// controller writes there is what is read.
    ///
    /// # Panics
    ///
    /// On silicon older than revision V.
    pub fn new(sensors: Sensors, ring: &'static mut [u16; RING], kept: Option<Factors>) -> Self {
        let revision = pac::DBGMCU.idc().read().rev_id();
        defmt::assert!(
            revision > LAST_REVISION_WITHOUT_DIVIDER,
            "silicon revision {=u16:#x}: the converter would run at twice its rate",
            revision
        );

        let adc = Adc::new(sensors.adc);
        let factors = calibrate_at_boost(kept);
        configure_scan(sensors.pins.map(|pin| pin.get_hw_channel()));
        Self {
            _adc: adc,
            dma: sensors.dma,
            ring,
            factors,
            first_start: None,
            next_number: 0,
        }
    }

    /// Its calibration factors, to be kept with what is calibrated by it; `None` if it does not let them be read.
    pub fn factors(&self) -> Option<Factors> {
        self.factors
    }

    /// Starts sampling. The stream ends at its first [`Fault`]; drop it and start another.
    pub fn start(&mut self) -> Stream<'_> {
        stop();
        let channel = Channel::new(self.dma.reborrow(), Irqs);
        // SAFETY: the address is that of ADC1's data register, which stays valid, and reads of half
        // a word are what it allows. The ring is borrowed by the stream for as long as the
        // controller runs: dropping the stream stops it and waits until it has.
        #[allow(unsafe_code)]
        let mut ring = unsafe {
            ReadableRingBuffer::new(
                channel,
                DMA_REQUEST,
                pac::ADC1.dr().as_ptr().cast(),
                self.ring,
                TransferOptions::default(),
            )
        };
        // A sample, that is whole scans: the buffer then never hands out part of one.
        ring.set_alignment(BLOCK);
        ring.start();

        // Everything else is ready, so that this instant is that of the first conversion. If an
        // interrupt comes in between, the deadlines are early by its length, not late.
        let started = Instant::now();
        pac::ADC1
            .cfgr()
            .modify(|w| w.set_dmngt(Dmngt::DMA_CIRCULAR));
        pac::ADC1.cr().modify(|w| w.set_adstart(true));

        // Saturating, and never back: when its 16-bit counter turns over, the HAL's clock can read
        // 65.5 ms early for an instant. (It counts half turns by a compare interrupt; seen on the
        // emulator, where its initialisation seems to raise the flag of the first.) A stream that starts on
        // such a reading ends at once for being late, and the next is right.
        let elapsed = started.saturating_duration_since(*self.first_start.get_or_insert(started));
        let number = elapsed.as_ticks().div_ceil(PERIOD.as_ticks()) as u32;
        self.next_number = self.next_number.max(number);
        Stream {
            ring,
            started,
            samples: 0,
            next_number: &mut self.next_number,
            fault: None,
        }
    }
}

/// Running conversion.
pub struct Stream<'a> {
    ring: ReadableRingBuffer<'a, u16>,
    started: Instant,
    samples: u64,
    next_number: &'a mut u32,
    fault: Option<Fault>,
}

impl Stream<'_> {
    /// The next sample, a millisecond after the last. May be cancelled without loss.
    ///
    /// # Errors
    ///
    /// The [`Fault`] that ended the stream, and again on every further call.
    pub async fn next(&mut self) -> Result<Sample, Fault> {
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        match self.read().await {
            Ok(sums) => {
                let number = *self.next_number;
                *self.next_number = number.wrapping_add(1);
                self.samples += 1;
                Ok(Sample { number, sums })
            }
            Err(fault) => {
                self.fault = Some(fault);
                Err(fault)
            }
        }
    }

    async fn read(&mut self) -> Result<Channels<u32>, Fault> {
        // Sample k is complete at k + 1 periods, and at k + 2 the controller is back at its first
        // word.
        let overwritten =
            self.started + Duration::from_ticks(PERIOD.as_ticks() * (self.samples + 2));
        let mut scans = [[0; CHANNELS]; SCANS];
        match with_deadline(overwritten, self.ring.read_exact(scans.as_flattened_mut())).await {
            // The clock decides, not the ring. The ring counts rounds by interrupts, and two that
            // come while interrupts are off are one: a reader held up for a whole number of rounds
            // would be given the right channels of the wrong time. Clock and converter share a
            // crystal, so the comparison holds for any length of run; if a sample took longer than
            // a millisecond after all, it would fail within the run. (The clock itself slips once
            // interrupts are off for 32 ms.)
            Ok(Ok(_)) if Instant::now() < overwritten => {}
            Ok(_) => return Err(Fault::Late),
            Err(_) if pac::ADC1.isr().read().ovr() => return Err(Fault::ConverterOverrun),
            Err(_) => return Err(Fault::Stalled),
        }

        let mut sums = [0; CHANNELS];
        for scan in scans {
            for (sum, code) in sums.iter_mut().zip(scan) {
                *sum += u32::from(code);
            }
        }
        Ok(Channels::from_scan_order(sums))
    }
}

impl Drop for Stream<'_> {
    fn drop(&mut self) {
        // Before the ring's own drop stops the controller: nothing is left to fetch then.
        stop();
    }
}

/// Calibrates once more, with the bias current that the converter will run at, or has it use the factors that were kept; the factors.
///
/// [`Adc::new`] chooses the current by the kernel clock (which it logs as the converter's) and does
/// not know of the fixed divider behind it. It took the next higher one and calibrated with that.
fn calibrate_at_boost(kept: Option<Factors>) -> Option<Factors> {
    disable();
    pac::ADC1.cr().modify(|w| w.set_boost(BOOST));
    if let Some(factors) = kept {
        enable();
        if write(&factors).is_some() {
            return Some(factors);
        }
        disable();
    }
    measure();
    enable();
    // Written back at once: whether a word that was read is still in use, the manual does not say.
    let found = read().filter(|factors| write(factors).is_some());
    if found.is_none() {
        // Some words may have been read and not written back: once more, and left alone.
        disable();
        measure();
        enable();
    }
    found
}

fn disable() {
    let adc = pac::ADC1;
    adc.cr().modify(|w| w.set_addis(true));
    while adc.cr().read().aden() {}
}

fn enable() {
    let adc = pac::ADC1;
    adc.isr().write(|w| w.set_adrdy(true));
    adc.cr().modify(|w| w.set_aden(true));
    while !adc.isr().read().adrdy() {}
}

/// Offset and linearity, single-ended: [`Adc::new`] has left both selected.
fn measure() {
    let adc = pac::ADC1;
    adc.cr().modify(|w| w.set_adcal(true));
    while adc.cr().read().adcal() {}
}

/// Looks at the flag of a linearity word before it is taken for stuck. The word moves within some cycles of the converter's clock, 0.13 µs each; a
/// look takes some 0.1 µs.
const LOOKS: u32 = 10_000;

/// Sets or clears LINCALRDYW of a word, 0 to 5 (RM0433 25.6.3, bits 22 to 27), which has the word written or read; `None` if the flag does not
/// follow.
fn hand_over(word: usize, ready: bool) -> Option<()> {
    let (adc, bit) = (pac::ADC1, 1 << (22 + word));
    let is = |cr: u32| cr & bit != 0;
    adc.cr().modify(|w| match ready {
        true => w.0 |= bit,
        false => w.0 &= !bit,
    });
    let mut looks = 0..LOOKS;
    looks.find(|_| is(adc.cr().read().0) == ready).map(|_| ())
}

/// The factors in use (RM0433 25.4.8): the converter is on and does not convert.
fn read() -> Option<Factors> {
    let adc = pac::ADC1;
    let mut factors = Factors {
        offset: adc.calfact().read().calfact_s(),
        linearity: [0; LINEARITY_WORDS],
    };
    // From the last word, as the maker's own library does.
    for (word, factor) in factors.linearity.iter_mut().enumerate().rev() {
        hand_over(word, false)?;
        *factor = adc.calfact2().read().lincalfact();
    }
    Some(factors)
}

/// Has the converter use these.
fn write(factors: &Factors) -> Option<()> {
    let adc = pac::ADC1;
    adc.calfact().modify(|w| w.set_calfact_s(factors.offset));
    for (word, factor) in factors.linearity.iter().enumerate().rev() {
        // A flag that is set already would not move the word.
        hand_over(word, false)?;
        adc.calfact2().write(|w| w.set_lincalfact(*factor));
        hand_over(word, true)?;
    }
    Some(())
}

/// Sequence, sampling times, input switches and repetition, by the number that the converter's input of each channel has.
fn configure_scan(inputs: Channels<u8>) {
    let adc = pac::ADC1;
    adc.cfgr().modify(|w| {
        w.set_res(Res::BITS16);
        w.set_cont(true);
        // On overflow the words in the FIFO are in order; those that do not fit are lost either
        // way.
        w.set_ovrmod(Ovrmod::PRESERVE);
    });
    adc.sqr1().modify(|w| w.set_l(CHANNELS as u8 - 1));
    for (place, channel) in inputs.in_scan_order().into_iter().enumerate() {
        // The sequence registers have room for 4, 5, 5 and 2 places.
        match place {
            0..4 => adc.sqr1().modify(|w| w.set_sq(place, channel)),
            4..9 => adc.sqr2().modify(|w| w.set_sq(place - 4, channel)),
            9..14 => adc.sqr3().modify(|w| w.set_sq(place - 9, channel)),
            _ => adc.sqr4().modify(|w| w.set_sq(place - 14, channel)),
        }
        // The sampling time registers have ten channels each.
        adc.smpr(usize::from(channel / 10))
            .modify(|w| w.set_smp(usize::from(channel % 10), SAMPLE_TIME));
        // Without preselection the pin stays off the analog bus and its conversions read anything.
        adc.pcsel()
            .modify(|w| w.set_pcsel(usize::from(channel), Pcsel::PRESELECTED));
    }
}

/// Ends conversion, and leaves neither word nor flag behind for the next stream to find.
fn stop() {
    let adc = pac::ADC1;
    if adc.cr().read().adstart() {
        adc.cr().modify(|w| w.set_adstp(Adstp::STOP));
        while adc.cr().read().adstart() {}
    }
    // No request while the FIFO is emptied by hand.
    adc.cfgr().modify(|w| w.set_dmngt(Dmngt::DR));
    for _ in 0..FIFO_WORDS {
        adc.dr().read();
    }
    adc.isr().write(|w| {
        w.set_eosmp(true);
        w.set_eoc(true);
        w.set_eos(true);
        w.set_ovr(true);
    });
}
