//! The blocking way through a capture, with images that a test makes up.

use std::cell::Cell;
use std::sync::Arc;

use handeye_geometry::depth::DepthImage;
use handeye_geometry::frames::Pose;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::TargetSpec;
use image::{Rgb, RgbImage};

use super::drawn::{BOARD, board, brighter_board};
use super::{CaptureEnd, CaptureRequest, Images, take};
use crate::model::{CaptureOptions, CapturePurpose, ColouredDepth, FrameImages, FrameInfo, LiveFrame, RefusalKind};
use crate::text::{Language, Text};

/// One image after the other, a pass apart.
struct Reel<F> {
    rgb: F,
    number: u64,
    pass_s: f64,
    now_s: Cell<f64>,
    /// Why no image has a pose.
    no_pose: Option<Text>,
}

impl<F: FnMut(u64) -> Result<RgbImage, &'static str>> Reel<F> {
    fn new(rgb: F) -> Self {
        Self { rgb, number: 0, pass_s: 0.05, now_s: Cell::new(100.0), no_pose: None }
    }
}

impl<F: FnMut(u64) -> Result<RgbImage, &'static str>> Images for Reel<F> {
    type Error = &'static str;

    fn now_s(&self) -> f64 {
        self.now_s.get()
    }

    fn next(&mut self) -> Result<LiveFrame, Self::Error> {
        self.number += 1;
        self.now_s.set(self.now_s.get() + 0.1);
        let info = FrameInfo {
            number: self.number,
            sim_time_s: self.number as f64 * self.pass_s,
            image_age_s: 0.0,
            image_off_m: 0.0,
            no_pose: self.no_pose.clone().map(Box::new),
            received_s: self.now_s.get(),
            rate_hz: 0.0,
            depth_range_m: [0.1, 3.5],
            far_plane_m: 3.5,
            base_from_tip: self.no_pose.is_none().then(Pose::identity),
            joints_rad: [0.0; 6].into(),
            base_from_target_true: None,
            clocks: None,
        };
        let rgb = (self.rgb)(self.number)?;
        let depth = DepthImage { width: 1, height: 1, metres: vec![0.5] };
        let images = FrameImages { rgb, depth: Some(ColouredDepth { metres: depth, colours: RgbImage::default() }) };
        Ok(LiveFrame { info, images: Arc::new(images) })
    }
}

fn request(frames: u32) -> CaptureRequest {
    CaptureRequest {
        number: 7,
        purpose: CapturePurpose::Calibrate,
        options: CaptureOptions { frames, ..CaptureOptions::default() },
        pose_name: Some("view".to_owned()),
        others: Vec::new(),
    }
}

/// A capture that is never cancelled.
fn take_all<F: FnMut(u64) -> Result<RgbImage, &'static str>>(
    request: CaptureRequest,
    target: &TargetSpec,
    reel: &mut Reel<F>,
) -> Result<CaptureEnd, &'static str> {
    take(request, target, reel, &CancelToken::default())
}

fn refused(end: Result<CaptureEnd, &'static str>) -> (RefusalKind, String) {
    match end.expect("images came") {
        CaptureEnd::Refused(refused) => (refused.kind, refused.why.in_language(Language::English)),
        CaptureEnd::Good(measured, _) => panic!("{measured:?}"),
    }
}

#[test]
fn four_images_show_that_everything_is_at_rest_and_the_next_ones_are_averaged() {
    let mut reel = Reel::new(|number| Ok(brighter_board(1, number as f64)));
    let CaptureEnd::Good(measured, last) = take_all(request(3), &BOARD, &mut reel).expect("images") else {
        panic!("a capture")
    };
    assert_eq!((measured.frames, reel.number, last.info.number), (3, 6, 6), "images 4, 5 and 6");
    assert_eq!(*measured.rgb, brighter_board(1, 5.0), "their mean");
    assert_eq!(measured.sim_time_s, last.info.sim_time_s);
    // Three intervals, with a rounded sum.
    assert!((measured.settled_s - 3.0 * 0.05).abs() < 1e-12, "{} s", measured.settled_s);
    assert_eq!(measured.corners.len(), 70);
    assert!(measured.corner_noise_px.is_some_and(|noise_px| noise_px < 0.01), "compared in all three");
    assert_eq!((measured.number, measured.pose_name.as_deref()), (7, Some("view")));
}

#[test]
fn what_is_no_good_is_refused_with_the_reason() {
    let (kind, why) = refused(take_all(request(1), &BOARD, &mut Reel::new(|_| Ok(RgbImage::new(320, 240)))));
    assert_eq!(kind, RefusalKind::NoBoard, "{why}");
    let blurred = board(6);
    let (kind, why) = refused(take_all(request(1), &BOARD, &mut Reel::new(|_| Ok(blurred.clone()))));
    assert_eq!(kind, RefusalKind::Blurred, "{why}");
    let near = CaptureRequest { others: vec![(12, Pose::identity())], ..request(1) };
    let sharp = board(0);
    let (kind, why) = refused(take_all(near, &BOARD, &mut Reel::new(|_| Ok(sharp.clone()))));
    assert_eq!(kind, RefusalKind::TooSimilar, "{why}");
    // Only a part of the image: a change by a lamp would affect all of it.
    let waving = |number: u64| {
        let mut rgb = sharp.clone();
        (0..480).for_each(|u| (300..360).for_each(|v| rgb.put_pixel(u, v, Rgb([90 * (number % 2) as u8; 3]))));
        Ok(rgb)
    };
    let (kind, why) = refused(take_all(request(1), &BOARD, &mut Reel::new(waving)));
    assert_eq!(kind, RefusalKind::NotSettled);
    assert!(why.contains("still changes after 10 s"), "{why}");
}

#[test]
fn a_simulation_without_time_ends_the_capture() {
    let sharp = board(0);
    for pass_s in [0.0, f64::NAN] {
        let mut reel = Reel { pass_s, ..Reel::new(|_| Ok(sharp.clone())) };
        let (kind, why) = refused(take_all(request(1), &BOARD, &mut reel));
        assert_eq!(kind, RefusalKind::Paused);
        assert!(why.contains("paused"), "{why}");
        assert!(reel.number < 70, "{} images in {} s", reel.number, reel.now_s.get() - 100.0);
    }
}

#[test]
fn images_without_a_pose_of_the_robot_end_the_capture_with_the_reason_that_its_driver_gives() {
    let sharp = board(0);
    let why = Text::verbatim("its states before and after the image are 0.400 s apart");
    let mut reel = Reel { no_pose: Some(why), ..Reel::new(|_| Ok(sharp.clone())) };
    let (kind, reported) = refused(take_all(request(1), &BOARD, &mut reel));
    assert_eq!(kind, RefusalKind::NoImages);
    assert!(
        reported.contains("0.400 s apart") && !reported.contains("pendant") && !reported.contains("paused"),
        "{reported}"
    );
}

#[test]
fn the_error_of_a_camera_ends_the_capture() {
    let end =
        take_all(request(1), &BOARD, &mut Reel::new(|number| if number < 3 { Ok(board(0)) } else { Err("gone") }));
    assert_eq!(end.expect_err("no third image"), "gone");
}
