//! Everything that the window shows about captures, gathered once for all panes and again only when it changed.

use std::collections::HashMap;
use std::sync::Arc;

use egui::{Context, Id};
use handeye_estimate::diagnose::coverage::{Coverage, CoveredView};
use handeye_estimate::diagnose::findings::{Finding, FindingCode};
use handeye_estimate::{CornerResidual, ViewResult, ViewStatus};
use handeye_session::{CaptureId, CaptureRecord, Document, Role};

use handeye_workbench::model::{Model, Observed, Solved};
use handeye_workbench::scene::{self, CaptureUse};

/// Cells of the image on which coverage is shown: as the findings judge it.
pub const CELLS: (usize, usize) = (8, 6);

/// What was seen in the image of a capture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Detected {
    /// It is being searched.
    NotYet,
    Board,
    NoBoard,
    /// The image cannot be read.
    Unreadable,
}

/// A capture that the estimate excluded as an outlier, because it does not fit the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RejectedCapture {
    /// How far its board is from where the others put it \[mm\] and by how much it is rotated \[deg\]; `None` if its corners
    /// are not an image of the board.
    pub board_off: Option<(f64, f64)>,
}

/// One capture with all that is known of it.
#[derive(Debug, Clone)]
pub struct CaptureRow {
    pub id: CaptureId,
    /// The taught pose at which it was taken.
    pub pose_name: Option<String>,
    pub role: Role,
    /// Whether the user excluded it.
    pub excluded: bool,
    /// What was seen.
    pub seen: Detected,
    /// RMS of the residuals of its corners \[px\]; of a verifying capture the error of the prediction.
    pub rms_px: Option<f64>,
    /// Length of the correction of its reported tip position \[mm\].
    pub correction_mm: Option<f64>,
    /// Angle of the correction of its reported tip orientation \[deg\].
    pub correction_deg: Option<f64>,
    /// How far the answer moves without it \[mm\].
    pub influence_mm: Option<f64>,
    /// Noise of a corner of its image \[px\].
    pub corner_noise_px: Option<f64>,
    /// How far it is from the others, if the estimate excluded it.
    pub rejected: Option<RejectedCapture>,
    /// How many of its corners the estimate excluded as outliers.
    pub rejected_corners: usize,
    /// What the calibration finds remarkable about it.
    pub found: Vec<FindingCode>,
}

impl CaptureRow {
    /// Whether it verifies the fit.
    pub fn verifies(&self) -> bool {
        self.role == Role::Verification
    }

    /// Whether the answer does not use it although it is meant to be in the fit.
    pub fn is_rejected(&self) -> bool {
        self.rejected.is_some() && !self.excluded && !self.verifies()
    }

    /// What it is used for.
    pub fn used_as(&self) -> CaptureUse {
        match (self.excluded, self.role) {
            (true, _) => CaptureUse::Excluded,
            (false, Role::Verification) => CaptureUse::Verification,
            (false, Role::Calibration) if self.is_rejected() => CaptureUse::Rejected,
            (false, Role::Calibration) => CaptureUse::Fit,
        }
    }

    /// Its name for display: `7 · above left`.
    pub fn title(&self) -> String {
        match &self.pose_name {
            Some(name) => format!("{} · {name}", self.id),
            None => self.id.to_string(),
        }
    }
}

/// All captures.
#[derive(Debug)]
pub struct CaptureTable {
    /// In the order in which they were taken.
    pub rows: Vec<CaptureRow>,
    /// Where the board was in the image, counted over the captures of the fit. `None` while no board was seen.
    pub coverage: Option<Coverage>,
    /// The captures of the outlines of `coverage`, as indices into `rows`.
    pub outlined: Vec<usize>,
    /// Width and height of the images \[px\].
    pub image_size: (u32, u32),
    /// What all this was made from; kept to detect changes.
    made_from: Sources,
}

/// What a table is made from, compared by identity.
#[derive(Debug)]
struct Sources {
    document: Arc<Document>,
    solved: Option<Arc<Solved>>,
    observed: Vec<(CaptureId, Option<Arc<Observed>>)>,
}

impl Sources {
    fn of(model: &Model) -> Self {
        Self {
            document: model.session.document.clone(),
            solved: model.solve.solved.clone(),
            observed: model.observed.iter().map(|(id, observed)| (*id, observed.clone())).collect(),
        }
    }

    fn are_those_of(&self, model: &Model) -> bool {
        let same = |a: Option<&Arc<Observed>>, b: Option<&Arc<Observed>>| match (a, b) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (None, None) => true,
            _ => false,
        };
        let same_solved = match (&self.solved, &model.solve.solved) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (None, None) => true,
            _ => false,
        };
        same_solved
            && Arc::ptr_eq(&self.document, &model.session.document)
            && self.observed.len() == model.observed.len()
            && self
                .observed
                .iter()
                .zip(&model.observed)
                .all(|((id, kept), (other, now))| id == other && same(kept.as_ref(), now.as_ref()))
    }
}

/// The table of the model; made again when captures, what was seen in them, or the calibration changed.
pub fn table(ctx: &Context, model: &Model) -> Arc<CaptureTable> {
    let id = Id::new("table of captures");
    let kept: Option<Arc<CaptureTable>> = ctx.data(|data| data.get_temp(id));
    if let Some(kept) = kept.filter(|kept| kept.made_from.are_those_of(model)) {
        return kept;
    }
    let made = Arc::new(CaptureTable::new(model));
    ctx.data_mut(|data| data.insert_temp(id, made.clone()));
    made
}

impl CaptureTable {
    /// How many captures have this use.
    pub fn count(&self, used_as: CaptureUse) -> usize {
        self.rows.iter().filter(|row| row.used_as() == used_as).count()
    }

    fn new(model: &Model) -> Self {
        let document = model.document();
        let mut rows: Vec<CaptureRow> = document.captures.iter().map(|record| plain_row(model, record)).collect();
        if let Some(solved) = &model.solve.solved {
            add_solution(&mut rows, solved);
            add_findings(&mut rows, document, &solved.findings);
        }
        let seen: Vec<(usize, &Observed)> = document
            .captures
            .iter()
            .enumerate()
            .filter_map(|(index, record)| Some((index, model.observed(record.id)?)))
            .filter(|(_, observed)| observed.corners.as_ref().is_some_and(|corners| !corners.is_empty()))
            .collect();
        let image_size = seen.first().map_or((0, 0), |(_, observed)| observed.image_size);
        let views = seen.iter().filter_map(|(index, observed)| {
            let record = &document.captures[*index];
            Some(CoveredView { name: &record.image, corners: observed.corners.as_deref()?, in_fit: record.is_in_use() })
        });
        let coverage = (!seen.is_empty()).then(|| Coverage::new(image_size, CELLS, views));
        // A view whose corners are not finite has no outline.
        let outlined = match &coverage {
            Some(coverage) if coverage.outlines.len() == seen.len() => seen.iter().map(|(index, _)| *index).collect(),
            Some(coverage) => {
                let by_name: HashMap<&str, usize> =
                    document.captures.iter().enumerate().map(|(i, record)| (record.image.as_str(), i)).collect();
                coverage.outlines.iter().filter_map(|outline| by_name.get(outline.view.as_str()).copied()).collect()
            }
            None => Vec::new(),
        };
        Self { rows, coverage, outlined, image_size, made_from: Sources::of(model) }
    }

    pub fn row(&self, id: CaptureId) -> Option<&CaptureRow> {
        self.rows.iter().find(|row| row.id == id)
    }
}

fn plain_row(model: &Model, record: &CaptureRecord) -> CaptureRow {
    let seen = match model.observed.get(&record.id) {
        None => Detected::NotYet,
        Some(None) => Detected::Unreadable,
        Some(Some(observed)) if observed.corners.is_some() => Detected::Board,
        Some(Some(_)) => Detected::NoBoard,
    };
    CaptureRow {
        id: record.id,
        pose_name: record.pose_name.clone(),
        role: record.role,
        excluded: record.excluded,
        seen,
        rms_px: None,
        correction_mm: None,
        correction_deg: None,
        influence_mm: None,
        corner_noise_px: record.corner_noise_px,
        rejected: None,
        rejected_corners: 0,
        found: Vec::new(),
    }
}

/// A number of a solve that is not finite is not shown.
fn finite(value: Option<f64>) -> Option<f64> {
    value.filter(|value| value.is_finite())
}

fn add_solution(rows: &mut [CaptureRow], solved: &Solved) {
    let index: HashMap<CaptureId, usize> = rows.iter().enumerate().map(|(i, row)| (row.id, i)).collect();
    for (id, view) in solved.captures.iter().zip(&solved.calibration.views) {
        let Some(row) = index.get(id).map(|&i| &mut rows[i]) else { continue };
        // A capture whose purpose changed since the solve has no number of this kind until the next one.
        if row.verifies() {
            continue;
        }
        row.rms_px = finite(view.rms_px);
        row.correction_mm = finite(view.correction_m.map(|metres| metres * 1e3));
        row.correction_deg = finite(view.correction_rad.map(f64::to_degrees));
        row.influence_mm = finite(view.influence_m.map(|metres| metres * 1e3));
        row.rejected = rejected(view);
        row.rejected_corners = view.rejected_corners.len();
    }
    let Some(Ok(verification)) = &solved.verification else { return };
    for (id, check) in solved.verified_captures.iter().zip(&verification.captures) {
        if let Some(row) = index.get(id).map(|&i| &mut rows[i]).filter(|row| row.verifies()) {
            row.rms_px = finite(Some(check.rms_px));
        }
    }
}

fn rejected(view: &ViewResult) -> Option<RejectedCapture> {
    let board_off = view.distance.map(|distance| (distance.metres * 1e3, distance.radians.to_degrees()));
    (view.status == ViewStatus::Outlier)
        .then(|| RejectedCapture { board_off: board_off.filter(|(mm, deg)| mm.is_finite() && deg.is_finite()) })
}

fn add_findings(rows: &mut [CaptureRow], document: &Document, findings: &[Finding]) {
    for finding in findings {
        for view in &finding.views {
            let Some(at) = document.captures.iter().position(|record| record.image == *view) else { continue };
            rows[at].found.push(finding.code);
        }
    }
}

/// The residuals of a capture, from the fit or from the verification; empty when there are none.
pub fn residuals(model: &Model, id: CaptureId) -> &[CornerResidual] {
    let outcome = model.solve.solved.as_deref().and_then(|solved| scene::outcome(solved, id));
    outcome.map_or(&[], |outcome| outcome.residuals)
}

#[cfg(test)]
mod tests {
    use super::*;
    use handeye_workbench::testing::sample;

    #[test]
    fn the_table_is_made_once_and_again_when_a_capture_changes() {
        let ctx = Context::default();
        let mut model = sample::solved();
        let first = table(&ctx, &model);
        assert!(Arc::ptr_eq(&first, &table(&ctx, &model)));
        let mut document = (*model.session.document).clone();
        document.captures[2].excluded = true;
        model.session.document = Arc::new(document);
        let second = table(&ctx, &model);
        assert!(second.rows[2].excluded && !first.rows[2].excluded);
        model.observed.insert(CaptureId(4), None);
        assert_eq!(table(&ctx, &model).rows[3].seen, Detected::Unreadable);
    }

    #[test]
    fn a_capture_has_the_numbers_of_its_own_view() {
        let ctx = Context::default();
        let model = sample::solved();
        let table = table(&ctx, &model);
        let solved = model.solve.solved.as_ref().expect("solved");
        for (row, view) in table.rows.iter().zip(&solved.calibration.views) {
            assert_eq!(row.rms_px, view.rms_px);
            assert!((row.correction_mm.expect("joint") - view.correction_m.expect("joint") * 1e3).abs() < 1e-12);
        }
        let checked = &table.rows[sample::FITTED as usize];
        let verification = solved.verification.as_ref().expect("checked").as_ref().expect("verified");
        assert!(checked.verifies() && checked.influence_mm.is_none());
        assert_eq!(checked.rms_px, Some(verification.captures[0].rms_px));
        assert_eq!(table.outlined.len(), table.rows.len());
    }

    #[test]
    fn a_capture_that_was_set_aside_has_its_distance_and_no_influence() {
        let model = sample::with_an_outlier();
        let table = table(&Context::default(), &model);
        let row = table.row(sample::OUTLIER).expect("a row");
        assert!(row.is_rejected() && row.influence_mm.is_none());
        let (mm, deg) = row.rejected.and_then(|rejected| rejected.board_off).expect("a distance");
        assert!((mm - 12.3).abs() < 1e-9 && (deg - 1.5).abs() < 1e-9, "{mm} mm, {deg}°");
        assert_eq!(table.rows.iter().filter(|row| row.is_rejected()).count(), 1);
        let excluded = CaptureRow { excluded: true, ..row.clone() };
        assert!(!excluded.is_rejected(), "who took it out by hand knows");
    }
}
