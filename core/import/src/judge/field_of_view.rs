//! Whether recorded poses of a target are of one that a camera sees. A robot's poses in their place give the same equations the
//! other way round, and so do the inverses of both, with camera and target where the target and the camera would be; but no lens
//! sees what is outside its field of view or behind it.

use nalgebra::Isometry3;

use handeye_wording::Text;
use handeye_wording::text;

/// Half of the field of lenses that calibrations are made with, radians: a fisheye of more sees a target at its border seldom.
const HALF_FIELD_RAD: f64 = 70.0 * std::f64::consts::PI / 180.0;
/// Share of the views that may be outside of it by a wrong row: a tenth, plus one.
const WRONG: usize = 10;

/// The reason, if too many of the target's poses are outside of the field of every lens: next to the camera, or behind
/// it.
pub(super) fn outside(seen: &[Isometry3<f64>]) -> Option<Text> {
    let is_outside = |pose: &&Isometry3<f64>| {
        let at = pose.translation.vector;
        at.z < HALF_FIELD_RAD.cos() * at.norm()
    };
    let outside = seen.iter().filter(is_outside).count();
    (outside > (seen.len() / WRONG).max(1)).then(|| {
        text!(
            "in {outside} of {views} views the poses that would be the target's put it behind the camera, or more than {deg}° \
             beside its axis, where no lens sees it",
            outside = outside,
            views = seen.len(),
            deg = format!("{:.0}", HALF_FIELD_RAD.to_degrees())
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn a_target_is_in_front_of_the_camera_and_never_behind_or_beside_it() {
        let at = |x: f64, z: f64| Isometry3::translation(x, 0.1, z);
        let front: Vec<Isometry3<f64>> = (0..9).map(|i| at(0.1 * f64::from(i) - 0.4, 0.5)).collect();
        assert_eq!(outside(&front), None);
        let behind: Vec<Isometry3<f64>> = front.iter().map(|pose| at(pose.translation.x, -0.5)).collect();
        assert!(
            outside(&behind).is_some(),
            "the inverse of both sides is the same equations with both links exchanged"
        );
        let mut one_wrong = front.clone();
        one_wrong[3] = Isometry3::new(Vector3::new(1.0, 0.0, 0.0), Vector3::zeros());
        assert_eq!(outside(&one_wrong), None);
        assert!(outside(&[&front[..5], &behind[..4]].concat()).is_some());
        assert!(outside(&front.iter().map(|_| at(0.8, 0.1)).collect::<Vec<_>>()).is_some());
    }
}
