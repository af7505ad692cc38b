//! Whether guided capture touches anything: sessions among random boxes, on three arms, with the camera on the arm and next
//! to it (eye to hand), judged by points on the surfaces of everything that moves.
//!
//! ```text
//! cargo run --release -p handeye_studies --example guided_safety -- 2000
//! ```
//!
//! The second row is the same with a lens that has to be estimated, so that less is known at the beginning. The third one is
//! the first with boxes unknown to the planner: what the check reports when something is touched.

#![expect(clippy::expect_used, clippy::print_stdout, reason = "a study prints, and stops at what cannot be")]

use std::env;

use handeye_estimate::handeye::Mode;
use handeye_plan::testing::clutter::{Tally, session};
use handeye_plan::testing::guided_cell::{CellArm, CellSetup};
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};

/// Views of a session.
const VIEWS: usize = 16;
/// Sessions that are run before the moves are counted again.
const BATCH: u64 = 12;

fn main() {
    let moves: usize = env::args().nth(1).map_or(2000, |n| n.parse().expect("a number of moves"));
    row("boxes known", moves, true, false);
    row("boxes known, lens not", moves, true, true);
    row("boxes unknown", moves / 10, false, false);
}

fn row(name: &str, moves: usize, is_known: bool, free_lens: bool) {
    let mut tally = Tally::default();
    let mut next = 0;
    while tally.moves < moves {
        let batch: Vec<u64> = (next..next + BATCH).collect();
        next += BATCH;
        let of_batch: Vec<Tally> =
            batch.into_par_iter().map(|seed| session(setup(seed, free_lens), VIEWS, is_known)).collect();
        tally = of_batch.into_iter().fold(tally, Tally::and);
    }
    let Tally { sessions, moves, contacts, self_contacts, out_of_range, too_fast, cut, nearest_m } = tally;
    println!(
        "{name}: {moves} moves in {sessions} sessions, contacts {contacts}, with itself {self_contacts}, joints out of range \
         {out_of_range}, too fast {too_fast}, board cut {cut}, nearest {:.1} mm",
        nearest_m * 1e3
    );
}

fn setup(seed: u64, free_lens: bool) -> CellSetup {
    let arm = CellArm::ALL[(seed % 3) as usize];
    let mode = if (seed / 3).is_multiple_of(2) { Mode::EyeInHand } else { Mode::EyeToHand };
    CellSetup { free_lens, ..CellSetup::new(arm, mode, seed) }
}
