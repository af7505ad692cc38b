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

/// Errors of `cornerSubPix` and of the model over rendered views of the published scene.
fn compare(views: u64, blur_px: f64, noise: f64) -> [Errors; 2] {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut errors = [Errors::default(), Errors::default()];
    for view in 0..views {
        let mut scene = random_scene(&mut rng, 0.7, std::f64::consts::PI);
        (scene.blur_px, scene.noise) = (blur_px, noise);
        let image = scene.render(view);
        let truth = scene.truth();
        // A detector without refinement is off by up to half a pixel.
        let rough = Ordered { points: truth.iter().map(|p| p.map(f64::round)).collect(), columns: 10 };
        let sub_pix = corner_sub_pix(&image, &rough).expect("refines");
        errors[0].add(&sub_pix, &truth);
        errors[1].add(&refine(&image, &rough).expect("refines"), &truth);
    }
    errors
}

#[test]
fn the_corner_model_beats_corner_sub_pix_on_rendered_boards() {
    // Blur [px], noise [grey levels], RMS per axis [px] allowed: a quarter above what was measured.
    let cases = [
        (0.0, 0.0, 0.003),
        (0.5, 0.0, 0.0045),
        (0.7, 2.0, 0.0095),
        (1.0, 2.0, 0.012),
        (0.7, 5.0, 0.022),
        (1.5, 2.0, 0.018),
        (2.5, 2.0, 0.041),
        (0.7, 10.0, 0.042),
    ];
    for (blur, noise, allowed) in cases {
        let [sub_pix, model] = compare(8, blur, noise);
        for (name, e) in [("cornerSubPix", &sub_pix), ("model", &model)] {
            let (bias, rms, worst) = (e.bias(), e.rms(), e.worst());
            println!(
                "blur {blur} noise {noise} {name:12} bias {:+.4} {:+.4} rms {rms:.4} worst {worst:.3}",
                bias.x, bias.y
            );
        }
        assert!(model.rms() < allowed, "blur {blur} noise {noise}: {}", model.rms());
        assert!(model.rms() < 0.6 * sub_pix.rms(), "blur {blur} noise {noise}: no better than cornerSubPix");
        // The mean of 560 corners is 24 times better than one; three deviations.
        assert!(model.bias().amax() < 0.001 + 3.0 * allowed / 24.0, "blur {blur} noise {noise}: {}", model.bias());
    }
}

#[test]
fn squares_of_eight_pixels_are_enough() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let (mut errors, mut reference) = (Errors::default(), Errors::default());
    for view in 0..6 {
        let mut scene = random_scene(&mut rng, 0.3, std::f64::consts::PI);
        // Half the size of the usual.
        scene.camera_from_target.translation.vector *= 2.1;
        scene.noise = 2.0;
        let (image, truth) = (scene.render(view), scene.truth());
        let rough = Ordered { points: truth.iter().map(|p| p.map(f64::round)).collect(), columns: 10 };
        let sub_pix = corner_sub_pix(&image, &rough).expect("refines");
        reference.add(&sub_pix, &truth);
        errors.add(&refine(&image, &rough).expect("refines"), &truth);
    }
    println!("8 px squares: cornerSubPix rms {:.4}, model rms {:.4}", reference.rms(), errors.rms());
    assert!(errors.rms() < 0.02 && errors.rms() < reference.rms(), "{} {}", errors.rms(), reference.rms());
}

#[test]
fn what_is_no_corner_keeps_the_answer_of_corner_sub_pix() {
    let flat = GrayImage::from_pixel(100, 100, image::Luma([120]));
    let edge = GrayImage::from_fn(100, 100, |u, _| image::Luma([if u < 50 { 30 } else { 200 }]));
    let points: Vec<Vector2<f64>> =
        (0..9).map(|i| Vector2::new(30.0 + 20.0 * f64::from(i % 3), 30.0 + 20.0 * f64::from(i / 3))).collect();
    let order = Ordered { points, columns: 3 };
    for image in [flat, edge] {
        let sub_pix = corner_sub_pix(&image, &order).expect("refines");
        assert_eq!(refine(&image, &order).expect("refines").points, sub_pix.points);
    }
    // A corner so close to the border that its window is cut.
    let board = GrayImage::from_fn(40, 40, |u, v| image::Luma([if (u / 20 + v / 20) % 2 == 0 { 30 } else { 200 }]));
    let near = Ordered {
        points: (0..9).map(|i| Vector2::new(1.0 + 18.0 * f64::from(i % 3), 1.0 + 18.0 * f64::from(i / 3))).collect(),
        columns: 3,
    };
    let sub_pix = corner_sub_pix(&board, &near).expect("refines");
    assert_eq!(refine(&board, &near).expect("refines").points[0], sub_pix.points[0]);
}

#[test]
fn the_error_function_is_right_to_seven_digits() {
    // Abramowitz & Stegun 1964, table 7.1.
    for (x, erf) in [(0.0, 0.0), (0.5, 0.5204998778), (1.0, 0.8427007929), (2.0, 0.9953222650), (-1.0, -0.8427007929)] {
        let (value, slope) = erf_and_slope(x);
        assert!((value - erf).abs() < 2e-7, "erf({x}) = {value}");
        let h = 1e-3;
        let numeric = (erf_and_slope(x + h).0 - erf_and_slope(x - h).0) / (2.0 * h);
        assert!((slope - numeric).abs() < 5e-4, "erf'({x}) = {slope}, not {numeric}");
    }
}

#[test]
fn light_that_falls_off_across_the_board_does_not_pull_corners() {
    let mut rng = ChaCha8Rng::seed_from_u64(13);
    let mut errors = Errors::default();
    for view in 0..4 {
        let scene = random_scene(&mut rng, 0.7, std::f64::consts::PI);
        let mut image = scene.render(view);
        for (u, _, pixel) in image.enumerate_pixels_mut() {
            // From full light to a fifth of it over a third of the image: 0.4 % a pixel, a lamp close to the board.
            let light = (1.2 - 0.004 * f64::from(u.saturating_sub(200))).clamp(0.2, 1.0);
            pixel.0[0] = (f64::from(pixel.0[0]) * light).round() as u8;
        }
        let truth = scene.truth();
        let rough = Ordered { points: truth.iter().map(|p| p.map(f64::round)).collect(), columns: 10 };
        errors.add(&refine(&image, &rough).expect("refines"), &truth);
    }
    // A gradient that were only added, not multiplied, would leave a bias of 0.013 px.
    println!("uneven light: model bias {:?} rms {:.4}", errors.bias(), errors.rms());
    assert!(errors.rms() < 0.007 && errors.bias().amax() < 0.001, "{} {}", errors.rms(), errors.bias());
}
