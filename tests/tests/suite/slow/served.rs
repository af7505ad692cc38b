//! The workbench in a browser: a real one, with real events, over the real connection.

use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use handeye_coppeliasim::cell::{Arm, CellPaths};
use handeye_coppeliasim::{ConnectionOptions, Endpoint};
use handeye_tests::desktop::{self, Desktop};
use handeye_tests::network::{Network, Quality};
use handeye_tests::{CellProcess, hurried};
use serde_json::Value;

/// From the last sign of a held button to an arm at rest.
const AT_REST: Duration = Duration::from_millis(500);

/// Presses of a button until the arm moves, and frames to wait for each.
const TRIES: usize = 40;
const FRAMES: usize = 20;

/// An arm that does not move for this long is at rest; a pass takes 50 ms.
const STILL: Duration = Duration::from_millis(400);

/// Fewer pixels than this differ because of the age of the image and the folder of the user, including the area around
/// their letters.
const ALIKE: usize = 2_000;

/// How often a window and a page that differ are compared again.
const LOOKS: usize = 60;

/// Height of the window on a screen of 900 points.
const HEIGHT: u32 = 852;

/// Where the bar at the bottom begins, where the latest message may differ.
const STATUS_BAR: u32 = HEIGHT - 70;

/// A browser without a graphics card keeps a machine busy by itself: one at a time.
fn alone() -> MutexGuard<'static, ()> {
    static BROWSER: Mutex<()> = Mutex::new(());
    BROWSER.lock().unwrap_or_else(PoisonError::into_inner)
}

fn shots(name: &str) -> PathBuf {
    std::env::var_os("HANDEYE_SCREENSHOTS")
        .filter(|folder| !folder.is_empty())
        .map_or_else(|| PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name), PathBuf::from)
}

/// From the start to exported files, with few clicks; and what the page wrote to its console meanwhile.
fn first_user(desktop: &mut Desktop) {
    desktop.until_seen("Connected to the built-in cell");
    desktop.until_seen("Board in view");
    desktop.photograph("1-connected");
    desktop.click("Calibrate for me");
    desktop.until_seen("Lowers the expected error");
    desktop.photograph("2-guided");
    desktop.until_seen("The goal is reached");
    desktop.until_seen("3 captures");
    desktop.click("4 Solve");
    desktop.until_seen("Expected error");
    desktop.photograph("3-solved");
    desktop.click("6 Export");
    desktop.click("Export 4 formats");
    desktop.until_seen("read back and compared");
    desktop.photograph("4-exported");
    let sessions = desktop.home().join("handeye-sessions");
    let session = std::fs::read_dir(&sessions).expect("the sessions").flatten().next().expect("a session").path();
    for file in ["result.json", "exports/calibration.json", "exports/opencv.yaml"] {
        assert!(session.join(file).is_file(), "{file}");
    }
    let (browser, _) = desktop.page();
    assert_eq!(browser.text(), [] as [String; 0], "the page complains");
}

#[test]
fn a_first_user_gets_to_exported_files_in_a_browser_and_downloads_them() {
    if !desktop::is_possible_in_browser() {
        return;
    }
    let _alone = alone();
    let folder = tempfile::tempdir().expect("a folder");
    let scene = hurried("reference", folder.path()).display().to_string();
    let mut desktop = Desktop::in_browser((1440, 900), false, &shots("served"), &["--scene", &scene]);
    first_user(&mut desktop);
    // The request of the button, as the page sends it.
    desktop.place_of("Download as one archive");
    let session = desktop.home().join("handeye-sessions");
    let session = std::fs::read_dir(session).expect("the sessions").flatten().next().expect("a session").path();
    let folder = session.join("exports");
    let (browser, tab) = desktop.page();
    let fetched = browser.evaluate(
        tab,
        &format!(
            "fetch('/download?folder=' + encodeURIComponent({folder:?}))
                .then(async (answer) => [answer.status, answer.headers.get('content-type'), \
                 (await answer.arrayBuffer()).byteLength])"
        ),
    );
    assert_eq!((&fetched[0], &fetched[1]), (&Value::from(200), &Value::from("application/zip")), "{fetched}");
    assert!(fetched[2].as_u64().is_some_and(|bytes| bytes > 1000), "{fetched}");
}

#[test]
fn a_first_user_gets_to_exported_files_with_fingers_on_a_tablet() {
    if !desktop::is_possible_in_browser() {
        return;
    }
    let _alone = alone();
    let folder = tempfile::tempdir().expect("a folder");
    let scene = hurried("reference", folder.path()).display().to_string();
    let mut desktop = Desktop::in_browser((1024, 768), true, &shots("served_tablet"), &["--scene", &scene]);
    first_user(&mut desktop);
}

/// The desktop window and the page are drawn by different programs from the same triangles. Only the last bit of a colour
/// may differ, and texts with the elapsed time or the folder of the user.
#[test]
fn the_page_shows_what_the_desktop_window_shows_pixel_for_pixel() {
    if !desktop::is_possible_in_browser() || !desktop::is_possible() {
        return;
    }
    let _alone = alone();
    // A paused simulation makes no images: nothing moves.
    let cell = CellProcess::start(&[]);
    let address = Endpoint::local(cell.port()).to_string();
    let arguments = ["--rerun", "off", "--connect", &address];
    let mut window = Desktop::start((1440, 900), &shots("served"), &arguments, &[]);
    // As large as the window made itself: it leaves room for the bars of a desktop.
    let mut page = Desktop::in_browser((1440, HEIGHT), false, &shots("served"), &arguments);
    for pane in ["Connect", "Target", "3D", "Result"] {
        for surface in [&mut window, &mut page] {
            surface.until_seen("The simulation is stopped");
            surface.click(pane);
        }
        // A window on a busy machine shows clicks late; a permanent difference remains.
        let differ = (0..LOOKS).map(|_| differing_pixels(&window, &page, pane)).find(|count| *count < ALIKE);
        assert!(differ.is_some(), "{pane}: {} pixels differ", differing_pixels(&window, &page, pane));
    }
}

/// How many pixels above the bar at the bottom have a different colour on the page than in the window.
fn differing_pixels(window: &Desktop, page: &Desktop, pane: &str) -> usize {
    let [window, page] = [(window, "window"), (page, "page")].map(|(surface, name)| {
        image::open(surface.photograph(&format!("{name}-{pane}"))).expect("an image").into_rgb8()
    });
    assert_eq!((window.dimensions(), page.dimensions()), ((1440, 900), (1440, HEIGHT)));
    let apart = |((_, row, window), page): &((u32, u32, &image::Rgb<u8>), &image::Rgb<u8>)| {
        *row < STATUS_BAR && window.0.iter().zip(&page.0).any(|(window, page)| window.abs_diff(*page) > 2)
    };
    let count = window.enumerate_pixels().zip(page.pixels()).filter(apart).count();
    println!("{pane}: {count} of {} pixels differ", 1440 * STATUS_BAR);
    count
}

/// The first place of the tip in the bar at the bottom.
fn tip(desktop: &mut Desktop) -> String {
    desktop.label("Tip in base, x y z [mm]:")
}

/// Holds a button that moves the arm, and waits until it moves.
fn hold_a_jog(desktop: &mut Desktop) {
    desktop.until_seen("Board in view");
    desktop.click("Jog");
    desktop.click("Hold");
    let place = desktop.place_of("Move +Z");
    let before = tip(desktop);
    // On a very busy machine the page does not report in time, and the jog is released as it has to be: the user
    // presses again.
    for _ in 0..TRIES {
        let (browser, tab) = desktop.page();
        browser.hold(tab, place);
        for _ in 0..FRAMES {
            desktop.frame_drawn();
            if tip(desktop) != before {
                return;
            }
        }
        let (browser, tab) = desktop.page();
        browser.let_go(tab, place);
    }
    panic!("the arm does not move");
}

/// A cell whose time runs, its address, and its arm as seen by other clients.
fn running_cell() -> (CellProcess, String, Arm) {
    let cell = CellProcess::start(&[]);
    let endpoint = Endpoint::local(cell.port());
    let mut arm = Arm::connect(&endpoint, &ConnectionOptions::default(), &CellPaths::default()).expect("a cell");
    arm.sim().start_simulation().expect("it starts");
    (cell, endpoint.to_string(), arm)
}

/// The arm comes to rest in time, and stays there while the page is restored with `back` and used again.
fn rests_and_comes_back(what: &str, desktop: &mut Desktop, arm: &mut Arm, back: impl FnOnce(&Desktop)) {
    let took = moves_for(arm);
    println!("{what}: the arm at rest after {:.0} ms", took.as_secs_f64() * 1e3);
    // The goal is half a second; a machine that builds at the same time takes longer for everything.
    assert!(took < 4 * AT_REST, "{took:?}");
    let rested = arm.joint_values().expect("a call");
    back(desktop);
    let (browser, tab) = desktop.page();
    browser.until(tab, "show.frame && document.getElementById('note').hidden && people.you");
    desktop.click("Poses");
    desktop.until_seen("No captures yet");
    assert_eq!(arm.joint_values().expect("a call"), rested, "it goes on by itself");
}

/// How long the arm still moves; it is at rest when it does not move for some passes.
fn moves_for(arm: &mut Arm) -> Duration {
    let began = Instant::now();
    let (mut last, mut moved) = (arm.joint_values().expect("a call"), began);
    while moved.elapsed() < STILL {
        let now = arm.joint_values().expect("a call");
        if now != last {
            (last, moved) = (now, Instant::now());
        }
    }
    moved - began
}

#[test]
fn a_browser_that_stands_still_lets_go_of_the_arm_and_comes_back() {
    if !desktop::is_possible_in_browser() {
        return;
    }
    let _alone = alone();
    let (_cell, address, mut arm) = running_cell();
    let mut desktop = Desktop::in_browser((1440, 900), false, &shots("served"), &["--connect", &address]);
    hold_a_jog(&mut desktop);
    desktop.page().0.signal("STOP");
    rests_and_comes_back("a page that stands still", &mut desktop, &mut arm, |desktop| {
        desktop.page().0.signal("CONT");
    });
}

/// One megabit per second, a round trip of 200 ms, two percent packet loss; then no connection at all.
#[test]
fn over_a_bad_network_the_arm_rests_when_it_goes_and_the_page_comes_back() {
    if !desktop::is_possible_in_browser() {
        return;
    }
    let _alone = alone();
    let (_cell, address, mut arm) = running_cell();
    let quality = Quality { bits_per_s: 1e6, round_trip: Duration::from_millis(200), loss: 0.02, seed: 1 };
    let mut network = None;
    let through = |program| network.insert(Network::to(program, quality)).address();
    let arguments = ["--connect", &address];
    let mut desktop = Desktop::in_browser_over((1440, 900), false, &shots("served"), &arguments, through);
    let network = network.expect("a network");
    hold_a_jog(&mut desktop);
    network.cut();
    rests_and_comes_back("a network that is gone", &mut desktop, &mut arm, |desktop| {
        // The page has to notice it first.
        let (browser, tab) = desktop.page();
        browser.until(tab, "!document.getElementById('note').hidden");
        network.mend();
    });
}

/// A closed lid, or another page in front: the page is no longer running.
#[test]
fn a_page_that_is_frozen_lets_go_of_the_arm_and_comes_back() {
    if !desktop::is_possible_in_browser() {
        return;
    }
    let _alone = alone();
    let (_cell, address, mut arm) = running_cell();
    let mut desktop = Desktop::in_browser((1440, 900), false, &shots("served"), &["--connect", &address]);
    hold_a_jog(&mut desktop);
    let freeze = |desktop: &Desktop, is_frozen| {
        let (browser, tab) = desktop.page();
        browser.freeze(tab, is_frozen);
    };
    freeze(&desktop, true);
    rests_and_comes_back("a page that is frozen", &mut desktop, &mut arm, |desktop| freeze(desktop, false));
}

/// Everything with a name is available to the screen reader of the browser, and works.
#[test]
fn a_screen_reader_finds_the_controls_and_presses_them() {
    if !desktop::is_possible_in_browser() {
        return;
    }
    let _alone = alone();
    let mut desktop = Desktop::in_browser((1440, 900), false, &shots("served"), &[]);
    desktop.until_seen("Board in view");
    let (browser, tab) = desktop.page();
    assert_eq!(browser.evaluate(tab, "document.querySelectorAll('#controls *').length"), Value::from(0));
    browser.evaluate(tab, "document.getElementById('reads').click()");
    let named = |name: &str| {
        format!("[...document.querySelectorAll('#controls button')].find((b) => b.textContent === '{name}')")
    };
    browser.until(tab, &named("Jog"));
    browser.until(tab, "document.getElementById('controls').textContent.includes('Board in view')");
    browser.evaluate(tab, &format!("{}.click()", named("Jog")));
    browser.until(tab, &named("Move +Z"));
    browser.until(tab, &format!("{}.getAttribute('aria-pressed') === 'true'", named("Jog")));
    // A field that gets the focus takes typed text.
    let field =
        "[...document.querySelectorAll('#controls button')].find((b) => b.textContent.startsWith('Goal of joint 1'))";
    browser.evaluate(tab, &format!("{field}.click()"));
    assert_eq!(browser.evaluate(tab, "document.activeElement.id"), Value::from("typing"));
    // Switched off, nothing remains, whatever is in flight.
    browser.evaluate(tab, "document.getElementById('reads').click()");
    assert_eq!(browser.evaluate(tab, "document.querySelectorAll('#controls *').length"), Value::from(0));
}

#[test]
fn others_watch_stop_the_arm_and_take_over_with_one_click() {
    if !desktop::is_possible_in_browser() {
        return;
    }
    let _alone = alone();
    let mut desktop = Desktop::in_browser((1440, 900), false, &shots("served"), &[]);
    desktop.until_seen("Board in view");
    let (browser, driver) = desktop.page();
    let url = browser.evaluate(driver, "location.href").as_str().expect("an address").to_owned();
    let watcher = browser.open(&url, (900, 700), false);
    browser.until(&watcher, "show.frame && !people.you && !document.getElementById('bar').hidden");
    let (browser, driver) = desktop.page();
    assert_eq!(browser.evaluate(driver, "people.pages"), Value::from(2));

    // Input at a page that only watches has no effect; its STOP has.
    hold_a_jog(&mut desktop);
    let (browser, _) = desktop.page();
    browser.evaluate(&watcher, "document.getElementById('stop').click()");
    // Both the stop and the jog that it ended report it: the last one is shown.
    desktop.until_seen("stopped");

    let (browser, driver) = desktop.page();
    browser.evaluate(&watcher, "document.getElementById('drive').click()");
    browser.until(&watcher, "people.you && show.frame.size[0] === 1024");
    browser.until(driver, "!people.you && !document.getElementById('bar').hidden");
    std::fs::write(shots("served").join("watching.png"), browser.photograph(driver)).expect("written");

    // The page that drives has gone: no page drives until a user requests it.
    browser.close(&watcher);
    browser.until(driver, "!people.driven");
    browser.evaluate(driver, "document.getElementById('drive').click()");
    browser.until(driver, "people.you && document.getElementById('bar').hidden");
}

#[test]
fn files_that_are_dropped_on_the_page_are_opened_as_a_session() {
    if !desktop::is_possible_in_browser() {
        return;
    }
    let _alone = alone();
    let mut desktop = Desktop::in_browser((1440, 900), false, &shots("served"), &[]);
    desktop.until_seen("Board in view");
    // A typical recording, made by the command line on the built-in cell.
    let folder = tempfile::tempdir().expect("a folder");
    let session = folder.path().join("recorded");
    let made = std::process::Command::new(handeye_tests::handeye_binary())
        .args(["auto", "--quiet", "--out"])
        .arg(&session)
        .current_dir(folder.path())
        .status();
    assert!(made.is_ok_and(|status| status.success()));
    let (browser, tab) = desktop.page();
    browser.drop_files(tab, (400.0, 400.0), &[&session]);
    desktop.until_seen("10 poses");
    desktop.until_seen("(95 %)");
}
