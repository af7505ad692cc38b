//! The capture that is under way or was refused, as shown in several places.

use handeye_capture::Wait;
use handeye_wording::text;
use handeye_workbench::model::{CapturePurpose, CaptureUnderWay, CaptureWait, Model};
use handeye_workbench::text::Text;

/// A refusal is shown over the image for this long \[s\]; after that the table of poses keeps it.
const REFUSAL_S: f64 = 8.0;

/// Whether the last refusal of a capture is shown over the image.
pub fn covers_image(model: &Model) -> bool {
    model.refused.as_ref().is_some_and(|refused| model.now_s - refused.at_s < REFUSAL_S)
}

/// What a capture waits for, in words.
pub fn waiting(capture: &CaptureUnderWay) -> Text {
    let what = match capture.wait {
        CaptureWait::Images(Wait::ForImage) => text!("waiting for an image"),
        CaptureWait::Images(Wait::RobotMoves) => text!("waiting for the robot to stand still"),
        CaptureWait::Images(Wait::ImageChanges) => text!("waiting for the image to come to rest"),
        CaptureWait::Images(Wait::Averaging { done, of }) => {
            text!("averaging images, {done} of {of}", done = done, of = of)
        }
        CaptureWait::Measuring => text!("measuring the board"),
        CaptureWait::Saving => text!("saving"),
    };
    match capture.purpose {
        CapturePurpose::Calibrate => text!("Capturing… {what}", what = what),
        CapturePurpose::Verify => text!("Capturing for verification… {what}", what = what),
    }
}
