use handeye_plan::guided::GuidedOptions;
use handeye_plan::guided::by_hand::{Deviation, Judged};
use nalgebra::Vector2;

use super::section::{begin_ui, progress_ui};
use crate::testing::driven::Driven;
use handeye_workbench::by_hand;
use handeye_workbench::by_hand::state::{ByHand, HandWaits};
use handeye_workbench::command::Command;
use handeye_workbench::model::Model;
use handeye_workbench::testing::sample;
use handeye_workbench::text::Language;

fn pane(model: Model) -> Driven {
    Driven::new(
        |ui, model, outbox| match &model.by_hand {
            Some(hand) => progress_ui(ui, model, hand, outbox),
            None => begin_ui(ui, model, None, 30.0, outbox),
        },
        model,
    )
}

fn ready() -> Model {
    let mut model = sample::solved();
    model.board_seen_s = Some(model.now_s);
    model
}

fn led(waits: HandWaits, judged: Option<Judged>) -> Model {
    let mut model = ready();
    let hand = ByHand { judged, ..ByHand::new(GuidedOptions::default(), waits, 0.0) };
    model.by_hand = Some(Box::new(hand));
    model
}

fn deviation() -> Deviation {
    Deviation {
        shift: Vector2::zeros(),
        distance_m: 0.4,
        distance_ratio: 1.0,
        tilt_rad: Vector2::new(0.4, 0.0),
        roll_rad: 0.0,
    }
}

#[test]
fn it_begins_with_the_board_in_view_and_needs_no_arm_that_is_driven() {
    let mut model = ready();
    model.cell.iter_mut().for_each(|cell| cell.arm = None);
    assert_eq!(pane(model).click("Guide me"), [Command::ByHand(by_hand::Command::Guide)]);
    let mut unseen = sample::connected();
    unseen.board_seen_s = None;
    assert!(!pane(unseen).is_enabled("Guide me"), "there is no board to begin with");
}

#[test]
fn what_to_change_is_said_and_a_view_can_be_skipped() {
    let judged = Judged { present: None, deviation: Some(deviation()), is_good: false };
    let mut leading = pane(led(HandWaits::View, Some(judged)));
    assert!(leading.sees("Tilt by 23°: the lower side of the board away"));
    assert_eq!(leading.click("Skip this view"), [Command::ByHand(by_hand::Command::SkipView)]);
    assert_eq!(leading.click("Stop guiding"), [Command::ByHand(by_hand::Command::StopGuiding)]);
    assert!(leading.nothing_is_cut_off());
    assert!(pane(led(HandWaits::View, Some(Judged { is_good: true, ..judged }))).sees("Good: hold still"));
    assert!(pane(led(HandWaits::View, None)).sees("The board is not seen"));
    assert!(!pane(led(HandWaits::Capture, None)).is_enabled("Skip this view"), "the capture is under way");
    let mut chinese = led(HandWaits::View, Some(judged));
    chinese.view.language = Language::Chinese;
    assert!(pane(chinese).sees("倾斜 23°：标定板下侧远离相机"));
}
