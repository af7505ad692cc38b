//! What can go wrong with a recording.

use std::path::PathBuf;

use handeye_workbench::text::Text;

/// Why something is not in the recording.
#[derive(Debug, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum RecordError {
    /// The stream did not take it.
    #[error("{path} could not be recorded: {why}", why = source.to_string())]
    Stream {
        /// Which entity.
        path: String,
        /// The stream's error.
        source: Box<rerun::RecordingStreamError>,
    },
    /// A file of a capture cannot be read; everything else of the entry is recorded.
    #[error("{file} of capture {capture} is not in the recording: {reason}", file = file.display())]
    File {
        capture: u32,
        file: PathBuf,
        /// What is wrong with it.
        reason: Text,
    },
    /// The result has numbers that its file format does not allow; everything else of the entry is recorded.
    #[error("the result is not in the recording as JSON: {reason}")]
    Result { reason: String },
    /// An image could not be compressed; everything else of the entry is recorded.
    #[error("an image of {width}×{height} could not be compressed for {path}: {reason}")]
    Image {
        /// Which entity.
        path: String,
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// The encoder's message.
        reason: String,
    },
}

/// Continues after errors that concern one thing only, and keeps the first of them.
#[derive(Debug, Default)]
pub(super) struct Faults(Option<RecordError>);

impl Faults {
    /// An error of the stream is passed on at once.
    pub fn tolerate(&mut self, outcome: Result<(), RecordError>) -> Result<(), RecordError> {
        match outcome {
            Err(stream @ RecordError::Stream { .. }) => Err(stream),
            Err(error) => {
                self.0.get_or_insert(error);
                Ok(())
            }
            Ok(()) => Ok(()),
        }
    }

    /// The first error.
    pub fn finish(self) -> Result<(), RecordError> {
        self.0.map_or(Ok(()), Err)
    }
}
