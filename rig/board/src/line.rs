//! The far end of the serial line: bytes to and from the microcontroller, each with its time.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rigless::chip::Timeline;
use rigless::chip::uart::Peer;
use rigless::snapshot::Store;
use rigless::time::VirtualNanos;

/// Bytes on their way in both directions.
#[derive(Debug, Default)]
pub(crate) struct Bytes {
    /// Waiting to be sent, oldest first.
    pub(crate) to_device: VecDeque<u8>,
    /// Received, oldest first, each with the end of its stop bit, ns.
    pub(crate) from_device: Vec<(u64, u8)>,
}

/// A cable: bytes put in at one end come out at the other.
#[derive(Debug, Clone, Default)]
pub(crate) struct Line(Arc<Mutex<Bytes>>);

impl Line {
    pub(crate) fn bytes(&self) -> MutexGuard<'_, Bytes> {
        // After a panic elsewhere the bytes are still valid.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The end that is connected to the microcontroller's port.
#[derive(Debug)]
pub(crate) struct FarEnd(pub(crate) Line);

impl Store for FarEnd {}

impl Peer for FarEnd {
    fn receive(&mut self, word: u16, context: &mut Timeline<'_, '_>) {
        let at = context.now().0;
        self.0.bytes().from_device.push((at, word as u8));
    }

    fn transmit(&mut self, _now: VirtualNanos) -> Option<u16> {
        self.0.bytes().to_device.pop_front().map(u16::from)
    }
}
