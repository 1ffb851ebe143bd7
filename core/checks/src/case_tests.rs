use crate::{cases, node_cases};

#[test]
fn case_names_are_unique_and_texts_end_without_full_stop() {
    let all: Vec<_> = cases().into_iter().chain(node_cases()).collect();
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
