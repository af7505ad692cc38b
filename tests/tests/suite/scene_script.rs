//! `assets/scenes/build_reference_scene.py`, unmodified, with the vendor's client: it builds the same cell as the
//! built-in one with the same scene file, and what cannot be built is refused.

use std::collections::BTreeSet;
use std::f64::consts::{PI, TAU};
use std::path::Path;
use std::process::{Command, Output};

use ciborium::Value;
use handeye_geometry::testing::python;
use handeye_tests::coppeliasim::{Call, StandIn};
use handeye_tests::{CellProcess, workspace_root};
use handeye_wire::Reader as _;
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};

/// What it creates, and the arm, which it loads.
const PARTS: [&str; 6] = ["/UR5", "/UR5/Tip", "/UR5/Target", "/UR5/3D_camera", "/UR5/3D_camera/depth", "/Plane"];
/// Rounding of products of poses, metres and radians.
const ROUNDING: f64 = 1e-9;

/// No number is that of the reference scene, and poses only state their differences.
const ANOTHER: &str = r"
[robot]
joint_mode = 'dynamic'
arm = { position_m = [0.1, -0.2, 0.35] }
tip = { position_m = [0.01, 0.0, 0.12], rotation_xyzw = [0.0, 0.6, 0.0, 0.8] }
start_joints_deg = [20.0, 30.0, -80.0, 10.0, 70.0, -15.0]
min_joints_deg = [-180.0, -90.0, -170.0, -100.0, -110.0, -200.0]
max_joints_deg = [190.0, 95.0, 175.0, 105.0, 115.0, 205.0]

[camera]
width = 800
height = 500
view_angle_deg = 49.0
near_m = 0.02
far_m = 2.5
sensor = { position_m = [0.0, 0.06, 0.01], rotation_xyzw = [0.6, 0.0, 0.8, 0.0] }

[board]
columns = 7
rows = 6
square_m = 0.025
paper_m = [0.24, 0.21]
plane = { position_m = [0.5, 0.1, 0.2], rotation_xyzw = [0.36, 0.48, 0.0, 0.8] }
";

/// What existed before the script, and after it.
struct Built {
    server: StandIn,
    own: Vec<(i64, Isometry3<f64>)>,
    lens: Lens,
}

/// The optics of the cell's own sensor.
struct Lens {
    size: [f64; 2],
    near_far_m: [f64; 2],
    view_angle_rad: f64,
}

impl Built {
    /// With the script and these arguments, on a cell with the scene of `text`.
    fn with(python: &Path, text: &str, arguments: &[&str]) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("scene.toml");
        std::fs::write(&file, text).expect("written");
        let file = file.to_str().expect("UTF-8");
        let mut server = StandIn::new(CellProcess::start(&["--scene", file]));
        let own = PARTS.map(|path| place(&mut server, path)).to_vec();
        let lens = Lens::of(&mut server, "/UR5/3D_camera");
        server.empty();
        let arguments: Vec<&str> = arguments.iter().map(|&word| if word == "SCENE" { file } else { word }).collect();
        let output = run(&mut server, python, &arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        Self { server, own, lens }
    }

    fn calls<'a>(&'a self, function: &'a str) -> impl Iterator<Item = &'a Call> {
        self.server.calls.iter().filter(move |call| call.function == format!("sim.{function}"))
    }

    /// Everything is at its place in the cell.
    fn assert_poses(&mut self) {
        for (path, (own, expected)) in PARTS.iter().zip(&self.own) {
            let (handle, pose) = place(&mut self.server, path);
            assert_eq!(handle == *own, *path == "/UR5", "{path} is the script's, and the arm is the model's");
            let (m, rad) = difference(expected, &pose);
            assert!(m < ROUNDING && rad < ROUNDING, "{path} is {m} m and {rad} rad from where the cell has it");
        }
    }

    /// Both sensors have the optics of that of the cell, one for colour and one for depth.
    fn assert_sensors(&mut self) {
        // Names and numbers of the API: handled with all others (not 1), in perspective (2), without a drawn volume (4).
        const OPTIONS: i64 = 2 + 4;
        const RGB_IGNORED: i64 = 1020;
        const DEPTH_IGNORED: i64 = 1021;
        assert_eq!(self.calls("createVisionSensor").count(), 2);
        for call in self.calls("createVisionSensor") {
            let Lens { size: [width, height], near_far_m: [near, far], view_angle_rad } = self.lens;
            assert_eq!(call.args[0].integer(), Some(OPTIONS));
            assert_eq!(call.args[1].numbers().expect("numbers"), [width, height, 0.0, 0.0]);
            let floats = call.args[2].numbers().expect("numbers");
            assert_eq!((floats.len(), floats[0], floats[1]), (11, near, far));
            assert!((floats[2] - view_angle_rad).abs() < ROUNDING, "{} rad", floats[2]);
            assert!(floats[4..].iter().all(|&reserved| reserved == 0.0), "{floats:?}");
        }
        for (path, ignored) in [("/UR5/3D_camera", DEPTH_IGNORED), ("/UR5/3D_camera/depth", RGB_IGNORED)] {
            let sensor = self.server.object(path);
            let set: Vec<_> = self.calls("setObjectInt32Param").filter(|call| is_of(call, sensor)).collect();
            let set: Vec<_> = set.iter().map(|call| (call.args[1].integer(), call.args[2].integer())).collect();
            assert_eq!(set, [(Some(ignored), Some(1))], "{path}");
        }
    }

    /// The squares are those of the cell's own board; returns how many are dark.
    fn assert_board(&mut self) -> usize {
        let truth = self.server.cell.call("handeye.truth", Vec::new()).expect("the truth").values()[0].clone();
        let number = |name: &str| truth.get("target").and_then(|board| board.get(name)?.number()).expect("a number");
        let (columns, rows, square_m) = (number("columns") as i64, number("rows") as i64, number("square_m"));
        let world_from_target = pose(truth.get("base_from_target").expect("a pose"));
        let (sheet, world_from_sheet) = place(&mut self.server, "/Plane");
        let shapes: Vec<Call> = self.calls("createPrimitiveShape").cloned().collect();
        let mut dark = BTreeSet::new();
        for shape in &shapes {
            const PLANE: i64 = 1;
            const STATIC: i64 = 3003;
            const RESPONDABLE: i64 = 3004;
            assert_eq!(shape.args[0].integer(), Some(PLANE));
            let (handle, size) =
                (shape.returned[0].integer().expect("a handle"), shape.args[1].numbers().expect("a size"));
            for (parameter, value) in [(STATIC, 1), (RESPONDABLE, 0)] {
                let set = |call: &Call| {
                    is_of(call, handle)
                        && call.args[1].integer() == Some(parameter)
                        && call.args[2].integer() == Some(value)
                };
                assert!(self.calls("setObjectInt32Param").any(set), "neither falls nor is pushed");
            }
            let colour = self.calls("setShapeColor").filter(|call| is_of(call, handle)).last().expect("a colour");
            let grey = colour.args[3].numbers().expect("a colour");
            if handle == sheet {
                assert!(grey.iter().all(|&value| value > 0.9), "the sheet is white");
                continue;
            }
            assert!(grey.iter().all(|&value| value < 0.1), "squares are dark");
            let world_from_square = pose(&self.server.ask("getObjectPose", vec![handle.into(), (-1).into()])[0]);
            // On the printed side, in front of the sheet by less than a depth camera or a corner detector can resolve.
            let lift_m = world_from_sheet.inv_mul(&world_from_square).translation.z;
            assert!(lift_m > 0.0 && lift_m < 5e-5, "{lift_m} m");
            let target_from_square = world_from_target.inv_mul(&world_from_square);
            // The first inner corner is (0, 0).
            let corner = |x: f64, y: f64| {
                let at = target_from_square * Point3::new(x * size[0] / 2.0, y * size[1] / 2.0, 0.0);
                let grid = [at.x / square_m, at.y / square_m].map(f64::round);
                let off_m = (at.x - grid[0] * square_m).hypot(at.y - grid[1] * square_m);
                assert!(off_m < ROUNDING, "a corner of a square is {off_m} m from the nearest inner corner");
                grid.map(|value| value as i64)
            };
            let corners: BTreeSet<[i64; 2]> =
                [corner(-1.0, -1.0), corner(1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0)].into_iter().collect();
            let first = *corners.first().expect("four");
            assert_eq!(corners, [[0, 0], [0, 1], [1, 0], [1, 1]].map(|[i, j]| [first[0] + i, first[1] + j]).into());
            assert!(dark.insert(first), "two squares in one place");
        }
        let all = (-1..columns).flat_map(|i| (-1..rows).map(move |j| [i, j]));
        assert_eq!(dark, all.filter(|[i, j]| (i + j) % 2 == 0).collect(), "that between the first corners is dark");
        dark.len()
    }
}

impl Lens {
    fn of(server: &mut StandIn, path: &str) -> Self {
        let sensor = server.object(path);
        let mut number = |function, parameter: i64| {
            server.ask(function, vec![sensor.into(), parameter.into()])[0].number().expect("a number")
        };
        Self {
            size: [1002, 1003].map(|parameter| number("getObjectInt32Param", parameter)),
            near_far_m: [1000, 1001].map(|parameter| number("getObjectFloatParam", parameter)),
            view_angle_rad: number("getObjectFloatParam", 1004),
        }
    }
}

fn run(server: &mut StandIn, python: &Path, arguments: &[&str]) -> Output {
    let mut program = Command::new(python);
    program.arg(workspace_root().join("assets/scenes/build_reference_scene.py"));
    server.run(program.args(["--port", &server.port().to_string()]).args(arguments))
}

fn is_of(call: &Call, handle: i64) -> bool {
    call.args[0].integer() == Some(handle)
}

fn place(server: &mut StandIn, path: &str) -> (i64, Isometry3<f64>) {
    let handle = server.object(path);
    (handle, pose(&server.ask("getObjectPose", vec![handle.into(), (-1).into()])[0]))
}

fn pose(value: &Value) -> Isometry3<f64> {
    let v = value.numbers().expect("seven numbers");
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(v[6], v[3], v[4], v[5]));
    Isometry3::from_parts(Translation3::from(Vector3::new(v[0], v[1], v[2])), rotation)
}

fn difference(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    let between = a.inv_mul(b);
    (between.translation.vector.norm(), between.rotation.angle())
}

/// The ranges that the script set, in the order of the joints.
fn ranges(built: &mut Built) -> Vec<[f64; 2]> {
    let joints = built.server.joints();
    let set: Vec<_> = built.calls("setJointInterval").collect();
    assert_eq!(set.iter().map(|call| call.args[0].integer().expect("a handle")).collect::<Vec<_>>(), joints);
    assert!(set.iter().all(|call| call.args[1].boolean() == Some(false)), "none turns without end");
    set.iter().map(|call| call.args[2].numbers().expect("numbers").try_into().expect("minimum and range")).collect()
}

#[test]
fn the_script_builds_the_reference_scene_with_its_defaults() {
    let Some(python) = python() else { return };
    // The joints of CoppeliaSim's model are dynamic; nothing else of the scene file differs.
    let mut built = Built::with(&python, "[robot]\njoint_mode = 'dynamic'\n", &[]);
    built.assert_poses();
    built.assert_sensors();
    assert_eq!((built.lens.size, built.lens.near_far_m), ([640.0, 480.0], [0.01, 3.5]));
    assert!((built.lens.view_angle_rad.to_degrees() - 57.0).abs() < ROUNDING);
    assert_eq!(built.assert_board(), 44);
    let model = built.calls("loadModel").next().expect("loaded").args[0].text().expect("a path").to_owned();
    assert_eq!(model, "/opt/CoppeliaSim/models/robots/non-mobile/UR5.ttm");
    for left_alone in ["setJointInterval", "setJointMode", "saveScene"] {
        assert_eq!(built.calls(left_alone).count(), 0, "{left_alone}");
    }
    // They would move to their targets when the simulation starts, and by the model's script.
    for (joint, start_deg) in built.server.joints().into_iter().zip([0.0_f64, 45.0, -60.0, 0.0, 90.0, 0.0]) {
        let target = built.server.ask("getJointTargetPosition", vec![joint.into()])[0].number().expect("a number");
        assert!((target - start_deg.to_radians()).abs() < ROUNDING, "{target}");
    }
    let script = built.server.script();
    assert_eq!(built.server.ask("isHandle", vec![script.into()])[0].boolean(), Some(false));
}

#[test]
fn every_number_of_the_scene_is_built() {
    const KINEMATIC: i64 = 0;
    let Some(python) = python() else { return };
    let mut built = Built::with(&python, ANOTHER, &["--scene", "SCENE", "--kinematic", "--save", "built.ttt"]);
    built.assert_poses();
    built.assert_sensors();
    // Eight by seven squares, of which every other one is dark.
    assert_eq!(built.assert_board(), 28);
    let low_deg = [-180.0, -90.0, -170.0, -100.0, -110.0, -200.0_f64];
    let high_deg = [190.0, 95.0, 175.0, 105.0, 115.0, 205.0_f64];
    for (set, (low, high)) in ranges(&mut built).into_iter().zip(low_deg.into_iter().zip(high_deg)) {
        let expected = [low.to_radians(), (high - low).to_radians()];
        assert!(set.iter().zip(expected).all(|(set, expected)| (set - expected).abs() < ROUNDING), "{set:?}");
    }
    let modes: Vec<_> = built.calls("setJointMode").map(|call| call.args[1].integer()).collect();
    assert_eq!(modes, [Some(KINEMATIC); 6]);
    let saved = built.calls("saveScene").next().expect("saved").args[0].text().expect("a path").to_owned();
    assert!(Path::new(&saved).is_absolute() && saved.ends_with("built.ttt"), "the simulator has a folder of its own");
}

#[test]
fn an_end_of_the_range_that_the_scene_leaves_open_is_that_of_the_model() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    for (end, value_deg, expected) in
        [("min", "-90.0", [-PI / 2.0, TAU + PI / 2.0]), ("max", "135.0", [-TAU, TAU + 0.75 * PI])]
    {
        let file = folder.path().join("one_end.toml");
        let scene = format!("[robot]\n{end}_joints_deg = [{}]\n", [value_deg; 6].join(", "));
        std::fs::write(&file, scene).expect("written");
        let file = file.to_str().expect("UTF-8");
        let mut built = Built::with(&python, "[robot]\njoint_mode = 'dynamic'\n", &["--scene", file]);
        for set in ranges(&mut built) {
            assert!(
                set.iter().zip(expected).all(|(set, expected)| (set - expected).abs() < ROUNDING),
                "{end}: {set:?}"
            );
        }
    }
}

#[test]
fn what_cannot_be_built_is_refused_by_name_and_what_coppeliasim_has_itself_is_named() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("scene.toml");
    let mut server = StandIn::new(CellProcess::start(&[]));
    server.empty();
    let mut build = |scene: &str| {
        std::fs::write(&file, scene).expect("written");
        server.calls.clear();
        let output = run(&mut server, &python, &["--scene", file.to_str().expect("UTF-8")]);
        let reported = [&output.stdout, &output.stderr].map(|reported| String::from_utf8_lossy(reported).into_owned());
        (output.status.success(), server.calls.len(), reported.concat())
    };
    for (named, scene) in [
        ("robot.model", "[robot]\nmodel = 'ur5e'"),
        ("robot.model", "[robot]\nmodel = { urdf = 'my.urdf' }"),
        ("robot.name", "[robot]\nname = 'Panda'"),
        ("robot.repeatability_mm", "[robot]\nrepeatability_mm = 0.05"),
        ("robot.joint_offset_deg", "[robot]\njoint_offset_deg = [0, 0.1, 0, 0, 0, 0]"),
        ("robot.arm_errors", "[robot]\narm_errors = { angle_deg = 0.07 }"),
        ("robot.max_joints_deg has 5 values", "[robot]\nmax_joints_deg = [90, 90, 90, 90, 90]"),
        ("camera.fx, camera.fy", "[camera]\nfx = 600.0\nfy = 600.0\ncx = 320.0\ncy = 240.0"),
        ("camera.distortion", "[camera]\ndistortion = { model = 'fisheye', coefficients = [0.1, 0, 0, 0] }"),
        ("board.random_offset_mm", "[board]\nrandom_offset_mm = 3.0"),
        ("board.motion.path", "[board.motion]\npath = 'circle'"),
        ("board.slip", "[board.slip]\nat_stop = 3\nby_mm = [5, 0, 0]"),
        ("board.print", "[board.print]\nbitmap_px = [1024, 768]"),
        ("image.noise_grey", "[image]\nnoise_grey = 1.8"),
        ("image.blur_px", "[image]\nblur_px = 0.7"),
        ("image.exposure", "[image]\nexposure = 0.9"),
        ("depth.noise_mm_per_m2", "[depth]\nnoise_mm_per_m2 = 2.5"),
        ("solids", "[[solids]]\nname = 'table'\nsize_m = [1, 1, 0.1]\nposition_m = [0, 0, 0]"),
        ("does not know camera.widht", "[camera]\nwidht = 320"),
        ("does not know lights.ambient", "[lights]\nambient = 0.5"),
        ("does not know robot", "robot = 'ur5'"),
        ("Could not read", "[robot"),
    ] {
        let (built, calls, reported) = build(scene);
        assert!(!built && calls == 0 && reported.contains(named), "{scene}: {calls} calls, {reported}");
        assert!(!reported.contains("Traceback"), "{scene}: {reported}");
    }
    let (built, calls, reported) = build(
        "[robot]\nrest_error_deg = 0.005\njoint_mode = 'kinematic'\n[image]\nsampling = 'centre'\n\
         [depth]\nnoise_mm = 0.01\noffset_px = 0.475\nnothing_m = 3.5000184\n[board.motion]\nspeed_m_s = 0.2\n",
    );
    assert!(built && calls > 0, "{reported}");
    for field in
        ["robot.rest_error_deg", "image.sampling", "depth.noise_mm", "depth.offset_px", "depth.nothing_m", "speed_m_s"]
    {
        assert!(reported.contains(field), "{field} is not named: {reported}");
    }
}
