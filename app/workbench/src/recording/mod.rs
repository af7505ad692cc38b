//! What a recording receives: everything that happens, as [`Entry`]s. How they are kept and viewed is left to the crate
//! that implements [`Recording`].

pub mod command;
mod entry;
pub(crate) mod recorded;
pub(crate) mod state;
pub(crate) mod update;

use std::time::Duration;

pub use command::{Command, Event};
pub use entry::Entry;

/// Where a browser that shows the window finds the recording: a path of the same server.
pub const BROWSER_PATH: &str = "/rerun/";

/// A recording of everything that happens. Nothing in it waits for a disk or a viewer, except [`finish`](Self::finish).
pub trait Recording {
    /// Records an entry, later and elsewhere. A document in another folder starts another recording.
    fn note(&self, entry: Entry);

    /// Opens a viewer; how that goes is reported.
    fn open_viewer(&self);

    /// Hands over the events since the last time.
    fn drain(&self, absorb: &mut dyn FnMut(crate::command::Event));

    /// Writes everything that was noted, waits at most this long, and ends. Returns whether all of it was written.
    fn finish(&mut self, deadline: Duration) -> bool;
}
