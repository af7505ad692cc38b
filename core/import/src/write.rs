//! An interpreted recording as a dataset folder. Comments in `dataset.toml` state the source of each convention.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use super::camera::chosen as chosen_camera;
use super::conventions::AngleUnit;
use super::error::ImportError;
use super::folder::unreadable;
use super::hypothesis::{Hypothesis, Source};
use super::judge::Judgement;
use super::recording::{FoundCamera, ImageFile, Recording, Stream, Track};
use super::settings::Settings;
use super::sight::{recorded_corners, size_of_points};
use handeye_dataset::CameraInput;
use handeye_dataset::write::{
    Joints, POSE_TABLE, Robot, description, description_of_images, pose_table, pose_table_with_joints,
};
use handeye_estimate::diagnose::hypotheses::rules_out;
use handeye_files::atomic_file;
use handeye_files::own_folder::{self, DESCRIPTION};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::targets::observation::{Corner, Corners};
use handeye_geometry::targets::{AprilTag, Dictionary, TargetSpec};
use handeye_wording::one_line;

/// Name of the table of the target's poses.
const TARGET_POSES: &str = "target_poses.csv";
/// Name of the table of recorded corners.
const CORNERS: &str = "corners.csv";
/// Folder of the images.
const IMAGES: &str = "images";

/// Everything to write, complete before the first file is written.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The text of `dataset.toml`.
    pub description: String,
    /// The text of `poses.csv`, where there is a robot.
    pub poses: Option<String>,
    /// The text of `target_poses.csv`, where there are no images.
    pub target_poses: Option<String>,
    /// The text of `corners.csv`, where recorded corners replace images.
    pub corners: Option<String>,
    /// Images to copy, and their names in the data set.
    pub images: Vec<(PathBuf, String)>,
    /// Views that are written.
    pub views: usize,
    /// Poses and images that are not, and why.
    pub left_out: Vec<String>,
}

/// Input of a plan in addition to the hypothesis.
pub struct Context<'a> {
    /// The recording that is written as a data set.
    pub recording: &'a Recording,
    /// All that was tried.
    pub judgement: &'a Judgement,
    /// Choices of the user.
    pub settings: &'a Settings,
    /// The target; `None` where only its poses are known.
    pub target: Option<(TargetSpec, String)>,
    /// The camera, where one is taken as known.
    pub camera: Option<FoundCamera>,
    /// Whether the user has selected this hypothesis out of several.
    pub is_taken: bool,
}

/// Plans the folder of a hypothesis. With `link_to` images stay where they are and are named relative to that folder.
pub fn plan(h: &Hypothesis, known: &Context<'_>, link_to: Option<&Path>) -> Plan {
    let recording = known.recording;
    let track = &recording.tracks[h.robot];
    let disagreeing: BTreeSet<usize> = h.fit.iter().flat_map(|fit| fit.disagreeing.iter().map(|(s, _)| *s)).collect();
    let mut left_out = Vec::new();
    let mut names = Names { link_to, root: &recording.root, taken: BTreeSet::new() };
    let mut images = Vec::new();
    let mut rows: Vec<(String, Pose<Base, Tip>, Vec<f64>)> = Vec::new();
    let mut target_rows = Vec::new();
    let recorded = RecordedCorners::of(h, known);
    let mut corner_rows = recorded.as_ref().map(|_| String::from("image,column,row,u,v\n"));
    let joint_unit = known.settings.joint_unit.map_or(1.0, AngleUnit::radians);
    for (index, (sample, image)) in track.samples.iter().zip(&h.pairing.image_of).enumerate() {
        let Some(image) = *image else {
            left_out.push(format!("{}: no image belongs to it", sample.place));
            continue;
        };
        if disagreeing.contains(&index) {
            let off = h.fit.iter().flat_map(|f| &f.disagreeing).find(|(s, _)| *s == index).map_or(0.0, |(_, m)| *m);
            left_out.push(format!(
                "{} with {}: the target is {:.1} mm from where this pose puts it",
                sample.place,
                image_name(recording, h.source, image),
                off * 1e3
            ));
            continue;
        }
        let Some(base_from_tip) = h.base_from_tip(sample) else {
            left_out.push(format!("{}: its numbers are no pose", sample.place));
            continue;
        };
        let name = match h.source {
            Source::Stream(i) => {
                let path = &recording.streams[i].images[image].path;
                if let (Some(recorded), Some(text)) = (&recorded, &mut corner_rows) {
                    let name = format!("view_{:04}", rows.len() + 1);
                    if !recorded.write(image, &name, text) {
                        left_out.push(format!("{}: it has no corners", image_name(recording, h.source, image)));
                        continue;
                    }
                    name
                } else if let Some(linked) = names.linked(path) {
                    linked
                } else {
                    let name = names.of(path, images.len());
                    images.push((recording.root.join(path), name.clone()));
                    name
                }
            }
            Source::Track(i) => {
                let name = format!("view_{:04}", rows.len() + 1);
                let sample = &recording.tracks[i].samples[image];
                let Some(seen) = h.camera_from_target(sample) else {
                    left_out.push(format!("{}: its numbers are no pose", sample.place));
                    continue;
                };
                target_rows.push((name.clone(), Pose::<Base, Tip>::from_isometry(seen)));
                name
            }
        };
        let joints = sample.joints.iter().map(|value| value * joint_unit).collect();
        rows.push((name, base_from_tip, joints));
    }
    if let Source::Stream(i) = h.source {
        let stream = &recording.streams[i];
        for image in h.pairing.without_pose(stream.images.len()) {
            left_out.push(format!("{}: no pose belongs to it", stream.images[image].shown()));
        }
    }
    let joints = rows.first().map_or(0, |(.., joints)| joints.len());
    let with_joints =
        known.settings.joint_unit.is_some() && joints > 0 && rows.iter().all(|(.., each)| each.len() == joints);
    let poses = if with_joints {
        pose_table_with_joints(joints, rows.iter().map(|(name, pose, q)| (name.as_str(), pose, q.as_slice())))
    } else {
        pose_table(rows.iter().map(|(name, pose, _)| (name.as_str(), pose)))
    };
    let target_poses =
        (!target_rows.is_empty()).then(|| pose_table(target_rows.iter().map(|(name, pose)| (name.as_str(), pose))));
    let mut text = comments(h, known, &left_out);
    if joints > 0 && !with_joints {
        comment(&mut text, "Joint values stand with the poses; --set joint_unit=rad or deg takes them over.");
    }
    let (target, is_placeholder) = match &known.target {
        Some((target, _)) => (*target, false),
        None => (PLACEHOLDER, true),
    };
    if is_placeholder {
        comment(
            &mut text,
            "The files do not say what the target is, and its poses stand for it: the tag below is only where errors are \
             stated. Describe the true target to have them stated there.",
        );
    }
    text.push('\n');
    let camera = known.camera.as_ref().map(|camera| CameraInput {
        fixed: true,
        accuracy_px: None,
        intrinsics: Some(camera.intrinsics),
        model: camera.intrinsics.distortion,
    });
    let robot = Robot { joints: with_joints.then_some(Joints::Count(joints)), ..Robot::default() };
    let body = description(h.mode, &target, camera.as_ref(), robot);
    if let Some(recorded) = &recorded {
        let key = format!("corners = \"{CORNERS}\"\n\n[robot]");
        text.push_str(&body.replacen("\n[robot]", &key, 1));
        if camera.is_none() {
            let (width, height) = recorded.size;
            let _ok = write!(text, "\n[camera]\nfixed = false\nwidth = {width}\nheight = {height}\n").is_ok();
        }
    } else if target_poses.is_some() {
        let key = format!("poses = \"{TARGET_POSES}\"\npose = \"camera_from_target\"\n\n[robot]");
        text.push_str(&body.replacen("\n[robot]", &key, 1));
    } else {
        text.push_str(&body);
    }
    Plan {
        description: text,
        poses: Some(poses),
        target_poses,
        corners: corner_rows,
        images,
        views: rows.len(),
        left_out,
    }
}

/// Plans the folder of images alone, to calibrate the camera by itself: those that the user named, or else those of the stream that
/// has most; what is not taken is reported. A lens that files describe is where the estimate starts, with its model. `None` where
/// there are no images; depth images do not count.
pub fn plan_images(recording: &Recording, settings: &Settings, target: &(TargetSpec, String)) -> Option<Plan> {
    let photographs = (0..recording.streams.len()).filter(|i| recording.has_photographs(*i));
    let streams: Vec<&Stream> = photographs.map(|i| &recording.streams[i]).collect();
    let stream = *match &settings.images {
        Some(name) => streams.iter().find(|stream| stream.name == *name),
        None => streams.iter().rev().max_by_key(|stream| stream.images.len()),
    }?;
    let others = streams.iter().filter(|other| other.name != stream.name);
    let mut left_out: Vec<String> = others
        .map(|other| format!("{} images {}: another camera or another series", other.images.len(), other.name))
        .collect();
    let copies = stream.images.iter().filter_map(|image| Some((image, &stream.images[image.same_as?])));
    left_out.extend(copies.map(|(copy, image)| format!("{}: a copy of {}", copy.shown(), image.shown())));
    let camera = chosen_camera(recording, stream.size, settings).ok().and_then(|(camera, _)| camera);
    let camera = camera.map(|camera| CameraInput {
        fixed: false,
        accuracy_px: None,
        intrinsics: Some(camera.intrinsics),
        model: camera.intrinsics.distortion,
    });
    let mut names = Names { link_to: None, root: &recording.root, taken: BTreeSet::new() };
    let named = |(index, image): (usize, &ImageFile)| (recording.root.join(&image.path), names.of(&image.path, index));
    let images: Vec<_> = stream.images.iter().filter(|it| it.same_as.is_none()).enumerate().map(named).collect();
    let (target, why) = target;
    let mut text = String::new();
    comment(&mut text, format!("Images alone, without a robot: {}. The target is {why}.", stream.name));
    text.push_str(&description_of_images(images.iter().map(|(_, name)| name.as_str()), target, camera.as_ref()));
    let views = images.len();
    Some(Plan { description: text, poses: None, target_poses: None, corners: None, images, views, left_out })
}

/// Corners that replace images, and the image size.
struct RecordedCorners {
    views: Vec<Option<Corners>>,
    columns: usize,
    size: (u32, u32),
}

impl RecordedCorners {
    fn of(h: &Hypothesis, known: &Context<'_>) -> Option<Self> {
        let Source::Stream(i) = h.source else { return None };
        let stream = known.recording.streams.get(i).filter(|stream| stream.points.is_some())?;
        let (target, _) = known.target.as_ref()?;
        // With this hypothesis they were read already.
        let views = recorded_corners(stream, target).ok()?;
        let size = size_of_points(stream, known.settings.image_size).ok()?;
        Some(Self { views, columns: target.grid().columns, size })
    }

    /// Writes the rows of a view; whether it has some.
    fn write(&self, view: usize, name: &str, text: &mut String) -> bool {
        let Some(Some(corners)) = self.views.get(view) else { return false };
        for Corner { index, px, .. } in corners {
            let (column, row) = (index % self.columns, index / self.columns);
            // Writing to a string cannot fail.
            let _ok = writeln!(text, "{name},{column},{row},{:?},{:?}", px.x, px.y).is_ok();
        }
        true
    }
}

/// Replaces a target of which only the poses are known.
const PLACEHOLDER: TargetSpec =
    TargetSpec::AprilTag(AprilTag { tag_m: 0.1, id: 0, family: Dictionary::APRILTAG_36H11, border_bits: None });

fn image_name(recording: &Recording, source: Source, image: usize) -> String {
    match source {
        Source::Stream(i) => recording.streams[i].images[image].shown(),
        Source::Track(i) => recording.tracks[i].samples[image].place.to_string(),
    }
}

/// Names of images in the data set.
struct Names<'a> {
    link_to: Option<&'a Path>,
    root: &'a Path,
    taken: BTreeSet<String>,
}

impl Names<'_> {
    /// Path relative to the data set, if the file stays where it is. Unpacked files do not.
    fn linked(&self, path: &Path) -> Option<String> {
        self.link_to.filter(|_| path.is_relative()).and_then(|folder| relative(&self.root.join(path), folder))
    }

    fn of(&mut self, path: &Path, index: usize) -> String {
        let ending = path.extension().map(|e| e.to_string_lossy().into_owned()).unwrap_or_default();
        let file = path.file_name().and_then(|name| name.to_str());
        let whole = path.to_str().map(|path| path.replace(['/', '\\'], "_"));
        // Files of two folders may have the same names, and a name may not be valid text.
        let candidates = [file.map(str::to_owned), whole, Some(format!("image_{:05}.{ending}", index + 1))];
        let free = candidates.into_iter().flatten().find(|name| !self.taken.contains(&name.to_lowercase()));
        let name = free.unwrap_or_else(|| format!("image_{:05}_{}.{ending}", index + 1, self.taken.len()));
        self.taken.insert(name.to_lowercase());
        format!("{IMAGES}/{name}")
    }
}

/// A path relative to a folder; `None` where there is none, or it is not valid text.
fn relative(path: &Path, folder: &Path) -> Option<String> {
    let path = path.canonicalize().ok()?;
    let folder = folder.canonicalize().ok()?;
    let same = path.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    let mut out = PathBuf::new();
    for _ in folder.components().skip(same) {
        out.push("..");
    }
    out.extend(path.components().skip(same));
    out.to_str().map(str::to_owned)
}

fn comment(text: &mut String, line: impl std::fmt::Display) {
    // A comment is on one line, whatever the name of a file is. Writing to a string cannot fail.
    let line = one_line(&line).replace(char::is_control, " ");
    let _ok = writeln!(text, "# {line}").is_ok();
}

fn comments(h: &Hypothesis, known: &Context<'_>, left_out: &[String]) -> String {
    let mut text = String::new();
    comment(&mut text, "Imported by handeye. Poses are converted to metres and quaternions; their sources:");
    for belief in &known.recording.beliefs {
        comment(&mut text, format_args!("  {belief}"));
    }
    for warning in &known.recording.warnings {
        comment(&mut text, format_args!("  note: {warning}"));
    }
    comment(&mut text, "How they were understood, and why:");
    for convention in h.conventions(known.recording) {
        let why = provenance(convention.key, &convention.value, h, known);
        comment(&mut text, format_args!("  {} = {} ({}): {why}", convention.key, convention.value, convention.means));
    }
    for other in &h.same_as {
        comment(&mut text, format_args!("  {other} would give the same poses"));
    }
    if let Some(fit) = &h.fit {
        comment(
            &mut text,
            format_args!(
                "So understood, half of the {} views agree to {:.2} mm and {:.3}° or better.",
                fit.views,
                fit.median_m * 1e3,
                fit.median_rad.to_degrees()
            ),
        );
    }
    if known.is_taken {
        comment(&mut text, "Taken by --take out of several hypotheses; the recording alone did not decide.");
    }
    if let Some((_, why)) = &known.target {
        comment(&mut text, format_args!("  target: {why}"));
    }
    if let Some(camera) = &known.camera {
        comment(&mut text, format_args!("  camera: {}, {}; fixed = false estimates it again", camera.name, camera.why));
    }
    if !left_out.is_empty() {
        comment(&mut text, format_args!("Not written ({}):", left_out.len()));
        for line in left_out {
            comment(&mut text, format_args!("  {line}"));
        }
    }
    text
}

/// Why a convention is as it is.
pub fn provenance(key: &str, value: &str, h: &Hypothesis, known: &Context<'_>) -> String {
    let settings = known.settings;
    let is_set = match key {
        "mode" => settings.mode.is_some(),
        "pose" => settings.direction.is_some(),
        "length_unit" => settings.length.is_some(),
        "rotation" => settings.rotation.is_some(),
        "angle_unit" => settings.angle.is_some(),
        "pairing" => settings.pairing.is_some(),
        "images" => settings.images.is_some(),
        "poses" => settings.poses.is_some(),
        "target_poses" => settings.target_poses.is_some(),
        "target_pose" => settings.target_direction.is_some(),
        "target_length_unit" => settings.target_length.is_some(),
        "target_rotation" => settings.target_rotation.is_some(),
        _ => false,
    };
    if is_set {
        return "given with --set".into();
    }
    if let Some(why) = stated(key, h, known.recording) {
        return why;
    }
    // The residual of each relative to the target's distance, and as text.
    let left = |h: &Hypothesis| h.fit.as_ref().map(|fit| (fit.relative, format!("{:.2} mm", fit.median_m * 1e3)));
    let (own, own_stated) = left(h).unwrap_or((f64::INFINITY, "nothing".into()));
    let other = known.judgement.hypotheses.iter().filter_map(|other| {
        let convention = other.conventions(known.recording).into_iter().find(|c| c.key == key)?;
        let (relative, reported) = left(other)?;
        let why = other.contradictions.first().cloned();
        (convention.value != value).then_some((relative, reported, convention.value, why))
    });
    match other.min_by(|a, b| a.0.total_cmp(&b.0)) {
        None => "nothing else is possible with these files, or explains the views nearly as well".into(),
        Some((relative, reported, value, _)) if rules_out(own, relative) => {
            format!("by the data: it leaves {own_stated}, {value} leaves {reported}")
        }
        Some((.., value, Some(why))) => format!("by the data: {value} is contradicted: {why}"),
        Some((_, reported, value, None)) => {
            format!("not decided by the data: it leaves {own_stated}, {value} leaves {reported}")
        }
    }
}

/// Conventions that files state.
pub(super) fn stated(key: &str, h: &Hypothesis, recording: &Recording) -> Option<String> {
    let robot = &recording.tracks[h.robot].stated;
    let target = match h.source {
        Source::Track(i) => Some(&recording.tracks[i].stated),
        Source::Stream(_) => None,
    };
    match key {
        "mode" => recording.mode.as_ref().map(|found| found.why().to_string()),
        "pose" => robot
            .direction
            .as_ref()
            .map(|k| k.why.clone())
            .or_else(|| robot.direction_in.as_ref().map(|k| k.why.clone())),
        "length_unit" => robot.length.as_ref().map(|k| k.why.clone()),
        "angle_unit" => robot.angle.as_ref().map(|k| k.why.clone()),
        "rotation" => robot.rotation.as_ref().filter(|k| k.value.len() == 1).map(|k| k.why.clone()),
        "target_pose" => target?.direction.as_ref().map(|k| k.why.clone()),
        "target_length_unit" => target?.length.as_ref().map(|k| k.why.clone()),
        "target_rotation" => target?.rotation.as_ref().filter(|k| k.value.len() == 1).map(|k| k.why.clone()),
        "poses" if recording.tracks.iter().filter(|track| is_robots(track)).count() == 1 => {
            Some("there is no other".into())
        }
        "images" if recording.streams.iter().filter(|s| !s.is_depth).count() == 1 => Some("there are no others".into()),
        _ => None,
    }
}

fn is_robots(track: &Track) -> bool {
    track.role != super::Role::Target
}

/// Writes a plan into a new or empty folder. `progress` is called with how many images of how many are written.
///
/// `dataset.toml` comes last, so that an interrupted import is not a data set.
///
/// # Errors
/// [`ImportError::OutNotEmpty`], [`ImportError::Unwritable`], [`ImportError::Unreadable`] for an image.
pub fn write(plan: &Plan, out: &Path, mut progress: impl FnMut(usize, usize)) -> Result<(), ImportError> {
    check_out(out)?;
    let unwritable =
        |file: &Path, e: &std::io::Error| ImportError::Unwritable { file: file.to_path_buf(), why: one_line(e) };
    fs::create_dir_all(out).map_err(|e| unwritable(out, &e))?;
    let put = |name: &str, bytes: &[u8]| {
        let file = out.join(name);
        atomic_file::write(&file, bytes).map_err(|e| unwritable(&file, &e))
    };
    if !plan.images.is_empty() {
        let folder = out.join(IMAGES);
        fs::create_dir(&folder).map_err(|e| unwritable(&folder, &e))?;
        for (i, (from, name)) in plan.images.iter().enumerate() {
            let bytes = own_folder::read(from).map_err(|e| unreadable(from, &e))?;
            put(name, &bytes)?;
            progress(i + 1, plan.images.len());
        }
    }
    if let Some(poses) = &plan.poses {
        put(POSE_TABLE, poses.as_bytes())?;
    }
    if let Some(target_poses) = &plan.target_poses {
        put(TARGET_POSES, target_poses.as_bytes())?;
    }
    if let Some(corners) = &plan.corners {
        put(CORNERS, corners.as_bytes())?;
    }
    put(DESCRIPTION, plan.description.as_bytes())
}

/// Refuses a folder that is not empty, and one that is reached through a link in a user's data.
///
/// # Errors
/// As [`write`](fn@write).
pub fn check_out(out: &Path) -> Result<(), ImportError> {
    let unwritable = |why: String| ImportError::Unwritable { file: out.to_path_buf(), why };
    match fs::read_dir(out) {
        Ok(mut entries) => {
            if entries.next().is_some() {
                return Err(ImportError::OutNotEmpty(out.to_path_buf()));
            }
        }
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            if fs::symlink_metadata(out).is_ok() {
                return Err(unwritable("it is a link to nothing".into()));
            }
        }
        Err(e) => return Err(unwritable(one_line(&e))),
    }
    own_folder::check_folder(out).map_err(|e| unwritable(one_line(&e)))
}
