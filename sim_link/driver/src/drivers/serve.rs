//! The driver's side of the protocol.

use std::io::{BufRead as _, BufReader, Read, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc;
use std::thread;
use std::time::{Duration, Instant};

use serde::Deserialize;

use super::outlet::{Outlet, Wanted};
use super::{Device, Fault};
use crate::message::{AnswerMessage, LogLevel, LogMessage, PROTOCOL, PongMessage, ToDriver};

/// Longest line of the protocol, with its end.
const MAX_LINE: u64 = 65_536;
/// The workbench says `hello` at once. A driver that hears nothing for so long was started by a person.
const LONELY: Duration = Duration::from_secs(1);
/// What that person has to know.
const WAITING: &str = "this program is a driver and waits for `hello` on its standard input, which the workbench sends that starts \
                       it: name this command under Connect, Driver, or try it with `handeye driver test \"COMMAND\"`, in quotes";
/// How often it is asked whether the workbench has gone without a word.
const LOOK: Duration = Duration::from_millis(250);

enum Event {
    Line(String),
    /// The input has ended, or holds what is no line.
    End,
    /// The device cannot go on.
    Device(Result<(), Fault>),
}

/// Speaks for a device until the workbench says `bye` or its end of the input closes. Takes a thread for the input and one
/// for the device, which end by themselves soon after.
///
/// # Errors
/// The device's [`Fault`], which has been sent as `error`.
pub fn serve(
    device: impl Device,
    input: impl Read + Send + 'static,
    output: impl Write + Send + 'static,
) -> Result<(), Fault> {
    let outlet = Outlet::new(output);
    let (events, received) = mpsc::sync_channel(16);
    let lines = events.clone();
    spawn("driver-input", move || read_lines(input, &lines))?;
    let mut serving = Serving { outlet: outlet.clone(), device: Some(device), events };
    let (began, mut is_said) = (Instant::now(), false);
    let result = loop {
        match received.recv_timeout(LOOK) {
            Ok(Event::Line(line)) => match serving.line(&line) {
                Ok(true) => {}
                Ok(false) => break Ok(()),
                Err(fault) => break Err(fault),
            },
            Ok(Event::Device(Err(fault))) => break Err(fault),
            Ok(Event::End | Event::Device(Ok(()))) | Err(mpsc::RecvTimeoutError::Disconnected) => break Ok(()),
            Err(mpsc::RecvTimeoutError::Timeout) if outlet.has_ended() => break Ok(()),
            Err(mpsc::RecvTimeoutError::Timeout)
                if !is_said && serving.device.is_some() && began.elapsed() > LONELY =>
            {
                outlet.log(LogLevel::Warn, WAITING);
                is_said = true;
            }
            Err(mpsc::RecvTimeoutError::Timeout) => {}
        }
    };
    if let Err(fault) = &result {
        outlet.say("error", LogMessage { level: LogLevel::Error, text: fault.to_string() });
    }
    outlet.end();
    result
}

fn spawn(name: &str, work: impl FnOnce() + Send + 'static) -> Result<(), Fault> {
    thread::Builder::new()
        .name(name.into())
        .spawn(work)
        .map(drop)
        .map_err(|error| Fault(format!("no thread for {name}: {error}")))
}

fn read_lines(input: impl Read, events: &mpsc::SyncSender<Event>) {
    let mut input = BufReader::new(input);
    loop {
        let mut line = Vec::new();
        let is_whole = match input.by_ref().take(MAX_LINE).read_until(b'\n', &mut line) {
            Ok(_) => line.last() == Some(&b'\n'),
            Err(_) => false,
        };
        let event = match String::from_utf8(line) {
            Ok(line) if is_whole => Event::Line(line),
            _ => Event::End,
        };
        let is_last = matches!(event, Event::End);
        if events.send(event).is_err() || is_last {
            return;
        }
    }
}

struct Serving<D> {
    outlet: Outlet,
    /// Until `hello` has come.
    device: Option<D>,
    events: mpsc::SyncSender<Event>,
}

impl<D: Device> Serving<D> {
    /// Answers a message. False when it was the last.
    fn line(&mut self, line: &str) -> Result<bool, Fault> {
        match serde_json::from_str::<ToDriver>(line) {
            Ok(ToDriver::Hello { protocol, .. }) => self.hello(protocol)?,
            Ok(ToDriver::Ping { id }) => {
                self.outlet.say("pong", PongMessage { id, stamp: self.outlet.device_time() });
            }
            Ok(ToDriver::NextImage { id, after, depth }) => self.outlet.want(Wanted { id, after, depth }),
            Ok(ToDriver::Arm { id, on: true } | ToDriver::Move { id, .. }) => {
                let why = "this driver only reads: it cannot move the arm".into();
                self.outlet.say("refused", AnswerMessage { id, why });
            }
            Ok(ToDriver::Arm { id, on: false } | ToDriver::Stop { id }) => {
                self.outlet.say("done", AnswerMessage { id, why: String::new() });
            }
            Ok(ToDriver::Bye {}) => return Ok(false),
            Err(error) => self.unknown(line, &error),
        }
        Ok(true)
    }

    fn hello(&mut self, protocol: u32) -> Result<(), Fault> {
        if protocol != PROTOCOL {
            return Err(Fault(format!(
                "the workbench speaks version {protocol} of the protocol, this driver {PROTOCOL}"
            )));
        }
        let Some(mut device) = self.device.take() else { return Ok(()) };
        let (outlet, events) = (self.outlet.clone(), self.events.clone());
        spawn("driver-device", move || {
            // What fails in a library would leave a driver that answers pings and has nothing to say.
            let result = catch_unwind(AssertUnwindSafe(|| {
                device.open(&outlet).and_then(|hello| {
                    outlet.greet(&hello);
                    device.run(&outlet)
                })
            }));
            let result = result.unwrap_or_else(|_panic| {
                Err(Fault("the program of this driver has a fault; standard error says where".into()))
            });
            // Nobody listens when the workbench has gone.
            drop(events.send(Event::Device(result)));
        })
    }

    /// A message of an unknown type is nothing; one of a known type that cannot be read is worth a line.
    fn unknown(&self, line: &str, error: &serde_json::Error) {
        #[derive(Deserialize)]
        struct Header {
            #[serde(rename = "type")]
            kind: String,
        }
        const KNOWN: [&str; 7] = ["hello", "ping", "next_image", "arm", "move", "stop", "bye"];
        let kind = serde_json::from_str::<Header>(line).map(|header| header.kind);
        if kind.as_ref().map_or(true, |kind| KNOWN.contains(&kind.as_str())) {
            self.outlet.log(LogLevel::Warn, format!("a message of the workbench cannot be read: {error}"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::Hello;

    struct Faulty;

    impl Device for Faulty {
        fn open(&mut self, _outlet: &Outlet) -> Result<Hello, Fault> {
            panic!("what a library does with a device that it does not know")
        }

        fn run(&mut self, _outlet: &Outlet) -> Result<(), Fault> {
            Ok(())
        }
    }

    #[test]
    fn a_device_that_fails_in_its_library_ends_the_driver_with_a_reason() {
        // The input stays open, as that of a driver does: only the device can end it.
        let (input, mut workbench) = std::io::pipe().expect("a pipe");
        let hello = ToDriver::Hello { protocol: PROTOCOL, workbench: "0".into() }.line();
        workbench.write_all(hello.as_bytes()).expect("it is read");
        let fault = serve(Faulty, input, std::io::sink()).expect_err("it cannot go on");
        assert!(fault.0.contains("has a fault"), "{fault}");
    }
}
