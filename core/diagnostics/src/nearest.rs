//! Suggestions for unknown names.

/// Longest name for which suggestions are made: the search takes the product of both lengths.
const LONGEST: usize = 80;

/// The name most similar to `wanted`, if any is similar.
pub fn nearest<'a>(wanted: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let wanted = wanted.to_lowercase();
    let length = wanted.chars().count();
    if length > LONGEST {
        return None;
    }
    let distance = |n: &str| {
        let other = n.chars().count();
        let most = 1 + other.max(length) / 3;
        // Names differ by at least the difference of their lengths.
        let alike = || strsim::damerau_levenshtein(&wanted, &n.to_lowercase());
        (other.abs_diff(length) <= most).then(alike).filter(|d| *d <= most)
    };
    names.into_iter().filter_map(|n| Some((distance(n)?, n))).min_by_key(|(d, _)| *d).map(|(_, n)| n)
}

/// Most names that are listed.
const MOST: usize = 100;

/// Help for an unknown name: the nearest one if there is one, else a list of all, or of the first ones.
pub fn one_of<'a>(wanted: &str, names: impl IntoIterator<Item = &'a str> + Clone) -> String {
    if let Some(n) = nearest(wanted, names.clone()) {
        return format!("did you mean `{n}`?");
    }
    let count = names.clone().into_iter().count();
    let all: Vec<_> = names.into_iter().take(MOST).map(|n| format!("`{n}`")).collect();
    match count {
        0 => "there are none".into(),
        1 => format!("there is only {}", all[0]),
        _ if count > MOST => format!("there are {}, and {} more", all.join(", "), count - MOST),
        _ => format!("there are {}", all.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn misspelt_name_finds_its_neighbour() {
        assert_eq!(nearest("overlap_ad", ["spsi", "overlap_add"]), Some("overlap_add"));
        assert_eq!(nearest("Velocty", ["velocity", "gain"]), Some("velocity"));
        assert_eq!(nearest("zzzzzz", ["velocity", "gain"]), None);
    }

    #[test]
    fn long_list_of_names_is_cut() {
        let names: Vec<String> = (0..5000).map(|i| format!("n{i}")).collect();
        let help = one_of("zzzzzzzz", names.iter().map(String::as_str));
        assert!(help.ends_with("`n98`, `n99`, and 4900 more") && help.len() < 1000, "{help}");
        assert_eq!(one_of("zzzzzzzz", ["a", "b"]), "there are `a`, `b`");
    }
}
