//! Arrays of NumPy: `.npy`, and `.npz`, a ZIP of them. Numbers and texts are read; pickled objects never are, since reading
//! one would run it.

use std::io::{Cursor, Read as _};
use std::sync::Arc;

use super::parts::{self, Part};
use super::{Encoding, File, Format, tree};
use crate::folder;
use crate::formats::nothing::Likely;
use crate::formats::reader::Reader;
use crate::recording::{Sample, Stated, Track};
use crate::value::Value;
use handeye_files::budget::Budget;
use handeye_wording::Text;
use handeye_wording::foreign;
use handeye_wording::text;

/// Most arrays of a file, and most numbers of one.
const MOST_ARRAYS: usize = 64;
const MOST_NUMBERS: usize = 4_000_000;
/// Numbers of an array that may be one pose, joint values or a camera.
const MOST_OF_A_POSE: usize = 64;

pub(super) struct NumPy;

impl Format for NumPy {
    fn name(&self) -> Text {
        Text::verbatim("NumPy")
    }

    fn endings(&self) -> &'static [(&'static str, Encoding)] {
        &[("npz", Encoding::Own), ("npy", Encoding::Own)]
    }

    fn read(&self, file: &File, reader: &mut Reader<'_>) -> bool {
        match folder::bytes(&reader.root.join(&file.path)) {
            Err(error) => reader.recording.warnings.push(error.into()),
            Ok(bytes) => match read(&file.name(), &bytes, reader.budget) {
                Err(why) => reader.not_used(&file.path, why),
                Ok((tracks, warnings)) => {
                    reader.recording.tracks.extend(tracks);
                    reader.recording.warnings.extend(warnings);
                }
            },
        }
        true
    }

    fn instead(&self, file: &File, reader: &Reader<'_>) -> Option<(Likely, Text)> {
        let bytes = folder::bytes(&reader.root.join(&file.path)).ok()?;
        document(&bytes, reader.budget).as_ref().map(tree::instead)
    }
}

struct Array {
    name: String,
    shape: Vec<usize>,
    content: Content,
}

enum Content {
    Numbers(Vec<f64>),
    Texts(Vec<String>),
}

/// The series of poses in a file, and what of it was not read.
fn read(file: &str, bytes: &[u8], budget: &Budget<'_>) -> Result<(Vec<Track>, Vec<Text>), Text> {
    let (arrays, warnings) = arrays(file, bytes, budget)?;
    Ok((series(file, &arrays), warnings))
}

/// The arrays of a small file as fields by their names; an array that is alone without a name is the whole of it.
pub(super) fn document(bytes: &[u8], budget: &Budget<'_>) -> Option<Value> {
    let (arrays, _) = arrays("", bytes, budget).ok()?;
    let mut entries: Vec<(String, Value)> = Vec::new();
    for array in arrays {
        let value = match array.content {
            Content::Numbers(numbers) => match numbers.as_slice() {
                [one] if array.shape.is_empty() => Value::Number(*one),
                _ if numbers.len() <= MOST_OF_A_POSE => Value::List(numbers.into_iter().map(Value::Number).collect()),
                _ => Value::Other,
            },
            Content::Texts(mut texts) if texts.len() == 1 => Value::Text(texts.swap_remove(0)),
            Content::Texts(_) => Value::Other,
        };
        entries.push((array.name, value));
    }
    match entries.as_slice() {
        [(name, _)] if name.is_empty() => entries.pop().map(|(_, value)| value),
        _ => Some(Value::Map(entries)),
    }
}

fn arrays(file: &str, bytes: &[u8], budget: &Budget<'_>) -> Result<(Vec<Array>, Vec<Text>), Text> {
    let mut warnings = Vec::new();
    let mut arrays = Vec::new();
    if bytes.starts_with(b"PK") {
        let mut zip = zip::ZipArchive::new(Cursor::new(bytes)).map_err(|e| foreign(&e))?;
        for i in 0..zip.len().min(MOST_ARRAYS) {
            let entry = zip.by_index(i).map_err(|e| foreign(&e))?;
            let name = entry.name().trim_end_matches(".npy").to_owned();
            let mut content = Vec::new();
            // The stated unpacked size is not trusted: no more is read than an array may have.
            let most = 16 * MOST_NUMBERS as u64;
            let unpacked = entry.take(most).read_to_end(&mut content).map_err(|e| foreign(&e))?;
            budget.unpack(unpacked as u64)?;
            match array(&name, &content) {
                Ok(array) => arrays.push(array),
                Err(why) => warnings.push(text!(
                    "{file}: array {name} is not used: {why}",
                    file = file,
                    name = format!("{name:?}"),
                    why = why
                )),
            }
        }
    } else {
        arrays.push(array("", bytes)?);
    }
    Ok((arrays, warnings))
}

fn series(file: &str, arrays: &[Array]) -> Vec<Track> {
    let mut tracks = Vec::new();
    let mut parts = Vec::new();
    for array in arrays {
        let Content::Numbers(numbers) = &array.content else { continue };
        let count = array.shape.first().copied().unwrap_or(0);
        if count < tree::LEAST_POSES || numbers.len() % count != 0 {
            continue;
        }
        let rows: Vec<Vec<f64>> = numbers.chunks_exact((numbers.len() / count).max(1)).map(<[f64]>::to_vec).collect();
        if [3, 4, 9].contains(&rows[0].len()) {
            parts.push(Part { name: array.name.clone(), rows });
            continue;
        }
        if tree::is_about_joints(&array.name) {
            continue;
        }
        let named = arrays.iter().find_map(|other| match &other.content {
            Content::Texts(texts) if texts.len() == count && texts.iter().all(|t| tree::is_image_name(t)) => {
                Some(texts)
            }
            _ => None,
        });
        let mut stated = Stated::default();
        let samples = rows.iter().enumerate().filter_map(|(i, row)| {
            let (numbers, reported) = tree::of_numbers(row, &array.name)?;
            stated = reported;
            let place = text!("{file}, {array} entry {entry}", file = file, array = &array.name, entry = i + 1);
            let place = Arc::new(place);
            Some(Sample { image: named.map(|n| n[i].clone()), number: None, place, numbers, joints: Vec::new() })
        });
        let samples: Vec<Sample> = samples.collect();
        tracks.extend(tree::track(tree::track_name(file, &array.name), &array.name, stated, samples));
    }
    tracks.extend(parts::series(&parts, file));
    tree::call_after_files(&mut tracks, file, tree::role_of_document(file));
    tracks
}

/// Reads one array: the magic, a header that is a Python dictionary of three entries, the numbers.
fn array(name: &str, bytes: &[u8]) -> Result<Array, Text> {
    let short = || text!("it ends early");
    let no_shape = || text!("its header has no shape");
    let no_type = || text!("its type is not known");
    let rest = bytes.strip_prefix(b"\x93NUMPY").ok_or_else(|| text!("it is no array of NumPy"))?;
    let (&major, rest) = rest.split_first().ok_or_else(short)?;
    let rest = rest.get(1..).ok_or_else(short)?;
    let (length, rest) = if major == 1 {
        let (size, rest) = rest.split_first_chunk::<2>().ok_or_else(short)?;
        (usize::from(u16::from_le_bytes(*size)), rest)
    } else {
        let (size, rest) = rest.split_first_chunk::<4>().ok_or_else(short)?;
        (u32::from_le_bytes(*size) as usize, rest)
    };
    let (header, data) = rest.split_at_checked(length).ok_or_else(short)?;
    let header = String::from_utf8_lossy(header);
    let after =
        |key: &str| header.split_once(key).map(|(_, rest)| rest.trim_start().trim_start_matches(':').trim_start());
    let kind = after("'descr'").and_then(|rest| rest.strip_prefix('\'')).and_then(|rest| rest.split_once('\''));
    let (kind, _) = kind.ok_or_else(|| text!("its header has no simple type"))?;
    let fortran = after("'fortran_order'").is_some_and(|rest| rest.starts_with("True"));
    let shape = after("'shape'").and_then(|rest| rest.strip_prefix('(')).and_then(|rest| rest.split_once(')'));
    let shape = shape.ok_or_else(no_shape)?.0;
    let shape: Vec<usize> = shape
        .split(',')
        .map(str::trim)
        .filter(|part| !part.is_empty())
        .map(|part| part.parse().map_err(|_error| no_shape()))
        .collect::<Result<_, _>>()?;
    let count = shape.iter().try_fold(1usize, |product, n| product.checked_mul(*n)).filter(|n| *n <= MOST_NUMBERS);
    let count = count.ok_or_else(|| text!("it has more than {most} numbers", most = MOST_NUMBERS))?;
    if kind.contains('O') {
        return Err(text!("it holds Python objects, which are never unpickled; save it as numbers"));
    }
    let (order, kind) = kind.split_at_checked(1).ok_or_else(no_type)?;
    let is_big = order == ">";
    let (letter, size) = kind.split_at_checked(1).ok_or_else(no_type)?;
    let size: usize = size.parse().map_err(|_error| no_type())?;
    let content = if letter == "U" {
        Content::Texts(texts(data, count, size, is_big).ok_or_else(short)?)
    } else {
        let numbers = numbers(data, count, letter, size, is_big).ok_or_else(short)?;
        if fortran && shape.len() > 1 {
            Content::Numbers(row_major(&numbers, &shape))
        } else {
            Content::Numbers(numbers)
        }
    };
    Ok(Array { name: name.to_owned(), shape, content })
}

fn numbers(data: &[u8], count: usize, letter: &str, size: usize, is_big: bool) -> Option<Vec<f64>> {
    if !matches!(size, 1 | 2 | 4 | 8) {
        return None;
    }
    let data = data.get(..count.checked_mul(size)?)?;
    let one = |bytes: &[u8]| -> Option<f64> {
        let mut padded = [0u8; 8];
        for (i, byte) in bytes.iter().enumerate() {
            padded[if is_big { size - 1 - i } else { i }] = *byte;
        }
        let raw = u64::from_le_bytes(padded);
        Some(match (letter, size) {
            ("f", 8) => f64::from_bits(raw),
            ("f", 4) => f64::from(f32::from_bits(raw as u32)),
            ("i", 8) => raw as i64 as f64,
            ("i", 4) => f64::from(raw as u32 as i32),
            ("i", 2) => f64::from(raw as u16 as i16),
            ("i", 1) => f64::from(raw as u8 as i8),
            ("u", _) => raw as f64,
            _ => return None,
        })
    };
    data.chunks_exact(size).map(one).collect()
}

/// Texts of `size` characters of four bytes, filled up with zeros.
fn texts(data: &[u8], count: usize, size: usize, is_big: bool) -> Option<Vec<String>> {
    let bytes = size.checked_mul(4)?;
    let data = data.get(..count.checked_mul(bytes)?)?;
    if bytes == 0 {
        return None;
    }
    let text = |chunk: &[u8]| {
        let code = |c: &[u8]| {
            let four = [c[0], c[1], c[2], c[3]];
            if is_big { u32::from_be_bytes(four) } else { u32::from_le_bytes(four) }
        };
        chunk.chunks_exact(4).map(code).take_while(|c| *c != 0).filter_map(char::from_u32).collect()
    };
    Some(data.chunks_exact(bytes).map(text).collect())
}

/// Numbers in column-major order, converted to row-major order.
fn row_major(numbers: &[f64], shape: &[usize]) -> Vec<f64> {
    let mut out = Vec::with_capacity(numbers.len());
    let mut index = vec![0usize; shape.len()];
    for _ in 0..numbers.len() {
        let mut at = 0;
        for (i, size) in index.iter().zip(shape).rev() {
            at = at * size + i;
        }
        out.push(numbers[at]);
        for (i, size) in index.iter_mut().zip(shape).rev() {
            *i += 1;
            if *i < *size {
                break;
            }
            *i = 0;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use handeye_files::budget::Limits;
    use handeye_geometry::progress::CancelToken;

    fn npy(kind: &str, fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
        let fortran = if fortran { "True" } else { "False" };
        let header = format!("{{'descr': '{kind}', 'fortran_order': {fortran}, 'shape': ({shape}), }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend_from_slice(&(header.len() as u16).to_le_bytes());
        bytes.extend_from_slice(header.as_bytes());
        bytes.extend_from_slice(data);
        bytes
    }

    fn read_all(file: &str, bytes: &[u8]) -> Result<(Vec<Track>, Vec<Text>), Text> {
        let cancel = CancelToken::default();
        read(file, bytes, &Budget::new(Limits::default(), &|| Duration::ZERO, &cancel))
    }

    #[test]
    fn numbers_of_every_type_and_order_are_read() {
        let doubles: Vec<u8> = (0..18).flat_map(|i| f64::from(i).to_le_bytes()).collect();
        let (tracks, _) = read_all("a.npy", &npy("<f8", false, "3, 6", &doubles)).expect("read");
        let numbers: Vec<_> = tracks[0].samples.iter().map(|s| s.numbers).collect();
        let columns: Vec<u8> = (0..18).flat_map(|i| f32::from((i % 3 * 6 + i / 3) as i16).to_be_bytes()).collect();
        let (tracks, _) = read_all("a.npy", &npy(">f4", true, "3, 6", &columns)).expect("read");
        assert_eq!(tracks[0].samples.iter().map(|s| s.numbers).collect::<Vec<_>>(), numbers);
    }

    #[test]
    fn objects_are_never_unpickled() {
        let error = read_all("a.npy", &npy("|O", false, "3,", b"\x80\x04cos\nsystem\n")).expect_err("refused");
        assert!(error.to_string().contains("never unpickled"), "{error}");
    }

    #[test]
    fn a_size_that_is_not_there_takes_no_memory() {
        for shape in ["99999999999, 6", "18446744073709551615, 18446744073709551615", "3, 6"] {
            assert!(read_all("a.npy", &npy("<f8", false, shape, &[0; 16])).is_err(), "{shape}");
        }
    }
}
