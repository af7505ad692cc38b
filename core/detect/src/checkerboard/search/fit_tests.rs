use super::*;

/// Half the difference between dark and light that the errors below are parts of.
const CONTRAST: f64 = 100.0;
/// The mean level, clear of both ends of the scale.
const LEVEL: f64 = 128.0;

/// A corner seen by one pixel: the corner from the middle of the pixel \[px\], the directions of the edges [°], the blur of
/// the lens \[px\].
#[derive(Debug, Clone, Copy)]
struct Errors {
    corner: Vector2<f64>,
    directions: [f64; 2],
    lens: f64,
}

/// Pairs of edges that cross at 60° or more, along the pixels, across them and between.
const DIRECTIONS: [[f64; 2]; 7] =
    [[0.0, 90.0], [90.0, 180.0], [1.0, 91.0], [22.0, 112.0], [45.0, 135.0], [20.0, 80.0], [150.0, 30.0]];

/// Corners at places within a pixel.
fn corners() -> impl Iterator<Item = Vector2<f64>> {
    (0..19).flat_map(|i| (0..19).map(move |j| Vector2::new(f64::from(i), f64::from(j)) * 0.13 - Vector2::repeat(1.177)))
}

impl Errors {
    fn parameters(&self) -> Parameters {
        let [first, second] = self.directions.map(f64::to_radians);
        let blur = (self.lens * self.lens + PIXEL_AREA).sqrt();
        Parameters::from_column_slice(&[self.corner.x, self.corner.y, 0.0, 0.0, first, second, blur, LEVEL, CONTRAST])
    }

    fn edges(&self) -> [Vector2<f64>; 2] {
        self.directions.map(|degrees| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            Vector2::new(cos, sin)
        })
    }

    /// The mean sign of the pattern over the area of the pixel, moved by `shift`: slice by slice, each exactly.
    fn area(&self, shift: Vector2<f64>, slices: u32) -> f64 {
        let edges = self.edges();
        let middle = shift - self.corner;
        let slice = |i: u32| {
            let y = middle.y + (f64::from(i) + 0.5) / f64::from(slices) - 0.5;
            let ends = [middle.x - 0.5, middle.x + 0.5];
            let [one, other] = [0, 1].map(|k| (y * edges[k].x / edges[k].y).clamp(ends[0], ends[1]));
            let cuts = [ends[0], one.min(other), one.max(other), ends[1]];
            let sign = |x: f64| edges.iter().map(|t| (t.x * y - t.y * x).signum()).product::<f64>();
            cuts.windows(2).map(|pair| (pair[1] - pair[0]) * sign(f64::midpoint(pair[0], pair[1]))).sum::<f64>()
        };
        (0..slices).map(slice).sum::<f64>() / f64::from(slices)
    }

    /// The same through a lens: the mean over the places to which its blur moves the light.
    fn through_the_lens(&self) -> f64 {
        const NODES: i32 = 9;
        let at = |i: i32| 3.6 * f64::from(i) / f64::from(NODES);
        let weight = |i: i32| (-0.5 * at(i) * at(i)).exp();
        let (mut sum, mut total) = (0.0, 0.0);
        for i in -NODES..=NODES {
            for j in -NODES..=NODES {
                let w = weight(i) * weight(j);
                sum += w * self.area(Vector2::new(at(i), at(j)) * self.lens, 60);
                total += w;
            }
        }
        sum / total
    }
}

/// The model of a pixel and its derivatives.
fn modelled(x: &Parameters) -> (f64, Parameters) {
    let mut group = Group { x: [0.0; LANES], y: [0.0; LANES], level: [LEVEL as f32; LANES], weight: [0.0; LANES] };
    group.weight[0] = 1.0;
    let model = Model::at(x, [0.0; 2], Profile::Pixels);
    let mut rows = model.rows(&group);
    model.add(&group, &Meeting::at(&model.place).seen(&group), &mut rows);
    (f64::from(rows.residuals[0]), Parameters::from_fn(|i, _| f64::from(rows.by[i][0])))
}

#[test]
fn without_blur_a_pixel_sees_the_area_of_the_squares_in_it() {
    let mut worst: f64 = 0.0;
    for directions in DIRECTIONS {
        for corner in corners() {
            let seen = Errors { corner, directions, lens: 0.0 };
            let off = modelled(&seen.parameters()).0 / CONTRAST - seen.area(Vector2::zeros(), 2000);
            worst = worst.max(off.abs());
        }
    }
    // The least blur of the lens and the least width of a box, 0.01 px each, take that much where an edge along the pixels
    // is on the border of one.
    assert!(worst < 0.012, "{worst}");
}

#[test]
fn through_a_lens_a_pixel_sees_the_mean_over_its_area_to_two_parts_in_a_hundred() {
    for lens in [0.1, 0.25, 0.5] {
        let mut worst: f64 = 0.0;
        for directions in DIRECTIONS {
            for corner in corners().step_by(7) {
                let seen = Errors { corner, directions, lens };
                let off = modelled(&seen.parameters()).0 / CONTRAST - seen.through_the_lens();
                worst = worst.max(off.abs());
            }
        }
        println!("lens {lens} px: off by up to {worst:.4} of the contrast");
        assert!(worst < 0.02, "lens {lens} px: {worst}");
    }
}

#[test]
fn derivatives_of_a_pixel_are_those_of_its_value() {
    // Larger than the rounding of single precision, smaller than the pixel.
    const STEP: f64 = 1e-3;
    for lens in [0.15, 0.3, 0.6] {
        for directions in DIRECTIONS {
            for corner in corners().step_by(5) {
                let x = Errors { corner, directions, lens }.parameters();
                let by = modelled(&x).1;
                // A degree from the pixels, the narrow box across an edge is of the size of the step.
                let places: &[usize] = if directions[0] == 1.0 { &[0, 1, BLUR] } else { &[0, 1, 4, 5, BLUR] };
                for &i in places {
                    let mut step = Parameters::zeros();
                    step[i] = STEP;
                    let slope = (modelled(&(x + step)).0 - modelled(&(x - step)).0) / (2.0 * STEP);
                    // The derivative neglects that the boxes across an edge change with its direction.
                    let allowed = if i == 4 || i == 5 { 0.06 } else { 0.03 } * CONTRAST;
                    let off = (slope - by[i]).abs();
                    assert!(off < allowed, "lens {lens}, {directions:?}, {corner:?}, by {i}: {slope} and {}", by[i]);
                }
            }
        }
    }
}
