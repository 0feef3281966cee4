//! Reading ahead: one thread reads while another uses what was read before, in bounded memory.

use crate::error::{Error, Result};

/// Makes results with `make` until it gives none, and hands them to `take` in their order. An error of `take` stops everything. `place` names the file
/// in the error if `make` panics.
#[cfg(not(target_family = "wasm"))]
pub(super) fn ahead<T: Send>(
    place: &str,
    mut make: impl FnMut() -> Option<T> + Send,
    take: impl FnMut(T) -> Result<()>,
) -> Result<()> {
    /// Results that may wait: one to take while the next is being made.
    const WAITING: usize = 2;
    std::thread::scope(|scope| {
        let (sender, receiver) = std::sync::mpsc::sync_channel(WAITING);
        // A send fails when the consumer has stopped; the rest is not needed then.
        let body = move || while make().is_some_and(|result| sender.send(result).is_ok()) {};
        let reader = std::thread::Builder::new().name("read".into());
        let reader = reader.spawn_scoped(scope, body).map_err(|error| {
            let problem = format!("cannot start a thread: {error}");
            Error::new(place, problem, "close other programs and run it again")
        })?;
        let outcome = receiver.iter().try_for_each(take);
        // A reader that waits in `send` must see that nobody listens, or the join below never ends.
        drop(receiver);
        // Joined here, because the scope would pass on the panic of an unjoined thread.
        match reader.join() {
            Err(_) if outcome.is_ok() => Err(reader_panicked(place)),
            _ => outcome,
        }
    })
}

/// The same without threads: each result is computed on demand.
#[cfg(target_family = "wasm")]
pub(super) fn ahead<T>(
    _: &str,
    make: impl FnMut() -> Option<T>,
    take: impl FnMut(T) -> Result<()>,
) -> Result<()> {
    std::iter::from_fn(make).try_for_each(take)
}

/// Error after the code that reads a file has panicked.
pub(super) fn reader_panicked(place: &str) -> Error {
    Error::new(
        place,
        "the reader failed on the contents",
        "the file is damaged: make it again from its source",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_order_until_the_consumer_stops() {
        let mut next = 0;
        let mut seen = Vec::new();
        let count = || {
            next += 1;
            (next <= 100).then_some(next - 1)
        };
        ahead("here", count, |i| {
            seen.push(i);
            Ok(())
        })
        .unwrap();
        assert_eq!(seen, (0..100).collect::<Vec<_>>());
        let mut taken = 0;
        let stop = |()| {
            taken += 1;
            match taken {
                5 => Err(Error::new("here", "stop", "nothing")),
                _ => Ok(()),
            }
        };
        let error = ahead("here", || Some(()), stop).unwrap_err();
        assert_eq!((taken, error.refused().problem.as_str()), (5, "stop"));
    }

    #[test]
    fn a_panic_of_the_reader_is_an_error() {
        let mut left = 3;
        let make = || {
            left -= 1;
            assert!(left > 0, "on purpose");
            Some(())
        };
        let error = ahead("file", make, |()| Ok(())).unwrap_err();
        assert!(error.to_string().starts_with("file: the reader failed"));
    }
}
