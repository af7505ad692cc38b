use std::path::PathBuf;

use egui::{Key, Ui};
use egui_kittest::kittest::Queryable as _;

use super::*;
use crate::testing::driven::Driven;
use handeye_workbench::command::Command;
use handeye_workbench::model::{
    FolderEntry, FolderKind, FolderListing, Messages, RecentSession, Severity, ViewerState,
};
use handeye_workbench::testing::sample;
use handeye_workbench::text::{Language, Text};
use handeye_workbench::{export, session, shell, taught};

fn shown_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    dialogs_ui(ui.ctx(), model, outbox);
}

/// A dialog over a folder with one entry of each kind.
fn driven(dialog: Dialog) -> Driven {
    let mut model = sample::captured();
    model.dialog = Some(dialog);
    let entry = |name: &str, kind| FolderEntry { name: name.to_owned(), kind };
    model.folder = Some(FolderListing {
        folder: PathBuf::from("/data"),
        entries: Ok(vec![
            entry("monday", FolderKind::Session),
            entry("recorded", FolderKind::Dataset),
            entry("flash drive", FolderKind::Images),
            entry("more", FolderKind::Plain),
            entry("poses.toml", FolderKind::File),
        ]),
    });
    model.recent = vec![RecentSession { folder: PathBuf::from("/data/tuesday"), captures: 12 }];
    Driven::new(shown_ui, model)
}

/// What was requested before the dialog closed, which it does when no session is on its way.
fn first(commands: Vec<Command>) -> Command {
    commands.into_iter().next().expect("a command")
}

#[test]
fn the_folder_is_asked_for_when_the_dialog_opens_and_not_again() {
    let mut pane = driven(Dialog::Open);
    assert_eq!(pane.commands(), [Command::Session(session::Command::ListFolder(PathBuf::from("/data")))]);
    pane.steps();
    assert!(pane.commands().is_empty());
}

#[test]
fn sessions_and_data_sets_are_marked_and_opened() {
    let mut pane = driven(Dialog::Open);
    assert!(pane.sees("recorded, data set"));
    assert!(!pane.sees("poses.toml"), "a file is nothing to open");
    pane.click("monday, session");
    assert_eq!(first(pane.click("Open")), Command::Session(session::Command::Open(PathBuf::from("/data/monday"))));
}

#[test]
fn a_session_of_before_is_opened() {
    let mut pane = driven(Dialog::Open);
    assert!(pane.sees("12 captures"));
    pane.click("tuesday");
    assert_eq!(first(pane.click("Open")), Command::Session(session::Command::Open(PathBuf::from("/data/tuesday"))));
}

#[test]
fn return_opens_what_was_clicked() {
    let mut pane = driven(Dialog::Open);
    pane.click("tuesday");
    assert_eq!(first(pane.press(Key::Enter)), Command::Session(session::Command::Open(PathBuf::from("/data/tuesday"))));
    let mut pane = driven(Dialog::Open);
    pane.click("flash drive, images");
    assert_eq!(
        first(pane.press(Key::Enter)),
        Command::Session(session::Command::Open(PathBuf::from("/data/flash drive")))
    );
}

#[test]
fn what_is_typed_goes_on_behind_the_path() {
    let mut pane = driven(Dialog::Open);
    pane.steps();
    pane.harness.input_mut().events.push(egui::Event::Text("/x".to_owned()));
    pane.steps();
    assert_eq!(first(pane.click("Open")), Command::Session(session::Command::Open(PathBuf::from("/data/x"))));
}

#[test]
fn the_keyboard_is_enough() {
    let mut pane = driven(Dialog::Open);
    pane.press(Key::ArrowDown);
    pane.press(Key::ArrowDown);
    assert_eq!(
        first(pane.press(Key::Enter)),
        Command::Session(session::Command::Open(PathBuf::from("/data/recorded")))
    );
    let mut pane = driven(Dialog::Open);
    pane.press(Key::ArrowUp);
    assert_eq!(
        pane.press(Key::Enter),
        [Command::Session(session::Command::ListFolder(PathBuf::from("/data/more")))],
        "a folder is gone into"
    );
    assert_eq!(pane.press(Key::Escape), [Command::Shell(shell::Command::SetDialog(None))]);
}

#[test]
fn the_dialog_closes_when_the_session_is_there_and_says_why_when_it_is_not() {
    let mut pane = driven(Dialog::Open);
    pane.click("monday, session");
    pane.harness.get_by_label("Open").click();
    pane.harness.step();
    pane.harness.step();
    pane.model().opening = true;
    pane.steps();
    assert!(!pane.commands().contains(&Command::Shell(shell::Command::SetDialog(None))), "it is still being opened");
    pane.model().opening = false;
    let text = Text::verbatim("The session is of a later version.");
    pane.model().messages.notify(Severity::Error, text, 100.0);
    pane.steps();
    assert!(pane.sees("The session is of a later version."));
    assert!(pane.commands().is_empty());
    pane.model().messages = Messages::default();
    pane.steps();
    assert_eq!(pane.commands(), [Command::Shell(shell::Command::SetDialog(None))]);
}

#[test]
fn a_folder_that_cannot_be_read_is_said() {
    let mut pane = driven(Dialog::Open);
    pane.model().folder =
        Some(FolderListing { folder: PathBuf::from("/root"), entries: Err("permission denied".to_owned()) });
    pane.steps();
    assert!(pane.sees("The folder cannot be read: permission denied"));
    assert_eq!(pane.click("Folder above"), [Command::Session(session::Command::ListFolder(PathBuf::from("/")))]);
}

#[test]
fn a_new_session_needs_no_path() {
    let mut pane = driven(Dialog::New);
    assert_eq!(first(pane.click("Begin")), Command::Session(session::Command::New(None)));
}

#[test]
fn a_copy_gets_a_name_that_stays_from_folder_to_folder() {
    let mut pane = driven(Dialog::SaveAs);
    assert_eq!(pane.click("more"), [Command::Session(session::Command::ListFolder(PathBuf::from("/data/more")))]);
    assert_eq!(
        first(pane.click("Save the copy")),
        Command::Session(session::Command::SaveAs(PathBuf::from("/data/more/sample-copy")))
    );
}

#[test]
fn files_of_poses_are_read_and_written() {
    let mut pane = driven(Dialog::ImportPoses);
    assert!(!pane.is_enabled("Import"), "a folder is no file of poses");
    pane.click("poses.toml, poses");
    let import = Command::Taught(taught::Command::Import(PathBuf::from("/data/poses.toml")));
    assert_eq!(pane.click("Import"), [import, Command::Shell(shell::Command::SetDialog(None))]);
    let mut pane = driven(Dialog::ExportPoses);
    let export = Command::Taught(taught::Command::Export(PathBuf::from("/data/poses.toml")));
    assert_eq!(pane.click("Write"), [export, Command::Shell(shell::Command::SetDialog(None))]);
}

#[test]
fn a_folder_for_exports_is_chosen() {
    let mut pane = driven(Dialog::ExportFolder);
    pane.click("more");
    let chosen = Command::Export(export::Command::SetFolder(Some(PathBuf::from("/data/more"))));
    assert_eq!(pane.click("Choose"), [chosen, Command::Shell(shell::Command::SetDialog(None))]);
}

#[test]
fn what_this_is_and_its_licences_can_be_read() {
    let mut pane = driven(Dialog::About);
    assert!(pane.sees(env!("CARGO_PKG_VERSION")));
    assert!(pane.sees("This program: MIT OR Apache-2.0"));
    assert!(pane.sees("Noto Sans SC: SIL Open Font License 1.1"));
    assert_eq!(pane.click("Close"), [Command::Shell(shell::Command::SetDialog(None))]);
}

#[test]
fn the_address_of_the_web_viewer_can_be_read_and_copied_where_no_browser_opens() {
    let url = "http://127.0.0.1:4321/?hide_welcome_screen=1&url=rerun%2Bhttp%3A%2F%2F127.0.0.1%3A4322%2Fproxy";
    for (language, copy) in [(Language::English, "Copy"), (Language::Chinese, "复制")] {
        let mut pane = driven(Dialog::RerunAddress);
        pane.model().view.language = language;
        pane.model().rerun.viewer = ViewerState::Web { url: url.to_owned() };
        pane.steps();
        assert!(pane.sees(url), "{language:?}");
        assert!(pane.nothing_is_cut_off(), "{language:?}");
        pane.harness.get_by_label(copy).click();
        let expected = egui::OutputCommand::CopyText(url.to_owned());
        let copied = (0..3).any(|_| {
            pane.harness.step();
            pane.harness.output().platform_output.commands.contains(&expected)
        });
        assert!(copied, "{language:?}");
    }
}

#[test]
fn the_address_of_a_viewer_that_is_gone_is_not_shown() {
    let mut pane = driven(Dialog::RerunAddress);
    pane.steps();
    assert!(pane.commands().contains(&Command::Shell(shell::Command::SetDialog(None))));
}
