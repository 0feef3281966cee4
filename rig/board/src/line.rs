//! The far end of the serial line: bytes to and from the microcontroller, each at its instant.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rigless::chip::Timeline;
use rigless::chip::uart::Peer;
use rigless::snapshot::Store;
use rigless::time::VirtualNanos;

/// What is on its way in either direction.
#[derive(Debug, Default)]
pub(crate) struct Bytes {
    /// Waiting for the line, oldest first.
    pub(crate) to_device: VecDeque<u8>,
    /// Come in, oldest first, each with the end of its stop bit, ns.
    pub(crate) from_device: Vec<(u64, u8)>,
}

/// A cable: what is put in at one end comes out at the other.
#[derive(Debug, Clone, Default)]
pub(crate) struct Line(Arc<Mutex<Bytes>>);

impl Line {
    pub(crate) fn bytes(&self) -> MutexGuard<'_, Bytes> {
        // A panic elsewhere leaves bytes as good as any.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The end that the microcontroller's port sees.
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
