//! The line between device and host: bytes that must never change, and what a decoder makes of anything else.

mod frames;
mod frozen;
mod golden;
