//! Candidates: points that look like the meeting of four squares.

use nalgebra::Vector2;

use super::pyramid::Level;
use crate::VisionError;
use crate::error::go_on;
use handeye_geometry::progress::CancelToken;

/// A point with four alternating sectors around it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Saddle {
    /// In pixels of the level.
    pub px: Vector2<f64>,
    /// Unit vectors along both edges; either may point the other way.
    pub edges: [Vector2<f64>; 2],
    /// Whether the sector from the first edge to the second is dark.
    pub dark_between: bool,
    strength: u16,
}

impl Saddle {
    /// Whether the sector that `direction` points into is dark.
    pub fn is_dark(&self, direction: &Vector2<f64>) -> bool {
        let side = self.edges[0].perp(direction) * self.edges[1].perp(direction);
        (side < 0.0) == self.dark_between
    }

    /// Sine of the angle between `direction` and the edge closest to it.
    pub fn off_edge(&self, direction: &Vector2<f64>) -> f64 {
        let unit = direction / direction.norm();
        self.edges[0].perp(&unit).abs().min(self.edges[1].perp(&unit).abs())
    }
}

/// Pixels at the border without a response: two for the second differences, one for the box.
const BORDER: usize = 4;
/// Pixels that are processed together.
const CHUNK: usize = 16;
/// Responses are stored in units of this power of two, so that the largest fits 16 bits.
const RESPONSE_SHIFT: u32 = 6;
/// Least response: that of a sharp corner with 8 grey levels between dark and light.
const MIN_RESPONSE: u16 = 60;
/// More candidates than this are noise or texture; the strongest are kept.
const MAX_SADDLES: usize = 6000;
/// Samples on the ring around a candidate: even, and in steps well below the angle between edges.
const RING: usize = 16;
/// Radius of the ring in pixels: within squares of 5 px, outside of the blur of a lens in focus.
const RING_PX: f32 = 3.0;
/// Least difference between dark and light on the ring, in sums of nine pixels: 7 grey levels.
const MIN_STEP: f32 = 9.0 * 7.0;
/// The parts of the ring across from each other may differ by this part of their variation: noise, a glare, a centre
/// off by half a pixel.
const MAX_ODD: f32 = 0.5;
/// Least angle between edges in samples of the ring: 18°, squares seen at 70° off their normal.
const MIN_ANGLE: f32 = 0.8;
/// Furthest, in samples, that the two ends of an edge may be from opposite.
const MAX_KINK: f32 = 2.0;

/// All candidates of a level, the strongest first.
pub(super) fn find(level: &Level, cancel: &CancelToken) -> Result<Vec<Saddle>, VisionError> {
    let (width, height) = level.size();
    if width <= 2 * BORDER || height <= 2 * BORDER {
        return Ok(Vec::new());
    }
    let boxes = box_sums(level, cancel)?;
    let responses = responses(&boxes, width, height, cancel)?;
    let mut out = Vec::new();
    for y in BORDER..height - BORDER {
        go_on(cancel)?;
        let row = &responses[y * width + BORDER..(y + 1) * width - BORDER];
        for (chunk_index, chunk) in row.chunks(CHUNK).enumerate() {
            if chunk.iter().fold(0, |most, r| most.max(*r)) < MIN_RESPONSE {
                continue;
            }
            let from = BORDER + chunk_index * CHUNK;
            let around = largest_around(&responses, width, from, y);
            for (i, (&strength, &most)) in chunk.iter().zip(&around).enumerate() {
                let x = from + i;
                if strength >= MIN_RESPONSE
                    && strength == most
                    && is_peak(&responses, width, x, y, strength)
                    && let Some(saddle) = saddle_at(&boxes, width, height, x, y, strength)
                {
                    out.push(saddle);
                }
            }
        }
    }
    out.sort_by_key(|saddle| std::cmp::Reverse(saddle.strength));
    out.truncate(MAX_SADDLES);
    Ok(out)
}

/// Sums of 3×3 pixels: at most 2295.
fn box_sums(level: &Level, cancel: &CancelToken) -> Result<Vec<i16>, VisionError> {
    let (width, height) = level.size();
    let mut out = vec![0i16; width * height];
    let mut column = vec![0i16; width];
    for y in 1..height - 1 {
        go_on(cancel)?;
        let rows = [y - 1, y, y + 1].map(|v| &level.pixels[v * width..(v + 1) * width]);
        // Nothing here can overflow; arithmetic without checks lets the compiler use vector instructions.
        for (((sum, a), b), c) in column.iter_mut().zip(rows[0]).zip(rows[1]).zip(rows[2]) {
            *sum = i16::from(*a).wrapping_add(i16::from(*b)).wrapping_add(i16::from(*c));
        }
        let target = &mut out[y * width + 1..(y + 1) * width - 1];
        for (((sum, a), b), c) in target.iter_mut().zip(&column).zip(&column[1..]).zip(&column[2..]) {
            *sum = a.wrapping_add(*b).wrapping_add(*c);
        }
    }
    Ok(out)
}

/// The determinant of the Hessian with the sign turned: positive at saddles, zero elsewhere.
fn responses(boxes: &[i16], width: usize, height: usize, cancel: &CancelToken) -> Result<Vec<u16>, VisionError> {
    let mut out = vec![0u16; width * height];
    let count = width - 2 * BORDER;
    for y in BORDER..height - BORDER {
        go_on(cancel)?;
        // Slices of equal length, so that the loop below needs no checks.
        let at = |dx: isize, dy: isize| {
            let start = ((y as isize + dy) * width as isize + BORDER as isize + dx) as usize;
            &boxes[start..start + count]
        };
        let (middle, left, right, up, down) = (at(0, 0), at(-2, 0), at(2, 0), at(0, -2), at(0, 2));
        let (ul, ur, dl, dr) = (at(-1, -1), at(1, -1), at(-1, 1), at(1, 1));
        let target = &mut out[y * width + BORDER..y * width + BORDER + count];
        for i in 0..count {
            let twice = middle[i].wrapping_add(middle[i]);
            let xx = i32::from(left[i].wrapping_sub(twice).wrapping_add(right[i]));
            let yy = i32::from(up[i].wrapping_sub(twice).wrapping_add(down[i]));
            let xy = i32::from(ul[i].wrapping_sub(ur[i]).wrapping_sub(dl[i]).wrapping_add(dr[i]));
            let saddle = xy.wrapping_mul(xy).wrapping_sub(xx.wrapping_mul(yy)) >> RESPONSE_SHIFT;
            target[i] = saddle.clamp(0, 65535) as u16;
        }
    }
    Ok(out)
}

/// The largest response of 5×5 around every pixel of a chunk: all at once, since in noise every other pixel is a saddle.
fn largest_around(responses: &[u16], width: usize, x: usize, y: usize) -> [u16; CHUNK] {
    let mut columns = [0u16; CHUNK + 4];
    for v in y - 2..=y + 2 {
        // Beyond the end of a row are the borders of this and the next, and then what no pixel of the chunk needs.
        let row = responses.get(v * width + x - 2..).unwrap_or_default();
        for (most, response) in columns.iter_mut().zip(row) {
            *most = (*most).max(*response);
        }
    }
    std::array::from_fn(|i| columns[i..i + 5].iter().fold(0, |most, r| most.max(*r)))
}

/// Largest of 5×5; of equals the first.
fn is_peak(responses: &[u16], width: usize, x: usize, y: usize, strength: u16) -> bool {
    (0..5).all(|dy| {
        let start = (y + dy - 2) * width + x - 2;
        responses[start..start + 5].iter().enumerate().all(|(dx, &other)| {
            let before = dy < 2 || (dy == 2 && dx < 2);
            other < strength || (other == strength && !before)
        })
    })
}

fn saddle_at(boxes: &[i16], width: usize, height: usize, x: usize, y: usize, strength: u16) -> Option<Saddle> {
    let at = |dx: isize, dy: isize| f32::from(boxes[((y as isize + dy) * width as isize + x as isize + dx) as usize]);
    let (gx, gy) = ((at(2, 0) - at(-2, 0)) / 4.0, (at(0, 2) - at(0, -2)) / 4.0);
    let (xx, yy) = ((at(-2, 0) - 2.0 * at(0, 0) + at(2, 0)) / 4.0, (at(0, -2) - 2.0 * at(0, 0) + at(0, 2)) / 4.0);
    let xy = (at(-1, -1) - at(1, -1) - at(-1, 1) + at(1, 1)) / 4.0;
    let determinant = xx * yy - xy * xy;
    if determinant >= 0.0 {
        return None;
    }
    let (dx, dy) = ((xy * gy - yy * gx) / determinant, (xy * gx - xx * gy) / determinant);
    let cut = (1.0 / dx.hypot(dy)).min(1.0);
    let (cx, cy) = (x as f32 + dx * cut, y as f32 + dy * cut);
    let ring = ring(boxes, width, height, cx, cy)?;
    let (edges, dark_between) = sectors(&ring)?;
    let px = Vector2::new(f64::from(cx), f64::from(cy));
    Some(Saddle { px, edges, dark_between, strength })
}

fn ring(boxes: &[i16], width: usize, height: usize, cx: f32, cy: f32) -> Option<[f32; RING]> {
    let reach = RING_PX + 2.0;
    if cx < reach || cy < reach || cx + reach > width as f32 || cy + reach > height as f32 {
        return None;
    }
    Some(std::array::from_fn(|i| {
        let (sin, cos) = RING_DIRECTIONS[i];
        let (u, v) = (cx + RING_PX * cos, cy + RING_PX * sin);
        // Positive, see above: the cast rounds down.
        let (x, y) = (u as usize, v as usize);
        let (fx, fy) = (u - x as f32, v - y as f32);
        let across = |y: usize| {
            let pair = &boxes[y * width + x..y * width + x + 2];
            f32::from(pair[0]) * (1.0 - fx) + f32::from(pair[1]) * fx
        };
        across(y) * (1.0 - fy) + across(y + 1) * fy
    }))
}

/// Sine and cosine of the angles of the ring.
static RING_DIRECTIONS: [(f32, f32); RING] = {
    const C: f32 = 0.923_879_5;
    const H: f32 = std::f32::consts::FRAC_1_SQRT_2;
    const S: f32 = 0.382_683_43;
    [
        (0.0, 1.0),
        (S, C),
        (H, H),
        (C, S),
        (1.0, 0.0),
        (C, -S),
        (H, -H),
        (S, -C),
        (0.0, -1.0),
        (-S, -C),
        (-H, -H),
        (-C, -S),
        (-1.0, 0.0),
        (-C, S),
        (-H, H),
        (-S, C),
    ]
};

/// Directions of both edges and whether the sector between is dark; `None` unless the ring alternates four times and
/// looks the same after half a turn.
fn sectors(ring: &[f32; RING]) -> Option<([Vector2<f64>; 2], bool)> {
    const HALF: usize = RING / 2;
    let (low, high) = ring.iter().fold((f32::MAX, f32::MIN), |(low, high), &v| (low.min(v), high.max(v)));
    if high - low < MIN_STEP {
        return None;
    }
    let middle = 0.5 * (low + high);
    let odd: f32 = (0..HALF).map(|i| (ring[i] - ring[i + HALF]).powi(2)).sum::<f32>() / 2.0;
    let all: f32 = ring.iter().map(|v| (v - middle).powi(2)).sum();
    if odd > MAX_ODD * all {
        return None;
    }
    let (mut crossings, mut count) = ([0.0; 4], 0);
    let mut first_falls = false;
    for i in 0..RING {
        let (here, next) = (ring[i] - middle, ring[(i + 1) % RING] - middle);
        if (here < 0.0) != (next < 0.0) {
            if count == 4 {
                return None;
            }
            if count == 0 {
                first_falls = next < 0.0;
            }
            crossings[count] = i as f32 + here / (here - next);
            count += 1;
        }
    }
    if count != 4 {
        return None;
    }
    let half = HALF as f32;
    let [a, b, c, d] = crossings;
    if (c - a - half).abs() > MAX_KINK || (d - b - half).abs() > MAX_KINK {
        return None;
    }
    let (first, second) = (0.5 * (a + c - half), 0.5 * (b + d - half));
    let apart = second - first;
    if !(MIN_ANGLE..=half - MIN_ANGLE).contains(&apart) {
        return None;
    }
    let edge = |samples: f32| {
        let (sin, cos) = (f64::from(samples) * std::f64::consts::PI / half as f64).sin_cos();
        Vector2::new(cos, sin)
    };
    Some(([edge(first), edge(second)], first_falls))
}
