//! No circles of imports between files of different folders of a crate: what a folder needs can then be read, tested and moved
//! without what needs it. What a folder imports from those in it does not count: a module knows its parts. Arguments of macros
//! are not read.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use handeye_tests::workspace_root;
use syn::visit::{self, Visit};
use syn::{Attribute, Item, UseTree, Visibility};

/// A module by the names on its path from the root of the crate.
type Module = Vec<String>;

/// Paths that a file names, and those that it imports, with the names that it has for them.
#[derive(Default)]
struct Named {
    paths: Vec<Vec<String>>,
    imported: Vec<(String, Vec<String>)>,
}

impl Named {
    fn flatten(&mut self, before: &[String], tree: &UseTree) {
        let mut path = before.to_vec();
        let (name, imported) = match tree {
            UseTree::Path(next) => {
                path.push(next.ident.to_string());
                return self.flatten(&path, &next.tree);
            }
            UseTree::Group(group) => return group.items.iter().for_each(|item| self.flatten(&path, item)),
            UseTree::Glob(_) => return self.paths.push(path),
            UseTree::Name(name) => (&name.ident, &name.ident),
            UseTree::Rename(name) => (&name.ident, &name.rename),
        };
        // `use super::shown::{self, Shown}` imports the module itself.
        if name != "self" {
            path.push(name.to_string());
        }
        let imported = if imported == "self" { path.last().cloned().unwrap_or_default() } else { imported.to_string() };
        self.imported.push((imported, path.clone()));
        self.paths.push(path);
    }
}

impl<'ast> Visit<'ast> for Named {
    fn visit_item(&mut self, item: &'ast Item) {
        let is_of_tests = match item {
            // The paths of a module within the file begin elsewhere.
            Item::Mod(item) => item.content.is_some() || of_tests(&item.attrs),
            Item::Use(item) => of_tests(&item.attrs),
            Item::Fn(item) => of_tests(&item.attrs),
            Item::Impl(item) => of_tests(&item.attrs),
            _ => false,
        };
        if is_of_tests {
            return;
        }
        if let Item::Use(item) = item {
            self.flatten(&[], &item.tree);
        }
        visit::visit_item(self, item);
    }

    // `pub(crate)` has a path too.
    fn visit_visibility(&mut self, _: &'ast Visibility) {}

    fn visit_path(&mut self, path: &'ast syn::Path) {
        self.paths.push(path.segments.iter().map(|segment| segment.ident.to_string()).collect());
        visit::visit_path(self, path);
    }
}

fn of_tests(attributes: &[Attribute]) -> bool {
    let is_of_tests = |attribute: &Attribute| {
        let condition = attribute.meta.require_list().map(|list| list.tokens.to_string()).unwrap_or_default();
        attribute.path().is_ident("cfg") && condition.contains("test")
    };
    attributes.iter().any(is_of_tests)
}

/// The sources of a crate by their modules, without those of tests.
fn sources(folder: &Path, module: &[String], found: &mut BTreeMap<Module, PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder of sources") {
        let path = entry.expect("an entry").path();
        let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
        let inside = |name: String| [module, &[name]].concat();
        if path.is_dir() {
            if name != "testing" && name != "tests" {
                sources(&path, &inside(name), found);
            }
        } else if path.extension().is_some_and(|extension| extension == "rs") && !name.ends_with("tests") {
            let is_of_folder = matches!(&*name, "mod" | "lib");
            found.insert(if is_of_folder { module.to_vec() } else { inside(name) }, path);
        }
    }
}

/// What modules import from each other: by module and name, the module that defines it.
type Imported = BTreeMap<(Module, String), Module>;

/// The module of the crate that defines what `path` names in `module`, as far as it can be followed without types.
fn target(
    sources: &BTreeMap<Module, PathBuf>,
    imported: &Imported,
    module: &[String],
    path: &[String],
) -> Option<Module> {
    let first = path.first()?;
    let (mut at, mut rest) = match first.as_str() {
        "crate" => (Vec::new(), &path[1..]),
        "self" => (module.to_vec(), &path[1..]),
        "super" => (module.to_vec(), path),
        // A child, something imported, or another crate.
        _ if sources.contains_key(&[module, std::slice::from_ref(first)].concat()) => (module.to_vec(), path),
        _ => (imported.get(&(module.to_vec(), first.clone()))?.clone(), &path[1..]),
    };
    while rest.first().is_some_and(|name| name == "super") {
        at.pop();
        rest = &rest[1..];
    }
    while let Some(name) = rest.first() {
        let inside = [&at[..], std::slice::from_ref(name)].concat();
        if sources.contains_key(&inside) {
            at = inside;
        } else if let Some(next) = imported.get(&(at.clone(), name.clone())) {
            at.clone_from(next);
        } else {
            break;
        }
        rest = &rest[1..];
    }
    Some(at)
}

/// Files of a crate and those that each imports from, its own parts left out.
fn imports(src: &Path) -> BTreeMap<PathBuf, BTreeSet<PathBuf>> {
    let mut files = BTreeMap::new();
    sources(src, &[], &mut files);
    let named: BTreeMap<&Module, Named> = files
        .iter()
        .map(|(module, path)| {
            let text = std::fs::read_to_string(path).expect("a source");
            let mut named = Named::default();
            named.visit_file(&syn::parse_file(&text).expect("Rust"));
            (module, named)
        })
        .collect();
    let mut imported = Imported::new();
    loop {
        let known = imported.len();
        for (module, named) in &named {
            for (name, path) in &named.imported {
                if let Some(defined) = target(&files, &imported, module, path).filter(|defined| defined != *module) {
                    imported.insert(((*module).clone(), name.clone()), defined);
                }
            }
        }
        // What is imported may be imported there as well.
        if imported.len() == known {
            break;
        }
    }
    let of_file = |(module, named): (&&Module, &Named)| {
        let targets = named.paths.iter().filter_map(|path| target(&files, &imported, module, path));
        let file = &files[*module];
        let is_part =
            |path: &&PathBuf| path.parent() != file.parent() && path.starts_with(file.parent().expect("a folder"));
        let others = targets.filter_map(|module| files.get(&module)).filter(|path| *path != file && !is_part(path));
        (file.clone(), others.cloned().collect())
    };
    named.iter().map(|(module, named)| of_file((module, named))).collect()
}

fn reached(from: &Path, imports: &BTreeMap<PathBuf, BTreeSet<PathBuf>>) -> BTreeSet<PathBuf> {
    let (mut seen, mut next) = (BTreeSet::new(), vec![from.to_path_buf()]);
    while let Some(file) = next.pop() {
        next.extend(imports.get(&file).into_iter().flatten().filter(|other| seen.insert((*other).clone())).cloned());
    }
    seen
}

/// Pairs of files of different folders that import from each other, directly or through others.
fn circles(src: &Path) -> Vec<(PathBuf, PathBuf)> {
    let imports = imports(src);
    let reached: BTreeMap<&PathBuf, BTreeSet<PathBuf>> =
        imports.keys().map(|file| (file, self::reached(file, &imports))).collect();
    let mut found = Vec::new();
    for (file, others) in &reached {
        for other in others.iter().filter(|other| other > file && other.parent() != file.parent()) {
            if reached.get(other).is_some_and(|back| back.contains(*file)) {
                found.push(((*file).clone(), other.clone()));
            }
        }
    }
    found
}

#[test]
fn no_files_of_different_folders_import_from_each_other() {
    let root = workspace_root();
    let (mut crates, mut found) = (0, Vec::new());
    for part in ["app", "core", "sim_link"] {
        for entry in std::fs::read_dir(root.join(part)).expect("the crates") {
            let src = entry.expect("an entry").path().join("src");
            if src.is_dir() {
                crates += 1;
                found.extend(circles(&src));
            }
        }
    }
    assert!(crates > 25, "{crates} crates were searched");
    assert!(found.is_empty(), "{} pairs, of which {:#?}", found.len(), &found[..found.len().min(10)]);
}

#[test]
fn a_circle_is_found_through_what_is_exported_again_and_through_the_name_of_a_module() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        let file = folder.path().join(name);
        std::fs::create_dir_all(file.parent().expect("below it")).expect("made");
        std::fs::write(file, text).expect("written");
    };
    write("lib.rs", "mod capture; mod motion;");
    write("capture/mod.rs", "mod state; pub use state::Capture as Taken;");
    write("capture/state.rs", "pub(crate) struct Capture;");
    write("motion/mod.rs", "pub(crate) mod start; use crate::capture::Taken;");
    write("motion/start.rs", "use crate::capture; fn goes(_: capture::Taken) {}");
    assert_eq!(circles(folder.path()), []);
    write("capture/state.rs", "use crate::motion; pub(crate) struct Capture; fn goes() { motion::start::goes(); }");
    let found = circles(folder.path());
    assert!(found.iter().any(|(a, b)| a.ends_with("capture/state.rs") && b.ends_with("motion/start.rs")), "{found:?}");
}
