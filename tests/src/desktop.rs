//! The window as the user sees it: on a screen of its own (Xvfb), operated with a real mouse and keyboard (xdotool), or in
//! a browser, operated through its events.

use std::borrow::Cow;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use handeye_geometry::testing::{Need, programs};

use crate::browser::{Browser, Tab};
use crate::process;
use crate::watch::Watch;

/// Longest wait for something to appear.
const PATIENCE: Duration = Duration::from_mins(10);
/// Longest time without a change of the controls before the window itself is checked.
const LOOK: Duration = Duration::from_secs(1);
/// The list of widgets is written, closed and renamed for every frame.
const CHANGES_OF_A_FRAME: usize = 3;

/// A screen or a browser with the workbench on it. Both end when it is dropped.
pub struct Desktop {
    surface: Surface,
    window: Child,
    widgets: PathBuf,
    shots: PathBuf,
    clicks: u32,
    watch: Watch,
    home: tempfile::TempDir,
}

/// Where the window is shown.
enum Surface {
    /// On a screen without a monitor.
    Screen { server: Child, display: String },
    /// In a browser; touched, or pointed at with a mouse.
    Page { browser: Box<Browser>, tab: Tab, touch: bool },
}

/// A control on the screen.
#[derive(Debug, Clone, PartialEq)]
struct Widget {
    label: String,
    role: String,
    centre: (f64, f64),
    enabled: bool,
}

/// A line of the list of widgets, which is read after every frame.
#[derive(serde::Deserialize)]
struct Node<'a> {
    #[serde(borrow)]
    label: Cow<'a, str>,
    #[serde(borrow)]
    role: Cow<'a, str>,
    rect: [f64; 4],
    enabled: bool,
}

/// Whether the programs that a [`Desktop`] needs are installed; if not, the running test has reported that it skips.
pub fn is_possible() -> bool {
    programs(Need::Xvfb, &["Xvfb", "xdotool", "import"])
}

/// Whether the browser that a [`Desktop::in_browser`] needs is installed; if not, the running test has reported that it
/// skips.
pub fn is_possible_in_browser() -> bool {
    programs(Need::Chromium, &["chromium"])
}

/// `handeye`, with a home folder of its own.
fn handeye(command: &str, home: &Path) -> Command {
    let mut handeye = Command::new(crate::handeye_binary());
    handeye
        .arg(command)
        .env("HOME", home)
        .env("XDG_CONFIG_HOME", home.join("config"))
        .env("XDG_DATA_HOME", home.join("data"))
        .env("HANDEYE_WIDGETS", home.join("widgets"))
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("DISPLAY");
    handeye
}

impl Desktop {
    /// Starts screen and window; screenshots go to `shots`.
    ///
    /// # Panics
    /// When one of them does not start.
    pub fn start(size: (u32, u32), shots: &Path, arguments: &[&str], environment: &[(&str, &str)]) -> Self {
        let (width, height) = size;
        let home = tempfile::tempdir().expect("a folder");
        // The screen chooses a free number and reports it.
        let mut screen = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", &format!("{width}x{height}x24"), "-nolisten", "tcp"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb starts");
        let mut number = String::new();
        let stdout = screen.stdout.take().expect("its output");
        std::io::BufRead::read_line(&mut std::io::BufReader::new(stdout), &mut number).expect("a number");
        let display = format!(":{}", number.trim());
        let widgets = home.path().join("widgets");
        let watch = Watch::folder(home.path());
        let window = handeye("gui", home.path())
            .args(arguments)
            .env("DISPLAY", &display)
            .env("LIBGL_ALWAYS_SOFTWARE", "1")
            .envs(environment.iter().copied())
            .spawn()
            .expect("the workbench starts");
        std::fs::create_dir_all(shots).expect("a folder");
        let surface = Surface::Screen { server: screen, display };
        Self { surface, window, widgets, shots: shots.to_path_buf(), clicks: 0, watch, home }
    }

    /// Starts `handeye serve` and a browser with its page, of a size in points.
    ///
    /// # Panics
    /// When one of them does not start.
    pub fn in_browser(size: (u32, u32), touch: bool, shots: &Path, arguments: &[&str]) -> Self {
        Self::in_browser_over(size, touch, shots, arguments, |address| address)
    }

    /// The same, with a different address for the browser: that of a network in between.
    ///
    /// # Panics
    /// When one of them does not start.
    pub fn in_browser_over(
        size: (u32, u32),
        touch: bool,
        shots: &Path,
        arguments: &[&str],
        through: impl FnOnce(SocketAddr) -> SocketAddr,
    ) -> Self {
        let home = tempfile::tempdir().expect("a folder");
        let watch = Watch::folder(home.path());
        let mut window = handeye("serve", home.path())
            .args(["--quiet", "--port", "0"])
            .args(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .expect("the workbench starts");
        let mut line = String::new();
        let stdout = window.stdout.take().expect("its output");
        std::io::BufRead::read_line(&mut std::io::BufReader::new(stdout), &mut line).expect("a line");
        let address =
            line.trim().strip_prefix("the workbench is at http://").expect("an address").trim_end_matches('/');
        let address = through(address.parse().expect("an address"));
        let browser = Browser::start();
        let tab = browser.open(&format!("http://{address}/"), size, touch);
        // A press before there is a frame hits nothing.
        browser.until(&tab, &format!("show.frame?.size[0] === {}", size.0));
        std::fs::create_dir_all(shots).expect("a folder");
        let widgets = home.path().join("widgets");
        let surface = Surface::Page { browser: Box::new(browser), tab, touch };
        Self { surface, window, widgets, shots: shots.to_path_buf(), clicks: 0, watch, home }
    }

    /// The browser and the page in it.
    ///
    /// # Panics
    /// When it is a screen.
    pub fn page(&self) -> (&Browser, &Tab) {
        match &self.surface {
            Surface::Page { browser, tab, .. } => (&**browser, tab),
            Surface::Screen { .. } => panic!("there is no page"),
        }
    }

    /// Clicks of the mouse and presses of keys so far.
    pub fn clicks(&self) -> u32 {
        self.clicks
    }

    /// The home folder of the user.
    pub fn home(&self) -> &Path {
        self.home.path()
    }

    /// The list of widgets as it was written last; empty before the first frame.
    fn list(&self) -> String {
        std::fs::read_to_string(&self.widgets).unwrap_or_default()
    }

    fn widgets(&self) -> Vec<Widget> {
        Self::parse(&self.list())
    }

    fn parse(list: &str) -> Vec<Widget> {
        let widget = |line: &str| {
            let node: Node<'_> = serde_json::from_str(line).ok()?;
            let [left, top, right, bottom] = node.rect;
            Some(Widget {
                label: node.label.into_owned(),
                role: node.role.into_owned(),
                centre: (f64::midpoint(left, right), f64::midpoint(top, bottom)),
                enabled: node.enabled,
            })
        };
        list.lines().filter_map(widget).collect()
    }

    /// Waits until something whose label contains a text is on the screen.
    ///
    /// # Panics
    /// When it does not come; the screen is photographed.
    pub fn until_seen(&mut self, text: &str) {
        self.until(&format!("{text:?}"), |widgets| widgets.iter().any(|widget| widget.label.contains(text)));
    }

    /// The first label that begins with a text.
    ///
    /// # Panics
    /// When there is none.
    pub fn label(&mut self, start: &str) -> String {
        self.until(&format!("{start:?}"), |widgets| widgets.iter().any(|widget| widget.label.starts_with(start)));
        let found = self.widgets().into_iter().find(|widget| widget.label.starts_with(start));
        found.map(|widget| widget.label).unwrap_or_default()
    }

    /// Waits until the label that begins with a text has changed.
    ///
    /// # Panics
    /// When it does not change.
    pub fn until_other(&mut self, start: &str, before: &str) {
        let is_other = |widget: &Widget| widget.label.starts_with(start) && widget.label != before;
        self.until(&format!("another {before:?}"), |widgets| widgets.iter().any(is_other));
    }

    fn until(&mut self, what: &str, mut is_so: impl FnMut(&[Widget]) -> bool) {
        let deadline = Instant::now() + PATIENCE;
        let mut looked_at = None;
        loop {
            // Most changes of files are those of an unchanged list.
            let list = self.list();
            if looked_at.as_ref() != Some(&list) {
                if is_so(&Self::parse(&list)) {
                    return;
                }
                looked_at = Some(list);
            }
            if Instant::now() > deadline {
                self.photograph("gave-up");
                let labels: Vec<String> = self.widgets().into_iter().map(|widget| widget.label).collect();
                panic!("waiting for {what}; there are {labels:#?}");
            }
            assert!(
                self.window.try_wait().ok().flatten().is_none(),
                "the workbench has ended while waiting for {what}"
            );
            self.watch.changes_within(LOOK);
        }
    }

    /// Clicks the button whose label is, or begins with, a text, once it has stopped moving.
    ///
    /// # Panics
    /// When there is none that can be pressed.
    pub fn click(&mut self, label: &str) {
        let mut at = self.place_of(label);
        loop {
            // A pane that has just come to the front moves its widgets for a frame or two.
            self.frame_drawn();
            let next = self.place_of(label);
            if next == at {
                break;
            }
            at = next;
        }
        match &self.surface {
            Surface::Screen { display, .. } => {
                let (x, y) = at;
                xdotool(display, &["mousemove", &format!("{x:.0}"), &format!("{y:.0}"), "click", "1"]);
            }
            Surface::Page { browser, tab, touch: true } => browser.tap(tab, at),
            Surface::Page { browser, tab, touch: false } => browser.click(tab, at),
        }
        self.clicks += 1;
    }

    /// Waits until another frame was drawn, but not for long: a window in which nothing changes is not drawn again.
    pub fn frame_drawn(&self) {
        self.watch.forget();
        for _ in 0..CHANGES_OF_A_FRAME {
            self.watch.changes_within(LOOK);
        }
    }

    /// The centre of a button that can be pressed; waits for it.
    ///
    /// # Panics
    /// When it does not come.
    pub fn place_of(&mut self, label: &str) -> (f64, f64) {
        let pressable = |widget: &Widget| {
            widget.enabled && widget.role != "Label" && (widget.label == label || widget.label.starts_with(label))
        };
        let mut place = None;
        self.until(&format!("the button {label:?}"), |widgets| {
            let exact = widgets.iter().find(|widget| pressable(widget) && widget.label == label);
            place = exact.or_else(|| widgets.iter().find(|widget| pressable(widget))).map(|widget| widget.centre);
            place.is_some()
        });
        place.expect("it was there")
    }

    /// Presses a key by its name, for example `space` or `ctrl+z`.
    pub fn press(&mut self, key: &str) {
        match &self.surface {
            Surface::Screen { display, .. } => xdotool(display, &["key", key]),
            Surface::Page { browser, tab, .. } => browser.press(tab, key),
        }
        self.clicks += 1;
    }

    /// Sends the workbench a signal by its name, `TERM`, and waits for its end: the status that it exits with, and how long
    /// that takes.
    pub fn end_by(&mut self, signal: &str) -> (ExitStatus, Duration) {
        let asked = Instant::now();
        process::signal(&self.window, signal);
        let status = process::end_of(&mut self.window);
        (status, asked.elapsed())
    }

    /// An image of the screen, `NAME.png`, and where it is; the pointer is moved out of the way first, and its tooltip closes.
    pub fn photograph(&self, name: &str) -> PathBuf {
        match &self.surface {
            Surface::Screen { display, .. } => xdotool(display, &["mousemove", "700", "12"]),
            Surface::Page { browser, tab, touch: false } => browser.point(tab, (700.0, 12.0)),
            Surface::Page { .. } => {}
        }
        // The window is drawn again without what the pointer was over, then without its tooltip. The list of widgets is
        // written before its frame is on the screen, so that one more has to begin.
        self.frame_drawn();
        self.frame_drawn();
        let deadline = Instant::now() + PATIENCE;
        while self.widgets().iter().any(|widget| widget.role == "Tooltip") && Instant::now() < deadline {
            self.watch.changes_within(LOOK);
        }
        let file = self.shots.join(format!("{name}.png"));
        match &self.surface {
            Surface::Screen { display, .. } => {
                let taken =
                    Command::new("import").args(["-window", "root"]).arg(&file).env("DISPLAY", display).status();
                assert!(taken.is_ok_and(|status| status.success()), "{}", file.display());
            }
            Surface::Page { browser, tab, .. } => {
                std::fs::write(&file, browser.photograph(tab)).expect("written");
            }
        }
        file
    }
}

fn xdotool(display: &str, arguments: &[&str]) {
    let done = Command::new("xdotool").args(arguments).env("DISPLAY", display).status();
    assert!(done.is_ok_and(|status| status.success()), "xdotool {arguments:?}");
}

impl Drop for Desktop {
    fn drop(&mut self) {
        let screen = match &mut self.surface {
            Surface::Screen { server, .. } => Some(server),
            Surface::Page { .. } => None,
        };
        for child in std::iter::once(&mut self.window).chain(screen) {
            let _ended = child.kill().and_then(|()| child.wait()).is_ok();
        }
    }
}
