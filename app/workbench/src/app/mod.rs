//! The application without its window: the model, the workers, and the only two ways to change the model.
//!
//! [`App::apply`] does what the user wants, [`App::absorb`] takes in what happened. Each part of the work has a file of
//! its own here; all of them change the model of the one [`App`] and hand work to threads, and none waits.

mod leave;
mod reach;

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use handeye_coppeliasim::cell::CellPaths;
use handeye_files::bounds::Bounds;

use crate::command::{Command, Event, Outbox};
use crate::model::{CellSource, Drivers, JobId, LiveFrame, Model, MotionId, Severity, ViewSettings};
use crate::recording::Recording;
use crate::recording::recorded::Recorded;
use crate::settings::SettingsWrite;
use crate::worker::{Cell, Clock, FileTask, SessionThreads, StopLine, Waker, Workers};
use crate::{
    by_hand, capture, connect, export, guided, import, keep_out, live, messages, motion, recording, scene, session,
    shell, solve, target, taught, track,
};
use handeye_wording::text;

pub use reach::Reach;

/// Makes what connects to a cell.
pub type Connect = Arc<dyn Fn(&CellSource, &CellPaths) -> Arc<dyn Cell> + Send + Sync>;

/// What an application begins with.
pub struct Start {
    /// Which cell.
    pub source: CellSource,
    /// What is remembered from one start to the next.
    pub view: ViewSettings,
    /// Addresses that were connected to before, newest first.
    pub addresses: Vec<String>,
    /// Drivers that were connected to before, newest first.
    pub drivers: Vec<Drivers>,
    /// Where a scene other than the built-in one has the parts of the cell.
    pub objects: CellPaths,
    /// Where the boxes that the arm keeps out of are kept; nowhere if not given.
    pub keep_out: Option<PathBuf>,
    /// Where new sessions go.
    pub sessions: PathBuf,
    /// A session or data set to open at once; where there is none, a session is begun there.
    pub open: Option<PathBuf>,
    /// What can be reached where the window is shown in browsers; nothing is then opened on the screen of this machine.
    pub in_browser: Option<InBrowser>,
}

/// How a window is shown in browsers.
#[derive(Clone)]
pub struct InBrowser {
    /// What can be reached from there.
    pub reach: Reach,
    /// What stops the arm, for the threads that listen to pages.
    pub stop: Arc<StopLine>,
}

/// Model and workers.
pub struct App {
    pub(crate) model: Model,
    /// The threads that talk to the cell; others take their place when another cell is chosen.
    pub(crate) workers: Workers,
    pub(crate) desk: SessionThreads,
    pub(crate) connect: Connect,
    pub(crate) clock: Clock,
    /// Has the window drawn again.
    pub waker: Waker,
    pub(crate) numbers: Numbers,
    /// The question that the solver was asked last.
    pub(crate) asked: Option<crate::solve::question::Question>,
    /// Nothing is recorded without.
    pub(crate) recording: Option<Box<dyn Recording>>,
    pub(crate) recorded: Recorded,
    /// Until when everything has to be over, once the application ends.
    pub(crate) leave_by: Option<Instant>,
    /// Stops of other threads that were taken note of.
    pub(crate) outside_stops: u64,
    /// What commands may reach, if not everything.
    reach: Option<Reach>,
}

/// The last numbers that were given to requests.
#[derive(Debug, Default)]
pub(crate) struct Numbers {
    pub(crate) capture: u64,
    pub(crate) job: JobId,
    pub(crate) motion: MotionId,
    /// The motion that follows the board.
    pub(crate) follow: Option<MotionId>,
    /// The request for poses to verify at that is not answered yet.
    pub(crate) plan: Option<MotionId>,
    /// The request for a view for a person to bring about.
    pub(crate) view: u64,
    /// The request about a recording.
    pub(crate) import: u64,
}

impl App {
    /// Starts the workers; they connect by themselves.
    ///
    /// # Errors
    /// When the system has no more threads.
    pub fn start(start: Start, connect: Connect, clock: Clock, waker: Waker) -> io::Result<Self> {
        let Start { source, view, addresses, drivers, objects, keep_out, sessions, open, in_browser } = start;
        let desk = SessionThreads::start(sessions, &clock, &waker)?;
        let stop = in_browser.as_ref().map(|shown| Arc::clone(&shown.stop)).unwrap_or_default();
        let connector = connect(&source, &objects);
        let workers = Workers::start(&source, &view, &connector, desk.captures(), &stop, &clock, &waker)?;
        let sessions = desk.sessions().to_path_buf();
        let shown = in_browser.is_some();
        let model = Model { addresses, drivers, objects, sessions, in_browser: shown, ..Model::new(source, view) };
        let (keep_out, fault) = crate::keep_out::update::opened(keep_out);
        let model = Model { keep_out, ..model };
        let numbers = Numbers::default();
        let mut app = Self {
            model,
            workers,
            desk,
            connect,
            clock,
            waker,
            numbers,
            asked: None,
            recording: None,
            recorded: Recorded::default(),
            leave_by: None,
            outside_stops: 0,
            reach: in_browser.map(|shown| shown.reach),
        };
        if let Some(fault) = fault {
            app.say(Severity::Error, fault);
        }
        app.prepare_session();
        app.send_target();
        app.send_keep_out();
        if let Some(folder) = open {
            app.open_or_begin(folder);
        }
        Ok(app)
    }

    /// What the window shows.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Goes on from a model that a test has made up. The workers do not hear of it.
    #[cfg(feature = "testing")]
    pub fn replace_model(&mut self, model: Model) {
        self.model = model;
    }

    /// Takes in what the workers have reported. Never waits for them.
    pub fn collect(&mut self) {
        self.take_outside_stops();
        self.absorb(Event::Tick { now_s: (self.clock)() });
        let mut events = Vec::new();
        self.workers.drain(|event| events.push(event));
        self.desk.drain(|event| events.push(event));
        if let Some(recording) = &self.recording {
            recording.drain(&mut |event| events.push(event));
        }
        for event in events {
            self.absorb(event);
        }
        self.record_changes();
    }

    /// Applies the commands of a frame of the window.
    pub fn apply_all(&mut self, outbox: &mut Outbox) {
        for (command, place) in outbox.drain() {
            tracing::trace!(?command, %place, "command");
            self.apply(command);
        }
    }

    /// What files in a folder that is opened may name: anything, where somebody sits at this machine.
    pub(crate) fn bounds_of(&self, path: &Path) -> Bounds {
        self.reach.as_ref().map_or(Bounds::ANYWHERE, |reach| reach.bounds_of(path))
    }

    /// Does what the user wants, or has a worker do it. Never waits for a worker.
    pub fn apply(&mut self, command: impl Into<Command>) {
        let command = command.into();
        if let Some(why) = self.reach.as_ref().and_then(|reach| reach.refusal(&command)) {
            self.say(Severity::Warning, why);
            return;
        }
        match command {
            Command::Motion(motion::Command::Stop) => self.stop(),
            Command::Connect(connect::Command::StartSimulation) => self.start_simulation(),
            Command::Connect(connect::Command::Reconnect) => self.reconnect(),
            Command::Connect(connect::Command::StopTrying) => self.stop_trying(),
            Command::Connect(connect::Command::Connect(source)) => self.connect(source),
            Command::Connect(connect::Command::Arm(on)) => self.arm(on),
            Command::Connect(connect::Command::TypePose(pose)) => self.type_pose(Some(pose)),
            Command::Connect(connect::Command::SetObjects(objects)) => self.set_objects(objects),
            Command::KeepOut(keep_out::Command::Set(content)) => self.set_keep_out(*content),
            Command::KeepOut(keep_out::Command::Import(file)) => self.import_keep_out(file),
            Command::KeepOut(keep_out::Command::Export(file)) => self.export_keep_out(file),
            Command::Target(target::Command::Print(page)) => self.print_target(page),

            Command::Shell(shell::Command::SetTheme(theme)) => self.model.view.theme = theme,
            Command::Shell(shell::Command::SetLanguage(language)) => self.model.view.language = language,
            Command::Shell(shell::Command::SetRotationFormat(format)) => self.model.view.rotation = format,
            Command::Live(live::Command::SetDepthScale(scale)) => self.set_depth_scale(scale),
            Command::Live(live::Command::SetDepthColours(colours)) => self.set_depth_colours(colours),
            Command::Live(live::Command::SetOverlays(overlays)) => self.model.view.overlays = overlays,
            Command::Live(live::Command::SetViewport(viewport)) => self.model.viewport = viewport,
            Command::Scene(scene::Command::SetView(view)) => self.model.scene = view,
            Command::Live(live::Command::PointAt(point)) => self.model.cursor = point,
            Command::Live(live::Command::Pick(pixel)) => self.pick(pixel),
            Command::Shell(shell::Command::GoToStep(step)) => self.model.step = step,
            Command::Shell(shell::Command::SetDialog(dialog)) => self.set_dialog(dialog),
            Command::Messages(messages::Command::Dismiss(number)) => self.model.messages.dismiss(number),
            // Where panes are is the window's business.
            Command::Shell(shell::Command::ShowPane(_) | shell::Command::ResetLayout) => {}

            Command::Motion(motion::Command::Move { goal, what }) => self.start_motion(goal, what),
            Command::Motion(motion::Command::Jog(jog)) => self.jog(jog),
            Command::Motion(motion::Command::JogHeld(jog)) => self.hold_jog(jog),
            Command::Motion(motion::Command::JogReleased) => self.release_jog(),
            Command::Motion(motion::Command::SetJog(settings)) => self.model.view.jog = settings,
            Command::Taught(taught::Command::Teach { name }) => self.teach(name),
            Command::Taught(taught::Command::Remove(name)) => self.remove_taught(&name),
            Command::Taught(taught::Command::Rename { from, to }) => self.rename_taught(&from, &to),
            Command::Taught(taught::Command::Reorder { name, to }) => self.reorder_taught(&name, to),
            Command::Taught(taught::Command::TeachReference) => self.teach_reference(),
            Command::Taught(taught::Command::Import(file)) => self.import_taught(file),
            Command::Taught(taught::Command::Export(file)) => self.export_taught(file),
            Command::Taught(taught::Command::Adopt) => self.adopt_taught(),
            Command::Taught(taught::Command::GoTo(name)) => self.visit_taught(&name),
            Command::Motion(motion::Command::GoToCapture(id)) => self.go_to_capture(id),
            Command::Taught(taught::Command::RunSequence { purpose }) => self.run_sequence(purpose),
            Command::Taught(taught::Command::ContinueSequence) => self.continue_sequence(),
            Command::Motion(motion::Command::GoHome) => self.go_home(),
            Command::Connect(connect::Command::ResetCell) => self.reset_cell(),
            Command::Guided(guided::Command::CalibrateForMe) => self.calibrate_for_me(),
            Command::Motion(motion::Command::ConfirmMove) => self.confirm_move(),
            Command::Motion(motion::Command::SkipMove) => self.skip_move(),
            Command::Motion(motion::Command::SetConfirmMoves(confirm)) => self.set_confirm_moves(confirm),
            Command::ByHand(by_hand::Command::Guide) => self.guide_by_hand(),
            Command::ByHand(by_hand::Command::SkipView) => self.skip_view(),
            Command::ByHand(by_hand::Command::StopGuiding) => self.stop_guiding(),
            Command::Taught(taught::Command::VerifyAtPlanned) => self.plan_verification(),
            Command::Taught(taught::Command::StopSequence) => self.stop_sequence(),

            Command::Capture(capture::Command::Take(purpose)) => self.capture(purpose, None),
            Command::Capture(capture::Command::Cancel) => self.cancel_capture(),
            Command::Capture(capture::Command::SetOptions(options)) => self.model.view.capture = options,
            Command::Session(session::Command::Select(ids)) => self.select(ids),
            Command::Session(session::Command::BackToLive) => self.back_to_live(),

            Command::Session(session::Command::SetExcluded { ids, excluded }) => self.set_excluded(ids, excluded),
            Command::Session(session::Command::SetPurpose { ids, purpose }) => self.set_purpose(ids, purpose),
            Command::Session(session::Command::Delete(ids)) => self.delete(ids),
            Command::Session(session::Command::Undo) => self.undo(),
            Command::Session(session::Command::Redo) => self.redo(),
            Command::Target(target::Command::Set(target)) => self.set_target(target),
            Command::Session(session::Command::SetMode(mode)) => self.set_mode(mode),
            Command::Session(session::Command::SetCamera(camera)) => self.set_camera(camera),
            Command::Session(session::Command::New(folder)) => self.new_session(folder),
            Command::Session(session::Command::Open(folder)) => self.open(folder),
            Command::Session(session::Command::OpenSample) => self.open_sample(),
            Command::Import(import::Command::SetTarget(typed)) => self.set_import_target(typed),
            Command::Import(import::Command::SetTime(seconds)) => self.set_import_time(seconds),
            Command::Import(import::Command::FixConvention { key, value }) => self.fix_convention(key, value),
            Command::Import(import::Command::ChooseHypothesis(place)) => self.choose_hypothesis(place),
            Command::Import(import::Command::ConvertRecording) => self.convert_recording(),
            Command::Import(import::Command::ConvertImages) => self.convert_images(),
            Command::Session(session::Command::SaveAs(folder)) => self.save_as(folder),
            Command::Session(session::Command::ListFolder(folder)) => self.list_folder(folder),
            Command::Session(session::Command::OpenFolder(folder)) => self.open_folder(folder),

            Command::Solve(solve::Command::Solve) => self.solve_again(),
            Command::Solve(solve::Command::Cancel) => self.cancel_solve(),
            Command::Solve(solve::Command::SetMethod(name)) => self.set_method(&name),
            Command::Solve(solve::Command::SetKeepOutliers(keep)) => self.set_keep_outliers(keep),
            Command::Solve(solve::Command::SetTipBox(chosen)) => self.set_tip_box(chosen),
            Command::Solve(solve::Command::SetGoal(goal)) => self.set_goal(goal),
            Command::Solve(solve::Command::SetOutlierLine(line_px)) => self.model.outlier_line_px = line_px,

            Command::Track(track::Command::SetTracking(on)) => self.set_tracking(on),
            Command::Track(track::Command::SetFollow(wish)) => self.set_follow(wish),
            Command::Track(track::Command::MoveBoard(motion)) => self.move_board(motion),
            Command::Track(track::Command::HideBoard(hidden)) => self.hide_board(hidden),
            Command::Recording(recording::Command::OpenRerun) => self.open_rerun(),

            Command::Export(export::Command::ChooseFormats(formats)) => self.model.export.chosen = formats,
            Command::Export(export::Command::ShowFormat(format)) => self.model.export.shown = format,
            Command::Export(export::Command::SetNames(names)) => self.set_export_names(names),
            Command::Export(export::Command::SetFolder(folder)) => self.model.export.folder = folder,
            Command::Export(export::Command::Export) => self.export(),
        }
    }

    /// Takes in what happened.
    pub fn absorb(&mut self, event: impl Into<Event>) {
        let event = event.into();
        self.record(&event);
        match event {
            Event::Tick { now_s } => {
                self.model.now_s = now_s;
                self.keep_keep_out(false);
                self.stop_waits();
            }
            Event::KeepOut(keep_out::Event::Standing(standing)) => self.standing_found(standing),
            Event::KeepOut(keep_out::Event::Read(content)) => self.keep_out_read(*content),
            Event::Connect(connect::Event::Link { link, state }) => self.link_changed(link, state),
            Event::Connect(connect::Event::Robot(robot)) => {
                self.model.trail.add(robot.base_from_tip.translation().into());
                self.stop_seen(&robot);
                if !robot.joints_rad.is_empty() {
                    self.model.home.get_or_insert(robot.joints_rad);
                }
                self.model.robot = Some(robot);
                self.model.robot_read_s = Some(self.model.now_s);
            }
            Event::Connect(connect::Event::NoRobot) => self.model.robot = None,
            Event::Connect(connect::Event::Cell(facts)) => self.cell_found(*facts),
            Event::Connect(connect::Event::Heard { severity, words }) => self.heard(severity, words),
            Event::Motion(motion::Event::Stopped) => self.stopped(),
            Event::Live(live::Event::Frame { info, dropped, images }) => {
                self.model.dropped_frames = dropped;
                // A frame out of a log has no pixels, and nothing to show.
                if let Some(images) = images {
                    self.model.frame = Some(LiveFrame { info, images });
                }
            }
            Event::Live(live::Event::Detection(detection)) => {
                if detection.corners.is_some() {
                    self.model.board_seen_s = Some(self.model.now_s);
                }
                self.model.detection = Some(*detection);
                self.look_by_hand();
            }
            Event::Motion(motion::Event::Moved { id, outcome }) => self.moved(id, outcome),
            Event::Guided(guided::Event::Chosen { id, outcome }) => self.guided_chosen(id, outcome),
            Event::ByHand(by_hand::Event::ViewChosen { number, choice }) => self.view_chosen(number, *choice),
            Event::Taught(taught::Event::Planned { id, views }) => self.planned(id, views),
            Event::Motion(motion::Event::JogEnded { why }) => self.jog_ended(why),
            Event::Capture(capture::Event::Waits { number, wait }) => self.capture_waits(number, wait),
            Event::Capture(capture::Event::Refused { number, refused }) => self.capture_refused(number, refused),
            Event::Capture(capture::Event::Captured { number, id }) => {
                self.captured(number, id);
                self.forget_typed_pose();
            }
            Event::Session(session::Event::Document(state)) => self.document_changed(*state),
            Event::Session(session::Event::Opened { exported }) => self.session_opened(exported),
            Event::Session(session::Event::Failed { why }) => self.session_failed(why),
            Event::Import(import::Event::NoSession(path)) => self.import(path),
            Event::Import(import::Event::Progress { number, work }) => self.import_progress(number, work),
            Event::Import(import::Event::Looked { number, found, trouble }) => {
                self.recording_looked(number, found, trouble)
            }
            Event::Import(import::Event::Converted { number, converted }) => {
                self.recording_converted(number, converted)
            }
            Event::Session(session::Event::Observed { id, target, observed }) => self.observed(id, target, observed),
            Event::Session(session::Event::Review { id, images }) => self.reviewed(id, images),
            Event::Session(session::Event::Folder(listing)) => self.model.folder = Some(listing),
            Event::Session(session::Event::Recent(recent)) => self.model.recent = recent,
            Event::Taught(taught::Event::Read { poses }) => self.poses_read(poses),
            Event::Solve(solve::Event::Progress { job, stage, part }) => self.solve_progress(job, stage, part),
            Event::Solve(solve::Event::Ended { job, outcome }) => self.solve_ended(job, outcome),
            Event::Export(export::Event::Previews(previews)) => {
                self.model.export.previews = previews.into_iter().collect()
            }
            Event::Export(export::Event::Written(written)) => self.written(written),
            Event::Track(track::Event::Tracked(tracked)) => self.tracked(tracked),
            Event::Track(track::Event::Failed { why }) => self.track_failed(why),
            Event::Track(track::Event::Follow(status)) => self.follow_goes(status),
            Event::Recording(recording::Event::Rerun(state)) => self.model.rerun = state,
            Event::Recording(recording::Event::NoBrowser) => self.show_rerun_address(),
            Event::Messages(messages::Event::Notice { severity, text }) => self.say(severity, text),
        }
        self.guided_step();
        self.guided_by_hand_step();
        self.fit_scene();
    }

    /// Has the settings written.
    pub fn write_settings(&mut self, settings: SettingsWrite) {
        let asked = self.desk.files(FileTask::Settings(settings));
        self.expect(text!("The settings were not written"), asked);
    }

    /// Tells the user when a worker did not take a request.
    pub(crate) fn expect<Refused>(&mut self, failure: handeye_wording::Text, asked: Result<(), Refused>) {
        if let Err(_refused) = asked {
            let text = text!("{failure}: the connection does not answer; wait until it is back", failure = failure);
            self.say(Severity::Warning, text);
        }
    }
}

#[cfg(test)]
mod motion_tests;
#[cfg(test)]
mod reasons_tests;
#[cfg(test)]
mod tests;
