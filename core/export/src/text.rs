//! Shared parts of the text formats: numbers, names, comments, and their comparison after reading back.

use nalgebra::Isometry3;

use super::input::NamedTransform;
use super::{TOLERANCE, rotation};
use handeye_result::CalibrationResult;

/// Rotation convention of a file: the words of its first comment.
#[derive(Debug, Clone, Copy)]
pub(super) enum Rotation {
    Quaternion,
    Rpy,
    QuaternionAndRpy,
    Matrix,
    Vector,
}

impl Rotation {
    fn words(self) -> &'static str {
        const RPY: &str = "rpy: radians about fixed x, y, z (URDF), R = Rz(yaw) * Ry(pitch) * Rx(roll)";
        const QUATERNION_AND_RPY: &str = "quaternion x y z w; \
            rpy: radians about fixed x, y, z (URDF), R = Rz(yaw) * Ry(pitch) * Rx(roll)";
        match self {
            Self::Quaternion => "quaternion x y z w, no Euler angles",
            Self::Rpy => RPY,
            Self::QuaternionAndRpy => QUATERNION_AND_RPY,
            Self::Matrix => "rotation matrix by rows, no Euler angles",
            Self::Vector => "rotation vector (axis times angle, radians), no Euler angles",
        }
    }
}

/// The first comment for a transform: its direction, units, and what made it. One line, ASCII.
pub(super) fn about_transform(
    transform: &NamedTransform<'_>,
    unit: &str,
    rotation: Rotation,
    result: &CalibrationResult,
) -> String {
    let (parent, child) = (transform.parent, transform.child);
    format!(
        "T_{parent}_{child}: a point p in {child} is T * p in {parent}. {unit}; {}. {}",
        rotation.words(),
        made_by(result)
    )
}

/// The first comment for a camera alone.
pub(super) fn about_intrinsics(result: &CalibrationResult) -> String {
    format!(
        "Intrinsics in pixels, pixel (0, 0) is the centre of the top-left pixel; no transform and no Euler angles. {}",
        made_by(result)
    )
}

/// Program and input that a result comes from.
pub(super) fn made_by(result: &CalibrationResult) -> String {
    // Free text must not end the comment that it is in.
    fn plain(text: &str) -> String {
        text.chars().filter(char::is_ascii_graphic).take(64).collect()
    }
    let provenance = &result.provenance;
    let input = provenance.input_sha256.as_deref().map_or("unknown".to_owned(), plain);
    format!("Made by handeye {}, input sha256 {input}.", plain(&provenance.tool_version))
}

/// A number with every digit that it has, and a decimal point or exponent so that no reader takes it for an integer.
pub(super) fn number(value: f64) -> String {
    let text = format!("{value:?}");
    // YAML 1.1 knows an exponent only behind a decimal point and with a sign.
    match text.split_once('e') {
        None => text,
        Some((digits, exponent)) => {
            let point = if digits.contains('.') { "" } else { ".0" };
            let sign = if exponent.starts_with('-') { "" } else { "+" };
            format!("{digits}{point}e{sign}{exponent}")
        }
    }
}

pub(super) fn numbers(values: &[f64]) -> String {
    values.iter().map(|v| number(*v)).collect::<Vec<_>>().join(", ")
}

/// Numbers with blanks between them: XML attributes, command lines, COLMAP.
pub(super) fn spaced(values: &[f64]) -> String {
    values.iter().map(|v| number(*v)).collect::<Vec<_>>().join(" ")
}

/// A line of a YAML map.
pub(super) fn entry(indent: usize, key: &str, value: f64) -> String {
    format!("{:indent$}{key}: {}\n", "", number(value))
}

/// Lines of a YAML map.
pub(super) fn entries(indent: usize, keys: &[&str], values: &[f64]) -> String {
    keys.iter().zip(values).map(|(key, value)| entry(indent, key, *value)).collect()
}

/// A name that YAML takes for nothing but text: `on`, `1e3` and `null` would be something else.
pub(super) fn quoted(name: &str) -> String {
    const WORDS: [&str; 10] = ["y", "n", "yes", "no", "on", "off", "true", "false", "null", "nan"];
    let is_word = WORDS.contains(&name.to_ascii_lowercase().as_str());
    let is_plain = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_' || c == '/');
    if is_plain && !is_word { name.to_owned() } else { format!("\"{name}\"") }
}

/// A frame name as an identifier: characters that are not valid in one are written `_`.
pub(super) fn identifier(name: &str) -> String {
    let plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if plain.starts_with(|c: char| c.is_ascii_digit()) { format!("_{plain}") } else { plain }
}

pub(super) fn parse_number(what: &str, text: &str) -> Result<f64, String> {
    text.trim().parse().map_err(|_error| format!("{what}: {text:?} is not a number"))
}

/// Numbers with blanks between them.
pub(super) fn parse_spaced(what: &str, text: &str) -> Result<Vec<f64>, String> {
    text.split_whitespace().map(|word| parse_number(what, word)).collect()
}

/// A fixed count of numbers with blanks between them.
pub(super) fn parse_exactly<const N: usize>(what: &str, text: &str) -> Result<[f64; N], String> {
    let found = parse_spaced(what, text)?;
    let count = found.len();
    found.try_into().map_err(|_found| format!("{what} has {count} numbers, not {N}"))
}

pub(super) fn compare_numbers(what: &str, got: &[f64], expected: &[f64]) -> Result<(), String> {
    // A number that is not known is written as NaN, and has to be read as one.
    let is_same = |a: f64, b: f64| (a.is_nan() && b.is_nan()) || (a - b).abs() <= TOLERANCE;
    let same = got.len() == expected.len() && got.iter().zip(expected).all(|(a, b)| is_same(*a, *b));
    if same { Ok(()) } else { Err(format!("{what} is {got:?}, not {expected:?}")) }
}

pub(super) fn compare_text(what: &str, got: &str, expected: &str) -> Result<(), String> {
    if got == expected { Ok(()) } else { Err(format!("{what} is {got:?}, not {expected:?}")) }
}

/// Compares a transform put together from the numbers of a file, in the file's own convention, with what it should be.
pub(super) fn compare_isometry(what: &str, got: &Isometry3<f64>, expected: &Isometry3<f64>) -> Result<(), String> {
    compare_rows(what, &rotation::rows(got), expected)
}

/// [`compare_isometry`] for the rows of a homogeneous matrix.
pub(super) fn compare_rows(what: &str, got: &[[f64; 4]; 4], expected: &Isometry3<f64>) -> Result<(), String> {
    let rows = rotation::rows(expected);
    // Far from the origin an inverted transform has the rounding of its distance.
    let far = TOLERANCE.max(1e-12 * expected.translation.vector.norm());
    let is_near = |i: usize, j: usize| (got[i][j] - rows[i][j]).abs() <= if j == 3 { far } else { TOLERANCE };
    let same = (0..4).all(|i| (0..4).all(|j| is_near(i, j)));
    if same { Ok(()) } else { Err(format!("{what} is {got:?}, not {rows:?}")) }
}
