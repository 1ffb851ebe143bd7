//! Suggestions for unknown names.

use std::cmp::Reverse;

/// Longest name for which suggestions are made: the search takes the product of both lengths.
const LONGEST: usize = 80;

/// Shortest text that is looked for within names.
const SHORTEST: usize = 3;

/// Most names that are suggested.
const MOST_NEAR: usize = 5;

/// The name most similar to `wanted`, if any is similar.
pub fn nearest<'a>(wanted: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    near(wanted, names).first().copied()
}

/// The names most similar to `wanted`, and names that contain it; the nearest first.
fn near<'a>(wanted: &str, names: impl IntoIterator<Item = &'a str>) -> Vec<&'a str> {
    let wanted = wanted.to_lowercase();
    let length = wanted.chars().count();
    if length > LONGEST {
        return Vec::new();
    }
    let within = |n: &str| length >= SHORTEST && n.to_lowercase().contains(&wanted);
    let distance = |n: &str| {
        let other = n.chars().count();
        let most = 1 + other.max(length) / 3;
        // Names differ by at least the difference of their lengths.
        let alike = || strsim::damerau_levenshtein(&wanted, &n.to_lowercase());
        (other.abs_diff(length) <= most).then(alike).filter(|d| *d <= most)
    };
    let judged = names.into_iter().map(|n| (distance(n), within(n), n));
    let mut near: Vec<_> = judged.filter(|(d, within, _)| d.is_some() || *within).collect();
    let least = near.iter().filter_map(|(d, ..)| *d).min();
    near.retain(|(d, within, _)| *within || *d == least);
    near.sort_by_key(|(d, within, _)| (Reverse(*within), d.unwrap_or(usize::MAX)));
    near.into_iter().take(MOST_NEAR).map(|(.., n)| n).collect()
}

/// Most names that are listed.
const MOST: usize = 100;

/// Help for an unknown name: the nearest ones if there are any, else a list of all, or of the first ones.
pub fn one_of<'a>(wanted: &str, names: impl IntoIterator<Item = &'a str> + Clone) -> String {
    if let Some((last, others)) = near(wanted, names.clone()).split_last() {
        let others: Vec<_> = others.iter().map(|n| format!("`{n}`")).collect();
        let or = if others.is_empty() { "" } else { " or " };
        return format!("did you mean {}{or}`{last}`?", others.join(", "));
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
    fn part_of_a_name_finds_all_that_contain_it() {
        let names = ["oak", "float glass", "grass", "sand-blasted glass"];
        assert_eq!(one_of("glass", names), "did you mean `float glass`, `sand-blasted glass` or `grass`?");
        assert_eq!(one_of("oka", names), "did you mean `oak`?");
    }

    #[test]
    fn long_list_of_names_is_cut() {
        let names: Vec<String> = (0..5000).map(|i| format!("n{i}")).collect();
        let help = one_of("zzzzzzzz", names.iter().map(String::as_str));
        assert!(help.ends_with("`n98`, `n99`, and 4900 more") && help.len() < 1000, "{help}");
        assert_eq!(one_of("zzzzzzzz", ["a", "b"]), "there are `a`, `b`");
    }
}
