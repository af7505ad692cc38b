//! The scenes of the cell with each of three arms, and with camera and board swapped.

use std::f64::consts::PI;

use handeye_arm::JointValues;
use handeye_cell::scene::{BoardSpec, RelativeTo, RobotSpec, Scene, ShippedScene};
use handeye_estimate::handeye::Mode;
use handeye_estimate::handeye::joint::Noise;
use handeye_geometry::frames::{Anchor, Camera, Mount, Pose, Target};
use handeye_geometry::testing::BOARD;
use handeye_plan::testing::guided_cell::{CellArm, CellSetup, GuidedCell, Places};
use handeye_plan::{Arm, Obstacle, Surroundings, ViewSetup};
use handeye_simulate::links::Links;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// Largest distance of a joint from its value in the scene at the first view, radians: the user has shown the board.
const BY_HAND_RAD: f64 = 0.06;

/// Which faults the cell has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellFaults {
    /// The faults of `reference.toml`: none.
    Reference,
    /// The faults of `realistic.toml`.
    Realistic,
}

impl CellFaults {
    pub const ALL: [Self; 2] = [Self::Reference, Self::Realistic];

    /// The errors of corners and robot: the robot's from the scene, the corners' as `auto` estimates it from images of the
    /// scene.
    pub fn noise(self) -> Noise {
        match self {
            Self::Reference => Noise { corner_px: 1.3e-3, ..Noise::EXACT },
            Self::Realistic => Noise { corner_px: 6.4e-3, robot_m: 5e-5, robot_rad: 0.01 * PI / 180.0, ..Noise::EXACT },
        }
    }

    /// The scene with an arm: its places are from the scene of the arm, everything else from that of the faults.
    fn scene(self, arm: CellArm) -> Scene {
        let shipped = |scene: ShippedScene| scene.scene().expect("a file of this project");
        let of_faults = shipped(match self {
            Self::Reference => ShippedScene::Reference,
            Self::Realistic => ShippedScene::Realistic,
        });
        let of_arm = match arm {
            CellArm::Ur5e => return of_faults,
            CellArm::Panda => shipped(ShippedScene::Panda),
            CellArm::Xarm6 => shipped(ShippedScene::Xarm6),
        };
        let RobotSpec { repeatability_mm, repeatability_deg, .. } = of_faults.robot;
        Scene {
            robot: RobotSpec { repeatability_mm, repeatability_deg, ..of_arm.robot },
            board: BoardSpec { plane: of_arm.board.plane, ..of_faults.board },
            ..of_faults
        }
    }
}

/// The cell of a scene, with a first view found by hand.
pub fn cell(faults: CellFaults, arm: CellArm, mode: Mode, seed: u64) -> GuidedCell {
    let scene = faults.scene(arm);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let setup = CellSetup { noise: faults.noise(), free_lens: true, ..CellSetup::new(arm, mode, seed) };
    (0..1000)
        .find_map(|_| {
            let views = ViewSetup::from(&scene.resolve(rng.random()).expect("a scene of this project"));
            let start = views.start_joints;
            let joints = JointValues::from_fn(start.len(), |i| start[i] + rng.random_range(-BY_HAND_RAD..BY_HAND_RAD));
            // What moves with the board is not there when the camera does.
            let goes = |name: &str| scene.solids.iter().any(|s| s.name == name && s.relative_to == RelativeTo::Plane);
            GuidedCell::placed(setup, places(views, joints, mode, &goes)?)
        })
        .expect("the board is in view where the scene begins")
}

fn places(views: ViewSetup, joints: JointValues, mode: Mode, goes_with_board: &dyn Fn(&str) -> bool) -> Option<Places> {
    let ViewSetup { base_from_target, tip_from_camera, arm, around, intrinsics, .. } = views;
    // The sheet itself is for the guide to find out.
    let mut stands: Vec<Obstacle> = around.obstacles.into_iter().filter(|it| it.name != "board").collect();
    let (mount_from_camera, anchor_from_target) = match mode {
        Mode::EyeInHand => {
            (Pose::from_isometry(*tip_from_camera.isometry()), Pose::from_isometry(*base_from_target.isometry()))
        }
        Mode::EyeToHand => {
            stands.retain(|it| !goes_with_board(&it.name));
            changed_over(&arm, &joints, tip_from_camera.isometry(), base_from_target.isometry())?
        }
    };
    let links = Links { mode, mount_from_camera, anchor_from_target };
    Some(Places { arm, joints, around: Surroundings::of(stands), links, intrinsics })
}

/// The board on the tip, where the camera was and facing its viewing direction, and the camera where it has the same first
/// view.
fn changed_over(
    arm: &Arm,
    joints: &JointValues,
    tip_from_camera: &Isometry3<f64>,
    base_from_target: &Isometry3<f64>,
) -> Option<(Pose<Mount, Camera>, Pose<Anchor, Target>)> {
    let base_from_tip = *arm.tip(joints)?.isometry();
    let first_view = (base_from_tip * tip_from_camera).inverse() * base_from_target;
    let facing = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI);
    let tip_from_target = tip_from_camera * facing * Translation3::from(-BOARD.centre().coords);
    let base_from_camera = base_from_tip * tip_from_target * first_view.inverse();
    Some((Pose::from_isometry(base_from_camera), Pose::from_isometry(tip_from_target)))
}
