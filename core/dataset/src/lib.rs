//! Dataset folders: images, robot poses and `dataset.toml`, which states their conventions.
//!
//! Nothing is guessed and nothing is dropped: a convention that is not stated, a word that is not one of the choices,
//! a row without its image is a [`DatasetError`] that names the file and the row.
//!
//! Columns of pose tables after `image,x,y,z`, in this order:
//!
//! | `rotation` | columns |
//! | --- | --- |
//! | `quaternion_xyzw` | `qx,qy,qz,qw` |
//! | `quaternion_wxyz` | `qw,qx,qy,qz` |
//! | `rotation_vector` | `rx,ry,rz`: axis times angle |
//! | `rpy` | `roll,pitch,yaw` (or `rx,ry,rz`): URDF, R = Rz(yaw)·Ry(pitch)·Rx(roll) |
//! | `matrix` | `r11,r12,r13,r21,…,r33`, row by row |
//!
//! Joint angles follow in columns `q1,q2,…` where `[robot]` states how many there are. With their arm they determine how
//! the tip moves with each joint, see [`DatasetArm`].
//!
//! A quaternion may be 10⁻³ off unit length, a matrix 2·10⁻³ off orthonormal; both are then made exact.
//!
//! # Example
//! ```no_run
//! use std::path::Path;
//!
//! use handeye_dataset::Dataset;
//!
//! let dataset = Dataset::read(Path::new("recording"))?;
//! println!("{} of {}", dataset.target, dataset.folder.display());
//! # Ok::<(), handeye_dataset::DatasetError>(())
//! ```
//!
//! `examples/calibrate_folder.rs` calibrates one. Never depends on a detector, a PDF writer or formats of other tools.

#![warn(missing_docs)]

mod config;
mod corners;
pub mod correct_table;
mod entry;
mod error;
mod images;
mod joints;
mod observations;
mod outside;
pub mod pose_record;
mod poses;
mod target_table;
#[cfg(feature = "taught_poses")]
pub mod taught_poses;
pub mod template;
mod text;
pub mod typed_pose;
mod value;
pub mod write;

pub use entry::Entry;
pub use images::holds_images;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

#[cfg(feature = "pixels")]
use image::{GrayImage, RgbImage};
use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};

use handeye_estimate::handeye::Mode;
use handeye_estimate::placement::{ArmOfViews, PlacementError};
use handeye_estimate::reach_error::USUAL_TOOL;
use handeye_estimate::robot_accuracy::RobotAccuracy;
use handeye_files::bounds::Bounds;
pub use handeye_files::own_folder::DESCRIPTION;
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::natural_order;
use handeye_geometry::targets::TargetSpec;
use handeye_images::ImageFileError;

pub use config::LONGEST_TOOL_M;
use config::{Config, PoseDirection};
use corners::CornerTable;
pub use error::{DatasetError, DatasetProblem};
pub use joints::DatasetArm;
use outside::Outside;
use poses::PoseRow;
use target_table::TargetPoseDirection;
use text::TextFile;

/// A dataset folder, read and checked. The images are not in memory: see [`Dataset::load_rgb`].
#[derive(Debug, Clone)]
pub struct Dataset {
    /// The folder that was read.
    pub folder: PathBuf,
    /// Where the camera is mounted; `None` when there is no robot, so that only intrinsics can be estimated.
    pub mode: Option<Mode>,
    /// The target.
    pub target: TargetSpec,
    /// Prior knowledge of the camera.
    pub camera: Option<CameraInput>,
    /// The views in the order of the pose table, or in natural order of their names when there is none.
    pub entries: Vec<Entry>,
    /// Width and height in pixels of every image; `None` only for pose pairs without images.
    pub image_size: Option<(u32, u32)>,
    /// The arm that the joint angles belong to, and whether they fit the poses; `None` when `[robot.arm]` is absent.
    pub arm: Option<DatasetArm>,
    /// Position of the tool's tip in the frame of the tip, metres, where `[robot]` states it.
    pub tool_m: Option<[f64; 3]>,
    /// Accuracy of the robot, millimetres, see [`RobotAccuracy`].
    pub robot_accuracy_mm: Option<f64>,
    /// Files outside of the folder that the tables name, through `../`.
    pub outside: Vec<String>,
    pose_table: Option<PathBuf>,
    /// Names in the data set of the text files.
    text_files: Vec<String>,
    /// Their SHA-256.
    #[cfg(feature = "digest")]
    text_sha256: Vec<[u8; 32]>,
}

/// Contents of `[camera]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CameraInput {
    /// Whether the intrinsics are known and stay as they are.
    pub fixed: bool,
    /// Accuracy of known intrinsics: displacement of image points by each of their parameters, one standard deviation,
    /// pixels; `None` where they are taken as exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accuracy_px: Option<f64>,
    /// The known intrinsics, or where an estimate starts; always there when `fixed`.
    pub intrinsics: Option<Intrinsics>,
    /// The lens model to use; `brown_conrady` when `[camera]` names none. Its coefficients are those of `intrinsics`,
    /// zero without.
    pub model: Distortion,
}

impl Dataset {
    /// Reads and checks a dataset folder that a user of this machine has named. Only the size of images is read, so that
    /// thousands are no problem.
    ///
    /// # Errors
    /// [`DatasetError`] on the first defect, with file and row.
    pub fn read(folder: &Path) -> Result<Self, DatasetError> {
        Self::read_within(folder, &Bounds::ANYWHERE)
    }

    /// As [`Self::read`], where the files of the data set may name only what is in `bounds`.
    ///
    /// # Errors
    /// As [`Self::read`]; [`DatasetProblem::OutOfReach`] before anything outside is opened.
    pub fn read_within(folder: &Path, bounds: &Bounds) -> Result<Self, DatasetError> {
        check_folder(folder)?;
        let mut outside = Outside::of(folder, bounds);
        outside.look_at(&folder.join(DESCRIPTION), None, DESCRIPTION, Path::new(DESCRIPTION))?;
        let description = TextFile::read(folder, Path::new(DESCRIPTION))?;
        let config = Config::parse(&description.path, &description.text)?;
        let mut table = |name: &Option<String>| {
            name.as_ref().map(|name| read_table(folder, name, &description.path, &mut outside)).transpose()
        };
        let poses_file = table(&config.robot.as_ref().map(|r| r.poses.clone()))?;
        let corners_file = table(&config.corners)?;
        let target_poses_file = table(&config.target_poses)?;
        let joints = config.robot.as_ref().and_then(|robot| robot.joints.as_ref());
        let named_arm = joints.and_then(|joints| Some((joints.arm.as_ref()?, joints.count)));
        let arm_file = table(&named_arm.and_then(|(arm, _)| arm.file().cloned()))?;
        let arm = named_arm.map(|(arm, joints)| arm.model(arm_file.as_ref(), joints)).transpose();
        let arm = arm.map_err(|(span, problem)| description.error_at(span.start, problem))?;

        let views = views(folder, &config, poses_file.as_ref(), &description.path)?;
        let mut corners = corners_file.as_ref().map(|file| corners::read_corners(file, &config.target)).transpose()?;
        let mut entries = EntryList { folder, poses_file: poses_file.as_ref(), views };
        if let (Some(file), Some(corners)) = (&corners_file, &corners) {
            entries.take_corner_images(file, corners)?;
        }
        for view in &entries.views {
            let table = poses_file.as_ref().or(corners_file.as_ref()).unwrap_or(&description);
            outside.look_at(&table.path, view.row, &view.name, &view.path)?;
        }
        let mut target_poses = match (&target_poses_file, &config.robot) {
            (Some(file), Some(robot)) => entries.target_poses(file, poses::read_poses(file, robot, None)?)?,
            _ => BTreeMap::new(),
        };

        let images_may_be_absent = corners.is_some() || target_poses_file.is_some();
        let stated_size = config.camera.as_ref().and_then(|c| c.size);
        let sizes = images::look_at(&entries, images_may_be_absent)?;
        let image_size = images::common_size(&entries, &sizes, stated_size)?;
        let camera = camera_input(&config, image_size, corners.is_some(), &description)?;

        let direction = config.robot.as_ref().map(|r| r.pose);
        let mut out = Vec::with_capacity(entries.views.len());
        for (view, size) in entries.views.iter().zip(&sizes) {
            let corners = match (&corners_file, &mut corners, image_size) {
                (Some(file), Some(table), Some(size)) => {
                    Some(table.remove(&view.path).map_or(Ok(Vec::new()), |c| c.inside(file, size))?)
                }
                _ => None,
            };
            out.push(Entry {
                name: view.name.clone(),
                image_path: size.map(|_| folder.join(&view.path)),
                base_from_tip: view.pose.zip(direction).map(|(pose, direction)| base_from_tip(pose, direction)),
                joints_rad: view.joints_rad.clone(),
                tip_from_joints: Vec::new(),
                corners,
                camera_from_target: target_poses
                    .remove(&view.path)
                    .map(|pose| camera_from_target(pose, config.target_pose)),
                row: view.row,
            });
        }
        let arm = arm.map(|model| DatasetArm::of(model, &mut out));
        let tables = [&poses_file, &corners_file, &target_poses_file, &arm_file];
        let files: Vec<&TextFile> =
            [Some(&description)].into_iter().chain(tables.map(Option::as_ref)).flatten().collect();
        let text_files = files.iter().map(|file| file.name.display().to_string()).collect();
        #[cfg(feature = "digest")]
        let text_sha256 = files.iter().map(|file| file.sha256).collect();
        Ok(Self {
            folder: folder.to_path_buf(),
            mode: config.robot.as_ref().and(config.mode),
            target: config.target,
            camera,
            entries: out,
            image_size,
            arm,
            tool_m: config.robot.as_ref().and_then(|robot| robot.tool_m),
            robot_accuracy_mm: config.robot.as_ref().and_then(|robot| robot.accuracy_mm),
            outside: outside.problems(poses_file.as_ref()),
            pose_table: poses_file.map(|f| f.path),
            text_files,
            #[cfg(feature = "digest")]
            text_sha256,
        })
    }

    /// The arm in the views, in the order of the entries, with the tool; `None` without `[robot.arm]`.
    ///
    /// # Errors
    /// Why its joint angles are not used.
    pub fn arm_of_views(&self) -> Option<Result<ArmOfViews, PlacementError>> {
        let of = |placement| ArmOfViews {
            placement,
            tool_m: self.tool_m.unwrap_or(USUAL_TOOL),
            joints_rad: self.entries.iter().map(|entry| entry.joints_rad.clone()).collect(),
        };
        Some(self.arm.as_ref()?.placement.clone().map(of))
    }

    /// Accuracy of the robot, with its tool; `None` where it is not stated.
    pub fn robot_accuracy(&self) -> Option<RobotAccuracy> {
        self.robot_accuracy_mm.map(|mm| RobotAccuracy::new(mm, self.tool_m))
    }

    /// Names in the data set and paths of its text files, as they begin the listing of `input_sha256`.
    pub fn text_files(&self) -> impl Iterator<Item = (&str, PathBuf)> {
        self.text_files.iter().map(|name| (name.as_str(), self.folder.join(name)))
    }

    /// The name in the data set of the image of a view, where it has one.
    pub fn image_name(&self, entry: &Entry) -> Option<String> {
        let path = entry.image_path.as_deref()?;
        Some(path.strip_prefix(&self.folder).unwrap_or(path).display().to_string())
    }

    /// The file of that image, as it is.
    ///
    /// # Errors
    /// [`DatasetError`] when it is gone, naming its row in the pose table.
    pub fn image_bytes(&self, entry: &Entry) -> Result<Vec<u8>, DatasetError> {
        self.load(entry, |path| {
            std::fs::read(path).map_err(|e| ImageFileError::Unreadable(handeye_wording::foreign(&e)))
        })
    }

    /// The image of a view as 8-bit RGB.
    ///
    /// # Errors
    /// [`DatasetError`] when it is damaged, truncated or gone, naming its row in the pose table.
    #[cfg(feature = "pixels")]
    pub fn load_rgb(&self, entry: &Entry) -> Result<RgbImage, DatasetError> {
        self.load(entry, handeye_images::load_rgb)
    }

    /// The image of a view as 8-bit grey, colours weighted as OpenCV does.
    ///
    /// # Errors
    /// As [`Self::load_rgb`].
    #[cfg(feature = "pixels")]
    pub fn load_gray(&self, entry: &Entry) -> Result<GrayImage, DatasetError> {
        self.load(entry, handeye_images::load_gray)
    }

    fn load<T>(
        &self,
        entry: &Entry,
        loader: impl FnOnce(&Path) -> Result<T, ImageFileError>,
    ) -> Result<T, DatasetError> {
        let file = self.pose_table.as_ref().unwrap_or(&self.folder);
        let fail = |problem| DatasetError::new(file, entry.row, problem);
        let name = || error::shown(&entry.name);
        let path = entry.image_path.as_ref().ok_or_else(|| fail(DatasetProblem::MissingImage(name())))?;
        loader(path).map_err(|source| fail(DatasetProblem::BadImage { name: name(), source: Box::new(source) }))
    }

    /// SHA-256 of the input in hexadecimal: of the text that
    /// `sha256sum dataset.toml poses.csv corners.csv IMAGE…` prints in the folder (the files there are, images in the
    /// order of the entries). It depends on names and content and not on where the folder is.
    ///
    /// # Errors
    /// [`DatasetError`] when an image can no longer be read.
    #[cfg(feature = "digest")]
    pub fn input_sha256(&self) -> Result<String, DatasetError> {
        let mut listing = handeye_files::digest::Listing::default();
        for (name, digest) in self.text_files.iter().zip(&self.text_sha256) {
            listing.add_digest(name, digest);
        }
        for entry in &self.entries {
            if let Some(name) = self.image_name(entry) {
                listing.add(&name, &self.image_bytes(entry)?);
            }
        }
        Ok(listing.digest())
    }
}

/// A view before its image was read.
struct View {
    name: String,
    /// Path in the data set.
    path: PathBuf,
    row: Option<usize>,
    pose: Option<Isometry3<f64>>,
    joints_rad: Option<Vec<f64>>,
}

impl View {
    fn of_image(name: String, path: PathBuf) -> Self {
        Self { name, path, row: None, pose: None, joints_rad: None }
    }
}

/// The views, and where messages about them point.
struct EntryList<'a> {
    folder: &'a Path,
    poses_file: Option<&'a TextFile>,
    views: Vec<View>,
}

impl EntryList<'_> {
    /// An error about the image of a view: in the pose table, or without one about the image itself.
    fn fail(&self, view: &View, problem: DatasetProblem) -> DatasetError {
        match self.poses_file {
            Some(file) => DatasetError::new(&file.path, view.row, problem),
            None => DatasetError::new(&self.folder.join(&view.path), None, problem),
        }
    }

    fn index_of(&self) -> BTreeMap<&Path, usize> {
        self.views.iter().enumerate().map(|(i, view)| (view.path.as_path(), i)).collect()
    }

    /// Without a robot, images that are only in the corner table are views as well; with one, they are an error.
    fn take_corner_images(&mut self, file: &TextFile, corners: &CornerTable) -> Result<(), DatasetError> {
        let known = self.index_of();
        let unknown = corners.iter().filter(|(path, _)| !known.contains_key(path.as_path()));
        if let Some(poses) = self.poses_file {
            return unknown
                .min_by_key(|(_, image)| image.line())
                .map_or(Ok(()), |(_, image)| Err(no_pose(file, image.line(), &image.name, poses)));
        }
        let added: Vec<View> = unknown.map(|(path, image)| View::of_image(image.name.clone(), path.clone())).collect();
        self.views.extend(added);
        self.views.sort_by(|a, b| natural_order::compare(&a.path.to_string_lossy(), &b.path.to_string_lossy()));
        Ok(())
    }

    fn target_poses(
        &self,
        file: &TextFile,
        rows: Vec<PoseRow>,
    ) -> Result<BTreeMap<PathBuf, Isometry3<f64>>, DatasetError> {
        let known = self.index_of();
        rows.into_iter()
            .map(|row| match (known.contains_key(row.path.as_path()), self.poses_file) {
                (false, Some(poses)) => Err(no_pose(file, Some(row.line), &row.name, poses)),
                _ => Ok((row.path, row.isometry)),
            })
            .collect()
    }
}

fn no_pose(file: &TextFile, line: Option<usize>, image: &str, poses: &TextFile) -> DatasetError {
    let poses = poses.name.display().to_string();
    DatasetError::new(&file.path, line, DatasetProblem::NoPose { name: error::shown(image), poses })
}

fn check_folder(folder: &Path) -> Result<(), DatasetError> {
    let fail = |problem| Err(DatasetError::new(folder, None, problem));
    match std::fs::metadata(folder) {
        Err(e) => fail(DatasetProblem::Unreadable(handeye_wording::one_line(&e))),
        Ok(metadata) if !metadata.is_dir() => fail(DatasetProblem::NotADataset),
        Ok(_) if !folder.join(DESCRIPTION).exists() => fail(DatasetProblem::NotADataset),
        Ok(_) => Ok(()),
    }
}

fn read_table(
    folder: &Path,
    name: &str,
    description: &Path,
    outside: &mut Outside<'_>,
) -> Result<TextFile, DatasetError> {
    let path = text::resolve(Path::new(""), name).ok_or_else(|| {
        let value = format!("{:?}", error::shown(name));
        let problem = DatasetProblem::BadValue { key: "the name of a table", value, want: "a path in this folder" };
        DatasetError::new(description, None, problem)
    })?;
    outside.look_at(description, None, &path.to_string_lossy(), &path)?;
    TextFile::read(folder, &path)
}

fn views(
    folder: &Path,
    config: &Config,
    poses_file: Option<&TextFile>,
    description: &Path,
) -> Result<Vec<View>, DatasetError> {
    if let (Some(file), Some(robot)) = (poses_file, &config.robot) {
        let rows = poses::read_poses(file, robot, robot.joints.as_ref())?;
        let view = |PoseRow { name, path, line, isometry, joints_rad }| View {
            name,
            path,
            row: Some(line),
            pose: Some(isometry),
            joints_rad,
        };
        return Ok(rows.into_iter().map(view).collect());
    }
    if let Some(names) = &config.images {
        return named_images(names).map_err(|problem| DatasetError::new(description, None, problem));
    }
    let paths = images::list(folder)?;
    if paths.is_empty() && config.corners.is_none() {
        // Without [robot] a table in the folder is not read, and does not show where the images are.
        let has_table = template::tables(folder).next().is_some();
        let hint = if has_table { "; for images that a pose table names, dataset.toml needs [robot]" } else { "" };
        return Err(DatasetError::new(folder, None, DatasetProblem::NoImages(hint)));
    }
    Ok(paths.into_iter().map(|path| View::of_image(path.to_string_lossy().into_owned(), path)).collect())
}

fn named_images(names: &[String]) -> Result<Vec<View>, DatasetProblem> {
    let mut views = Vec::with_capacity(names.len());
    let mut known = BTreeSet::new();
    for name in names {
        let bad = |want| DatasetProblem::BadValue { key: "images", value: format!("{:?}", error::shown(name)), want };
        let path = text::resolve(Path::new(""), name).ok_or_else(|| bad("a path relative to this folder"))?;
        if !known.insert(path.clone()) {
            return Err(bad("every image once"));
        }
        views.push(View::of_image(name.clone(), path));
    }
    if views.is_empty() {
        return Err(DatasetProblem::BadValue { key: "images", value: "[]".to_owned(), want: "at least one image" });
    }
    Ok(views)
}

fn camera_from_target(pose: Isometry3<f64>, direction: TargetPoseDirection) -> Pose<Camera, Target> {
    match direction {
        TargetPoseDirection::CameraFromTarget => Pose::from_isometry(pose),
        TargetPoseDirection::TargetFromCamera => Pose::<Target, Camera>::from_isometry(pose).inverse(),
    }
}

fn base_from_tip(pose: Isometry3<f64>, direction: PoseDirection) -> Pose<Base, Tip> {
    match direction {
        PoseDirection::BaseFromTip => Pose::from_isometry(pose),
        PoseDirection::TipFromBase => Pose::<Tip, Base>::from_isometry(pose).inverse(),
    }
}

fn camera_input(
    config: &Config,
    image_size: Option<(u32, u32)>,
    has_corners: bool,
    description: &TextFile,
) -> Result<Option<CameraInput>, DatasetError> {
    let needs_size = has_corners || config.camera.as_ref().is_some_and(|c| c.pinhole.is_some());
    if needs_size && image_size.is_none() {
        let row = config.camera.as_ref().map(|c| c.row);
        let why = "there are no images that would tell their size; write width and height in pixels";
        let problem = DatasetProblem::MissingKey { table: "camera", key: "width", why };
        return Err(DatasetError::new(&description.path, row, problem));
    }
    Ok(config.camera.as_ref().map(|camera| CameraInput {
        fixed: camera.fixed,
        accuracy_px: camera.accuracy_px,
        intrinsics: image_size.and_then(|size| camera.intrinsics(size)),
        model: camera.distortion,
    }))
}

#[cfg(test)]
mod tests;
