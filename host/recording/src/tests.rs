//! What the tests of this crate share.

#[cfg(feature = "parquet")]
mod round_trip;

/// Checks that `text` contains all these words.
#[track_caller]
pub fn says(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "{word:?} is not in: {text}");
    }
}
