//! How the viewer is arranged in each step of the workflow.

use handeye_estimate::handeye::Mode;
use rerun::blueprint::components::PanelState;
use rerun::blueprint::{
    Blueprint, ContainerLike, Horizontal, SelectionPanel, Spatial2DView, Spatial3DView, Tabs, TextDocumentView,
    TextLogView, TimePanel, TimeSeriesView, Vertical,
};

use super::scene::paths;
use handeye_workbench::model::Step;

/// What is shown. Nothing is in front that has nothing to show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Arranged {
    /// The step of the workflow.
    pub step: Step,
    /// Whether the camera is next to the robot (eye to hand), and not on its tip.
    pub is_eye_to_hand: bool,
    /// Whether there are joints.
    pub has_joints: bool,
}

/// The arrangement for a step. Steps before the first capture share that of capturing, exporting that of solving.
pub fn of(arranged: Arranged) -> Blueprint {
    match arranged.step {
        Step::Connect | Step::Target | Step::Capture => capture(arranged),
        Step::Solve | Step::Export => solve(arranged),
        Step::Verify => verify(arranged),
        Step::Track => track(arranged),
    }
}

/// Live: what robot and camera do now.
fn capture(arranged_for: Arranged) -> Blueprint {
    let right = Vertical::new([
        Tabs::new([live_image("Camera", arranged_for)]).into(),
        Tabs::new(joints_and_log(arranged_for)).into(),
    ])
    .with_row_shares(vec![2.0, 1.0]);
    arranged(cell("Cell", &[]), right.into(), paths::SIM_TIMELINE)
}

/// Capture by capture: how the answer was obtained.
fn solve(arranged_for: Arranged) -> Blueprint {
    let images = [live_image("Image of the capture", arranged_for), selected_image()];
    let right = Vertical::new([
        Tabs::new(images).into(),
        Tabs::new([
            report(),
            plot("Residuals [px]", "plots/residual"),
            plot("Expected error [mm]", paths::PLOT_EXPECTED),
        ])
        .into(),
    ]);
    let cell = cell("Captures and board", &["- /base/track/**", "- /base/points"]);
    arranged(cell, right.into(), paths::CAPTURE_TIMELINE)
}

/// Where the calibration predicts the board, compared with where it is seen.
fn verify(arranged_for: Arranged) -> Blueprint {
    let images = [live_image("Prediction in the live image", arranged_for), selected_image()];
    let right = Vertical::new([
        Tabs::new(images).into(),
        Tabs::new([plot("Residuals [px]", "plots/residual"), report(), log()]).into(),
    ]);
    let cell = cell("Cell and predicted boards", &["- /base/track/**", "- /base/points"]);
    arranged(cell, right.into(), paths::SIM_TIMELINE)
}

/// The board as it moves.
fn track(arranged_for: Arranged) -> Blueprint {
    let right = Vertical::new([
        Tabs::new([live_image("Camera", arranged_for)]).into(),
        plots("Position [mm]", &[paths::PLOT_TRACK_ERROR, paths::PLOT_TRACK_SIGMA]),
        plots("From image to pose [ms]", &[paths::PLOT_LATENCY]),
        Tabs::new(joints_and_log(arranged_for)).into(),
    ]);
    arranged(cell("Tracking", &["- /base/captures/**"]), right.into(), paths::SIM_TIMELINE)
}

fn arranged(left: ContainerLike, right: ContainerLike, timeline: &str) -> Blueprint {
    Blueprint::new(Horizontal::new([left, right]).with_column_shares(vec![3.0, 2.0]))
        .with_auto_views(false)
        .with_auto_layout(false)
        .with_time_panel(TimePanel::new().with_state(PanelState::Collapsed).with_timeline(timeline))
        .with_selection_panel(SelectionPanel::from_state(PanelState::Collapsed))
}

/// Everything with a place, except what the step does not need.
fn cell(name: &str, without: &[&str]) -> ContainerLike {
    // The points that a viewer derives from a depth image reach to the far plane, and hide the arm in front of them.
    let depths = LENSES.map(|mode| format!("- /{}/{}", lens(mode), paths::DEPTH));
    let contents =
        ["+ $origin/**", "- /plots/**", "- /selected/**"].iter().chain(without).map(|query| (*query).to_owned());
    Spatial3DView::new(name).with_origin("/").with_contents(contents.chain(depths)).into()
}

/// Where a camera may be.
const LENSES: [Mode; 2] = [Mode::EyeInHand, Mode::EyeToHand];

fn lens(mode: Mode) -> String {
    paths::below(paths::camera(mode), paths::LENS)
}

/// The live image, of the camera on the tip or next to the robot (eye to hand).
fn live_image(name: &str, Arranged { is_eye_to_hand, .. }: Arranged) -> ContainerLike {
    let mode = if is_eye_to_hand { Mode::EyeToHand } else { Mode::EyeInHand };
    let no_depth = format!("- /{}/{}", lens(mode), paths::DEPTH);
    Spatial2DView::new(name).with_origin(lens(mode)).with_contents(["+ $origin/**".to_owned(), no_depth]).into()
}

/// What the robot does, if that is known, and what was reported.
fn joints_and_log(Arranged { has_joints, .. }: Arranged) -> impl Iterator<Item = ContainerLike> {
    let joints = has_joints.then(|| plot("Joints", paths::PLOT_JOINTS));
    joints.into_iter().chain([log()])
}

fn selected_image() -> ContainerLike {
    Spatial2DView::new("Selected capture").with_origin(paths::SELECTED).into()
}

fn plot(name: &str, origin: &str) -> ContainerLike {
    TimeSeriesView::new(name).with_origin(origin).into()
}

fn plots(name: &str, series: &[&str]) -> ContainerLike {
    let contents = series.iter().map(|path| format!("+ /{path}"));
    TimeSeriesView::new(name).with_origin("/").with_contents(contents).into()
}

fn report() -> ContainerLike {
    TextDocumentView::new("Report").with_origin(paths::REPORT).into()
}

fn log() -> ContainerLike {
    TextLogView::new("Log").with_origin(paths::LOG).into()
}

#[cfg(test)]
mod tests {
    use rerun::RecordingStreamBuilder;
    use rerun::blueprint::BlueprintActivation;
    use rerun::log::LogMsg;

    use super::*;

    #[test]
    fn every_step_has_an_arrangement_that_a_viewer_is_told_to_take() {
        for step in Step::ALL {
            let (rec, storage) = RecordingStreamBuilder::new("handeye-workbench").memory().expect("a recording");
            let activation = BlueprintActivation { make_active: true, make_default: true };
            of(Arranged { step, is_eye_to_hand: true, has_joints: false }).send(&rec, activation).expect("sent");
            rec.flush_blocking().expect("flushed");
            let is_activation = |message: &LogMsg| matches!(message, LogMsg::BlueprintActivationCommand(_));
            assert!(storage.take().iter().any(is_activation), "{step:?}");
        }
    }
}
