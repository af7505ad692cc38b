//! What the window offers for each driver is what its subcommand accepts.

use std::path::Path;

use clap::{Args as _, Command};

use super::driver::{DriverArgs, python};
use handeye_driver::DriverSpec;
use handeye_workbench::connect::offered::FieldKind::{Switch, Text, Word};
use handeye_workbench::connect::offered::Rank::Needed;
use handeye_workbench::connect::offered::{ALL, Field, ON, Offered, Part, Values, of_part, parse};

/// Options that make no sense in a window: listening is for another driver, and RTDE has one port.
const NOT_OFFERED: [(&str, &str); 2] = [("fake", "--listen"), ("ur-rtde", "--port")];

/// Name of an option, empty for an argument without one, and whether it is required.
type Option = (String, bool);

/// The options of a subcommand.
fn of_clap(command: &Command) -> Vec<Option> {
    let own = command.get_arguments().filter(|argument| argument.get_id() != "help");
    own.map(|argument| {
        let name = argument.get_long().map_or_else(String::new, |long| format!("--{long}"));
        (name, argument.is_required_set())
    })
    .collect()
}

/// The options of a driver in Python, as its file adds them to a parser, with the one that all have.
fn of_python(source: &str) -> Vec<Option> {
    let added = source.split("add").filter_map(|call| {
        let (is_argument, call) = call.strip_prefix("_argument").map_or((false, call), |call| (true, call));
        let (name, rest) = call.strip_prefix('(')?.trim_start().strip_prefix('"')?.split_once('"')?;
        let is_option = name.starts_with("--");
        // Under a shorter name it may be another function that adds something.
        if !is_option && !is_argument {
            return None;
        }
        Some((if is_option { name.to_owned() } else { String::new() }, !is_option || rest.contains("required=True")))
    });
    added.chain([("--python".to_owned(), false)]).collect()
}

#[test]
fn every_driver_that_comes_with_the_program_is_offered_with_every_option_it_has() {
    let all = DriverArgs::augment_args(Command::new("driver"));
    let is_driver = |command: &&Command| !["test", "eject"].contains(&command.get_name());
    let commands: Vec<&Command> = all.get_subcommands().filter(is_driver).collect();
    assert_eq!(commands.len(), ALL.len());
    for command in commands {
        let name = command.get_name();
        let offered = ALL.iter().find(|offered| offered.name == name).unwrap_or_else(|| panic!("{name}: not offered"));
        let file = python::ALL.iter().find(|shipped| shipped.name == name);
        // Cells of other simulators add their common options in a file that they share.
        let of_file = |file: &python::Shipped| {
            let shared = file.files().filter(|(name, _)| *name == "simulated_cell.py").map(|(_, source)| source);
            of_python(&std::iter::once(file.source).chain(shared).collect::<String>())
        };
        let options = file.map_or_else(|| of_clap(command), of_file);
        for (option, is_needed) in &options {
            let field = offered.fields().find(|field| field.option == option);
            let is_always = offered.camera_alone.contains(&option.as_str());
            let is_left_out = NOT_OFFERED.contains(&(name, option.as_str()));
            assert!(field.is_some() || is_always || is_left_out, "{name}: no field for {option}");
            assert!(field.is_none_or(|field| *is_needed == (field.rank == Needed)), "{name}: {option}");
        }
        for field in offered.fields() {
            assert!(options.iter().any(|(option, _)| option == field.option), "{name}: {} is none", field.option);
        }
    }
}

/// A value for each field that the option takes.
fn filled(offered: &Offered, part: Part) -> Values {
    let value = |field: &Field| match field.kind {
        Text("robot.urdf" | "tcp://127.0.0.1:23000") => String::new(),
        Text("/home/me/captures") => "/home/me/my captures".to_owned(),
        Text("0") => "-2.5".to_owned(),
        Text(example) => example.to_owned(),
        Word(words) => words()[0].to_owned(),
        Switch => ON.to_owned(),
    };
    offered.fields_of(part).map(|field| (field.option, value(field))).filter(|(_, value)| !value.is_empty()).collect()
}

/// A driver in Python accepts the values of its options.
fn is_taken_by_its_file(name: &str, options: &[String]) {
    let Some(shipped) = python::ALL.iter().find(|shipped| shipped.name == name) else { return };
    let Some(python) = handeye_geometry::testing::python() else { return };
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/drivers").join(shipped.file);
    let mut command = std::process::Command::new(python);
    // Help is printed once everything before it is parsed; the name makes it accept `--python` as well.
    let output = command.arg(file).args(options).arg("--help").env(python::NAME_VARIABLE, name).output();
    let output = output.expect("python runs");
    assert!(output.status.success(), "{options:?}: {}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn a_command_line_is_what_the_program_takes_and_is_read_back_as_it_was() {
    for part in [Part::Robot, Part::Camera] {
        for offered in of_part(part) {
            let values = filled(offered, part);
            let command = offered.command(part, &values).expect("all that is needed is there");
            let Ok(DriverSpec::Command(words)) = command.parse() else { panic!("{command}") };
            let all = DriverArgs::augment_args(Command::new("driver"));
            if let Err(error) = all.try_get_matches_from(&words[1..]) {
                panic!("{command}: {error}");
            }
            is_taken_by_its_file(offered.name, &words[3..]);
            let (again, read) = parse(&command, part).expect("its own command line");
            assert_eq!((again.name, read), (offered.name, values), "{command}");
        }
    }
}

#[test]
fn another_program_and_options_without_a_field_are_left_as_they_are_typed() {
    for other in [
        "",
        "python3 mine.py",
        "tcp://127.0.0.1:7000",
        "/opt/handeye driver fake",
        "handeye driver ur-rtde --speed 3",
        "handeye driver ur-rtde --host",
        "handeye driver ur-rtde --host a --host b",
        "handeye driver fake --listen 127.0.0.1:1",
        "handeye driver 'ur-rtde",
    ] {
        assert!(parse(other, Part::Robot).is_none(), "{other}");
    }
    assert!(parse("handeye driver folder images", Part::Camera).is_none(), "it would want poses");
    assert!(parse("handeye driver ur-rtde --host a", Part::Camera).is_none());
}
