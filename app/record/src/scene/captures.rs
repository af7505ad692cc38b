//! The captures: each a camera where it was, with its image, the corners in it and its result in the calibration.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use handeye_estimate::CornerResidual;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::depth::DepthImage;
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::planar_pose;
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::observation::{Corner, Corners};
use handeye_session::{CaptureId, CaptureRecord, Document, Session, SessionError};
use image::RgbImage;
use rerun::{Arrows2D, AsComponents, Color, EncodedImage, Points3D, Radius};

use super::convert::{corner_marks, marks, no_lines, outline, pinhole, pixel, transform};
use super::error::RecordError;
use super::paths::{self, below};
use super::pen::{Clock, Instant, Pen};
use super::style;
use handeye_wording::text;
use handeye_workbench::scene::{self, BAD_AT_MEDIANS, CaptureItem, CaptureUse, Known, outcome};

/// A capture that is in the recording.
#[derive(Debug)]
pub(super) struct Shown {
    pub record: CaptureRecord,
    /// When it was taken.
    pub taken: Instant,
    /// `None` until they are known, and where the board was not found.
    pub corners: Option<Corners>,
}

/// All captures.
#[derive(Debug, Default)]
pub(super) struct Captures {
    /// The document, with its folder if there is one.
    document: Option<Arc<Document>>,
    folder: Option<PathBuf>,
    shown: BTreeMap<CaptureId, Shown>,
    /// Deleted, but may come back.
    deleted: BTreeMap<CaptureId, Shown>,
    selected: Vec<CaptureId>,
}

/// What a document has changed.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Changes {
    pub gone: Vec<CaptureId>,
    pub new: Vec<CaptureId>,
    pub changed: Vec<CaptureId>,
}

impl Captures {
    pub fn get(&self, id: CaptureId) -> Option<&Shown> {
        self.shown.get(&id)
    }

    /// Where the tip was at each.
    pub fn tips(&self) -> impl Iterator<Item = &Pose<Base, Tip>> {
        self.shown.values().filter_map(|shown| shown.record.base_from_tip.as_ref())
    }

    /// Takes over a document. Every capture that was not there before counts one more.
    pub fn update(&mut self, folder: Option<PathBuf>, document: &Arc<Document>, clock: &mut Clock) -> Changes {
        let mut changes = Changes::default();
        let is_other = self.document.as_ref().is_some_and(|before| before.meta.created != document.meta.created);
        if is_other {
            self.deleted.clear();
            self.selected.clear();
        }
        let is_kept = |id: &CaptureId| !is_other && document.capture(*id).is_some();
        changes.gone = self.shown.keys().copied().filter(|id| !is_kept(id)).collect();
        for id in &changes.gone {
            if let Some(shown) = self.shown.remove(id).filter(|_| !is_other) {
                self.deleted.insert(*id, shown);
            }
        }
        // A session that was opened is of another simulation than what is seen live.
        let is_first = self.document.is_none();
        for record in &document.captures {
            if let Some(shown) = self.shown.get_mut(&record.id) {
                if shown.record != *record {
                    shown.record = record.clone();
                    changes.changed.push(record.id);
                }
                continue;
            }
            // One that comes back counts too: a viewer shows what was cleared at the same time at the origin.
            clock.captures += 1;
            let before = self.deleted.remove(&record.id);
            let own = record.sim_time_s.map_or(clock.sim_time_s, |time| time.max(0.0));
            if !clock.is_live {
                clock.sim_time_s = clock.sim_time_s.max(own);
            }
            // What was cleared since it was taken, and what comes from another session, exists from now on.
            let time = if before.is_some() || is_other {
                clock.sim_time_s
            } else if is_first {
                own.min(clock.sim_time_s)
            } else {
                own
            };
            let taken = Instant { capture: Some(clock.captures), sim_time_s: Some(time) };
            self.shown
                .insert(record.id, Shown { record: record.clone(), taken, corners: before.and_then(|it| it.corners) });
            changes.new.push(record.id);
        }
        self.document = Some(Arc::clone(document));
        self.folder = folder;
        changes
    }

    /// Takes over corners; `None` when there is no such capture now.
    pub fn observe(&mut self, id: CaptureId, corners: Option<Corners>) -> Option<&Shown> {
        let shown = self.shown.get_mut(&id)?;
        shown.corners = corners;
        Some(shown)
    }

    /// Takes over the selection and returns what is drawn differently now.
    pub fn select(&mut self, ids: &[CaptureId]) -> Vec<CaptureId> {
        let before = std::mem::replace(&mut self.selected, ids.to_vec());
        let differs = |id: &&CaptureId| before.contains(id) != self.selected.contains(id);
        self.shown.keys().filter(differs).copied().collect()
    }

    /// An image as it is on the disk; `None` without a folder.
    pub fn image(&self, record: &CaptureRecord) -> Result<Option<EncodedImage>, RecordError> {
        let Some(folder) = &self.folder else { return Ok(None) };
        let file = folder.join(&record.image);
        match std::fs::read(&file) {
            Ok(bytes) => Ok(Some(EncodedImage::from_file_contents(bytes))),
            Err(error) => Err(RecordError::File { capture: record.id.0, file, reason: text!("{why}", why = error) }),
        }
    }

    /// Depths and the colours to them; `None` where no depths were recorded.
    pub fn depth(&self, record: &CaptureRecord) -> Result<Option<(DepthImage, RgbImage)>, RecordError> {
        let (Some(folder), Some(document), Some(name)) = (&self.folder, &self.document, &record.depth) else {
            return Ok(None);
        };
        let session = Session { folder: folder.clone(), document: Arc::clone(document) };
        let failed = |file: &str, error: SessionError| RecordError::File {
            capture: record.id.0,
            file: folder.join(file),
            reason: error.into(),
        };
        let Some(depth) = session.load_depth_m(record).map_err(|error| failed(name, error))? else { return Ok(None) };
        let rgb = session.load_rgb(record).map_err(|error| failed(&record.image, error))?;
        Ok(Some((depth, rgb)))
    }

    /// Where a capture was taken, coloured by what is known about it.
    pub fn write_place(&self, pen: Pen<'_>, known: &Known, shown: &Shown) -> Result<(), RecordError> {
        let record = &shown.record;
        let item = scene::Captures::new(known).item(record);
        let (Some(base_from_camera), Some(intrinsics)) = (item.base_from_camera, known.intrinsics()) else {
            return Ok(());
        };
        let is_selected = self.selected.contains(&record.id);
        let colour = if is_selected { style::SELECTED } else { colour(&item) };
        let path = paths::capture(record.id);
        let name = Points3D::new([[0.0_f32; 3]])
            .with_labels([label(record.id, item.used_as)])
            .with_colors([colour])
            .with_radii([Radius::new_ui_points(style::CORNER_UI_POINTS)]);
        pen.write(&path, &[&transform(base_from_camera.isometry()) as &dyn AsComponents, &name])?;
        let line = if is_selected { style::THICK_UI_POINTS } else { style::THIN_UI_POINTS };
        pen.write(&below(&path, paths::LENS), &pinhole(&intrinsics, style::CAPTURE_IMAGE_PLANE, colour, line))
    }

    /// Everything in the image of a capture, below a lens or another place of images.
    pub fn write_marks(pen: Pen<'_>, known: &Known, shown: &Shown, below_path: &str) -> Result<(), RecordError> {
        let outcome = known.solved.as_deref().and_then(|solved| outcome(solved, shown.record.id));
        let residuals = outcome.map_or(&[][..], |outcome| outcome.residuals);
        let corners = shown.corners.as_deref().unwrap_or_default();
        pen.write(&below(below_path, paths::CORNERS), &corner_marks(corners, style::SEEN))?;
        let predicted = residuals.iter().map(|r| r.px - r.residual_px);
        pen.write(&below(below_path, paths::PREDICTED), &marks(predicted, style::PREDICTED))?;
        let arrow = |r: &CornerResidual| (r.residual_px * style::RESIDUAL_FACTOR).map(|v| v as f32).into();
        let arrows = Arrows2D::from_vectors(residuals.iter().map(arrow).collect::<Vec<[f32; 2]>>())
            .with_origins(residuals.iter().map(|r| pixel(&(r.px - r.residual_px))))
            .with_colors([style::RESIDUAL])
            .with_radii([Radius::new_ui_points(style::THIN_UI_POINTS)]);
        pen.write(&below(below_path, paths::RESIDUALS), &arrows)
    }

    /// The board as seen in the image of a capture, and as calibrated.
    pub fn write_boards(pen: Pen<'_>, known: &Known, shown: &Shown) -> Result<(), RecordError> {
        let path = paths::capture(shown.record.id);
        if known.mount().is_none() {
            return Ok(());
        }
        let seen_path = below(&path, paths::SEEN_BOARD);
        pen.frame_if(&seen_path, seen(known, shown.corners.as_deref()).as_ref(), style::SMALL_AXES)?;
        let predicted_path = below(&path, paths::PREDICTED_BOARD);
        let outcome = known.solved.as_deref().and_then(|solved| outcome(solved, shown.record.id));
        match (outcome.and_then(|outcome| outcome.camera_from_target), known.target) {
            (Some(predicted), Some(target)) => pen.write(
                &predicted_path,
                &[&transform(predicted.isometry()) as &dyn AsComponents, &outline(&target, style::PREDICTED)],
            ),
            _ => pen.write(&predicted_path, &no_lines()),
        }
    }

    /// Everything about every capture, after the calibration has changed.
    pub fn write_all(&self, pen: Pen<'_>, known: &Known) -> Result<(), RecordError> {
        for (id, shown) in &self.shown {
            self.write_place(pen, known, shown)?;
            Self::write_marks(pen, known, shown, &below(&paths::capture(*id), paths::LENS))?;
            Self::write_boards(pen, known, shown)?;
        }
        self.newest_selected().map_or(Ok(()), |shown| Self::write_marks(pen, known, shown, paths::SELECTED))
    }

    /// The capture that was selected last.
    pub fn newest_selected(&self) -> Option<&Shown> {
        self.shown.get(self.selected.last()?)
    }
}

fn seen(known: &Known, corners: Option<&[Corner]>) -> Option<Pose<Camera, Target>> {
    let (target, intrinsics): (TargetSpec, Intrinsics) = (known.target?, known.intrinsics()?);
    // Corners that no pose explains have none; the table of captures shows that too.
    planar_pose::camera_from_target(corners?, &target, &intrinsics).ok()
}

/// Its colour, unless it is selected.
fn colour(item: &CaptureItem) -> Color {
    match item.used_as {
        CaptureUse::Excluded => style::EXCLUDED,
        CaptureUse::Rejected => style::SET_ASIDE,
        CaptureUse::Fit | CaptureUse::Verification => {
            item.times_median.map_or(style::NEUTRAL, |times| style::residual_colour(times / BAD_AT_MEDIANS))
        }
    }
}

/// Its number, and that it was excluded as an outlier if it was.
fn label(id: CaptureId, used_as: CaptureUse) -> String {
    if used_as == CaptureUse::Rejected { format!("{id} (outlier)") } else { id.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_capture_that_was_set_aside_is_named_so_and_has_the_colour_of_a_warning() {
        let item = |used_as| CaptureItem { base_from_camera: None, used_as, rms_px: None, times_median: Some(1.0) };
        let id = CaptureId(7);
        assert_eq!(label(id, CaptureUse::Rejected), "7 (outlier)");
        assert_eq!(colour(&item(CaptureUse::Rejected)), style::SET_ASIDE);
        assert_eq!(label(id, CaptureUse::Fit), "7");
        assert_ne!(colour(&item(CaptureUse::Fit)), style::SET_ASIDE);
        assert_eq!(colour(&item(CaptureUse::Excluded)), style::EXCLUDED);
    }
}
