use nalgebra::Vector6;

use super::*;
use crate::handeye::Mode;
use crate::handeye::joint::chain::correction_transform;
use crate::handeye::joint::{Noise, camera_from_target, fit};
use crate::test_sessions::Estimated as _;
use handeye_geometry::camera::Distortion;
use handeye_geometry::frames::{Anchor, Camera, Mount, Pose, Target};
use handeye_geometry::se3;
use handeye_simulate::session::{REALISTIC, Session, camera, trial};

const LENS: usize = 9;

/// Sessions of one camera: both set-ups, unequal numbers of views and unequal noise.
fn sessions() -> Vec<(Session, Noise)> {
    let intrinsics = Intrinsics { distortion: Distortion::BrownConrady([-0.1, 0.05, 1e-3, -5e-4, 0.0]), ..camera() };
    let noises = [REALISTIC, Noise { corner_px: 0.2, ..REALISTIC }, Noise { robot_m: 5e-4, ..REALISTIC }];
    let modes = [(Mode::EyeInHand, 7), (Mode::EyeToHand, 6), (Mode::EyeInHand, 5)];
    let session = |(((mode, views), noise), seed)| (trial(mode, views, &noise, intrinsics, seed), noise);
    modes.into_iter().zip(noises).zip(31..).map(session).collect()
}

fn fitted(
    session: &(Session, Noise),
    solution: Option<&JointSolution>,
    lens_prior: Option<LensPrior<'_>>,
) -> Result<Fitted<JointSolution>, HandEyeError> {
    let (trial, noise) = session;
    let cancel = CancelToken::default();
    let problem = JointProblem { lens_prior, ..trial.problem(true, Some(*noise)) };
    let start = solution.map_or_else(|| trial.start(), JointSolution::as_start);
    let fit = fit(&problem, &start, &cancel)?;
    let says = LensInformation::of(&problem, &fit, &cancel)?;
    Ok(Fitted { fit, says })
}

/// All unknowns of all sessions, with nothing eliminated and every derivative a difference.
#[derive(Clone)]
struct Dense<'a> {
    sessions: &'a [(Session, Noise)],
    lens: Intrinsics,
    links: Vec<(Pose<Mount, Camera>, Pose<Anchor, Target>)>,
    corrections: Vec<Vec<Vector6<f64>>>,
}

impl<'a> Dense<'a> {
    fn at_truth(sessions: &'a [(Session, Noise)]) -> Self {
        let links = sessions.iter().map(|(t, _)| (t.mount_from_camera, t.anchor_from_target)).collect();
        let corrections = sessions.iter().map(|(t, _)| vec![Vector6::zeros(); t.views.len()]).collect();
        Self { sessions, lens: sessions[0].0.intrinsics, links, corrections }
    }

    fn count(&self) -> usize {
        LENS + self.corrections.iter().map(|of| 12 + 6 * of.len()).sum::<usize>()
    }

    /// First unknown of a session.
    fn first(&self, session: usize) -> usize {
        LENS + self.corrections[..session].iter().map(|of| 12 + 6 * of.len()).sum::<usize>()
    }

    fn stepped(&self, step: &DVector<f64>) -> Self {
        let mut next = self.clone();
        let parameters: Vec<f64> = self.lens.parameters().iter().zip(step.iter()).map(|(p, s)| p + s).collect();
        next.lens = self.lens.with_parameters(&parameters);
        for j in 0..self.sessions.len() {
            let at = self.first(j);
            let six = |k: usize| step.fixed_rows::<6>(k).into_owned();
            let (camera, target) = self.links[j];
            next.links[j] = (camera.perturbed(&six(at)), target.perturbed(&six(at + 6)));
            for (i, correction) in next.corrections[j].iter_mut().enumerate() {
                *correction += six(at + 12 + 6 * i);
            }
        }
        next
    }

    /// In standard deviations.
    fn residuals(&self) -> DVector<f64> {
        let mut all = Vec::new();
        for (j, (trial, noise)) in self.sessions.iter().enumerate() {
            for (view, correction) in trial.views.iter().zip(&self.corrections[j]) {
                let tip = Pose::from_isometry(view.base_from_tip.isometry() * correction_transform(correction));
                let chain = camera_from_target(trial.mode, &tip, &self.links[j].0, &self.links[j].1);
                for corner in &view.corners {
                    let px = self.lens.project(&(chain.isometry() * trial.points[corner.index])).expect("in front");
                    all.extend([(px.x - corner.px.x) / noise.corner_px, (px.y - corner.px.y) / noise.corner_px]);
                }
                let level = |k: usize| if k < 3 { noise.robot_m } else { noise.robot_rad };
                all.extend((0..6).map(|k| correction[k] / level(k)));
            }
        }
        DVector::from_vec(all)
    }

    fn jacobian(&self) -> DMatrix<f64> {
        let columns: Vec<DVector<f64>> = (0..self.count())
            .map(|k| {
                let mut step = DVector::zeros(self.count());
                let h = if k < 4 { 1e-3 } else { 1e-6 };
                step[k] = h;
                (self.stepped(&step).residuals() - self.stepped(&-step).residuals()) / (2.0 * h)
            })
            .collect();
        DMatrix::from_columns(&columns)
    }

    /// The optimum and the covariance of all unknowns there.
    fn solved(mut self) -> (Self, DMatrix<f64>) {
        const STEPS: usize = 6;
        let mut covariance = DMatrix::zeros(0, 0);
        for _ in 0..STEPS {
            let jacobian = self.jacobian();
            covariance = covariance_of(&jacobian.tr_mul(&jacobian)).expect("determined");
            self = self.stepped(&-(&covariance * jacobian.tr_mul(&self.residuals())));
        }
        (self, covariance)
    }
}

#[test]
fn the_rounds_end_at_the_optimum_of_all_unknowns_together_with_its_covariance() {
    let sessions = sessions();
    let alone = sessions.iter().map(|session| fitted(session, None, None).expect("solves")).collect();
    let (shared, lens) = share(alone, 0, |i, _, last: &JointSolution, others: LensEstimate| {
        fitted(&sessions[i], Some(last), Some(others.as_prior()))
    })
    .expect("solves")
    .expect("one lens");
    let (dense, covariance) = Dense::at_truth(&sessions).solved();
    // Rounds end at a thousandth of a standard deviation; the last one brings it far below.
    let of_lens = covariance.view((0, 0), (LENS, LENS)).into_owned();
    let information = covariance_of(&of_lens).expect("determined");
    let off = difference(&lens.intrinsics, &dense.lens);
    let sigmas = off.dot(&(&information * &off)).sqrt();
    println!("lens {sigmas:.1e} standard deviations from the dense optimum");
    assert!(sigmas < TOLERANCE, "{sigmas}");
    for (j, session) in shared.iter().enumerate() {
        let at = dense.first(j);
        let expected = covariance.fixed_view::<6, 6>(at, at).into_owned();
        let inverse = expected.try_inverse().expect("regular");
        let ours = session.fit.hand_eye.mount_from_camera();
        let off = se3::log((dense.links[j].0.inverse() * ours).isometry());
        let sigmas = off.dot(&(inverse * off)).sqrt();
        let stated = (inverse * session.fit.hand_eye_covariance()).symmetric_part().symmetric_eigenvalues();
        println!("session {j}: {sigmas:.1e} standard deviations, variances over the dense ones {stated:?}");
        assert!(sigmas < TOLERANCE, "session {j}: {sigmas}");
        let ratio = session.fit.hand_eye_covariance().component_div(&expected);
        // Differences are good to a millionth; far from the diagonal a small number is the difference of large ones.
        assert!(ratio.diagonal().iter().all(|r| (r - 1.0).abs() < 1e-3), "session {j}: {ratio}");
        let theirs = session.fit.covariance.view((12, 12), (LENS, LENS)).into_owned();
        let ratio = theirs.component_div(&of_lens).diagonal();
        assert!(ratio.iter().all(|r| (r - 1.0).abs() < 1e-3), "session {j}: {ratio}");
    }
}

#[test]
fn what_a_session_says_of_its_lens_is_without_what_the_prior_adds() {
    let sessions = sessions();
    let (session, noise) = &sessions[0];
    let alone = fitted(&sessions[0], None, None).expect("solves");
    let other = LensEstimate::by([&fitted(&sessions[1], None, None).expect("solves").says]).expect("determined");
    // So strong that subtracting it again would leave nothing but rounding.
    let strong = other.clone().times(1e9);
    let problem = JointProblem { lens_prior: Some(strong.as_prior()), ..session.problem(true, Some(*noise)) };
    let says = LensInformation::of(&problem, &alone.fit, &CancelToken::default()).expect("determined");
    let with = LensEstimate::by([&says]).expect("determined");
    let without = LensEstimate::by([&alone.says]).expect("determined");
    // The same within the rounding of inverting a matrix twice: scaled, its condition is below 1e8 of 1e16.
    assert!(without.distance(&with.intrinsics) < 1e-5, "{}", without.distance(&with.intrinsics));
    let ratio = with.information.diagonal().component_div(&without.information.diagonal());
    assert!(ratio.iter().all(|r| (r - 1.0).abs() < 1e-6), "{ratio}");
    // And a fit with the prior lies between both.
    let shared = fitted(&sessions[0], Some(&alone.fit), Some(other.as_prior())).expect("solves");
    let (moved, way) = (without.distance(&shared.fit.intrinsics), without.distance(&other.intrinsics));
    assert!(moved > 0.1 && moved < way, "{moved} of {way}");
}

#[test]
fn a_widened_session_counts_for_less_by_as_much() {
    let sessions = sessions();
    let says: Vec<LensInformation> =
        sessions.iter().map(|session| fitted(session, None, None).expect("solves").says).collect();
    let [a, b, _] = says.as_slice() else { panic!("three sessions") };
    let by = |all: &[&LensInformation]| LensEstimate::by(all.iter().copied()).expect("determined");
    let widened = a.clone().widened(4.0);
    let together = by(&[&widened, b]);
    let expected = by(&[a]).information / 4.0 + by(&[b]).information;
    assert!((&together.information - &expected).norm() < 1e-12 * expected.norm());
    let to_b = |lens: &LensEstimate| by(&[b]).distance(&lens.intrinsics);
    assert!(to_b(&together) < to_b(&by(&[a, b])), "the mean moves to the one that counts for more");
}
