//! The encodings of messages: of ROS 2 (CDR, XCDR1), with numbers at multiples of their size, and of ROS 1, without gaps;
//! texts and lists with their length before them in both. Only the messages that a recording of a calibration has.

use nalgebra::{Isometry3, Quaternion, Translation3, Unit};

/// Encoding of messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    /// CDR, the encoding of ROS 2.
    Cdr,
    /// The encoding of ROS 1: little-endian, headers with a sequence number.
    Ros1,
}

/// Reads one message; every method gives `None` past its end.
pub(super) struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    is_little: bool,
    encoding: Encoding,
}

/// When and in which frame.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header {
    pub stamp_ns: i64,
    pub frame: String,
}

impl<'a> Reader<'a> {
    /// In CDR it starts after the four bytes that state the encoding of the rest.
    pub fn new(encoding: Encoding, message: &'a [u8]) -> Option<Self> {
        if encoding == Encoding::Ros1 {
            return Some(Self { bytes: message, at: 0, is_little: true, encoding });
        }
        let (head, bytes) = message.split_at_checked(4)?;
        let is_little = match head[1] {
            0 => false,
            1 => true,
            _ => return None,
        };
        Some(Self { bytes, at: 0, is_little, encoding })
    }

    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let end = self.at.checked_add(count)?;
        let part = self.bytes.get(self.at..end)?;
        self.at = end;
        Some(part)
    }

    fn number<const N: usize>(&mut self) -> Option<[u8; N]> {
        if self.encoding == Encoding::Cdr {
            self.at = self.at.checked_next_multiple_of(N)?;
        }
        let mut bytes: [u8; N] = self.take(N)?.try_into().ok()?;
        if !self.is_little {
            bytes.reverse();
        }
        Some(bytes)
    }

    pub fn u8(&mut self) -> Option<u8> {
        self.number::<1>().map(|b| b[0])
    }

    pub fn u32(&mut self) -> Option<u32> {
        self.number().map(u32::from_le_bytes)
    }

    pub fn f64(&mut self) -> Option<f64> {
        self.number().map(f64::from_le_bytes)
    }

    pub fn text(&mut self) -> Option<String> {
        let length = self.u32()? as usize;
        let bytes = self.take(length)?;
        Some(String::from_utf8_lossy(bytes.strip_suffix(&[0]).unwrap_or(bytes)).into_owned())
    }

    /// A list of bytes.
    pub fn blob(&mut self) -> Option<&'a [u8]> {
        let length = self.u32()? as usize;
        self.take(length)
    }

    pub fn f64s(&mut self) -> Option<Vec<f64>> {
        let count = self.u32()? as usize;
        // A length that is not there takes no memory.
        if count > self.bytes.len() / 8 {
            return None;
        }
        (0..count).map(|_| self.f64()).collect()
    }

    pub fn header(&mut self) -> Option<Header> {
        if self.encoding == Encoding::Ros1 {
            let _seq = self.u32()?;
        }
        let sec = self.number().map(i32::from_le_bytes)?;
        let nanosec = self.u32()?;
        let stamp_ns = i64::from(sec) * 1_000_000_000 + i64::from(nanosec);
        Some(Header { stamp_ns, frame: self.text()? })
    }

    /// Translation and quaternion x y z w.
    pub fn transform(&mut self) -> Option<Isometry3<f64>> {
        let [x, y, z, a, b, c, w] = [(); 7].map(|()| self.f64());
        let rotation = Unit::try_new(Quaternion::new(w?, a?, b?, c?), 0.5)?;
        let pose = Isometry3::from_parts(Translation3::new(x?, y?, z?), rotation);
        (pose.translation.vector.iter().all(|v| v.is_finite()) && pose.rotation.coords.iter().all(|v| v.is_finite()))
            .then_some(pose)
    }
}
