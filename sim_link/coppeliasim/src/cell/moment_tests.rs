//! Frames of cells that report the moment of their images, and of others.

use super::*;

fn calls(cell: &Cell, function: &str) -> usize {
    cell.camera.functions().iter().filter(|called| *called == function).count()
}

fn shown() -> Vec<(&'static str, Value)> {
    vec![
        ("sim_time", Value::Float(0.95)),
        ("joints", wire::floats([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])),
        ("tip", wire::floats([0.3, 0.2, 0.1, 0.0, 0.0, 0.0, 1.0])),
        ("base_from_target", wire::floats([0.0, -0.4, 0.8, 0.0, 0.0, 0.0, 1.0])),
    ]
}

fn cell_that_tells(moment: Option<Value>) -> Cell {
    let world = world();
    edit(&world, |w| {
        w.truth = Some(wire::map([]));
        w.moment = moment;
    });
    cell(world)
}

#[test]
fn a_frame_of_a_built_in_cell_has_all_of_the_pass_that_its_images_show() {
    let mut cell = cell_that_tells(Some(wire::map(shown())));
    let frame = cell.client.camera().grab().expect("a frame");
    assert_eq!((frame.sim_time_s, frame.joints), (0.95, [0.1, 0.2, 0.3, 0.4, 0.5, 0.6].into()));
    assert_eq!(frame.base_from_tip.translation(), Vector3::new(0.3, 0.2, 0.1));
    assert_eq!(frame.base_from_target_true.map(|pose| pose.translation()), Some(Vector3::new(0.0, -0.4, 0.8)));
    assert_eq!(calls(&cell, "sim.getJointPosition"), 0, "one call instead of eight");
}

#[test]
fn before_the_first_pass_a_frame_has_the_present_state() {
    let mut cell = cell_that_tells(Some(wire::map([])));
    let frame = cell.client.camera().grab().expect("a frame");
    assert_eq!((frame.sim_time_s, frame.base_from_target_true), (1.0, None));
    cell.client.camera().grab().expect("a frame");
    assert_eq!(calls(&cell, "handeye.moment"), 2, "the next one may be there");
}

#[test]
fn a_cell_that_cannot_tell_is_asked_once() {
    let mut cell = cell_that_tells(None);
    assert!(cell.client.info().is_handeye_cell);
    for _ in 0..2 {
        assert_eq!(cell.client.camera().grab().expect("a frame").sim_time_s, 1.0);
    }
    assert_eq!(calls(&cell, "handeye.moment"), 1);
}

#[test]
fn coppeliasim_is_not_asked_what_its_images_show() {
    let mut cell = cell(world());
    cell.client.camera().grab().expect("a frame");
    assert_eq!(calls(&cell, "handeye.moment"), 0);
}

#[test]
fn an_image_that_another_client_moved_the_arm_after_is_taken_again() {
    let mut cell = cell(world());
    edit(&cell.world, |w| w.moved_when_handled = 2);
    let frame = cell.client.camera().grab().expect("a frame");
    assert_eq!(cell.world().handled, 3);
    assert_eq!(cell.world().held, 0);
    let there = cell.world().base_from_tip;
    assert_eq!((frame.base_from_tip, frame.image_age_s), (there, 0.0));
    edit(&cell.world, |w| w.moved_when_handled = u32::MAX);
    assert_eq!(cell.client.camera().grab(), Err(LinkError::MixedInstants { attempts: 10 }));
    assert_eq!(cell.world().held, 0);
}

#[test]
fn a_moment_that_cannot_be_computed_with_is_an_error_and_leaves_nothing_held() {
    let bad = [("joints", wire::floats([0.0; 5])), ("tip", wire::floats([0.0; 7])), ("tip", Value::from("here"))];
    for (key, value) in bad {
        let fields = shown().into_iter().map(|(name, old)| (name, if name == key { value.clone() } else { old }));
        let mut cell = cell_that_tells(Some(wire::map(fields.collect::<Vec<_>>())));
        assert!(matches!(cell.client.camera().grab(), Err(LinkError::BadTruth { .. })));
        assert_eq!(cell.world().held, 0);
    }
}

#[test]
fn a_server_without_a_board_to_move_is_told_from_one_that_refuses() {
    let mut cell = cell(world());
    let moved = cell.client.arm().move_board(&BoardMotion::along(BoardPath::Circle, 0.1));
    let shown = cell.client.arm().show_board(false);
    for (outcome, name) in [(moved, "handeye.moveBoard"), (shown, "handeye.showBoard")] {
        assert!(matches!(outcome, Err(LinkError::Unsupported { call, .. }) if call == name));
    }
}
