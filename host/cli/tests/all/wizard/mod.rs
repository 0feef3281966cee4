//! `mimu wizard`, from its arguments to its exit status.
#![cfg(unix)]

pub mod bench;
pub mod on_board;
mod playback;
mod relayed;
mod text;
