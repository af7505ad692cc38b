use nalgebra::Vector6;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::handeye::Mode;
use crate::handeye::joint::{Noise, with_stated_error};
use crate::test_sessions::Estimated as _;
use handeye_geometry::testing::{BOARD, GRID};
use handeye_simulate::links::normal;
use handeye_simulate::session::{REALISTIC, Session, camera, trial};

/// Corners that are good and a robot that is nearly exact: what is left is the print.
const EXACT_ROBOT: Noise = Noise { corner_px: 0.05, robot_m: 1e-6, robot_rad: 1e-6, ..Noise::EXACT };

/// The errors of a print.
#[derive(Debug, Clone, Copy)]
enum Print {
    /// As drawn.
    Exact,
    /// Every point independently, RMS per axis, metres.
    Single(f64),
    /// Lines on the pixels of a bitmap of that size, metres.
    Bitmap(f64),
    /// Three waves over the target along each axis, each with this amplitude, metres.
    Waves(f64),
}

impl Print {
    fn errors_m(self, seed: u64) -> Vec<Vector2<f64>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0xb0a4d);
        let points = BOARD.points();
        match self {
            Self::Exact => vec![Vector2::zeros(); points.len()],
            Self::Single(m) => points.iter().map(|_| Vector2::new(normal(&mut rng), normal(&mut rng)) * m).collect(),
            Self::Bitmap(pixel_m) => {
                let offset = [0.5 * pixel_m * normal(&mut rng), 0.5 * pixel_m * normal(&mut rng)];
                let on_pixel =
                    |value: f64, offset: f64| ((value + offset) / pixel_m).round() * pixel_m - offset - value;
                points.iter().map(|p| Vector2::new(on_pixel(p.x, offset[0]), on_pixel(p.y, offset[1]))).collect()
            }
            Self::Waves(amplitude_m) => {
                let long = GRID.square_m * GRID.columns as f64;
                let waves: Vec<[f64; 4]> = (0..6).map(|_| std::array::from_fn(|_| normal(&mut rng))).collect();
                let of = |p: &Point3<f64>, waves: &[[f64; 4]]| -> f64 {
                    let wave = |w: &[f64; 4]| (3.0 * (w[0] * p.x + w[1] * p.y) / long + 3.0 * w[2]).sin();
                    waves.iter().map(|w| wave(w) * amplitude_m).sum()
                };
                points.iter().map(|p| Vector2::new(of(p, &waves[..3]), of(p, &waves[3..]))).collect()
            }
        }
    }
}

fn session(views: usize, noise: &Noise, print: Print, seed: u64) -> Session {
    let mut session = trial(Mode::EyeInHand, views, noise, camera(), seed);
    session.add_print_errors(&print.errors_m(seed));
    session
}

/// The answer with print errors where they are shown, and with the error that may be stated.
fn solved(session: &Session) -> (Option<PrintErrors>, JointSolution, JointSolution) {
    let cancel = CancelToken::default();
    let problem = session.problem(true, None);
    let without = fit(&problem, &session.start(), &cancel).expect("solves");
    let plain = with_stated_error(&problem, without.clone(), &cancel).expect("solves");
    let Some((mut print, solution)) = with_shown_print(&problem, &without, &cancel).expect("not cancelled") else {
        return (None, plain.clone(), plain);
    };
    let board = print.on(problem.board);
    let problem = JointProblem { board: &board, ..problem };
    let solution = with_stated_error(&problem, solution, &cancel).expect("solves");
    let (solution, sigma_m) = with_its_error(&problem, solution, &print, &cancel).expect("solves");
    print.sigma_m = sigma_m;
    (Some(print), solution, plain)
}

fn squared_distance(session: &Session, solution: &JointSolution) -> f64 {
    let error: Vector6<f64> = session.hand_eye_error(solution);
    error.dot(&(solution.hand_eye_covariance().try_inverse().expect("regular") * error))
}

/// The errors without rigid motions, which are not errors of the print.
fn without_rigid(errors: &[Vector2<f64>]) -> DVector<f64> {
    let n = errors.len();
    let all = DVector::from_fn(2 * n, |i, _| errors[i % n][i / n]);
    let rigid = rigid(&BOARD.points());
    &all - &rigid * rigid.tr_mul(&all)
}

#[test]
fn errors_of_a_print_are_found_and_what_they_do_to_the_answer_is_counted() {
    let exact = [Print::Single(3e-5), Print::Bitmap(1.94e-4), Print::Waves(3e-5)].map(|print| (EXACT_ROBOT, print));
    let real = [(REALISTIC, Print::Single(1e-4))];
    let trials = 20;
    for (noise, print) in exact.into_iter().chain(real) {
        let (mut found, mut with, mut plain, mut off, mut of) = (0, 0.0, 0.0, 0.0, 0.0);
        for seed in 7100..7100 + trials {
            let session = session(12, &noise, print, seed);
            let (shown, solution, before) = solved(&session);
            with += squared_distance(&session, &solution);
            plain += squared_distance(&session, &before);
            let Some(shown) = shown else { continue };
            found += 1;
            let truth = without_rigid(&print.errors_m(seed));
            off += (without_rigid(&shown.errors_m) - &truth).norm_squared();
            of += truth.norm_squared();
        }
        let (with, plain, left) = (with / trials as f64, plain / trials as f64, f64::sqrt(off / of));
        println!(
            "robot {:.4} mm, {print:?}: found in {found} of {trials}, squared Mahalanobis distance {with:.2} of 6 ({plain:.1} \
             without), error left {left:.3} of the print's",
            noise.robot_m * 1e3
        );
        assert_eq!(found, trials);
        // With a true covariance it is 6 or less; 20 of them scatter by sqrt(12 / 20) = 0.8.
        assert!(with < 8.5, "{print:?}: {with}");
        assert!(plain > 1.3 * with, "{print:?}: {plain} without, {with} with");
        assert!(left < 0.5, "{print:?}: {left}");
    }
}

#[test]
fn a_print_as_drawn_shows_nothing() {
    // At most one in a thousand by chance.
    let found = (0..60).filter(|seed| solved(&session(12, &REALISTIC, Print::Exact, 7300 + seed)).0.is_some());
    assert_eq!(found.count(), 0);
}
