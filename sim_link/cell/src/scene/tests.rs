use super::*;
use handeye_arm::{ArmKind, JointValues};
use handeye_geometry::frames::{Base, PointIn, Pose, Tip};
use handeye_motion::Course;
use handeye_plan::ViewSetup;
use handeye_wire::axes::sensor_from_camera;
use nalgebra::{Point3, Vector2, Vector3};

/// World poses of the tip that the public script drives to, `[x y z qx qy qz qw]`; it lists one of them twice.
pub(super) const TAUGHT: [[f64; 7]; 10] = [
    [-0.1100547924, -0.0159581117, 0.8466254223, 0.5609105895, -0.5609503047, 0.4305463900, 0.4305158212],
    [-0.1659581117, -0.0159581117, 0.8216254223, 0.5417925805, -0.4495188050, 0.5757261663, 0.4158521675],
    [-0.1100547924, -0.0159581117, 0.8216254223, 0.0000321293, 0.7932742610, -0.6088644722, 0.0000171275],
    [-0.1100547924, -0.0159581117, 0.9216254223, 0.0000140773, 0.7932754374, -0.6088629403, 0.0000108560],
    [-0.1100547924, -0.0159581117, 0.8216254223, 0.5791521935, -0.5416388515, 0.4546027807, 0.4056431968],
    [-0.1100547924, -0.0159581117, 0.8216254223, 0.5415953149, -0.5791980964, 0.4056650408, 0.4545766764],
    [-0.2100547924, -0.0159581117, 0.8816254223, 0.5212515544, -0.5212938038, 0.4777945964, 0.4777676326],
    [-0.1500054792, -0.0159581117, 0.8016254223, 0.5212515544, -0.5212938038, 0.4777945964, 0.4777676326],
    [-0.1500054792, -0.0159581117, 0.8016254223, 0.5212515544, -0.5212938038, 0.4777945964, 0.4777676326],
    [-0.1010000548, -0.0159581117, 0.8016254223, 0.5212515544, -0.5212938038, 0.4777945964, 0.4777676326],
];

pub(super) fn taught(index: usize) -> Pose<Base, Tip> {
    let [x, y, z, qx, qy, qz, qw] = TAUGHT[index];
    Pose::from_translation_xyzw([x, y, z], [qx, qy, qz, qw])
}

fn reference() -> ResolvedScene {
    Scene::reference().unwrap().resolve(1).unwrap()
}

fn pixel(scene: &ResolvedScene, base_from_tip: &Pose<Base, Tip>, point: Point3<f64>) -> Vector2<f64> {
    let in_camera = scene.camera_from_target(base_from_tip) * PointIn::new(point);
    scene.intrinsics.project(&in_camera.point()).unwrap()
}

#[test]
fn the_defaults_are_the_reference_scene() {
    assert_eq!(Scene::reference().unwrap(), Scene::default());
    assert_eq!(Scene::from_toml("").unwrap(), Scene::default());
}

#[test]
fn the_scenes_that_are_built_in_are_valid_and_keep_their_numbers_as_files() {
    for shipped in [ShippedScene::Reference, ShippedScene::Realistic, ShippedScene::Nominal, ShippedScene::Tracking] {
        let scene = shipped.scene().unwrap();
        scene.resolve(7).unwrap();
        let text = toml::to_string(&scene).unwrap();
        assert_eq!(Scene::from_toml(&text).unwrap(), scene);
    }
}

#[test]
fn the_tracking_scene_is_the_realistic_one_but_for_its_time_step_and_the_motion_of_its_board() {
    let mut scene = Scene::tracking().unwrap();
    assert_eq!((scene.simulation.time_step_s, scene.board.motion.path), (0.03, BoardPath::Circle));
    assert_eq!((scene.board.motion.speed_m_s, scene.board.motion.size_m), (0.1, 0.04));
    scene.simulation.time_step_s = SimulationSpec::default().time_step_s;
    scene.board.motion = BoardMotionSpec::default();
    assert_eq!(scene, Scene::realistic().unwrap());
}

#[test]
fn the_nominal_scene_is_the_realistic_one_but_for_a_good_robot_with_the_links_of_a_usual_arm() {
    let mut scene = ShippedScene::Nominal.scene().unwrap();
    assert_eq!((scene.robot.repeatability_mm, scene.robot.repeatability_deg), (0.02, 0.005));
    assert_eq!(scene.robot.arm_errors, ArmErrorsSpec::NOMINAL);
    let realistic = Scene::realistic().unwrap();
    assert_eq!(realistic.robot.arm_errors, ArmErrorsSpec::NONE);
    scene.robot = realistic.robot.clone();
    assert_eq!(scene, realistic);
}

#[test]
fn every_path_of_usual_size_keeps_the_board_in_view_of_the_arm_at_its_start() {
    for scene in [Scene::reference().unwrap(), Scene::tracking().unwrap()] {
        let resolved = scene.resolve(1).unwrap();
        let tip = resolved.reported_tip(&resolved.start_joints).unwrap();
        let plane_from_target = resolved.world_from_plane.inv_mul(resolved.base_from_target.isometry());
        for path in BoardPath::ALL {
            let course = Course::new(&BoardMotionSpec { path, ..BoardMotionSpec::default() }, 1);
            for tenth in 0..600 {
                let offset = course.offset(f64::from(tenth) * 0.1);
                let base_from_target = resolved.world_from_plane * offset * plane_from_target;
                let moved =
                    ResolvedScene { base_from_target: Pose::from_isometry(base_from_target), ..resolved.clone() };
                for point in moved.target.points() {
                    let px = pixel(&moved, &tip, point);
                    let inside = px.x > 5.0 && px.y > 5.0 && px.x < 634.0 && px.y < 474.0;
                    assert!(inside, "{path} after {} s: {px}", f64::from(tenth) * 0.1);
                }
            }
        }
    }
}

#[test]
fn the_reference_camera_is_the_stock_one() {
    let scene = reference();
    // 320 / tan(28.5°), principal point in the middle.
    assert!((scene.intrinsics.fx - 589.3667).abs() < 1e-4);
    assert_eq!((scene.intrinsics.cx, scene.intrinsics.cy), (319.5, 239.5));
    // The hand-eye transform that the public scene's calibration looks for: a quarter turn and 50 mm.
    let quarter = nalgebra::UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
    assert!(scene.tip_from_camera.rotation().angle_to(&quarter) < 1e-12);
    assert!((scene.tip_from_camera.translation() - Vector3::new(0.05, 0.0, 0.0)).norm() < 1e-12);
}

#[test]
fn a_vision_sensor_has_its_x_to_the_left_and_its_y_up() {
    let right_and_down = PointIn::new(Point3::new(1.0, 2.0, 3.0));
    let in_sensor = sensor_from_camera() * right_and_down;
    assert_eq!(in_sensor.point(), Point3::new(-1.0, -2.0, 3.0));
}

#[test]
fn from_the_first_taught_pose_the_board_is_where_the_public_scene_has_it() {
    let scene = reference();
    let tip = taught(0);
    let centre = scene.camera_from_target(&tip) * PointIn::new(scene.target.centre());
    assert!((centre.point().z - 0.3825).abs() < 5e-5, "{centre:?}");
    let px = pixel(&scene, &tip, scene.target.centre());
    // Half of the last digit that is known.
    assert!((px - Vector2::new(342.5, 230.0)).amax() < 0.05, "{px}");
}

#[test]
fn from_every_taught_pose_the_whole_board_is_seen_from_the_front_and_most_show_it_upright() {
    let scene = reference();
    for index in 0..TAUGHT.len() {
        let tip = taught(index);
        for point in scene.target.points() {
            let px = pixel(&scene, &tip, point);
            assert!(scene.intrinsics.contains(&px), "pose {}: {px}", index + 1);
        }
        let origin = pixel(&scene, &tip, Point3::origin());
        let along_x = pixel(&scene, &tip, Point3::new(0.015, 0.0, 0.0)) - origin;
        let along_y = pixel(&scene, &tip, Point3::new(0.0, 0.015, 0.0)) - origin;
        // x × y points away from the viewer: the print is not mirrored.
        assert!(along_x.perp(&along_y) > 0.0, "pose {}", index + 1);
        // In the third and fourth the camera is rolled by a quarter turn.
        let right = if index == 2 || index == 3 { -along_x.y } else { along_x.x };
        assert!(right > 0.9 * along_x.norm(), "pose {}: x goes {along_x}, y goes {along_y}", index + 1);
    }
}

#[test]
fn the_realistic_scene_shows_the_whole_board_from_every_taught_pose_whatever_the_seed() {
    let scene = Scene::realistic().unwrap();
    // Margin for a detector that uses the surroundings of a corner.
    let margin = 5.0;
    for seed in 0..200 {
        let resolved = scene.resolve(seed).unwrap();
        for index in 0..TAUGHT.len() {
            for point in resolved.target.points() {
                let px = pixel(&resolved, &taught(index), point);
                let inside = px.x > margin && px.y > margin && px.x < 639.0 - margin && px.y < 479.0 - margin;
                assert!(inside, "seed {seed}, pose {}: {px}", index + 1);
            }
        }
    }
}

#[test]
fn the_arm_reaches_every_taught_pose_in_one_configuration_and_touches_nothing() {
    let scene = reference();
    let setup = ViewSetup::from(&scene);
    let mut joints = scene.start_joints;
    for index in 0..TAUGHT.len() {
        let arm_from_connection =
            scene.world_from_arm.inverse() * taught(index).isometry() * scene.connection_from_tip.inverse();
        let found = scene.arm.inverse(&Pose::from_isometry(arm_from_connection), &joints);
        let found = found.unwrap_or_else(|error| panic!("pose {}: {error}", index + 1));
        let found = JointValues::try_from(&found[..]).unwrap();
        let (distance_m, angle_rad) = scene.reported_tip(&found).unwrap().distance_to(&taught(index));
        assert!(distance_m < 1e-9 && angle_rad < 1e-9);
        assert!(setup.arm.is_free(&found, &setup.around, 0.0), "pose {} touches something", index + 1);
        joints = found;
    }
}

#[test]
fn the_sheet_faces_the_robot_and_the_target_lies_in_its_middle() {
    let scene = reference();
    let out_of_print = scene.world_from_plane.rotation * Vector3::z();
    assert!((out_of_print - Vector3::y()).norm() < 1e-12);
    let into_board = scene.base_from_target.rotation() * Vector3::z();
    assert!((into_board + out_of_print).norm() < 1e-12);
    let centre = scene.base_from_target * PointIn::new(scene.target.centre());
    assert!((centre.point().coords - scene.world_from_plane.translation.vector).norm() < 1e-12);
}

#[test]
fn a_seed_decides_everything_and_another_one_changes_everything() {
    let scene = Scene::realistic().unwrap();
    assert_eq!(scene.resolve(3).unwrap(), scene.resolve(3).unwrap());
    let (a, b) = (scene.resolve(3).unwrap(), scene.resolve(4).unwrap());
    assert_ne!(a.tip_from_camera, b.tip_from_camera);
    assert_ne!(a.base_from_target, b.base_from_target);
    assert_ne!(a.robot_errors.settled(0), b.robot_errors.settled(0));
    assert_ne!(a.robot_errors.settled(0), a.robot_errors.settled(1));
    assert_eq!(a.robot_errors.settled(5), a.robot_errors.settled(5));
    // One thing is drawn without regard to another.
    let mut fixed_board = scene;
    fixed_board.board.random_offset_mm = 0.0;
    fixed_board.board.random_offset_deg = 0.0;
    assert_eq!(fixed_board.resolve(3).unwrap().tip_from_camera, a.tip_from_camera);
}

/// The truth of a seed is part of every recorded result, so it must not change between versions or machines.
#[test]
fn the_truth_of_a_seed_is_pinned() {
    let camera = Scene::realistic().unwrap().resolve(1).unwrap().tip_from_camera;
    let nominal = reference().tip_from_camera;
    let delta = handeye_geometry::se3::log((nominal.inverse() * camera).isometry());
    let pinned = [
        0.0007908064455675657,
        -0.004154311114395666,
        0.00022560951133927885,
        -0.01368243819217911,
        0.009642606395657448,
        -0.005208284185074087,
    ];
    for (actual, expected) in delta.iter().zip(pinned) {
        assert!((actual - expected).abs() < 1e-12, "{delta:?}");
    }
}

#[test]
fn repeatability_has_the_stated_size_per_axis() {
    let mut scene = Scene::reference().unwrap();
    scene.robot.repeatability_mm = 0.05;
    scene.robot.repeatability_deg = 0.01;
    let errors = scene.resolve(11).unwrap().robot_errors;
    let count = 4000;
    let mut sums = [0.0; 6];
    for index in 0..count {
        for (sum, value) in sums.iter_mut().zip(errors.settled(index).iter()) {
            *sum += value * value;
        }
    }
    for (axis, sum) in sums.into_iter().enumerate() {
        let sigma = (sum / count as f64).sqrt();
        let stated = if axis < 3 { 0.05e-3 } else { 0.01_f64.to_radians() };
        // The estimate of σ from 4000 draws scatters by 1/√8000, 1.1 %: five times that.
        assert!((sigma / stated - 1.0).abs() < 0.056, "axis {axis}: {sigma} instead of {stated}");
    }
}

#[test]
fn a_perfect_robot_is_where_it_says_and_a_faulty_one_is_not() {
    let mut scene = Scene::reference().unwrap();
    let joints = JointValues::from([0.1, 0.7, -1.0, 0.1, 1.5, 0.2]);
    let perfect = scene.resolve(1).unwrap();
    assert_eq!(perfect.true_tip(&joints, 3), perfect.reported_tip(&joints));
    let offset_deg = JointValues::from([0.1, -0.1, 0.1, 0.0, 0.1, -0.1]);
    scene.robot.joint_offset_deg = Some(offset_deg);
    let offset = scene.resolve(1).unwrap();
    assert_eq!(offset.reported_tip(&joints), perfect.reported_tip(&joints));
    let moved = JointValues::from_fn(6, |i| joints[i] + offset_deg[i].to_radians());
    let arm_from_connection = *ArmKind::Ur5Coppeliasim.arm().forward(&moved).unwrap().isometry();
    let expected = offset.world_from_arm * arm_from_connection * offset.connection_from_tip;
    let (distance_m, angle_rad) = offset.true_tip(&joints, 0).unwrap().distance_to(&Pose::from_isometry(expected));
    assert!(distance_m < 1e-12 && angle_rad < 1e-12);
    scene.robot.repeatability_mm = 0.05;
    let noisy = scene.resolve(1).unwrap();
    assert_ne!(noisy.true_tip(&joints, 0), noisy.true_tip(&joints, 1));
    assert_eq!(noisy.true_tip(&joints, 1), noisy.true_tip(&joints, 1), "an arm that stands still stays put");
}

/// RMS of the displacements of all corners of some boards along both axes, millimetres.
fn print_rms_mm(text: &str, seeds: u64) -> [f64; 2] {
    let scene = Scene::from_toml(text).unwrap();
    let mut sums = [0.0; 2];
    for seed in 0..seeds {
        let resolved = scene.resolve(seed).unwrap();
        for (printed, ideal) in resolved.printed_points().iter().zip(resolved.target.points()) {
            sums[0] += (printed.x - ideal.x).powi(2);
            sums[1] += (printed.y - ideal.y).powi(2);
        }
    }
    sums.map(|sum| 1e3 * (sum / (70 * seeds) as f64).sqrt())
}

#[test]
fn a_print_is_off_the_grid_by_what_the_scene_says_and_the_same_every_time() {
    // Rounding to pixels of w is uniform: w / √12, known to a few parts in a hundred from 10 columns and 7 rows.
    let bitmap = print_rms_mm("[board.print]\nbitmap_px = [1024, 768]\n", 1);
    assert!(bitmap.iter().all(|rms| (0.04..0.07).contains(rms)), "{bitmap:?}");
    // 1σ from 200 boards of 70 corners, and of 7 terms: within four of their own deviations.
    let white = print_rms_mm("[board.print]\nwhite_mm = 0.03\n", 200);
    assert!(white.iter().all(|rms| (rms / 0.03 - 1.0).abs() < 4.0 / (2.0 * 14_000.0f64).sqrt()), "{white:?}");
    let smooth = print_rms_mm("[board.print]\nsmooth_mm = 0.03\n", 200);
    assert!(smooth.iter().all(|rms| (rms / 0.03 - 1.0).abs() < 4.0 / (2.0 * 1400.0f64).sqrt()), "{smooth:?}");
    let scene = Scene::coppeliasim().unwrap();
    assert_eq!(scene.resolve(1).unwrap().printed_points(), scene.resolve(2).unwrap().printed_points());
}

#[test]
fn a_solid_on_the_board_goes_where_the_board_goes() {
    let scene = Scene::realistic().unwrap();
    for seed in [1, 2] {
        let resolved = scene.resolve(seed).unwrap();
        let panel = resolved.solids.iter().find(|s| s.name == "panel").unwrap();
        let plane_from_panel = resolved.world_from_plane.inverse() * panel.world_from_solid;
        // Its front is a millimetre behind the print.
        assert!((plane_from_panel.translation.vector.z + panel.size_m[2] / 2.0 + 0.001).abs() < 1e-12);
    }
}

#[test]
fn mistakes_in_a_file_are_found_at_their_line() {
    let cases: [(&str, usize, &str); 20] = [
        ("[camera]\nnear = 0.1\n", 2, "camera.near"),
        ("[camera]\nwidth = 640\nheight = \"tall\"\n", 3, "camera.height"),
        ("[robot\n", 1, ""),
        ("[board.motion]\npath = \"spiral\"\n", 2, "board.motion.path"),
        ("[board.motion]\npath = \"step\"\ntilt_deg = 31.0\n", 3, "board.motion.tilt_deg"),
        ("[board.motion]\npath = \"circle\"\nsize_m = 0.01\nspeed_m_s = 0.21\n", 4, "board.motion.speed_m_s"),
        ("[board.slip]\nat_stop = 0\nby_mm = [5, 0, 0]\n", 2, "board.slip.at_stop"),
        ("[board.slip]\nat_stop = 1\nby_mm = [5, 0, nan]\n", 3, "board.slip.by_mm[2]"),
        ("[board.print]\nbitmap_px = [1024, 30]\n", 2, "board.print.bitmap_px[1]"),
        ("[board.print]\nwhite_mm = 1.0\n", 2, "board.print.white_mm"),
        ("[robot]\narm_errors = { angle_deg = 2.1 }\n", 2, "robot.arm_errors.angle_deg"),
        ("[robot.arm_errors]\nangle_deg = 0.1\nlength_mm = -0.1\n", 3, "robot.arm_errors.length_mm"),
        ("[robot]\narm_errors = { compliance_deg = nan }\n", 2, "robot.arm_errors.compliance_deg"),
        ("[robot]\narm_errors = { angle = 0.1 }\n", 2, "robot.arm_errors.angle"),
        // Not written down: the line of its table.
        ("\n[camera]\n\nnear_m = 5.0\n", 2, "camera.far_m"),
        ("\n[camera]\nfx = 500.0\n", 2, "camera.fy"),
        ("[board]\npaper_m = [0.2, 0.01]\n", 2, "board.paper_m[1]"),
        ("[robot]\ntip = { rotation_xyzw = [0, 0, 0, 2] }\n", 2, "robot.tip.rotation_xyzw"),
        ("[[solids]]\nname = \"a\"\nsize_m = [1, 0, 1]\nposition_m = [0, 0, 0]\n", 3, "solids[0].size_m[1]"),
        ("seed = 1\n[robot]\nstart_joints_deg = [\n0, 0, 0,\n0, 0, nan]\n", 5, "robot.start_joints_deg[5]"),
    ];
    for (text, expected_line, expected_field) in cases {
        match Scene::from_toml(text).unwrap_err() {
            SceneError::Syntax { line, field, .. } | SceneError::Field { line, field, .. } => {
                assert_eq!((line, field.as_str()), (Some(expected_line), expected_field), "{text}");
            }
            other => panic!("{other}"),
        }
    }
    let message = Scene::from_toml("[image]\nnoise_grey = -1.0\n").unwrap_err().to_string();
    assert_eq!(message, "image.noise_grey is -1, it must be a number from 0 to 64. File: scene, line 2");
}

#[test]
fn a_lens_that_folds_inside_the_image_is_refused() {
    let text = "[camera]\ndistortion = { model = \"brown_conrady\", coefficients = [-3.0, 0, 0, 0, 0] }\n";
    let message = Scene::from_toml(text).unwrap_err().to_string();
    assert!(message.contains("camera.distortion") && message.contains("line 2"), "{message}");
}

#[test]
fn a_file_that_is_missing_is_named() {
    let message = Scene::load(std::path::Path::new("/nowhere/scene.toml")).unwrap_err().to_string();
    assert!(message.contains("/nowhere/scene.toml"), "{message}");
}

#[test]
fn a_scene_made_in_code_is_checked_too() {
    let mut scene = Scene::default();
    scene.camera.far_m = f64::NAN;
    assert!(scene.resolve(1).is_err());
}

/// The arm of the cell in data sets, and the rotation of the tip by its joints, agree with the cell.
#[test]
fn the_arm_of_data_sets_is_the_arm_of_the_cell_and_an_offset_of_a_joint_turns_the_tip_by_its_twist() {
    let mut scene = Scene::realistic().unwrap();
    (scene.robot.repeatability_mm, scene.robot.repeatability_deg) = (0.0, 0.0);
    let offset_deg = 0.2;
    for joint in 0..6 {
        let offsets = JointValues::from_fn(6, |j| if j == joint { offset_deg } else { 0.0 });
        scene.robot.joint_offset_deg = Some(offsets);
        let truth = scene.resolve(3).unwrap();
        let arm = ArmKind::Ur5Coppeliasim.arm();
        let arm = arm
            .clone()
            .mounted(truth.world_from_arm * arm.base_from_first, arm.flange_from_tip * truth.connection_from_tip);
        for moved in 0..6 {
            let joints = JointValues::from_fn(6, |j| truth.start_joints[j] + 0.3 * ((3 * j + moved) as f64).sin());
            let tip = truth.reported_tip(&joints).unwrap();
            let (distance_m, angle_rad) = arm.forward(&joints).unwrap().distance_to(&tip);
            assert!(distance_m < 1e-12 && angle_rad < 1e-7, "acos near 1 has half the digits");
            // The motion of one joint is a screw, and its exponential exact.
            let twist = arm.tip_by_joint(&joints).unwrap()[joint] * f64::to_radians(offset_deg);
            let (off_m, off_rad) = tip.perturbed(&twist).distance_to(&truth.true_tip(&joints, 1).unwrap());
            assert!(off_m < 1e-12 && off_rad < 1e-7, "joint {}: {off_m} m", joint + 1);
        }
    }
}
