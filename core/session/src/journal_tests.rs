use std::fs;

use proptest::prelude::*;
use serde_json::json;

use super::*;
use crate::tests::{folder, meta, names, pose, record, store_with};
use crate::{Role, Session, Store, TaughtChange, session_file};
use handeye_dataset::taught_poses::{Goal, TaughtPose};
use handeye_estimate::handeye::Mode;

fn exclude(id: u32, excluded: bool) -> Edit {
    Edit::SetExcluded { ids: vec![CaptureId(id)], excluded }
}

/// A small session, closed, with its journal and where in it every line ends.
fn closed_session(folder: &Path) -> (Vec<u8>, Vec<usize>) {
    let mut store = store_with(folder, 2);
    store.apply(exclude(1, true)).expect("exclude");
    store.undo().expect("undo");
    store.apply(Edit::SetExportNames(json!({"base": "κ \n\"link\""}))).expect("names");
    drop(store);
    let bytes = fs::read(folder.join(JOURNAL)).expect("journal");
    let ends = (1..=bytes.len()).filter(|&end| bytes[end - 1] == b'\n').collect();
    (bytes, ends)
}

#[test]
fn a_journal_that_is_torn_anywhere_opens_with_what_was_acknowledged() {
    let dir = folder();
    let (bytes, ends) = closed_session(dir.path());
    assert_eq!(ends.len(), 6);
    let states: Vec<History> = ends.iter().map(|&end| replay(&bytes[..end]).expect("whole").history).collect();
    let path = dir.path().join(JOURNAL);
    // The last three lines.
    for cut in ends[2]..bytes.len() {
        // The document as it is when the program is killed while it writes the journal: of the entry before.
        let whole = ends.iter().filter(|&&end| end <= cut).count();
        fs::write(&path, &bytes[..cut]).expect("write");
        let history = &states[whole - 1];
        let json = session_file::to_json(history.document(), whole as u64, history.last_capture()).expect("text");
        fs::write(dir.path().join("session.json"), json).expect("write");
        assert_eq!(Session::open(dir.path()).expect("read").document, *history.document(), "cut to {cut} bytes");
        assert_eq!(fs::read(&path).expect("journal").len(), cut, "reading has changed the journal");

        let mut store = Store::open(dir.path()).unwrap_or_else(|e| panic!("cut to {cut} bytes: {e}"));
        assert_eq!(store.history(), history, "cut to {cut} bytes");
        let committed = &bytes[..ends[whole - 1]];
        assert_eq!(fs::read(&path).expect("journal"), committed);
        let torn = dir.path().join("journal.torn-1");
        assert_eq!(torn.exists(), cut > committed.len(), "cut to {cut} bytes");
        if torn.exists() {
            assert_eq!(fs::read(&torn).expect("kept"), &bytes[committed.len()..cut]);
            fs::remove_file(&torn).expect("remove");
        }
        store.apply(Edit::SetExportNames(json!(cut))).expect("the journal goes on");
        let after = store.history().clone();
        drop(store);
        assert_eq!(*Store::open(dir.path()).expect("open").history(), after);
    }
}

#[test]
fn torn_ends_are_kept_one_beside_the_other() {
    let dir = folder();
    drop(store_with(dir.path(), 1));
    // Blocks that reached the disk in another order, also with a line end in them.
    for torn in [&b"\0\0\0\0"[..], b"{\"seq\":3", b"\0\0}\n", b"\n"] {
        let mut file = File::options().append(true).open(dir.path().join(JOURNAL)).expect("open");
        file.write_all(torn).expect("write");
        assert_eq!(Store::open(dir.path()).expect("open").document().captures.len(), 1);
    }
    let kept: Vec<_> = names(dir.path()).into_iter().filter(|name| name.starts_with("journal.torn")).collect();
    assert_eq!(kept, ["journal.torn-1", "journal.torn-2", "journal.torn-3", "journal.torn-4"]);
    assert_eq!(fs::read(dir.path().join("journal.torn-3")).expect("kept"), b"\0\0}\n");
}

#[test]
fn damage_in_the_middle_is_refused_with_file_and_row_and_left_alone() {
    let dir = folder();
    let (bytes, ends) = closed_session(dir.path());
    let path = dir.path().join(JOURNAL);
    let refused = |damaged: &[u8], row: u64, why: &str| {
        fs::write(&path, damaged).expect("write");
        let before = names(dir.path());
        for error in [Session::open(dir.path()).expect_err(why), Store::open(dir.path()).expect_err(why)] {
            assert_eq!(error.file, path);
            let SessionProblem::Damaged { row: at, .. } = error.problem else { panic!("{why}: {error}") };
            assert_eq!(at, row, "{why}: {error}");
            let text = error.to_string();
            assert!(text.contains(&format!("row {row}")) && text.contains("move it out"), "{why}: {text}");
            assert!(!text.contains('\n'), "{why}: {text}");
        }
        assert_eq!((fs::read(&path).expect("journal"), names(dir.path())), (damaged.to_vec(), before), "{why}");
    };
    // Every byte of a line in the middle, the line end among them.
    for at in ends[1]..ends[2] {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x10;
        refused(&damaged, 3, &format!("byte {at}"));
    }
    for at in (0..ends[0]).step_by(7) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x01;
        refused(&damaged, 1, &format!("byte {at} of the beginning"));
    }
    let without_row_3 = [&bytes[..ends[1]], &bytes[ends[2]..]].concat();
    refused(&without_row_3, 3, "a row is missing");
    let twice = [&bytes[..ends[2]], &bytes[ends[1]..]].concat();
    refused(&twice, 4, "a row is there twice");
    refused(&[&bytes[..ends[1]], b"\n", &bytes[ends[1]..]].concat(), 3, "an empty row");
    refused(&[], 1, "an empty journal");
    // The document has this entry, so it was acknowledged and is not one that never happened.
    let mut damaged = bytes.clone();
    damaged[ends[4] + 10] ^= 0x10;
    refused(&damaged, 6, "the last row");
    refused(&bytes[..bytes.len() - 1], 6, "the last line end");
}

#[test]
fn an_entry_that_is_whole_and_unknown_is_never_cut_off() {
    let dir = folder();
    drop(store_with(dir.path(), 1));
    let path = dir.path().join(JOURNAL);
    let good = fs::read_to_string(&path).expect("journal");
    let line = |body: &str| format!("{body},\"sha256\":\"{}\"}}\n", checksum(body.as_bytes()));
    fs::write(&path, format!("{good}{}", line("{\"seq\":3,\"entry\":{\"edit\":{\"paint\":1}}"))).expect("write");
    let error = Store::open(dir.path()).expect_err("a later kind");
    assert!(matches!(error.problem, SessionProblem::Unknown { row: 3, .. }), "{error}");
    fs::write(&path, format!("{good}{}", line("{\"seq\":3,\"entry\":\"redo\""))).expect("write");
    let error = Store::open(dir.path()).expect_err("nothing to redo");
    assert!(matches!(error.problem, SessionProblem::Damaged { row: 3, .. }), "{error}");

    let begin = good.lines().next().expect("a first line");
    let body = &begin[..begin.len() - 29];
    for (from, to, needle) in [
        ("\"version\":\"1.0\"", "\"version\":\"2.0\"", "version \"2.0\""),
        ("\"format\":\"handeye-journal\"", "\"format\":\"diary\"", "format is \"diary\""),
        ("\"begin\"", "\"end\"", "no begin"),
    ] {
        assert!(body.contains(from), "{body}");
        fs::write(&path, line(&body.replace(from, to))).expect("write");
        fs::remove_file(dir.path().join("session.json")).ok();
        let error = Store::open(dir.path()).expect_err(to).to_string();
        assert!(error.contains(needle), "{error}");
    }
}

#[test]
fn a_document_of_something_else_is_not_replaced_by_the_journal() {
    let dir = folder();
    drop(store_with(dir.path(), 1));
    let path = dir.path().join("session.json");
    for text in ["{\"format\": \"jupyter\"}", "{\"format\": \"handeye-session\", \"version\": \"2.0\"}"] {
        fs::write(&path, text).expect("write");
        assert!(Store::open(dir.path()).is_err(), "{text}");
        assert_eq!(fs::read_to_string(&path).expect("text"), text);
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_changes_nothing_and_a_journal_that_cannot_be_put_back_takes_no_more() {
    let dir = folder();
    drop(store_with(dir.path(), 1));
    let bytes = fs::read(dir.path().join(JOURNAL)).expect("journal");
    let mut journal = Journal::open(dir.path(), bytes.len() as u64, 2).expect("open");
    journal.file = File::options().write(true).open("/dev/full").expect("a full disk");
    let prepared = journal.prepare(&Entry::Undo).expect("a line");
    let error = journal.append(&prepared).expect_err("full");
    assert!(matches!(error.problem, SessionProblem::Unwritable(_)), "{error}");
    assert_eq!(journal.sequence(), 2);
    // Nothing can be cut off from that file either.
    let error = journal.prepare(&Entry::Undo).err().expect("broken");
    assert!(matches!(error.problem, SessionProblem::Broken), "{error}");
    assert_eq!(fs::read(dir.path().join(JOURNAL)).expect("journal"), bytes);
}

#[derive(Debug, Clone)]
enum Step {
    Capture,
    Delete(Vec<u32>),
    Exclude(Vec<u32>, bool),
    Role(Vec<u32>, Role),
    Mode(Mode),
    Taught(Vec<f64>),
    Names(String),
    Undo,
    Redo,
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let ids = || prop::collection::vec(1_u32..8, 1..3);
    let step = prop_oneof![
        4 => Just(Step::Capture),
        1 => ids().prop_map(Step::Delete),
        1 => (ids(), any::<bool>()).prop_map(|(ids, excluded)| Step::Exclude(ids, excluded)),
        1 => ids().prop_map(|ids| Step::Role(ids, Role::Verification)),
        1 => prop_oneof![Just(Mode::EyeInHand), Just(Mode::EyeToHand)].prop_map(Step::Mode),
        1 => prop::collection::vec(prop::num::f64::NORMAL, 0..4).prop_map(Step::Taught),
        1 => any::<String>().prop_map(Step::Names),
        4 => Just(Step::Undo),
        3 => Just(Step::Redo),
    ];
    prop::collection::vec(step, 1..60)
}

/// The entry of a step.
fn entry(step: &Step, history: &History) -> Entry {
    let ids = |ids: &[u32]| ids.iter().copied().map(CaptureId).collect::<Vec<_>>();
    Entry::Edit(match step {
        Step::Capture => {
            let id = history.next_capture_id().expect("few captures");
            Edit::AddCapture(Box::new(record(id.0)))
        }
        Step::Delete(which) => Edit::DeleteCaptures(ids(which)),
        Step::Exclude(which, excluded) => Edit::SetExcluded { ids: ids(which), excluded: *excluded },
        Step::Role(which, role) => Edit::SetRole { ids: ids(which), role: *role },
        Step::Mode(mode) => Edit::SetMode(*mode),
        Step::Taught(angles) => {
            let joints = |i: usize| {
                if i.is_multiple_of(2) { Goal::Joints(vec![angles[i]; 6]) } else { Goal::Tip(pose(i as u8)) }
            };
            let poses = (0..angles.len()).map(|i| TaughtPose::new(format!("p{i}"), joints(i))).collect();
            Edit::SetTaught { change: TaughtChange::Replace, poses }
        }
        Step::Names(name) => Edit::SetExportNames(json!({ "base": name })),
        Step::Undo => return Entry::Undo,
        Step::Redo => return Entry::Redo,
    })
}

mod slow {
    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn a_journal_replays_to_the_same_document_and_stacks(steps in steps()) {
            let mut history = History::new(Document::new(meta()));
            let (begin, _) = encode(1, &Entry::begin(&history)).expect("begin");
            let mut bytes = begin.into_bytes();
            let mut sequence = 1;
            // The end of every line, and the state there.
            let mut states = vec![(bytes.len(), history.clone())];
            for step in &steps {
                let (line, read) = encode(sequence + 1, &entry(step, &history)).expect("a line");
                let before = history.clone();
                let done = match read {
                    Entry::Edit(edit) => history.apply(edit),
                    Entry::Undo => history.undo(),
                    _ => history.redo(),
                };
                // A step that does not fit changes nothing and is not written down.
                if done.is_err() {
                    prop_assert_eq!(&history, &before);
                    continue;
                }
                sequence += 1;
                bytes.extend(line.as_bytes());
                states.push((bytes.len(), history.clone()));
                if matches!(step, Step::Undo) {
                    let mut again = history.clone();
                    again.redo().expect("what was undone can be redone");
                    prop_assert_eq!(again, before);
                } else {
                    let mut back = history.clone();
                    back.undo().expect("what was done can be undone");
                    prop_assert_eq!(back.document(), before.document());
                }
            }
            for (length, state) in &states {
                let replayed = replay(&bytes[..*length]).expect("whole");
                prop_assert_eq!(&replayed.history, state);
                prop_assert_eq!(replayed.length, *length);
                // To the last bit, and not only equal.
                let text = |history: &History| format!("{history:?}");
                prop_assert_eq!(text(&replayed.history), text(state));
            }
            let (last, state) = &states[states.len() - 1];
            let from = states[states.len().saturating_sub(4)].0;
            for cut in from..*last {
                let (length, state) = states.iter().rev().find(|(length, _)| *length <= cut).expect("the first line");
                let replayed = replay(&bytes[..cut]).expect("torn");
                prop_assert_eq!((&replayed.history, replayed.length), (state, *length));
            }
            let json = session_file::to_json(state.document(), sequence, state.last_capture()).expect("text");
            let file = session_file::from_json(&json).expect("reads");
            prop_assert_eq!((&file.document, file.sequence), (&**state.document(), Some(sequence)));
        }
    }
}
