//! The library's own source as text: its files, and which file uses what of which.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

/// A module by its path from the root of the crate; the root itself is empty.
pub(crate) type Module = Vec<String>;

/// A file of the library.
pub(crate) struct Source {
    /// The path of the file, from `src`.
    pub(crate) path: String,
    /// The whole text.
    pub(crate) text: String,
    /// The text without comments and without unit tests.
    pub(crate) code: String,
    uses: Vec<Use>,
}

/// A name that a `use` brings into a file.
struct Use {
    is_reexport: bool,
    path: Vec<String>,
}

/// All files of the library.
pub(crate) struct Sources(pub(crate) BTreeMap<Module, Source>);

impl Sources {
    /// Reads every file below `src` but for the program's `main.rs`.
    pub(crate) fn read() -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        let mut sources = BTreeMap::new();
        for path in rust_files(&root) {
            let path = path.strip_prefix(&root).unwrap().to_path_buf();
            let text = fs::read_to_string(root.join(&path)).unwrap();
            let mut module: Module = path
                .with_extension("")
                .iter()
                .map(|part| part.to_str().unwrap().to_owned())
                .collect();
            if module == ["main"] {
                continue;
            }
            if matches!(module.last().unwrap().as_str(), "mod" | "lib") {
                module.pop();
            }
            let code = code_of(&text);
            let uses = uses_of(&code);
            let path = path.to_str().unwrap().replace('\\', "/");
            sources.insert(
                module,
                Source {
                    path,
                    text,
                    code,
                    uses,
                },
            );
        }
        Self(sources)
    }

    /// For each module the modules whose names it uses, a re-exported name counting for the module that
    /// defines it. A `mod.rs` that only hands names on uses nothing by that.
    pub(crate) fn dependencies(&self) -> BTreeMap<&Module, BTreeSet<&Module>> {
        let mut dependencies = BTreeMap::new();
        for (module, source) in &self.0 {
            let hands_on = source.path.ends_with("mod.rs") || source.path == "lib.rs";
            let by_use = source.uses.iter();
            let by_use = by_use.filter(|used| !(used.is_reexport && hands_on));
            let mut paths: Vec<Vec<String>> = by_use.map(|used| used.path.clone()).collect();
            paths.extend(inline_paths(&source.code));
            let found: BTreeSet<&Module> = paths
                .iter()
                .filter_map(|path| self.definition(module, path, 0))
                .filter(|used| *used != module)
                .collect();
            dependencies.insert(module, found);
        }
        dependencies
    }

    /// The module that defines what `path` means in `module`; nothing for names of other crates.
    fn definition(&self, module: &Module, path: &[String], depth: usize) -> Option<&Module> {
        let mut at = module.clone();
        let mut rest = path;
        match path.first()?.as_str() {
            "crate" => (at, rest) = (Module::new(), &path[1..]),
            "self" => rest = &path[1..],
            "super" => {
                while rest.first().is_some_and(|part| part == "super") {
                    at.pop();
                    rest = &rest[1..];
                }
            }
            first if self.0.contains_key(&joined(&at, first)) => {}
            _ => return None,
        }
        while let Some(first) = rest.first()
            && self.0.contains_key(&joined(&at, first))
        {
            at.push(first.clone());
            rest = &rest[1..];
        }
        let reexported = rest.first().filter(|_| depth < 8).and_then(|name| {
            let uses = &self.0.get(&at)?.uses;
            let by_name = uses.iter().filter(|used| used.path.last() == Some(name));
            by_name
                .filter(|used| used.path != path)
                .find_map(|used| self.definition(&at, &used.path, depth + 1))
        });
        reexported.or_else(|| self.0.get_key_value(&at).map(|(module, _)| module))
    }
}

fn joined(module: &Module, part: &str) -> Module {
    let mut joined = module.clone();
    joined.push(part.to_owned());
    joined
}

fn rust_files(dir: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(rust_files(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// `text` without its unit tests, which stand at the end, and without comments.
fn code_of(text: &str) -> String {
    let end = text.find("\n#[cfg(test)]\nmod tests").unwrap_or(text.len());
    text[..end]
        .lines()
        .map(|line| line.split("//").next().unwrap_or_default())
        .flat_map(|line| [line, "\n"])
        .collect()
}

fn uses_of(code: &str) -> Vec<Use> {
    let mut uses = Vec::new();
    for statement in code.split(';') {
        // A statement may follow attributes, modules and functions.
        let Some(start) = statement.rfind("use ") else {
            continue;
        };
        let line = statement[..start].rfind('\n').map_or(0, |at| at + 1);
        let before = statement[line..start].trim();
        if !(before.is_empty() || before.starts_with("pub")) {
            continue;
        }
        let tree: String = statement[start + 4..].split_whitespace().collect();
        let mut paths = Vec::new();
        expand(&tree, &[], &mut paths);
        uses.extend(paths.into_iter().map(|path| Use {
            is_reexport: !before.is_empty(),
            path,
        }));
    }
    uses
}

/// The paths of a tree like `a::{b, c::{d, e}}`.
fn expand(tree: &str, prefix: &[String], paths: &mut Vec<Vec<String>>) {
    let parts = |text: &str| -> Vec<String> {
        let parts = text.split("::").filter(|part| !part.is_empty());
        parts.map(str::to_owned).collect()
    };
    let Some(open) = tree.find('{') else {
        let path = [prefix, &parts(tree)].concat();
        paths.extend((!tree.is_empty()).then_some(path));
        return;
    };
    let prefix = [prefix, &parts(&tree[..open])].concat();
    let inner = &tree[open + 1..tree.rfind('}').unwrap_or(tree.len())];
    let (mut depth, mut start) = (0, 0);
    for (at, c) in inner.char_indices().chain([(inner.len(), ',')]) {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                expand(&inner[start..at], &prefix, paths);
                start = at + 1;
            }
            _ => {}
        }
    }
}

/// Paths like `crate::geometry::spread` outside of `use`.
fn inline_paths(code: &str) -> Vec<Vec<String>> {
    let is_of_path = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
    code.match_indices("crate::")
        .map(|(at, _)| {
            let path = &code[at..];
            let end = path.find(|c| !is_of_path(c)).unwrap_or(path.len());
            path[..end].split("::").map(str::to_owned).collect()
        })
        // `crate::{` begins the tree of a `use`.
        .filter(|path: &Vec<String>| path.last().is_some_and(|part| !part.is_empty()))
        .collect()
}
