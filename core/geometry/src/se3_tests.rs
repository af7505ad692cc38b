use super::*;
use approx::assert_relative_eq;
use proptest::prelude::*;

fn tangent(max_angle: f64) -> impl Strategy<Value = Vector6<f64>> {
    (prop::array::uniform3(-2.0..2.0f64), prop::array::uniform3(-1.0..1.0f64), 0.0..1.0f64).prop_map(
        move |(t, axis, s)| {
            let axis = Vector3::from(axis);
            let n = axis.norm();
            let phi = if n < 1e-6 { Vector3::zeros() } else { axis / n * (s * max_angle) };
            Vector6::new(t[0], t[1], t[2], phi.x, phi.y, phi.z)
        },
    )
}

fn matrix_exponential(delta: &Vector6<f64>) -> nalgebra::Matrix4<f64> {
    let mut twist = nalgebra::Matrix4::zeros();
    let phi = delta.fixed_rows::<3>(3).into_owned();
    twist.fixed_view_mut::<3, 3>(0, 0).copy_from(&skew(&phi));
    twist.fixed_view_mut::<3, 1>(0, 3).copy_from(&delta.fixed_rows::<3>(0));
    twist.exp()
}

proptest! {
    #[test]
    fn exp_is_the_matrix_exponential_of_the_twist(delta in tangent(6.0)) {
        let ours = exp(&delta).to_homogeneous();
        prop_assert!((ours - matrix_exponential(&delta)).norm() < 1e-11);
    }

    #[test]
    fn log_undoes_exp(delta in tangent(3.0)) {
        prop_assert!((log(&exp(&delta)) - delta).norm() < 1e-8);
    }

    #[test]
    fn exp_undoes_log_at_every_angle(delta in tangent(6.3)) {
        let pose = exp(&delta);
        let again = exp(&log(&pose));
        prop_assert!((again.to_homogeneous() - pose.to_homogeneous()).norm() < 1e-8);
    }

    #[test]
    fn adjoint_moves_a_perturbation_across(pose in tangent(3.0), delta in tangent(0.5)) {
        let t = exp(&pose);
        let right = t * exp(&delta);
        let left = exp(&(adjoint(&t) * delta)) * t;
        prop_assert!((right.to_homogeneous() - left.to_homogeneous()).norm() < 1e-10);
    }

    #[test]
    fn left_jacobian_times_its_inverse_is_one(delta in tangent(5.0)) {
        let phi = delta.fixed_rows::<3>(3).into_owned();
        let product = left_jacobian(&phi) * left_jacobian_inverse(&phi);
        prop_assert!((product - Matrix3::identity()).norm() < 1e-9);
    }

    #[test]
    fn mean_rotation_ignores_quaternion_signs(delta in tangent(3.0), flip in any::<bool>()) {
        let q = exp(&delta).rotation;
        let p = if flip { UnitQuaternion::new_unchecked(-q.into_inner()) } else { q };
        let mean = mean_rotation([q, p, q]).expect("three rotations");
        prop_assert!(mean.angle_to(&q) < 1e-7);
    }
}

#[test]
fn series_and_closed_form_meet_at_the_switch() {
    for angle in [SMALL_ANGLE * 0.999, SMALL_ANGLE * 1.001] {
        let delta = Vector6::new(1.0, 2.0, 3.0, 0.0, angle, 0.0);
        assert_relative_eq!(exp(&delta).to_homogeneous(), matrix_exponential(&delta), epsilon = 1e-13);
        assert_relative_eq!(log(&exp(&delta)), delta, epsilon = 1e-12);
    }
}

#[test]
fn log_of_a_half_turn_has_angle_pi() {
    let half_turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, std::f64::consts::PI, 0.0));
    assert_relative_eq!(rotation_vector(&half_turn).norm(), std::f64::consts::PI, epsilon = 1e-15);
}

#[test]
fn nearest_rotation_of_a_reflection_is_a_rotation() {
    let r = nearest_rotation(&Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -0.1)));
    assert_relative_eq!(r.matrix().determinant(), 1.0, epsilon = 1e-12);
    assert_relative_eq!(*r.matrix(), Matrix3::identity(), epsilon = 1e-12);
}
