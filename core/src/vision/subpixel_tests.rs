use super::*;
use crate::vision::rendered::random_scene;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Errors of all corners over some rendered views.
#[derive(Default)]
struct Errors {
    all: Vec<Vector2<f64>>,
}

impl Errors {
    fn add(&mut self, order: &Ordered, truth: &[Vector2<f64>]) {
        self.all.extend(order.points.iter().zip(truth).map(|(p, t)| p - t));
    }

    fn bias(&self) -> Vector2<f64> {
        self.all.iter().sum::<Vector2<f64>>() / self.all.len() as f64
    }

    /// RMS per axis.
    fn rms(&self) -> f64 {
        (self.all.iter().map(nalgebra::Matrix::norm_squared).sum::<f64>() / (2.0 * self.all.len() as f64)).sqrt()
    }

    fn worst(&self) -> f64 {
        self.all.iter().map(nalgebra::Matrix::norm).fold(0.0, f64::max)
    }
}

/// Saddle point of a quadratic fitted to a lightly blurred patch, as a yardstick (Placht et al. 2014).
fn saddle(image: &GrayImage, order: &Ordered, blur: f32) -> Ordered {
    let smooth = image::imageops::blur(
        &image::ImageBuffer::<image::Luma<f32>, Vec<f32>>::from_fn(image.width(), image.height(), |u, v| {
            image::Luma([f32::from(image.get_pixel(u, v).0[0])])
        }),
        blur,
    );
    let mut out = order.clone();
    for (index, point) in out.points.iter_mut().enumerate() {
        let reach = 2.0; let _ = index;
        for _ in 0..3 {
            let centre = point.map(f64::round);
            let mut ata = SMatrix::<f64, 6, 6>::zeros();
            let mut atb = SVector::<f64, 6>::zeros();
            let r = reach as i64;
            for y in -r..=r {
                for x in -r..=r {
                    let (u, v) = (centre.x as i64 + x, centre.y as i64 + y);
                    let (x, y) = (x as f64, y as f64);
                    let row = SVector::<f64, 6>::from_column_slice(&[x * x, x * y, y * y, x, y, 1.0]);
                    ata += row * row.transpose();
                    atb += row * f64::from(smooth.get_pixel(u as u32, v as u32).0[0]);
                }
            }
            let k = ata.cholesky().expect("a full patch").solve(&atb);
            let hessian = nalgebra::Matrix2::new(2.0 * k[0], k[1], k[1], 2.0 * k[2]);
            let Some(inverse) = hessian.try_inverse() else { break };
            let offset = -inverse * Vector2::new(k[3], k[4]);
            if hessian.determinant() < 0.0 && offset.norm() < 1.5 {
                *point = centre + offset;
            }
        }
    }
    out
}

fn compare(views: usize, blur_px: f64, noise: f64) -> [Errors; 3] {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut errors = [Errors::default(), Errors::default(), Errors::default()];
    for view in 0..views {
        let mut scene = random_scene(&mut rng, 0.7, std::f64::consts::PI);
        (scene.blur_px, scene.noise) = (blur_px, noise);
        let image = scene.render(view as u64);
        let truth = scene.truth();
        // The error of a detector without refinement: up to half a pixel.
        let rough = Ordered { points: truth.iter().map(|p| p.map(|c| c.round())).collect(), columns: 10 };
        let sub_pix = corner_sub_pix(&image, &rough).expect("refines");
        errors[0].add(&sub_pix, &truth);
        errors[1].add(&saddle(&image, &sub_pix, 1.5), &truth);
        errors[2].add(&fit_corners(&image, &sub_pix), &truth);
    }
    errors
}

#[test]
fn the_corner_model_beats_corner_sub_pix_on_rendered_boards() {
    for (blur, noise) in [(0.0, 0.0), (0.5, 0.0), (0.7, 2.0), (1.0, 2.0), (0.7, 5.0), (1.5, 2.0), (2.5, 2.0), (0.7, 10.0)] {
        let [sub_pix, saddle, model] = compare(8, blur, noise);
        for (name, e) in [("cornerSubPix", &sub_pix), ("saddle", &saddle), ("model", &model)] {
            println!(
                "blur {blur} noise {noise}: {name:12} bias {:+.4} {:+.4}  rms {:.4}  worst {:.3}",
                e.bias().x,
                e.bias().y,
                e.rms(),
                e.worst()
            );
        }
    }
}
