use std::path::Path;
use std::sync::{Condvar, Mutex};
use std::time::Instant;

use handeye_session::Document;
use rerun::log::LogMsg;
use rerun::sink::CallbackSink;

use super::super::lasting::Recording;
use super::super::stream::{SharedSink, Stream, Target, file_sink};
use super::*;
use handeye_workbench::model::{Severity, ViewerState};
use handeye_workbench::recording::Recording as _;
use handeye_workbench::session::start;
use handeye_workbench::text::Language;

const SOON: Duration = Duration::from_secs(30);

fn start(choice: RerunChoice) -> Recorder {
    Recorder::start(RecorderOptions {
        choice,
        pace: Pace::Live,
        beside_session: true,
        web: WebViewer::AtAddress,
        waker: Arc::new(|| {}),
    })
    .expect("a recorder")
}

fn document(folder: &Path) -> Entry {
    let document = Document::new(start::meta(None, String::new()));
    Entry::Document { folder: Some(folder.to_path_buf()), document: Arc::new(document) }
}

fn reported(words: &str) -> Entry {
    Entry::Message { severity: Severity::Info, words: words.to_owned() }
}

fn robot(sim_time_s: f64) -> Entry {
    Entry::Robot { sim_time_s, base_from_tip: handeye_geometry::frames::Pose::identity(), joints_rad: [0.1; 6].into() }
}

/// The entities of a recording, and how many rows each has.
fn entities(file: &Path) -> std::collections::BTreeMap<String, u64> {
    let bytes = std::fs::File::open(file).expect("the file");
    let decoder = rerun::external::re_log_encoding::DecoderApp::decode_eager(std::io::BufReader::new(bytes));
    let mut entities = std::collections::BTreeMap::new();
    for message in decoder.expect("a recording") {
        if let LogMsg::ArrowMsg(store, message) = message.expect("a message")
            && store.is_recording()
        {
            let chunk = rerun::log::Chunk::from_arrow_msg(&message).expect("a chunk");
            *entities.entry(chunk.entity_path().to_string()).or_default() += chunk.num_rows() as u64;
        }
    }
    entities
}

#[test]
fn a_recording_that_is_off_takes_entries_and_does_nothing() {
    let recorder = start(RerunChoice::Off);
    assert!(!recorder.is_on());
    recorder.note(reported("a"));
    recorder.open(ViewerRequest::Best);
    assert_eq!(recorder.state(), RerunState::default());
}

#[test]
fn a_long_recording_holds_nothing_back_until_it_is_closed() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("recording.rrd");
    let target = Target::File { path: path.clone(), sink: file_sink(&path).expect("a sink") };
    let recording = Recording { id: "long".to_owned(), name: "long".to_owned(), folder: None };
    let mut stream = Stream::open(&target, &recording).expect("a stream");
    for second in 0..300 {
        stream.write_live(&robot(f64::from(second))).expect("written");
        stream.flush().expect("flushed");
    }
    let before = std::fs::metadata(&path).expect("the file").len();
    drop((stream, target));
    let after = std::fs::metadata(&path).expect("the file").len();
    assert!(after - before < 1024, "{} bytes were held for {before} bytes of 300 chunks", after - before);
    assert!(!entities(&path).is_empty());
}

#[test]
fn every_session_gets_a_file_of_its_own_with_what_was_before_its_first_capture() {
    let (one, two) = (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
    let mut recorder = start(RerunChoice::Record);
    recorder.note(reported("before there is a session"));
    recorder.note(document(one.path()));
    recorder.note(reported("in the first"));
    recorder.note(document(two.path()));
    recorder.note(document(one.path()));
    assert!(recorder.finish(SOON));
    let first = entities(&one.path().join("recording.rrd"));
    assert_eq!(first.get("/log"), Some(&2), "{first:?}");
    let second = entities(&two.path().join("recording.rrd"));
    assert_eq!(second.get("/log"), None, "{second:?}");
    assert!(second.contains_key("/base"), "{second:?}");
    assert!(one.path().join("recording-2.rrd").is_file(), "opened again");
}

#[test]
fn a_folder_that_cannot_be_written_is_said_once_and_the_work_goes_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut recorder = start(RerunChoice::Record);
    recorder.note(document(&folder.path().join("none")));
    for number in 0..10 {
        recorder.note(reported(&number.to_string()));
    }
    let shared = Arc::clone(recorder.shared.as_ref().expect("it is on"));
    assert!(recorder.finish(SOON));
    let mut words = Vec::new();
    shared.drain(&mut |event| {
        if let Event::Messages(handeye_workbench::messages::Event::Notice { text, .. }) = event {
            words.push(text.in_language(Language::English));
        }
    });
    assert_eq!(words.len(), 1, "{words:?}");
    assert!(words[0].contains("the session itself is safe"), "{words:?}");
}

#[test]
fn a_named_file_that_cannot_be_made_is_an_error_at_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let choice = RerunChoice::Save(folder.path().join("none").join("a.rrd"));
    let options = RecorderOptions {
        choice,
        pace: Pace::Everything,
        beside_session: false,
        web: WebViewer::AtAddress,
        waker: Arc::new(|| {}),
    };
    assert!(Recorder::start(options).is_err());
}

/// A sink that blocks until it is released.
#[derive(Default)]
struct Gate {
    open: Mutex<bool>,
    bell: Condvar,
}

impl Gate {
    fn pass(&self) {
        let mut open = self.open.lock().expect("the gate");
        while !*open {
            open = self.bell.wait(open).expect("the gate");
        }
    }

    fn open(&self) {
        *self.open.lock().expect("the gate") = true;
        self.bell.notify_all();
    }
}

#[test]
fn a_viewer_that_comes_late_gets_what_lasts_and_the_trail_of_the_robot() {
    let folder = tempfile::tempdir().expect("a folder");
    let recorder = start(RerunChoice::Record);
    for second in 0..10 {
        recorder.note(robot(f64::from(second)));
    }
    recorder.note(reported("early"));
    recorder.note(document(folder.path()));
    let shared = Arc::clone(recorder.shared.as_ref().expect("it is on"));
    let (sent, messages) = crossbeam_channel::unbounded();
    let sink = SharedSink(Arc::new(CallbackSink::new(move |batch: &[LogMsg]| {
        for message in batch {
            if let LogMsg::ArrowMsg(store, message) = message
                && store.is_recording()
            {
                let chunk = rerun::log::Chunk::from_arrow_msg(message).expect("a chunk");
                sent.send((chunk.entity_path().to_string(), chunk.num_rows())).expect("the test listens");
            }
        }
    })));
    shared.write_to_viewers(Target::Viewers { lasting: sink.clone(), live: sink });
    let mut rows = std::collections::BTreeMap::new();
    while rows.get("/base/tip").is_none_or(|&rows| rows < 10) || !rows.contains_key("/log") {
        let (entity, count) = messages.recv_timeout(SOON).expect("everything that lasts");
        *rows.entry(entity).or_insert(0) += count;
    }
}

#[test]
fn the_web_viewer_and_its_server_are_there_for_this_machine_only() {
    let recorder = start(RerunChoice::Web);
    let url = loop {
        match recorder.state().viewer {
            ViewerState::Web { url } => break url,
            ViewerState::Opening => std::thread::yield_now(),
            other => panic!("{other:?}"),
        }
    };
    assert!(url.starts_with("http://127.0.0.1:"), "{url}");
    let decoded = url.replace("%2B", "+").replace("%3A", ":").replace("%2F", "/");
    let sources: Vec<_> = decoded.split("&url=").skip(1).collect();
    assert_eq!(sources.len(), 1, "{decoded}");
    for source in sources {
        let address = source.trim_start_matches("rerun+http://").trim_end_matches("/proxy");
        assert!(address.starts_with("127.0.0.1:"), "{address}");
        assert!(std::net::TcpStream::connect(address).is_ok(), "{address}");
    }
    recorder.open(ViewerRequest::Web);
    while recorder.state().viewer == ViewerState::Opening {
        std::thread::yield_now();
    }
    assert_eq!(recorder.state().viewer, ViewerState::Web { url }, "the same page again");
}

mod slow {
    use super::*;

    #[test]
    fn a_viewer_that_takes_nothing_holds_up_neither_the_caller_nor_the_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let gate = Arc::new(Gate::default());
        let at_gate = Arc::clone(&gate);
        let sink = SharedSink(Arc::new(CallbackSink::new(move |_| at_gate.pass())));
        let mut recorder = start(RerunChoice::Record);
        let shared = Arc::clone(recorder.shared.as_ref().expect("it is on"));
        shared.write_to_viewers(Target::Viewers { lasting: sink.clone(), live: sink });
        recorder.note(document(folder.path()));
        let began = Instant::now();
        let mut longest = Duration::ZERO;
        for round in 0..20_000 {
            let call = Instant::now();
            recorder.note(robot(f64::from(round) * 0.01));
            recorder.note(reported("hello"));
            longest = longest.max(call.elapsed());
        }
        // 40,000 entries; one that waited for the viewer would wait for ever.
        assert!(began.elapsed() < SOON, "{:?}", began.elapsed());
        println!("40,000 entries in {:?}, the longest call {longest:?}", began.elapsed());
        assert!(!recorder.finish(Duration::from_millis(200)), "the viewer cannot have taken everything");
        let file = folder.path().join("recording.rrd");
        let lines = entities(&file).get("/log").copied().unwrap_or_default();
        assert!(lines > 0, "the file has what was said");
        gate.open();
    }
}
