//! The line to a digital sensor: SPI by DMA, with a chip select.

use embassy_stm32::gpio::Output;
use embassy_stm32::mode::Async;
use embassy_stm32::spi::Spi;
use embassy_stm32::spi::mode::Master;
use embassy_time::{Instant, Timer};

use crate::chip::{Bus, BusFault, Chip};
use crate::digital::{DieSum, Polled};
use crate::sampling::Acquire;
use crate::source::{Fault, Scan};

/// Direction bit of the first byte: read. The sensors of InvenSense, ST and Bosch have it alike.
const READ: u8 = 0x80;

/// Longest transfer: the address, and a burst of the FIFO.
const LONGEST: usize = 1 + 80;

/// SPI with the chip select of one sensor.
pub struct Line {
    bus: Spi<'static, Async, Master>,
    select: Output<'static>,
    /// In static memory, which DMA reaches: the sampling task's future is static.
    bytes: [u8; LONGEST],
}

impl Line {
    /// `select` is high while the sensor is not addressed.
    pub fn new(bus: Spi<'static, Async, Master>, select: Output<'static>) -> Self {
        Self {
            bus,
            select,
            bytes: [0; LONGEST],
        }
    }

    /// Exchanges the first bytes of the buffer.
    async fn exchange(&mut self, length: usize) -> Result<(), BusFault> {
        let bytes = self.bytes.get_mut(..length).ok_or(BusFault)?;
        self.select.set_low();
        let done = self.bus.transfer_in_place(bytes).await;
        self.select.set_high();
        done.map_err(|_| BusFault)
    }
}

impl Bus for Line {
    async fn read(&mut self, register: u8, into: &mut [u8]) -> Result<(), BusFault> {
        self.bytes = [0; LONGEST];
        self.bytes[0] = READ | register;
        self.exchange(1 + into.len()).await?;
        into.copy_from_slice(&self.bytes[1..=into.len()]);
        Ok(())
    }

    async fn write(&mut self, register: u8, value: u8) -> Result<(), BusFault> {
        self.bytes[..2].copy_from_slice(&[register, value]);
        self.exchange(2).await
    }

    async fn wait_us(&mut self, us: u32) {
        Timer::after_micros(u64::from(us)).await;
    }

    fn now_us(&self) -> u64 {
        Instant::now().as_micros()
    }
}

impl<C: Chip> Acquire for Polled<C> {
    type Slow = DieSum;

    fn acquire(&mut self, take: impl FnMut(Scan<DieSum>)) -> impl Future<Output = Fault> {
        self.run(take)
    }
}
