//! A process that is killed while it works on a session: every change that was acknowledged is there afterwards, with
//! everything that can be undone and redone, and no copy is ever incomplete.

use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use handeye_dataset::Dataset;
use handeye_estimate::handeye::Mode;
use handeye_geometry::depth::DepthImage;
use handeye_geometry::frames::Pose;
use handeye_geometry::targets::{Grid, TargetSpec};
use handeye_session::{Capture, CaptureId, CaptureRecord, Document, Edit, History, Session, SessionMeta, Store};
use image::{Rgb, RgbImage};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// Marks the process of the test below as the one to be killed: the folder to work in, and the seed of its actions.
const VICTIM: &str = "HANDEYE_TEST_SESSION_VICTIM";
const SEED: &str = "HANDEYE_TEST_SESSION_SEED";

/// The name by which the test runner knows the test below.
const THIS_TEST: &str = "slow::session_kill::a_kill_at_any_moment_loses_nothing_that_was_acknowledged";

const SESSIONS: u64 = 50;
/// How often the program that works on one session is killed. Each time it continues where the previous one ended.
const KILLS_PER_SESSION: u64 = 4;

fn meta() -> SessionMeta {
    SessionMeta {
        created: "2026-05-02T10:11:12Z".into(),
        tool_version: "test".into(),
        mode: Mode::EyeInHand,
        target: TargetSpec::Chessboard(Grid { columns: 10, rows: 7, square_m: 0.015 }),
        camera: None,
        seeds: [].into(),
        ground_truth: None,
        arm: None,
        joint_kinds: None,
        tool_m: None,
        robot_accuracy_mm: None,
    }
}

fn image(id: CaptureId) -> RgbImage {
    RgbImage::from_fn(64, 48, |x, y| Rgb([id.0 as u8, (x * 3) as u8, (x ^ y) as u8]))
}

fn depth(id: CaptureId) -> DepthImage {
    DepthImage::new(64, 48, vec![id.0 as f32 / 3.0; 64 * 48]).expect("as many as pixels")
}

fn base_from_tip(id: CaptureId) -> Pose<handeye_geometry::frames::Base, handeye_geometry::frames::Tip> {
    Pose::from_translation_xyzw([f64::from(id.0) / 3.0, 0.0, 0.0], [0.1, 0.2, 0.3, 0.9])
}

/// The document's record of a capture by [`act`].
fn record(id: CaptureId) -> CaptureRecord {
    CaptureRecord {
        depth: Some(format!("depth/{id:04}.tiff")),
        ..CaptureRecord::new(id, format!("images/{id:04}.png"), base_from_tip(id))
    }
}

#[derive(Debug, Clone)]
enum Action {
    Capture,
    Edit(Box<Edit>),
    Undo,
    Redo,
    SaveAs,
}

/// The next action; the same for the same seed and the same history.
fn choose(rng: &mut ChaCha8Rng, history: &History) -> Action {
    let captures = &history.document().captures;
    let mut some_capture = || captures.get(rng.random_range(0..captures.len().max(1)));
    let (one, two) = (some_capture().cloned(), some_capture().map(|c| c.id));
    match (rng.random_range(0..20), one) {
        (0..2, Some(one)) => {
            let mut ids = vec![one.id];
            ids.extend(two.filter(|two| *two != one.id));
            Action::Edit(Box::new(Edit::DeleteCaptures(ids)))
        }
        (2..5, Some(one)) => Action::Edit(Box::new(Edit::SetExcluded { ids: vec![one.id], excluded: !one.excluded })),
        (5..10, _) if history.undo_edit().is_some() => Action::Undo,
        (10..13, _) if history.redo_edit().is_some() => Action::Redo,
        (13..15, _) => Action::SaveAs,
        _ => Action::Capture,
    }
}

/// The effect of the action on the history; captures as [`act`] takes them.
fn model(history: &mut History, action: &Action) {
    match action {
        Action::Capture => {
            let id = history.next_capture_id().expect("few captures");
            history.apply(Edit::AddCapture(Box::new(record(id)))).expect("a capture");
        }
        Action::Edit(edit) => history.apply((**edit).clone()).expect("an edit"),
        Action::Undo => history.undo().expect("undo"),
        Action::Redo => history.redo().expect("redo"),
        Action::SaveAs => {}
    }
}

fn act(store: &mut Store, action: Action, copy: &Path) {
    match action {
        Action::Capture => {
            let id = store.history().next_capture_id().expect("few captures");
            let (image, depth) = (image(id), depth(id));
            let capture = Capture { depth_m: Some(&depth), ..Capture::new(&image, base_from_tip(id)) };
            assert_eq!(store.add_capture(&capture).expect("add"), id);
        }
        Action::Edit(edit) => store.apply(*edit).expect("edit"),
        Action::Undo => store.undo().expect("undo"),
        Action::Redo => store.redo().expect("redo"),
        Action::SaveAs => drop(store.save_as(copy).expect("save as")),
    }
}

/// Path of the copy after this many actions of a run.
fn copy_path(folder: &Path, seed: u64, actions: usize) -> PathBuf {
    folder.with_file_name(format!("copy-{seed}-{actions}"))
}

/// Works for ever and prints a line after every call that has returned.
fn work_until_killed(folder: &Path, seed: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut store = if Session::is_session(folder) { Store::open(folder) } else { Store::create(folder, meta()) }
        .expect("a session");
    println!("done: open");
    for actions in 0.. {
        let action = choose(&mut rng, store.history());
        act(&mut store, action, &copy_path(folder, seed, actions));
        println!("done: {actions}");
    }
}

/// What the kills hit.
#[derive(Debug, Default)]
struct Figures {
    kills: usize,
    /// Kills before the session existed.
    before_the_session: usize,
    /// Calls that had returned.
    acknowledged: usize,
    /// Kills of a change that was on the disk and not yet acknowledged.
    recorded_and_not_acknowledged: usize,
    /// Kills that left half a line in the journal.
    torn_journals: usize,
    /// Kills after which `session.json` lagged behind the journal.
    documents_behind: usize,
    copies: usize,
    /// Kills that left a copy under its hidden name.
    interrupted_copies: usize,
    images: usize,
}

#[test]
fn a_kill_at_any_moment_loses_nothing_that_was_acknowledged() {
    if let Some(folder) = std::env::var_os(VICTIM) {
        let seed = std::env::var(SEED).ok().and_then(|seed| seed.parse().ok()).expect("a seed");
        work_until_killed(Path::new(&folder), seed);
        return;
    }
    let begun = Instant::now();
    let mut figures = Figures::default();
    for session in 0..SESSIONS {
        let home = tempfile::tempdir().expect("a temporary folder");
        let folder = home.path().join("session");
        let mut known = History::new(Document::new(meta()));
        for kill in 0..KILLS_PER_SESSION {
            let seed = session * KILLS_PER_SESSION + kill;
            let calls = run_and_kill(&folder, seed);
            figures.kills += 1;
            known = check(&folder, seed, calls, known, &mut figures);
        }
    }
    println!("{figures:?} in {:.1} s", begun.elapsed().as_secs_f64());
    assert_eq!(figures.kills, 200);
}

/// Starts the victim, lets it progress by a random amount, kills it, and counts the calls that have returned.
fn run_and_kill(folder: &Path, seed: u64) -> usize {
    let mut rng = ChaCha8Rng::seed_from_u64(!seed);
    // Now and then before the session exists.
    let wait_for = rng.random_range(0..10);
    let longer = Duration::from_micros(rng.random_range(0..8_000));
    let mut victim = Command::new(std::env::current_exe().expect("this program"))
        .args(["--exact", THIS_TEST, "--nocapture"])
        .env(VICTIM, folder)
        .env(SEED, seed.to_string())
        .stdout(Stdio::piped())
        .spawn()
        .expect("spawn");
    let mut lines = BufReader::new(victim.stdout.take().expect("a pipe")).lines();
    let is_done = |line: &String| line.starts_with("done: ");
    let mut calls = lines.by_ref().map_while(Result::ok).filter(is_done).take(wait_for).count();
    assert_eq!(calls, wait_for, "the victim of seed {seed} ended by itself");
    // Spread the kill over the steps of the next call.
    let until = Instant::now() + longer;
    while Instant::now() < until {
        std::hint::spin_loop();
    }
    victim.kill().expect("kill");
    victim.wait().expect("wait");
    calls += lines.map_while(Result::ok).filter(is_done).count();
    calls
}

/// Compares the disk with what was acknowledged; `known` is the session before the run.
fn check(folder: &Path, seed: u64, calls: usize, known: History, figures: &mut Figures) -> History {
    figures.acknowledged += calls;
    if !Session::is_session(folder) {
        assert_eq!(calls, 0, "seed {seed}: an acknowledged session is gone");
        figures.before_the_session += 1;
        return known;
    }
    // The first line reports that the session is open.
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut acknowledged = known;
    for actions in 0..calls.saturating_sub(1) {
        let action = choose(&mut rng, &acknowledged);
        model(&mut acknowledged, &action);
        if matches!(action, Action::SaveAs) {
            check_copy(&copy_path(folder, seed, actions), &acknowledged, figures);
        }
    }
    let mut begun = acknowledged.clone();
    if calls > 0 {
        let action = choose(&mut rng, &acknowledged);
        model(&mut begun, &action);
        let copy = copy_path(folder, seed, calls - 1);
        if copy.exists() {
            assert!(matches!(action, Action::SaveAs), "seed {seed}");
            check_copy(&copy, &acknowledged, figures);
        }
    }
    let home = folder.parent().expect("a parent");
    for entry in home.read_dir().expect("list") {
        let path = entry.expect("entry").path();
        if path.extension().is_some_and(|extension| extension == "partial") {
            figures.interrupted_copies += 1;
            std::fs::remove_dir_all(&path).expect("remove");
        }
    }

    let document = std::fs::read(folder.join("session.json")).ok();
    let session = Session::open(folder).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
    let store = Store::open(folder).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
    assert_eq!(session.document, *store.document(), "seed {seed}");
    let found = store.history().clone();
    assert!(found == acknowledged || found == begun, "seed {seed}: {calls} calls, {found:?}");
    figures.recorded_and_not_acknowledged += usize::from(found != acknowledged);
    figures.documents_behind += usize::from(document != std::fs::read(folder.join("session.json")).ok());
    figures.torn_journals += usize::from(folder.join("journal.torn-1").exists());
    drop(std::fs::remove_file(folder.join("journal.torn-1")));
    check_files(folder, &found, figures);
    found
}

/// A copy under its final name is complete.
fn check_copy(copy: &Path, expected: &History, figures: &mut Figures) {
    figures.copies += 1;
    let store = Store::open(copy).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(store.history(), expected);
    check_files(copy, expected, figures);
    drop(store);
    std::fs::remove_dir_all(copy).expect("remove");
}

/// Decodes every file of every capture that the session has, or has after undos and redos.
fn check_files(folder: &Path, history: &History, figures: &mut Figures) {
    let session = Session::open(folder).unwrap_or_else(|e| panic!("{e}"));
    let mut captures: Vec<CaptureRecord> = Vec::new();
    let mut take = |history: &History| {
        let new = |capture: &&CaptureRecord| captures.iter().all(|known| known.id != capture.id);
        let new: Vec<_> = history.document().captures.iter().filter(new).cloned().collect();
        captures.extend(new);
    };
    take(history);
    let mut other = history.clone();
    while other.undo().is_ok() {
        take(&other);
    }
    while other.redo().is_ok() {
        take(&other);
    }
    for capture in &captures {
        assert_eq!(session.load_rgb(capture).unwrap_or_else(|e| panic!("{e}")), image(capture.id));
        assert_eq!(session.load_depth_m(capture).unwrap_or_else(|e| panic!("{e}")), Some(depth(capture.id)));
        figures.images += 1;
    }
    let in_use: Vec<&str> = history.document().in_use().map(|capture| capture.image.as_str()).collect();
    if in_use.is_empty() {
        // A data set without views is an error of its own.
        return;
    }
    let data = Dataset::read(folder).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(data.entries.iter().map(|entry| entry.name.as_str()).collect::<Vec<_>>(), in_use);
}
