//! `zmqRemoteApi.*`: what a client asks first.

use super::{Call, Outcome, Table, nothing};
use crate::cell::server::task::Answer;

pub(super) const FUNCTIONS: Table = &[("require", require), ("info", info)];

/// Everything is loaded already; whether the name exists is for `info`, which every client calls next.
fn require(call: &mut Call<'_>) -> Outcome {
    call.args.text(0)?;
    nothing()
}

fn info(call: &mut Call<'_>) -> Outcome {
    Ok(Answer::Info(call.args.text(0)?.to_owned()))
}
