//! What the estimate decided by itself, and the direction that it knows worst.

use handeye_core::findings::FindingCode;

use crate::text::Language;
use crate::tr;

pub(super) fn templates(code: FindingCode) -> Vec<&'static str> {
    let en = Language::English;
    match code {
        FindingCode::OutlierView => vec![
            tr!(
                en,
                "{count} views set aside, the answer is without: {list} ({how_far}). The arm may still have moved, the \
                 board may have been touched, or another pose was written down; capture again, or keep all views to see \
                 the difference."
            ),
            tr!(
                en,
                "{count} view set aside, the answer is without: {list} ({how_far}). The arm may still have moved, the \
                 board may have been touched, or another pose was written down; capture again, or keep all views to see \
                 the difference."
            ),
        ],
        FindingCode::OutlierCorners => vec![
            tr!(
                en,
                "{count} corners set aside, far from where the rest of the view puts them: in {list}. Look for \
                 reflections and things in front of the target."
            ),
            tr!(
                en,
                "{count} corner set aside, far from where the rest of the view puts them: in {list}. Look for reflections \
                 and things in front of the target."
            ),
        ],
        FindingCode::Renumbered => vec![tr!(
            en,
            "The target looks the same from both ends, and was counted from the other end in {list} to agree with the \
             rest. A target with an odd sum of inner corners, or a ChArUco board, has no such choice."
        )],
        FindingCode::BoardBent => vec![tr!(
            en,
            "The target is bent by {x} ± {x_sigma} mm along x and {y} ± {y_sigma} mm along y (middle against edges, one \
             standard deviation). The answer allows for it; fix the target to a flat plate for a better one."
        )],
        FindingCode::UncertaintyWidened => vec![tr!(
            en,
            "The stated uncertainty is {times} times what independent noise explains, because {why}. It counts what the \
             data show; more poses in other places of the workspace help more than many in one."
        )],
        FindingCode::NoiseUnclear => vec![tr!(
            en,
            "Robot and corner noise can hardly be told apart: the robot's {mm} mm is known to ± {mm_percent} % and its \
             {deg}° to ± {deg_percent} %. The expected error allows for it. More views, or better pictures, tell them \
             apart."
        )],
        FindingCode::WeakDirection => vec![tr!(
            en,
            "The weakest direction of the answer is {what}: {size} (one standard deviation), {ratio} times the best. Add \
             views turned by 30° and more to both sides about {across}."
        )],
        _ => Vec::new(),
    }
}

pub(super) fn parts() -> [&'static str; 18] {
    let en = Language::English;
    [
        tr!(en, "its corners are no image of the target"),
        tr!(en, "the target is up to {mm} mm and {deg}° from where the other views put it"),
        tr!(en, "the robot is off in the same direction in neighbouring poses"),
        tr!(en, "the answer moves too far without views that follow each other"),
        tr!(en, "the answer moves too far without neighbouring poses"),
        tr!(en, "two halves of the views disagree by more than stated"),
        tr!(en, "the answer moves too far without single views"),
        tr!(en, "views left out are predicted worse than stated"),
        tr!(en, "the camera's turn about {axis}"),
        tr!(en, "the place of what it sees along {axis}"),
        tr!(en, "±{deg}°, which is {mm} mm at the board"),
        tr!(en, "the axis {axis} of the camera"),
        tr!(en, "the camera's x axis (right)"),
        tr!(en, "the camera's y axis (down)"),
        tr!(en, "the camera's line of sight"),
        tr!(en, "the camera's y axis and its line of sight"),
        tr!(en, "the camera's x axis and its line of sight"),
        tr!(en, "the camera's x and y axes"),
    ]
}
