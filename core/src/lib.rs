//! Hand-eye calibration without window or sockets: frames, cameras, targets, solvers, data sets.
//!
//! Corners of a target and the poses that a robot reported go in; where the camera is on the robot, and how far off a
//! point measured with it is expected to be, come out:
//!
//! ```
//! use handeye_core::diagnose::calibrate;
//! use handeye_core::estimate::handeye::{HandEye, Mode};
//! use handeye_core::estimate::{CameraKnowledge, Method, ObservedView, Observations};
//! use handeye_core::progress::CancelToken;
//! use handeye_core::targets::{Grid, TargetSpec};
//! # use handeye_core::geometry::camera::Intrinsics;
//! # use handeye_core::geometry::frames::{Base, Pose, Tip};
//! # use handeye_core::nalgebra::{Isometry3, Vector2, Vector3};
//! # use handeye_core::targets::observation::{Corner, Corners};
//! #
//! # const TARGET: TargetSpec = TargetSpec::Chessboard(Grid { columns: 9, rows: 6, square_m: 0.025 });
//! # fn tip_from_camera() -> Isometry3<f64> { Isometry3::new(Vector3::new(0.05, 0.0, 0.08), Vector3::z() * 1.5) }
//! # /// Twelve views of a board on a table, with corners that are a few hundredths of a pixel off.
//! # fn recording() -> Vec<(String, Pose<Base, Tip>, Corners)> {
//! #     let base_from_target = Isometry3::new(Vector3::new(0.5, 0.1, 0.0), Vector3::x() * 3.1);
//! #     let camera = Intrinsics::pinhole(640, 480, 600.0);
//! #     let view = |i: usize| {
//! #         let angle = i as f64 * 2.4;
//! #         let turn = Vector3::new(0.5 * angle.cos(), 0.5 * angle.sin(), 0.4 * (2.0 * angle).sin());
//! #         let aim = Isometry3::new(Vector3::new(0.0, 0.0, 0.45 + 0.01 * i as f64), turn);
//! #         let camera_from_target = aim * Isometry3::translation(-0.1, -0.0625, 0.0);
//! #         let base_from_tip = base_from_target * camera_from_target.inverse() * tip_from_camera().inverse();
//! #         let corner = |(k, point)| {
//! #             let px = camera.project(&(camera_from_target * point)).expect("in front of the camera");
//! #             let noise = |n: usize| ((n * 7919 + i * 104_729) % 13) as f64 / 130.0 - 0.046;
//! #             Corner::new(k, px + Vector2::new(noise(k), noise(k + 5)))
//! #         };
//! #         let corners = TARGET.points().into_iter().enumerate().map(corner).collect();
//! #         (format!("image {i}"), Pose::from_isometry(base_from_tip), corners)
//! #     };
//! #     (0..12).map(view).collect()
//! # }
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // Of each image: its name, the pose of the TCP in the base, and the corners in it by their number, row by row.
//! let mut views = Vec::new();
//! for (name, base_from_tip, corners) in recording() {
//!     views.push(ObservedView::new(name, Some(base_from_tip), Some(corners)));
//! }
//! let observations = Observations {
//!     mode: Some(Mode::EyeInHand),
//!     target: TargetSpec::Chessboard(Grid { columns: 9, rows: 6, square_m: 0.025 }),
//!     image_size: (640, 480),
//!     camera: CameraKnowledge::NOTHING,
//!     views,
//! };
//! let calibration = calibrate(&observations, Method::Joint, &CancelToken::default())?;
//!
//! let Some(HandEye::EyeInHand { tip_from_camera, .. }) = calibration.hand_eye else { return Err("no robot".into()) };
//! println!("{tip_from_camera:?}");
//! let error_m = calibration.tip_error_95_m().ok_or("only the joint estimate states its error")?;
//! println!("95 % of points measured with it are off by less than {:.3} mm", error_m * 1e3);
//! # let (off_m, _) = tip_from_camera.distance_to(&Pose::from_isometry(self::tip_from_camera()));
//! # assert!(off_m < 5e-4 && error_m < 2e-3, "off by {off_m} m, stated {error_m} m");
//! # Ok(())
//! # }
//! ```
//!
//! `examples/` has whole programs: `calibrate_folder` for recorded data, `track_board` for a board from image to image.
//!
//! Features: `opencv` (default) finds targets in images and tracks them; everything else is computed without it.
//!
//! Conventions (frames, units, pixel origin, order of tangent vectors) are in `docs/conventions.md`. Results are the same
//! in every run and on any number of cores: no clock, no hidden seed.

pub mod budget;
pub mod capture;
pub mod depth;
#[cfg(feature = "opencv")]
pub mod detect;
pub mod diagnose;
pub mod estimate;
pub mod geometry;
pub mod natural_order;
pub mod plan;
pub mod progress;
pub mod project;
pub mod targets;
#[cfg(feature = "testing")]
pub mod testing;
pub mod track;
pub mod verify;
pub mod wording;

pub use image;
pub use nalgebra;
