//! From candidates to the grid of a board.

use std::collections::{BTreeMap, VecDeque};

use nalgebra::Vector2;

use super::saddles::Saddle;
use crate::VisionError;
use crate::error::go_on;
use handeye_geometry::progress::CancelToken;

/// The grid of a board as found on a level of the pyramid.
pub(super) struct Grown {
    /// In rows of the board's columns, pixels of the level.
    pub points: Vec<Vector2<f64>>,
    /// Whether a saddle was seen there; the other points are from the grid.
    pub seen: Vec<bool>,
}

/// Seeds look this far for their neighbours [px of the level]: larger squares are small on a coarser level.
const SEED_REACH_PX: f64 = 34.0;
/// Sine of the angle that a seed's neighbour may lie off its edge: half the error of the ring, and a lens.
const SEED_CONE: f64 = 0.25;
/// Ratio of opposite steps of a seed: strong perspective with small squares.
const SEED_RATIO: f64 = 1.9;
/// A point is taken within this part of a step from where the grid puts it.
const NEAR: f64 = 0.3;
/// Sine of the angle between a step and the edges at both of its ends: errors of the ring on squares of 5 px.
const OFF_EDGE: f64 = 0.42;
/// Part of the points that must be seen, in all and in every line: dirt and glare hide single ones.
pub(super) const MIN_SEEN: f64 = 0.85;
const MIN_SEEN_IN_LINE: f64 = 0.6;
/// A line beyond the board of which more than this part is seen makes it another board; less is clutter next to it.
const MAX_BEYOND: f64 = 0.6;
/// Bins of the search for neighbours \[px of the level\].
const BIN_PX: f64 = 8.0;

/// Points along the shorter side of the smallest grid that counts as one.
const LEAST_SIDE: i32 = 3;

type Node = (i32, i32);

const DIRECTIONS: [Node; 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

/// The grid with `columns` × `rows` points among the candidates, in either orientation.
pub(super) fn grow(
    saddles: &[Saddle],
    size: (usize, usize),
    (columns, rows): (usize, usize),
    cancel: &CancelToken,
) -> Result<Option<Grown>, VisionError> {
    let need = (MIN_SEEN * (columns * rows) as f64).ceil() as usize;
    if saddles.len() < need {
        return Ok(None);
    }
    let bins = Bins::new(saddles, size);
    let mut visited = vec![false; saddles.len()];
    for seed in 0..saddles.len() {
        go_on(cancel)?;
        if visited[seed] {
            continue;
        }
        let Some(start) = seed_at(saddles, &bins, seed) else { continue };
        let lattice = Lattice::from_seed(saddles, &bins, &start, 2 * columns * rows + 100);
        for &index in lattice.nodes.values() {
            visited[index] = true;
        }
        if lattice.nodes.len() >= need
            && let Some(grown) = lattice.board(columns, rows)
        {
            return Ok(Some(grown));
        }
    }
    Ok(None)
}

/// Points of the largest grid among the candidates along its sides, whatever grid is searched; `None` where no grid has
/// three by three.
pub(super) fn largest(
    saddles: &[Saddle],
    size: (usize, usize),
    cancel: &CancelToken,
) -> Result<Option<(usize, usize)>, VisionError> {
    let bins = Bins::new(saddles, size);
    let mut visited = vec![false; saddles.len()];
    let mut best = None;
    for seed in 0..saddles.len() {
        go_on(cancel)?;
        if visited[seed] {
            continue;
        }
        let Some(start) = seed_at(saddles, &bins, seed) else { continue };
        let lattice = Lattice::from_seed(saddles, &bins, &start, saddles.len());
        for &index in lattice.nodes.values() {
            visited[index] = true;
        }
        let sides = lattice.whole_part();
        best = best.max(sides.map(|(width, height)| (width * height, width, height)));
    }
    Ok(best.map(|(_, width, height)| (width, height)))
}

/// Candidates by place.
struct Bins {
    columns: usize,
    rows: usize,
    /// Start of each bin in `members`.
    starts: Vec<u32>,
    members: Vec<u32>,
}

impl Bins {
    fn new(saddles: &[Saddle], (width, height): (usize, usize)) -> Self {
        let (columns, rows) = (width / BIN_PX as usize + 1, height / BIN_PX as usize + 1);
        let bin = |s: &Saddle| (s.px.y / BIN_PX) as usize * columns + (s.px.x / BIN_PX) as usize;
        let mut starts = vec![0u32; columns * rows + 1];
        for saddle in saddles {
            starts[bin(saddle) + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut members = vec![0u32; saddles.len()];
        for (index, saddle) in saddles.iter().enumerate() {
            let slot = &mut next[bin(saddle)];
            members[*slot as usize] = index as u32;
            *slot += 1;
        }
        Self { columns, rows, starts, members }
    }

    /// All candidates in the bins that a circle touches.
    fn around(&self, px: Vector2<f64>, radius: f64) -> impl Iterator<Item = usize> + '_ {
        let range = |c: f64, n: usize| {
            // A negative number becomes 0, a large one is cut: either way no bin too many is harmful.
            let bin = |c: f64| (c.max(0.0) as usize).min(n);
            bin((c - radius) / BIN_PX)..bin((c + radius) / BIN_PX + 1.0)
        };
        let columns = range(px.x, self.columns);
        range(px.y, self.rows).flat_map(move |row| {
            let (from, to) = (row * self.columns + columns.start, row * self.columns + columns.end.max(columns.start));
            let members = self.starts[from] as usize..self.starts[to.max(from)] as usize;
            self.members[members].iter().map(|&i| i as usize)
        })
    }
}

/// A candidate with a neighbour along each half of its edges.
struct Seed {
    centre: usize,
    neighbours: [usize; 4],
}

fn seed_at(saddles: &[Saddle], bins: &Bins, centre: usize) -> Option<Seed> {
    let here = &saddles[centre];
    let [x, y] = here.edges;
    let diagonal = x + y;
    let dark = here.is_dark(&diagonal);
    let mut best = [(f64::INFINITY, usize::MAX); 4];
    for index in bins.around(here.px, SEED_REACH_PX) {
        let offset = saddles[index].px - here.px;
        let squared = offset.norm_squared();
        if index == centre || squared > SEED_REACH_PX * SEED_REACH_PX {
            continue;
        }
        for (axis, direction) in [x, y].iter().enumerate() {
            let off = direction.perp(&offset);
            if off * off >= SEED_CONE * SEED_CONE * squared {
                continue;
            }
            let slot = if direction.dot(&offset) > 0.0 { axis } else { axis + 2 };
            if squared < best[slot].0
                && saddles[index].is_dark(&diagonal) != dark
                && saddles[index].off_edge(direction) < OFF_EDGE
            {
                best[slot] = (squared, index);
            }
        }
    }
    let alike = |a: f64, b: f64| a.max(b) < SEED_RATIO * SEED_RATIO * a.min(b);
    let complete = best.iter().all(|(_, index)| *index != usize::MAX);
    (complete && alike(best[0].0, best[2].0) && alike(best[1].0, best[3].0))
        .then(|| Seed { centre, neighbours: best.map(|(_, index)| index) })
}

struct Lattice<'a> {
    saddles: &'a [Saddle],
    nodes: BTreeMap<Node, usize>,
}

impl<'a> Lattice<'a> {
    fn from_seed(saddles: &'a [Saddle], bins: &Bins, seed: &Seed, most: usize) -> Self {
        let mut lattice = Self { saddles, nodes: BTreeMap::from([((0, 0), seed.centre)]) };
        let mut taken = vec![seed.centre];
        let mut queue = VecDeque::new();
        for (direction, index) in DIRECTIONS.into_iter().zip(seed.neighbours) {
            lattice.nodes.insert(direction, index);
            taken.push(index);
            queue.push_back(direction);
        }
        let mut is_taken = vec![false; saddles.len()];
        for index in taken {
            is_taken[index] = true;
        }
        while let Some(node) = queue.pop_front() {
            if lattice.nodes.len() > most {
                break;
            }
            for direction in DIRECTIONS {
                let next = (node.0 + direction.0, node.1 + direction.1);
                if lattice.nodes.contains_key(&next) {
                    continue;
                }
                if let Some(index) = lattice.next(bins, &is_taken, node, direction) {
                    lattice.nodes.insert(next, index);
                    is_taken[index] = true;
                    queue.push_back(next);
                }
            }
        }
        lattice
    }

    fn px(&self, node: Node) -> Option<Vector2<f64>> {
        self.nodes.get(&node).map(|&i| self.saddles[i].px)
    }

    /// The step from `node` in a direction that the points around it suggest.
    fn step(&self, node: Node, (dx, dy): Node) -> Option<Vector2<f64>> {
        let here = self.px(node)?;
        let (mut sum, mut count) = (Vector2::zeros(), 0.0);
        if let Some(behind) = self.px((node.0 - dx, node.1 - dy)) {
            sum += here - behind;
            count += 1.0;
        }
        for side in [1, -1] {
            let beside = (node.0 + side * dy, node.1 + side * dx);
            if let (Some(from), Some(to)) = (self.px(beside), self.px((beside.0 + dx, beside.1 + dy))) {
                sum += to - from;
                count += 1.0;
            }
        }
        (count > 0.0).then(|| sum / count)
    }

    fn next(&self, bins: &Bins, is_taken: &[bool], node: Node, direction: Node) -> Option<usize> {
        let from = &self.saddles[*self.nodes.get(&node)?];
        let step = self.step(node, direction)?;
        let expected = from.px + step;
        let near = NEAR * step.norm();
        if from.off_edge(&step) > OFF_EDGE {
            return None;
        }
        // The dark squares change sides from one corner to the next; the bisector of both edges decides.
        let across = from.edges[0] + from.edges[1];
        let dark = from.is_dark(&across);
        let mut best = (near, None);
        for index in bins.around(expected, near) {
            let to = &self.saddles[index];
            let distance = (to.px - expected).norm();
            if distance < best.0
                && !is_taken[index]
                && to.is_dark(&across) != dark
                && to.off_edge(&(to.px - from.px)) < OFF_EDGE
            {
                best = (distance, Some(index));
            }
        }
        best.1
    }

    /// The part of the grid that is the board.
    fn board(&self, columns: usize, rows: usize) -> Option<Grown> {
        let (low, high) = self.bounds();
        let mut best: Option<(usize, Window)> = None;
        for (width, height) in [(columns as i32, rows as i32), (rows as i32, columns as i32)] {
            for y in low.1..=high.1 - height + 1 {
                for x in low.0..=high.0 - width + 1 {
                    let window = Window { x, y, width, height };
                    let count = self.nodes.keys().filter(|node| window.contains(**node)).count();
                    if best.as_ref().is_none_or(|(most, _)| count > *most) {
                        best = Some((count, window));
                    }
                }
            }
            if columns == rows {
                break;
            }
        }
        let (count, window) = best?;
        let enough = count as f64 >= MIN_SEEN * (columns * rows) as f64;
        (enough && self.is_whole(&window)).then(|| self.points(&window, columns)).flatten()
    }

    /// Sides of the rest when lines that are mostly missing are removed from its rim; `None` below three by three.
    fn whole_part(&self) -> Option<(usize, usize)> {
        let (low, high) = self.bounds();
        let mut window = Window { x: low.0, y: low.1, width: high.0 - low.0 + 1, height: high.1 - low.1 + 1 };
        while window.width >= LEAST_SIDE && window.height >= LEAST_SIDE {
            let Window { x, y, width, height } = window;
            let rims = [
                (self.part_of_column(&window, x), Window { x: x + 1, width: width - 1, ..window }),
                (self.part_of_column(&window, x + width - 1), Window { width: width - 1, ..window }),
                (self.part_of_row(&window, y), Window { y: y + 1, height: height - 1, ..window }),
                (self.part_of_row(&window, y + height - 1), Window { height: height - 1, ..window }),
            ];
            let emptiest = rims.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
            if emptiest.0 >= MIN_SEEN_IN_LINE {
                return Some((width as usize, height as usize));
            }
            window = emptiest.1;
        }
        None
    }

    fn part_of_row(&self, window: &Window, y: i32) -> f64 {
        let seen = (window.x..window.x + window.width).filter(|x| self.nodes.contains_key(&(*x, y))).count();
        seen as f64 / f64::from(window.width)
    }

    fn part_of_column(&self, window: &Window, x: i32) -> f64 {
        let seen = (window.y..window.y + window.height).filter(|y| self.nodes.contains_key(&(x, *y))).count();
        seen as f64 / f64::from(window.height)
    }

    fn bounds(&self) -> (Node, Node) {
        let (mut low, mut high) = ((i32::MAX, i32::MAX), (i32::MIN, i32::MIN));
        for &(x, y) in self.nodes.keys() {
            low = (low.0.min(x), low.1.min(y));
            high = (high.0.max(x), high.1.max(y));
        }
        (low, high)
    }

    /// Whether every line of the board is mostly seen, and no line beyond it.
    fn is_whole(&self, window: &Window) -> bool {
        let Window { x, y, width, height } = *window;
        let (row, column) = (|y| self.part_of_row(window, y), |x| self.part_of_column(window, x));
        (y..y + height).all(|y| row(y) >= MIN_SEEN_IN_LINE)
            && (x..x + width).all(|x| column(x) >= MIN_SEEN_IN_LINE)
            && [y - 1, y + height].into_iter().all(|y| row(y) <= MAX_BEYOND)
            && [x - 1, x + width].into_iter().all(|x| column(x) <= MAX_BEYOND)
    }

    fn points(&self, window: &Window, columns: usize) -> Option<Grown> {
        let Window { x, y, width, height } = *window;
        let mut known: BTreeMap<Node, Vector2<f64>> = BTreeMap::new();
        for node in self.nodes.keys().filter(|node| window.contains(**node)) {
            known.insert(*node, self.px(*node)?);
        }
        // Rows of the board along the longer or shorter side as the target has them.
        let turned = width as usize != columns;
        let nodes: Vec<Node> = if turned {
            (x..x + width).flat_map(|x| (y..y + height).map(move |y| (x, y))).collect()
        } else {
            (y..y + height).flat_map(|y| (x..x + width).map(move |x| (x, y))).collect()
        };
        let seen = nodes.iter().map(|node| known.contains_key(node)).collect();
        while known.len() < nodes.len() {
            let missing: Vec<Node> = nodes.iter().copied().filter(|node| !known.contains_key(node)).collect();
            let guesses: Vec<_> =
                missing.into_iter().filter_map(|node| guess(&known, node).map(|px| (node, px))).collect();
            if guesses.is_empty() {
                return None;
            }
            known.extend(guesses);
        }
        let points = nodes.iter().map(|node| known[node]).collect();
        Some(Grown { points, seen })
    }
}

/// The place of a point between two neighbours, or in line with two.
fn guess(known: &BTreeMap<Node, Vector2<f64>>, (x, y): Node) -> Option<Vector2<f64>> {
    let at = |dx: i32, dy: i32| known.get(&(x + dx, y + dy)).copied();
    let between = [(1, 0), (0, 1)].into_iter().filter_map(|(dx, dy)| Some((at(dx, dy)? + at(-dx, -dy)?) / 2.0));
    let beyond = DIRECTIONS.into_iter().filter_map(|(dx, dy)| Some(at(dx, dy)? * 2.0 - at(2 * dx, 2 * dy)?));
    let mean = |all: Vec<Vector2<f64>>| (!all.is_empty()).then(|| all.iter().sum::<Vector2<f64>>() / all.len() as f64);
    mean(between.collect()).or_else(|| mean(beyond.collect()))
}

#[derive(Debug, Clone, Copy)]
struct Window {
    x: i32,
    y: i32,
    width: i32,
    height: i32,
}

impl Window {
    fn contains(&self, (x, y): Node) -> bool {
        (self.x..self.x + self.width).contains(&x) && (self.y..self.y + self.height).contains(&y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_candidate_is_around_a_place_outside_of_the_image() {
        let bins = Bins::new(&[], (64, 48));
        for u in [-1e9, -70.0, 63.9, 70.0, 200.0, 1e9, f64::NAN] {
            for v in [-1e9, -70.0, 47.9, 70.0, 200.0, 1e9, f64::NAN] {
                assert_eq!(bins.around(Vector2::new(u, v), 12.0).count(), 0);
            }
        }
    }
}
