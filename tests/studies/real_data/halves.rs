//! Whether the answers of random halves agree as well as they state, each calibrated and examined as in the command line.

use handeye_estimate::diagnose::{Calibration, calibrate};
use handeye_estimate::{CameraKnowledge, Method, Observations, ObservedView};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::se3;
use nalgebra::Vector6;
use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;

use crate::methods::MANY;
use crate::sets::Set;

/// Number of standard deviations within which two answers that differ by chance alone are in 95 % of cases.
const WITHIN: f64 = 1.96;
/// Numbers of a lens that are compared: fx, fy, cx, cy.
const LENS_NUMBERS: usize = 4;

/// How many were within, of how many.
#[derive(Default, Clone, Copy)]
struct Share {
    within: usize,
    of: usize,
}

impl Share {
    fn add(&mut self, within: bool) {
        self.within += usize::from(within);
        self.of += 1;
    }

    fn together(self, other: Self) -> Self {
        Self { within: self.within + other.within, of: self.of + other.of }
    }

    fn percent(self) -> String {
        if self.of == 0 { "–".to_owned() } else { format!("{:.1}", 100.0 * self.within as f64 / self.of as f64) }
    }
}

/// The results of pairs of halves.
#[derive(Default)]
pub struct Agreement {
    translation: Share,
    rotation: Share,
    lens: Share,
    /// Errors of a measured point compared with the root of the sum of the squares of both stated errors.
    point: Share,
    /// Share of halves for which nothing was stated.
    silent: Share,
    apart_m: Vec<f64>,
}

impl Agreement {
    fn add(&mut self, [a, b]: &[Option<Calibration>; 2]) {
        for half in [a, b] {
            self.silent.add(half.as_ref().and_then(Calibration::tip_error_95_m).is_none());
        }
        let (Some(a), Some(b)) = (a, b) else { return };
        let Some((difference, at)) = difference(a, b) else { return };
        let moved_m = (difference.fixed_rows::<3>(0) + difference.fixed_rows::<3>(3).cross(&at.coords)).norm();
        self.apart_m.push(moved_m);
        // If the data contradict themselves nothing is stated that could be wrong.
        let (Some(of_a), Some(of_b)) = (a.tip_error_95_m(), b.error_95_m(&at)) else { return };
        self.point.add(moved_m <= of_a.hypot(of_b));
        if let (Some(ca), Some(cb)) = (a.link_covariances(), b.link_covariances()) {
            for k in 0..6 {
                let share = if k < 3 { &mut self.translation } else { &mut self.rotation };
                share.add(difference[k].abs() <= WITHIN * (ca.hand_eye[(k, k)] + cb.hand_eye[(k, k)]).sqrt());
            }
        }
        for k in 0..LENS_NUMBERS {
            if let (Some((a, of_a)), Some((b, of_b))) = (lens(a, k), lens(b, k)) {
                self.lens.add((a - b).abs() <= WITHIN * of_a.hypot(of_b));
            }
        }
    }

    pub fn together(mut self, mut other: Self) -> Self {
        self.apart_m.append(&mut other.apart_m);
        Self {
            translation: self.translation.together(other.translation),
            rotation: self.rotation.together(other.rotation),
            lens: self.lens.together(other.lens),
            point: self.point.together(other.point),
            silent: self.silent.together(other.silent),
            apart_m: self.apart_m,
        }
    }

    pub fn print(&mut self, name: &str, camera: &str) {
        self.apart_m.sort_by(f64::total_cmp);
        let median_m = self.apart_m.get(self.apart_m.len() / 2).copied().unwrap_or(f64::NAN);
        println!(
            "| {name} | {camera} | {} | {} | {} | {} | {:.3} | {} |",
            self.translation.percent(),
            self.rotation.percent(),
            self.lens.percent(),
            self.point.percent(),
            median_m * 1e3,
            self.silent.percent(),
        );
    }
}

/// By how much two answers differ, `log(A⁻¹ B)`, and a point where the first saw the target.
fn difference(a: &Calibration, b: &Calibration) -> Option<(Vector6<f64>, nalgebra::Point3<f64>)> {
    let of = |calibration: &Calibration| Some(calibration.hand_eye.as_ref()?.mount_from_camera());
    Some((se3::log((of(a)?.inverse() * of(b)?).isometry()), a.joint.as_ref()?.reference_point))
}

/// A number of the lens that was estimated, and its standard deviation.
fn lens(calibration: &Calibration, k: usize) -> Option<(f64, f64)> {
    /// Index of the lens among the unknowns of the covariance.
    const LENS_AT: usize = 12;
    let joint = calibration.joint.as_ref().filter(|joint| joint.free.intrinsics)?;
    Some((calibration.intrinsics()?.parameters()[k], joint.covariance[(LENS_AT + k, LENS_AT + k)].sqrt()))
}

/// Head of the table.
pub fn header() {
    println!(
        "| set | camera | translation % | rotation % | fx, fy, cx, cy % | point % | apart, mm | nothing stated % |"
    );
    println!("|---|---|---|---|---|---|---|---|");
}

/// Random divisions of a set; the combined result with the lens as given and with an estimated one.
pub fn run(set: &Set, splits: usize) -> Agreement {
    let mut of_all = Agreement::default();
    for (camera, given) in [("given", true), ("estimated", false)] {
        if !set.has_corners() || !given && set.views.len() < MANY {
            continue;
        }
        let mut rng = ChaCha8Rng::seed_from_u64(100);
        let mut order: Vec<usize> = (0..set.views.len()).collect();
        let mut agreement = Agreement::default();
        for _ in 0..splits {
            order.shuffle(&mut rng);
            let (a, b) = order.split_at(order.len() / 2);
            agreement.add(&[a, b].map(|half| calibrated(set, half, given)));
        }
        agreement.print(&set.name, camera);
        of_all = of_all.together(agreement);
    }
    of_all
}

/// A half, in the order in which it was captured.
fn calibrated(set: &Set, half: &[usize], given: bool) -> Option<Calibration> {
    let mut half = half.to_vec();
    half.sort_unstable();
    let camera = if given { CameraKnowledge::Fixed(set.intrinsics) } else { CameraKnowledge::NOTHING };
    let observations = Observations {
        mode: Some(set.mode),
        target: set.target,
        image_size: set.image_size,
        camera,
        views: half.iter().map(|view| ObservedView::from(&set.views[*view])).collect(),
    };
    calibrate(&observations, Method::Joint, &CancelToken::default()).ok()
}
