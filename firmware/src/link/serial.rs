//! A serial port, by DMA both ways.

use embassy_stm32::mode::Async;
use embassy_stm32::usart::{RingBufferedUartRx, Uart, UartTx};

use crate::design_parameters::RECEIVED;

/// To the host.
pub struct Output(UartTx<'static, Async>);

impl Output {
    /// Sends all bytes.
    pub async fn send(&mut self, bytes: &[u8]) {
        // The only error of the transmitter is an empty buffer.
        let _ = self.0.write(bytes).await;
    }
}

/// From the host: a ring that DMA fills, so that nothing is lost while a call is being answered.
pub struct Input(RingBufferedUartRx<'static>);

impl Input {
    /// The next bytes; `None` if some were lost.
    pub async fn receive(&mut self, bytes: &mut [u8]) -> Option<usize> {
        self.0.read(bytes).await.ok()
    }
}

/// Both directions.
pub fn split(uart: Uart<'static, Async>, ring: &'static mut [u8; RECEIVED]) -> (Output, Input) {
    let (output, input) = uart.split();
    (Output(output), Input(input.into_ring_buffered(ring)))
}
