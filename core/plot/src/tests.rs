//! A check that tests of all pictures use.

use std::collections::HashMap;

/// Counts the opening tags of a document. Checks that its tags are nested and its coordinates are numbers.
pub(super) fn tags(svg: &str) -> HashMap<String, usize> {
    let (mut open, mut count) = (Vec::new(), HashMap::new());
    for part in svg.split('<').skip(1) {
        let (tag, _) = part.split_once('>').expect("every tag ends");
        let name =
            tag.split([' ', '/', '\n']).find(|s| !s.is_empty()).expect("every tag has a name").to_owned();
        if tag.starts_with('/') {
            assert_eq!(open.pop(), Some(name));
            continue;
        }
        assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
        *count.entry(name.clone()).or_insert(0) += 1;
        if !tag.ends_with('/') {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "{open:?}");
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "no coordinate is out of numbers");
    count
}
