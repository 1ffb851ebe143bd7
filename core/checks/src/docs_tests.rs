//! docs/stability.md tells every case there is, in the cases' own sentences.

use std::path::Path;

use crate::cases;

const BEGIN: &str = "<!-- cases: written by `make stability-docs` -->\n";
const END: &str = "<!-- end of cases -->\n";

/// The cases, a table a family.
fn tables() -> String {
    let (mut out, mut family) = (String::new(), None);
    for case in cases() {
        if family != Some(case.family) {
            family = Some(case.family);
            out += &format!(
                "\n### {}\n\n| case | what is hard | what must hold |\n|---|---|---|\n",
                case.family.name().replace('_', " ")
            );
        }
        let told = |text: &str| text.replace('|', "\\|");
        let graph = if case.of_graph { "" } else { " *" };
        out += &format!("| `{}`{graph} | {} | {} |\n", case.name, told(case.hard), told(case.must));
    }
    out + "\n"
}

#[test]
fn the_committed_page_tells_every_case() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/stability.md");
    let committed = std::fs::read_to_string(&path).unwrap();
    let (before, rest) = committed.split_once(BEGIN).expect("where the cases begin");
    let (_, after) = rest.split_once(END).expect("where they end");
    let page = format!("{before}{BEGIN}{}{END}{after}", tables());
    if std::env::var_os("ASPERITY_WRITE_STABILITY").is_some() {
        std::fs::write(&path, &page).unwrap();
        return;
    }
    assert!(committed == page, "docs/stability.md is stale; write it anew with: make stability-docs");
}

#[test]
fn case_names_are_unique_and_sentences_without_full_stop() {
    let all = cases();
    for (i, case) in all.iter().enumerate() {
        assert!(all[..i].iter().all(|c| c.name != case.name), "two cases are called {}", case.name);
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        assert!(case.name.chars().all(plain), "{}", case.name);
        for text in [case.hard, case.must] {
            assert!(
                !text.is_empty() && !text.ends_with('.') && !text.contains('\n'),
                "{}: {text}",
                case.name
            );
        }
    }
}
