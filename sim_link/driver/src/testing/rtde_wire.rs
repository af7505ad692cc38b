//! Packages of RTDE: `[u16 size][u8 type][body]`, the size with its own two bytes and the type's, big end first.

use std::io::{Error, ErrorKind};

/// Where controllers listen.
pub const PORT: u16 = 30_004;
/// Bytes before the body.
const HEADER: usize = 3;

/// Asks for a version of the protocol; answered by whether it is accepted.
pub const REQUEST_PROTOCOL_VERSION: u8 = b'V';
/// Asks for the version of the controller's software.
pub const GET_CONTROLLER_VERSION: u8 = b'v';
/// A message for people, from the controller.
pub const TEXT_MESSAGE: u8 = b'M';
/// Values, at the requested rate.
pub const DATA: u8 = b'U';
/// Selects the values and their rate.
pub const SETUP_OUTPUTS: u8 = b'O';
/// Says which values the client will write.
pub const SETUP_INPUTS: u8 = b'I';
/// Begins the stream of values.
pub const START: u8 = b'S';
/// Interrupts the stream of values.
pub const PAUSE: u8 = b'P';

/// One package as bytes.
///
/// # Errors
/// For a body of more than 65 532 bytes.
pub fn package(kind: u8, body: &[u8]) -> std::io::Result<Vec<u8>> {
    let size = u16::try_from(HEADER + body.len()).map_err(Error::other)?;
    let mut bytes = Vec::with_capacity(usize::from(size));
    bytes.extend_from_slice(&size.to_be_bytes());
    bytes.push(kind);
    bytes.extend_from_slice(body);
    Ok(bytes)
}

/// Whole packages out of bytes that arrive in pieces. It holds no more than one package and what was pushed last.
#[derive(Debug, Default)]
pub struct Unpacker {
    bytes: Vec<u8>,
    taken: usize,
}

impl Unpacker {
    /// Takes what has arrived.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.drain(..self.taken);
        self.taken = 0;
        self.bytes.extend_from_slice(bytes);
    }

    /// Type and body of the next package, once it is whole.
    ///
    /// # Errors
    /// For a size that no package has.
    pub fn next_package(&mut self) -> std::io::Result<Option<(u8, Vec<u8>)>> {
        let rest = &self.bytes[self.taken..];
        let Some((header, _)) = rest.split_first_chunk::<HEADER>() else { return Ok(None) };
        let size = usize::from(u16::from_be_bytes([header[0], header[1]]));
        if size < HEADER {
            return Err(ErrorKind::InvalidData.into());
        }
        let Some(body) = rest.get(HEADER..size) else { return Ok(None) };
        let package = (header[2], body.to_vec());
        self.taken += size;
        Ok(Some(package))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn packages_come_out_as_they_went_in_however_they_are_cut(
            bodies in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 0..40), 0..8),
            cut in 1_usize..30,
        ) {
            let mut stream = Vec::new();
            for body in &bodies {
                stream.extend(package(DATA, body).expect("short"));
            }
            let mut unpacker = Unpacker::default();
            let mut got = Vec::new();
            for piece in stream.chunks(cut) {
                unpacker.push(piece);
                while let Some((kind, body)) = unpacker.next_package().expect("a package") {
                    prop_assert_eq!(kind, DATA);
                    got.push(body);
                }
            }
            prop_assert_eq!(got, bodies);
        }
    }
}
