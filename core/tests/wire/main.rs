//! The line between device and host: bytes that must never change, and a decoder's reaction to anything else.

mod frames;
mod golden;
