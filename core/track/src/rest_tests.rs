use nalgebra::Vector6;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::{BoardDetection, State};
use handeye_geometry::frames::{Base, Pose, Target};
use handeye_geometry::targets::observation::Corners;
use handeye_simulate::links::normal;

/// Hard-edged images: the tilt to two tenths of a degree.
const SIGMA: [f64; 6] = [1e-4, 1e-4, 2e-4, 3e-3, 3e-3, 2e-4];
const PERIOD_S: f64 = 1.0 / 15.0;

fn update(time_s: f64, base_from_target: Pose<Base, Target>) -> Update {
    let covariance = Matrix6::from_diagonal(&Vector6::from(SIGMA.map(|sigma| sigma * sigma)));
    let seen = BoardDetection {
        corners: Corners::default(),
        camera_from_target: Pose::identity(),
        base_from_target,
        covariance,
        rms_px: 0.1,
    };
    let estimate = Estimate {
        time_s,
        base_from_target,
        covariance,
        velocity_m_s: Vector3::new(0.01, 0.0, 0.0),
        angular_velocity_rad_s: Vector3::zeros(),
    };
    let state = State::Tracking { corners: 70, of: 70 };
    Update { time_s, state, seen: Some(seen), with_depth: None, by_depth: None, estimate: Some(estimate) }
}

fn placed(metres: f64, noise: &Vector6<f64>) -> Pose<Base, Target> {
    Pose::from_isometry(se3::exp(&Vector6::new(metres, 0.0, 0.0, 0.0, 0.0, 0.0)) * se3::exp(noise))
}

/// Images in which the board is at `place` by time, with random errors; in how many it is at rest, and at how many places it
/// was.
fn shown(seconds: f64, seed: u64, place: impl Fn(f64) -> f64) -> (Vec<bool>, usize) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut rest = Rest::default();
    let (mut rests, mut places, mut last) = (Vec::new(), 0, None);
    for k in 0..(seconds / PERIOD_S) as usize {
        let time_s = k as f64 * PERIOD_S;
        let noise = Vector6::from_fn(|i, _| SIGMA[i] * normal(&mut rng));
        rest.see(&update(time_s, placed(place(time_s), &noise)));
        let at = rest.at().map(|at| at.time_s);
        places += usize::from(at.is_some() && at != last);
        last = at.or(last);
        rests.push(at.is_some());
    }
    (rests, places)
}

#[test]
fn a_board_that_stands_rests_at_one_place_though_every_image_differs() {
    let mut places = 0;
    for seed in 0..10 {
        let (rests, of) = shown(20.0, seed, |_| 0.3);
        assert!(rests[rests.len() / 2..].iter().filter(|rests| **rests).count() > 140, "seed {seed}");
        places += of;
    }
    // One image in a thousand is elsewhere by chance: three of three thousand, and never fifteen.
    assert!((10..25).contains(&places), "{places}");
}

#[test]
fn a_board_that_moves_is_followed_at_once_and_rests_where_it_stops() {
    // From the second second on 20 mm/s, and at rest from the sixth on.
    let (rests, _) = shown(12.0, 3, |time_s| 0.02 * (time_s - 2.0).clamp(0.0, 4.0));
    let during = |from_s: f64, to_s: f64| {
        let at = |s: f64| (s / PERIOD_S) as usize;
        rests[at(from_s)..at(to_s)].iter().filter(|rests| **rests).count() as f64 / (at(to_s) - at(from_s)) as f64
    };
    assert!(during(1.0, 2.0) > 0.9, "before: {}", during(1.0, 2.0));
    assert!(during(2.3, 6.0) < 0.02, "on the way: {}", during(2.3, 6.0));
    assert!(during(8.0, 12.0) > 0.9, "after: {}", during(8.0, 12.0));
}

#[test]
fn where_it_rests_it_has_no_velocity_and_a_clock_that_goes_back_begins_anew() {
    let mut rest = Rest::default();
    for k in 0..20 {
        rest.see(&update(10.0 + k as f64 * PERIOD_S, Pose::identity()));
    }
    assert_eq!(rest.at().expect("rests").velocity_m_s, Vector3::zeros());
    let away = placed(0.1, &Vector6::zeros());
    rest.see(&update(0.0, away));
    assert!(rest.at().is_none());
    for k in 1..20 {
        rest.see(&update(k as f64 * PERIOD_S, away));
    }
    assert!(rest.at().expect("rests").base_from_target.distance_to(&away).0 < 1e-9);
}
