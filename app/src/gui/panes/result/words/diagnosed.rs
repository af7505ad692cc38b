//! What the doctor says of a session: faults in how it was written down, and what happened while it was recorded.

use handeye_core::findings::FindingCode;

use crate::text::Language;
use crate::tr;

pub(super) fn templates(code: FindingCode) -> Vec<&'static str> {
    let en = Language::English;
    match code {
        FindingCode::NotFinite => vec![
            tr!(
                en,
                "{count} views with a pose or a corner that is not a number ({list}). Write the table anew, or leave them \
                 out."
            ),
            tr!(
                en,
                "{count} view with a pose or a corner that is not a number ({list}). Write the table anew, or leave them \
                 out."
            ),
        ],
        FindingCode::OutlierCorners => vec![tr!(
            en,
            "{wrong} of {corners} corners are not where the rest of their view puts them ({list}). Look there for \
             reflections, a covered corner or a wrong index; leave the view out or capture it again."
        )],
        FindingCode::InvertedPoses
        | FindingCode::WrongMode
        | FindingCode::WrongQuaternionOrder
        | FindingCode::WrongLengthUnit
        | FindingCode::ShiftedPoses => vec![tr!(
            en,
            "{what} So read, the board comes together within {so} mm, as stated within {given} mm (median view). {advice}"
        )],
        FindingCode::InconsistentPoses => inconsistent(),
        FindingCode::OutlierView => outliers(),
        other => changes(other),
    }
}

fn inconsistent() -> Vec<&'static str> {
    let en = Language::English;
    vec![
        tr!(
            en,
            "Robot poses and pictures contradict each other: the board comes together within {misfit} mm only, at a \
             distance of {distance} mm. Inverted poses, the other mode, millimetres, quaternion order and rows out of step \
             do not explain it. Check that the poses belong to these pictures, and the axes and angles that the poses \
             were made from."
        ),
        tr!(
            en,
            "The robot poses scatter by {mm} mm and {deg}° per axis about what the pictures say, even with what else was \
             found, more than an arm errs (below 2 mm and 0.5°). The arm may have been moving, poses and pictures may not \
             be of the same moment, or the arm's own geometry is wrong. Capture again at rest; no solver can mend it."
        ),
        tr!(
            en,
            "The robot poses scatter by {mm} mm and {deg}° per axis about what the pictures say, more than an arm errs \
             (below 2 mm and 0.5°). The arm may have been moving, poses and pictures may not be of the same moment, or \
             the arm's own geometry is wrong. Capture again at rest; no solver can mend it."
        ),
    ]
}

fn outliers() -> Vec<&'static str> {
    let en = Language::English;
    vec![
        tr!(
            en,
            "Views {list} contradict the others: the board is out by up to {mm} mm and {deg}°. {worth} The arm or the \
             board may have been moving, or the pose belongs to another picture. Leave it out and see what changes."
        ),
        tr!(
            en,
            "View {list} contradicts the others: the board is out by up to {mm} mm and {deg}°. {worth} The arm or the \
             board may have been moving, or the pose belongs to another picture. Leave it out and see what changes."
        ),
        tr!(
            en,
            "Views {list} contradict the others: the board is out by up to {mm} mm and {deg}°. {worth} The board may have \
             been read the wrong way round, or the pose belongs to another picture. Leave it out and see what changes."
        ),
        tr!(
            en,
            "View {list} contradicts the others: the board is out by up to {mm} mm and {deg}°. {worth} The board may have \
             been read the wrong way round, or the pose belongs to another picture. Leave it out and see what changes."
        ),
    ]
}

/// What differs from what was stated, or changed on the way.
fn changes(code: FindingCode) -> Vec<&'static str> {
    let en = Language::English;
    match code {
        FindingCode::WrongScale => vec![
            tr!(
                en,
                "The motion of the robot says that the target is {size} % ± {sigma} % smaller than stated. {worth} Measure \
                 the target with a ruler, over as many squares as it has."
            ),
            tr!(
                en,
                "The motion of the robot says that the target is {size} % ± {sigma} % larger than stated. {worth} Measure \
                 the target with a ruler, over as many squares as it has."
            ),
        ],
        FindingCode::BoardBent => vec![tr!(
            en,
            "The target is bent: its middle stands {x} mm (along x) and {y} mm (along y) out. {worth} Fix it to a flat \
             plate."
        )],
        FindingCode::WrongIntrinsics => vec![tr!(
            en,
            "The intrinsics given do not fit the pictures: the focal length would be {percent} % ± {sigma} % off. {worth} \
             Let them be estimated, or give those of this camera at this image size and focus."
        )],
        FindingCode::BoardMoved => vec![
            tr!(
                en,
                "The target moved before view {view}, by {mm} mm and {deg}°. {worth} Fix it and capture again, or keep \
                 only the views before or after."
            ),
            tr!(
                en,
                "The target on the tip moved before view {view}, by {mm} mm and {deg}°. {worth} Fix it and capture again, \
                 or keep only the views before or after."
            ),
        ],
        FindingCode::CameraMoved => vec![
            tr!(
                en,
                "The camera on the tip moved before view {view}, by {mm} mm and {deg}°. {worth} Fix it and capture again, \
                 or keep only the views before or after."
            ),
            tr!(
                en,
                "The camera moved before view {view}, by {mm} mm and {deg}°. {worth} Fix it and capture again, or keep \
                 only the views before or after."
            ),
        ],
        FindingCode::JointOffset => vec![tr!(
            en,
            "The zero of joint {joint} is off by {offset}° ± {sigma}°. {worth} Master the arm anew, or let the offset be \
             estimated with the calibration."
        )],
        _ => Vec::new(),
    }
}

/// Sentences that stand within others. Where several faults were made together, one follows the other;
/// what ends with more is tried first.
pub(super) fn parts() -> [&'static str; 17] {
    let en = Language::English;
    [
        tr!(
            en,
            "This explains the data {times} times better: the robot's noise goes from {mm_before} mm and {deg_before}° to \
             {mm} mm and {deg}°. Views left out are predicted to {with} mm instead of {without} mm."
        ),
        tr!(
            en,
            "This explains the data {times} times better: the robot's noise goes from {mm_before} mm and {deg_before}° to \
             {mm} mm and {deg}°."
        ),
        tr!(
            en,
            "The robot poses are the inverse of what is stated, or the camera sits on the other side (eye in hand against \
             eye to hand): both are the same equations. The camera would be {camera} m from what carries it and the board \
             {target} m. {more}"
        ),
        tr!(
            en,
            "The robot poses are the inverse of what is stated, or the camera sits on the other side (eye in hand against \
             eye to hand): both are the same equations. The camera would be {camera} m from what carries it and the board \
             {target} m."
        ),
        tr!(en, "The quaternions of the robot poses are in the order {has} and were read as {stated}. {more}"),
        tr!(en, "The quaternions of the robot poses are in the order {has} and were read as {stated}."),
        tr!(
            en,
            "The positions of the robot poses are in {has} where {stated} were stated, or the size of the target is in the \
             wrong unit."
        ),
        tr!(en, "Every picture belongs to the robot pose of the row after it."),
        tr!(en, "Every picture belongs to the robot pose of the row before it."),
        tr!(en, "Check whether the table has base_from_tip or tip_from_base, and whether the camera is on the tip."),
        tr!(
            en,
            "Check whether the table has base_from_tip or tip_from_base, and whether the camera is on the tip. {more}"
        ),
        tr!(en, "Check the order of the columns."),
        tr!(en, "Check the order of the columns. {more}"),
        tr!(en, "Check the unit of the poses and the size of the target."),
        tr!(en, "Check how pictures and poses were paired."),
        tr!(en, "millimetres"),
        tr!(en, "metres"),
    ]
}
