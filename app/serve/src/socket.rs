//! The connection of a page: frames and texts in one direction, the user's input in the other.
//!
//! Two tasks, so that input of a page that takes its frames slowly is still received: a STOP does not wait for a frame to
//! be sent or drawn.

use std::sync::Arc;
use std::time::Duration;

use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt as _, StreamExt as _};
use hyper::upgrade::Upgraded;
use hyper_util::rt::TokioIo;
use serde::Serialize;
use tokio::sync::{mpsc, watch};
use tokio::time::{Instant, interval, timeout};
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::protocol::{Message, Role, WebSocketConfig};

use super::difference::Shown;
use super::hub::{Hub, PageId, PageRequest, People, Words};
use super::input::PageMessage;
use super::reading::Control;
use super::upload::Uploads;

/// Longest message of a page \[bytes\]: includes pasted text.
const MOST_BYTES: usize = 64 << 10;

/// Frames in flight to a page. With one, the page would wait for the next after every one.
const ON_THE_WAY: u64 = 2;

/// How often a page is pinged.
const PING: Duration = Duration::from_secs(5);

/// How often the server reports to a page that it is alive: what the page shows is not live when it receives nothing.
const ALIVE: Duration = Duration::from_secs(1);

/// A page that was silent for this long is gone.
const GONE: Duration = Duration::from_secs(15);

/// A page that takes nothing for this long is gone.
const STALLED: Duration = Duration::from_secs(30);

type Socket = WebSocketStream<TokioIo<Upgraded>>;

/// What a page receives in addition to frames.
#[derive(Serialize)]
#[serde(tag = "t", rename_all = "snake_case")]
enum ServerMessage<'a> {
    /// Which page drives.
    People { you: bool, driven: bool, pages: usize },
    /// Texts of the page itself.
    Words {
        #[serde(flatten)]
        words: &'a Words,
    },
    /// The controls, for a screen reader.
    Controls { controls: &'a [Control] },
    /// The server is alive, also when there is nothing new.
    Alive,
}

/// Serves a page until it has disconnected.
pub async fn attend(upgraded: Upgraded, name: String, hub: Arc<Hub>, uploads: Arc<Uploads>) {
    let config = WebSocketConfig::default().max_message_size(Some(MOST_BYTES)).max_frame_size(Some(MOST_BYTES));
    let socket: Socket = WebSocketStream::from_raw_socket(TokioIo::new(upgraded), Role::Server, Some(config)).await;
    let (to_page, from_page) = socket.split();
    let Some((id, page_requests)) = hub.join(&name) else {
        tracing::info!("a page was not let in: there are too many");
        return;
    };
    let (shown, acknowledged) = watch::channel(0);
    // Either ends the other.
    let ended = tokio::select! {
        ended = write(to_page, id, &hub, page_requests, acknowledged) => ended,
        ended = read(from_page, id, &hub, &uploads, shown) => ended,
    };
    hub.leave(id);
    tracing::debug!(page = id, why = ended, "a page has gone");
}

async fn read(
    mut from_page: SplitStream<Socket>,
    id: PageId,
    hub: &Hub,
    uploads: &Uploads,
    shown: watch::Sender<u64>,
) -> &'static str {
    loop {
        let message = match timeout(GONE, from_page.next()).await {
            Ok(Some(Ok(message))) => message,
            Ok(Some(Err(_)) | None) => return "closed",
            Err(_late) => return "silent",
        };
        let text = match message {
            Message::Text(text) => text,
            Message::Ping(_) | Message::Pong(_) => continue,
            Message::Close(_) => return "closed by the page",
            Message::Binary(_) | Message::Frame(_) => return "not understood",
        };
        let Ok(reported) = serde_json::from_str::<PageMessage>(&text) else { return "not understood" };
        match reported {
            PageMessage::Input { events } => {
                if hub.done(id, events).is_err() {
                    return "too much";
                }
            }
            PageMessage::Screen(screen) if screen.is_sensible() => hub.screen(id, screen),
            PageMessage::Screen(_) => return "no size",
            PageMessage::Shown { number } => {
                shown.send_replace(number);
            }
            PageMessage::Visible { visible } => {
                if !visible {
                    hub.let_go(id);
                }
                hub.sees(id, Some(visible), None);
            }
            PageMessage::Reads { reads } => hub.reads(id, reads),
            PageMessage::Held => hub.held(id),
            PageMessage::Stop => hub.stop(),
            PageMessage::Drive => hub.drive(id),
            PageMessage::Open { upload } => {
                if let Some(folder) = uploads.finished(&upload) {
                    hub.open(id, folder);
                }
            }
        }
    }
}

async fn write(
    mut to_page: SplitSink<Socket, Message>,
    id: PageId,
    hub: &Hub,
    mut page_requests: mpsc::Receiver<PageRequest>,
    mut acknowledged: watch::Receiver<u64>,
) -> &'static str {
    let (mut frames, mut people, mut words) = (hub.frames(), hub.people(), hub.words());
    frames.mark_changed();
    people.mark_changed();
    words.mark_changed();
    let mut controls = hub.controls();
    let (mut pings, mut alive) = (interval(PING), interval(ALIVE));
    let mut page = Shown::default();
    let (mut sent, mut last) = (0, 0);
    let mut taken = Instant::now();
    loop {
        let has_room = sent - (*acknowledged.borrow()).min(sent) < ON_THE_WAY;
        hub.sees(id, None, Some(has_room));
        let message = tokio::select! {
            biased;
            changed = people.changed() => {
                if changed.is_err() {
                    return "ended";
                }
                if !hub.has(id) {
                    return "replaced";
                }
                let People { driver, pages } = *people.borrow_and_update();
                json(&ServerMessage::People { you: driver == Some(id), driven: driver.is_some(), pages })
            }
            changed = words.changed() => {
                if changed.is_err() {
                    return "ended";
                }
                let words = words.borrow_and_update();
                json(&ServerMessage::Words { words: &words })
            }
            changed = controls.changed() => {
                if changed.is_err() {
                    return "ended";
                }
                let controls = Arc::clone(&controls.borrow_and_update());
                if !hub.is_read(id) {
                    continue;
                }
                json(&ServerMessage::Controls { controls: &controls })
            }
            Some(request) = page_requests.recv() => json(&request),
            changed = acknowledged.changed() => {
                if changed.is_err() {
                    return "ended";
                }
                taken = Instant::now();
                continue;
            }
            changed = frames.changed(), if has_room => {
                if changed.is_err() {
                    return "ended";
                }
                let (number, frame) = frames.borrow_and_update().clone();
                if number == 0 || number == last {
                    continue;
                }
                last = number;
                sent += 1;
                // On another thread: the threads that listen to pages have no time for it.
                let stated = tokio::task::spawn_blocking(move || {
                    let message = page.message(sent, &frame);
                    (page, message)
                });
                let Ok((after, message)) = stated.await else { return "failed" };
                page = after;
                Message::binary(message)
            }
            _ = alive.tick() => json(&ServerMessage::Alive),
            _ = pings.tick() => {
                if !has_room && taken.elapsed() > STALLED {
                    return "stalled";
                }
                Message::Ping(Vec::new().into())
            }
        };
        match timeout(STALLED, to_page.send(message)).await {
            Ok(Ok(())) => {}
            Ok(Err(_)) => return "closed",
            Err(_late) => return "stalled",
        }
    }
}

fn json(stated: &impl Serialize) -> Message {
    // Only strings and numbers: serialization cannot fail.
    Message::text(serde_json::to_string(stated).unwrap_or_default())
}
