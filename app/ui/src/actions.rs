//! Everything that can be done from anywhere, in one table: the keyboard, the help about it, the command palette and the
//! menu read it.

use egui::{Key, KeyboardShortcut, Modifiers};

use handeye_workbench::command::Command;
use handeye_workbench::model::{
    CapturePurpose, CellSource, Dialog, FollowStatus, Model, Motion, Moves, Pane, SolveStatus, Step, ThemeChoice,
};
use handeye_workbench::text::Language;
use handeye_workbench::tr;
use handeye_workbench::{
    by_hand, capture, connect, export, guided, motion, recording, session, shell, solve, taught, track,
};

/// Headings of the help about the keyboard.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Group {
    /// The arm and captures.
    Work,
    Session,
    Steps,
    Window,
    Panes,
}

impl Group {
    /// For display.
    pub(crate) fn name(self, language: Language) -> &'static str {
        match self {
            Self::Work => tr!(language, "Robot and captures"),
            Self::Session => tr!(language, "Session"),
            Self::Steps => tr!(language, "Steps"),
            Self::Window => tr!(language, "Window"),
            Self::Panes => tr!(language, "Panes"),
        }
    }
}

/// Something that can be done.
#[derive(Debug, Clone)]
pub struct Action {
    /// For display.
    pub name: &'static str,
    /// Where the help lists it.
    pub group: Group,
    /// The keys that do it; the first one is shown.
    pub keys: &'static [KeyboardShortcut],
    /// What it does.
    pub command: Command,
    /// Whether it can be done now.
    pub available: bool,
}

const fn plain(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::NONE, key)
}

const fn ctrl(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::COMMAND, key)
}

const CTRL_SHIFT: Modifiers = Modifiers { shift: true, ..Modifiers::COMMAND };

/// Stops the arm from anywhere, also while text is typed and while a dialog is open.
pub const STOP_KEY: Key = Key::Escape;

const STOP: &[KeyboardShortcut] = &[plain(STOP_KEY)];
const CAPTURE: &[KeyboardShortcut] = &[plain(Key::Space)];
const DELETE: &[KeyboardShortcut] = &[plain(Key::Delete)];
const REDO: &[KeyboardShortcut] = &[KeyboardShortcut::new(CTRL_SHIFT, Key::Z), ctrl(Key::Y)];
const UNDO: &[KeyboardShortcut] = &[ctrl(Key::Z)];
const NEW: &[KeyboardShortcut] = &[ctrl(Key::N)];
const OPEN: &[KeyboardShortcut] = &[ctrl(Key::O)];
const SAVE: &[KeyboardShortcut] = &[ctrl(Key::S)];
const PALETTE: &[KeyboardShortcut] = &[ctrl(Key::K), ctrl(Key::P)];
const KEYS: &[KeyboardShortcut] = &[plain(Key::F1), plain(Key::Questionmark)];
const STEPS: [&[KeyboardShortcut]; 7] = [
    &[plain(Key::Num1)],
    &[plain(Key::Num2)],
    &[plain(Key::Num3)],
    &[plain(Key::Num4)],
    &[plain(Key::Num5)],
    &[plain(Key::Num6)],
    &[plain(Key::Num7)],
];

/// All actions, in the order of the help.
pub fn all(model: &Model, language: Language) -> Vec<Action> {
    let mut all = work(model, language);
    all.extend(session(model, language));
    all.extend(window(model, language));
    all
}

fn action(
    name: &'static str,
    group: Group,
    keys: &'static [KeyboardShortcut],
    command: Command,
    available: bool,
) -> Action {
    Action { name, group, keys, command, available }
}

/// The arm, captures, the answer and what is done with it.
fn work(model: &Model, language: Language) -> Vec<Action> {
    let with = |name, keys, command, available| action(name, Group::Work, keys, command, available);
    let plain = |name, command, available| with(name, &[], command, available);
    let hindrance = crate::shell::reasons::hindrance(model);
    let takes = hindrance.is_none();
    let moves = crate::shell::reasons::immovable(model).is_none();
    let has_poses = !model.document().taught.is_empty();
    let has_robot = crate::shell::reasons::needs_robot(model).is_none();
    let run = |name, purpose: Option<CapturePurpose>| {
        plain(
            name,
            taught::Command::RunSequence { purpose }.into(),
            moves && has_poses && (has_robot || purpose.is_none()),
        )
    };
    let sequence = model.sequence.as_ref().filter(|_| model.sequence_runs);
    let asks = model.asked.is_some();
    let hand = model.by_hand.as_ref();
    let blocked = crate::track::pane::Blocked::of(model);
    let may_move = model.is_armed();
    let asks_to_move = matches!(model.moves(), Moves::OnceArmed { .. }) && model.control.is_connected();
    let mut all = vec![
        with(tr!(language, "Stop the arm"), STOP, motion::Command::Stop.into(), true),
        with(tr!(language, "Capture"), CAPTURE, capture::Command::Take(CapturePurpose::Calibrate).into(), takes),
        plain(tr!(language, "Capture for verification"), capture::Command::Take(CapturePurpose::Verify).into(), takes),
        plain(tr!(language, "Cancel capture"), capture::Command::Cancel.into(), model.capture.is_some()),
        plain(
            tr!(language, "Calibrate for me"),
            guided::Command::CalibrateForMe.into(),
            crate::guided::section::blocked(model, hindrance).is_none() && model.takes_chosen_poses(),
        ),
        plain(
            tr!(language, "Guide me"),
            by_hand::Command::Guide.into(),
            takes && hand.is_none() && crate::by_hand::section::blocked(model).is_none(),
        ),
        run(tr!(language, "Capture at each taught pose"), Some(CapturePurpose::Calibrate)),
        run(tr!(language, "Verify at each taught pose"), Some(CapturePurpose::Verify)),
        run(tr!(language, "Move to each taught pose"), None),
        plain(
            tr!(language, "Verify at planned poses"),
            taught::Command::VerifyAtPlanned.into(),
            moves && model.calibrated().is_some(),
        ),
        plain(
            tr!(language, "Continue the sequence"),
            taught::Command::ContinueSequence.into(),
            moves && model.sequence.as_ref().is_some_and(|sequence| sequence.current().is_some()),
        ),
        plain(tr!(language, "Stop the sequence"), taught::Command::StopSequence.into(), sequence.is_some()),
        plain(
            tr!(language, "Move there"),
            taught::Command::ConfirmMove.into(),
            asks && crate::shell::reasons::unmovable(model).is_none() && model.motion == Motion::Idle,
        ),
        plain(tr!(language, "Skip this pose"), taught::Command::SkipMove.into(), asks),
        plain(
            tr!(language, "Skip this view"),
            by_hand::Command::SkipView.into(),
            hand.is_some_and(|hand| hand.waits == handeye_workbench::by_hand::state::HandWaits::View),
        ),
        plain(tr!(language, "Stop guiding"), by_hand::Command::StopGuiding.into(), hand.is_some()),
        plain(
            tr!(language, "Home: where the arm stood when the cell was connected"),
            motion::Command::GoHome.into(),
            moves && model.home.is_some(),
        ),
        plain(
            tr!(language, "Reset the cell"),
            connect::Command::ResetCell.into(),
            model.source.is_built_in() && !model.sequence_runs,
        ),
        with(
            tr!(language, "Delete the selected captures"),
            DELETE,
            session::Command::Delete(model.selection.clone()).into(),
            !model.selection.is_empty(),
        ),
        plain(tr!(language, "Back to live"), session::Command::BackToLive.into(), !model.selection.is_empty()),
        plain(tr!(language, "Teach here"), taught::Command::Teach { name: None }.into(), model.robot.is_some()),
        plain(
            tr!(language, "Use the taught poses of another cell here"),
            taught::Command::Adopt.into(),
            sequence.is_none() && model.taught().len() < model.document().taught.len(),
        ),
        plain(tr!(language, "Reference poses"), taught::Command::TeachReference.into(), sequence.is_none()),
        plain(
            tr!(language, "Let the workbench move it"),
            connect::Command::Arm(true).into(),
            asks_to_move && !may_move,
        ),
        plain(tr!(language, "Only read the robot"), connect::Command::Arm(false).into(), asks_to_move && may_move),
        plain(tr!(language, "Solve"), solve::Command::Solve.into(), true),
        plain(
            tr!(language, "Cancel solving"),
            solve::Command::Cancel.into(),
            matches!(model.solve.status, SolveStatus::Running { .. }),
        ),
        plain(
            tr!(language, "Export the chosen formats"),
            export::Command::Export.into(),
            crate::export::pane::why_not(model).is_none(),
        ),
        plain(
            tr!(language, "Start tracking"),
            track::Command::SetTracking(true).into(),
            !model.track.on && blocked.tracking.is_none(),
        ),
        plain(tr!(language, "Stop tracking"), track::Command::SetTracking(false).into(), model.track.on),
        plain(
            tr!(language, "Stop following"),
            track::Command::SetFollow(None).into(),
            !matches!(model.track.follow, FollowStatus::Off | FollowStatus::Ended(_)),
        ),
        plain(tr!(language, "Try to connect now"), connect::Command::Reconnect.into(), true),
        plain(
            tr!(language, "Stop trying"),
            connect::Command::StopTrying.into(),
            matches!(model.source, CellSource::Drivers(_)) && !model.control.is_connected(),
        ),
    ];
    // A robot behind a driver has no simulation.
    if !matches!(model.source, CellSource::Drivers(_)) {
        let rests = model.resting_simulation().is_some();
        all.push(plain(tr!(language, "Start simulation"), connect::Command::StartSimulation.into(), rests));
    }
    all
}

/// Undo, and the files of the session.
fn session(model: &Model, language: Language) -> Vec<Action> {
    let with = |name, keys, command, available| action(name, Group::Session, keys, command, available);
    let dialog = |name, keys, dialog| with(name, keys, shell::Command::SetDialog(Some(dialog)).into(), true);
    let facts = handeye_workbench::session::facts::of(model);
    vec![
        with(tr!(language, "Undo"), UNDO, session::Command::Undo.into(), facts.undo.is_some()),
        with(tr!(language, "Redo"), REDO, session::Command::Redo.into(), facts.redo.is_some()),
        dialog(tr!(language, "New session…"), NEW, Dialog::New),
        dialog(tr!(language, "Open session…"), OPEN, Dialog::Open),
        with(
            tr!(language, "Open a sample"),
            &[],
            session::Command::OpenSample.into(),
            !model.opening && !model.sequence_runs,
        ),
        dialog(tr!(language, "Save session…"), SAVE, Dialog::SaveAs),
    ]
}

/// Steps, panes and how the window looks.
fn window(model: &Model, language: Language) -> Vec<Action> {
    let mut all = Vec::new();
    for (step, keys) in Step::ALL.into_iter().zip(STEPS) {
        all.push(action(
            crate::shell::step_name(step, language),
            Group::Steps,
            keys,
            shell::Command::GoToStep(step).into(),
            true,
        ));
    }
    let with = |name, keys, command, available| action(name, Group::Window, keys, command, available);
    let open = |dialog| shell::Command::SetDialog(Some(dialog)).into();
    all.extend([
        with(tr!(language, "All commands"), PALETTE, open(Dialog::Palette), true),
        with(tr!(language, "Keyboard"), KEYS, open(Dialog::Help), true),
        with(tr!(language, "Light theme"), &[], shell::Command::SetTheme(ThemeChoice::Light).into(), true),
        with(tr!(language, "Dark theme"), &[], shell::Command::SetTheme(ThemeChoice::Dark).into(), true),
        with(tr!(language, "Reset layout"), &[], shell::Command::ResetLayout.into(), true),
        with(tr!(language, "Open the recording in Rerun"), &[], recording::Command::OpenRerun.into(), model.rerun.on),
        with(tr!(language, "About"), &[], open(Dialog::About), true),
    ]);
    for other in Language::ALL {
        all.push(with(other.own_name(), &[], shell::Command::SetLanguage(other).into(), true));
    }
    for pane in Pane::ALL {
        all.push(action(
            crate::shell::panes::title(pane, language),
            Group::Panes,
            &[],
            shell::Command::ShowPane(pane).into(),
            true,
        ));
    }
    all
}

/// The keys of an action as usually written.
pub(crate) fn keys_text(ctx: &egui::Context, action: &Action) -> Vec<String> {
    let names = egui::ModifierNames::NAMES;
    let is_mac = ctx.os().is_mac();
    action
        .keys
        .iter()
        .map(|keys| {
            let key = match keys.logical_key {
                Key::Questionmark => "?",
                Key::Escape => "Esc",
                key => key.name(),
            };
            match names.format(&keys.modifiers, is_mac) {
                modifiers if modifiers.is_empty() => key.to_owned(),
                modifiers => format!("{modifiers}+{key}"),
            }
        })
        .collect()
}

/// The commands of the keys that were pressed in this frame, except the stop. Nothing while text is typed; a key
/// without Ctrl belongs to the widget that has the focus.
pub fn pressed(ctx: &egui::Context, model: &Model) -> Vec<Command> {
    let any =
        ctx.input(|input| input.events.iter().any(|event| matches!(event, egui::Event::Key { pressed: true, .. })));
    if !any || ctx.text_edit_focused() {
        return Vec::new();
    }
    let focused = ctx.memory(|memory| memory.focused().is_some());
    let mut commands = Vec::new();
    let mut actions = all(model, Language::English);
    // Ctrl+Shift+Z is also Ctrl+Z with one more key: the longer one goes first.
    actions.sort_by_key(|action| !action.keys.iter().any(|keys| keys.modifiers.shift));
    for action in actions {
        let keys = action.keys.iter().filter(|keys| keys.logical_key != STOP_KEY);
        let mut keys = keys.filter(|keys| !(focused && keys.modifiers.is_none() && keys.logical_key == Key::Space));
        if keys.any(|keys| ctx.input_mut(|input| input.consume_shortcut(keys))) && action.available {
            commands.push(action.command);
        }
    }
    commands
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use handeye_workbench::command::CommandKind;
    use handeye_workbench::model::{CellSource, ViewSettings};

    /// Commands with a value that is only available where it is chosen: a pose in a row, a typed number, a point of an image, a
    /// file, a held key.
    const ONLY_IN_PLACE: &[CommandKind] = {
        use handeye_workbench::capture::command::CommandKind as Capture;
        use handeye_workbench::connect::command::CommandKind as Connect;
        use handeye_workbench::export::command::CommandKind as Export;
        use handeye_workbench::import::command::CommandKind as Import;
        use handeye_workbench::keep_out::command::CommandKind as KeepOut;
        use handeye_workbench::live::command::CommandKind as Live;
        use handeye_workbench::messages::command::CommandKind as Messages;
        use handeye_workbench::motion::command::CommandKind as Motion;
        use handeye_workbench::scene::command::CommandKind as Scene;
        use handeye_workbench::session::command::CommandKind as Session;
        use handeye_workbench::shell::command::CommandKind as Shell;
        use handeye_workbench::solve::command::CommandKind as Solve;
        use handeye_workbench::target::command::CommandKind as Target;
        use handeye_workbench::taught::command::CommandKind as Taught;
        use handeye_workbench::track::command::CommandKind as Track;

        &[
            CommandKind::Capture(Capture::SetOptions),
            CommandKind::Connect(Connect::Connect),
            CommandKind::Connect(Connect::SetObjects),
            CommandKind::Connect(Connect::TypePose),
            CommandKind::Export(Export::ChooseFormats),
            CommandKind::Export(Export::SetFolder),
            CommandKind::Export(Export::SetNames),
            CommandKind::Export(Export::ShowFormat),
            CommandKind::Import(Import::ChooseHypothesis),
            CommandKind::Import(Import::ConvertImages),
            CommandKind::Import(Import::ConvertRecording),
            CommandKind::Import(Import::FixConvention),
            CommandKind::Import(Import::SetTarget),
            CommandKind::Import(Import::SetTime),
            CommandKind::KeepOut(KeepOut::Export),
            CommandKind::KeepOut(KeepOut::Import),
            CommandKind::KeepOut(KeepOut::Set),
            CommandKind::Live(Live::Pick),
            CommandKind::Live(Live::PointAt),
            CommandKind::Live(Live::SetDepthColours),
            CommandKind::Live(Live::SetDepthScale),
            CommandKind::Live(Live::SetOverlays),
            CommandKind::Live(Live::SetViewport),
            CommandKind::Messages(Messages::Dismiss),
            CommandKind::Motion(Motion::GoToCapture),
            CommandKind::Motion(Motion::Jog),
            CommandKind::Motion(Motion::JogHeld),
            CommandKind::Motion(Motion::JogReleased),
            CommandKind::Motion(Motion::Move),
            CommandKind::Motion(Motion::MoveCorrected),
            CommandKind::Motion(Motion::SetJog),
            CommandKind::Scene(Scene::SetView),
            CommandKind::Session(Session::ListFolder),
            CommandKind::Session(Session::New),
            CommandKind::Session(Session::Open),
            CommandKind::Session(Session::OpenFolder),
            CommandKind::Session(Session::SaveAs),
            CommandKind::Session(Session::Select),
            CommandKind::Session(Session::SetCamera),
            CommandKind::Session(Session::SetRobotAccuracy),
            CommandKind::Session(Session::SetExcluded),
            CommandKind::Session(Session::SetMode),
            CommandKind::Session(Session::SetPurpose),
            CommandKind::Shell(Shell::SetRotationFormat),
            CommandKind::Solve(Solve::SetGoal),
            CommandKind::Solve(Solve::SetKeepOutliers),
            CommandKind::Solve(Solve::SetMethod),
            CommandKind::Solve(Solve::SetOutlierLine),
            CommandKind::Solve(Solve::SetTipBox),
            CommandKind::Target(Target::Print),
            CommandKind::Target(Target::Set),
            CommandKind::Taught(Taught::Export),
            CommandKind::Taught(Taught::GoTo),
            CommandKind::Taught(Taught::Import),
            CommandKind::Taught(Taught::Remove),
            CommandKind::Taught(Taught::Rename),
            CommandKind::Taught(Taught::Reorder),
            CommandKind::Taught(Taught::SetConfirmMoves),
            CommandKind::Track(Track::HideBoard),
            CommandKind::Track(Track::MoveBoard),
            CommandKind::Track(Track::SetCorrected),
        ]
    };

    #[test]
    fn every_command_that_needs_no_value_of_its_place_is_in_the_palette() {
        let model = Model::new(CellSource::default(), ViewSettings::default());
        let there: BTreeSet<_> =
            all(&model, Language::English).iter().map(|it| CommandKind::from(&it.command)).collect();
        for kind in CommandKind::all() {
            let elsewhere = ONLY_IN_PLACE.contains(&kind);
            assert_ne!(there.contains(&kind), elsewhere, "{kind:?}: in the palette, or listed here with what it needs");
        }
    }

    #[test]
    fn no_two_actions_have_the_same_keys_or_the_same_name_in_a_group() {
        let model = Model::new(CellSource::default(), ViewSettings::default());
        for language in Language::ALL {
            let all = all(&model, language);
            for (index, one) in all.iter().enumerate() {
                for other in &all[index + 1..] {
                    assert!(one.keys.iter().all(|keys| !other.keys.contains(keys)), "{} {}", one.name, other.name);
                    assert!(one.group != other.group || one.name != other.name, "{}", one.name);
                }
            }
        }
    }
}
