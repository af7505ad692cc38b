//! From the files of a recording to the hypotheses about it: used by both the command line and the window.

use std::path::PathBuf;
use std::sync::Arc;

use handeye_estimate::CameraKnowledge;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::{AprilTag, TargetSpec};
use handeye_import::{
    self as import, FoundCamera, Hypothesis, ImportError, Judgement, Recording, Role, Settings, Sight, Sights, Source,
    Verdict, write,
};

use crate::observe::{self, ObserveError, Progress};
use crate::text::Text;
use handeye_wording::Value;
use handeye_wording::text;

/// Why nothing was made of a recording.
#[derive(Debug, thiserror::Error, handeye_wording::Localized)]
pub enum NotUnderstood {
    /// The files, or the choices.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// The images.
    #[error(transparent)]
    Observe(#[from] ObserveError),
    /// The target is not known, or not in the images; and what to give.
    #[error("{0}")]
    Target(Text),
}

/// What the images of a recording show.
#[derive(Debug)]
pub struct Looked {
    /// The recording with what was derived from it: poses by the chain of an arm, and at the times of images of a moving
    /// robot.
    pub recording: Arc<Recording>,
    /// The target and where it comes from; `None` where only its poses are known.
    pub target: Option<(TargetSpec, String)>,
    /// By stream: its name, in how many images the target was found, and of how many.
    pub seen: Vec<(String, usize, usize)>,
    /// What else the user should know.
    pub notes: Vec<Text>,
    /// Why no image shows the target, where two series may be poses of the robot and of the target all the same.
    unseen: Option<Text>,
    sights: Sights,
    /// By stream, the camera that is taken as known.
    cameras: Vec<Option<FoundCamera>>,
}

impl Looked {
    /// Tries every hypothesis that the files and the settings leave open. Settings that choose what to look at
    /// ([`looks`]) have to be those of [`look`].
    ///
    /// # Errors
    /// [`NotUnderstood`].
    pub fn judge(&self, settings: &Settings, cancel: &CancelToken) -> Result<Judgement, NotUnderstood> {
        let judged = import::judge(&self.recording, &self.sights, settings, cancel);
        if let Some(why) = &self.unseen {
            let is_explained = |judgement: &Judgement| judgement.verdict != Verdict::Unexplained;
            let is_reported = matches!(&judged, Err(ImportError::DidNotMove { .. } | ImportError::BadChoice { .. }));
            if !is_reported && !judged.as_ref().is_ok_and(is_explained) && !cancel.is_cancelled() {
                return Err(NotUnderstood::Target(why.clone()));
            }
        }
        let judgement = judged?;
        if cancel.is_cancelled() { Err(ObserveError::Cancelled.into()) } else { Ok(judgement) }
    }

    /// What goes into the data set in addition to a hypothesis; `is_taken`: the user chose it out of several.
    pub fn context<'a>(
        &'a self,
        judgement: &'a Judgement,
        settings: &'a Settings,
        hypothesis: &Hypothesis,
        is_taken: bool,
    ) -> write::Context<'a> {
        let camera = match hypothesis.source {
            Source::Stream(i) => self.cameras.get(i).cloned().flatten(),
            Source::Track(_) => None,
        };
        let recording = &*self.recording;
        write::Context { recording, judgement, settings, target: self.target.clone(), camera, is_taken }
    }
}

/// The supported formats, one per line.
pub fn formats_text() -> Vec<Text> {
    let line = |(name, endings): (Text, String)| {
        if endings.is_empty() { name } else { text!("{name} ({endings})", name = name, endings = endings) }
    };
    import::formats().into_iter().map(line).collect()
}

/// A note that not everything was tried, and what to do about it.
pub fn untried_text(judgement: &Judgement) -> Text {
    text!(
        "there are more hypotheses than are tried: {untried} of them and {series} pairs of series were left out. Name the series of \
         the robot (poses=NAME) and of the target (target_poses=NAME), or keep one recording in the folder",
        untried = judgement.untried,
        series = judgement.sources_untried
    )
}

/// Whether a setting determines what to look at, and not only what it means: when it changes, the images are searched again.
pub fn looks(key: &str, recording: &Recording) -> bool {
    // The offset of the clocks is estimated for what the user has stated about the poses.
    let is_about_clocks = matches!(key, "mode" | "pose" | "poses" | "clock_offset") && !recording.motions.is_empty();
    is_about_clocks || matches!(key, "images" | "camera" | "target_poses" | "arm" | "image_size")
}

/// Finds the target in the images. `given` is a target that the user names; without it the one that files describe is taken.
///
/// # Errors
/// [`NotUnderstood`].
pub fn look(
    recording: &Arc<Recording>,
    given: Option<TargetSpec>,
    settings: &Settings,
    progress: Progress<'_>,
    cancel: &CancelToken,
) -> Result<Looked, NotUnderstood> {
    let recording = match &settings.arm {
        Some(arm) => Arc::new(import::with_arm(recording, arm)?),
        None => Arc::clone(recording),
    };
    let mut look =
        Look { recording: &recording, settings, progress, cancel, notes: Vec::new(), unseen: None, seen: Vec::new() };
    let target = look.target(given)?;
    let (mut sights, cameras) = look.sights(target.as_ref().map(|(target, _)| *target))?;
    let Look { notes, unseen, seen, .. } = look;
    let recording = match import::timed(&recording, &mut sights, settings, cancel) {
        Err(_) if cancel.is_cancelled() => return Err(ObserveError::Cancelled.into()),
        timed => timed?.map_or(recording, Arc::new),
    };
    Ok(Looked { recording, target, seen, notes, unseen, sights, cameras })
}

struct Look<'a> {
    recording: &'a Recording,
    settings: &'a Settings,
    progress: Progress<'a>,
    cancel: &'a CancelToken,
    notes: Vec<Text>,
    unseen: Option<Text>,
    seen: Vec<(String, usize, usize)>,
}

impl Look<'_> {
    /// The target that was given, or the only one that files describe.
    fn target(&mut self, given: Option<TargetSpec>) -> Result<Option<(TargetSpec, String)>, NotUnderstood> {
        if let Some(target) = given {
            return Ok(Some((target, "given with --target".into())));
        }
        let Some(first) = self.recording.targets.first() else { return Ok(None) };
        if self.recording.targets.iter().any(|found| found.target != first.target) {
            self.notes.push(text!("the files describe several targets: say which it is"));
            return Ok(None);
        }
        let described = format!("described in {}", first.file);
        match first.target {
            TargetSpec::AprilTag(tag) if first.is_id_open => {
                let id = self.tag_in_sight(&tag)?;
                let why = format!("{described}, its number by the images: the only tag of its family in most of them");
                Ok(Some((TargetSpec::AprilTag(AprilTag { id, ..tag }), why)))
            }
            target => Ok(Some((target, described))),
        }
    }

    /// The number of a tag that files describe without it: of the only one that most images show.
    fn tag_in_sight(&self, tag: &AprilTag) -> Result<usize, NotUnderstood> {
        let paths: Vec<PathBuf> = self.streams().into_iter().flat_map(|i| self.recording.image_paths(i)).collect();
        let seen = observe::tags_in_sight(&paths, tag, self.progress, self.cancel)?;
        let often: Vec<usize> = seen.iter().filter(|(_, count)| 2 * **count > paths.len()).map(|(id, _)| *id).collect();
        if let [id] = often[..] {
            return Ok(id);
        }
        let listed = seen.iter().map(|(id, count)| text!("number {id} in {count}", id = id, count = count));
        let listed = if seen.is_empty() { text!("none") } else { Text::list(listed) };
        Err(NotUnderstood::Target(text!(
            "the files do not say which tag of {family} it is, and {images} images show {listed}: give the target as \
             kind=apriltag,tag={tag},family={family},id=N",
            family = tag.family.to_string(),
            images = paths.len(),
            listed = listed,
            tag = tag.tag_m * 1e3
        )))
    }

    /// The streams in which the target may be.
    fn streams(&self) -> Vec<usize> {
        let streams = &self.recording.streams;
        let is_wanted = |i: &usize| match &self.settings.images {
            Some(name) => *name == streams[*i].name,
            None => streams[*i].points.is_some() || self.recording.has_photographs(*i),
        };
        (0..streams.len()).filter(is_wanted).collect()
    }

    /// Finds the target in the images of every stream that may be meant.
    fn sights(&mut self, target: Option<TargetSpec>) -> Result<(Sights, Vec<Option<FoundCamera>>), NotUnderstood> {
        let recording = self.recording;
        let mut sights = Sights { streams: vec![None; recording.streams.len()], target };
        let mut cameras = vec![None; recording.streams.len()];
        let wanted = self.streams();
        let has_robot = !recording.tracks.is_empty() || !recording.motions.is_empty();
        if !has_robot && target.is_none() {
            // The camera alone can be calibrated all the same, with what is in sight.
            for i in wanted.iter().copied().filter(|i| recording.streams[*i].points.is_none()) {
                let (name, paths) = (&recording.streams[i].name, recording.image_paths(i));
                let seen = self.chessboards_in_sight(name, &paths)?;
                self.notes.push(seen);
            }
        }
        if self.settings.target_poses.is_some() || wanted.is_empty() || !has_robot {
            return Ok((sights, cameras));
        }
        let mut troubles: Vec<Text> = Vec::new();
        for i in wanted {
            match self.sight(i, target)? {
                Ok((sight, camera)) => (sights.streams[i], cameras[i]) = (Some(sight), camera),
                Err(why) => troubles.push(why),
            }
        }
        if sights.streams.iter().any(Option::is_some) {
            self.notes.extend(troubles);
        } else {
            self.without_images(target, troubles)?;
        }
        Ok((sights, cameras))
    }

    /// What a stream shows of the target, with the camera that is assumed to be known; or why it is not seen.
    fn sight(
        &mut self,
        i: usize,
        target: Option<TargetSpec>,
    ) -> Result<Result<(Sight, Option<FoundCamera>), Text>, NotUnderstood> {
        let stream = &self.recording.streams[i];
        let paths = self.recording.image_paths(i);
        let trouble = |why: Value| text!("{name}: {why}", name = &stream.name, why = why);
        let Some(target) = target else {
            let Some(points) = &stream.points else { return self.chessboards_in_sight(&stream.name, &paths).map(Err) };
            return Ok(Err(text!(
                "{name} has {count} corners of an image: give the target that has so many, as COLUMNSxROWSxMM",
                name = &stream.name,
                count = points.iter().flatten().next().map_or(0, Vec::len)
            )));
        };
        let size = match &stream.points {
            Some(_) => import::size_of_points(stream, self.settings.image_size),
            None => Ok(stream.size),
        };
        let size = match size {
            Ok(size) => size,
            Err(why) => return Ok(Err(trouble(why.into()))),
        };
        let (camera, note) = import::chosen_camera(self.recording, size, self.settings)?;
        self.notes.extend(note);
        let known = camera.as_ref().map_or(CameraKnowledge::NOTHING, |c| CameraKnowledge::Fixed(c.intrinsics));
        let sight = if let Some(points) = &stream.points {
            self.seen.push((stream.name.clone(), points.iter().flatten().count(), points.len()));
            Sight::of_points(target, stream, Some(size), known)
        } else {
            let corners = match observe::observe_images(&paths, &target, self.progress, self.cancel) {
                Err(ObserveError::Cancelled) => return Err(ObserveError::Cancelled.into()),
                Err(error) => return Ok(Err(trouble(error.into()))),
                Ok(corners) => corners,
            };
            self.seen.push((stream.name.clone(), corners.iter().flatten().count(), corners.len()));
            Sight::of_corners(target, stream.size, known, &corners)
        };
        Ok(sight.map(|sight| (sight, camera)).map_err(|why| trouble(why.into())))
    }

    /// For when no image shows the target: its recorded poses need none.
    fn without_images(&mut self, target: Option<TargetSpec>, troubles: Vec<Text>) -> Result<(), NotUnderstood> {
        let recording = self.recording;
        let instead = text!("the recorded poses of the target are used, and not the images");
        if recording.tracks.iter().any(|track| track.role == Role::Target) {
            // They do not show what the target is, and need not.
            self.notes.extend(if target.is_some() { troubles } else { vec![instead] });
            return Ok(());
        }
        let troubles = Text::list(troubles);
        let why = if target.is_some() {
            text!("the target was not found: {troubles}", troubles = troubles)
        } else {
            text!("the files do not say what was looked at: {troubles}", troubles = troubles)
        };
        // If nothing states what their two series are of, the data decide.
        let may_be = recording.tracks.iter().filter(|track| track.reading_of.is_none());
        let has_pair = may_be.clone().count() >= 2 && may_be.clone().any(|track| track.role != Role::Robot);
        if !has_pair && recording.still.is_empty() {
            return Err(NotUnderstood::Target(why));
        }
        self.notes.push(instead);
        self.unseen = Some(why);
        Ok(())
    }

    /// What chessboards the images of a stream show.
    fn chessboards_in_sight(&self, name: &str, paths: &[PathBuf]) -> Result<Text, NotUnderstood> {
        let seen = observe::chessboards_in_sight(paths, self.progress, self.cancel)?;
        let mut sizes: Vec<((usize, usize), usize)> = seen.into_iter().collect();
        sizes.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        let Some(((columns, rows), _)) = sizes.first() else {
            return Ok(text!("{name} shows no chessboard: name the target", name = name));
        };
        let listed = sizes.iter().take(4).map(|((columns, rows), count)| {
            text!("{columns} × {rows} inner corners in {count}", columns = columns, rows = rows, count = count)
        });
        Ok(text!(
            "{name} shows chessboards of {listed} of {images} images: give the target with its square in mm, as \
             {columns}x{rows}xMM",
            name = name,
            listed = Text::list(listed),
            images = paths.len(),
            columns = columns,
            rows = rows
        ))
    }
}
