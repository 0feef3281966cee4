//! Which files a command may overwrite.

use std::path::Path;

use mimu_recording::error::{Argument, Error, Result};

/// What only files of mimu have: the kinds that `-o` writes, keys of results in JSON, and the heads of exports and pages.
const OWN: [&str; 6] = [
    "format = \"mimu-calibration/",
    "format = \"mimu-thermal-biases/",
    "format = \"mimu-noise/",
    "format = \"mimu-prior/",
    "format = \"mimu-plan/",
    "\"format\": \"mimu-",
];

/// Before the work, refuses to overwrite a file that mimu did not write, as its contents show. An empty file has none.
pub(crate) fn check_overwritten(outputs: &[Option<&Path>]) -> Result<()> {
    for path in outputs.iter().flatten().filter(|path| path.is_file()) {
        let bytes = std::fs::read(path).map_err(|e| Error::io(path, &e))?;
        let text = String::from_utf8_lossy(&bytes);
        let by_version = |(at, _): (usize, &str)| {
            let version = text[at..].strip_prefix("mimu ");
            version.is_some_and(|v| v.starts_with(|c: char| c.is_ascii_digit()))
        };
        let is_own = OWN.iter().any(|mark| text.contains(mark))
            || text.match_indices("mimu ").any(by_version)
            || bytes.starts_with(b"mimc");
        if !bytes.is_empty() && !is_own {
            return Err(Error::new(
                path.display(),
                "the file exists, and mimu did not write it",
                "choose another name, or remove it",
            )
            .about(Argument::Replace));
        }
    }
    Ok(())
}
