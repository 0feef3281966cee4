//! The line to the host: frames out, bytes in. A serial port, or the part's own USB with the feature `usb`.

use embassy_futures::select::{Either, select};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::zerocopy_channel::{Receiver, Sender};
use mimu_core::wire::{MAX_FRAME, Message, encode};

use crate::liveness::Progress;

#[cfg(not(feature = "usb"))]
mod serial;
#[cfg(feature = "usb")]
mod usb;

#[cfg(not(feature = "usb"))]
pub use serial::{Input, Output, split};
#[cfg(feature = "usb")]
pub use usb::{Input, Memory, Output, Usb, split};

/// A frame to be sent.
#[derive(Clone, Copy)]
pub struct Outgoing {
    length: usize,
    bytes: [u8; MAX_FRAME],
}

impl Outgoing {
    /// Nothing.
    pub const EMPTY: Self = Self {
        length: 0,
        bytes: [0; MAX_FRAME],
    };

    fn fill(&mut self, message: &Message<'_>) {
        // A frame that is too long is dropped; the types exclude such messages.
        self.length = encode(message, &mut self.bytes).unwrap_or_default();
    }

    fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or(&[])
    }
}

/// Frames that were queued, and frames that were sent.
pub static TRANSMITTED: Progress = Progress::new();

/// Input of the queue of frames.
pub type FrameSender = Sender<'static, NoopRawMutex, Outgoing>;
/// Output of the queue of frames.
pub type FrameReceiver = Receiver<'static, NoopRawMutex, Outgoing>;

/// Sends a message, and waits for room.
pub async fn send(frames: &mut FrameSender, message: &Message<'_>) {
    frames.send().await.fill(message);
    TRANSMITTED.begin();
    frames.send_done();
}

/// Sends a message if there is room; returns whether it did.
pub fn try_send(frames: &mut FrameSender, message: &Message<'_>) -> bool {
    let Some(frame) = frames.try_send() else {
        return false;
    };
    frame.fill(message);
    TRANSMITTED.begin();
    frames.send_done();
    true
}

/// Transmits queued frames; answers go before events, because the host waits for them.
pub async fn transmit(mut output: Output, mut replies: FrameReceiver, mut events: FrameReceiver) {
    loop {
        let from_replies = match select(replies.receive(), events.receive()).await {
            Either::First(frame) => {
                output.send(frame.bytes()).await;
                true
            }
            Either::Second(frame) => {
                output.send(frame.bytes()).await;
                false
            }
        };
        TRANSMITTED.complete();
        match from_replies {
            true => replies.receive_done(),
            false => events.receive_done(),
        }
    }
}
