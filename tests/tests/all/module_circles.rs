//! Modules depend on each other in one direction.
//!
//! Among the siblings at each level of a crate's tree there is no cycle; everything below a sibling counts as that sibling. A module and its parent
//! may refer to each other, because the names that a child takes from its parent are shared by all children.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Crates, as folders from the root of the repository.
#[rustfmt::skip]
const CRATES: [&str; 16] = [
    "core", "firmware", "host/recording", "host/allan", "host/mimu", "host/thermal", "host/body", "host/device", "host/equipment", "host/export",
    "host/fleet", "host/wizard", "host/station", "host/cli", "rig", "rig/board",
];

/// A module by its path from the crate's root, which is empty.
type Module = Vec<String>;

/// Source files below `folder` with their modules.
fn files(folder: &Path, module: &Module, all: &mut Vec<(Module, PathBuf)>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let stem = path.file_stem().unwrap().to_str().unwrap().to_string();
        let mut inner = module.clone();
        if path.is_dir() {
            inner.push(stem);
            files(&path, &inner, all);
        } else if path.extension().is_some_and(|e| e == "rs") {
            if !["lib", "main", "mod"].contains(&stem.as_str()) {
                inner.push(stem);
            }
            all.push((inner, path));
        }
    }
}

/// Text without comments and without the unit tests, which are at the end.
fn code(text: &str) -> String {
    let code = text.split("#[cfg(test)]\nmod tests").next().unwrap();
    let lines = code.lines().map(|l| l.split("//").next().unwrap());
    lines.collect::<Vec<_>>().join("\n")
}

/// All paths of the tree that `text` begins with, `a::{b, c::d}` as `a::b` and `a::c::d`, each appended to `before`; and the rest of the text.
fn paths<'a>(text: &'a str, before: &Module, out: &mut Vec<Module>) -> &'a str {
    let text = text.trim_start();
    if let Some(mut rest) = text.strip_prefix('{') {
        loop {
            rest = paths(rest, before, out).trim_start();
            match rest.strip_prefix(',') {
                Some(more) => rest = more,
                None => return rest.strip_prefix('}').unwrap_or(rest),
            }
        }
    }
    let end = text
        .find(|c: char| !c.is_alphanumeric() && c != '_')
        .unwrap_or(text.len());
    let (name, rest) = text.split_at(end);
    let mut path = before.clone();
    if !name.is_empty() {
        path.push(name.to_string());
    }
    match rest.strip_prefix("::") {
        Some(more) if !name.is_empty() => paths(more, &path, out),
        _ => {
            out.push(path);
            rest
        }
    }
}

/// Paths that `module` mentions by `crate::` and `super::`, from the crate's root.
fn mentioned(module: &Module, code: &str) -> Vec<Module> {
    let mut out = Vec::new();
    for start in ["crate::", "super::"] {
        for (at, _) in code.match_indices(start) {
            let before = code[..at].chars().next_back();
            if before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':') {
                continue;
            }
            let mut found = Vec::new();
            paths(&code[at..], &Vec::new(), &mut found);
            for path in found {
                let up = path.iter().take_while(|name| *name == "super").count();
                let mut from_root = match path[0].as_str() {
                    "crate" => Vec::new(),
                    _ => module[..module.len().saturating_sub(up)].to_vec(),
                };
                from_root.extend_from_slice(&path[up.max(1)..]);
                out.push(from_root);
            }
        }
    }
    out
}

/// For each parent module, which of its children mention which.
type Edges = BTreeMap<Module, BTreeMap<String, BTreeSet<String>>>;

fn edges(files: &[(Module, String)]) -> Edges {
    let known: BTreeSet<&Module> = files.iter().map(|(m, _)| m).collect();
    let mut edges = Edges::new();
    for (from, code) in files {
        for mut to in mentioned(from, code) {
            // The last part may be an item instead of a module.
            while !to.is_empty() && !known.contains(&to) {
                to.pop();
            }
            let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
            if let (Some(a), Some(b)) = (from.get(shared), to.get(shared)) {
                let of_parent = edges.entry(from[..shared].to_vec()).or_default();
                of_parent.entry(a.clone()).or_default().insert(b.clone());
            }
        }
    }
    edges
}

/// A cycle among siblings, if there is one.
fn circle(edges: &BTreeMap<String, BTreeSet<String>>) -> Option<Vec<String>> {
    fn walk(
        at: &str,
        edges: &BTreeMap<String, BTreeSet<String>>,
        way: &mut Vec<String>,
        done: &mut BTreeSet<String>,
    ) -> Option<Vec<String>> {
        if let Some(begun) = way.iter().position(|w| w == at) {
            return Some(way[begun..].to_vec());
        }
        if done.contains(at) {
            return None;
        }
        way.push(at.to_string());
        let next = edges.get(at).into_iter().flatten();
        let found = next.into_iter().find_map(|n| walk(n, edges, way, done));
        way.pop();
        done.insert(at.to_string());
        found
    }
    let mut done = BTreeSet::new();
    let mut starts = edges.keys();
    starts.find_map(|start| walk(start, edges, &mut Vec::new(), &mut done))
}

#[test]
fn no_modules_depend_on_each_other_in_a_circle() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut circles = Vec::new();
    for name in CRATES {
        let mut all = Vec::new();
        files(&root.join(name).join("src"), &Vec::new(), &mut all);
        assert!(!all.is_empty(), "{name} has no sources");
        let read = |(m, p): (Module, PathBuf)| (m, code(&fs::read_to_string(p).unwrap()));
        let all: Vec<(Module, String)> = all.into_iter().map(read).collect();
        for (parent, mut siblings) in edges(&all) {
            // A board names what it is made of by type, and the parts read its constants: one file for each board is worth that circle.
            if name == "firmware" {
                siblings.remove("board");
            }
            if let Some(way) = circle(&siblings) {
                circles.push(format!("{name}/{}: {}", parent.join("/"), way.join(" -> ")));
            }
        }
    }
    assert!(circles.is_empty(), "circles:\n{}", circles.join("\n"));
}

/// The modules of one folder in another language, and which they import: their names, separated by commas, follow one of the `words`.
fn of_folder(folder: &Path, ending: &str, words: &[&str]) -> BTreeMap<String, BTreeSet<String>> {
    let entries = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let sources = entries.filter(|path| path.extension().is_some_and(|e| e == ending));
    let read = |path: PathBuf| {
        let text = fs::read_to_string(&path).unwrap();
        let lists = text
            .lines()
            .flat_map(|line| words.iter().filter_map(|w| line.split_once(w)));
        let end = |c: char| !c.is_alphanumeric() && c != '_';
        let names = lists
            .flat_map(|(_, list)| list.split(", "))
            .filter_map(|name| name.split(end).next());
        let stem = path.file_stem().unwrap().to_str().unwrap().to_owned();
        (stem, names.map(str::to_owned).collect())
    };
    sources.map(read).collect()
}

#[test]
fn no_modules_of_the_package_and_of_the_page_depend_on_each_other_in_a_circle() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for (folder, ending, before) in [
        ("python/mimu", "py", ["from mimu.", "from mimu import "]),
        ("web/page", "js", ["from \"./", "import(\"./"]),
    ] {
        let modules = of_folder(&root.join(folder), ending, &before);
        assert!(
            modules.values().map(BTreeSet::len).sum::<usize>() > 10,
            "{folder}: {modules:?}"
        );
        assert_eq!(circle(&modules), None, "{folder}");
    }
}

#[test]
fn a_circle_is_seen_through_grouped_imports_and_below_a_sibling() {
    let module = |path: &str| -> Module { path.split('/').map(String::from).collect() };
    let files = [
        (
            module("a/inner"),
            "use crate::{c::X, b::{Y, Z}};".to_string(),
        ),
        (module("b"), "use super::a::inner::W;".to_string()),
        (module("c"), "fn f() -> u8 { 0 }".to_string()),
    ];
    let found = edges(&files);
    assert_eq!(
        circle(&found[&Vec::new()]),
        Some(vec!["a".into(), "b".into()])
    );
    let straight = edges(&[files[0].clone(), files[2].clone()]);
    assert_eq!(circle(&straight[&Vec::new()]), None);
}
