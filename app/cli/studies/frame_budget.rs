//! What the thread of the window does for a frame, while everything else fails or is busy.
//!
//!     cargo run --release -p handeye_app --example frame_budget [SECONDS]
//!
//! The first two lines are the same work without and with a recording for Rerun, and the last two with a viewer as well:
//! one that reads, and one that is stopped (`rerun` on the `PATH`; skipped without). `images/s` counts those that the
//! window got, `MB` is the memory of the program.
//!
//! Draws the whole window 60 times a second without a graphics card: events, panes, tessellation. Prints for each
//! situation the median, the 99th percentile and the worst of the wall times of the frames, including processor time
//! taken by other threads, and how many shapes the last frame had.

mod window;

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use handeye_cell::scene::Scene;
use handeye_coppeliasim::ConnectionOptions;
use handeye_coppeliasim::cell::{CellClient, CellPaths};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::targets::observation::Corner;
use handeye_record::RerunChoice;
use handeye_server::{CellConfig, CellServer};
use handeye_session::{CaptureId, CaptureRecord, Document};
use handeye_workbench::app::App;
use handeye_workbench::model::{CellSource, MotionGoal, Observed, SessionState, ViewerState};
use handeye_workbench::session::start::{self, BOARD};
use handeye_workbench::text::Text;
use handeye_workbench::{motion, session};
use image::RgbImage;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector2};
use window::Drawn;

/// Bytes per second of the slow line.
const SLOW_LINE: usize = 1_000_000;

fn main() -> anyhow::Result<()> {
    let seconds: u64 = std::env::args().nth(1).map_or(Ok(20), |text| text.parse())?;
    let duration = Duration::from_secs(seconds);
    println!(
        "{:<30} {:>7} {:>9} {:>26} {:>10} {:>6}",
        "", "frames", "shapes", "ms: median, 99 %, worst", "images/s", "MB"
    );

    let cell = CellServer::start(CellConfig::new(Scene::reference()?))?;
    // A cell at an address starts its simulation on command; without passes there are no new images.
    let endpoint = cell.endpoint().parse()?;
    let mut starter = CellClient::connect(&endpoint, &ConnectionOptions::default(), &CellPaths::default())?;
    starter.arm().sim().start_simulation()?;
    let live = || CellSource::Address(cell.endpoint());
    // In turns, so that other load of the machine affects both.
    for round in 1..=2 {
        measure(&format!("live images, round {round}"), live(), duration, |_| {})?;
        recorded(&format!("the same, recorded, round {round}"), live(), duration, RerunChoice::Record, |_| {})?;
    }
    recorded("a viewer that reads", live(), duration, RerunChoice::Web, |app| read(app, false))?;
    recorded("a viewer that is stopped", live(), duration, RerunChoice::Web, |app| read(app, true))?;

    let silent = TcpListener::bind("127.0.0.1:0")?;
    let address = format!("tcp://{}", silent.local_addr()?);
    let _accepting = thread::spawn(move || silent.incoming().map_while(Result::ok).collect::<Vec<TcpStream>>().len());
    measure("a server that never answers", CellSource::Address(address), duration, |_| {})?;

    let slow = slow_line(&cell.endpoint())?;
    measure("a line of 1 MB/s", CellSource::Address(slow), duration, |_| {})?;

    measure("a move of 30 s", CellSource::Address(cell.endpoint()), duration.max(Duration::from_secs(35)), |app| {
        let mut view = app.model().view.jog;
        view.speed = Some(0.005);
        app.apply(motion::Command::SetJog(view));
        let goal = MotionGoal::Joints([0.4, 0.3, -0.6, 0.2, 1.2, 0.3].into());
        app.apply(motion::Command::Move { goal, what: Text::verbatim("a far place") });
    })?;

    measure("a solve of 1,000 views", CellSource::Address(cell.endpoint()), duration, thousand_views)?;
    Ok(())
}

/// Starts a viewer without a window that reads the recording; stops it at once, or lets it read. It ends with this program.
fn read(app: &App, stopped: bool) {
    let ViewerState::Web { url } = &app.model().rerun.viewer else { return };
    let decoded = url.replace("%2B", "+").replace("%3A", ":").replace("%2F", "/");
    let sources = decoded.split("&url=").skip(1);
    let file = std::env::temp_dir().join(format!("handeye-frame-budget-{}-{stopped}.rrd", std::process::id()));
    let script = if stopped {
        "sleep 3; kill -STOP -- -$viewer; sleep 60; kill -KILL -- -$viewer"
    } else {
        "sleep 40; kill -- -$viewer"
    };
    let script = format!("setsid \"$@\" & viewer=$!; {script}; rm -f \"$0\"");
    let started = std::process::Command::new("sh")
        .args(["-c", &script])
        .arg(&file)
        .args(["rerun", "--bind", "127.0.0.1", "--port", "auto", "--save"])
        .arg(&file)
        .args(sources)
        .env("CI", "true")
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null())
        .spawn();
    if let Err(error) = started {
        println!("no viewer: {error}");
    }
}

/// Memory of this program [MB].
fn resident_mb() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap_or_default();
    line.split_whitespace().next().and_then(|number| number.parse::<u64>().ok()).unwrap_or(0) / 1000
}

/// Draws the window for a while, without a recording.
fn measure(what: &str, source: CellSource, duration: Duration, begin: impl FnOnce(&mut App)) -> anyhow::Result<()> {
    recorded(what, source, duration, RerunChoice::Off, begin)
}

/// Draws the window for a while.
fn recorded(
    what: &str,
    source: CellSource,
    duration: Duration,
    rerun: RerunChoice,
    begin: impl FnOnce(&mut App),
) -> anyhow::Result<()> {
    let mut drawn = Drawn::open(source, rerun)?;
    let mut begin = Some(begin);
    let mut first_image = None;
    let warm_up = Duration::from_secs(3);
    while drawn.age() < duration + warm_up {
        drawn.draw();
        // The first frames create fonts and connections; they are not what a user waits for.
        if drawn.age() < warm_up {
            drawn.times_ms.clear();
            continue;
        }
        if let (None, Some(image)) = (first_image, &drawn.app().model().frame) {
            first_image = Some((image.info.number, Instant::now()));
        }
        if let Some(begin) = begin.take() {
            begin(drawn.app());
        }
    }
    let newest = drawn.app().model().frame.as_ref().map_or(0, |image| image.info.number);
    let rate_hz = first_image.map_or(0.0, |(first, at)| (newest - first) as f64 / at.elapsed().as_secs_f64());
    println!(
        "{what:<30} {:>7} {:>9} {:>26} {rate_hz:>10.1} {:>6}",
        drawn.times_ms.len(),
        drawn.shapes,
        drawn.summary(),
        resident_mb()
    );
    Ok(())
}

/// A connection to the server that carries this many bytes per second in each direction.
fn slow_line(server: &str) -> anyhow::Result<String> {
    let server = server.trim_start_matches("tcp://").to_owned();
    let listener = TcpListener::bind("127.0.0.1:0")?;
    let address = format!("tcp://{}", listener.local_addr()?);
    thread::spawn(move || {
        for client in listener.incoming().map_while(Result::ok) {
            let Ok(server) = TcpStream::connect(&server) else { return };
            let (Ok(client_too), Ok(server_too)) = (client.try_clone(), server.try_clone()) else { return };
            thread::spawn(move || trickle(client, server));
            thread::spawn(move || trickle(server_too, client_too));
        }
    });
    Ok(address)
}

fn trickle(mut from: TcpStream, mut to: TcpStream) {
    let mut piece = vec![0; SLOW_LINE / 100];
    while let Ok(count @ 1..) = from.read(&mut piece) {
        thread::sleep(Duration::from_secs_f64(count as f64 / SLOW_LINE as f64));
        if to.write_all(&piece[..count]).is_err() {
            return;
        }
    }
}

/// A session of 1,000 captures of a made-up cell, which the solver takes up automatically.
fn thousand_views(app: &mut App) {
    let camera = Intrinsics::pinhole(640, 480, 589.37);
    let tip_from_camera: Pose<Tip, Camera> = Pose::from_translation_xyzw([0.05, 0.0, 0.0], [0.0, 0.0, 0.7, 0.7]);
    let base_from_target: Pose<Base, Target> = Pose::from_translation_xyzw([0.4, 0.1, 0.02], [1.0, 0.0, 0.0, 0.0]);
    let mut document = Document::new(start::meta(None, String::new()));
    let mut seen = Vec::new();
    for n in 1..=1000_u32 {
        let s = f64::from(n);
        let turn =
            UnitQuaternion::from_euler_angles(0.45 * (1.7 * s).sin(), 0.45 * (2.3 * s).cos(), 0.5 * (0.9 * s).sin());
        let middle = BOARD.centre();
        let camera_from_target: Pose<Camera, Target> = Pose::from_isometry(
            Translation3::new(0.02 * s.sin(), 0.02 * s.cos(), 0.32 + 0.04 * (1.9 * s).sin())
                * Isometry3::from_parts(Translation3::identity(), turn)
                * Translation3::new(-middle.x, -middle.y, 0.0),
        );
        let corners: Vec<Corner> = BOARD
            .points()
            .iter()
            .enumerate()
            .filter_map(|(index, point)| {
                let px = camera.project(&(camera_from_target.isometry() * point)).ok()?;
                let off = |phase: f64| 0.07 * (s * 12.9 + index as f64 * 78.2 + phase).sin();
                Some(Corner::new(index, px + Vector2::new(off(0.0), off(1.0))))
            })
            .collect();
        let base_from_tip = base_from_target * camera_from_target.inverse() * tip_from_camera.inverse();
        document.captures.push(CaptureRecord::new(CaptureId(n), format!("images/{n:04}.png"), base_from_tip));
        let thumbnail = Arc::new(RgbImage::new(160, 120));
        seen.push((
            CaptureId(n),
            Observed { corners: Some(corners.into()), depth: None, image_size: (640, 480), thumbnail },
        ));
    }
    let state = SessionState { folder: None, document: Arc::new(document), undo: None, redo: None };
    app.absorb(session::Event::Document(Box::new(state)));
    for (id, observed) in seen {
        app.absorb(session::Event::Observed { id, target: BOARD, observed: Some(Arc::new(observed)) });
    }
}
