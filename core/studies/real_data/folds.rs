//! Held-out error of every method over five folds.

use handeye_core::estimate::uncertainty::quality;
use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;

use crate::methods::{Answer, Choice, OURS, names};
use crate::sets::Set;

const FOLDS: usize = 5;

/// Errors of one method: per division and view, squared pixels (mean over the corners) and squared metres.
struct Errors {
    name: &'static str,
    by_division: Vec<Vec<(f64, f64)>>,
}

impl Errors {
    fn rms(&self, division: usize) -> (f64, f64) {
        let views = &self.by_division[division];
        let (px, m) = views.iter().fold((0.0, 0.0), |(a, b), (px, m)| (a + px, b + m));
        ((px / views.len() as f64).sqrt(), (m / views.len() as f64).sqrt())
    }

    /// Mean over the divisions of the squared errors of one view.
    fn of_view(&self, view: usize) -> (f64, f64) {
        let n = self.by_division.len() as f64;
        self.by_division.iter().map(|d| d[view]).fold((0.0, 0.0), |(a, b), (px, m)| (a + px / n, b + m / n))
    }

    /// By how many of its standard errors over the views the squared error is above that of `other`, px and metres.
    fn against(&self, other: &Self) -> (f64, f64) {
        let views = self.by_division[0].len();
        let z = |pick: &dyn Fn((f64, f64)) -> f64| {
            let differences: Vec<f64> = (0..views).map(|v| pick(self.of_view(v)) - pick(other.of_view(v))).collect();
            let mean = differences.iter().sum::<f64>() / views as f64;
            let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (views as f64 - 1.0);
            mean / (variance / views as f64).sqrt().max(f64::MIN_POSITIVE)
        };
        (z(&|(px, _)| px), z(&|(_, m)| m))
    }
}

/// Fold of every view: `i mod 5` first, then random ones.
fn divisions(count: usize, random: usize) -> Vec<Vec<usize>> {
    let fixed: Vec<usize> = (0..count).map(|i| i % FOLDS).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut all = vec![fixed.clone()];
    for _ in 0..random {
        let mut shuffled = fixed.clone();
        shuffled.shuffle(&mut rng);
        all.push(shuffled);
    }
    all
}

pub fn run(set: &Set, random: usize) {
    let count = set.pairs.len();
    let mut errors = Vec::new();
    for name in names(set) {
        let by_division: Option<Vec<_>> =
            divisions(count, random).iter().map(|folds| division(set, name, folds)).collect();
        match by_division {
            Some(by_division) => errors.push(Errors { name, by_division }),
            None => println!("{}: {name} has no answer in some fold", set.name),
        }
    }
    println!("\n### {} ({count} views, {random} random divisions)\n", set.name);
    println!("| method | i mod 5: px | mm | random: px | mm | above joint by standard errors: px | mm |");
    println!("|---|---|---|---|---|---|---|");
    let Some(ours) = errors.iter().find(|e| e.name == OURS) else { return };
    for method in &errors {
        let (px, m) = method.rms(0);
        let random: Vec<(f64, f64)> = (1..method.by_division.len()).map(|d| method.rms(d)).collect();
        let (rpx, rm) = mean(&random);
        let (zpx, zm) = method.against(ours);
        let relative = if method.name == OURS { "| |".to_owned() } else { format!("| {zpx:+.1} | {zm:+.1} |") };
        println!("| {} | {px:.3} | {:.4} | {rpx:.3} | {:.4} {relative}", method.name, m * 1e3, rm * 1e3);
    }
}

fn mean(values: &[(f64, f64)]) -> (f64, f64) {
    let n = values.len().max(1) as f64;
    values.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n))
}

/// Errors of every view, each from the fit without its fold.
fn division(set: &Set, name: &str, folds: &[usize]) -> Option<Vec<(f64, f64)>> {
    let mut errors = vec![(0.0, 0.0); folds.len()];
    for fold in 0..FOLDS {
        let used: Vec<usize> = (0..folds.len()).filter(|&i| folds[i] != fold).collect();
        let answer = Choice::new(set, &used).solve(set, name)?;
        for held in (0..folds.len()).filter(|&i| folds[i] == fold) {
            errors[held] = (squared_px(set, &answer, held)?, board_error_m(set, &answer, held)?.powi(2));
        }
    }
    Some(errors)
}

/// Mean over the corners of the squared 2-D residual, predicted from the reported robot pose. Zero without corners.
fn squared_px(set: &Set, answer: &Answer, view: usize) -> Option<f64> {
    let Some(corners) = set.views.get(view).map(|v| &v.corners) else { return Some(0.0) };
    let anchor_from_mount = answer.anchor_from_mount(set, view);
    let chain = answer.mount_from_camera.inverse() * anchor_from_mount.inverse() * answer.anchor_from_target;
    let squared: Option<f64> = corners
        .iter()
        .map(|c| {
            let px = answer.intrinsics.project(&(chain.isometry() * set.board.point(c.index, &answer.shape))).ok()?;
            Some((px - c.px).norm_squared())
        })
        .sum();
    squared.map(|s| s / corners.len() as f64)
}

/// With the target's pose from the corners of the view alone, by the camera and the target of the answer.
fn board_error_m(set: &Set, answer: &Answer, view: usize) -> Option<f64> {
    let pair = &set.pairs[view];
    let mut camera_from_target = pair.camera_from_target;
    if let Some(view) = set.views.get(view) {
        let (board, start) = (&set.board, &camera_from_target);
        camera_from_target = quality::pose_of_view(&answer.intrinsics, board, &answer.shape, &view.corners, start)?;
    }
    Some(quality::board_error_m(
        &answer.anchor_from_mount(set, view),
        &answer.mount_from_camera,
        &camera_from_target,
        &answer.anchor_from_target,
        &(set.centre * answer.shape.scale),
    ))
}
