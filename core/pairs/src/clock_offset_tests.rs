use nalgebra::{Isometry3, Vector3, Vector6};
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::*;
use handeye_geometry::se3;
use handeye_simulate::links::noise_twist;

const OFFSET_S: f64 = 0.0437;

/// An arm that sways, its motions given by `waves`: amplitude, frequency \[Hz\] and phase of every number of its pose.
fn arm(time_s: f64, waves: &[[f64; 3]]) -> Isometry3<f64> {
    let of = |axis: usize| -> f64 {
        let own = waves.iter().enumerate().filter(|(i, _)| i % 6 == axis);
        own.map(|(_, [size, hertz, phase])| size * (std::f64::consts::TAU * hertz * time_s + phase).sin()).sum()
    };
    let turn = Vector3::new(of(3), of(4), of(5));
    Isometry3::new(Vector3::new(0.4 + 0.2 * of(0), 0.2 * of(1), 0.5 + 0.2 * of(2)), turn)
}

/// Motions that do not repeat themselves within minutes.
fn waves() -> Vec<[f64; 3]> {
    (0..12).map(|k| [0.5, 0.11 + 0.047 * f64::from(k), 1.7 * f64::from(k)]).collect()
}

type Both = (Vec<(f64, Pose<Anchor, Mount>)>, Vec<(f64, Pose<Camera, Target>)>);

/// The robot at 125 Hz and the camera at 30 Hz for some seconds, the camera's clock behind by [`OFFSET_S`].
fn recorded(waves: &[[f64; 3]], seconds: f64, noise: (f64, f64), seed: u64) -> Both {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let x: Pose<Mount, Camera> = Pose::from_isometry(se3::exp(&Vector6::new(0.03, -0.05, 0.08, 0.2, -0.3, 1.5)));
    let y: Pose<Anchor, Target> = Pose::from_isometry(se3::exp(&Vector6::new(0.9, 0.1, 0.1, 1.0, 2.0, 0.5)));
    let times = |hertz: f64| (0..(seconds * hertz) as u32).map(move |k| f64::from(k) / hertz);
    let robot = times(125.0)
        .map(|t| {
            let pose: Pose<Anchor, Mount> = Pose::from_isometry(arm(t, waves));
            (t, pose.perturbed(&noise_twist(&mut rng, 0.1 * noise.0, 0.1 * noise.1)))
        })
        .collect();
    let mut rng = ChaCha8Rng::seed_from_u64(seed + 1000);
    let camera = times(30.0)
        .map(|t| {
            let seen = x.inverse() * Pose::from_isometry(arm(t, waves)).inverse() * y;
            (t - OFFSET_S, seen.perturbed(&noise_twist(&mut rng, noise.0, noise.1)))
        })
        .collect();
    (robot, camera)
}

fn reported((robot, camera): &Both, within_s: f64) -> Result<ClockOffset, ClockOffsetError> {
    clock_offset(robot, camera, within_s, &CancelToken::default())
}

#[test]
fn the_offset_is_found_as_well_as_it_is_said_to_be() {
    let (mut squares, sessions) = (0.0, 40);
    for seed in 0..sessions {
        let mut both = recorded(&waves(), 12.0, (1e-3, 2e-3), seed);
        if seed % 4 == 0 {
            // Wrong poses of the target, as of a marker that was read the other way round.
            for (_, pose) in both.1.iter_mut().step_by(11) {
                *pose = pose.perturbed(&Vector6::new(0.1, 0.0, 0.05, 0.0, 1.0, 0.3));
            }
        }
        let ClockOffset { offset_s, sigma_s } = reported(&both, 1.0).expect("told");
        assert!(sigma_s < 1e-3, "seed {seed}: {sigma_s}");
        squares += ((offset_s - OFFSET_S) / sigma_s).powi(2) / sessions as f64;
    }
    println!("error in its standard deviation, RMS over {sessions} recordings: {:.2}", squares.sqrt());
    // The mean of 40 squares scatters by 0.22.
    assert!((0.4..1.7).contains(&squares), "{squares}");
}

#[test]
fn a_motion_that_tells_no_time_is_refused() {
    // Uniform rotation about one axis.
    let even = |t: f64| Isometry3::new(Vector3::new(0.4, 0.0, 0.5), Vector3::z() * 0.4 * t);
    let x: Pose<Mount, Camera> = Pose::from_isometry(se3::exp(&Vector6::new(0.03, -0.05, 0.08, 0.2, -0.3, 1.5)));
    let y: Pose<Anchor, Target> = Pose::from_isometry(se3::exp(&Vector6::new(0.9, 0.1, 0.1, 1.0, 2.0, 0.5)));
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let robot: Vec<_> =
        (0..600).map(|k| (f64::from(k) / 100.0, Pose::from_isometry(even(f64::from(k) / 100.0)))).collect();
    let camera: Vec<_> = (0..180)
        .map(|k| {
            let t = f64::from(k) / 30.0;
            let seen = x.inverse() * Pose::from_isometry(even(t)).inverse() * y;
            (t, seen.perturbed(&noise_twist(&mut rng, 1e-3, 2e-3)))
        })
        .collect();
    let refused = reported(&(robot, camera), 0.5);
    assert!(refused.is_err(), "{refused:?}");
    // A robot at rest.
    let (robot, camera) = recorded(&[], 6.0, (1e-3, 2e-3), 6);
    let refused = reported(&(robot, camera), 0.5);
    assert!(refused.is_err(), "{refused:?}");
}

#[test]
fn a_motion_that_repeats_itself_is_told_from_one_that_does_not() {
    // Twice a second on all axes: an offset of half a second more fits as well, and one of a quarter second nearly as
    // well.
    let twice: Vec<[f64; 3]> = (0..6).map(|k| [0.4, 2.0, f64::from(k)]).collect();
    let both = recorded(&twice, 10.0, (1e-3, 2e-3), 7);
    let refused = reported(&both, 1.0).expect_err("it repeats itself");
    assert!(matches!(refused, ClockOffsetError::Ambiguous { .. }), "{refused}");
    let near = reported(&both, 0.1).expect("once it is known roughly");
    assert!((near.offset_s - OFFSET_S).abs() < 5.0 * near.sigma_s, "{near:?}");
}

#[test]
fn streams_that_cannot_be_used_are_named() {
    let (robot, camera) = recorded(&waves(), 6.0, (1e-3, 2e-3), 8);
    let few = clock_offset(&robot[..10], &camera, 1.0, &CancelToken::default());
    assert_eq!(few, Err(ClockOffsetError::TooFew { whose: "robot", got: 10, need: NEED }));
    let mut back = camera.clone();
    back[7].0 = back[6].0;
    let back = clock_offset(&robot, &back, 1.0, &CancelToken::default());
    assert_eq!(back, Err(ClockOffsetError::NotRising { whose: "camera", entry: 7 }));
    let late: Vec<_> = camera.iter().map(|(stamp_s, pose)| (stamp_s + 100.0, *pose)).collect();
    let late = clock_offset(&robot, &late, 1.0, &CancelToken::default());
    assert_eq!(late, Err(ClockOffsetError::Apart { within_s: 1.0 }));
}
