//! Width and height out of the header of an image file, for which no decoder is needed.
//!
//! `imagesize` 0.15 does the same, but it takes the height of a BMP that is written from the top down for almost 2³² rows,
//! and no fill bytes between the segments of a JPEG.

use std::io::{self, ErrorKind, Read, Seek, SeekFrom};

use handeye_wording::{foreign, text};

use super::ImageFileError;

/// Most fields of a TIFF directory that are read; cameras write a few dozen.
const MAX_FIELDS: u64 = 10_000;

type Size = (u32, u32);

/// Width and height in pixels of a PNG, JPEG, BMP or TIFF.
pub fn size(file: &mut (impl Read + Seek)) -> Result<Size, ImageFileError> {
    let found = match &bytes::<4>(file)? {
        b"\x89PNG" => png(file)?,
        [0xFF, 0xD8, 0xFF, _] => jpeg(file)?,
        [b'B', b'M', ..] => bmp(file)?,
        [b'I', b'I', version @ (42 | 43), 0] => Tiff {
            file,
            big: *version == 43,
            u16: u16::from_le_bytes,
            u32: u32::from_le_bytes,
            u64: u64::from_le_bytes,
        }
        .size()?,
        [b'M', b'M', 0, version @ (42 | 43)] => Tiff {
            file,
            big: *version == 43,
            u16: u16::from_be_bytes,
            u32: u32::from_be_bytes,
            u64: u64::from_be_bytes,
        }
        .size()?,
        _ => return Err(ImageFileError::Undecodable(text!("it begins like none of them"))),
    };
    found.ok_or_else(|| ImageFileError::Undecodable(text!("its header does not say its size")))
}

fn bytes<const N: usize>(file: &mut impl Read) -> Result<[u8; N], ImageFileError> {
    let mut read = [0; N];
    file.read_exact(&mut read).map_err(|error| failure(&error))?;
    Ok(read)
}

fn go_to(file: &mut impl Seek, place: SeekFrom) -> Result<(), ImageFileError> {
    file.seek(place).map(drop).map_err(|error| failure(&error))
}

fn failure(error: &io::Error) -> ImageFileError {
    match error.kind() {
        ErrorKind::UnexpectedEof => ImageFileError::Truncated(foreign(error)),
        _ => ImageFileError::Unreadable(foreign(error)),
    }
}

/// The chunk IHDR is the first.
fn png(file: &mut (impl Read + Seek)) -> Result<Option<Size>, ImageFileError> {
    go_to(file, SeekFrom::Start(12))?;
    let is_header = &bytes(file)? == b"IHDR";
    let size = (u32::from_be_bytes(bytes(file)?), u32::from_be_bytes(bytes(file)?));
    Ok(is_header.then_some(size))
}

/// Rows from the top down have a negative height.
fn bmp(file: &mut (impl Read + Seek)) -> Result<Option<Size>, ImageFileError> {
    /// Bytes of the header of OS/2, whose numbers are short.
    const CORE_HEADER: u32 = 12;
    go_to(file, SeekFrom::Start(14))?;
    if u32::from_le_bytes(bytes(file)?) == CORE_HEADER {
        return Ok(Some((u16::from_le_bytes(bytes(file)?).into(), u16::from_le_bytes(bytes(file)?).into())));
    }
    let [width, height] = [i32::from_le_bytes(bytes(file)?), i32::from_le_bytes(bytes(file)?)];
    Ok(u32::try_from(width).ok().map(|width| (width, height.unsigned_abs())))
}

/// The size is in the segment that begins the frame; thumbnails are inside of others, which are passed as a whole.
fn jpeg(file: &mut (impl Read + Seek)) -> Result<Option<Size>, ImageFileError> {
    go_to(file, SeekFrom::Start(2))?;
    loop {
        while bytes(file)? != [0xFF] {}
        let mut marker = bytes::<1>(file)?;
        while marker == [0xFF] {
            marker = bytes(file)?;
        }
        match marker[0] {
            // Start of frame, whatever its coding.
            0xC0..=0xC3 | 0xC5..=0xC7 | 0xC9..=0xCB | 0xCD..=0xCF => {
                go_to(file, SeekFrom::Current(3))?;
                let height = u16::from_be_bytes(bytes(file)?);
                return Ok(Some((u16::from_be_bytes(bytes(file)?).into(), height.into())));
            }
            // End of the image and start of a scan.
            0xD9 | 0xDA => return Ok(None),
            // These markers have no segment.
            0x00 | 0x01 | 0xD0..=0xD8 => {}
            _ => {
                let length = i64::from(u16::from_be_bytes(bytes(file)?));
                go_to(file, SeekFrom::Current(length - 2))?;
            }
        }
    }
}

/// A TIFF, or a BigTIFF, with the order of its bytes.
struct Tiff<'a, F> {
    file: &'a mut F,
    big: bool,
    u16: fn([u8; 2]) -> u16,
    u32: fn([u8; 4]) -> u32,
    u64: fn([u8; 8]) -> u64,
}

impl<F: Read + Seek> Tiff<'_, F> {
    /// The size is among the fields of the first directory, in any type of whole number.
    fn size(&mut self) -> Result<Option<Size>, ImageFileError> {
        const WIDTH: u16 = 256;
        const HEIGHT: u16 = 257;
        go_to(self.file, SeekFrom::Start(if self.big { 8 } else { 4 }))?;
        let directory = self.offset()?;
        go_to(self.file, SeekFrom::Start(directory))?;
        let fields = if self.big { self.offset()? } else { (self.u16)(bytes(self.file)?).into() };
        let (mut width, mut height) = (None, None);
        for _field in 0..fields.min(MAX_FIELDS) {
            let tag = (self.u16)(bytes(self.file)?);
            let kind = (self.u16)(bytes(self.file)?);
            let _count = self.offset()?;
            let value = if self.big { bytes(self.file)? } else { widened(bytes(self.file)?) };
            let number = self.number(kind, value);
            match tag {
                WIDTH => width = number,
                HEIGHT => height = number,
                _ => {}
            }
        }
        Ok(width.zip(height))
    }

    /// A place in the file, or a count.
    fn offset(&mut self) -> Result<u64, ImageFileError> {
        Ok(if self.big { (self.u64)(bytes(self.file)?) } else { (self.u32)(bytes(self.file)?).into() })
    }

    /// Value of a field; `None` when it is not an integer of 32 bits.
    fn number(&self, kind: u16, [a, b, c, d, e, f, g, h]: [u8; 8]) -> Option<u32> {
        match kind {
            1 => Some(a.into()),
            3 => Some((self.u16)([a, b]).into()),
            4 => Some((self.u32)([a, b, c, d])),
            16 => u32::try_from((self.u64)([a, b, c, d, e, f, g, h])).ok(),
            _ => None,
        }
    }
}

fn widened([a, b, c, d]: [u8; 4]) -> [u8; 8] {
    [a, b, c, d, 0, 0, 0, 0]
}
