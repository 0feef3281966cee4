//! How a subcommand ended, if nothing was refused.

/// What the exit status tells the calling program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Status {
    /// Status 0.
    Done,
    /// Status 3: the result is written, `--strict` was given, and the judgement of the result is worse than `good`.
    NotGood,
    /// Status 3: the result is written, and a unit is beyond its limits.
    #[cfg(not(target_family = "wasm"))]
    Rejected,
}

impl Status {
    /// The exit status of the process.
    pub(crate) fn code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::NotGood => 3,
            #[cfg(not(target_family = "wasm"))]
            Self::Rejected => 3,
        }
    }
}
