//! SHA-256 of the input of a calibration.

use std::fmt::Write as _;
use std::fs::File;
use std::io;
use std::path::Path;

use sha2::{Digest as _, Sha256};

/// The text that `sha256sum FILE…` prints, whose digest depends on names and content and not on where the folder is.
#[derive(Debug, Default)]
pub struct Listing(String);

impl Listing {
    /// Adds a file by its content.
    pub fn add(&mut self, name: &str, bytes: &[u8]) {
        self.add_digest(name, &Sha256::digest(bytes).into());
    }

    /// Adds a file by its digest.
    pub fn add_digest(&mut self, name: &str, digest: &[u8; 32]) {
        // Writing to a string cannot fail.
        let _ok = writeln!(self.0, "{}  {name}", hex(digest)).is_ok();
    }

    /// Adds a file from the disk.
    ///
    /// # Errors
    /// Whatever the file system reports.
    pub fn add_file(&mut self, name: &str, path: &Path) -> io::Result<()> {
        let mut hasher = Sha256::new();
        io::copy(&mut File::open(path)?, &mut hasher)?;
        self.add_digest(name, &hasher.finalize().into());
        Ok(())
    }

    /// The digest of the text, hexadecimal.
    pub fn digest(&self) -> String {
        hex(&Sha256::digest(self.0.as_bytes()))
    }
}

/// Bytes as hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::with_capacity(2 * bytes.len()), |mut text, byte| {
        let digit = |nibble: u8| char::from_digit(u32::from(nibble), 16).unwrap_or('0');
        text.push(digit(byte >> 4));
        text.push(digit(byte & 15));
        text
    })
}
