//! A set of triads.

use crate::triad_name::{TriadKind, TriadName};

/// A set of triads: a bit for each name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Triads([u64; TriadKind::ALL.len()]);

impl Triads {
    /// Adds `triad`, whose number is 1 to [`TriadName::MOST`].
    pub fn insert(&mut self, triad: TriadName) {
        self.0[triad.kind as usize] |= bit(triad);
    }

    /// Whether `triad` is in it.
    pub fn contains(self, triad: TriadName) -> bool {
        self.0[triad.kind as usize] & bit(triad) != 0
    }

    /// Whether there is no triad.
    pub fn is_empty(self) -> bool {
        self == Self::default()
    }

    /// Its triads, by number and kind.
    pub fn iter(self) -> impl Iterator<Item = TriadName> {
        let count = if self.is_empty() { 0 } else { usize::MAX };
        TriadName::all()
            .take(count)
            .filter(move |triad| self.contains(*triad))
    }
}

/// The bit of a triad; none for a number that no name has.
fn bit(triad: TriadName) -> u64 {
    match triad.number {
        1..=TriadName::MOST => 1 << (triad.number - 1),
        _ => 0,
    }
}

impl FromIterator<TriadName> for Triads {
    fn from_iter<I: IntoIterator<Item = TriadName>>(triads: I) -> Self {
        let mut set = Self::default();
        triads.into_iter().for_each(|triad| set.insert(triad));
        set
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_has_what_was_put_in_by_number_and_kind() {
        let names = ["mag64", "gyro", "accel2", "mag", "gyro2"];
        let set: Triads = names.into_iter().filter_map(TriadName::parse).collect();
        let listed: Vec<String> = set.iter().map(|triad| triad.to_string()).collect();
        assert_eq!(listed, ["gyro", "mag", "gyro2", "accel2", "mag64"]);
        assert!(!set.contains(TriadName::ACCEL) && Triads::default().iter().next().is_none());
    }
}
