//! What a recording is told: everything that happens, as [`Entry`]s. How they are kept and looked at is another crate's
//! business, which implements [`Recording`].

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

/// A recording of everything that happens. Nothing in it waits for a disk or a viewer, but for [`finish`](Self::finish).
pub trait Recording {
    /// Records an entry, later and elsewhere. A document in another folder begins another recording.
    fn note(&self, entry: Entry);

    /// Opens a viewer; how that goes is reported.
    fn open_viewer(&self);

    /// Hands over what is to be told since the last time.
    fn drain(&self, absorb: &mut dyn FnMut(crate::command::Event));

    /// Has everything written that was noted, waits for that no longer than so long, and ends. Returns whether all of it
    /// is where it belongs.
    fn finish(&mut self, deadline: Duration) -> bool;
}
