//! Findings in the language of the window.
//!
//! The core says a finding in English. A sentence of the catalogue that reads the same gives its values, and with them
//! the translation; a sentence that no catalogue has is shown as the core says it. So a finding is never said with
//! other numbers or with less than the core says.

mod decided;
mod diagnosed;

use handeye_core::findings::{Finding, FindingCode};

use crate::text::{Language, Text, Value};
use crate::tr;

/// A finding that can be said in every language.
pub fn of(finding: &Finding) -> Text {
    let said = finding.text.as_str();
    let templates = templates(finding.code);
    let whole = |said: &str| templates.iter().find_map(|template| matched(template, said));
    whole(said).or_else(|| beside(said, whole)).unwrap_or_else(|| Text::verbatim(said))
}

/// A finding that ends with saying that another one explains as much.
fn beside(said: &str, whole: impl Fn(&str) -> Option<Text>) -> Option<Text> {
    const FINDING: &str = "{finding}";
    let template = tr!(Language::English, "{finding} What else was found explains much the same: check both.");
    let finding = whole(said.strip_suffix(template.strip_prefix(FINDING)?)?)?;
    Some(Text::new(template, vec![("finding", Value::Text(finding))]))
}

fn templates(code: FindingCode) -> Vec<&'static str> {
    let en = Language::English;
    match code {
        FindingCode::TooFewViews => vec![
            tr!(en, "{views} views of the target: a calibration takes {need} at the least. Capture more poses."),
            tr!(en, "{views} view of the target: a calibration takes {need} at the least. Capture more poses."),
            tr!(
                en,
                "{views} views of the target: enough for an answer, few for the noise levels on which its stated \
                 uncertainty rests. Capture {need} or more."
            ),
        ],
        FindingCode::TargetNotFound => vec![tr!(
            en,
            "The target was not found in {count} of {of} views ({list}). Look at these pictures: is it wholly in view, \
             sharp and lit, and are its columns and rows right?"
        )],
        FindingCode::ViewsAlike => vec![tr!(
            en,
            "The views are all alike: the tip turned by no more than {largest}° between any two. Turn it by 30° and more \
             to all sides about two axes, with the board in view."
        )],
        FindingCode::OneRotationAxis => vec![tr!(
            en,
            "All turns are about the same axis of the tip, {axis}, within {spread}°: the camera's place along it cannot \
             be seen. Add views turned by 30° about an axis across it."
        )],
        FindingCode::WeakRotation => vec![tr!(
            en,
            "The tip turned by {strongest}° (RMS between views) about its axis {axis}, but by only {second}° and \
             {weakest}° about the axes across it. Add views turned by 30° to both sides, most of all about {weak}."
        )],
        FindingCode::LittleTilt => vec![tr!(
            en,
            "The board was never tilted by more than {largest}° against the camera, and the focal length is known to \
             {sigma} % (one standard deviation). Add views with the board tilted by 30° to 45°."
        )],
        FindingCode::PoorCoverage => vec![tr!(en, "The board covered {covered} % of the image; {where}. {why}.")],
        FindingCode::InfluentialView => vec![tr!(
            en,
            "View {view} alone moves the answer by {influence} mm; the median view moves it by {median} mm. Check its \
             picture and its robot pose, or add views like it so that it does not stand alone."
        )],
        FindingCode::LargeResidual => vec![tr!(
            en,
            "The corners of view {view} fit with {rms} px, those of the median view with {median} px. Look at its \
             picture for blur, reflections and wrong corners; leave it out if there are any."
        )],
        FindingCode::LargeCorrection => vec![tr!(
            en,
            "The robot pose of view {view} had to be corrected by {mm} mm and {deg}°, the median by {median_mm} mm and \
             {median_deg}°. The arm may have moved when the picture was taken, or the board has; leave the view out or \
             capture it again."
        )],
        FindingCode::PoorPrediction => vec![tr!(
            en,
            "Views left out of the fit are predicted to {heldout} px, where robot and corner noise explain {expected} \
             px. The model misses something: a wrong view, a board that is bent or not of the stated size, too few views \
             for so many unknowns, or robot errors that depend on the pose. Capture more views and check those that \
             stand out."
        )],
        FindingCode::RobotNoise => vec![tr!(
            en,
            "The robot limits the answer: its noise of {mm} mm and {deg}° per axis moves corners by {robot} px, their \
             own noise is {corner} px. Better pictures will not help much; more views, and settling longer before each, \
             will."
        )],
        FindingCode::ClosedFormsDisagree => {
            vec![tr!(en, "Closed forms differ from the middle of all: {list}. {advice}")]
        }
        FindingCode::GoalReached => vec![tr!(
            en,
            "Good enough: the expected error of {error} mm (95 %) is below the goal of {goal} mm. Verify with captures \
             that were not in the fit."
        )],
        FindingCode::GoalNotReached => {
            vec![tr!(en, "The expected error of {error} mm (95 %) is above the goal of {goal} mm. {advice}")]
        }
        other => [decided::templates(other), diagnosed::templates(other)].concat(),
    }
}

/// Parts of sentences that are translated as well; whole ones first.
fn parts() -> impl Iterator<Item = &'static str> {
    decided::parts().into_iter().chain(diagnosed::parts()).chain(common_parts())
}

fn common_parts() -> [&'static str; 21] {
    let en = Language::English;
    [
        tr!(en, "it is seen in patches"),
        tr!(en, "nothing was seen at the {places}"),
        tr!(en, "The intrinsics are given, so this matters little"),
        tr!(en, "Bring the board there: the lens is only known where it was seen"),
        tr!(en, "Most of them do, so the views determine the answer weakly: add views with more tilt and turn."),
        tr!(en, "The others agree; these weigh noise badly and are for comparison only."),
        tr!(en, "About {more} more views like those gathered will reach it."),
        tr!(en, "About {more} more view like those gathered will reach it."),
        tr!(
            en,
            "More views like these would take too many: tilt and turn the camera more, come closer, or reduce the noise."
        ),
        tr!(en, "top left"),
        tr!(en, "top right"),
        tr!(en, "top"),
        tr!(en, "left"),
        tr!(en, "middle"),
        tr!(en, "right"),
        tr!(en, "bottom left"),
        tr!(en, "bottom right"),
        tr!(en, "bottom"),
        tr!(en, "{names} and {more} more"),
        tr!(en, "{first}, {rest}"),
        tr!(en, "{method} by {distance} mm"),
    ]
}

/// The template filled so that it reads as `said`; `None` when it cannot.
fn matched(template: &'static str, said: &str) -> Option<Text> {
    let (start, mut places) = template.split_at(template.find('{').unwrap_or(template.len()));
    let mut rest = said.strip_prefix(start)?;
    let mut values = Vec::new();
    while let Some((name, after)) = places.strip_prefix('{').and_then(|inside| inside.split_once('}')) {
        let (literal, next) = after.split_at(after.find('{').unwrap_or(after.len()));
        let (value, left) = if next.is_empty() { (rest.strip_suffix(literal)?, "") } else { rest.split_once(literal)? };
        values.push((name, part(value)));
        (rest, places) = (left, next);
    }
    rest.is_empty().then(|| Text::new(template, values))
}

fn part(said: &str) -> Value {
    parts().find_map(|template| matched(template, said)).map_or_else(|| Value::from(said), Value::Text)
}
