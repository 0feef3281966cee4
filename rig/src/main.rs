//! The command `mimu-rig`.

fn main() {}
