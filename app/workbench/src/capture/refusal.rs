//! Why there is no capture: what is wrong and what to do, in words.

use handeye_capture::{NO_IMAGES_S, Refusal, RobotRate};

use handeye_detect::EdgeBlur;
use handeye_detect::VisionError;
use handeye_geometry::targets::TargetSpec;

use crate::capture::state::RefusalKind;
use crate::text::Text;
use handeye_wording::text;

/// Kind and words.
pub type Why = (RefusalKind, Text);

/// Why no images came together.
pub(crate) fn of_machine(refusal: &Refusal) -> Why {
    match refusal {
        Refusal::RobotMoves { after_s, rate } => {
            let seconds = format!("{after_s:.0}");
            let degrees = |rad_s: f64| format!("{:.2}", rad_s.to_degrees());
            let why = match *rate {
                RobotRate::Joint(rad_s) => text!(
                    "The robot still moves after {seconds} s: a joint turns at {rate}°/s. Let it come to rest and capture again",
                    seconds = seconds,
                    rate = degrees(rad_s)
                ),
                RobotRate::Tip { m_s, rad_s } => text!(
                    "The robot still moves after {seconds} s: the tip moves at {speed} mm/s and turns at {rate}°/s. Let it come \
                     to rest and capture again",
                    seconds = seconds,
                    speed = format!("{:.2}", m_s * 1e3),
                    rate = degrees(rad_s)
                ),
            };
            (RefusalKind::NotSettled, why)
        }
        Refusal::ImageChanges { after_s } => {
            let why = text!(
                "The robot stands, but the image still changes after {seconds} s: keep moving things and flickering light \
                 out of view and capture again",
                seconds = format!("{after_s:.0}")
            );
            (RefusalKind::NotSettled, why)
        }
        Refusal::Paused => {
            let why = text!(
                "No simulated time has passed for {seconds} s: the simulation is paused, or another client holds it. Let it go on and capture again",
                seconds = NO_IMAGES_S
            );
            (RefusalKind::Paused, why)
        }
        Refusal::NoImages => {
            let why = text!(
                "No images have come for {seconds} s: check the connection to the camera and capture again",
                seconds = NO_IMAGES_S
            );
            (RefusalKind::NoImages, why)
        }
        Refusal::TooSimilar(similar) => {
            let why = text!(
                "Capture {id} was taken only {distance} mm and {angle}° from here and adds no information: move or \
                 turn further and capture again",
                id = similar.id,
                distance = format!("{:.1}", similar.distance_m * 1e3),
                angle = format!("{:.1}", similar.angle_rad.to_degrees())
            );
            (RefusalKind::TooSimilar, why)
        }
    }
}

/// The board is not in the image.
pub fn no_board(target: &TargetSpec) -> Why {
    let grid = target.grid();
    let why = text!(
        "The board was not found: bring all its {columns}×{rows} points into the image, without reflections, and check \
         that the target is set to the board that is there",
        columns = grid.columns,
        rows = grid.rows
    );
    (RefusalKind::NoBoard, why)
}

/// Images arrive, but the robot's pose is not known, for this reason.
pub fn no_pose(why: Option<&Text>) -> Why {
    let why = match why {
        Some(why) => text!("The robot's pose for the image is not known: {why}", why = why.clone()),
        None => text!("The robot's pose for the image is not known"),
    };
    (RefusalKind::NoImages, why)
}

/// The image could not be searched at all.
pub(crate) fn not_searched(error: &VisionError) -> Why {
    (RefusalKind::NoBoard, text!("The board cannot be looked for: {why}", why = error))
}

/// No target is configured.
pub fn no_target() -> Why {
    (RefusalKind::NoBoard, text!("No board is chosen: choose the target and capture again"))
}

/// The image is not sharp enough.
pub fn blurred(blur: &EdgeBlur) -> Why {
    let why = text!(
        "The image is blurred: the board's edges are {edge} px wide, its squares {square} px. Focus the camera, or go \
         closer if the squares are small, and capture again",
        edge = format!("{:.1}", blur.edge_width_px()),
        square = format!("{:.0}", blur.square_px)
    );
    (RefusalKind::Blurred, why)
}

/// The user no longer wants it.
pub fn cancelled() -> Why {
    (RefusalKind::Cancelled, text!("The capture was cancelled"))
}

/// A newer one takes its place.
pub(crate) fn another_capture() -> Why {
    (RefusalKind::Cancelled, text!("The capture was replaced by a newer one"))
}

/// It would have been measured on another board.
pub(crate) fn other_target() -> Why {
    (RefusalKind::Cancelled, text!("The target was changed: capture again"))
}
