//! The board: where a scene has it; moving and hiding that of the built-in cell.

use ciborium::Value;
use handeye_geometry::frames::{Base, Pose, Target};
use handeye_geometry::targets::TargetSpec;

use super::Arm;
use crate::error::LinkError;
use crate::sim::ObjectHandle;
use handeye_wire as wire;
use handeye_wire::axes::sheet_from_target;

pub use handeye_motion::{BoardPath, UnknownPath};

/// The cell's function that has the board move along a path.
const MOVE_FUNCTION: &str = "handeye.moveBoard";

/// The cell's function that hides the board and shows it again.
const SHOW_FUNCTION: &str = "handeye.showBoard";

/// How the board is to move. Defaults of the cell: 0.1 m/s, 0.04 m, 3°, the seed of the cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoardMotion {
    /// The shape of the path, around where the board is; [`BoardPath::Still`] brings it to rest.
    pub path: BoardPath,
    /// Mean speed along the path [m/s], from 0.001 to 1 and at most 20/s times the size.
    pub speed_m_s: f64,
    /// How far the path reaches \[m\], from 0.001 to 0.5.
    pub size_m: Option<f64>,
    /// Largest angle by which the board is turned on its way [°], from 0 to 30.
    pub tilt_deg: Option<f64>,
    /// Seed of the random parts of the path.
    pub seed: Option<u64>,
}

impl BoardMotion {
    /// Along a path at a speed [m/s], with the cell's defaults for the rest.
    pub fn along(path: BoardPath, speed_m_s: f64) -> Self {
        Self { path, speed_m_s, size_m: None, tilt_deg: None, seed: None }
    }

    fn to_value(self) -> Value {
        let Self { path, speed_m_s, size_m, tilt_deg, seed } = self;
        let mut fields = vec![("path", Value::from(path.name()))];
        // A board at rest has no speed, whatever number is given.
        if path != BoardPath::Still {
            fields.push(("speed_m_s", Value::Float(speed_m_s)));
        }
        fields.extend(size_m.map(|size_m| ("size_m", Value::Float(size_m))));
        fields.extend(tilt_deg.map(|tilt_deg| ("tilt_deg", Value::Float(tilt_deg))));
        fields.extend(seed.map(|seed| ("seed", Value::from(seed))));
        wire::map(fields)
    }
}

impl Arm {
    /// Moves the board along a path from where it is, without a jump in position or velocity (except for
    /// [`BoardPath::Step`]). The end of the simulation puts it back.
    ///
    /// # Errors
    /// [`LinkError::Unsupported`] on a server that is not a built-in cell; [`LinkError::Remote`] names the number that
    /// is out of its range.
    pub fn move_board(&mut self, motion: &BoardMotion) -> Result<(), LinkError> {
        self.call_board(MOVE_FUNCTION, motion.to_value())
    }

    /// Hides the board from the camera or shows it again, from the next pass on.
    ///
    /// # Errors
    /// [`LinkError::Unsupported`] on a server that is not a built-in cell.
    pub fn show_board(&mut self, is_shown: bool) -> Result<(), LinkError> {
        self.call_board(SHOW_FUNCTION, Value::from(is_shown))
    }

    /// Pose of the board in the scene, assumed to be on its sheet as in the public scene. `None` where the scene has no
    /// object of the board's name.
    ///
    /// # Errors
    /// Any [`LinkError`] of the call.
    pub fn base_from_board(&mut self, target: &TargetSpec) -> Result<Option<Pose<Base, Target>>, LinkError> {
        let Some(board) = self.objects.board else { return Ok(None) };
        let sheet: Pose<Base, Target> = self.sim.get_object_pose(board, ObjectHandle::WORLD)?;
        Ok(Some(Pose::from_isometry(sheet.isometry() * sheet_from_target(target))))
    }

    fn call_board(&mut self, function: &str, argument: Value) -> Result<(), LinkError> {
        match self.sim.connection().call(function, vec![argument]) {
            Ok(_nothing) => Ok(()),
            Err(error) if error.is_unknown_function() => Err(LinkError::Unsupported {
                call: function.to_owned(),
                needs: "a built-in cell of this version (`handeye cell`); CoppeliaSim cannot move the board",
            }),
            Err(error) => Err(error),
        }
    }
}
