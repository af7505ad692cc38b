//! The drivers that come with the program, with the options of each; and their command lines.

use std::collections::BTreeMap;

use handeye_arm::ArmKind;
use handeye_cell::scene::ShippedScene;
use handeye_driver::DriverSpec;

use crate::arguments::ArmErrorsChoice;
use crate::text::Language;
use crate::tr;

/// Values of fields, by option; fields without a value are not in it.
pub type Values = BTreeMap<&'static str, String>;

/// What a driver is chosen for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The robot, and its camera where the driver has one.
    Robot,
    /// The camera alone.
    Camera,
}

/// A driver that comes with the program.
#[derive(Debug)]
pub struct Offered {
    /// Its subcommand of `handeye driver`.
    pub name: &'static str,
    /// What it can be chosen for.
    parts: &'static [Part],
    /// Arguments that it always gets as the driver of a camera only.
    pub camera_alone: &'static [&'static str],
    /// What can be set for it, in groups that drivers share.
    fields: &'static [&'static [Field]],
}

/// Something that can be set for a driver.
#[derive(Debug)]
pub struct Field {
    /// The option; empty for an argument without one.
    pub option: &'static str,
    /// What is entered.
    pub kind: FieldKind,
    /// Whether it is of use for a camera alone.
    pub for_camera: bool,
    /// How prominently it is shown.
    pub rank: Rank,
}

/// What is entered into a field.
#[derive(Debug, Clone, Copy)]
pub enum FieldKind {
    /// A text, such as this one; the default where there is one.
    Text(&'static str),
    /// One of some words.
    Word(fn() -> Vec<&'static str>),
    /// On or off.
    Switch,
}

/// How prominently a field is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rank {
    /// It is required.
    Needed,
    /// Usually set.
    Usual,
    /// Under *More options*.
    More,
}

const fn field(option: &'static str, kind: FieldKind, rank: Rank) -> Field {
    Field { option, kind, for_camera: true, rank }
}

const fn robot_field(option: &'static str, kind: FieldKind, rank: Rank) -> Field {
    Field { option, kind, for_camera: false, rank }
}

use FieldKind::{Switch, Text, Word};
use Rank::{More, Needed, Usual};

/// For every driver that is a Python file: which Python to use, if it should not have an environment of its own.
const PYTHON: &[Field] = &[field("--python", Text("/usr/bin/python3"), More)];

/// What is read of ROS, whatever it comes over.
const ROS: &[Field] = &[
    robot_field("--base-frame", Text("base_link"), Usual),
    robot_field("--tip-frame", Text("tool0"), Usual),
    field("--image", Text("/camera/image_raw"), Usual),
    field("--camera-info", Text("/camera/camera_info"), Usual),
    field("--rectified", Switch, More),
    field("--depth", Text("/camera/depth"), More),
    robot_field("--joints", Text("/joint_states"), More),
    robot_field("--joint-names", Text("joint_1,joint_2,…"), More),
    robot_field("--urdf", Text("robot.urdf"), More),
    field("--image-rate", Text("10"), More),
];

/// What depth cameras have in common.
const DEPTH_CAMERA: &[Field] = &[
    field("--serial", Text("123456789012"), Usual),
    field("--size", Text("1280x720"), Usual),
    field("--exposure", Text("100"), Usual),
    field("--gain", Text("16"), More),
    field("--rate", Text("30"), More),
    field("--no-depth", Switch, More),
];

/// What the cells of other simulators have in common.
const SIMULATED_CELL: &[Field] = &[
    robot_field("--eye-to-hand", Switch, Usual),
    robot_field("--board", Text("10x7x15"), More),
    robot_field("--size", Text("640x480"), More),
    robot_field("--samples", Text("16"), More),
    robot_field("--start", Text("0,-80,-110,-80,90,0"), More),
    robot_field("--truth", Text("truth.json"), More),
];

/// All of them, in the order of the list.
pub static ALL: &[Offered] = &[
    Offered {
        name: "ur-rtde",
        parts: &[Part::Robot],
        camera_alone: &[],
        fields: &[
            &[
                robot_field("--host", Text("192.168.0.10"), Needed),
                robot_field("--arm", Word(|| ArmKind::ALL.into_iter().map(ArmKind::name).collect()), Usual),
                robot_field("--frequency", Text("125"), More),
            ],
            PYTHON,
        ],
    },
    Offered {
        name: "xarm",
        parts: &[Part::Robot],
        camera_alone: &[],
        fields: &[
            &[
                robot_field("--host", Text("192.168.1.185"), Needed),
                robot_field("--urdf", Text("robot.urdf"), Usual),
                robot_field("--tip-link", Text("link_eef"), More),
            ],
            PYTHON,
        ],
    },
    Offered {
        name: "franka",
        parts: &[Part::Robot],
        camera_alone: &[],
        fields: &[
            &[
                robot_field("--host", Text("172.16.0.2"), Needed),
                robot_field("--urdf", Text("robot.urdf"), Usual),
                robot_field("--tip-link", Text("fr3_link8"), More),
                robot_field("--frequency", Text("100"), More),
            ],
            PYTHON,
        ],
    },
    Offered {
        name: "rosbridge",
        parts: &[Part::Robot, Part::Camera],
        camera_alone: &[],
        fields: &[
            &[field("--url", Text("ws://127.0.0.1:9090"), Usual)],
            ROS,
            &[field("--fragment-size", Text("1000000"), More)],
            PYTHON,
        ],
    },
    Offered { name: "ros2", parts: &[Part::Robot, Part::Camera], camera_alone: &[], fields: &[ROS, PYTHON] },
    #[cfg(target_os = "linux")]
    Offered {
        name: "v4l",
        parts: &[Part::Camera],
        camera_alone: &[],
        fields: &[
            &[
                field("--device", Text("/dev/video0"), Usual),
                field("--size", Text("1280x720"), Usual),
                field("--format", Word(|| vec!["RGB3", "YUYV", "GREY", "MJPG"]), More),
                field("--rate", Text("30"), More),
            ],
            PYTHON,
        ],
    },
    Offered { name: "realsense", parts: &[Part::Camera], camera_alone: &[], fields: &[DEPTH_CAMERA, PYTHON] },
    Offered {
        name: "orbbec",
        parts: &[Part::Camera],
        camera_alone: &[],
        fields: &[DEPTH_CAMERA, &[field("--format", Word(|| vec!["YUYV", "MJPG", "RGB"]), More)], PYTHON],
    },
    Offered {
        name: "folder",
        parts: &[Part::Robot, Part::Camera],
        camera_alone: &["--images-only"],
        fields: &[
            &[
                field("", Text("/home/me/captures"), Needed),
                robot_field("--length-unit", Word(|| vec!["m", "mm"]), Usual),
                robot_field(
                    "--rotation",
                    Word(|| vec!["quaternion_xyzw", "quaternion_wxyz", "rotation_vector", "rpy", "matrix"]),
                    Usual,
                ),
                robot_field("--angle-unit", Word(|| vec!["rad", "deg"]), Usual),
                robot_field("--pose", Word(|| vec!["base_from_tip", "tip_from_base"]), Usual),
                robot_field("--poses", Text("poses.csv"), More),
                robot_field("--joints", Text("6"), More),
                robot_field("--joint-unit", Word(|| vec!["rad", "deg"]), More),
                field("--size", Text("1280x720"), More),
                field("--hold", Text("2"), More),
            ],
            PYTHON,
        ],
    },
    Offered {
        name: "mujoco",
        parts: &[Part::Robot],
        camera_alone: &[],
        fields: &[
            &[
                robot_field("--model", Text("scene.xml"), Usual),
                robot_field("--tip", Text("attachment_site"), Usual),
                robot_field("--camera", Text("wrist"), More),
            ],
            SIMULATED_CELL,
            PYTHON,
        ],
    },
    Offered {
        name: "pybullet",
        parts: &[Part::Robot],
        camera_alone: &[],
        fields: &[
            &[
                robot_field("--arm", Word(|| vec!["panda", "iiwa", "xarm6"]), Usual),
                robot_field("--urdf", Text("robot.urdf"), More),
                robot_field("--tip", Text("tool0"), More),
            ],
            SIMULATED_CELL,
            PYTHON,
        ],
    },
    Offered {
        name: "fake",
        parts: &[Part::Robot],
        camera_alone: &[],
        fields: &[&[
            robot_field("--scene", Word(|| ShippedScene::ALL.into_iter().map(ShippedScene::name).collect()), Usual),
            robot_field("--seed", Text("1"), Usual),
            robot_field("--arm-errors", Word(|| ArmErrorsChoice::NAMES.to_vec()), More),
            robot_field("--connect", Text("tcp://127.0.0.1:23000"), More),
            robot_field("--only", Word(|| vec!["robot", "camera"]), More),
            robot_field("--clock", Text("0"), More),
        ]],
    },
];

/// The drivers for a part of the cell.
pub fn of_part(part: Part) -> impl Iterator<Item = &'static Offered> {
    ALL.iter().filter(move |offered| offered.parts.contains(&part))
}

/// Which of them a command line starts, and with which values; `None` for another program, and for one of them with options
/// that have no field.
pub fn parse(command: &str, part: Part) -> Option<(&'static Offered, Values)> {
    let Ok(DriverSpec::Command(words)) = command.parse() else { return None };
    let [program, driver, name, reported @ ..] = words.as_slice() else { return None };
    let offered = of_part(part).find(|offered| offered.name == name)?;
    if program != PROGRAM || driver != "driver" {
        return None;
    }
    let always = offered.always(part);
    if !always.iter().all(|word| reported.iter().any(|other| other == word)) {
        return None;
    }
    let mut values = Values::new();
    let mut rest = reported.iter().filter(|word| !always.contains(&word.as_str()));
    while let Some(word) = rest.next() {
        let (option, value) = match word.split_once('=') {
            Some((option, value)) if word.starts_with("--") => (option, Some(value)),
            _ if word.starts_with("--") => (word.as_str(), None),
            _ => ("", Some(word.as_str())),
        };
        let field = offered.fields_of(part).find(|field| field.option == option)?;
        let value = match (field.kind, value) {
            (Switch, None) => ON.to_owned(),
            (Switch, Some(_)) => return None,
            (_, Some(value)) => value.to_owned(),
            (_, None) => rest.next()?.clone(),
        };
        if values.insert(field.option, value).is_some() {
            return None;
        }
    }
    Some((offered, values))
}

/// The program that drivers are started with: this one.
const PROGRAM: &str = "handeye";
/// The value of a switch that is on.
pub const ON: &str = "on";

impl Offered {
    /// All that can be set for it.
    pub fn fields(&self) -> impl Iterator<Item = &'static Field> {
        self.fields.iter().copied().flatten()
    }

    /// The fields for a part of the cell.
    pub fn fields_of(&self, part: Part) -> impl Iterator<Item = &'static Field> {
        self.fields().filter(move |field| part == Part::Robot || field.for_camera)
    }

    fn always(&self, part: Part) -> &'static [&'static str] {
        match part {
            Part::Robot => &[],
            Part::Camera => self.camera_alone,
        }
    }

    /// The command line with these values; `None` while a required one is missing.
    pub fn command(&self, part: Part, values: &Values) -> Option<String> {
        let mut words = vec![PROGRAM.to_owned(), "driver".to_owned(), self.name.to_owned()];
        for field in self.fields_of(part) {
            let value = values.get(field.option).map(|value| value.trim()).filter(|value| !value.is_empty());
            match (value, field.kind) {
                (None, _) if field.rank == Needed => return None,
                (None, _) => {}
                (Some(_), Switch) => words.push(field.option.to_owned()),
                (Some(value), _) if field.option.is_empty() => words.push(value.to_owned()),
                // In one word a value that begins with a hyphen is not taken for an option.
                (Some(value), _) if value.starts_with('-') => words.push(format!("{}={value}", field.option)),
                (Some(value), _) => words.extend([field.option.to_owned(), value.to_owned()]),
            }
        }
        words.extend(self.always(part).iter().map(|&word| word.to_owned()));
        Some(DriverSpec::Command(words).to_string())
    }

    /// What it is called in the list.
    pub fn title(&self, language: Language) -> &'static str {
        match self.name {
            "ur-rtde" => tr!(language, "Universal Robots (RTDE)"),
            "rosbridge" => tr!(language, "ROS 1 or ROS 2 (rosbridge)"),
            "xarm" => tr!(language, "UFACTORY xArm"),
            "franka" => tr!(language, "Franka arm"),
            "ros2" => tr!(language, "ROS 2 (rclpy)"),
            "v4l" => tr!(language, "USB camera (Video4Linux)"),
            "realsense" => tr!(language, "Intel RealSense"),
            "orbbec" => tr!(language, "Orbbec"),
            "folder" => tr!(language, "Folder that images are saved in"),
            "mujoco" => tr!(language, "Cell simulated by MuJoCo"),
            "pybullet" => tr!(language, "Cell simulated by PyBullet"),
            _ => tr!(language, "Simulated robot and camera"),
        }
    }

    /// A description.
    pub fn about(&self, part: Part, language: Language) -> &'static str {
        match (self.name, part) {
            ("ur-rtde", _) => tr!(
                language,
                "Reads the controller; it does not move the arm. Which arm it is the controller does not say: choose it to have \
                 the arm drawn."
            ),
            ("rosbridge", Part::Robot) => tr!(
                language,
                "Reads robot and camera; it does not move the arm. Without frames and images it lists the frames of tf in Log."
            ),
            ("xarm" | "franka", _) => tr!(
                language,
                "Reads the controller; it does not move the arm. With a URDF the arm is drawn and its errors are estimated."
            ),
            ("ros2", Part::Robot) => tr!(
                language,
                "Reads robot and camera; it does not move the arm. Start the workbench where ROS is set up. \
                 Without frames and images it lists the frames of tf in Log."
            ),
            ("rosbridge" | "ros2", Part::Camera) => tr!(language, "Reads the images of one topic."),
            ("realsense" | "orbbec", _) => {
                tr!(language, "Reads colour images, depth and the lens that the camera states.")
            }
            ("v4l", _) => tr!(language, "Switch autofocus off before the first capture."),
            ("folder", Part::Robot) => tr!(
                language,
                "Shows each new image with its pose. How poses are written is said here or in the folder's dataset.toml."
            ),
            ("folder", Part::Camera) => tr!(language, "Shows each new image."),
            ("mujoco", _) => tr!(
                language,
                "Nothing real is connected. An arm with the dimensions of a UR5e, or a model (MJCF) with its tip. The simulator is \
                 installed the first time."
            ),
            ("pybullet", _) => tr!(
                language,
                "Nothing real is connected. An arm of the list, or a URDF with its tip. The simulator is installed the first time."
            ),
            _ => tr!(language, "To try the window with a driver: nothing real is connected."),
        }
    }
}

impl Field {
    /// Its name.
    pub fn label(&self, language: Language) -> &'static str {
        match self.option {
            "--host" | "--url" => tr!(language, "Address"),
            "--arm" => tr!(language, "Arm"),
            "--frequency" => tr!(language, "States per second"),
            "--base-frame" => tr!(language, "Base frame"),
            "--tip-frame" => tr!(language, "Tip frame"),
            "--image" => tr!(language, "Image topic"),
            "--camera-info" => tr!(language, "Camera info topic"),
            "--rectified" => tr!(language, "Images are rectified"),
            "--depth" => tr!(language, "Depth topic"),
            "--joints" if matches!(self.kind, Text("6")) => tr!(language, "Joints per row"),
            "--joints" => tr!(language, "Joint state topic"),
            "--joint-names" => tr!(language, "Joint names"),
            "--urdf" => tr!(language, "URDF file"),
            "--tip-link" => tr!(language, "Flange in the URDF"),
            "--image-rate" | "--rate" => tr!(language, "Images per second"),
            "--fragment-size" => tr!(language, "Fragments [bytes]"),
            "--device" => tr!(language, "Device"),
            "--size" => tr!(language, "Image size [px]"),
            "--serial" => tr!(language, "Serial number"),
            "--exposure" => tr!(language, "Exposure [camera units]"),
            "--gain" => tr!(language, "Gain [camera units]"),
            "--no-depth" => tr!(language, "Without depth"),
            "--format" => tr!(language, "Pixel format"),
            "" => tr!(language, "Folder"),
            "--length-unit" => tr!(language, "Length unit"),
            "--rotation" => tr!(language, "Rotation"),
            "--angle-unit" => tr!(language, "Angle unit"),
            "--pose" => tr!(language, "Poses are"),
            "--poses" => tr!(language, "Table of poses"),
            "--joint-unit" => tr!(language, "Joint unit"),
            "--python" => tr!(language, "Python"),
            "--hold" => tr!(language, "Show each for [s]"),
            "--scene" => tr!(language, "Scene"),
            "--seed" => tr!(language, "Seed"),
            "--arm-errors" => tr!(language, "Errors of the links"),
            "--eye-to-hand" => tr!(language, "Camera beside the arm"),
            "--model" => tr!(language, "Model (MJCF)"),
            "--tip" => tr!(language, "Tip"),
            "--camera" => tr!(language, "Camera of the model"),
            "--board" => tr!(language, "Board"),
            "--samples" => tr!(language, "Renderings per image"),
            "--start" => tr!(language, "Joints at the start [°, mm]"),
            "--truth" => tr!(language, "File for the truth"),
            "--connect" => tr!(language, "Running cell"),
            "--only" => tr!(language, "One part alone"),
            _ => tr!(language, "Clock begins at [s]"),
        }
    }
}
