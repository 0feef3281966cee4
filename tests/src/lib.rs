//! Whole-system tests of mimu: see the files beside this one in `tests/`.
