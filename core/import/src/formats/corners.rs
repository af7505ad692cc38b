//! Corners that another program has found, in JSON or YAML: lists of image points, one per file or per element of a list, with the
//! size of the image and of the board where the file has them.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::tree::{LEAST_POSES, is_image_name, track_name};
use super::{File, Format};
use crate::folder;
use crate::formats::reader::Reader;
use crate::recording::{FoundTarget, ImageFile, Stream};
use crate::value::Value;
use handeye_geometry::targets::observation::Corner;
use handeye_geometry::targets::{Grid, TargetSpec};
use handeye_wording::Text;
use handeye_wording::text;

/// Points of the smallest board, and of the largest.
const LEAST_POINTS: usize = 9;
const MOST_POINTS: usize = 100_000;
/// Settings and points are not nested deeper.
const DEEPEST: usize = 8;
/// Elements of a list that is not of points and is looked into.
const MOST_LOOKED_INTO: usize = 4;
/// Most lists of points of one file, such as those before and after a refinement.
const MOST_LISTS: usize = 8;

type Point = [f64; 2];

pub(super) struct Corners;

impl Format for Corners {
    fn name(&self) -> Text {
        text!("corners instead of images")
    }

    fn sniff(&self, file: &File) -> bool {
        file.value().is_some()
    }

    /// They are not poses, which other formats may find in the same files.
    fn read_together(&self, files: &[File], reader: &mut Reader<'_>) -> bool {
        let (streams, targets) = streams(files);
        reader.recording.streams.extend(streams);
        reader.recording.targets.extend(targets);
        false
    }
}

/// The lists of points of one image, by their path in the document.
struct View<'a> {
    file: PathBuf,
    number: Option<u64>,
    value: &'a Value,
    lists: Vec<(String, Vec<Point>)>,
}

impl<'a> View<'a> {
    fn new(file: PathBuf, number: Option<u64>, value: &'a Value) -> Self {
        let mut lists = Vec::new();
        look(value, "", &mut lists, 0);
        Self { file, number, value, lists }
    }
}

/// The streams of points in documents, and the boards that they describe.
fn streams(files: &[File]) -> (Vec<Stream>, Vec<FoundTarget>) {
    let documents = files.iter().filter_map(|file| Some((file, file.value()?)));
    let views: Vec<View<'_>> =
        documents.map(|(file, value)| View::new(file.path.clone(), file.number, value)).collect();
    let of_files = views.iter().filter(|view| !view.lists.is_empty()).count();
    if of_files >= LEAST_POSES {
        let name = folder::shown(files.iter().map(|file| file.path.as_path()));
        return of_views(&name, &views, None);
    }
    let (mut streams, mut targets) = (Vec::new(), Vec::new());
    for file in files {
        let Some((path, elements)) = file.value().and_then(|value| elements(value, "", 0)) else { continue };
        let (more, boards) = of_views(&track_name(&file.name(), &path), &elements, file.value());
        streams.extend(more);
        targets.extend(boards);
    }
    (streams, targets)
}

/// The list or the map that has an element with points for every image.
fn elements<'a>(value: &'a Value, path: &str, depth: usize) -> Option<(String, Vec<View<'a>>)> {
    if depth > DEEPEST {
        return None;
    }
    let views: Vec<View<'a>> = match value {
        Value::List(items) => items
            .iter()
            .enumerate()
            .map(|(i, item)| {
                let name = image_of(item).unwrap_or_else(|| format!("{:06}", i + 1));
                View::new(PathBuf::from(name), number_of(item).or(Some(i as u64)), item)
            })
            .collect(),
        Value::Map(entries) => {
            entries.iter().map(|(key, item)| View::new(PathBuf::from(key), digits(key), item)).collect()
        }
        _ => return None,
    };
    let with_points = views.iter().filter(|view| !view.lists.is_empty()).count();
    // Lists of one image, such as points before and after a refinement, are not separate images.
    let are_images = with_points >= LEAST_POSES && 2 * with_points >= views.len();
    if are_images {
        return Some((path.to_owned(), views));
    }
    let Value::Map(entries) = value else { return None };
    entries.iter().find_map(|(key, inner)| {
        let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
        elements(inner, &path, depth + 1)
    })
}

/// The number that a name ends in.
fn digits(key: &str) -> Option<u64> {
    let stem = if is_image_name(key) { key.rsplit_once('.').map_or(key, |(stem, _)| stem) } else { key };
    stem[stem.trim_end_matches(|c: char| c.is_ascii_digit()).len()..].parse().ok()
}

fn image_of(value: &Value) -> Option<String> {
    let Value::Map(entries) = value else { return None };
    let texts = || entries.iter().filter_map(|(key, inner)| Some((key.to_lowercase(), inner.text()?)));
    let named = texts().find(|(_, text)| is_image_name(text));
    let named = named.or_else(|| {
        texts().find(|(key, _)| matches!(&**key, "file" | "name" | "file_name" | "filename" | "image" | "view"))
    });
    named.map(|(_, text)| text.trim().to_owned())
}

fn number_of(value: &Value) -> Option<u64> {
    ["id", "index", "frame", "number", "view", "image_id"].iter().find_map(|key| value.get(key)?.whole())
}

fn of_views(name: &str, views: &[View<'_>], whole: Option<&Value>) -> (Vec<Stream>, Vec<FoundTarget>) {
    let mut paths: BTreeMap<&str, usize> = BTreeMap::new();
    for (path, _) in views.iter().flat_map(|view| &view.lists) {
        *paths.entry(path).or_default() += 1;
    }
    let reported = |view: &View<'_>| size(view.value, 0).or_else(|| size(whole?, 0));
    let mut streams = Vec::new();
    let mut counts: Vec<usize> = Vec::new();
    for (path, count) in paths {
        if count < LEAST_POSES {
            continue;
        }
        let mut images = Vec::new();
        let mut points = Vec::new();
        let mut sizes: Vec<Option<(u32, u32)>> = Vec::new();
        for view in views {
            let list = view.lists.iter().find(|(it, _)| it == path).map(|(_, list)| list.clone());
            counts.extend(list.iter().map(Vec::len));
            sizes.push(reported(view));
            images.push(ImageFile { path: view.file.clone(), number: view.number, same_as: None, stamp_ns: None });
            points.push(list);
        }
        // Two cameras are two recordings.
        let size = sizes.first().copied().flatten().filter(|first| sizes.iter().all(|size| *size == Some(*first)));
        let name = if path.is_empty() { name.to_owned() } else { format!("{name}:{path}") };
        streams.push(Stream { name, images, size: size.unwrap_or_default(), is_depth: false, points: Some(points) });
    }
    let boards = views.iter().filter_map(|view| board(view.value, 0)).chain(whole.and_then(|whole| board(whole, 0)));
    let boards: Vec<Grid> = boards.filter(|grid| counts.contains(&grid.len())).collect();
    let is_one = boards.windows(2).all(|pair| pair[0] == pair[1]);
    let found =
        |grid: &Grid| FoundTarget { target: TargetSpec::Chessboard(*grid), file: name.to_owned(), is_id_open: false };
    let targets = boards.first().filter(|_| is_one && !streams.is_empty()).map(found).into_iter().collect();
    (streams, targets)
}

/// Every list of points of an image in a value, with its path.
fn look(value: &Value, path: &str, lists: &mut Vec<(String, Vec<Point>)>, depth: usize) {
    if depth > DEEPEST || lists.len() >= MOST_LISTS {
        return;
    }
    // Points of the board are in space.
    let lower = path.to_lowercase();
    if ["object", "obj_", "objp", "world", "3d", "pose"].iter().any(|word| lower.contains(word)) {
        return;
    }
    if let Some(points) = points(value, &lower) {
        lists.push((path.to_owned(), points));
        return;
    }
    match value {
        Value::Map(entries) => {
            for (key, inner) in entries {
                let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                look(inner, &path, lists, depth + 1);
            }
        }
        Value::List(items) => {
            for (i, item) in items.iter().take(MOST_LOOKED_INTO).enumerate() {
                look(item, &format!("{path}[{i}]"), lists, depth + 1);
            }
        }
        _ => {}
    }
}

/// The points of a value: a list of pairs, however they are nested or called, or their coordinates one after the other or in two
/// lists.
fn points(value: &Value, path: &str) -> Option<Vec<Point>> {
    let list = match value {
        Value::Map(_) => {
            let of = |keys: [&str; 2]| {
                let [u, v] = keys.map(|key| value.get(key).and_then(|list| list.numbers(MOST_POINTS)));
                let (u, v) = (u?, v?);
                (u.len() == v.len()).then(|| u.into_iter().zip(v).map(|(u, v)| [u, v]).collect::<Vec<Point>>())
            };
            [["u", "v"], ["x", "y"], ["px", "py"]].into_iter().find_map(of)?
        }
        Value::List(items) => {
            let mut points = Vec::new();
            let are_pairs = items.iter().try_for_each(|item| pairs(item, &mut points, 0));
            if are_pairs.is_some() {
                points
            } else {
                // Consecutive numbers are points where their name says so.
                let is_named = ["corner", "point", "pixel", "pts", "uv"].iter().any(|word| path.contains(word));
                let numbers =
                    value.numbers(2 * MOST_POINTS).filter(|numbers| is_named && numbers.len().is_multiple_of(2))?;
                let is_flat = items.iter().all(|item| item.number().is_some());
                is_flat.then(|| numbers.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect::<Vec<Point>>())?
            }
        }
        _ => return None,
    };
    let is_seen = |point: &Point| point.iter().all(|px| px.is_finite() && (-1.0..1e5).contains(px));
    // Coordinates of one are those of a normalised image, or of a list of ids.
    let has_pixels = list.iter().any(|point| point[0] > 2.0 && point[1] > 2.0);
    ((LEAST_POINTS..MOST_POINTS).contains(&list.len()) && has_pixels && list.iter().all(is_seen)).then_some(list)
}

fn pairs(value: &Value, points: &mut Vec<Point>, depth: usize) -> Option<()> {
    if points.len() > MOST_POINTS || depth > 3 {
        return None;
    }
    let of_map = |keys: [&str; 2]| {
        let [u, v] = keys.map(|key| value.get(key).and_then(Value::number));
        Some([u?, v?])
    };
    match value {
        Value::Map(_) => points.push([["u", "v"], ["x", "y"], ["px", "py"]].into_iter().find_map(of_map)?),
        Value::List(items) => match items.as_slice() {
            [Value::Number(u), Value::Number(v)] => points.push([*u, *v]),
            [] => return None,
            inner => inner.iter().try_for_each(|item| pairs(item, points, depth + 1))?,
        },
        _ => return None,
    }
    Some(())
}

/// The size of the image that a document states, in pixels.
fn size(value: &Value, depth: usize) -> Option<(u32, u32)> {
    let Value::Map(entries) = value else { return None };
    let whole = |keys: &[&str]| {
        keys.iter().find_map(|key| value.get(key)?.whole()).and_then(|n| u32::try_from(n).ok()).filter(|n| *n > 0)
    };
    let sides = (
        whole(&["image_width", "imageWidth", "img_width", "width", "w"]),
        whole(&["image_height", "imageHeight", "img_height", "height", "h"]),
    );
    if let (Some(width), Some(height)) = sides {
        return Some((width, height));
    }
    let two = |key: &str| -> Option<[f64; 2]> { value.get(key)?.numbers(2)?.try_into().ok() };
    let named = ["image_size", "imageSize", "img_size", "resolution", "image_resolution", "frame_size"];
    if let Some([width, height]) = named.iter().find_map(|key| two(key)) {
        return whole_size(width, height);
    }
    // NumPy's order is rows, columns, channels.
    let shape = ["image_shape", "img_shape", "shape"].iter().find_map(|key| value.get(key)?.numbers(3));
    if let Some([height, width, ..]) = shape.as_deref() {
        return whole_size(*width, *height);
    }
    let nested = |(_, inner): &(String, Value)| if depth < 3 { size(inner, depth + 1) } else { None };
    entries.iter().find_map(nested)
}

fn whole_size(width: f64, height: f64) -> Option<(u32, u32)> {
    let side = |px: f64| (px.fract() == 0.0 && (1.0..1e5).contains(&px)).then_some(px as u32);
    Some((side(width)?, side(height)?))
}

/// A board that a document describes with the unit of its square in the name; one without a unit is reported and not used.
fn board(value: &Value, depth: usize) -> Option<Grid> {
    let Value::Map(entries) = value else { return None };
    let side = |number: f64| (number.fract() == 0.0 && (2.0..1000.0).contains(&number)).then_some(number as usize);
    let one = |keys: &[&str]| keys.iter().find_map(|key| value.get(key)?.number()).and_then(side);
    let two = entries.iter().find_map(|(key, inner)| {
        let lower = key.to_lowercase();
        let is_size = ["chessboard", "checkerboard", "board", "pattern", "grid", "inner_corners"]
            .iter()
            .any(|it| lower.contains(it));
        let [columns, rows] = inner.list() else { return None };
        is_size.then(|| Some((side(columns.number()?)?, side(rows.number()?)?)))?
    });
    let apart = || Some((one(&["columns", "cols", "corners_x", "nx"])?, one(&["rows", "corners_y", "ny"])?));
    let square = entries.iter().find_map(|(key, inner)| {
        let lower = key.to_lowercase();
        let is_square = ["square", "spacing", "tile", "cell"].iter().any(|word| lower.contains(word));
        let units = [
            ("_mm", 1e-3),
            ("_cm", 1e-2),
            ("_m", 1.0),
            ("(mm)", 1e-3),
            ("[mm]", 1e-3),
            ("meters", 1.0),
            ("metres", 1.0),
        ];
        let unit = units.iter().find(|(unit, _)| lower.ends_with(unit))?.1;
        let length = inner.number().filter(|length| length.is_finite() && *length > 0.0)?;
        is_square.then_some(length * unit)
    });
    match (two.or_else(apart), square) {
        (Some((columns, rows)), Some(square_m)) => Some(Grid { columns, rows, square_m }),
        _ if depth < 3 => entries.iter().find_map(|(_, inner)| board(inner, depth + 1)),
        _ => None,
    }
}

/// The recorded points of an image as corners of a target, which has as many. Whether points go down the columns or along the
/// rows is decided by which of the two is a grid in perspective.
///
/// # Errors
/// A sentence, where the target has another number of points, or is not a grid.
pub(crate) fn numbered(points: &[Point], target: &TargetSpec) -> Result<Vec<Corner>, Text> {
    let grid = match target {
        TargetSpec::Chessboard(grid) | TargetSpec::Circles(grid) => *grid,
        other => {
            return Err(text!(
                "recorded corners are those of a chessboard or a grid of dots, and {other} was given",
                other = other.text()
            ));
        }
    };
    let (columns, rows) = (grid.columns, grid.rows);
    if points.len() != grid.len() {
        return Err(text!(
            "{recorded} corners were recorded, and the target has {count} ({columns} × {rows})",
            recorded = points.len(),
            count = grid.len(),
            columns = columns,
            rows = rows
        ));
    }
    let by_rows = |at: usize| at;
    let by_columns = |at: usize| (at % rows) * columns + at / rows;
    let corners = |number: &dyn Fn(usize) -> usize| -> Vec<Corner> {
        let mut all: Vec<Corner> =
            points.iter().enumerate().map(|(at, px)| Corner::new(number(at), (*px).into())).collect();
        all.sort_by_key(|corner| corner.index);
        all
    };
    let (plain, turned) = (corners(&by_rows), corners(&by_columns));
    let bent = |corners: &[Corner]| bent_px(corners, columns, rows);
    Ok(if bent(&turned) < bent(&plain) { turned } else { plain })
}

/// Mean distance of corners from the middle of their two neighbours: little along the lines of a grid.
fn bent_px(corners: &[Corner], columns: usize, rows: usize) -> f64 {
    let at = |column: usize, row: usize| corners[row * columns + column].px;
    let along = (0..rows).flat_map(|row| (1..columns - 1).map(move |c| ((c - 1, row), (c, row), (c + 1, row))));
    let down =
        (0..columns).flat_map(|column| (1..rows - 1).map(move |r| ((column, r - 1), (column, r), (column, r + 1))));
    let triples = along.chain(down);
    triples.map(|(a, b, c)| ((at(a.0, a.1) + at(c.0, c.1)) / 2.0 - at(b.0, b.1)).norm()).sum()
}

/// Whether points are in an image of this size, as far as a refinement may slide over its border.
pub(crate) fn are_inside(points: &[Point], (width, height): (u32, u32)) -> bool {
    let is_in = |px: f64, side: u32| (-1.0..=f64::from(side)).contains(&px);
    points.iter().all(|[u, v]| is_in(*u, width) && is_in(*v, height))
}
