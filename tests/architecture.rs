//! Holds the sources to what ARCHITECTURE.md promises: the order of imports, short functions, where
//! `unsafe` may stand, and no name of a package registry's host.

#![allow(clippy::unwrap_used)] // a test that cannot read its sources has failed

use std::fs;
use std::path::{Path, PathBuf};

/// A module imports from its own layer and from those above, in the order of `lib.rs`.
const LAYERS: &[&[&str]] = &[
    &["error", "contract", "math", "optics", "kernel"],
    &["image", "shader"],
    &["scene", "film"],
    &["accel", "sampling", "record"],
    &[
        "progress",
        "media",
        "subsurface",
        "surface",
        "neighbourhood",
        "path",
        "passes",
    ],
    &["reuse"],
    &["render"],
    &["python"],
];

/// Beyond this a function is read in parts, and its parts want names.
const LONGEST_FUNCTION: usize = 75;

struct Source {
    path: PathBuf,
    text: String,
}

/// All files below `folder` whose name ends with one of `extensions`, sorted.
fn sources(folder: &str, extensions: &[&str]) -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders = vec![root.join(folder)];
    let mut found = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if extensions
                .iter()
                .any(|e| path.extension().is_some_and(|x| x == *e))
            {
                let text = fs::read_to_string(&path).unwrap();
                let path = path.strip_prefix(root).unwrap().to_owned();
                found.push(Source { path, text });
            }
        }
    }
    found.sort_by(|a, b| a.path.cmp(&b.path));
    found
}

fn file(name: &str) -> Option<Source> {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).ok()?;
    Some(Source {
        path: PathBuf::from(name),
        text,
    })
}

fn rust_sources() -> Vec<Source> {
    let found: Vec<_> = ["src", "tests", "benches"]
        .iter()
        .flat_map(|folder| sources(folder, &["rs"]))
        .collect();
    assert!(found.len() > 3, "the sources were not found");
    found
}

fn module_of(path: &Path) -> String {
    let below_src = path.strip_prefix("src").unwrap();
    let first = below_src.components().next().unwrap();
    Path::new(first.as_os_str())
        .file_stem()
        .unwrap()
        .to_string_lossy()
        .into_owned()
}

/// The source with the contents of comments, strings and character literals blanked out.
fn code_only(text: &str) -> String {
    let chars: Vec<char> = text.chars().collect();
    let mut code = String::with_capacity(text.len());
    let mut at = 0;
    while at < chars.len() {
        let end = skip_token(&chars, at);
        if end == at {
            code.push(chars[at]);
            at += 1;
        } else {
            let newlines = chars[at..end].iter().filter(|c| **c == '\n').count();
            code.extend(std::iter::repeat_n('\n', newlines));
            at = end;
        }
    }
    code
}

/// The end of the comment, string or character literal that starts at `at`, else `at` itself.
fn skip_token(chars: &[char], at: usize) -> usize {
    let next = chars.get(at + 1).copied().unwrap_or(' ');
    let after_word = at > 0 && (chars[at - 1].is_alphanumeric() || chars[at - 1] == '_');
    match chars[at] {
        '/' if next == '/' => find(chars, at, "\n"),
        '/' if next == '*' => find(chars, at + 2, "*/") + 2,
        '"' => string_end(chars, at),
        'r' if !after_word && (next == '"' || next == '#') => raw_string_end(chars, at),
        '\'' if next == '\\' => find(chars, at + 3, "'") + 1,
        '\'' if chars.get(at + 2) == Some(&'\'') => at + 3,
        _ => at,
    }
    .min(chars.len())
}

fn find(chars: &[char], from: usize, what: &str) -> usize {
    let what: Vec<char> = what.chars().collect();
    (from..chars.len())
        .find(|&i| chars[i..].starts_with(&what))
        .unwrap_or(chars.len())
}

fn string_end(chars: &[char], start: usize) -> usize {
    let mut at = start + 1;
    while at < chars.len() && chars[at] != '"' {
        at += if chars[at] == '\\' { 2 } else { 1 };
    }
    at + 1
}

fn raw_string_end(chars: &[char], start: usize) -> usize {
    let hashes = chars[start + 1..].iter().take_while(|c| **c == '#').count();
    if chars.get(start + 1 + hashes) != Some(&'"') {
        return start;
    }
    let close = format!("\"{}", "#".repeat(hashes));
    find(chars, start + 2 + hashes, &close) + close.len()
}

/// The words of a line of code.
fn words(line: &str) -> impl Iterator<Item = &str> {
    line.split(|c: char| !c.is_alphanumeric() && c != '_')
        .filter(|word| !word.is_empty())
}

/// Line numbers and what follows `crate::` there, up to the file's own tests.
fn imports(text: &str) -> Vec<(usize, String)> {
    let code = code_only(text);
    let product = code
        .split("#[cfg(test)]\nmod tests {")
        .next()
        .unwrap_or_default();
    let mut found = Vec::new();
    for (number, line) in product.lines().enumerate() {
        for rest in line.split("crate::").skip(1) {
            let grouped = rest.starts_with('{');
            let name = words(rest).next().filter(|_| !grouped).unwrap_or("{");
            found.push((number + 1, name.to_owned()));
        }
    }
    found
}

/// Lines where a function starts, and its length.
fn function_lengths(text: &str) -> Vec<(usize, usize)> {
    let code = code_only(text);
    let lines: Vec<&str> = code.lines().collect();
    let starts = |line: &str| {
        let mut words = words(line).skip_while(|word| *word != "fn");
        words.next().is_some() && words.next().is_some() && !line.contains("fn(")
    };
    (0..lines.len())
        .filter(|start| starts(lines[*start]))
        .map(|start| (start + 1, item_length(&lines[start..])))
        .collect()
}

/// Lines from the first to the brace that closes it, or to the semicolon of a bare signature.
fn item_length(lines: &[&str]) -> usize {
    let mut depth = 0;
    for (row, line) in lines.iter().enumerate() {
        for c in line.chars() {
            match c {
                '{' | '(' | '[' => depth += 1,
                '}' | ')' | ']' => depth -= 1,
                _ => {}
            }
            if depth == 0 && (c == '}' || c == ';') {
                return row + 1;
            }
        }
    }
    lines.len()
}

/// Lines where a Python function starts, and its length.
fn python_function_lengths(text: &str) -> Vec<(usize, usize)> {
    let lines: Vec<&str> = text.lines().collect();
    let indent = |line: &str| line.len() - line.trim_start().len();
    let starts = |line: &str| {
        let line = line.trim_start();
        line.starts_with("def ") || line.starts_with("async def ")
    };
    let mut found = Vec::new();
    for (start, line) in lines.iter().enumerate().filter(|(_, line)| starts(line)) {
        let belongs = |inner: &str| {
            let closes_signature = inner.trim_start().starts_with(')');
            inner.is_empty() || closes_signature || indent(inner) > indent(line)
        };
        let after = &lines[start + 1..];
        let end = after.iter().position(|inner| !belongs(inner));
        let body = &after[..end.unwrap_or(after.len())];
        let last = body.iter().rposition(|inner| !inner.is_empty());
        found.push((start + 1, 1 + last.map_or(0, |last| last + 1)));
    }
    found
}

/// Modules in the order of lib.rs.
fn module_order() -> Vec<String> {
    let lib = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/lib.rs")).unwrap();
    let product = lib.replace("#[cfg(test)]\nmod testing;", "");
    product
        .lines()
        .filter_map(|line| line.trim_start_matches("pub ").strip_prefix("mod "))
        .map(|name| name.trim_end_matches(';').to_owned())
        .collect()
}

#[test]
fn lib_lists_its_modules_layer_by_layer() {
    let layer_of = |name: &String| {
        let layer = LAYERS
            .iter()
            .position(|layer| layer.contains(&name.as_str()));
        layer.unwrap_or_else(|| panic!("{name} is in no layer"))
    };
    let order = module_order();
    assert!(order.contains(&"math".to_owned()), "{order:?}");
    assert!(order.iter().map(layer_of).is_sorted(), "{order:?}");
}

#[test]
fn modules_import_only_from_those_above() {
    let order = module_order();
    let rank = |name: &str| order.iter().position(|known| known == name);
    let mut wrong = Vec::new();
    for source in sources("src", &["rs"]) {
        let module = module_of(&source.path);
        if source.path.ends_with("tests.rs") || module == "testing" {
            continue; // tests may look at everything
        }
        let Some(own_rank) = rank(&module) else {
            continue; // lib.rs itself
        };
        for (line, import) in imports(&source.text) {
            // `use crate::{a::X, b::Y}` would hide modules from this test: one line per module.
            if rank(&import).is_none_or(|rank| rank > own_rank) {
                wrong.push(format!("{}:{line}: crate::{import}", source.path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "not above:\n{}", wrong.join("\n"));
}

#[test]
fn functions_are_short() {
    let rust = rust_sources()
        .into_iter()
        .map(|s| (function_lengths(&s.text), s.path));
    let python = ["addon", "python", "scripts", "tests", "blend_samples"]
        .iter()
        .flat_map(|folder| sources(folder, &["py"]))
        .map(|s| (python_function_lengths(&s.text), s.path));
    let mut long = Vec::new();
    let mut count = 0;
    for (functions, path) in rust.chain(python) {
        count += functions.len();
        for (line, length) in functions {
            if length > LONGEST_FUNCTION {
                long.push(format!("{}:{line}: {length} lines", path.display()));
            }
        }
    }
    assert!(count > 20, "only {count} functions were found");
    assert!(long.is_empty(), "too long:\n{}", long.join("\n"));
}

#[test]
fn unsafe_stands_only_in_the_kernel() {
    for source in rust_sources() {
        if source.path.starts_with("src/kernel") || source.path.starts_with("src/kernel.rs") {
            continue;
        }
        let code = code_only(&source.text);
        let line = code
            .lines()
            .position(|line| words(line).any(|word| word == "unsafe"));
        assert_eq!(line, None, "unsafe in {}", source.path.display());
    }
}

/// Where packages come from is the machine's business: it may use a mirror.
#[test]
fn no_registry_is_named() {
    let hosts = [
        ["pypi", "org"],
        ["pythonhosted", "org"],
        ["crates", "io"],
        ["npmjs", "com"],
    ]
    .map(|name| name.join("."));
    let folders = [
        ".ci", "addon", "python", "scripts", "src", "tests", "benches", "docs",
    ];
    let text = ["rs", "py", "toml", "txt", "md", "sh"];
    let mut files: Vec<_> = folders.iter().flat_map(|f| sources(f, &text)).collect();
    for name in [
        "Makefile",
        "Cargo.toml",
        "pyproject.toml",
        "deny.toml",
        "README.md",
        ".ci/run",
    ] {
        files.extend(file(name));
    }
    for source in files {
        for host in &hosts {
            let line = source.text.lines().position(|line| line.contains(host));
            assert_eq!(line, None, "{host} in {}", source.path.display());
        }
    }
}

#[test]
fn the_reader_of_sources_reads() {
    let text = "use crate::math::Ray; // crate::path\nconst A: &str = \"crate::path\";\n\
                fn f<'a>(x: &'a str) -> char {\n    '{'\n}\ntrait T {\n    fn g();\n}\n\
                #[cfg(test)]\nmod tests {\n    use crate::render;\n}\n";
    assert_eq!(imports(text), [(1, "math".to_owned())]);
    assert_eq!(function_lengths(text), [(3, 3), (7, 1)]);
    let python = "class A:\n    def f(\n        self,\n    ) -> None:\n        pass\n\n\
                  def g(): ...\n\nx = 1\n";
    assert_eq!(python_function_lengths(python), [(2, 4), (7, 1)]);
}
