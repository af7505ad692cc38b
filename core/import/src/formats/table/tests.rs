use super::*;
use crate::conventions::{AngleUnit, LengthUnit};

fn one(text: &str) -> Track {
    // Another order of the same numbers is another reading of this series.
    let mut tracks = read("poses.txt", text);
    tracks.retain(|track| track.reading_of.is_none());
    assert_eq!(tracks.len(), 1, "{tracks:?}");
    tracks.remove(0)
}

#[test]
fn every_delimiter_gives_the_same_numbers() {
    let row = |i: usize| [0.41 + i as f64, -0.25, 17.0, -3.05, 0.5, 1e-3];
    for (by, comma) in
        [(",", false), (", ", false), ("\t", false), (" ", false), ("   ", false), (";", true), (";", false)]
    {
        let text: String = (0..4)
            .map(|i| {
                let cells = row(i).map(|v| if comma { v.to_string().replace('.', ",") } else { v.to_string() });
                cells.join(by) + "\n"
            })
            .collect();
        let track = one(&text);
        assert_eq!(track.samples.len(), 4, "{by:?}");
        for (i, sample) in track.samples.iter().enumerate() {
            assert_eq!(sample.numbers, Numbers::Angles(row(i)), "{by:?}, {comma}");
            assert_eq!(sample.place.to_string(), format!("poses.txt, row {}", i + 1));
        }
    }
}

#[test]
fn names_numbers_and_units_of_a_header_are_taken() {
    let text = "image,x [mm],y [mm],z [mm],rx (deg),ry (deg),rz (deg)\nb/2.png,1,2,3,4,5,6\nb/3.png,1,2,3,4,5,7\n\
                b/10.png,1,2,3,4,5,8\n";
    let track = one(text);
    assert_eq!(track.stated.length.as_ref().map(|k| k.value), Some(LengthUnit::Millimetre));
    assert_eq!(track.stated.angle.as_ref().map(|k| k.value), Some(AngleUnit::Degree));
    assert_eq!(track.samples[2].image.as_deref(), Some("b/10.png"));
}

#[test]
fn columns_are_found_by_their_names_in_any_order() {
    let text = "id qw qx qy qz x y z\n7 1 0 0 0 1 2 3\n9 1 0 0 0 4 5 6\n12 0 0 0 1 7 8 9\n";
    let track = one(text);
    assert_eq!(track.samples[2].numbers, Numbers::Quaternion([7.0, 8.0, 9.0, 0.0, 0.0, 1.0, 0.0]));
    assert_eq!(track.samples.iter().map(|s| s.number).collect::<Vec<_>>(), [Some(7), Some(9), Some(12)]);
}

#[test]
fn rows_with_a_number_and_python_lists_are_read() {
    let track = one("1 [0.1, 0.2, 0.3, 1, 2, 3]\n2 [0.1, 0.2, 0.4, 1, 2, 3]\n5 [0.1, 0.2, 0.5, 1, 2, 3]\n");
    assert_eq!(track.samples[2].number, Some(5));
    assert_eq!(track.samples[2].numbers, Numbers::Angles([0.1, 0.2, 0.5, 1.0, 2.0, 3.0]));
}

#[test]
fn matrices_stand_in_one_row_or_in_four_with_a_count_before_them() {
    let flat = "1 0 0 4 0 1 0 5 0 0 1 6 0 0 0 1\n0 -1 0 4 1 0 0 5 0 0 1 6 0 0 0 1\n1 0 0 7 0 1 0 5 0 0 1 6 0 0 0 1\n";
    let four = "3\n1 0 0 4\n0 1 0 5\n0 0 1 6\n0 0 0 1\n\n0 -1 0 4\n1 0 0 5\n0 0 1 6\n0 0 0 1\n\n1 0 0 7\n0 1 0 5\n0 0 1 6\n0 0 0 1\n";
    let (a, b) = (one(flat), one(four));
    let numbers = |track: &Track| track.samples.iter().map(|s| s.numbers).collect::<Vec<_>>();
    assert_eq!(numbers(&a), numbers(&b));
    assert_eq!(a.samples.len(), 3);
}

#[test]
fn a_table_of_something_else_is_no_series() {
    assert!(read("corners.csv", "image,column,row,u,v\na.png,0,0,1,2\na.png,1,0,1,2\na.png,2,0,1,2\n").is_empty());
    assert!(read("notes.txt", "we took 20 images\nthe board has 11 8 corners of 20 mm\n").is_empty());
}
