//! Suggestions for names that are not there.

/// The name most like `wanted`, if any is like it at all.
pub fn nearest<'a>(wanted: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let wanted = wanted.to_lowercase();
    names
        .into_iter()
        .map(|n| (strsim::damerau_levenshtein(&wanted, &n.to_lowercase()), n))
        .filter(|(d, n)| *d <= 1 + n.chars().count().max(wanted.chars().count()) / 3)
        .min_by_key(|(d, _)| *d)
        .map(|(_, n)| n)
}

/// Help for an unknown name: the nearest one if there is one, else the list of them all.
pub fn one_of<'a>(wanted: &str, names: impl IntoIterator<Item = &'a str> + Clone) -> String {
    if let Some(n) = nearest(wanted, names.clone()) {
        return format!("did you mean `{n}`?");
    }
    let all: Vec<_> = names.into_iter().map(|n| format!("`{n}`")).collect();
    match all.len() {
        0 => "there are none".into(),
        1 => format!("there is only {}", all[0]),
        _ => format!("there are {}", all.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_misspelt_name_finds_its_neighbour() {
        assert_eq!(nearest("overlap_ad", ["spsi", "overlap_add"]), Some("overlap_add"));
        assert_eq!(nearest("Velocty", ["velocity", "gain"]), Some("velocity"));
        assert_eq!(nearest("zzzzzz", ["velocity", "gain"]), None);
    }
}
