//! Whether the answers of random halves agree as well as they say.

use handeye_estimate::handeye::joint::{Free, JointSolution, SmallSample};
use handeye_estimate::uncertainty::{overdispersion, quality};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::se3;
use nalgebra::{Matrix6, Point3};
use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ContinuousCDF as _, FisherSnedecor};

use crate::methods::Choice;
use crate::sets::Set;

/// An answer and by how much its covariance has to be widened.
struct Half {
    solution: JointSolution,
    factor: f64,
}

impl Half {
    fn new(set: &Set, views: &[usize], free: Free) -> Option<Self> {
        let kept = Choice::new(set, views).joint(set, free)?;
        let widening = overdispersion::check(&kept.problem(set), &kept.solution, &CancelToken::default()).ok()?;
        Some(Self { solution: kept.solution, factor: widening.factor })
    }

    /// Covariance in the units of its distribution.
    fn covariance(&self) -> Matrix6<f64> {
        self.solution.hand_eye_covariance() / self.solution.small_sample.scale
    }
}

/// Degrees of freedom of the sum of two covariances, by Welch and Satterthwaite in the mean over the directions of the sum.
fn degrees(a: &Half, b: &Half) -> f64 {
    let (ca, cb) = (a.covariance(), b.covariance());
    let Some(inverse) = (ca + cb).try_inverse() else { return f64::NAN };
    let share = |c: Matrix6<f64>| (inverse * c).trace() / 6.0;
    let of = |half: &Half, c| share(c).powi(2) / half.solution.small_sample.degrees_of_freedom;
    (of(a, ca) + of(b, cb)).recip()
}

/// How often two halves agreed.
#[derive(Default)]
struct Agreement {
    splits: usize,
    region: usize,
    tip: usize,
}

impl Agreement {
    fn add(&mut self, difference: &nalgebra::Vector6<f64>, covariance: &Matrix6<f64>, degrees: f64, at: &Point3<f64>) {
        let Some(inverse) = covariance.try_inverse() else { return };
        let limit = if degrees < 1e6 {
            FisherSnedecor::new(6.0, degrees).map_or(f64::NAN, |law| law.inverse_cdf(0.95))
        } else {
            // Chi-square with six degrees of freedom.
            12.591_587 / 6.0
        };
        self.splits += 1;
        self.region += usize::from(difference.dot(&(inverse * difference)) / 6.0 <= limit);
        let moved = difference.fixed_rows::<3>(0) + difference.fixed_rows::<3>(3).cross(&at.coords);
        self.tip += usize::from(
            moved.norm()
                <= quality::tip_error_95_at(
                    covariance,
                    SmallSample { degrees_of_freedom: degrees, ..SmallSample::KNOWN },
                    at,
                ),
        );
    }

    fn print(&self) {
        let share = |n: usize| n as f64 / self.splits.max(1) as f64 * 100.0;
        print!(" {:.0} % | {:.0} % |", share(self.region), share(self.tip));
    }
}

/// Head of the table.
pub fn header() {
    println!(
        "| set | model | region | tip | region, widened | tip, widened | halves widened | mm apart at the board | splits |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
}

pub fn run(set: &Set, splits: usize) {
    if !set.has_corners() {
        return;
    }
    let mut variants = vec![("joint", Free::default())];
    variants.extend(crate::methods::variants(set).filter(|(_, free)| !free.warp));
    for (name, free) in variants {
        let mut rng = ChaCha8Rng::seed_from_u64(100);
        let mut order: Vec<usize> = (0..set.views.len()).collect();
        let (mut stated, mut widened) = (Agreement::default(), Agreement::default());
        let (mut failed, mut widened_halves, mut apart_m) = (0, 0, 0.0);
        for _ in 0..splits {
            order.shuffle(&mut rng);
            let (a, b) = order.split_at(order.len() / 2);
            let sorted = |part: &[usize]| {
                let mut part = part.to_vec();
                part.sort_unstable();
                part
            };
            let (Some(a), Some(b)) = (Half::new(set, &sorted(a), free), Half::new(set, &sorted(b), free)) else {
                failed += 1;
                continue;
            };
            let (x, y) = (a.solution.hand_eye.mount_from_camera(), b.solution.hand_eye.mount_from_camera());
            let difference = se3::log((x.inverse() * y).isometry());
            let at = a.solution.reference_point;
            let degrees = degrees(&a, &b);
            stated.add(&difference, &(a.covariance() + b.covariance()), degrees, &at);
            widened.add(&difference, &(a.covariance() * a.factor + b.covariance() * b.factor), degrees, &at);
            widened_halves += usize::from(a.factor > 1.0) + usize::from(b.factor > 1.0);
            apart_m += (difference.fixed_rows::<3>(0) + difference.fixed_rows::<3>(3).cross(&at.coords)).norm();
        }
        print!("| {} | {name} |", set.name);
        stated.print();
        widened.print();
        let done = splits - failed;
        println!(
            " {:.0} % | {:.3} | {done} |",
            widened_halves as f64 / (2 * done).max(1) as f64 * 100.0,
            apart_m / done.max(1) as f64 * 1e3
        );
    }
}
