//! `docs/contract.md` is `src/contract/`, rendered. After a change of the tables,
//! `UPDATE=1 cargo test --test contract` writes the page anew.

#![allow(clippy::unwrap_used)] // a test that cannot read or write the page has failed

use std::{env, fs, path::Path};

use dualcone::contract::{
    ArraySpec, CONTENT, FRAME, GRID, IMAGE, Kind, MESH, MESH_MOTION, PASSES, PassSpec, SETTINGS,
    SettingSpec,
};

const PAGE: &str = "docs/contract.md";

const INTRODUCTION: &str = "\
# What crosses from the add-on into the renderer

Rendered from the tables in `src/contract/` by `tests/contract.rs`; change the tables, then run
`UPDATE=1 cargo test --test contract`.

Letters in a shape are lengths that the caller chooses: V vertices, T triangles, I instances,
S material slots, C closures, M materials, L lights, H x W pixels, J moving instances, R placements of
them, Y times while the shutter is open, U parts of its time, E frames around, F instances that
differ there, with W vertices, X x Y x Z points of a grid with N numbers each, G and H as I and M where Cryptomatte asks. Everything that does not say so is given for the middle of that time,
the frame's own. The world's Z is up, matrices
multiply column vectors from the left, and colours are scene linear. Arrays are C-contiguous.
";

/// A table with escaped cells under a heading.
fn section(title: &str, columns: &[&str], rows: &[Vec<String>]) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let header: Vec<_> = columns.iter().map(ToString::to_string).collect();
    let rule: Vec<_> = columns.iter().map(|_| "---".to_owned()).collect();
    let escaped = rows.iter().map(|row| {
        let cells: Vec<_> = row.iter().map(|cell| cell.replace('|', "\\|")).collect();
        line(&cells)
    });
    let body: String = [line(&header), line(&rule)]
        .into_iter()
        .chain(escaped)
        .collect();
    format!("\n## {title}\n\n{body}")
}

fn arrays(title: &str, table: &[ArraySpec]) -> String {
    let row = |array: &ArraySpec| {
        vec![
            format!("`{}`", array.name),
            array.dtype.name().to_owned(),
            format!("({})", array.shape.join(", ")),
            array.unit.to_owned(),
            array.doc.to_owned(),
        ]
    };
    let rows: Vec<_> = table.iter().map(row).collect();
    section(title, &["array", "dtype", "shape", "unit", "what"], &rows)
}

/// Default and range of a setting.
fn values(kind: Kind) -> (String, String) {
    match kind {
        Kind::Int(default, min, max) => (default.to_string(), format!("{min} to {max}")),
        Kind::Float(default, min, max) => (format!("{default:?}"), format!("{min:?} to {max:?}")),
        Kind::Bool(default) => (default.to_string(), "true or false".to_owned()),
        Kind::Enum(default, items) => {
            let words: Vec<_> = items
                .iter()
                .map(|(word, _, doc)| format!("`{word}`: {doc}"))
                .collect();
            (format!("`{default}`"), words.join("; "))
        }
    }
}

fn settings(table: &[SettingSpec]) -> String {
    let row = |setting: &SettingSpec| {
        let (default, range) = values(setting.kind);
        vec![
            format!("`{}`", setting.name),
            setting.label.to_owned(),
            default,
            range,
            setting.doc.to_owned(),
        ]
    };
    let rows: Vec<_> = table.iter().map(row).collect();
    let columns = ["setting", "label", "default", "values", "what"];
    section("Settings", &columns, &rows)
}

fn passes(table: &[PassSpec]) -> String {
    let row = |pass: &PassSpec| {
        vec![
            pass.name.to_owned(),
            pass.channels.to_owned(),
            pass.kind.to_owned(),
            pass.doc.to_owned(),
        ]
    };
    let rows: Vec<_> = table.iter().map(row).collect();
    section("Passes", &["pass", "channels", "type", "what"], &rows)
}

fn page() -> String {
    [
        INTRODUCTION.to_owned(),
        arrays("Mesh", MESH),
        arrays("Mesh motion", MESH_MOTION),
        arrays("Content of a mesh", CONTENT),
        arrays("Grid", GRID),
        arrays("Image", IMAGE),
        arrays("Frame", FRAME),
        settings(SETTINGS),
        passes(PASSES),
    ]
    .concat()
}

#[test]
fn the_page_shows_the_tables() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(PAGE);
    if env::var_os("UPDATE").is_some() {
        fs::write(&path, page()).unwrap();
    }
    // Git may have checked it out with the line ends of the platform.
    let written = fs::read_to_string(&path).unwrap().replace("\r\n", "\n");
    for (row, (expected, found)) in page().lines().zip(written.lines()).enumerate() {
        assert_eq!(
            expected,
            found,
            "{PAGE}:{}: UPDATE=1 cargo test --test contract",
            row + 1
        );
    }
    assert!(
        page() == written,
        "{PAGE}: UPDATE=1 cargo test --test contract"
    );
}
