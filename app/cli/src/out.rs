//! The one way to standard output and standard error. `println!` panics if the pipe is closed or the disk is full;
//! nothing here does, and clippy enforces its use.
//!
//! Names and messages come from untrusted sources: files, drivers, servers. A terminal interprets some characters
//! instead of showing them, so every line for the user goes through [`shown`].

use std::borrow::Cow;
use std::fmt::{Display, Write as _};
use std::io::{self, ErrorKind, IsTerminal as _, Write};

use anyhow::anyhow;

use super::Failure;

/// Writes a result to standard output.
///
/// # Errors
/// As [`finished`].
pub fn print(text: &str) -> Result<(), Failure> {
    write(shown(text).as_bytes())
}

/// Writes one line of a result to standard output.
///
/// # Errors
/// As [`finished`].
pub fn line(line: impl Display) -> Result<(), Failure> {
    print(&format!("{line}\n"))
}

/// Writes what a program may read to standard output, byte for byte; a terminal gets it as text.
///
/// # Errors
/// As [`finished`].
pub fn bytes(bytes: &[u8]) -> Result<(), Failure> {
    write(&for_standard_output(bytes))
}

fn for_standard_output(bytes: &[u8]) -> Cow<'_, [u8]> {
    if !io::stdout().is_terminal() {
        return Cow::Borrowed(bytes);
    }
    Cow::Owned(shown(&String::from_utf8_lossy(bytes)).into_owned().into_bytes())
}

/// Standard output that is written piece by piece, line by line; as [`bytes`].
#[derive(Debug, Clone, Copy)]
pub struct Results;

impl Write for Results {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        io::stdout().lock().write_all(&for_standard_output(bytes))?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stdout().flush()
    }
}

/// Text that is safe for a terminal: control characters and those that change the direction of text are escaped.
pub fn shown(text: &str) -> Cow<'_, str> {
    if !text.contains(is_obeyed) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for letter in text.chars() {
        if is_obeyed(letter) {
            // Writing to a string cannot fail.
            let _written = write!(shown, "\\u{{{:x}}}", u32::from(letter)).is_ok();
        } else {
            shown.push(letter);
        }
    }
    Cow::Owned(shown)
}

/// Control characters of terminals, in both their ranges, and those of text direction.
fn is_obeyed(letter: char) -> bool {
    let is_direction = matches!(letter, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    is_direction || (letter.is_control() && !matches!(letter, '\n' | '\t'))
}

fn write(bytes: &[u8]) -> Result<(), Failure> {
    let mut stdout = io::stdout().lock();
    // Flushed here: at the end of the program a failure could not be reported.
    finished(stdout.write_all(bytes).and_then(|()| stdout.flush()), "standard output")
}

/// The outcome of writing to something that is not a file. A pipe whose reader has closed it is not a failure: the
/// reader has seen enough.
///
/// # Errors
/// Whatever else the system reports.
pub fn finished(written: io::Result<()>, place: impl Display) -> Result<(), Failure> {
    match written {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::failed(anyhow!("{place} cannot be written: {error}")))
        }
        _ => Ok(()),
    }
}

/// Writes one line for the user to standard error. A failure cannot be reported anywhere.
pub fn note(line: impl Display) {
    let _written = Log { is_coloured: false }.write_all(format!("{line}\n").as_bytes()).is_ok();
}

/// Standard error for lines that must not stop the work: it accepts all of them.
#[derive(Debug, Clone, Copy)]
pub struct Log {
    /// Whether the writer of the lines sets colours; the writer then also escapes the content.
    pub is_coloured: bool,
}

impl Write for Log {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        let text = String::from_utf8_lossy(line);
        let shown = if self.is_coloured { coloured(&text) } else { shown(&text) };
        let _written = io::stderr().lock().write_all(shown.as_bytes()).is_ok();
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// As [`shown`], except that colours are kept.
fn coloured(text: &str) -> Cow<'_, str> {
    const BEGIN: &str = "\u{1b}[";
    let Some(at) = text.find(BEGIN) else { return shown(text) };
    let mut rest = &text[at..];
    let mut coloured = shown(&text[..at]).into_owned();
    while let Some(numbers) = rest.strip_prefix(BEGIN) {
        let length = numbers.find(|letter: char| !letter.is_ascii_digit() && letter != ';').unwrap_or(numbers.len());
        let is_colour = numbers[length..].starts_with('m');
        let end = if is_colour { BEGIN.len() + length + 1 } else { BEGIN.len() };
        let next = rest[end..].find(BEGIN).map_or(rest.len(), |next| end + next);
        if is_colour {
            coloured.push_str(&rest[..end]);
        } else {
            coloured.push_str(&shown(&rest[..end]));
        }
        coloured.push_str(&shown(&rest[end..next]));
        rest = &rest[next..];
    }
    Cow::Owned(coloured)
}

/// A count with its noun: “1 view”, “2 views”.
pub fn counted(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_would_obey_is_spelled_out_and_everything_else_stays() {
        for harmless in ["", "poses.csv\t12\n", "图像/一.png ±0.3 mm °", "a\\u{1b}b"] {
            assert_eq!(shown(harmless), harmless);
        }
        // Colours, the title of the window, the clipboard, 8-bit controls, going back over a line, and reversed letters.
        for obeyed in
            ["\u{1b}[31m", "\u{1b}]0;x\u{7}", "\u{1b}]52;c;eA==\u{7}", "\u{9b}2J", "a\rb", "a\u{8}b", "\u{7f}", "\0"]
                .into_iter()
                .chain(["\u{202e}gnp.exe", "\u{2066}x\u{2069}"])
        {
            let shown = shown(obeyed);
            assert!(!shown.contains(is_obeyed), "{shown:?}");
            assert!(shown.contains("\\u{"), "{shown:?}");
        }
        assert_eq!(shown("a\u{1b}[2Jb"), "a\\u{1b}[2Jb");
    }

    #[test]
    fn of_a_log_in_colours_nothing_else_is_obeyed() {
        let line = "\u{1b}[33m WARN\u{1b}[0m \u{1b}[1;3mname\u{1b}[0m: a\u{1b}]0;x\u{7}b\u{1b}[2Jc\u{9b}m \u{1b}[";
        let expected =
            "\u{1b}[33m WARN\u{1b}[0m \u{1b}[1;3mname\u{1b}[0m: a\\u{1b}]0;x\\u{7}b\\u{1b}[2Jc\\u{9b}m \\u{1b}[";
        assert_eq!(coloured(line), expected);
        assert_eq!(coloured("plain\u{1b}"), "plain\\u{1b}");
    }
}
