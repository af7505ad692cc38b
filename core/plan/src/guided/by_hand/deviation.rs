//! How a view differs from the one that is wanted, and what to do about it, in words for a person who looks at the image.

use nalgebra::{UnitQuaternion, Vector2, Vector3};

use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Camera, Pose, Target};
use handeye_geometry::targets::TargetSpec;
use handeye_wording::Text;
use handeye_wording::text;

/// Angle within which a view counts as the wanted one: a hand achieves it, and the gain hardly differs.
const NEAR_RAD: f64 = 8.0 * std::f64::consts::PI / 180.0;
/// The same for the position of the board, as a fraction of the width of the image.
const NEAR_SHIFT: f64 = 0.08;
/// The same for the distance, as a fraction of it.
const NEAR_DISTANCE: f64 = 0.12;

/// Difference from the present view to the wanted one, as seen in the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// How far the middle of the board has to move to the right and down, as part of the width of the image.
    pub shift: Vector2<f64>,
    /// Distance along the line of sight that is wanted, metres.
    pub distance_m: f64,
    /// Wanted over present distance.
    pub distance_ratio: f64,
    /// Turn about the axes of the image to the right and down, after that about the line of sight, radians: a positive one
    /// about the first moves the lower side of the board away from the camera, about the second the left side.
    pub tilt_rad: Vector2<f64>,
    /// Turn of the board in the image, clockwise, radians.
    pub roll_rad: f64,
}

impl Deviation {
    /// `None` where the middle of the board is not in front of the camera in one of the two.
    pub(crate) fn between(
        intrinsics: &Intrinsics,
        target: &TargetSpec,
        present: &Pose<Camera, Target>,
        wanted: &Pose<Camera, Target>,
    ) -> Option<Self> {
        let middle = |pose: &Pose<Camera, Target>| {
            let point = pose.isometry() * target.centre();
            Some((intrinsics.project(&point).ok()?, point.coords.norm()))
        };
        let ((from_px, from_m), (to_px, to_m)) = (middle(present)?, middle(wanted)?);
        let turn = wanted.rotation() * present.rotation().inverse();
        let (tilt, roll_rad) = swing_and_twist(&turn);
        Some(Self {
            shift: (to_px - from_px) / f64::from(intrinsics.width),
            distance_m: to_m,
            distance_ratio: to_m / from_m,
            tilt_rad: tilt.xy(),
            roll_rad,
        })
    }

    /// Whether the view is close enough to the wanted one.
    pub(crate) fn is_near(&self) -> bool {
        self.parts().into_iter().all(|(_, of_tolerance)| of_tolerance <= 1.0)
    }

    /// What to change first: the part farthest outside its tolerance. `None` where all are within.
    pub fn advice(&self) -> Option<Text> {
        let (part, _) = self
            .parts()
            .into_iter()
            .filter(|(_, of_tolerance)| *of_tolerance > 1.0)
            .max_by(|(_, a), (_, b)| a.total_cmp(b))?;
        let degrees = |rad: f64| format!("{:.0}", rad.abs().to_degrees());
        Some(match part {
            Part::Shift if self.shift.x.abs() >= self.shift.y.abs() && self.shift.x > 0.0 => {
                text!("Bring the board to the right in the image")
            }
            Part::Shift if self.shift.x.abs() >= self.shift.y.abs() => {
                text!("Bring the board to the left in the image")
            }
            Part::Shift if self.shift.y > 0.0 => text!("Bring the board down in the image"),
            Part::Shift => text!("Bring the board up in the image"),
            Part::Distance => {
                let centimetres = format!("{:.0}", self.distance_m * 1e2);
                if self.distance_ratio < 1.0 {
                    text!("Camera and board closer together: {distance} cm", distance = centimetres)
                } else {
                    text!("Camera and board farther apart: {distance} cm", distance = centimetres)
                }
            }
            Part::Tilt => {
                let (x, y) = (self.tilt_rad.x, self.tilt_rad.y);
                let angle = degrees(self.tilt_rad.norm());
                match (x.abs() >= y.abs(), x > 0.0, y > 0.0) {
                    (true, true, _) => text!("Tilt by {angle}°: the lower side of the board away", angle = angle),
                    (true, false, _) => text!("Tilt by {angle}°: the upper side of the board away", angle = angle),
                    (false, _, true) => text!("Tilt by {angle}°: the left side of the board away", angle = angle),
                    (false, _, false) => text!("Tilt by {angle}°: the right side of the board away", angle = angle),
                }
            }
            Part::Roll if self.roll_rad > 0.0 => {
                text!("Turn the board in the image clockwise by {angle}°", angle = degrees(self.roll_rad))
            }
            Part::Roll => {
                text!("Turn the board in the image counterclockwise by {angle}°", angle = degrees(self.roll_rad))
            }
        })
    }

    /// Each part divided by its tolerance.
    fn parts(&self) -> [(Part, f64); 4] {
        [
            (Part::Shift, self.shift.norm() / NEAR_SHIFT),
            (Part::Distance, self.distance_ratio.ln().abs() / NEAR_DISTANCE.ln_1p()),
            (Part::Tilt, self.tilt_rad.norm() / NEAR_RAD),
            (Part::Roll, self.roll_rad.abs() / NEAR_RAD),
        ]
    }
}

#[derive(Debug, Clone, Copy)]
enum Part {
    Shift,
    Distance,
    Tilt,
    Roll,
}

/// A rotation as a turn about an axis across z (a rotation vector) after a turn about z \[rad\], which is the line of sight.
pub(super) fn swing_and_twist(turn: &UnitQuaternion<f64>) -> (Vector3<f64>, f64) {
    let twist_rad = 2.0 * turn.k.atan2(turn.w);
    // The same turn by less than half a revolution.
    let twist_rad = twist_rad - std::f64::consts::TAU * (twist_rad / std::f64::consts::TAU).round();
    let twist = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), twist_rad);
    ((turn * twist.inverse()).scaled_axis(), twist_rad)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Translation3};

    use super::*;
    use handeye_geometry::testing::BOARD;
    use handeye_simulate::session::camera;
    use handeye_wording::English;

    /// A view of the middle of the board from 0.4 m, turned by this rotation vector.
    fn view(turn: Vector3<f64>) -> Pose<Camera, Target> {
        at(Vector3::new(0.0, 0.0, 0.4), turn)
    }

    fn at(place: Vector3<f64>, turn: Vector3<f64>) -> Pose<Camera, Target> {
        let pose = Isometry3::from_parts(place.into(), UnitQuaternion::from_scaled_axis(turn));
        Pose::from_isometry(pose * Translation3::from(-BOARD.centre().coords))
    }

    fn advice(present: &Pose<Camera, Target>, wanted: &Pose<Camera, Target>) -> Option<String> {
        let deviation = Deviation::between(&camera(), &BOARD, present, wanted).expect("in front of the camera");
        assert_eq!(deviation.is_near(), deviation.advice().is_none());
        deviation.advice().map(|text| text.in_language(English))
    }

    #[test]
    fn words_say_what_a_person_sees_when_it_is_done() {
        let straight = view(Vector3::zeros());
        let reported = |wanted: &Pose<Camera, Target>| advice(&straight, wanted).expect("far from it");
        // Turned about the axis to the right, what is below goes away from the camera: y is down, z away.
        let lower_away = view(Vector3::new(0.5, 0.0, 0.0));
        let corner = |row: usize| lower_away.isometry() * BOARD.point(row * BOARD.grid().columns);
        assert!(corner(BOARD.grid().rows - 1).z > corner(0).z);
        assert_eq!(reported(&lower_away), "Tilt by 29°: the lower side of the board away");
        assert_eq!(reported(&view(Vector3::new(-0.5, 0.0, 0.0))), "Tilt by 29°: the upper side of the board away");
        assert_eq!(reported(&view(Vector3::new(0.0, 0.5, 0.0))), "Tilt by 29°: the left side of the board away");
        assert_eq!(reported(&view(Vector3::new(0.0, -0.5, 0.0))), "Tilt by 29°: the right side of the board away");
        assert_eq!(reported(&view(Vector3::new(0.0, 0.0, 0.5))), "Turn the board in the image clockwise by 29°");
        assert_eq!(
            reported(&view(Vector3::new(0.0, 0.0, -0.5))),
            "Turn the board in the image counterclockwise by 29°"
        );
        let place = |x: f64, y: f64, z: f64| at(Vector3::new(x, y, z), Vector3::zeros());
        assert_eq!(reported(&place(0.1, 0.02, 0.4)), "Bring the board to the right in the image");
        assert_eq!(reported(&place(0.0, -0.1, 0.4)), "Bring the board up in the image");
        assert_eq!(reported(&place(0.0, 0.0, 0.25)), "Camera and board closer together: 25 cm");
        assert_eq!(reported(&place(0.0, 0.0, 0.6)), "Camera and board farther apart: 60 cm");
        assert_eq!(advice(&straight, &view(Vector3::new(0.05, 0.05, -0.1))), None);
    }

    #[test]
    fn a_roll_of_more_than_half_a_revolution_is_the_other_way_round() {
        let (_, twist) = swing_and_twist(&UnitQuaternion::from_scaled_axis(Vector3::z() * 3.5));
        assert!((twist - (3.5 - std::f64::consts::TAU)).abs() < 1e-9, "{twist}");
    }
}
