//! The reader on recorded data sets, if they are available.

use handeye_dataset::Dataset;
use handeye_geometry::testing::data_folder;

#[test]
fn recorded_data_sets_are_read_whole() {
    let Some(data) = data_folder() else { return };
    let expected = [
        ("caliban_no_curv", 20, (1920, 1080)),
        ("rwhe_cs_synthetic_3", 30, (1920, 1080)),
        ("rwhe_kuka_1_eye_in_hand", 30, (1928, 1208)),
        ("visp_franka_eye_in_hand", 8, (640, 480)),
        ("rct_circles_eye_in_hand", 15, (640, 480)),
    ];
    for (name, views, size) in expected {
        let data = Dataset::read(&data.join(name)).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((data.entries.len(), data.image_size), (views, Some(size)), "{name}");
        let image = data.load_gray(&data.entries[0]).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(image.dimensions(), size, "{name}");
        assert_eq!(data.input_sha256().map(|h| h.len()).ok(), Some(64), "{name}");
    }
}
