//! Dependencies go downwards only, no files use each other in a circle, and the house stays in measure.

use std::collections::BTreeMap;

use crate::sources::{Module, Sources};

/// The modules, the lowest first: each may use those before it.
const LAYERS: [&str; 20] = [
    // Numbers.
    "geometry",
    "quality",
    "lloyd",
    "mesh",
    "transients",
    "tiling",
    "spacing",
    "resample",
    "simulate",
    "picture",
    // Files.
    "store",
    "las",
    "tile",
    // The application.
    "config",
    "views",
    "job",
    "report",
    "cli",
    // The root, and what benches and tests look at.
    "internals",
    "",
];

/// Public items of the library: functions, types, traits and constants.
const MAX_PUBLIC_ITEMS: usize = 154;
const MAX_LINES_OF_A_FILE: usize = 450;
const MAX_LINES_OF_A_FUNCTION: usize = 80;

fn layer(module: &Module) -> usize {
    let name = module.first().map_or("", String::as_str);
    let layer = LAYERS.iter().position(|&layer| layer == name);
    layer.unwrap_or_else(|| panic!("{name} is in no layer"))
}

#[test]
fn dependencies_go_downwards_only() {
    let sources = Sources::read();
    let mut checked = 0;
    for (module, used) in sources.dependencies() {
        for used in used {
            assert!(
                layer(used) <= layer(module),
                "{} uses {}, which is above it",
                module.join("::"),
                used.join("::")
            );
            checked += 1;
        }
    }
    assert!(checked > 200, "the test finds what modules use: {checked}");
}

#[test]
fn no_files_use_each_other_in_a_circle() {
    let sources = Sources::read();
    let mut dependencies = sources.dependencies();
    // Whatever uses nothing that is left is taken away, again and again.
    loop {
        let left: Vec<&Module> = dependencies.keys().copied().collect();
        dependencies.retain(|_, used| used.iter().any(|used| left.contains(used)));
        if dependencies.len() == left.len() {
            break;
        }
    }
    let circles: Vec<String> = dependencies
        .iter()
        .map(|(module, used)| {
            let used = used.iter().filter(|used| dependencies.contains_key(*used));
            let used: Vec<String> = used.map(|used| used.join("::")).collect();
            format!("{} uses {}", module.join("::"), used.join(", "))
        })
        .collect();
    assert!(circles.is_empty(), "{}", circles.join("\n"));
}

#[test]
fn unsafe_code_stands_nowhere() {
    for source in Sources::read().0.values() {
        for line in source.text.lines() {
            let code = line.split("//").next().unwrap_or_default();
            let is_unsafe = code.contains("unsafe {") || code.contains("unsafe fn");
            assert!(!is_unsafe, "{}: {line}", source.path);
        }
    }
}

#[test]
fn the_public_items_are_few() {
    let sources = Sources::read();
    let is_item = |line: &&str| {
        let item = line.trim_start().strip_prefix("pub ");
        item.is_some_and(|item| {
            let kinds = [
                "fn ", "const ", "struct ", "enum ", "trait ", "type ", "static ",
            ];
            kinds.iter().any(|kind| item.starts_with(kind))
        })
    };
    let by_file: BTreeMap<&str, usize> = sources
        .0
        .values()
        .map(|source| {
            (
                source.path.as_str(),
                source.code.lines().filter(is_item).count(),
            )
        })
        .collect();
    let items: usize = by_file.values().sum();
    assert!(
        (30..=MAX_PUBLIC_ITEMS).contains(&items),
        "{items} public items: {by_file:#?}"
    );
}

#[test]
fn files_are_short() {
    for source in Sources::read().0.values() {
        let lines = source.text.lines().count();
        assert!(
            lines <= MAX_LINES_OF_A_FILE,
            "{}: {lines} lines",
            source.path
        );
    }
}

/// A function begins with a line that has `fn` and ends with a brace that stands as far to the left.
#[test]
fn functions_are_short() {
    let mut checked = 0;
    for source in Sources::read().0.values() {
        let lines: Vec<&str> = source.text.lines().collect();
        for (start, line) in lines.iter().enumerate() {
            let code = line.trim_start();
            let words: Vec<&str> = code
                .split(' ')
                .take_while(|word| !word.contains('('))
                .collect();
            let is_function = !code.starts_with("//")
                && (words.contains(&"fn") || code.starts_with("fn "))
                && !line.trim_end().ends_with(';');
            if !is_function {
                continue;
            }
            let indent = &line[..line.len() - code.len()];
            let end = lines[start..]
                .iter()
                .position(|line| *line == format!("{indent}}}"));
            let length = end.map_or(1, |end| end + 1);
            assert!(
                length <= MAX_LINES_OF_A_FUNCTION,
                "{}:{}: a function of {length} lines",
                source.path,
                start + 1
            );
            checked += 1;
        }
    }
    assert!(checked > 500, "the test finds functions: {checked}");
}

/// Words that once had a private meaning. Standard words stand in their place.
#[test]
fn retired_words_are_gone() {
    const RETIRED: [&str; 9] = [
        "lot",
        "odds",
        "glimpse",
        "glimpses",
        "portrait",
        "excerpt",
        "crowd",
        "fewest_lines",
        "most_bend",
    ];
    for source in Sources::read().0.values() {
        for (number, line) in source.text.lines().enumerate() {
            let mut words = line.split(|c: char| !(c.is_alphanumeric() || c == '_'));
            let retired = words.find(|word| RETIRED.contains(&word.to_lowercase().as_str()));
            assert_eq!(retired, None, "{}:{}: {line}", source.path, number + 1);
        }
    }
}
/// A comment is read alone, from a search: it does not lean on the item above it.
#[test]
fn comments_of_items_stand_by_themselves() {
    const LEANING: [&str; 9] = [
        "The same",
        "Those of",
        "And ",
        "…",
        "As [`",
        "Of those",
        "Such a",
        "Likewise",
        "The others",
    ];
    for source in Sources::read().0.values() {
        let mut before = "";
        for (number, line) in source.text.lines().enumerate() {
            let line = line.trim_start();
            let comment = line
                .strip_prefix("/// ")
                .or_else(|| line.strip_prefix("//! "));
            let is_first = !before.starts_with("///") && !before.starts_with("//!");
            if let Some(comment) = comment.filter(|_| is_first) {
                let leans = LEANING.iter().find(|words| comment.starts_with(**words));
                assert_eq!(leans, None, "{}:{}: {comment}", source.path, number + 1);
            }
            before = line;
        }
    }
}
