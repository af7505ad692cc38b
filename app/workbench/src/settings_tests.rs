use super::*;

fn nothing(_: &str) -> Option<String> {
    None
}

fn write(wanted: Option<SettingsWrite>) -> Result<(), Warning> {
    wanted.expect("something has changed").perform()
}

fn reported(warnings: &[Warning]) -> Vec<String> {
    warnings.iter().map(|Warning(text)| text.in_language(Language::English)).collect()
}

#[test]
fn what_was_written_is_read_again() {
    let settings = Settings {
        theme: ThemeChoice::Light,
        language: LanguageChoice::Chinese,
        rotation: RotationFormat::Quaternion,
        depth_scale: DepthScale::Full,
        depth_colours: ColourMap::Viridis,
        connect: "tcp://a:1".to_owned(),
        scene: "panda".to_owned(),
        addresses: vec!["tcp://a:1".to_owned(), "tcp://b:2".to_owned()],
        drivers: vec![Drivers { robot: None, camera: Some("python3 camera.py".to_owned()) }],
        sessions: "/data/sessions".to_owned(),
        objects: CellPaths::below("Panda"),
    };
    let mut read = Settings::default();
    assert_eq!(read.read("settings.toml", &settings.written()), []);
    assert_eq!(read, settings);
}

#[test]
fn a_bad_value_is_told_with_its_line_and_key_and_the_others_are_taken() {
    let mut settings = Settings::default();
    let content = "# mine\ntheme = \"blue\"\nlanguage = \"zh-CN\"\n\ndepth_scale = 3\ncolour = \"red\"\n";
    let warnings = reported(&settings.read("settings.toml", content));
    assert_eq!(warnings.len(), 3, "{warnings:?}");
    assert!(
        warnings
            .iter()
            .any(|text| text.contains("line 2") && text.contains("theme") && text.contains("`dark` or `light`"))
    );
    assert!(warnings.iter().any(|text| text.contains("line 5") && text.contains("depth_scale")));
    assert!(warnings.iter().any(|text| text.contains("line 6") && text.contains("`depth_colours`")));
    assert_eq!(settings.language, LanguageChoice::Chinese);
    assert_eq!(settings.theme, ThemeChoice::Dark);
}

#[test]
fn a_bad_list_is_told_and_a_long_one_is_cut() {
    let mut settings = Settings::default();
    let warnings = reported(&settings.read("settings.toml", "addresses = [\"tcp://a:1\", 3]\ntheme = \"light\"\n"));
    assert!(warnings[0].contains("line 1") && warnings[0].contains("addresses"), "{warnings:?}");
    assert_eq!((settings.addresses.len(), settings.theme), (0, ThemeChoice::Light));
    let many = format!("addresses = {:?}", ["tcp://a:1"; ADDRESSES + 1]);
    assert_eq!(settings.read("settings.toml", &many), []);
    assert_eq!(settings.addresses.len(), ADDRESSES);
}

#[test]
fn a_bad_variable_is_told_with_what_it_may_be() {
    let mut settings = Settings::default();
    let bad = |name: &str| (name == "HANDEYE_ROTATION").then(|| "euler".to_owned());
    let warnings = reported(&settings.read_environment(bad));
    assert!(warnings[0].contains("HANDEYE_ROTATION") && warnings[0].contains("`rpy` or `quaternion`"), "{warnings:?}");
    assert_eq!(warnings.len(), 1);
}

#[test]
fn a_line_that_is_no_toml_is_told_and_the_lines_around_it_are_taken() {
    let mut settings = Settings::default();
    let warnings = reported(&settings.read("settings.toml", "theme = \"light\"\n= what\nlanguage = \"zh-CN\"\n"));
    assert!(warnings.iter().any(|text| text.contains("line 2")), "{warnings:?}");
    assert_eq!(settings.theme, ThemeChoice::Light);
}

#[test]
fn the_environment_goes_before_the_file_and_does_not_get_into_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("deep").join("settings.toml");
    std::fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
    std::fs::write(&path, "theme = \"light\"\nlanguage = \"en\"\n").expect("written");
    let variable = |name: &str| (name == "HANDEYE_LANGUAGE").then(|| "zh-CN".to_owned());
    let (mut file, settings, warnings) = SettingsFile::open(Some(path.clone()), variable);
    assert_eq!(warnings, []);
    assert_eq!((settings.theme, settings.language), (ThemeChoice::Light, LanguageChoice::Chinese));
    write(file.keep(ViewSettings { theme: ThemeChoice::Dark, ..settings.view() }, &[], &[], &CellPaths::default()))
        .expect("it can be written");
    let (_, again, _) = SettingsFile::open(Some(path), nothing);
    assert_eq!((again.theme, again.language), (ThemeChoice::Dark, LanguageChoice::English));
}

#[test]
fn nothing_is_written_before_something_is_changed() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("settings.toml");
    let (mut file, settings, _) = SettingsFile::open(Some(path.clone()), nothing);
    assert_eq!(file.keep(settings.view(), &[], &[], &CellPaths::default()), None, "there is nothing to do");
    assert!(!path.exists());
}

#[test]
fn earlier_addresses_are_in_the_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("settings.toml");
    let (mut file, settings, _) = SettingsFile::open(Some(path.clone()), nothing);
    let addresses = vec!["tcp://a:1".to_owned(), "tcp://b:1".to_owned()];
    write(file.keep(settings.view(), &addresses, &[], &CellPaths::default())).expect("it can be written");
    assert_eq!(SettingsFile::open(Some(path), nothing).1.addresses, addresses);
}

#[test]
fn objects_of_the_scene_are_in_the_file_once_they_are_changed_and_not_those_of_one_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("settings.toml");
    let (file, settings, _) = SettingsFile::open(Some(path.clone()), nothing);
    let of_this_run = CellPaths::below("xArm");
    let mut file = file.with_objects(&of_this_run);
    assert_eq!(file.keep(settings.view(), &[], &[], &of_this_run), None, "given for this run");
    let chosen = CellPaths { depth: String::new(), ..CellPaths::below("Panda") };
    write(file.keep(settings.view(), &[], &[], &chosen)).expect("it can be written");
    assert_eq!(SettingsFile::open(Some(path), nothing).1.objects, chosen);
    let mut read = Settings::default();
    for (line, why) in [("flange = \"/Panda\"", "flange"), ("tip = \"Panda\"", "begins with /")] {
        let warnings = reported(&read.read("settings.toml", &format!("[objects]\n{line}\n")));
        assert!(warnings[0].contains(why) && read == Settings::default(), "{warnings:?}");
    }
}

#[test]
fn a_file_that_cannot_be_written_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let blocked = folder.path().join("file");
    std::fs::write(&blocked, "").expect("written");
    let (mut file, settings, _) = SettingsFile::open(Some(blocked.join("settings.toml")), nothing);
    let view = ViewSettings { theme: ThemeChoice::Light, ..settings.view() };
    let Err(Warning(text)) = write(file.keep(view, &[], &[], &CellPaths::default())) else { panic!("it went well") };
    assert!(text.in_language(Language::English).contains("settings.toml"));
}

#[test]
fn the_file_keeps_its_place_in_the_folders_of_the_system() {
    let path = default_path().expect("there is a home");
    assert!(path.is_absolute() && path.ends_with("handeye-workbench/settings.toml"), "{}", path.display());
}

#[test]
fn the_language_is_that_of_the_system_until_one_is_chosen() {
    for (locale, language) in [
        ("zh_CN.UTF-8", Language::Chinese),
        ("zh-Hans-CN", Language::Chinese),
        ("ZH", Language::Chinese),
        ("de_DE.UTF-8", Language::English),
        ("C", Language::English),
        ("", Language::English),
    ] {
        assert_eq!(Language::of_locale(locale), language, "{locale}");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("settings.toml");
    let (mut file, settings, _) = SettingsFile::open(Some(path.clone()), nothing);
    assert_eq!(settings.language, LanguageChoice::System);
    let view = ViewSettings { theme: ThemeChoice::Light, ..settings.view() };
    write(file.keep(view, &[], &[], &CellPaths::default())).expect("it can be written");
    let (mut file, settings, _) = SettingsFile::open(Some(path.clone()), nothing);
    assert_eq!(settings.language, LanguageChoice::System, "another setting was changed, not the language");
    let other = Language::ALL.into_iter().find(|it| *it != settings.view().language).expect("two languages");
    write(file.keep(ViewSettings { language: other, ..settings.view() }, &[], &[], &CellPaths::default()))
        .expect("it can be written");
    let (_, settings, _) = SettingsFile::open(Some(path), nothing);
    assert_eq!(settings.language, LanguageChoice::from(other));
}
