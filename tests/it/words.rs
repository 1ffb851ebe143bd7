//! Plain words: no long sentences, no clauses that must be read twice.
//!
//! It reads the pages, the texts of the program, and the doc comments of its sources. All `--help` is on
//! the page `docs/reference/commands.md`.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use harness::root;
use regex::Regex;

/// Most words of a sentence.
const MOST: usize = 30;
/// Most words of a cell of a table.
const MOST_IN_CELL: usize = 25;
/// Pages to read, separated by spaces, instead of all.
const PAGES: &str = "ASPERITY_PAGES";

/// Clauses that stand for a noun, and words that this project once had for a textbook's term. Questions and
/// headings may have them.
const PATTERNS: &[&str] = &[
    r"\b(of|by|to|for|from|with|in|on|at|than|over|after|into|without|but|except|is|are|and|or|not) what\b",
    r"\b(behind|beside) what\b",
    r"^What\b",
    r"\bwhat (is|are|was|were|comes|has|it|they|there)\b",
    r"\bsays? what\b",
    r"^So long\b",
    r"\bsays the\b",
    r"\bto be trusted\b|\bbe had\b",
    r"\b(undominated|told apart|warned of|it likes|as is of)\b",
    r"\b(is|are|was|were) told\b",
    r"\bcomes? of it\b",
    r"\b(for ever|by turns|held to)\b",
];

/// A paragraph, an item of a list or a cell of a table: lines with their numbers.
struct Block {
    lines: Vec<(usize, String)>,
    cell: bool,
    heading: bool,
}

/// The blocks of a Markdown text. Code between fences and comments are left out.
fn blocks<'t>(lines: impl Iterator<Item = (usize, &'t str)>) -> Vec<Block> {
    let mut all: Vec<Block> = Vec::new();
    let (mut fenced, mut commented, mut open) = (false, false, false);
    for (number, line) in lines {
        let line = line.trim();
        if line.starts_with("```") {
            (fenced, open) = (!fenced, false);
        } else if !fenced && (commented || line.starts_with("<!--")) {
            (commented, open) = (!line.contains("-->"), false);
        } else if fenced || line.is_empty() {
            open = false;
        } else if let Some(row) = line.strip_prefix('|') {
            open = false;
            let cells = row.trim_end_matches('|').split('|').map(str::trim);
            let words = cells.filter(|cell| cell.contains(|c: char| c.is_alphanumeric()));
            all.extend(words.map(|cell| Block {
                lines: vec![(number, cell.to_owned())],
                cell: true,
                heading: false,
            }));
        } else {
            let marker = line.split(' ').next().unwrap_or_default();
            let ordered = marker.strip_suffix('.').is_some_and(|n| n.parse::<u32>().is_ok());
            let heading = marker.starts_with('#');
            let begins = heading || ordered || matches!(marker, "-" | "*" | ">");
            let text = if begins { line[marker.len()..].trim() } else { line };
            let entry = (number, text.to_owned());
            match all.last_mut() {
                Some(block) if open && !begins => block.lines.push(entry),
                _ => all.push(Block { lines: vec![entry], cell: false, heading }),
            }
            open = !heading;
        }
    }
    all
}

/// Words that are no sentence's end.
const ABBREVIATIONS: &[&str] = &["e.g.", "i.e.", "al.", "vs.", "Fig.", "etc."];

/// The sentences of a block, each with its line. Lists in code's docs are divided by `;` and `:` as well.
fn sentences(block: &Block, ends: &[char]) -> Vec<(usize, String)> {
    let mut all: Vec<(usize, String)> = Vec::new();
    let mut ended = true;
    for (line, text) in &block.lines {
        for word in text.split_whitespace() {
            if ended {
                all.push((*line, String::new()));
            }
            if let Some((_, sentence)) = all.last_mut() {
                let _ = write!(sentence, "{}{word}", if ended { "" } else { " " });
            }
            let bare = word.trim_end_matches(['"', '\'', ')', '*', '_', ']']);
            ended = bare.ends_with(ends) && !ABBREVIATIONS.contains(&bare);
        }
    }
    all
}

/// Looks for faults, and lists them with their places.
struct Reader {
    patterns: Vec<Regex>,
    code: Regex,
    faults: Vec<String>,
    sentences: usize,
}

impl Reader {
    fn new() -> Self {
        let regex = |p: &str| Regex::new(&format!("(?-u){p}")).expect("a pattern");
        let patterns = PATTERNS.iter().map(|p| regex(p)).collect();
        // Code, places of links, and values of formatted texts count as one word or none.
        let code = regex(r"`[ -_a-~]*`|\]\([!-~]*\)|\{[ -|~]*\}");
        Self { patterns, code, faults: Vec::new(), sentences: 0 }
    }

    fn read<'t>(&mut self, file: &str, lines: impl Iterator<Item = (usize, &'t str)>, ends: &[char]) {
        for block in blocks(lines) {
            let most = if block.cell { MOST_IN_CELL } else { MOST };
            for (line, sentence) in sentences(&block, ends) {
                self.sentences += 1;
                let plain = self.code.replace_all(&sentence, "code");
                let words = plain.split(' ').filter(|w| w.contains(|c: char| c.is_alphanumeric())).count();
                let mut fault = |why: String| self.faults.push(format!("{file}:{line}: {why}: {sentence}"));
                if words > most {
                    fault(format!("{words} words"));
                }
                let judged = !block.heading && !plain.ends_with('?');
                let patterns = self.patterns.iter().filter(|_| judged);
                if let Some(found) = patterns.filter_map(|pattern| pattern.find(&plain)).next() {
                    fault(format!("not plain, \"{}\"", found.as_str()));
                }
            }
        }
    }

    #[track_caller]
    fn ends(self, least: usize) {
        assert!(self.sentences >= least, "only {} sentences were found", self.sentences);
        let count = self.faults.len();
        assert!(count == 0, "{count} sentences are not plain:\n{}", self.faults.join("\n"));
    }
}

/// Files of the repository, by patterns of Git.
fn files(patterns: &[&str]) -> Vec<String> {
    let mut git = Command::new("git");
    git.current_dir(root()).args(["ls-files", "-co", "--exclude-standard"]).args(patterns);
    let output = git.output().expect("git");
    let all = String::from_utf8(output.stdout).expect("names of files");
    all.lines().filter(|name| root().join(name).is_file()).map(str::to_owned).collect()
}

fn text(file: &str) -> String {
    std::fs::read_to_string(root().join(file)).expect(file)
}

const SENTENCE: &[char] = &['.', '!', '?'];

#[test]
fn pages_and_help_are_plain() {
    let pages = match std::env::var(PAGES) {
        Ok(names) => names.split_whitespace().map(str::to_owned).collect(),
        // The report of the shipped trade-off is left out: measurements write it.
        Err(_) => files(&["README.md", "ARCHITECTURE.md", "docs/*.md", ":!docs/tradeoff"]),
    };
    let mut reader = Reader::new();
    for page in pages {
        reader.read(&page, (1..).zip(text(&page).lines()), SENTENCE);
    }
    reader.ends(1);
}

/// Sources of the program without their tests.
fn sources() -> Vec<(String, String)> {
    let is_test = |name: &str| {
        let stem = Path::new(name).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        stem.ends_with("tests") || stem == "testing" || stem == "bench" || name.contains("/tests/")
    };
    let all = files(&["core/*.rs", "hosts/*.rs", "nodes/*.rs", "plugins/*.rs"]);
    let shown = all.into_iter().filter(|name| !is_test(name)).map(|name| {
        let text = text(&name);
        let end = ["", "pub(crate) "]
            .iter()
            .find_map(|p| text.find(&format!("#[cfg(test)]\n{p}mod tests {{")))
            .unwrap_or(text.len());
        (name, text[..end].to_owned())
    });
    shown.collect()
}

/// The texts of a source, with the numbers of their lines. Raw texts are code of some kind, and left out.
fn texts(source: &str) -> Vec<(usize, String)> {
    let regex = |text: &str| Regex::new(text).expect("a pattern");
    let tokens = regex(r##"(?s)r#".*?"#|r"[^"]*"|'\\?"'|//[^\n]*|"([^"\\]|\\.)*""##);
    let joined = regex(r"\\\n[ \t]*");
    let all = tokens.find_iter(source).filter(|found| found.as_str().starts_with('"')).map(|found| {
        let line = 1 + source[..found.start()].matches('\n').count();
        let text = joined.replace_all(found.as_str(), "");
        (line, text.trim_matches('"').replace("\\\"", "\"").replace("\\n", "\n"))
    });
    all.filter(|(_, text)| text.split(' ').count() > 2).collect()
}

#[test]
fn texts_of_the_program_are_plain() {
    let mut reader = Reader::new();
    // The model card is left out: a training that takes hours writes it.
    for (file, source) in sources().into_iter().filter(|(file, _)| !file.ends_with("model_report.rs")) {
        for (line, text) in texts(&source) {
            reader.read(&file, text.lines().map(|it| (line, it)), SENTENCE);
        }
    }
    reader.ends(1000);
}

#[test]
fn doc_comments_are_plain() {
    let mut reader = Reader::new();
    for (file, source) in sources() {
        let lines = source.lines().map(|line| {
            let line = line.trim();
            line.strip_prefix("///").or(line.strip_prefix("//!")).unwrap_or_default()
        });
        reader.read(&file, (1..).zip(lines), &['.', '!', '?', ';', ':']);
    }
    reader.ends(1000);
}

#[test]
fn sentence_that_is_not_plain_is_found() {
    let found = |text: &str| {
        let mut reader = Reader::new();
        reader.read("page.md", (1..).zip(text.lines()), SENTENCE);
        reader.faults
    };
    let long = "one word and ".repeat(11);
    assert!(found(&format!("Short.\n{long}\nends. Short."))[0].starts_with("page.md:2: 34 words: one"));
    assert!(found(&format!("| {long} | b |"))[0].contains("33 words"));
    for text in ["It is a folder of what comes.", "What is ranked is the load.", "So long it is silent."] {
        assert_eq!(found(text).len(), 1, "{text}");
    }
    let plain = "What is it? See `what is it`.\n\n```\nof what\n```\n<!-- of what -->\n\n# What you need\n";
    assert!(found(plain).is_empty());
}
