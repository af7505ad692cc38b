//! What the window offers of each driver is what its subcommand takes.

use clap::{Args as _, Command};

use super::driver::DriverArgs;
use handeye_driver::DriverSpec;
use handeye_workbench::connect::drivers::offered::FieldKind::{Switch, Text, Word};
use handeye_workbench::connect::drivers::offered::Rank::Needed;
use handeye_workbench::connect::drivers::offered::{ALL, Field, ON, Offered, Part, Values, of_part, parse};

/// Options that make no sense in a window, with the reason.
const NOT_OFFERED: [(&str, &str); 1] = [("fake", "--listen")];

fn subcommands() -> Vec<Command> {
    let all = DriverArgs::augment_args(Command::new("driver"));
    all.get_subcommands().filter(|command| command.get_name() != "test").cloned().collect()
}

fn options(command: &Command) -> Vec<String> {
    let own = command.get_arguments().filter(|argument| argument.get_id() != "help");
    own.map(|argument| argument.get_long().map_or_else(String::new, |long| format!("--{long}"))).collect()
}

#[test]
fn every_driver_that_comes_with_the_program_is_offered_with_every_option_it_has() {
    let commands = subcommands();
    assert_eq!(commands.len(), ALL.len());
    for command in &commands {
        let name = command.get_name();
        let offered = ALL.iter().find(|offered| offered.name == name).unwrap_or_else(|| panic!("{name}: not offered"));
        for option in options(command) {
            let is_field = offered.fields.iter().any(|field| field.option == option);
            let is_always = offered.camera_alone.contains(&option.as_str());
            let is_left_out = NOT_OFFERED.contains(&(name, option.as_str()));
            assert!(is_field || is_always || is_left_out, "{name}: no field for {option}");
        }
        for field in offered.fields {
            assert!(options(command).iter().any(|option| option == field.option), "{name}: {} is none", field.option);
            let needed = command.get_arguments().find(|argument| {
                argument.get_long().map_or_else(String::new, |long| format!("--{long}")) == field.option
            });
            let is_needed = needed.is_some_and(clap::Arg::is_required_set);
            assert_eq!(is_needed, field.rank == Needed, "{name}: {}", field.option);
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
