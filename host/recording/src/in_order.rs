//! Work in parallel, results in order, memory bounded.

#[cfg(not(target_family = "wasm"))]
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

use crate::error::{Error, Result};

/// Results that may wait in each worker's channel: one to take while the next is being made.
#[cfg(not(target_family = "wasm"))]
const WAITING: usize = 2;

/// Number of threads to start.
///
/// At most eight: each holds a few chunks, and the one consumer is slower than eight parsers.
pub(super) fn worker_count() -> usize {
    thread::available_parallelism()
        .map_or(1, usize::from)
        .min(8)
}

/// Makes results 0..`count` on `workers` threads and hands them to `take` in that order.
///
/// Worker w makes w, w + workers, w + 2 workers and so on, with its own state from `start(w)`. An error of `take` stops everything. `place` names the
/// file in the error if a worker panics.
#[cfg(not(target_family = "wasm"))]
pub(super) fn in_order<T, W, S>(
    place: &str,
    count: u64,
    workers: usize,
    start: S,
    mut take: impl FnMut(u64, T) -> Result<()>,
) -> Result<()>
where
    T: Send,
    W: FnMut(u64) -> T,
    S: Fn(usize) -> W + Sync,
{
    let workers = workers.max(1);
    thread::scope(|scope| {
        let mut handles = Vec::with_capacity(workers);
        let mut receivers: Vec<Receiver<T>> = Vec::with_capacity(workers);
        for worker in 0..workers {
            let (sender, receiver): (SyncSender<T>, _) = sync_channel(WAITING);
            receivers.push(receiver);
            let start = &start;
            let body = move || {
                let mut work = start(worker);
                let mut index = worker as u64;
                // A send fails when the consumer has stopped; the rest is not needed then.
                while index < count && sender.send(work(index)).is_ok() {
                    index += workers as u64;
                }
            };
            let handle = thread::Builder::new()
                .name(format!("read {worker}"))
                .spawn_scoped(scope, body)
                .map_err(|error| {
                    Error::new(
                        place,
                        format!("cannot start a thread: {error}"),
                        "close other programs and run it again",
                    )
                })?;
            handles.push(handle);
        }
        let mut outcome = Ok(());
        for index in 0..count {
            outcome = match receivers[(index % workers as u64) as usize].recv() {
                Ok(result) => take(index, result),
                // The sender is gone before its last result: only a panic does that.
                Err(_) => Err(reader_panicked(place)),
            };
            if outcome.is_err() {
                break;
            }
        }
        // Workers that wait in `send` must see that nobody listens, or the joins below never end.
        drop(receivers);
        for handle in handles {
            // Joined here, because the scope would pass on the panic of an unjoined thread.
            if handle.join().is_err() && outcome.is_ok() {
                outcome = Err(reader_panicked(place));
            }
        }
        outcome
    })
}

/// The same without threads: each result is computed on demand.
#[cfg(target_family = "wasm")]
pub(super) fn in_order<T, W, S>(
    _: &str,
    count: u64,
    workers: usize,
    start: S,
    mut take: impl FnMut(u64, T) -> Result<()>,
) -> Result<()>
where
    W: FnMut(u64) -> T,
    S: Fn(usize) -> W,
{
    let mut works: Vec<W> = (0..workers.max(1)).map(start).collect();
    let each = works.len() as u64;
    (0..count).try_for_each(|index| take(index, works[(index % each) as usize](index)))
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
    fn results_come_in_order_from_any_number_of_workers() {
        for workers in [1, 2, 3, 7] {
            let mut seen = Vec::new();
            in_order(
                "here",
                100,
                workers,
                |_| |i| i * i,
                |i, square| {
                    seen.push((i, square));
                    Ok(())
                },
            )
            .unwrap();
            assert_eq!(seen, (0..100).map(|i| (i, i * i)).collect::<Vec<_>>());
        }
    }

    #[test]
    fn an_error_of_the_consumer_ends_the_work() {
        let stop = |i, ()| {
            if i == 5 {
                Err(Error::new("here", "stop", "nothing"))
            } else {
                Ok(())
            }
        };
        let error = in_order("here", u64::MAX, 3, |_| |_| (), stop).unwrap_err();
        assert_eq!(error.refused().problem, "stop");
    }

    #[test]
    fn a_panic_of_a_worker_is_an_error() {
        let error = in_order(
            "file",
            10,
            2,
            |_| |i| assert!(i != 4, "on purpose"),
            |_, ()| Ok(()),
        )
        .unwrap_err();
        assert!(error.to_string().starts_with("file: the reader failed"));
    }
}
