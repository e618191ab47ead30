//! The rooms of the house: which crate may use which, no import cycle in any, and nothing too long to hold.
//!
//! A module that hands on what its files define (`pub use`) does not import them by that; whoever uses the name does.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use proc_macro2::Span;
use syn::spanned::Spanned as _;
use syn::visit::{self, Visit};

use crate::sandbox::root;

/// The crates of the workspace that each crate may use.
const MAY_USE: [(&str, &[&str]); 9] = [
    ("dem-core", &[]),
    ("smc-calib", &[]),
    ("campaign", &[]),
    ("figures", &[]),
    ("guide", &[]),
    ("workbench", &["campaign", "dem-core", "figures", "smc-calib"]),
    ("calibrate", &["campaign", "dem-core", "figures", "smc-calib", "workbench"]),
    ("python", &["campaign", "dem-core", "smc-calib", "workbench"]),
    ("studies", &["campaign", "dem-core", "figures", "smc-calib", "workbench"]),
];

#[test]
fn crates_use_only_those_below_them() {
    let manifest = |name: &str| {
        let path = root().join("crates").join(name).join("Cargo.toml");
        let text = fs::read_to_string(path).expect("a manifest");
        toml::from_str::<toml::Table>(&text).expect("TOML")
    };
    let crates: BTreeSet<String> = fs::read_dir(root().join("crates"))
        .expect("crates/")
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
        .collect();
    assert_eq!(crates, MAY_USE.iter().map(|(name, _)| (*name).to_owned()).collect());
    for (name, allowed) in MAY_USE {
        let manifest = manifest(name);
        let used = manifest["dependencies"].as_table().expect("dependencies").keys();
        for other in used.filter(|other| crates.contains(*other)) {
            assert!(allowed.contains(&other.as_str()), "{name} uses {other}");
        }
    }
}

/// A module by the names on its path in the crate.
type Module = Vec<String>;

/// The source files of a crate by module.
fn modules(source: &Path) -> BTreeMap<Module, syn::File> {
    rust_files(source)
        .into_iter()
        .filter(|path| !(path.ends_with("main.rs") && source.join("lib.rs").exists()))
        .map(|path| {
            let relative = path.strip_prefix(source).expect("below").with_extension("");
            let mut module: Module =
                relative.iter().map(|part| part.to_string_lossy().into_owned()).collect();
            if module.last().is_some_and(|last| ["mod", "lib", "main"].contains(&last.as_str())) {
                module.pop();
            }
            (module, parsed(&path))
        })
        .collect()
}

fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut files = Vec::new();
    for entry in entries {
        let path = entry.expect("an entry").path();
        if path.is_dir() && !path.ends_with("target") {
            files.extend(rust_files(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files
}

fn parsed(path: &Path) -> syn::File {
    let text = fs::read_to_string(path).expect("a source file");
    syn::parse_file(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The paths that a file names: those of its imports, and those in its code.
#[derive(Default)]
struct Paths {
    private: Vec<Module>,
    /// Names that it hands on, with the paths behind them.
    public: Vec<(String, Module)>,
}

fn is_test(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("cfg")
            && attribute.parse_args::<syn::Path>().is_ok_and(|path| path.is_ident("test"))
    })
}

fn flattened(tree: &syn::UseTree, before: &[String], all: &mut Vec<(String, Module)>) {
    let longer = |name: &syn::Ident| [before, &[name.to_string()]].concat();
    match tree {
        syn::UseTree::Path(path) => flattened(&path.tree, &longer(&path.ident), all),
        syn::UseTree::Name(name) if name.ident == "self" => {
            all.push((before.last().cloned().unwrap_or_default(), before.to_vec()));
        }
        syn::UseTree::Name(name) => all.push((name.ident.to_string(), longer(&name.ident))),
        syn::UseTree::Rename(name) => all.push((name.rename.to_string(), longer(&name.ident))),
        syn::UseTree::Glob(_) => all.push(("*".to_owned(), before.to_vec())),
        syn::UseTree::Group(group) => {
            group.items.iter().for_each(|tree| flattened(tree, before, all));
        }
    }
}

impl<'ast> Visit<'ast> for Paths {
    fn visit_item(&mut self, item: &'ast syn::Item) {
        let test = match item {
            syn::Item::Mod(module) => is_test(&module.attrs),
            syn::Item::Fn(function) => is_test(&function.attrs),
            syn::Item::Use(item) => is_test(&item.attrs),
            _ => false,
        };
        if !test {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        let mut all = Vec::new();
        flattened(&item.tree, &[], &mut all);
        if matches!(item.vis, syn::Visibility::Inherited) {
            self.private.extend(all.into_iter().map(|(_, path)| path));
        } else {
            self.public.extend(all);
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        if path.segments.len() > 1 {
            self.private.push(path.segments.iter().map(|s| s.ident.to_string()).collect());
        }
        visit::visit_path(self, path);
    }
}

/// The imports among the files of a crate.
struct Imports {
    files: BTreeMap<Module, Paths>,
}

impl Imports {
    fn of(source: &Path) -> Self {
        let files = modules(source)
            .into_iter()
            .map(|(module, file)| {
                let mut paths = Paths::default();
                paths.visit_file(&file);
                (module, paths)
            })
            .collect();
        Self { files }
    }

    /// A path from the root of the crate; none for one of another crate.
    fn absolute(&self, module: &[String], path: &[String]) -> Option<Module> {
        let first = path.first()?;
        let mut base = module.to_vec();
        let mut rest = path;
        match first.as_str() {
            "crate" => return Some(path[1..].to_vec()),
            "self" => rest = &path[1..],
            "super" => {
                while rest.first().is_some_and(|name| name == "super") {
                    base.pop();
                    rest = &rest[1..];
                }
            }
            _ => {
                let child = [module, std::slice::from_ref(first)].concat();
                self.files.get(&child)?;
            }
        }
        Some([base, rest.to_vec()].concat())
    }

    /// The file in which a path ends; through what other files hand on.
    fn file(&self, path: &[String], depth: usize) -> Module {
        let known = |n: &usize| self.files.contains_key(&path[..*n]);
        let end = (0..=path.len()).rev().find(known).unwrap_or(0);
        let module = path[..end].to_vec();
        if let (Some(name), true) = (path.get(end), depth < 8) {
            let handed = self.files[&module].public.iter().find(|(handed, _)| handed == name);
            let target = handed.and_then(|(_, target)| self.absolute(&module, target));
            if let Some(target) = target.filter(|target| target != path) {
                return self.file(&target, depth + 1);
            }
        }
        module
    }

    fn edges(&self) -> BTreeMap<Module, BTreeSet<Module>> {
        let of = |(module, paths): (&Module, &Paths)| {
            let targets = paths.private.iter().filter_map(|path| self.absolute(module, path));
            let files = targets.map(|target| self.file(&target, 0));
            (module.clone(), files.filter(|file| file != module).collect())
        };
        self.files.iter().filter(|(module, _)| !module.is_empty()).map(of).collect()
    }

    /// A cycle, if there is one.
    fn cycle(&self) -> Option<Vec<String>> {
        let mut edges = self.edges();
        // Files that import none of the rest are on no cycle: what stays is.
        loop {
            let ends: Vec<Module> = edges
                .iter()
                .filter(|(_, to)| to.is_empty())
                .map(|(from, _)| from.clone())
                .collect();
            if ends.is_empty() {
                break;
            }
            ends.iter().for_each(|end| drop(edges.remove(end)));
            let left: BTreeSet<Module> = edges.keys().cloned().collect();
            edges.values_mut().for_each(|to| to.retain(|file| left.contains(file)));
        }
        let first = edges.keys().next()?.clone();
        let mut walk = vec![first];
        loop {
            let next = edges[walk.last()?].first()?.clone();
            if let Some(start) = walk.iter().position(|file| *file == next) {
                return Some(walk[start..].iter().map(|file| file.join("::")).collect());
            }
            walk.push(next);
        }
    }
}

#[test]
fn no_files_of_a_crate_import_one_another_in_a_cycle() {
    for (name, _) in MAY_USE {
        let imports = Imports::of(&root().join("crates").join(name).join("src"));
        assert!(imports.files.len() > 3, "{name} has no files");
        let cycle = imports.cycle();
        assert!(cycle.is_none(), "{name}: {}", cycle.unwrap_or_default().join(" -> "));
    }
}

#[test]
fn a_cycle_of_imports_is_found_through_what_a_module_hands_on() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, text) in [
        ("lib.rs", "mod a; mod b; mod c; pub use b::B;"),
        ("a.rs", "use crate::B; pub fn f() { crate::c::g() }"),
        ("b.rs", "pub struct B; fn h() { super::a::f() }"),
        ("c.rs", "pub fn g() {} #[cfg(test)] mod tests { use crate::a::f; }"),
    ] {
        fs::write(folder.path().join(name), text).expect("written");
    }
    assert_eq!(Imports::of(folder.path()).cycle(), Some(vec!["a".to_owned(), "b".to_owned()]));
    fs::write(folder.path().join("b.rs"), "pub struct B;").expect("written");
    assert_eq!(Imports::of(folder.path()).cycle(), None);
}

/// Functions that are too long, or have too many arguments.
struct Functions<'a> {
    file: &'a Path,
    found: &'a mut Vec<String>,
}

impl Functions<'_> {
    fn look(&mut self, signature: &syn::Signature, span: Span) {
        let lines = span.end().line - signature.span().start().line + 1;
        let receiver = usize::from(signature.receiver().is_some());
        let arguments = signature.inputs.len() - receiver;
        if lines > 80 || arguments > 6 {
            let (file, name) = (self.file.display(), &signature.ident);
            self.found.push(format!("{file}: {name}: {lines} lines, {arguments} arguments"));
        }
    }
}

impl<'ast> Visit<'ast> for Functions<'_> {
    fn visit_item_fn(&mut self, function: &'ast syn::ItemFn) {
        self.look(&function.sig, function.span());
        visit::visit_item_fn(self, function);
    }

    fn visit_impl_item_fn(&mut self, function: &'ast syn::ImplItemFn) {
        self.look(&function.sig, function.span());
        visit::visit_impl_item_fn(self, function);
    }

    fn visit_trait_item_fn(&mut self, function: &'ast syn::TraitItemFn) {
        self.look(&function.sig, function.span());
        visit::visit_trait_item_fn(self, function);
    }
}

#[test]
fn no_file_is_above_500_lines_no_function_above_80_or_6_arguments() {
    let mut found = Vec::new();
    for path in ["crates", "tests"].iter().flat_map(|top| rust_files(&root().join(top))) {
        let lines = fs::read_to_string(&path).expect("a source file").lines().count();
        if lines > 500 {
            found.push(format!("{}: {lines} lines", path.display()));
        }
        Functions { file: &path, found: &mut found }.visit_file(&parsed(&path));
    }
    assert!(found.is_empty(), "{found:#?}");
}

/// Names in the list of a script, and those of the tests that are ignored as run by it.
fn left_out(script: &str, list: &str, word: &str) -> [BTreeSet<String>; 2] {
    let ci = fs::read_to_string(root().join(script)).expect("the script");
    let (_, long) = ci.split_once(&format!("\n{list}=(\n")).expect("a list");
    let (long, _) = long.split_once("\n)\n").expect("its end");
    let listed = long.lines().map(|line| line.trim().to_owned()).collect();
    let ignore = format!("#[ignore = \"{word}: run by {script}\"]");
    let mut left_out = BTreeSet::new();
    for path in [root().join("crates"), root().join("tests")].iter().flat_map(|p| rust_files(p)) {
        let text = fs::read_to_string(&path).expect("a file");
        for after in text.split(&ignore).skip(1) {
            let (_, name) = after.split_once("fn ").expect("a function");
            left_out.insert(name.split('(').next().unwrap_or_default().to_owned());
        }
    }
    [listed, left_out]
}

#[test]
fn every_test_that_is_left_out_for_its_length_runs_in_ci() {
    let [listed, ignored] = left_out(".ci/run", "long", "long");
    assert_eq!(listed, ignored);
    let [listed, ignored] = left_out(".ci/long", "longer", "longer");
    assert_eq!(listed, ignored);
}
