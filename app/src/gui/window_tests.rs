use egui::vec2;
use egui_kittest::kittest::Queryable as _;

use super::*;
use crate::command::Event;
use crate::gui::testing::{Silent, connected, frame, robot};
use crate::model::{CellSource, ImagePoint, Link, LinkState, Pane, RotationFormat, Simulation, Step};
use crate::text::Language;

#[test]
fn every_state_of_the_connection_says_what_goes_on() {
    let mut built_in = Silent::new(CellSource::BuiltIn);
    built_in.links(&LinkState::StartingCell { why: None });
    assert!(built_in.sees("Starting the built-in cell…"));
    built_in.links(&LinkState::Failed { why: "no scene".to_owned() });
    assert!(built_in.sees("The built-in cell did not start"));
    assert!(built_in.sees("No scene."));
    built_in.links(&connected());
    assert!(built_in.sees("Connected to the built-in cell"));
    assert!(built_in.sees("Waiting for the first picture…"));

    let mut remote = Silent::new(CellSource::Address("tcp://sim:23000".to_owned()));
    let why = Some("nothing answers".to_owned());
    remote.links(&LinkState::Searching { address: "tcp://sim:23000".to_owned(), attempt: 3, why });
    assert!(remote.sees("Searching for tcp://sim:23000…"));
    assert!(remote.sees("Try 3. Nothing answers."));
}

#[test]
fn a_lost_connection_says_since_when_and_why_and_keeps_the_last_picture() {
    let mut silent = Silent::live();
    let why = "the cable is out".to_owned();
    let lost = LinkState::Lost { since_s: 88.0, why: why.clone(), attempt: 0 };
    silent.absorb(Event::Link { link: Link::Camera, state: lost });
    assert!(silent.sees("Camera connection lost 12 s ago"));
    assert!(silent.sees("The cable is out."));
    assert!(silent.harness.query_by_label("Colour picture").is_some());
    let retrying = LinkState::Retrying { since_s: 88.0, why: why.clone(), attempt: 2 };
    silent.absorb(Event::Link { link: Link::Camera, state: retrying });
    assert!(silent.sees("retrying"));
    let later = LinkState::Lost { since_s: 95.0, why, attempt: 0 };
    silent.absorb(Event::Link { link: Link::Control, state: later });
    assert!(silent.sees("Connection lost 12 s ago"), "the first loss counts");
}

#[test]
fn the_pixel_under_the_pointer_is_read_from_both_pictures() {
    for name in ["Colour picture", "Depth picture"] {
        let mut silent = Silent::live();
        assert!(silent.sees("Point at a picture"));
        // In the middle of pixel (20, 30): a swap of the axes or an offset of half a pixel shows.
        let picture = silent.harness.get_by_label(name).rect();
        let part = vec2(20.5 / 64.0, 30.5 / 48.0);
        silent.harness.hover_at(picture.min + part * picture.size());
        silent.steps();
        let point = silent.app().model().cursor.expect("a pixel is pointed at");
        assert_eq!(point, ImagePoint { column: 20, row: 30 });
        let (column, row) = (point.column, point.row);
        assert!(silent.sees(&format!("Pixel {column}, {row}")));
        assert!(silent.sees(&format!("RGB {column} {row} 200")));
        assert!(silent.sees(&format!("Depth {:.3} m", 0.5 + 0.01 * column as f32)));
        silent.harness.hover_at(egui::pos2(5.0, 5.0));
        silent.steps();
        assert_eq!(silent.app().model().cursor, None);
    }
}

#[test]
fn a_pixel_without_surface_has_no_made_up_depth() {
    let mut silent = Silent::live();
    silent.app().apply(Command::PointAt(Some(ImagePoint { column: 0, row: 0 })));
    // Before the next frame of the window takes the pointer away again.
    silent.harness.step();
    assert!(silent.sees("Depth over 3.50 m"));
}

#[test]
fn the_robot_is_shown_in_millimetres_and_degrees() {
    let mut silent = Silent::live();
    assert!(silent.sees("Tip in base, x y z [mm]: 110.0 −16.0 847.0"));
    assert!(silent.sees("Tip in base, roll pitch yaw [deg]: 0.00 0.00 0.00"));
    assert!(silent.sees("Joints 1 to 6 [deg]: 0.0 45.0 −57.3 0.0 0.0 0.0"));
    assert!(silent.sees("Simulation: 12.35 s"));
    assert!(silent.sees("Dropped: 7"));
    silent.harness.get_by_label("quat").click();
    silent.steps();
    assert_eq!(silent.app().model().view.rotation, RotationFormat::Quaternion);
    assert!(silent.sees("Tip in base, quaternion x y z w: 0.0000 0.0000 0.0000 1.0000"));
}

#[test]
fn stop_is_one_click_away_in_every_state() {
    let mut silent = Silent::new(CellSource::BuiltIn);
    for prepare in [LinkState::StartingCell { why: None }, connected()] {
        silent.links(&prepare);
        silent.harness.get_by_label("STOP").click();
        silent.steps();
        assert!(silent.app().model().stop_pending);
        assert!(silent.sees("STOPPING…"));
        silent.absorb(Event::Stopped);
    }
}

#[test]
fn the_theme_is_switched_and_remembered() {
    let mut silent = Silent::live();
    assert!(silent.harness.ctx.global_style().visuals.dark_mode);
    silent.harness.get_by_label("Light theme").click();
    silent.steps();
    assert!(!silent.harness.ctx.global_style().visuals.dark_mode);
    assert_eq!(silent.app().model().view.theme, ThemeChoice::Light);
    assert!(silent.harness.query_by_label("Dark theme").is_some());
}

#[test]
fn a_simulation_that_rests_can_be_started() {
    let mut silent = Silent::live();
    silent.absorb(Event::Robot(robot(Simulation::Stopped)));
    assert!(silent.sees("The simulation is stopped"));
    assert!(silent.harness.query_by_label("Start simulation").is_some());
    silent.absorb(Event::Robot(robot(Simulation::Running)));
    assert!(!silent.sees("The simulation is stopped"));
}

#[test]
fn a_picture_is_uploaded_once_however_often_the_window_is_drawn() {
    let mut silent = Silent::live();
    silent.harness.run_steps(10);
    assert_eq!(silent.harness.state().uploads(), 1);
    silent.absorb(frame(2));
    assert_eq!(silent.harness.state().uploads(), 2);
}

#[test]
fn pictures_that_no_longer_come_are_not_counted_as_a_frame_rate() {
    let mut silent = Silent::live();
    assert!(silent.sees("20 fps"));
    let Event::Frame { mut info, dropped, images } = frame(2) else { unreachable!() };
    info.received_s = 95.0;
    silent.absorb(Event::Frame { info, dropped, images });
    assert!(silent.sees("no new pictures"));
    assert!(silent.sees("Image age: 5.0 s"));
}

#[test]
fn nothing_is_cut_off_at_the_smallest_size() {
    let size = vec2(1024.0, 700.0);
    let mut silent = Silent::of_size(CellSource::BuiltIn, size);
    silent.links(&connected());
    silent.absorb(Event::Robot(robot(Simulation::Running)));
    silent.absorb(frame(1));
    silent.app().apply(Command::SetRotationFormat(RotationFormat::Quaternion));
    silent.steps();
    for label in ["STOP", "Light theme", "Dropped: 7", "Full range", "Colour picture", "Depth picture"] {
        let rect = silent.harness.get_by_label(label).rect();
        assert!(rect.min.x >= 0.0 && rect.max.x <= size.x && rect.max.y <= size.y, "{label}: {rect:?}");
    }
}
