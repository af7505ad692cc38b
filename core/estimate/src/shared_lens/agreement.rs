//! Whether sessions have one lens, by the lens of each alone.
//!
//! The lens `ℓ_i` of a session alone and `ℓ_o` of all others together are independent, so `(ℓ_i − ℓ_o)ᵀ (C_i + C_o)⁻¹
//! (ℓ_i − ℓ_o)` of `k` lens parameters follows chi-square with `k` degrees of freedom; with covariances from estimated noise
//! levels `k F(k, ν)`, with the degrees of freedom of the session (of its hand-eye transform, which has fewer than the lens,
//! so that the false alarms are at most as many as stated). The session that differs most is judged first, at a level that
//! counts for the number of sessions; where it is another lens the rest are judged without it.

use statrs::distribution::{ContinuousCDF as _, FisherSnedecor};

use super::found::OddSession;
use super::{NamedSession, Refit};
use crate::handeye::joint::normal::covariance_of;
use crate::handeye::joint::shared_lens::{Fitted, LensEstimate, difference};

/// Sets of sessions of one lens that are taken for sessions of several.
const FALSE_ALARM: f64 = 1e-3;
/// Degrees of freedom that are practically infinite.
const MANY: f64 = 1e6;

/// How the lenses of all sessions, each alone, agree with each other.
pub(super) struct Agreement {
    /// Probability of a difference as large as the largest if the lens is one.
    pub p_value: f64,
    /// Sessions with another lens, in their order; empty where the lens is one.
    pub odd: Vec<OddSession>,
}

/// How a session differs from others.
struct Differs {
    session: usize,
    /// `T²/k`
    ratio: f64,
    p_value: f64,
    odd: OddSession,
}

/// Judges sessions by their fits without each other; `None` when a lens is not determined.
pub(super) fn test(sessions: &[NamedSession<'_>], alone: &[Fitted<Refit>]) -> Option<Agreement> {
    let mut rest: Vec<usize> = (0..alone.len()).collect();
    let (mut p_value, mut odd) = (None, Vec::new());
    while rest.len() > 1 {
        let mut differ = Vec::with_capacity(rest.len());
        for &session in &rest {
            differ.push(differs(sessions, alone, session, &rest)?);
        }
        differ.sort_by(|a, b| b.ratio.total_cmp(&a.ratio));
        // Of two, either differs from the other as much: one comparison, and it is not known which of them it is.
        let (comparisons, out) = if rest.len() > 2 { (rest.len(), 1) } else { (1, 2) };
        let worst = (differ[0].p_value * comparisons as f64).min(1.0);
        p_value.get_or_insert(worst);
        if worst >= FALSE_ALARM {
            break;
        }
        differ.truncate(out);
        rest.retain(|session| differ.iter().all(|it| it.session != *session));
        odd.extend(differ);
    }
    odd.sort_by_key(|it: &Differs| it.session);
    Some(Agreement { p_value: p_value.unwrap_or(1.0), odd: odd.into_iter().map(|it| it.odd).collect() })
}

/// How a session differs from the others in `rest`.
fn differs(sessions: &[NamedSession<'_>], alone: &[Fitted<Refit>], session: usize, rest: &[usize]) -> Option<Differs> {
    let own = LensEstimate::by([&alone[session].says])?;
    let others = LensEstimate::by(rest.iter().filter(|other| **other != session).map(|other| &alone[*other].says))?;
    let covariance = own.covariance()? + others.covariance()?;
    let information = covariance_of(&covariance)?;
    let off = difference(&own.intrinsics, &others.intrinsics);
    let count = off.len() as f64;
    let ratio = off.dot(&(&information * &off)) / count;
    let freedom = alone[session].fit.refined.screened.solution.small_sample.degrees_of_freedom.min(MANY);
    // Both numbers are positive, so the distribution exists; without it no session is called odd.
    let p_value = FisherSnedecor::new(count, freedom).map_or(1.0, |law| law.sf(ratio));
    let odd = OddSession {
        name: sessions[session].name.to_owned(),
        focal_px: own.intrinsics.fx,
        others_focal_px: others.intrinsics.fx,
        sigma_px: covariance[(0, 0)].max(0.0).sqrt(),
        centre_apart_px: (own.intrinsics.cx - others.intrinsics.cx).hypot(own.intrinsics.cy - others.intrinsics.cy),
    };
    Some(Differs { session, ratio, p_value, odd })
}
