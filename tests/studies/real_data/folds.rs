//! Held-out error of every method over five folds, with scattered views and with neighbours.

use handeye_estimate::uncertainty::quality;
use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;

use crate::blocks;
use crate::methods::{Answer, Choice, FIELD, OURS, names};
use crate::sets::Set;

const FOLDS: usize = 5;

/// Errors of every view in one division: squared pixels (mean over the corners) and squared metres.
type ByView = Vec<(f64, f64)>;

/// Errors of one method.
struct Errors {
    name: &'static str,
    /// `i mod 5` first, then the random divisions.
    scattered: Vec<ByView>,
    /// Folds of neighbours, if the method has an answer without each of them.
    blocked: Option<ByView>,
}

impl Errors {
    /// By how many of its standard errors over the views the squared error is above that of `other`, px and metres.
    fn against(&self, other: &Self) -> (f64, f64) {
        above(&over_divisions(&self.scattered), &over_divisions(&other.scattered))
    }

    fn blocked_against(&self, other: &Self) -> Option<(f64, f64)> {
        Some(above(self.blocked.as_ref()?, other.blocked.as_ref()?))
    }
}

fn rms(views: &ByView) -> (f64, f64) {
    let (px, m) = mean(views);
    (px.sqrt(), m.sqrt())
}

/// Mean over the divisions of the squared errors of every view.
fn over_divisions(divisions: &[ByView]) -> ByView {
    let of_view = |view: usize| mean(&divisions.iter().map(|d| d[view]).collect::<Vec<_>>());
    (0..divisions[0].len()).map(of_view).collect()
}

fn above(these: &ByView, others: &ByView) -> (f64, f64) {
    let z = |pick: fn((f64, f64)) -> f64| {
        let views = these.len() as f64;
        let differences: Vec<f64> = these.iter().zip(others).map(|(a, b)| pick(*a) - pick(*b)).collect();
        let mean = differences.iter().sum::<f64>() / views;
        let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (views - 1.0);
        mean / (variance / views).sqrt().max(f64::MIN_POSITIVE)
    };
    (z(|(px, _)| px), z(|(_, m)| m))
}

/// Fold of every view: `i mod 5` first, then random ones.
fn scattered(count: usize, random: usize) -> Vec<Vec<usize>> {
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
    let blocks = blocks::folds(set, FOLDS);
    let mut errors = Vec::new();
    for name in names(set) {
        let scattered: Option<Vec<_>> =
            scattered(count, random).iter().map(|folds| division(set, name, folds)).collect();
        match scattered {
            Some(scattered) => errors.push(Errors { name, scattered, blocked: division(set, name, &blocks) }),
            None => println!("{}: {name} has no answer in some fold", set.name),
        }
    }
    println!("\n### {} ({count} views, {random} random divisions)\n", set.name);
    println!(
        "| method | i mod 5: px | mm | random: px | mm | above joint by standard errors: px | mm | blocks: px | mm | above joint by \
         standard errors: px | mm |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    let Some(ours) = errors.iter().find(|e| e.name == OURS) else { return };
    for method in &errors {
        let (fixed, random) = (&method.scattered[0], &method.scattered[1..]);
        let other = method.name != OURS;
        let cells = [
            error_cells(set, Some(rms(fixed))),
            error_cells(set, Some(mean(&random.iter().map(rms).collect::<Vec<_>>()))),
            relative_cells(set, other.then(|| method.against(ours))),
            error_cells(set, method.blocked.as_ref().map(rms)),
            relative_cells(set, method.blocked_against(ours).filter(|_| other)),
        ];
        println!("| {} {}|", method.name, cells.concat());
    }
    for reference in [OURS, FIELD] {
        let Some(reference) = errors.iter().find(|e| e.name == reference) else { continue };
        let better: Vec<String> = errors.iter().filter_map(|method| where_better(set, method, reference)).collect();
        let better = if better.is_empty() { "nothing".to_owned() } else { better.join("; ") };
        println!("\nBelow `{}` by more than two standard errors: {better}.", reference.name);
    }
}

/// In which columns a method is better than another by more than two standard errors, in words.
fn where_better(set: &Set, method: &Errors, reference: &Errors) -> Option<String> {
    let scattered = method.against(reference);
    let blocked = method.blocked_against(reference).unwrap_or_default();
    let of = [("px", scattered.0), ("mm", scattered.1), ("px in blocks", blocked.0), ("mm in blocks", blocked.1)];
    let shown: Vec<String> = of
        .iter()
        .filter(|(name, z)| *z < -2.0 && (set.has_corners() || name.starts_with("mm")))
        .map(|(name, z)| format!("{name} ({z:.1})"))
        .collect();
    (!shown.is_empty()).then(|| format!("{} in {}", method.name, shown.join(", ")))
}

/// Without corners there are no pixels.
fn error_cells(set: &Set, errors: Option<(f64, f64)>) -> String {
    match errors {
        Some((px, m)) if set.has_corners() => format!("| {px:.3} | {:.4} ", m * 1e3),
        Some((_, m)) => format!("| | {:.4} ", m * 1e3),
        None => "| no answer | ".to_owned(),
    }
}

fn relative_cells(set: &Set, by: Option<(f64, f64)>) -> String {
    match by {
        Some((px, m)) if set.has_corners() => format!("| {px:+.1} | {m:+.1} "),
        Some((_, m)) => format!("| | {m:+.1} "),
        None => "| | ".to_owned(),
    }
}

fn mean(values: &[(f64, f64)]) -> (f64, f64) {
    let n = values.len().max(1) as f64;
    values.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n))
}

/// Errors of every view, each from the fit without its fold.
fn division(set: &Set, name: &str, folds: &[usize]) -> Option<ByView> {
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

/// With the target's pose from the corners of the view alone, with the camera and the target of the answer.
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
