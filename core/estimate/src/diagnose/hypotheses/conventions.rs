//! Conventions by which poses are written: units, directions, forms of rotations. And what numbers mean under each of
//! them.

use std::fmt;

use nalgebra::{Isometry3, Matrix3, Matrix4, Quaternion, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::handeye::Mode;
use handeye_geometry::se3;

/// The numbers of a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Numbers {
    /// x y z and three numbers of a rotation.
    Angles([f64; 6]),
    /// x y z and a quaternion of unit length.
    Quaternion([f64; 7]),
    /// A rigid transform.
    Matrix(Matrix4<f64>),
}

/// The unit in which positions are written down.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum LengthUnit {
    /// 1 m.
    Metre,
    /// 0.001 m.
    Millimetre,
    /// 0.01 m.
    Centimetre,
}

impl LengthUnit {
    /// All of them, the commonest first.
    pub const ALL: [Self; 3] = [Self::Metre, Self::Millimetre, Self::Centimetre];

    /// How many metres it is.
    pub fn metres(self) -> f64 {
        match self {
            Self::Metre => 1.0,
            Self::Millimetre => 1e-3,
            Self::Centimetre => 1e-2,
        }
    }

    /// Its name in `--set`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Metre => "m",
            Self::Millimetre => "mm",
            Self::Centimetre => "cm",
        }
    }
}

/// The unit in which angles are written down.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum AngleUnit {
    /// 1 rad.
    Radian,
    /// π/180 rad.
    Degree,
}

impl AngleUnit {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Radian, Self::Degree];

    /// How many radians it is.
    pub fn radians(self) -> f64 {
        match self {
            Self::Radian => 1.0,
            Self::Degree => std::f64::consts::PI / 180.0,
        }
    }

    /// Its name in `--set`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Radian => "rad",
            Self::Degree => "deg",
        }
    }
}

/// Which way a transform maps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Direction {
    /// `base_from_tip`, or `camera_from_target`.
    Forward,
    /// `tip_from_base`, or `target_from_camera`.
    Inverse,
}

impl Direction {
    /// Both, the commonest first.
    pub const ALL: [Self; 2] = [Self::Forward, Self::Inverse];

    /// The other one.
    #[must_use]
    pub(crate) fn other(self) -> Self {
        match self {
            Self::Forward => Self::Inverse,
            Self::Inverse => Self::Forward,
        }
    }

    /// In which direction the written pose of the robot is `anchor_from_mount`: it is inverted where the camera is next to the
    /// robot (eye to hand).
    #[must_use]
    pub fn of_mount(self, mode: Mode) -> Self {
        if mode == Mode::EyeInHand { self } else { self.other() }
    }

    /// The pose that a written one means.
    pub fn of(self, written: &Isometry3<f64>) -> Isometry3<f64> {
        match self {
            Self::Forward => *written,
            Self::Inverse => written.inverse(),
        }
    }
}

/// How numbers of a rotation are meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RotationForm {
    /// Axis times angle.
    Vector,
    /// A product of three turns.
    Euler(Euler),
    /// A quaternion, its real part last.
    Xyzw,
    /// A quaternion, its real part first.
    Wxyz,
    /// A matrix, which can be meant in one way only.
    Matrix,
}

/// `R = R_a(α) · R_b(β) · R_c(γ)`: the axes from left to right and which of the three numbers turns about each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Euler {
    axes: [u8; 3],
    columns: [u8; 3],
}

impl Euler {
    /// Roll, pitch, yaw: `R = Rz(3rd) · Ry(2nd) · Rx(1st)`.
    pub const RPY: Self = Self { axes: [2, 1, 0], columns: [2, 1, 0] };
    /// KUKA's A, B, C: `R = Rz(1st) · Ry(2nd) · Rx(3rd)`.
    pub const KUKA: Self = Self { axes: [2, 1, 0], columns: [0, 1, 2] };

    /// All that are tried, roll pitch yaw and KUKA's first: the first number turns about the first axis named, outermost
    /// or innermost, in every order of axes; numbers for x, y and z in every order of the product; and those of two turns
    /// about one axis that controllers have.
    pub(crate) fn all() -> Vec<Self> {
        const ORDERS: [[u8; 3]; 6] = [[2, 1, 0], [0, 1, 2], [1, 0, 2], [2, 0, 1], [0, 2, 1], [1, 2, 0]];
        let mut all = vec![Self::RPY, Self::KUKA];
        let by_axis = ORDERS.map(|axes| Self { axes, columns: axes });
        let outer = ORDERS.map(|axes| Self { axes, columns: [0, 1, 2] });
        let inner = ORDERS.map(|axes| Self { axes, columns: [2, 1, 0] });
        let twice = [[2, 1, 2], [2, 0, 2]].map(|axes| Self { axes, columns: [0, 1, 2] });
        for each in by_axis.into_iter().chain(outer).chain(inner).chain(twice) {
            if !all.contains(&each) {
                all.push(each);
            }
        }
        all
    }

    /// Those that turn about x by the first number, about y by the second and about z by the third.
    pub fn of_roll_pitch_yaw() -> Vec<Self> {
        Self::all().into_iter().filter(|euler| euler.axes == euler.columns).collect()
    }

    fn rotation(self, angles_rad: &[f64; 3]) -> UnitQuaternion<f64> {
        let turn = |i: usize| {
            let axis = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()][usize::from(self.axes[i])];
            UnitQuaternion::from_axis_angle(&axis, angles_rad[usize::from(self.columns[i])])
        };
        turn(0) * turn(1) * turn(2)
    }
}

impl RotationForm {
    /// Its name in `--set rotation=`; for turns the axes and the columns, from left to right of the product.
    pub fn name(self) -> String {
        match self {
            Self::Vector => "rotation_vector".into(),
            Self::Xyzw => "quaternion_xyzw".into(),
            Self::Wxyz => "quaternion_wxyz".into(),
            Self::Matrix => "matrix".into(),
            Self::Euler(Euler { axes, columns }) => {
                let axes: String = axes.iter().map(|a| ['x', 'y', 'z'][usize::from(*a)]).collect();
                let columns: String = columns.iter().map(|c| ['1', '2', '3'][usize::from(*c)]).collect();
                format!("euler_{axes}_{columns}")
            }
        }
    }

    /// The form with a name. In addition to [`name`](Self::name): `rpy`, `kuka_abc`, `fanuc_wpr`, and `euler_xyz` or
    /// `euler_XYZ` as in SciPy, about fixed or about moving axes.
    pub fn by_name(name: &str) -> Option<Self> {
        match name {
            "rotation_vector" => return Some(Self::Vector),
            "quaternion_xyzw" => return Some(Self::Xyzw),
            "quaternion_wxyz" => return Some(Self::Wxyz),
            "matrix" => return Some(Self::Matrix),
            "rpy" | "fanuc_wpr" => return Some(Self::Euler(Euler::RPY)),
            "kuka_abc" => return Some(Self::Euler(Euler::KUKA)),
            _ => {}
        }
        let rest = name.strip_prefix("euler_")?;
        let (axes, columns) = rest.split_once('_').unwrap_or((rest, ""));
        let axis = |c: char| "xyz".find(c.to_ascii_lowercase()).map(|i| i as u8);
        let three = |digits: Vec<u8>| <[u8; 3]>::try_from(digits).ok();
        let named = three(axes.chars().map(axis).collect::<Option<Vec<u8>>>()?)?;
        if named[0] == named[1] || named[1] == named[2] {
            return None;
        }
        let euler = match columns {
            "" if axes.chars().all(char::is_uppercase) => Euler { axes: named, columns: [0, 1, 2] },
            "" if axes.chars().all(char::is_lowercase) => {
                Euler { axes: [named[2], named[1], named[0]], columns: [2, 1, 0] }
            }
            digits => {
                let column = |c: char| "123".find(c).map(|i| i as u8);
                let columns = three(digits.chars().map(column).collect::<Option<Vec<u8>>>()?)?;
                let mut sorted = columns;
                sorted.sort_unstable();
                if sorted != [0, 1, 2] {
                    return None;
                }
                Euler { axes: named, columns }
            }
        };
        Some(Self::Euler(euler))
    }

    /// Those that numbers of this kind may have when nothing is stated about them.
    pub fn all_for(numbers: &Numbers) -> Vec<Self> {
        match numbers {
            Numbers::Angles(_) => {
                std::iter::once(Self::Vector).chain(Euler::all().into_iter().map(Self::Euler)).collect()
            }
            Numbers::Quaternion(_) => vec![Self::Xyzw, Self::Wxyz],
            Numbers::Matrix(_) => vec![Self::Matrix],
        }
    }

    /// Whether its numbers are angles.
    pub fn has_angles(self) -> bool {
        matches!(self, Self::Vector | Self::Euler(_))
    }
}

impl fmt::Display for RotationForm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Vector => f.write_str("rotation vector (axis times angle)"),
            Self::Xyzw => f.write_str("quaternion x y z w"),
            Self::Wxyz => f.write_str("quaternion w x y z"),
            Self::Matrix => f.write_str("rotation matrix"),
            Self::Euler(Euler { axes, columns }) => {
                f.write_str("R = ")?;
                for i in 0..3 {
                    let axis = ['x', 'y', 'z'][usize::from(axes[i])];
                    let nth = ["1st", "2nd", "3rd"][usize::from(columns[i])];
                    write!(f, "{}R{axis}({nth})", if i == 0 { "" } else { "·" })?;
                }
                Ok(())
            }
        }
    }
}

/// What the numbers of a series mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Reading {
    /// The unit of positions.
    pub length: LengthUnit,
    /// The unit of angles; unused where there are none.
    pub angle: AngleUnit,
    /// How rotations are written down.
    pub rotation: RotationForm,
}

impl Reading {
    /// The transform that was written, metres; `None` where the numbers do not fit this reading.
    pub fn transform(&self, numbers: &Numbers) -> Option<Isometry3<f64>> {
        let metres = self.length.metres();
        let (translation, rotation) = match (numbers, self.rotation) {
            (Numbers::Angles(n), RotationForm::Vector) => {
                (Vector3::new(n[0], n[1], n[2]), UnitQuaternion::from_scaled_axis(self.angles(n).into()))
            }
            (Numbers::Angles(n), RotationForm::Euler(euler)) => {
                (Vector3::new(n[0], n[1], n[2]), euler.rotation(&self.angles(n)))
            }
            (Numbers::Quaternion(n), form @ (RotationForm::Xyzw | RotationForm::Wxyz)) => {
                let [.., a, b, c, d] = *n;
                let q =
                    if form == RotationForm::Xyzw { Quaternion::new(d, a, b, c) } else { Quaternion::new(a, b, c, d) };
                (Vector3::new(n[0], n[1], n[2]), Unit::try_new(q, 0.5)?)
            }
            (Numbers::Matrix(m), RotationForm::Matrix) => {
                let rotation: Matrix3<f64> = m.fixed_view::<3, 3>(0, 0).into_owned();
                let exact: Rotation3<f64> = se3::nearest_rotation(&rotation);
                (m.fixed_view::<3, 1>(0, 3).into_owned(), UnitQuaternion::from_rotation_matrix(&exact))
            }
            _ => return None,
        };
        let finite = translation.iter().all(|v| v.is_finite()) && rotation.coords.iter().all(|v| v.is_finite());
        finite.then(|| Isometry3::from_parts(Translation3::from(translation * metres), rotation))
    }

    /// The numbers that a transform is written as, those that [`transform`](Self::transform) reads; `None` for matrices and
    /// products of turns other than roll, pitch and yaw.
    pub(crate) fn numbers(&self, pose: &Isometry3<f64>) -> Option<Numbers> {
        let [x, y, z] = (pose.translation.vector / self.length.metres()).into();
        let q = pose.rotation.coords;
        let angles = match self.rotation {
            RotationForm::Vector => pose.rotation.scaled_axis().into(),
            RotationForm::Euler(Euler::RPY) => <[f64; 3]>::from(pose.rotation.euler_angles()),
            RotationForm::Euler(_) | RotationForm::Matrix => return None,
            RotationForm::Xyzw => return Some(Numbers::Quaternion([x, y, z, q.x, q.y, q.z, q.w])),
            RotationForm::Wxyz => return Some(Numbers::Quaternion([x, y, z, q.w, q.x, q.y, q.z])),
        };
        let [a, b, c] = angles.map(|angle| angle / self.angle.radians());
        Some(Numbers::Angles([x, y, z, a, b, c]))
    }

    fn angles(&self, numbers: &[f64; 6]) -> [f64; 3] {
        let unit = self.angle.radians();
        [numbers[3] * unit, numbers[4] * unit, numbers[5] * unit]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_of_a_rotation_is_read_to_the_same_rotation() {
        let forms = [RotationForm::Vector, RotationForm::Xyzw, RotationForm::Wxyz, RotationForm::Matrix];
        for form in Euler::all().into_iter().map(RotationForm::Euler).chain(forms) {
            assert_eq!(RotationForm::by_name(&form.name()), Some(form), "{}", form.name());
        }
        assert_eq!(RotationForm::by_name("euler_xyz"), Some(RotationForm::Euler(Euler::RPY)));
        assert_eq!(RotationForm::by_name("euler_ZYX"), Some(RotationForm::Euler(Euler::KUKA)));
        for bad in ["euler_xxy", "euler_xy", "euler_zyx_311", "euler_", "euler_xYz", ""] {
            assert_eq!(RotationForm::by_name(bad), None, "{bad}");
        }
    }

    #[test]
    fn the_turns_that_are_tried_are_all_different() {
        let angles = [0.3, -0.7, 1.1];
        let all = Euler::all();
        for (i, a) in all.iter().enumerate() {
            for b in &all[..i] {
                let apart = a.rotation(&angles).angle_to(&b.rotation(&angles));
                assert!(apart > 1e-3, "{a:?} and {b:?}");
            }
        }
    }

    #[test]
    fn roll_pitch_yaw_is_that_of_urdf_and_kuka_turns_about_z_first() {
        let angles = [0.3, -0.7, 1.1];
        let urdf = UnitQuaternion::from_euler_angles(0.3, -0.7, 1.1);
        assert!(Euler::RPY.rotation(&angles).angle_to(&urdf) < 1e-12);
        let kuka = UnitQuaternion::from_euler_angles(1.1, -0.7, 0.3);
        assert!(Euler::KUKA.rotation(&angles).angle_to(&kuka) < 1e-12);
    }

    #[test]
    fn a_transform_is_written_as_the_numbers_that_it_is_read_from() {
        let pose = Isometry3::new(Vector3::new(0.1, -0.2, 0.3), Vector3::new(0.4, -0.5, 0.6));
        let turns = [RotationForm::Vector, RotationForm::Euler(Euler::RPY)];
        for rotation in turns.into_iter().chain([RotationForm::Xyzw, RotationForm::Wxyz]) {
            for (length, angle) in [(LengthUnit::Millimetre, AngleUnit::Degree), (LengthUnit::Metre, AngleUnit::Radian)]
            {
                let reading = Reading { length, angle, rotation };
                let again = reading.numbers(&pose).and_then(|numbers| reading.transform(&numbers)).expect("a pose");
                assert!((again.to_homogeneous() - pose.to_homogeneous()).amax() < 1e-12, "{reading:?}");
            }
        }
    }
}
