//! Packages of RTDE: `[u16 size][u8 type][body]`, the size with its own two bytes and the type's, big end first.

use super::RtdeError;

/// Bytes before the body.
const HEADER: usize = 3;
/// Longest body of a package.
#[cfg(test)]
const MAX_BODY: usize = u16::MAX as usize - HEADER;

/// Asks for a version of the protocol; answered by whether it is accepted.
pub const REQUEST_PROTOCOL_VERSION: u8 = b'V';
/// Asks for the version of the controller's software.
pub const GET_CONTROLLER_VERSION: u8 = b'v';
/// A message for people, from the controller.
pub const TEXT_MESSAGE: u8 = b'M';
/// Values, as often as it was asked for.
pub const DATA: u8 = b'U';
/// Says which values are wanted, and how often.
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
/// [`RtdeError::TooLong`] for a body of more than 65 532 bytes.
pub fn package(kind: u8, body: &[u8]) -> Result<Vec<u8>, RtdeError> {
    let size = u16::try_from(HEADER + body.len()).map_err(|_error| RtdeError::TooLong { bytes: body.len() })?;
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
    /// [`RtdeError::Malformed`] for a size that no package has.
    pub fn next_package(&mut self) -> Result<Option<(u8, Vec<u8>)>, RtdeError> {
        let rest = &self.bytes[self.taken..];
        let Some((header, _)) = rest.split_first_chunk::<HEADER>() else { return Ok(None) };
        let size = usize::from(u16::from_be_bytes([header[0], header[1]]));
        if size < HEADER {
            return Err(RtdeError::malformed(format!(
                "a package says that it has {size} bytes, the least is {HEADER}"
            )));
        }
        let Some(body) = rest.get(HEADER..size) else { return Ok(None) };
        let package = (header[2], body.to_vec());
        self.taken += size;
        Ok(Some(package))
    }
}

/// Reads the fields of a body one after the other.
#[derive(Debug)]
pub struct Body<'a> {
    rest: &'a [u8],
    what: &'static str,
}

impl<'a> Body<'a> {
    /// `what` is what an error calls the package.
    pub fn new(bytes: &'a [u8], what: &'static str) -> Self {
        Self { rest: bytes, what }
    }

    /// The next `N` bytes.
    pub fn bytes<const N: usize>(&mut self) -> Result<[u8; N], RtdeError> {
        let Some((bytes, rest)) = self.rest.split_first_chunk::<N>() else {
            return Err(RtdeError::malformed(format!("{} ends early", self.what)));
        };
        self.rest = rest;
        Ok(*bytes)
    }

    /// So many bytes.
    pub fn take(&mut self, count: usize) -> Result<&'a [u8], RtdeError> {
        let Some((bytes, rest)) = self.rest.split_at_checked(count) else {
            return Err(RtdeError::malformed(format!("{} ends early", self.what)));
        };
        self.rest = rest;
        Ok(bytes)
    }

    /// One byte.
    pub fn byte(&mut self) -> Result<u8, RtdeError> {
        self.bytes::<1>().map(|[byte]| byte)
    }

    /// A whole number.
    pub fn int(&mut self) -> Result<i32, RtdeError> {
        self.bytes().map(i32::from_be_bytes)
    }

    /// A finite number.
    pub fn double(&mut self) -> Result<f64, RtdeError> {
        let value = self.bytes().map(f64::from_be_bytes)?;
        if value.is_finite() { Ok(value) } else { Err(RtdeError::malformed(format!("{} has {value}", self.what))) }
    }

    /// Six finite numbers.
    pub fn vector6(&mut self) -> Result<[f64; 6], RtdeError> {
        let mut values = [0.0; 6];
        for value in &mut values {
            *value = self.double()?;
        }
        Ok(values)
    }

    /// What is left.
    pub fn rest(self) -> &'a [u8] {
        self.rest
    }
}

/// The text of a message for people, without what would break a line: at most 400 characters.
pub fn one_line(bytes: &[u8]) -> String {
    const MOST: usize = 400;
    String::from_utf8_lossy(bytes).chars().map(|c| if c.is_control() { ' ' } else { c }).take(MOST).collect()
}

/// A message for people as version 2 has it: `[u8 length][text][u8 length][source][u8 level]`, or text alone.
pub fn text_message(body: &[u8]) -> String {
    let mut fields = Body::new(body, "a text message");
    let text = fields.byte().and_then(|length| fields.take(usize::from(length)));
    one_line(text.unwrap_or(body))
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

        #[test]
        fn any_bytes_are_packages_or_an_error_and_never_a_panic(
            bytes in proptest::collection::vec(any::<u8>(), 0..300),
        ) {
            let mut unpacker = Unpacker::default();
            unpacker.push(&bytes);
            let mut total = 0;
            while let Ok(Some((_, body))) = unpacker.next_package() {
                total += body.len() + HEADER;
            }
            prop_assert!(total <= bytes.len());
            text_message(&bytes);
        }
    }

    #[test]
    fn a_body_that_is_too_long_for_its_size_is_refused() {
        assert!(package(DATA, &vec![0; MAX_BODY]).is_ok());
        assert!(matches!(package(DATA, &vec![0; MAX_BODY + 1]), Err(RtdeError::TooLong { .. })));
    }
}
