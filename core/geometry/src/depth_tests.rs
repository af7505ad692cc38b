use super::DepthSample::{Far, Invalid, Metres};
use super::*;
use crate::camera::Distortion;

const FAR_M: f32 = 3.5;

fn row(metres: &[f32]) -> DepthImage {
    DepthImage::new(metres.len() as u32, 1, metres.to_vec()).expect("as many as pixels")
}

#[test]
fn pixels_without_surface_are_told_apart() {
    let image = row(&[0.5, 0.0, -1.0, f32::NAN, 3.5, 3.4998, 3.49, f32::INFINITY, f32::NEG_INFINITY]);
    let kinds: Vec<DepthSample> = (0..9).map(|column| image.sample(column, 0, FAR_M)).collect();
    assert_eq!(kinds, [Metres(0.5), Invalid, Invalid, Invalid, Far, Far, Metres(3.49), Far, Invalid]);
    assert_eq!(image.sample(9, 0, FAR_M), Invalid);
    assert_eq!(image.sample(0, 1, FAR_M), Invalid);
    assert_eq!(image.sample(6, 0, f32::INFINITY), Metres(3.49), "a sensor without far plane");
}

#[test]
fn a_wrong_number_of_samples_is_refused() {
    let error = DepthImage::new(4, 3, vec![1.0; 11]).expect_err("one short");
    assert_eq!(error, DepthError::WrongLength { width: 4, height: 3, got: 11, need: 12 });
    let broken = DepthImage { width: 4, height: 3, metres: vec![] };
    assert!(broken.colours(ColourMap::Grey, 0.0, 1.0, FAR_M).is_err());
    assert_eq!(broken.sample(0, 0, FAR_M), DepthSample::Invalid);
}

#[test]
fn colour_maps_follow_their_published_tables() {
    // Entries 0, 32, … of the 256 colours of either table.
    let turbo = [
        (0, [48, 18, 59]),
        (32, [70, 107, 227]),
        (64, [40, 188, 235]),
        (96, [50, 242, 152]),
        (128, [164, 252, 60]),
        (192, [251, 126, 33]),
        (224, [208, 47, 5]),
        (255, [122, 4, 3]),
    ];
    let viridis = [
        (0, [68, 1, 84]),
        (64, [59, 82, 139]),
        (100, [42, 118, 142]),
        (128, [33, 145, 140]),
        (200, [112, 207, 87]),
        (255, [253, 231, 37]),
    ];
    for (map, table) in [(ColourMap::Turbo, &turbo[..]), (ColourMap::Viridis, &viridis[..])] {
        for (entry, want) in table {
            let got = map.colour(f64::from(*entry) / 255.0);
            for c in 0..3 {
                assert!(got[c].abs_diff(want[c]) <= 7, "{map:?} {entry}: {got:?} instead of {want:?}");
            }
        }
    }
    assert_eq!(ColourMap::Grey.colour(0.5), [128; 3]);
    for map in [ColourMap::Turbo, ColourMap::Viridis, ColourMap::Grey] {
        assert_eq!(map.colour(-3.0), map.colour(0.0));
        assert_eq!(map.colour(7.0), map.colour(1.0));
        assert_eq!(map.colour(f64::NAN), map.colour(0.0));
    }
}

#[test]
fn the_colours_of_missing_and_far_pixels_are_in_no_map() {
    for map in [ColourMap::Turbo, ColourMap::Viridis, ColourMap::Grey] {
        for i in 0..=1000 {
            let colour = map.colour(f64::from(i) / 1000.0);
            for special in [INVALID_COLOUR, FAR_COLOUR] {
                let apart: u32 = (0..3).map(|c| u32::from(colour[c].abs_diff(special[c]))).sum();
                // Grey passes the dark blue at a distance; to distinguish a colour on the screen takes about this much.
                assert!(apart >= 16, "{map:?} at {i}: {colour:?}");
            }
        }
    }
}

#[test]
fn an_image_spans_the_range_and_marks_what_is_no_depth() {
    let image = row(&[0.1, 0.2, 1.85, 3.4, f32::NAN, 3.5]);
    let coloured = image.colours(ColourMap::Grey, 0.2, 3.4, FAR_M).expect("a range");
    let colours: Vec<[u8; 3]> = coloured.as_chunks::<3>().0.to_vec();
    assert_eq!(colours, [[0; 3], [0; 3], [131; 3], [255; 3], INVALID_COLOUR, FAR_COLOUR]);
    for (near, far) in [(1.0, 1.0), (2.0, 1.0), (f32::NAN, 1.0), (0.0, f32::INFINITY)] {
        assert!(matches!(image.colours(ColourMap::Turbo, near, far, FAR_M), Err(DepthError::BadRange { .. })));
    }
}

#[test]
fn a_deprojected_pixel_projects_to_itself_at_its_depth() {
    for distortion in [Distortion::None, Distortion::BrownConrady([-0.2, 0.1, 0.001, -0.002, 0.0])] {
        let camera = Intrinsics { distortion, ..Intrinsics::pinhole(640, 480, 589.37) };
        let image = DepthImage::new(640, 480, vec![0.75; 640 * 480]).expect("as many as pixels");
        for (column, row) in [(0, 0), (320, 240), (639, 479), (100, 400)] {
            let point = image.point(column, row, FAR_M, &camera).expect("inside").expect("a surface").point();
            assert!((point.z - 0.75).abs() < 1e-12, "depth is along the axis, not along the ray");
            let px = camera.project(&point).expect("in front");
            assert!((px - nalgebra::Vector2::new(f64::from(column), f64::from(row))).norm() < 1e-9);
        }
    }
}

#[test]
fn pixels_without_surface_have_no_point() {
    let camera = Intrinsics::pinhole(2, 1, 100.0);
    let image = row(&[f32::NAN, 3.5]);
    for column in 0..3 {
        assert_eq!(image.point(column, 0, FAR_M, &camera).map(|p| p.is_none()), Ok(true));
    }
    let other = Intrinsics::pinhole(640, 480, 100.0);
    assert!(matches!(image.point(0, 0, FAR_M, &other), Err(DepthError::OtherCamera { .. })));
}
