//! The subcommands, one per file: each has a struct of arguments and a function `run`.

#[cfg(not(target_family = "wasm"))]
pub(crate) mod accept;
pub(crate) mod allan;
pub(crate) mod apply;
pub(crate) mod compare;
pub(crate) mod completions;
pub(crate) mod convert;
pub(crate) mod design;
#[cfg(not(target_family = "wasm"))]
pub(crate) mod device;
pub(crate) mod diagnose;
pub(crate) mod export;
pub(crate) mod fit;
pub(crate) mod fleet;
pub(crate) mod import;
pub(crate) mod man;
pub(crate) mod noise;
#[cfg(not(target_family = "wasm"))]
pub(crate) mod record;
pub(crate) mod report;
pub(crate) mod thermal;
pub(crate) mod trajectory;
pub(crate) mod verify;
pub(crate) mod wizard;
