//! The part's memory, as accessed by a debugger.

use rigless::emulator::Host;
use rigless::soc::Width;

/// Reads bytes from an address on.
pub(crate) fn read(host: &mut dyn Host, address: u64, length: usize) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::with_capacity(length);
    let mut at = address;
    let end = address + length as u64;
    while at < end {
        let width = if at.is_multiple_of(8) && end - at >= 8 {
            Width::W64
        } else {
            Width::W8
        };
        let value = host.read(at, width).map_err(|e| e.to_string())?;
        let taken = width.bytes() as usize;
        bytes.extend(&value.to_le_bytes()[..taken]);
        at += taken as u64;
    }
    Ok(bytes)
}

/// Writes bytes into flash memory where they differ from the current ones.
pub(crate) fn program(host: &mut dyn Host, address: u64, bytes: &[u8]) -> Result<(), String> {
    let before = read(host, address, bytes.len())?;
    for ((at, &new), old) in (address..).zip(bytes).zip(before) {
        if new != old {
            host.program(at, Width::W8, u64::from(new))
                .map_err(|e| e.to_string())?;
        }
    }
    Ok(())
}
