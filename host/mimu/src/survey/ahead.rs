//! Reads the next item while the current one is processed.

#[cfg(not(target_family = "wasm"))]
use std::sync::mpsc::{channel, sync_channel};
#[cfg(not(target_family = "wasm"))]
use std::thread;

#[cfg(not(target_family = "wasm"))]
use mimu_recording::error::Error;
use mimu_recording::error::Result;

/// Passes `read(0)`, `read(1)`, ... to `take`, `count` of them. `take` calls the function that it also receives once per item, as soon as
/// there is memory, to start the next read in parallel. `place` names the file in the error if the reader panics.
#[cfg(not(target_family = "wasm"))]
pub(super) fn ahead<T: Send>(
    place: &str,
    count: usize,
    mut read: impl FnMut(usize) -> T + Send,
    mut take: impl FnMut(usize, T, &dyn Fn()) -> Result<()>,
) -> Result<()> {
    let (sender, receiver) = sync_channel(0);
    let (ask, asked) = channel();
    thread::scope(|scope| {
        let reader = scope.spawn(move || {
            for k in 0..count {
                // Either fails only if the receiver has given up.
                if asked.recv().is_err() || sender.send(read(k)).is_err() {
                    break;
                }
            }
        });
        // Fails only if the reader has panicked, which `join` reports.
        let next = || {
            let _ = ask.send(());
        };
        next();
        for k in 0..count {
            let Ok(one) = receiver.recv() else { break };
            take(k, one, &next)?;
        }
        drop((receiver, ask));
        reader.join().map_err(|_| {
            Error::new(
                place,
                "the reader failed on the contents",
                "make the file again from its source",
            )
        })
    })
}

/// The same without threads.
#[cfg(target_family = "wasm")]
pub(super) fn ahead<T>(
    _: &str,
    count: usize,
    mut read: impl FnMut(usize) -> T,
    mut take: impl FnMut(usize, T, &dyn Fn()) -> Result<()>,
) -> Result<()> {
    (0..count).try_for_each(|k| take(k, read(k), &|| ()))
}
