//! The rules by which results are [judged](crate::judgement).
//!
//! | module | judges |
//! |---|---|
//! | [`errors`] | error figures, by the input and by what is predicted of them |
//! | [`input`] | whether the input is what it is declared to be |
//! | `of_fit` | a fit |
//!
//! A verification, a diagnosis and curves over temperature are judged where they are made, by the same functions.

pub mod errors;
pub mod input;
mod of_fit;
