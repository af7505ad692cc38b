//! Forward kinematics and Jacobians of arms from URDF files, compared with Pinocchio.

use std::process::Command;

use handeye_arm::testing as arms;
use handeye_geometry::testing::python;
use handeye_tests::workspace_root;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

/// Configurations of each arm.
const CONFIGURATIONS: usize = 1000;

/// Our values for an arm: joints by name, values, and for these the tip's pose and the Jacobian in the axes of the base.
fn reported(file: &arms::ArmFile, rng: &mut ChaCha8Rng) -> Value {
    let arm = file.arm().expect("a good file");
    let names: Vec<&str> = arm.joints().iter().map(|joint| joint.name.as_str()).collect();
    let cases: Vec<Value> = (0..CONFIGURATIONS)
        .map(|_| {
            let parts: Vec<f64> = names.iter().map(|_| rng.random_range(0.0..1.0)).collect();
            let joints = arms::values_at(&arm, parts);
            let tip = arm.forward(&joints).expect("a value for each joint");
            let rotation = tip.rotation().to_rotation_matrix();
            let columns: Vec<Vec<f64>> = arm
                .jacobian(&joints)
                .expect("a value for each joint")
                .column_iter()
                .map(|column| column.iter().copied().collect())
                .collect();
            let rows: Vec<Vec<f64>> = rotation.matrix().row_iter().map(|row| row.iter().copied().collect()).collect();
            let translation: [f64; 3] = tip.translation().into();
            json!({"joints": joints, "translation_m": translation, "rotation": rows, "jacobian_columns": columns})
        })
        .collect();
    json!({"tip": file.tip, "joints": names, "cases": cases})
}

#[test]
fn pinocchio_has_every_arm_where_we_have_it() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for file in arms::ALL {
        let path = |ending: &str| folder.path().join(format!("{}.{ending}", file.name));
        std::fs::write(path("urdf"), file.urdf).expect("written");
        std::fs::write(path("json"), reported(&file, &mut rng).to_string()).expect("written");
    }
    let output = Command::new(python)
        .arg(workspace_root().join("tests/python/kinematics.py"))
        .arg(folder.path())
        .output()
        .expect("python runs");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
    // One line per arm: the script compared them all.
    assert_eq!(text(&output.stdout).lines().count(), arms::ALL.len(), "{}", text(&output.stdout));
    println!("{}", text(&output.stdout));
}
