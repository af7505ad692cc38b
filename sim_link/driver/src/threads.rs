//! The threads of a connection: one reads, one writes, one collects standard error, and one watches over them and ends the
//! driver. Nothing that a driver does, or does not do, blocks anybody else.

use std::io::{BufReader, Read, Write};
use std::net::Shutdown;
use std::sync::Arc;
use std::sync::mpsc::Receiver;
use std::time::Duration;

use super::error::{DriverError, Ending};
use super::link::LinkEnd;
use super::log::LONGEST;
use super::message::{LogLevel, ToDriver};
use super::shared::{DriverExit, Inner, Out, Shared};
use super::wire::MessageReader;

/// How long reading the rest of the output of a driver that has ended may take.
const LAST_WORDS: Duration = Duration::from_millis(300);
/// Pings that may be without an answer: those of the silence that is allowed, with room.
const MOST_PINGS: usize = 64;
/// Size of the buffer that output is read into.
const BUFFER: usize = 1 << 16;

/// Reads messages until the output ends or breaks the protocol. What comes after that is passed over: a driver whose output
/// cannot be written would die of it before it has brought the arm to rest.
pub fn read(shared: &Shared, output: Box<dyn Read + Send>) {
    let mut output = BufReader::with_capacity(BUFFER, output);
    let mut messages = MessageReader::new(&mut output);
    loop {
        let taken = match messages.read() {
            Ok(Some(incoming)) => shared.take(incoming, shared.now_s()),
            Ok(None) => break,
            Err(error) => Err(error),
        };
        if let Err(error) = taken {
            shared.finish(Ending::Broken(error));
            break;
        }
        if shared.lock().ending.is_some() {
            break;
        }
    }
    let _unreadable = std::io::copy(&mut output, &mut std::io::sink()).is_err();
    shared.update(|inner| inner.read_up.output = true);
}

/// Writes what is queued until the queue is closed; then the driver's input ends.
pub fn write(shared: &Shared, mut input: Box<dyn Write + Send>, queue: &Receiver<Out>) {
    while let Ok(out) = queue.recv() {
        let line = match out {
            Out::Line(line) => line,
            Out::Ping(id) => {
                let left_s = shared.now_s();
                let mut inner = shared.lock();
                if inner.pings.len() >= MOST_PINGS {
                    inner.pings.pop_front();
                }
                inner.pings.push_back((id, left_s));
                ToDriver::Ping { id }.line()
            }
            Out::Bye => ToDriver::Bye {}.line(),
        };
        if input.write_all(line.as_bytes()).and_then(|()| input.flush()).is_err() {
            // It has closed its input, most likely because it has ended; the watch finds out which.
            shared.close_queue();
            break;
        }
    }
}

/// Collects standard error, line by line, long lines in their beginning.
pub fn collect_errors(shared: &Shared, mut errors: Box<dyn Read + Send>) {
    let mut line = Vec::new();
    let mut buffer = [0; 4096];
    while let Ok(count @ 1..) = errors.read(&mut buffer) {
        for &byte in &buffer[..count] {
            if byte == b'\n' {
                shared.update(|inner| inner.log.add(LogLevel::Info, true, &String::from_utf8_lossy(&line)));
                line.clear();
            } else if line.len() < LONGEST {
                line.push(byte);
            }
        }
    }
    shared.update(|inner| {
        if !line.is_empty() {
            inner.log.add(LogLevel::Info, true, &String::from_utf8_lossy(&line));
        }
        inner.read_up.errors = true;
    });
}

/// Sends pings, notices that the driver is gone, and ends it.
pub fn watch(shared: &Arc<Shared>, mut end: LinkEnd) {
    let mut id = 0;
    let over = |inner: &mut Inner| inner.read_up.output.then_some(());
    while let Ok(over) = shared.wait(shared.options.ping_every, None, over) {
        let is_over = over.is_some() || end.ended_within(Duration::ZERO).is_some();
        if is_over {
            shared.finish(how_ended(shared, &mut end));
            break;
        }
        let Some(heard_s) = shared.lock().heard_s() else { continue };
        if shared.lock().trial.is_quiet {
            shared.lock().last_heard_s = shared.now_s();
            continue;
        }
        if shared.now_s() - heard_s > shared.options.silence.as_secs_f64() {
            shared.finish(Ending::Silent { after: shared.options.silence });
            break;
        }
        id += 1;
        // A queue that is full is one that the driver does not read: then no pong comes either.
        let _left_out = shared.enqueue(Out::Ping(id)).is_err();
    }
    bury(shared, &mut end);
}

/// Why the output has ended, or the process.
fn how_ended(shared: &Shared, end: &mut LinkEnd) -> Ending {
    let status = end.ended_within(LAST_WORDS);
    // Its last lines often give the reason.
    let read_up = |inner: &mut Inner| (inner.read_up.errors && inner.read_up.output).then_some(());
    if status.is_some()
        && let Err(DriverError::Gone { why, .. }) = shared.wait(LAST_WORDS, None, read_up)
    {
        return why;
    }
    let last_line = shared.lock().log.last_printed();
    match status {
        Some(status) => Ending::Exited { status: status.to_string(), last_line },
        None => Ending::Closed { last_line },
    }
}

/// Tells the driver to brake and end, closes its input, and kills it when it does not end by itself.
fn bury(shared: &Shared, end: &mut LinkEnd) {
    // Looked for while their parents live, below whom some of them are found.
    let living = end.living();
    if !shared.lock().trial.leaves_without_bye {
        let _full_or_closed = shared.enqueue(Out::Bye).is_err();
    }
    shared.close_queue();
    let patience = shared.options.farewell;
    let burial = match end {
        LinkEnd::Tcp(stream) => {
            if shared.lock().trial.leaves_without_bye {
                let _closed_already = stream.shutdown(Shutdown::Write).is_err();
            }
            if shared.wait_for_output(patience) { DriverExit::Closed } else { DriverExit::LeftOpen }
        }
        LinkEnd::Process(..) => match end.ended_within(patience) {
            Some(status) => DriverExit::Ended { status: status.to_string(), is_success: status.success() },
            None => DriverExit::Killed,
        },
    };
    end.kill(living);
    shared.update(|inner| inner.burial = Some(burial));
}
