//! What images without anti-aliasing cost: corners and calibrations of the scene `coppeliasim`, compared with its
//! truth. `cargo run --release --example hard_edges -- [SEEDS] [exact|bitmap] [area]`.
//!
//! Every seed has a different camera (1 mm, 0.5°) and a different place of the board (2 mm, 0.5°), seen from the ten taught
//! poses. The truth is the renderer's: pixels are drawn by what their centres see, and corners are where they were printed.
//! `area` draws the same with pixels that have an area, as the other scenes do.

use std::path::Path;

use handeye_cell::render::{RenderScene, Renderer, Sampling};
use handeye_cell::scene::{ResolvedScene, Scene};
use handeye_dataset::taught_poses::{Goal, TaughtPoses};
use handeye_detect::detect;
use handeye_estimate::diagnose::calibrate;
use handeye_estimate::handeye::Mode;
use handeye_estimate::{CameraKnowledge, Method, Observations, ObservedView};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::observation::Corner;
use image::{DynamicImage, GrayImage};
use nalgebra::Isometry3;

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let seeds: u64 = words.first().map_or(Ok(20), |word| word.parse())?;
    let has = |what: &str| words.iter().any(|word| word == what);
    let mut scene = Scene::coppeliasim()?;
    scene.camera.random_offset_mm = 1.0;
    scene.camera.random_offset_deg = 0.5;
    scene.board.random_offset_mm = 2.0;
    scene.board.random_offset_deg = 0.5;
    if has("exact") {
        scene.board.print = None;
    }
    if has("area") {
        scene.image.sampling = Sampling::Area;
    }
    let poses = taught()?;
    let (mut corners, mut sessions, mut missed) = (Corners::default(), Vec::new(), 0);
    for seed in 0..seeds {
        let resolved = scene.resolve(seed)?;
        let mut views = Vec::new();
        for (name, pose) in &poses {
            let found = detect(&image(&resolved, pose), &resolved.target)?;
            match &found {
                Some(found) => corners.add(&resolved, pose, found),
                None => missed += 1,
            }
            views.push(ObservedView::new(name.clone(), Some(*pose), found));
        }
        sessions.extend(Session::of(&resolved, views)?);
    }
    println!("{} views, {missed} without the board", corners.views);
    corners.print();
    Session::print(&sessions);
    Ok(())
}

/// A name and a pose of the tip.
type Taught = (String, Pose<Base, Tip>);

fn taught() -> Result<Vec<Taught>, Failure> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/poses/seed10.toml");
    let poses = TaughtPoses::parse(&file, &std::fs::read_to_string(&file)?)?.poses;
    let tip = |pose: &handeye_dataset::taught_poses::TaughtPose| match &pose.goal {
        Goal::Tip(tip) => Ok((pose.name.clone(), *tip)),
        Goal::Joints(_) => Err("the taught poses are poses of the tip"),
    };
    poses.iter().map(|pose| tip(pose).map_err(Into::into)).collect()
}

fn image(scene: &ResolvedScene, base_from_tip: &Pose<Base, Tip>) -> GrayImage {
    let world_from_camera = (*base_from_tip * scene.tip_from_camera).isometry().to_owned();
    let drawn = RenderScene {
        world_from_camera,
        board: scene.board_at(*scene.base_from_target.isometry()),
        solids: Vec::new(),
        light: scene.lamp(),
        background: scene.background(),
    };
    let rgb =
        Renderer::new(scene.intrinsics, scene.near_m, scene.far_m).render_rgb(&drawn, &scene.imaging(), scene.seed);
    DynamicImage::ImageRgb8(rgb).into_luma8()
}

/// Errors of corners relative to where they were printed.
#[derive(Default)]
struct Corners {
    views: usize,
    squares_px2: f64,
    stated_px2: f64,
    relative: f64,
    count: f64,
    by_view_px: Vec<f64>,
}

impl Corners {
    fn add(&mut self, scene: &ResolvedScene, base_from_tip: &Pose<Base, Tip>, found: &[Corner]) {
        let camera_from_target = scene.camera_from_target(base_from_tip);
        let printed = scene.printed_points();
        self.views += 1;
        let mut of_view = 0.0;
        for corner in found {
            let point = camera_from_target.isometry() * printed[corner.index];
            let Ok(truth) = scene.intrinsics.project(&point) else { continue };
            let off = corner.px - truth;
            of_view += off.norm_squared();
            self.squares_px2 += off.norm_squared();
            self.count += 2.0;
            if let Some(covariance) = corner.covariance_px2 {
                self.stated_px2 += covariance.trace();
                self.relative += covariance.try_inverse().map_or(0.0, |inverse| off.dot(&(inverse * off)));
            }
        }
        self.by_view_px.push((of_view / (2 * found.len()) as f64).sqrt());
    }

    fn print(&self) {
        let mut by_view = self.by_view_px.clone();
        by_view.sort_by(f64::total_cmp);
        let at = |part: f64| by_view.get((part * (by_view.len() as f64 - 1.0)) as usize).copied().unwrap_or(f64::NAN);
        println!(
            "corners: RMS {:.4} px per axis, stated {:.4}, errors over stated {:.3}; RMS of a view: median {:.4}, 95 % {:.4}, most {:.4}",
            (self.squares_px2 / self.count).sqrt(),
            (self.stated_px2 / self.count).sqrt(),
            (self.relative / self.count).sqrt(),
            at(0.5),
            at(0.95),
            at(1.0)
        );
    }
}

/// A calibration compared with the truth.
struct Session {
    error_m: f64,
    error_rad: f64,
    focal: f64,
    at_point_m: f64,
    stated_m: Option<f64>,
    corner_px: f64,
    findings: String,
}

impl Session {
    fn of(scene: &ResolvedScene, views: Vec<ObservedView>) -> Result<Option<Self>, Failure> {
        let observations = Observations {
            mode: Some(Mode::EyeInHand),
            target: scene.target,
            image_size: (scene.intrinsics.width, scene.intrinsics.height),
            camera: CameraKnowledge::NOTHING,
            views,
        };
        let work = CancelToken::default();
        let calibration = calibrate(&observations, Method::Joint, &work)?;
        let (Some(hand_eye), Some(joint), Some(lens)) =
            (&calibration.hand_eye, &calibration.joint, calibration.intrinsics())
        else {
            return Ok(None);
        };
        let found: Isometry3<f64> = *hand_eye.mount_from_camera().isometry();
        let truth = scene.tip_from_camera.isometry();
        let point = joint.reference_point;
        Ok(Some(Self {
            error_m: (found.translation.vector - truth.translation.vector).norm(),
            error_rad: found.rotation.angle_to(&truth.rotation),
            focal: (lens.fx * lens.fy).sqrt() / (scene.intrinsics.fx * scene.intrinsics.fy).sqrt() - 1.0,
            at_point_m: (found * point - truth * point).norm(),
            stated_m: calibration.tip_error_95_m(),
            corner_px: joint.noise.corner_px,
            findings: calibration
                .diagnosis()
                .findings
                .iter()
                .map(|finding| format!("{:?}", finding.code))
                .collect::<Vec<_>>()
                .join(" "),
        }))
    }

    fn print(sessions: &[Self]) {
        let rms = |of: &dyn Fn(&Self) -> f64| {
            (sessions.iter().map(|session| of(session).powi(2)).sum::<f64>() / sessions.len().max(1) as f64).sqrt()
        };
        println!(
            "{} sessions: camera {:.3} mm, {:.4}°, focal length {:.3} % (RMS); estimated noise of a corner {:.4} px",
            sessions.len(),
            1e3 * rms(&|s| s.error_m),
            rms(&|s| s.error_rad).to_degrees(),
            100.0 * rms(&|s| s.focal),
            rms(&|s| s.corner_px)
        );
        let stated: Vec<(f64, f64)> = sessions.iter().filter_map(|s| Some((s.at_point_m, s.stated_m?))).collect();
        let covered = stated.iter().filter(|(error, stated)| error <= stated).count();
        let rms_of = |values: Vec<f64>| (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt();
        println!(
            "error of a point {:.3} mm RMS, stated (95 %) {:.3} mm RMS, below it in {covered} of {} sessions, nothing stated in {}",
            1e3 * rms_of(stated.iter().map(|s| s.0).collect()),
            1e3 * rms_of(stated.iter().map(|s| s.1).collect()),
            stated.len(),
            sessions.len() - stated.len()
        );
        let mut codes = std::collections::BTreeMap::<&str, usize>::new();
        for code in sessions.iter().flat_map(|session| session.findings.split_whitespace()) {
            *codes.entry(code).or_default() += 1;
        }
        println!("findings: {codes:?}");
    }
}
