//! The image of the board against the analytic projection, by measurements that share no code with the renderer.

use std::sync::Arc;

use handeye_geometry::camera::{Distortion, Intrinsics};
use image::RgbImage;
use nalgebra::{Isometry3, Matrix2, Point3, Translation3, Unit, UnitQuaternion, Vector2, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::{BoardSurface, Imaging, Light, LightSource, PrintErrors, RenderScene, Renderer, Sampling};

const COLUMNS: usize = 10;
const ROWS: usize = 7;
const SQUARE_M: f64 = 0.015;

fn cameras() -> [Intrinsics; 2] {
    let ideal = Intrinsics::from_view_angle(640, 480, 57f64.to_radians());
    let lens = Distortion::BrownConrady([-0.14, 0.06, 0.0007, -0.0005, 0.01]);
    [ideal, Intrinsics { fx: 601.3, fy: 597.8, cx: 322.4, cy: 236.9, distortion: lens, ..ideal }]
}

fn scene(camera_from_target: Isometry3<f64>) -> RenderScene {
    RenderScene {
        world_from_camera: camera_from_target.inverse(),
        board: BoardSurface::new(Isometry3::identity(), COLUMNS, ROWS, SQUARE_M, [0.20, 0.15]),
        solids: Vec::new(),
        light: Light {
            source: LightSource::Directional(Unit::new_normalize(Vector3::new(0.2, -0.3, -1.0))),
            ..Light::default()
        },
        background: [0.4; 3],
    }
}

fn corner(column: f64, row: f64) -> Point3<f64> {
    Point3::new(column * SQUARE_M, row * SQUARE_M, 0.0)
}

/// A pose 0.3 to 0.6 m away, tilted by up to 45 degrees and rolled by up to `roll`, all squares in the image.
fn random_pose(random: &mut ChaCha8Rng, camera: &Intrinsics, roll: f64) -> Isometry3<f64> {
    loop {
        let distance = random.random_range(0.3..0.6);
        let lateral = Vector2::new(random.random_range(-0.12..0.12), random.random_range(-0.10..0.10));
        let towards: f64 = random.random_range(0.0..std::f64::consts::TAU);
        let tilt_axis = Vector3::new(towards.cos(), towards.sin(), 0.0);
        let tilt = UnitQuaternion::from_scaled_axis(tilt_axis * random.random_range(0.0..45f64.to_radians()));
        let roll = UnitQuaternion::from_scaled_axis(Vector3::z() * random.random_range(-roll..roll));
        let middle = corner(4.5, 3.0).coords;
        let pose = Isometry3::from_parts(Translation3::new(lateral.x, lateral.y, distance), tilt * roll)
            * Translation3::from(-middle);
        let ends = [(-1.0, -1.0), (10.0, -1.0), (10.0, 7.0), (-1.0, 7.0)];
        let inside = |px: Vector2<f64>| px.x > 4.0 && px.y > 4.0 && px.x < 635.0 && px.y < 475.0;
        if ends.iter().all(|&(c, r)| camera.project(&(pose * corner(c, r))).is_ok_and(inside)) {
            return pose;
        }
    }
}

fn grey(image: &RgbImage, x: i64, y: i64) -> f64 {
    f64::from(image.get_pixel(x as u32, y as u32).0[1])
}

/// The point to which the grey gradients around it are orthogonal, by weighted least squares, from a start nearby.
///
/// Reference: Förstner, Gülch 1987, "A fast operator for detection and precise location of distinct points".
fn refine(image: &RgbImage, start: Vector2<f64>, sigma_px: f64) -> Vector2<f64> {
    let reach = (2.5 * sigma_px).ceil() as i64;
    let mut at = start;
    for _ in 0..20 {
        let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
        let (x0, y0) = (at.x.round() as i64, at.y.round() as i64);
        for y in y0 - reach..=y0 + reach {
            for x in x0 - reach..=x0 + reach {
                let p = Vector2::new(x as f64, y as f64);
                let gradient = Vector2::new(
                    grey(image, x + 1, y) - grey(image, x - 1, y),
                    grey(image, x, y + 1) - grey(image, x, y - 1),
                );
                let weight = (-(p - at).norm_squared() / (2.0 * sigma_px * sigma_px)).exp();
                let outer = gradient * gradient.transpose() * weight;
                normal += outer;
                right += outer * p;
            }
        }
        let next = normal.try_inverse().expect("a corner has gradients in two directions") * right;
        let step = (next - at).norm();
        at = next;
        if step < 1e-5 {
            break;
        }
    }
    at
}

struct Errors {
    mean: Vector2<f64>,
    rms: Vector2<f64>,
}

fn errors(all: &[Vector2<f64>]) -> Errors {
    let n = all.len() as f64;
    let mean = all.iter().sum::<Vector2<f64>>() / n;
    let rms = (all.iter().map(|e| e.component_mul(e)).sum::<Vector2<f64>>() / n).map(f64::sqrt);
    Errors { mean, rms }
}

/// Along an image row, the sum of the dark parts of the pixels from the middle of a dark square to the middle of a
/// white one is the place of the edge between them, whatever the blur: a ruler without an estimator.
#[test]
fn edges_have_no_bias() {
    for camera in cameras() {
        let renderer = Renderer::new(camera, 0.01, 3.5);
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let mut all = Vec::new();
        for seed in 0..30 {
            let pose = random_pose(&mut random, &camera, 20f64.to_radians());
            let image = renderer.render_rgb(&scene(pose), &Imaging::default(), seed);
            let at = |c: f64, r: f64| camera.project(&(pose * corner(c, r))).expect("in front");
            for i in 0..(COLUMNS - 2) * (ROWS - 1) {
                let (column, row) = ((1 + i % (COLUMNS - 2)) as f64, (i / (COLUMNS - 2)) as f64 + 0.5);
                let line = at(column, row).y.round();
                let mut on_line = row;
                for _ in 0..8 {
                    let slope = (at(column, on_line + 0.01).y - at(column, on_line - 0.01).y) / 0.02;
                    on_line += (line - at(column, on_line).y) / slope;
                }
                let edge = at(column, on_line).x;
                let half = 0.3 * (at(column + 1.0, row) - at(column, row)).norm();
                let (from, to) = ((edge - half).round() as i64, (edge + half).round() as i64);
                let (left, right) = (grey(&image, from, line as i64), grey(&image, to, line as i64));
                assert!((left - right).abs() > 100.0, "an edge is where the model says");
                let of_left: f64 = (from..=to).map(|x| (grey(&image, x, line as i64) - right) / (left - right)).sum();
                all.push(Vector2::new(from as f64 - 0.5 + of_left - edge, 0.0));
            }
        }
        let Errors { mean, rms } = errors(&all);
        println!("{}: edges mean {:.5} rms {:.5}", camera.distortion.name(), mean.x, rms.x);
        // Rounding to grey levels leaves 0.3 / 140 px for each of the two or three pixels on the edge.
        assert!(mean.x.abs() < 0.001, "{}", mean.x);
        assert!(rms.x < 0.006, "{}", rms.x);
    }
}

#[test]
fn depth_is_that_of_the_plane_along_the_axis() {
    for camera in cameras() {
        let renderer = Renderer::new(camera, 0.01, 3.5);
        let mut random = ChaCha8Rng::seed_from_u64(13);
        let mut seen = 0;
        for seed in 0..20 {
            let pose = random_pose(&mut random, &camera, std::f64::consts::PI);
            let depths = renderer.render_depth(&scene(pose), &Imaging::default(), seed);
            for i in (0..depths.len()).step_by(37) {
                let px = Vector2::new((i % 640) as f64, (i / 640) as f64);
                let ray = camera.unproject(&px).expect("inside the lens model").into_inner();
                let normal = pose.rotation * Vector3::z();
                let hit = ray * (normal.dot(&pose.translation.vector) / normal.dot(&ray));
                let on_sheet = pose.inverse() * Point3::from(hit) - corner(4.5, 3.0);
                let (x, y) = (on_sheet.x.abs(), on_sheet.y.abs());
                if x < 0.0999 && y < 0.0749 {
                    seen += 1;
                    assert!((f64::from(depths[i]) - hit.z).abs() < 1e-6, "{px:?}");
                } else if x > 0.1001 || y > 0.0751 {
                    assert_eq!(depths[i], 3.5);
                }
            }
        }
        assert!(seen > 5000, "{seen}");
    }
}

#[test]
fn every_square_has_its_colour_where_the_lens_model_puts_it() {
    for camera in cameras() {
        let renderer = Renderer::new(camera, 0.01, 3.5);
        let mut random = ChaCha8Rng::seed_from_u64(17);
        for seed in 0..10 {
            let pose = random_pose(&mut random, &camera, std::f64::consts::PI);
            let image = renderer.render_rgb(&scene(pose), &Imaging::default(), seed);
            for (c, r) in (-1..=9).flat_map(|c| (-1..=6).map(move |r| (c, r))) {
                let px = camera.project(&(pose * corner(f64::from(c) + 0.5, f64::from(r) + 0.5))).expect("in front");
                let dark = grey(&image, px.x.round() as i64, px.y.round() as i64) < 60.0;
                assert_eq!(dark, (c + r) % 2 == 0, "square {c} {r}");
            }
        }
    }
}

#[test]
fn an_upright_camera_sees_the_boards_x_axis_to_the_right_and_its_y_axis_down() {
    let camera = cameras()[0];
    let pose = Isometry3::translation(-0.0675, -0.045, 0.35);
    let image = Renderer::new(camera, 0.01, 3.5).render_rgb(&scene(pose), &Imaging::default(), 0);
    // The outermost squares of the first column are dark at the top and white at the bottom, the last column's not.
    let level = |c: f64, r: f64| {
        let px = camera.project(&(pose * corner(c, r))).expect("in front");
        (px, grey(&image, px.x.round() as i64, px.y.round() as i64))
    };
    let ((top_left, a), (top_right, b), (bottom_left, c)) = (level(-0.5, -0.5), level(9.5, -0.5), level(-0.5, 6.5));
    assert!(top_left.x < 200.0 && top_right.x > 440.0 && bottom_left.y > 300.0);
    assert!(a < 60.0 && b < 60.0 && c > 120.0, "{a} {b} {c}");
}

/// Printed position of a node of a print with errors of up to a tenth of a millimetre.
fn printed(column: i64, row: i64) -> Point3<f64> {
    let [along, down] = off(column, row);
    corner(column as f64 + along, row as f64 + down)
}

fn off(column: i64, row: i64) -> [f64; 2] {
    let (c, r) = (column as f64, row as f64);
    [0.006 * (1.7 * c + r).sin(), 0.006 * (c - 2.3 * r).cos()]
}

/// What the centre of a pixel sees, by which sides of the printed squares it is on. `None` on a side.
fn seen_by_centre(pose: &Isometry3<f64>, ray: Vector3<f64>) -> Option<bool> {
    let (origin, ray) = (pose.inverse() * Point3::origin(), pose.inverse_transform_vector(&ray));
    let at = origin - ray * (origin.z / ray.z);
    let mut dark = false;
    for row in -1..ROWS as i64 {
        for column in -1..COLUMNS as i64 {
            let around = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(right, down)| printed(column + right, row + down));
            let inside = (0..4).map(|i| {
                let (from, to) = (around[i], around[(i + 1) % 4]);
                (to - from).xy().perp(&(at - from).xy())
            });
            let nearest = inside.fold(f64::INFINITY, f64::min) / SQUARE_M;
            if nearest.abs() < 1e-6 {
                return None;
            }
            dark |= nearest > 0.0 && (column + row) % 2 == 0;
        }
    }
    Some(dark)
}

#[test]
fn with_one_sample_a_pixel_is_dark_where_its_centre_sees_a_dark_square_of_the_print() {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let imaging = Imaging { sampling: Sampling::Centre, ..Imaging::default() };
    for camera in cameras() {
        let mut scene = scene(random_pose(&mut random, &camera, 1.0));
        scene.board.print = Some(Arc::new(PrintErrors::new(COLUMNS, ROWS, off)));
        let pose = scene.world_from_camera.inverse();
        let image = Renderer::new(camera, 0.01, 3.5).render_rgb(&scene, &imaging, 0);
        let levels: std::collections::BTreeSet<u8> = image.pixels().map(|pixel| pixel.0[1]).collect();
        assert_eq!(levels.len(), 3, "dark, paper and background, and nothing between: {levels:?}");
        let dark = *levels.first().expect("three");
        let (mut asked, mut wrong) = (0, 0);
        for (x, y, pixel) in image.enumerate_pixels().filter(|(x, y, _)| (x + 640 * y) % 17 == 0) {
            let ray = camera.unproject(&Vector2::new(f64::from(x), f64::from(y))).expect("inside the image");
            if let Some(expected) = seen_by_centre(&pose, *ray) {
                asked += 1;
                wrong += usize::from(expected != (pixel.0[1] == dark));
            }
        }
        assert!(asked > 10_000 && wrong == 0, "{wrong} of {asked}");
    }
}

#[test]
fn depth_has_the_offset_that_was_measured_on_coppeliasim() {
    // Millimetres on a board 0.4 m away, by its tilt; the measured ones were read to 0.02 mm.
    for (tilt_deg, measured_mm) in [(0.0f64, 0.0), (15.0, 0.08), (30.0, 0.18), (45.0, 0.32), (60.0, 0.55)] {
        let tilt = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), tilt_deg.to_radians());
        let pose =
            Isometry3::from_parts(Translation3::new(0.0, 0.0, 0.4), tilt) * Translation3::new(-0.0675, -0.045, 0.0);
        let renderer = Renderer::new(cameras()[0], 0.01, 3.5);
        let [ideal, offset] = [0.0, 0.475].map(|depth_offset_px| {
            let imaging = Imaging { depth_offset_px, depth_of_nothing_m: Some(3.5000184), ..Imaging::default() };
            renderer.render_depth(&scene(pose), &imaging, 0)
        });
        let middle = 240 * 640 + 320;
        let by_mm = 1e3 * f64::from(offset[middle] - ideal[middle]);
        assert!((by_mm - measured_mm).abs() < 0.025, "{tilt_deg}°: {by_mm} mm");
        let slope_mm = 1e3 * f64::from(ideal[middle + 640] - ideal[middle]).abs();
        assert!((by_mm - 0.475 * slope_mm).abs() < 0.002, "{by_mm} of {slope_mm}");
        assert_eq!(offset[0], 3.5000184, "nothing is hit beside the sheet");
    }
}

mod slow {
    use super::*;

    #[test]
    fn corners_measured_in_the_image_are_where_the_lens_model_projects_them() {
        for camera in cameras() {
            let renderer = Renderer::new(camera, 0.01, 3.5);
            let mut random = ChaCha8Rng::seed_from_u64(7);
            // Every other image as sharp as can be, which is the hardest to measure in, the rest as a good lens makes it.
            let mut all = [Vec::new(), Vec::new()];
            for seed in 0..200 {
                let blurred = seed % 2;
                let imaging = Imaging { blur_px: [0.0, 0.7][blurred], ..Imaging::default() };
                let pose = random_pose(&mut random, &camera, std::f64::consts::PI);
                let image = renderer.render_rgb(&scene(pose), &imaging, seed as u64);
                for i in 0..COLUMNS * ROWS {
                    let (c, r) = ((i % COLUMNS) as f64, (i / COLUMNS) as f64);
                    let at = |c: f64, r: f64| camera.project(&(pose * corner(c, r))).expect("in front");
                    let truth = at(c, r);
                    let side = (at(c + 0.5, r) - at(c - 0.5, r)).norm().min((at(c, r + 0.5) - at(c, r - 0.5)).norm());
                    // The window stays inside the four squares, where the image is symmetric about the corner.
                    all[blurred].push(refine(&image, truth, 0.2 * side) - truth);
                }
            }
            for Errors { mean, rms } in all.map(|all| errors(&all)) {
                println!("{}: mean {mean:?} rms {rms:?}", camera.distortion.name());
                assert!(mean.amax() < 0.002, "{mean:?}");
                assert!(rms.amax() < 0.025, "{rms:?}");
            }
        }
    }
}
