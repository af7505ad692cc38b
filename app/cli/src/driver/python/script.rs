//! The metadata at the top of a script, as in [PEP 723](https://peps.python.org/pep-0723/).

use serde::Deserialize;

/// What a script needs.
#[derive(Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct Needs {
    /// Which Python, such as `>=3.9`.
    pub requires_python: String,
    /// Packages, as pip takes them.
    pub dependencies: Vec<String>,
}

impl Needs {
    /// The needs of a script; `None` if it does not state them.
    pub fn of(source: &str) -> Option<Self> {
        let block =
            source.lines().skip_while(|line| *line != "# /// script").skip(1).take_while(|line| *line != "# ///");
        let text: Vec<&str> = block.map(|line| line.strip_prefix('#').unwrap_or(line).trim_start()).collect();
        toml::from_str(&text.join("\n")).ok()
    }

    /// Whether a Python is new enough. Only a minimum version is stated.
    pub fn has_python(&self, (major, minor): (u32, u32)) -> bool {
        let least = self.requires_python.strip_prefix(">=").and_then(|least| least.split_once('.'));
        let least = least.and_then(|(major, minor)| Some((major.parse().ok()?, minor.parse().ok()?)));
        least.is_some_and(|least: (u32, u32)| (major, minor) >= least)
    }
}

#[cfg(test)]
mod tests {
    use super::super::ALL;
    use super::*;

    #[test]
    fn every_driver_states_what_it_needs_within_bounds() {
        for driver in ALL {
            let needs = Needs::of(driver.source).unwrap_or_else(|| panic!("{} states nothing", driver.file));
            assert!(needs.has_python((3, 9)) && !needs.has_python((3, 8)), "{}", driver.file);
            for package in &needs.dependencies {
                assert!(package.contains('<'), "{}: {package} may become anything", driver.file);
            }
        }
    }

    #[test]
    fn the_block_ends_where_it_ends() {
        let source = "#!/usr/bin/env python3\n# /// script\n# requires-python = \">=3.10\"\n# dependencies = [\n#   \"a<2\",\n# ]\n# ///\n# b\n";
        let needs = Needs { requires_python: ">=3.10".into(), dependencies: vec!["a<2".into()] };
        assert_eq!(Needs::of(source), Some(needs));
        assert_eq!(Needs::of("import this\n"), None);
    }
}
