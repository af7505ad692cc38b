use std::collections::BTreeSet;

use egui::vec2;
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use handeye_estimate::handeye::Mode;
use handeye_geometry::targets::TargetSpec;

use super::*;
use crate::testing::{Silent, connected, frame, robot};
use handeye_workbench::command::Event;
use handeye_workbench::model::{
    CellSource, Drivers, ImagePoint, Link, LinkState, Model, Motion, MotionId, Moves, Pane, RotationFormat, Simulation,
    Step,
};
use handeye_workbench::testing::sample;
use handeye_workbench::text::{Language, Text};
use handeye_workbench::{connect, live, messages, motion, session, shell};

#[test]
fn every_state_of_the_connection_says_what_goes_on() {
    let mut built_in = Silent::new(CellSource::default());
    built_in.links(&LinkState::StartingCell { why: None });
    assert!(built_in.sees("Starting the built-in cell…"));
    built_in.links(&LinkState::Failed { why: Text::verbatim("no scene") });
    assert!(built_in.sees("The built-in cell did not start"));
    assert!(built_in.sees("No scene."));
    built_in.links(&connected());
    assert!(built_in.sees("Connected to the built-in cell"));
    assert!(built_in.sees("Waiting for the first image…"));

    let mut remote = Silent::new(CellSource::Address("tcp://sim:23000".to_owned()));
    let why = Some(Text::verbatim("nothing answers"));
    remote.links(&LinkState::Searching { address: "tcp://sim:23000".to_owned(), attempt: 3, why });
    assert!(remote.sees("Searching for tcp://sim:23000…"));
    assert!(remote.sees("Try 3. Nothing answers."));
}

#[test]
fn a_lost_connection_says_since_when_and_why_and_keeps_the_last_image() {
    let mut silent = Silent::live();
    let why = Text::verbatim("the cable is out");
    let lost = LinkState::Lost { since_s: 88.0, why: why.clone(), attempt: 0, next_s: 100.0 };
    silent.absorb(connect::Event::Link { link: Link::Camera, state: lost });
    assert!(silent.sees("Camera connection lost 12 s ago"));
    assert!(silent.sees("The cable is out."));
    assert!(silent.harness.query_by_label("Colour image").is_some());
    let retrying = LinkState::Retrying { since_s: 88.0, why: why.clone(), attempt: 2 };
    silent.absorb(connect::Event::Link { link: Link::Camera, state: retrying });
    assert!(silent.sees("retrying"));
    let later = LinkState::Lost { since_s: 95.0, why, attempt: 0, next_s: 100.0 };
    silent.absorb(connect::Event::Link { link: Link::Control, state: later });
    assert!(silent.sees("Connection lost 12 s ago"), "the first loss counts");
}

#[test]
fn a_driver_that_is_gone_says_why_and_when_it_is_started_again_and_a_person_can_have_enough() {
    let drivers = Drivers { robot: Some("python3 my_driver.py".to_owned()), camera: None };
    let mut silent = Silent::new(CellSource::Drivers(drivers));
    let why = Text::verbatim("the driver `python3 my_driver.py` ended (exit status: 1): no camera");
    let since_s = silent.app().model().now_s - 5.0;
    let next_s = since_s + 5.0 + 9.5;
    silent.links(&LinkState::Lost { since_s, why: why.clone(), attempt: 3, next_s });
    assert!(silent.sees("Connection lost 5 s ago"));
    assert!(silent.sees("ended (exit status: 1): no camera. Try 4 comes in 9 s."));
    assert!(silent.harness.query_by_label("Stop trying").is_some());
    silent.links(&LinkState::Resting { why });
    assert!(silent.sees("Not connected") && silent.sees("It is not tried again until you ask for it."));
    assert!(silent.harness.query_by_label("Try again now").is_some());
    assert!(silent.harness.query_by_label("Stop trying").is_none());
}

/// A robot behind a driver is not part of a simulator, whatever happens to it.
#[test]
fn words_of_a_simulator_stand_nowhere_behind_a_driver() {
    let drivers = Drivers { robot: Some("python3 my_driver.py".to_owned()), camera: None };
    let lost = LinkState::Lost { since_s: 90.0, why: Text::verbatim("it ended"), attempt: 1, next_s: 101.0 };
    for (is_armed, link) in [(true, connected()), (false, connected()), (true, lost)] {
        let mut silent = Silent::new(CellSource::Drivers(drivers.clone()));
        // A session of a robot has no truth to compare with.
        let mut model = sample::with_answer(|solved| solved.result.truth = None);
        model.source = CellSource::Drivers(drivers.clone());
        let cell = model.cell.as_mut().expect("connected");
        (cell.moves, cell.truth) = (Moves::OnceArmed { joints: true, tip: true }, None);
        model.robot.as_mut().expect("connected").is_armed = is_armed;
        silent.app().replace_model(model);
        silent.links(&link);
        let none_of_it = |silent: &Silent, place: &str| {
            for word in ["imulat", "CoppeliaSim"] {
                assert!(!silent.sees(word), "{word} in {place}, armed {is_armed}");
            }
        };
        // The pane that chooses a cell offers the simulator, and the pane that writes files names it as a reader.
        for pane in Pane::ALL.into_iter().filter(|pane| !matches!(pane, Pane::Connect | Pane::Export)) {
            silent.show(pane);
            if !silent.harness.state_mut().layout().is_in_front(Pane::Connect) {
                none_of_it(&silent, &format!("{pane:?}"));
            }
        }
        silent.press(egui::Modifiers::COMMAND, egui::Key::K);
        assert!(silent.sees("Stop the arm"), "the palette is open");
        none_of_it(&silent, "the palette");
    }
}

#[test]
fn the_pixel_under_the_pointer_is_read_from_both_images() {
    for name in ["Colour image", "Depth image"] {
        let mut silent = Silent::live();
        assert!(silent.sees("Point at an image"));
        // In the middle of pixel (20, 30): a swap of the axes or an offset of half a pixel shows.
        let image = silent.harness.get_by_label(name).rect();
        let part = vec2(20.5 / 64.0, 30.5 / 48.0);
        silent.harness.hover_at(image.min + part * image.size());
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
    silent.app().apply(live::Command::PointAt(Some(ImagePoint { column: 0, row: 0 })));
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
    silent.harness.get_by_label("quat").click();
    silent.steps();
    assert_eq!(silent.app().model().view.rotation, RotationFormat::Quaternion);
    assert!(silent.sees("Tip in base, quaternion x y z w: 0.0000 0.0000 0.0000 1.0000"));
}

#[test]
fn stop_is_one_click_away_in_every_state() {
    for (prepare, before, after) in [
        (LinkState::StartingCell { why: None }, "STOP cannot act", "STOP cannot act"),
        (connected(), "STOP", "STOPPING…"),
    ] {
        let mut silent = Silent::new(CellSource::default());
        silent.links(&prepare);
        silent.harness.get_by_label(before).click();
        silent.steps();
        assert!(silent.app().model().stop_pending);
        assert!(silent.sees(after));
    }
}

#[test]
fn theme_and_language_are_switched_in_the_menu_at_once() {
    let mut silent = Silent::live();
    assert!(silent.harness.ctx.global_style().visuals.dark_mode);
    for name in ["Menu", "Theme ⏵", "Light theme"] {
        silent.click(name);
    }
    assert!(!silent.harness.ctx.global_style().visuals.dark_mode);
    assert_eq!(silent.app().model().view.theme, ThemeChoice::Light);
    for name in ["Menu", "Language ⏵", "简体中文"] {
        silent.click(name);
    }
    assert_eq!(silent.app().model().view.language, Language::Chinese);
    assert!(silent.sees("标定板") && !silent.sees("Poses"));
}

#[test]
fn a_simulation_that_rests_can_be_started() {
    let mut silent = Silent::live();
    silent.absorb(connect::Event::Robot(robot(Simulation::Stopped)));
    assert!(silent.sees("The simulation is stopped"));
    assert!(silent.harness.query_by_label("Start simulation").is_some());
    silent.absorb(connect::Event::Robot(robot(Simulation::Running)));
    assert!(!silent.sees("The simulation is stopped"));
}

#[test]
fn an_image_is_uploaded_once_however_often_the_window_is_drawn() {
    let mut silent = Silent::live();
    silent.harness.run_steps(10);
    assert_eq!(silent.harness.state().uploads(), 1);
    silent.absorb(frame(2));
    assert_eq!(silent.harness.state().uploads(), 2);
}

#[test]
fn images_that_no_longer_come_are_not_counted_as_a_frame_rate() {
    let mut silent = Silent::live();
    assert!(silent.sees("20 fps"));
    let Event::Live(live::Event::Frame { mut info, dropped, images }) = frame(2) else { unreachable!() };
    info.received_s = 95.0;
    silent.absorb(live::Event::Frame { info, dropped, images });
    assert!(silent.sees("no new images"));
    assert!(silent.sees("Image age: 5.0 s"));
}

#[test]
fn nothing_is_cut_off_at_the_smallest_size() {
    let size = vec2(1024.0, 700.0);
    let mut silent = Silent::of_size(CellSource::default(), size);
    silent.links(&connected());
    silent.absorb(connect::Event::Robot(robot(Simulation::Running)));
    silent.absorb(frame(1));
    for language in Language::ALL {
        silent.command(shell::Command::SetLanguage(language));
        silent.command(shell::Command::SetRotationFormat(RotationFormat::Quaternion));
        let tr =
            |english| handeye_workbench::text::Catalogue::translation(language, english).unwrap_or(english).to_owned();
        let mut labels: Vec<_> =
            ["STOP", "Menu", "Undo", "Redo", "Full range", "Colour image", "Depth image"].into_iter().map(tr).collect();
        labels.push(format!("{}: 0.0 s", tr("Image age")));
        labels.extend(Pane::ALL.map(|pane| crate::shell::panes::title(pane, language).to_owned()));
        for label in labels {
            let nodes: Vec<_> = silent.harness.query_all_by_label(&label).collect();
            assert!(!nodes.is_empty(), "{label} is not there");
            for node in nodes {
                let rect = node.rect();
                assert!(rect.width() > 0.0 && rect.height() > 0.0, "{label}: {rect:?}");
                let inside = rect.min.x >= 0.0 && rect.min.y >= 0.0 && rect.max.x <= size.x && rect.max.y <= size.y;
                assert!(inside, "{label}: {rect:?}");
            }
        }
    }
}

#[test]
fn every_tab_of_the_first_layout_is_wholly_seen_at_the_smallest_size() {
    let mut silent = Silent::of_size(CellSource::default(), vec2(1024.0, 700.0));
    let right = silent.harness.get_by_label("Track").rect();
    assert!(right.max.x < 1024.0 - 8.0, "{right:?}");
    silent.click("Track");
    assert!(silent.harness.state_mut().layout().is_in_front(Pane::Track));
}

#[test]
fn a_step_brings_its_panes_to_the_front_by_click_and_by_key() {
    let mut silent = Silent::live();
    let step = silent.harness.get_by_label_contains("4 Solve: blocked");
    step.click();
    silent.steps();
    for pane in [Pane::Charts, Pane::Result] {
        assert!(silent.harness.state_mut().layout().is_in_front(pane), "{pane:?}");
    }
    silent.press(egui::Modifiers::NONE, egui::Key::Num2);
    assert!(silent.harness.state_mut().layout().is_in_front(Pane::Target));
    silent.command(shell::Command::GoToStep(Step::Capture));
    assert!(silent.harness.state_mut().layout().is_in_front(Pane::Jog));
    silent.command(shell::Command::ResetLayout);
    assert!(silent.harness.state_mut().layout().is_in_front(Pane::Connect));
}

#[test]
fn esc_stops_the_arm_while_text_is_typed_and_while_a_dialog_is_open() {
    let mut silent = Silent::live();
    silent.press(egui::Modifiers::NONE, egui::Key::Escape);
    assert!(silent.app().model().stop_pending);

    silent.absorb(motion::Event::Stopped);
    silent.click("CoppeliaSim");
    silent.harness.get_by_label("Address of the cell").focus();
    silent.steps();
    assert!(silent.harness.ctx.text_edit_focused());
    silent.press(egui::Modifiers::NONE, egui::Key::Escape);
    assert!(silent.app().model().stop_pending);

    silent.absorb(motion::Event::Stopped);
    silent.command(shell::Command::SetDialog(Some(Dialog::Help)));
    assert!(silent.sees("Esc stops the arm at any time"));
    silent.press(egui::Modifiers::NONE, egui::Key::Escape);
    assert!(silent.app().model().stop_pending);
    assert!(!silent.sees("Esc stops the arm at any time"));
}

/// A connection that is lost while the arm can still be moved: for example the images alone.
#[test]
fn what_says_why_images_are_not_live_moves_nothing_that_moves_the_arm() {
    let mut silent = Silent::live();
    silent.absorb(connect::Event::Link { link: Link::Motion, state: connected() });
    for (pane, names) in
        [(Pane::Jog, ["Jog joint 1 +", "Stop"].as_slice()), (Pane::Taught, &["STOP"]), (Pane::Verify, &["STOP"])]
    {
        silent.show(pane);
        let places = |silent: &Silent| -> Vec<_> {
            names.iter().map(|name| silent.harness.get_by_label(name).rect().min).collect()
        };
        let before = places(&silent);
        let lost = LinkState::Lost { since_s: 88.0, why: Text::verbatim("gone"), attempt: 0, next_s: 100.0 };
        silent.absorb(connect::Event::Link { link: Link::Camera, state: lost });
        assert!(silent.sees("Camera connection lost 12 s ago"));
        assert_eq!(places(&silent), before, "{pane:?}");
        silent.absorb(connect::Event::Link { link: Link::Camera, state: connected() });
    }
}

#[test]
fn the_robot_is_grey_with_its_age_in_every_pane_once_it_is_not_read_any_more() {
    let mut silent = Silent::live();
    assert!(!silent.sees("last read"));
    silent.absorb(Event::Tick { now_s: 100.0 });
    let mut model = silent.app().model().clone();
    model.robot_read_s = Some(80.0);
    silent.show_model(model);
    for pane in [Pane::Scene, Pane::Jog] {
        silent.show(pane);
        // In the bar at the bottom, and in the pane.
        assert!(silent.harness.query_all_by_label_contains("last read 20 s ago").count() >= 2, "{pane:?}");
    }
    assert!(silent.sees("STOP") && !silent.sees("STOP cannot act"));
    silent.links(&LinkState::Resting { why: Text::verbatim("enough") });
    assert!(silent.sees("STOP cannot act"));
}

/// One press, one thing.
#[test]
fn esc_stops_what_is_under_way_and_leaves_open_what_is_open() {
    type Open<'a> = (&'a str, &'a dyn Fn(&mut Silent));
    let mut silent = Silent::live();
    let opened: [Open<'_>; 3] = [
        ("New session…", &|silent| silent.click("Menu")),
        ("Esc stops the arm at any time", &|silent| silent.command(shell::Command::SetDialog(Some(Dialog::Help)))),
        ("Type a command", &|silent| silent.command(shell::Command::SetDialog(Some(Dialog::Palette)))),
    ];
    for (shown, open) in opened {
        let mut model = silent.app().model().clone();
        model.motion = Motion::Moving { id: MotionId(1), what: Text::verbatim("a pose"), since_s: 100.0 };
        model.stop_pending = false;
        silent.app().replace_model(model);
        open(&mut silent);
        silent.steps();
        assert!(silent.sees(shown), "{shown}");
        silent.press(egui::Modifiers::NONE, egui::Key::Escape);
        assert!(silent.app().model().stop_pending, "{shown}");
        assert!(silent.sees(shown), "{shown}: it is closed as well");
        silent.absorb(motion::Event::Stopped);
        silent.press(egui::Modifiers::NONE, egui::Key::Escape);
        assert!(!silent.sees(shown), "{shown}: nothing is left to stop");
    }
}

#[test]
fn keys_rest_while_text_is_typed() {
    let mut silent = Silent::live();
    silent.click("CoppeliaSim");
    silent.harness.get_by_label("Address of the cell").focus();
    silent.steps();
    silent.press(egui::Modifiers::NONE, egui::Key::Num2);
    assert!(silent.harness.state_mut().layout().is_in_front(Pane::Connect));
    silent.press(egui::Modifiers::COMMAND, egui::Key::K);
    assert!(silent.harness.query_by_label("Type a command").is_none());
}

#[test]
fn a_command_is_found_by_typing_and_done_by_enter() {
    let mut silent = Silent::live();
    silent.press(egui::Modifiers::COMMAND, egui::Key::K);
    assert!(silent.harness.query_by_label("Type a command").is_some());
    silent.harness.event(egui::Event::Text("light".to_owned()));
    silent.steps();
    silent.press(egui::Modifiers::NONE, egui::Key::Enter);
    assert_eq!(silent.app().model().view.theme, ThemeChoice::Light);
    assert!(silent.harness.query_by_label("Type a command").is_none());
}

#[test]
fn the_help_lists_the_keys_that_work() {
    let mut silent = Silent::live();
    silent.press(egui::Modifiers::NONE, egui::Key::F1);
    for text in ["Stop the arm", "Esc", "Ctrl+Z", "Ctrl+Shift+Z", "Space", "Delete the selected captures", "F1"] {
        assert!(silent.sees(text), "{text}");
    }
    silent.click("Close");
    assert!(!silent.sees("Delete the selected captures"));
}

#[test]
fn an_error_stays_on_the_screen_until_it_is_put_aside_and_then_in_the_log() {
    let mut silent = Silent::live();
    let text = handeye_workbench::text::Text::verbatim("the lens cap is on");
    silent.absorb(messages::Event::Notice { severity: handeye_workbench::model::Severity::Error, text });
    assert_eq!(silent.harness.query_all_by_label("the lens cap is on").count(), 1, "below the steps and nowhere else");
    let all = silent.app().model().messages.iter().len();
    for _ in 0..all {
        if let Some(button) = silent.harness.query_all_by_label("Dismiss").next() {
            button.click();
        }
        silent.steps();
    }
    assert!(silent.harness.query_all_by_label("Dismiss").next().is_none());
    silent.show(Pane::Log);
    silent.click("Errors");
    assert_eq!(silent.harness.query_all_by_label("the lens cap is on").count(), 1, "in the log");
}

#[test]
fn an_address_is_checked_before_it_is_used() {
    let mut silent = Silent::live();
    silent.click("CoppeliaSim");
    let button = |silent: &Silent| silent.harness.get_by_label("Connect now").accesskit_node().is_disabled();
    assert!(!button(&silent), "the usual port on this machine is offered");
    silent.harness.get_by_label("Address of the cell").focus();
    silent.steps();
    silent.harness.event(egui::Event::Text("!".to_owned()));
    silent.steps();
    assert!(button(&silent));
    silent.press(egui::Modifiers::NONE, egui::Key::Backspace);
    silent.click("Connect now");
    assert_eq!(silent.app().model().addresses, ["tcp://127.0.0.1:23000"]);
}

#[test]
fn the_board_and_the_mode_are_set_in_the_target_pane() {
    let mut silent = Silent::live();
    silent.show(Pane::Target);
    assert!(silent.sees("10 × 7 corners are 11 × 8 squares"));
    silent.harness.get_by_role_and_label(egui::accesskit::Role::ComboBox, "Kind of board").click();
    silent.steps();
    silent.click("Dots");
    silent.until("dots", |model| matches!(model.document().meta.target, TargetSpec::Circles(_)));
    assert!(silent.sees("This board looks the same after half a turn"));
    silent.click("Eye to hand");
    silent.until("the mode", |model| model.document().meta.mode == Mode::EyeToHand);
    silent.click("Fixed");
    silent.until("the camera", |model| {
        model.document().meta.camera.is_some_and(|camera| camera.fixed && camera.intrinsics.is_some())
    });
    silent.harness.get_by_label("Accuracy of the intrinsics").focus();
    silent.steps();
    silent.harness.event(egui::Event::Text("0.5".to_owned()));
    silent.steps();
    silent.press(egui::Modifiers::NONE, egui::Key::Enter);
    silent.until("the accuracy", |model| {
        model.document().meta.camera.is_some_and(|camera| camera.fixed && camera.accuracy_px == Some(0.5))
    });
    silent.click("Estimate");
    silent.until("an estimate, which has an accuracy of its own", |model| {
        model.document().meta.camera.is_some_and(|camera| !camera.fixed && camera.accuracy_px.is_none())
    });
}

/// Every text that a shape shows.
fn texts(shape: &egui::Shape, found: &mut Vec<String>) {
    match shape {
        egui::Shape::Text(text) => found.push(text.galley.text().to_owned()),
        egui::Shape::Vec(shapes) => shapes.iter().for_each(|shape| texts(shape, found)),
        _ => {}
    }
}

#[test]
fn every_pane_and_dialog_shows_nothing_but_letters_that_the_fonts_have() {
    let mut silent = Silent::live();
    let alphabet = alphabet(&silent);
    let dialogs = [Dialog::Help, Dialog::About, Dialog::Palette].map(|dialog| shell::Command::SetDialog(Some(dialog)));
    let views: Vec<_> = Pane::ALL.map(shell::Command::ShowPane).into_iter().chain(dialogs).collect();
    for language in Language::ALL {
        for theme in [ThemeChoice::Dark, ThemeChoice::Light] {
            silent.command(shell::Command::SetLanguage(language));
            silent.command(shell::Command::SetTheme(theme));
            for view in &views {
                silent.command(*view);
                let mut found = Vec::new();
                silent.harness.output().shapes.iter().for_each(|clipped| texts(&clipped.shape, &mut found));
                assert!(found.len() > 20, "{view:?} {language:?}: nothing is drawn");
                for text in found {
                    assert_eq!(missing(&alphabet, &text), "", "{view:?} {language:?}: {text}");
                }
                silent.command(shell::Command::SetDialog(None));
            }
        }
    }
}

#[test]
fn the_fonts_have_every_letter_of_every_catalogue() {
    let alphabet = alphabet(&Silent::new(CellSource::default()));
    for (english, chinese) in handeye_workbench::text::every_translation() {
        for text in [english, chinese] {
            assert_eq!(missing(&alphabet, text), "", "{text}");
        }
    }
}

/// The letters that every font of the window has.
fn alphabet(silent: &Silent) -> BTreeSet<char> {
    let families = [egui::FontFamily::Proportional, egui::FontFamily::Monospace, fonts::semibold()];
    silent.harness.ctx.fonts_mut(|fonts| {
        let sets = families.map(|family| fonts.fonts.font(&family).characters().keys().copied().collect());
        sets.into_iter().reduce(|common: BTreeSet<char>, other| &common & &other).expect("a font")
    })
}

/// The letters of a text that a font does not have.
fn missing(alphabet: &BTreeSet<char>, text: &str) -> String {
    text.chars().filter(|letter| !letter.is_whitespace() && !alphabet.contains(letter)).collect()
}

#[test]
fn the_same_warning_is_on_the_screen_once() {
    let mut silent = Silent::live();
    silent.show_model(handeye_workbench::testing::sample::tracking());
    silent.show(Pane::Track);
    let why = "joint 3 is at its limit";
    let text = handeye_workbench::text::Text::verbatim(why);
    let count = |silent: &Silent| silent.harness.query_all_by_label_contains(why).count();
    let app = silent.app();
    let mut model = app.model().clone();
    model.track.follow = handeye_workbench::model::FollowStatus::Ended(text.clone());
    let (home, now_s) = (handeye_workbench::model::Home::Pane(Pane::Track), model.now_s);
    model.messages.notify_at(home, handeye_workbench::model::Severity::Warning, text, now_s);
    silent.show_model(model);
    assert_eq!(count(&silent), 1, "in its pane");
    silent.show(Pane::Jog);
    assert_eq!(count(&silent), 1, "below the steps, because its pane is not in front");
    silent.show(Pane::Track);
    assert_eq!(count(&silent), 1);
}

#[test]
fn why_there_is_no_capture_is_on_the_screen_once_and_the_table_keeps_it() {
    let mut silent = Silent::live();
    silent.show(Pane::Poses);
    let why = handeye_workbench::text::Text::verbatim("the board is not in view");
    let mut model = handeye_workbench::testing::sample::captured();
    let reported = handeye_wording::text!("No capture: {why}", why = why.clone());
    let at_s = model.now_s;
    let home = handeye_workbench::model::Home::Pane(Pane::Colour);
    model.messages.notify_at(home, handeye_workbench::model::Severity::Warning, reported, at_s);
    let kind = handeye_workbench::model::RefusalKind::NoBoard;
    model.refused = Some(handeye_workbench::model::CaptureRefused { kind, why, at_s });
    silent.show_model(model.clone());
    let count = |silent: &Silent| silent.harness.query_all_by_label_contains("the board is not in view").count();
    assert_eq!(count(&silent), 1, "over the image");
    if let Some(refused) = &mut model.refused {
        refused.at_s = at_s - 60.0;
    }
    silent.show_model(model);
    assert_eq!(count(&silent), 1, "in the table");
}

#[test]
fn the_line_at_the_bottom_says_what_is_under_way_and_old_news_no_more() {
    let mut silent = Silent::live();
    let news = "the sequence has ended";
    let mut model = handeye_workbench::testing::sample::solved();
    let now_s = model.now_s;
    let say = |model: &mut Model, at_s| {
        model.messages.notify(
            handeye_workbench::model::Severity::Info,
            handeye_workbench::text::Text::verbatim(news),
            at_s,
        );
    };
    let mut old = model.clone();
    say(&mut old, now_s - 60.0);
    silent.show_model(old);
    assert!(!silent.sees(news));
    say(&mut model, now_s);
    silent.show_model(model.clone());
    assert!(silent.sees(news));
    model.planning = true;
    silent.show_model(model);
    assert!(!silent.sees(news) && silent.sees("Planning poses that are not in the fit"));
}

#[test]
fn the_board_counts_as_in_view_until_it_was_not_found_for_a_while() {
    let mut silent = Silent::live();
    let mut model = handeye_workbench::testing::sample::connected();
    let mut detection = model.detection.clone().expect("seen");
    let now_s = model.now_s;
    model.board_seen_s = None;
    silent.show_model(model);
    let is_in_view = |silent: &Silent| silent.sees("(Board in view)");
    assert!(!is_in_view(&silent));
    silent.absorb(live::Event::Detection(Box::new(detection.clone())));
    detection.corners = None;
    silent.absorb(live::Event::Detection(Box::new(detection)));
    assert!(is_in_view(&silent), "a blurred image says nothing");
    let mut model = silent.app().model().clone();
    model.board_seen_s = Some(now_s - 2.0);
    silent.show_model(model);
    assert!(!is_in_view(&silent));
}

#[test]
fn exports_of_the_captures_that_are_there_are_done_and_others_are_not() {
    let mut silent = Silent::live();
    silent.show_model(handeye_workbench::testing::sample::solved());
    assert!(!silent.sees("(Files written)"));
    silent.absorb(session::Event::Opened { exported: true });
    assert!(silent.sees("(Files written)"));
    let mut state = silent.app().model().session.clone();
    let mut document = (*state.document).clone();
    document.captures[0].excluded = true;
    state.document = std::sync::Arc::new(document);
    silent.absorb(session::Event::Document(Box::new(state)));
    assert!(!silent.app().model().export.is_present, "another answer comes of these captures");
}
