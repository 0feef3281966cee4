//! The firmware's release image on the emulated board, tested as a whole.
//!
//! | where                | what                                                                                 |
//! |----------------------|--------------------------------------------------------------------------------------|
//! | [`conversation`]     | the host's end of the serial line                                                    |
//! | `tests/all/`         | sampling, the line, restarts, cuts of the supply, the pseudo-terminal                |
//! | `budget/`            | cost of the firmware, against `budget.toml`                                          |

pub mod conversation;

use std::path::PathBuf;

use mimu_board::commanded::Kind;
use mimu_board::front::Front;
use mimu_board::image::Image;
use mimu_board::running::Board;
use mimu_board::schematic::Volts;

/// A millisecond of virtual time, ns.
pub const MS: u64 = 1_000_000;

/// Time after which the firmware samples, ns: 42 ms of it are the converter's calibration.
pub const STARTED: u64 = 100 * MS;

/// The release image: the one that `MIMU_FIRMWARE` names, or the last one built into the target directory.
///
/// # Panics
///
/// If it was not built.
pub fn image() -> Image {
    let path =
        std::env::var_os("MIMU_FIRMWARE").map_or_else(|| built("mimu-firmware"), PathBuf::from);
    match Image::read(&path) {
        Ok(image) => image,
        Err(problem) => panic!("{problem}"),
    }
}

/// The release image for the Matek H743: the one that `MIMU_FIRMWARE_MATEK` names, or the last one that `make images` built.
///
/// # Panics
///
/// If it was not built.
pub fn digital_image() -> Image {
    let path = std::env::var_os("MIMU_FIRMWARE_MATEK")
        .map_or_else(|| built("mimu-firmware-matek-h743"), PathBuf::from);
    match Image::read(&path) {
        Ok(image) => image,
        Err(problem) => panic!("{problem}; `make images` builds it"),
    }
}

/// The release image of a board.
///
/// # Panics
///
/// If it was not built.
pub fn image_of(kind: Kind) -> Image {
    match kind {
        Kind::Nucleo => image(),
        Kind::Matek { .. } => digital_image(),
    }
}

/// Path of the release build of a program for the target.
pub fn built(name: &str) -> PathBuf {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let target = std::env::var_os("CARGO_TARGET_DIR")
        .map_or_else(|| PathBuf::from(root).join("target"), PathBuf::from);
    target.join("thumbv7em-none-eabihf/image").join(name)
}

/// A board with the release image at constant voltages.
pub fn still(volts: Volts) -> Board {
    Board::new(&image(), Front::Still(volts)).unwrap()
}
