//! Drivers that do not come up, as shell commands.

use std::path::Path;
use std::time::Instant;

use super::*;
use crate::{DriverSpec, Ending};

/// Longest wait for what comes within a second on a machine that has nothing else to do.
const PATIENCE: Duration = Duration::from_mins(1);

/// A driver that notes in a file that it was started, and then does this.
fn host(noted: &Path, then: &str) -> DriverHost {
    let script = format!("echo started >> '{}'; {then}", noted.display());
    let robot = DriverSpec::Command(vec!["sh".to_owned(), "-c".to_owned(), script]);
    let options = DriverOptions { hello: PATIENCE, ..DriverOptions::default() };
    DriverHost::new(DriverCellSpec { robot, camera: None }, options)
}

fn starts(noted: &Path) -> usize {
    std::fs::read_to_string(noted).map_or(0, |text| text.lines().count())
}

#[test]
fn a_driver_that_ends_at_once_is_not_started_by_everybody_who_asks_and_says_why_to_all() {
    let folder = tempfile::tempdir().unwrap();
    let noted = folder.path().join("noted");
    let host = host(&noted, "echo 'no camera is plugged in' >&2; exit 3");
    let cancel = CancelToken::default();
    let first = host.cell(&cancel).unwrap_err();
    let NoCell::Later { error: DriverError::Gone { why: Ending::Exited { last_line, .. }, .. }, tries: 1, .. } = &first
    else {
        panic!("{first:?}")
    };
    assert_eq!(last_line.as_deref(), Some("no camera is plugged in"));
    for _ in 0..1000 {
        // The longest pause is 15 s: whatever the machine does meanwhile, a thousand requests are not a thousand
        // starts.
        let NoCell::Later { error, .. } = host.cell(&cancel).unwrap_err() else { panic!("it is tried again") };
        assert!(error.to_string().contains("no camera is plugged in"), "{error}");
    }
    assert!(starts(&noted) <= 3, "{} starts", starts(&noted));
}

#[test]
fn nobody_starts_a_driver_while_it_rests_and_a_person_starts_it_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let noted = folder.path().join("noted");
    let host = host(&noted, "exit 3");
    let cancel = CancelToken::default();
    assert!(matches!(host.cell(&cancel), Err(NoCell::Later { .. })));
    host.rest();
    let NoCell::Rests { error: Some(error) } = host.cell(&cancel).unwrap_err() else { panic!("it does not rest") };
    assert!(error.to_string().contains("exit status: 3"), "{error}");
    assert_eq!(starts(&noted), 1);
    host.again();
    assert!(matches!(host.cell(&cancel), Err(NoCell::Later { tries: 1, .. })), "the tries are counted anew");
    assert_eq!(starts(&noted), 2);
}

#[test]
fn a_start_under_way_is_given_up_when_a_person_has_had_enough() {
    let folder = tempfile::tempdir().unwrap();
    let noted = folder.path().join("noted");
    let host = host(&noted, "exec sleep 600");
    let began = Instant::now();
    std::thread::scope(|scope| {
        let asked = scope.spawn(|| host.cell(&CancelToken::default()));
        while starts(&noted) == 0 {
            assert!(began.elapsed() < PATIENCE, "it was never started");
            std::thread::yield_now();
        }
        host.rest();
        assert!(matches!(asked.join().unwrap(), Err(NoCell::Rests { .. })));
    });
    assert!(began.elapsed() < PATIENCE, "the wait for `hello` was given up");
}

#[test]
fn a_driver_that_is_being_prepared_says_so_to_all_who_ask_and_is_started_once() {
    let folder = tempfile::tempdir().unwrap();
    let (noted, ready) = (folder.path().join("noted"), folder.path().join("ready"));
    let preparing = r#"{"type":"preparing","text":"packages are fetched"}"#;
    let hello = r#"{"type":"hello","protocol":1,"name":"slow","can":["image"],"camera":{"width":4,"height":2}}"#;
    let prepare = format!("until [ -e '{}' ]; do echo '{preparing}'; sleep 0.05; done", ready.display());
    let mut host = host(&noted, &format!("{prepare}; echo '{hello}'; cat > {}", folder.path().join("heard").display()));
    // Shorter than the preparation.
    host.options.hello = Duration::from_millis(300);
    let cancel = CancelToken::default();
    let began = Instant::now();
    while began.elapsed() < 3 * host.options.hello {
        let NoCell::Later { error, .. } = host.cell(&cancel).unwrap_err() else { panic!("it goes on") };
        assert!(matches!(&error, DriverError::Preparing { what, .. } if what == "packages are fetched"), "{error}");
    }
    std::fs::write(&ready, "").unwrap();
    let until = Instant::now() + PATIENCE;
    let cell = loop {
        match host.cell(&cancel) {
            Ok(cell) => break cell,
            Err(NoCell::Later { error: DriverError::Preparing { .. }, .. }) if Instant::now() < until => {}
            Err(why) => panic!("{why:?}"),
        }
    };
    assert_eq!((cell.robot().hello().name.as_str(), starts(&noted)), ("slow", 1));
}
