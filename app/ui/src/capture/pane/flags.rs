//! What is remarkable about a capture, why, and what to do.

use handeye_estimate::diagnose::findings::FindingCode;

use crate::capture::rows::{CaptureRow, Detected};
use crate::style::theme::Tone;
use handeye_wording::text;
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// One remark.
#[derive(Debug, Clone, PartialEq)]
pub struct Flag {
    /// How bad it is; `None` for a neutral remark.
    pub tone: Option<Tone>,
    /// In a word or two.
    pub name: &'static str,
    /// Why, and what to do.
    pub why: String,
}

/// What is known in addition to the row.
#[derive(Debug, Clone, Copy, Default)]
pub struct Circumstances {
    /// The line between good and bad residuals \[px\].
    pub outlier_line_px: Option<f64>,
    /// The last capture was refused because the robot is where this one was taken.
    pub refused_here: bool,
}

/// How much a row is worth looking at, for sorting.
pub fn weight(row: &CaptureRow) -> u8 {
    match row.seen {
        Detected::Unreadable => return 9,
        Detected::NoBoard => return 8,
        Detected::Board | Detected::NotYet => {}
    }
    if row.is_rejected() {
        return 8;
    }
    let has = |code, weight| if row.found.contains(&code) { weight } else { 0 };
    has(FindingCode::LargeResidual, 4)
        + has(FindingCode::LargeCorrection, 2)
        + has(FindingCode::InfluentialView, 1)
        + u8::from(row.excluded)
}

/// Why the estimate excluded a capture, and what to do; `None` if it did not.
fn why_rejected(row: &CaptureRow, language: Language) -> Option<String> {
    let rejected = row.rejected.filter(|_| row.is_rejected())?;
    let why = match rejected.board_off {
        Some((mm, deg)) => text!(
            "It does not fit the other captures, so the answer is without it: its board is {mm} mm and {deg}° from where \
             they put it. The arm may still have moved, the board may have been touched, or the pose is of another \
             image. Look at its image and capture this pose again, or keep all views in the result to see the \
             difference.",
            mm = format!("{mm:.2}"),
            deg = format!("{deg:.3}")
        ),
        None => text!(
            "Its corners are no image of the board, so the answer is without it. Look at its image: reflections, a \
             covered board, wrong columns and rows. Capture this pose again, or keep all views in the result to see the \
             difference."
        ),
    };
    Some(why.in_language(language))
}

/// The same for single corners.
fn why_corners_rejected(row: &CaptureRow, language: Language) -> Option<String> {
    let why = text!(
        "Corners of this image that are far from where the rest of it puts them, and which the answer is without: \
         {count}. Look there for reflections and things in front of the board.",
        count = row.rejected_corners
    );
    (row.rejected_corners > 0 && !row.excluded && !row.verifies() && !row.is_rejected())
        .then(|| why.in_language(language))
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
        Detected::Unreadable => {
            let why = tr!(
                language,
                "The image of this capture cannot be read from the disk, so it is not used. Delete it and capture this \
                 pose again."
            );
            flag(Some(Tone::Bad), tr!(language, "Not readable"), why.to_owned());
        }
        Detected::NoBoard => {
            let why = tr!(
                language,
                "The board was not found in this image, so it is not used. Check whether it is wholly in view, sharp and lit, and whether its columns and rows are right; or delete this capture."
            );
            flag(Some(Tone::Warning), tr!(language, "No board"), why.to_owned());
        }
        Detected::NotYet => {
            let why = tr!(language, "The board is being looked for in this image.");
            flag(Some(Tone::Busy), tr!(language, "Looking…"), why.to_owned());
        }
        Detected::Board => {}
    }
    if let Some(why) = why_rejected(row, language) {
        flag(Some(Tone::Warning), tr!(language, "Outlier"), why);
    }
    if let (Some(rms_px), Some(line_px)) = (row.rms_px, circumstances.outlier_line_px)
        && rms_px > line_px
        && !row.verifies()
        && !row.excluded
        && !row.is_rejected()
    {
        let (rms, line) = (format!("{rms_px:.3}"), format!("{line_px:.3}"));
        let why = text!(
            "Its residual of {rms} px is above the line that you drew at {line} px. Exclude it if its image is bad.",
            rms = rms,
            line = line
        );
        flag(Some(Tone::Warning), tr!(language, "Above the line"), why.in_language(language));
    }
    if row.found.contains(&FindingCode::LargeResidual) {
        let why = tr!(
            language,
            "Its corners fit much worse than those of the other captures. Look at its image: blur, a reflection or a \
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
            "The result depends strongly on this one capture. That is not an error, but more captures like it would \
             make the result more robust."
        );
        flag(Some(Tone::Busy), tr!(language, "Influential"), why.to_owned());
    }
    if let Some(why) = why_corners_rejected(row, language) {
        flag(Some(Tone::Busy), tr!(language, "Outlier corners"), why);
    }
    if row.excluded {
        let why = tr!(language, "It was excluded by hand and does not affect the result. Tick it to use it again.");
        flag(None, tr!(language, "Excluded"), why.to_owned());
    }
    flags
}
