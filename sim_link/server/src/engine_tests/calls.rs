use super::motions::{tip_pose, to_pose};
use super::*;

#[test]
fn functions_and_constants_are_listed_as_clients_expect() {
    let mut bench = Bench::new();
    assert_eq!(bench.call(A, "zmqRemoteApi.require", vec![Value::from("sim")]), Value::Map(vec![]));
    let info = bench.get("zmqRemoteApi.info", vec![Value::from("sim")]);
    assert_eq!(info.get("getObject"), Some(&wire::map([("func", Value::Map(vec![]))])));
    assert_eq!(info.get("handle_world"), Some(&wire::map([("const", Value::from(-1))])));
    assert_eq!(info.get("simulation_advancing_running"), Some(&wire::map([("const", Value::from(17))])));
    let truth = bench.get("zmqRemoteApi.info", vec![Value::from("handeye")]);
    assert!(truth.get("truth").is_some() && truth.get("getObject").is_none());
    let missing = bench.error("zmqRemoteApi.info", vec![Value::from("simGLTF")]);
    assert!(missing.starts_with("module 'simGLTF' not found: the built-in cell has handeye, sim"), "{missing}");
}

#[test]
fn wrong_calls_are_told_so_in_the_simulators_words() {
    let mut bench = Bench::new();
    let words = "354: in sim._getObject: object does not exist, or alias/path is ill formatted.";
    let path = bench.error("sim.getObject", vec![Value::from("/nope")]);
    assert!(path.starts_with(words) && path.contains("'/nope'"), "{path}");
    assert!(bench.error("sim.foo", vec![]).starts_with("No such function: sim.foo "));
    assert!(bench.error("foo", vec![]).starts_with("No such function: foo "));
    let module = bench.error("zmqRemoteApi.require", vec![Value::from("simNope")]);
    assert!(module.starts_with("module 'simNope' not found:"), "{module}");
    assert_eq!(bench.error("sim.handle_world", vec![]), "attempt to call a number value (upvalue 'func')");
    let missing = "354: in sim.getObjectPose: object does not exist.";
    assert_eq!(bench.error("sim.getObjectPose", vec![Value::from(9999)]), missing);
    let few = "354: in sim.getObjectPose: the function requires more arguments.";
    assert_eq!(bench.error("sim.getObjectPose", vec![]), few);
    let arm = Value::from(bench.engine.cell.stage.arm);
    let joint = "354: in sim.getJointPosition: object is not a joint.";
    assert_eq!(bench.error("sim.getJointPosition", vec![arm.clone()]), joint);
    let sensor = "354: in sim.getVisionSensorImg: object is not a vision sensor.";
    assert_eq!(bench.error("sim.getVisionSensorImg", vec![arm.clone()]), sensor);
    let text = "354: in sim.getObjectPose: argument 2 is not an integer.";
    assert_eq!(bench.error("sim.getObjectPose", vec![arm.clone(), Value::from("x")]), text);
    let nan = "354: in sim.setObjectPosition: invalid data.";
    assert_eq!(bench.error("sim.setObjectPosition", vec![arm.clone(), floats(&[f64::NAN, 0.0, 0.0])]), nan);
    let size = "354: in sim.setObjectPosition: incorrect table size.";
    assert_eq!(bench.error("sim.setObjectPosition", vec![arm, floats(&[1.0])]), size);
}

#[test]
fn a_missing_object_is_minus_one_for_those_who_ask_for_no_error() {
    let mut bench = Bench::new();
    let options = wire::map([("noError", Value::from(true))]);
    assert_eq!(bench.get("sim.getObject", vec![Value::from("/nope"), options]), Value::from(-1));
}

#[test]
fn setters_take_both_orders_of_arguments() {
    let mut bench = Bench::new();
    let dummy = bench.get("sim.createDummy", vec![Value::from(0.01), Value::Null]);
    bench.call(A, "sim.setObjectPosition", vec![dummy.clone(), Value::from(-1), floats(&[1.0, 2.0, 3.0])]);
    assert_eq!(bench.get("sim.getObjectPosition", vec![dummy.clone()]).numbers(), Some(vec![1.0, 2.0, 3.0]));
    bench.call(A, "sim.setObjectPosition", vec![dummy.clone(), wire::integers([4, 5, 6])]);
    assert_eq!(bench.get("sim.getObjectPosition", vec![dummy, Value::from(-1)]).numbers(), Some(vec![4.0, 5.0, 6.0]));
}

#[test]
fn truth_is_what_the_objects_say_in_opencvs_axes() {
    let mut bench = Bench::new();
    let truth = bench.get("handeye.truth", vec![]);
    let numbers = |name: &str| truth.get(name).and_then(Reader::numbers).expect("numbers");
    let half = std::f64::consts::FRAC_1_SQRT_2;
    for (a, b) in numbers("tip_from_camera").iter().zip([0.05, 0.0, 0.0, 0.0, 0.0, half, half]) {
        assert!((a - b).abs() < 1e-12);
    }
    let focal = truth.get("intrinsics").and_then(|i| i.get("fx")).and_then(Reader::number).expect("a number");
    assert!((focal - 589.3667).abs() < 1e-4);
    let mut moved = numbers("base_from_target");
    moved[1] -= 0.1;
    bench.call(A, "handeye.setBoardPose", vec![floats(&moved)]);
    let read = bench.get("handeye.truth", vec![]).get("base_from_target").and_then(Reader::numbers).expect("numbers");
    for (a, b) in read.iter().zip(&moved) {
        assert!((a - b).abs() < 1e-12);
    }
}

#[test]
fn buffers_are_background_before_the_first_pass_and_come_with_the_full_resolution() {
    let mut bench = Bench::new();
    let camera = Value::from(bench.engine.cell.stage.camera);
    let image = bench.call(A, "sim.getVisionSensorImg", vec![camera.clone()]);
    let [pixels, size] = image.list().expect("two values") else { panic!("two values") };
    let pixels = pixels.blob().expect("bytes");
    assert_eq!((pixels.len(), size), (640 * 480 * 3, &wire::integers([640, 480])));
    assert!(pixels.chunks(3).all(|pixel| pixel == [182, 196, 214]));
    let crop = vec![camera.clone(), Value::from(1), Value::from(0.0), wire::integers([10, 20]), wire::integers([4, 2])];
    let part = bench.call(A, "sim.getVisionSensorImg", crop);
    let [pixels, size] = part.list().expect("two values") else { panic!("two values") };
    assert_eq!((pixels.blob(), size), (Some(&[197_u8; 8][..]), &wire::integers([640, 480])));
    let beyond = vec![camera, Value::from(0), Value::from(0.0), wire::integers([639, 0]), wire::integers([2, 1])];
    assert!(bench.error("sim.getVisionSensorImg", beyond).ends_with("invalid arguments."));
    let depth = bench.get("sim.getObject", vec![Value::from("/UR5/3D_camera/depth")]);
    for (options, far) in [(1, 3.5_f32), (0, 1.0)] {
        let depths = bench.call(A, "sim.getVisionSensorDepth", vec![depth.clone(), Value::from(options)]);
        let bytes = depths.list().expect("two values")[0].blob().expect("bytes").to_vec();
        assert_eq!(bytes.len(), 640 * 480 * 4);
        assert!(bytes.chunks(4).all(|b| b == far.to_le_bytes()));
    }
}

#[test]
fn a_vision_sensor_tells_its_lens_by_parameters_and_properties() {
    let mut bench = Bench::new();
    let camera = Value::from(bench.engine.cell.stage.camera);
    let angle =
        bench.get("sim.getObjectFloatParam", vec![camera.clone(), Value::from(1004)]).number().expect("a number");
    assert!((angle - 57.0_f64.to_radians()).abs() < 1e-12);
    assert_eq!(bench.get("sim.getObjectInt32Param", vec![camera.clone(), Value::from(1002)]), Value::from(640));
    let planes = bench.get("sim.getFloatArrayProperty", vec![camera.clone(), Value::from("clippingPlanes")]);
    assert_eq!(planes.numbers(), Some(vec![0.01, 3.5]));
    assert_eq!(bench.call(A, "sim.getObjectFloatParam", vec![camera, Value::from(7)]), Value::Map(vec![]));
}

#[test]
fn signals_and_logs_are_kept_within_bounds() {
    let mut bench = Bench::new();
    bench.call(A, "sim.setStringSignal", vec![Value::from("s"), Value::Bytes(vec![0, 255])]);
    assert_eq!(bench.get("sim.getStringSignal", vec![Value::from("s")]), Value::Bytes(vec![0, 255]));
    assert_eq!(bench.call(A, "sim.getInt32Signal", vec![Value::from("s")]), Value::Map(vec![]));
    let long = Value::Bytes(vec![0; crate::cell::MAX_SIGNAL_BYTES + 1]);
    assert!(bench.error("sim.setStringSignal", vec![Value::from("s"), long]).contains("bytes in a signal"));
    let refused = (0..1000).find(|i| {
        bench.send(A, "sim.setInt32Signal", vec![Value::from(format!("{i}")), Value::from(1)]);
        bench.reply(A).expect("answered").get("err").is_some()
    });
    assert_eq!(refused, Some(255));
    for line in 0..1000 {
        bench.call(A, "sim.addLog", vec![Value::from(450), Value::from(format!("{line}"))]);
    }
    assert_eq!(bench.engine.cell.log.len(), 200);
    bench.call(A, "sim.addLog", vec![Value::from(450), Value::Null]);
    bench.call(A, "sim.addLog", vec![Value::from(420), Value::from("oh")]);
}

/// The colour buffer as it is sent.
fn image(bench: &mut Bench) -> Vec<u8> {
    let camera = Value::from(bench.engine.cell.stage.camera);
    let image = bench.call(A, "sim.getVisionSensorImg", vec![camera]);
    image.list().expect("two values")[0].blob().expect("bytes").to_vec()
}

#[test]
fn image_noise_is_new_in_every_pass_and_the_same_for_everybody_who_looks() {
    let mut scene = Scene::default();
    (scene.image.noise_grey, scene.camera.width, scene.camera.height) = (2.0, 64, 48);
    let mut images = [(); 2].map(|()| {
        let mut bench = Bench::with(&scene, false);
        bench.call(A, "sim.setStepping", vec![Value::from(true)]);
        bench.call(A, "sim.startSimulation", vec![]);
        let mut images = Vec::new();
        for _ in 0..3 {
            bench.call(A, "sim.step", vec![]);
            images.push(image(&mut bench));
            assert_eq!(images.last(), Some(&image(&mut bench)));
        }
        images
    });
    assert_eq!(images[0], images[1], "the same seed gives the same noise");
    images[0].dedup();
    assert_eq!(images[0].len(), 3);
}

#[test]
fn a_world_without_its_board_or_arm_is_still_drawn() {
    let mut bench = Bench::new();
    bench.call(A, "sim.setStepping", vec![Value::from(true)]);
    bench.call(A, "sim.startSimulation", vec![]);
    bench.call(A, "sim.step", vec![]);
    let before = image(&mut bench);
    let (plane, joint) = (bench.engine.cell.stage.plane, bench.engine.cell.stage.joints[2]);
    bench.call(A, "sim.removeObjects", vec![wire::integers([plane, joint])]);
    bench.call(A, "sim.step", vec![]);
    assert_ne!(image(&mut bench), before);
    assert!(bench.error("handeye.truth", vec![]).ends_with("object does not exist."));
    let start = tip_pose(&mut bench);
    let params = to_pose(&mut bench, &start, vec![]);
    assert!(bench.error("sim.moveToPose", vec![params]).ends_with("object does not exist."));
}

#[test]
fn functions_that_the_cell_does_not_have_are_listed_and_say_what_to_do() {
    let mut bench = Bench::new();
    let info = bench.get("zmqRemoteApi.info", vec![Value::from("sim")]);
    for (name, what) in [
        ("getScript", "no scripts"),
        ("loadScene", "handeye cell --scene FILE"),
        ("setJointTargetVelocity", "sim.setJointTargetPosition"),
        ("setVisionSensorImg", "cannot be written"),
    ] {
        assert!(info.get(name).is_some(), "a client that builds its object from the list would not call {name}");
        let error = bench.error(&format!("sim.{name}"), vec![]);
        assert!(error.contains(what), "{error}");
    }
}
