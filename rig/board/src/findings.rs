//! The emulator's findings about a firmware.

use std::collections::BTreeMap;

use rigless::session::Session;

use crate::part::Machine;

/// The emulator's findings about a firmware.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Findings {
    /// Violated rules of the reference manual, and accesses that the part refused.
    pub broken: Vec<String>,
    /// Writes without effect, because the emulator does not model the function.
    pub unmodelled: Vec<String>,
}

/// All findings so far.
pub(crate) fn findings(session: &Session<Machine>) -> Findings {
    let mut findings = Findings::default();
    for told in session.told() {
        findings.broken.push(format!(
            "{}.{} at {} ns: {}",
            told.instance, told.register, told.at.0, told.reason
        ));
    }
    for (address, fault) in session.refused() {
        findings.broken.push(format!("{address:#010x}: {fault}"));
    }
    for unmapped in session.unmapped() {
        findings.broken.push(unmapped.to_string());
    }
    for (instance, number) in session.unrouted() {
        findings
            .broken
            .push(format!("{instance}: interrupt {number} has no line"));
    }
    let mut writes = BTreeMap::new();
    for gap in session.unimplemented().values().filter(|g| g.writes > 0) {
        writes.insert((gap.instance, gap.register), gap.writes);
    }
    for ((instance, register), count) in writes {
        findings
            .unmodelled
            .push(format!("{instance}.{register}: {count} writes"));
    }
    for (address, gap) in session.undefined() {
        findings.unmodelled.push(format!(
            "{} at {address:#010x}: {} reads, {} writes where no register is",
            gap.instance, gap.reads, gap.writes
        ));
    }
    findings
}
