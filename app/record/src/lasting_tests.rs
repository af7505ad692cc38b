use std::sync::Arc;

use handeye_geometry::frames::Pose;
use handeye_session::{CaptureId, Document};

use super::*;
use handeye_workbench::model::{Observed, Severity, Step};
use handeye_workbench::session::start;

fn reported(words: &str) -> Entry {
    Entry::Message { severity: Severity::Info, words: words.to_owned() }
}

fn document(captures: &[u32]) -> Entry {
    let mut document = Document::new(start::meta(None, String::new()));
    for id in captures {
        let record = handeye_workbench::testing::sample::captured().session.document.captures[0].clone();
        document.captures.push(handeye_session::CaptureRecord { id: CaptureId(*id), ..record });
    }
    Entry::Document { folder: None, document: Arc::new(document) }
}

fn observed(id: u32, width: u32) -> Entry {
    let observed = Observed { corners: None, depth: None, image_size: (width, 1), thumbnail: Arc::default() };
    Entry::Observed { id: CaptureId(id), observed: Arc::new(observed) }
}

fn robot(sim_time_s: f64) -> Entry {
    Entry::Robot { sim_time_s, base_from_tip: Pose::identity(), joints_rad: [0.0; 6].into() }
}

fn words(lasting: &Lasting) -> Vec<String> {
    let word = |item: &Item| match item {
        Item::Begin(recording) => format!("begin {}", recording.id),
        Item::Name(name) => format!("name {name}"),
        Item::Entry(Entry::Message { words, .. }) => words.clone(),
        Item::Entry(Entry::Document { document, .. }) => format!("{} captures", document.captures.len()),
        Item::Entry(Entry::Observed { id, observed }) => format!("{id:?} {}", observed.image_size.0),
        Item::Entry(Entry::Step(step)) => format!("{step:?}"),
        Item::Entry(_) => "another".to_owned(),
    };
    lasting.iter().map(word).collect()
}

#[test]
fn a_newer_document_takes_the_place_of_the_older_one_and_its_deleted_captures_go() {
    let mut lasting = Lasting::default();
    for entry in [document(&[1, 2]), reported("a"), observed(1, 10), observed(2, 20), observed(1, 11), document(&[1])] {
        lasting.put(entry);
    }
    assert_eq!(words(&lasting), ["1 captures", "a", "CaptureId(1) 11"]);
}

#[test]
fn nothing_of_an_earlier_recording_is_replaced_by_a_later_one() {
    let mut lasting = Lasting::default();
    let recording = Recording { id: "two".to_owned(), name: String::new(), folder: None };
    lasting.put(document(&[1]));
    lasting.put(observed(1, 10));
    lasting.push(Item::Begin(recording));
    lasting.put(document(&[]));
    assert_eq!(words(&lasting), ["1 captures", "CaptureId(1) 10", "begin two", "0 captures"]);
}

#[test]
fn another_recording_begins_with_what_is_true_of_every_one() {
    let mut lasting = Lasting::default();
    for entry in [document(&[1]), Entry::Step(Step::Solve), reported("a")] {
        lasting.put(entry);
    }
    lasting.begin_another();
    assert_eq!(words(&lasting), ["Solve"]);
}

#[test]
fn a_long_day_of_messages_stays_a_short_list_that_ends_with_the_newest() {
    let mut lasting = Lasting::default();
    lasting.put(document(&[]));
    for number in 0..MAX_MESSAGE + 7 {
        lasting.put(reported(&number.to_string()));
    }
    let words = words(&lasting);
    assert_eq!(words.len(), MAX_MESSAGE + 1);
    assert_eq!((words[0].as_str(), words[1].as_str()), ("0 captures", "7"));
}

#[test]
fn the_trail_stays_short_and_reaches_from_the_first_state_to_about_the_last() {
    let mut trail = Trail::default();
    let end_s = 50_000.0;
    let mut now_s = 0.0;
    while now_s < end_s {
        trail.put(&robot(now_s));
        now_s += 0.05;
    }
    let times: Vec<f64> = trail.iter().filter_map(time_of).collect();
    assert!(times.len() <= MAX_TRAIL && times.len() > MAX_TRAIL / 4, "{}", times.len());
    assert_eq!(times.first(), Some(&0.0));
    assert!(times.last().is_some_and(|last| end_s - last < end_s / 100.0), "{:?}", times.last());
    assert!(times.is_sorted());
}

fn time_of(entry: &Entry) -> Option<f64> {
    if let Entry::Robot { sim_time_s, .. } = entry { Some(*sim_time_s) } else { None }
}
