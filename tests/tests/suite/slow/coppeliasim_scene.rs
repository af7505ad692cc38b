//! The cell that looks like CoppeliaSim with the tutorial's scene: hard edges, a board drawn on a bitmap, depths with a polygon
//! offset, an arm that starts straight up with the board out of view.

use std::process::{Command, Output};

use handeye_coppeliasim::cell::{CellClient, CellPaths};
use handeye_coppeliasim::{ConnectionOptions, Endpoint};
use handeye_geometry::targets::{Grid, TargetSpec};
use handeye_tests::{CellProcess, handeye_binary, workspace_root};
use serde_json::Value;

const BOARD: TargetSpec = TargetSpec::Chessboard(Grid { columns: 10, rows: 7, square_m: 0.015 });

fn scene() -> String {
    workspace_root().join("assets/scenes/coppeliasim.toml").display().to_string()
}

fn handeye(arguments: &[&str]) -> Output {
    let output = Command::new(handeye_binary()).args(arguments).output().expect("handeye runs");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    output
}

fn json(file: &std::path::Path) -> Value {
    serde_json::from_slice(&std::fs::read(file).expect("a file")).expect("JSON")
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("a number: {value}"))
}

/// An arm that does not see the board and a board that is not as drawn, from start to finish.
#[test]
fn it_is_calibrated_from_an_arm_that_stands_straight_up_and_a_board_at_rest_is_followed_at_rest() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = scene();
    // Only what CoppeliaSim has.
    let cell = CellProcess::start(&["--fast", "--scene", &scene, "--coppeliasim-only"]);
    let endpoint = format!("tcp://127.0.0.1:{}", cell.port());
    let (session, file) = (folder.path().join("session").display().to_string(), folder.path().join("result.json"));
    let out = file.display().to_string();
    let run = handeye(&["auto", "--connect", &endpoint, "--poses", "guided", "--out", &session, "--json", &out]);
    let reported = String::from_utf8_lossy(&run.stderr);
    assert!(reported.contains("the board is not in view here: the arm goes to a view of the board"), "{reported}");
    drop(cell);
    let result = json(&file);
    let views = result["views"].as_array().expect("views").len();
    let (error_mm, stated_mm) =
        (number(&result["truth"]["translation_error_mm"]), number(&result["quality"]["tip_error_95_mm"]));
    let print_mm = number(&result["estimate"]["print"]["rms_mm"]);
    println!("{views} views, {error_mm:.3} mm, stated {stated_mm:.3} mm, print {print_mm:.4} mm");
    assert!(views <= 16 && stated_mm <= 0.3 && error_mm <= 2.0 * stated_mm);
    // Its pixels are 0.195 mm, so the variance of line errors is a twelfth of the square of that.
    assert!((0.04..0.07).contains(&print_mm));
    let codes: Vec<&str> = result["findings"]
        .as_array()
        .expect("findings")
        .iter()
        .filter_map(|finding| finding["code"].as_str())
        .collect();
    assert!(codes.contains(&"print_errors") && !codes.contains(&"board_bent"), "{codes:?}");
    // The renderer adds a fraction of the depth change from pixel to pixel, and nothing else.
    let depth = &result["depth"]["errors"];
    let (slope_px, sigma_px) = (number(&depth["slope_px"]), number(&depth["slope_sigma_px"]));
    println!("depth of slopes {slope_px:.3} ± {sigma_px:.3} px");
    assert!((slope_px - 0.475).abs() < 4.0 * sigma_px && sigma_px < 0.15, "{depth}");
    assert!(!codes.contains(&"depth_error"), "{codes:?}");

    let cell = CellProcess::start(&["--scene", &scene]);
    let endpoint = format!("tcp://127.0.0.1:{}", cell.port());
    let address: Endpoint = endpoint.parse().expect("an address");
    let mut client =
        CellClient::connect(&address, &ConnectionOptions::default(), &CellPaths::default()).expect("a cell");
    client.arm().sim().start_simulation().expect("it starts");
    let file = folder.path().join("track.json");
    let track = file.display().to_string();
    let frames = "400";
    handeye(&[
        "track",
        "--connect",
        &endpoint,
        "--calibration",
        &out,
        "--follow",
        "--frames",
        frames,
        "--json",
        &track,
    ]);
    let summary = json(&file)["summary"].clone();
    println!("{summary}");
    assert!(number(&summary["tracked"]) >= 50.0, "{summary}");
    assert!(number(&summary["position_rms_mm"]) <= 0.2, "{summary}");
    assert!(number(&summary["rotation_rms_deg"]) <= 0.05, "{summary}");
    // A pose of the tip from corners alone is off by millimetres.
    assert!(number(&summary["follow_distance_rms_mm"]) <= 0.5, "{summary}");

    // The tip has to be where the corner truly is.
    handeye(&["track", "--connect", &endpoint, "--calibration", &out, "--reach", "0", "--stand-off", "20"]);
    let base_from_target = client.arm().ground_truth().expect("the truth").base_from_target.expect("of the board");
    let tip = client.arm().base_from_tip().expect("the tip").translation();
    let off = base_from_target.isometry().inverse_transform_point(&tip.into()) - BOARD.points()[0];
    let off_mm = off.xy().norm().hypot(off.z.abs() - 0.02) * 1e3;
    println!("the tip is {off_mm:.3} mm off the point 20 mm before the corner");
    assert!(off_mm <= 0.3, "{off_mm} mm");
}
