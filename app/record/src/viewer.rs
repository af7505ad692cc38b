//! Opening viewers, each on a thread of its own: programs are started and watched, which takes time.

use std::process::Child;
use std::sync::Arc;
use std::thread::Builder;
use std::time::Duration;

use rerun::sink::{GrpcSink, GrpcSinkConnectionState};

use super::recorder::WebViewer;
use super::serving::Server;
use super::shared::{Shared, Viewers};
use super::stream::{SharedSink, Target};
use super::{browser, native};
use handeye_wording::text;
use handeye_workbench::model::{Severity, ViewerState};
use handeye_workbench::recording;
use handeye_workbench::recording::BROWSER_PATH;
use handeye_workbench::text::Text;

/// A native viewer that exits this soon has not shown anything.
const GRACE: Duration = Duration::from_secs(3);

/// Time within which a connected viewer has to answer.
const CONNECT: Duration = Duration::from_secs(10);

/// Between two checks of a connection.
const LOOK: Duration = Duration::from_millis(100);

#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ViewerRequest {
    /// The native one, or the web viewer if there is none.
    Best,
    /// The native one.
    Native,
    /// The web viewer.
    Web,
    /// One that runs already, at this address.
    Connect(String),
}

/// Opens a viewer unless one is being opened.
pub(super) fn open(shared: &Arc<Shared>, request: ViewerRequest) {
    if let Err(state) = shared.reports.begin_opening() {
        let text = match state {
            ViewerState::Native => text!("The Rerun viewer is open already"),
            ViewerState::Connected { url } => text!("The recording goes to the viewer at {url} already", url = url),
            _ => text!("The Rerun viewer is being opened"),
        };
        shared.reports.notice(Severity::Info, text);
        return;
    }
    let work = Arc::clone(shared);
    let request = if matches!(shared.web, WebViewer::Relayed(_)) { ViewerRequest::Web } else { request };
    let started = Builder::new().name("rerun-opener".to_owned()).spawn(move || {
        let opened = match request {
            ViewerRequest::Best => work.native().or_else(|why| {
                tracing::info!("{}", why.in_language(handeye_workbench::text::Language::English));
                work.web()
            }),
            ViewerRequest::Native => work.native(),
            ViewerRequest::Web => work.web(),
            ViewerRequest::Connect(url) => work.connect(&url),
        };
        if let Err(why) = opened {
            work.failed(why);
        }
    });
    if let Err(error) = started {
        shared.failed(text!("No viewer was opened: {error}", error = error));
    }
}

impl Shared {
    fn failed(&self, why: Text) {
        self.reports.notice(Severity::Warning, why.clone());
        self.reports.set_viewer(ViewerState::Failed(why));
    }

    /// Runs a server for viewers, on the page of the web viewer if requested: returns the addresses of the recording and of the
    /// page.
    fn serve(&self, on_page: bool) -> Result<[String; 2], Text> {
        let mut viewers = self.viewers();
        if viewers.server.is_none() {
            let relay = if let WebViewer::Relayed(relay) = &self.web { Arc::clone(relay) } else { Arc::default() };
            let server =
                Server::start(&relay).map_err(|error| text!("No viewer was opened: {error}", error = error))?;
            self.write_to_viewers(server.target());
            viewers.server = Some(server);
        }
        viewers.on_page |= on_page;
        Ok(viewers.server.as_ref().map(|server| [server.url(), server.page()]).unwrap_or_default())
    }

    fn native(&self) -> Result<(), Text> {
        let program = native::find()?;
        let [url, _page] = self.serve(false)?;
        let cannot = |error: std::io::Error| {
            text!(
                "The native Rerun viewer {program} does not start: {error}",
                program = program.display(),
                error = error
            )
        };
        let mut child = native::start(&program, &url).map_err(cannot)?;
        if let Some(status) = native::wait(&mut child, GRACE, || self.has_ended()).map_err(cannot)?
            && !status.success()
        {
            return Err(text!(
                "The native Rerun viewer ended at once ({status}): it needs a screen and Vulkan or OpenGL",
                status = status
            ));
        }
        self.reports.set_viewer(ViewerState::Native);
        self.watch(child);
        Ok(())
    }

    /// Waits until the user closes the viewer.
    fn watch(&self, mut child: Child) {
        let ended = native::wait(&mut child, Duration::MAX, || self.has_ended());
        tracing::debug!(?ended, "the native viewer is no longer looked after");
        if self.has_ended() {
            return;
        }
        let mut viewers = self.viewers();
        if let Viewers { server: Some(server), on_page: true } = &*viewers {
            self.reports.set_viewer(ViewerState::Web { url: server.page() });
            return;
        }
        // No viewer is left: writing for viewers would only cost time.
        self.leave_viewers();
        viewers.server = None;
        drop(viewers);
        self.reports.set_viewer(ViewerState::Closed);
    }

    fn web(&self) -> Result<(), Text> {
        let [_recording, page] = self.serve(true)?;
        let url = if matches!(self.web, WebViewer::Relayed(_)) { BROWSER_PATH.to_owned() } else { page };
        self.reports.set_viewer(ViewerState::Web { url: url.clone() });
        if matches!(self.web, WebViewer::Here) {
            let opened = browser::open(&url);
            let text = if opened {
                text!("The recording is shown in the browser: {url}", url = url)
            } else {
                text!("The recording is shown at {url}: open it in a browser", url = url)
            };
            self.reports.notice(Severity::Info, text);
            if !opened {
                self.reports.report(recording::Event::NoBrowser);
            }
        }
        Ok(())
    }

    fn connect(&self, url: &str) -> Result<(), Text> {
        let uri = url.parse().map_err(|error| {
            text!("{url} is not the address of a Rerun viewer: {why}", url = url, why = format!("{error}"))
        })?;
        let uri: rerun::external::re_uri::ProxyUri = uri;
        let sink = Arc::new(GrpcSink::new(uri));
        let shared = SharedSink(Arc::clone(&sink) as Arc<dyn rerun::sink::LogSink>);
        self.write_to_viewers(Target::Viewers { lasting: shared.clone(), live: shared });
        let began = std::time::Instant::now();
        let mut reported = ViewerState::Opening;
        while !self.has_ended() {
            let now = match sink.status() {
                GrpcSinkConnectionState::Connecting { .. } if began.elapsed() < CONNECT => ViewerState::Opening,
                GrpcSinkConnectionState::Connecting { .. } => ViewerState::Failed(text!(
                    "Nothing answers at {url}: start a viewer there; the connection is tried again",
                    url = url
                )),
                GrpcSinkConnectionState::Connected => ViewerState::Connected { url: url.to_owned() },
                GrpcSinkConnectionState::Disconnected(_) => {
                    self.leave_viewers();
                    return Err(text!("The viewer at {url} has gone", url = url));
                }
            };
            if now != reported {
                reported.clone_from(&now);
                self.reports.set_viewer(now);
            }
            std::thread::sleep(LOOK);
        }
        Ok(())
    }
}
