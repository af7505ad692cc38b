//! Images of the cell compared with the analytic projection of its content, with the detector that users have.

use handeye_cell::render::{BoardSurface, Imaging, Light, RenderScene, Renderer};
use handeye_detect as detect;
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::targets::{Grid, TargetSpec};
use handeye_images::gray_from_rgb;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector2, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

const GRID: Grid = Grid { columns: 10, rows: 7, square_m: 0.015 };
const VIEWS: usize = 200;
const FAR_M: f64 = 3.5;

/// The board 0.3 to 0.55 m away, tilted by up to 45° about any axis in its plane, at any roll, completely in view.
fn random_pose(rng: &mut ChaCha8Rng, camera: &Intrinsics) -> Isometry3<f64> {
    let centre = TargetSpec::Chessboard(GRID).centre();
    loop {
        let tilt = rng.random_range(0.0..45f64.to_radians());
        let azimuth = rng.random_range(0.0..std::f64::consts::TAU);
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(azimuth.cos(), azimuth.sin(), 0.0) * tilt)
            * UnitQuaternion::from_scaled_axis(Vector3::z() * rng.random_range(-3.0..3.0));
        let place = Translation3::new(
            rng.random_range(-0.06..0.06),
            rng.random_range(-0.04..0.04),
            rng.random_range(0.3..0.55),
        );
        let pose = Isometry3::from_parts(place, turn) * Isometry3::translation(-centre.x, -centre.y, 0.0);
        let margin = [(-1.0, -1.0), (10.0, -1.0), (10.0, 7.0), (-1.0, 7.0)];
        let in_view = margin.iter().all(|(x, y)| {
            let at = pose * Point3::new(x * GRID.square_m, y * GRID.square_m, 0.0);
            camera.project(&at).is_ok_and(|px| camera.contains(&px))
        });
        if in_view {
            return pose;
        }
    }
}

struct Errors {
    corners: Vec<Vector2<f64>>,
    worst_depth_m: f64,
}

fn measure(renderer: &Renderer, camera: &Intrinsics, view: usize) -> Errors {
    let mut rng = ChaCha8Rng::seed_from_u64(view as u64);
    let camera_from_target = random_pose(&mut rng, camera);
    let scene = RenderScene {
        world_from_camera: Isometry3::identity(),
        board: BoardSurface::new(camera_from_target, GRID.columns, GRID.rows, GRID.square_m, [0.2, 0.15]),
        solids: Vec::new(),
        light: Light::default(),
        background: [0.4, 0.45, 0.5],
    };
    let frame = renderer.render(&scene, &Imaging::default(), view as u64);
    let found = detect::detect(&gray_from_rgb(&frame.rgb), &TargetSpec::Chessboard(GRID))
        .expect("an image")
        .unwrap_or_else(|| panic!("the board of view {view} is not found"));
    let mut worst_depth_m: f64 = 0.0;
    let corners = found
        .iter()
        .map(|corner| {
            let in_camera = camera_from_target * GRID.point(corner.index);
            let px = camera.project(&in_camera).expect("in front");
            // Depth at the centre of the pixel nearest to the corner, on the board's plane.
            let (u, v) = (px.x.round(), px.y.round());
            let ray = camera.unproject(&Vector2::new(u, v)).expect("inside the lens");
            let normal = camera_from_target.rotation * Vector3::z();
            let along = normal.dot(&in_camera.coords) / normal.dot(&ray);
            let seen = f64::from(frame.depth_m[v as usize * camera.width as usize + u as usize]);
            worst_depth_m = worst_depth_m.max((seen - along * ray.z).abs());
            corner.px - px
        })
        .collect();
    Errors { corners, worst_depth_m }
}

#[test]
fn corners_and_depths_are_where_the_lens_model_says() {
    let ideal = Intrinsics::pinhole(640, 480, 589.37);
    let bent = Intrinsics { distortion: Distortion::BrownConrady([-0.08, 0.05, 6e-4, -4e-4, 0.0]), ..ideal };
    for (name, camera) in [("no distortion", ideal), ("distortion", bent)] {
        let renderer = Renderer::new(camera, 0.01, FAR_M);
        let views: Vec<Errors> = (0..VIEWS).into_par_iter().map(|view| measure(&renderer, &camera, view)).collect();
        let errors: Vec<Vector2<f64>> = views.iter().flat_map(|v| v.corners.iter().copied()).collect();
        let bias = errors.iter().sum::<Vector2<f64>>() / errors.len() as f64;
        let rms = (errors.iter().map(Vector2::norm_squared).sum::<f64>() / (2.0 * errors.len() as f64)).sqrt();
        let depth_mm = views.iter().map(|v| v.worst_depth_m).fold(0.0, f64::max) * 1e3;
        println!(
            "{name}: bias [{:+.4} {:+.4}] px, rms {rms:.4} px per axis over {} corners, worst depth error {depth_mm:.4} mm",
            bias.x,
            bias.y,
            errors.len()
        );
        // A third of a hundredth of a pixel is the effect of rounding to grey levels; the rest is for the straight edges in
        // the model of a corner, which the lens bends.
        assert!(bias.amax() <= 0.002 && rms <= 0.008, "{name}: bias {bias}, rms {rms}");
        assert!(depth_mm <= 0.1, "{name}: {depth_mm} mm");
    }
}
