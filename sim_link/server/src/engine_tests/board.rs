//! The board that moves and hides; the moment of an image has the pose at which it was drawn.

use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Base, Camera, PointIn, Pose, Target, Tip};
use nalgebra::{Matrix2, Point3, Vector2};

use super::*;
use handeye_cell::scene::ResolvedScene;

/// Grey levels of an image, row 0 on top.
struct Grey {
    width: usize,
    levels: Vec<f64>,
}

impl Grey {
    fn at(&self, x: i64, y: i64) -> f64 {
        self.levels[y as usize * self.width + x as usize]
    }

    /// The point to which the gradients around it are orthogonal (Förstner, Gülch 1987), from a start nearby.
    fn corner_near(&self, start: Vector2<f64>) -> Vector2<f64> {
        let mut at = start;
        for _ in 0..20 {
            let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
            let (x0, y0) = (at.x.round() as i64, at.y.round() as i64);
            for y in y0 - 4..=y0 + 4 {
                for x in x0 - 4..=x0 + 4 {
                    let p = Vector2::new(x as f64, y as f64);
                    let gradient =
                        Vector2::new(self.at(x + 1, y) - self.at(x - 1, y), self.at(x, y + 1) - self.at(x, y - 1));
                    let outer = gradient * gradient.transpose() * (-(p - at).norm_squared() / 8.0).exp();
                    normal += outer;
                    right += outer * p;
                }
            }
            at = normal.try_inverse().expect("a corner has gradients in two directions") * right;
        }
        at
    }
}

impl Bench {
    fn image(&mut self) -> Grey {
        let camera = Value::from(self.engine.cell.stage.camera);
        let reply = self.call(A, "sim.getVisionSensorImg", vec![camera]);
        let bytes = reply.list().expect("a list")[0].blob().expect("bytes").to_vec();
        let greys = bytes.chunks_exact(3).map(|pixel| f64::from(pixel[1])).collect::<Vec<_>>();
        Grey { width: 640, levels: greys.chunks_exact(640).rev().flatten().copied().collect() }
    }

    /// Depth of the pixel in the middle of the image, metres.
    fn depth_in_the_middle(&mut self) -> f64 {
        let depth =
            self.call(A, "sim.getObject", vec![Value::from("/UR5/3D_camera/depth")]).list().expect("one")[0].clone();
        let reply = self.call(A, "sim.getVisionSensorDepth", vec![depth, Value::from(1)]);
        let bytes = reply.list().expect("a list")[0].blob().expect("bytes").to_vec();
        let at = 4 * (240 * 640 + 320);
        f64::from(f32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes")))
    }

    fn moment(&mut self) -> Value {
        self.get("handeye.moment", vec![])
    }

    /// A simulation that waits for the client's steps, after its first pass.
    fn stepping(scene: &Scene) -> Self {
        let mut bench = Self::with(scene, false);
        bench.call(A, "sim.setStepping", vec![Value::from(true)]);
        bench.call(A, "sim.startSimulation", vec![]);
        bench.call(A, "sim.step", vec![]);
        bench
    }

    fn put(&mut self, joints: &[f64]) {
        let handles = self.engine.cell.stage.joints.clone();
        for (handle, position) in handles.into_iter().zip(joints) {
            self.call(A, "sim.setJointPosition", vec![Value::from(handle), Value::Float(*position)]);
        }
    }

    fn board_place(&mut self) -> Vec<f64> {
        self.moment().get("base_from_target").and_then(Reader::numbers).expect("a pose")[..3].to_vec()
    }
}

fn pose<Dst, Src>(map: &Value, key: &str) -> Pose<Dst, Src> {
    let numbers = map.get(key).and_then(Reader::numbers).expect("a pose");
    let [x, y, z, qx, qy, qz, qw] = numbers.try_into().expect("seven numbers");
    Pose::from_translation_xyzw([x, y, z], [qx, qy, qz, qw])
}

fn motion(fields: &[(&'static str, Value)]) -> Vec<Value> {
    vec![wire::map(fields.iter().cloned())]
}

/// Largest distance of a measured corner from where moment and truth have it, pixels.
fn reprojection_error(bench: &mut Bench, scene: &ResolvedScene) -> f64 {
    let (moment, truth) = (bench.moment(), bench.get("handeye.truth", vec![]));
    let base_from_tip: Pose<Base, Tip> = pose(&moment, "tip");
    let tip_from_camera: Pose<Tip, Camera> = pose(&truth, "tip_from_camera");
    let base_from_target: Pose<Base, Target> = pose(&moment, "base_from_target");
    let camera_from_target = (base_from_tip * tip_from_camera).inverse() * base_from_target;
    let lens: Intrinsics = scene.intrinsics;
    let image = bench.image();
    let error = |point: Point3<f64>| {
        let px = lens.project(&(camera_from_target * PointIn::new(point)).point()).expect("in front");
        assert!(px.x > 8.0 && px.y > 8.0 && px.x < 631.0 && px.y < 471.0, "in view: {px}");
        (image.corner_near(px) - px).norm()
    };
    scene.target.points().into_iter().map(error).fold(0.0, f64::max)
}

/// Largest distance of a measured corner from where it is for a camera on this tip, pixels.
fn error_from(image: &Grey, scene: &ResolvedScene, base_from_tip: &Pose<Base, Tip>) -> f64 {
    let camera_from_target = scene.camera_from_target(base_from_tip);
    let error = |point: Point3<f64>| {
        let px = scene.intrinsics.project(&(camera_from_target * PointIn::new(point)).point()).expect("in front");
        (image.corner_near(px) - px).norm()
    };
    scene.target.points().into_iter().map(error).fold(0.0, f64::max)
}

#[test]
fn the_image_is_seen_from_where_the_arm_truly_is_and_not_from_where_it_reports() {
    let mut scene = Scene::default();
    scene.robot.arm_errors = handeye_cell::scene::ArmErrorsSpec::NOMINAL;
    let resolved = scene.resolve(scene.seed).expect("valid");
    let mut bench = Bench::stepping(&scene);
    for swing in [0.0, 0.04, -0.05] {
        let joints: [f64; 6] =
            std::array::from_fn(|i| resolved.start_joints[i] + swing * [0.5, -0.4, 0.8, 0.6, -0.7, 1.5][i]);
        bench.put(&joints);
        bench.call(A, "sim.step", vec![]);
        let (moment, truth) = (bench.moment(), bench.get("handeye.truth", vec![]));
        let nominal = resolved.reported_tip(&joints.into()).expect("six joints");
        let reported: Pose<Base, Tip> = pose(&moment, "tip");
        assert!(reported.distance_to(&nominal).0 < 1e-12);
        let published: Pose<Tip, Camera> = pose(&truth, "tip_from_camera");
        assert!(published.distance_to(&resolved.tip_from_camera).0 < 1e-12);
        let image = bench.image();
        let real = resolved.true_tip(&joints.into(), 0).expect("six joints");
        // As exact as without errors; a millimetre is 1.5 pixels.
        assert!(error_from(&image, &resolved, &real) < 0.1);
        assert!(error_from(&image, &resolved, &reported) > 0.5);
    }
    let joints = bench.get("handeye.truth", vec![]).get("robot").and_then(|robot| robot.get("joints").cloned());
    let joints = joints.expect("they are published");
    let tilts = joints.list().expect("a list").iter().map(|joint| joint.get("tilt_rad").and_then(Reader::numbers));
    assert!(tilts.eq(resolved.robot_errors.joints.iter().map(|joint| Some(joint.tilt_rad.to_vec()))));
}

#[test]
fn the_image_shows_the_board_where_the_moment_says_while_board_and_arm_move() {
    let mut scene = Scene::default();
    scene.board.motion.path = handeye_cell::scene::BoardPath::RandomWalk;
    scene.board.motion.speed_m_s = 0.15;
    let resolved = scene.resolve(scene.seed).expect("valid");
    let mut bench = Bench::stepping(&scene);
    let mut worst: f64 = 0.0;
    for pass in 0..60 {
        let swing = 0.05 * (f64::from(pass) * 0.3).sin();
        let joints: [f64; 6] =
            std::array::from_fn(|i| resolved.start_joints[i] + swing * [0.5, -0.4, 0.8, 0.6, -0.7, 1.5][i]);
        bench.put(&joints);
        // Put, but not seen yet: the moment is still that of the last image.
        if pass % 10 == 5 {
            worst = worst.max(reprojection_error(&mut bench, &resolved));
        }
        bench.call(A, "sim.step", vec![]);
        if pass % 10 == 9 {
            worst = worst.max(reprojection_error(&mut bench, &resolved));
        }
    }
    // 0.15 m/s at 0.38 m: an error of one pass in the moment is an error of 11 pixels.
    assert!(worst < 0.1, "{worst} px");
}

#[test]
fn a_moment_is_of_the_pass_that_the_images_show_and_not_of_what_was_set_since() {
    let mut bench = Bench::stepping(&Scene::default());
    let before = bench.moment();
    let time_s = before.get("sim_time").and_then(Reader::number).expect("a time");
    assert_eq!(time_s, bench.time_s());
    let joints = before.get("joints").and_then(Reader::numbers).expect("joints");
    assert_eq!(joints, bench.joints());
    bench.put(&GOAL);
    bench.call(A, "handeye.setBoardPose", vec![floats(&[0.0, 0.5, 0.8, 0.0, 0.0, 0.0, 1.0])]);
    assert_eq!(bench.moment(), before);
    let truth = bench.get("handeye.truth", vec![]);
    assert_ne!(truth.get("base_from_target"), before.get("base_from_target"), "truth is of now");
    bench.call(A, "sim.step", vec![]);
    let after = bench.moment();
    assert_eq!(after.get("joints").and_then(Reader::numbers), Some(GOAL.to_vec()));
    assert_eq!(after.get("sim_time").and_then(Reader::number), Some(time_s + 0.05));
    assert_eq!(after.get("base_from_target"), truth.get("base_from_target"));
    let tip = Value::from(bench.engine.cell.stage.tip);
    let reported = bench.get("sim.getObjectPose", vec![tip, Value::from(-1)]);
    assert_eq!(after.get("tip"), Some(&reported));
}

#[test]
fn there_is_no_moment_before_the_first_pass_and_after_the_end() {
    let mut bench = Bench::new();
    assert_eq!(bench.moment(), Value::Map(vec![]));
    bench.call(A, "sim.startSimulation", vec![]);
    bench.call(A, "sim.step", vec![]);
    assert!(bench.moment().get("sim_time").is_some());
    bench.call(A, "sim.stopSimulation", vec![Value::from(true)]);
    assert_eq!(bench.moment(), Value::Map(vec![]));
}

#[test]
fn a_board_is_moved_over_the_wire_and_is_back_at_the_end() {
    let mut bench = Bench::stepping(&Scene::default());
    let start = bench.board_place();
    let circle = [("path", Value::from("circle")), ("speed_m_s", Value::Float(0.2)), ("size_m", Value::Float(0.05))];
    bench.call(A, "handeye.moveBoard", motion(&circle));
    let mut way = 0.0;
    let mut before = start.clone();
    for pass in 0..120 {
        bench.call(A, "sim.step", vec![]);
        let place = bench.board_place();
        let step = place.iter().zip(&before).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        way += if pass >= 40 { step } else { 0.0 };
        before = place;
    }
    // The target's origin is not the centre, and turns a little with the board.
    assert!((way / 4.0 - 0.2).abs() < 0.02, "{} m/s", way / 4.0);
    let truth = bench.get("handeye.truth", vec![]);
    assert_eq!(truth.get("base_from_target"), bench.moment().get("base_from_target"));
    bench.call(A, "sim.stopSimulation", vec![Value::from(true)]);
    let truth = bench.get("handeye.truth", vec![]);
    assert_eq!(truth.get("base_from_target").and_then(Reader::numbers).expect("a pose")[..3], start[..]);
}

#[test]
fn a_hidden_board_is_in_neither_image_and_comes_back() {
    let mut scene = Scene::default();
    scene.solids.clear();
    let mut bench = Bench::stepping(&scene);
    // Without what holds it there is nothing behind it.
    let stand = bench.get("sim.getObject", vec![Value::from("/Plane/Stand")]);
    bench.call(A, "sim.removeObjects", vec![Value::Array(vec![stand])]);
    bench.call(A, "sim.step", vec![]);
    let contrast = |image: &Grey| {
        let greys = (100..380).map(|y| image.at(320, y));
        greys.clone().fold(0.0, f64::max) - greys.fold(255.0, f64::min)
    };
    let (seen, depth) = (contrast(&bench.image()), bench.depth_in_the_middle());
    assert!(seen > 100.0 && (depth - 0.49).abs() < 0.01, "{seen} grey levels at {depth} m");
    bench.call(A, "handeye.showBoard", vec![Value::from(false)]);
    assert!(contrast(&bench.image()) > 100.0, "hidden from the next pass on");
    bench.call(A, "sim.step", vec![]);
    let (seen, depth) = (contrast(&bench.image()), bench.depth_in_the_middle());
    assert!(seen < 1.0 && depth == f64::from(3.5_f32), "{seen} grey levels at {depth} m");
    assert!(bench.moment().get("base_from_target").is_some(), "it is there, only not to be seen");
    bench.call(A, "handeye.showBoard", vec![Value::from(true)]);
    bench.call(A, "sim.step", vec![]);
    assert!(contrast(&bench.image()) > 100.0);
    bench.call(A, "handeye.showBoard", vec![Value::from(false)]);
    bench.call(A, "sim.stopSimulation", vec![Value::from(true)]);
    bench.call(A, "sim.setStepping", vec![Value::from(true)]);
    bench.call(A, "sim.startSimulation", vec![]);
    bench.call(A, "sim.step", vec![]);
    assert!(contrast(&bench.image()) > 100.0, "the end of the simulation brings it back");
}

#[test]
fn wrong_paths_and_numbers_are_refused_with_what_they_must_be() {
    let mut bench = Bench::stepping(&Scene::default());
    let before = bench.board_place();
    let circle = ("path", Value::from("circle"));
    let cases: [(Vec<Value>, &str); 10] = [
        (vec![], "missing 'path' field."),
        (vec![Value::from("circle")], "argument 1 is not a table."),
        (motion(&[("path", Value::from(3))]), "invalid 'path' field."),
        (
            motion(&[("path", Value::from("spiral"))]),
            "there is no path \"spiral\" for the board; it is one of still, circle, figure_eight, random_walk, step.",
        ),
        (
            motion(&[circle.clone(), ("speed_m_s", Value::from(2))]),
            "speed_m_s is 2, it must be a number from 0.001 to 1.",
        ),
        (
            motion(&[circle.clone(), ("size_m", Value::Float(f64::NAN))]),
            "size_m is NaN, it must be a number from 0.001 to 0.5.",
        ),
        (
            motion(&[circle.clone(), ("speed_m_s", Value::from(1)), ("size_m", Value::Float(0.04))]),
            "speed_m_s is 1, it must be at most 20/s times size_m, which is 0.04.",
        ),
        (motion(&[circle.clone(), ("tilt_deg", Value::from("much"))]), "invalid 'tilt_deg' field."),
        (motion(&[circle.clone(), ("seed", Value::from(-1))]), "invalid 'seed' field."),
        (
            motion(&[circle, ("speed", Value::from(1))]),
            "there is no field \"speed\"; there are path, speed_m_s, size_m, tilt_deg, seed.",
        ),
    ];
    for (args, expected) in cases {
        assert_eq!(bench.error("handeye.moveBoard", args), format!("354: in handeye.moveBoard: {expected}"));
    }
    let no_boolean = "354: in handeye.showBoard: argument 1 is not a boolean.";
    assert_eq!(bench.error("handeye.showBoard", vec![Value::from("no")]), no_boolean);
    let few = "354: in handeye.showBoard: the function requires more arguments.";
    assert_eq!(bench.error("handeye.showBoard", vec![]), few);
    for _ in 0..20 {
        bench.call(A, "sim.step", vec![]);
    }
    assert_eq!(bench.board_place(), before, "nothing of that moved the board");
}

#[test]
fn a_cell_without_its_board_or_its_camera_answers_what_it_can() {
    let mut bench = Bench::stepping(&Scene::default());
    let plane = bench.engine.cell.stage.plane;
    bench.call(A, "sim.removeObjects", vec![wire::integers([plane])]);
    bench.call(A, "handeye.moveBoard", motion(&[("path", Value::from("circle"))]));
    bench.call(A, "sim.step", vec![]);
    assert!(bench.moment().get("base_from_target").is_none() && bench.moment().get("tip").is_some());
    assert_eq!(
        bench.error("handeye.showBoard", vec![Value::from(false)]),
        "354: in handeye.showBoard: object does not exist."
    );
    let camera = bench.engine.cell.stage.camera;
    bench.call(A, "sim.removeObjects", vec![wire::integers([camera])]);
    assert_eq!(bench.error("handeye.moment", vec![]), "354: in handeye.moment: object does not exist.");
}

#[test]
fn the_depth_is_the_same_whether_colour_was_asked_for_before_or_not() {
    let depths = |colour_first: bool| {
        let mut bench = Bench::stepping(&Scene::tracking().expect("valid"));
        bench.call(A, "sim.step", vec![]);
        if colour_first {
            bench.image();
        }
        let depth = bench.get("sim.getObject", vec![Value::from("/UR5/3D_camera/depth")]);
        bench.call(A, "sim.getVisionSensorDepth", vec![depth, Value::from(1)])
    };
    assert!(depths(true) == depths(false));
}
