//! `docs/stability.md` lists every case.

use std::path::Path;

use crate::{Case, cases, node_cases};

const BEGIN: &str = "<!-- cases: written by `make stability-docs` -->\n";
const END: &str = "<!-- end of cases -->\n";

/// All cases, as the program has them.
fn all() -> Vec<&'static Case> {
    cases().into_iter().chain(node_cases()).collect()
}

/// An item of a list, in lines of at most 105 columns.
fn item(case: &Case) -> String {
    let star = if case.of_graph || case.family == "node" { "" } else { " \\*" };
    let text = format!("- `{}`{star}: {}.\n", case.name, case.hard) + &format!("*Must hold:* {}.", case.must);
    let mut out = String::new();
    for line in text.lines() {
        let mut width = 0;
        for word in line.split(' ') {
            let fits = width > 0 && width + 1 + word.len() <= 105;
            out += if fits {
                " "
            } else if out.is_empty() {
                ""
            } else {
                "\n  "
            };
            width = if fits { width + 1 } else { 2 } + word.len();
            out += word;
        }
    }
    out + "\n"
}

/// The cases, a list per family.
fn lists() -> String {
    let (mut out, mut family) = (String::new(), "");
    for case in all() {
        if family != case.family {
            family = case.family;
            out += &format!("\n### {}\n\n", family.replace('_', " "));
        }
        out += &item(case);
    }
    out + "\n"
}

#[test]
fn docs_list_every_case() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/stability.md");
    let committed = std::fs::read_to_string(&path).unwrap();
    let (before, rest) = committed.split_once(BEGIN).expect("the begin of the cases");
    let (_, after) = rest.split_once(END).expect("their end");
    let page = format!("{before}{BEGIN}{}{END}{after}", lists());
    if std::env::var_os("ASPERITY_WRITE_STABILITY").is_some() {
        std::fs::write(&path, &page).unwrap();
        return;
    }
    assert!(committed == page, "docs/stability.md is stale; write it anew with: make stability-docs");
}

#[test]
fn case_names_are_unique_and_texts_end_without_full_stop() {
    let all = all();
    for (i, case) in all.iter().enumerate() {
        assert!(all[..i].iter().all(|c| c.name != case.name), "two cases are called {}", case.name);
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        assert!(case.name.chars().all(plain), "{}", case.name);
        for text in [case.hard, case.must] {
            let good = !text.is_empty() && !text.ends_with('.') && !text.contains('\n');
            assert!(good, "{}: {text}", case.name);
        }
    }
}
