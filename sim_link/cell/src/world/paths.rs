//! Object paths such as `/UR5/joint`, `./link[1]` and `::/Tip`, and the aliases that lead back.

use super::error::WorldError;
use super::tree::Tree;
use crate::world::handle::Handle;

/// Segments that a path may have. A segment matches at any depth, so the search grows with every one of them.
const MAX_SEGMENTS: usize = 32;

/// Comparisons that one look-up may cost before the path counts as unusable; the reference scene needs under 300.
const MAX_COMPARISONS: usize = 500_000;

/// One name between slashes.
#[derive(Debug, Clone, PartialEq)]
struct Segment {
    pattern: String,
    /// `[n]`: the n-th match on that level, and no search below it.
    on_level: Option<usize>,
    /// `{n}`: the n-th match in search order from this point of the path.
    in_order: Option<usize>,
}

/// Where a path starts.
#[derive(Debug, Clone, PartialEq)]
enum Start {
    Scene,
    At(Handle),
}

struct Search<'a> {
    tree: &'a Tree,
    /// Matches of the whole path that are still to be passed over.
    to_skip: usize,
    comparisons: usize,
}

/// Finds the object at `path`, the `index`-th of several (`None`: the first, or the one that a trailing `{n}` gives).
///
/// `proxy` is where `.` and `:` start from.
///
/// # Errors
/// [`WorldError::NoSuchPath`] for no match and for anything that is not a path.
pub fn find(tree: &Tree, path: &str, index: Option<usize>, proxy: Option<Handle>) -> Result<Handle, WorldError> {
    if let Some(proxy) = proxy
        && !tree.contains(proxy)
    {
        return Err(WorldError::NoSuchProxy);
    }
    let (start, rest) = parse_start(tree, path, proxy).ok_or(WorldError::NoSuchPath)?;
    let mut segments = parse_segments(rest).ok_or(WorldError::NoSuchPath)?;
    let Some(last) = segments.last_mut() else {
        return match start {
            Start::At(handle) if index.unwrap_or(0) == 0 => Ok(handle),
            _ => Err(WorldError::NoSuchPath),
        };
    };
    let in_order = last.in_order.take();
    let to_skip = index.or(in_order).unwrap_or(0);
    let level = match start {
        Start::Scene => tree.level(None),
        Start::At(handle) => tree.level(Some(handle)),
    };
    let mut search = Search { tree, to_skip, comparisons: 0 };
    search.descend(level, &segments, &mut 0).ok_or(WorldError::NoSuchPath)
}

impl Search<'_> {
    /// Searches `level` and everything below it for `segments`; `seen` counts the matches of the first of them.
    fn descend(&mut self, level: &[Handle], segments: &[Segment], seen: &mut usize) -> Option<Handle> {
        let (segment, rest) = segments.split_first()?;
        let mut on_this_level = 0;
        for &handle in level {
            self.comparisons += 1;
            if self.comparisons > MAX_COMPARISONS {
                return None;
            }
            let object = self.tree.get(handle).ok()?;
            if !matches_wildcards(&segment.pattern, &object.alias) {
                continue;
            }
            let position = on_this_level;
            on_this_level += 1;
            if segment.on_level.is_some_and(|wanted| wanted != position) {
                continue;
            }
            let order = *seen;
            *seen += 1;
            if segment.in_order.is_some_and(|wanted| wanted != order) {
                continue;
            }
            let found = if rest.is_empty() {
                self.take(handle)
            } else {
                self.descend(self.tree.level(Some(handle)), rest, &mut 0)
            };
            if found.is_some() {
                return found;
            }
        }
        if segment.on_level.is_some() {
            return None;
        }
        level.iter().find_map(|&handle| self.descend(self.tree.level(Some(handle)), segments, seen))
    }

    fn take(&mut self, handle: Handle) -> Option<Handle> {
        if self.to_skip == 0 {
            return Some(handle);
        }
        self.to_skip -= 1;
        None
    }
}

/// Splits off `/`, `./`, `../`, `:` and so on; `None` if the path does not start like one.
fn parse_start<'a>(tree: &Tree, path: &'a str, proxy: Option<Handle>) -> Option<(Start, &'a str)> {
    if let Some(rest) = path.strip_prefix('/') {
        return Some((Start::Scene, rest));
    }
    let (mut first, mut rest) = split_first_segment(path);
    let Some(proxy) = proxy else {
        // A remote client is not an object: its children are the scene's, but it is not an object itself.
        return (first == "." && !rest.is_empty()).then_some((Start::Scene, rest));
    };
    let mut at = match first {
        "." => proxy,
        ".." => tree.get(proxy).ok()?.parent()?,
        ":" => model_of(tree, proxy)?,
        "::" => model_above(tree, proxy)?,
        _ => return None,
    };
    loop {
        let (next, after) = split_first_segment(rest);
        (first, rest) = match next {
            ".." | "::" => (next, after),
            _ => return Some((Start::At(at), rest)),
        };
        at = if first == ".." { tree.get(at).ok()?.parent()? } else { model_above(tree, at)? };
    }
}

fn split_first_segment(path: &str) -> (&str, &str) {
    path.split_once('/').unwrap_or((path, ""))
}

fn model_of(tree: &Tree, handle: Handle) -> Option<Handle> {
    std::iter::once(handle).chain(tree.ancestors(handle)).find(|&h| tree.get(h).is_ok_and(|object| object.model_base))
}

fn model_above(tree: &Tree, handle: Handle) -> Option<Handle> {
    let model = model_of(tree, handle)?;
    tree.ancestors(model).find(|&h| tree.get(h).is_ok_and(|object| object.model_base))
}

fn parse_segments(path: &str) -> Option<Vec<Segment>> {
    if path.is_empty() {
        return Some(Vec::new());
    }
    let segments = path.split('/').map(parse_segment).collect::<Option<Vec<_>>>()?;
    (segments.len() <= MAX_SEGMENTS).then_some(segments)
}

fn parse_segment(text: &str) -> Option<Segment> {
    let (text, in_order) = split_number(text, '{', '}')?;
    let (pattern, on_level) = split_number(text, '[', ']')?;
    (!pattern.is_empty()).then(|| Segment { pattern: pattern.to_owned(), on_level, in_order })
}

/// `name[3]` → (`name`, 3); `None` for an opened bracket without a number in it.
fn split_number(text: &str, open: char, close: char) -> Option<(&str, Option<usize>)> {
    let Some(inner) = text.strip_suffix(close) else {
        return Some((text, None));
    };
    let (name, digits) = inner.rsplit_once(open)?;
    Some((name, Some(digits.parse().ok()?)))
}

/// Whether `name` fits a pattern in which `*` is any run of characters and `?` any one.
fn matches_wildcards(pattern: &str, name: &str) -> bool {
    if !pattern.contains(['*', '?']) {
        return pattern == name;
    }
    let pattern: Vec<char> = pattern.chars().collect();
    let name: Vec<char> = name.chars().collect();
    let (mut p, mut n) = (0, 0);
    // Position of the last star, and how much of the name it has matched.
    let mut star: Option<(usize, usize)> = None;
    while n < name.len() {
        if p < pattern.len() && pattern[p] == '*' {
            star = Some((p, n));
            p += 1;
        } else if p < pattern.len() && (pattern[p] == '?' || pattern[p] == name[n]) {
            p += 1;
            n += 1;
        } else if let Some((at, swallowed)) = star {
            star = Some((at, swallowed + 1));
            p = at + 1;
            n = swallowed + 1;
        } else {
            return false;
        }
    }
    pattern[p..].iter().all(|&c| c == '*')
}

/// The name of an object in the form that `options` asks for.
///
/// -1 alias; 0 `alias[n]` where siblings share it; 1 the shortest path that leads back; 2 the full path; 3 the alias,
/// with the handle if others have the same; 4 alias with handle; 5 as 1; 6 to 9 `/alias{n}` after none, one, two or
/// all of its parent models.
///
/// # Errors
/// [`WorldError::NoSuchObject`]; [`WorldError::InvalidArguments`] for another option.
pub fn alias(tree: &Tree, handle: Handle, options: i64) -> Result<String, WorldError> {
    let name = tree.get(handle)?.alias.clone();
    let tagged = || format!("{name}__{handle}__");
    match options {
        -1 => Ok(name),
        0 => Ok(ordered(tree, handle)),
        1 | 5 => Ok(shortest_path(tree, handle)),
        2 => Ok(full_path(tree, handle)),
        3 if tree.iter().filter(|(_, object)| object.alias == name).count() == 1 => Ok(name),
        3 | 4 => Ok(tagged()),
        6..=9 => Ok(model_path(tree, handle, [0, 1, 2, usize::MAX][(options - 6) as usize])),
        _ => Err(WorldError::InvalidArguments),
    }
}

fn ordered(tree: &Tree, handle: Handle) -> String {
    let Ok(object) = tree.get(handle) else { return String::new() };
    let same: Vec<Handle> = tree
        .level(object.parent())
        .iter()
        .copied()
        .filter(|&sibling| tree.get(sibling).is_ok_and(|other| other.alias == object.alias))
        .collect();
    match same.iter().position(|&sibling| sibling == handle) {
        Some(position) if same.len() > 1 => format!("{}[{position}]", object.alias),
        _ => object.alias.clone(),
    }
}

fn full_path(tree: &Tree, handle: Handle) -> String {
    let mut names: Vec<String> =
        std::iter::once(handle).chain(tree.ancestors(handle)).map(|h| ordered(tree, h)).collect();
    names.reverse();
    format!("/{}", names.join("/"))
}

fn shortest_path(tree: &Tree, handle: Handle) -> String {
    let name = ordered(tree, handle);
    let mut candidates = vec![format!("/{name}")];
    if let Some(model) = tree.ancestors(handle).find(|&h| tree.get(h).is_ok_and(|object| object.model_base)) {
        candidates.push(format!("/{}/{name}", ordered(tree, model)));
    }
    candidates
        .into_iter()
        .find(|path| find(tree, path, None, None) == Ok(handle))
        .unwrap_or_else(|| full_path(tree, handle))
}

fn model_path(tree: &Tree, handle: Handle, models: usize) -> String {
    let mut above: Vec<Handle> =
        tree.ancestors(handle).filter(|&h| tree.get(h).is_ok_and(|object| object.model_base)).take(models).collect();
    above.reverse();
    above.push(handle);
    let mut path = String::new();
    for object in above.iter().filter_map(|&h| tree.get(h).ok()) {
        path.push('/');
        path.push_str(&object.alias);
    }
    (0..tree.iter().count())
        .find(|&n| find(tree, &path, Some(n), None) == Ok(handle))
        .map_or_else(|| full_path(tree, handle), |n| format!("{path}{{{n}}}"))
}

#[cfg(test)]
#[path = "paths_tests.rs"]
mod tests;
