//! The drivers that come with the workbench, through the protocol, against servers written from the makers' guides.

mod folder;
mod rosbridge;
mod units;
mod ur_rtde;
mod v4l;

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

use handeye_driver::message::{FromDriver, Hello, ImageMessage, StateMessage, ToDriver};

/// Long enough for a busy machine; a test that waits this long has failed.
const PATIENCE: Duration = Duration::from_secs(20);

/// The file of a driver that comes with the program.
fn driver_file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/drivers").join(name)
}

/// The workbench's end of a driver.
struct Talk {
    input: ChildStdin,
    messages: Receiver<(FromDriver, Vec<u8>)>,
    driver: Child,
    next_id: u64,
}

impl Talk {
    /// Runs a file of `assets/drivers` and sends `hello`.
    fn run(python: &Path, file: &str, options: &[&str]) -> Self {
        let mut command = Command::new(python);
        command.arg(driver_file(file)).args(options);
        Self::with(command)
    }

    /// Starts a driver and sends `hello`.
    fn with(mut command: Command) -> Self {
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("python runs");
        let (input, output) = (child.stdin.take().expect("a pipe"), child.stdout.take().expect("a pipe"));
        let (send, messages) = channel();
        thread::spawn(move || {
            let mut output = BufReader::new(output);
            while let Some(message) = read(&mut output) {
                if send.send(message).is_err() {
                    return;
                }
            }
        });
        let mut talk = Self { input, messages, driver: child, next_id: 0 };
        talk.say(&ToDriver::Hello { protocol: 1, workbench: "test".into() });
        talk
    }

    fn say(&mut self, message: &ToDriver) {
        self.input.write_all(message.line().as_bytes()).expect("the driver reads");
    }

    /// The next message that `pick` accepts; others are skipped.
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
        assert_eq!(self.driver.wait().expect("it ends").code(), Some(1), "{text}");
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
        assert_eq!(self.driver.wait().expect("it ends").code(), Some(0));
    }
}

/// One message and the bytes after it; `None` at the end.
fn read(output: &mut BufReader<ChildStdout>) -> Option<(FromDriver, Vec<u8>)> {
    let mut line = String::new();
    if output.read_line(&mut line).expect("lines of text") == 0 {
        return None;
    }
    let (message, count) = FromDriver::parse(&line).unwrap_or_else(|error| panic!("{error}: {line}"));
    let mut bytes = vec![0; usize::try_from(count).expect("a length")];
    output.read_exact(&mut bytes).expect("the bytes of the message");
    Some((message, bytes))
}
