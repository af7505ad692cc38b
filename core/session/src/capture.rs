//! Captures and their files.

use std::io::Cursor;
use std::path::Path;

use image::{ImageFormat, RgbImage};

use super::capture_id::CaptureId;
use super::depth;
use super::document::{CaptureRecord, Role};
use super::edit_error::EditError;
use super::error::{SessionError, SessionProblem};
use super::session_file::IMAGES;
use handeye_files::atomic_file;
use handeye_geometry::depth::DepthImage;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_wording::Text;
use handeye_wording::one_line;
use handeye_wording::text;

/// The folder of depth images in a session.
pub(super) const DEPTH: &str = "depth";

/// The data of one capture.
#[derive(Debug, Clone, Copy)]
pub struct Capture<'a> {
    /// The colour image.
    pub image: &'a RgbImage,
    /// Depth in metres, of the size of the image.
    pub depth_m: Option<&'a DepthImage>,
    /// Tip pose as the controller reported it; `None` where there is no robot.
    pub base_from_tip: Option<Pose<Base, Tip>>,
    /// Joint angles as the controller reported them, radians.
    pub joints_rad: Option<&'a [f64]>,
    /// Simulation time of the image, seconds.
    pub sim_time_s: Option<f64>,
    /// Whether it is for the calibration or for verification.
    pub role: Role,
    /// Number of frames that the image is the mean of, at least 1.
    pub frames: u32,
    /// Noise of a corner of this image along one axis, pixels (one sigma), where it was measured.
    pub corner_noise_px: Option<f64>,
    /// How long the arm had been at rest when the image was taken, seconds.
    pub settled_s: Option<f64>,
    /// The taught pose at which it was taken.
    pub pose_name: Option<&'a str>,
}

impl<'a> Capture<'a> {
    /// A single frame for calibration, with nothing else known.
    pub fn new(image: &'a RgbImage, base_from_tip: impl Into<Option<Pose<Base, Tip>>>) -> Self {
        Self {
            image,
            depth_m: None,
            base_from_tip: base_from_tip.into(),
            joints_rad: None,
            sim_time_s: None,
            role: Role::Calibration,
            frames: 1,
            corner_noise_px: None,
            settled_s: None,
            pose_name: None,
        }
    }

    /// Its entry in the document; `session_size` is the size of the images before, pixels.
    pub(super) fn record(&self, id: CaptureId, session_size: Option<(u32, u32)>) -> Result<CaptureRecord, EditError> {
        let record = CaptureRecord {
            id,
            image: format!("{IMAGES}/{id:04}.png"),
            depth: self.depth_m.map(|_| format!("{DEPTH}/{id:04}.tiff")),
            base_from_tip: self.base_from_tip,
            joints_rad: self.joints_rad.map(<[f64]>::to_vec),
            sim_time_s: self.sim_time_s,
            role: self.role,
            excluded: false,
            frames: self.frames,
            corner_noise_px: self.corner_noise_px,
            settled_s: self.settled_s,
            pose_name: self.pose_name.map(str::to_owned),
        };
        record.check()?;
        let refuse = |what: Text| Err(EditError::bad(record.named(), what));
        let size = self.image.dimensions();
        if size.0 == 0 || size.1 == 0 {
            return refuse(text!("has an image without pixels"));
        }
        if session_size.is_some_and(|other| other != size) {
            return refuse(text!("has an image of another size than the captures before: begin a new session"));
        }
        if self.depth_m.is_some_and(|d| (d.width, d.height) != size) {
            return refuse(text!("has a depth image of another size than its image"));
        }
        Ok(record)
    }

    /// Writes image and depth under the names in its record. They are on the disk when this returns.
    pub(super) fn write_files(&self, folder: &Path, record: &CaptureRecord) -> Result<(), SessionError> {
        let encode_failed =
            |name: &str, e: String| SessionError::new(&folder.join(name), SessionProblem::Unwritable(e));
        let png = encode_png(self.image).map_err(|e| encode_failed(&record.image, e))?;
        write(folder, &record.image, &png)?;
        if let (Some(name), Some(depth_m)) = (&record.depth, self.depth_m) {
            let tiff = depth::encode(depth_m).map_err(|e| encode_failed(name, e))?;
            write(folder, name, &tiff)?;
        }
        Ok(())
    }
}

fn write(folder: &Path, name: &str, bytes: &[u8]) -> Result<(), SessionError> {
    let path = folder.join(name);
    atomic_file::write(&path, bytes).map_err(|e| SessionError::unwritable(&path, &e))
}

fn encode_png(image: &RgbImage) -> Result<Vec<u8>, String> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, ImageFormat::Png).map_err(|e| one_line(&e))?;
    Ok(bytes.into_inner())
}
