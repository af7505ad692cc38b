use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};

use super::*;

const MOTION: MotionModel = MotionModel { acceleration: 0.3, angular_acceleration: 1.5, coast_s: 0.5 };
const PERIOD_S: f64 = 1.0 / 30.0;

fn normal(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| StandardNormal.sample(rng))
}

fn centre() -> Point3<f64> {
    Point3::new(0.0675, 0.045, 0.0)
}

/// A board that moves according to the model, in steps much finer than the images.
struct Board {
    at: Vector3<f64>,
    rotation: UnitQuaternion<f64>,
    velocity: Vector3<f64>,
    spin: Vector3<f64>,
}

impl Board {
    fn go_on(&mut self, rng: &mut ChaCha8Rng, for_s: f64) {
        const STEPS: usize = 50;
        let dt = for_s / STEPS as f64;
        for _ in 0..STEPS {
            let change = normal(rng) * (MOTION.acceleration * dt.sqrt());
            self.at += (self.velocity + 0.5 * change) * dt;
            self.velocity += change;
            let change = normal(rng) * (MOTION.angular_acceleration * dt.sqrt());
            self.rotation = UnitQuaternion::from_scaled_axis((self.spin + 0.5 * change) * dt) * self.rotation;
            self.spin += change;
        }
    }

    fn base_from_target(&self) -> Pose<Base, Target> {
        let origin = self.at - self.rotation * centre().coords;
        Pose::from_isometry(Isometry3::from_parts(origin.into(), self.rotation))
    }

    /// The board as measured by an image: sideways to 0.1 mm, in depth to 0.5 mm, tilted to 2 mrad.
    fn seen(&self, rng: &mut ChaCha8Rng) -> BoardPose {
        let sigmas = [1e-4, 1e-4, 5e-4, 2e-3, 2e-3, 3e-4];
        let delta = Vector6::from_fn(|i, _| {
            let n: f64 = StandardNormal.sample(rng);
            sigmas[i] * n
        });
        let covariance = Matrix6::from_diagonal(&Vector6::from(sigmas).map(|s| s * s));
        BoardPose::new(&self.base_from_target().perturbed(&delta), &covariance, &centre())
    }
}

#[test]
fn errors_are_of_the_size_that_the_filter_states_for_a_board_that_moves_as_modelled() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let (mut now, mut ahead) = (0.0, 0.0);
    let (mut taken, mut refused) = (0, 0);
    let runs = 200;
    for _ in 0..runs {
        let mut board = Board {
            at: normal(&mut rng),
            rotation: UnitQuaternion::from_scaled_axis(normal(&mut rng)),
            velocity: normal(&mut rng) * START_SIGMA.0,
            spin: normal(&mut rng) * START_SIGMA.1,
        };
        let mut filter = Filter::new(MOTION, centre(), 0.0, &board.seen(&mut rng));
        for i in 1..=20 {
            board.go_on(&mut rng, PERIOD_S);
            filter.predict(f64::from(i) * PERIOD_S);
            if filter.update(&board.seen(&mut rng)) { taken += 1 } else { refused += 1 }
        }
        let squared = |filter: &Filter, board: &Board| {
            let estimate = filter.estimate();
            let off = se3::log((estimate.base_from_target.inverse() * board.base_from_target()).isometry());
            off.dot(&estimate.covariance.cholesky().expect("positive").solve(&off))
        };
        now += squared(&filter, &board);
        // A quarter of a second without images.
        board.go_on(&mut rng, 0.25);
        filter.predict(filter.time_s() + 0.25);
        ahead += squared(&filter, &board);
    }
    // 6 degrees of freedom a run; 99.9 % of such means lie within this.
    let bound = 3.29 * (2.0 / (6.0 * f64::from(runs))).sqrt();
    let (now, ahead) = (now / 6.0 / f64::from(runs), ahead / 6.0 / f64::from(runs));
    println!("squared errors over expected: {now:.3} at an image, {ahead:.3} a quarter second on; bound ±{bound:.3}");
    assert!((now - 1.0).abs() < bound && (ahead - 1.0).abs() < bound);
    assert!(refused <= taken / 1000, "{refused} of {taken} refused");
}

#[test]
fn many_short_predictions_are_one_long_one() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let board = Board {
        at: normal(&mut rng),
        rotation: UnitQuaternion::identity(),
        velocity: Vector3::zeros(),
        spin: Vector3::zeros(),
    };
    let mut short = Filter::new(MOTION, centre(), 0.0, &board.seen(&mut rng));
    (short.velocity, short.spin) = (Vector3::new(0.3, -0.1, 0.2), Vector3::new(0.4, 1.0, -0.2));
    let mut long = short.clone();
    long.predict(0.4);
    for i in 1..=100 {
        short.predict(f64::from(i) * 0.004);
    }
    assert!((long.covariance - short.covariance).amax() < 2e-4 * long.covariance.amax());
    assert!((long.centre - short.centre).norm() < 1e-12 && long.rotation.angle_to(&short.rotation) < 1e-12);
    let before = long.covariance;
    long.predict(0.1);
    long.predict(f64::NAN);
    assert_eq!((long.covariance, long.time_s()), (before, 0.4));
}

#[test]
fn a_wild_sight_is_refused_and_changes_nothing() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut board = Board {
        at: normal(&mut rng),
        rotation: UnitQuaternion::identity(),
        velocity: Vector3::zeros(),
        spin: Vector3::zeros(),
    };
    let mut filter = Filter::new(MOTION, centre(), 0.0, &board.seen(&mut rng));
    for i in 1..=10 {
        filter.predict(f64::from(i) * PERIOD_S);
        assert!(filter.update(&board.seen(&mut rng)));
    }
    filter.predict(11.0 * PERIOD_S);
    let before = filter.estimate();
    board.at.x += 0.02;
    assert!(!filter.update(&board.seen(&mut rng)));
    assert_eq!(filter.estimate(), before);
}
