//! Tables with a header, which names the columns.

use nalgebra::Matrix4;

use super::cells::Line;
use super::{image_of, sample, whole};
use crate::conventions::{AngleUnit, Euler, LengthUnit, RotationForm, is_unit, rigid};
use crate::formats::{joints, tree};
use crate::recording::{JointSeries, Known, Numbers, Role, Stated, Track};
use crate::value::number;

/// Number of columns that are recognised as joint values without further hints: fewer may be angles of anything.
const LEAST_JOINTS: usize = 4;

/// The name of a column without its unit; and the unit.
fn column(name: &str) -> (String, Option<&'static str>) {
    let lower = name.to_lowercase();
    let lower = lower.trim().trim_matches(['"', '\'']);
    let units = [
        ("mm", "mm"),
        ("cm", "cm"),
        ("deg", "deg"),
        ("degree", "deg"),
        ("degrees", "deg"),
        ("rad", "rad"),
        ("m", "m"),
        ("°", "deg"),
        ("radians", "rad"),
        ("meter", "m"),
        ("metre", "m"),
        ("meters", "m"),
    ];
    let words: Vec<&str> =
        lower.split(['[', ']', '(', ')', ' ', '_', '/', '.', '-', ':']).filter(|w| !w.is_empty()).collect();
    let unit = words.iter().skip(1).find_map(|word| units.iter().find(|(name, _)| name == word).map(|(_, unit)| *unit));
    let is_unit = |word: &str| units.iter().any(|(name, _)| *name == word);
    let rest: Vec<&str> = words.iter().enumerate().filter(|(i, w)| *i == 0 || !is_unit(w)).map(|(_, w)| *w).collect();
    let name = rest.join("_");
    // A field of a message has those that it is in before it: `field.pose.position.x`.
    let own = ["position_", "orientation_", "translation_", "rotation_"].iter().find_map(|field| name.rfind(field));
    (own.map_or(name.as_str(), |at| &name[at..]).to_owned(), unit)
}

/// The names that columns of a pose have, in their order.
const TRANSLATIONS: [[&str; 3]; 9] = [
    ["x", "y", "z"],
    ["tx", "ty", "tz"],
    ["px", "py", "pz"],
    ["t_x", "t_y", "t_z"],
    ["p_x", "p_y", "p_z"],
    ["pos_x", "pos_y", "pos_z"],
    ["position_x", "position_y", "position_z"],
    ["translation_x", "translation_y", "translation_z"],
    ["x_pos", "y_pos", "z_pos"],
];
const QUATERNIONS: [[&str; 4]; 7] = [
    ["qx", "qy", "qz", "qw"],
    ["q_x", "q_y", "q_z", "q_w"],
    ["quat_x", "quat_y", "quat_z", "quat_w"],
    ["orientation_x", "orientation_y", "orientation_z", "orientation_w"],
    ["rotation_x", "rotation_y", "rotation_z", "rotation_w"],
    ["rot_x", "rot_y", "rot_z", "rot_w"],
    ["ox", "oy", "oz", "ow"],
];
const ANGLES: [[&str; 3]; 11] = [
    ["rx", "ry", "rz"],
    ["roll", "pitch", "yaw"],
    ["a", "b", "c"],
    ["w", "p", "r"],
    ["r_x", "r_y", "r_z"],
    ["rot_x", "rot_y", "rot_z"],
    ["rotation_x", "rotation_y", "rotation_z"],
    ["rvec_x", "rvec_y", "rvec_z"],
    ["euler_x", "euler_y", "euler_z"],
    ["alpha", "beta", "gamma"],
    ["theta_x", "theta_y", "theta_z"],
];

pub(super) fn with_header(file: &str, lines: &[Line]) -> Option<Vec<Track>> {
    let at = lines
        .iter()
        .take(20)
        .position(|line| !line.is_numeric() && lines.iter().any(Line::is_numeric) && is_header(line))?;
    let header: Vec<(String, Option<&str>)> = lines[at].cells.iter().map(|cell| column(cell)).collect();
    let find = |name: &str| header.iter().position(|(column, _)| column == name);
    let all = |names: &[&str]| -> Option<Vec<usize>> { names.iter().map(|name| find(name)).collect() };
    let translation = TRANSLATIONS.iter().find_map(|names| all(names));
    let mut stated = Stated::default();
    let by_header = |what: &str| format!("the header of {file}: {what}");
    let rotation = if let Some((names, columns)) = QUATERNIONS.iter().find_map(|names| Some((names, all(names)?))) {
        stated.rotation = Some(Known::by(by_header(&names.join(" ")), vec![RotationForm::Xyzw]));
        Some(columns)
    } else if let Some((names, columns)) = ANGLES.iter().find_map(|names| Some((names, all(names)?))) {
        let forms = match names[0] {
            "roll" => Some(Euler::of_roll_pitch_yaw().into_iter().map(RotationForm::Euler).collect()),
            "rvec_x" => Some(vec![RotationForm::Vector]),
            _ => None,
        };
        stated.rotation = forms.map(|forms| Known::by(by_header(&names.join(" ")), forms));
        if let Some(unit) = header[columns[0]].1 {
            let unit =
                if unit == "deg" { Some(AngleUnit::Degree) } else { (unit == "rad").then_some(AngleUnit::Radian) };
            stated.angle = unit.map(|unit| Known::by(by_header(&lines[at].cells[columns[0]]), unit));
        }
        Some(columns)
    } else {
        let names = |from: usize| -> Vec<String> {
            (from..from + 3).flat_map(|i| (from..from + 3).map(move |j| format!("r{i}{j}"))).collect()
        };
        [1, 0].iter().find_map(|from| {
            let names = names(*from);
            all(&names.iter().map(String::as_str).collect::<Vec<_>>())
        })
    };
    let (translation, rotation) = (translation?, rotation?);
    if let Some(unit) = header[translation[0]].1 {
        let unit = LengthUnit::ALL.into_iter().find(|u| u.name() == unit);
        stated.length = unit.map(|unit| Known::by(by_header(&lines[at].cells[translation[0]]), unit));
    }
    let extra_columns = extra_columns(&header);
    let mut samples = Vec::new();
    for line in &lines[at + 1..] {
        let cell = |i: usize| line.cells.get(i).map_or("", String::as_str);
        let Some(numbers): Option<Vec<f64>> = translation.iter().chain(&rotation).map(|i| number(cell(*i))).collect()
        else {
            continue;
        };
        let pose = match *numbers.as_slice() {
            [x, y, z, a, b, c] => Some(Numbers::Angles([x, y, z, a, b, c])),
            [x, y, z, a, b, c, d] => is_unit(&[a, b, c, d]).then_some(Numbers::Quaternion([x, y, z, a, b, c, d])),
            [x, y, z, ..] => {
                let mut m = Matrix4::identity();
                m.fixed_view_mut::<3, 3>(0, 0).copy_from(&nalgebra::Matrix3::from_row_slice(&numbers[3..]));
                (m[(0, 3)], m[(1, 3)], m[(2, 3)]) = (x, y, z);
                rigid(m.transpose().as_slice()).map(Numbers::Matrix)
            }
            _ => None,
        };
        let Some(pose) = pose else { continue };
        let (named, counted) = called(line, &extra_columns);
        let joints: Option<Vec<f64>> = extra_columns.joints.iter().map(|i| number(cell(*i))).collect();
        samples.push(sample(file, line, named, counted, pose, joints.unwrap_or_default()));
    }
    let mut track = tree::track(file.to_owned(), file, stated, samples)?;
    track.role = if tree::is_of_target(file) { Role::Target } else { Role::Unknown };
    Some(vec![track])
}

/// Columns next to those of a pose.
struct ExtraColumns {
    image: Option<usize>,
    index: Option<usize>,
    joints: Vec<usize>,
}

fn extra_columns(header: &[(String, Option<&str>)]) -> ExtraColumns {
    let find = |name: &str| header.iter().position(|(column, _)| column == name);
    let image = header.iter().position(|(name, _)| {
        matches!(
            &**name,
            "image"
                | "img"
                | "file"
                | "filename"
                | "name"
                | "image_name"
                | "image_file"
                | "path"
                | "image_path"
                | "file_name"
                | "picture"
        )
    });
    let index = header.iter().position(|(name, _)| {
        matches!(
            &**name,
            "id" | "index"
                | "idx"
                | "number"
                | "no"
                | "n"
                | "frame"
                | "num"
                | "sample"
                | "pose"
                | "image_id"
                | "view"
                | "i"
                | ""
        )
    });
    let joints: Vec<usize> = (1..=12)
        .map_while(|j| {
            ["q", "j", "joint", "joint_", "q_", "j_", "axis", "a"]
                .iter()
                .find_map(|prefix| find(&format!("{prefix}{j}")))
        })
        .collect();
    ExtraColumns { image, index, joints }
}

/// The image and the number of a row.
fn called(line: &Line, extra_columns: &ExtraColumns) -> (Option<String>, Option<u64>) {
    let cell = |i: usize| line.cells.get(i).map_or("", String::as_str);
    let named =
        extra_columns.image.map(|i| cell(i).to_owned()).filter(|name| !name.is_empty()).or_else(|| image_of(line));
    match named {
        // An image that is called by its number.
        Some(name) if name.bytes().all(|b| b.is_ascii_digit()) => (None, name.parse().ok()),
        named => (named, extra_columns.index.and_then(|i| number(cell(i))).and_then(whole)),
    }
}

/// The joint values of a table that has no poses.
pub(super) fn joints(file: &str, lines: &[Line]) -> Option<JointSeries> {
    let columns =
        |line: &Line| -> Vec<(String, Option<&'static str>)> { line.cells.iter().map(|cell| column(cell)).collect() };
    let is_header = |line: &Line| !line.is_numeric() && extra_columns(&columns(line)).joints.len() >= LEAST_JOINTS;
    let at = lines.iter().take(20).position(is_header)?;
    let header = columns(&lines[at]);
    let extra_columns = extra_columns(&header);
    let unit = header[extra_columns.joints[0]]
        .1
        .and_then(|unit| AngleUnit::ALL.into_iter().find(|known| known.name() == unit));
    let unit =
        unit.map(|unit| Known::by(format!("the header of {file}: {}", lines[at].cells[extra_columns.joints[0]]), unit));
    let samples = lines[at + 1..].iter().filter_map(|line| {
        let values = extra_columns.joints.iter().map(|i| number(line.cells.get(*i)?)).collect::<Option<Vec<f64>>>()?;
        let (image, number) = called(line, &extra_columns);
        Some(joints::sample(super::place(file, line), image, number, values))
    });
    joints::series(file.to_owned(), Vec::new(), unit, samples.collect())
}

fn is_header(line: &Line) -> bool {
    let names: Vec<String> = line.cells.iter().map(|cell| column(cell).0).collect();
    TRANSLATIONS.iter().any(|axes| axes.iter().all(|axis| names.iter().any(|name| name == axis)))
}
