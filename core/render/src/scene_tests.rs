//! Bodies, order of depth, clipping, edges, and images as values.

use handeye_geometry::camera::{Distortion, Intrinsics};
use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::{BoardSurface, Finish, Imaging, Light, LightSource, RenderScene, Renderer, Shape, Solid};

const FAR_M: f64 = 3.5;

fn small_camera() -> Intrinsics {
    Intrinsics::from_view_angle(160, 120, 57f64.to_radians())
}

fn renderer() -> Renderer {
    Renderer::new(small_camera(), 0.01, FAR_M)
}

/// Camera at the world's origin looking along z, board 0.5 m before it.
fn scene(solids: Vec<Solid>) -> RenderScene {
    let world_from_target = Isometry3::translation(-0.0675, -0.045, 0.5);
    RenderScene {
        world_from_camera: Isometry3::identity(),
        board: BoardSurface::new(world_from_target, 10, 7, 0.015, [0.20, 0.15]),
        solids,
        light: Light::default(),
        background: [0.25, 0.5, 0.75],
    }
}

fn without_board(solids: Vec<Solid>) -> RenderScene {
    let mut scene = scene(solids);
    scene.board.world_from_target = Isometry3::translation(0.0, 0.0, -1.0);
    scene
}

fn ball(x: f64, y: f64, z: f64, radius: f64) -> Solid {
    Solid::new(Shape::Sphere { radius }, Isometry3::translation(x, y, z), [0.9, 0.1, 0.1])
}

fn depth_at(depths: &[f32], x: usize, y: usize) -> f64 {
    f64::from(depths[y * 160 + x])
}

/// Signed distance to the surface of a solid, in world coordinates; a bound of it for boxes and cylinders inside.
fn signed_distance(solid: &Solid, point: &Point3<f64>) -> f64 {
    let p = solid.world_from_shape.inverse() * point;
    let outside = |x: f64, y: f64| x.max(y).min(0.0) + x.max(0.0).hypot(y.max(0.0));
    match solid.shape {
        Shape::Sphere { radius } => p.coords.norm() - radius,
        Shape::Capsule { a, b, radius } => {
            let along = b - a;
            let tau = ((p - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            (p - (a + along * tau)).norm() - radius
        }
        Shape::Box { half_extents: h } => outside(outside(p.x.abs() - h.x, p.y.abs() - h.y), p.z.abs() - h.z),
        Shape::Cylinder { radius, half_height } => outside(p.x.hypot(p.y) - radius, p.z.abs() - half_height),
        Shape::Plane => p.z,
    }
}

fn random_solids(random: &mut ChaCha8Rng) -> Vec<Solid> {
    let mut number = |low: f64, high: f64| random.random_range(low..high);
    let mut solids: Vec<Solid> = (0..12)
        .map(|i| {
            let shape = match i % 4 {
                0 => Shape::Sphere { radius: number(0.02, 0.2) },
                1 => Shape::Capsule {
                    a: Point3::new(number(-0.2, 0.2), number(-0.2, 0.2), 0.0),
                    b: Point3::new(number(-0.2, 0.2), 0.1, number(-0.2, 0.2)),
                    radius: number(0.02, 0.08),
                },
                2 => {
                    Shape::Box { half_extents: Vector3::new(number(0.02, 0.3), number(0.02, 0.3), number(0.002, 0.1)) }
                }
                _ => Shape::Cylinder { radius: number(0.02, 0.1), half_height: number(0.01, 0.3) },
            };
            let translation = Vector3::new(number(-0.5, 0.5), number(-0.4, 0.4), number(0.3, 2.0));
            let turn = Vector3::new(number(-2.0, 2.0), number(-2.0, 2.0), number(-2.0, 2.0));
            Solid::new(shape, Isometry3::new(translation, turn), [0.5; 3])
        })
        .collect();
    let floor = UnitQuaternion::from_scaled_axis(Vector3::x() * 1.7);
    solids.push(Solid::new(Shape::Plane, Isometry3::from_parts([0.0, 0.6, 0.0].into(), floor), [0.5; 3]));
    solids
}

#[test]
fn rays_end_on_the_first_body_in_their_way() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let camera = small_camera();
    let mut ends = 0;
    for _ in 0..12 {
        let solids = random_solids(&mut random);
        let free: Vec<Solid> = solids.iter().filter(|s| signed_distance(s, &Point3::origin()) > 0.0).cloned().collect();
        let depths = renderer().render_depth(&without_board(free.clone()), &Imaging::default(), 0);
        for (i, &depth) in depths.iter().enumerate().step_by(7) {
            let px = nalgebra::Vector2::new((i % 160) as f64, (i / 160) as f64);
            let ray = camera.unproject(&px).expect("pinhole").into_inner();
            let ray = ray / ray.z;
            let nearest = |depth: f64| {
                let point = Point3::from(ray * depth);
                free.iter().map(|solid| signed_distance(solid, &point)).fold(f64::INFINITY, f64::min)
            };
            let depth = f64::from(depth);
            // Sphere tracing finds the first surface by distances alone.
            let mut walked = 0.01;
            for _ in 0..20_000 {
                let step = nearest(walked) / ray.norm();
                if step < 1e-8 || walked > FAR_M {
                    break;
                }
                walked += step;
            }
            if depth < FAR_M {
                ends += 1;
                assert!(nearest(depth).abs() < 2e-6, "{px:?}: depth {depth} is on no surface");
                assert!(walked > depth - 1e-5, "{px:?}: passed through a body at {walked} on the way to {depth}");
            } else {
                assert!(walked > FAR_M, "{px:?}: missed a body at {walked}");
            }
        }
    }
    assert!(ends > 5000, "{ends}");
}

#[test]
fn a_body_before_the_board_hides_it_and_one_behind_does_not_show() {
    let depths = renderer().render_depth(
        &scene(vec![ball(0.02, 0.0, 0.4, 0.01), ball(-0.02, 0.0, 0.6, 0.03)]),
        &Imaging::default(),
        0,
    );
    let camera = small_camera();
    let column = |x: f64, z: f64| (camera.fx * x / z + camera.cx).round() as usize;
    assert!((depth_at(&depths, column(0.02, 0.4), 60) - 0.39).abs() < 1e-3);
    assert!((depth_at(&depths, column(-0.02, 0.5), 60) - 0.5).abs() < 1e-6);
}

#[test]
fn what_lies_close_behind_a_tilted_board_changes_no_pixel() {
    let tilted =
        Isometry3::from_parts(Translation3::new(0.0, 0.0, 0.5), UnitQuaternion::from_euler_angles(0.4, -0.3, 0.2));
    // Half a millimetre behind the sheet, and a little smaller so that it shows on no side.
    let plate = Shape::Box { half_extents: Vector3::new(0.095, 0.07, 0.002) };
    let plate = Solid::new(plate, tilted * Translation3::new(0.0, 0.0, 0.0025), [0.9, 0.1, 0.1]);
    let images = [scene(vec![plate]), scene(Vec::new())].map(|mut scene| {
        scene.board.world_from_target = tilted * Translation3::new(-0.0675, -0.045, 0.0);
        renderer().render(&scene, &Imaging::default(), 0)
    });
    assert!(images[0] == images[1]);
}

#[test]
fn a_wall_that_fills_the_image_has_one_colour_and_the_depth_of_its_plane() {
    let turned = UnitQuaternion::from_euler_angles(0.3, -0.2, 0.0);
    let wall = Shape::Box { half_extents: Vector3::new(3.0, 3.0, 0.1) };
    let pose = Isometry3::from_parts(Translation3::new(0.0, 0.0, 1.1), turned);
    let image =
        renderer().render(&without_board(vec![Solid::new(wall, pose, [0.4, 0.5, 0.6])]), &Imaging::default(), 0);
    let colour = image.rgb.get_pixel(80, 60);
    assert!(image.rgb.pixels().all(|pixel| pixel == colour));
    let normal = turned * Vector3::z();
    let offset = normal.dot(&(pose * Point3::new(0.0, 0.0, -0.1)).coords);
    let camera = small_camera();
    for (i, depth) in image.depth_m.iter().enumerate() {
        let px = nalgebra::Vector2::new((i % 160) as f64, (i / 160) as f64);
        let ray = camera.unproject(&px).expect("a pinhole");
        let expected = offset / normal.dot(&(ray.into_inner() / ray.z));
        assert!((f64::from(*depth) - expected).abs() < 1e-6, "pixel {i}: {depth} instead of {expected}");
    }
}

#[test]
fn the_back_of_the_sheet_is_plain() {
    let mut scene = scene(Vec::new());
    let half_turn = Isometry3::rotation(Vector3::y() * std::f64::consts::PI);
    scene.board.world_from_target = Isometry3::translation(0.0675, -0.045, 0.5) * half_turn;
    let image = renderer().render_rgb(&scene, &Imaging::default(), 0);
    let middle = *image.get_pixel(80, 60);
    for (x, y) in [(60, 50), (70, 65), (95, 55), (99, 70)] {
        assert_eq!(*image.get_pixel(x, y), middle);
    }
    assert_ne!(middle, *image.get_pixel(1, 1));
}

#[test]
fn nothing_means_the_background_and_exactly_the_far_plane() {
    let frame = renderer().render(&without_board(Vec::new()), &Imaging::default(), 0);
    assert!(frame.depth_m.iter().all(|&d| d == 3.5));
    assert!(frame.rgb.pixels().all(|p| p.0 == [64, 128, 191]));
}

#[test]
fn what_is_outside_the_clipping_planes_is_not_drawn() {
    let near = ball(0.0, 0.0, 0.006, 0.003);
    let far = ball(0.0, 0.0, 4.0, 0.4);
    let frame = renderer().render(&without_board(vec![near, far]), &Imaging::default(), 0);
    assert!(frame.depth_m.iter().all(|&d| d == 3.5));
    assert!(frame.rgb.pixels().all(|p| p.0 == [64, 128, 191]));
}

#[test]
fn a_camera_sees_out_of_its_housing() {
    let housing =
        Solid::new(Shape::Box { half_extents: Vector3::new(0.1, 0.05, 0.02) }, Isometry3::identity(), [0.1; 3]);
    let depths = renderer().render_depth(&scene(vec![housing]), &Imaging::default(), 0);
    assert!((depth_at(&depths, 80, 60) - 0.5).abs() < 1e-6);
}

#[test]
fn the_print_wins_against_the_table_that_it_lies_on() {
    let table = Solid::new(
        Shape::Box { half_extents: Vector3::new(0.3, 0.3, 0.05) },
        Isometry3::translation(0.0, 0.0, 0.55),
        [0.5, 0.3, 0.1],
    );
    for tilt in [0.0, 0.3] {
        let turn = Isometry3::rotation(Vector3::x() * tilt);
        let mut scene = scene(vec![table.clone()]);
        let about = Isometry3::translation(0.0, 0.0, 0.5) * turn * Isometry3::translation(0.0, 0.0, -0.5);
        scene.board.world_from_target = about * scene.board.world_from_target;
        scene.solids[0].world_from_shape = about * scene.solids[0].world_from_shape;
        let image = renderer().render_rgb(&scene, &Imaging::default(), 0);
        for (x, y) in (60..100).flat_map(|x| (50..70).map(move |y| (x, y))) {
            let [r, _, b] = image.get_pixel(x, y).0;
            assert_eq!(r, b, "no wood shines through at {x} {y}");
        }
    }
}

#[test]
fn edges_of_bodies_are_smooth_and_keep_their_area() {
    // A square plate turned by 0.3 rad about the axis: its area in the image is known.
    let side = 0.2;
    let plate = Solid::new(
        Shape::Box { half_extents: Vector3::new(side / 2.0, side / 2.0, 1e-4) },
        Isometry3::new(Vector3::new(0.003, 0.002, 0.5), Vector3::z() * 0.3),
        [0.0; 3],
    );
    let image = renderer().render_rgb(&without_board(vec![plate]), &Imaging::default(), 0);
    let covered: f64 = image.pixels().map(|p| 1.0 - f64::from(p.0[2]) / 191.0).sum();
    let expected = (small_camera().fx * side / (0.5 - 1e-4)).powi(2);
    // 16 rays per pixel on about 200 edge pixels: the errors, at most 1/16 each, average out.
    assert!((covered / expected - 1.0).abs() < 2e-3, "{covered} {expected}");
    let levels: std::collections::BTreeSet<u8> = image.pixels().map(|p| p.0[2]).collect();
    assert!(levels.len() > 10, "{levels:?}");
}

/// A floor 0.3 m under the camera, with a ball over it.
fn floor_scene(source: LightSource, with_ball: bool) -> RenderScene {
    let up = UnitQuaternion::rotation_between(&Vector3::z(), &-Vector3::y()).expect("not opposite");
    let floor = Isometry3::from_parts(Translation3::new(0.0, 0.3, 0.0), up);
    let mut solids = vec![
        Solid::new(Shape::Plane, floor, [0.7; 3]).with_finish(Finish::Tiles { pitch_m: 0.11, joint_m: 0.004 }),
        Solid::new(
            Shape::Box { half_extents: Vector3::new(0.6, 0.2, 0.05) },
            floor * Translation3::new(0.0, -1.5, 0.05),
            [0.7; 3],
        )
        .with_finish(Finish::Wood),
    ];
    if with_ball {
        solids.push(ball(0.1, 0.15, 1.0, 0.05));
    }
    RenderScene { light: Light { source, ..Light::default() }, ..scene(solids) }
}

#[test]
fn floors_look_the_same_by_the_short_way_as_by_the_long_way() {
    let towards = Vector3::new(0.3, -1.0, -0.2).normalize();
    // A lamp at a place takes the long way, one in a direction the short way.
    let far_lamp = LightSource::Point(Point3::from(towards * 1e7));
    let renderer = Renderer::new(Intrinsics::from_view_angle(640, 480, 57f64.to_radians()), 0.01, FAR_M);
    let render = |source| renderer.render(&floor_scene(source, true), &Imaging::default(), 0);
    let (short, long) = (render(LightSource::Directional(Unit::new_normalize(towards))), render(far_lamp));
    assert_eq!(short.depth_m, long.depth_m);
    let worst = short.rgb.iter().zip(long.rgb.iter()).map(|(a, b)| a.abs_diff(*b)).max();
    assert!(worst <= Some(8), "{worst:?}");
    let sum: u64 = short.rgb.iter().zip(long.rgb.iter()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    assert!(sum < short.rgb.len() as u64 / 4, "mean difference {}", sum as f64 / short.rgb.len() as f64);
}

#[test]
fn a_body_darkens_the_floor_below_it_and_leaves_the_print_alone() {
    let above = LightSource::Directional(Unit::new_normalize(Vector3::new(0.0, -1.0, 0.0)));
    let render = |with_ball| renderer().render_rgb(&floor_scene(above, with_ball), &Imaging::default(), 0);
    let (with, without) = (render(true), render(false));
    let camera = small_camera();
    let below = camera.project(&Point3::new(0.1, 0.3, 1.0)).expect("in front");
    let at = |image: &image::RgbImage| image.get_pixel(below.x as u32, below.y as u32).0[0];
    assert!(f32::from(at(&with)) < 0.75 * f32::from(at(&without)), "{} {}", at(&with), at(&without));

    let facing = LightSource::Directional(Unit::new_normalize(Vector3::new(0.0, -0.2, -1.0)));
    let board_only = |solids| {
        let scene = RenderScene { light: Light { source: facing, ..Light::default() }, ..scene(solids) };
        renderer().render_rgb(&scene, &Imaging::default(), 0)
    };
    // The ball is behind the camera, between the lamp and the board.
    assert_eq!(board_only(Vec::new()), board_only(vec![ball(0.0, 0.0, -0.3, 0.05)]));
}

#[test]
fn squares_smaller_than_a_pixel_average_to_grey() {
    let mut scene = scene(Vec::new());
    // 2 mm at 3 m are a tenth of a pixel of this camera.
    scene.board = BoardSurface::new(Isometry3::translation(-0.4, -0.3, 3.0), 401, 301, 0.002, [0.9, 0.7]);
    let image = renderer().render_rgb(&scene, &Imaging::default(), 0);
    scene.board.dark = scene.board.white;
    let white = f64::from(renderer().render_rgb(&scene, &Imaging::default(), 0).get_pixel(80, 60).0[0]);
    let expected = white * 0.5 * (1.0 + 0.06 / 0.9);
    for (x, y) in (65..95).flat_map(|x| (50..70).map(move |y| (x, y))) {
        let level = f64::from(image.get_pixel(x, y).0[0]);
        assert!((level - expected).abs() < 2.0, "{x} {y}: {level}, expected {expected}");
    }
}

#[test]
fn pixels_beyond_the_reach_of_the_lens_show_the_background() {
    let lens = Distortion::BrownConrady([-0.5, 0.0, 0.0, 0.0, 0.0]);
    let camera = Intrinsics { distortion: lens, ..Intrinsics::pinhole(160, 120, 75.0) };
    let wall = Solid::new(
        Shape::Box { half_extents: Vector3::new(9.0, 9.0, 0.1) },
        Isometry3::translation(0.0, 0.0, 2.0),
        [0.9; 3],
    );
    let frame = Renderer::new(camera, 0.01, FAR_M).render(&without_board(vec![wall]), &Imaging::default(), 0);
    assert_eq!(depth_at(&frame.depth_m, 0, 0), 3.5);
    assert_eq!(frame.rgb.get_pixel(0, 0).0, [64, 128, 191]);
    assert!((depth_at(&frame.depth_m, 80, 60) - 1.9).abs() < 1e-6);
}

#[test]
fn a_fisheye_renders_what_is_in_front_of_its_plane() {
    let lens = Distortion::Fisheye([0.02, -0.003, 0.0, 0.0]);
    // 160 pixels at 45 px/rad see past 90 degrees on both sides.
    let camera = Intrinsics { distortion: lens, ..Intrinsics::pinhole(160, 120, 45.0) };
    let frame = Renderer::new(camera, 0.01, FAR_M).render(&scene(Vec::new()), &Imaging::default(), 0);
    assert!((depth_at(&frame.depth_m, 80, 60) - 0.5).abs() < 1e-6);
    assert_eq!(depth_at(&frame.depth_m, 0, 60), 3.5);
}

#[test]
fn unusable_intrinsics_give_an_empty_image_and_no_panic() {
    for camera in [
        Intrinsics { fx: f64::NAN, ..small_camera() },
        Intrinsics { width: 0, ..small_camera() },
        Intrinsics { fy: 0.0, ..small_camera() },
    ] {
        let frame = Renderer::new(camera, 0.01, FAR_M).render(&scene(Vec::new()), &Imaging::default(), 0);
        assert!(frame.depth_m.iter().all(|&d| d == 3.5));
        assert_eq!(frame.rgb.dimensions(), (camera.width, camera.height));
    }
}

#[test]
fn the_same_arguments_give_the_same_bytes_and_the_parts_equal_the_whole() {
    let imaging = Imaging {
        blur_px: 0.8,
        noise_grey: 3.0,
        exposure: 1.1,
        depth_noise_m: 0.001,
        depth_noise_per_m2: 0.001,
        depth_offset_px: 0.4,
        ..Imaging::default()
    };
    let solids = random_solids(&mut ChaCha8Rng::seed_from_u64(2))
        .into_iter()
        .map(|solid| solid.with_finish(Finish::Brushed))
        .collect();
    let scene = scene(solids);
    let frame = renderer().render(&scene, &imaging, 42);
    assert_eq!(frame, renderer().render(&scene, &imaging, 42));
    assert_eq!(frame.rgb, renderer().render_rgb(&scene, &imaging, 42));
    assert_eq!(frame.depth_m, renderer().render_depth(&scene, &imaging, 42));
    let other = renderer().render(&scene, &imaging, 43);
    assert_ne!(frame.rgb, other.rgb);
    assert_ne!(frame.depth_m, other.depth_m);
}

#[test]
fn the_default_light_saturates_nothing() {
    let frame = renderer().render(&scene(random_solids(&mut ChaCha8Rng::seed_from_u64(4))), &Imaging::default(), 0);
    assert!(frame.rgb.iter().all(|&level| level < 250));
}
