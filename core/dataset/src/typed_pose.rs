//! A pose as a person copies it from a robot's pendant: numbers in a stated convention.

use nalgebra::{Isometry3, Matrix3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use handeye_geometry::se3;

/// Largest deviation of the length of a quaternion, or of an axis of a matrix, from 1: three printed decimals.
const UNIT_TOLERANCE: f64 = 1e-3;
/// Largest angle that a controller reports \[rad\]: joints turn up to two full turns either way.
const LARGEST_ANGLE_RAD: f64 = 4.0 * std::f64::consts::PI;
/// No arm on a table reaches further \[m\].
const FARTHEST_M: f64 = 100.0;

/// Notation of the rotation.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TypedRotation {
    /// x y z rx ry rz: a rotation vector in radians, as Universal Robots shows it.
    #[default]
    RotationVectorRad,
    /// The same in degrees.
    RotationVectorDeg,
    /// x y z roll pitch yaw in degrees about fixed axes, R = Rz(yaw) · Ry(pitch) · Rx(roll): URDF, xArm, Fanuc W P R, Yaskawa.
    RollPitchYawDeg,
    /// The same in radians.
    RollPitchYawRad,
    /// x y z A B C in degrees, R = Rz(A) · Ry(B) · Rx(C): KUKA.
    KukaAbc,
    /// x y z qx qy qz qw.
    QuaternionXyzw,
    /// x y z qw qx qy qz: ABB.
    QuaternionWxyz,
    /// 12 or 16 numbers of a homogeneous matrix, row by row.
    Matrix,
}

impl TypedRotation {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::RotationVectorRad,
        Self::RotationVectorDeg,
        Self::RollPitchYawDeg,
        Self::RollPitchYawRad,
        Self::KukaAbc,
        Self::QuaternionXyzw,
        Self::QuaternionWxyz,
        Self::Matrix,
    ];

    fn counts(self) -> &'static [usize] {
        match self {
            Self::QuaternionXyzw | Self::QuaternionWxyz => &[7],
            Self::Matrix => &[12, 16],
            _ => &[6],
        }
    }
}

/// Why a text is not a pose in its convention.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum TypedPoseError {
    /// A word that is not a number.
    #[error("{word:?} is not a number")]
    NoNumber {
        /// The typed word.
        word: String,
    },
    /// Too few or too many.
    #[error("there are {got} numbers, and this convention has {need}")]
    Count {
        /// Given.
        got: usize,
        /// Wanted, in words.
        need: String,
    },
    /// A length that no robot reaches.
    #[error("the position is {metres:.1} m from the base: check whether it is in metres or millimetres")]
    TooFar {
        /// Its distance.
        metres: f64,
    },
    /// An angle beyond two turns.
    #[error("an angle of {radians:.1} rad is more than two turns: check whether it is in degrees or radians")]
    AngleTooLarge {
        /// The angle.
        radians: f64,
    },
    /// A quaternion of another length.
    #[error("the quaternion has the length {length:.4} instead of 1: check the order of the numbers")]
    NotUnit {
        /// Length of the quaternion as it was typed.
        length: f64,
    },
    /// No rotation matrix.
    #[error("the first three columns are not a rotation: check that the numbers are given row by row")]
    NoRotation,
}

/// The transform of a text such as `p[0.4, -0.1, 0.3, 0, 3.14, 0]`, in metres. `metres_per_unit` is that of its lengths.
///
/// # Errors
/// [`TypedPoseError`]. Nothing is guessed: what is impossible in the convention is refused.
pub fn read(text: &str, metres_per_unit: f64, rotation: TypedRotation) -> Result<Isometry3<f64>, TypedPoseError> {
    let numbers = numbers(text)?;
    if !rotation.counts().contains(&numbers.len()) {
        let need = rotation.counts().iter().map(usize::to_string).collect::<Vec<_>>().join(" or ");
        return Err(TypedPoseError::Count { got: numbers.len(), need });
    }
    let (position, turn) = if rotation == TypedRotation::Matrix {
        let at = |row: usize, column: usize| numbers[4 * row + column];
        let is_homogeneous = numbers.len() == 12 || numbers[12..] == [0.0, 0.0, 0.0, 1.0];
        let matrix = Matrix3::from_fn(at);
        let deviation = (matrix.transpose() * matrix - Matrix3::identity()).amax();
        if !is_homogeneous || deviation > 2.0 * UNIT_TOLERANCE || matrix.determinant() < 0.0 {
            return Err(TypedPoseError::NoRotation);
        }
        let turn = UnitQuaternion::from_rotation_matrix(&se3::nearest_rotation(&matrix));
        (Vector3::new(at(0, 3), at(1, 3), at(2, 3)), turn)
    } else {
        (Vector3::from_row_slice(&numbers[..3]), turn(&numbers[3..], rotation)?)
    };
    let position = position * metres_per_unit;
    if position.norm() > FARTHEST_M {
        return Err(TypedPoseError::TooFar { metres: position.norm() });
    }
    Ok(Isometry3::from_parts(Translation3::from(position), turn))
}

fn turn(numbers: &[f64], rotation: TypedRotation) -> Result<UnitQuaternion<f64>, TypedPoseError> {
    let angles = |radians_per_unit: f64| {
        let angles = [0, 1, 2].map(|i| numbers[i] * radians_per_unit);
        let too_large = angles.into_iter().find(|angle| angle.abs() > LARGEST_ANGLE_RAD);
        too_large.map_or(Ok(angles), |radians| Err(TypedPoseError::AngleTooLarge { radians }))
    };
    let degrees = std::f64::consts::PI / 180.0;
    let unit = |quaternion: Quaternion<f64>| {
        let length = quaternion.norm();
        let is_unit = (length - 1.0).abs() <= UNIT_TOLERANCE;
        is_unit.then(|| UnitQuaternion::from_quaternion(quaternion)).ok_or(TypedPoseError::NotUnit { length })
    };
    let euler = |[roll, pitch, yaw]: [f64; 3]| UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    match rotation {
        TypedRotation::RotationVectorRad => Ok(UnitQuaternion::from_scaled_axis(Vector3::from(angles(1.0)?))),
        TypedRotation::RotationVectorDeg => Ok(UnitQuaternion::from_scaled_axis(Vector3::from(angles(degrees)?))),
        TypedRotation::RollPitchYawDeg => Ok(euler(angles(degrees)?)),
        TypedRotation::RollPitchYawRad => Ok(euler(angles(1.0)?)),
        TypedRotation::KukaAbc => {
            let [a, b, c] = angles(degrees)?;
            Ok(euler([c, b, a]))
        }
        TypedRotation::QuaternionXyzw => unit(Quaternion::new(numbers[3], numbers[0], numbers[1], numbers[2])),
        TypedRotation::QuaternionWxyz => unit(Quaternion::new(numbers[0], numbers[1], numbers[2], numbers[3])),
        // It is not given by three numbers.
        TypedRotation::Matrix => Err(TypedPoseError::NoRotation),
    }
}

/// All numbers of a text; names of fields, brackets and units between them are passed over.
fn numbers(text: &str) -> Result<Vec<f64>, TypedPoseError> {
    let is_between = |c: char| c.is_whitespace() || "[](){},;|:=".contains(c);
    let words = text.split(is_between).filter(|word| !word.is_empty() && !is_name(word));
    words
        .map(|word| {
            let word = word.trim_end_matches('°').replace('−', "-");
            word.parse().ok().filter(|number: &f64| number.is_finite()).ok_or(TypedPoseError::NoNumber { word })
        })
        .collect()
}

/// Words that a pendant shows next to its numbers.
fn is_name(word: &str) -> bool {
    const NAMES: [&str; 24] = [
        "p", "x", "y", "z", "rx", "ry", "rz", "a", "b", "c", "w", "r", "qx", "qy", "qz", "qw", "mm", "m", "deg", "rad",
        "roll", "pitch", "yaw", "tcp",
    ];
    NAMES.contains(&word.to_ascii_lowercase().as_str())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The pose of the golden calibration file: the same rotation in every convention, computed by another program.
    const POSITION: [f64; 3] = [0.045, -0.032, 0.061];
    const WRITTEN: [(TypedRotation, f64, &str); 8] = [
        (TypedRotation::RotationVectorRad, 1.0, "p[0.045, -0.032, 0.061, 0.429877369, 0.079930497, 1.414769930]"),
        (TypedRotation::RotationVectorDeg, 1e-3, "45 -32 61 24.63015892 4.57968013 81.06034637"),
        (TypedRotation::RollPitchYawDeg, 1e-3, "X 45 mm; Y −32 mm; Z 61 mm; 20.05352283 -11.45915590 80.21409132"),
        (TypedRotation::RollPitchYawRad, 1.0, "0.045,-0.032,0.061,0.35,-0.20,1.40"),
        (TypedRotation::KukaAbc, 1e-3, "{X 45.0, Y -32.0, Z 61.0, A 80.21409132, B -11.45915590, C 20.05352283}"),
        (TypedRotation::QuaternionXyzw, 1.0, "0.045 -0.032 0.061 0.195832126 0.036412615 0.644503346 0.738200065"),
        (TypedRotation::QuaternionWxyz, 1e-3, "[[45,-32,61],[0.738200065,0.195832126,0.036412615,0.644503346]]"),
        (
            TypedRotation::Matrix,
            1.0,
            "0.166579116 -0.937283305 0.306188511 0.045\n0.965806345 0.092530430 -0.242190471 -0.032\n\
             0.198669331 0.336062681 0.920647800 0.061\n0 0 0 1",
        ),
    ];

    #[test]
    fn one_pose_is_read_alike_in_every_convention() {
        let wanted =
            UnitQuaternion::from_quaternion(Quaternion::new(0.738200065, 0.195832126, 0.036412615, 0.644503346));
        for (rotation, metres, text) in WRITTEN {
            let pose = read(text, metres, rotation).unwrap_or_else(|error| panic!("{rotation:?}: {error}"));
            assert!(pose.rotation.angle_to(&wanted) < 3e-8, "{rotation:?}");
            assert!((pose.translation.vector - Vector3::from(POSITION)).norm() < 1e-12, "{rotation:?}");
        }
    }

    #[test]
    fn what_cannot_be_in_a_convention_is_refused() {
        let read = |text: &str, rotation| read(text, 1.0, rotation).map(|_| ());
        let vector = TypedRotation::RotationVectorRad;
        assert_eq!(read("1 2 3", vector), Err(TypedPoseError::Count { got: 3, need: "6".to_owned() }));
        assert_eq!(read("1 2 3 0 0 O", vector), Err(TypedPoseError::NoNumber { word: "O".to_owned() }));
        assert!(matches!(read("0.4 0 0.3 0 180 0", vector), Err(TypedPoseError::AngleTooLarge { .. })));
        assert!(matches!(read("400 0 300 0 3 0", vector), Err(TypedPoseError::TooFar { .. })), "millimetres");
        let quaternion = TypedRotation::QuaternionXyzw;
        assert!(matches!(read("0 0 0 1 1 0 0", quaternion), Err(TypedPoseError::NotUnit { .. })));
        let columns = "1 0 0 0 0 0 1 0 0 -1 0 0 0.1 0.2 0.3 1";
        assert_eq!(read(columns, TypedRotation::Matrix), Err(TypedPoseError::NoRotation), "column by column");
        assert_eq!(
            read("1 0 0 0 0 1 0 0 0 0 -1 0", TypedRotation::Matrix),
            Err(TypedPoseError::NoRotation),
            "a mirror"
        );
        assert_eq!(read("nan 0 0 0 0 0", vector), Err(TypedPoseError::NoNumber { word: "nan".to_owned() }));
    }

    proptest! {
        #[test]
        fn no_text_makes_it_panic(text in ".{0,200}", index in 0..8_usize) {
            let _result = read(&text, 1e-3, TypedRotation::ALL[index]);
        }
    }
}
