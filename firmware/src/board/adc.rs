//! The converter: ADC1 scanning freely into a ring in memory, averaged to one sample a millisecond.
//!
//! embassy-stm32 0.6 starts every read of this family's converter by software and has no ring buffer for it, so the scheduler would
//! determine rate and gaps. Its driver is therefore used for power-up and calibration only. The rest is done here on the registers: the
//! sequence repeats automatically (CONT), and circular DMA transfers every word.
//!
//! # Why a scan is never rotated by a channel
//!
//! A word lost between converter and memory would silently shift every later word to its neighbour's place. Two mechanisms prevent this.
//!
//! - Within a stream no word can be lost unnoticed. When its FIFO overflows, the converter raises
//!   OVR and makes no further DMA request until the flag is cleared (RM0433 25.4.27), and it is
//!   cleared only between streams. The words in memory up to then are in order. No further word arrives, and the deadline in
//!   [`Stream::next`] turns this into an error.
//! - After an error the stream is over: it repeats the error until it is dropped. A new one begins
//!   with the converter stopped, which resets the sequence to its first channel, the FIFO emptied,
//!   and the DMA controller set up anew at the first word of the ring. It is aligned by construction, without skipping words. Every part is
//!   needed: with the eight words of an overflow left in the FIFO, all later scans would be rotated by eight places. Pausing and resuming the
//!   controller does not help: it resumes with the remaining count, but at the ring's first word.

use embassy_stm32::Peri;
use embassy_stm32::adc::Adc;
use embassy_stm32::dma::{Channel, ReadableRingBuffer, TransferOptions};
use embassy_stm32::pac;
use embassy_stm32::pac::adc::vals::{Adstp, Boost, Dmngt, Ovrmod, Pcsel, Res, SampleTime};
use embassy_stm32::peripherals::{ADC1, DMA1_CH0};
use embassy_time::{Duration, Instant, with_deadline};

use crate::board::{ADC_HZ, Irqs, SAMPLING_HALF_CYCLES, SCANS, Sensors};
use crate::channels::{CHANNELS, Channels};
use crate::convert::{SlowSums, scan};
use crate::design_parameters::SAMPLE_HZ;
use crate::front_end::{Factors, LINEARITY_WORDS};
use crate::sampling::Acquire;
use crate::source::{Fault, Scan};

/// Conversions in one sample.
const BLOCK: usize = SCANS * CHANNELS;

/// `REV_ID` of revision Y, the last silicon that does not halve the converter's kernel clock: everything would run twice as fast (RM0433
/// 25.4.3).
const LAST_REVISION_WITHOUT_DIVIDER: u16 = 0x1003;

/// Words in the ring: two samples. The controller interrupts at the half and at the end, once per sample, and the reader has one sample
/// period to take it. A longer ring would give more time, but deliver samples in bunches.
pub const RING: usize = 2 * BLOCK;

/// The request multiplexer's input for ADC1 (RM0433 17.3.2).
const DMA_REQUEST: u8 = 9;

/// Depth of the converter's FIFO (RM0433 25.4.27).
const FIFO_WORDS: usize = 8;

const PERIOD: Duration = Duration::from_hz(SAMPLE_HZ as u64);
const _: () = assert!(PERIOD.as_ticks() * SAMPLE_HZ as u64 == embassy_time::TICK_HZ);

/// The register's code for [`SAMPLING_HALF_CYCLES`]: derived from it, so the set and the calculated time cannot differ.
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
    /// within a stream. Across a fault it advances by the elapsed time, rounded up: a gap in the numbers equals the gap in time to within
    /// one sample.
    pub number: u64,
    /// Sums of the conversions of each channel.
    pub sums: Channels<u32>,
}

/// ADC1 with its DMA channel and ring, powered up, calibrated and set to the scan, not yet running.
pub struct Converter {
    // Reserves the peripheral.
    _adc: Adc<'static, ADC1>,
    dma: Peri<'static, DMA1_CH0>,
    ring: &'static mut [u16; RING],
    factors: Option<Factors>,
    first_start: Option<Instant>,
    next_number: u64,
}

impl Converter {
    /// Powers up, calibrates and configures. Takes 42 ms, nearly all of it for calibration. With `kept` factors, which then replace its
    /// own, it takes half of that.
    ///
    /// `ring` must be in memory that DMA1 reaches, which is all RAM of `memory.x`. The data cache stays off, as after reset, so reads see
    /// what the controller writes.
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

    /// Its calibration factors, to be stored with the unit's calibration; `None` if they cannot be read.
    pub fn factors(&self) -> Option<Factors> {
        self.factors
    }

    /// Starts sampling. The stream ends at its first [`Fault`]; drop it and start another.
    pub fn start(&mut self) -> Stream<'_> {
        stop();
        let channel = Channel::new(self.dma.reborrow(), Irqs);
        // SAFETY: the address is that of ADC1's data register, which is always valid and allows half-word reads. The stream borrows the
        // ring for as long as the controller runs: dropping the stream stops the controller and waits for it.
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
        // One sample, a whole number of scans: the buffer then never returns part of a scan.
        ring.set_alignment(BLOCK);
        ring.start();

        // Everything else is ready, so this is the instant of the first conversion. If an interrupt comes in between, the deadlines are
        // early by its duration, not late.
        let started = Instant::now();
        pac::ADC1
            .cfgr()
            .modify(|w| w.set_dmngt(Dmngt::DMA_CIRCULAR));
        pac::ADC1.cr().modify(|w| w.set_adstart(true));

        // Saturating, so it never goes back: when its 16-bit counter overflows, the HAL's clock can read 65.5 ms early for an instant. (It
        // counts half turns by a compare interrupt; seen on the
        // emulator, where its initialisation seems to raise the flag of the first.) A stream that starts on such a reading ends at once as
        // late, and the next one is right.
        let elapsed = started.saturating_duration_since(*self.first_start.get_or_insert(started));
        let number = elapsed.as_ticks().div_ceil(PERIOD.as_ticks());
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

impl Acquire for Converter {
    type Slow = SlowSums;

    async fn acquire(&mut self, mut take: impl FnMut(Scan<SlowSums>)) -> Fault {
        let mut stream = self.start();
        loop {
            match stream.next().await {
                Ok(sample) => take(scan(sample.number, &sample.sums)),
                Err(fault) => return fault,
            }
        }
    }
}

/// Running conversion.
pub struct Stream<'a> {
    ring: ReadableRingBuffer<'a, u16>,
    started: Instant,
    samples: u64,
    next_number: &'a mut u64,
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
                *self.next_number = number + 1;
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
        // Sample k is complete after k + 1 periods; after k + 2 the controller overwrites its first word.
        let overwritten =
            self.started + Duration::from_ticks(PERIOD.as_ticks() * (self.samples + 2));
        let mut scans = [[0; CHANNELS]; SCANS];
        match with_deadline(overwritten, self.ring.read_exact(scans.as_flattened_mut())).await {
            // The clock decides, not the ring. The ring counts rounds by interrupts, and two interrupts while interrupts are off count as
            // one: a reader that is late by a whole number of rounds would get the right channels of the wrong time. Clock and converter
            // share a crystal, so the comparison is valid for any duration; a sample longer than a millisecond would fail during the run.
            // (The clock itself slips if interrupts are off for 32 ms.)
            Ok(Ok(_)) if Instant::now() < overwritten => {}
            // By the clock or by the ring's count, the controller had begun to overwrite the sample.
            Ok(_) => return Err(Fault::Late),
            // The controller did not fetch for 400 µs.
            Err(_) if pac::ADC1.isr().read().ovr() => return Err(Fault::Overrun),
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
        // Before the ring's drop stops the controller, so that nothing remains to be fetched.
        stop();
    }
}

/// Calibrates again, with the bias current that the converter will use, or loads the kept factors; returns the factors.
///
/// [`Adc::new`] chooses the current for the kernel clock (which it logs as the converter's), without the fixed divider after it. It
/// therefore calibrated with the next higher current.
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
    // Written back at once, because the manual does not say whether a word is still in use after it was read.
    let found = read().filter(|factors| write(factors).is_some());
    if found.is_none() {
        // Some words may have been read but not written back: calibrate again, and do not read.
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

/// Number of polls of a linearity word's flag before it counts as stuck. The word moves within some cycles of the converter's clock, 0.13
/// µs each; a poll takes about 0.1 µs.
const LOOKS: u32 = 10_000;

/// Sets or clears LINCALRDYW of a word, 0 to 5 (RM0433 25.6.3, bits 22 to 27), which writes or reads the word; `None` if the flag does not
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

/// The factors in use (RM0433 25.4.8). The converter has to be on and idle.
fn read() -> Option<Factors> {
    let adc = pac::ADC1;
    let mut factors = Factors {
        offset: adc.calfact().read().calfact_s(),
        linearity: [0; LINEARITY_WORDS],
    };
    // From the last word, as in the manufacturer's library.
    for (word, factor) in factors.linearity.iter_mut().enumerate().rev() {
        hand_over(word, false)?;
        *factor = adc.calfact2().read().lincalfact();
    }
    Some(factors)
}

/// Loads these factors into the converter.
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

/// Configures sequence, sampling times, input switches and repetition, from the converter's input number of each channel.
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
        // Without preselection the pin is not connected to the analog bus, and its conversions are arbitrary.
        adc.pcsel()
            .modify(|w| w.set_pcsel(usize::from(channel), Pcsel::PRESELECTED));
    }
}

/// Ends conversion and removes all words and flags before the next stream.
fn stop() {
    let adc = pac::ADC1;
    if adc.cr().read().adstart() {
        adc.cr().modify(|w| w.set_adstp(Adstp::STOP));
        while adc.cr().read().adstart() {}
    }
    // Disable DMA requests while the FIFO is emptied by hand.
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
