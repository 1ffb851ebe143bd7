//! `docs/scenes.md` lists every effect and every field.

use std::fmt::Write as _;
use std::path::Path;

use asperity_node::{Effect, Param};

const BEGIN: &str = "<!-- effects: written by `make scene-docs` -->\n";
const END: &str = "<!-- end of effects -->\n";

fn field(p: &Param) -> String {
    let default = match &p.default {
        Some(value) => format!("; {value} if left out"),
        None if p.optional => "; may be left out".to_owned(),
        None => String::new(),
    };
    let unit = if p.unit.is_empty() { String::new() } else { format!(" {}", p.unit) };
    format!("- `{}`: {}. A {}{unit}{default}.\n", p.name, p.doc, p.kind)
}

fn effect(kind: &str, summary: &str, effect: &Effect) -> String {
    let mut out = format!("### {kind}\n\n{summary} It acts {}.\n", effect.acts.words());
    for form in &effect.forms {
        let _ = write!(out, "\n```ron\n{}\n```\n\n", effect.written(kind, form));
        form.fields.iter().for_each(|p| out += &field(p));
        for name in &form.nested {
            let _ = writeln!(out, "- `{name}`: see below.");
        }
    }
    out + "\n"
}

#[test]
fn docs_list_every_effect() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/scenes.md");
    let committed = std::fs::read_to_string(&path).unwrap();
    let (before, rest) = committed.split_once(BEGIN).expect("the begin of the effects");
    let (_, after) = rest.split_once(END).expect("their end");
    let registry = crate::registry();
    let all = registry
        .effects()
        .map(|(kind, of)| effect(kind, registry.get(kind).map_or("", |kind| &kind.descriptor().summary), of));
    let page = format!("{before}{BEGIN}\n{}{END}{after}", all.collect::<String>());
    if std::env::var_os("ASPERITY_WRITE_SCENES").is_some() {
        std::fs::write(&path, &page).unwrap();
        return;
    }
    assert!(page == committed, "docs/scenes.md is not as the kinds tell: make scene-docs");
}
