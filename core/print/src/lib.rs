//! Targets on paper, at exact physical scale.
//!
//! [`Drawing`] is what is black on a target, in metres in the target frame. [`Sheet`] lays it on a page with rulers and a
//! line of text, and [`pdf`] writes the page. Rendered images for tests are made of the same drawing, so that what is
//! printed is what is tested to be found.
//!
//! ```
//! use handeye_geometry::targets::{Grid, TargetSpec};
//! use handeye_print::{Page, target_pdf};
//!
//! let board = TargetSpec::Chessboard(Grid { columns: 9, rows: 6, square_m: 0.02 });
//! assert!(target_pdf(&board, Page::A4)?.starts_with(b"%PDF"));
//! # Ok::<(), handeye_print::PrintError>(())
//! ```
//!
//! The only crate that writes PDF. The codes of markers come from `handeye_detect`.

#![warn(missing_docs)]

mod drawing;
mod pdf;
mod sheet;

pub use drawing::{Drawing, Shape};
pub use pdf::pdf;
pub use sheet::{Page, Sheet, Text};

use handeye_geometry::targets::{BadTarget, TargetSpec};

/// Why a target cannot be printed.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum PrintError {
    /// A number of the target is out of range.
    #[error("the target cannot be drawn: {source}")]
    BadTarget {
        /// The dimension, and its valid range.
        #[from]
        source: BadTarget,
    },
    /// The markers cannot be drawn.
    #[error("the markers cannot be drawn: {reason}")]
    Markers {
        /// The error of the marker library.
        reason: String,
    },
    /// The page is too small.
    #[error(
        "the target with its margins and rulers needs {need_mm:?} mm (width, height), the page {page} has {has_mm:?} mm: \
         take a larger page, or --page fit for a page of its own size"
    )]
    DoesNotFit {
        /// Width and height needed, rounded up.
        need_mm: [f64; 2],
        /// The paper that it does not fit on.
        page: Page,
        /// Its width and height, the way round that is nearer to fitting.
        has_mm: [f64; 2],
    },
    /// No page of that size can be described.
    #[error("a page of {need_mm:?} mm (width, height) is larger than the 5 m that a PDF can describe")]
    TooLarge {
        /// Width and height needed, rounded up.
        need_mm: [f64; 2],
    },
}

/// A target as a PDF.
///
/// # Errors
/// [`PrintError`].
pub fn target_pdf(target: &TargetSpec, page: Page) -> Result<Vec<u8>, PrintError> {
    Ok(pdf(&Sheet::new(target, page)?))
}

#[cfg(test)]
mod tests;
