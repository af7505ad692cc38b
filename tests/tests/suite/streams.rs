//! Output that nobody reads, that does not fit on the disk, or that goes to something other than a file.

use std::fs::{self, File};
use std::io::Read as _;
use std::os::unix::fs::{FileTypeExt as _, symlink};
use std::path::Path;
use std::process::{Command, Output, Stdio};

use handeye_result::CalibrationResult;
use serde_json::Value;

use crate::solved::{command, copy_of_session, handeye, solved, text, utf8};

/// A pipe whose reader is gone, as with a shell pipe into `true`.
fn closed() -> Stdio {
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    writer.into()
}

/// A disk without room.
fn full() -> Stdio {
    File::options().write(true).open("/dev/full").expect("a device").into()
}

fn run(command: &mut Command) -> Output {
    command.spawn().and_then(std::process::Child::wait_with_output).expect("the binary is built")
}

/// Everything that prints to standard output and ends by itself, one command per line.
fn printing(session: &Path) -> Vec<Vec<String>> {
    let (session, result) = (utf8(session), session.join("result.json"));
    let out = Path::new(session).join("files");
    let (result, out) = (utf8(&result), utf8(&out));
    [
        &["--help"][..],
        &["--version"],
        &["calibrate", "--help"],
        &["calibrate", session],
        &["calibrate", session, "--json", "-"],
        &["doctor", session],
        &["doctor", session, "--json", "-"],
        &["export", result, "--format", "json", "--out", out],
        &["target", "--kind", "chessboard", "--columns", "8", "--rows", "5", "--square", "20", "--pdf", "-"],
        &["track", "--calibration", result, "--frames", "2"],
        &["track", "--calibration", result, "--frames", "2", "--json", "-"],
    ]
    .into_iter()
    .map(|arguments| arguments.iter().map(|&argument| argument.to_owned()).collect())
    .collect()
}

#[test]
fn a_reader_that_has_gone_is_no_failure_and_a_full_disk_is_one_line() {
    let (_home, session) = copy_of_session();
    for arguments in printing(&session) {
        let unread = run(command().args(&arguments).arg("-q").stdout(closed()).stderr(Stdio::piped()));
        let reported = text(&unread.stderr);
        assert_eq!(unread.status.code(), Some(0), "{arguments:?}: {reported}");
        assert!(!reported.contains("error") && !reported.contains("panicked"), "{arguments:?}: {reported}");
        let lost = run(command().args(&arguments).arg("-q").stdout(full()).stderr(Stdio::piped()));
        let reported = text(&lost.stderr);
        assert_eq!(lost.status.code(), Some(1), "{arguments:?}: {reported}");
        assert_eq!(reported.lines().count(), 1, "{arguments:?}: {reported}");
        assert!(
            reported.starts_with("error: standard output cannot be written: No space left"),
            "{arguments:?}: {reported}"
        );
    }
}

#[test]
fn a_gate_is_kept_when_nobody_reads_the_report() {
    let (_home, session) = copy_of_session();
    let arguments = ["-q", "calibrate", utf8(&session), "--gate", "rms_px<0.000001"];
    let output = run(command().args(arguments).stdout(closed()).stderr(Stdio::piped()));
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
}

#[test]
fn messages_that_cannot_be_said_stop_nothing() {
    let (home, session) = copy_of_session();
    for stream in [closed as fn() -> Stdio, full] {
        // With its lines of progress, and without any output except an error.
        let output = run(command().args(["calibrate", utf8(&session)]).stdout(Stdio::piped()).stderr(stream()));
        assert_eq!(output.status.code(), Some(0));
        assert!(text(&output.stdout).starts_with("Hand-eye calibration"), "{}", text(&output.stdout));
        let output = run(command().args(["calibrate", "/no/such/folder"]).stdout(Stdio::piped()).stderr(stream()));
        assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0));
        let output = run(command().arg("--no-such-option").stdout(Stdio::piped()).stderr(stream()));
        assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0));
        let pdf = home.path().join("board.pdf");
        let board = ["target", "--kind", "chessboard", "--columns", "8", "--rows", "5", "--square", "20", "--pdf"];
        let output = run(command().args(board).arg(&pdf).stdout(stream()).stderr(stream()));
        assert!(matches!(output.status.code(), Some(0 | 1)), "{:?}", output.status);
        assert!(fs::read(&pdf).expect("written before anything is said").starts_with(b"%PDF-"));
    }
}

#[test]
fn a_cell_that_cannot_say_where_it_listens_ends() {
    let output = run(command().args(["cell", "--port", "0", "-q"]).stdout(full()).stderr(Stdio::piped()));
    assert_eq!((output.status.code(), text(&output.stderr).lines().count()), (Some(1), 1));
}

#[test]
fn every_json_goes_to_standard_output_alone_when_it_is_asked_for() {
    let (_home, session) = copy_of_session();
    let auto = CalibrationResult::from_json(&text(&solved().auto.stdout)).expect("nothing but the result of auto");
    let path = utf8(&session);
    for stdout in ["-", "/dev/stdout", "/proc/self/fd/1"] {
        let calibrated = handeye(&["calibrate", path, "--json", stdout]);
        assert_eq!(calibrated.status.code(), Some(0), "{}", text(&calibrated.stderr));
        let calibrated = CalibrationResult::from_json(&text(&calibrated.stdout)).expect("nothing but the result");
        assert_eq!(calibrated.hand_eye, auto.hand_eye);
        let diagnosis = handeye(&["doctor", path, "--json", stdout]);
        let diagnosis: Value = serde_json::from_slice(&diagnosis.stdout).expect("nothing but the diagnosis");
        assert!(diagnosis["findings"].is_array());
        let result = session.join("result.json");
        let tracked = handeye(&["track", "--calibration", utf8(&result), "--frames", "3", "--json", stdout]);
        let tracked: Value = serde_json::from_slice(&tracked.stdout).expect("nothing but the track");
        assert_eq!(tracked["frames"].as_array().map(Vec::len), Some(3));
    }
    // If standard output is an open file, it is that file and not a new one of its name.
    let file = session.join("out.json");
    let stdout = File::create(&file).expect("a file");
    let output = run(command().args(["-q", "calibrate", path, "--json", "/dev/stdout"]).stdout(stdout));
    assert_eq!(output.status.code(), Some(0));
    assert!(CalibrationResult::read(&file).is_ok());
    assert!(Path::new("/dev/stdout").is_symlink());
}

/// Runs a command that writes to a pipe and returns its output.
fn through_pipe(pipe: &Path, arguments: &[&str]) -> Vec<u8> {
    assert!(Command::new("mkfifo").arg(pipe).status().expect("mkfifo").success());
    let path = pipe.to_path_buf();
    let reader = std::thread::spawn(move || {
        let mut bytes = Vec::new();
        File::open(path).and_then(|mut pipe| pipe.read_to_end(&mut bytes)).map(|_| bytes)
    });
    let output = handeye(arguments);
    let found = fs::symlink_metadata(pipe).expect("the pipe is still there");
    assert!(found.file_type().is_fifo(), "{arguments:?} replaced the pipe");
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", text(&output.stderr));
    reader.join().expect("no panic").expect("read")
}

#[test]
fn a_pipe_and_a_device_are_written_to_and_never_replaced() {
    let (home, session) = copy_of_session();
    let (pipe, path, result) = (home.path().join("pipe"), utf8(&session), session.join("result.json"));
    let board = ["target", "--kind", "chessboard", "--columns", "8", "--rows", "5", "--square", "20", "--pdf"];
    for (arguments, begins) in [
        (&["calibrate", path, "--json"][..], "{"),
        (&["doctor", path, "--json"][..], "{"),
        (&["track", "--calibration", utf8(&result), "--frames", "2", "--json"][..], "{"),
        (&board[..], "%PDF-"),
    ] {
        let written = through_pipe(&pipe, &[arguments, &[utf8(&pipe)]].concat());
        assert!(text(&written).starts_with(begins) && written.len() > 200, "{arguments:?}: {} bytes", written.len());
        fs::remove_file(&pipe).expect("removed");

        let device = home.path().join("device");
        symlink("/dev/null", &device).expect("a link");
        let output = handeye(&[arguments, &[utf8(&device)]].concat());
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", text(&output.stderr));
        assert!(device.is_symlink(), "{arguments:?} replaced a link to a device");
        fs::remove_file(&device).expect("removed");
        symlink("/dev/full", &device).expect("a link");
        let output = handeye(&[&["-q"][..], arguments, &[utf8(&device)]].concat());
        assert_eq!((output.status.code(), text(&output.stderr).lines().count()), (Some(1), 1), "{arguments:?}");
        fs::remove_file(&device).expect("removed");
    }
}

#[test]
fn a_link_inside_of_a_session_is_never_written_through() {
    let (home, session) = copy_of_session();
    let precious = home.path().join("precious");
    fs::write(&precious, "years of work").expect("written");
    let elsewhere = home.path().join("elsewhere");
    fs::create_dir(&elsewhere).expect("a folder");
    fs::remove_dir_all(session.join("exports")).expect("removed");
    symlink(&elsewhere, session.join("exports")).expect("a link");
    let result = session.join("result.json");
    for name in ["mine.json", ".mine.json.partial", "track.json"] {
        symlink(&precious, session.join(name)).expect("a link");
    }
    let (path, file, track) = (utf8(&session), session.join("mine.json"), session.join("track.json"));
    let output = handeye(&["calibrate", path, "--json", utf8(&file)]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let output = handeye(&["track", "--calibration", utf8(&result), "--frames", "1", "--json", utf8(&track)]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(!file.is_symlink() && !track.is_symlink());
    let exports = session.join("exports");
    let deeper = exports.join("ros");
    for out in [&exports, &deeper] {
        for arguments in [&["calibrate", path, "-q", "--out"][..], &["export", path, "-q", "--format", "json", "--out"]]
        {
            let output = handeye(&[arguments, &[utf8(out)]].concat());
            let reported = text(&output.stderr);
            assert_eq!((output.status.code(), reported.lines().count()), (Some(1), 1), "{arguments:?}: {reported}");
            assert!(reported.contains("exports is a link"), "{reported}");
        }
    }
    assert_eq!(fs::read_to_string(&precious).expect("read"), "years of work");
    assert_eq!(fs::read_dir(&elsewhere).expect("list").count(), 0);
}
