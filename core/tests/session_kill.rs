//! A process that is killed while it captures: every capture that it was told is recorded is there afterwards.

use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

use handeye_core::dataset::Dataset;
use handeye_core::depth::DepthImage;
use handeye_core::frames::Pose;
use handeye_core::handeye::Mode;
use handeye_core::image::{Rgb, RgbImage};
use handeye_core::session::{Capture, Session, SessionMeta, SessionWriter};
use handeye_core::target::{Grid, TargetSpec};

/// Tells the test below that it is the process to be killed, and where to write.
const VICTIM: &str = "HANDEYE_TEST_SESSION_VICTIM";

fn meta() -> SessionMeta {
    SessionMeta {
        created: "2026-05-02T10:11:12Z".into(),
        tool_version: "test".into(),
        mode: Mode::EyeInHand,
        target: TargetSpec::Chessboard(Grid { columns: 10, rows: 7, square_m: 0.015 }),
        camera: None,
        seeds: [].into(),
        ground_truth: None,
    }
}

fn image(number: usize) -> RgbImage {
    RgbImage::from_fn(64, 48, |x, y| Rgb([number as u8, (x * 3) as u8, (x ^ y) as u8]))
}

/// Captures for ever and prints a line for every capture that is recorded.
fn capture_until_killed(folder: &Path) {
    let mut writer = SessionWriter::create(folder, meta()).expect("create");
    for number in 1.. {
        let depth = DepthImage::new(64, 48, vec![0.5; 64 * 48]).expect("as many as pixels");
        let base_from_tip = Pose::from_translation_xyzw([number as f64, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]);
        let image = image(number);
        let capture =
            Capture { image: &image, depth_m: Some(&depth), base_from_tip, joints_rad: None, sim_time_s: None };
        writer.add_capture(&capture).expect("add");
        println!("recorded {number}");
    }
}

#[test]
fn a_kill_at_any_moment_loses_no_acknowledged_capture() {
    if let Some(folder) = std::env::var_os(VICTIM) {
        capture_until_killed(Path::new(&folder));
        return;
    }
    let home = tempfile::tempdir().expect("a temporary folder");
    let mut spare = 0;
    for round in 0..24 {
        let folder = home.path().join(round.to_string());
        let acknowledged = run_and_kill(&folder, 1 + round % 4, round * 20_000);
        let session = Session::open(&folder).unwrap_or_else(|e| panic!("{e}"));
        assert!(session.captures.len() >= acknowledged, "{} of {acknowledged}", session.captures.len());
        spare += session.captures.len() - acknowledged;
        for (i, record) in session.captures.iter().enumerate() {
            assert_eq!(record.base_from_tip.translation().x, (i + 1) as f64);
            assert_eq!(session.load_rgb(record).unwrap_or_else(|e| panic!("{e}")), image(i + 1));
            assert!(session.load_depth_m(record).unwrap_or_else(|e| panic!("{e}")).is_some());
        }
        let data = Dataset::read(&folder).unwrap_or_else(|e| panic!("{e}"));
        assert!(data.entries.len() >= acknowledged);
        for entry in &data.entries {
            data.load_rgb(entry).unwrap_or_else(|e| panic!("{e}"));
        }
        let resumed = SessionWriter::resume(&folder).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(resumed.captures().len(), session.captures.len());
    }
    println!("{spare} captures were recorded and not yet acknowledged");
}

/// Starts the victim, waits for some acknowledgements and a little more, kills it, and counts all acknowledgements.
fn run_and_kill(folder: &Path, wait_for: usize, spins: usize) -> usize {
    let mut victim = Command::new(std::env::current_exe().expect("this program"))
        .args(["--exact", "a_kill_at_any_moment_loses_no_acknowledged_capture", "--nocapture"])
        .env(VICTIM, folder)
        .stdout(Stdio::piped())
        .spawn()
        .expect("spawn");
    let mut lines = BufReader::new(victim.stdout.take().expect("a pipe")).lines();
    let is_recorded = |line: &String| line.starts_with("recorded ");
    let mut acknowledged = lines.by_ref().map_while(Result::ok).filter(is_recorded).take(wait_for).count();
    assert_eq!(acknowledged, wait_for, "the victim ended by itself");
    // Spread the kill over the steps of the next capture.
    for _ in 0..spins {
        std::hint::spin_loop();
    }
    victim.kill().expect("kill");
    victim.wait().expect("wait");
    acknowledged += lines.map_while(Result::ok).filter(is_recorded).count();
    acknowledged
}
