//! A firmware image: the ELF file made by `cargo build`.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use object::{Object, ObjectSection, ObjectSegment, ObjectSymbol, SectionFlags};
use rigless::image::Image as Placed;

/// First address that is RAM; below it is flash.
const RAM: u64 = 0x2000_0000;

/// An image that the board can run.
#[derive(Debug, Clone)]
pub struct Image {
    pub(crate) placed: Placed,
    symbols: BTreeMap<String, u64>,
    sizes: Sizes,
}

/// Memory use of an image, bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sizes {
    /// Code, constants, and the initial values of variables.
    pub flash: u64,
    /// Variables. The stack gets the rest.
    pub ram: u64,
}

/// Location of the image from `cargo build -p mimu-firmware --profile image --target thumbv7em-none-eabihf`: in the target directory that
/// `CARGO_TARGET_DIR` names, or in `target` here.
pub fn release_image() -> PathBuf {
    built("mimu-firmware")
}

/// The same of the image for the Matek H743, which `make images` puts beside it.
pub fn digital_release_image() -> PathBuf {
    built("mimu-firmware-matek-h743")
}

fn built(name: &str) -> PathBuf {
    let target =
        std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| "target".into(), PathBuf::from);
    target.join("thumbv7em-none-eabihf/image").join(name)
}

impl Image {
    /// Reads an ELF file.
    ///
    /// Errors: no such file, not an ELF file, or not one for this core.
    pub fn read(path: &Path) -> Result<Self, String> {
        let name = path.display();
        let bytes = fs::read(path).map_err(|e| {
            format!(
                "{name}: {e}; build it with `cargo build -p mimu-firmware --profile image --target \
                 thumbv7em-none-eabihf`"
            )
        })?;
        let refused =
            |e: &dyn std::fmt::Display| format!("{name}: {e}; give the ELF file of the firmware");
        let file = object::File::parse(&*bytes).map_err(|e| refused(&e))?;
        let symbols = file
            .symbols()
            .filter(|symbol| symbol.is_definition())
            // The lowest bit of a function's symbol means Thumb and is not part of its address.
            .filter_map(|symbol| Some((symbol.name().ok()?.to_owned(), symbol.address() & !1)))
            .collect();
        let sizes = sizes(&file);
        drop(file);
        let placed = Placed::new(path, bytes, None).map_err(|e| refused(&e))?;
        Ok(Self {
            placed,
            symbols,
            sizes,
        })
    }

    /// Address of a function's first instruction, or of a variable.
    ///
    /// Errors: the image has no such symbol.
    pub fn address(&self, symbol: &str) -> Result<u64, String> {
        self.symbols
            .get(symbol)
            .copied()
            .ok_or_else(|| format!("the image has no symbol {symbol}"))
    }

    /// Address of the only symbol whose mangled name contains `part`. Tables of the compiler contain the names of their functions and are ignored.
    ///
    /// Errors: no such symbol, or several.
    pub fn find(&self, part: &str) -> Result<u64, String> {
        let meant = |name: &str| name.contains(part) && !name.starts_with(".L");
        let mut found = self.symbols.iter().filter(|(name, _)| meant(name));
        match (found.next(), found.next()) {
            (Some((_, &address)), None) => Ok(address),
            (None, _) => Err(format!("the image has no symbol with {part} in it")),
            (Some((one, _)), Some((other, _))) => {
                Err(format!("{part} is in several symbols: {one}, {other}"))
            }
        }
    }

    /// Its memory use.
    pub fn sizes(&self) -> Sizes {
        self.sizes
    }
}

fn sizes(file: &object::File<'_>) -> Sizes {
    let flash = file.segments().map(|segment| segment.file_range().1).sum();
    let allocated = |flags| matches!(flags, SectionFlags::Elf { sh_flags, .. } if sh_flags & u64::from(object::elf::SHF_ALLOC) != 0);
    let ram = file
        .sections()
        .filter(|section| section.address() >= RAM && allocated(section.flags()))
        .map(|section| section.size())
        .sum();
    Sizes { flash, ram }
}
