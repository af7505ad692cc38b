//! From image to image: what is expected, what is seen, and whether it can be the board.

use nalgebra::Matrix6;

use super::by_depth::by_depth;
use super::depth_tilt::DepthTilt;
use super::detection::{Board, Expected, Eye};
use super::filter::{BoardPose, Filter};
use super::noise::CornerNoise;
use super::{BoardDetection, Estimate, Image, Setup, State, TrackError, Update, WithDepth};
use handeye_geometry::depth::DepthImage;
use handeye_geometry::frames::{Base, Camera, Pose};
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::bent::BoardPoints;

/// Corners are searched within this many standard deviations of where they are expected.
const SEARCH: f64 = 2.5;
/// Sights that do not fit what is expected but fit each other, after which they are believed: one is a mistake, two may
/// be the same mistake, three in a row are a board that was moved.
const SIGHTS_TO_MOVE: usize = 3;
/// Images between two searches of the whole image in vain: an image with corners enough, but no whole board, takes
/// several times as long as one with a board.
const PAUSE: usize = 3;
/// Blur of the edges before any was measured, 1σ [px]: a lens in focus.
const USUAL_BLUR_PX: f64 = 0.8;

/// Follows a board. One image after the other goes in, and where the board is comes out.
///
/// Every image is evaluated alone first: corners near where the board is expected, or the whole image searched for the
/// whole board where nothing is expected or nothing was found there; then a pose with its covariance. A filter for
/// constant velocity joins the images. The mathematics is in `docs/maths/tracking.md`.
#[derive(Debug, Clone)]
pub struct Tracker {
    setup: Setup,
    board: BoardPoints,
    filter: Option<Filter>,
    /// Sights that the filter did not believe, and how many.
    elsewhere: Option<(Filter, usize)>,
    /// Time of the last image that the filter believed \[s\].
    believed_s: Option<f64>,
    first_dark: bool,
    blur_px: f64,
    noise: CornerNoise,
    /// Images that are not to be searched as a whole.
    pause: usize,
    last: Option<Update>,
}

impl Tracker {
    /// Checks what it will work with.
    ///
    /// # Errors
    /// [`TrackError::Intrinsics`], [`TrackError::NoHandEye`], [`TrackError::TargetTooSmall`], [`TrackError::BadSquare`],
    /// [`TrackError::BadMotion`].
    pub fn new(setup: Setup) -> Result<Self, TrackError> {
        setup.calibrated.intrinsics.validate().map_err(|source| TrackError::Intrinsics { source })?;
        if !setup.calibrated.hand_eye.mount_from_camera().is_finite() {
            return Err(TrackError::NoHandEye);
        }
        let grid = setup.target.grid();
        if grid.columns < 3 || grid.rows < 3 {
            return Err(TrackError::TargetTooSmall { columns: grid.columns, rows: grid.rows });
        }
        if !(grid.square_m.is_finite() && grid.square_m > 0.0) {
            return Err(TrackError::BadSquare { square_m: grid.square_m });
        }
        setup.motion.check()?;
        let noise = CornerNoise::new(setup.calibrated.uncertainty.as_ref().map(|u| u.noise.corner_px));
        Ok(Self {
            board: setup.calibrated.board(&setup.target),
            setup,
            filter: None,
            elsewhere: None,
            believed_s: None,
            first_dark: true,
            blur_px: USUAL_BLUR_PX,
            noise,
            pause: 0,
            last: None,
        })
    }

    /// Its input.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Forgets every image.
    pub(crate) fn reset(&mut self) {
        self.filter = None;
        self.elsewhere = None;
        self.believed_s = None;
        self.first_dark = true;
        self.blur_px = USUAL_BLUR_PX;
        self.noise.forget();
        self.pause = 0;
        self.last = None;
    }

    /// Takes an image in. An image of the same time as the one before changes nothing and gets the same answer; an
    /// earlier one starts the tracker again.
    ///
    /// A board that is not in the image is not an error: [`Update::state`] reports it.
    ///
    /// # Errors
    /// [`TrackError::OtherSize`], [`TrackError::NotFinite`], [`TrackError::BadTime`], which leave the tracker as it was;
    /// [`TrackError::Vision`].
    pub fn see(&mut self, image: &Image<'_>) -> Result<Update, TrackError> {
        self.check(image)?;
        if let Some(last) = &self.last {
            if last.time_s == image.time_s {
                return Ok(last.clone());
            }
            if last.time_s > image.time_s {
                self.reset();
            }
        }
        let base_from_camera = self.setup.calibrated.base_from_camera(&image.base_from_tip);
        let filter = self.expected(image.time_s);
        let board = self.look(image, &base_from_camera, filter.as_ref())?;
        self.filter = filter;
        let seen = board.and_then(|board| self.seen(board, &base_from_camera));
        let tilted = seen.as_ref().zip(image.depth).and_then(|(seen, depth)| self.tilted(image, depth, seen));
        let believed = seen.as_ref().is_some_and(|seen| self.believe(image.time_s, seen, tilted.as_ref()));
        if self.filter.is_none() {
            self.elsewhere = None;
        }
        let by_depth = seen
            .as_ref()
            .zip(image.depth)
            .and_then(|(seen, depth)| by_depth(image, depth, seen, &self.setup.calibrated, &self.setup.target));
        let update = Update {
            time_s: image.time_s,
            state: self.state(if believed { seen.as_ref() } else { None }),
            seen,
            with_depth: tilted,
            by_depth,
            estimate: self.filter.as_ref().map(Filter::estimate),
        };
        self.last = Some(update.clone());
        Ok(update)
    }

    /// Predicted pose of the board at `time_s` at constant velocity, with its covariance; `None` while it is not known,
    /// for a time before the last image, and for one for which it would be lost.
    pub fn at(&self, time_s: f64) -> Option<Estimate> {
        let known_s = self.filter.as_ref()?.time_s();
        (time_s >= known_s).then(|| self.expected(time_s))?.map(|filter| filter.estimate())
    }

    fn check(&self, image: &Image<'_>) -> Result<(), TrackError> {
        let time_s = image.time_s;
        if !time_s.is_finite() {
            return Err(TrackError::BadTime { time_s });
        }
        if !image.base_from_tip.is_finite() {
            return Err(TrackError::NotFinite { time_s });
        }
        let camera = &self.setup.calibrated.intrinsics;
        let depth = image.depth.map(|depth| ("depth image", (depth.width, depth.height)));
        for (what, (width, height)) in [("image", image.grey.dimensions())].into_iter().chain(depth) {
            if (width, height) != (camera.width, camera.height) {
                let (camera_width, camera_height) = (camera.width, camera.height);
                return Err(TrackError::OtherSize { what, width, height, camera_width, camera_height });
            }
        }
        Ok(())
    }

    /// The filter at `time_s`; `None` when the board has not been seen for too long.
    fn expected(&self, time_s: f64) -> Option<Filter> {
        let believed_s = self.believed_s?;
        if time_s - believed_s > self.setup.motion.coast_s {
            return None;
        }
        let mut filter = self.filter.clone()?;
        filter.predict(time_s);
        Some(filter)
    }

    fn look(
        &mut self,
        image: &Image<'_>,
        base_from_camera: &Pose<Base, Camera>,
        filter: Option<&Filter>,
    ) -> Result<Option<Board>, TrackError> {
        let Setup { target, calibrated, .. } = &self.setup;
        let eye = Eye { image: image.grey, target, board: &self.board, camera: &calibrated.intrinsics };
        let expected = filter.map(|filter| self.in_image(filter, base_from_camera));
        let mut near = None;
        if let Some(expected) = &expected
            && matches!(self.setup.target, TargetSpec::Chessboard(_))
        {
            near = eye.near(expected);
            // A part of the board could be another part of it, when it is not known well where to expect it.
            if near.as_ref().is_some_and(|board| eye.shows_all_sides(&board.fit.corners) || !eye.is_vague(expected)) {
                return Ok(near);
            }
        }
        if self.pause > 0 {
            self.pause -= 1;
            return Ok(near);
        }
        if !eye.may_show_all() {
            return Ok(near);
        }
        let board = eye.anywhere(expected.as_ref().map(|e| &e.camera_from_target))?;
        if board.is_none() {
            self.pause = PAUSE;
        }
        Ok(board.or(near))
    }

    fn in_image(&self, filter: &Filter, base_from_camera: &Pose<Base, Camera>) -> Expected {
        let camera_from_target = *(base_from_camera.inverse() * filter.base_from_target()).isometry();
        let (shift_m, turn_rad) = filter.sigmas();
        let centre = self.setup.target.centre();
        let depth_m = (camera_from_target * centre).z.max(1e-3);
        let off_m = shift_m + turn_rad * centre.coords.norm();
        let radius_px = SEARCH * off_m * self.setup.calibrated.intrinsics.fx / depth_m;
        Expected { camera_from_target, radius_px, blur_px: self.blur_px, first_dark: self.first_dark }
    }

    /// Pose and covariance of a board in the image, and what the next image can use of it.
    fn seen(&mut self, board: Board, base_from_camera: &Pose<Base, Camera>) -> Option<BoardDetection> {
        let inverse = board.fit.information.cholesky()?.inverse();
        let variance = self.noise.variance(board.fit.cost, board.fit.corners.len());
        self.blur_px = board.blur_px.unwrap_or(self.blur_px);
        self.first_dark = board.first_dark.unwrap_or(self.first_dark);
        let camera_from_target = Pose::from_isometry(board.fit.pose);
        let seen = BoardDetection {
            rms_px: board.fit.rms_px(),
            corners: board.fit.corners,
            camera_from_target,
            base_from_target: *base_from_camera * camera_from_target,
            covariance: symmetric(&(inverse * variance)),
        };
        let usable = seen.base_from_target.is_finite() && seen.covariance.iter().all(|v| v.is_finite());
        usable.then_some(seen)
    }

    /// The board by corners and the tilt that depths have.
    fn tilted(&self, image: &Image<'_>, depth: &DepthImage, seen: &BoardDetection) -> Option<WithDepth> {
        let Setup { target, calibrated, .. } = &self.setup;
        let by_corners = seen.camera_from_target.isometry();
        let tilt = DepthTilt::new(depth, image.far_plane_m, &calibrated.intrinsics, target, by_corners)?;
        let tilted = tilt.with(by_corners, &seen.covariance)?;
        let base_from_camera = calibrated.base_from_camera(&image.base_from_tip);
        let base_from_target = base_from_camera * Pose::from_isometry(tilted.camera_from_target);
        let covariance = symmetric(&tilted.covariance);
        let usable = base_from_target.is_finite() && covariance.iter().all(|value| value.is_finite());
        usable.then_some(WithDepth { base_from_target, covariance })
    }

    /// Whether a detection is accepted as the board; the filter then has it, with the tilt by depth where there is one.
    fn believe(&mut self, time_s: f64, seen: &BoardDetection, tilted: Option<&WithDepth>) -> bool {
        let centre = self.setup.target.centre();
        let sight = match tilted {
            Some(tilted) => BoardPose::new(&tilted.base_from_target, &tilted.covariance, &centre),
            None => BoardPose::new(&seen.base_from_target, &seen.covariance, &centre),
        };
        let start = || Filter::new(self.setup.motion, centre, time_s, &sight);
        let Some(filter) = &mut self.filter else {
            self.filter = Some(start());
            self.believed_s = Some(time_s);
            return true;
        };
        let there = self.elsewhere.take().map(|(mut there, count)| {
            there.predict(time_s);
            (there, count)
        });
        // The longer the filter coasts the more it would take in, a board put elsewhere as one thrown there too.
        let nearer = there
            .as_ref()
            .and_then(|(there, _)| there.distance_squared(&sight))
            .is_some_and(|distance| filter.distance_squared(&sight).is_none_or(|own| distance < own));
        if !nearer && filter.update(&sight) {
            self.believed_s = Some(time_s);
            return true;
        }
        let agrees = there.and_then(|(mut there, count)| there.update(&sight).then_some((there, count + 1)));
        let (there, count) = agrees.unwrap_or_else(|| (start(), 1));
        if count < SIGHTS_TO_MOVE {
            self.elsewhere = Some((there, count));
            return false;
        }
        self.filter = Some(there);
        self.believed_s = Some(time_s);
        true
    }

    fn state(&self, believed: Option<&BoardDetection>) -> State {
        let of = self.setup.target.len();
        match (believed, self.believed_s) {
            (Some(seen), _) => State::Tracking { corners: seen.corners.len(), of },
            (None, None) => State::Searching,
            (None, Some(since_s)) if self.filter.is_some() => State::Coasting { since_s },
            (None, Some(since_s)) => State::Lost { since_s },
        }
    }
}

fn symmetric(m: &Matrix6<f64>) -> Matrix6<f64> {
    0.5 * (m + m.transpose())
}

#[cfg(test)]
#[path = "tracker_tests.rs"]
mod tests;
