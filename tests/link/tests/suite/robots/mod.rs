//! The drivers that come with the workbench, through the protocol, in front of servers that other clients read too.

mod folder;
mod rosbridge;
mod ur_rtde;

use std::io::{BufRead as _, BufReader, PipeReader, PipeWriter, Read as _, Write as _};
use std::path::Path;
use std::process::Command;
use std::sync::mpsc::{Receiver, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use handeye_driver::drivers::{Device, Fault, serve};
use handeye_driver::message::{FromDriver, Hello, ImageMessage, StateMessage, ToDriver};

/// Long enough for a busy machine; a test that waits so long has failed.
const PATIENCE: Duration = Duration::from_secs(20);

/// The workbench's end of a driver that runs in this process.
struct Talk {
    input: Option<PipeWriter>,
    messages: Receiver<(FromDriver, Vec<u8>)>,
    driver: JoinHandle<Result<(), Fault>>,
    next_id: u64,
}

impl Talk {
    /// Starts it and says `hello`.
    fn start(device: impl Device) -> Self {
        let (read_by_driver, input) = std::io::pipe().expect("a pipe");
        let (output, written_by_driver) = std::io::pipe().expect("a pipe");
        let driver = thread::spawn(move || serve(device, read_by_driver, written_by_driver));
        let (send, messages) = channel();
        thread::spawn(move || {
            let mut output = BufReader::new(output);
            while let Some(message) = read(&mut output) {
                if send.send(message).is_err() {
                    return;
                }
            }
        });
        let mut talk = Self { input: Some(input), messages, driver, next_id: 0 };
        talk.say(&ToDriver::Hello { protocol: 1, workbench: "test".into() });
        talk
    }

    fn say(&mut self, message: &ToDriver) {
        let input = self.input.as_mut().expect("not closed yet");
        input.write_all(message.line().as_bytes()).expect("the driver reads");
    }

    /// The next message that `pick` takes; others are passed over.
    fn wait<T>(&mut self, mut pick: impl FnMut(FromDriver, Vec<u8>) -> Option<T>) -> T {
        let deadline = Instant::now() + PATIENCE;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let (message, bytes) = self.messages.recv_timeout(left).expect("a message of the driver in time");
            if let Some(found) = pick(message, bytes) {
                return found;
            }
        }
    }

    fn hello(&mut self) -> Hello {
        self.wait(|message, _| match message {
            FromDriver::Hello(hello) => Some(*hello),
            FromDriver::Error(error) => panic!("no hello: {}", error.text),
            other => panic!("{other:?} came before hello"),
        })
    }

    fn state(&mut self) -> StateMessage {
        self.wait(|message, _| match message {
            FromDriver::State(state) => Some(*state),
            FromDriver::Error(error) => panic!("no state: {}", error.text),
            _ => None,
        })
    }

    /// The text of the `error` with which it ends.
    fn error(mut self) -> String {
        let text = self.wait(|message, _| match message {
            FromDriver::Error(error) => Some(error.text),
            _ => None,
        });
        let result = self.driver.join().expect("no panic");
        assert_eq!(result, Err(Fault(text.clone())));
        text
    }

    fn image(&mut self, after: Option<f64>, depth: bool) -> (ImageMessage, Vec<u8>) {
        self.next_id += 1;
        let id = self.next_id;
        self.say(&ToDriver::NextImage { id, after, depth });
        self.wait(|message, bytes| match message {
            FromDriver::Image(image) if image.id == id => Some((image, bytes)),
            FromDriver::Error(error) => panic!("no image: {}", error.text),
            _ => None,
        })
    }

    /// Ends it as the workbench does.
    fn bye(mut self) {
        self.say(&ToDriver::Bye {});
        assert_eq!(self.driver.join().expect("no panic"), Ok(()));
    }
}

/// One message and the bytes behind it; `None` at the end.
fn read(output: &mut BufReader<PipeReader>) -> Option<(FromDriver, Vec<u8>)> {
    let mut line = String::new();
    if output.read_line(&mut line).expect("lines of text") == 0 {
        return None;
    }
    let (message, count) = FromDriver::parse(&line).unwrap_or_else(|error| panic!("{error}: {line}"));
    let mut bytes = vec![0; usize::try_from(count).expect("a length")];
    output.read_exact(&mut bytes).expect("the bytes of the message");
    Some((message, bytes))
}

/// What a script of `tests/python` prints: JSON.
fn script(python: &Path, name: &str, arguments: &[&str]) -> serde_json::Value {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/python").join(name);
    let output = Command::new(python).arg(file).args(arguments).output().expect("python runs");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{name}:\n{text}{}", String::from_utf8_lossy(&output.stderr));
    let line = text.lines().last().expect("a line");
    serde_json::from_str(line).unwrap_or_else(|error| panic!("{name}: {error}: {line}"))
}
