//! Names of units.

/// Name of a unit that nobody has named. It is the default, because a name made up from that of a file or folder would make two sessions of one unit
/// look like sessions of two.
pub const UNNAMED: &str = "unnamed";

/// Whether two names belong to two units. A unit without a name may be any.
pub fn are_two_units(one: &str, other: &str) -> bool {
    one != other && one != UNNAMED && other != UNNAMED
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_on_one_side_only_contradicts_nothing_and_two_names_do() {
        assert!(!are_two_units("a", "a") && !are_two_units("a", UNNAMED));
        assert!(!are_two_units(UNNAMED, UNNAMED) && are_two_units("a", "b"));
    }
}
