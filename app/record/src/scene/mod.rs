//! The scene in the recording: entries of the application become entities of Rerun.
//!
//! One [`SceneWriter`] writes one recording. It keeps what later entries need from earlier ones (camera, board, captures)
//! and nothing else; images of captures are read from the session's folder when they are written.
//!
//! | part | writes |
//! | --- | --- |
//! | `robot` | arm, tip, the way that the tip went |
//! | `items` | cameras and boards of the scene, those that a simulated cell says are true among them |
//! | `camera` | the live camera: image, depths, points in the base |
//! | `captures` | a frustum per capture with image, corners, residuals, boards |
//! | `planned` | poses that guided capture goes to |
//! | `result` | the board as calibrated, uncertainties, numbers, report |
//! | `track` | the board as it is tracked |
//!
//! What happens between captures has no time on the time line `capture`; on it robot and camera are as they were when
//! the capture was taken, so that stepping through it shows one capture after the other.

mod boxes;
mod camera;
mod captures;
mod convert;
mod error;
mod items;
pub mod paths;
mod pen;
mod planned;
mod result;
mod robot;
pub mod style;
mod track;

use std::path::PathBuf;
use std::sync::Arc;

use handeye_arm::{JointKind, JointValues};
use handeye_cell::render::Solid;
use handeye_estimate::handeye::Mode;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_session::{CaptureId, Document};
use rerun::{RecordingStream, TextLog, TextLogLevel};

pub use error::RecordError;

use super::blueprint::Arranged;
use captures::Captures;
use convert::{axes, corner_marks};
use error::Faults;
use handeye_workbench::model::{CellFacts, FrameImages, FrameInfo, LiveDetection, Observed, Severity, Solved, Step};
use handeye_workbench::recording::Entry;
use handeye_workbench::scene::{CameraItem, Extent, Known, PosedArm, Truth, posed_arm};
use items::{write_board, write_camera};
use paths::below;
use pen::{Clock, Instant, Pen};
use planned::Planned;
use robot::Trail;

/// Interval at which depths and points of live images are recorded [s, simulated]: they are ten times the size of the
/// image, and what they show changes slowly.
const DEPTH_EVERY_S: f64 = 1.0;

/// Turns entries into entities, see the [module](self).
#[derive(Debug)]
pub struct SceneWriter {
    clock: Clock,
    known: Known,
    /// The solids of the arm that are written.
    solids: Vec<(usize, Solid)>,
    /// The arm as it was drawn last.
    arm: Option<PosedArm>,
    /// Whether the newest tip is of the newest cell.
    is_placed: bool,
    /// The joints that have names in the plot.
    named_joints: Vec<JointKind>,
    session_trail: Trail,
    connection_trail: Trail,
    captures: Captures,
    planned: Planned,
    /// Number and time \[s\] of the newest image.
    newest_image: Option<(u64, f64)>,
    depth_at_s: Option<f64>,
    /// The far plane of the depth sensor \[m\], once known from an image.
    far_plane_m: Option<f32>,
}

impl Default for SceneWriter {
    fn default() -> Self {
        Self::new()
    }
}

impl SceneWriter {
    /// For an empty recording.
    pub fn new() -> Self {
        Self {
            clock: Clock::default(),
            known: Known::default(),
            solids: Vec::new(),
            arm: None,
            is_placed: false,
            named_joints: Vec::new(),
            session_trail: Trail::new(paths::TRAJECTORY_SESSION, style::PAST_WAY),
            connection_trail: Trail::new(paths::TRAJECTORY_CONNECTION, style::WAY),
            captures: Captures::default(),
            planned: Planned::default(),
            newest_image: None,
            depth_at_s: None,
            far_plane_m: None,
        }
    }

    /// What exists at all times: axes of the world, names of series. Once per recording, before anything else.
    ///
    /// # Errors
    /// [`RecordError::Stream`].
    pub fn begin(rec: &RecordingStream) -> Result<(), RecordError> {
        let pen = Pen::new(rec);
        pen.write_static("/", &rerun::ViewCoordinates::RIGHT_HAND_Z_UP())?;
        pen.write_static(paths::BASE, &axes(style::LARGE_AXES))?;
        for (path, name) in result::SERIES {
            pen.write_static(path, &result::named(name))?;
        }
        Ok(())
    }

    /// Writes the content of an entry, on the time lines of [`paths`]. The stream may differ from call to call, as long
    /// as all of them belong to one recording.
    ///
    /// # Errors
    /// [`RecordError::Stream`] when the recording takes nothing more. Other errors concern one image or document, and
    /// the rest of the entry is written.
    pub fn write(&mut self, rec: &RecordingStream, entry: &Entry) -> Result<(), RecordError> {
        let pen = Pen::new(rec);
        match entry {
            Entry::Cell(facts) => self.cell(pen, facts),
            Entry::Robot { sim_time_s, base_from_tip, joints_rad } => {
                self.robot(pen, *sim_time_s, base_from_tip, joints_rad)
            }
            Entry::Image { info, images } => self.image(pen, info, images),
            Entry::Detection(detection) => self.detection(pen, detection),
            Entry::Document { folder, document } => self.document(pen, folder.clone(), document),
            Entry::Observed { id, observed } => self.observed(pen, *id, observed),
            Entry::Solved(solved) => self.solved(pen, solved),
            Entry::Tracked(tracked) => {
                self.clock.tick(tracked.update.time_s);
                let known = &mut self.known;
                known.base_from_target_tracked = tracked.update.estimate.as_ref().map(|it| it.base_from_target);
                known.base_from_target_true = tracked.truth.or(known.base_from_target_true);
                pen.at(self.clock.live());
                track::write(pen, &self.known, tracked)
            }
            Entry::Planned(poses) => {
                pen.at(self.clock.now());
                self.planned.write(pen, &self.known, poses)
            }
            Entry::KeepOut { scene_obstacles, own } => {
                pen.at(self.clock.now());
                boxes::write(pen, scene_obstacles, own)
            }
            Entry::Selected(ids) => self.selected(pen, ids),
            // The arrangement of the viewer is not part of the scene, see `blueprint`.
            Entry::Step(_) => Ok(()),
            Entry::Message { severity, words } => {
                pen.at(self.clock.now());
                let level = match severity {
                    Severity::Info => TextLogLevel::INFO,
                    Severity::Warning => TextLogLevel::WARN,
                    Severity::Error => TextLogLevel::ERROR,
                };
                pen.write(paths::LOG, &TextLog::new(words.as_str()).with_level(level))
            }
        }
    }

    /// What there is to show in a step.
    pub fn arranged(&self, step: Step) -> Arranged {
        let has_joints = self.known.cell.as_ref().is_none_or(|cell| !cell.joints.is_empty());
        Arranged { step, is_eye_to_hand: self.known.mode() == Mode::EyeToHand, has_joints }
    }

    /// How much room all of it takes; `None` before it is known where anything is.
    pub fn extent(&self) -> Option<Extent> {
        // The tip of the previous cell is not where the arm of this one is.
        let is_known = self.known.cell.is_none() || self.is_placed;
        is_known.then(|| Extent::of(&self.known, self.arm.as_ref(), self.captures.tips())).flatten()
    }

    fn cell(&mut self, pen: Pen<'_>, facts: &Arc<CellFacts>) -> Result<(), RecordError> {
        self.known.cell = Some(CellFacts::clone(facts));
        self.arm = None;
        self.is_placed = false;
        self.known.base_from_target_true = None;
        pen.at(self.clock.now());
        self.connection_trail.restart(pen)?;
        if self.known.truth().is_none() {
            pen.clear(paths::TRUTH)?;
        }
        self.surroundings(pen)
    }

    /// What follows from cell, document and calibration together.
    fn surroundings(&self, pen: Pen<'_>) -> Result<(), RecordError> {
        write_camera(pen, &self.known, self.known.camera())?;
        if self.known.base_from_tip.is_some() { self.truth(pen) } else { Ok(()) }
    }

    /// Camera and board where they truly are; nothing if the cell does not report it.
    fn truth(&self, pen: Pen<'_>) -> Result<(), RecordError> {
        write_camera(pen, &self.known, self.known.true_camera())?;
        write_board(pen, &self.known, self.known.true_board())
    }

    fn robot(
        &mut self,
        pen: Pen<'_>,
        sim_time_s: f64,
        base_from_tip: &Pose<Base, Tip>,
        joints: &JointValues,
    ) -> Result<(), RecordError> {
        self.clock.tick(sim_time_s);
        pen.at(self.clock.live());
        self.tip(pen, base_from_tip, Some(joints))?;
        self.joints(pen, joints)?;
        // The trail is one line on every time line.
        pen.at(self.clock.now());
        self.trails(pen, base_from_tip)
    }

    fn tip(
        &mut self,
        pen: Pen<'_>,
        base_from_tip: &Pose<Base, Tip>,
        joints: Option<&[f64]>,
    ) -> Result<(), RecordError> {
        let is_first = self.known.base_from_tip.replace(*base_from_tip).is_none();
        self.is_placed = true;
        pen.frame(paths::TIP, base_from_tip.isometry(), style::LARGE_AXES)?;
        if let Some(arm) = joints.and_then(|joints| posed_arm(self.known.cell.as_ref(), base_from_tip, joints)) {
            if self.solids != arm.bodies {
                robot::write_solids(pen, &arm.bodies, &self.solids)?;
                self.solids.clone_from(&arm.bodies);
            }
            robot::write_arm(pen, &arm)?;
            self.arm = Some(arm);
        }
        if is_first {
            self.truth(pen)
        } else {
            // Its lens is unchanged.
            let camera = self.known.true_camera();
            write_camera(pen, &self.known, camera.map(|camera| CameraItem { shape: None, ..camera }))
        }
    }

    fn joints(&mut self, pen: Pen<'_>, joints: &[f64]) -> Result<(), RecordError> {
        let cell = self.known.cell.as_ref();
        let kind = |i: usize| cell.and_then(|cell| cell.joints.get(i)).map_or(JointKind::Revolute, |joint| joint.kind);
        robot::write_joints(pen, joints, kind, &mut self.named_joints)
    }

    fn trails(&mut self, pen: Pen<'_>, base_from_tip: &Pose<Base, Tip>) -> Result<(), RecordError> {
        let to = base_from_tip.translation();
        self.session_trail.go(pen, &to)?;
        self.connection_trail.go(pen, &to)
    }

    fn image(&mut self, pen: Pen<'_>, info: &FrameInfo, images: &FrameImages) -> Result<(), RecordError> {
        self.clock.tick(info.sim_time_s);
        self.newest_image = Some((info.number, self.clock.sim_time_s));
        self.far_plane_m = Some(info.far_plane_m);
        pen.at(self.clock.live());
        if let Some(base_from_tip) = &info.base_from_tip {
            self.tip(pen, base_from_tip, Some(&info.joints_rad))?;
        }
        if info.base_from_target_true.is_some() {
            self.known.base_from_target_true = info.base_from_target_true;
            write_board(pen, &self.known, self.known.true_board())?;
        }
        let mut faults = Faults::default();
        faults.tolerate(camera::write_image(pen, &self.known, &images.rgb))?;
        let Some(base_from_tip) = &info.base_from_tip else { return faults.finish() };
        camera::write_prediction(pen, &self.known, base_from_tip)?;
        let age_s = self.depth_at_s.map(|at| self.clock.sim_time_s - at);
        // A negative age means that the simulation was restarted.
        if age_s.is_none_or(|age| !(0.0..DEPTH_EVERY_S).contains(&age)) {
            self.depth_at_s = Some(self.clock.sim_time_s);
            if let Some(depth) = &images.depth {
                let images = (&depth.metres, &images.rgb);
                faults.tolerate(camera::write_depth(
                    pen,
                    &self.known,
                    Some(base_from_tip),
                    images,
                    self.far_plane_m,
                ))?;
            }
        }
        faults.finish()
    }

    fn detection(&mut self, pen: Pen<'_>, detection: &LiveDetection) -> Result<(), RecordError> {
        let of_image = self.newest_image.filter(|(number, _)| *number == detection.frame);
        let live = self.clock.live();
        pen.at(Instant { sim_time_s: of_image.map_or(live.sim_time_s, |(_, time)| Some(time)), ..live });
        let corners = detection.corners.as_deref().unwrap_or_default();
        pen.write(&below(&camera::lens(&self.known), paths::CORNERS), &corner_marks(corners, style::SEEN))?;
        result::number(pen, paths::PLOT_SEARCH, Some(detection.took_s * 1e3))?;
        let board = below(paths::camera(self.known.mode()), paths::SEEN_BOARD);
        let seen = detection.camera_from_target.filter(|_| self.known.mount().is_some());
        pen.frame_if(&board, seen.as_ref(), style::SMALL_AXES)
    }

    fn document(&mut self, pen: Pen<'_>, folder: Option<PathBuf>, document: &Arc<Document>) -> Result<(), RecordError> {
        let mode_before = self.known.mode();
        let meta = &document.meta;
        self.known.target = Some(meta.target);
        self.known.document_mode = Some(meta.mode);
        self.known.document_truth = meta
            .ground_truth
            .as_ref()
            .and_then(|truth| Some(Truth::of_links(&truth.links(meta.mode)?, truth.intrinsics)));
        // Camera and truth as they were before the first of the new captures.
        pen.at(self.clock.now());
        if self.known.mode() != mode_before {
            pen.clear(paths::camera(mode_before))?;
            pen.clear(paths::board(mode_before))?;
        }
        self.surroundings(pen)?;
        let changes = self.captures.update(folder, document, &mut self.clock);
        pen.at(self.clock.now());
        for id in &changes.gone {
            pen.clear(&paths::capture(*id))?;
        }
        let mut faults = Faults::default();
        for id in changes.new {
            self.new_capture(pen, id, &mut faults)?;
        }
        pen.at(self.clock.now());
        for shown in changes.changed.iter().filter_map(|id| self.captures.get(*id)) {
            self.captures.write_place(pen, &self.known, shown)?;
        }
        faults.finish()
    }

    /// A capture with its image; on the time line of captures also robot and camera as they were.
    fn new_capture(&mut self, pen: Pen<'_>, id: CaptureId, faults: &mut Faults) -> Result<(), RecordError> {
        let Some(shown) = self.captures.get(id) else { return Ok(()) };
        let (record, taken) = (shown.record.clone(), shown.taken);
        let is_live = self.clock.is_live;
        // Robot and camera that are seen live are elsewhere by now.
        let as_taken = Instant { sim_time_s: taken.sim_time_s.filter(|_| !is_live), ..taken };
        pen.at(as_taken);
        let live_tip = self.known.base_from_tip;
        if let Some(taken_at) = &record.base_from_tip {
            self.tip(pen, taken_at, record.joints_rad.as_deref())?;
        }
        self.joints(pen, record.joints_rad.as_deref().unwrap_or_default())?;
        if is_live {
            self.known.base_from_tip = live_tip;
        } else if let Some(taken_at) = &record.base_from_tip {
            self.trails(pen, taken_at)?;
        }
        let image = self.captures.image(&record);
        if let Ok(Some(image)) = &image {
            pen.write(&below(&camera::lens(&self.known), paths::IMAGE), image)?;
        }
        match self.captures.depth(&record) {
            Ok(Some((depth, rgb))) => {
                let (tip, images) = (record.base_from_tip.as_ref(), (&depth, &rgb));
                faults.tolerate(camera::write_depth(pen, &self.known, tip, images, self.far_plane_m))?;
            }
            Ok(None) => {}
            Err(error) => faults.tolerate(Err(error))?,
        }
        pen.at(taken);
        if let Some(shown) = self.captures.get(id) {
            self.captures.write_place(pen, &self.known, shown)?;
            // The corners of one that comes back are known already.
            if shown.corners.is_some() {
                Captures::write_marks(pen, &self.known, shown, &below(&paths::capture(id), paths::LENS))?;
                Captures::write_boards(pen, &self.known, shown)?;
            }
        }
        match image {
            Ok(Some(image)) => {
                let lens = below(&paths::capture(id), paths::LENS);
                pen.write(&below(&lens, paths::IMAGE), &image)
            }
            Ok(None) => Ok(()),
            Err(error) => faults.tolerate(Err(error)),
        }
    }

    fn observed(&mut self, pen: Pen<'_>, id: CaptureId, observed: &Observed) -> Result<(), RecordError> {
        let is_live = self.clock.is_live;
        let Some(shown) = self.captures.observe(id, observed.corners.clone()) else { return Ok(()) };
        pen.at(shown.taken);
        Captures::write_marks(pen, &self.known, shown, &below(&paths::capture(id), paths::LENS))?;
        Captures::write_boards(pen, &self.known, shown)?;
        pen.at(Instant { sim_time_s: shown.taken.sim_time_s.filter(|_| !is_live), ..shown.taken });
        let corners = shown.corners.as_deref().unwrap_or_default();
        pen.write(&below(&camera::lens(&self.known), paths::CORNERS), &corner_marks(corners, style::SEEN))
    }

    fn solved(&mut self, pen: Pen<'_>, solved: &Arc<Solved>) -> Result<(), RecordError> {
        self.known.solved = Some(Arc::clone(solved));
        pen.at(self.clock.now());
        let mut faults = Faults::default();
        faults.tolerate(result::write(pen, &self.known, solved))?;
        if let Some(tip) = &self.known.base_from_tip {
            self.truth(pen)?;
            camera::write_prediction(pen, &self.known, tip)?;
        }
        self.captures.write_all(pen, &self.known)?;
        faults.finish()
    }

    fn selected(&mut self, pen: Pen<'_>, ids: &[CaptureId]) -> Result<(), RecordError> {
        pen.at(self.clock.now());
        let changed = self.captures.select(ids);
        for shown in changed.iter().filter_map(|id| self.captures.get(*id)) {
            self.captures.write_place(pen, &self.known, shown)?;
        }
        let Some(shown) = self.captures.newest_selected() else { return pen.clear(paths::SELECTED) };
        Captures::write_marks(pen, &self.known, shown, paths::SELECTED)?;
        match self.captures.image(&shown.record)? {
            Some(image) => pen.write(&below(paths::SELECTED, paths::IMAGE), &image),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests;
