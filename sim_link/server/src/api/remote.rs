//! `zmqRemoteApi.*`: what a client asks first.

use super::{Call, Outcome, Table};
use crate::task::Answer;

pub(super) const FUNCTIONS: Table = &[("require", require), ("info", info)];

/// Everything is loaded already.
fn require(call: &mut Call<'_>) -> Outcome {
    Ok(Answer::Require(call.args.text(0)?.to_owned()))
}

fn info(call: &mut Call<'_>) -> Outcome {
    Ok(Answer::Info(call.args.text(0)?.to_owned()))
}
