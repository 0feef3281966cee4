//! Names of units.

/// Name of a unit that nobody has named. It is the default, because a name made up from that of a file or folder would make two sessions of one unit
/// look like sessions of two.
pub const UNNAMED: &str = "unnamed";

/// Whether two names belong to two units. A unit without a name may be any.
pub fn are_two_units(one: &str, other: &str) -> bool {
    one != other && one != UNNAMED && other != UNNAMED
}

/// Two names among `names` that belong to two units, and the place of the second, if there are two.
pub fn two_units<'a>(
    names: impl IntoIterator<Item = &'a str>,
) -> Option<(&'a str, &'a str, usize)> {
    let mut named = names.into_iter().enumerate().filter(|(_, n)| *n != UNNAMED);
    let (_, first) = named.next()?;
    let (at, other) = named.find(|(_, name)| are_two_units(first, name))?;
    Some((first, other, at))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_on_one_side_only_contradicts_nothing_and_two_names_do() {
        assert!(!are_two_units("a", "a") && !are_two_units("a", UNNAMED));
        assert!(!are_two_units(UNNAMED, UNNAMED) && are_two_units("a", "b"));
        assert_eq!(two_units([UNNAMED, "a", UNNAMED, "a"]), None);
        assert_eq!(two_units([UNNAMED, "a", UNNAMED, "b"]), Some(("a", "b", 3)));
    }
}
