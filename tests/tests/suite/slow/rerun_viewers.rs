//! The recording as seen by users: in a browser, in the native viewer, and in one that hangs.
//!
//! Images go to `$HANDEYE_SCREENSHOTS`, or else next to the build.

use std::collections::BTreeSet;
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use handeye_geometry::testing::{Need, programs, python, skip};
use handeye_record::RerunChoice;
use handeye_tests::desktop::{self, Desktop};
use handeye_tests::watch::Watch;
use handeye_tests::workbench::Workbench;
use handeye_tests::{CellProcess, handeye_binary, process};
use handeye_workbench::connect;
use handeye_workbench::model::{CellSource, Model, ViewerState};

/// Longer than anything that a test waits for takes on a busy machine.
const PATIENCE: Duration = Duration::from_mins(4);

/// What the recording may take of the memory of the workbench while a viewer hangs, see docs/reference/rerun_viewers.md.
const MEMORY_BOUND: u64 = 512 * 1024 * 1024;

fn shots() -> PathBuf {
    let folder = std::env::var_os("HANDEYE_SCREENSHOTS")
        .filter(|folder| !folder.is_empty())
        .map_or_else(|| PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("rerun_viewers"), PathBuf::from);
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

/// The native viewer of the Python environment. `None` if there is none, and the test has reported that it skips.
fn native_viewer() -> Option<PathBuf> {
    // The program itself: the `rerun` on the path of Python starts it as a child, which signals do not reach.
    let where_it_is = "import rerun_cli, os; print(os.path.join(os.path.dirname(rerun_cli.__file__), 'rerun'))";
    let reported = Command::new(python()?).args(["-c", where_it_is]).output().expect("python runs");
    let viewer = PathBuf::from(String::from_utf8_lossy(&reported.stdout).trim());
    if viewer.is_file() {
        return Some(viewer);
    }
    skip(Need::Python, "Python has no rerun-sdk");
    None
}

/// How many colours there are in a part of an image, given in shares of its sides: left, top, right, bottom.
fn colours(image: &Path, [left, top, right, bottom]: [f64; 4]) -> usize {
    let image = image::open(image).unwrap_or_else(|error| panic!("{}: {error}", image.display())).to_rgb8();
    let (width, height) = (f64::from(image.width()), f64::from(image.height()));
    let inside = |x: u32, y: u32| {
        let (x, y) = (f64::from(x) / width, f64::from(y) / height);
        (left..right).contains(&x) && (top..bottom).contains(&y)
    };
    let seen = image.enumerate_pixels().filter(|(x, y, _)| inside(*x, *y)).map(|(_, _, pixel)| pixel.0);
    seen.collect::<BTreeSet<_>>().len()
}

/// A process that ends with the test.
struct Ends(Child);

impl Drop for Ends {
    fn drop(&mut self) {
        // A stopped process does not react to a polite request to end.
        let _ended = self.0.kill().and_then(|()| self.0.wait()).is_ok();
    }
}

/// Reads lines until one contains a web address.
fn address(lines: impl std::io::Read) -> String {
    for line in BufReader::new(lines).lines() {
        let line = line.expect("a line");
        if let Some(at) = line.find("http://127.0.0.1:") {
            return line[at..].split_whitespace().next().unwrap_or_default().to_owned();
        }
    }
    panic!("it ended without an address");
}

/// Makes a browser take a screenshot of a page.
fn photograph(url: &str, image: &Path, profile: &Path) {
    let mut browser = Command::new("chromium")
        .args(["--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader"])
        .args(["--enable-unsafe-swiftshader", "--disable-background-networking", "--disable-component-update"])
        .args(["--disable-sync", "--no-first-run", "--force-dark-mode", "--window-size=1400,900"])
        // No host name is resolved: there is no network except this machine.
        .arg("--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1")
        .args(["--timeout=60000", "--virtual-time-budget=90000"])
        .arg(format!("--user-data-dir={}", profile.display()))
        .arg(format!("--screenshot={}", image.display()))
        .arg(url)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("chromium starts");
    process::end_of(&mut browser);
}

#[test]
fn a_browser_without_network_shows_a_live_session_in_3d() {
    if !programs(Need::Chromium, &["chromium"]) {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let mut session = Command::new(handeye_binary())
        .args(["auto", "--quiet", "--real-time", "--rerun", "web", "--out"])
        .arg(folder.path().join("session"))
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary is built: cargo build -p handeye_app");
    let reported = session.stderr.take().expect("its messages");
    let _session = Ends(session);
    let url = address(reported);
    // The arm moves to its poses meanwhile.
    let image = shots().join("rerun-web.png");
    let deadline = Instant::now() + PATIENCE;
    loop {
        let _old = std::fs::remove_file(&image).is_ok();
        photograph(&url, &image, &folder.path().join("browser"));
        // The centre of the window, between the panels: 3D scene and images. A viewer without a recording has only a
        // few.
        let seen = colours(&image, [0.2, 0.1, 0.75, 0.7]);
        println!("web viewer: {seen} colours, {}", image.display());
        if seen > 500 {
            return;
        }
        // A busy machine takes longer to load the viewer than the browser waits.
        assert!(Instant::now() < deadline, "{seen} colours: see {}", image.display());
    }
}

#[test]
fn the_button_opens_the_native_viewer_which_shows_the_cell() {
    let Some(viewer) = native_viewer() else { return };
    if !desktop::is_possible() {
        return;
    }
    // A viewer that takes a screenshot of itself: its image in an off-screen window cannot be obtained otherwise.
    let folder = tempfile::tempdir().expect("a folder");
    let image = shots().join("rerun-native.png");
    let _old = std::fs::remove_file(&image).is_ok();
    let watch = Watch::folder(&shots());
    let wrapper = folder.path().join("rerun");
    let script = format!(
        "#!/bin/sh\n[ \"$1\" = --version ] && exec '{viewer}' --version\nexec '{viewer}' \"$@\" --screenshot-to \
         '{image}' --window-size 1400x900\n",
        viewer = viewer.display(),
        image = std::path::absolute(&image).expect("a path").display(),
    );
    std::fs::write(&wrapper, script).expect("written");
    let allowed = Command::new("chmod").arg("+x").arg(&wrapper).status();
    assert!(allowed.is_ok_and(|status| status.success()));
    let path = std::env::var("PATH").unwrap_or_default();
    let path = format!("{}:{path}", folder.path().display());
    let environment = [("PATH", path.as_str()), ("WGPU_BACKEND", "vulkan")];
    let mut desktop = Desktop::start((1440, 900), &shots(), &[], &environment);
    desktop.until_seen("Board in view");
    desktop.click("Capture");
    desktop.until_seen("1 of");
    desktop.click("Rerun");
    assert!(watch.closes_within(&image, PATIENCE), "the viewer takes no image of itself");
    let seen = colours(&image, [0.2, 0.1, 0.75, 0.7]);
    println!("native viewer: {seen} colours, {}", image.display());
    assert!(seen > 500, "{seen} colours: see {}", image.display());
}

/// Images that the workbench shows within a time, and its largest memory \[bytes\].
fn at_work(bench: &mut Workbench, seconds: f64) -> (f64, u64) {
    let number = |model: &Model| model.frame.as_ref().map_or(0, |frame| frame.info.number);
    let first = number(bench.model());
    let began = Instant::now();
    let mut largest = 0;
    while began.elapsed().as_secs_f64() < seconds {
        let seen = number(bench.model());
        bench.until("another image", |model| number(model) > seen);
        largest = largest.max(resident_bytes());
    }
    let shown = number(bench.model()) - first;
    (shown as f64 / began.elapsed().as_secs_f64(), largest)
}

/// Memory of this process.
fn resident_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap_or("0 kB");
    line.split_whitespace().next().and_then(|number| number.parse::<u64>().ok()).unwrap_or(0) * 1024
}

#[test]
fn a_viewer_that_is_stopped_changes_neither_the_images_nor_the_bound_of_the_memory() {
    let Some(viewer) = native_viewer() else { return };
    // `HANDEYE_STOPPED_S=30` for the long run.
    let stopped_s = std::env::var("HANDEYE_STOPPED_S").ok().and_then(|text| text.parse().ok()).unwrap_or(8.0);
    let folder = tempfile::tempdir().expect("a folder");
    let cell = CellProcess::start(&[]);
    let source = CellSource::Address(format!("tcp://127.0.0.1:{}", cell.port()));
    let mut bench = Workbench::start_recording(source, folder.path(), None, RerunChoice::Web);
    bench.until("images", |model| model.frame.is_some() && matches!(model.rerun.viewer, ViewerState::Web { .. }));
    bench.click(connect::Command::StartSimulation);
    let ViewerState::Web { url } = bench.model().rerun.viewer.clone() else { panic!("no viewer") };
    let decoded = url.replace("%2B", "+").replace("%3A", ":").replace("%2F", "/");
    let sources = decoded.split("&url=").skip(1).map(str::to_owned);
    // A viewer without a window: it reads like any viewer.
    let taken = folder.path().join("taken.rrd");
    let mut reader = Command::new(viewer);
    reader.args(["--bind", "127.0.0.1", "--port", "auto", "--save"]).arg(&taken).args(sources).env("CI", "true");
    let reader = Ends(reader.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("a viewer"));
    bench.until("a viewer that reads", |_| std::fs::metadata(&taken).is_ok_and(|file| file.len() > 1_000_000));

    let (before_hz, before_bytes) = at_work(&mut bench, stopped_s);
    process::signal(&reader.0, "STOP");
    let (stopped_hz, stopped_bytes) = at_work(&mut bench, stopped_s);
    process::signal(&reader.0, "CONT");
    let (after_hz, _) = at_work(&mut bench, 2.0);
    println!(
        "images per second: {before_hz:.1} with a viewer, {stopped_hz:.1} while it is stopped, {after_hz:.1} \
         afterwards; memory {} MB, {} MB",
        before_bytes / 1_000_000,
        stopped_bytes / 1_000_000
    );
    // 5 % is the variation of the machine itself when other tests run at the same time; a workbench that waits shows
    // none.
    assert!(stopped_hz > 0.8 * before_hz, "{before_hz} {stopped_hz}");
    assert!(stopped_bytes < before_bytes + MEMORY_BOUND, "{before_bytes} {stopped_bytes}");
}
