//! What is remarkable about a capture, why, and what to do.

use handeye_core::findings::FindingCode;

use crate::gui::captures::{CaptureRow, Seen};
use crate::gui::theme::Tone;
use crate::text::Language;
use crate::{text, tr};

/// One remark.
#[derive(Debug, Clone, PartialEq)]
pub struct Flag {
    /// How bad it is; `None` for what is merely so.
    pub tone: Option<Tone>,
    /// In a word or two.
    pub name: &'static str,
    /// Why, and what to do.
    pub why: String,
}

/// What is known besides the row.
#[derive(Debug, Clone, Copy, Default)]
pub struct Circumstances {
    /// The line between good and bad residuals [px].
    pub outlier_line_px: Option<f64>,
    /// The last capture was refused because the robot is where this one was taken.
    pub refused_here: bool,
}

/// How much a row is worth looking at, for sorting.
pub fn weight(row: &CaptureRow) -> u8 {
    match row.seen {
        Seen::Unreadable => return 9,
        Seen::NoBoard => return 8,
        Seen::Board | Seen::NotYet => {}
    }
    let has = |code, weight| if row.found.contains(&code) { weight } else { 0 };
    has(FindingCode::LargeResidual, 4)
        + has(FindingCode::LargeCorrection, 2)
        + has(FindingCode::InfluentialView, 1)
        + u8::from(row.excluded)
}

/// The remarks on a capture, the worst first.
pub fn flags(row: &CaptureRow, circumstances: Circumstances, language: Language) -> Vec<Flag> {
    let mut flags = Vec::new();
    let mut flag = |tone, name, why: String| flags.push(Flag { tone, name, why });
    if circumstances.refused_here {
        let why = tr!(
            language,
            "The last capture was refused because the robot still is where this one was taken. Move the arm, or delete \
             this one first."
        );
        flag(Some(Tone::Warning), tr!(language, "Robot is here"), why.to_owned());
    }
    match row.seen {
        Seen::Unreadable => {
            let why = tr!(
                language,
                "The picture of this capture cannot be read from the disk, so it is not used. Delete it and capture this \
                 pose again."
            );
            flag(Some(Tone::Bad), tr!(language, "Not readable"), why.to_owned());
        }
        Seen::NoBoard => {
            let why = tr!(
                language,
                "The board was not found in this picture, so it is not used. Look whether it is wholly in view, sharp and \
                 lit, and whether its columns and rows are right; or delete this capture."
            );
            flag(Some(Tone::Warning), tr!(language, "No board"), why.to_owned());
        }
        Seen::NotYet => {
            let why = tr!(language, "The board is being looked for in this picture.");
            flag(Some(Tone::Busy), tr!(language, "Looking…"), why.to_owned());
        }
        Seen::Board => {}
    }
    if let (Some(rms_px), Some(line_px)) = (row.rms_px, circumstances.outlier_line_px)
        && rms_px > line_px
        && !row.verifies()
        && !row.excluded
    {
        let (rms, line) = (format!("{rms_px:.3}"), format!("{line_px:.3}"));
        let why = text!(
            "Its residual of {rms} px is above the line that you drew at {line} px. Exclude it if its picture is bad.",
            rms = rms,
            line = line
        );
        flag(Some(Tone::Warning), tr!(language, "Above the line"), why.say(language));
    }
    if row.found.contains(&FindingCode::LargeResidual) {
        let why = tr!(
            language,
            "Its corners fit much worse than those of the other captures. Look at its picture: blur, a reflection or a \
             moved board. Then exclude it or capture this pose again."
        );
        flag(Some(Tone::Warning), tr!(language, "Large residual"), why.to_owned());
    }
    if row.found.contains(&FindingCode::LargeCorrection) {
        let why = tr!(
            language,
            "The robot's pose had to be corrected much more than at the other captures. Perhaps the arm was not at rest, \
             or the board was moved. Go there again and capture it once more."
        );
        flag(Some(Tone::Warning), tr!(language, "Large correction"), why.to_owned());
    }
    if row.found.contains(&FindingCode::InfluentialView) {
        let why = tr!(
            language,
            "The answer leans on this one capture. That is no error, but more captures like it would make the answer \
             safer."
        );
        flag(Some(Tone::Busy), tr!(language, "Influential"), why.to_owned());
    }
    if row.excluded {
        let why = tr!(language, "It was taken out by hand and touches no number. Tick it to use it again.");
        flag(None, tr!(language, "Excluded"), why.to_owned());
    }
    flags
}
